"""`./talbot package`: dist/talbot-VERSION.zip, both a legacy add-on (3.4) and an extension (4.2 and newer)."""

from __future__ import annotations

import re
import subprocess
import zipfile
from pathlib import Path

from launcher import native
from launcher.common import CACHE, ROOT, LauncherError, project_version, say

EPOCH = (1980, 1, 1, 0, 0, 0)  # same input, same bytes


def add_entry(archive: zipfile.ZipFile, name: str, data: bytes, mode: int) -> None:
    info = zipfile.ZipInfo(name, EPOCH)
    info.external_attr = mode << 16
    info.compress_type = zipfile.ZIP_DEFLATED
    archive.writestr(info, data)


def check_manifest(folder: Path) -> None:
    path = folder / "blender_manifest.toml"
    if not path.exists():
        raise LauncherError(f"{path} is missing")
    version = re.search(r'^version\s*=\s*"([^"]*)"', path.read_text(encoding="utf-8"), re.MULTILINE)
    if version is None or version[1] != project_version():
        said = version[1] if version else "nothing"
        raise LauncherError(f"{path} says version {said}, CMakeLists.txt says {project_version()}")


def validate(path: Path) -> None:
    """With Blender's own tool, when an official build is at hand."""
    for tool in sorted(
        CACHE.glob("bpy-*/lib/python*/site-packages/bpy/*/scripts/addons_core/bl_pkg/cli/blender_ext.py")
    ):
        python = next(parent for parent in tool.parents if parent.parent == CACHE) / "bin" / "python"
        result = subprocess.run([str(python), str(tool), "validate", str(path)], capture_output=True, text=True)
        if result.returncode != 0:
            raise LauncherError(f"Blender's own check refuses {path}:\n{result.stdout}{result.stderr}")
        say(f"Checked with the extension tool of {tool.parents[4].name}.")


def run() -> int:
    folder = native.prepare() / "addons" / "talbot"
    check_manifest(ROOT / "addon")
    if native.native_module() is None:
        raise LauncherError("The native module was not built.")
    target = ROOT / "dist" / f"talbot-{project_version()}.zip"
    target.parent.mkdir(exist_ok=True)
    with zipfile.ZipFile(target, "w") as archive:
        # Blender removes the old folder before an upgrade only when the archive has an entry for the folder itself;
        # otherwise it overwrites a library that is mapped, and crashes.
        add_entry(archive, "talbot/", b"", 0o40755)
        for path in sorted(folder.rglob("*")):
            if path.is_dir() or "__pycache__" in path.parts:
                continue
            data = path.read_bytes()
            if path.suffix == ".so":
                stripped = target.parent / path.name
                subprocess.run(["strip", "-o", str(stripped), str(path)], check=True)
                data = stripped.read_bytes()
                stripped.unlink()
            add_entry(archive, f"talbot/{path.relative_to(folder)}", data, 0o100644)
        add_entry(archive, "talbot/LICENSE", (ROOT / "LICENSE").read_bytes(), 0o100644)
    validate(target)
    print(f"{target} ({target.stat().st_size / 1e6:.1f} MB)")
    say("It uses this machine's libraries (Embree, OpenImageIO ...): for other machines build it there.")
    return 0
