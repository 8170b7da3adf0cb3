"""Every node probe against the numbers that Cycles gives in the same Blender version."""

from __future__ import annotations

import json
import os
from pathlib import Path

import bpy
import pytest
from probe_scene import render_probes

TOLERANCE = 1e-4
"""Relative, and absolute below 1."""


def golden_file() -> Path:
    version = ".".join(str(part) for part in bpy.app.version[:2])
    return Path(__file__).parent / "golden" / f"nodes_{version}.json"


def difference(expected: list[float], found: list[float]) -> float:
    """Largest difference of the channels; a NaN is infinitely wrong."""
    worst = max(abs(a - b) / max(1.0, abs(a)) for a, b in zip(expected, found, strict=True))
    return worst if worst == worst else float("inf")


def test_probes() -> None:
    path = golden_file()
    if not path.exists():
        pytest.skip(f"no golden numbers for Blender {bpy.app.version_string}")
    golden = json.loads(path.read_text())
    found = render_probes("TALBOT")
    assert set(golden) <= set(found)
    differences = {name: difference(value, found[name]) for name, value in golden.items()}
    report = os.environ.get("TALBOT_NODE_REPORT")
    if report:
        Path(report).write_text(json.dumps(differences))
    wrong = {name: (golden[name], found[name]) for name, worst in differences.items() if worst > TOLERANCE}
    assert not wrong
