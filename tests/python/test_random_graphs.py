"""A fixed list of random graphs in Cycles and in Talbot."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
from random_graphs import ACROSS, TOLERANCE, differences

SEEDS = range(512)
NAN_IN_CYCLES = {(3, 4): {6, 40, 71, 325}, (5, 0): {297, 398, 510}, (5, 2): {195, 291, 398, 510}}
"""Cycles normalises a vector of zero, or takes the sine of infinity, and shows NaN as black. Traced in 3.4, in 5.0 and,
of 5.2's, in 195; the others of 5.2 read the same nodes."""
LAST_BIT = 3
"""Graphs that may differ otherwise. Those that do were traced to one bit more or less in what a discontinuous or
chaotic node reads: 56 in 3.4; 333 in 5.0; 237, 247 and 333 in 5.2."""


def test_random_graphs(pair_scene: Any, tmp_path: Path) -> None:
    results = []
    for start in range(0, len(SEEDS), ACROSS**2):
        for obj in list(pair_scene.objects):
            pair_scene.collection.objects.unlink(obj)
        results += differences(pair_scene, list(SEEDS[start : start + ACROSS**2]), tmp_path)
    assert all(r.finite for r in results)
    known = NAN_IN_CYCLES.get(bpy.app.version[:2], set())
    bad = sorted((r for r in results if r.worst > TOLERANCE and r.seed not in known), key=lambda r: -r.worst)
    assert len(bad) <= LAST_BIT, [f"seed {r.seed}: {r.worst:.3g}" for r in bad]
