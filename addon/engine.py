"""The RenderEngine that Blender sees: thin. Each callback delegates, catches everything and tells the user in words.

The native sessions live in a side object: Blender invalidates the engine's Python instance before its finalizer runs.
"""

import os
import traceback
import weakref
from collections.abc import Callable
from typing import Any

import bpy

from . import final, native, passes, preview, reports, viewport


class EngineState:
    """What one engine instance owns besides Blender's data."""

    def __init__(self) -> None:
        self.final = final.FinalState()
        self.viewport: viewport.Viewport | None = None

    def close(self) -> None:
        """Stops all work and lets go of the sessions. Safe to call twice."""
        if self.viewport is not None:
            self.viewport.close()
            self.viewport = None
        self.final.close()


def explain(error: Exception) -> str:
    """One sentence for the user."""
    if isinstance(error, native.Unavailable):
        return str(error)
    if isinstance(error, MemoryError):
        return "Out of memory: simplify the scene or render at a lower resolution"
    module = type(error).__module__
    if module.endswith("_talbot") or module == "talbot":
        return str(error)
    return f"Internal error in Talbot ({type(error).__name__}: {error})"


def _show_tracebacks(scene: Any) -> bool:
    talbot = getattr(scene, "talbot", None)
    return bool(os.environ.get("TALBOT_DEBUG") or bpy.app.debug or getattr(talbot, "show_tracebacks", False))


def _print_traceback(scene: Any) -> None:
    if _show_tracebacks(scene):
        traceback.print_exc()


class TalbotRenderEngine(bpy.types.RenderEngine):
    """Talbot path tracer"""

    bl_idname = "TALBOT"
    bl_label = "Talbot"
    bl_use_preview = True
    bl_use_eevee_viewport = True  # Material Preview is drawn by EEVEE, as for Cycles
    bl_use_shading_nodes_custom = False
    bl_use_postprocess = True
    bl_use_image_save = True
    bl_use_gpu_context = False
    bl_use_stereo_viewport = False

    @property
    def state(self) -> EngineState:
        """Made on first use: `__init__` runs twice in Blender 5 and never for 3.4's stray first instance."""
        state = self.__dict__.get("_state")
        if state is None:
            state = EngineState()
            self._state = state
            weakref.finalize(self, state.close).atexit = True
        return state

    def update_render_passes(self, scene: Any = None, renderlayer: Any = None) -> None:
        """The passes of a view layer."""
        self._guarded(scene, "WARNING", lambda: passes.register_all(self, scene, renderlayer))

    def update(self, data: Any = None, depsgraph: Any = None) -> None:
        """Nothing is read before `render`: both come in pairs."""

    def render(self, depsgraph: Any) -> None:
        """Renders one view layer of a frame, or a preview."""
        job = preview.render if self.is_preview else final.render
        scene = depsgraph.scene_eval
        if not self._guarded(scene, "ERROR", lambda: job(self, self.state.final, depsgraph)):
            self.state.final.close()

    def view_update(self, context: Any, depsgraph: Any) -> None:
        """The scene changed, or a viewport starts."""
        self._guarded_view(depsgraph.scene_eval, lambda view: view.update(self, context, depsgraph))

    def view_draw(self, context: Any, depsgraph: Any) -> None:
        """The viewport wants its picture."""
        self._guarded_view(depsgraph.scene_eval, lambda view: view.draw(self, context, depsgraph))

    def _guarded(self, scene: Any, severity: str, action: Callable[[], None]) -> bool:
        try:
            action()
        except Exception as error:
            message = explain(error)
            _print_traceback(scene)
            if scene is not None and not self.is_preview:
                reports.of_scene(scene.name).add(reports.Line("error", message))
            self.report({severity}, message)
            return False
        return True

    def _guarded_view(self, scene: Any, action: Callable[[viewport.Viewport], None]) -> None:
        state = self.state
        if state.viewport is None:
            state.viewport = viewport.Viewport()
        view = state.viewport
        try:
            action(view)
        except Exception as error:
            message = explain(error)
            if message != view.failure:  # view_draw comes again and again
                view.failure = message
                _print_traceback(scene)
                reports.of_scene(scene.name).add(reports.Line("error", message))
            self.update_stats("Talbot", f"Error: {message}")


def registered_elsewhere() -> str:
    """The module of another Talbot that is registered in this Blender, "" when there is none."""
    for other in bpy.types.RenderEngine.__subclasses__():
        if other is not TalbotRenderEngine and getattr(other, "bl_idname", "") == TalbotRenderEngine.bl_idname:
            if other.is_registered:
                return other.__module__.rpartition(".")[0] or other.__module__
    return ""
