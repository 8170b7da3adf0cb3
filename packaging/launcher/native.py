"""Configures and builds the native part, and lays the add-on out for Blender in build/stage."""

from __future__ import annotations

import fcntl
import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from launcher.common import BUILD, ROOT, STAGE, LauncherError, say

STEP = re.compile(r"^\[(\d+)/(\d+)\] ")
SYSTEM_PYTHON = "/usr/bin/python3"


@contextmanager
def locked(directory: Path) -> Iterator[None]:
    """One build at a time in a directory, also when two launchers run."""
    try:
        directory.mkdir(parents=True, exist_ok=True)
        file = open(directory / ".lock", "w")
    except OSError as error:
        raise LauncherError(f"{directory} cannot be written: {error.strerror}") from None
    with file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield


def drop_foreign(build: Path) -> None:
    """CMake refuses a build folder that was configured at another place: one that was moved or copied is made anew."""
    cache = build / "CMakeCache.txt"
    if not cache.exists():
        return
    home = re.search(r"^CMAKE_HOME_DIRECTORY:INTERNAL=(.*)$", cache.read_text(errors="replace"), re.MULTILINE)
    if home and os.path.realpath(home[1]) == str(ROOT):
        return
    say(f"{build} was made for {home[1] if home else 'another place'}: building anew")
    for entry in build.iterdir():
        if entry.name == ".lock":
            continue
        shutil.rmtree(entry) if entry.is_dir() and not entry.is_symlink() else entry.unlink()


def configure(build: Path, options: list[str]) -> None:
    """Runs CMake once; afterwards ninja runs it again by itself when needed. `options` are for the first time only."""
    drop_foreign(build)
    if (build / "build.ninja").exists():
        return
    command = ["cmake", "-S", str(ROOT), "-B", str(build), "-G", "Ninja", *options]
    if not any(option.startswith("-DCMAKE_BUILD_TYPE") for option in options):
        command.append("-DCMAKE_BUILD_TYPE=Release")
    if os.path.exists(SYSTEM_PYTHON):
        # The module is for Blender's Python, which on Debian is the system's, whatever comes first in PATH.
        command += [f"-DPython_EXECUTABLE={SYSTEM_PYTHON}", f"-DPYTHON_EXECUTABLE={SYSTEM_PYTHON}"]
    result = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    (build / "configure.log").write_text(result.stdout)
    if result.returncode != 0:
        raise LauncherError(result.stdout + f"\nCMake failed. The log is {build}/configure.log.")


def run_ninja(build: Path, targets: list[str]) -> None:
    """Quiet: one line of progress when there is anything to do, and the whole output when a step fails."""
    environment = {**os.environ, "NINJA_STATUS": "[%f/%t] "}
    command = ["ninja", "-C", str(build), *targets]
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=environment, errors="replace"
    )
    assert process.stdout is not None
    started = time.monotonic()
    lines: list[str] = []
    announced = live = False
    for line in process.stdout:
        lines.append(line)
        step = STEP.match(line)
        if step and "Re-checking globbed" not in line and "Re-running CMake" not in line:
            if sys.stderr.isatty():
                print(f"\rBuilding Talbot [{step[1]}/{step[2]}] ", end="", file=sys.stderr, flush=True)
                live = True
            elif not announced:
                say(f"Building Talbot: {step[2]} steps")
            announced = True
    code = process.wait()
    (build / "build.log").write_text("".join(lines))
    seconds = time.monotonic() - started
    if code != 0:
        tail = "".join(line for line in lines if not STEP.match(line) or "FAILED" in line)
        raise LauncherError(f"{tail[-20000:]}\nThe build failed. The log is {build}/build.log.")
    if announced:
        say(f"{chr(13) if live else ''}Built Talbot in {seconds:.0f} s.          ")


def build(targets: list[str], build_dir: Path = BUILD, options: list[str] | None = None) -> None:
    with locked(build_dir):
        configure(build_dir, options or [])
        run_ninja(build_dir, targets)


def link(source: Path, target: Path) -> None:
    if target.is_symlink() and os.readlink(target) == str(source):
        return
    target.unlink(missing_ok=True)
    target.symlink_to(source)


def native_module() -> Path | None:
    found = sorted((BUILD / "engine").glob("_talbot*.so"))
    return found[0] if found else None


def stage() -> Path:
    """build/stage/addons/talbot: links to the add-on's files and the native module; caches land there too."""
    target = STAGE / "addons" / "talbot"
    wanted: set[Path] = set()
    for source in sorted((ROOT / "addon").rglob("*")):
        if source.is_dir() or "__pycache__" in source.parts or source.suffix == ".pyi":
            continue
        place = target / source.relative_to(ROOT / "addon")
        place.parent.mkdir(parents=True, exist_ok=True)
        link(source, place)
        wanted.add(place)
    module = native_module()
    if module is not None:
        target.mkdir(parents=True, exist_ok=True)
        link(module, target / module.name)
        wanted.add(target / module.name)
    for place in target.rglob("*"):
        if place.is_symlink() and place not in wanted:
            place.unlink()
    return STAGE


def prepare() -> Path:
    """Builds what Blender needs and returns the staged scripts folder."""
    # The standalone program is not needed to start Blender: `./talbot test` builds it.
    build(["_talbot"])
    with locked(BUILD):
        return stage()
