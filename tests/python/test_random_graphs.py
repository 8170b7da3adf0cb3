"""A fixed list of random graphs in Cycles and in Talbot."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from random_graphs import ACROSS, TOLERANCE, differences

SEEDS = range(512)
ALLOWED = len(SEEDS) // 100
"""Graphs that may differ. Those that do were traced: to one bit more or less in what a discontinuous or chaotic node
reads (56 in 3.4; 247 and 333 in 5.0; 237, 247 and 333 in 5.2), and to a vector of zero that Cycles normalises to no
number, of which a later node makes black (398 and 510 since 5.0)."""


def test_random_graphs(pair_scene: Any, tmp_path: Path) -> None:
    results = []
    for start in range(0, len(SEEDS), ACROSS**2):
        results += differences(pair_scene, list(SEEDS[start : start + ACROSS**2]), tmp_path)
    assert all(r.finite for r in results)
    bad = sorted((r for r in results if r.worst > TOLERANCE), key=lambda r: -r.worst)
    assert len(bad) <= ALLOWED, [f"seed {r.seed}: {r.worst:.3g}" for r in bad]
