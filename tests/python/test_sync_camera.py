"""Cameras: the film window in every fit, depth of field, panoramas, the viewport's view."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import bpy
import pytest
from mathutils import Matrix
from sync_recorder import synchronise
from talbot.sync.camera import film_window, viewport_border, viewport_values, window_of_projection
from talbot.sync.context import SyncContext


def add_camera(**values: Any) -> Any:
    camera = bpy.data.cameras.new("Camera")
    for name, value in values.items():
        setattr(camera, name, value)
    obj = bpy.data.objects.new("Camera", camera)
    bpy.context.scene.collection.objects.link(obj)
    bpy.context.scene.camera = obj
    return obj


def window(width: float, height: float, shift_x: float = 0, shift_y: float = 0, lens: float = 50) -> Any:
    """The window of a film of this size in mm; shifts in mm too."""
    edges = (-width / 2 + shift_x, width / 2 + shift_x, -height / 2 + shift_y, height / 2 + shift_y)
    return pytest.approx([edge / lens for edge in edges], abs=1e-6)


@pytest.mark.parametrize(
    ("size", "aspect", "values", "expected"),
    [
        ((8, 6), (1, 1), {}, window(36, 27)),
        ((6, 8), (1, 1), {}, window(27, 36)),
        ((6, 8), (1, 1), {"sensor_fit": "HORIZONTAL"}, window(36, 48)),
        ((8, 6), (1, 1), {"sensor_fit": "VERTICAL"}, window(32, 24)),
        ((8, 6), (2, 1), {}, window(36, 13.5)),
        ((8, 6), (1, 2), {}, window(24, 36)),
        ((8, 6), (1, 1), {"shift_x": 0.2, "shift_y": -0.1}, window(36, 27, 7.2, -3.6)),
        ((6, 8), (1, 1), {"shift_x": 0.2, "shift_y": -0.1}, window(27, 36, 7.2, -3.6)),
        ((8, 6), (1, 1), {"lens": 24, "sensor_width": 20}, window(20, 15, lens=24)),
        ((8, 6), (1, 1), {"type": "ORTHO", "ortho_scale": 4}, window(4, 3, lens=1)),
        ((6, 8), (1, 1), {"type": "ORTHO", "ortho_scale": 4}, window(3, 4, lens=1)),
    ],
)
def test_window(empty_scene: Any, size: Any, aspect: Any, values: dict[str, Any], expected: Any) -> None:
    """Measured with Cycles in both versions."""
    add_camera(**values)
    render = bpy.context.scene.render
    render.pixel_aspect_x, render.pixel_aspect_y = aspect
    session, _, _ = synchronise(*size)
    assert list(session.camera["view"]) == expected
    assert session.camera["type"] == ("orthographic" if "type" in values else "perspective")


def test_scale_is_dropped_and_its_sign_kept(empty_scene: Any) -> None:
    camera = add_camera()
    camera.scale = (-2, 3, 4)
    camera.location = (1, 2, 3)
    bpy.context.view_layer.update()
    session, _, _ = synchronise()
    matrix = session.camera["to_world"]
    assert matrix[0:3] == [-1, 0, 0] and matrix[5] == 1 and matrix[10] == 1
    assert matrix[12:15] == [1, 2, 3]


def test_depth_of_field(empty_scene: Any) -> None:
    camera = add_camera(lens=50)
    session, _, _ = synchronise()
    assert session.camera.get("aperture_radius", 0) == 0
    dof = camera.data.dof
    dof.use_dof = True
    dof.aperture_fstop = 2
    dof.aperture_blades = 5
    dof.aperture_ratio = 2
    dof.focus_distance = 7
    session, _, _ = synchronise()
    assert session.camera["aperture_radius"] == pytest.approx(0.0125)
    assert session.camera["focus_distance"] == 7
    assert session.camera["aperture_blades"] == 5 and session.camera["aperture_ratio"] == 2
    target = bpy.data.objects.new("Target", None)
    bpy.context.scene.collection.objects.link(target)
    target.location = (100, 0, -4)
    dof.focus_object = target
    bpy.context.view_layer.update()
    session, _, _ = synchronise()
    assert session.camera["focus_distance"] == pytest.approx(4), "along the axis, not as the crow flies"
    camera.data.type = "ORTHO"
    session, _, _ = synchronise()
    assert session.camera["aperture_radius"] == pytest.approx(0.25)


def test_panorama(empty_scene: Any) -> None:
    camera = add_camera(type="PANO")
    holder = camera.data if hasattr(camera.data, "panorama_type") else camera.data.cycles
    holder.panorama_type = "FISHEYE_EQUISOLID"
    holder.fisheye_lens = 15
    holder.fisheye_fov = 2
    session, _, result = synchronise(6, 8)
    assert result.warnings == []
    values = session.camera
    assert (values["type"], values["panorama"]) == ("panoramic", "fisheye_equisolid")
    assert (values["lens_mm"], values["fov"]) == (15, 2)
    assert (values["sensor_width_mm"], values["sensor_height_mm"]) == (27, 36)
    holder.panorama_type = "EQUIRECTANGULAR"
    holder.longitude_min = -1
    camera.data.update_tag()
    session, _, _ = synchronise(6, 8)
    assert session.camera["panorama"] == "equirectangular" and session.camera["longitude_min"] == -1


def test_other_objects_and_none(empty_scene: Any) -> None:
    session, _, _ = synchronise()
    assert session.camera == {}
    empty = bpy.data.objects.new("Eye", None)
    bpy.context.scene.collection.objects.link(empty)
    bpy.context.scene.camera = empty
    session, _, _ = synchronise(8, 6)
    assert list(session.camera["view"]) == window(36, 27)


def projection(left: float, right: float, bottom: float, top: float, near: float, far: float) -> Matrix:
    """An off-centre perspective projection."""
    return Matrix(
        (
            (2 * near / (right - left), 0, (right + left) / (right - left), 0),
            (0, 2 * near / (top - bottom), (top + bottom) / (top - bottom), 0),
            (0, 0, -(far + near) / (far - near), -2 * far * near / (far - near)),
            (0, 0, -1, 0),
        )
    )


def test_window_of_a_projection() -> None:
    assert window_of_projection(projection(-0.02, 0.05, -0.01, 0.03, 0.1, 100)) == pytest.approx((-0.2, 0.5, -0.1, 0.3))
    orthographic = Matrix(((0.5, 0, 0, -0.25), (0, 1, 0, 0), (0, 0, -0.1, 0), (0, 0, 0, 1)))
    assert window_of_projection(orthographic) == pytest.approx((-1.5, 2.5, -1, 1))


@pytest.mark.parametrize("perspective", [True, False])
def test_viewport_view(empty_scene: Any, perspective: bool) -> None:
    matrix = Matrix.Translation((0, 0, -5))
    window_matrix = projection(-0.04, 0.04, -0.03, 0.03, 0.1, 100)
    if not perspective:
        window_matrix = Matrix(((0.5, 0, 0, 0), (0, 0.5, 0, 0), (0, 0, -0.01, 0), (0, 0, 0, 1)))
    region_data = SimpleNamespace(
        view_matrix=matrix, window_matrix=window_matrix, view_perspective="PERSP" if perspective else "ORTHO"
    )
    space = SimpleNamespace(clip_start=0.1, clip_end=100, camera=None, use_render_border=False)
    context = SimpleNamespace(space_data=space, scene=bpy.context.scene)
    values = viewport_values(SyncContext(None), context, region_data, 80, 60)
    if perspective:
        assert values["type"] == "perspective"
        assert values["view"] == pytest.approx((-0.4, 0.4, -0.3, 0.3))
        assert values["to_world"][14] == 5
    else:
        assert values["type"] == "orthographic"
        assert values["view"] == pytest.approx((-2, 2, -2, 2))
        assert values["to_world"][14] == 5 + 50 and values["clip_start"] == 0, "what lies behind the centre is seen too"


def test_film_window_shift_is_of_the_fitted_side() -> None:
    left, right, bottom, top = film_window(0.5, "AUTO", 2, 1, (0.1, 0.1))
    assert (left, right) == pytest.approx((-0.4, 0.6))
    assert (bottom, top) == pytest.approx((-0.15, 0.35))
    assert math.isclose(right - left, 1)


def view_of(perspective: str, window_matrix: Matrix, **space: Any) -> tuple[Any, Any]:
    """The context and the region's data of a 3D viewport."""
    defaults = {"camera": None, "use_render_border": False}
    scene = bpy.context.scene
    context = SimpleNamespace(
        space_data=SimpleNamespace(**(defaults | space)),
        scene=scene,
        evaluated_depsgraph_get=bpy.context.evaluated_depsgraph_get,
    )
    return context, SimpleNamespace(window_matrix=window_matrix, view_perspective=perspective)


def test_border_of_a_view(empty_scene: Any) -> None:
    border = {
        "render_border_min_x": 0.25,
        "render_border_max_x": 0.5,
        "render_border_min_y": 0.1,
        "render_border_max_y": 1,
    }
    matrix = projection(-0.04, 0.04, -0.03, 0.03, 0.1, 100)
    assert viewport_border(*view_of("PERSP", matrix, **border), 80, 60) == (0, 0, 0, 0)
    assert viewport_border(*view_of("PERSP", matrix, use_render_border=True, **border), 80, 60) == (20, 6, 20, 54)
    border["render_border_max_x"] = border["render_border_min_x"] = 1.0
    assert viewport_border(*view_of("PERSP", matrix, use_render_border=True, **border), 80, 60) == (79, 6, 1, 54)


def test_border_in_the_cameras_view(empty_scene: Any) -> None:
    """The camera's frame fills half of the view's width, and the border the right half of the frame."""
    scene = bpy.context.scene
    add_camera(lens=50)  # sees from -0.36 to 0.36 at distance 1
    scene.render.resolution_x, scene.render.resolution_y = 200, 100
    matrix = projection(-0.072, 0.072, -0.054, 0.054, 0.1, 100)
    assert viewport_border(*view_of("CAMERA", matrix, use_render_border=True), 80, 60) == (0, 0, 0, 0)
    scene.render.use_border = True
    scene.render.border_min_x, scene.render.border_max_x = 0.5, 1.0
    scene.render.border_min_y, scene.render.border_max_y = 0.0, 1.0
    x, y, width, height = viewport_border(*view_of("CAMERA", matrix), 80, 60)
    assert (x, width) == pytest.approx((40, 20), abs=1)
    assert (y, height) == pytest.approx((20, 20), abs=1)
