"""The order of a synchronisation, and what an edit in the viewport makes necessary.

Shaders come first: they decide which attributes of meshes are worth reading. Then meshes, then objects and lamps, which
name both by handle.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import bpy
import numpy as np

from .. import settings as talbot_settings
from ..passes import light_groups
from .camera import camera_values, viewport_border, viewport_values
from .changes import Changes, read_changes
from .context import ACTIVE_UV, SyncContext
from .culling import Culling, culling_of
from .images import ImageSync
from .materials import ShaderSync
from .meshes import MeshSync
from .motion import Eyes, MotionPass, Shutter, shutter_of
from .objects import ObjectPass
from .records import Gathered, fingerprint, object_arrays
from .subdivision import chosen_view
from .unsupported import warn_scene
from .world import world_values

CROP = ("crop_x", "crop_y", "crop_width", "crop_height")
SetFrame = Callable[[int, float], None]
Sent = tuple[Gathered, list[int], bool]
"""What a pass found, the mesh handles of its records, and whether something was sent."""


@dataclass
class SyncResult:
    """What a synchronisation could not do, and seconds per stage."""

    warnings: list[str] = field(default_factory=list)
    timings: dict[str, float] = field(default_factory=dict)


class SceneSync:
    """Keeps one native session equal to a depsgraph."""

    def __init__(self, session: Any) -> None:
        self.session = session
        self.context = SyncContext(session)
        self.images = ImageSync(self.context)
        self.shaders = ShaderSync(self.context, self.images)
        self.meshes = MeshSync(self.context)
        self._settings: dict[str, Any] = {}
        self._camera: dict[str, Any] = {}
        self._world: dict[str, Any] = {}
        self._lights: list[dict[str, Any]] = []
        self._objects: dict[str, Any] = {}
        self._has_objects = False
        self._moves = False
        self._eyes: Eyes | None = None
        self._view: dict[str, Any] = {}
        self._motions: list[dict[str, Any]] = []

    # -- whole scenes

    def full(
        self,
        depsgraph: Any,
        scene: Any,
        view_layer: Any,
        *,
        width: int,
        height: int,
        viewport: bool,
        preview: bool = False,
        set_frame: SetFrame | None = None,
        eyes: Eyes | None = None,
        view: dict[str, Any] | None = None,
    ) -> SyncResult:
        """Sends everything; what the session held before is removed. `set_frame` takes the depsgraph to another frame,
        for motion blur; `eyes` are the cameras of a stereo pair; `view` is what a viewport shows."""
        context = self.context
        self._eyes, self._view = eyes, view or {}
        context.viewport = viewport
        context.warnings.clear()
        context.timings.clear()
        self._forget()
        with context.timed("settings"):
            self._send_settings(scene, view_layer, width, height, preview)
        warn_scene(context, scene)
        context.set_scene(scene, view_layer)
        self.shaders.begin(None)
        if viewport:
            self._sync_scene(depsgraph, scene, view_layer, Changes(objects=True, scene=True))
        else:
            self._sync_frame(
                depsgraph, scene, view_layer, Changes(objects=True, scene=True), (width, height), set_frame
            )
        return SyncResult(list(context.warnings), dict(context.timings))

    def next_frame(
        self,
        depsgraph: Any,
        scene: Any,
        view_layer: Any,
        *,
        width: int,
        height: int,
        set_frame: SetFrame | None = None,
        eyes: Eyes | None = None,
    ) -> SyncResult:
        """Another final frame of the same depsgraph (persistent data): of what the session holds, meshes whose geometry
        did not change stay; shaders, objects, lamps, world and camera are read again and sent where they differ."""
        context = self.context
        self._eyes = eyes
        context.warnings.clear()
        context.timings.clear()
        changes = read_changes(depsgraph)
        warn_scene(context, scene)
        with context.timed("settings"):
            self._send_settings(scene, view_layer, width, height)
        self.images.begin(changes.images)
        self.images.refresh()
        context.set_scene(scene, view_layer)
        self.shaders.begin(None)
        self._sync_frame(depsgraph, scene, view_layer, changes, (width, height), set_frame)
        return SyncResult(list(context.warnings), dict(context.timings))

    def _sync_frame(
        self,
        depsgraph: Any,
        scene: Any,
        view_layer: Any,
        changes: Changes,
        size: tuple[int, int],
        set_frame: SetFrame | None,
    ) -> None:
        """Scene and camera of a final frame, with what moves while the shutter is open."""
        self._motions = []
        shutter = shutter_of(scene, view_layer) if set_frame is not None else None
        if shutter is None or set_frame is None:
            if self._moves:
                self.session.set_motion({})
                self._moves = False
            self._sync_scene(depsgraph, scene, view_layer, changes)
            self._send_frame_camera(depsgraph, scene, size)
            return
        frame = (scene.frame_current, scene.frame_subframe)
        # Meshes keep the motion they were sent: all are new.
        changes.all_meshes = True
        try:
            self._sync_moving(depsgraph, changes, size, shutter, set_frame)
        finally:
            set_frame(*frame)

    def _sync_moving(
        self, depsgraph: Any, changes: Changes, size: tuple[int, int], shutter: Shutter, set_frame: SetFrame
    ) -> None:
        set_frame(*shutter.frame(0.5))
        scene = depsgraph.scene_eval
        self.context.set_scene(scene, depsgraph.view_layer_eval)
        gathered, handles, _ = self._sync_scene(depsgraph, scene, depsgraph.view_layer_eval, changes)
        self._send_frame_camera(depsgraph, scene, size)
        with self.context.timed("motion"):
            motion = MotionPass(self.context, shutter, self._eyes)
            motion.begin(depsgraph, gathered, handles, scene, size)
            for moment in motion.moments():
                self.context.check()
                set_frame(*shutter.frame(moment))
                motion.sample(depsgraph, depsgraph.scene_eval, moment, size)
            self._motions = motion.send(depsgraph.scene_eval)
        self._moves = True

    def _send_frame_camera(self, depsgraph: Any, scene: Any, size: tuple[int, int]) -> None:
        if scene.camera is not None:
            camera = scene.camera.evaluated_get(depsgraph)
            values = camera_values(self.context, camera, scene.render, *size, camera.matrix_world)
            self._send_camera(values)
            self._send_dicing_camera(values)

    def _send_dicing_camera(self, values: dict[str, Any]) -> bool:
        """Whose pixels adaptive subdivision counts: the scene's own choice, or this one. True when it changed."""
        values = self.meshes.dicing.chosen or values
        if not self.meshes.dicing.used or values == self.meshes.dicing.camera:
            return False
        self.session.set_dicing_camera(values)
        self.meshes.dicing.camera = values
        return True

    def _forget(self) -> None:
        if self._has_objects:
            self.session.set_objects({"mesh": np.zeros(0, np.int32), "matrix": np.zeros((0, 16), np.float32)})
        self.session.set_lights([])
        self.session.set_world({})
        self.meshes.forget()
        self.shaders.clear()
        self.images.clear()
        self.context.wanted = set()
        self._settings, self._camera, self._world, self._objects, self._lights = {}, {}, {}, {}, []
        self._has_objects = False

    def _send_settings(self, scene: Any, view_layer: Any, width: int, height: int, preview: bool = False) -> bool:
        values = talbot_settings.engine_settings(
            scene, view_layer, scene.render, viewport=self.context.viewport, preview=preview
        )
        values["width"], values["height"] = max(width, 1), max(height, 1)
        if self.context.viewport:
            values |= {name: self._settings[name] for name in CROP if name in self._settings}
        self.context.version = values["version"]
        aovs = [] if self.context.viewport else [aov.name for aov in view_layer.aovs if aov.is_valid]
        self.context.aovs = frozenset(aovs)
        groups = [] if self.context.viewport else light_groups(view_layer)
        self.context.light_groups = {name: index for index, name in enumerate(groups)}
        if values == self._settings:
            return False
        self.session.set_settings(values)
        self._settings = values
        return True

    def _sync_scene(self, depsgraph: Any, scene: Any, view_layer: Any, changes: Changes) -> Sent:
        """Everything but settings and camera."""
        context = self.context
        changed = False
        with context.timed("objects"):
            gathered = ObjectPass(context, self.shaders, depsgraph, view_layer, self._culling(depsgraph, scene)).run()
        with context.timed("world"):
            changed |= self._send_world(world_values(context, self.shaders, scene, view_layer))
        if gathered.lights != self._lights:
            self.session.set_lights(gathered.lights)
            self._lights = gathered.lights
            changed = True
        wanted = self.shaders.wanted()
        if view_layer.use_pass_uv:
            wanted.add(ACTIVE_UV)
        with context.timed("meshes"):
            stale_all = changes.all_meshes or not wanted <= context.wanted
            context.wanted |= wanted
            handles, meshes_changed, removed = self.meshes.send(
                gathered.records, changes.geometry, stale_all, depsgraph
            )
            changed |= meshes_changed
        self.meshes.dicing.used = any(record.dicing is not None for record in gathered.records)
        if self.meshes.dicing.used:
            self.meshes.dicing.chosen = chosen_view(depsgraph, scene, self._settings["width"], self._settings["height"])
        with context.timed("objects"):
            # Who compares later: viewports, and frames with persistent data.
            changed |= self._send_objects(gathered, handles, context.viewport or scene.render.use_persistent_data)
            for handle in removed:
                self.session.remove_mesh(handle)
        self.shaders.sweep()
        return gathered, handles, changed or self.shaders.sent

    def _culling(self, depsgraph: Any, scene: Any) -> Culling | None:
        # A viewport's view counts as it was when something was edited, as in Cycles.
        if self.context.viewport:
            return culling_of(scene, self._view)
        if scene.camera is None or not scene.render.use_simplify:
            return None
        camera, size = scene.camera.evaluated_get(depsgraph), (self._settings["width"], self._settings["height"])
        silent = SyncContext(None)
        return culling_of(scene, camera_values(silent, camera, scene.render, *size, camera.matrix_world))

    def _send_objects(self, gathered: Gathered, handles: list[int], remembers: bool) -> bool:
        arrays = object_arrays(gathered, handles)
        now = fingerprint(arrays) if remembers else {}
        before, self._objects = self._objects, now
        self._has_objects = True
        if before and before.keys() == now.keys():
            different = [name for name in now if now[name] != before[name]]
            if not different:
                return False
            if different == ["matrix"] and before["matrix"][0] == now["matrix"][0]:
                self.session.set_object_matrices(arrays["matrix"])
                return True
        self.session.set_objects(arrays)
        return True

    def _send_world(self, values: dict[str, Any]) -> bool:
        if values == self._world:
            return False
        self.session.set_world(values)
        self._world = values
        return True

    def _send_camera(self, values: dict[str, Any]) -> bool:
        if values == self._camera:
            return False
        self.session.set_camera(values)
        self._camera = values
        return True

    # -- edits in the viewport

    def update(self, depsgraph: Any) -> bool:
        """Sends what changed since the last call. True when the picture must be rendered again."""
        scene, view_layer = depsgraph.scene_eval, depsgraph.view_layer_eval
        changes = read_changes(depsgraph)
        changed = False
        if changes.scene and self._settings:
            changed |= self._send_settings(scene, view_layer, self._settings["width"], self._settings["height"])
        self.images.begin(changes.images)
        changed |= self.images.refresh()
        changes.all_shaders |= self.context.set_scene(scene, view_layer) and self.shaders.reads_time
        changes.all_shaders |= changes.scene and self.shaders.reads_layer
        self.shaders.begin(None if changes.all_shaders else changes.shading)
        if changes.only_shading() and self._update_shaders(depsgraph, scene, view_layer):
            return changed or self.shaders.sent
        return self._sync_scene(depsgraph, scene, view_layer, changes)[2] or changed

    def _update_shaders(self, depsgraph: Any, scene: Any, view_layer: Any) -> bool:
        """Reads changed materials and worlds without a pass over the objects. False when they ask more of meshes."""
        for update in depsgraph.updates:
            if isinstance(update.id, bpy.types.Material) and self.shaders.has(update.id):
                self.shaders.material(update.id)
        if self._send_world(world_values(self.context, self.shaders, scene, view_layer)):
            self.shaders.sent = True
        return self.shaders.wanted() <= self.context.wanted

    # -- cameras

    def set_render_camera(self, engine: Any, depsgraph: Any, eye: int = 0) -> bool:
        """The camera of the view that is active (one eye of a stereo pair), and how it moves. True when it changed."""
        if len(self._motions) > 1:
            self.session.set_motion(self._motions[eye])
        scene = depsgraph.scene_eval
        camera = engine.camera_override or scene.camera
        if camera is None:
            return False
        camera = camera.evaluated_get(depsgraph)
        matrix = engine.camera_model_matrix(camera)
        shift_x = engine.camera_shift_x(camera) if camera.type == "CAMERA" else 0.0
        width, height = self._settings["width"], self._settings["height"]
        return self._send_camera(camera_values(self.context, camera, scene.render, width, height, matrix, shift_x))

    def set_viewport_camera(self, context: Any, region: Any, region_data: Any, width: int, height: int) -> bool:
        """Follows a 3D viewport's view, size and render region. True when one of them changed."""
        border = viewport_border(context, region_data, width, height)
        window = {"width": max(width, 1), "height": max(height, 1)} | dict(zip(CROP, border, strict=True))
        changed = any(self._settings.get(name) != value for name, value in window.items())
        if changed:
            self._settings = self._settings | window
            self.session.set_settings(self._settings)
        values = self._view = viewport_values(self.context, context, region_data, width, height)
        # Dicing keeps the view of when the mesh came: turning the view costs nothing.
        if self.meshes.dicing.stale or self.meshes.dicing.chosen:
            self.meshes.dicing.stale = False
            changed |= self._send_dicing_camera(values)
        return self._send_camera(values) or changed

    def viewport_rectangle(self) -> tuple[float, float, float, float]:
        """What the picture covers of the viewport's region: x, y, width, height as fractions, from the bottom left."""
        width, height = self._settings["width"], self._settings["height"]
        x, y, across, up = (self._settings[name] for name in CROP)
        if across == 0:
            return 0.0, 0.0, 1.0, 1.0
        return x / width, y / height, across / width, up / height
