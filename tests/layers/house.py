"""What the tests of the house's order share: where the files are, and what counts as a source."""

from __future__ import annotations

import os
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
BUILD = Path(os.environ.get("TALBOT_BUILD_DIR", ROOT / "build"))

# Left to right: a layer may include itself and what stands to its left. python and cli are both last.
LAYERS = [
    "base",
    "scene",
    "asset",
    "closure",
    "shader",
    "geometry",
    "light",
    "film",
    "integrator",
    "session",
    "python",
    "cli",
]

FOLDERS = ("engine", "addon", "packaging", "tests", "scenes")


def sources(*suffixes: str, folders: tuple[str, ...] = FOLDERS) -> list[Path]:
    found = [path for folder in folders for path in (ROOT / folder).rglob("*") if path.suffix in suffixes]
    return sorted(path for path in found if path.is_file() and "__pycache__" not in path.parts)


def shown(path: Path) -> str:
    return str(path.relative_to(ROOT))
