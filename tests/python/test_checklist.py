"""The scenes of the pairs as files."""

from __future__ import annotations

import subprocess
from pathlib import Path

import bpy
import pytest

SCRIPT = Path(__file__).resolve().parents[2] / "scenes" / "checklist.py"


@pytest.mark.skipif(not bpy.app.binary_path, reason="a module is no program")
def test_scenes_of_an_expression_are_saved(tmp_path: Path) -> None:
    command = [bpy.app.binary_path, "-b", "--factory-startup", "--addons", "talbot", "--python", str(SCRIPT), "--"]
    done = subprocess.run([*command, str(tmp_path / "new"), "lights and test_lamps and spots"], capture_output=True)
    assert b"1 scenes in" in done.stdout, done.stdout.decode() + done.stderr.decode()
    (saved,) = (tmp_path / "new").iterdir()
    assert saved.name == "lights.test_lamps_spots.blend"
    with bpy.data.libraries.load(str(saved)) as (there, here):
        assert len(there.lights) == 4
        here.scenes = there.scenes
    assert here.scenes[0].render.engine == "CYCLES"
    bpy.data.scenes.remove(here.scenes[0])
