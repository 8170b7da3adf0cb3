"""Saves the scenes that the tests compare with Cycles, each as a .blend file to open, render or take apart.

`./talbot blender -b --python scenes/checklist.py -- FOLDER [EXPRESSION]`; the expression is as pytest's -k: "lights and
spread". They are built by tests/python/test_pairs_*.py, each beside what it must show, and are named after their tests.
What works of all that Cycles shows says addon/sync/README.md, line by line.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

import bpy
import pytest

TESTS = Path(__file__).resolve().parent.parent / "tests" / "python"


class Saver:
    """A plugin of pytest: the tests build their scenes as ever, but what they would render is saved instead."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.count = 0
        self._name = ""

    def pytest_runtest_setup(self, item: pytest.Item) -> None:
        self._name = re.sub(r"[^\w.-]+", "_", f"{item.path.stem}.{item.name}").removeprefix("test_pairs_").strip("_")

    def save(self, scene: bpy.types.Scene, *_: object, **__: object) -> None:
        """In the place of a render, which ends the test."""
        scene.render.engine = "CYCLES"
        bpy.ops.file.pack_all()
        bpy.ops.wm.save_as_mainfile(filepath=str(self.folder / f"{self._name}.blend"), copy=True, compress=True)
        self.count += 1
        pytest.skip("saved")


def main(folder: Path, expression: str) -> tuple[int, bool]:
    """How many scenes were saved, and whether none failed."""
    folder.mkdir(parents=True, exist_ok=True)
    sys.dont_write_bytecode = True
    sys.path.insert(0, str(TESTS))
    import pairs

    saver = Saver(folder)
    pairs.render = saver.save
    code = pytest.main(["-q", "-k", f"pairs_ and ({expression})", str(TESTS)], plugins=[saver])
    return saver.count, code == pytest.ExitCode.OK


if __name__ == "__main__":
    given = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else []
    if not given:
        sys.exit("Which folder? After -- comes FOLDER [EXPRESSION].")
    saved, fine = main(Path(given[0]).resolve(), given[1] if len(given) > 1 else "test")
    print(f"{saved} scenes in {given[0]}")
    if not fine:
        sys.exit("Not all scenes could be built, or the expression finds none.")
