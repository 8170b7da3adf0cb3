"""Adaptive subdivision: the mesh as it is before its last modifier, which the engine does in that modifier's place.

Until 4.2 Cycles dices what the modifier has already subdivided; later it dices what goes into the modifier. A Python
engine is given the subdivided mesh in all versions: what goes in is had by switching the modifier off in the evaluated
copy of the object, which is nobody's but the depsgraph's, for as long as it takes to evaluate the object once more.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import bpy
import numpy as np

from .. import versions
from .camera import camera_values
from .context import SyncContext
from .mesh import F32, read_column

DICES_BEFORE_MODIFIER = "open_adaptive_subdivision_panel" in bpy.types.SubsurfModifier.bl_rna.properties
IN_MODIFIER = "use_adaptive_subdivision" in bpy.types.SubsurfModifier.bl_rna.properties
SHARPNESS = 10.0
"""Of a full crease."""
UV_SMOOTHING = {
    "NONE": "none",
    "PRESERVE_CORNERS": "corners",
    "PRESERVE_CORNERS_AND_JUNCTIONS": "junctions",
    "PRESERVE_CORNERS_JUNCTIONS_AND_CONCAVE": "concave",
    "PRESERVE_BOUNDARIES": "borders",
    "SMOOTH_ALL": "all",
}


@dataclass
class Dicing:
    """How an object's mesh is diced, as `_talbot.pyi`'s MeshArrays name it."""

    values: dict[str, Any]
    use_creases: bool


@dataclass
class DicingView:
    """Whose pixels are counted: the camera that was sent, the scene's own choice, whether meshes came after it."""

    used: bool = False
    stale: bool = True
    camera: dict[str, Any] = field(default_factory=dict)
    chosen: dict[str, Any] | None = None


def chosen_view(depsgraph: Any, scene: Any, width: int, height: int) -> dict[str, Any] | None:
    """The scene's dicing camera; None: the one that renders."""
    camera = versions.cycles_settings(scene).get("dicing_camera")
    if camera is None or camera.type != "CAMERA":
        return None
    camera = camera.evaluated_get(depsgraph)
    return camera_values(SyncContext(None), camera, scene.render, width, height, camera.matrix_world)


def dicing_of(context: SyncContext, obj: Any, scene: Any) -> Dicing | None:
    """None: the object is not subdivided adaptively."""
    modifier = obj.modifiers[-1] if obj.type == "MESH" and len(obj.modifiers) else None
    if modifier is None or modifier.type != "SUBSURF":
        return None
    if not (modifier.show_viewport if context.viewport else modifier.show_render):
        return None
    settings, own = versions.cycles_settings(scene), versions.cycles_settings(obj)
    rate = float(settings.get("preview_dicing_rate", 8.0) if context.viewport else settings.get("dicing_rate", 1.0))
    in_pixels = True
    if IN_MODIFIER:
        if not modifier.use_adaptive_subdivision:
            return None
        in_pixels = modifier.adaptive_space == "PIXEL"
        length = modifier.adaptive_pixel_size if in_pixels else modifier.adaptive_object_edge_length
    else:
        experimental = settings.get_enum("feature_set", ("SUPPORTED", "EXPERIMENTAL"), "SUPPORTED") == "EXPERIMENTAL"
        if not experimental or not own.get("use_adaptive_subdivision", False):
            return None
        length = float(own.get("dicing_rate", 1.0))
    length *= rate
    values = {
        "subdivision": "simple" if modifier.subdivision_type == "SIMPLE" else "catmull_clark",
        "uv_smoothing": UV_SMOOTHING[modifier.uv_smooth],
        "sharp_corners": modifier.boundary_smooth == "PRESERVE_CORNERS",
        "in_pixels": in_pixels,
        "edge_length": max(length, 0.1) if in_pixels else length,
        "max_level": max(1, min(int(settings.get("max_subdivisions", 12)), 16)),
    }
    return Dicing(values, modifier.use_creases or not DICES_BEFORE_MODIFIER)


@contextmanager
def cage_of(obj: Any, depsgraph: Any) -> Iterator[Any]:
    """The mesh of an evaluated object that is diced."""
    if not DICES_BEFORE_MODIFIER:
        yield obj.data
        return
    switch = "show_render" if depsgraph.mode == "RENDER" else "show_viewport"
    switches = np.empty(len(obj.modifiers), dtype=np.bool_)
    obj.modifiers.foreach_get(switch, switches)
    # In bulk: setting the property by its name would tell the whole of Blender that something changed.
    obj.modifiers.foreach_set(switch, np.append(switches[:-1], False))
    try:
        yield obj.to_mesh(preserve_all_data_layers=True, depsgraph=depsgraph)
    finally:
        obj.modifiers.foreach_set(switch, switches)
        obj.to_mesh_clear()


def add_cage(mesh: Any, dicing: Dicing, arrays: dict[str, Any]) -> None:
    """Adds the faces, the creases and how to dice them."""
    faces = len(mesh.polygons)
    starts = np.empty(faces + 1, dtype=np.uint32)
    mesh.polygons.foreach_get("loop_start", starts[:-1])
    starts[-1] = len(mesh.loops)
    arrays |= dicing.values | {"face_starts": starts}
    # A smooth limit surface has normals of its own.
    arrays.pop("corner_normals", None)
    if dicing.values["subdivision"] != "simple":
        arrays.pop("vertex_normals", None)
    if not dicing.use_creases:
        return
    edges = _creases(mesh, "crease_edge", "EDGE", mesh.edges)
    if edges is not None:
        which = np.flatnonzero(edges > 0)
        ends = read_column(mesh.edges, "vertices", len(mesh.edges), np.uint32, 2)
        arrays["crease_edges"] = np.ascontiguousarray(ends[which])
        arrays["crease_sharpness"] = np.ascontiguousarray(edges[which] * np.float32(SHARPNESS))
    layers = getattr(mesh, "vertex_creases", None)
    vertices = _creases(mesh, "crease_vert", "POINT", layers[0].data if layers else None)
    if vertices is not None:
        which = np.flatnonzero(vertices > 0)
        arrays["crease_vertices"] = which.astype(np.uint32)
        arrays["vertex_sharpness"] = np.ascontiguousarray(vertices[which] * np.float32(SHARPNESS))


def _creases(mesh: Any, name: str, domain: str, elements: Any) -> F32 | None:
    """An attribute since 4.0; before that the edges' own, and a layer of the vertices."""
    attribute = mesh.attributes.get(name)
    if attribute is not None and attribute.domain == domain and attribute.data_type == "FLOAT":
        return read_column(attribute.data, "value", len(attribute.data), np.float32)
    if not elements or ("crease" not in elements[0].bl_rna.properties and domain == "EDGE"):
        return None
    return read_column(elements, "crease" if domain == "EDGE" else "value", len(elements), np.float32)
