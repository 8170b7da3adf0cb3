"""Runs inside Blender for `./talbot render`: applies the JSON settings that follow `--` and renders one frame."""

from __future__ import annotations

import json
import os
import re
import sys
import time
from typing import Any

import bpy

FORMATS = {
    ".png": "PNG",
    ".exr": "OPEN_EXR",
    ".jpg": "JPEG",
    ".jpeg": "JPEG",
    ".tif": "TIFF",
    ".tiff": "TIFF",
    ".hdr": "HDR",
    ".bmp": "BMP",
    ".tga": "TARGA",
    ".webp": "WEBP",
}


def fail(message: str) -> None:
    print(f"Error: {message}", flush=True)
    sys.exit(1)


def set_where_present(owner: Any, names: tuple[str, ...], value: Any) -> bool:
    """Sets the first of the properties that this engine has."""
    for name in names:
        if owner is not None and hasattr(owner, name):
            setattr(owner, name, value)
            return True
    return False


def apply_engine_settings(scene: bpy.types.Scene, job: dict[str, Any]) -> None:
    """Samples and seed live with each engine. TALBOT itself may read Cycles' settings, so both are set."""
    engine = job["engine"]
    owners = {"CYCLES": ["cycles"], "TALBOT": ["talbot"]}.get(engine, ["eevee"])
    for key, names in (("samples", ("samples", "taa_render_samples")), ("seed", ("seed",))):
        if job[key] is None:
            continue
        done = [set_where_present(getattr(scene, owner, None), names, job[key]) for owner in owners]
        if not any(done):
            print(f"Warning: {engine} has no setting for --{key}", flush=True)


def set_format(scene: bpy.types.Scene, output: str) -> None:
    extension = os.path.splitext(output)[1].lower()
    if extension not in FORMATS:
        fail(f"no picture format ends in {extension!r}; known are {', '.join(FORMATS)}")
    settings = scene.render.image_settings
    if extension == ".exr" and settings.file_format == "OPEN_EXR_MULTILAYER":
        return
    if hasattr(settings, "media_type"):  # 5.0 and newer: the kind comes before the format
        settings.media_type = "IMAGE"
    settings.file_format = FORMATS[extension]


def written_path(scene: bpy.types.Scene, output: str) -> str:
    """Blender puts the frame number in place of a run of #."""
    return re.sub("#+", lambda run: f"{scene.frame_current:0{len(run[0])}d}", output)


def main() -> None:
    job = json.loads(sys.argv[sys.argv.index("--") + 1])
    scene = bpy.context.scene
    try:
        scene.render.engine = job["engine"]
    except TypeError:
        fail(f"engine not found {job['engine']!r}")
    if job["size"]:
        scene.render.resolution_x, scene.render.resolution_y = job["size"]
        scene.render.resolution_percentage = 100
    if job["threads"]:
        scene.render.threads_mode = "FIXED"
        scene.render.threads = job["threads"]
    apply_engine_settings(scene, job)
    if job["frame"] is not None:
        scene.frame_set(job["frame"])
    output = job["output"]
    set_format(scene, output)
    scene.render.filepath = output
    scene.render.use_file_extension = False
    started = time.monotonic()
    try:
        bpy.ops.render.render(write_still=True)
    except RuntimeError as error:
        fail(str(error).strip().removeprefix("Error: "))
    result = {"path": written_path(scene, output), "seconds": time.monotonic() - started}
    print("talbot-render: " + json.dumps(result), flush=True)


main()
