"""Which scene a command is about, as Blender's arguments."""

from __future__ import annotations

from pathlib import Path

from launcher.common import ROOT, LauncherError


def scene_file(given: str | None) -> Path:
    """The file asked for, else the default scene: a .blend, or a .py that builds the scene."""
    if given is not None:
        path = Path(given).absolute()
        if not path.is_file():
            raise LauncherError(f"There is no file {path}")
        return path
    for name in ("default.blend", "default.py"):
        path = ROOT / "scenes" / name
        if path.exists():
            return path
    raise LauncherError(f"There is no default scene in {ROOT / 'scenes'}; name a .blend file")


def open_arguments(path: Path) -> list[str]:
    return ["--python", str(path)] if path.suffix == ".py" else [str(path)]
