"""Rows of instances, gathered in runs."""

from __future__ import annotations

import numpy as np
from talbot.sync.records import Runs


def test_runs_say_what_each_row_shows() -> None:
    random = np.random.default_rng(3)
    for _ in range(50):
        runs, rows, which, row = Runs(), [], [], 0
        for _ in range(random.integers(0, 6)):
            shown = tuple(random.integers(0, 9, random.integers(0, 4)).tolist())
            runs.begin(row, shown)
            for _ in range(random.integers(1, 5)):
                rows += [row] * len(shown)
                which += shown
                row += 1
        found = runs.expand(row)
        assert found[0].tolist() == rows and found[1].tolist() == which
