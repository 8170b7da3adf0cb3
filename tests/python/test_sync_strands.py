"""Particle hair, Curves and point clouds as the engine gets them."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
import pytest
from sync_recorder import synchronise
from test_sync_scene import SQUARE, add_mesh, attributes, shader_reading


def add_hair(obj: Any, **values: Any) -> Any:
    """A particle system with strands."""
    obj.modifiers.new("Hair", "PARTICLE_SYSTEM")
    settings = obj.particle_systems[-1].settings
    settings.type, settings.count, settings.hair_length = "HAIR", 5, 2.0
    settings.root_radius, settings.tip_radius, settings.radius_scale = 1.0, 0.5, 0.1
    for name, value in values.items():
        setattr(settings, name, value)
    return settings


def points_of(obj: Any, radius: float | None) -> None:
    """Turns the vertices of a mesh object into points."""
    tree = bpy.data.node_groups.new("Points", "GeometryNodeTree")
    if hasattr(tree, "interface"):
        for way in ("INPUT", "OUTPUT"):
            tree.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    else:
        tree.inputs.new("NodeSocketGeometry", "Geometry")
        tree.outputs.new("NodeSocketGeometry", "Geometry")
    nodes = [tree.nodes.new(n) for n in ("NodeGroupInput", "GeometryNodeMeshToPoints", "NodeGroupOutput")]
    if radius is not None:
        nodes[1].inputs["Radius"].default_value = radius
    tree.links.new(nodes[0].outputs[0], nodes[1].inputs[0])
    tree.links.new(nodes[1].outputs[0], nodes[2].inputs[0])
    obj.modifiers.new("Points", "NODES").node_group = tree


def test_particle_hair(empty_scene: Any) -> None:
    obj = add_mesh("Head", SQUARE, [(0, 1, 2, 3)])
    obj.location, obj.scale = (5, 0, 0), (2, 2, 2)
    obj.data.materials.append(bpy.data.materials.new("Skin"))
    obj.data.materials.append(bpy.data.materials.new("Strands"))
    add_hair(obj, material=2, display_step=2, use_close_tip=False)
    session, _, result = synchronise(viewport=True)
    assert result.warnings == []
    hair = session.mesh(obj.particle_systems[0].name)
    keys = 2**2 + 1
    assert hair["curve_starts"].tolist() == [keys * i for i in range(6)]
    positions = hair["positions"].reshape(5, keys, 3)
    assert positions.dtype == np.float32
    # In the object's own space: the square is one unit wide, hair stands along its normal.
    assert (positions[..., :2] > -0.001).all() and (positions[..., :2] < 1.001).all()
    length = attributes(hair)["@length"][2]
    assert np.allclose(length, positions[:, -1, 2], atol=1e-4) and (length > 0.5).all()
    assert np.allclose(hair["radii"].reshape(5, keys)[0], np.linspace(0.05, 0.025, keys), atol=5e-4)
    assert np.allclose(attributes(hair)["@intercept"][2].reshape(5, keys)[2], np.linspace(0, 1, keys), atol=0.02)
    random = attributes(hair)["@random"][2]
    assert random[0] == pytest.approx(0.8603128, abs=1e-6)
    assert len(set(random.tolist())) == 5
    assert hair["curve_shape"] == "ribbon" and hair["curve_subdivisions"] == 2
    sets = [session.objects["material_sets"][i] for i in session.objects["material_set"]]
    names = [[session.shaders[h][0] for h in handles] for handles in sets]
    assert names == [["Material 'Skin'", "Material 'Strands'"], ["Material 'Strands'"]]
    assert len(session.objects["mesh"]) == 2


def test_short_children_end_where_they_are_cut(empty_scene: Any) -> None:
    """Blender has no keys for the rest, and answers zeros."""
    obj = add_mesh("Head", SQUARE, [(0, 1, 2, 3)])
    obj.location = (5, 0, 0)
    settings = add_hair(obj, child_type="INTERPOLATED", display_step=3, child_length=0.45)
    setattr(settings, "child_nbr" if hasattr(settings, "child_nbr") else "child_percent", 20)
    hair = synchronise(viewport=True)[0].mesh(obj.particle_systems[0].name)
    keys = np.diff(hair["curve_starts"])
    assert len(keys) > 50 and keys.min() < 9
    # A strand that went to the world's origin would leave the square's five units away.
    assert (hair["positions"][:, 0] > -0.5).all()
    assert attributes(hair)["@length"][2].max() < 2.1


def test_hair_is_left_out_where_it_is_hidden(empty_scene: Any) -> None:
    obj = add_mesh("Head", SQUARE, [(0, 1, 2, 3)])
    add_hair(obj)
    layer = bpy.context.view_layer
    layer.use_strand = False
    assert len(synchronise()[0].objects["mesh"]) == 1
    layer.use_strand, layer.use_solid = True, False
    session, _, _ = synchronise()
    assert len(session.objects["mesh"]) == 1
    assert "radii" in session.mesh(obj.particle_systems[0].name)
    layer.use_solid = True
    obj.particle_systems[0].settings.render_type = "NONE"
    assert len(synchronise()[0].objects["mesh"]) == 1


def test_hair_gets_its_emitters_coordinates(empty_scene: Any) -> None:
    obj = add_mesh("Head", SQUARE, [(0, 1, 2, 3)])
    layer = obj.data.uv_layers.new(name="Map")
    layer.data.foreach_set("uv", np.array([0, 0, 1, 0, 1, 1, 0, 1], np.float32))
    obj.data.materials.append(shader_reading("Map"))
    add_hair(obj)
    session, _, _ = synchronise(viewport=True)
    hair = session.mesh(obj.particle_systems[0].name)
    domain, _, uv = attributes(hair)["Map"]
    roots = hair["positions"][hair["curve_starts"][:-1]]
    assert domain == "FACE"
    assert np.allclose(uv, roots[:, :2], atol=1e-3)


def test_points(empty_scene: Any) -> None:
    obj = add_mesh("Cloud", [(0, 0, 0), (1, 0, 0), (0, 2, 0)], [(0, 1, 2)])
    points_of(obj, 0.25)
    session, _, result = synchronise()
    assert result.warnings == []
    (mesh,) = session.meshes.values()
    arrays = mesh[1]
    assert "curve_starts" not in arrays
    assert sorted(map(tuple, arrays["positions"].tolist())) == [(0, 0, 0), (0, 2, 0), (1, 0, 0)]
    assert arrays["radii"].tolist() == [0.25] * 3
    assert len(attributes(arrays)["@random"][2]) == 3


@pytest.mark.skipif(bpy.app.version < (4, 3, 0), reason="Python cannot make Curves before 4.x")
def test_curves(empty_scene: Any) -> None:
    data = bpy.data.hair_curves.new("Strands")
    data.add_curves([3, 2])
    positions = np.array([[0, 0, 0], [0, 0, 1], [0, 0, 3], [1, 0, 0], [1, 2, 0]], np.float32)
    data.points.foreach_set("position", positions.ravel())
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("Strands", data))
    session, _, result = synchronise()
    assert result.warnings == []
    arrays = session.mesh("Strands")
    assert arrays["curve_starts"].tolist() == [0, 3, 5]
    assert np.array_equal(arrays["positions"], positions)
    values = attributes(arrays)
    assert values["@length"][2].tolist() == [3, 2]
    assert np.allclose(values["@intercept"][2], [0, 1 / 3, 1, 0, 1])
    assert len(arrays["radii"]) == 5


def test_a_renderer_takes_them(empty_scene: Any, tmp_path: Any) -> None:
    scene = bpy.context.scene
    obj = add_mesh("Head", SQUARE, [(0, 1, 2, 3)])
    add_hair(obj)
    cloud = add_mesh("Cloud", [(0, 0, 1), (1, 0, 1)], [])
    points_of(cloud, 0.2)
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.location = (0.5, 0.5, 6)
    scene.collection.objects.link(camera)
    scene.camera = camera
    scene.render.engine = "TALBOT"
    scene.render.resolution_x = scene.render.resolution_y = 16
    scene.cycles.samples = 1
    scene.render.filepath = str(tmp_path / "out.png")
    assert bpy.ops.render.render(write_still=True) == {"FINISHED"}
