"""Simplify's culling: which objects are left out, against Cycles and by closed form."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from pair_scenes import add_box, add_object, add_plane, diffuse, glow, look_at, look_down
from pairs import Bounds, agree
from sync_recorder import synchronise
from talbot.sync.culling import Culling


def culled(obj: Any, frame: bool = False, distance: bool = False) -> Any:
    """An object with culling switched on."""
    obj.cycles.use_camera_cull, obj.cycles.use_distance_cull = frame, distance
    return obj


def simplify(scene: Any, **margins: float) -> None:
    """Culling by what is named: `camera` and `distance` margins."""
    scene.render.use_simplify = True
    for name, margin in margins.items():
        setattr(scene.cycles, f"use_{name}_cull", True)
        setattr(scene.cycles, f"{name}_cull_margin", margin)


def straight(perspective: bool = True) -> Culling:
    """A camera at the origin that looks along -Z, one unit to each side of the axis at distance 1."""
    return Culling(np.eye(4), np.zeros(3), (-1.0, 1.0, -1.0, 1.0), (0.1, 100.0), perspective, 0.1, 10.0)


def unit_boxes(places: list[tuple[float, float, float]]) -> tuple[Any, Any]:
    """Boxes of side 1 around the places, and their matrices."""
    box = np.array([(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)], np.float32)
    matrices = np.tile(np.eye(4, dtype=np.float32), (len(places), 1, 1))
    matrices[:, 3, :3] = places
    return np.tile(box, (len(places), 1, 1)), matrices.reshape(-1, 16)


def test_frame_and_distance() -> None:
    """Boxes in the middle, beyond the right edge (at 1.2 times the depth, with the margin), within it, behind, far."""
    places = [(0.0, 0.0, -5.0), (7.2, 0.0, -5.0), (7.0, 0.0, -5.0), (0.0, 0.0, 5.0), (0.0, 0.0, -30.0)]
    boxes, matrices = unit_boxes(places)
    all_, none = np.ones(5, np.bool_), np.zeros(5, np.bool_)
    assert straight().hidden(boxes, matrices, all_, none).tolist() == [False, True, False, True, False]
    assert straight().hidden(boxes, matrices, none, all_).tolist() == [False, False, False, False, True]
    # With both rules an object must break both.
    assert straight().hidden(boxes, matrices, all_, all_).tolist() == [False] * 5
    assert straight().hidden(boxes, matrices, none, none).tolist() == [False] * 5


def test_orthographic_frame() -> None:
    """The frame ends at 1 at any distance; 0.2 more are the margin."""
    boxes, matrices = unit_boxes([(1.6, 0.0, -5.0), (1.8, 0.0, -5.0), (0.0, -1.8, -50.0), (0.0, 0.0, 1.5)])
    all_, none = np.ones(4, np.bool_), np.zeros(4, np.bool_)
    assert straight(False).hidden(boxes, matrices, all_, none).tolist() == [False, True, True, False]


@pytest.mark.parametrize("camera", ["perspective", "orthographic"])
def test_beside_cycles(pair_scene: Any, tmp_path: Path, camera: str) -> None:
    """Boxes in and around the frame light a ceiling: those that are left out do not."""
    if camera == "perspective":
        look_at(pair_scene, (0.0, -8.0, 1.0), (0.0, 0.0, 1.0), 35.0)
    else:
        look_down(pair_scene, 6.0)
    simplify(pair_scene, camera=0.1, distance=9.0)
    for number, place in enumerate((x, y, 0.0) for x in (-6.0, -3.5, 0.0, 3.5, 6.0) for y in (-10.0, -4.3, 0.0, 6.0)):
        box = add_box(
            glow((0.2 + 0.1 * (number % 7), 0.5, 1.0 - 0.1 * (number % 5)), 3.0), (0.8, 0.8, 0.8), location=place
        )
        culled(box, frame=number % 3 != 2, distance=number % 3 != 0)
    add_plane(diffuse(), 40.0, location=(0, 0, 3 if camera == "perspective" else -1))
    pair_scene.cycles.max_bounces = 1
    agree(pair_scene, tmp_path, samples=256, batches=8, bounds=Bounds(0.02, 0.1, 0.002))


def test_instances_one_by_one(pair_scene: Any, tmp_path: Path) -> None:
    """Instances of a collection: each is judged where it stands; the mesh of objects without a place is not sent."""
    look_down(pair_scene, 4.0)
    simplify(pair_scene, camera=0.0)
    inner = bpy.data.collections.new("Inner")
    box = culled(add_box(glow((1.0, 0.4, 0.2)), (0.5, 0.5, 0.5)), frame=True)
    pair_scene.collection.objects.unlink(box)
    inner.objects.link(box)
    for x in (-1.0, 1.0, 5.0):
        empty = add_object(None, (x, 0.0, 0.0))
        empty.instance_type, empty.instance_collection = "COLLECTION", inner
    culled(add_box(glow(), location=(30, 0, 0)), frame=True)
    agree(pair_scene, tmp_path, samples=64)


def test_viewport(empty_scene: Any) -> None:
    """By the view of when something was edited; without a view nothing is left out."""
    simplify(empty_scene, camera=0.1)
    for x in (0.0, 30.0):
        culled(add_box(diffuse(), location=(x, 0, 0)), frame=True)
    session, sync, _ = synchronise(viewport=True)
    assert len(session.objects["mesh"]) == 2
    depsgraph = bpy.context.evaluated_depsgraph_get()

    def shown_from(x: float) -> list[float]:
        view = {"type": "orthographic", "view": (-3.0, 3.0, -3.0, 3.0), "clip_start": 0.1, "clip_end": 100.0}
        view["to_world"] = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, x, 0, 20, 1]
        sync.full(depsgraph, empty_scene, bpy.context.view_layer, width=64, height=64, viewport=True, view=view)
        return session.objects["matrix"][:, 12].tolist()

    assert shown_from(0.0) == [0.0]
    assert shown_from(30.0) == [30.0]
    assert sorted(shown_from(1.0e-3)) == [0.0]
