"""Bounce limits, clamps, caustics and transparency mean the same in Cycles and in Talbot."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from pair_scenes import (
    add_box,
    add_lamp,
    add_mesh,
    add_plane,
    add_sphere,
    change_material,
    diffuse,
    glow,
    grid,
    look_at,
    look_down,
    material,
    set_world,
)
from pairs import Bounds, agree


def cabinet(scene: Any) -> None:
    """A white box, open in front, with a panel of light, a glass ball, a glossy box and a metal ball."""
    look_at(scene, (0.0, -4.2, 1.0), (0.0, 0.0, 1.0), 45.0)
    walls = add_box(diffuse(0.8), (2, 2, 2), inside=True, location=(0, 0, 1))
    walls.data.materials.append(diffuse((0.8, 0.2, 0.1)))
    walls.data.polygons[0].material_index = 1
    front = walls.data.polygons[2]
    hole = [list(p.vertices) for p in walls.data.polygons if p.index != front.index]
    add_mesh([v.co for v in walls.data.vertices], hole, *walls.data.materials, location=(0, 0, 1))
    walls.hide_render = True
    add_plane(glow(1.0, 6.0), 0.8, location=(0, 0, 1.98))
    add_sphere(material(lambda tree: tree("BsdfGlass", IOR=1.45)), 0.35, location=(-0.45, -0.3, 0.36))
    add_sphere(
        material(lambda tree: tree("BsdfGlossy", Roughness=0.3, Color=(0.9, 0.7, 0.4))), 0.3, location=(0.5, 0.3, 0.9)
    )
    add_box(material(lambda tree: tree("BsdfPrincipled", Roughness=0.3)), (0.6, 0.6, 0.5), location=(0.45, 0.2, 0.26))
    cycles = scene.cycles
    cycles.max_bounces, cycles.diffuse_bounces, cycles.glossy_bounces = 4, 4, 4
    cycles.transmission_bounces, cycles.transparent_max_bounces = 8, 8


LIMITS: dict[str, dict[str, Any]] = {
    "direct only": {"max_bounces": 0},
    "one bounce": {"max_bounces": 1},
    "no diffuse": {"diffuse_bounces": 0},
    "no glossy": {"glossy_bounces": 0},
    "no transmission": {"transmission_bounces": 0},
    "one transmission": {"transmission_bounces": 1},
    "roulette late": {"min_light_bounces": 3, "min_transparent_bounces": 3},
    "no reflective caustics": {"caustics_reflective": False},
    "no refractive caustics": {"caustics_refractive": False},
    "filter glossy": {"blur_glossy": 2.0},
    "light threshold": {"light_sampling_threshold": 0.1},
}


@pytest.mark.parametrize("limit", LIMITS)
def test_limits(pair_scene: Any, tmp_path: Path, limit: str) -> None:
    cabinet(pair_scene)
    pair_scene.render.resolution_x = pair_scene.render.resolution_y = 24
    for name, value in LIMITS[limit].items():
        setattr(pair_scene.cycles, name, value)
    agree(pair_scene, tmp_path, samples=64, cells=3, bounds=Bounds(0.03, 0.15))


@pytest.mark.parametrize(("direct", "indirect"), [(0.4, 0.0), (0.0, 0.3), (0.8, 0.2)])
def test_clamps(pair_scene: Any, tmp_path: Path, direct: float, indirect: float) -> None:
    """A floor under a sun without size and glowing balls, beside a mirror.

    A clamp cuts single contributions: only where each has one value it does not depend on how lights are sampled.
    """
    look_at(pair_scene, (0.0, -4.0, 2.0), (0.0, 0.5, 0.5), 35.0)
    add_plane(diffuse((0.8, 0.6, 0.4)), 6.0)
    mirror = material(lambda tree: tree("BsdfGlossy", Roughness=0.0, Color=(0.9, 0.8, 0.7)))
    add_plane(mirror, 3.0, location=(0.0, 1.5, 1.5), rotation=(1.4, 0.0, 0.0))
    unsampled = glow((2.0, 1.0, 0.3), 2.0)
    if hasattr(unsampled.cycles, "emission_sampling"):
        unsampled.cycles.emission_sampling = "NONE"
    else:
        unsampled.cycles.sample_as_light = False
    for x in (-0.8, 0.8):
        add_sphere(unsampled, 0.3, location=(x, 0.3, 0.3))
    add_lamp("SUN", 4.0, (-2, -2, 4), toward=(0, 0, 0), angle=0.0)
    cycles = pair_scene.cycles
    cycles.max_bounces, cycles.diffuse_bounces = 1, 0
    cycles.sample_clamp_direct, cycles.sample_clamp_indirect = direct, indirect
    agree(pair_scene, tmp_path, samples=64)


@pytest.mark.parametrize("limit", [0, 1, 3])
def test_transparent_stacks(pair_scene: Any, tmp_path: Path, limit: int) -> None:
    """Stacks of one to four tinted sheets over a floor, and their shadows."""
    look_down(pair_scene, 4.0)
    add_plane(diffuse(), 8.0)
    for number, place in enumerate(grid(4, 2)):
        for sheet in range(number + 1):
            tint = material(lambda tree: tree("BsdfTransparent", Color=(0.9, 0.7, 0.5)))
            add_plane(tint, 0.9, location=(place[0] * 2 * 0.9, place[1] * 2 * 0.9, 0.3 + 0.2 * sheet))
    add_lamp("SUN", 2.0, (1, 1, 3), toward=(0, 0, 0), angle=0.0)
    set_world(pair_scene, 0.2)
    pair_scene.cycles.transparent_max_bounces, pair_scene.cycles.max_bounces = limit, 2
    agree(pair_scene, tmp_path)


def test_transparent_shadows(pair_scene: Any, tmp_path: Path) -> None:
    """Shadows of sheets: half transparent, chequered and glowing, alpha, switched off (which a volume overrules); and
    Is Shadow Ray."""
    look_down(pair_scene, 4.0, 0.9)
    add_plane(diffuse(), 8.0)
    half = material(lambda t: t("MixShader", in0=0.5, in1=t("BsdfTransparent"), in2=t("BsdfDiffuse")))
    opaque = material(lambda t: t("MixShader", in0=0.5, in1=t("BsdfTransparent"), in2=t("BsdfDiffuse")))
    volume = material(lambda t: t("VolumeAbsorption", Density=1e-6), output="Volume")
    for item in (opaque, volume):
        change_material(item, use_transparent_shadow=False)
    items = [
        half,
        opaque,
        volume,
        material(
            lambda t: t(
                "MixShader", in0=t("TexChecker", Scale=4.0).outputs[1], in1=t("BsdfTransparent"), in2=half_glow(t)
            )
        ),
        material(lambda t: t("BsdfPrincipled", Alpha=0.3, Base_Color=(0.2, 0.8, 0.3))),
        material(
            lambda t: t(
                "MixShader",
                in0=t("LightPath").outputs["Is Shadow Ray"],
                in1=t("BsdfDiffuse"),
                in2=t("BsdfTransparent", Color=(0.3, 0.6, 0.9)),
            )
        ),
    ]
    for item, place in zip(items, grid(6, 3), strict=True):
        add_plane(item, 0.8, location=(place[0] * 1.3, place[1] * 1.3 + 0.5, 1.4))
    add_lamp("SUN", 2.0, (0, 0.4, 3), toward=(0, 0, 0), angle=0.02)
    set_world(pair_scene, 0.1)
    pair_scene.cycles.max_bounces = 2
    agree(pair_scene, tmp_path, samples=64)


def half_glow(tree: Any) -> Any:
    """Matt and glowing."""
    return tree("AddShader", in0=tree("BsdfDiffuse"), in1=tree("Emission", Strength=0.3))


def test_light_paths(pair_scene: Any, tmp_path: Path) -> None:
    """A world and a wall that look different to each kind of ray, and a lamp that only lights the first hit."""
    look_at(pair_scene, (0.0, -5.0, 2.0), (0.0, 0.0, 0.6), 35.0)
    add_plane(diffuse(), 6.0)
    add_sphere(material(lambda tree: tree("BsdfGlossy", Roughness=0.05)), 0.6, location=(-1.0, 0, 0.6))
    add_sphere(material(lambda tree: tree("BsdfGlass", Roughness=0.0)), 0.5, location=(0.6, -0.5, 0.5))

    def seen(tree: Any) -> Any:
        path = tree("LightPath")
        camera = tree("MixRGB", in0=path.outputs["Is Camera Ray"], in1=(0.2, 0.3, 0.8), in2=(0.8, 0.2, 0.2))
        return tree("MixRGB", in0=path.outputs["Is Glossy Ray"], in1=camera, in2=(0.2, 0.9, 0.3))

    set_world(pair_scene, build=seen)
    wall = material(
        lambda t: t(
            "BsdfDiffuse",
            Color=t("MixRGB", in0=t("LightPath").outputs["Is Diffuse Ray"], in1=(0.8, 0.8, 0.2), in2=(0.1, 0.1, 0.9)),
        )
    )
    add_plane(wall, 4.0, location=(0, 2.0, 1.0), rotation=(1.57, 0, 0))
    lamp = add_lamp("POINT", 60, (1.5, -1.0, 2.0), shadow_soft_size=0.2)
    lamp.data.cycles.max_bounces = 0
    pair_scene.cycles.max_bounces = 3
    agree(pair_scene, tmp_path, samples=64, bounds=Bounds(0.02, 0.15))
