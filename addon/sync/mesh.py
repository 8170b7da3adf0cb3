"""An evaluated mesh as arrays.

Blender 3.4 and 4.2 keep the same things in different places; where, is found by asking, not by number.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..versions import flat_faces_split_normals
from .context import (
    ACTIVE_COLOR,
    ACTIVE_TANGENT,
    ACTIVE_UV,
    GENERATED,
    INSTANCER,
    ISLAND,
    POINTINESS,
    PROPERTY_PREFIXES,
    UNMAPPED_TANGENT,
    SyncContext,
)
from .generated import generated_of, texture_space
from .tangents import corner_tangents, tangents_without_map
from .topology import pointiness, random_per_island

F32 = NDArray[np.float32]

VALUE_FIELDS = {
    "FLOAT": ("value", 1),
    "INT": ("value", 1),
    "INT8": ("value", 1),
    "BOOLEAN": ("value", 1),
    "FLOAT2": ("vector", 2),
    "FLOAT_VECTOR": ("vector", 3),
    "FLOAT_COLOR": ("color", 4),
    "BYTE_COLOR": ("color", 4),
    "QUATERNION": ("value", 4),
}
"""Where a generic attribute keeps its values, and how many there are. `color` of byte colours is linear already."""
INTEGERS = {"INT": np.int32, "INT8": np.int32, "BOOLEAN": np.bool_}
NO_MAP = "@tangent:"
"""Tangents where there is no UV map."""
DOMAINS = {"POINT": "VERTEX", "CORNER": "CORNER", "FACE": "FACE", "EDGE": "VERTEX"}


def read_column(collection: Any, field: str, count: int, dtype: Any, columns: int = 1) -> Any:
    """`count` elements of a collection by foreach_get. Of another dtype than the stored one Blender converts
    item by item."""
    values = np.empty(count * columns, dtype=dtype)
    if count:
        collection.foreach_get(field, values)
    return values if columns == 1 else values.reshape(count, columns)


def read_mesh(context: SyncContext, mesh: Any) -> dict[str, Any] | None:
    """The arrays of `_talbot.pyi`'s MeshArrays; None for a mesh without faces."""
    if not len(mesh.polygons):
        return None
    mesh.calc_loop_triangles()
    arrays = _topology(mesh)
    arrays["face_smooth"] = face_smooth(mesh)
    read_normals(mesh, arrays)
    attributes = _attributes(context, mesh, arrays)
    if attributes:
        arrays["attributes"] = attributes
    active = _active_uv(mesh)
    if active is not None:
        arrays["active_uv"] = active.name
    arrays["active_color"] = _active_color(mesh)
    return arrays


def _topology(mesh: Any) -> dict[str, Any]:
    vertices, corners, triangles, faces = (
        len(mesh.vertices),
        len(mesh.loops),
        len(mesh.loop_triangles),
        len(mesh.polygons),
    )
    attributes = mesh.attributes
    position, corner_vert = attributes.get("position"), attributes.get(".corner_vert")
    if position is not None:
        positions = read_column(position.data, "vector", vertices, np.float32, 3)
    else:
        positions = read_column(mesh.vertices, "co", vertices, np.float32, 3)
    if corner_vert is not None:
        corner_vertices = read_column(corner_vert.data, "value", corners, np.int32).view(np.uint32)
    else:
        corner_vertices = read_column(mesh.loops, "vertex_index", corners, np.uint32)
    if hasattr(mesh, "loop_triangle_polygons"):
        triangle_faces = read_column(mesh.loop_triangle_polygons, "value", triangles, np.int32).view(np.uint32)
    else:
        triangle_faces = read_column(mesh.loop_triangles, "polygon_index", triangles, np.uint32)
    arrays = {
        "positions": positions,
        "corner_vertices": corner_vertices,
        "triangle_corners": read_column(mesh.loop_triangles, "loops", triangles, np.uint32, 3),
        "triangle_faces": triangle_faces,
    }
    material = attributes.get("material_index")
    if material is not None and material.domain == "FACE" and material.data_type == "INT":
        arrays["face_materials"] = read_column(material.data, "value", faces, np.int32)
    elif len(mesh.materials) > 1:
        arrays["face_materials"] = read_column(mesh.polygons, "material_index", faces, np.uint32).view(np.int32)
    return arrays


def face_smooth(mesh: Any) -> NDArray[np.uint8]:
    """1 where a face is smooth."""
    faces = len(mesh.polygons)
    if not hasattr(mesh, "corner_normals"):
        return read_column(mesh.polygons, "use_smooth", faces, np.bool_).view(np.uint8)
    sharp = mesh.attributes.get("sharp_face")
    if sharp is None or sharp.domain != "FACE":
        return np.ones(faces, dtype=np.uint8)
    return np.logical_not(read_column(sharp.data, "value", faces, np.bool_)).view(np.uint8)


def _has_sharp_edges(mesh: Any) -> bool:
    sharp = mesh.attributes.get("sharp_edge")
    if sharp is None or sharp.domain != "EDGE":
        return False
    return bool(read_column(sharp.data, "value", len(mesh.edges), np.bool_).any())


def read_normals(mesh: Any, arrays: dict[str, Any]) -> None:
    """Vertex normals where faces are smooth; corner normals only where sharp edges or custom normals
    make them differ."""
    if hasattr(mesh, "corner_normals"):
        split = mesh.normals_domain == "CORNER" and (
            flat_faces_split_normals() or mesh.has_custom_normals or _has_sharp_edges(mesh)
        )
        if mesh.normals_domain == "FACE":  # all edges are sharp
            arrays["face_smooth"] = np.zeros(len(mesh.polygons), dtype=np.uint8)
        if split:
            arrays["corner_normals"] = read_column(mesh.corner_normals, "vector", len(mesh.loops), np.float32, 3)
            if mesh.has_custom_normals:
                arrays["face_smooth"] = np.ones(len(mesh.polygons), dtype=np.uint8)
    else:
        split = mesh.use_auto_smooth
        if split:
            mesh.calc_normals_split()
            arrays["corner_normals"] = read_column(mesh.loops, "normal", len(mesh.loops), np.float32, 3)
            mesh.free_normals_split()
            if mesh.has_custom_normals:
                arrays["face_smooth"] = np.ones(len(mesh.polygons), dtype=np.uint8)
    if not split and arrays["face_smooth"].any():
        arrays["vertex_normals"] = read_column(mesh.vertex_normals, "vector", len(mesh.vertices), np.float32, 3)


# -- attributes


def _active_uv(mesh: Any) -> Any:
    return next((layer for layer in mesh.uv_layers if layer.active_render), None)


def _active_color(mesh: Any) -> str:
    colors = mesh.color_attributes
    name = getattr(colors, "default_color_name", "")
    if name:
        return name
    index = colors.render_color_index
    return colors[index].name if 0 <= index < len(colors) else ""


def _read_uv(mesh: Any, name: str) -> F32 | None:
    layer = mesh.uv_layers.get(name)
    if layer is None:
        return None
    if hasattr(layer, "uv"):
        return read_column(layer.uv, "vector", len(mesh.loops), np.float32, 2)
    return read_column(layer.data, "uv", len(mesh.loops), np.float32, 2)


def _attributes(context: SyncContext, mesh: Any, arrays: dict[str, Any]) -> list[tuple[str, str, bool, Any]]:
    """What shaders ask for and this mesh has."""
    wanted: set[str] = set()
    active = _active_uv(mesh)
    for name in context.wanted:
        if name == ACTIVE_UV:
            wanted.add(active.name if active is not None else "")
        elif name == ACTIVE_COLOR:
            wanted.add(_active_color(mesh))
        elif name == ACTIVE_TANGENT:
            wanted.add(f"@tangent:{active.name}" if active is not None else _unmapped_tangent(context, mesh))
        elif name.startswith(UNMAPPED_TANGENT):
            continue
        elif not name.startswith(tuple(PROPERTY_PREFIXES.values())) and name != INSTANCER:
            wanted.add(name)
    wanted.discard("")
    out: list[tuple[str, str, bool, Any]] = []
    for name in sorted(wanted):
        if name == GENERATED:
            out += _generated(mesh, arrays)
            continue
        if name.startswith("@tangent:"):
            uv = _read_uv(mesh, name.removeprefix("@tangent:"))
            if uv is not None:
                out.append((name, "CORNER", False, corner_tangents(mesh, name.removeprefix("@tangent:"), uv, arrays)))
            elif name == NO_MAP:
                context.check()
                generated = generated_of(mesh, _undeformed(mesh))
                out.append((name, "CORNER", False, tangents_without_map(generated, arrays, context.version >= 500)))
            continue
        if name == POINTINESS:
            out.append((name, "VERTEX", False, pointiness(mesh, arrays["positions"])))
            continue
        if name == ISLAND:
            out.append((name, "VERTEX", False, random_per_island(mesh, len(mesh.vertices))))
            continue
        uv = _read_uv(mesh, name)
        if uv is not None:
            out.append((name, "CORNER", False, uv))
            continue
        attribute = mesh.attributes.get(name)
        if attribute is not None:
            out += _generic(context, mesh, attribute)
    return out


def _unmapped_tangent(context: SyncContext, mesh: Any) -> str:
    """Where there is no map: costly, so for materials that ask. An empty slot's may be the object's."""
    owners = (f"{UNMAPPED_TANGENT}Material '{item.name}'" if item is not None else "" for item in mesh.materials)
    return NO_MAP if any(not owner or owner in context.wanted for owner in owners) else ""


def _generic(context: SyncContext, mesh: Any, attribute: Any) -> list[tuple[str, str, bool, Any]]:
    kind, domain = attribute.data_type, DOMAINS.get(attribute.domain)
    if kind not in VALUE_FIELDS or domain is None:
        context.warn(f"Mesh '{mesh.name}': attribute '{attribute.name}' ({kind}, {attribute.domain}) is not supported")
        return []
    field, columns = VALUE_FIELDS[kind]
    values = read_column(attribute.data, field, len(attribute.data), INTEGERS.get(kind, np.float32), columns)
    values = np.ascontiguousarray(values, dtype=np.float32)
    if attribute.domain == "EDGE":
        values = _edges_to_vertices(mesh, values.reshape(len(mesh.edges), columns)).reshape(-1, columns)
        values = values.reshape(-1) if columns == 1 else values
    return [(attribute.name, domain, kind in ("FLOAT_COLOR", "BYTE_COLOR"), values)]


def _edges_to_vertices(mesh: Any, values: F32) -> F32:
    """A vertex gets the mean of its edges."""
    edges = read_column(mesh.edges, "vertices", len(mesh.edges), np.uint32, 2).astype(np.int64)
    total = np.zeros((len(mesh.vertices), values.shape[1]), dtype=np.float32)
    count = np.zeros(len(mesh.vertices), dtype=np.float32)
    for end in (0, 1):
        np.add.at(total, edges[:, end], values)
        np.add.at(count, edges[:, end], 1.0)
    return total / np.maximum(count, 1.0)[:, None]


def _undeformed(mesh: Any) -> F32:
    return read_column(mesh.vertices, "undeformed_co", len(mesh.vertices), np.float32, 3)


def _generated(mesh: Any, arrays: dict[str, Any]) -> list[tuple[str, str, bool, Any]]:
    """An offset and a scale, or values a vertex where modifiers deform."""
    scale, offset = texture_space(mesh)
    arrays["generated_scale"] = tuple(float(v) for v in scale)
    arrays["generated_offset"] = tuple(float(v) for v in offset)
    undeformed = _undeformed(mesh)
    extent = float(np.abs(mesh.texspace_size).max())
    if np.allclose(undeformed, arrays["positions"], rtol=0, atol=1e-5 * max(extent, 1e-6)):
        return []
    return [(GENERATED, "VERTEX", False, generated_of(mesh, undeformed))]
