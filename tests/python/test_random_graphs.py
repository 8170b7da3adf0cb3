"""A fixed list of random graphs in Cycles and in Talbot."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
from random_graphs import ACROSS, TOLERANCE, differences

SEEDS = range(512)
BLACK_IN_CYCLES = {398, 510} if bpy.app.version >= (5, 0, 0) else set()
"""Cycles normalises a vector of zero, and a later node makes black of what is no number. Traced."""
LAST_BIT = 4 if bpy.app.version >= (5, 2, 0) else 3
"""Graphs that may differ otherwise. Those that do were traced to one bit more or less in what a discontinuous or
chaotic node reads: 56 in 3.4; 247 and 333 in 5.0; 195 (a checker's edge), 237, 247 and 333
in 5.2."""


def test_random_graphs(pair_scene: Any, tmp_path: Path) -> None:
    results = []
    for start in range(0, len(SEEDS), ACROSS**2):
        results += differences(pair_scene, list(SEEDS[start : start + ACROSS**2]), tmp_path)
    assert all(r.finite for r in results)
    bad = sorted((r for r in results if r.worst > TOLERANCE and r.seed not in BLACK_IN_CYCLES), key=lambda r: -r.worst)
    assert len(bad) <= LAST_BIT, [f"seed {r.seed}: {r.worst:.3g}" for r in bad]
