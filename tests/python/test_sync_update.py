"""Edits: only what changed is sent again."""

from __future__ import annotations

from typing import Any

import bpy
import pytest
from sync_recorder import synchronise


@pytest.fixture
def scene_of_two(empty_scene: Any) -> Any:
    """Two cubes of one material, a lamp; synchronised."""
    bpy.ops.mesh.primitive_cube_add()
    first = bpy.context.object
    bpy.ops.mesh.primitive_cube_add(location=(4, 0, 0))
    second = bpy.context.object
    material = bpy.data.materials.new("M")
    material.use_nodes = True
    for obj in (first, second):
        obj.data.materials.append(material)
    bpy.ops.object.light_add(type="POINT")
    session, sync, _ = synchronise(viewport=True)
    session.calls.clear()
    return session, sync, first, second, material


class Updates:
    """In background mode Blender clears a depsgraph's updates before a script sees them; handlers see them in time."""

    def __init__(self, sync: Any) -> None:
        self.sync = sync
        self.changed = False

    def __enter__(self) -> Updates:
        bpy.app.handlers.depsgraph_update_post.append(self._update)
        return self

    def __exit__(self, *_: Any) -> None:
        bpy.context.view_layer.update()
        bpy.app.handlers.depsgraph_update_post.remove(self._update)

    def _update(self, _scene: Any, depsgraph: Any) -> None:
        self.changed |= self.sync.update(depsgraph)


def test_nothing(scene_of_two: Any) -> None:
    session, sync, *_ = scene_of_two
    assert sync.update(bpy.context.evaluated_depsgraph_get()) is False
    assert session.calls == []


def test_moving(scene_of_two: Any) -> None:
    session, sync, first, *_ = scene_of_two
    with Updates(sync) as updates:
        first.location.x = -3
    assert updates.changed
    assert session.calls == ["set_object_matrices"]
    assert -3 in session.objects["matrix"][:, 12]


def test_moving_a_lamp(scene_of_two: Any) -> None:
    session, sync, *_ = scene_of_two
    with Updates(sync):
        bpy.data.objects["Point"].location.z = 9
    assert session.calls == ["set_lights"]
    assert session.lights[0]["to_world"][14] == 9


def test_geometry(scene_of_two: Any) -> None:
    session, sync, first, *_ = scene_of_two
    with Updates(sync):
        first.data.vertices[0].co.x = -5
        first.data.update()
    assert session.calls.count("set_mesh") + session.calls.count("add_mesh") == 1
    assert any(arrays["positions"].min() == -5 for _, arrays in session.meshes.values())
    assert len(session.meshes) == 2


def test_modifier(scene_of_two: Any) -> None:
    session, sync, first, *_ = scene_of_two
    with Updates(sync):
        first.modifiers.new("Subsurf", "SUBSURF")
    assert sorted(len(arrays["positions"]) for _, arrays in session.meshes.values()) == [8, 26]


def test_material(scene_of_two: Any) -> None:
    session, sync, *_, material = scene_of_two
    with Updates(sync) as updates:
        material.node_tree.nodes["Principled BSDF"].inputs["Roughness"].default_value = 0.125
    assert updates.changed
    assert session.calls == ["set_shader"]


def test_new_attribute_is_read_from_meshes(scene_of_two: Any) -> None:
    session, sync, *_, material = scene_of_two
    with Updates(sync):
        tree = material.node_tree
        node = tree.nodes.new("ShaderNodeUVMap")
        tree.links.new(node.outputs[0], tree.nodes["Principled BSDF"].inputs["Base Color"])
    assert session.calls.count("set_mesh") == 2
    assert all(arrays["attributes"][0][0] == "UVMap" for _, arrays in session.meshes.values())


def test_adding_and_removing(scene_of_two: Any) -> None:
    session, sync, first, *_ = scene_of_two
    with Updates(sync):
        bpy.ops.mesh.primitive_plane_add()
    assert len(session.objects["mesh"]) == 3 and len(session.meshes) == 3
    with Updates(sync):
        bpy.data.objects.remove(first)
    assert len(session.objects["mesh"]) == 2 and len(session.meshes) == 2


def test_new_material_replaces_the_old_one(scene_of_two: Any) -> None:
    session, sync, first, second, _ = scene_of_two
    with Updates(sync):
        for obj in (first, second):
            obj.data.materials[0] = bpy.data.materials.new("New")
    materials = [name for name, _, _ in session.shaders.values() if name.startswith("Material")]
    assert sorted(materials) == ["Material 'New'", "Material 'New.001'"]  # from 5.x on a new lamp has nodes as well


def test_world_and_settings(scene_of_two: Any) -> None:
    session, sync, *_ = scene_of_two
    with Updates(sync):
        bpy.context.scene.world = bpy.data.worlds.new("W")
    assert "set_world" in session.calls and session.world["shader"] in session.shaders
    session.calls.clear()
    with Updates(sync) as updates:
        bpy.context.scene.talbot.preview_samples = 77
        bpy.context.scene.update_tag()
    assert updates.changed and session.settings["samples"] == 77


def test_node_group(scene_of_two: Any) -> None:
    session, sync, *_, material = scene_of_two
    group = bpy.data.node_groups.new("G", "ShaderNodeTree")
    if hasattr(group, "interface"):
        group.interface.new_socket("Out", in_out="OUTPUT", socket_type="NodeSocketColor")
    else:
        group.outputs.new("NodeSocketColor", "Out")
    inside, rgb = group.nodes.new("NodeGroupOutput"), group.nodes.new("ShaderNodeRGB")
    group.links.new(rgb.outputs[0], inside.inputs[0])
    with Updates(sync):
        holder = material.node_tree.nodes.new("ShaderNodeGroup")
        holder.node_tree = group
        material.node_tree.links.new(
            holder.outputs[0], material.node_tree.nodes["Principled BSDF"].inputs["Base Color"]
        )
    session.calls.clear()
    with Updates(sync) as updates:
        rgb.outputs[0].default_value = (0.5, 0.25, 0.125, 1)
    assert updates.changed and "set_shader" in session.calls


def test_a_property_of_the_view_layer(scene_of_two: Any) -> None:
    """Shaders that read it are sent again; lamps have what objects have."""
    session, sync, *_, material = scene_of_two
    lamp = next(o for o in bpy.data.objects if o.type == "LIGHT")
    lamp["wear"], lamp.pass_index, lamp.color = 0.25, 3, (0.1, 0.2, 0.3, 0.4)
    node = material.node_tree.nodes.new("ShaderNodeAttribute")
    node.attribute_type, node.attribute_name = "VIEW_LAYER", "wear"
    principled = material.node_tree.nodes["Principled BSDF"]
    material.node_tree.links.new(node.outputs["Color"], principled.inputs["Base Color"])
    tree = lamp.data.node_tree if lamp.data.use_nodes else None
    if tree is None:
        lamp.data.use_nodes = True
        tree = lamp.data.node_tree
    own = tree.nodes.new("ShaderNodeAttribute")
    own.attribute_type, own.attribute_name = "OBJECT", "wear"
    emission = next(n for n in tree.nodes if n.type == "EMISSION")
    tree.links.new(own.outputs["Color"], emission.inputs["Color"])
    with Updates(sync):
        bpy.context.scene["wear"] = (1.0, 2.0, 3.0)
        bpy.context.scene.update_tag()

    def read() -> list[float]:
        return session.node("Material 'M'", "ShaderNodeAttribute")["properties"]["layer_value"].tolist()

    assert read() == [1.0, 2.0, 3.0, 1.0, 2.0]
    (light,) = session.lights
    assert light["attributes"] == [("object:wear", (0.25,))]
    assert light["pass_index"] == 3 and light["object_color"] == pytest.approx((0.1, 0.2, 0.3, 0.4))
    with Updates(sync) as updates:
        bpy.context.scene["wear"] = 0.5
        bpy.context.scene.update_tag()
    assert updates.changed
    assert read() == [0.5] * 3 + [1.0, 0.5]
