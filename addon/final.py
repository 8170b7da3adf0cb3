"""A final render: one view layer of one frame, from Blender's scene to Blender's render result."""

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import bpy

from . import native, passes, reports
from .sessions import Synced, open_session
from .sync.context import Interrupted

WAIT_MILLISECONDS = 50
"""How long a cancel may go unnoticed: the engine needs a part of the 200 ms for itself."""

LINE_SECONDS = 1.0
"""Least time between two lines on the console of a background render."""

PICTURE_SHARE = 0.05
"""Share of the time that intermediate pictures may take."""

MEBIBYTE = 1 << 20
GIBIBYTE = 1 << 30
MAX_METADATA = 1000


@dataclass
class FinalState:
    """What an engine keeps between frames while the scene asks for persistent data."""

    kept: Synced | None = None
    running: Any = None
    frame: tuple[str, int, float] | None = None
    layers: set[str] = field(default_factory=set)

    def close(self) -> None:
        """Stops and frees the sessions."""
        if self.running is not None:
            self.running.stop()
            self.running = None
        if self.kept is not None:
            self.kept.session.stop()
            self.kept = None


@contextmanager
def result_of(engine: Any, width: int, height: int, layer_name: str) -> Iterator[Any]:
    """Blender's result for one layer, ended whatever happens: a missing end crashes Blender when it writes a file."""
    result = engine.begin_result(0, 0, width, height, layer=layer_name)
    try:
        yield result
    finally:
        engine.end_result(result)


def check_memory(width: int, height: int) -> None:
    """Blender's result is touched as soon as it is asked for: what it cannot hold would end Blender. Combined alone, in
    Blender and in the session; with other passes, the session says more."""
    needed, left = width * height * 32, native.module().available_memory()
    if needed > left:
        sizes = f"{needed / GIBIBYTE:.0f} GiB, {left / GIBIBYTE:.0f} GiB are left"
        raise native.module().Error(f"Not enough memory: a picture of {width} x {height} pixels takes {sizes}")


def render(engine: Any, state: FinalState, depsgraph: Any) -> None:
    """Renders the depsgraph's view layer, every view of it (stereo), all passes."""
    scene = depsgraph.scene_eval
    layer = depsgraph.view_layer_eval
    check_memory(engine.resolution_x, engine.resolution_y)
    with result_of(engine, engine.resolution_x, engine.resolution_y, layer.name) as result:
        if not result.layers:
            raise RuntimeError(f"view layer {layer.name} has no place in the result")
        try:
            LayerRender(engine, state, depsgraph, scene, layer, result).run()
        except Interrupted:
            return  # cancelled before there was a picture


def _keeps_data(scene: Any, original: Any) -> bool:
    """Whether the next frame may start from this one's session. With several view layers Blender makes a new depsgraph
    for each (the evaluated scene has its own layer only); frames of image sequences would pile up."""
    layers = sum(1 for layer in original.view_layers if layer.use)
    moving = any(image.source in {"SEQUENCE", "MOVIE"} and image.users for image in bpy.data.images)
    return scene.render.use_persistent_data and layers == 1 and not moving


def describe_seconds(seconds: float) -> str:
    """12.34 s as Blender writes times: 00:12.34."""
    minutes, rest = divmod(max(0.0, seconds), 60.0)
    hours, minutes = divmod(int(minutes), 60)
    head = f"{hours}:{minutes:02d}" if hours else f"{minutes:02d}"
    return f"{head}:{rest:05.2f}"


def check_failed(session: Any, progress: dict[str, Any]) -> None:
    """Raises what made the session fail."""
    if progress["state"] == "failed":
        raise native.module().Error(session.error())


class LayerRender:
    """One call of Blender's `render`."""

    def __init__(self, engine: Any, state: FinalState, depsgraph: Any, scene: Any, layer: Any, result: Any) -> None:
        self.engine = engine
        self.state = state
        self.depsgraph = depsgraph
        self.scene = scene
        self.layer = layer
        self.result = result
        self.pixels = result.resolution_x * result.resolution_y
        self.passes = passes.wanted(scene, layer)
        self.denoise = passes.denoises(scene, layer)
        self.views = [view.name for view in result.views] or [""]
        self.shown = ("", 0.0)
        self.reports = self._reports_of_frame()

    def _reports_of_frame(self) -> reports.Reports:
        """The view layers of a frame share one list; a layer that comes again begins the next."""
        frame = (self.scene.name, self.scene.frame_current, self.scene.frame_subframe)
        if frame != self.state.frame or self.layer.name in self.state.layers:
            self.state.frame = frame
            self.state.layers = set()
            reports.begin(self.scene.name)
        self.state.layers.add(self.layer.name)
        return reports.of_scene(self.scene.name)

    def run(self) -> None:
        """Reads the scene once, renders every view."""
        started = time.perf_counter()
        synced, stages = self._synchronise()
        sync_seconds = time.perf_counter() - started
        session = synced.session
        self.state.running = session
        session.set_passes(passes.native_names(self.passes, denoise=self.denoise))
        session.set_denoiser(native.library_dirs() if self.denoise else None)
        for number, view in enumerate(self.views):
            if view or self.engine.camera_override:
                self.engine.active_view_set(view)
                synced.sync.set_render_camera(self.engine, self.depsgraph, number)
            if not self._render_view(session, view, number):
                break
        self._finish(session, sync_seconds, stages)

    def _synchronise(self) -> tuple[Synced, dict[str, float]]:
        """A session that holds the scene (the kept one, with persistent data), and the seconds of each stage."""
        engine, scene, layer = self.engine, self.scene, self.layer
        engine.update_stats(f"{scene.name}, {layer.name}", "Synchronizing")
        persistent = _keeps_data(scene, self.depsgraph.scene)
        synced = self.state.kept if persistent else None
        width, height = engine.resolution_x, engine.resolution_y
        kept = synced is not None
        synced = synced or open_session()
        context = synced.sync.context
        context.interrupted = engine.test_break
        eyes = self._eyes if any(self.views) else None
        try:
            if kept:
                outcome = synced.sync.next_frame(
                    self.depsgraph, scene, layer, width=width, height=height, set_frame=self._set_frame, eyes=eyes
                )
            else:
                outcome = synced.sync.full(
                    self.depsgraph,
                    scene,
                    layer,
                    width=width,
                    height=height,
                    viewport=False,
                    set_frame=self._set_frame,
                    eyes=eyes,
                )
        except Interrupted:
            self.state.close()
            raise
        finally:
            context.interrupted = None  # the engine must not outlive this callback
        lines = [reports.Line("warning", str(text)) for text in outcome.warnings]
        lines += [
            reports.Line("warning", f"The {name} pass is not available in Talbot yet", f"View Layer {layer.name}")
            for name in passes.not_offered(layer)
        ]
        lines += reports.from_session(synced.session)  # about meshes and objects; the session forgets it when it starts
        reports.publish(engine, self.reports, lines)
        self.state.kept = synced if persistent else None
        return synced, outcome.timings

    def _set_frame(self, frame: int, subframe: float) -> None:
        self.engine.frame_set(frame, subframe=subframe)

    def _eyes(self, camera: Any) -> list[tuple[Any, float]]:
        """The evaluated camera in every view, at the moment to which the scene is set."""
        out = []
        for view in self.views:
            self.engine.active_view_set(view)
            shift = self.engine.camera_shift_x(camera) if camera.type == "CAMERA" else 0.0
            out.append((self.engine.camera_model_matrix(camera), shift))
        return out

    def _render_view(self, session: Any, view: str, number: int) -> bool:
        """Renders one view to its end. False when the user cancelled; what there is has been written."""
        engine = self.engine
        dump = os.environ.get("TALBOT_DUMP", "")  # `./talbot render --dump`: the first view of the first layer
        if dump and number == 0 and len(self.state.layers) == 1:
            session.dump(dump)
        session.start()
        seen = 0
        next_picture = time.perf_counter() + 0.5
        cancelled = False
        while True:
            finished = session.wait(WAIT_MILLISECONDS)
            if engine.test_break():
                session.cancel()
                session.stop()
                cancelled = True
                break
            progress = session.progress()
            check_failed(session, progress)
            self._show_progress(progress, number)
            if finished:
                break
            now = time.perf_counter()
            if not bpy.app.background and progress["image_version"] != seen and now >= next_picture:
                seen = progress["image_version"]
                passes.write(self.result.layers[0], view, self.passes[:1], session, self.pixels)
                engine.update_result(self.result)
                spent = time.perf_counter() - now
                next_picture = now + max(0.5, spent / PICTURE_SHARE)
        denoised = session.read_denoised() if self.denoise and not cancelled else None
        passes.write(self.result.layers[0], view, self.passes, session, self.pixels, denoised=denoised)
        engine.update_result(self.result)
        return not cancelled

    def _stats_line(self, progress: dict[str, Any]) -> str:
        parts = [f"{self.scene.name}, {self.layer.name}"]
        if progress["remaining"] >= 0 and progress["state"] == "rendering":
            parts.insert(0, f"Remaining:{describe_seconds(progress['remaining'])}")
        memory, peak = progress["memory"] / MEBIBYTE, progress["memory_peak"] / MEBIBYTE
        parts.append(f"Mem:{memory:.0f}M, Peak:{peak:.0f}M")
        return " | ".join(parts)

    def _show_progress(self, progress: dict[str, Any], view_number: int) -> None:
        engine = self.engine
        engine.update_memory_stats(
            memory_used=progress["memory"] / MEBIBYTE, memory_peak=progress["memory_peak"] / MEBIBYTE
        )
        engine.update_progress((view_number + min(1.0, progress["fraction"])) / len(self.views))
        self._show_status(progress)

    def _show_status(self, progress: dict[str, Any]) -> None:
        """Blender prints each status in the background: only new ones, and not too many."""
        status, now = progress["status"], time.perf_counter()
        before, when = self.shown
        ended = progress["state"] == "done"
        if status == before or (bpy.app.background and not ended and now - when < LINE_SECONDS):
            return
        self.shown = (status, now)
        self.engine.update_stats(self._stats_line(progress), status)

    def _finish(self, session: Any, sync_seconds: float, stages: dict[str, float]) -> None:
        lines = reports.from_session(session)
        lines.append(
            reports.Line("info", self._summary(session, sync_seconds, stages), f"View Layer {self.layer.name}")
        )
        reports.publish(self.engine, self.reports, lines)
        self._stamp(session, sync_seconds)
        self.state.running = None
        if self.state.kept is None:
            session.stop()

    def _summary(self, session: Any, sync_seconds: float, stages: dict[str, float]) -> str:
        """Where the time went, for the panel."""
        progress, statistics = session.progress(), session.statistics()
        parts = ", ".join(f"{name} {seconds:.2f}" for name, seconds in stages.items() if seconds >= 0.01)
        rays = statistics["camera_rays"] + statistics["bounce_rays"] + statistics["shadow_rays"]
        seconds = max(statistics["render_seconds"], 1e-6)
        samples, (width, height) = progress["samples_done"], session.size()
        mean = statistics["paths"] / max(1, width * height)
        counted = f"{samples} samples" if mean > samples - 0.05 else f"{mean:.1f} of {samples} samples a pixel"
        return (
            f"Read in {sync_seconds:.2f} s{f' ({parts})' if parts else ''}, "
            f"built in {statistics['update_seconds']:.2f} s, "
            f"{counted} in {seconds:.2f} s, {rays / seconds / 1e6:.2f} million rays a second, "
            f"peak {progress['memory_peak'] / MEBIBYTE:.0f} MiB"
        )

    def _stamp(self, session: Any, sync_seconds: float) -> None:
        """What made the picture, into the file's metadata."""
        progress = session.progress()
        module = native.module()
        result = self.engine.get_result()
        prefix = f"talbot.{self.layer.name}"
        fallbacks = "; ".join(str(line) for line in self.reports.lines if line.level != "info")
        fields = {
            "talbot.version": module.__version__,
            "talbot.instruction_set": module.chosen_instruction_set(),
            "talbot.seed": str(self.scene.talbot.seed),
            f"{prefix}.samples": str(progress["samples_done"]),
            f"{prefix}.render_time": describe_seconds(progress["seconds"]),
            f"{prefix}.synchronization_time": describe_seconds(sync_seconds),
        }
        if fallbacks:
            fields[f"{prefix}.fallbacks"] = fallbacks[:MAX_METADATA]
        for name, value in fields.items():
            result.stamp_data_add_field(name, value)
