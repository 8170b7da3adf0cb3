"""What the steps of session.py share: the job, Blender, rendering and comparing pictures, installing."""

from __future__ import annotations

import importlib
import json
import os
import sys
from pathlib import Path
from typing import Any

ARGUMENTS = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else sys.argv[1:]
JOB: dict[str, Any] = json.loads(Path(ARGUMENTS[0]).read_text())

if JOB["as_program"]:
    # The official program has its libraries in the global scope, the module keeps them to itself.
    sys.setdlopenflags(os.RTLD_NOW | os.RTLD_GLOBAL)
import bpy

sys.setdlopenflags(os.RTLD_NOW)
import numpy as np

import scenes

EXTENSION = "bl_ext.user_default.talbot"
FOLDER = Path(JOB["folder"])
IMAGES = FOLDER / "images"
Picture = np.ndarray


class Skipped(Exception):
    """Cannot be tried here; the text says why."""


class State:
    """What later steps compare with."""

    before: dict[int, Picture] = {}
    cycles: dict[int, Picture] = {}


def check(holds: bool, text: str) -> None:
    if not holds:
        raise AssertionError(text)


def render(index: int, engine: str, **settings: object) -> Picture:
    scene = scenes.build(index, IMAGES)
    try:
        scene.render.engine = engine
    except TypeError:
        raise AssertionError(f"there is no engine {engine}") from None
    for name, value in settings.items():
        setattr(scene.cycles, name, value)
    return render_scene(scene)


def render_scene(scene: bpy.types.Scene) -> Picture:
    path = FOLDER / "rendered.exr"
    path.unlink(missing_ok=True)
    if hasattr(scene.render.image_settings, "media_type"):
        scene.render.image_settings.media_type = "IMAGE"
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(str(path))
    pixels = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(pixels)
    bpy.data.images.remove(image)
    check(bool(np.isfinite(pixels).all()) and float(pixels[:3].max()) >= 0, "the picture is not of numbers")
    return pixels


def difference(a: Picture, b: Picture) -> float:
    """Largest, beside the picture's mean."""
    check(a.shape == b.shape, "the pictures differ in size")
    return float(np.abs(a - b).max() / max(float(np.abs(b).mean()), 1e-6))


def cycles_changed(index: int) -> float:
    """How Cycles' picture differs from the one before Talbot came."""
    return difference(render(index, "CYCLES"), State.cycles[index])


def module_name() -> str:
    return EXTENSION if JOB["kind"] == "extension" else "talbot"


def has_engine() -> bool:
    engines = bpy.types.RenderEngine.__subclasses__()
    return any(getattr(engine, "bl_idname", "") == "TALBOT" and engine.is_registered for engine in engines)


def install_file(path: str) -> None:
    """By Blender's own commands."""
    if JOB["kind"] == "extension":
        bpy.ops.extensions.package_install_files(filepath=path, repo="user_default", enable_on_install=True)
    else:
        bpy.ops.preferences.addon_install(filepath=path, overwrite=True)
        bpy.ops.preferences.addon_enable(module="talbot")


def native() -> Any:
    return importlib.import_module(f"{module_name()}.native")


def enable() -> None:
    """In a process that finds the add-on installed."""
    if JOB["kind"] == "extension":
        import addon_utils

        check(addon_utils.enable(EXTENSION, default_set=True) is not None, "the extension cannot be enabled")
    else:
        bpy.ops.preferences.addon_enable(module="talbot")
    check(has_engine() and native().problem() == "", native().problem())


def one_picture() -> None:
    """The first scene, as the process before rendered it."""
    stored = np.load(FOLDER / f"{JOB['host']}.npz")
    found = difference(render(0, "TALBOT"), stored["0"])
    check(found <= JOB["tolerance"], f"it differs from the system build's by {found:.3g} of its mean")
