"""Shadow catchers: the pass and the composed picture agree with Cycles'."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from pair_scenes import (
    add_box,
    add_lamp,
    add_plane,
    add_sphere,
    diffuse,
    glow,
    look_at,
    material,
    set_world,
)
from pairs import Bounds, agree


def ball_on_catcher(scene: Any) -> Any:
    """A red ball and a glowing box on a catcher, under a lamp and the sky."""
    look_at(scene, (0.0, -5.0, 3.0), (0.0, 0.0, 0.3), 40.0)
    catcher = add_plane(diffuse((0.6, 0.5, 0.4)), 6.0)
    catcher.is_shadow_catcher = True
    add_sphere(diffuse((0.8, 0.2, 0.1)), 0.5, location=(-0.6, 0.0, 0.5))
    add_box(glow((0.2, 0.5, 1.0), 2.0), (0.5, 0.5, 0.5), location=(0.9, 0.2, 0.25))
    add_lamp("AREA", 150, (1.0, -2.0, 3.0), toward=(0.0, 0.0, 0.0), shape="SQUARE", size=0.8)
    set_world(scene, (0.2, 0.25, 0.3))
    scene.cycles.max_bounces = 2
    return catcher


@pytest.mark.parametrize("transparent", [False, True])
@pytest.mark.parametrize("wants_pass", [False, True])
def test_catcher(pair_scene: Any, tmp_path: Path, transparent: bool, wants_pass: bool) -> None:
    ball_on_catcher(pair_scene)
    pair_scene.render.film_transparent = transparent
    pair_scene.view_layers[0].cycles.use_pass_shadow_catcher = wants_pass
    passes = ("Combined", "Shadow Catcher") if wants_pass else ("Combined",)
    agree(pair_scene, tmp_path, samples=64, bounds=Bounds(0.02, 0.1), passes=passes)


def test_catcher_behind_a_pane(pair_scene: Any, tmp_path: Path) -> None:
    """Seen through a tinted, transparent pane; the catcher is glossy."""
    catcher = ball_on_catcher(pair_scene)
    pane = add_plane(material(lambda tree: tree("BsdfTransparent", Color=(0.5, 0.9, 0.6))), 1.5)
    pane.location, pane.rotation_euler = (0.3, -1.5, 1.0), (1.2, 0.0, 0.0)
    catcher.data.materials[0] = material(lambda tree: tree("BsdfGlossy", Roughness=0.5))
    pair_scene.render.film_transparent = True
    agree(pair_scene, tmp_path, samples=128, bounds=Bounds(0.02, 0.1))


@pytest.mark.parametrize("transparent", [False, True])
@pytest.mark.parametrize("wants_pass", [False, True])
def test_half_transparent_catcher(pair_scene: Any, tmp_path: Path, transparent: bool, wants_pass: bool) -> None:
    """What the catcher lets through counts with it and without it: over the film's edge, and over a floor below."""

    def half(tree: Any) -> Any:
        mix = tree("MixShader", in0=0.5)
        for number, node in ((1, tree("BsdfTransparent", Color=(1, 1, 1))), (2, tree("BsdfDiffuse", Color=0.6))):
            tree.tree.links.new(node.outputs[0], mix.inputs[number])
        return mix

    catcher = ball_on_catcher(pair_scene)
    catcher.data.materials[0] = material(half)
    add_plane(diffuse((0.1, 0.5, 0.9)), 2.0, location=(1.0, 0.0, -0.5))
    pair_scene.render.film_transparent = transparent
    pair_scene.view_layers[0].cycles.use_pass_shadow_catcher = wants_pass
    passes = ("Combined", "Shadow Catcher") if wants_pass else ("Combined",)
    agree(pair_scene, tmp_path, samples=64, bounds=Bounds(0.02, 0.1), passes=passes)


def test_light_that_is_not_real(pair_scene: Any, tmp_path: Path) -> None:
    """A lamp that is no shadow catcher brightens the catcher's pass."""
    ball_on_catcher(pair_scene)
    lamp = add_lamp("POINT", 60, (-1.5, -1.0, 1.5), shadow_soft_size=0.1)
    lamp.is_shadow_catcher = False
    pair_scene.view_layers[0].cycles.use_pass_shadow_catcher = True
    agree(pair_scene, tmp_path, samples=64, bounds=Bounds(0.02, 0.1), passes=("Combined", "Shadow Catcher"))
