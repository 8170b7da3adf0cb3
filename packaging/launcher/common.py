"""Places, messages and child processes shared by all commands."""

from __future__ import annotations

import os
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
BUILD = ROOT / "build"
STAGE = BUILD / "stage"
CACHE = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "talbot"


class LauncherError(Exception):
    """One or more lines for the user; ends the launcher with status 1."""


def say(text: str) -> None:
    """Progress goes to stderr, so that a command's own output can be piped."""
    print(text, file=sys.stderr, flush=True)


def project_version() -> str:
    """The version in CMakeLists.txt: `project(talbot VERSION x.y.z ...)`."""
    text = (ROOT / "CMakeLists.txt").read_text(encoding="utf-8")
    return text.split("project(talbot VERSION ", 1)[1].split()[0].rstrip(")")
