"""Runs inside Blender for run.py: renders the open scene with one engine and several seeds; writes times and pixels."""

import re
import resource
import sys
import time
from pathlib import Path
from typing import Any

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

from job import run

MOST_SAMPLES = 16384


def prepare(scene: bpy.types.Scene, job: dict[str, Any]) -> None:
    """The same light transport in both engines, and nothing that hides noise."""
    scene.render.engine = job["engine"]
    cycles = scene.cycles
    cycles.device = "CPU"
    cycles.use_adaptive_sampling = False
    cycles.use_denoising = False
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0.0
    cycles.light_sampling_threshold = 0.0
    cycles.pixel_filter_type = "BOX"
    if hasattr(cycles, "time_limit"):
        cycles.time_limit = 0.0
    render = scene.render
    width = render.resolution_x * render.resolution_percentage / 100
    wanted = job["width"] or min(480, width)
    render.resolution_percentage = 100
    scale = wanted / render.resolution_x
    render.resolution_x = max(1, round(render.resolution_x * scale))
    render.resolution_y = max(1, round(render.resolution_y * scale))
    render.use_compositing = render.use_sequencer = False
    render.use_border = False
    if job["threads"]:
        render.threads_mode, render.threads = "FIXED", job["threads"]
    settings = render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "IMAGE"
    settings.file_format, settings.color_depth, settings.color_mode = "OPEN_EXR", "32", "RGBA"


def render(scene: bpy.types.Scene, samples: int, seed: int, path: Path) -> float:
    scene.cycles.samples, scene.cycles.seed = samples, seed
    scene.render.filepath = str(path)
    begin = time.perf_counter()
    bpy.ops.render.render(write_still=True)
    return time.perf_counter() - begin


def pixels(path: Path) -> np.ndarray:
    image = bpy.data.images.load(str(path))
    image.colorspace_settings.name = "Non-Color"
    values = np.empty(len(image.pixels), dtype=np.float32)
    image.pixels.foreach_get(values)
    bpy.data.images.remove(image)
    return values.reshape(-1, 4)


def rays_a_second(scene: bpy.types.Scene) -> dict[str, float]:
    """From the summary line that Talbot leaves for its panel."""
    from talbot import reports

    text = " ".join(str(line) for line in reports.of_scene(scene.name).lines)
    found = re.search(r"([\d.]+) million rays a second", text)
    return {"mrays": float(found.group(1))} if found else {}


def measure(job: dict[str, Any]) -> dict[str, Any]:
    scene = bpy.context.scene
    prepare(scene, job)
    folder = Path(job["folder"])
    picture = folder / "picture.exr"
    render(scene, 1, 99, picture)  # warm: files in cache, shaders and libraries loaded
    one = min(render(scene, 1, 98, picture), render(scene, 1, 97, picture))
    # So many that their time stands out from what loading takes more or less.
    few = 8
    while (spent := render(scene, few, 96, picture) - one) < max(job["seconds"] / 4, one / 2) and few < MOST_SAMPLES:
        few = min(4 * few, MOST_SAMPLES)
    samples = int(np.clip(round(job["seconds"] / max(spent, 1e-3) * few), 4, MOST_SAMPLES))
    times = []
    for seed in range(job["seeds"]):
        times.append(render(scene, samples, 1000 + seed, picture))
        np.save(folder / f"{seed}.npy", pixels(picture))
    total = float(np.median(times))
    per_sample = max((total - one) / (samples - 1), 1e-6)
    answer = {
        "samples": samples,
        "render": per_sample * samples,
        "load": max(one - per_sample, 0.0),
        "total": total,
        "memory": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024,
        "size": [scene.render.resolution_x, scene.render.resolution_y],
        "blender": bpy.app.version_string,
    }
    if job["engine"] == "TALBOT":
        answer |= rays_a_second(scene)
    return answer


run(measure)
