"""Scenes that something is wrong with, or too much of: right or said, never a crash."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from pair_scenes import add_box, add_mesh, add_object, add_plane, diffuse, glow, look_down, material
from sync_recorder import synchronise
from test_addon_pictures import lines, picture, scene

__all__ = ["scene"]


def finite(item: bpy.types.Scene) -> None:
    assert np.isfinite(picture(item)).all()


def test_ten_thousand_materials(scene: bpy.types.Scene) -> None:
    """Each on a face of its own. (From 5.0 on Blender itself takes long to make so many: fewer.)"""
    side = 100 if bpy.app.version < (5, 0, 0) else 50
    count = side * side
    vertices = [(x, y, 0) for y in range(side + 1) for x in range(side + 1)]
    first = [y * (side + 1) + x for y in range(side) for x in range(side)]
    obj = add_mesh(vertices, [(a, a + 1, a + side + 2, a + side + 1) for a in first], diffuse())
    for number in range(count):
        item = bpy.data.materials.new(f"M{number:05}")
        item.use_nodes = False
        item.diffuse_color = (number / count, 0.5, 0.5, 1.0)
        obj.data.materials.append(item)
    obj.data.polygons.foreach_set("material_index", np.arange(count, dtype=np.int32))
    look_down(scene, side).location.xy = (side / 2, side / 2)
    finite(scene)
    assert not lines(scene)


@pytest.mark.parametrize("name", ["Würfel", "立方体", "مكعب", "🦊 'a' \"b\" {c} %d\\n", "x" * 63])
def test_names_in_any_script(scene: bpy.types.Scene, name: str) -> None:
    cube = bpy.data.objects["Cube"]
    for item in (cube, cube.data, cube.data.materials[0], bpy.data.objects["Light"], scene, scene.view_layers[0]):
        item.name = name
    session, _, _ = synchronise()
    assert cube.name in session.objects["names"]
    finite(scene)


def test_instances_of_nothing(scene: bpy.types.Scene) -> None:
    """Collections of empties, an empty collection, a mesh without faces that instances on its faces."""
    empties, nothing = bpy.data.collections.new("Empties"), bpy.data.collections.new("Nothing")
    empties.objects.link(bpy.data.objects.new("Empty", None))
    for inner in (empties, nothing):
        outer = add_object(None)
        outer.instance_type, outer.instance_collection = "COLLECTION", inner
    dots = add_mesh([(0, 0, 0), (1, 0, 0)], [], None)
    dots.instance_type = "FACES"
    add_object(None).parent = dots
    before = picture(scene)
    assert np.isfinite(before).all()
    session, _, _ = synchronise()
    assert len(session.objects["mesh"]) == 1, "the cube alone"


def test_hair_of_no_length(scene: bpy.types.Scene) -> None:
    cube = bpy.data.objects["Cube"]
    cube.modifiers.new("Hair", "PARTICLE_SYSTEM")
    settings = cube.particle_systems[0].settings
    settings.type, settings.count, settings.hair_length = "HAIR", 5, 0.001
    settings.root_radius = settings.tip_radius = 0.0
    finite(scene)


def test_curves_of_no_length(scene: bpy.types.Scene) -> None:
    """All keys in one place, a single key, keys and radii that are no numbers."""
    curves = bpy.data.hair_curves.new("Curves")
    if not hasattr(curves, "add_curves"):
        pytest.skip("scripts make curves from 4.3 on")
    curves.add_curves([4, 1, 3, 3])
    places = np.zeros((11, 3), np.float32)
    places[5:] = np.arange(6)[:, None] * 0.1
    places[6, 1], places[9, 2] = np.nan, np.inf
    curves.points.foreach_set("position", places.ravel())
    radius = curves.attributes.get("radius") or curves.attributes.new("radius", "FLOAT", "POINT")
    radius.data.foreach_set("value", np.array([0.1] * 8 + [np.nan, -1.0, 0.0], np.float32))
    add_object(curves)
    finite(scene)


@pytest.mark.parametrize("kind", ["FLOAT", "FLOAT_VECTOR", "FLOAT_COLOR", "FLOAT2"])
def test_attributes_that_are_no_numbers(scene: bpy.types.Scene, kind: str) -> None:
    mesh = bpy.data.objects["Cube"].data
    attribute = mesh.attributes.new("bad", kind, "CORNER" if kind == "FLOAT2" else "POINT")
    field, width = {"FLOAT": ("value", 1), "FLOAT_COLOR": ("color", 4)}.get(
        kind, ("vector", 2 if kind == "FLOAT2" else 3)
    )
    values = np.ones(len(attribute.data) * width, np.float32)
    values[::3], values[1::3] = np.nan, np.inf
    attribute.data.foreach_set(field, values)
    mesh.materials[0] = material(lambda tree: tree("Attribute", attribute_name="bad").outputs["Color"])
    finite(scene)


def test_one_mesh_with_two_modifiers(empty_scene: Any) -> None:
    """Objects of the same data differ where their modifiers do, and share it where they have none."""
    boxes = [add_box(diffuse(), location=(2 * number, 0, 0)) for number in range(4)]
    for box in boxes[1:]:
        box.data = boxes[0].data
    boxes[0].modifiers.new("Array", "ARRAY").count = 3
    boxes[1].modifiers.new("Subdivide", "SUBSURF").levels = 1
    session, _, _ = synchronise()
    names = [session.objects["names"][index] for index in session.objects["name"]]
    handles = dict(zip(names, session.objects["mesh"].tolist(), strict=True))
    faces = [len(session.meshes[handles[box.name]][1]["triangle_corners"]) for box in boxes]
    assert handles[boxes[2].name] == handles[boxes[3].name]
    assert faces == [3 * faces[2], 4 * faces[2], faces[2], faces[2]]


def test_overrides_of_a_library_that_is_gone(scene: bpy.types.Scene, tmp_path: Path) -> None:
    """What was linked is missing, what is local renders; Blender itself says what it did not find."""
    library, path = tmp_path / "library.blend", tmp_path / "scene.blend"
    collection = bpy.data.collections.new("Linked")
    box = add_box(glow(), location=(1, 0, 0))
    scene.collection.objects.unlink(box)
    collection.objects.link(box)
    bpy.data.libraries.write(str(library), {collection})
    bpy.data.collections.remove(collection)
    bpy.data.objects.remove(box)
    with bpy.data.libraries.load(str(library), link=True) as (_, wanted):
        wanted.collections = ["Linked"]
    wanted.collections[0].override_hierarchy_create(scene, bpy.context.view_layer)
    add_plane(diffuse(), 2.0)
    look_down(scene, 3.0)
    bpy.ops.wm.save_as_mainfile(filepath=str(path), check_existing=False)
    library.unlink()
    bpy.ops.wm.open_mainfile(filepath=str(path), load_ui=False)
    finite(bpy.context.scene)
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)


def test_deleted_and_renamed_between_frames(scene: bpy.types.Scene) -> None:
    """With persistent data; what has gone is gone, what is new is there."""
    scene.render.use_persistent_data = True
    cube = bpy.data.objects["Cube"]
    other = add_box(diffuse(), location=(3, 0, 0))
    finite(scene)
    cube.name, name = "Renamed", cube.name
    other.name = name
    finite(scene)
    bpy.data.objects.remove(cube)
    bpy.data.meshes.remove(other.data)
    finite(scene)
    add_box(diffuse())
    finite(scene)
    scene.render.use_persistent_data = False
