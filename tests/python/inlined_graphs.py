"""What Blender's inliner resolves before an engine sees it: repeat zones, closures, bundles, menu switches, constants.

Each builder gives a socket to be shown; what a Blender does not have raises `NotHere`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy
from pair_scenes import color_card, image_of


class NotHere(Exception):
    """The Blender has no such node, or not in shaders."""


def new(tree: Any, kind: str) -> Any:
    """A node that may not exist."""
    try:
        return tree.tree.nodes.new(kind)
    except RuntimeError as error:
        raise NotHere(kind) from error


def place(tree: Any) -> Any:
    """Something that nobody can fold: 0 to 1 from left to right."""
    return tree("SeparateXYZ", Vector=tree("TexCoord").outputs["Generated"]).outputs["X"]


def link(tree: Any, source: Any, target: Any) -> None:
    tree.tree.links.new(source, target)


def zone(tree: Any, first: str, last: str) -> tuple[Any, Any]:
    """Both ends of a zone."""
    start, end = new(tree, first), new(tree, last)
    if not start.pair_with_output(end):
        raise NotHere(first)
    return start, end


def repeat(tree: Any, kind: str = "FLOAT", iterations: Any = 3) -> tuple[Any, Any]:
    """A repeat zone with one item besides what it comes with."""
    start, end = zone(tree, "GeometryNodeRepeatInput", "GeometryNodeRepeatOutput")
    end.repeat_items.clear()
    try:
        end.repeat_items.new(kind, "x")
    except RuntimeError as error:
        raise NotHere(kind) from error
    if isinstance(iterations, bpy.types.NodeSocket):
        link(tree, iterations, start.inputs["Iterations"])
    else:
        start.inputs["Iterations"].default_value = iterations
    return start, end


def repeat_zone(tree: Any, iterations: Any = 3) -> Any:
    """x = 0.6 x + place, with the number of the turn added."""
    start, end = repeat(tree, "FLOAT", iterations)
    start.inputs["x"].default_value = 0.5
    turn = tree("Math", operation="MULTIPLY_ADD", in0=start.outputs["Iteration"], in1=0.25, in2=place(tree))
    step = tree("Math", operation="MULTIPLY_ADD", in0=start.outputs["x"], in1=0.6, in2=turn)
    link(tree, step.outputs[0], end.inputs["x"])
    return end.outputs["x"]


def repeat_by_constant(tree: Any) -> Any:
    count = new(tree, "FunctionNodeInputInt")
    count.integer = 4
    return repeat_zone(tree, count.outputs[0])


def repeat_never(tree: Any) -> Any:
    return repeat_zone(tree, 0)


def repeat_in_repeat(tree: Any) -> Any:
    start, end = repeat(tree, "FLOAT", 2)
    start.inputs["x"].default_value = 0.3
    inner, inner_end = repeat(tree, "FLOAT", 3)
    link(tree, start.outputs["x"], inner.inputs["x"])
    step = tree("Math", operation="MULTIPLY_ADD", in0=inner.outputs["x"], in1=0.8, in2=place(tree))
    link(tree, step.outputs[0], inner_end.inputs["x"])
    link(tree, inner_end.outputs["x"], end.inputs["x"])
    return end.outputs["x"]


def repeat_of(kind: str) -> Callable[[Any], Any]:
    """An item of another kind: what goes in and out is converted."""

    def build(tree: Any) -> Any:
        start, end = repeat(tree, kind, 1)
        scaled = tree("Math", operation="MULTIPLY_ADD", in0=place(tree), in1=5.0, in2=-2.0)
        link(tree, scaled.outputs[0], start.inputs["x"])
        link(tree, start.outputs["x"], end.inputs["x"])
        return tree("Math", operation="MULTIPLY", in0=end.outputs["x"], in1=0.5).outputs[0]

    return build


def repeat_shader(tree: Any) -> Any:
    """A shader that is mixed with another one in each turn."""
    start, end = repeat(tree, "SHADER", 3)
    link(tree, tree("Emission", Color=(1.0, 0.2, 0.1)).outputs[0], start.inputs["x"])
    mix = tree("MixShader", in0=place(tree), in2=tree("Emission", Color=(0.1, 0.3, 0.9)))
    link(tree, start.outputs["x"], mix.inputs[1])
    link(tree, mix.outputs[0], end.inputs["x"])
    return end.outputs["x"]


def evaluated(tree: Any, closure: Any, value: Any) -> Any:
    """A closure's output for an input."""
    node = new(tree, "NodeEvaluateClosure")
    node.input_items.new("FLOAT", "a")
    node.output_items.new("FLOAT", "b")
    link(tree, closure, node.inputs[0])
    link(tree, value, next(s for s in node.inputs if s.name == "a"))
    return next(s for s in node.outputs if s.name == "b")


def closure(tree: Any) -> Any:
    """a -> 0.7 a + place."""
    start, end = zone(tree, "NodeClosureInput", "NodeClosureOutput")
    end.input_items.new("FLOAT", "a")
    end.output_items.new("FLOAT", "b")
    step = tree("Math", operation="MULTIPLY_ADD", in1=0.7, in2=place(tree))
    link(tree, start.outputs["a"], step.inputs[0])
    link(tree, step.outputs[0], end.inputs["b"])
    return end.outputs[0]


def closure_twice(tree: Any) -> Any:
    made = closure(tree)
    return evaluated(tree, made, evaluated(tree, made, place(tree)))


def bundle(tree: Any) -> Any:
    """A number and a colour, put together and taken apart."""
    together, apart = new(tree, "NodeCombineBundle"), new(tree, "NodeSeparateBundle")
    for node in (together, apart):
        node.bundle_items.new("FLOAT", "number")
        node.bundle_items.new("RGBA", "color")
    link(tree, place(tree), together.inputs["number"])
    together.inputs["color"].default_value = (0.2, 0.5, 0.9, 1.0)
    link(tree, together.outputs[0], apart.inputs[0])
    mix = tree("MixRGB", in0=apart.outputs["number"], in1=(1.0, 0.1, 0.3))
    link(tree, apart.outputs["color"], mix.inputs[2])
    return mix.outputs[0]


def closure_in_bundle(tree: Any) -> Any:
    together, apart = new(tree, "NodeCombineBundle"), new(tree, "NodeSeparateBundle")
    for node in (together, apart):
        node.bundle_items.new("CLOSURE", "f")
    link(tree, closure(tree), together.inputs["f"])
    link(tree, together.outputs[0], apart.inputs[0])
    return evaluated(tree, apart.outputs["f"], place(tree))


def menu_switch(tree: Any, kind: str, chosen: str = "B") -> Any:
    """Chooses the second of two."""
    node = new(tree, "GeometryNodeMenuSwitch")
    try:
        node.data_type = kind
    except TypeError as error:
        raise NotHere(kind) from error
    link(tree, place(tree), node.inputs["A"])
    node.inputs["Menu"].default_value = chosen
    return node


def menu_of(kind: str, value: Any) -> Callable[[Any], Any]:
    def build(tree: Any) -> Any:
        node = menu_switch(tree, kind)
        node.inputs["B"].default_value = value
        shown = tree("Math", operation="ADD", in0=node.outputs[0], in1=0.25)
        return node.outputs[0] if kind in ("RGBA", "VECTOR") else shown.outputs[0]

    return build


def menu_linked(tree: Any) -> Any:
    return menu_switch(tree, "FLOAT", "A").outputs[0]


def menu_shader(tree: Any) -> Any:
    node = new(tree, "GeometryNodeMenuSwitch")
    node.data_type = "SHADER"
    link(tree, tree("Emission", Color=(1.0, 0.2, 0.1)).outputs[0], node.inputs["A"])
    link(tree, tree("Emission", Color=place(tree)).outputs[0], node.inputs["B"])
    node.inputs["Menu"].default_value = "B"
    return node.outputs[0]


def menu_by_constant(tree: Any) -> Any:
    node = menu_switch(tree, "FLOAT", "A")
    node.inputs["B"].default_value = 0.75
    chooser = new(tree, "FunctionNodeInputMenu")
    link(tree, chooser.outputs[0], node.inputs["Menu"])
    chooser.value = "B"
    return node.outputs[0]


def constant(kind: str, prop: str, value: Any) -> Callable[[Any], Any]:
    """A constant's node, in arithmetic and as it is."""

    def build(tree: Any) -> Any:
        node = new(tree, kind)
        setattr(node, prop, value)
        product = tree("MixRGB", blend_type="MULTIPLY", in0=1.0, in1=place(tree), in2=node)
        return tree("MixRGB", in0=0.5, in1=product, in2=node).outputs[0]

    return build


def shown_as_shader(kind: str, prop: str, value: Any) -> Callable[[Any], Any]:
    """A constant where a shader is expected, which shines with it."""

    def build(tree: Any) -> Any:
        node = new(tree, kind)
        setattr(node, prop, value)
        mix = tree("MixShader", in0=place(tree), in1=tree("Emission", Color=(0.2, 0.3, 0.9)))
        link(tree, node.outputs[0], mix.inputs[2])
        return mix.outputs[0]

    return build


def as_normal(kind: str, prop: str, value: Any) -> Callable[[Any], Any]:
    """A constant into sockets that have no value of their own."""

    def build(tree: Any) -> Any:
        node = new(tree, kind)
        setattr(node, prop, value)
        fresnel = tree("Fresnel")
        link(tree, node.outputs[0], fresnel.inputs["Normal"])
        card = tree("TexImage", image=image_of(color_card()), interpolation="Closest")
        link(tree, node.outputs[0], card.inputs["Vector"])
        return tree("MixRGB", in0=fresnel.outputs[0], in1=card.outputs[0], in2=place(tree)).outputs[0]

    return build


def grouped(kind: str, value: Any) -> Callable[[Any], Any]:
    """A group's socket of another kind, unlinked, feeds sockets without a value of their own and with one."""

    def build(tree: Any) -> Any:
        inner = bpy.data.node_groups.new("Inner", "ShaderNodeTree")
        try:
            inner.interface.new_socket("in", in_out="INPUT", socket_type=kind).default_value = value
        except TypeError as error:
            raise NotHere(kind) from error
        inner.interface.new_socket("out", in_out="OUTPUT", socket_type="NodeSocketVector")
        inside = type(tree)(inner)
        given = inside("NodeGroupInput").outputs[0]
        texture = inside("TexWave", Vector=given)
        added = inside("VectorMath", in0=texture.outputs[0], in1=given)
        link(inside, added.outputs[0], inside("NodeGroupOutput").inputs[0])
        outer = tree.tree.nodes.new("ShaderNodeGroup")
        outer.node_tree = inner
        product = tree("MixRGB", in0=0.5, in1=place(tree), in2=outer.outputs[0])
        return product.outputs[0]

    return build


def scene_time(tree: Any) -> Any:
    node = new(tree, "GeometryNodeInputSceneTime")
    total = tree("Math", in0=node.outputs["Seconds"], in1=place(tree))
    return tree("Math", operation="MULTIPLY_ADD", in0=node.outputs["Frame"], in1=0.1, in2=total).outputs[0]


GRAPHS: dict[str, Callable[[Any], Any]] = {
    "repeat": repeat_zone,
    "repeat by a constant": repeat_by_constant,
    "repeat never": repeat_never,
    "repeat in repeat": repeat_in_repeat,
    "repeat an integer": repeat_of("INT"),
    "repeat a boolean": repeat_of("BOOLEAN"),
    "repeat a vector": repeat_of("VECTOR"),
    "repeat a colour": repeat_of("RGBA"),
    "repeat a shader": repeat_shader,
    "closure": lambda tree: evaluated(tree, closure(tree), place(tree)),
    "closure twice": closure_twice,
    "closure in a bundle": closure_in_bundle,
    "bundle": bundle,
    "menu of numbers": menu_of("FLOAT", 0.75),
    "menu of integers": menu_of("INT", 2),
    "menu of booleans": menu_of("BOOLEAN", True),
    "menu of vectors": menu_of("VECTOR", (0.1, 0.6, 0.3)),
    "menu of colours": menu_of("RGBA", (0.1, 0.6, 0.3, 1.0)),
    "menu of shaders": menu_shader,
    "menu of a link": menu_linked,
    "menu by a constant": menu_by_constant,
    "integer": constant("FunctionNodeInputInt", "integer", 2),
    "boolean": constant("FunctionNodeInputBool", "boolean", True),
    "vector": constant("FunctionNodeInputVector", "vector", (0.2, 0.7, 0.4)),
    "integer as a shader": shown_as_shader("FunctionNodeInputInt", "integer", 2),
    "boolean as a shader": shown_as_shader("FunctionNodeInputBool", "boolean", True),
    "vector as a shader": shown_as_shader("FunctionNodeInputVector", "vector", (0.2, 0.7, 0.4)),
    "integer as a normal": as_normal("FunctionNodeInputInt", "integer", 1),
    "boolean as a normal": as_normal("FunctionNodeInputBool", "boolean", True),
    "vector as a normal": as_normal("FunctionNodeInputVector", "vector", (0.2, 0.7, 0.4)),
    "group of a number": grouped("NodeSocketFloat", 0.7),
    "group of an integer": grouped("NodeSocketInt", 3),
    "group of a boolean": grouped("NodeSocketBool", True),
    "group of a vector": grouped("NodeSocketVector", (0.2, 0.7, 0.4)),
    "group of a colour": grouped("NodeSocketColor", (0.2, 0.7, 0.4, 1.0)),
    "group of a rotation": grouped("NodeSocketRotation", (0.2, 0.7, 0.4)),
    "scene time": scene_time,
}
