"""Normals of a Curves datablock at its points. Blender's own (`Curves.normals`) cannot be read: `foreach_get` copies
them after Blender has freed them (seen in 4.5 and 5.0), so the first are wrong, and of millions the process ends.

As in Blender: by minimum twist from a first normal that is level, or level everywhere, or stored; turned by the tilt.
Tangents are taken at the points themselves.
"""

from typing import Any

import numpy as np

from .mesh import F32, read_column

Z_UP, FREE = 1, 2  # values of the attribute normal_mode; 0: minimum twist
POLY = 1  # of curve_type
LEVEL = 1e-4  # tangents nearer to the z axis have the x axis for a normal


def curve_normals(data: Any, positions: F32, starts: np.ndarray) -> F32:
    """positions: (points, 3); starts: the first point of each curve, and the number of points. Returns (points, 3)."""
    begin, end = starts[:-1].astype(np.int64), starts[1:].astype(np.int64)
    keys = len(positions)
    types = _values(data, "curve_type", "CURVE", len(begin), np.int32)
    modes = _values(data, "normal_mode", "CURVE", len(begin), np.int32)
    cyclic = _values(data, "cyclic", "CURVE", len(begin), bool)
    tangents = _tangents(positions, begin, end, np.repeat(types == POLY, end - begin), cyclic)
    normals = _level(tangents)
    twisted = (modes != Z_UP) & (end - begin > 1)
    _carry_on(normals, tangents, begin[twisted], end[twisted])
    _close(normals, tangents, begin[twisted & cyclic], end[twisted & cyclic])
    stored = data.attributes.get("custom_normal")
    if stored is not None and stored.domain == "POINT" and stored.data_type == "FLOAT_VECTOR":
        free = np.repeat(modes == FREE, end - begin)
        normals[free] = _unit(read_column(stored.data, "vector", keys, np.float32, 3)[free])
    tilt = _values(data, "tilt", "POINT", keys, np.float32)
    turned = tilt != 0
    normals[turned] = _turn(normals[turned], tangents[turned], tilt[turned])
    return normals


def _values(data: Any, name: str, domain: str, count: int, dtype: Any) -> np.ndarray:
    """An attribute's numbers, 0 where there is none."""
    attribute = data.attributes.get(name)
    if attribute is None or attribute.domain != domain or len(attribute.data) != count:
        return np.zeros(count, dtype=dtype)
    return read_column(attribute.data, "value", count, dtype)


def _unit(v: F32) -> F32:
    length = np.linalg.norm(v, axis=1, keepdims=True)
    return v / np.where(length > 0, length, 1.0)


def _tangents(positions: F32, begin: np.ndarray, end: np.ndarray, straight: np.ndarray, cyclic: np.ndarray) -> F32:
    """Of straight lines the mean of both directions, of curves from neighbour to neighbour; at ends the only one."""
    ahead, behind = np.zeros_like(positions), np.zeros_like(positions)
    ahead[:-1] = np.diff(positions, axis=0)
    ahead[end - 1] = np.where(cyclic[:, None], positions[begin] - positions[end - 1], 0.0)
    behind[1:] = ahead[:-1]
    behind[begin] = np.where(cyclic[:, None], ahead[end - 1], 0.0)
    scale = straight[:, None]
    return _unit(np.where(scale, _unit(ahead) + _unit(behind), ahead + behind))


def _level(tangents: F32) -> F32:
    normals = np.stack([tangents[:, 1], -tangents[:, 0], np.zeros(len(tangents), np.float32)], axis=1)
    upright = np.abs(tangents[:, 0]) + np.abs(tangents[:, 1]) < LEVEL
    normals[upright] = (1.0, 0.0, 0.0)
    return _unit(normals)


def _turn(v: F32, axis: F32, angle: F32) -> F32:
    """[Rodrigues 1840]; axes of length 1."""
    c, s = np.cos(angle)[:, None], np.sin(angle)[:, None]
    along = np.einsum("ij,ij->i", axis, v)[:, None]
    return v * c + np.cross(axis, v) * s + axis * along * (1 - c)


def _carried(normals: F32, before: F32, after: F32) -> F32:
    """Turned as the tangents turn."""
    axis = np.cross(before, after)
    sine = np.linalg.norm(axis, axis=1)
    angle = np.arctan2(sine, np.einsum("ij,ij->i", before, after))
    axis /= np.where(sine > 0, sine, 1.0)[:, None]
    return np.where((sine > 0)[:, None], _turn(normals, axis, angle), normals)


def _carry_on(normals: F32, tangents: F32, begin: np.ndarray, end: np.ndarray) -> None:
    """One point of all curves after another."""
    at = begin + 1
    while len(at):
        normals[at] = _carried(normals[at - 1], tangents[at - 1], tangents[at])
        longer = at + 1 < end
        at, end = at[longer] + 1, end[longer]


def _close(normals: F32, tangents: F32, begin: np.ndarray, end: np.ndarray) -> None:
    """Closed curves: what is missing to the first normal is shared by all points."""
    if not len(begin):
        return
    first, axis = normals[begin], tangents[begin]
    last = _carried(normals[end - 1], tangents[end - 1], axis)
    missing = np.arctan2(np.einsum("ij,ij->i", axis, np.cross(last, first)), np.einsum("ij,ij->i", last, first))
    counts = end - begin
    offsets = np.cumsum(counts) - counts
    step = np.arange(counts.sum()) - np.repeat(offsets, counts)
    at = np.repeat(begin, counts) + step
    normals[at] = _turn(normals[at], tangents[at], (step * np.repeat(missing / counts, counts)).astype(np.float32))
