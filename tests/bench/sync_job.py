"""Runs inside Blender for sync.py: builds a case, renders a tiny picture with one engine, writes how long it read."""

import os
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

from job import run


def clear() -> bpy.types.Scene:
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.location = (0, 0, 30)
    scene.collection.objects.link(camera)
    scene.camera = camera
    return scene


def sheet(cells: int, size: float = 10.0) -> Any:
    """A square of cells x cells faces."""
    axis = np.linspace(-size / 2, size / 2, cells + 1, dtype=np.float32)
    x, y = np.meshgrid(axis, axis, indexing="xy")
    positions = np.stack([x, y, 0.2 * np.sin(3 * x) * np.cos(2 * y)], axis=-1).reshape(-1, 3)
    i = np.arange((cells + 1) ** 2).reshape(cells + 1, cells + 1)
    corners = np.stack([i[:-1, :-1], i[:-1, 1:], i[1:, 1:], i[1:, :-1]], axis=-1).reshape(-1).astype(np.int32)
    mesh = bpy.data.meshes.new("Sheet")
    mesh.vertices.add(len(positions))
    mesh.vertices.foreach_set("co", positions.reshape(-1))
    mesh.loops.add(corners.size)
    mesh.loops.foreach_set("vertex_index", corners)
    mesh.polygons.add(corners.size // 4)
    mesh.polygons.foreach_set("loop_start", np.arange(0, corners.size, 4, dtype=np.int32))
    if bpy.app.version < (4, 1, 0):
        mesh.polygons.foreach_set("loop_total", np.full(corners.size // 4, 4, dtype=np.int32))
    mesh.update()
    obj = bpy.data.objects.new("Sheet", mesh)
    bpy.context.scene.collection.objects.link(obj)
    return obj


def triangles(scene: bpy.types.Scene) -> None:
    sheet(707)


def instances(scene: bpy.types.Scene) -> None:
    parent = sheet(316)
    bpy.ops.mesh.primitive_cube_add(size=0.02)
    bpy.context.object.parent = parent
    parent.instance_type = "FACES"


def hair(scene: bpy.types.Scene) -> None:
    obj = sheet(10)
    obj.modifiers.new("Hair", "PARTICLE_SYSTEM")
    settings = obj.particle_systems[0].settings
    settings.type, settings.count, settings.render_step = "HAIR", 20_000, 3


def curves(scene: bpy.types.Scene) -> None:
    data = bpy.data.hair_curves.new("Curves")
    count, keys = 100_000, 8
    positions = np.zeros((count, keys, 3), np.float32)
    positions[:, :, :2] = np.random.default_rng(1).uniform(-5, 5, (count, 1, 2))
    positions[:, :, 2] = np.linspace(0, 1, keys)
    data.add_curves([keys] * count)
    data.points.foreach_set("position", positions.ravel())
    scene.collection.objects.link(bpy.data.objects.new("Curves", data))


def animation(scene: bpy.types.Scene) -> None:
    """A heavy mesh that stands still, persistent data, and a camera that moves."""
    sheet(707)
    scene.render.use_persistent_data = True
    for frame, x in ((1, 0.0), (10, 3.0)):
        scene.camera.location.x = x
        scene.camera.keyframe_insert("location", frame=frame)


CASES: dict[str, Callable[[bpy.types.Scene], None]] = {
    "triangles": triangles,
    "instances": instances,
    "hair": hair,
    "curves": curves,
    "animation": animation,
}


class CyclesClock:
    """Seconds from the first object that Cycles reads until it begins to build, by its status lines. Older Blenders
    print them and do not tell handlers: the printed lines are kept and put beside the handler's times."""

    def __init__(self) -> None:
        self.times: list[float] = []
        self.texts: list[str] = []
        # To a function that names its parameters Blender does not tell the text.
        bpy.app.handlers.render_stats.append(lambda *arguments: self.note(*arguments))
        self.printed = tempfile.TemporaryFile("w+", errors="replace")
        os.dup2(self.printed.fileno(), 1)

    def note(self, *arguments: Any) -> None:
        self.times.append(time.perf_counter())
        if arguments and arguments[0]:
            self.texts.append(str(arguments[0]))

    def take(self) -> float:
        """Of the last render; nothing was read: 0."""
        self.printed.seek(0)
        texts = self.texts or [line for line in self.printed if line.startswith("Fra:")]
        states = list(zip(self.times, texts, strict=True))
        begin = next((at for at, text in states if "Synchronizing" in text), None)
        after = [at for at, text in states if begin is not None and at > begin and "Synchronizing" not in text]
        self.printed.seek(0)
        self.printed.truncate()
        self.times.clear()
        self.texts.clear()
        return after[0] - begin if begin is not None and after else 0.0


class TalbotClock:
    """Seconds of the whole synchronisation: everything between Blender's call and the start of the session."""

    def __init__(self) -> None:
        from talbot import final

        self.seconds = 0.0
        inner = final.LayerRender._synchronise

        def timed(render: Any) -> Any:
            started = time.perf_counter()
            try:
                return inner(render)
            finally:
                self.seconds += time.perf_counter() - started

        final.LayerRender._synchronise = timed

    def take(self) -> float:
        seconds, self.seconds = self.seconds, 0.0
        return seconds


def measure(job: dict[str, Any]) -> dict[str, Any]:
    """Cold: the first render of the process; warm: the fastest of the next three (of an animation: the next frames)."""
    if job["case"] == "curves" and not hasattr(bpy.data.hair_curves.new("Curves"), "add_curves"):
        return {"blender": bpy.app.version_string}  # scripts cannot make them here
    scene = clear()
    CASES[job["case"]](scene)
    scene.render.engine = job["engine"]
    scene.render.resolution_x = scene.render.resolution_y = 16
    scene.cycles.samples, scene.cycles.device = 1, "CPU"
    scene.cycles.use_denoising = False
    clock = CyclesClock() if job["engine"] == "CYCLES" else TalbotClock()
    seconds = []
    for frame in range(1, 5):
        if job["case"] == "animation":
            scene.frame_set(frame)
        bpy.ops.render.render()
        seconds.append(clock.take())
    return {"cold": seconds[0], "warm": min(seconds[1:]), "blender": bpy.app.version_string}


run(measure)
