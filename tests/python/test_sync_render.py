"""What a final render's depsgraph gives: render levels, render visibility, undeformed coordinates, stereo cameras."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import bpy
import numpy as np
import pytest
from sync_recorder import RecordingSession
from test_sync_scene import SQUARE, add_mesh, attributes, shader_reading


class CapturingEngine(bpy.types.RenderEngine):
    """Reads the scene into a recording session, renders nothing."""

    bl_idname = "TALBOT_TEST_CAPTURE"
    bl_label = "Capture"
    bl_use_preview = False
    captured: list[Any] = []
    failure: list[BaseException] = []

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)

    def render(self, depsgraph: Any) -> None:
        from talbot.sync.depsgraph import SceneSync

        try:
            session = RecordingSession()
            sync = SceneSync(session)
            width, height = self.resolution_x, self.resolution_y
            layer = depsgraph.view_layer_eval
            result = sync.full(depsgraph, depsgraph.scene_eval, layer, width=width, height=height, viewport=False)
            cameras = []
            for view in depsgraph.scene.render.views if depsgraph.scene.render.use_multiview else ():
                self.active_view_set(view.name)
                sync.set_render_camera(self, depsgraph)
                cameras.append(dict(session.camera))
            sync.set_render_camera(self, depsgraph)
            CapturingEngine.captured.append((session, result, cameras))
        except BaseException as error:
            CapturingEngine.failure.append(error)
        self.end_result(self.begin_result(0, 0, self.resolution_x, self.resolution_y))


@pytest.fixture
def capture(empty_scene: Any) -> Iterator[Any]:
    """A function that renders the scene and returns (session, result, cameras)."""
    bpy.utils.register_class(CapturingEngine)
    scene = bpy.context.scene
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(camera)
    scene.camera = camera
    scene.render.engine = CapturingEngine.bl_idname
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 16, 8, 100

    def run() -> Any:
        CapturingEngine.captured.clear()
        CapturingEngine.failure.clear()
        bpy.ops.render.render()
        if CapturingEngine.failure:
            raise CapturingEngine.failure[0]
        return CapturingEngine.captured[-1]

    yield run
    scene.render.engine = "CYCLES"
    bpy.utils.unregister_class(CapturingEngine)


def test_render_levels_and_visibility(capture: Any) -> None:
    obj = add_mesh("Levels", SQUARE, [(0, 1, 2, 3)])
    modifier = obj.modifiers.new("Subsurf", "SUBSURF")
    modifier.levels, modifier.render_levels = 0, 2
    add_mesh("Hidden in the view", SQUARE, [(0, 1, 2, 3)]).hide_viewport = True
    add_mesh("Hidden in renders", SQUARE, [(0, 1, 2, 3)]).hide_render = True
    session, _, _ = capture()
    assert (session.settings["width"], session.settings["height"]) == (16, 8)
    assert len(session.mesh("Levels")["positions"]) == 25
    assert set(session.objects["names"]) == {"Levels", "Hidden in the view"}


def test_generated_is_undeformed(capture: Any) -> None:
    obj = add_mesh("Bent", SQUARE, [(0, 1, 2, 3)])
    obj.data.materials.append(shader_reading(node="ShaderNodeTexCoord"))
    obj.modifiers.new("Displace", "DISPLACE").strength = 0.5
    session, _, _ = capture()
    arrays = session.mesh("Bent")
    domain, _, generated = attributes(arrays)["@generated"]
    assert domain == "VERTEX"
    assert not np.allclose(arrays["positions"][:, 2], 0), "the modifier moved it"
    assert np.allclose(generated[:, :2], np.array(SQUARE)[:, :2], atol=1e-5)


def test_stereo_cameras(capture: Any) -> None:
    scene = bpy.context.scene
    scene.render.use_multiview = True
    stereo = scene.camera.data.stereo
    stereo.convergence_mode = "OFFAXIS"
    stereo.interocular_distance = 0.2
    stereo.convergence_distance = 2.0
    stereo.pivot = "CENTER"
    _, _, cameras = capture()
    left, right = cameras[0], cameras[1]
    assert left["to_world"][12] == pytest.approx(-0.1, abs=1e-5)
    assert right["to_world"][12] == pytest.approx(0.1, abs=1e-5)
    assert left["view"][0] > right["view"][0], "the eyes' windows meet at the convergence plane"
    for camera, eye in ((left, -0.1), (right, 0.1)):
        middle = (camera["view"][0] + camera["view"][1]) / 2
        assert eye + middle * 2.0 == pytest.approx(0, abs=1e-5)


def test_object_that_is_no_camera(capture: Any) -> None:
    lamp = bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "SPOT"))
    bpy.context.scene.collection.objects.link(lamp)
    lamp.location = (1, 2, 3)
    bpy.context.scene.camera = lamp
    session, _, _ = capture()
    assert session.camera["to_world"][12:15] == [1, 2, 3]
