"""Nodes in atlases of emitting squares: every cell of a picture shows another node, in Cycles and in Talbot."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from pair_scenes import (
    Builder,
    Tree,
    add_object,
    add_plane,
    add_sphere,
    atlas,
    color_card,
    image_of,
)
from pairs import Bounds, agree

BOUNDS = Bounds(0.003, 0.01)
"""Only the places of the samples make noise here: a box filter keeps the cells apart."""


def agree_on_nodes(scene: Any, path: Path, cells: int, bounds: Bounds = BOUNDS) -> None:
    """Each cell of the atlas is a cell of the statistics."""
    scene.render.resolution_x = scene.render.resolution_y = 6 * cells
    scene.cycles.pixel_filter_type = "BOX"
    agree(scene, path, samples=128, batches=8, cells=cells, bounds=bounds)


def operations(node: str, name: str) -> list[str]:
    """The values of an enumeration of a node type."""
    return [item.identifier for item in getattr(bpy.types, node).bl_rna.properties[name].enum_items]


def across(builders: list[Builder]) -> int:
    """Width of the square grid that holds them."""
    return int(np.ceil(np.sqrt(len(builders))))


def varying(tree: Tree, low: float = -1.0, high: float = 1.0) -> tuple[Any, Any]:
    """Two numbers over the square: u and v, stretched."""
    separate = tree("SeparateXYZ", in0=tree("TexCoord").outputs["UV"])
    mapped = [tree("MapRange", in0=separate.outputs[axis], To_Min=low, To_Max=high).outputs[0] for axis in (0, 1)]
    return mapped[0], mapped[1]


def visible(tree: Tree, value: Any) -> Any:
    """A vector or number moved to where emission shows it: 0.5 + 0.25 x, per axis, and never below zero."""
    scaled = tree("VectorMath", operation="MULTIPLY_ADD", in0=value, in1=(0.25,) * 3, in2=(0.5,) * 3)
    clamped = tree("VectorMath", operation="MAXIMUM", in0=scaled, in1=(0.0,) * 3)
    return tree("VectorMath", operation="MINIMUM", in0=clamped, in1=(4.0,) * 3)


def test_math(pair_scene: Any, tmp_path: Path) -> None:
    def build(operation: str, clamp: bool) -> Builder:
        def make(tree: Tree) -> Any:
            u, v = varying(tree, -1.5, 1.7)
            values = {"in0": u, "in1": v, "in2": 0.4}
            node = tree("Math", operation=operation, use_clamp=clamp)
            for key, value in list(values.items())[: len([s for s in node.inputs if s.enabled])]:
                tree.set(node.inputs[int(key[2:])], value)
            return visible(tree, node)

        return make

    builders = [build(name, False) for name in operations("ShaderNodeMath", "operation")] + [build("MULTIPLY", True)]
    atlas(pair_scene, builders, across(builders))
    agree_on_nodes(pair_scene, tmp_path, across(builders))


def test_vector_math(pair_scene: Any, tmp_path: Path) -> None:
    def build(operation: str) -> Builder:
        def make(tree: Tree) -> Any:
            u, v = varying(tree, -1.5, 1.7)
            first = tree("CombineXYZ", X=u, Y=v, Z=0.3)
            second = tree("CombineXYZ", X=0.7, Y=u, Z=v)
            node = tree("VectorMath", operation=operation)
            enabled = [socket for socket in node.inputs if socket.enabled]
            for socket, value in zip(enabled, (first, second, (0.3, -0.6, 0.5)), strict=False):
                tree.set(socket, 1.4 if socket.type == "VALUE" else value)
            return visible(tree, node)

        return make

    builders = [build(name) for name in operations("ShaderNodeVectorMath", "operation")]
    atlas(pair_scene, builders, across(builders))
    agree_on_nodes(pair_scene, tmp_path, across(builders))


@pytest.mark.parametrize("kind", ["MixRGB", "Mix"])
def test_blend_types(pair_scene: Any, tmp_path: Path, kind: str) -> None:
    """The old node and the new one."""

    def build(blend: str, clamp: bool) -> Builder:
        def make(tree: Tree) -> Any:
            u, v = varying(tree, 0.0, 1.3)
            first = tree("CombineXYZ", X=u, Y=v, Z=0.2)
            second = tree("CombineXYZ", X=0.6, Y=u, Z=v)
            inputs = {"in0": 0.7, "in1": first, "in2": second}
            if kind == "MixRGB":
                return visible(tree, tree(kind, blend_type=blend, use_clamp=clamp, **inputs))
            return visible(tree, tree(kind, data_type="RGBA", blend_type=blend, clamp_result=clamp, **inputs))

        return make

    builders = [build(name, False) for name in operations("ShaderNodeMixRGB", "blend_type")] + [build("ADD", True)]
    atlas(pair_scene, builders, across(builders))
    agree_on_nodes(pair_scene, tmp_path, across(builders))


def test_mix_of_numbers_and_vectors(pair_scene: Any, tmp_path: Path) -> None:
    def build(kind: str, factor: float, clamp: bool, mode: str) -> Builder:
        def make(tree: Tree) -> Any:
            u, v = varying(tree)
            node = tree("Mix", data_type=kind, clamp_factor=clamp, factor_mode=mode)
            enabled = [socket for socket in node.inputs if socket.enabled]
            factors = (factor, factor / 2, -factor) if mode == "NON_UNIFORM" and kind == "VECTOR" else factor
            for socket, value in zip(enabled, (factors, u, v), strict=True):
                tree.set(socket, value)
            return visible(tree, node)

        return make

    cases = [("FLOAT", 0.3, True), ("FLOAT", 1.6, True), ("FLOAT", 1.6, False), ("VECTOR", 0.6, True)]
    builders = [build(*case, "UNIFORM") for case in cases]
    builders += [build("VECTOR", 1.4, clamp, mode) for clamp in (True, False) for mode in ("UNIFORM", "NON_UNIFORM")]
    atlas(pair_scene, builders, 3)
    agree_on_nodes(pair_scene, tmp_path, 3)


def test_color_ramps(pair_scene: Any, tmp_path: Path) -> None:
    def build(mode: str, interpolation: str, hue: str) -> Builder:
        def make(tree: Tree) -> Any:
            u, _ = varying(tree, -0.2, 1.2)
            node = tree("ValToRGB", in0=u)
            ramp = node.color_ramp
            ramp.color_mode = mode
            if mode == "RGB":
                ramp.interpolation = interpolation
            else:
                ramp.hue_interpolation = hue
            ramp.elements[0].position, ramp.elements[0].color = 0.1, (0.9, 0.1, 0.2, 1)
            ramp.elements[1].position, ramp.elements[1].color = 0.8, (0.1, 0.3, 0.9, 1)
            ramp.elements.new(0.45).color = (0.2, 0.8, 0.1, 1)
            return node

        return make

    builders = [build("RGB", name, "") for name in ("LINEAR", "EASE", "CARDINAL", "B_SPLINE", "CONSTANT")]
    builders += [build(mode, "", hue) for mode in ("HSV", "HSL") for hue in ("NEAR", "FAR", "CW", "CCW")]
    builders.append(lambda tree: tree("ValToRGB", in0=varying(tree)[0]).outputs["Alpha"])
    atlas(pair_scene, builders, 4)
    agree_on_nodes(pair_scene, tmp_path, 4)


def test_noise_and_checker(pair_scene: Any, tmp_path: Path) -> None:
    """Every dimension, fractions of octaves, distortion, both outputs; 4.0's types and normalisation where they are."""

    def noise(output: str, **values: Any) -> Builder:
        known = bpy.types.ShaderNodeTexNoise.bl_rna.properties

        def make(tree: Tree) -> Any:
            chosen = {key: value for key, value in values.items() if not key.islower() or key in known}
            node = tree("TexNoise", **chosen)
            socket = next((s for s in node.outputs if s.name == output), node.outputs[0])
            return visible(tree, socket)

        return make

    dimensions = ("1D", "2D", "3D", "4D")
    builders = [noise(output, noise_dimensions=d, Scale=3.0) for d in dimensions for output in ("Fac", "Color")]
    builders += [noise("Color", noise_dimensions=d, Distortion=1.5, Detail=2.5, Roughness=0.7) for d in dimensions]
    builders += [noise("Fac", noise_dimensions=d, Detail=0.0, Scale=4.0) for d in dimensions]
    kinds = ("MULTIFRACTAL", "RIDGED_MULTIFRACTAL", "HYBRID_MULTIFRACTAL", "HETERO_TERRAIN")
    builders += [noise("Fac", noise_type=kind, noise_dimensions="3D", Detail=3.3) for kind in kinds]
    builders += [noise("Fac", normalize=False, noise_dimensions=d) for d in ("2D", "3D")]
    builders += [
        lambda tree: tree("TexChecker", Scale=4.0, Color1=(0.9, 0.2, 0.1), Color2=(0.1, 0.4, 0.8)),
        lambda tree: tree("TexChecker", Scale=3.0).outputs["Fac"],
        lambda tree: tree("TexChecker", Vector=tree("TexCoord").outputs["Object"], Scale=3.3),
    ]
    atlas(pair_scene, builders, across(builders))
    agree_on_nodes(pair_scene, tmp_path, across(builders))


def coordinate(name: str) -> Builder:
    """An output of Texture Coordinate."""
    return lambda tree: visible(tree, tree("TexCoord").outputs[name])


def mapping(kind: str) -> Builder:
    """One kind of Mapping, with every value set where the kind has it."""

    def make(tree: Tree) -> Any:
        values = {"Rotation": (0.3, 0.5, 0.8), "Scale": (1.5, 0.6, -1.2)}
        if kind in ("POINT", "TEXTURE"):
            values["Location"] = (0.2, -0.4, 0.7)
        return visible(tree, tree("Mapping", vector_type=kind, Vector=tree("TexCoord").outputs["Generated"], **values))

    return make


def other_object(tree: Tree) -> Any:
    """Coordinates of a turned and scaled empty."""
    empty = add_object(None, (1.0, 2.0, 3.0), (0.4, 0.2, 0.9))
    empty.scale = (1.0, 2.0, 0.5)
    bpy.context.view_layer.update()
    return visible(tree, tree("TexCoord", object=empty).outputs["Object"])


COORDINATES: list[Builder] = [
    *(coordinate(name) for name in ("Generated", "Normal", "UV", "Object", "Camera", "Window", "Reflection")),
    other_object,
    *(mapping(kind) for kind in ("POINT", "TEXTURE", "VECTOR", "NORMAL")),
    lambda tree: visible(tree, tree("UVMap", uv_map="Second")),
    lambda tree: visible(tree, tree("UVMap")),
    lambda tree: tree("VertexColor", layer_name="Bytes"),
    lambda tree: tree("VertexColor", layer_name="Floats"),
    lambda tree: tree("VertexColor").outputs["Alpha"],
    lambda tree: visible(tree, tree("Attribute", attribute_name="Second").outputs["Vector"]),
    lambda tree: tree("Attribute", attribute_name="Floats").outputs["Fac"],
    lambda tree: visible(tree, tree("NewGeometry").outputs["Normal"]),
    lambda tree: visible(tree, tree("NewGeometry").outputs["Position"]),
]


def add_layers(obj: Any) -> Any:
    """A second UV map and two colour attributes, random."""
    random = np.random.default_rng(3)
    mesh = obj.data
    if not mesh.uv_layers:
        mesh.uv_layers.new(name="UVMap").data.foreach_set("uv", random.random(2 * len(mesh.loops)))
    mesh.uv_layers.new(name="Second").data.foreach_set("uv", random.random(2 * len(mesh.loops)))
    for name, kind, domain in (("Bytes", "BYTE_COLOR", "CORNER"), ("Floats", "FLOAT_COLOR", "POINT")):
        layer = mesh.color_attributes.new(name, kind, domain)
        layer.data.foreach_set("color", random.random(4 * len(layer.data)))
    return obj


@pytest.mark.parametrize("shape", [add_plane, add_sphere])
def test_coordinates(pair_scene: Any, tmp_path: Path, shape: Callable[..., Any]) -> None:
    for obj in atlas(pair_scene, COORDINATES, across(COORDINATES), shape):
        add_layers(obj)
        if shape is add_sphere:
            obj.rotation_euler, obj.scale = (0.3, 0.2, 0.5), (1.0, 0.8, 1.2)
    # Edges of balls: where the samples lie matters more than on squares.
    bounds = Bounds(0.005, 0.03) if shape is add_sphere else BOUNDS
    agree_on_nodes(pair_scene, tmp_path, across(COORDINATES), bounds)


def nested_group() -> Any:
    """A group in a group; values pass through a default, a reroute and a muted node."""
    inner = bpy.data.node_groups.new("Inner", "ShaderNodeTree")
    outer = bpy.data.node_groups.new("Outer", "ShaderNodeTree")
    for group in (inner, outer):
        for way, name, kind in (
            ("INPUT", "Value", "NodeSocketFloat"),
            ("INPUT", "Shift", "NodeSocketFloat"),
            ("OUTPUT", "Result", "NodeSocketColor"),
        ):
            if hasattr(group, "interface"):
                group.interface.new_socket(name, in_out=way, socket_type=kind)
            else:
                (group.inputs if way == "INPUT" else group.outputs).new(kind, name)
    tree = Tree(inner)
    given, result = tree("NodeGroupInput"), tree("NodeGroupOutput")
    total = tree("Math", operation="ADD", in0=given.outputs["Value"], in1=given.outputs["Shift"])
    muted = tree("Math", operation="MULTIPLY", in0=total, in1=100.0)
    muted.mute = True
    tree.set(result.inputs["Result"], tree("CombineXYZ", X=muted, Y=0.3, Z=given.outputs["Value"]))
    tree = Tree(outer)
    given, result = tree("NodeGroupInput"), tree("NodeGroupOutput")
    nested = tree("Group", node_tree=inner)
    reroute = tree("NodeReroute")
    tree.set(reroute.inputs[0], given.outputs["Value"])
    tree.set(nested.inputs["Value"], reroute)
    nested.inputs["Shift"].default_value = 0.25
    tree.set(result.inputs["Result"], nested)
    return outer


def test_groups_reroutes_and_muted_nodes(pair_scene: Any, tmp_path: Path) -> None:
    group = nested_group()

    def grouped(tree: Tree) -> Any:
        node = tree("Group", node_tree=group)
        tree.set(node.inputs["Value"], varying(tree, 0.0, 1.0)[0])
        return node

    def default_of_group(tree: Tree) -> Any:
        node = tree("Group", node_tree=group)
        node.inputs["Value"].default_value = 0.6
        return node

    def muted_mix(tree: Tree) -> Any:
        node = tree("Mix", data_type="RGBA", in0=0.5, in1=(0.9, 0.2, 0.1), in2=(0.1, 0.2, 0.9))
        node.mute = True
        return node

    def muted_texture(tree: Tree) -> Any:
        """Its colour output has no input to pass: black, with something added so that the cell shows."""
        node = tree("TexChecker")
        node.mute = True
        return visible(tree, node.outputs["Color"])

    def muted_group(tree: Tree) -> Any:
        node = grouped(tree)
        node.mute = True
        return visible(tree, node)

    def muted_link(tree: Tree) -> Any:
        node = tree("Math", operation="ADD", in0=varying(tree)[0], in1=0.3)
        node.inputs[0].links[0].is_muted = True
        return visible(tree, node)

    builders: list[Builder] = [
        grouped,
        default_of_group,
        muted_mix,
        muted_texture,
        muted_group,
        muted_link,
        lambda tree: tree("RGB"),
        lambda tree: visible(tree, tree("Value")),
        lambda tree: visible(tree, tree("MapRange", in0=tree("RGB"))),
    ]
    atlas(pair_scene, builders, 3)
    for node in [node for item in bpy.data.materials for node in item.node_tree.nodes]:
        if node.bl_idname == "ShaderNodeRGB":
            node.outputs[0].default_value = (0.7, 0.4, 0.2, 1)
        elif node.bl_idname == "ShaderNodeValue":
            node.outputs[0].default_value = 1.3
    agree_on_nodes(pair_scene, tmp_path, 3)


def lit(scene: Any) -> None:
    """A slanted sun for what only bends normals."""
    from pair_scenes import add_lamp

    add_lamp("SUN", 3.0, (3, 2, 4), toward=(0, 0, 0), angle=0.0)
    scene.cycles.max_bounces = 0


@pytest.mark.parametrize("shape", [add_plane, add_sphere])
def test_normal_maps(pair_scene: Any, tmp_path: Path, shape: Callable[..., Any]) -> None:
    pixels = color_card()
    pixels[..., :3] = 0.5 + 0.5 * (pixels[..., :3] - 0.5)
    pixels[..., 2] = 0.9
    image = image_of(pixels)

    def build(space: str, strength: float, uv: str) -> Builder:
        def make(tree: Tree) -> Any:
            texture = tree("TexImage", image=image, Vector=tree("UVMap", uv_map=uv))
            return tree(
                "BsdfDiffuse", Normal=tree("NormalMap", space=space, uv_map=uv, Color=texture, Strength=strength)
            )

        return make

    spaces = ("TANGENT", "OBJECT", "WORLD", "BLENDER_OBJECT", "BLENDER_WORLD")
    builders = [build(space, 1.0, "UVMap") for space in spaces]
    builders += [build(space, strength, "UVMap") for space in ("TANGENT", "WORLD") for strength in (0.4, 2.0)]
    atlas(pair_scene, builders, 3, shape)
    lit(pair_scene)
    agree_on_nodes(pair_scene, tmp_path, 3, Bounds(0.005, 0.02))


@pytest.mark.parametrize("shape", [add_plane, add_sphere])
def test_bump(pair_scene: Any, tmp_path: Path, shape: Callable[..., Any]) -> None:
    """Heights that are smooth over a pixel."""

    def build(**values: Any) -> Builder:
        def make(tree: Tree) -> Any:
            height = tree("TexNoise", Vector=tree("TexCoord").outputs["Generated"], Scale=1.5, Detail=0.0)
            return tree("BsdfDiffuse", Normal=tree("Bump", Height=height.outputs[0], **values))

        return make

    def displaced(tree: Tree) -> Any:
        return tree("BsdfDiffuse")

    builders = [build(Distance=0.3), build(Distance=1.0, Strength=0.5), build(Distance=0.3, invert=True), displaced]
    objects = atlas(pair_scene, builders, 2, shape)
    tree = Tree.__new__(Tree)
    tree.tree = objects[3].data.materials[0].node_tree
    height = tree("TexNoise", Vector=tree("TexCoord").outputs["Generated"], Scale=1.5, Detail=0.0)
    output = tree.tree.nodes["Material Output"]
    tree.set(output.inputs["Displacement"], tree("Displacement", Height=height.outputs[0], Scale=0.3))
    lit(pair_scene)
    pair_scene.render.resolution_x = pair_scene.render.resolution_y = 64
    agree(pair_scene, tmp_path, samples=32, batches=8, cells=2, bounds=Bounds(0.01, 0.03))
