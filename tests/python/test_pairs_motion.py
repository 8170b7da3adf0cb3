"""What moves while the shutter is open, in Cycles and in Talbot."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from mathutils import Vector
from pair_scenes import (
    add_box,
    add_lamp,
    add_object,
    add_plane,
    animate,
    diffuse,
    glow,
    look_at,
    new_geometry_group,
    open_shutter,
    set_world,
)
from pairs import Bounds, agree

FRAME = 5


def stage(scene: Any) -> Any:
    """A box over a floor, sun and sky; the shutter is open for a frame around frame 5."""
    look_at(scene, (3.0, -3.0, 2.5), (0.0, 0.0, 0.4))
    add_lamp("SUN", 2.0, (2, -3, 5), toward=(0, 0, 0), angle=0.1)
    set_world(scene, 0.3)
    scene.cycles.max_bounces = 1
    add_plane(diffuse(0.6), 6.0)
    open_shutter(scene)
    return add_box(diffuse((0.8, 0.4, 0.2)), location=(0, 0, 0.6))


def fly(obj: Any) -> None:
    """Across the picture, turning."""
    animate(obj, "location", (1, (-3, 0, 0.6)), (9, (3, 0, 0.6)))
    animate(obj, "rotation_euler", (1, (0, 0, -3)), (9, (0, 0, 5)))


def move_object(scene: Any, box: Any) -> None:
    fly(box)


def move_from_start(scene: Any, box: Any) -> None:
    fly(box)
    open_shutter(scene, 1.0, "START")


def move_to_end(scene: Any, box: Any) -> None:
    fly(box)
    open_shutter(scene, 0.5, "END")


def turn_in_steps(scene: Any, box: Any) -> None:
    animate(box, "rotation_euler", (4, (0, 0, -1.5)), (6, (0, 0, 1.6)))
    box.cycles.motion_steps = 3


def move_camera(scene: Any, box: Any) -> None:
    place = scene.camera.location.copy()
    animate(scene.camera, "location", (4, place + Vector((-0.3, 0, 0))), (6, place + Vector((0.3, 0.1, 0))))


def zoom(scene: Any, box: Any) -> None:
    animate(scene.camera.data, "lens", (4, 35.0), (6, 65.0))


def deform(scene: Any, box: Any) -> None:
    box.shape_key_add(name="Basis")
    key = box.shape_key_add(name="Moved", from_mix=False)
    for point in key.data:
        point.co = point.co * 1.8 + Vector((0.4, 0, 0.3))
    animate(key, "value", (4, 0.0), (6, 1.0))


def flip(scene: Any, box: Any) -> None:
    """Mirrored, with smooth normals, while its shape changes."""
    box.scale = (-1.0, 1.0, 0.8)
    box.data.polygons.foreach_set("use_smooth", [True] * 6)
    deform(scene, box)


def bulge(scene: Any, box: Any) -> None:
    """Smooth normals of a shape that changes, alike in all directions."""
    box.data.polygons.foreach_set("use_smooth", [True] * 6)
    deform(scene, box)


def roll(scene: Any, box: Any) -> None:
    fly(box)
    scene.cycles.rolling_shutter_type, scene.cycles.rolling_shutter_duration = "TOP", 0.2


def switched_off(scene: Any, box: Any) -> None:
    fly(box)
    box.cycles.use_motion_blur = False


def velocities(scene: Any, box: Any) -> None:
    attribute = box.data.attributes.new("velocity", "FLOAT_VECTOR", "POINT")
    count = len(box.data.vertices)
    attribute.data.foreach_set("vector", np.tile(np.array((12, 0, 6), np.float32), count))


def shutter_curve(scene: Any, box: Any) -> None:
    fly(box)
    curve = scene.render.motion_blur_shutter_curve
    curve.curves[0].points[0].location = (0, 0)
    curve.update()


def move_instances(scene: Any, box: Any) -> None:
    inner = bpy.data.collections.new("Inner")
    scene.collection.objects.unlink(box)
    inner.objects.link(box)
    box.scale, box.location = (0.5, 0.5, 0.5), (0, 0, 0)
    empties = [add_object(None, (0, y, 0.4)) for y in (0.0, 1.0)]
    for empty in empties:
        empty.instance_type, empty.instance_collection = "COLLECTION", inner
    animate(empties[0], "location", (4, (-0.5, 0, 0.5)), (6, (0.5, 0, 0.8)))


def stiff(scene: Any, box: Any) -> None:
    deform(scene, box)
    fly(box)
    box.cycles.use_deform_motion = False


def follow_a_parent(scene: Any, box: Any) -> None:
    """A turning arm, its box and what hangs on that; the box grows as it goes."""
    arm = add_object(None)
    animate(arm, "rotation_euler", (4, (0, 0, -0.5)), (6, (0, 0, 0.6)))
    box.parent, box.location = arm, (0.8, 0, 0.5)
    animate(box, "scale", (4, (0.4, 0.4, 0.4)), (6, (0.9, 0.5, 0.6)))
    small = add_box(diffuse((0.2, 0.5, 0.8)), (0.4, 0.4, 0.4), location=(-1.2, 0.5, 0.0))
    small.parent = box


def orthographic(scene: Any, box: Any) -> None:
    scene.camera.data.type, scene.camera.data.ortho_scale = "ORTHO", 4.0
    move_camera(scene, box)


UNIT_NORMALS = pytest.mark.skipif(
    bpy.app.version < (3, 6, 0), reason="Cycles interpolates normals of what deforms and leaves them shorter than one"
)
MOVES: Sequence[Any] = (
    move_object,
    move_from_start,
    move_to_end,
    turn_in_steps,
    move_camera,
    zoom,
    deform,
    pytest.param(flip, marks=UNIT_NORMALS),
    pytest.param(bulge, marks=UNIT_NORMALS),
    roll,
    switched_off,
    velocities,
    shutter_curve,
    move_instances,
    stiff,
    follow_a_parent,
    orthographic,
)


@pytest.mark.parametrize("move", MOVES)
def test_motion(pair_scene: Any, tmp_path: Path, move: Callable[[Any, Any], None]) -> None:
    box = stage(pair_scene)
    move(pair_scene, box)
    pair_scene.frame_set(FRAME)
    agree(pair_scene, tmp_path, samples=96, batches=8, bounds=Bounds(0.01, 0.06))


@pytest.mark.parametrize("convergence", ["OFFAXIS", "TOE"])
def test_both_eyes_move(pair_scene: Any, tmp_path: Path, convergence: str) -> None:
    """A stereo pair flies and turns, and so do its eyes, which look at one point."""
    stage(pair_scene)
    render = pair_scene.render
    render.use_multiview, settings = True, render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "MULTI_LAYER_IMAGE"
    settings.file_format, settings.views_format = "OPEN_EXR_MULTILAYER", "MULTIVIEW"
    stereo = pair_scene.camera.data.stereo
    stereo.convergence_mode, stereo.interocular_distance, stereo.convergence_distance = convergence, 0.6, 3.0
    camera, place = pair_scene.camera, pair_scene.camera.location.copy()
    camera.rotation_euler = camera.matrix_world.to_euler()
    turn = Vector(camera.rotation_euler)
    animate(camera, "location", (4, place + Vector((-0.4, 0, 0))), (6, place + Vector((0.3, 0.2, 0))))
    animate(camera, "rotation_euler", (4, turn), (6, turn + Vector((0, 0, 0.2))))
    pair_scene.frame_set(FRAME)
    views = ("Combined.left", "Combined.right")
    agree(pair_scene, tmp_path, samples=96, batches=8, bounds=Bounds(0.01, 0.06), passes=views)


def test_emissive_box_flies_and_turns(pair_scene: Any, tmp_path: Path) -> None:
    """Its light samples follow it."""
    box = stage(pair_scene)
    set_world(pair_scene, 0.0)
    bpy.data.objects.remove(next(obj for obj in pair_scene.objects if obj.type == "LIGHT"))
    box.data.materials[0] = glow((4.0, 2.0, 1.0), 2.0)
    fly(box)
    pair_scene.frame_set(FRAME)
    agree(pair_scene, tmp_path, samples=256, batches=8, bounds=Bounds(0.01, 0.06))


def give_velocity(modifier: Any, to_points: bool) -> None:
    """Geometry nodes: a velocity by place on each point, of points or of what comes in."""
    group, given, result = new_geometry_group("Velocity")
    nodes, link = group.nodes, group.links.new
    came = given.outputs[0]
    if to_points:
        points = nodes.new("GeometryNodeMeshToPoints")
        points.inputs["Radius"].default_value = 0.15
        link(came, points.inputs["Mesh"])
        came = points.outputs[0]
    place, speed, store = (
        nodes.new(kind)
        for kind in ("GeometryNodeInputPosition", "ShaderNodeVectorMath", "GeometryNodeStoreNamedAttribute")
    )
    speed.operation = "MULTIPLY_ADD"
    speed.inputs[1].default_value, speed.inputs[2].default_value = (8.0, 0.0, 4.0), (10.0, 0.0, 5.0)
    store.data_type, store.domain = "FLOAT_VECTOR", "POINT"
    store.inputs["Name"].default_value = "velocity"
    link(place.outputs[0], speed.inputs[0])
    link(came, store.inputs["Geometry"])
    link(speed.outputs[0], next(s for s in store.inputs if s.name == "Value" and s.type == "VECTOR"))
    paint = nodes.new("GeometryNodeSetMaterial")
    paint.inputs["Material"].default_value = modifier.id_data.data.materials[0]
    link(store.outputs[0], paint.inputs[0])
    link(paint.outputs[0], result.inputs[0])
    modifier.node_group = group


@pytest.mark.parametrize("kind", ["points", "curves"])
def test_velocities_of_strands(pair_scene: Any, tmp_path: Path, kind: str) -> None:
    """What a simulation says of points and of curves, which do not move from frame to frame."""
    box = stage(pair_scene)
    obj = box
    if kind == "curves":
        bpy.data.objects.remove(box)
        obj = standing_curves()
    give_velocity(obj.modifiers.new("Velocity", "NODES"), kind == "points")
    pair_scene.frame_set(FRAME)
    agree(pair_scene, tmp_path, samples=96, batches=8, bounds=Bounds(0.01, 0.06))


def standing_curves() -> Any:
    """A few thick curves side by side."""
    curves = bpy.data.hair_curves.new("Pair")
    if not hasattr(curves, "add_curves"):
        pytest.skip("scripts make curves from 4.3 on")
    curves.add_curves([5] * 6)
    positions = [(0.3 * curve - 0.75, 0.05 * key, 0.3 * key) for curve in range(6) for key in range(5)]
    curves.points.foreach_set("position", np.array(positions, np.float32).ravel())
    radius = curves.attributes.get("radius") or curves.attributes.new("radius", "FLOAT", "POINT")
    radius.data.foreach_set("value", np.full(30, 0.08, np.float32))
    curves.materials.append(diffuse((0.8, 0.4, 0.2)))
    return add_object(curves)


def test_hair_moves_with_its_object(pair_scene: Any, tmp_path: Path) -> None:
    box = stage(pair_scene)
    box.modifiers.new("Hair", "PARTICLE_SYSTEM")
    settings = box.particle_systems[0].settings
    settings.type, settings.count, settings.hair_length = "HAIR", 60, 0.6
    settings.radius_scale, settings.root_radius, settings.tip_radius = 0.06, 1.0, 0.3
    animate(box, "location", (4, (-0.2, 0, 0.6)), (6, (0.3, 0, 0.6)))
    pair_scene.frame_set(FRAME)
    agree(pair_scene, tmp_path, samples=96, batches=8, bounds=Bounds(0.015, 0.08))
