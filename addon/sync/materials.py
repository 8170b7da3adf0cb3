"""Materials, worlds' and lamps' node trees as shaders: one handle each, sent again only when what is sent differs."""

import pickle
from typing import Any

import numpy as np

from .. import versions
from .context import SyncContext, id_key
from .images import ImageSync
from .nodes import GraphBuilder
from .nodes_flatten import invalid_links

EMISSION_SAMPLING = ("NONE", "AUTO", "FRONT", "BACK", "FRONT_BACK")


def _plain_graph(output: str, node: str, color: tuple[float, ...]) -> dict[str, Any]:
    """A graph of one closure of a constant colour."""
    return {
        "nodes": [
            {
                "type": output,
                "name": "Output",
                "properties": {},
                "inputs": [("Surface", "SHADER", 0.0, False, 1, "Shader")],
                "outputs": [],
            },
            {
                "type": node,
                "name": "Color",
                "properties": {},
                "inputs": [("Color", "COLOR", (*color[:3], 1.0), False, -1, "")],
                "outputs": [("Shader", "SHADER", 0.0)],
            },
        ],
        "output_node": 0,
    }


def material_graph(material: Any) -> dict[str, Any]:
    """What a material without nodes looks like: diffuse in its viewport colour."""
    graph = _plain_graph("ShaderNodeOutputMaterial", "ShaderNodeBsdfDiffuse", tuple(material.diffuse_color))
    graph["nodes"][1]["outputs"] = [("BSDF", "SHADER", 0.0)]
    graph["nodes"][0]["inputs"] = [("Surface", "SHADER", 0.0, False, 1, "BSDF")]
    graph["nodes"][1]["inputs"].append(("Roughness", "FLOAT", 0.0, False, -1, ""))
    graph["nodes"][1]["inputs"].append(("Normal", "VECTOR", (0.0, 0.0, 0.0), True, -1, ""))
    return graph


def world_graph(world: Any) -> dict[str, Any]:
    """What a world without nodes looks like: its colour."""
    graph = _plain_graph("ShaderNodeOutputWorld", "ShaderNodeBackground", tuple(world.color))
    graph["nodes"][1]["outputs"] = [("Background", "SHADER", 0.0)]
    graph["nodes"][0]["inputs"] = [("Surface", "SHADER", 0.0, False, 1, "Background")]
    graph["nodes"][1]["inputs"].append(("Strength", "FLOAT", 1.0, False, -1, ""))
    return graph


def _signature(*parts: Any) -> bytes:
    """Equal for equal graphs."""

    def plain(value: Any) -> Any:
        if isinstance(value, np.ndarray):
            return value.tobytes()
        if isinstance(value, dict):
            return {key: plain(item) for key, item in value.items()}
        return [plain(item) for item in value] if isinstance(value, list) else value

    return pickle.dumps([plain(part) for part in parts])


class ShaderSync:
    """Handles of shaders by datablock."""

    def __init__(self, context: SyncContext, images: ImageSync) -> None:
        self.context = context
        self.images = images
        self._handles: dict[tuple[str, str], int] = {}
        self._signatures: dict[tuple[str, str], bytes] = {}
        self._wanted: dict[tuple[str, str], frozenset[str]] = {}
        self._images: dict[tuple[str, str], frozenset[int]] = {}
        self._fresh: set[tuple[str, str]] = set()
        self._seen: set[tuple[str, str]] = set()
        self.sent = False
        """Whether the last pass changed a shader."""
        self.reads_time = False
        """Whether some shader has shown the scene's time."""
        self.reads_layer = False
        """Or a property of the view layer."""

    def clear(self) -> None:
        """Forgets and removes everything."""
        for handle in self._handles.values():
            self.context.session.remove_shader(handle)
        for memory in (self._handles, self._signatures, self._wanted, self._images):
            memory.clear()

    def begin(self, changed: set[tuple[str, str]] | None) -> None:
        """Starts a pass: datablocks in `changed` (None: all) are read again when somebody asks for them."""
        self._fresh = set() if changed is None else set(self._handles) - changed
        self._seen = set()
        self.sent = False

    def sweep(self) -> None:
        """Ends a pass: removes the shaders nobody asked for, then the images no shader shows."""
        for key in set(self._handles) - self._seen:
            self.context.session.remove_shader(self._handles.pop(key))
            for memory in (self._signatures, self._wanted, self._images):
                memory.pop(key, None)
        self.images.keep(frozenset().union(*self._images.values()))

    def has(self, material: Any) -> bool:
        """Whether the session shows the material."""
        return id_key(material) in self._handles

    def wanted(self) -> set[str]:
        """Attributes that any shader reads."""
        return set().union(*self._wanted.values()) if self._wanted else set()

    def material(self, material: Any) -> int:
        """The handle of a material."""
        key = id_key(material)
        self._seen.add(key)
        if key in self._fresh:
            return self._handles[key]
        owner = f"Material '{material.name}'"
        cycles = versions.cycles_settings(material)
        sampling = cycles.get_enum("emission_sampling", EMISSION_SAMPLING, "AUTO")
        transparent = cycles.get("use_transparent_shadow")
        if transparent is None:
            transparent = getattr(material, "use_transparent_shadow", True)
        values = {
            "pass_index": material.pass_index,
            "sample_as_light": sampling != "NONE" and bool(cycles.get("sample_as_light", True)),
            "emission_front": sampling != "BACK",
            "emission_back": sampling != "FRONT",
            "use_transparent_shadow": bool(transparent),
            "use_bump_map_correction": bool(cycles.get("use_bump_map_correction", True)),
        }
        method = cycles.get_enum("displacement_method", ("BUMP", "DISPLACEMENT", "BOTH"), "")
        method = method or getattr(material, "displacement_method", "BUMP")
        values["displacement"] = method.lower()
        graph = self._tree_graph(material, owner, key)
        if graph is None:
            graph = material_graph(material)
        return self._send(key, owner, graph, values)

    def world(self, world: Any) -> int:
        """The handle of a world."""
        key = id_key(world)
        self._seen.add(key)
        if key in self._fresh:
            return self._handles[key]
        owner = f"World '{world.name}'"
        graph = self._tree_graph(world, owner, key)
        return self._send(key, owner, world_graph(world) if graph is None else graph, {})

    def light(self, light: Any) -> int:
        """The handle of a lamp's nodes; -1 when it has none."""
        key = id_key(light)
        self._seen.add(key)
        if key in self._fresh:
            return self._handles[key]
        owner = f"Light '{light.name}'"
        graph = self._tree_graph(light, owner, key)
        if graph is None:
            self._seen.discard(key)  # nodes that were switched off go with the sweep
            return -1
        return self._send(key, owner, graph, {})

    def _tree_graph(self, owner_id: Any, owner: str, key: tuple[str, str]) -> dict[str, Any] | None:
        """The graph of a datablock's nodes; None when it does not use nodes; empty (black) without an output."""
        self._wanted[key], self._images[key] = frozenset(), frozenset()
        if owner_id.node_tree is None or not getattr(owner_id, "use_nodes", True):
            return None
        for problem in invalid_links(owner_id.node_tree):
            self.context.warn(f"{owner}: {problem}")
        # The inliner's result owns its tree: it must live while the tree is read.
        inlined = owner_id.inline_shader_nodes() if hasattr(owner_id, "inline_shader_nodes") else None
        tree = inlined.node_tree if inlined is not None else owner_id.node_tree
        output = tree.get_output_node("CYCLES") if tree is not None else None
        if output is None:
            return {"nodes": [], "output_node": -1}
        builder = GraphBuilder(self.context, self.images, owner, inlined is not None)
        graph = builder.build(tree, output)
        self.reads_time |= builder.reads_time
        self.reads_layer |= builder.reads_layer
        self._wanted[key], self._images[key] = frozenset(builder.wanted), frozenset(builder.image_handles)
        return graph

    def _send(self, key: tuple[str, str], name: str, graph: dict[str, Any], values: dict[str, Any]) -> int:
        signature = _signature(graph, values)
        handle = self._handles.get(key)
        if handle is None:
            handle = self._handles[key] = self.context.session.add_shader(name, graph, values)
            self.sent = True
        elif self._signatures.get(key) != signature:
            self.context.session.set_shader(handle, name, graph, values)
            self.sent = True
        self._signatures[key] = signature
        self._fresh.add(key)
        return handle
