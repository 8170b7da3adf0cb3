"""Meshes, objects and instances as the engine gets them."""

from __future__ import annotations

import math
from typing import Any

import bpy
import numpy as np
import pytest
from sync_recorder import synchronise

OLD = bpy.app.version < (4, 1, 0)


def add_mesh(name: str, vertices: list[Any], faces: list[Any]) -> Any:
    """An object of a new mesh, linked to the scene."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(vertices, [], faces)
    mesh.update()
    obj = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(obj)
    return obj


SQUARE = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]


def shader_reading(attribute: str = "", node: str = "ShaderNodeAttribute", **properties: Any) -> Any:
    """A material that reads an attribute, so that it is sent."""
    material = bpy.data.materials.new("Reads")
    material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    emission = tree.nodes.new("ShaderNodeEmission")
    source = tree.nodes.new(node)
    if attribute:
        source.attribute_name = attribute
    for name, value in properties.items():
        setattr(source, name, value)
    sockets = [s for s in source.outputs if s.enabled]
    tree.links.new(sockets[0], emission.inputs["Color"])
    tree.links.new(emission.outputs[0], output.inputs["Surface"])
    return material


def attributes(arrays: dict[str, Any]) -> dict[str, tuple[str, bool, Any]]:
    """Attributes by name."""
    return {name: (domain, color, values) for name, domain, color, values in arrays.get("attributes", [])}


# -- meshes


def test_quad(empty_scene: Any) -> None:
    add_mesh("Quad", SQUARE, [(0, 1, 2, 3)])
    session, _, result = synchronise()
    arrays = session.mesh("Quad")
    assert result.warnings == []
    assert arrays["positions"].tolist() == [list(map(float, v)) for v in SQUARE]
    assert arrays["corner_vertices"].tolist() == [0, 1, 2, 3]
    assert sorted(arrays["triangle_corners"].reshape(-1).tolist()) == [0, 0, 1, 2, 2, 3]
    assert arrays["triangle_faces"].tolist() == [0, 0]
    assert arrays["face_smooth"].dtype == np.uint8
    for name in ("corner_vertices", "triangle_corners", "triangle_faces"):
        assert arrays[name].dtype == np.uint32


def test_material_slots(empty_scene: Any) -> None:
    obj = add_mesh("Two", [*SQUARE, (0, 0, 1)], [(0, 1, 2, 3), (0, 1, 4)])
    first, second = bpy.data.materials.new("First"), bpy.data.materials.new("Second")
    obj.data.materials.append(first)
    obj.data.materials.append(None)
    obj.data.materials.append(second)
    obj.data.polygons[1].material_index = 2
    session, _, _ = synchronise()
    assert session.mesh("Two")["face_materials"].tolist() == [0, 2]
    handles = session.objects["material_sets"][session.objects["material_set"][0]]
    assert [session.shaders[h][0] if h >= 0 else None for h in handles] == [
        "Material 'First'",
        None,
        "Material 'Second'",
    ]


def test_slot_linked_to_the_object(empty_scene: Any) -> None:
    obj = add_mesh("Slot", SQUARE, [(0, 1, 2, 3)])
    obj.data.materials.append(bpy.data.materials.new("Of the mesh"))
    obj.material_slots[0].link = "OBJECT"
    obj.material_slots[0].material = bpy.data.materials.new("Of the object")
    session, _, _ = synchronise()
    assert [name for name, _, _ in session.shaders.values() if name.startswith("Material")] == [
        "Material 'Of the object'"
    ]


def test_flat_and_smooth(empty_scene: Any) -> None:
    for name, smooth in (("Flat", False), ("Smooth", True)):
        obj = add_mesh(name, SQUARE, [(0, 1, 2, 3)])
        obj.data.polygons.foreach_set("use_smooth", [smooth])
    session, _, _ = synchronise()
    assert session.mesh("Flat")["face_smooth"].tolist() == [0]
    assert "vertex_normals" not in session.mesh("Flat")
    assert session.mesh("Smooth")["face_smooth"].tolist() == [1]
    assert session.mesh("Smooth")["vertex_normals"].tolist() == [[0, 0, 1]] * 4
    assert "corner_normals" not in session.mesh("Smooth")


def test_custom_normals(empty_scene: Any) -> None:
    obj = add_mesh("Custom", SQUARE, [(0, 1, 2, 3)])
    mesh = obj.data
    mesh.polygons.foreach_set("use_smooth", [True])
    wanted = np.array([(0.6, 0, 0.8), (0, 0.6, 0.8), (0, 0, 1), (-0.6, 0, 0.8)], np.float32)
    if OLD:
        mesh.use_auto_smooth = True
    mesh.normals_split_custom_set(wanted.tolist())
    session, _, _ = synchronise()
    assert np.allclose(session.mesh("Custom")["corner_normals"], wanted, atol=2e-3)


def test_sharp_edges_give_corner_normals(empty_scene: Any) -> None:
    """A tent with one sharp edge, the others smooth."""
    points = [(0, 0, 0), (1, 0, 1), (1, 1, 1), (0, 1, 0), (2, 0, 0), (2, 1, 0), (3, 0, -0.1), (3, 1, -0.1)]
    obj = add_mesh("Tent", points, [(0, 1, 2, 3), (1, 4, 5, 2), (4, 6, 7, 5)])
    mesh = obj.data
    mesh.polygons.foreach_set("use_smooth", [True] * 3)
    if OLD:
        mesh.use_auto_smooth = True
        mesh.auto_smooth_angle = math.radians(60)
    else:
        mesh.set_sharp_from_angle(angle=math.radians(60))
    session, _, _ = synchronise()
    arrays = session.mesh("Tent")
    normals = arrays["corner_normals"]
    at_ridge = normals[arrays["corner_vertices"] == 1]
    assert at_ridge[0][0] * at_ridge[1][0] < 0, "the ridge's two sides keep their own normals"
    below = normals[arrays["corner_vertices"] == 4]
    assert np.allclose(below[0], below[1], atol=1e-5), "the soft edge shares one"
    assert arrays["face_smooth"].tolist() == [1, 1, 1]


def test_uv_and_colours_only_when_read(empty_scene: Any) -> None:
    obj = add_mesh("Attributes", SQUARE, [(0, 1, 2, 3)])
    mesh = obj.data
    for name in ("First", "Second"):
        layer = mesh.uv_layers.new(name=name, do_init=False)
        layer.data.foreach_set("uv", [0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0, 1.0] if name == "First" else [0.5] * 8)
    mesh.uv_layers["Second"].active_render = True
    color = mesh.color_attributes.new("Col", "BYTE_COLOR", "CORNER")
    color.data.foreach_set("color", [0.5, 0.25, 1.0, 0.5] * 4)
    heat = mesh.attributes.new("heat", "FLOAT", "POINT")
    heat.data.foreach_set("value", [0.0, 1.0, 2.0, 3.0])
    session, _, _ = synchronise()
    assert "attributes" not in session.mesh("Attributes")
    assert session.mesh("Attributes")["active_uv"] == "Second"

    mesh.materials.append(shader_reading(node="ShaderNodeUVMap"))
    mesh.materials.append(shader_reading(node="ShaderNodeUVMap", uv_map="First"))
    mesh.materials.append(shader_reading("heat"))
    mesh.materials.append(shader_reading(node="ShaderNodeVertexColor", layer_name="Col"))
    session, _, _ = synchronise()
    found = attributes(session.mesh("Attributes"))
    assert set(found) == {"First", "Second", "heat", "Col"}
    assert found["First"][0] == "CORNER" and found["First"][2].shape == (4, 2)
    assert found["Second"][2].tolist() == [[0.5, 0.5]] * 4
    assert found["heat"][0] == "VERTEX" and found["heat"][2].tolist() == [0, 1, 2, 3]
    assert found["Col"][:2] == ("CORNER", True)
    assert found["Col"][2][0] == pytest.approx([0.5, 0.25, 1.0, 0.5], abs=4e-3)


def test_integer_boolean_edge_and_face_attributes(empty_scene: Any) -> None:
    obj = add_mesh("Kinds", [*SQUARE, (0, 0, 1)], [(0, 1, 2, 3), (0, 1, 4)])
    mesh = obj.data
    mesh.attributes.new("count", "INT", "FACE").data.foreach_set("value", [7, -3])
    mesh.attributes.new("flag", "BOOLEAN", "POINT").data.foreach_set("value", [True, False, True, False, False])
    edges = mesh.attributes.new("along", "FLOAT", "EDGE")
    edges.data.foreach_set("value", [1.0] * len(mesh.edges))
    for name in ("count", "flag", "along"):
        mesh.materials.append(shader_reading(name))
    session, _, _ = synchronise()
    found = attributes(session.mesh("Kinds"))
    assert found["count"][0] == "FACE" and found["count"][2].tolist() == [7, -3]
    assert found["flag"][2].tolist() == [1, 0, 1, 0, 0]
    assert found["along"][0] == "VERTEX" and found["along"][2].tolist() == [1] * 5
    assert all(values.dtype == np.float32 for _, _, values in found.values())


def test_generated_coordinates(empty_scene: Any) -> None:
    obj = add_mesh("Box", [(-1, -2, 0), (3, -2, 0), (3, 4, 0), (-1, 4, 0)], [(0, 1, 2, 3)])
    obj.data.materials.append(shader_reading(node="ShaderNodeTexCoord"))
    session, _, _ = synchronise()
    arrays = session.mesh("Box")
    generated = arrays["positions"] * arrays["generated_scale"] + arrays["generated_offset"]
    assert generated[:, :2].min(axis=0) == pytest.approx([0, 0], abs=1e-6)
    assert generated[:, :2].max(axis=0) == pytest.approx([1, 1])
    assert "attributes" not in arrays


def test_tangents(empty_scene: Any) -> None:
    for name, faces in (("Quads", [(0, 1, 2, 3)]), ("Ngon", [(0, 1, 4, 2, 3)])):
        points = [*SQUARE, (1.5, 0.5, 0)]
        obj = add_mesh(name, points, faces)
        layer = obj.data.uv_layers.new(name="UVMap")
        for corner, loop in zip(layer.data, obj.data.loops, strict=True):
            x, y, _ = points[loop.vertex_index]
            corner.uv = (y, x)  # mirrored: tangent +Y, sign -1
        obj.data.materials.append(shader_reading(node="ShaderNodeTangent", direction_type="UV_MAP"))
    session, _, _ = synchronise()
    for name in ("Quads", "Ngon"):
        domain, _, values = attributes(session.mesh(name))["@tangent:UVMap"]
        assert domain == "CORNER"
        assert np.allclose(values, [[0, 1, 0, -1]] * len(values), atol=1e-5), name


def test_bad_meshes(empty_scene: Any) -> None:
    add_mesh("Empty", [], [])
    add_mesh("Point", [(0, 0, 0)], [])
    nan = add_mesh("NaN", SQUARE, [(0, 1, 2, 3)])
    nan.data.vertices[1].co.x = float("nan")
    add_mesh("Flat", [(0, 0, 0)] * 3, [(0, 1, 2)])
    session, _, _ = synchronise()
    assert {name for name, _ in session.meshes.values()} == {"NaN", "Flat"}
    assert len(session.objects["mesh"]) == 2


def test_edit_mode(empty_scene: Any) -> None:
    bpy.ops.mesh.primitive_cube_add()
    bpy.ops.object.mode_set(mode="EDIT")
    session, _, _ = synchronise()
    bpy.ops.object.mode_set(mode="OBJECT")
    assert [len(arrays["triangle_corners"]) for _, arrays in session.meshes.values()] == [12]


# -- objects


def test_object_values(empty_scene: Any) -> None:
    obj = add_mesh("Named", SQUARE, [(0, 1, 2, 3)])
    obj.location = (1, 2, 3)
    obj.scale = (-1, 2, 1)
    obj.pass_index = 7
    obj.color = (0.5, 0.25, 0.125, 1)
    obj.visible_glossy = False
    obj.is_shadow_catcher = True
    bpy.context.view_layer.update()
    session, _, _ = synchronise()
    objects = session.objects
    assert objects["names"][objects["name"][0]] == "Named"
    assert objects["matrix"][0, 12:15].tolist() == [1, 2, 3]
    assert objects["matrix"][0, 0] == -1 and objects["matrix"][0, 5] == 2
    assert objects["pass_index"].tolist() == [7]
    assert objects["color"][0] == pytest.approx([0.5, 0.25, 0.125, 1])
    assert (objects["visibility"] & 63).tolist() == [63 & ~4]
    assert objects["flags"].tolist() == [4]


@pytest.mark.parametrize(("name", "random"), [("Cube", 0.313142), ("p", 0.503706), ("Suzanne.001", 0.457977)])
def test_random_of_a_name(empty_scene: Any, name: str, random: float) -> None:
    add_mesh(name, SQUARE, [(0, 1, 2, 3)])
    session, _, _ = synchronise()
    assert session.objects["random"][0] / 0xFFFFFFFF == pytest.approx(random, abs=1e-6)


def test_collection_instances(empty_scene: Any) -> None:
    scene = bpy.context.scene
    obj = add_mesh("Inside", SQUARE, [(0, 1, 2, 3)])
    scene.collection.objects.unlink(obj)
    collection = bpy.data.collections.new("Instanced")
    collection.objects.link(obj)
    for index in range(3):
        empty = bpy.data.objects.new(f"Empty {index}", None)
        empty.instance_type = "COLLECTION"
        empty.instance_collection = collection
        empty.location.x = 10 * index
        empty.visible_diffuse = index != 1
        scene.collection.objects.link(empty)
    bpy.context.view_layer.update()
    session, _, _ = synchronise()
    assert len(session.meshes) == 1
    assert sorted(session.objects["matrix"][:, 12].tolist()) == [0, 10, 20]
    assert session.objects["flags"].tolist() == [1, 1, 1]
    assert sorted((session.objects["visibility"] & 63).tolist()) == [61, 63, 63], (
        "the instancer's visibility counts too"
    )


def test_particle_instances(empty_scene: Any) -> None:
    scene = bpy.context.scene
    emitter = add_mesh("Emitter", SQUARE, [(0, 1, 2, 3)])
    thing = add_mesh("Thing", SQUARE, [(0, 1, 2, 3)])
    thing.hide_viewport = True
    emitter.modifiers.new("Particles", "PARTICLE_SYSTEM")
    settings = emitter.particle_systems[0].settings
    settings.count, settings.frame_start, settings.frame_end, settings.lifetime = 5, 1, 1, 100
    settings.render_type = "OBJECT"
    settings.instance_object = thing
    scene.frame_set(2)
    session, _, _ = synchronise()
    names = [session.objects["names"][i] for i in session.objects["name"]]
    assert names.count("Thing") == 5 and names.count("Emitter") == 1
    instances = session.objects["flags"] & 1
    assert instances.sum() == 5
    assert len(set(session.objects["random"].tolist())) == 6
    assert len(session.meshes) == 2


def test_geometry_nodes_instances(empty_scene: Any) -> None:
    group = bpy.data.node_groups.new("Instances", "GeometryNodeTree")
    if hasattr(group, "interface"):
        group.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
        group.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    else:
        group.inputs.new("NodeSocketGeometry", "Geometry")
        group.outputs.new("NodeSocketGeometry", "Geometry")
    source, target = group.nodes.new("NodeGroupInput"), group.nodes.new("NodeGroupOutput")
    cube, material = group.nodes.new("GeometryNodeMeshCube"), group.nodes.new("GeometryNodeSetMaterial")
    material.inputs["Material"].default_value = bpy.data.materials.new("Generated")
    scatter = group.nodes.new("GeometryNodeInstanceOnPoints")
    group.links.new(source.outputs[0], scatter.inputs["Points"])
    group.links.new(cube.outputs[0], material.inputs["Geometry"])
    group.links.new(material.outputs[0], scatter.inputs["Instance"])
    group.links.new(scatter.outputs[0], target.inputs[0])
    obj = add_mesh("Points", SQUARE, [(0, 1, 2, 3)])
    obj.modifiers.new("Nodes", "NODES").node_group = group
    bpy.context.view_layer.update()
    session, _, result = synchronise()
    assert result.warnings == []
    assert len(session.objects["mesh"]) == 4 and len(session.meshes) == 1
    assert session.objects["flags"].tolist() == [1] * 4
    handles = session.objects["material_sets"][session.objects["material_set"][0]]
    ((_, arrays),) = session.meshes.values()
    assert {session.shaders[handles[slot]][0] for slot in arrays["face_materials"]} == {"Material 'Generated'"}


def test_holdout_and_indirect_collections(empty_scene: Any) -> None:
    scene, layer = bpy.context.scene, bpy.context.view_layer
    for name in ("Holdout", "Indirect"):
        collection = bpy.data.collections.new(name)
        scene.collection.children.link(collection)
        obj = add_mesh(name, SQUARE, [(0, 1, 2, 3)])
        scene.collection.objects.unlink(obj)
        collection.objects.link(obj)
    layer.layer_collection.children["Holdout"].holdout = True
    layer.layer_collection.children["Indirect"].indirect_only = True
    layer.update()
    session, _, _ = synchronise()
    objects = session.objects
    by_name = {objects["names"][n]: i for i, n in enumerate(objects["name"])}
    assert objects["flags"][by_name["Holdout"]] == 2
    assert objects["visibility"][by_name["Holdout"]] & 63 == 63
    assert objects["flags"][by_name["Indirect"]] == 0
    assert objects["visibility"][by_name["Indirect"]] & 63 == 62


def test_hidden_and_unsupported(empty_scene: Any) -> None:
    hidden = add_mesh("Hidden", SQUARE, [(0, 1, 2, 3)])
    hidden.hide_viewport = True
    curve = bpy.data.objects.new("Hair", bpy.data.hair_curves.new("Hair"))
    bpy.context.scene.collection.objects.link(curve)
    volume = bpy.data.objects.new("Smoke", bpy.data.volumes.new("Smoke"))
    bpy.context.scene.collection.objects.link(volume)
    bpy.ops.object.text_add()
    bpy.context.view_layer.update()
    session, _, result = synchronise()
    assert len(session.objects["mesh"]) == 1, "text is a mesh by the time it is rendered"
    assert result.warnings == ["Object 'Smoke': volumes are not supported yet and not rendered"]


def test_material_override_and_custom_properties(empty_scene: Any) -> None:
    obj = add_mesh("Props", SQUARE, [(0, 1, 2, 3)])
    obj["wear"] = 0.75
    obj.data.materials.append(shader_reading("wear", attribute_type="OBJECT"))
    session, _, _ = synchronise()
    index = session.objects["attribute_set"][0]
    assert session.objects["attribute_sets"][index] == [("object:wear", (0.75,))]
    bpy.context.view_layer.material_override = bpy.data.materials.new("Override")
    session, _, _ = synchronise()
    assert [session.shaders[h][0] for h in session.objects["material_sets"][0]] == ["Material 'Override'"]


# -- lamps and world
