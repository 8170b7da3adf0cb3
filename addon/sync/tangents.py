"""Tangents for normal maps: unit tangent and the sign of the bitangent, a corner.

Blender computes MikkTSpace for triangles and quads. Meshes with larger faces get the same average over their triangles
[Mikkelsen 2008, "Simulation of Wrinkled Surfaces Revisited"]: the corner angles weigh, corners are joined where
position, normal, UV and handedness agree.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

F32 = NDArray[np.float32]


def corner_tangents(mesh: Any, uv_name: str, uv: F32, arrays: dict[str, Any]) -> F32:
    """(C, 4): tangent and sign."""
    corners = len(mesh.loops)
    try:
        mesh.calc_tangents(uvmap=uv_name)
    except RuntimeError:
        return _tangents_of(uv, arrays)
    tangents = np.empty(corners * 3, dtype=np.float32)
    signs = np.empty(corners, dtype=np.float32)
    mesh.loops.foreach_get("tangent", tangents)
    mesh.loops.foreach_get("bitangent_sign", signs)
    mesh.free_tangents()
    return np.concatenate((tangents.reshape(corners, 3), signs[:, None]), axis=1, dtype=np.float32)


def _unit(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.divide(vectors, lengths, out=np.zeros_like(vectors), where=lengths > 0)


def tangents_without_map(generated: F32, arrays: dict[str, Any], unfold: bool) -> F32:
    """(C, 4) where there is no UV map: it is longitude and latitude around the middle of the texture space then.

    `unfold`: triangles do not run back around the ball where the longitude begins again.
    """
    x, y, z = (generated.astype(np.float64) - 0.5).T
    length = np.sqrt(x * x + y * y + z * z)
    u = np.where((x != 0) | (y != 0), 0.5 - np.arctan2(x, y) / (2 * np.pi), 0.0)
    v = 1 - np.arccos(np.clip(np.divide(z, length, out=np.zeros_like(z), where=length > 0), -1, 1)) / np.pi
    uv = np.where(length[:, None] > 0, np.stack((u, v), axis=1), 0.0).astype(np.float32)[arrays["corner_vertices"]]
    if unfold:
        corners = arrays["triangle_corners"].reshape(-1, 3)
        corners = corners[np.ptp(uv[corners, 0], axis=1) >= 0.5].reshape(-1)
        uv[corners[uv[corners, 0] >= 0.5], 0] -= 1.0
    return _tangents_of(uv, arrays)


def _tangents_of(uv: F32, arrays: dict[str, Any]) -> F32:
    """(C, 4) for (C, 2) coordinates."""
    triangles = arrays["triangle_corners"].astype(np.int64)
    vertices = arrays["corner_vertices"].astype(np.int64)[triangles]
    points = arrays["positions"].astype(np.float64)[vertices]
    coordinates = uv.astype(np.float64)[triangles]
    normals = _corner_normals(arrays, triangles, vertices, points)

    edge1, edge2 = points[:, 1] - points[:, 0], points[:, 2] - points[:, 0]
    d1, d2 = coordinates[:, 1] - coordinates[:, 0], coordinates[:, 2] - coordinates[:, 0]
    area = d1[:, 0] * d2[:, 1] - d1[:, 1] * d2[:, 0]
    sign = np.where(area >= 0, 1.0, -1.0)
    tangent = (edge1 * d2[:, 1:2] - edge2 * d1[:, 1:2]) * sign[:, None]

    # Each corner's share: the tangent in the corner's tangent plane, weighed by the corner's angle.
    tangent = np.repeat(tangent[:, None, :], 3, axis=1)
    tangent = _unit(tangent - normals * np.sum(normals * tangent, axis=-1, keepdims=True))
    after, before = _unit(np.roll(points, -1, axis=1) - points), _unit(np.roll(points, 1, axis=1) - points)
    angle = np.arccos(np.clip(np.sum(after * before, axis=-1), -1.0, 1.0))
    share = (tangent * angle[..., None]).reshape(-1, 3)

    keys = np.concatenate(
        (vertices.reshape(-1, 1), normals.reshape(-1, 3), coordinates.reshape(-1, 2), np.repeat(sign, 3)[:, None]),
        axis=1,
    )
    _, group = np.unique(keys, axis=0, return_inverse=True)
    group = group.reshape(-1)
    total = np.zeros((int(group.max()) + 1, 3)) if len(group) else np.zeros((0, 3))
    np.add.at(total, group, share)

    out = np.zeros((len(uv), 4), dtype=np.float32)
    out[:, 0] = 1.0
    out[:, 3] = 1.0
    corner = triangles.reshape(-1)
    out[corner, :3] = _unit(total)[group]
    out[corner, 3] = np.repeat(sign, 3)
    return out


def _corner_normals(
    arrays: dict[str, Any], triangles: NDArray[np.int64], vertices: NDArray[np.int64], points: NDArray[np.float64]
) -> NDArray[np.float64]:
    if "corner_normals" in arrays:
        return arrays["corner_normals"].astype(np.float64)[triangles]
    flat = _unit(np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0]))
    flat = np.repeat(flat[:, None, :], 3, axis=1)
    if "vertex_normals" not in arrays:
        return flat
    smooth = arrays["face_smooth"].astype(bool)[arrays["triangle_faces"].astype(np.int64)]
    return np.where(smooth[:, None, None], arrays["vertex_normals"].astype(np.float64)[vertices], flat)
