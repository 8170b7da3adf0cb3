"""Finds, loads and checks the native module. Whatever is wrong with it becomes one sentence for the user."""

import importlib
import importlib.util
import platform
import sys
import sysconfig
from functools import cache
from pathlib import Path
from types import ModuleType

import bpy

_NAME = "_talbot"
_WHEEL_PACKAGE = "talbot_native"
"""Where the wheel has the module: extensions get it from there, legacy add-ons and builds have it beside this file."""
_FOLDER = Path(__file__).parent

_module: ModuleType | None = None
_problem = "The add-on has not been registered."


class Unavailable(RuntimeError):
    """The native module cannot be used; the message says why and what to do."""


def load(expected_version: str) -> str:
    """Loads and checks the module once a registration. Returns what is wrong with it, "" when nothing is."""
    global _module, _problem
    _module, _problem = _load(expected_version)
    return _problem


def _load(expected_version: str) -> tuple[ModuleType | None, str]:
    try:
        module = _import()
    except ImportError as error:
        return None, _why_not_imported(error)
    # After an upgrade Python keeps the old library in memory; it would be called with the new add-on's arguments.
    if module.__version__ != expected_version:
        return None, (
            f"The add-on is version {expected_version}, but the native module in memory is {module.__version__}: "
            "restart Blender"
        )
    try:
        module.chosen_instruction_set()
        module.check()
    except module.Error as error:
        return None, str(error)
    return module, ""


def _import() -> ModuleType:
    try:
        return importlib.import_module(f".{_NAME}", __package__)
    except ModuleNotFoundError:
        if any(_FOLDER.glob(f"{_NAME}*.so")):
            raise
    return importlib.import_module(f"{_WHEEL_PACKAGE}.{_NAME}")


def _why_not_imported(error: ImportError) -> str:
    found = sorted(path.name for path in _FOLDER.glob(f"{_NAME}*.so"))
    # A file that is found but does not load raises ImportError itself, under the same name.
    if not isinstance(error, ModuleNotFoundError):
        return f"The native module {found[0] if found else _NAME} cannot be loaded: {error}"
    if found and not (error.name or "").endswith(_NAME):
        return f"The native module {found[0]} cannot be loaded: {error}"
    running = f"Python {sys.version_info.major}.{sys.version_info.minor} ({platform.system()} on {platform.machine()})"
    if found:
        return f"The native module {found[0]} is not for this Blender's {running}: install the matching build"
    wheels = sorted(path.name for path in (_FOLDER / "wheels").glob("*.whl"))
    if not wheels:
        return f"The native module is missing from {_FOLDER}: install a packaged Talbot, or build it with CMake"
    if not any(_fits(name) for name in wheels):
        return f"{wheels[0]} is not for this Blender's {running}: install the matching Talbot"
    return (
        f"Blender has not unpacked {wheels[0]}: make its folder of extensions writable, then disable and enable Talbot"
    )


def _fits(wheel: str) -> bool:
    """By the tags in its name: for this Python, this system and this processor."""
    pythons, _, system = wheel.removesuffix(".whl").split("-")[-3:]
    here = sysconfig.get_platform().split("-")
    is_for_python = f"cp{sys.version_info.major}{sys.version_info.minor}" in pythons.split(".")
    return is_for_python and here[0] in system and system.endswith(here[-1])


def module() -> ModuleType:
    """The native module; raises Unavailable with one sentence."""
    if _module is None:
        raise Unavailable(_problem)
    return _module


def problem() -> str:
    """What is wrong with the native module, "" when it works."""
    return _problem


def library_dirs() -> list[str]:
    """Where Open Image Denoise may lie besides the system's places: beside Blender, or in the `pyoidn` package."""
    dirs = [Path(bpy.utils.resource_path("LOCAL")).parent / "lib"]
    spec = importlib.util.find_spec("pyoidn")
    if spec is not None and spec.origin:
        dirs.append(Path(spec.origin).parent / "oidn" / "lib")
    return [str(path) for path in dirs if path.is_dir()]


@cache
def denoiser_version() -> str:
    """Version of Open Image Denoise, "" when it is not found. Asked once: the search opens libraries."""
    return _module.denoiser_version(library_dirs()) if _module is not None else ""
