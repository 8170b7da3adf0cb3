"""`./talbot package`: wheel, extension and legacy add-on in dist/, with a native module that brings its libraries."""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import tempfile
import zipfile
from pathlib import Path

from launcher import native
from launcher.bundle import archives, examine, headers, isolate, libraries
from launcher.bundle.parts import DISTRIBUTION_PARTS, PARTS, SHARED_PARTS
from launcher.common import CACHE, ROOT, LauncherError, project_version, say

COMPILER_MAJOR = "12"  # Debian 12's; newer ones ask for newer C and C++ libraries than the bundle may need
DIST = ROOT / "dist"
NEEDED_BYTES = 1e9
DATA_TABLES = {
    "hosek-wilkie": ("BSD-3-Clause", "engine/shader/hosek_sky_table.cpp"),
    "ltc-sheen": ("Apache-2.0", "engine/closure/sheen_table.cpp"),
}
"""Numbers that others published: licence, and the file that begins with the notice."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--python",
        action="append",
        choices=headers.KNOWN_PYTHONS,
        metavar="VERSION",
        help=f"only for this Python, {' or '.join(headers.KNOWN_PYTHONS)} (may be repeated; default: all in one)",
    )


def check_compiler() -> None:
    result = subprocess.run(["c++", "-dumpfullversion"], capture_output=True, text=True)
    if result.stdout.split(".")[0] != COMPILER_MAJOR:
        raise LauncherError(
            f"The bundle is made with g++ {COMPILER_MAJOR} on Debian 12, so that it runs on older systems; "
            f"this is g++ {result.stdout.strip()}."
        )


def check_manifest(folder: Path) -> str:
    """The manifest's text; its version has to be the project's."""
    path = folder / "blender_manifest.toml"
    if not path.exists():
        raise LauncherError(f"{path} is missing")
    text = path.read_text(encoding="utf-8")
    version = re.search(r'^version\s*=\s*"([^"]*)"', text, re.MULTILINE)
    if version is None or version[1] != project_version():
        said = version[1] if version else "nothing"
        raise LauncherError(f"{path} says version {said}, CMakeLists.txt says {project_version()}")
    return text


def build_native(pythons: list[str]) -> dict[str, bytes]:
    """The native module for these Pythons and its shared libraries, checked. One build folder a choice of Pythons."""
    prefix = libraries.build_all()
    with native.locked(libraries.PLACE):
        roots = [f"{version}={headers.python_include(version)}" for version in pythons]
        pybind11 = headers.pybind11_include()
    options = [
        f"-DTALBOT_BUNDLE={prefix}",
        f"-DTALBOT_BUNDLE_PYTHONS={';'.join(roots)}",
        f"-DTALBOT_PYBIND11={pybind11}",
        "-DTALBOT_TESTS=OFF",
    ]
    place = libraries.PLACE / f"talbot-{'-'.join(pythons)}"
    native.build(["_talbot"], place, options)
    with native.locked(libraries.PLACE):
        # Read at once: another launcher makes the folder anew.
        files = isolate.isolate(place / "engine" / archives.MODULE, place / "isolated")
        examine.check_bundle(files, isolate.PREFIX)
        say(examine.describe(files))
        return {path.name: path.read_bytes() for path in files}


def data_notices() -> dict[str, bytes]:
    """What stands at the top of the tables that others published, up to the line for the formatter."""
    found = {}
    for name, (_, path) in DATA_TABLES.items():
        top = (ROOT / path).read_text().split("// clang-format off")[0]
        lines = [line.removeprefix("//").removeprefix(" ") for line in top.splitlines()]
        found[f"{name}/NOTICE"] = "\n".join(lines).encode()
    return found


def gather_notices(prefix: Path) -> dict[str, bytes]:
    """The licences of everything inside, by the name of the part."""
    found = {"talbot/LICENSE": (ROOT / "LICENSE").read_bytes()}
    found |= archives.read_tree(prefix / "notices") | data_notices()
    packages = {name: package for name, (_, package) in DISTRIBUTION_PARTS.items()}
    packages |= {name: package for name, (_, package, _) in SHARED_PARTS.items()}
    for name, package in packages.items():
        found[f"{name}/copyright"] = Path(f"/usr/share/doc/{package}/copyright").read_bytes()
    licences = {part.name: part.licence for part in PARTS}
    licences |= {name: entry[0] for name, entry in (DISTRIBUTION_PARTS | SHARED_PARTS).items()}
    licences |= {name: licence for name, (licence, _) in DATA_TABLES.items()}
    licences["pybind11"] = "BSD-3-Clause"
    lines = [f"{name}: {licence}\n" for name, licence in sorted(licences.items())]
    found["README.txt"] = f"Talbot is GPL-3.0-or-later. Inside it are:\n\n{''.join(lines)}".encode()
    found["pybind11/LICENSE"] = (headers.pybind11_include().parents[1] / "LICENSE").read_bytes()
    return found


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


def write_all(files: dict[str, bytes], target: Path) -> None:
    """All or nothing: written beside, checked, then renamed into place."""
    target.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=target, prefix=".unfinished-") as scratch:
        for name, data in files.items():
            path = Path(scratch) / name
            with open(path, "wb") as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
            if zipfile.ZipFile(path).testzip() is not None:
                raise LauncherError(f"{path} was not written as it should")
            if "-linux-" in name:
                validate(path)
        for name in files:
            os.replace(Path(scratch) / name, target / name)


def gather(pythons: list[str]) -> archives.Contents:
    """Builds what goes into the packages."""
    check_compiler()
    manifest = check_manifest(ROOT / "addon")
    files = build_native(pythons)
    notices = gather_notices(libraries.PREFIX)
    return archives.Contents(archives.read_addon(), files, notices, manifest, pythons, project_version())


def package(contents: archives.Contents, target: Path) -> list[Path]:
    """Writes the three files: extension, legacy add-on, wheel."""
    files = archives.make_all(contents)
    wheel = files[archives.wheel_name(contents)]
    unpacked = archives.unpacked_size(wheel) + sum(len(data) for data in contents.addon.values())
    examine.check_sizes({name: len(data) for name, data in files.items()}, unpacked)
    try:
        write_all(files, target)
    except OSError as error:
        raise LauncherError(f"Nothing was packaged: {target} cannot be written: {error.strerror}.") from None
    return [target / name for name in files]


def check_space() -> None:
    """Before the first build; later ones need little, and say so where they fail."""
    place = next(folder for folder in (libraries.PLACE, *libraries.PLACE.parents) if folder.exists())
    free = shutil.disk_usage(place).free
    if free < NEEDED_BYTES and not libraries.PREFIX.exists():
        raise LauncherError(
            f"The libraries of the bundle take {NEEDED_BYTES / 1e9:.0f} GB to build; "
            f"{free / 1e9:.1f} GB are free in {place}."
        )


def run(arguments: argparse.Namespace) -> int:
    check_space()
    pythons = sorted(set(arguments.python or headers.DEFAULT_PYTHONS), key=lambda text: int(text.split(".")[1]))
    for path in package(gather(pythons), DIST):
        data = path.read_bytes()
        print(f"{path} ({len(data) / 1e6:.1f} MB, {archives.unpacked_size(data) / 1e6:.1f} MB unpacked)")
    return 0
