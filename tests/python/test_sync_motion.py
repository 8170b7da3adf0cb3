"""Motion blur: moments of the shutter, maps between them, what is sent."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import bpy
import numpy as np
import pytest
from mathutils import Matrix
from sync_recorder import RecordingSession
from test_sync_scene import SQUARE, add_mesh


class MovingEngine(bpy.types.RenderEngine):
    """Reads the scene into a recording session as a final render does, renders nothing."""

    bl_idname = "TALBOT_TEST_MOTION"
    bl_label = "Motion"
    bl_use_preview = False
    session: RecordingSession | None = None
    failure: BaseException | None = None

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)

    def render(self, depsgraph: Any) -> None:
        from talbot.sync.depsgraph import SceneSync

        try:
            session = RecordingSession()
            SceneSync(session).full(
                depsgraph,
                depsgraph.scene_eval,
                depsgraph.view_layer_eval,
                width=8,
                height=8,
                viewport=False,
                set_frame=lambda frame, subframe: self.frame_set(frame, subframe=subframe),
            )
            MovingEngine.session = session
        except BaseException as error:
            MovingEngine.failure = error
        self.end_result(self.begin_result(0, 0, self.resolution_x, self.resolution_y))


@pytest.fixture
def capture(empty_scene: Any) -> Iterator[Any]:
    """A function that reads the scene and returns the session."""
    bpy.utils.register_class(MovingEngine)
    scene = bpy.context.scene
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(camera)
    scene.camera = camera
    scene.render.engine = MovingEngine.bl_idname
    scene.render.resolution_x = scene.render.resolution_y = 8
    scene.render.use_motion_blur, scene.render.motion_blur_shutter = True, 1.0
    scene.frame_set(5)

    def run() -> RecordingSession:
        MovingEngine.session = MovingEngine.failure = None
        bpy.ops.render.render()
        if MovingEngine.failure is not None:
            raise MovingEngine.failure
        assert MovingEngine.session is not None
        return MovingEngine.session

    yield run
    bpy.utils.unregister_class(MovingEngine)


def animate(owner: Any, path: str, values: dict[int, Any]) -> None:
    """Keys with straight lines between them."""
    for frame, value in values.items():
        setattr(owner, path, value)
        owner.keyframe_insert(path, frame=frame)
    block = owner.id_data.animation_data.action
    curves = block.fcurves if hasattr(block, "fcurves") else block.layers[0].strips[0].channelbags[0].fcurves
    for curve in curves:
        for key in curve.keyframe_points:
            key.interpolation = "LINEAR"


def test_objects(capture: Any) -> None:
    moving = add_mesh("Moving", SQUARE, [(0, 1, 2, 3)])
    still = add_mesh("Still", SQUARE, [(0, 1, 2, 3)])
    excluded = add_mesh("Excluded", SQUARE, [(0, 1, 2, 3)])
    for obj in (moving, excluded):
        animate(obj, "location", {1: (0, 0, 0), 9: (8, 0, 0)})
    excluded.cycles.use_motion_blur = False
    still.location = (0, 5, 0)
    session = capture()
    names = [session.objects["names"][i] for i in session.objects["name"]]
    which = dict(zip(names, session.motion["object_motion"].tolist(), strict=True))
    assert which == {"Moving": 0, "Still": -1, "Excluded": -1}
    (maps,) = session.motion["objects"]
    assert np.allclose(maps[:, 12], [3.5, 4, 4.5], atol=1e-5)
    assert session.motion["shutter"][0] == 0 and session.motion["shutter"][-1] == 1
    assert "camera" not in session.motion
    scene = bpy.context.scene
    assert (scene.frame_current, scene.frame_subframe) == (5, 0)


def test_shutter_positions(capture: Any) -> None:
    moving = add_mesh("Moving", SQUARE, [(0, 1, 2, 3)])
    animate(moving, "location", {1: (0, 0, 0), 9: (8, 0, 0)})
    scene = bpy.context.scene
    owner = scene.render if hasattr(scene.render, "motion_blur_position") else scene.cycles
    for position, expected in (("START", [4, 4.5, 5]), ("END", [3, 3.5, 4])):
        owner.motion_blur_position = position
        session = capture()
        assert np.allclose(session.motion["objects"][0][:, 12], expected, atol=1e-5)
        assert session.objects["matrix"][0][12] == pytest.approx(expected[1])


def test_camera_and_shapes(capture: Any) -> None:
    scene = bpy.context.scene
    animate(scene.camera, "location", {1: (0, 0, 0), 9: (0, 8, 0)})
    obj = add_mesh("Shape", SQUARE, [(0, 1, 2, 3)])
    obj.shape_key_add(name="Basis")
    key = obj.shape_key_add(name="Up")
    for point in key.data:
        point.co.z += 1
    animate(key, "value", {4: 0.0, 6: 1.0})
    flying = add_mesh("Flying", SQUARE, [(0, 1, 2, 3)])
    speed = flying.data.attributes.new("velocity", "FLOAT_VECTOR", "POINT")
    speed.data.foreach_set("vector", np.tile([24, 0, 0], 4).astype(np.float32))
    scene.render.fps = 24
    session = capture()
    assert np.allclose(session.motion["camera"][:, 13], [3.5, 4, 4.5], atol=1e-5)
    shapes = {session.meshes[handle][0]: values for handle, values in session.mesh_motions.items()}
    assert set(shapes) == {"Shape", "Flying"}
    assert np.allclose(
        shapes["Shape"]["positions"].reshape(3, 4, 3)[:, :, 2].mean(axis=1), [0.25, 0.5, 0.75], atol=1e-3
    )
    assert np.allclose(shapes["Flying"]["positions"].reshape(2, 4, 3)[:, 0, 0], [-0.5, 0.5], atol=1e-5)


def test_a_shape_is_read_once_for_all_its_instances(capture: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    from talbot.sync import motion

    scene = bpy.context.scene
    obj = add_mesh("Part", SQUARE, [(0, 1, 2, 3)])
    wave = obj.modifiers.new("Wave", "WAVE")
    wave.time_offset, wave.width, wave.height = -20.0, 1.0, 0.3
    collection = bpy.data.collections.new("Parts")
    scene.collection.objects.unlink(obj)
    collection.objects.link(obj)
    for place in range(12):
        holder = bpy.data.objects.new("Holder", None)
        holder.instance_type, holder.instance_collection = "COLLECTION", collection
        holder.location.x = place
        scene.collection.objects.link(holder)
    reads = []
    positions = motion._positions
    monkeypatch.setattr(motion, "_positions", lambda data: reads.append(data.name) or positions(data))
    session = capture()
    assert len(session.objects["name"]) == 12 and len(session.mesh_motions) == 1
    assert len(reads) == 3, "one for each moment"


def test_nothing_moves_without_the_switch(capture: Any) -> None:
    moving = add_mesh("Moving", SQUARE, [(0, 1, 2, 3)])
    animate(moving, "location", {1: (0, 0, 0), 9: (8, 0, 0)})
    bpy.context.view_layer.use_motion_blur = False
    assert "set_motion" not in capture().calls


def test_turns_get_maps_enough(empty_scene: Any) -> None:
    from talbot.sync.motion import MAX_MOMENTS, finer

    turned = [Matrix.Rotation(math.radians(a), 4, "Z") for a in (0, 60, 120)]
    rows = finer(turned)
    assert len(rows) % 2 == 1 and 31 <= len(rows) <= 35
    for index, row in enumerate(rows):
        expected = Matrix.Rotation(math.radians(120 * index / (len(rows) - 1)), 4, "Z")
        assert np.allclose(row.reshape(4, 4).T, np.array(expected), atol=1e-5)
    straight = [Matrix.Translation((x, 0, 0)) for x in (0.0, 1.0, 5.0)]
    assert len(finer(straight)) == 3
    assert len(finer([Matrix.Rotation(a, 4, "X") for a in np.linspace(0, 100, 65)])) <= MAX_MOMENTS
    flat = Matrix.Diagonal((0.0, 1.0, 1.0, 1.0))
    assert np.isfinite(finer([flat, flat @ Matrix.Rotation(1.0, 4, "Z")])).all()
    mirrored = [
        Matrix.Diagonal((-1.0, 1.0, 1.0, 1.0)),
        Matrix.Translation((1, 0, 0)) @ Matrix.Diagonal((-1.0, 1.0, 1.0, 1.0)),
    ]
    for row in finer(mirrored):
        assert np.linalg.det(row.reshape(4, 4)[:3, :3]) == pytest.approx(-1)
