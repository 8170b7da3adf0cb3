"""Node trees as data for `Session.add_shader`: every property of every node, tables of ramps and curves,
image handles.

What the engine makes of a node is the engine's business: this module knows kinds of property, not kinds of
node, but for which mesh attributes a node reads.
"""

from typing import Any

import bpy
import numpy as np
from mathutils import Euler, Matrix
from numpy.typing import NDArray

from .context import (
    ACTIVE_COLOR,
    ACTIVE_TANGENT,
    ACTIVE_UV,
    CURVE_NORMAL,
    GENERATED,
    INSTANCER,
    ISLAND,
    PARTICLE,
    POINTINESS,
    PROPERTY_PREFIXES,
    UNMAPPED_TANGENT,
    SyncContext,
)
from .ies import BadFile, ies_text, parse_ies
from .images import ImageSync
from .named import color_and_number, named_property
from .nodes_flatten import FlatNode, Flattener, Source

KINDS = {
    "VALUE": "FLOAT",
    "INT": "INT",
    "BOOLEAN": "BOOL",
    "VECTOR": "VECTOR",
    "ROTATION": "VECTOR",
    "RGBA": "COLOR",
    "SHADER": "SHADER",
}
ZERO = {"FLOAT": 0.0, "INT": 0, "BOOL": False, "VECTOR": (0.0, 0.0, 0.0), "COLOR": (0.0, 0.0, 0.0, 0.0), "SHADER": 0.0}

UNLINKED_GENERATED = {
    "ShaderNodeTexNoise",
    "ShaderNodeTexMusgrave",
    "ShaderNodeTexVoronoi",
    "ShaderNodeTexGabor",
    "ShaderNodeTexGradient",
    "ShaderNodeTexWave",
    "ShaderNodeTexMagic",
    "ShaderNodeTexChecker",
    "ShaderNodeTexBrick",
    "ShaderNodeTexSky",
}
"""Textures whose unlinked Vector means Generated."""


GEOMETRY_ATTRIBUTES = {"Pointiness": POINTINESS, "Random Per Island": ISLAND, "Tangent": GENERATED}
"""What outputs of the Geometry node read from the mesh."""


def socket_kind(socket: Any) -> str | None:
    """The engine's name for the socket's type; None for sockets that carry no value (menus, strings, bundles)."""
    return KINDS.get(socket.type)


def socket_value(socket: Any, kind: str) -> Any:
    """The value stored on a socket, as the engine reads it."""
    if kind == "SHADER" or not hasattr(socket, "default_value"):
        return ZERO[kind]
    value = socket.default_value
    if kind in ("VECTOR", "COLOR"):
        return tuple(value)[:4]
    return bool(value) if kind == "BOOL" else value


def convert_value(value: Any, kind: str, wanted: str) -> Any:
    """A constant as another kind of socket reads it; colours to numbers are left to the engine, which
    knows the luminance."""
    if kind == wanted:
        return value
    if wanted in ("FLOAT", "INT", "BOOL"):
        number = sum(value[:3]) / 3.0 if isinstance(value, tuple) else float(value)
        return {"FLOAT": number, "INT": int(number), "BOOL": number != 0.0}[wanted]
    numbers = value[:3] if isinstance(value, tuple) else (float(value),) * 3
    return numbers if wanted == "VECTOR" else (*numbers, 1.0)


class GraphBuilder:
    """Turns one tree into the dictionary of `_talbot.pyi`'s add_shader."""

    def __init__(self, context: SyncContext, images: ImageSync, owner: str, inlined: bool = False) -> None:
        self.context = context
        self._inlined = inlined
        self.images = images
        self.owner = owner
        self.wanted: set[str] = set()
        self.image_handles: set[int] = set()
        self.reads_time = self.reads_layer = False
        self._nodes: list[dict[str, Any]] = []

    def build(self, tree: Any, output: Any) -> dict[str, Any]:
        """The graph that feeds `output`."""
        flattener = Flattener()
        flat = flattener.run(tree, output, lambda node: node.type == "OUTPUT_AOV" and self._is_wanted_aov(node))
        for problem in flattener.problems:
            self.context.warn(f"{self.owner}: {problem}")
        self._nodes = [self._node(f) for f in flat]
        for data, source in zip(self._nodes[: len(flat)], flat, strict=True):
            data["inputs"] = [item for item in (self._input(i) for i in source.inputs) if item is not None]
            self._collect_wanted(source, data)
        return {"nodes": self._nodes, "output_node": 0}

    def _is_wanted_aov(self, node: Any) -> bool:
        return aov_name(node) in self.context.aovs and (self._inlined or not node.mute)

    def _node(self, flat: FlatNode) -> dict[str, Any]:
        node = flat.node
        # The inliner numbers its copies: "3_Noise Texture".
        name = flat.name.lstrip("0123456789").removeprefix("_") if self._inlined else flat.name
        outputs = []
        for socket in node.outputs:
            kind = socket_kind(socket)
            if kind is not None and socket.enabled:
                outputs.append((socket.identifier, kind, socket_value(socket, kind)))
        if node.bl_idname == "GeometryNodeInputSceneTime":
            self.reads_time = True
            outputs = [("Seconds", "FLOAT", self.context.seconds), ("Frame", "FLOAT", self.context.frame)]
        return {
            "type": node.bl_idname,
            "name": name,
            "properties": self._properties(node, name),
            "inputs": [],
            "outputs": outputs,
        }

    def _input(self, item: Any) -> tuple[str, str, Any, bool, int, str] | None:
        socket, source = item.socket, item.source
        kind = socket_kind(socket)
        if kind is None:
            return None
        value = socket_value(socket, kind)
        if source is None:
            return socket.identifier, kind, value, bool(socket.hide_value), -1, ""
        if source.index >= 0:
            return socket.identifier, kind, value, bool(socket.hide_value), source.index, source.identifier
        return self._constant(socket, kind, source)

    def _constant(self, socket: Any, kind: str, source: Source) -> tuple[str, str, Any, bool, int, str]:
        """A constant found behind groups or muted nodes; a socket with a "default of the situation" prefers that."""
        if socket.hide_value:
            return socket.identifier, kind, ZERO[kind], True, -1, ""
        if source.socket is None:
            return socket.identifier, kind, ZERO[kind], False, -1, ""
        found = socket_kind(source.socket) or "FLOAT"
        value = socket_value(source.socket, found)
        needs_node = (kind == "SHADER" and found != "SHADER") or (found == "COLOR" and kind in ("FLOAT", "INT", "BOOL"))
        if not needs_node:
            return socket.identifier, kind, convert_value(value, found, kind), False, -1, ""
        color = convert_value(value, found, "COLOR")
        self._nodes.append(
            {
                "type": "ShaderNodeRGB",
                "name": source.socket.name,
                "properties": {},
                "inputs": [],
                "outputs": [("Color", "COLOR", color)],
            }
        )
        return socket.identifier, kind, ZERO[kind], False, len(self._nodes) - 1, "Color"

    def _properties(self, node: Any, name: str) -> dict[str, Any]:
        out: dict[str, Any] = {}
        for identifier, kind in node_properties(node):
            value = getattr(node, identifier, None)
            if kind == "ARRAY":
                out[identifier] = np.array(value, dtype=np.float32).reshape(-1)
            elif kind == "NUMBER":
                out[identifier] = float(value)
            elif kind == "TEXT":
                out[identifier] = str(value)
            elif identifier == "image":
                out["image"] = -1
                if value is not None:
                    out["image"] = self.images.handle(value, node.image_user, self.owner)
                    self.image_handles.add(out["image"])
            elif identifier == "color_ramp":
                out["color_ramp"] = ramp_table(value, self.context.version)
                out["color_ramp_constant"] = float(value.interpolation == "CONSTANT")
            elif identifier == "mapping":
                out.update(curve_properties(value, self.context.version))
            elif identifier == "ies":
                self._add_ies(node, name, out)
            elif identifier == "texture_mapping":
                table = texture_mapping_table(value)
                if table is not None:
                    out["texture_mapping"] = table
                if value.use_min or value.use_max:
                    self.context.warn(f"{self.owner}, node '{name}': minimum and maximum of its mapping are ignored")
            elif identifier == "object" and value is not None:
                out["object_matrix"] = matrix_rows(value.matrix_world.inverted_safe())
        if node.type == "OUTPUT_AOV":
            out["aov_name"] = aov_name(node)
        elif out.get("attribute_type") == "VIEW_LAYER":
            self.reads_layer = True
            out["layer_value"] = layer_value(self.context.layers, out["attribute_name"])
        if getattr(node, "sample_attribute_items", None):
            out.update(sampled_attributes(node))
        return out

    def _add_ies(self, node: Any, name: str, out: dict[str, Any]) -> None:
        try:
            text = ies_text(node)
            if text is not None:
                out["ies_table"] = parse_ies(text)
        except BadFile as error:
            self.context.warn(f"{self.owner}, node '{name}': the IES file is not used: {error}")

    def _collect_wanted(self, flat: FlatNode, data: dict[str, Any]) -> None:
        """Which mesh attributes the node reads."""
        kind, properties, wanted = data["type"], data["properties"], self.wanted
        vector_unlinked = any(i[0] == "Vector" and i[4] < 0 for i in data["inputs"])
        if kind == "ShaderNodeUVMap":
            wanted.add(properties.get("uv_map") or ACTIVE_UV)
        elif kind == "ShaderNodeTexImage" and vector_unlinked:
            wanted.add(ACTIVE_UV)
        elif kind == "ShaderNodeTexCoord":
            linked = {link.from_socket.identifier for link in flat.scope.links.values() if link.from_node == flat.node}
            if "UV" in linked:
                wanted.add(ACTIVE_UV)
            if "Generated" in linked:
                wanted.add(GENERATED)
        elif kind == "ShaderNodeNewGeometry":
            linked = {link.from_socket.identifier for link in flat.scope.links.values() if link.from_node == flat.node}
            wanted.update(name for socket, name in GEOMETRY_ATTRIBUTES.items() if socket in linked)
        elif kind == "ShaderNodeVertexColor":
            wanted.add(properties.get("layer_name") or ACTIVE_COLOR)
        elif kind == "ShaderNodeAttribute" and properties.get("attribute_name") and "layer_value" not in properties:
            prefix = PROPERTY_PREFIXES.get(properties.get("attribute_type", "GEOMETRY"), "")
            wanted.add(prefix + properties["attribute_name"])
        elif kind == "ShaderNodeNormalMap" and properties.get("space") == "TANGENT":
            uv = properties.get("uv_map")
            self._want_tangents(uv)
        elif kind == "ShaderNodeTangent":
            uv = properties.get("uv_map")
            if properties.get("direction_type") == "RADIAL":
                wanted.add(GENERATED)
            else:
                self._want_tangents(uv)
        elif kind in UNLINKED_GENERATED and vector_unlinked:
            wanted.add(GENERATED)
        elif kind == "ShaderNodeRaycast":
            wanted.update(name for key, name in properties.items() if key.startswith("attribute_") and name)
        elif kind == "ShaderNodeParticleInfo":
            wanted.add(PARTICLE)
        elif kind == "ShaderNodeBsdfHairPrincipled" and properties.get("model") == "HUANG":
            wanted.add(CURVE_NORMAL)
        # Anisotropic closures take their default tangent from Generated where their Tangent is unlinked.
        inputs = {i[0]: i for i in data["inputs"]}
        anisotropy = inputs.get("Anisotropic") or inputs.get("Anisotropy")
        if (
            anisotropy
            and "Tangent" in inputs
            and inputs["Tangent"][4] < 0
            and (anisotropy[4] >= 0 or anisotropy[2] != 0)
        ):
            wanted.add(GENERATED)
        if properties.get("from_instancer"):
            wanted.add(INSTANCER)

    def _want_tangents(self, uv: str | None) -> None:
        mine = (ACTIVE_UV, ACTIVE_TANGENT, UNMAPPED_TANGENT + self.owner)
        self.wanted.update((uv, f"@tangent:{uv}") if uv else mine)


def layer_value(layers: tuple[Any, ...], name: str) -> NDArray[np.float32]:
    """Colour, alpha and number of a property of the view layer, or of the scene; zeros where neither has it."""
    found = next((value for value in (named_property(owner, name) for owner in layers) if value), None)
    return np.array(color_and_number(found) if found else (0.0,) * 5, dtype=np.float32)


def sampled_attributes(node: Any) -> dict[str, str]:
    """Names of attributes that a Raycast node reads where its ray ends: "attribute_3" for the output Attribute_3."""
    inputs = [socket for socket in node.inputs if socket.type == "STRING" and socket.identifier.startswith("Value_")]
    return {socket.identifier.replace("Value_", "attribute_"): socket.default_value for socket in inputs}


def aov_name(node: Any) -> str:
    """Which AOV the node writes; in 3.4 it is the node's name."""
    return getattr(node, "aov_name", node.name)


_PROPERTIES: dict[str, list[tuple[str, str]]] = {}


def node_properties(node: Any) -> list[tuple[str, str]]:
    """Names and kinds (NUMBER, TEXT, ARRAY, POINTER) of what a node type has beyond every node's properties."""
    known = _PROPERTIES.get(node.bl_idname)
    if known is not None:
        return known
    common = bpy.types.Node.bl_rna.properties
    found = []
    for prop in node.bl_rna.properties:
        if prop.identifier in common or prop.type == "COLLECTION":
            continue
        if prop.type == "POINTER":
            found.append((prop.identifier, "POINTER"))
        elif prop.type == "ENUM":
            if not prop.is_enum_flag:
                found.append((prop.identifier, "TEXT"))
        elif prop.type == "STRING":
            found.append((prop.identifier, "TEXT"))
        else:
            found.append((prop.identifier, "ARRAY" if prop.is_array else "NUMBER"))
    _PROPERTIES[node.bl_idname] = found
    return found


def table_size(version: int) -> int:
    """Entries of ramps and curves, as Cycles has them."""
    return 256 if version <= 304 else 257


def ramp_table(ramp: Any, version: int) -> NDArray[np.float32]:
    """RGBA of the ramp at equal steps over 0..1."""
    size = table_size(version)
    evaluate = ramp.evaluate
    return np.array([tuple(evaluate(i / (size - 1))) for i in range(size)], dtype=np.float32).reshape(-1)


def curve_properties(mapping: Any, version: int) -> dict[str, Any]:
    """Tables of a curve mapping over the range its points span; RGB curves have the combined curve applied first."""
    mapping.initialize()
    curves = list(mapping.curves)
    first = min(curve.points[0].location[0] for curve in curves)
    last = max(curve.points[-1].location[0] for curve in curves)
    size = table_size(version)
    steps = [first + (last - first) * i / (size - 1) for i in range(size)]
    evaluate = mapping.evaluate
    if len(curves) == 1:
        rows = [evaluate(curves[0], x) for x in steps]
    else:
        combined = [evaluate(curves[3], x) for x in steps] if len(curves) > 3 else steps
        rows = [[evaluate(curve, x) for curve in curves[:3]] + [1.0] for x in combined]
    return {
        "mapping": np.array(rows, dtype=np.float32).reshape(-1),
        "mapping_min": float(first),
        "mapping_max": float(last),
        "mapping_extend": str(mapping.extend),
    }


def matrix_rows(matrix: Matrix) -> NDArray[np.float32]:
    """Row-major 3x4."""
    return np.array([tuple(row) for row in matrix[:3]], dtype=np.float32).reshape(-1)


def texture_mapping_table(mapping: Any) -> NDArray[np.float32] | None:
    """The map a texture node applies to its vector, None when it is the identity."""
    axes = {"NONE": None, "X": 0, "Y": 1, "Z": 2}
    choose = Matrix.Diagonal((0.0, 0.0, 0.0, 1.0))
    for row, axis in enumerate((mapping.mapping_x, mapping.mapping_y, mapping.mapping_z)):
        if axes[axis] is not None:
            choose[row][axes[axis]] = 1.0
    kind = mapping.vector_type
    scale = mapping.scale.copy()
    if kind in ("TEXTURE", "NORMAL"):
        # Keeps the inverse finite.
        scale = [np.copysign(max(abs(s), 1e-5), s) for s in scale]
    size = Matrix.Diagonal((*scale, 1.0))
    turn = Euler(mapping.rotation).to_matrix().to_4x4()
    move = Matrix.Translation(mapping.translation)
    if kind == "POINT":
        matrix = move @ turn @ size
    elif kind == "TEXTURE":
        matrix = (move @ turn @ size).inverted_safe()
    elif kind == "VECTOR":
        matrix = turn @ size
    else:
        matrix = (turn @ size).inverted_safe().transposed()
    matrix = matrix @ choose
    identity = Matrix.Identity(4)
    if all(
        abs(a - b) < 1e-7
        for left, right in zip(matrix, identity, strict=True)
        for a, b in zip(left, right, strict=True)
    ):
        return None
    return matrix_rows(matrix)
