"""What a vertex knows of the mesh around it: how pointed it is, and which island it belongs to."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import native

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
I64 = NDArray[np.int64]


def _edges(mesh: Any) -> NDArray[np.uint32]:
    edges = np.empty(len(mesh.edges) * 2, dtype=np.uint32)
    mesh.edges.foreach_get("vertices", edges)
    return edges


def _sum_at(index: I64, values: F64, count: int) -> F64:
    """Sums of the rows of `values` by index."""
    if values.ndim == 1:
        return np.bincount(index, values, count)
    return np.stack([np.bincount(index, column, count) for column in values.T], axis=1)


def pointiness(mesh: Any, positions: F32) -> F32:
    """Angle between normal and mean edge direction, a vertex, in half turns; blurred once over the edges. Vertices in
    the same place count as one."""
    count = len(positions)
    unique, place = np.unique(positions + 0.0, axis=0, return_inverse=True)
    place = place.reshape(-1).astype(np.int64)
    number = len(unique)
    normals = np.empty(count * 3, dtype=np.float32)
    (mesh.vertex_normals if hasattr(mesh, "vertex_normals") else mesh.vertices).foreach_get(
        "vector" if hasattr(mesh, "vertex_normals") else "normal", normals
    )
    shared = np.maximum(np.bincount(place, minlength=number), 1)[:, None]
    normal = _sum_at(place, normals.reshape(count, 3).astype(np.float64), number) / shared

    edges = np.sort(place[_edges(mesh).astype(np.int64)].reshape(-1, 2), axis=1)
    edges = np.unique(edges[edges[:, 0] != edges[:, 1]], axis=0)
    first, second = edges[:, 0], edges[:, 1]
    direction = unique[second].astype(np.float64) - unique[first]
    direction /= np.maximum(np.linalg.norm(direction, axis=1, keepdims=True), 1e-30)
    degree = np.bincount(first, minlength=number) + np.bincount(second, minlength=number)
    mean = (_sum_at(first, direction, number) - _sum_at(second, direction, number)) / np.maximum(degree, 1)[:, None]
    raw = np.arccos(np.clip((normal * mean).sum(axis=1), -1.0, 1.0)) / np.pi
    raw[degree == 0] = 0.0
    blurred = (raw + _sum_at(first, raw[second], number) + _sum_at(second, raw[first], number)) / (degree + 1)
    return blurred[place].astype(np.float32)


def random_per_island(mesh: Any, vertices: int) -> F32:
    """A number for each vertex, the same all over its island."""
    return np.frombuffer(native.module().random_per_island(vertices, _edges(mesh)), dtype=np.float32)
