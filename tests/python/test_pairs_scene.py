"""Meshes as modifiers leave them, and every way to instance them, in Cycles and in Talbot."""

from __future__ import annotations

import math
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
    diffuse,
    glow,
    grid,
    look_at,
    look_down,
    material,
    new_geometry_group,
    set_custom_normals,
    set_world,
    sphere_shape,
)
from pairs import Bounds, agree


def lit(scene: Any) -> None:
    """A slanted lamp and a dim sky."""
    add_lamp("SUN", 2.0, (3, -2, 4), toward=(0, 0, 0), angle=0.1)
    set_world(scene, (0.2, 0.25, 0.3))
    scene.cycles.max_bounces = 1


def shade_auto(obj: Any, angle: float) -> None:
    """Auto smooth: a property of meshes until 4.0, sharp edges since."""
    mesh = obj.data
    if hasattr(mesh, "use_auto_smooth"):
        mesh.use_auto_smooth, mesh.auto_smooth_angle = True, angle
    else:
        mesh.set_sharp_from_angle(angle=angle)


def test_no_material(pair_scene: Any, tmp_path: Path) -> None:
    """No slot, and an empty one: grey paint, from 5.0 on the look of a new material."""
    look_at(pair_scene, (2.2, -4.2, 2.4))
    lit(pair_scene)
    for place, slots in ((-1.5, 0), (1.5, 1)):
        plane = add_plane(diffuse(), 3.0, location=(place, 0, 0))
        plane.data.materials.clear()
        for _ in range(slots):
            plane.data.materials.append(None)
    agree(pair_scene, tmp_path, samples=64, bounds=Bounds(0.005, 0.04))


def test_normals(pair_scene: Any, tmp_path: Path) -> None:
    """Smooth, flat, auto smooth, custom, mixed faces, sharp edges; with unequal and negative scales."""
    look_down(pair_scene, 3.0)
    grey = material(lambda tree: tree("BsdfPrincipled", Roughness=0.4))
    places = grid(9, 3)
    cylinder = [(0.4 * math.cos(a), 0.4 * math.sin(a), z) for z in (-0.3, 0.3) for a in np.arange(8) * math.pi / 4]
    sides = [(i, (i + 1) % 8, 8 + (i + 1) % 8, 8 + i) for i in range(8)]
    sides += [tuple(range(7, -1, -1)), tuple(range(8, 16))]
    turn = (0.9, 0.2, 0.4)
    add_sphere(grey, segments=8, location=places[0])
    add_sphere(grey, segments=8, smooth=False, location=places[1])
    shade_auto(add_mesh(cylinder, sides, grey, smooth=True, location=places[2], rotation=turn), 0.9)
    set_custom_normals(add_sphere(grey, segments=12, location=places[3]))
    mixed = add_sphere(grey, segments=10, location=places[4])
    mixed.data.polygons.foreach_set("use_smooth", [number % 2 == 0 for number in range(len(mixed.data.polygons))])
    sharp = add_mesh(cylinder, sides, grey, smooth=True, location=places[5], rotation=turn)
    if hasattr(sharp.data, "use_auto_smooth"):
        sharp.data.use_auto_smooth, sharp.data.auto_smooth_angle = True, math.pi
    for edge in list(sharp.data.edges)[::3]:
        edge.use_edge_sharp = True
    add_sphere(grey, segments=8, location=places[6]).scale = (1.0, 0.5, 0.8)
    mirrored = add_sphere(grey, segments=8, location=places[7])
    set_custom_normals(mirrored)
    mirrored.scale = (-1.0, 1.0, 0.7)
    subdivided = add_box(grey, (0.7, 0.7, 0.7), location=places[8])
    subdivided.modifiers.new("Subdivide", "SUBSURF").render_levels = 2
    subdivided.data.polygons.foreach_set("use_smooth", [True] * 6)
    lit(pair_scene)
    agree(pair_scene, tmp_path, cells=3, bounds=Bounds(0.01, 0.04))


def test_material_slots_and_modifiers(pair_scene: Any, tmp_path: Path) -> None:
    """Faces choose slots; a slot of the object replaces the mesh's; modifiers keep and offset them."""
    look_down(pair_scene, 2.0)
    colors = [glow(color, 0.8) for color in ((1, 0.1, 0.1), (0.1, 1, 0.1), (0.1, 0.1, 1))]
    places = grid(4, 2)
    for number, place in enumerate(places):
        ball = add_sphere(colors[0], segments=12, location=place)
        for item in colors[1:]:
            ball.data.materials.append(item)
        count = len(ball.data.polygons)
        ball.data.polygons.foreach_set("material_index", np.arange(count) % (4 if number == 3 else 3))
        if number == 1:
            ball.material_slots[0].link = "OBJECT"
            ball.material_slots[0].material = glow((1, 1, 0))
        elif number == 2:
            modifier = ball.modifiers.new("Solidify", "SOLIDIFY")
            modifier.thickness, modifier.material_offset = 0.1, 1
        ball.rotation_euler = (0.4, 0.3, 0.0)
    agree(pair_scene, tmp_path, cells=2)


def set_fields(scene: Any) -> None:
    """What instances can show of themselves: index, random number, colour, location."""
    look_down(scene, 6.0)
    lit(scene)


def telling() -> Any:
    """A material that shows an instance's own values."""

    def build(tree: Tree) -> Any:
        info = tree("ObjectInfo")
        mixed = tree("MixRGB", in0=0.5, in1=info.outputs["Random"], in2=info.outputs["Location"])
        return tree("BsdfDiffuse", Color=mixed)

    return material(build)


def test_collection_instances(pair_scene: Any, tmp_path: Path) -> None:
    """A collection with an offset, nested in another, turned and scaled, with a lamp inside."""
    set_fields(pair_scene)
    inner, outer = bpy.data.collections.new("Inner"), bpy.data.collections.new("Outer")
    inner.instance_offset = (0.2, 0.0, 0.0)
    things = [
        add_box(telling(), (0.6, 0.4, 0.3), location=(0, 0, 0.2)),
        add_sphere(telling(), 0.2, segments=10, location=(0.5, 0, 0.3)),
        add_lamp("POINT", 5, (0.2, 0.4, 0.6), shadow_soft_size=0.1),
    ]
    for thing in things:
        pair_scene.collection.objects.unlink(thing)
        inner.objects.link(thing)
    for number in range(2):
        empty = add_object(None, (0.0, number * 1.2, 0.0), (0, 0, 0.5 * number))
        empty.instance_type, empty.instance_collection = "COLLECTION", inner
        pair_scene.collection.objects.unlink(empty)
        outer.objects.link(empty)
    for number, scale in enumerate(((1, 1, 1), (0.7, 1.2, 1.0), (-1, 1, 1))):
        empty = add_object(None, (number * 1.8 - 1.8, -0.8, 0.0), (0.2 * number, 0, 0))
        empty.scale = scale
        empty.instance_type, empty.instance_collection = "COLLECTION", outer
    add_plane(diffuse(), 8.0)
    agree(pair_scene, tmp_path, samples=128)


@pytest.mark.parametrize("kind", ["OBJECT", "COLLECTION"])
def test_particle_instances(pair_scene: Any, tmp_path: Path, kind: str) -> None:
    """An emitter of objects, or of a collection's in turn; the emitter itself is not shown in one of the cases."""
    set_fields(pair_scene)
    add_plane(diffuse(), 8.0, location=(0, 0, -0.5))
    shapes = [add_box(telling(), (0.4, 0.3, 0.5)), add_sphere(telling(), 0.2, segments=8)]
    collection = bpy.data.collections.new("Shapes")
    for shape in shapes:
        pair_scene.collection.objects.unlink(shape)
        collection.objects.link(shape)
    emitter = add_plane(diffuse((0.2, 0.3, 0.8)), 5.0)
    emitter.modifiers.new("Particles", "PARTICLE_SYSTEM")
    settings = emitter.particle_systems[0].settings
    settings.count, settings.frame_start, settings.frame_end, settings.lifetime = 40, 1, 1, 100
    settings.physics_type, settings.render_type = "NO", kind
    settings.use_rotations, settings.rotation_factor_random = True, 0.6
    settings.particle_size, settings.size_random = 0.8, 0.5
    if kind == "OBJECT":
        settings.instance_object = shapes[0]
        emitter.show_instancer_for_render = False
    else:
        settings.instance_collection = collection
    pair_scene.frame_set(5)
    agree(pair_scene, tmp_path)


def scatter_group(shape: Any) -> Any:
    """Geometry nodes: instances of an object on the points of a mesh, turned and scaled by position."""
    group, given, result = new_geometry_group("Scatter")
    nodes, link = group.nodes, group.links.new
    instance, info = nodes.new("GeometryNodeInstanceOnPoints"), nodes.new("GeometryNodeObjectInfo")
    position, scale = nodes.new("GeometryNodeInputPosition"), nodes.new("ShaderNodeVectorMath")
    join = nodes.new("GeometryNodeJoinGeometry")
    info.inputs["Object"].default_value = shape
    info.inputs["As Instance"].default_value = True
    scale.operation = "MULTIPLY_ADD"
    scale.inputs[1].default_value, scale.inputs[2].default_value = (0.2, 0.1, 0.0), (1.0, 1.0, 1.0)
    link(given.outputs[0], instance.inputs["Points"])
    link(info.outputs["Geometry"], instance.inputs["Instance"])
    link(position.outputs[0], scale.inputs[0])
    link(scale.outputs[0], instance.inputs["Scale"])
    link(position.outputs[0], instance.inputs["Rotation"])
    link(given.outputs[0], join.inputs[0])
    link(instance.outputs[0], join.inputs[0])
    link(join.outputs[0], result.inputs[0])
    return group


def test_geometry_nodes_instances(pair_scene: Any, tmp_path: Path) -> None:
    set_fields(pair_scene)
    shape = add_box(telling(), (0.4, 0.3, 0.6), location=(0, 0, 50))
    points = [(x, y, 0.0) for x in range(-2, 3) for y in range(-2, 3)]
    faces = [(5 * i + j, 5 * (i + 1) + j, 5 * (i + 1) + j + 1, 5 * i + j + 1) for i in range(4) for j in range(4)]
    ground = add_mesh(points, faces, diffuse((0.3, 0.6, 0.3)))
    ground.modifiers.new("Scatter", "NODES").node_group = scatter_group(shape)
    agree(pair_scene, tmp_path)


def test_instances_on_vertices_and_faces(pair_scene: Any, tmp_path: Path) -> None:
    """Blender's oldest instancing, with normals as directions and faces as sizes."""
    set_fields(pair_scene)
    for number, (kind, middle) in enumerate((("VERTS", -1.5), ("FACES", 1.5))):
        vertices, faces = sphere_shape(8, 4, 1.0)
        parent = add_mesh(vertices, faces, diffuse(), location=(middle, 0, 0))
        parent.instance_type = kind
        parent.use_instance_vertices_rotation = parent.use_instance_faces_scale = True
        parent.show_instancer_for_render = number == 1
        child = add_box(telling(), (0.3, 0.2, 0.5))
        child.parent = parent
    agree(pair_scene, tmp_path)


def test_visibility_of_objects(pair_scene: Any, tmp_path: Path) -> None:
    """Objects hidden from one kind of ray each, over a mirror and a matt floor; a holdout and one seen indirectly."""
    look_at(pair_scene, (0.0, -6.0, 3.0), (0.0, 0.0, 0.4), 40.0)
    add_plane(material(lambda tree: tree("BsdfGlossy", Roughness=0.3)), 3.0, location=(-1.5, 0, 0))
    add_plane(diffuse(), 3.0, location=(1.5, 0, 0))
    names = (
        "visible_camera",
        "visible_diffuse",
        "visible_glossy",
        "visible_transmission",
        "visible_shadow",
        "is_holdout",
    )
    for number, name in enumerate(names):
        thing = add_box(diffuse((0.9, 0.5, 0.2)), (0.5, 0.5, 0.5), location=(number - 2.5, 0.3 * (number % 3), 0.3))
        setattr(thing, name, name == "is_holdout")
    lit(pair_scene)
    agree(pair_scene, tmp_path, samples=128, bounds=Bounds(0.01, 0.06))
