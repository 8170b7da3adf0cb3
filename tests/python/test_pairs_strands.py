"""Particle hair, Curves objects and point clouds: shapes and what their info nodes say, in Cycles and in Talbot."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from pair_scenes import (
    Tree,
    add_lamp,
    add_mesh,
    add_object,
    add_plane,
    diffuse,
    look_at,
    material,
    new_geometry_group,
    set_world,
)
from pairs import Bounds, agree

Build = Callable[[Tree], Any]
BOUNDS = Bounds(0.025, 0.06)
"""Thin things: where a fibre covers a pixel is decided by each engine's own intersection, and light leaves thick fibres
and dense tufts elsewhere (addon/sync/README.md)."""


def lit(scene: Any) -> None:
    """Sun and sky, no further bounces."""
    look_at(scene, (2.2, -2.2, 1.8), (0, 0, 0.2))
    add_lamp("SUN", 2.0, (2, -3, 5), toward=(0, 0, 0), angle=0.1)
    set_world(scene, 0.3)
    scene.cycles.max_bounces = 1


def shown(build: Build) -> Any:
    """A material that emits what `build` returns."""
    return material(lambda tree: tree("Emission", Color=build(tree)))


def halved(tree: Tree, socket: Any) -> Any:
    """A direction as a colour."""
    values = {"in1": (0.5, 0.5, 0.5), "in2": (0.5, 0.5, 0.5)}
    return tree("VectorMath", operation="MULTIPLY_ADD", in0=socket, **values).outputs[0]


def hair_on_sheet(item: Any, count: int = 150, **values: Any) -> Any:
    """Hair on a turned square of 10 x 10 faces with a UV map."""
    side = np.linspace(-1, 1, 11)
    vertices = [(x, y, 0.0) for y in side for x in side]
    faces = [(11 * y + x, 11 * y + x + 1, 11 * y + x + 12, 11 * y + x + 11) for y in range(10) for x in range(10)]
    obj = add_mesh(vertices, faces, item, location=(0.1, 0, 0), rotation=(0.1, 0, 0.3))
    layer = obj.data.uv_layers.new(name="UVMap")
    for loop in obj.data.loops:
        x, y, _ = vertices[loop.vertex_index]
        layer.data[loop.index].uv = (x / 2 + 0.5, y / 2 + 0.5)
    obj.modifiers.new("Hair", "PARTICLE_SYSTEM")
    settings = obj.particle_systems[0].settings
    settings.type, settings.count, settings.hair_length = "HAIR", count, 0.6
    settings.root_radius, settings.tip_radius, settings.radius_scale = 1.0, 0.3, 0.1
    for name, value in values.items():
        setattr(settings, name, value)
    return obj


CHILDREN = {
    "none": {},
    "simple": {"count": 20, "child_type": "SIMPLE", "rendered_child_count": 10},
    "interpolated": {
        "count": 30,
        "child_type": "INTERPOLATED",
        "rendered_child_count": 10,
        "kink": "CURL",
        "kink_amplitude": 0.1,
    },
}


@pytest.mark.parametrize("children", CHILDREN)
@pytest.mark.parametrize("shape", ["RIBBONS", "THICK"])
def test_hair(pair_scene: Any, tmp_path: Path, children: str, shape: str) -> None:
    lit(pair_scene)
    pair_scene.cycles_curves.shape = shape
    hair_on_sheet(diffuse((0.8, 0.5, 0.3)), **CHILDREN[children])
    # From 4.0 on some thick strands of Cycles shadow themselves (mottled, while their neighbours are not): up to 8 %.
    brighter = shape == "THICK" and bpy.app.version >= (4, 0, 0)
    bounds = Bounds(0.04, 0.12, 0.08) if brighter else Bounds(0.025, 0.1, 0.02)
    agree(pair_scene, tmp_path, samples=96, batches=8, bounds=bounds)


def hair_info(output: str) -> Build:
    return lambda tree: tree("HairInfo").outputs[output]


TELLS: dict[str, Build] = {
    "intercept": hair_info("Intercept"),
    "length": hair_info("Length"),
    "thickness": lambda tree: tree("Math", operation="MULTIPLY", in0=tree("HairInfo").outputs["Thickness"], in1=20.0),
    "random": hair_info("Random"),
    "is_strand": hair_info("Is Strand"),
    "tangent_normal": lambda tree: halved(tree, tree("HairInfo").outputs["Tangent Normal"]),
    "normal": lambda tree: halved(tree, tree("NewGeometry").outputs["Normal"]),
    "uv": lambda tree: tree("UVMap").outputs[0],
    "generated": lambda tree: tree("TexCoord").outputs["Generated"],
}


@pytest.mark.parametrize("name", TELLS)
def test_what_hair_tells(pair_scene: Any, tmp_path: Path, name: str) -> None:
    look_at(pair_scene, (2.2, -2.2, 1.8), (0, 0, 0.2))
    hair_on_sheet(shown(TELLS[name]))
    agree(pair_scene, tmp_path, samples=64, batches=8, bounds=BOUNDS)


def test_hair_of_instances(pair_scene: Any, tmp_path: Path) -> None:
    """Tufts on the faces of a sheet: hair reads UV and Generated from the instancer."""
    look_at(pair_scene, (2.2, -2.2, 1.8), (0, 0, 0.2))

    def both(tree: Tree) -> Any:
        coordinates = tree("TexCoord")
        coordinates.from_instancer = True
        sum_ = tree("VectorMath", operation="ADD", in0=coordinates.outputs["UV"], in1=coordinates.outputs["Generated"])
        return tree("VectorMath", operation="ADD", in0=sum_.outputs[0], in1=(2.0, 2.0, 2.0)).outputs[0]

    tuft = hair_on_sheet(shown(both), count=40)
    sheet = add_plane(diffuse(0.5), 3.0)
    sheet.modifiers.new("Faces", "SUBSURF").subdivision_type = "SIMPLE"
    sheet.modifiers[0].render_levels = sheet.modifiers[0].levels = 1
    tuft.parent, tuft.scale = sheet, (0.4, 0.4, 0.4)
    sheet.instance_type = "FACES"
    agree(pair_scene, tmp_path, samples=64, batches=8, bounds=BOUNDS)


def curves_object(item: Any, count: int = 80, keys: int = 6) -> Any:
    """Hair curves with radii that stand on the floor."""
    curves = bpy.data.hair_curves.new("Pair")
    if not hasattr(curves, "add_curves"):
        pytest.skip("scripts make curves from 4.3 on")
    random = np.random.default_rng(1)
    positions = np.zeros((count, keys, 3), np.float32)
    positions[:, :, :2] = random.uniform(-1, 1, (count, 1, 2))
    positions[:, :, 2] = np.linspace(0, 1, keys)
    positions[:, :, :2] += np.cumsum(random.normal(0, 0.08, (count, keys, 2)), axis=1)
    curves.add_curves([keys] * count)
    curves.points.foreach_set("position", positions.ravel())
    radius = curves.attributes.get("radius") or curves.attributes.new("radius", "FLOAT", "POINT")
    radius.data.foreach_set("value", np.tile(np.linspace(0.05, 0.01, keys), count).astype(np.float32))
    curves.materials.append(item)
    return add_object(curves)


@pytest.mark.parametrize("shape", ["RIBBONS", "THICK", "THICK_LINEAR", "POLY"])
def test_curves(pair_scene: Any, tmp_path: Path, shape: str) -> None:
    lit(pair_scene)
    add_plane(diffuse(0.6), 4.0)
    obj = curves_object(diffuse((0.8, 0.5, 0.3)))
    if shape == "POLY":
        if not hasattr(obj.data, "set_types"):
            pytest.skip("this Blender's scripts cannot make curves of straight lines")
        obj.data.set_types(type="POLY")
    else:
        try:
            pair_scene.cycles_curves.shape = shape
        except TypeError:
            pytest.skip("thick linear curves came with 5.0")
    agree(pair_scene, tmp_path, samples=96, batches=8, bounds=BOUNDS)


def points_group(item: Any) -> Any:
    """Geometry nodes: a mesh's vertices as points, their radii from an attribute."""
    group, given, result = new_geometry_group("Points")
    nodes, link = group.nodes, group.links.new
    points, named = nodes.new("GeometryNodeMeshToPoints"), nodes.new("GeometryNodeInputNamedAttribute")
    named.inputs[0].default_value = "size"
    paint = nodes.new("GeometryNodeSetMaterial")
    paint.inputs["Material"].default_value = item
    link(given.outputs[0], points.inputs["Mesh"])
    link(next(s for s in named.outputs if s.name == "Attribute" and s.type == "VALUE"), points.inputs["Radius"])
    link(points.outputs[0], paint.inputs[0])
    link(paint.outputs[0], result.inputs[0])
    return group


def point_info(output: str) -> Build:
    return lambda tree: tree("PointInfo").outputs[output]


POINTS: dict[str, Callable[[], Any]] = {
    "matt": lambda: diffuse((0.8, 0.5, 0.3)),
    "glass": lambda: material(lambda tree: tree("BsdfGlass", Roughness=0.3)),
    "random": lambda: shown(point_info("Random")),
    "radius": lambda: shown(point_info("Radius")),
    "position": lambda: shown(point_info("Position")),
}


@pytest.mark.parametrize("kind", POINTS)
def test_points(pair_scene: Any, tmp_path: Path, kind: str) -> None:
    lit(pair_scene)
    item = POINTS[kind]()
    random = np.random.default_rng(3)
    obj = add_mesh(random.uniform(-1, 1, (60, 3)), [], item)
    size = obj.data.attributes.new("size", "FLOAT", "POINT")
    size.data.foreach_set("value", random.uniform(0.03, 0.2, 60).astype(np.float32))
    obj.modifiers.new("Points", "NODES").node_group = points_group(item)
    add_plane(diffuse(0.6), 8.0, location=(0, 0, -1))
    if kind == "glass":
        pair_scene.cycles.max_bounces = 4
    bounds = Bounds(0.03, 0.3) if kind == "glass" else BOUNDS
    agree(pair_scene, tmp_path, samples=256, batches=8, bounds=bounds)
