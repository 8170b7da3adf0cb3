"""The headers of the Pythons the module is for, and of pybind11: unpacked below build/bundle, nothing is installed."""

from __future__ import annotations

import re
import shutil
import subprocess
import zipfile
from pathlib import Path

from launcher.bundle.libraries import PLACE, fetch_wheel, mirrors
from launcher.bundle.parts import PYBIND11, PYBIND11_SHA256
from launcher.common import LauncherError, say

KEYRING = "/usr/share/keyrings/debian-archive-keyring.gpg"
# Which release of Debian has the headers of a Python that Debian 12 does not have.
RELEASES = {"3.13": "trixie"}
DEFAULT_PYTHONS = ("3.11", "3.13")
KNOWN_PYTHONS = tuple(sorted({*DEFAULT_PYTHONS, *RELEASES}))


def system_include(version: str) -> Path | None:
    root = Path("/usr/include")
    return root if (root / f"python{version}" / "Python.h").exists() else None


def fetch_package(name: str, release: str, place: Path) -> Path:
    """A package of another release, by apt with lists of its own: signatures are checked, the system is not touched."""
    problems = ""
    for site in mirrors():
        lists = place / "apt" / "lists"
        (lists / "partial").mkdir(parents=True, exist_ok=True)
        sources = place / "apt" / "one.list"
        sources.write_text(f"deb [signed-by={KEYRING}] {site} {release} main\n")
        options = [f"Dir::Etc::sourcelist={sources}", "Dir::Etc::sourceparts=/dev/null", f"Dir::State::lists={lists}"]
        options += ["Dir::Cache::pkgcache=", "Dir::Cache::srcpkgcache=", "Dir::State::status=/dev/null"]
        options += ["Acquire::Languages=none", "APT::Sandbox::User=root"]
        apt = ["apt-get", *(word for option in options for word in ("-o", option)), "-q"]
        for command in ([*apt, "update"], [*apt, "download", name]):
            result = subprocess.run(command, cwd=place, capture_output=True, text=True)
            problems += result.stderr
        found = sorted(place.glob(f"{name}_*.deb"))
        if found:
            shutil.rmtree(place / "apt")
            return found[-1]
    raise LauncherError(
        f"{problems[-1500:]}\n{name} of Debian {release} could not be fetched: it needs the network once."
    )


def python_include(version: str) -> Path:
    """The folder that holds pythonVERSION/Python.h."""
    system = system_include(version)
    if system is not None:
        return system
    if version not in RELEASES:
        raise LauncherError(f"There are no headers of Python {version} here; known are {', '.join(KNOWN_PYTHONS)}.")
    place = PLACE / f"python-{version}"
    include = place / "usr" / "include"
    if (place / "complete").exists():
        return include
    shutil.rmtree(place, ignore_errors=True)
    place.mkdir(parents=True)
    say(f"Fetching the headers of Python {version}")
    package = fetch_package(f"libpython{version}-dev", RELEASES[version], place)
    subprocess.run(["dpkg-deb", "-x", str(package), str(place)], check=True)
    package.unlink()
    if not (include / f"python{version}" / "Python.h").exists():
        raise LauncherError(f"{package.name} holds no headers of Python {version}.")
    (place / "complete").touch()
    return include


def pybind11_include() -> Path:
    """One version for all Pythons: Debian 12's own does not know 3.13."""
    place = PLACE / f"pybind11-{PYBIND11}"
    include = place / "pybind11" / "include"
    if (place / "complete").exists():
        return include
    wheel = fetch_wheel("pybind11", PYBIND11, PYBIND11_SHA256, place)
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(place)
    notices = [path for path in place.rglob("*") if re.fullmatch(r"LICENSE.*", path.name)]
    if not notices or not (include / "pybind11" / "pybind11.h").exists():
        raise LauncherError(f"{wheel.name} is not what was expected: no headers or no licence.")
    shutil.copy(notices[0], place / "LICENSE")
    (place / "complete").touch()
    return include
