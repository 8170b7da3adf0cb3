"""The Blenders Talbot can run in: the system's, a program by its path, or an official build as a Python module."""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path

from launcher.common import BUILD, CACHE, ROOT, LauncherError, say
from launcher.native import locked, native_module

MODULES = {"bpy-4.2": "4.2.23", "bpy-4.5": "4.5.15", "bpy-5.0": "5.0.1"}
# What the official builds expect of the system, beside what a Debian without a desktop has.
MODULE_PACKAGES = "libx11-6 libxrender1 libxxf86vm1 libxfixes3 libxi6 libxkbcommon0 libsm6 libice6 libgl1 libegl1"


@dataclass
class Host:
    """How to start one Blender: `command` comes before Blender's own arguments."""

    name: str
    command: list[str]
    is_module: bool = False
    environment: dict[str, str] = field(default_factory=dict)


def user_environment(name: str, stage: Path) -> dict[str, str]:
    """The user's own configuration is neither read nor written: each Blender has its own below build/."""
    user = BUILD / "user" / name
    user.mkdir(parents=True, exist_ok=True)
    environment = {key: value for key, value in os.environ.items() if not key.startswith("BLENDER_")}
    environment |= {
        "BLENDER_USER_RESOURCES": str(user),
        "BLENDER_USER_CONFIG": str(user / "config"),
        "BLENDER_USER_DATAFILES": str(user / "datafiles"),
        "BLENDER_USER_SCRIPTS": str(stage),
    }
    return environment


def why_no_modules() -> str:
    """Why the official modules, all of CPython 3.11, cannot load what was built here; "" when they can."""
    built = native_module()
    if built is None or ".cpython-311-" in built.name:
        return ""
    return (
        "the official Blender modules run CPython 3.11, but the native module was built for this system's Python "
        f"({built.name}): use them on Debian 12"
    )


def find_python311() -> str:
    for candidate in ("/usr/bin/python3.11", shutil.which("python3.11"), "/usr/local/bin/python3.11"):
        if candidate and os.path.exists(candidate):
            return candidate
    raise LauncherError(
        "The official Blender modules need CPython 3.11: put a `python3.11` with venv and pip into PATH."
    )


def module_python(name: str) -> Path:
    """The Python of the environment that holds this `bpy`, which is made on first use."""
    version = MODULES[name]
    place = CACHE / name
    python = place / "bin" / "python"
    marker = place / "talbot-complete"
    if marker.exists() and marker.read_text().strip() == version:
        return python
    with locked(CACHE):
        if marker.exists() and marker.read_text().strip() == version:
            return python
        shutil.rmtree(place, ignore_errors=True)
        say(f"Fetching Blender {version} as a Python module (once, about 350 MB) into {place}")
        commands = [
            [find_python311(), "-m", "venv", str(place)],
            [
                str(python),
                "-m",
                "pip",
                "install",
                "--quiet",
                "--disable-pip-version-check",
                f"bpy=={version}",
                "pytest",
            ],
            [str(python), "-c", "import bpy"],
        ]
        for command in commands:
            result = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
            if result.returncode != 0:
                raise LauncherError(
                    f"{result.stdout}\nBlender {version} could not be installed as a Python module. It needs the "
                    f"network once, CPython 3.11 with venv, and these libraries of the system: {MODULE_PACKAGES}"
                )
        marker.write_text(version)
    return python


def find_host(which: str | None, stage: Path) -> Host:
    if which is None or which in ("system", "blender"):
        program = shutil.which("blender")
        if program is None:
            raise LauncherError("There is no `blender` in PATH; install it or say --blender PATH or --blender bpy-5.0.")
        environment = user_environment("system", stage)
        # Debian's Blender looks for its Python's home through PATH: another Python in front would take numpy away.
        environment["PATH"] = os.pathsep.join(["/usr/bin", "/bin", environment.get("PATH", "")])
        return Host("system", [program], environment=environment)
    if which in MODULES:
        if why_no_modules():
            raise LauncherError(f"--blender {which}: {why_no_modules()}.")
        command = [str(module_python(which)), str(ROOT / "packaging" / "bpy_driver.py")]
        return Host(which, command, True, user_environment(which, stage))
    program = shutil.which(which)
    if program is None:
        raise LauncherError(f"--blender {which}: neither a program nor one of {', '.join(MODULES)}")
    name = "program-" + hashlib.sha1(os.path.realpath(program).encode()).hexdigest()[:10]
    return Host(which, [program], environment=user_environment(name, stage))


def with_addon(host: Host, arguments: list[str]) -> list[str]:
    """--addons has to stand before the file and before -E."""
    return [*host.command, "--addons", "talbot", *arguments]


def become(host: Host, arguments: list[str]) -> None:
    """Replaces this process by Blender, so that signals and the status are Blender's own."""
    command = with_addon(host, arguments)
    sys.stdout.flush()
    os.execve(command[0], command, host.environment)
