"""A session that records what it is told, for tests of what the add-on reads from Blender."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np

OBJECT_COLUMNS = {"matrix", "traits", "random", "dupli_generated", "dupli_uv"}


class RecordingSession:
    """The scene half of the native Session. Removed things must not be named again."""

    def __init__(self) -> None:
        self.calls: list[str] = []
        self.settings: dict[str, Any] = {}
        self.camera: dict[str, Any] = {}
        self.dicing_camera: dict[str, Any] = {}
        self.world: dict[str, Any] = {}
        self.lights: list[dict[str, Any]] = []
        self.objects: dict[str, Any] = {}
        self.meshes: dict[int, tuple[str, dict[str, Any]]] = {}
        self.shaders: dict[int, tuple[str, dict[str, Any], dict[str, Any]]] = {}
        self.images: dict[int, dict[str, Any]] = {}
        self.motion: dict[str, Any] = {}
        self.mesh_motions: dict[int, dict[str, Any]] = {}
        self._next = 0

    def _handle(self) -> int:
        self._next += 1
        return self._next

    def set_settings(self, values: dict[str, Any]) -> None:
        self.calls.append("set_settings")
        self.settings = dict(values)

    def set_camera(self, values: dict[str, Any]) -> None:
        self.calls.append("set_camera")
        self.camera = dict(values)

    def set_dicing_camera(self, values: dict[str, Any]) -> None:
        self.calls.append("set_dicing_camera")
        self.dicing_camera = dict(values)

    def set_world(self, values: dict[str, Any]) -> None:
        self.calls.append("set_world")
        assert values.get("shader", -1) in (-1, *self.shaders)
        self.world = dict(values)

    def set_lights(self, lights: list[dict[str, Any]]) -> None:
        self.calls.append("set_lights")
        assert all(light["shader"] in (-1, *self.shaders) for light in lights)
        self.lights = lights

    def add_mesh(self, name: str, arrays: dict[str, Any]) -> int:
        self.calls.append("add_mesh")
        handle = self._handle()
        self.meshes[handle] = (name, arrays)
        return handle

    def set_mesh(self, handle: int, name: str, arrays: dict[str, Any]) -> None:
        self.calls.append("set_mesh")
        assert handle in self.meshes
        self.meshes[handle] = (name, arrays)

    def set_motion(self, values: dict[str, Any]) -> None:
        self.calls.append("set_motion")
        self.motion = values

    def set_mesh_motion(self, handle: int, values: dict[str, Any]) -> None:
        self.calls.append("set_mesh_motion")
        assert handle in self.meshes
        self.mesh_motions[handle] = values

    def remove_mesh(self, handle: int) -> None:
        self.calls.append("remove_mesh")
        del self.meshes[handle]

    def set_objects(self, arrays: dict[str, Any]) -> None:
        self.calls.append("set_objects")
        assert all(handle in (-1, *self.meshes) for handle in arrays["mesh"])
        assert all(h in (-1, *self.shaders) for handles in arrays.get("material_sets", []) for h in handles)
        # Tests ask for an object's row of every column.
        traits = arrays.get("traits", slice(None))
        shared = {name for name, values in arrays.items() if isinstance(values, np.ndarray)} - OBJECT_COLUMNS
        self.objects = arrays | {name: arrays[name][traits] for name in shared}

    def set_object_matrices(self, matrix: Any) -> None:
        self.calls.append("set_object_matrices")
        assert matrix.shape == self.objects["matrix"].shape
        self.objects["matrix"] = matrix

    def add_shader(self, name: str, graph: dict[str, Any], values: dict[str, Any]) -> int:
        self.calls.append("add_shader")
        handle = self._handle()
        self.shaders[handle] = (name, graph, values)
        return handle

    def set_shader(self, handle: int, name: str, graph: dict[str, Any], values: dict[str, Any]) -> None:
        self.calls.append("set_shader")
        assert handle in self.shaders
        self.shaders[handle] = (name, graph, values)

    def remove_shader(self, handle: int) -> None:
        del self.shaders[handle]

    def add_image(self, values: dict[str, Any]) -> int:
        self.calls.append("add_image")
        handle = self._handle()
        self.images[handle] = values
        return handle

    def set_image(self, handle: int, values: dict[str, Any]) -> None:
        self.calls.append("set_image")
        assert handle in self.images
        self.images[handle] = values

    def remove_image(self, handle: int) -> None:
        del self.images[handle]

    # -- what tests ask

    def shader(self, name: str) -> dict[str, Any]:
        """The graph of "Material 'X'"."""
        return next(graph for title, graph, _ in self.shaders.values() if title == name)

    def node(self, name: str, kind: str) -> dict[str, Any]:
        """The only node of a kind in a shader."""
        found = [node for node in self.shader(name)["nodes"] if node["type"] == kind]
        assert len(found) == 1, [node["type"] for node in self.shader(name)["nodes"]]
        return found[0]

    def mesh(self, name: str) -> dict[str, Any]:
        """The arrays of a mesh."""
        return next(arrays for title, arrays in self.meshes.values() if title == name)


def synchronise(width: int = 160, height: int = 90, viewport: bool = False) -> tuple[Any, Any, Any]:
    """The open scene in a recording session: session, SceneSync, SyncResult."""
    from talbot.sync.depsgraph import SceneSync

    depsgraph = bpy.context.evaluated_depsgraph_get()
    session = RecordingSession()
    sync = SceneSync(session)
    result = sync.full(
        depsgraph, bpy.context.scene, depsgraph.view_layer_eval, width=width, height=height, viewport=viewport
    )
    return session, sync, result


def node_input(node: dict[str, Any], identifier: str) -> tuple[Any, ...]:
    """(identifier, kind, value, hidden_value, from_node, from_output) of one input."""
    return next(item for item in node["inputs"] if item[0] == identifier)
