"""Cameras: the final frame's (perspective, orthographic, panoramic, stereo) and the viewport's.

The engine wants the film plane's window: at distance 1 for perspective, in metres for orthographic. Sensor fit, shift,
pixel aspect, zoom and offset are all in it.
"""

import math
from typing import Any

from mathutils import Matrix, Vector

from .. import settings as talbot_settings
from .. import versions
from .context import SyncContext, column_major

PANORAMAS = {
    "EQUIRECTANGULAR": "equirectangular",
    "EQUIANGULAR_CUBEMAP_FACE": "equiangular_cubemap",
    "MIRRORBALL": "mirrorball",
    "FISHEYE_EQUIDISTANT": "fisheye_equidistant",
    "FISHEYE_EQUISOLID": "fisheye_equisolid",
    "FISHEYE_LENS_POLYNOMIAL": "fisheye_polynomial",
    "CENTRAL_CYLINDRICAL": "central_cylindrical",
}
TYPES = {"PERSP": "perspective", "ORTHO": "orthographic", "PANO": "panoramic"}
MIN_FOCUS = 1e-5


def film_window(
    half_fit: float, fit: str, width: float, height: float, shift: tuple[float, float]
) -> tuple[float, float, float, float]:
    """left, right, bottom, top when the fitted side reaches from -half_fit to half_fit; width and height
    in units of one aspect. Shift is a fraction of the fitted side in both directions."""
    horizontal = fit == "HORIZONTAL" or (fit == "AUTO" and width >= height)
    half_x = half_fit if horizontal else half_fit * width / height
    half_y = half_fit * height / width if horizontal else half_fit
    dx, dy = 2.0 * half_fit * shift[0], 2.0 * half_fit * shift[1]
    return dx - half_x, dx + half_x, dy - half_y, dy + half_y


def unscaled(matrix: Matrix) -> Matrix:
    """Without the size of its scale; a mirrored camera stays mirrored."""
    out = matrix.to_4x4()
    for index in range(3):
        column = Vector(out.col[index][:3])
        if column.length > 0:
            column.normalize()
        out.col[index] = (*column, 0.0)
    return out


def focus_distance(camera: Any, matrix: Matrix) -> float:
    """Distance of the focus plane along the view axis."""
    dof = camera.dof
    target = dof.focus_object
    if target is None:
        return max(dof.focus_distance, MIN_FOCUS)
    point = target.matrix_world.translation
    pose = getattr(target, "pose", None)
    if dof.focus_subtarget and pose is not None and dof.focus_subtarget in pose.bones:
        point = (target.matrix_world @ pose.bones[dof.focus_subtarget].matrix).translation
    axis = Vector(matrix.col[2][:3])
    return max(abs((point - matrix.translation).dot(axis)), MIN_FOCUS)


def aperture_values(camera: Any, matrix: Matrix) -> dict[str, Any]:
    """Depth of field; empty when the camera has none."""
    dof = camera.dof
    if not dof.use_dof:
        return {}
    stop = 2.0 * max(dof.aperture_fstop, 1e-5)
    return {
        "aperture_radius": 1.0 / stop if camera.type == "ORTHO" else camera.lens * 1e-3 / stop,
        "aperture_blades": dof.aperture_blades,
        "aperture_rotation": dof.aperture_rotation,
        "aperture_ratio": max(dof.aperture_ratio, 1e-5),
        "focus_distance": focus_distance(camera, matrix),
    }


def panorama_values(context: SyncContext, camera: Any, width: float, height: float) -> dict[str, Any]:
    """The settings of a panoramic camera; 3.4 keeps them with Cycles, newer versions in the camera."""
    cycles = versions.cycles_settings(camera)

    def get(name: str, fallback: Any) -> Any:
        return getattr(camera, name) if hasattr(camera, name) else cycles.get(name, fallback)

    kind = get("panorama_type", "FISHEYE_EQUISOLID") if hasattr(camera, "panorama_type") else ""
    kind = kind or cycles.get_enum("panorama_type", tuple(PANORAMAS), "FISHEYE_EQUISOLID")
    if kind not in PANORAMAS:
        context.warn(f"Camera '{camera.name}': panorama {kind} is not supported; equirectangular is used")
        kind = "EQUIRECTANGULAR"
    horizontal = camera.sensor_fit == "HORIZONTAL" or (camera.sensor_fit == "AUTO" and width >= height)
    fitted = camera.sensor_height if camera.sensor_fit == "VERTICAL" else camera.sensor_width
    radius = max(get("central_cylindrical_radius", 1.0), 1e-5)
    return {
        "panorama": PANORAMAS[kind],
        "fov": get("fisheye_fov", math.pi),
        "lens_mm": get("fisheye_lens", 10.5),
        "sensor_width_mm": fitted if horizontal else fitted * width / height,
        "sensor_height_mm": fitted * height / width if horizontal else fitted,
        "latitude_min": get("latitude_min", -math.pi / 2),
        "latitude_max": get("latitude_max", math.pi / 2),
        "longitude_min": get("longitude_min", -math.pi),
        "longitude_max": get("longitude_max", math.pi),
        "polynomial": tuple(
            get(f"fisheye_polynomial_k{i}", default)
            for i, default in enumerate(
                (
                    -1.1735143712967577e-05,
                    -0.019988736953434998,
                    -3.3525322965709175e-06,
                    3.099275275886036e-06,
                    -2.6064646454854524e-08,
                )
            )
        ),
        "cylinder": (
            get("central_cylindrical_range_u_min", -math.pi),
            get("central_cylindrical_range_u_max", math.pi),
            get("central_cylindrical_range_v_min", -1.0) / radius,
            get("central_cylindrical_range_v_max", 1.0) / radius,
            radius,
        ),
    }


def camera_values(
    context: SyncContext,
    camera_object: Any,
    render: Any,
    width: int,
    height: int,
    matrix: Matrix,
    shift_x: float | None = None,
) -> dict[str, Any]:
    """The dictionary for `Session.set_camera`. Matrix and horizontal shift may be one eye's."""
    matrix = unscaled(matrix)
    across, up = width * render.pixel_aspect_x, height * render.pixel_aspect_y
    camera = camera_object.data
    values: dict[str, Any] = {"to_world": column_major(matrix)}
    if camera_object.type != "CAMERA":
        # Any object may be the camera: it looks like one with default settings.
        values["view"] = film_window(36.0 / (2.0 * 50.0), "AUTO", across, up, (0.0, 0.0))
        return values
    kind = camera.type
    if kind not in TYPES:
        context.warn(f"Camera '{camera.name}': custom cameras are not supported; perspective is used")
        kind = "PERSP"
    shift = (camera.shift_x if shift_x is None else shift_x, camera.shift_y)
    sensor = camera.sensor_height if camera.sensor_fit == "VERTICAL" else camera.sensor_width
    half_fit = camera.ortho_scale / 2.0 if kind == "ORTHO" else sensor / (2.0 * max(camera.lens, 1e-5))
    values |= {
        "type": TYPES[kind],
        "view": film_window(half_fit, camera.sensor_fit, across, up, shift),
        "clip_start": camera.clip_start,
        "clip_end": camera.clip_end,
    }
    if kind == "PANO":
        values |= panorama_values(context, camera, across, up)
    return values | aperture_values(camera, matrix)


def window_of_projection(projection: Matrix) -> tuple[float, float, float, float]:
    """The film plane's window of a projection matrix: zoom and offset of the view are in it."""
    orthographic = projection[3][3] != 0.0
    sides = []
    for row in (0, 1):
        scale = projection[row][row]
        middle = -projection[row][3] if orthographic else projection[row][2]
        sides += [(middle - 1.0) / scale, (middle + 1.0) / scale]
    return tuple(sides)


def viewport_values(
    context: SyncContext, view_context: Any, region_data: Any, width: int, height: int
) -> dict[str, Any]:
    """The same for a 3D viewport."""
    space = view_context.space_data
    scene = view_context.scene
    matrix = region_data.view_matrix.inverted_safe()
    projection = region_data.window_matrix
    orthographic = projection[3][3] != 0.0
    values: dict[str, Any] = {
        "type": "orthographic" if orthographic else "perspective",
        "view": window_of_projection(projection),
        "clip_start": space.clip_start,
        "clip_end": space.clip_end,
    }
    camera_object = space.camera or scene.camera
    if region_data.view_perspective == "CAMERA" and camera_object is not None:
        camera_object = camera_object.evaluated_get(view_context.evaluated_depsgraph_get())
        if camera_object.type == "CAMERA":
            camera = camera_object.data
            values |= {"clip_start": camera.clip_start, "clip_end": camera.clip_end}
            values |= aperture_values(camera, unscaled(matrix))
            if camera.type == "PANO":
                values["type"] = "panoramic"
                values |= panorama_values(context, camera, width, height)
    elif orthographic:
        # An orthographic view shows what lies behind its centre too: start half the depth further back.
        matrix = matrix @ Matrix.Translation((0.0, 0.0, space.clip_end / 2.0))
        values["clip_start"] = 0.0
    return values | {"to_world": column_major(matrix)}


def viewport_border(view_context: Any, region_data: Any, width: int, height: int) -> tuple[int, int, int, int]:
    """The part of a 3D viewport to render as x, y, width, height in pixels from the bottom left; zeros: all of it.

    In the camera's view the render region of the scene, a part of the camera's frame; else the viewport's own."""
    space, render = view_context.space_data, view_context.scene.render
    camera_object = space.camera or view_context.scene.camera
    if region_data.view_perspective == "CAMERA" and camera_object is not None:
        if not render.use_border:
            return 0, 0, 0, 0
        left, right, bottom, top = window_of_projection(region_data.window_matrix)
        frame_width, frame_height = talbot_settings.resolution(render)
        camera_object = camera_object.evaluated_get(view_context.evaluated_depsgraph_get())
        values = camera_values(
            SyncContext(None), camera_object, render, frame_width, frame_height, camera_object.matrix_world
        )
        frame = values["view"]
        sides = (
            _mix(frame[0], frame[1], render.border_min_x) - left,
            _mix(frame[0], frame[1], render.border_max_x) - left,
            _mix(frame[2], frame[3], render.border_min_y) - bottom,
            _mix(frame[2], frame[3], render.border_max_y) - bottom,
        )
        x0, x1 = sides[0] / (right - left), sides[1] / (right - left)
        y0, y1 = sides[2] / (top - bottom), sides[3] / (top - bottom)
    elif space.use_render_border:
        x0, x1 = space.render_border_min_x, space.render_border_max_x
        y0, y1 = space.render_border_min_y, space.render_border_max_y
    else:
        return 0, 0, 0, 0
    x, x_end = _pixels(x0, x1, width)
    y, y_end = _pixels(y0, y1, height)
    return x, y, x_end - x, y_end - y


def _mix(low: float, high: float, fraction: float) -> float:
    return low + (high - low) * fraction


def _pixels(low: float, high: float, size: int) -> tuple[int, int]:
    """First and end pixel of a border's side; at least one pixel, which lies in the region."""
    first = min(max(int(low * size), 0), max(size - 1, 0))
    return first, min(max(int(high * size), first + 1), max(size, 1))
