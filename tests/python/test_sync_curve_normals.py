"""Normals of Curves: which way the long axis of elliptic strands points."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
import pytest
from talbot.sync.curve_normals import curve_normals

pytestmark = pytest.mark.skipif(bpy.app.version < (4, 5, 0), reason="Python cannot make Curves before 4.5")


def make(points: list[list[tuple[float, float, float]]], **values: tuple[str, str, Any]) -> tuple[Any, Any, Any]:
    """A Curves datablock with attributes NAME=(kind, domain, value of all)."""
    data = bpy.data.hair_curves.new("Strands")
    data.add_curves([len(p) for p in points])
    positions = np.array([p for curve in points for p in curve], dtype=np.float32)
    data.attributes["position"].data.foreach_set("vector", positions.ravel())
    for name, (kind, domain, value) in values.items():
        for item in (data.attributes.get(name) or data.attributes.new(name, kind, domain)).data:
            item.value = value
    starts = np.cumsum([0] + [len(p) for p in points]).astype(np.uint32)
    return data, positions, starts


def test_the_first_is_level_and_others_follow_by_minimum_twist(empty_scene: Any) -> None:
    arc = [(0.0, float(np.sin(a)), float(1 - np.cos(a))) for a in np.linspace(0, np.pi / 2, 9)]
    data, positions, starts = make([arc, [(0, 0, 0), (0, 0, 1)], [(0, 0, 0), (1, 1, 0)]])
    normals = curve_normals(data, positions, starts)
    assert np.allclose(normals[:9], (1, 0, 0), atol=1e-5)  # across the plane of the arc all along
    assert np.allclose(normals[9:11], (1, 0, 0))  # upright
    assert np.allclose(normals[11:], (np.sqrt(0.5), -np.sqrt(0.5), 0))


def test_they_stand_on_the_curve_and_do_not_twist(empty_scene: Any) -> None:
    random = np.random.default_rng(1)
    curves = [np.cumsum(random.normal(size=(12, 3)) * 0.2 + (0.2, 0.4, 1), axis=0).tolist() for _ in range(50)]
    data, positions, starts = make(curves)
    normals = curve_normals(data, positions, starts).reshape(50, 12, 3)
    p = positions.reshape(50, 12, 3)
    along = p[:, 2:] - p[:, :-2]
    along /= np.linalg.norm(along, axis=2, keepdims=True)
    assert np.allclose(np.linalg.norm(normals, axis=2), 1, atol=1e-5)
    assert np.abs((normals[:, 1:-1] * along).sum(axis=2)).max() < 1e-5
    # From one to the next only the part that the tangents' turn asks for: nothing about the curve.
    twist = (np.cross(normals[:, 1:-2], normals[:, 2:-1]) * (along[:, 1:] + along[:, :-1])).sum(axis=2)
    assert np.abs(twist).max() < 0.2


def test_tilt_and_modes(empty_scene: Any) -> None:
    line = [(0.0, float(y), 0.0) for y in range(3)]
    data, positions, starts = make([line], tilt=("FLOAT", "POINT", np.pi / 2))
    assert np.allclose(curve_normals(data, positions, starts), (0, 0, -1), atol=1e-6)  # x turned about y
    climb = [(0, 0, 0), (1, 0, 1), (1, 1, 2)]
    data, positions, starts = make([climb], normal_mode=("INT8", "CURVE", 1))
    assert np.allclose(curve_normals(data, positions, starts)[:, 2], 0)


def test_a_closed_curve_closes(empty_scene: Any) -> None:
    angles = np.linspace(0, 2 * np.pi, 65)[:-1]
    ring = [(float(np.cos(a)), float(np.sin(a)), float(0.3 * np.sin(2 * a))) for a in angles]
    data, positions, starts = make([ring], cyclic=("BOOLEAN", "CURVE", True))
    normals = curve_normals(data, positions, starts)
    assert (normals[-1] * normals[0]).sum() > 0.98
    assert (normals[1:] * normals[:-1]).sum(axis=1).min() > 0.98


def test_points_without_a_direction_have_a_normal(empty_scene: Any) -> None:
    data, positions, starts = make([[(1, 2, 3)], [(0, 0, 0), (0, 0, 0)]])
    assert np.allclose(curve_normals(data, positions, starts), (1, 0, 0))
