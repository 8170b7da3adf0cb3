"""A fixed list of random graphs in Cycles and in Talbot."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from random_graphs import ACROSS, TOLERANCE, differences

SEEDS = range(512)
SHARE = 0.99
"""Of the graphs agree. All others were traced: Cycles normalises a vector of zero to NaN, which is black (seeds 6, 40,
71 and 325 in 3.4; 297, 398 and 510 in 5.0); or the last bit decides (56 in 3.4, 333 in 5.0)."""


def test_random_graphs(pair_scene: Any, tmp_path: Path) -> None:
    results = []
    for start in range(0, len(SEEDS), ACROSS**2):
        for obj in list(pair_scene.objects):
            pair_scene.collection.objects.unlink(obj)
        results += differences(pair_scene, list(SEEDS[start : start + ACROSS**2]), tmp_path)
    assert all(r.finite for r in results)
    bad = sorted((r for r in results if r.worst > TOLERANCE), key=lambda r: -r.worst)
    assert len(bad) <= (1 - SHARE) * len(SEEDS), [f"seed {r.seed}: {r.worst:.3g}" for r in bad]
