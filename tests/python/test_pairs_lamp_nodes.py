"""What the nodes of lamps and of the world read of objects, cameras and the view layer; light that is negative."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
import pytest
from pair_scenes import (
    Tree,
    add_lamp,
    add_object,
    add_plane,
    diffuse,
    glow,
    grid,
    look_down,
    material,
    node_tree,
    set_world,
)
from pairs import Bounds, agree

ACROSS = 6
Builder = Callable[[Tree], Any]


def output_of(kind: str, output: str) -> Builder:
    return lambda tree: tree(kind).outputs[output]


def attribute(kind: str, name: str, output: str = "Color") -> Builder:
    def build(tree: Tree) -> Any:
        node = tree("Attribute", attribute_type=kind, attribute_name=name)
        return next(socket for socket in node.outputs if socket.identifier == output)

    return build


ATTRIBUTES: list[Builder] = [
    *(attribute(kind, "shade") for kind in ("OBJECT", "INSTANCER", "GEOMETRY")),
    attribute("OBJECT", "shade", "Fac"),
    *(attribute(kind, "tint", "Alpha") for kind in ("OBJECT", "INSTANCER")),
    *(attribute(kind, "nobody", "Alpha") for kind in ("OBJECT", "INSTANCER", "GEOMETRY")),
    attribute("OBJECT", "color"),
    attribute("OBJECT", "data.energy", "Fac"),
]
"""Cycles crashes where the camera sees them on lamps, before lamps were objects."""
OTHERS: list[Builder] = [
    *(output_of("ObjectInfo", n) for n in ("Location", "Color", "Alpha", "Object Index", "Material Index", "Random")),
    *(output_of("ParticleInfo", name) for name in ("Random", "Size")),
    attribute("VIEW_LAYER", "shade"),
    attribute("VIEW_LAYER", "shade", "Fac"),
    attribute("VIEW_LAYER", "tint", "Alpha"),
    attribute("VIEW_LAYER", "nobody", "Alpha"),
    attribute("VIEW_LAYER", "weight"),
]
PLACES: list[Builder] = [
    *(output_of("TexCoord", name) for name in ("Window", "Camera", "Generated", "Object", "Normal", "Reflection")),
    *(output_of("CameraData", name) for name in ("View Vector", "View Z Depth", "View Distance")),
    output_of("NewGeometry", "Position"),
    lambda tree: tree(
        "VectorTransform",
        vector_type="POINT",
        convert_from="WORLD",
        convert_to="CAMERA",
        Vector=tree("NewGeometry").outputs["Position"],
    ),
]
BUILDERS = ATTRIBUTES + OTHERS + PLACES


def give_properties(scene: Any, obj: Any) -> None:
    obj["shade"], obj["tint"] = (0.3, 0.6, 0.9), (0.9, 0.5, 0.2, 0.4)
    obj.color, obj.pass_index = (0.2, 0.7, 0.5, 0.6), 2
    layer = scene.view_layers[0]
    layer["shade"], layer["tint"], scene["weight"] = (0.7, 0.2, 0.4), (0.1, 0.2, 0.3, 0.6), 0.5


def add_lamps(scene: Any, builders: list[Builder], across: int, kind: str, **values: Any) -> list[Any]:
    """One lamp for each, shining down on its cell."""
    lamps = []
    for number, (build, place) in enumerate(zip(builders, grid(len(builders), across), strict=True)):
        obj = add_lamp(kind, 2.0, (place[0] + 0.1, place[1], 0.5), **values)
        obj.name = f"Lamp {number}"
        tree = node_tree(obj.data)
        tree("OutputLight", Surface=tree("Emission", Color=build(tree)))
        give_properties(scene, obj)
        lamps.append(obj)
    return lamps


def instance(scene: Any, lamps: list[Any]) -> None:
    """Shows them by an instancer with properties of its own instead."""
    collection = bpy.data.collections.new("Lamps")
    for obj in lamps:
        collection.objects.link(obj)
        scene.collection.objects.unlink(obj)
    instancer = add_object(None, (0.05, 0.03, 0.0))
    instancer.instance_type, instancer.instance_collection = "COLLECTION", collection
    instancer["shade"], instancer.color = (0.8, 0.1, 0.4), (0.9, 0.3, 0.6, 0.8)


@pytest.mark.parametrize("instanced", [False, True])
def test_lamps_that_the_camera_sees(pair_scene: Any, tmp_path: Path, instanced: bool) -> None:
    camera = look_down(pair_scene, ACROSS)
    builders = BUILDERS if bpy.app.version >= (4, 5, 0) else OTHERS + PLACES
    builders = [*builders, output_of("NewGeometry", "Tangent")]
    lamps = add_lamps(pair_scene, builders, ACROSS, "AREA", size=0.6)
    for obj in lamps:
        obj.rotation_euler.x, obj.visible_camera = 3.0, True
    if instanced:
        instance(pair_scene, lamps)
        camera.data.type, camera.data.lens = "PERSP", 100.0
    agree(pair_scene, tmp_path, samples=256, cells=ACROSS, bounds=Bounds(0.005, 0.1))


@pytest.mark.parametrize("part", range(4))
def test_light_of_lamps(pair_scene: Any, tmp_path: Path, part: int) -> None:
    """Spots that light the ground, each a cell."""
    look_down(pair_scene, 3.0).location = (0.1, 0.2, 20.0)
    add_plane(diffuse(), 4.0)
    builders = BUILDERS[part::4]
    lamps = add_lamps(pair_scene, builders, 3, "SPOT", spot_size=0.8, spot_blend=0.3, shadow_soft_size=0.02)
    if part % 2:
        instance(pair_scene, lamps)
    pair_scene.cycles.max_bounces = 0
    agree(pair_scene, tmp_path, samples=256, cells=3, bounds=Bounds(0.04, 0.1))


def tiled(tree: Tree) -> Any:
    """Each builder's colour in a cell of the picture."""
    window = tree("SeparateXYZ", Vector=tree("TexCoord").outputs["Window"])

    def cell(axis: str) -> Any:
        scaled = tree("Math", operation="MULTIPLY", in0=window.outputs[axis], in1=ACROSS)
        return tree("Math", operation="FLOOR", in0=scaled)

    row = tree("Math", operation="MULTIPLY", in0=cell("Y"), in1=ACROSS)
    number = tree("Math", operation="ADD", in0=row, in1=cell("X"))
    total: Any = (0.0, 0.0, 0.0)
    for index, build in enumerate(BUILDERS):
        here = tree("Math", operation="COMPARE", in0=number, in1=index, in2=0.1)
        total = tree("MixRGB", in0=here, in1=total, in2=build(tree)).outputs[0]
    return total


@pytest.mark.parametrize("camera", ["ORTHO", "PERSP", "PANO"])
def test_world(pair_scene: Any, tmp_path: Path, camera: str) -> None:
    """The world is no object; of the view layer it reads what all read."""
    view = look_down(pair_scene, ACROSS)
    view.data.type, view.location, view.rotation_euler = camera, (0.3, 0.4, 2.0), (0.6, 0.2, 0.3)
    if camera == "PANO":
        cycles = view.data.cycles if hasattr(view.data, "cycles") else view.data
        cycles.panorama_type = "EQUIRECTANGULAR"
    set_world(pair_scene, build=tiled)
    give_properties(pair_scene, add_plane(diffuse(), 1.0, location=(0, 0, 50)))
    pair_scene.render.resolution_x = pair_scene.render.resolution_y = 8 * ACROSS
    agree(pair_scene, tmp_path, cells=ACROSS)


@pytest.mark.parametrize("camera", ["PERSP", "PANO"])
def test_camera_space_of_surfaces(pair_scene: Any, tmp_path: Path, camera: str) -> None:
    view = look_down(pair_scene, ACROSS)
    view.data.type, view.location, view.rotation_euler = camera, (0.3, 0.4, 3.0), (0.2, 0.1, 0.3)
    if camera == "PANO":
        cycles = view.data.cycles if hasattr(view.data, "cycles") else view.data
        cycles.panorama_type, cycles.fisheye_fov = "FISHEYE_EQUIDISTANT", 1.5
    else:
        view.data.lens = 20.0
    for build, place in zip(PLACES, grid(len(PLACES), 4), strict=True):
        add_plane(material(lambda tree, build=build: tree("Emission", Color=build(tree))), location=place)
    agree(pair_scene, tmp_path, samples=256, bounds=Bounds(0.01, 0.1))


@pytest.mark.parametrize("kind", ["lamp", "mesh", "world"])
def test_negative_light(pair_scene: Any, tmp_path: Path, kind: str) -> None:
    """Takes from the light of another lamp, more in places than there is."""
    look_down(pair_scene, 2.0)
    add_plane(material(lambda tree: tree("BsdfDiffuse", Color=(0.8, 0.6, 0.4))), 4.0)
    add_lamp("POINT", 10.0, (0.5, 0.0, 0.6), shadow_soft_size=0.1)
    if kind == "lamp":
        add_lamp("POINT", -20.0, (-0.5, 0.0, 0.6), shadow_soft_size=0.1)
    elif kind == "mesh":
        panel = add_plane(glow(1.0, -5.0), 0.3, location=(-0.5, 0.0, 0.6), rotation=(3.1, 0.0, 0.0))
        panel.visible_camera = False
    else:
        set_world(pair_scene, build=lambda tree: tree("Background", Strength=-0.3))
    pair_scene.cycles.max_bounces = 1
    agree(pair_scene, tmp_path, samples=128, bounds=Bounds(0.02, 0.08))
