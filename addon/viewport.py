"""The rendered viewport: follows the scene and the view, and draws the newest picture until its samples are done."""

import weakref
from typing import Any

import bpy
import gpu
import numpy as np
from gpu_extras.presets import draw_texture_2d
from numpy.typing import NDArray

from . import final, native, passes, reports
from .sessions import open_session
from .sync.camera import viewport_values

TICK_SECONDS = 0.05
WORKING = ("updating", "rendering")


class Viewport:
    """One 3D viewport in rendered mode. Holds no Blender data beyond a callback."""

    def __init__(self) -> None:
        self.failure = ""
        self.session: Any = None
        self.sync: Any = None
        self._drawn_version = 0
        self._texture: Any = None
        self._pixels: NDArray[np.float32] | None = None  # the GPU buffer aliases this memory
        self._rectangle = (0.0, 0.0, 1.0, 1.0)  # of the region that the texture covers
        self._passes: list[str] = []
        self.closed = False
        self.ticking = False

    def close(self) -> None:
        """Stops rendering; called when Blender frees the engine."""
        self.closed = True
        self._texture = None
        self._pixels = None
        self._stop()

    def _stop(self) -> None:
        if self.session is not None:
            self.session.stop()
        self.session = None
        self.sync = None

    def update(self, engine: Any, context: Any, depsgraph: Any) -> None:
        """The scene changed: reads it whole the first time (or after a failure), then only what changed."""
        if self.session is None or self.failure:
            self._start(engine, context, depsgraph)
            return
        changed = self.sync.update(depsgraph)
        if self._choose_passes(depsgraph.scene_eval) or changed:
            self._restart(engine)

    def _start(self, engine: Any, context: Any, depsgraph: Any) -> None:
        """A new session; the old one, if any, may be in an unknown state."""
        self._stop()
        synced = open_session()
        region, scene = context.region, depsgraph.scene_eval
        width, height = region.width, region.height
        view = {}  # only culling asks for it
        if scene.render.use_simplify:
            view = viewport_values(synced.sync.context, context, context.region_data, width, height)
        outcome = synced.sync.full(
            depsgraph, scene, depsgraph.view_layer_eval, width=width, height=height, viewport=True, view=view
        )
        kept = reports.begin(scene.name)
        for text in outcome.warnings:
            kept.add(reports.Line("warning", str(text)))
        synced.sync.set_viewport_camera(context, region, context.region_data, width, height)
        self.session, self.sync = synced.session, synced.sync
        self.failure = ""
        self._drawn_version = 0
        self._passes = []
        self._choose_passes(scene)
        self._restart(engine)

    def _choose_passes(self, scene: Any) -> bool:
        """Asks for the denoiser and its guides while it is on. True when that changed."""
        denoise = scene.talbot.use_preview_denoising
        wanted = ["combined", *(passes.DENOISING_GUIDES if denoise else ())]
        if wanted == self._passes:
            return False
        self._passes = wanted
        self.session.set_passes(wanted)
        self.session.set_denoiser(native.library_dirs() if denoise else None)
        return True

    def _restart(self, engine: Any) -> None:
        self.session.start()  # what is drawn stays until there is a new picture
        self._keep_ticking(engine)
        engine.update_stats("Talbot", "Updating")

    def draw(self, engine: Any, context: Any, depsgraph: Any) -> None:
        """Follows the view, then draws the newest picture there is."""
        width, height = context.region.width, context.region.height
        if self.failure:  # until the scene is edited
            self._draw_texture(width, height)
            engine.update_stats("Talbot", f"Error: {self.failure}")
            return
        if self.session is None:
            self._start(engine, context, depsgraph)
        if self.sync.set_viewport_camera(context, context.region, context.region_data, width, height):
            self._restart(engine)
        progress = self.session.progress()
        final.check_failed(self.session, progress)
        self._refresh_texture(progress)
        self._draw_texture(width, height)
        self._show_status(engine, progress)
        if progress["state"] in WORKING:
            self._keep_ticking(engine)

    def _draw_texture(self, width: int, height: int) -> None:
        """Linear and premultiplied: Blender applies the view transform. Stretched until a resize has its picture."""
        if self._texture is not None:
            x, y, across, up = self._rectangle
            gpu.state.blend_set("ALPHA_PREMULT")
            draw_texture_2d(self._texture, (x * width, y * height), across * width, up * height)
            gpu.state.blend_set("NONE")

    def _refresh_texture(self, progress: dict[str, Any]) -> None:
        version = progress["image_version"]
        if version == self._drawn_version:
            return
        pixels = self.session.read_denoised()
        if pixels is None:
            pixels = self.session.read_pass("combined")
        if pixels is not None:
            self._upload(pixels)
            self._drawn_version = version

    def _upload(self, pixels: NDArray[np.float32]) -> None:
        width, height = self.session.size()
        if pixels.shape[0] != width * height:
            return
        self._pixels = np.ascontiguousarray(pixels, np.float32)
        buffer = gpu.types.Buffer("FLOAT", self._pixels.size, self._pixels.reshape(-1))
        self._texture = gpu.types.GPUTexture((width, height), format="RGBA16F", data=buffer)
        self._rectangle = self.sync.viewport_rectangle()

    def _show_status(self, engine: Any, progress: dict[str, Any]) -> None:
        memory = f"Mem:{progress['memory'] / final.MEBIBYTE:.0f}M"
        done = progress["state"] == "done"
        status = "Rendering Done" if done else progress["status"]
        engine.update_stats(f"{memory} | Time:{final.describe_seconds(progress['seconds'])}", status)

    def _keep_ticking(self, engine: Any) -> None:
        """Asks Blender for redraws while the picture changes. The timer ends with the work or the viewport."""
        if self.ticking:
            return
        self.ticking = True
        bpy.app.timers.register(_ticker(weakref.ref(self), weakref.ref(engine)), first_interval=TICK_SECONDS)


def _ticker(view_ref: Any, engine_ref: Any) -> Any:
    last = [-1]

    def tick() -> float | None:
        view, engine = view_ref(), engine_ref()
        if view is None or engine is None or view.closed or view.session is None:
            return None
        progress = view.session.progress()
        try:
            if progress["image_version"] != last[0] or progress["state"] not in WORKING:
                last[0] = progress["image_version"]
                engine.tag_redraw()
        except ReferenceError:  # Blender freed the engine between two ticks
            view.ticking = False
            return None
        if progress["state"] not in WORKING:
            view.ticking = False
            return None
        return TICK_SECONDS

    return tick
