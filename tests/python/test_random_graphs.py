"""A fixed list of random graphs in Cycles and in Talbot."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
from random_graphs import ACROSS, TOLERANCE, differences

SEEDS = range(512)
NO_NUMBER = {398: (5, 0, 0), 510: (5, 0, 0), 195: (5, 2, 0)}
"""Seeds, and since which Blender. Traced: Cycles has no number on the way, of which a later node makes a colour. It
normalises a vector of zero (398, 510); Facing of a normal longer than 1 has none in either engine, but Talbot's Magic
Texture makes one of it (195)."""
LAST_BIT = 3
"""Graphs that may differ otherwise. Those that do were traced to one bit more or less in what a discontinuous or
chaotic node reads: 56 in 3.4; 247 and 333 in 5.0; 237, 247 and 333 in 5.2."""


def test_random_graphs(pair_scene: Any, tmp_path: Path) -> None:
    results = []
    for start in range(0, len(SEEDS), ACROSS**2):
        results += differences(pair_scene, list(SEEDS[start : start + ACROSS**2]), tmp_path)
    assert all(r.finite for r in results)
    left_out = {seed for seed, since in NO_NUMBER.items() if bpy.app.version >= since}
    bad = sorted((r for r in results if r.worst > TOLERANCE and r.seed not in left_out), key=lambda r: -r.worst)
    assert len(bad) <= LAST_BIT, [f"seed {r.seed}: {r.worst:.3g}" for r in bad]
