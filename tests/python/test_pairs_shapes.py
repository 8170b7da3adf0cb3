"""Objects that become meshes, and what meshes tell shaders, in Cycles and in Talbot."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from pair_scenes import (
    Tree,
    add_box,
    add_lamp,
    add_mesh,
    add_object,
    add_plane,
    add_sphere,
    animate,
    diffuse,
    glow,
    grid,
    look_at,
    look_down,
    material,
    new_geometry_group,
    open_shutter,
    set_custom_normals,
    set_world,
)
from pairs import Bounds, agree


def halved(tree: Tree, socket: Any) -> Any:
    """A direction or place as a colour."""
    half = (0.5, 0.5, 0.5)
    return tree("VectorMath", operation="MULTIPLY_ADD", in0=socket, in1=half, in2=half).outputs[0]


def telling(output: str) -> Any:
    """A material that emits a texture coordinate."""
    return material(lambda tree: halved(tree, tree("TexCoord").outputs[output]))


def add_curve(item: Any, points: Any, kind: str = "BEZIER", **values: Any) -> Any:
    """A curve object through points; `values` are properties of the curve."""
    curve = bpy.data.curves.new("Pair", "CURVE")
    curve.dimensions = "3D"
    spline = curve.splines.new(kind)
    holders = spline.bezier_points if kind == "BEZIER" else spline.points
    holders.add(len(points) - 1)
    for holder, point in zip(holders, points, strict=True):
        holder.co = point if kind == "BEZIER" else (*point, 1.0)
        if kind == "BEZIER":
            holder.handle_left_type = holder.handle_right_type = "AUTO"
    for number, holder in enumerate(holders):
        holder.radius, holder.tilt = 1.0 - 0.15 * number, 0.3 * number
    for name, value in values.items():
        setattr(curve, name, value)
    curve.materials.append(item)
    return add_object(curve)


def add_text(item: Any, **values: Any) -> Any:
    """The letters "Ag", big."""
    text = bpy.data.curves.new("Pair", "FONT")
    text.body, text.size, text.align_x, text.align_y = "Ag", 1.0, "CENTER", "CENTER"
    for name, value in values.items():
        setattr(text, name, value)
    text.materials.append(item)
    return add_object(text)


def add_surface(item: Any) -> Any:
    """A bent NURBS patch."""
    surface = bpy.data.curves.new("Pair", "SURFACE")
    surface.dimensions = "3D"
    for row in range(4):
        spline = surface.splines.new("NURBS")
        spline.points.add(3)
        for column, point in enumerate(spline.points):
            point.co = (column / 3 - 0.5, row / 3 - 0.5, 0.4 * math.sin(row + column), 1.0)
            point.select = True
    surface.materials.append(item)
    obj = add_object(surface)
    bpy.context.view_layer.objects.active = obj
    obj.select_set(True)
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.curve.make_segment()
    bpy.ops.object.mode_set(mode="OBJECT")
    return obj


def add_family(item: Any) -> list[Any]:
    """Two balls of metal that flow together: the first of the family has the shape."""
    out = []
    for x in (-0.2, 0.25):
        ball = bpy.data.metaballs.new("Family")
        ball.render_resolution = ball.resolution = 0.12
        ball.elements.new().radius = 0.45
        ball.materials.append(item)
        obj = add_object(ball)
        obj.name = "Family" if not out else "Family.001"
        obj.location = (x, 0.1 * x, 0.0)
        out.append(obj)
    return out


WAVE = [(-0.4, -0.2, 0.0), (-0.1, 0.3, 0.1), (0.2, -0.2, 0.2), (0.4, 0.3, 0.0)]


def shapes(item: Any) -> list[Any]:
    """Everything that Blender turns into a mesh; the metaballs come last, two objects."""
    taper = add_curve(item, [(0, 1.0, 0), (0.5, 0.3, 0), (1, 0.8, 0)], "POLY")
    taper.hide_render = True
    square = add_curve(item, [(-0.1, -0.05, 0), (0.1, -0.05, 0), (0.0, 0.1, 0)], "POLY")
    square.data.splines[0].use_cyclic_u, square.hide_render = True, True
    profile = {"bevel_mode": "OBJECT", "bevel_object": square, "use_fill_caps": True}
    return [
        add_curve(item, WAVE, bevel_depth=0.06, bevel_resolution=3),
        add_curve(item, WAVE, "NURBS", bevel_depth=0.08, taper_object=taper, use_fill_caps=True),
        add_curve(item, WAVE, **profile),
        add_curve(item, WAVE, "POLY", extrude=0.1, bevel_depth=0.03, offset=0.05),
        add_text(item, extrude=0.1, bevel_depth=0.02),
        add_text(item, shear=0.3, space_character=1.2),
        add_surface(item),
        *add_family(item),
    ]


def lay_out(objects: list[Any]) -> None:
    """On a grid of 3 x 3, all turned the same way; a family of metaballs in one cell."""
    places = grid(9, 3)
    for number, obj in enumerate(objects):
        place = places[min(number, 7)]
        obj.location = [a + b for a, b in zip(obj.location, place, strict=True)]
        if obj.type != "META":
            obj.rotation_euler = (0.4, 0.3, 0.2)
            obj.scale = (0.9, 0.7, 1.1)


@pytest.mark.parametrize("shown", ["matt", "Generated", "UV", "Normal", "Object"])
def test_what_becomes_a_mesh(pair_scene: Any, tmp_path: Path, shown: str) -> None:
    """Curves with bevel, taper, profile and extrusion, text, a NURBS patch, metaballs; and their coordinates."""
    look_down(pair_scene, 3.0)
    lay_out(shapes(diffuse((0.8, 0.5, 0.3)) if shown == "matt" else telling(shown)))
    if shown == "matt":
        add_lamp("SUN", 2.0, (3, -2, 4), toward=(0, 0, 0), angle=0.1)
        set_world(pair_scene, (0.2, 0.25, 0.3))
        pair_scene.cycles.max_bounces = 1
    # Thin things: where the samples lie in a pixel makes the noise.
    agree(pair_scene, tmp_path, samples=128, batches=8, cells=3, bounds=Bounds(0.01, 0.05))


def test_normals_under_uneven_scale(pair_scene: Any, tmp_path: Path) -> None:
    """Coarse smooth balls: normals are interpolated after the scale where the mesh is used once and stands still, else
    before it. Alone, mirrored, with custom normals, sharing their mesh, moving, deforming, bumped by a map."""
    look_down(pair_scene, 3.0)
    item, places = material(lambda tree: halved(tree, tree("NewGeometry").outputs["Normal"])), grid(9, 3)
    mapped = material(lambda tree: halved(tree, tree("NormalMap", Color=(0.7, 0.4, 0.9)).outputs["Normal"]))
    balls = [add_sphere(mapped if place is places[1] else item, segments=6, location=place) for place in places]
    for ball in balls:
        ball.rotation_euler, ball.scale = (0.5, 0.4, 0.2), (1.0, 0.3, 0.6)
    uv = balls[1].data.uv_layers.new(name="UVMap").data
    for loop in balls[1].data.loops:
        uv[loop.index].uv = balls[1].data.vertices[loop.vertex_index].co.xy
    balls[2].scale.x = -1.0
    balls[4].data = balls[3].data
    balls[5].scale = (0.8, 0.8, 0.8)
    open_shutter(pair_scene)
    animate(balls[6], "rotation_euler", (4, (0.5, 0.4, 0.2)), (6, (0.5, 0.4, 0.3)))
    # Until 3.5 Cycles leaves the normals of what deforms shorter than one.
    balls[7].shape_key_add(name="Basis")
    key = balls[7].shape_key_add(name="Moved", from_mix=False)
    for point in key.data:
        point.co.x *= 1.2
    if bpy.app.version >= (3, 6, 0):
        animate(key, "value", (4, 0.0), (6, 1.0))
    pair_scene.frame_set(5)
    set_custom_normals(balls[8])
    agree(pair_scene, tmp_path, samples=64, batches=8, cells=3, bounds=Bounds(0.01, 0.05))


def test_texture_spaces(pair_scene: Any, tmp_path: Path) -> None:
    """Generated coordinates where the texture space is set by hand, before modifiers, with shape keys."""
    look_down(pair_scene, 2.0)
    objects = [add_box(telling("Generated"), (0.7, 0.5, 0.6), location=place) for place in grid(4, 2)]
    for obj in objects:
        obj.rotation_euler = (0.5, 0.4, 0.2)
    by_hand, bent, _, sparse = (obj.data for obj in objects)
    for owner in (by_hand, bent):
        owner.use_auto_texspace = False
    if hasattr(by_hand, "texspace_location"):
        by_hand.texspace_location, by_hand.texspace_size = (0.2, 0.1, 0.0), (0.5, 0.2, 0.8)
        bent.texspace_size = (0.3, 0.5, 0.4)
    modifier = objects[1].modifiers.new("Cast", "CAST")
    modifier.factor = 0.8
    objects[2].shape_key_add(name="Basis")
    key = objects[2].shape_key_add(name="Moved")
    for point in key.data:
        point.co = point.co * 1.3
    key.value = 1.0
    sparse.vertices[0].co.x -= 0.2
    agree(pair_scene, tmp_path, samples=64, batches=8, cells=2, bounds=Bounds(0.01, 0.05))


def test_meshes_without_faces(pair_scene: Any, tmp_path: Path) -> None:
    """Loose vertices and edges show nothing, beside a face and alone."""
    look_down(pair_scene, 2.0)
    for number, place in enumerate(grid(4, 2)):
        mesh = bpy.data.meshes.new("Pair")
        points = [(-0.4, -0.4, 0), (0.4, -0.4, 0), (0.0, 0.1, 0), (-0.4, 0.4, 0), (0.4, 0.4, 0)]
        mesh.from_pydata(
            points[: 1 if number == 2 else 5],
            [(3, 4)] if number < 2 else [],
            [(0, 1, 2)] if number in (0, 3) else [],
        )
        mesh.materials.append(glow((1.0, 0.5, 0.2)))
        mesh.update()
        obj = add_object(mesh, place)
        if number == 1:
            obj.modifiers.new("Subdivision", "SUBSURF")
    agree(pair_scene, tmp_path, samples=64, batches=8, cells=2, bounds=Bounds(0.01, 0.05))


ATTRIBUTES = [
    ("FLOAT", "POINT"),
    ("FLOAT", "EDGE"),
    ("FLOAT", "FACE"),
    ("FLOAT", "CORNER"),
    ("FLOAT_VECTOR", "FACE"),
    ("FLOAT_VECTOR", "EDGE"),
    ("FLOAT2", "POINT"),
    ("FLOAT2", "FACE"),
    ("FLOAT_COLOR", "FACE"),
    ("FLOAT_COLOR", "CORNER"),
    ("BYTE_COLOR", "POINT"),
    ("BYTE_COLOR", "FACE"),
    ("INT", "POINT"),
    ("INT", "FACE"),
    ("INT8" if bpy.app.version >= (4, 0, 0) else "INT", "CORNER"),
    ("BOOLEAN", "FACE"),
]
"""Cycles before 4.0 has no small integers."""
FIELDS = {
    "FLOAT_VECTOR": ("vector", 3),
    "FLOAT2": ("vector", 2),
    "FLOAT_COLOR": ("color", 4),
    "BYTE_COLOR": ("color", 4),
    "QUATERNION": ("value", 4),
    "INT32_2D": ("value", 2),
    "INT16_2D": ("value", 2),
}


NEWER_ATTRIBUTES = [
    (kind, domain)
    for kind in ("QUATERNION", "INT32_2D", "INT16_2D")
    for domain in ("POINT", "EDGE", "FACE", "CORNER")
    if (kind, domain) != ("QUATERNION", "EDGE")  # vertices get their mean turn in Cycles, the mean of the numbers here
    if kind in bpy.types.Attribute.bl_rna.properties["data_type"].enum_items
]


@pytest.mark.parametrize("newer", [False, True])
@pytest.mark.parametrize("output", ["Color", "Vector", "Fac", "Alpha"])
def test_attributes(pair_scene: Any, tmp_path: Path, output: str, newer: bool) -> None:
    """Every type in every domain that people use, read by name from a mesh of a quad, a pentagon and a triangle."""
    kinds = NEWER_ATTRIBUTES if newer else ATTRIBUTES
    if not kinds:
        pytest.skip("not in this Blender")
    look_down(pair_scene, 4.0)
    random = np.random.default_rng(5)
    points = [
        (-0.4, -0.4, 0),
        (0.1, -0.4, 0),
        (0.1, 0.2, 0),
        (-0.4, 0.2, 0),
        (0.4, -0.2, 0),
        (0.4, 0.3, 0),
        (0, 0.4, 0),
    ]
    faces = [(0, 1, 2, 3), (1, 4, 5, 6, 2), (3, 2, 6)]
    item = material(lambda tree: halved(tree, tree("Attribute", attribute_name="Told").outputs[output]))
    for (kind, domain), place in zip(kinds, grid(16, 4), strict=False):
        mesh = add_mesh(points, faces, item, location=place).data
        layer = mesh.attributes.new("Told", kind, domain)
        name, width = FIELDS.get(kind, ("value", 1))
        values = random.random(width * len(layer.data))
        if kind.startswith(("INT", "BOOLEAN")):
            values = np.floor(values * 2)
        layer.data.foreach_set(name, values.astype(np.int32 if kind.startswith(("INT", "BOOLEAN")) else np.float32))
    agree(pair_scene, tmp_path, samples=64, batches=8, bounds=Bounds(0.01, 0.05))


def info(output: str) -> Callable[[Tree], Any]:
    return lambda tree: tree("ObjectInfo").outputs[output]


def properties(kind: str, name: str) -> Callable[[Tree], Any]:
    return lambda tree: tree("Attribute", attribute_type=kind, attribute_name=name).outputs["Color"]


def wrapped(tree: Tree, socket: Any) -> Any:
    """The fraction of a large number."""
    return tree("Math", operation="FRACT", in0=tree("Math", operation="MULTIPLY", in0=socket, in1=0.37))


OF_OBJECTS: list[Callable[[Tree], Any]] = [
    info("Color"),
    info("Random"),
    lambda tree: wrapped(tree, info("Object Index")(tree)),
    lambda tree: wrapped(tree, info("Material Index")(tree)),
    lambda tree: halved(tree, info("Location")(tree)),
    lambda tree: info("Alpha")(tree),
    lambda tree: tree("NewGeometry").outputs["Random Per Island"],
    properties("OBJECT", "shade"),
    properties("INSTANCER", "shade"),
    properties("OBJECT", "color"),
    properties("OBJECT", "location"),
    properties("OBJECT", "data.shade"),
    properties("VIEW_LAYER", "shade"),
    lambda tree: halved(tree, tree("TexCoord", from_instancer=True).outputs["Generated"]),
    lambda tree: halved(tree, tree("UVMap", from_instancer=True).outputs[0]),
    lambda tree: halved(tree, tree("VectorTransform", convert_from="OBJECT", convert_to="WORLD", Vector=(1, 0.5, 0.2))),
]


def islands(item: Any) -> Any:
    """Three loose triangles, two of them joined at one corner."""
    points = [(-0.4, -0.4, 0), (0, -0.4, 0), (-0.2, 0, 0), (0.2, 0, 0), (0, 0.4, 0), (0.1, -0.4, 0), (0.4, -0.4, 0)]
    obj = add_mesh([*points, (0.4, 0.3, 0)], [(0, 1, 2), (2, 3, 4), (5, 6, 7)], item)
    obj["shade"], obj.data["shade"] = (0.3, 0.6, 0.9), 0.4
    obj.color, obj.pass_index = (0.2, 0.7, 0.5, 0.6), 5
    return obj


@pytest.mark.parametrize("instanced", ["no", "faces", "nodes"])
def test_what_objects_tell(pair_scene: Any, tmp_path: Path, instanced: str) -> None:
    """Colour, index, random numbers, custom properties of the object, its data, its instancer and the view layer."""
    look_down(pair_scene, 4.0)
    pair_scene.view_layers[0]["shade"] = (0.7, 0.2, 0.4)
    for number, (build, place) in enumerate(zip(OF_OBJECTS, grid(16, 4), strict=True)):
        item = material(build)
        item.pass_index = number + 2
        obj = islands(item)
        if instanced == "no":
            obj.location = place
            continue
        square = [(-0.4, -0.4, 0.1), (0.4, -0.4, 0.1), (0.4, 0.4, 0.1), (-0.4, 0.4, 0.1)]
        parent = add_mesh(square, [(0, 1, 2, 3)], item, location=place)
        parent["shade"] = (0.1 * number, 0.5, 0.2)
        parent.data.uv_layers.new(name="UVMap").data.foreach_set("uv", (0.2, 0.1, 0.6, 0.1, 0.6, 0.5, 0.2, 0.5))
        if instanced == "faces":
            parent.instance_type, parent.show_instancer_for_render = "FACES", False
            obj.parent = parent
        else:
            obj.location = (0, 0, 21)
            parent.modifiers.new("Scatter", "NODES").node_group = on_faces(obj)
    agree(pair_scene, tmp_path, samples=256, batches=8, bounds=Bounds(0.01, 0.05))


def on_faces(shape: Any) -> Any:
    """Geometry nodes: the object once in the middle, from the mean of the points."""
    group, given, result = new_geometry_group("Scatter")
    nodes, link = group.nodes, group.links.new
    instance, other = nodes.new("GeometryNodeInstanceOnPoints"), nodes.new("GeometryNodeObjectInfo")
    middle = nodes.new("GeometryNodeMeshToPoints")
    middle.mode = "FACES"
    other.inputs["Object"].default_value, other.inputs["As Instance"].default_value = shape, True
    link(given.outputs[0], middle.inputs["Mesh"])
    link(middle.outputs[0], instance.inputs["Points"])
    link(other.outputs["Geometry"], instance.inputs["Instance"])
    link(instance.outputs[0], result.inputs[0])
    return group


def test_shadow_terminator(pair_scene: Any, tmp_path: Path) -> None:
    """Coarse smooth balls with both offsets, none and much."""
    look_at(pair_scene, (0.0, -5.0, 2.0), (0.0, 0.0, 0.0), 45.0)
    grey = diffuse(0.7)
    for number, (shading, geometry) in enumerate(((0.0, 0.0), (0.0, 0.1), (0.4, 0.1), (0.2, 0.6))):
        ball = add_sphere(grey, 0.42, segments=8, location=(number - 1.5, 0.0, 0.0))
        if hasattr(ball, "shadow_terminator_shading_offset"):
            ball.shadow_terminator_shading_offset = shading
            ball.shadow_terminator_geometry_offset = geometry
        else:
            ball.cycles.shadow_terminator_offset = shading
            ball.cycles.shadow_terminator_geometry_offset = geometry
    add_plane(diffuse(0.5), 6.0, location=(0, 0, -0.5))
    add_lamp("SUN", 3.0, (4, -1, 2), toward=(0, 0, 0), angle=0.05)
    pair_scene.cycles.max_bounces = 0
    agree(pair_scene, tmp_path, samples=64, batches=8, bounds=Bounds(0.01, 0.05))
