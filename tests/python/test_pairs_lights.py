"""Lamps, emitting meshes and worlds light the same scene in Cycles and in Talbot."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from pair_scenes import (
    add_box,
    add_lamp,
    add_mesh,
    add_plane,
    add_sphere,
    diffuse,
    glow,
    image_of,
    look_at,
    look_down,
    material,
    node_tree,
    set_world,
)
from pairs import Bounds, agree

Lamps = list[Callable[[tuple[float, float]], Any]]


def lamp(kind: str, energy: float, height: float = 0.6, **values: Any) -> Callable[[tuple[float, float]], Any]:
    """A lamp in the middle of a cell; `lean` tilts it, `rescale` scales the object."""
    lean, scale = values.pop("lean", (0.0, 0.0, 0.0)), values.pop("rescale", (1.0, 1.0, 1.0))

    def add(middle: tuple[float, float]) -> Any:
        obj = add_lamp(kind, energy, (*middle, height), **values)
        obj.rotation_euler, obj.scale = lean, scale
        return obj

    return add


CELLS: dict[str, Lamps] = {
    "points": [
        lamp("POINT", 10, shadow_soft_size=0.0),
        lamp("POINT", 10, shadow_soft_size=0.1),
        lamp("POINT", 10, shadow_soft_size=0.3, color=(1.0, 0.3, 0.1)),
        lamp("POINT", 10, shadow_soft_size=0.1, rescale=(2.0, 0.5, 3.0)),
    ],
    "spots": [
        lamp("SPOT", 30, spot_size=0.8, spot_blend=0.0, shadow_soft_size=0.0),
        lamp("SPOT", 30, spot_size=1.2, spot_blend=1.0, shadow_soft_size=0.02),
        lamp("SPOT", 30, spot_size=1.0, spot_blend=0.3, shadow_soft_size=0.1, lean=(0.5, 0.3, 0.0)),
        lamp("SPOT", 30, spot_size=3.0, spot_blend=0.15, shadow_soft_size=0.05, rescale=(2.0, 0.7, 1.0)),
    ],
    "areas": [
        lamp("AREA", 5, shape="SQUARE", size=0.3),
        lamp("AREA", 5, shape="RECTANGLE", size=0.6, size_y=0.2, lean=(0.4, 0.0, 0.0)),
        lamp("AREA", 5, shape="DISK", size=0.5),
        lamp("AREA", 5, shape="ELLIPSE", size=0.6, size_y=0.3, lean=(0.0, 0.4, 0.7)),
    ],
    "area spread": [
        lamp("AREA", 3, shape="SQUARE", size=0.3, spread=1.5),
        lamp("AREA", 3, shape="RECTANGLE", size=0.5, size_y=0.2, spread=0.7, rescale=(1.5, 0.5, 1.0)),
        lamp("AREA", 3, shape="DISK", size=0.4, spread=2.5),
        lamp("AREA", 2, shape="ELLIPSE", size=0.4, size_y=0.2, spread=0.6),
    ],
}


def rooms(scene: Any, lamps: Lamps) -> None:
    """Four rooms with black walls, a lamp and a small box in each."""
    look_down(scene, 2.0)
    grey, black = diffuse(), diffuse(0.0)
    add_plane(grey, 2.0)
    for number, add in enumerate(lamps):
        middle = (number % 2 - 0.5, number // 2 - 0.5)
        add(middle)
        add_box(grey, (0.2, 0.2, 0.2), location=(middle[0] + 0.25, middle[1] + 0.2, 0.1))
    for wall in (((-1, 0, 0), (1, 0, 0), (1, 0, 2), (-1, 0, 2)), ((0, -1, 0), (0, 1, 0), (0, 1, 2), (0, -1, 2))):
        add_mesh(wall, [(0, 1, 2, 3)], black)


@pytest.mark.parametrize("kind", CELLS)
def test_lamps(pair_scene: Any, tmp_path: Path, kind: str) -> None:
    rooms(pair_scene, CELLS[kind])
    pair_scene.cycles.max_bounces = 0
    agree(pair_scene, tmp_path, samples=128 if kind == "area spread" else 32, bounds=Bounds(0.02, 0.08))


def test_lamps_with_bounces(pair_scene: Any, tmp_path: Path) -> None:
    rooms(pair_scene, [CELLS[kind][1] for kind in CELLS])
    pair_scene.cycles.max_bounces = 2
    agree(pair_scene, tmp_path, samples=128, bounds=Bounds(0.02, 0.08))


def test_lamps_that_the_camera_and_mirrors_see(pair_scene: Any, tmp_path: Path) -> None:
    """A point, a spot, a disk and a rectangle over a mirror; one of them is hidden from the camera."""
    mirror = material(lambda tree: tree("BsdfGlossy", Roughness=0.0))
    look_at(pair_scene, (0.0, -4.0, 2.0), (0.0, 0.0, 0.5), 40.0)
    add_plane(mirror, 6.0)
    lamps = [
        add_lamp("POINT", 20, (-1.2, 0.0, 1.0), shadow_soft_size=0.3),
        add_lamp("SPOT", 20, (-0.4, 0.0, 1.0), toward=(-0.4, -4.0, 1.0), shadow_soft_size=0.2),
        add_lamp("AREA", 10, (0.4, 0.0, 1.0), toward=(0.4, -4.0, 1.0), shape="DISK", size=0.5),
        add_lamp("AREA", 10, (1.2, 0.0, 1.0), toward=(1.2, -4.0, 1.0), shape="RECTANGLE", size=0.5, size_y=0.3),
    ]
    for obj in lamps:
        obj.visible_camera = obj is not lamps[2]
    agree(pair_scene, tmp_path, bounds=Bounds(0.01, 0.08))


@pytest.mark.parametrize("option", ["", "no shadow", "no MIS"])
def test_lamp_options(pair_scene: Any, tmp_path: Path, option: str) -> None:
    """On glossy and matt ground, where sampling the light and the surface share the work."""
    options: dict[str, Any] = {}
    if option == "no shadow":
        # 5.0 keeps the switch in the lamp, 3.4 with Cycles.
        options = {"use_shadow": False, "cycles_cast_shadow": False}
    elif option == "no MIS":
        options = {"cycles_use_multiple_importance_sampling": False}
    lamps = [
        lamp("AREA", 5, shape="SQUARE", size=0.4, **options),
        lamp("POINT", 10, shadow_soft_size=0.2, **options),
        lamp("SPOT", 20, shadow_soft_size=0.2, spot_size=2.0, **options),
        lamp("AREA", 5, shape="ELLIPSE", size=0.4, size_y=0.3, **options),
    ]
    rooms(pair_scene, lamps)
    glossy = material(lambda tree: tree("BsdfGlossy", Roughness=0.4))
    add_plane(glossy, 2.0, location=(0.0, 0.0, 0.01))
    pair_scene.cycles.max_bounces = 1
    agree(pair_scene, tmp_path, bounds=Bounds(0.02, 0.08))


@pytest.mark.skipif("exposure" not in bpy.types.Light.bl_rna.properties, reason="newer properties of lamps")
def test_newer_units(pair_scene: Any, tmp_path: Path) -> None:
    """Exposure, temperature, no division by the area, true spheres."""
    lamps = [
        lamp("POINT", 2, shadow_soft_size=0.2, exposure=2.0, use_soft_falloff=False),
        lamp("SPOT", 5, spot_size=1.5, shadow_soft_size=0.15, normalize=False, exposure=1.0, use_soft_falloff=False),
        lamp(
            "AREA", 6, shape="RECTANGLE", size=0.5, size_y=0.3, normalize=False, use_temperature=True, temperature=3000
        ),
        lamp("AREA", 5, shape="DISK", size=0.4, use_temperature=True, temperature=9000, exposure=-0.5),
    ]
    rooms(pair_scene, lamps)
    pair_scene.cycles.max_bounces = 0
    agree(pair_scene, tmp_path, bounds=Bounds(0.02, 0.08))


@pytest.mark.parametrize("output", ["UV", "Generated", "Object", "Reflection", "Parametric"])
def test_pictures_on_lamps(pair_scene: Any, tmp_path: Path, output: str) -> None:
    """What the shader of a lamp reads where light leaves it, seen by matt ground and a mirror."""
    if output == "Parametric" and bpy.app.version < (4, 0, 0):
        pytest.skip("round lamps had other ones")
    lamps = [
        lamp("AREA", 5, shape="RECTANGLE", size=0.5, size_y=0.3, lean=(0.3, 0.0, 0.4)),
        lamp("AREA", 5, shape="DISK", size=0.5),
        lamp("POINT", 10, shadow_soft_size=0.15),
        lamp("SPOT", 20, shadow_soft_size=0.1, spot_size=2.0, lean=(0.0, 0.3, 0.2)),
    ]
    rooms(pair_scene, lamps)
    for light in bpy.data.lights:
        tree = node_tree(light)
        source = tree("NewGeometry" if output == "Parametric" else "TexCoord").outputs[output]
        half = (0.5, 0.5, 0.5)
        color = tree("VectorMath", operation="MULTIPLY_ADD", in0=source, in1=half, in2=half)
        tree("OutputLight", Surface=tree("Emission", Color=color.outputs[0], Strength=1.5))
    add_plane(material(lambda tree: tree("BsdfGlossy", Roughness=0.2)), 2.0, location=(0.0, 1.0, 0.01))
    pair_scene.cycles.max_bounces = 1
    agree(pair_scene, tmp_path, samples=64, bounds=Bounds(0.02, 0.08))


def test_lamp_nodes(pair_scene: Any, tmp_path: Path) -> None:
    """Light Output with colours that depend on the direction."""
    lamps = [
        lamp("POINT", 10, shadow_soft_size=0.1),
        lamp("SPOT", 30, spot_size=1.5),
        lamp("AREA", 5, shape="SQUARE", size=0.3),
        lamp("AREA", 5, shape="DISK", size=0.3, spread=2.0),
    ]
    rooms(pair_scene, lamps)
    for light in bpy.data.lights:
        tree = node_tree(light)
        checker = tree("TexChecker", Vector=tree("TexCoord").outputs["Normal"], Color1=(1, 0.2, 0.1), Scale=3.0)
        emission = tree("Emission", Color=checker.outputs["Color"], Strength=1.5)
        tree("OutputLight", Surface=emission)
    pair_scene.cycles.max_bounces = 0
    agree(pair_scene, tmp_path, bounds=Bounds(0.02, 0.08))


def test_photometric_lamps(pair_scene: Any, tmp_path: Path) -> None:
    """Measured intensities by direction (IES), full circles and a quarter, on lamps of each kind, turned and scaled."""
    lamps = [
        lamp("POINT", 10, shadow_soft_size=0.15, lean=(0.3, 0.2, 0.5)),
        lamp("POINT", 10, shadow_soft_size=0.2),
        lamp("SPOT", 30, spot_size=2.0, shadow_soft_size=0.1, lean=(0.2, -0.3, 0.4), rescale=(1.0, 0.6, 1.0)),
        lamp("AREA", 5, shape="RECTANGLE", size=0.4, size_y=0.2, lean=(0.3, 0.0, 0.6)),
    ]
    rooms(pair_scene, lamps)
    circle = "1 1000 1 5 5 1 2 0 0 0\n1 1 100\n0 30 60 90 180\n0 90 180 270 360\n" + "".join(
        f"900 {600 - 100 * side} {300 + 90 * side} 100 50\n" for side in (0, 1, 2, 1, 0)
    )
    quarter = "1 1000 1 4 3 1 2 0 0 0\n1 1 100\n0 20 50 90\n0 45 90\n900 800 300 0\n900 500 200 0\n900 200 100 0\n"
    for number, light in enumerate(bpy.data.lights):
        text = bpy.data.texts.new("ies")
        text.write("IESNA:LM-63-1995\nTILT=NONE\n" + (quarter if number == 1 else circle))
        tree = node_tree(light)
        tree("OutputLight", Surface=tree("Emission", Strength=tree("TexIES", mode="INTERNAL", ies=text).outputs[0]))
    pair_scene.cycles.max_bounces = 0
    agree(pair_scene, tmp_path, samples=64, bounds=Bounds(0.02, 0.08))


@pytest.mark.parametrize("output", ["Quadratic", "Linear", "Constant"])
def test_falloff(pair_scene: Any, tmp_path: Path, output: str) -> None:
    """Light Falloff on lamps and on a panel, with and without smoothing."""
    lamps = [
        lamp("POINT", 4, shadow_soft_size=0.1),
        lamp("SPOT", 9, spot_size=1.5, shadow_soft_size=0.05),
        lamp("AREA", 3, shape="SQUARE", size=0.3),
    ]
    rooms(pair_scene, lamps)

    def falloff(tree: Any, smooth: float) -> Any:
        return tree("LightFalloff", Strength=1.5, Smooth=smooth).outputs[output]

    for number, light in enumerate(bpy.data.lights):
        tree = node_tree(light)
        tree("OutputLight", Surface=tree("Emission", Strength=falloff(tree, 0.2 * number)))
    panel = material(lambda tree: tree("Emission", Strength=falloff(tree, 0.1)))
    add_plane(panel, 0.3, location=(0.5, 0.5, 0.6), rotation=(3.1, 0.0, 0.0)).visible_camera = False
    pair_scene.cycles.max_bounces = 0
    agree(pair_scene, tmp_path, samples=64, bounds=Bounds(0.02, 0.08))


@pytest.mark.parametrize("kind", ["lamps", "triangles", "panels"])
def test_many(pair_scene: Any, tmp_path: Path, kind: str) -> None:
    """As many emitters as a tree chooses among."""
    look_at(pair_scene, (0, -9, 6), (0, 0, 0), 40.0)
    add_plane(diffuse(), 12.0)
    random = np.random.default_rng(7)
    for x, y in random.uniform(-4, 4, (8, 2)):
        add_box(diffuse(), (0.8, 0.8, 1.2), location=(x, y, 0.6))
    places = np.append(random.uniform(-5, 5, (150, 2)), random.uniform(0.4, 2.0, (150, 1)), axis=1)
    if kind == "triangles":
        corners = (places[:, None] + random.normal(0, 0.1, (150, 3, 3))).reshape(-1, 3)
        add_mesh(corners, np.arange(450).reshape(-1, 3), glow(1.0, 15.0)).visible_camera = False
    for place in places if kind != "triangles" else ():
        color, strength = random.uniform(0.2, 1.0, 3), random.lognormal()
        if kind == "lamps":
            add_lamp("POINT", 4 * strength, place, shadow_soft_size=0.05, color=color)
        else:
            panel = add_plane(glow(tuple(color), 6 * strength), 0.2, location=place, rotation=random.uniform(-3, 3, 3))
            panel.visible_camera = False
    pair_scene.cycles.max_bounces = 1
    # 3.4 chooses among them all alike.
    bounds = Bounds(0.02, 0.15) if bpy.app.version >= (3, 5, 0) else Bounds(0.04, 0.3)
    agree(pair_scene, tmp_path, samples=96, bounds=bounds)


@pytest.mark.parametrize("angle", [0.0, 0.2, 1.5])
def test_sun(pair_scene: Any, tmp_path: Path, angle: float) -> None:
    """Half of the ground is glossy and sees the disc."""
    look_at(pair_scene, (0.0, -4.0, 3.0))
    add_plane(diffuse(), 6.0)
    add_plane(material(lambda tree: tree("BsdfGlossy", Roughness=0.3)), 2.0, location=(1.0, 0.0, 0.01))
    add_box(diffuse((0.8, 0.4, 0.2)), (0.7, 0.7, 1.0), location=(-0.6, 0.3, 0.5))
    add_lamp("SUN", 3.0, (2.0, 3.0, 4.0), toward=(0, 0, 0), angle=angle, color=(1.0, 0.9, 0.7))
    pair_scene.cycles.max_bounces = 1
    agree(pair_scene, tmp_path)


def test_emitting_meshes(pair_scene: Any, tmp_path: Path) -> None:
    """A ball, a panel seen from its back, a textured panel, and one that is too weak for light sampling."""
    look_at(pair_scene, (0.0, -5.0, 3.0))
    add_plane(diffuse(), 6.0)
    add_sphere(glow((1.0, 0.5, 0.2), 4.0), 0.3, segments=12, location=(-1.0, 0.0, 0.6))
    add_plane(glow(1.0, 3.0), 0.6, location=(0.6, 0.3, 0.8), rotation=(0.4, 0.3, 0.0))
    checkered = material(lambda t: t("Emission", Color=t("TexChecker", Scale=4.0).outputs["Color"], Strength=5.0))
    add_plane(checkered, 0.6, location=(1.2, -0.4, 0.3), rotation=(1.2, 0.0, 0.9))
    add_sphere(glow((0.2, 0.5, 1.0), 0.3), 0.3, segments=12, location=(0.0, -0.8, 0.3))
    pair_scene.cycles.max_bounces = 2
    agree(pair_scene, tmp_path, samples=64, bounds=Bounds(0.02, 0.08))


def open_ground(scene: Any) -> None:
    """A ball, a mirror ball and a box on the ground under the sky."""
    look_at(scene, (0.0, -5.0, 2.0), (0.0, 0.0, 0.6), 30.0)
    add_plane(diffuse(), 20.0)
    add_sphere(diffuse((0.8, 0.3, 0.2)), 0.6, location=(-1.0, 0.0, 0.6))
    add_sphere(material(lambda tree: tree("BsdfGlossy", Roughness=0.0)), 0.6, location=(1.0, 0.0, 0.6))
    add_box(material(lambda tree: tree("BsdfGlossy", Roughness=0.5)), location=(0.0, 1.5, 0.5))
    scene.cycles.max_bounces = 2


def test_world_colour(pair_scene: Any, tmp_path: Path) -> None:
    open_ground(pair_scene)
    set_world(pair_scene, (0.3, 0.5, 0.9))
    agree(pair_scene, tmp_path)


def sky_image() -> Any:
    """A horizon, a bright patch and a dim one."""
    height, width = 32, 64
    pixels = np.ones((height, width, 4))
    up = (np.arange(height) + 0.5) / height
    pixels[..., 0], pixels[..., 1], pixels[..., 2] = 0.3, 0.2 + 0.2 * up[:, None], 0.2 + 0.6 * up[:, None]
    pixels[22:24, 40:43, :3] = (40, 30, 20)
    pixels[18:26, 8:12, :3] = (0, 3, 5)
    return image_of(pixels)


@pytest.mark.parametrize("method", ["MANUAL", "NONE"])
def test_hdri(pair_scene: Any, tmp_path: Path, method: str) -> None:
    open_ground(pair_scene)
    world = set_world(pair_scene, build=lambda tree: tree("TexEnvironment", image=sky_image()))
    world.cycles.sampling_method = method
    bounds = Bounds(0.05, 0.2) if method == "NONE" else Bounds(0.01, 0.06)
    agree(pair_scene, tmp_path, samples=128, bounds=bounds)


def test_world_visibility(pair_scene: Any, tmp_path: Path) -> None:
    """The sky that mirrors do not show, and that the camera sees."""
    open_ground(pair_scene)
    world = set_world(pair_scene, (0.3, 0.5, 0.9))
    world.cycles_visibility.glossy = False
    agree(pair_scene, tmp_path)
