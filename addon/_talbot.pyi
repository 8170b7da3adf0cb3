"""The native module: what Python may ask of the engine.

Arrays are C-contiguous numpy arrays of exactly the dtype named; anything else raises TypeError, wrong lengths ValueError,
impossible values `Error`. Memory is lent during the call and copied; the GIL is released while C++ works.
Handles are small integers, valid until removed. Every edit stops a running render first; `start()` renders what was edited.
"""

from typing import Any, TypedDict

import numpy as np
from numpy.typing import NDArray

f32 = NDArray[np.float32]
u32 = NDArray[np.uint32]
i32 = NDArray[np.int32]
u8 = NDArray[np.uint8]

__version__: str
embree_version: str
python_abi: str

class Error(RuntimeError): ...

def available_memory() -> int:
    """Bytes the system could still give."""

def compiled_instruction_sets() -> list[str]: ...
def chosen_instruction_set() -> str:
    """Raises Error when TALBOT_ISA asks for what the machine cannot run."""

def check() -> None:
    """Traces a known triangle and compares library versions; raises Error with one sentence when another Embree answers."""

def denoiser_version(library_dirs: list[str]) -> str:
    """ "2.3.3", or "" when Open Image Denoise is not found."""

def random_per_island(vertices: int, edges: u32) -> bytes:
    """f32 a vertex, in 0..1, alike all over a connected part; edges as pairs of vertices."""

def matrix_columns(matrices: list[Any]) -> bytes:
    """f32 (n, 16), column-major, of copies of 4x4 mathutils matrices; TypeError for anything else."""

class Progress(TypedDict):
    state: str  # idle, updating, rendering, paused, done, cancelled, failed
    status: str
    fraction: float
    samples_done: int
    samples_total: int
    seconds: float
    remaining: float  # -1: unknown
    memory: int
    memory_peak: int
    image_version: int  # grows, over starts too, when there is something new to read
    pixel_size: int

class MeshArrays(TypedDict, total=False):
    """One mesh after modifiers. Required: positions, corner_vertices, triangle_corners. F = Blender's faces, C = corners, V = vertices, T = triangles."""

    positions: f32  # (V, 3)
    corner_vertices: u32  # (C,)
    triangle_corners: u32  # (T, 3), Blender's loop triangles
    triangle_faces: u32  # (T,)
    face_materials: i32  # (F,)
    face_smooth: u8  # (F,) 0 or 1
    vertex_normals: f32  # (V, 3)
    corner_normals: f32  # (C, 3)
    attributes: list[tuple[str, str, bool, NDArray[Any]]]
    # (name, "VERTEX" | "CORNER" | "FACE", is_color, f32 (n,) or (n, 2..4); for colours also u8 (n, 4) sRGB-encoded bytes)
    active_uv: str
    active_color: str
    generated_offset: tuple[float, float, float]
    generated_scale: tuple[float, float, float]
    # A cage (scene::Subdivision): "catmull_clark" or "simple". Required with it: face_starts.
    subdivision: str
    face_starts: u32  # (F + 1,) first corner of each face, and C
    uv_smoothing: str  # none, corners, junctions, concave, borders, all
    sharp_corners: bool
    in_pixels: bool
    edge_length: float
    max_level: int
    crease_edges: u32  # (E, 2) vertices
    crease_sharpness: f32  # (E,)
    crease_vertices: u32
    vertex_sharpness: f32

class StrandArrays(TypedDict, total=False):
    """Curves or points instead of a mesh: whatever has `radii`. Required: positions, radii. K keys or points, C curves."""

    positions: f32  # (K, 3)
    radii: f32  # (K,)
    curve_starts: u32  # (C + 1,) first key of each curve, and K; absent: points
    curve_shape: str  # ribbon, thick, thick_linear
    curve_subdivisions: int
    attributes: list[tuple[str, str, bool, NDArray[Any]]]  # "VERTEX": a key or point, "FACE": a curve
    active_uv: str
    active_color: str
    generated_offset: tuple[float, float, float]
    generated_scale: tuple[float, float, float]

class ObjectArrays(TypedDict, total=False):
    """All objects and instances of the scene at once, N of them, and what many of them share, their traits, n of those.
    Required: mesh, matrix; without `traits` every object has its own (n = N)."""

    matrix: f32  # (N, 16) column-major, as foreach_get("matrix_world") gives it
    traits: i32  # (N,) row of the columns of length n, -1: removed
    random: u32  # (N,)
    dupli_generated: f32  # (N, 3)
    dupli_uv: f32  # (N, 2)
    mesh: i32  # (n,) mesh handle
    name: i32  # (n,) index into `names`
    names: list[str]
    material_set: i32  # (n,) index into `material_sets`
    material_sets: list[list[int]]  # shader handles by material slot, -1: none
    visibility: u32  # (n,) bits camera 1, diffuse 2, glossy 4, transmission 8, volume 16, shadow 32
    receiver_set: i32  # (n,) 0 to 63
    linking: i32  # (n,) of its emission, index into `linkings`, -1: it lights everything
    linkings: list[tuple[int, int]]  # mask of the receiver sets; blocker group 0 to 63, -1: all objects block
    blocks: u32  # (n, 2) bit g of the low or the high word: casts the shadows of emitters with blocker group g; bit 63: some group names it
    pass_index: i32  # (n,)
    color: f32  # (n, 4)
    flags: u32  # (n,) bits is_instance 1, is_holdout 2, is_shadow_catcher 4
    shading_offset: f32  # (n,)
    geometry_offset: f32  # (n,)
    attribute_set: i32  # (n,) index into `attribute_sets`, -1: none
    attribute_sets: list[list[tuple[str, tuple[float, ...]]]]

class Session:
    def __init__(self) -> None: ...

    # -- the scene. Dictionaries have the field names of engine/scene/scene.h (enums as their names, lower case with underscores:
    # "blackman_harris", "perspective", "rectangle"); unknown keys raise KeyError, missing ones keep their defaults.
    def set_settings(self, values: dict[str, Any]) -> None: ...
    def set_camera(self, values: dict[str, Any]) -> None: ...  # to_world: 16 floats, column-major
    def set_dicing_camera(self, values: dict[str, Any]) -> None:
        """Whose pixels adaptive subdivision counts."""
    def set_world(self, values: dict[str, Any]) -> None: ...
    def set_passes(self, names: list[str]) -> None:
        """Names: combined, depth, normal, position, uv, mist, object_index, material_index, diffuse_direct, ..., emission,
        environment, denoising_albedo, denoising_normal, sample_count, shadow_catcher; of AOV Output nodes aov_color:NAME
        (4 channels, alpha counts what was written) and aov_value:NAME."""

    def add_mesh(self, name: str, arrays: MeshArrays | StrandArrays) -> int: ...
    def set_mesh(self, handle: int, name: str, arrays: MeshArrays | StrandArrays) -> None: ...
    def remove_mesh(self, handle: int) -> None: ...
    def set_objects(self, arrays: ObjectArrays) -> None:
        """Replaces all objects."""
    def set_object_matrices(self, matrix: f32) -> None:
        """(N, 16): moves the objects of the last set_objects; nothing else changes."""
    def set_motion(self, values: dict[str, Any]) -> None:
        """What moves while the shutter is open; replaces what was said before ({}: nothing moves). After set_objects and set_camera.
        Moments are spread evenly over the shutter, 2 to 129 of them. `objects`: list of f32 (moments, 16), column-major;
        `object_motion`: i32 (N,) index into it for each object, -1: stands still; `camera`: f32 (moments, 16);
        `camera_views`: f32 (moments, 4); `shutter`: f32 moments of 0 to 1 at which equal parts of the light have come in;
        `rolling_duration`: float, only with a rolling shutter."""
    def set_mesh_motion(self, handle: int, values: dict[str, f32]) -> None:
        """`positions` (moments * V, 3), and `normals` in the same way of the corner normals, where the mesh has none of the
        vertex normals. Until the mesh is set again."""
    def set_lights(self, lights: list[dict[str, Any]]) -> None:
        """Replaces all lamps. `linking`: a pair as in ObjectArrays; `attributes`: a list of (name, 1 to 4 numbers)."""
    def add_shader(self, name: str, graph: dict[str, Any], values: dict[str, Any]) -> int:
        """graph = {"nodes": [{"type", "name", "properties": {name: number | str | f32 array},
                               "inputs": [(identifier, kind, value, hidden_value, from_node, from_output)],
                               "outputs": [(identifier, kind, value)]}], "output_node": int}
        kind: "FLOAT" "INT" "BOOL" "VECTOR" "COLOR" "SHADER"; value: float or tuple; from_node -1 when unlinked.
        values: fields of scene::Shader (pass_index, sample_as_light, ...)."""
    def set_shader(self, handle: int, name: str, graph: dict[str, Any], values: dict[str, Any]) -> None: ...
    def remove_shader(self, handle: int) -> None: ...
    def add_image(self, values: dict[str, Any]) -> int:
        """Fields of scene::Image; bytes: bytes; pixels: f32 (h*w*4,)."""
    def set_image(self, handle: int, values: dict[str, Any]) -> None: ...
    def remove_image(self, handle: int) -> None: ...

    # -- the render
    def start(self) -> None: ...
    def wait(self, milliseconds: int) -> bool:
        """True when the session no longer runs (done, cancelled, failed)."""
    def cancel(self) -> None: ...
    def stop(self) -> None: ...
    def pause(self, paused: bool) -> None: ...
    def progress(self) -> Progress: ...
    def statistics(self) -> dict[str, Any]: ...
    def error(self) -> str: ...
    def report(self) -> list[tuple[str, str, str, int]]:
        """(level "info" | "warning" | "error", text, where, count)"""
    def size(self) -> tuple[int, int]:
        """Width and height of the rendered area."""
    def read_pass(self, name: str) -> f32 | None:
        """(height * width, channels), bottom row first; None before the first sample or when it was not asked for."""
    def set_denoiser(self, library_dirs: list[str] | None) -> None:
        """From the next start on Combined is denoised in the background when its samples are done (state still "rendering",
        status "Denoising"); cancel and edits end that too. None: not denoised."""
    def read_denoised(self) -> f32 | None:
        """Denoised Combined (height * width, 4); None while there is none. The report warns when there cannot be one."""
    def dump(self, path: str) -> None: ...
