"""Light and shadow linking (4.0 and newer): the same objects are lit, and cast shadows, in Cycles and in Talbot."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from pair_scenes import (
    add_box,
    add_lamp,
    add_mesh,
    add_object,
    add_plane,
    add_sphere,
    diffuse,
    glow,
    look_at,
    material,
    set_world,
)
from pairs import Bounds, agree
from test_pairs_strands import points_group

pytestmark = pytest.mark.skipif(bpy.app.version < (4, 0, 0), reason="Blender has no light linking")
Members = Sequence[tuple[Any, str]]


def linking(members: Members, children: Sequence[tuple[Sequence[Any], str]] = ()) -> Any:
    """A linking collection of objects, and of collections, with the state of each."""
    collection = bpy.data.collections.new("Linking")
    for obj, state in members:
        collection.objects.link(obj)
        collection.collection_objects[-1].light_linking.link_state = state
    for objects, state in children:
        child = bpy.data.collections.new("Child")
        for obj in objects:
            child.objects.link(obj)
        collection.children.link(child)
        collection.collection_children[-1].light_linking.link_state = state
    return collection


def row_of_things(scene: Any) -> list[Any]:
    """A matt ball, a glossy box, a mirror ball and a matt box on the ground."""
    look_at(scene, (0.0, -5.0, 3.0), (0.0, 0.0, 0.3), 40.0)
    ground = add_plane(diffuse(), 8.0)
    rough = material(lambda tree: tree("BsdfGlossy", Roughness=0.4))
    mirror = material(lambda tree: tree("BsdfGlossy", Roughness=0.0))
    return [
        add_sphere(diffuse((0.8, 0.4, 0.3)), 0.4, location=(-1.5, 0.0, 0.4)),
        add_box(rough, (0.6, 0.6, 0.6), location=(-0.5, 0.0, 0.3)),
        add_sphere(mirror, 0.4, location=(0.5, 0.0, 0.4)),
        add_box(diffuse((0.3, 0.4, 0.8)), (0.6, 0.6, 0.6), location=(1.5, 0.0, 0.3)),
        ground,
    ]


def emitters() -> list[Any]:
    """A lamp of each kind and an emissive mesh, none of them seen by the camera."""
    lamps = [
        add_lamp("POINT", 60, (-1.5, -1.0, 2.0), shadow_soft_size=0.2),
        add_lamp("SPOT", 100, (0.0, -1.5, 2.5), toward=(0.0, 0.0, 0.0), shadow_soft_size=0.1, spot_size=1.2),
        add_lamp("AREA", 40, (1.5, -1.0, 2.0), toward=(1.0, 0.0, 0.0), shape="DISK", size=0.8),
        add_lamp("SUN", 0.5, (0.0, 0.0, 5.0), toward=(1.0, 1.0, 0.0), angle=0.3),
    ]
    panel = add_mesh(
        [(-0.6, 1.6, 1.0), (-0.6, 1.4, 2.0), (0.5, 1.4, 2.0), (0.6, 1.6, 1.0)],
        [(0, 1, 2, 3)],
        glow((1.0, 0.8, 0.4), 4.0),
    )
    panel.visible_camera = False
    return [*lamps, panel]


@pytest.mark.parametrize("world", [False, True])
def test_receivers(pair_scene: Any, tmp_path: Path, world: bool) -> None:
    """Each emitter with receivers of its own: included, excluded, by a child collection, instanced."""
    things, lights = row_of_things(pair_scene), emitters()
    ball, box, mirror, other, ground = things
    instance = add_object(None, (0.5, -1.2, 0.0))
    instanced = bpy.data.collections.new("Instanced")
    instanced.objects.link(other)
    instance.instance_type, instance.instance_collection, instance.scale = "COLLECTION", instanced, (0.5, 0.5, 0.5)
    lights[0].light_linking.receiver_collection = linking([(ball, "INCLUDE"), (ground, "INCLUDE")])
    lights[1].light_linking.receiver_collection = linking([(ground, "EXCLUDE")])
    lights[2].light_linking.receiver_collection = linking([(mirror, "EXCLUDE")], [((mirror, other, ground), "INCLUDE")])
    lights[3].light_linking.receiver_collection = linking([(instance, "INCLUDE"), (box, "INCLUDE")])
    lights[4].light_linking.receiver_collection = linking([(box, "EXCLUDE")])
    if world:
        set_world(pair_scene, build=lambda tree: tree("TexGradient", Vector=tree("TexCoord").outputs["Generated"]))
    pair_scene.cycles.max_bounces, pair_scene.cycles.caustics_reflective = 2, False
    agree(pair_scene, tmp_path, samples=1024, bounds=Bounds(0.02, 0.1))


def test_blockers(pair_scene: Any, tmp_path: Path) -> None:
    """Emitters whose shadows some objects alone cast, one of them transparent."""
    things, lights = row_of_things(pair_scene), emitters()
    ball, box, mirror, other, _ = things
    mirror.data.materials[0] = material(lambda tree: tree("BsdfTransparent", Color=(0.8, 0.5, 0.2)))
    lights[0].light_linking.blocker_collection = linking([(ball, "INCLUDE")])
    lights[1].light_linking.blocker_collection = linking([(box, "EXCLUDE")])
    lights[2].light_linking.blocker_collection = linking([(mirror, "INCLUDE"), (other, "INCLUDE")])
    lights[3].light_linking.blocker_collection = linking([(ball, "INCLUDE"), (mirror, "INCLUDE")])
    lights[4].light_linking.blocker_collection = linking([(box, "EXCLUDE")])
    pair_scene.cycles.max_bounces = 1
    agree(pair_scene, tmp_path, samples=128, bounds=Bounds(0.02, 0.1))


@pytest.mark.parametrize("roughness", [0.0, 0.15, 0.4])
def test_blockers_in_mirrors(pair_scene: Any, tmp_path: Path, roughness: float) -> None:
    """What rays that are scattered find of such emitters: by their blockers, and by what no collection names."""
    things, lights = row_of_things(pair_scene), emitters()
    ball, box, mirror, other, ground = things
    for thing in (box, mirror, ground):
        thing.data.materials[0] = material(lambda tree: tree("BsdfGlossy", Roughness=roughness))
    sheet = add_plane(
        material(lambda tree: tree("BsdfTransparent", Color=(0.3, 0.6, 0.9))), 1.5, location=(-1.0, 0, 1.2)
    )
    wall = add_plane(diffuse(), 1.0, location=(1.2, 0.6, 1.1), rotation=(0.6, 0.0, 0.0))
    unnamed = add_plane(diffuse(), 0.7, location=(0.0, 0.4, 1.3), rotation=(0.6, 0.0, 0.0))
    for thing in (sheet, wall, unnamed):
        thing.visible_camera = False
    lights[0].light_linking.blocker_collection = linking([(ball, "INCLUDE"), (sheet, "INCLUDE")])
    lights[1].light_linking.blocker_collection = linking([(box, "EXCLUDE"), (wall, "EXCLUDE")])
    lights[2].light_linking.blocker_collection = linking([(wall, "INCLUDE"), (other, "INCLUDE")])
    lights[3].light_linking.blocker_collection = linking([(ball, "INCLUDE"), (mirror, "INCLUDE")])
    lights[4].light_linking.blocker_collection = linking([(wall, "EXCLUDE")])
    lights[4].light_linking.receiver_collection = linking([(box, "EXCLUDE")])
    pair_scene.cycles.max_bounces, pair_scene.cycles.caustics_reflective = 2, False
    agree(pair_scene, tmp_path, samples=256, bounds=Bounds(0.02, 0.15))


def test_emissive_strands_with_blockers(pair_scene: Any, tmp_path: Path) -> None:
    """Points and curves that emit, as shadow linking has them: light samples do not find them."""
    curves = bpy.data.hair_curves.new("Curves")
    if not hasattr(curves, "add_curves"):
        pytest.skip("scripts make curves from 4.3 on")
    item = glow((0.3, 0.6, 1.0), 4.0)
    dots = add_mesh([(0.5, 0.5, 1.5), (1.2, 0.0, 1.4)], [], item)
    size = dots.data.attributes.new("size", "FLOAT", "POINT")
    size.data.foreach_set("value", [0.3, 0.25])
    dots.modifiers.new("Points", "NODES").node_group = points_group(item)
    look_at(pair_scene, (0.0, -5.0, 3.0), (0.0, 0.0, 0.3), 40.0)
    add_plane(diffuse(), 8.0)
    ball = add_sphere(diffuse(), 0.4, location=(-0.8, 0.0, 0.4))
    add_sphere(material(lambda tree: tree("BsdfGlossy")), 0.4, location=(0.8, 0.0, 0.4))
    roof = add_plane(diffuse(), 1.5, location=(-0.6, 0.0, 1.1))
    roof.visible_camera = False
    curves.add_curves([4])
    curves.points.foreach_set("position", np.linspace((-1.4, 0.6, 1.6), (0.0, 0.6, 1.6), 4).astype(np.float32).ravel())
    radius = curves.attributes.get("radius") or curves.attributes.new("radius", "FLOAT", "POINT")
    radius.data.foreach_set("value", [0.0, 0.2, 0.2, 0.0])
    curves.materials.append(glow((1.0, 0.7, 0.3), 4.0))
    for obj in (add_object(curves), dots):
        obj.visible_camera = False
        obj.light_linking.blocker_collection = linking([(ball, "INCLUDE"), (roof, "EXCLUDE")])
    pair_scene.cycles_curves.shape = "THICK"
    pair_scene.cycles.max_bounces = 1
    agree(pair_scene, tmp_path, samples=512, bounds=Bounds(0.03, 0.15))


def test_both_together(pair_scene: Any, tmp_path: Path) -> None:
    things, lights = row_of_things(pair_scene), emitters()
    for number, light in enumerate(lights):
        light.light_linking.receiver_collection = linking([(things[number - 1], "EXCLUDE")])
        light.light_linking.blocker_collection = linking([(things[number], "INCLUDE")])
    pair_scene.cycles.max_bounces = 1
    things[2].hide_render = True
    agree(pair_scene, tmp_path, samples=128, bounds=Bounds(0.02, 0.1))
