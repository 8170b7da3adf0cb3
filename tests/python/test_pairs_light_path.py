"""What Light Path says of the ways to lamps, suns, emitting meshes and the world, and of shadows on the way."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
import pytest
from pair_scenes import SIZE, Tree, add_lamp, add_plane, diffuse, look_down, material, node_tree, set_world
from pairs import Bounds, agree
from test_pairs_links import linking

OUTPUTS = [
    "Is Camera Ray",
    "Is Shadow Ray",
    "Is Diffuse Ray",
    "Is Glossy Ray",
    "Is Singular Ray",
    "Is Reflection Ray",
    "Is Transmission Ray",
    "Ray Depth",
    "Diffuse Depth",
    "Glossy Depth",
    "Transparent Depth",
    "Transmission Depth",
    "Ray Length",
]
EMITTERS = ["world", "SUN", "AREA", "POINT", "mesh"]


def told(tree: Tree, far: bool) -> Any:
    """A colour of all outputs, each with weights of its own; without the length of endless rays."""
    path = tree("LightPath")
    channels = []
    for channel in range(3):
        total: Any = 0.05
        for number, name in enumerate(OUTPUTS[:-1] if far else OUTPUTS):
            weight = 0.02 * (1 + number * (3 * channel + 1) % 13)
            scaled = tree("Math", operation="MULTIPLY", in0=path.outputs[name], in1=weight)
            total = tree("Math", operation="ADD", in0=scaled, in1=total)
        channels.append(total)
    return tree("CombineXYZ", X=channels[0], Y=channels[1], Z=channels[2])


def add_emitter(scene: Any, kind: str, height: float, up: bool) -> Any:
    """Above the origin, or the world. The object, where it is one."""
    if kind == "world":
        set_world(scene, build=lambda tree: tree("Background", Color=told(tree, True)))
        return None
    turned = (3.14159, 0.0, 0.0) if up else (0.0, 0.0, 0.0)
    if kind == "mesh":
        item = material(lambda tree: tree("Emission", Color=told(tree, False), Strength=2.0))
        return add_plane(item, 1.0, location=(0, 0, height), rotation=turned)
    size = {"SUN": {"angle": 0.5}, "AREA": {"size": 1.0}, "POINT": {"shadow_soft_size": 0.4}}[kind]
    obj = add_lamp(kind, 2.0 if kind == "SUN" else 10.0, (0, 0, height), **size)
    obj.rotation_euler, obj.visible_camera = turned, True
    tree = node_tree(obj.data)
    tree("OutputLight", Surface=tree("Emission", Color=told(tree, kind == "SUN")))
    return obj


@pytest.mark.parametrize("way", ["straight", "mirror", "glass", "veil"])
@pytest.mark.parametrize("kind", EMITTERS)
def test_what_rays_find(pair_scene: Any, tmp_path: Path, kind: str, way: str) -> None:
    """Straight on; in a mirror; through clear glass and what is transparent behind it; through transparent layers."""
    view = look_down(pair_scene, 0.2, 3.0)
    if way == "mirror":
        view.location.z = 1.0
        add_plane(material(lambda tree: tree("BsdfGlossy", Roughness=0.0)), 4.0)
    for height, layer in ((2.0, "glass"), (1.5, "veil"), (1.0, "veil")):
        if way == "glass" and layer == "glass":
            clear = material(lambda tree: tree("BsdfRefraction", Roughness=0.0, IOR=1.0))
            add_plane(clear, 4.0, location=(0, 0, height))
        elif way in ("glass", "veil") and layer == "veil":
            veil = material(lambda tree: tree("BsdfTransparent", Color=(0.9, 0.8, 0.7)))
            add_plane(veil, 4.0, location=(0, 0, height))
    add_emitter(pair_scene, kind, 2.0 if way == "mirror" else 0.0, up=way != "mirror")
    pair_scene.render.resolution_x = pair_scene.render.resolution_y = SIZE // 4
    # The first sample of a delta refraction is lost in Cycles: its random number is 0.
    samples, bound = (256, 0.01) if way == "glass" else (16, 0.005)
    bounds = Bounds(bound, 0.04, systematic=0.006 if way == "glass" else 1e-3)
    agree(pair_scene, tmp_path, samples=samples, batches=8, cells=2, bounds=bounds)


@pytest.mark.parametrize("way", ["straight", "mirror"])
@pytest.mark.parametrize("kind", EMITTERS)
def test_light_samples(pair_scene: Any, tmp_path: Path, kind: str, way: str) -> None:
    """The light on matt ground, also as a mirror shows it."""
    view = look_down(pair_scene, 0.2, 0.8)
    if way == "straight":
        add_plane(diffuse(), 1.0)
        add_emitter(pair_scene, kind, 1.0, up=False)
    else:
        add_plane(material(lambda tree: tree("BsdfGlossy", Roughness=0.0)), 0.4)
        add_plane(diffuse(), 1.0, location=(0, 0, 1), rotation=(3.14159, 0, 0))
        add_emitter(pair_scene, kind, -1.0, up=True)
        view.data.clip_start = 0.01
    pair_scene.render.resolution_x = pair_scene.render.resolution_y = SIZE // 4
    agree(pair_scene, tmp_path, samples=512, cells=2, bounds=Bounds(0.03, 0.06))


def test_shadows_by_ray_length(pair_scene: Any, tmp_path: Path) -> None:
    """Layers that let through less the longer the ray is, from where it began, for shadows and for the camera."""

    def layer(tree: Tree) -> Any:
        length = tree("Math", operation="MULTIPLY", in0=tree("LightPath").outputs["Ray Length"], in1=0.2)
        black = tree("BsdfDiffuse", Color=(0, 0, 0))
        return tree("MixShader", in0=length, in1=tree("BsdfTransparent"), in2=black)

    look_down(pair_scene, 2.0, 1.5)
    add_plane(diffuse(), 4.0)
    for height in (0.5, 1.0, 2.0):
        add_plane(material(layer), 4.0, location=(0, 0, height))
    add_lamp("SUN", 3.0, (0, 0, 3), angle=0.0)
    pair_scene.cycles.max_bounces = 0
    agree(pair_scene, tmp_path, bounds=Bounds(0.01, 0.05))


@pytest.mark.skipif(bpy.app.version < (4, 2, 0), reason="light linking came with 4.0")
@pytest.mark.parametrize("roughness", [0.0, 0.3])
@pytest.mark.parametrize("kind", ["SUN", "AREA", "mesh"])
def test_what_rays_find_with_blockers(pair_scene: Any, tmp_path: Path, kind: str, roughness: float) -> None:
    """An emitter whose shadows are linked is found by rays of its own. What they and light samples see differs, so the
    weights between the two are seen: of rough mirrors 0.7 %."""
    look_down(pair_scene, 0.2, 3.0).location.z = 1.0
    add_plane(material(lambda tree: tree("BsdfGlossy", Roughness=roughness)), 4.0)
    other = add_plane(diffuse(), 0.1, location=(5.0, 0.0, 0.0))
    lamp = add_emitter(pair_scene, kind, 2.5, False)
    lamp.visible_camera = False
    lamp.light_linking.blocker_collection = linking([(other, "INCLUDE")])
    pair_scene.cycles.max_bounces = 2
    agree(pair_scene, tmp_path, samples=256, batches=8, bounds=Bounds(0.012, 0.1, systematic=0.01))
