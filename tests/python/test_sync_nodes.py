"""Node trees as the engine gets them."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
import pytest
from sync_recorder import node_input, synchronise
from talbot.sync.nodes_flatten import Flattener

OLD = not hasattr(bpy.types.Material, "inline_shader_nodes")


def make_material(name: str = "M") -> tuple[Any, Any]:
    """A material on a plane, its tree with nothing but the output."""
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    tree.nodes.new("ShaderNodeOutputMaterial")
    bpy.ops.mesh.primitive_plane_add()
    bpy.context.object.data.materials.append(material)
    return material, tree


def surface(tree: Any, node: Any) -> None:
    """Links a closure to the output."""
    tree.links.new(node.outputs[0], tree.nodes["Material Output"].inputs["Surface"])


def group_with(tree_name: str, sockets: list[tuple[str, str, str]]) -> tuple[Any, Any, Any]:
    """A node group: tree, its input node, its output node. Sockets: (name, "INPUT" | "OUTPUT", type)."""
    tree = bpy.data.node_groups.new(tree_name, "ShaderNodeTree")
    for name, side, kind in sockets:
        if hasattr(tree, "interface"):
            tree.interface.new_socket(name, in_out=side, socket_type=kind)
        else:
            (tree.inputs if side == "INPUT" else tree.outputs).new(kind, name)
    return tree, tree.nodes.new("NodeGroupInput"), tree.nodes.new("NodeGroupOutput")


def test_properties_values_and_links(empty_scene: Any) -> None:
    _, tree = make_material()
    diffuse = tree.nodes.new("ShaderNodeBsdfDiffuse")
    math = tree.nodes.new("ShaderNodeMath")
    math.operation = "MULTIPLY_ADD"
    math.use_clamp = True
    math.inputs[2].default_value = 0.25
    tree.links.new(tree.nodes.new("ShaderNodeTexChecker").outputs["Fac"], math.inputs[0])
    tree.links.new(math.outputs[0], diffuse.inputs["Roughness"])
    surface(tree, diffuse)
    noise = tree.nodes.new("ShaderNodeTexNoise")  # not linked: not sent
    noise.inputs["Scale"].default_value = 3
    session, _, result = synchronise()
    assert result.warnings == []
    node = session.node("Material 'M'", "ShaderNodeBsdfDiffuse")
    graph = session.shader("Material 'M'")
    kinds = [n["type"] for n in graph["nodes"]]
    assert "ShaderNodeTexNoise" not in kinds
    assert graph["nodes"][graph["output_node"]]["type"] == "ShaderNodeOutputMaterial"
    identifier, kind, _, hidden, source, output = node_input(node, "Roughness")
    assert (identifier, kind, hidden, output) == ("Roughness", "FLOAT", False, "Value")
    assert node_input(node, "Normal")[3] is True, "an unlinked normal means the shading normal"
    linked = graph["nodes"][source]
    assert linked["type"] == "ShaderNodeMath"
    assert linked["properties"]["operation"] == "MULTIPLY_ADD"
    assert linked["properties"]["use_clamp"] == 1.0
    assert node_input(linked, "Value_002")[2] == 0.25
    assert linked["name"] == "Math", "messages name nodes as the user does"


def test_disabled_sockets_are_left_out(empty_scene: Any) -> None:
    _, tree = make_material()
    emission = tree.nodes.new("ShaderNodeEmission")
    mix = tree.nodes.new("ShaderNodeMix")
    mix.data_type = "RGBA"
    noise = tree.nodes.new("ShaderNodeTexNoise")
    tree.links.new(noise.outputs["Color"], mix.inputs["A_Color"] if "A_Color" in mix.inputs else mix.inputs[6])
    tree.links.new(mix.outputs[2], emission.inputs["Color"])
    surface(tree, emission)
    session, _, _ = synchronise()
    node = session.node("Material 'M'", "ShaderNodeMix")
    assert [item[0] for item in node["inputs"]] == ["Factor_Float", "A_Color", "B_Color"]
    assert [item[0] for item in node["outputs"]] == ["Result_Color"]


def test_nested_groups_and_reroutes(empty_scene: Any) -> None:
    inner, inner_in, inner_out = group_with(
        "Inner", [("Value", "INPUT", "NodeSocketFloat"), ("Out", "OUTPUT", "NodeSocketColor")]
    )
    noise = inner.nodes.new("ShaderNodeTexNoise")
    inner.links.new(inner_in.outputs[0], noise.inputs["Scale"])
    inner.links.new(noise.outputs["Color"], inner_out.inputs[0])
    outer, outer_in, outer_out = group_with(
        "Outer", [("Value", "INPUT", "NodeSocketFloat"), ("Out", "OUTPUT", "NodeSocketColor")]
    )
    holder = outer.nodes.new("ShaderNodeGroup")
    holder.node_tree = inner
    outer.links.new(outer_in.outputs[0], holder.inputs[0])
    reroute = outer.nodes.new("NodeReroute")
    outer.links.new(holder.outputs[0], reroute.inputs[0])
    outer.links.new(reroute.outputs[0], outer_out.inputs[0])

    _, tree = make_material()
    first, second = tree.nodes.new("ShaderNodeGroup"), tree.nodes.new("ShaderNodeGroup")
    for node, scale in ((first, 7.0), (second, 9.0)):
        node.node_tree = outer
        node.inputs[0].default_value = scale
    first.name, second.name = "First", "Second"
    mix = tree.nodes.new("ShaderNodeMixShader")
    for index, node in enumerate((first, second)):
        emission = tree.nodes.new("ShaderNodeEmission")
        tree.links.new(node.outputs[0], emission.inputs["Color"])
        tree.links.new(emission.outputs[0], mix.inputs[1 + index])
    surface(tree, mix)
    session, _, result = synchronise()
    assert result.warnings == []
    noises = [n for n in session.shader("Material 'M'")["nodes"] if n["type"] == "ShaderNodeTexNoise"]
    assert sorted(node_input(n, "Scale")[2] for n in noises) == [7.0, 9.0], "each use of a group has its own values"
    if OLD:
        assert {n["name"] for n in noises} == {"First > Group > Noise Texture", "Second > Group > Noise Texture"}


def test_group_value_into_another_kind_of_socket(empty_scene: Any) -> None:
    group, inside, outside = group_with(
        "G", [("Color", "INPUT", "NodeSocketColor"), ("Out", "OUTPUT", "NodeSocketShader")]
    )
    emission = group.nodes.new("ShaderNodeEmission")
    group.links.new(inside.outputs[0], emission.inputs["Strength"])
    group.links.new(emission.outputs[0], outside.inputs[0])
    _, tree = make_material()
    node = tree.nodes.new("ShaderNodeGroup")
    node.node_tree = group
    node.inputs[0].default_value = (1.0, 0.5, 0.25, 1.0)
    surface(tree, node)
    session, _, _ = synchronise()
    sent = session.node("Material 'M'", "ShaderNodeEmission")
    _, _, value, _, source, output = node_input(sent, "Strength")
    if source >= 0:
        rgb = session.shader("Material 'M'")["nodes"][source]
        assert rgb["type"] == "ShaderNodeRGB" and output == "Color"
        assert rgb["outputs"][0][2][:3] == pytest.approx((1.0, 0.5, 0.25))
    else:
        assert value == pytest.approx(0.2126 + 0.7152 * 0.5 + 0.0722 * 0.25, abs=1e-3)


def test_muted_nodes_and_links(empty_scene: Any) -> None:
    _, tree = make_material()
    diffuse = tree.nodes.new("ShaderNodeBsdfDiffuse")
    bright = tree.nodes.new("ShaderNodeBrightContrast")
    noise = tree.nodes.new("ShaderNodeTexNoise")
    tree.links.new(noise.outputs["Color"], bright.inputs["Color"])
    tree.links.new(bright.outputs[0], diffuse.inputs["Color"])
    bright.mute = True
    link = tree.links.new(noise.outputs[0], diffuse.inputs["Roughness"])
    link.is_muted = True
    diffuse.inputs["Roughness"].default_value = 0.5
    surface(tree, diffuse)
    session, _, _ = synchronise()
    graph = session.shader("Material 'M'")
    node = session.node("Material 'M'", "ShaderNodeBsdfDiffuse")
    color = node_input(node, "Color")
    assert graph["nodes"][color[4]]["type"] == "ShaderNodeTexNoise"
    assert color[5] == "Color"
    assert node_input(node, "Roughness")[2:5] == (0.5, False, -1)


@pytest.mark.parametrize("kind", ["ShaderNodeBrightContrast", "NodeReroute"])
def test_constants_behind_what_is_skipped(empty_scene: Any, kind: str) -> None:
    """Measured with Cycles: 3.4 takes zero for what nothing feeds, 5.0 leaves the socket its own value."""
    _, tree = make_material()
    emission = tree.nodes.new("ShaderNodeEmission")
    emission.inputs["Color"].default_value = (0.9, 0.8, 0.7, 1.0)
    node = tree.nodes.new(kind)
    node.mute = True
    tree.links.new(node.outputs[0], emission.inputs["Color"])
    surface(tree, emission)
    session, _, _ = synchronise()
    color = node_input(session.node("Material 'M'", "ShaderNodeEmission"), "Color")
    assert color[4] == -1
    assert color[2][:3] == pytest.approx((0.0, 0.0, 0.0) if OLD else (0.9, 0.8, 0.7))


def test_group_value_for_a_texture_vector(empty_scene: Any) -> None:
    """Measured with Cycles: in 3.4 the texture keeps its own coordinates, in 5.0 the group's value counts."""
    group, inside, outside = group_with("G", [("V", "INPUT", "NodeSocketVector"), ("Out", "OUTPUT", "NodeSocketColor")])
    gradient = group.nodes.new("ShaderNodeTexGradient")
    group.links.new(inside.outputs[0], gradient.inputs["Vector"])
    group.links.new(gradient.outputs[0], outside.inputs[0])
    _, tree = make_material()
    holder = tree.nodes.new("ShaderNodeGroup")
    holder.node_tree = group
    holder.inputs[0].default_value = (0.1, 0.2, 0.3)
    emission = tree.nodes.new("ShaderNodeEmission")
    tree.links.new(holder.outputs[0], emission.inputs["Color"])
    surface(tree, emission)
    session, _, _ = synchronise()
    if OLD:
        vector = node_input(session.node("Material 'M'", "ShaderNodeTexGradient"), "Vector")
        assert vector[3:5] == (True, -1)
    else:  # the inliner folded the texture
        color = node_input(session.node("Material 'M'", "ShaderNodeEmission"), "Color")
        assert color[4] == -1 and color[2][:3] == pytest.approx((0.1, 0.1, 0.1))


def test_circles_end(empty_scene: Any) -> None:
    _, tree = make_material()
    emission = tree.nodes.new("ShaderNodeEmission")
    one, two = tree.nodes.new("ShaderNodeMath"), tree.nodes.new("ShaderNodeMath")
    tree.links.new(one.outputs[0], two.inputs[0])
    tree.links.new(two.outputs[0], one.inputs[0])
    tree.links.new(one.outputs[0], emission.inputs["Strength"])
    surface(tree, emission)
    session, _, _ = synchronise()
    nodes = session.shader("Material 'M'")["nodes"]
    assert len([n for n in nodes if n["type"] == "ShaderNodeMath"]) <= 2


def test_circle_of_reroutes_is_reported(empty_scene: Any) -> None:
    """Blender marks circles' links invalid; a tree that says otherwise must not hang the reader."""

    class Thing:
        def __init__(self, **values: Any) -> None:
            self.__dict__.update(values)

        def as_pointer(self) -> int:
            return id(self)

    socket = Thing(identifier="Input", enabled=True, hide_value=False)
    output = Thing(identifier="Output", enabled=True)
    reroute = Thing(name="R", type="REROUTE", mute=False, inputs=[socket], outputs=[output], internal_links=[])
    target = Thing(identifier="Surface", enabled=True, hide_value=False)
    last = Thing(name="Out", type="OUTPUT_MATERIAL", mute=False, inputs=[target], outputs=[])
    links = [
        Thing(is_muted=False, is_valid=True, from_node=reroute, from_socket=output, to_node=reroute, to_socket=socket),
        Thing(is_muted=False, is_valid=True, from_node=reroute, from_socket=output, to_node=last, to_socket=target),
    ]
    flattener = Flattener()
    nodes = flattener.run(Thing(links=links, nodes=[reroute, last]), last)
    assert len(nodes) == 1
    assert "circle" in flattener.problems[0]


def test_ramp_curves_and_mapping(empty_scene: Any) -> None:
    _, tree = make_material()
    emission = tree.nodes.new("ShaderNodeEmission")
    ramp = tree.nodes.new("ShaderNodeValToRGB")
    ramp.color_ramp.interpolation = "CONSTANT"
    ramp.color_ramp.elements[0].color = (1, 0, 0, 1)
    noise = tree.nodes.new("ShaderNodeTexNoise")
    noise.texture_mapping.scale = (2, 3, 4)
    noise.texture_mapping.translation = (1, 0, 0)
    tree.links.new(noise.outputs[0], ramp.inputs[0])
    curve = tree.nodes.new("ShaderNodeRGBCurve")
    curve.mapping.curves[3].points[0].location = (0.0, 0.5)
    tree.links.new(ramp.outputs[0], curve.inputs["Color"])
    tree.links.new(curve.outputs[0], emission.inputs["Color"])
    surface(tree, emission)
    session, sync, _ = synchronise()
    size = 256 if sync.context.version == 304 else 257
    properties = session.node("Material 'M'", "ShaderNodeValToRGB")["properties"]
    assert properties["color_ramp_constant"] == 1.0
    table = properties["color_ramp"].reshape(size, 4)
    assert table.dtype == np.float32
    assert table[0].tolist() == [1, 0, 0, 1] and table[-1].tolist() == [1, 1, 1, 1]
    properties = session.node("Material 'M'", "ShaderNodeTexNoise")["properties"]
    assert properties["texture_mapping"].reshape(3, 4).tolist() == [[2, 0, 0, 1], [0, 3, 0, 0], [0, 0, 4, 0]]
    properties = session.node("Material 'M'", "ShaderNodeRGBCurve")["properties"]
    table = properties["mapping"].reshape(size, 4)
    assert (properties["mapping_min"], properties["mapping_max"]) == (0.0, 1.0)
    assert properties["mapping_extend"] in ("EXTRAPOLATED", "HORIZONTAL")
    assert table[0, :3] == pytest.approx([0.5] * 3, abs=0.01), "the combined curve is in every channel"
    assert table[-1, :3] == pytest.approx([1.0] * 3, abs=0.01)


def test_object_matrix(empty_scene: Any) -> None:
    _, tree = make_material()
    target = bpy.data.objects.new("Target", None)
    bpy.context.scene.collection.objects.link(target)
    target.location = (1, 2, 3)
    emission = tree.nodes.new("ShaderNodeEmission")
    coordinates = tree.nodes.new("ShaderNodeTexCoord")
    coordinates.object = target
    tree.links.new(coordinates.outputs["Object"], emission.inputs["Color"])
    surface(tree, emission)
    session, _, _ = synchronise()
    matrix = session.node("Material 'M'", "ShaderNodeTexCoord")["properties"]["object_matrix"].reshape(3, 4)
    assert matrix[:, 3].tolist() == [-1, -2, -3]


def test_materials_without_nodes_or_output(empty_scene: Any) -> None:
    material, tree = make_material()
    tree.nodes.clear()
    session, _, _ = synchronise()
    assert session.shader("Material 'M'") == {"nodes": [], "output_node": -1}
    if bpy.app.version < (5, 0, 0):
        material.use_nodes = False
        material.diffuse_color = (0.1, 0.2, 0.3, 1.0)
        session, _, _ = synchronise()
        node = session.node("Material 'M'", "ShaderNodeBsdfDiffuse")
        assert node_input(node, "Color")[2][:3] == pytest.approx((0.1, 0.2, 0.3))
