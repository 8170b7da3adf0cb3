"""After any edits, what the session holds must be what a fresh synchronisation would send."""

from __future__ import annotations

import random
from collections.abc import Callable
from typing import Any

import bpy
import numpy as np
import pytest
from sync_recorder import RecordingSession, synchronise


def meshes() -> list[Any]:
    return [obj for obj in bpy.data.objects if obj.type == "MESH"]


class Editor:
    """Random edits of a small scene."""

    def __init__(self, seed: int) -> None:
        self.random = random.Random(seed)
        for x in range(4):
            bpy.ops.mesh.primitive_cube_add(location=(2 * x, 0, 0))
        bpy.ops.object.light_add(type="AREA")
        self.materials = [self._material() for _ in range(3)]

    def _material(self) -> Any:
        material = bpy.data.materials.new("M")
        material.use_nodes = True
        return material

    def edits(self) -> list[Callable[[], None]]:
        return [getattr(self, name) for name in dir(type(self)) if name.startswith("edit_")]

    def edit_move(self) -> None:
        self.random.choice(list(bpy.data.objects)).location.x += self.random.uniform(-1, 1)

    def edit_scale(self) -> None:
        self.random.choice(meshes()).scale.z = self.random.choice([0.0, 1.0, -1.0, 2.0])

    def edit_add(self) -> None:
        add = self.random.choice([bpy.ops.mesh.primitive_uv_sphere_add, bpy.ops.object.text_add])
        add(location=(self.random.uniform(-3, 3), 0, 0))

    def edit_remove(self) -> None:
        if len(meshes()) > 1:
            bpy.data.objects.remove(self.random.choice(meshes()))

    def edit_slots(self) -> None:
        obj = self.random.choice(meshes())
        obj.data.materials.clear()
        obj.data.materials.append(self.random.choice([*self.materials, None]))

    def edit_value(self) -> None:
        node = self.random.choice(self.materials).node_tree.nodes["Principled BSDF"]
        node.inputs["Roughness"].default_value = self.random.random()

    def edit_nodes(self) -> None:
        tree = self.random.choice(self.materials).node_tree
        kind = self.random.choice(["ShaderNodeTexImage", "ShaderNodeTexNoise", "ShaderNodeUVMap"])
        node = tree.nodes.new(kind)
        if kind == "ShaderNodeTexImage":
            node.image = bpy.data.images.new("I", 2, 2)
        tree.links.new(node.outputs[0], tree.nodes["Principled BSDF"].inputs["Base Color"])

    def edit_materials(self) -> None:
        bpy.data.materials.remove(self.materials.pop(0))
        self.materials.append(self._material())

    def edit_modifier(self) -> None:
        self.random.choice(meshes()).modifiers.new("X", self.random.choice(["SUBSURF", "TRIANGULATE", "ARRAY"]))

    def edit_vertex(self) -> None:
        mesh = self.random.choice(meshes()).data
        if len(mesh.vertices):
            mesh.vertices[0].co.x = self.random.uniform(-2, 2)
            mesh.update()

    def edit_light(self) -> None:
        bpy.data.lights[0].energy = self.random.uniform(0, 100)

    def edit_world(self) -> None:
        bpy.context.scene.world = self.random.choice([None, bpy.data.worlds.new("W")])

    def edit_hide(self) -> None:
        obj = self.random.choice(list(bpy.data.objects))
        obj.hide_viewport = not obj.hide_viewport

    def edit_empty(self) -> None:
        self.random.choice(meshes()).data.clear_geometry()

    def edit_name(self) -> None:
        self.random.choice(meshes()).name = f"R{self.random.randint(0, 3)}"


def plain(value: Any) -> Any:
    """Comparable data."""
    if isinstance(value, np.ndarray):
        return value.dtype.str, value.shape, value.tobytes()
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items()}
    return [plain(item) for item in value] if isinstance(value, (list, tuple)) else value


def described(session: RecordingSession) -> dict[str, Any]:
    """The scene with handles replaced by what they stand for. Attributes that nobody reads any more may stay."""

    def shader(handle: int) -> Any:
        if handle < 0:
            return None
        name, graph, values = session.shaders[handle]
        nodes = []
        for node in graph["nodes"]:
            properties = dict(node["properties"])
            if properties.get("image", -1) >= 0:
                properties["image"] = session.images[properties["image"]]
            nodes.append(node | {"properties": properties})
        return plain([name, nodes, values])

    def mesh(handle: int) -> Any:
        if handle < 0:
            return None
        name, arrays = session.meshes[handle]
        kept = ("positions", "corner_vertices", "triangle_corners", "face_smooth", "face_materials", "active_uv")
        return plain([name, {key: arrays[key] for key in kept if key in arrays}])

    objects = session.objects
    rows = []
    for row in range(len(objects["mesh"])):
        slots = objects["material_sets"][objects["material_set"][row]]
        columns = ("matrix", "visibility", "random", "pass_index", "color", "flags")
        rows.append(
            (
                objects["names"][objects["name"][row]],
                mesh(int(objects["mesh"][row])),
                [shader(handle) for handle in slots],
                [plain(objects[column][row]) for column in columns],
            )
        )
    lights = [light | {"shader": shader(light["shader"])} for light in session.lights]
    world = session.world | {"shader": shader(session.world.get("shader", -1))}
    return {"objects": rows, "lights": plain(lights), "world": plain(world), "settings": session.settings}


@pytest.mark.parametrize("seed", range(4))
def test_incremental_equals_full(empty_scene: Any, seed: int) -> None:
    editor = Editor(seed)
    session, sync, _ = synchronise(viewport=True)
    applied: list[str] = []

    def update(_scene: Any, depsgraph: Any) -> None:
        sync.update(depsgraph)

    bpy.app.handlers.depsgraph_update_post.append(update)
    try:
        edits = editor.edits()
        for step in range(40):
            edit = editor.random.choice(edits)
            applied.append(edit.__name__)
            edit()
            bpy.context.view_layer.update()
            if step % 8 == 7:
                fresh, _, _ = synchronise(viewport=True)
                before, after = described(session), described(fresh)
                for key in after:
                    assert before[key] == after[key], (key, applied[-8:])
                assert len(session.meshes) == len(fresh.meshes), applied[-8:]
                assert len(session.shaders) == len(fresh.shaders), applied[-8:]
                assert len(session.images) == len(fresh.images), applied[-8:]
    finally:
        bpy.app.handlers.depsgraph_update_post.remove(update)
