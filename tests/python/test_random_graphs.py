"""A fixed list of random graphs in Cycles and in Talbot."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
from random_graphs import ACROSS, TOLERANCE, differences

SEEDS = range(512)
SHARE = 0.98 if bpy.app.version >= (4, 0, 0) else 0.975
"""Of the graphs agree; the goal is 99 %. What was traced of the rest are cliffs where the last bit decides, and NaN,
which is black in Cycles. Not explained: seeds 40, 209 and 418 in 3.4, 297 in 5.0."""


def test_random_graphs(pair_scene: Any, tmp_path: Path) -> None:
    results = []
    for start in range(0, len(SEEDS), ACROSS**2):
        for obj in list(pair_scene.objects):
            pair_scene.collection.objects.unlink(obj)
        results += differences(pair_scene, list(SEEDS[start : start + ACROSS**2]), tmp_path)
    assert all(r.finite for r in results)
    bad = sorted((r for r in results if r.worst > TOLERANCE), key=lambda r: -r.worst)
    assert len(bad) <= (1 - SHARE) * len(SEEDS), [f"seed {r.seed}: {r.worst:.3g}" for r in bad]
