"""View layers, panoramas and portals show the same in Cycles and in Talbot."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from pair_scenes import (
    Tree,
    add_box,
    add_lamp,
    add_mesh,
    add_plane,
    add_sphere,
    diffuse,
    glow,
    grid,
    image_of,
    look_at,
    look_down,
    material,
    set_world,
)
from pairs import Bounds, agree, render, stacked

PANORAMAS: dict[str, dict[str, float]] = {
    "EQUIRECTANGULAR": {"latitude_min": -0.6, "latitude_max": 1.2, "longitude_min": -1.5, "longitude_max": 2.5},
    "EQUIANGULAR_CUBEMAP_FACE": {},
    "MIRRORBALL": {},
    "FISHEYE_EQUIDISTANT": {"fisheye_fov": 2.8},
    "FISHEYE_EQUISOLID": {"fisheye_fov": 3.0, "fisheye_lens": 9.0},
    "FISHEYE_LENS_POLYNOMIAL": {"fisheye_fov": 3.0, "fisheye_polynomial_k1": -0.05, "fisheye_polynomial_k3": 1e-5},
    "CENTRAL_CYLINDRICAL": {"central_cylindrical_range_v_min": -0.8, "central_cylindrical_range_u_max": 2.0},
}


def court(scene: Any) -> Any:
    """Glowing things all around the camera: no light is sampled, so only the camera makes noise."""
    pixels = np.ones((8, 8, 4))
    pixels[..., :3] = np.where((np.indices((8, 8)).sum(0) % 2)[..., None], (0.9, 0.7, 0.5), (0.1, 0.2, 0.4))
    image = image_of(pixels)
    add_plane(material(lambda tree: tree("TexImage", image=image, interpolation="Closest")), 8.0)
    places = ((0, 3, 1), (2.5, 1, 0.5), (-2, -2, 1.5), (1.5, -2.5, 1), (-3, 0.5, 0.5), (0.5, 0.5, 3))
    for number, place in enumerate(places):
        color = [0.3, 0.3, 0.3]
        color[number % 3] = 2.0 + number
        add_sphere(glow(color), 0.6, location=place)
    set_world(scene, (0.3, 0.5, 0.8))
    scene.cycles.max_bounces = 0
    return look_at(scene, (0.0, 0.0, 1.0), (0.0, 3.0, 1.2))


@pytest.mark.parametrize("kind", PANORAMAS)
def test_panoramas(pair_scene: Any, tmp_path: Path, kind: str) -> None:
    """The settings are the camera's own in newer versions, Cycles' in older ones; some kinds are newer than 3.4."""
    camera = court(pair_scene).data
    holder = camera if hasattr(camera, "panorama_type") else camera.cycles
    camera.type = "PANO"
    if kind not in holder.bl_rna.properties["panorama_type"].enum_items.keys():
        pytest.skip("not in this Blender")
    holder.panorama_type = kind
    for name, value in PANORAMAS[kind].items():
        setattr(holder, name, value)
    pair_scene.render.resolution_x, pair_scene.render.resolution_y = 40, 28
    agree(pair_scene, tmp_path, samples=64, batches=8, bounds=Bounds(0.01, 0.06))


@pytest.mark.parametrize("kind", PANORAMAS)
def test_window_of_panoramas(pair_scene: Any, tmp_path: Path, kind: str) -> None:
    """The place in the picture, as a ball and the sky show it."""
    camera = look_at(pair_scene, (0.0, 0.0, 1.0), (0.0, 3.0, 1.2)).data
    holder = camera if hasattr(camera, "panorama_type") else camera.cycles
    camera.type = "PANO"
    if kind not in holder.bl_rna.properties["panorama_type"].enum_items.keys():
        pytest.skip("not in this Blender")
    if kind == "FISHEYE_LENS_POLYNOMIAL" and bpy.app.version < (4, 0, 0):
        pytest.skip("its inverse is an approximation there")
    holder.panorama_type = kind
    for name, value in PANORAMAS[kind].items():
        setattr(holder, name, value)
    add_sphere(material(lambda tree: tree("TexCoord").outputs["Window"]), 1.5, location=(0.0, 3.0, 1.0))
    set_world(pair_scene, build=lambda tree: tree("TexCoord").outputs["Window"])
    pair_scene.render.resolution_x, pair_scene.render.resolution_y = 40, 28
    pair_scene.cycles.filter_width = 0.01
    agree(pair_scene, tmp_path, samples=16, batches=8, bounds=Bounds(0.01, 0.06))


def in_collection(scene: Any, obj: Any) -> Any:
    """A collection of the scene with this object in it alone; returns its layer collection."""
    collection = bpy.data.collections.new("Pair")
    scene.collection.children.link(collection)
    collection.objects.link(obj)
    scene.collection.objects.unlink(obj)
    return scene.view_layers[0].layer_collection.children[collection.name]


def stage(scene: Any) -> list[Any]:
    """A ball and a box on the ground, a mirror behind them, a lamp and the sky."""
    look_at(scene, (0.0, -5.0, 2.0), (0.0, 0.0, 0.5), 40.0)
    ground = add_plane(diffuse(), 8.0)
    mirror = add_plane(material(lambda tree: tree("BsdfGlossy", Roughness=0.0)), 3.0, location=(0.0, 1.5, 1.0))
    mirror.rotation_euler = (1.5, 0.0, 0.2)
    ball = add_sphere(diffuse((0.8, 0.3, 0.2)), 0.5, location=(-0.7, 0.0, 0.5))
    box = add_box(diffuse((0.2, 0.4, 0.8)), (0.7, 0.7, 0.7), location=(0.7, 0.1, 0.35))
    add_lamp("AREA", 80, (2.0, -2.0, 3.0), toward=(0.0, 0.0, 0.0), shape="SQUARE", size=0.7)
    set_world(scene, (0.2, 0.25, 0.3))
    scene.cycles.max_bounces, scene.cycles.caustics_reflective = 2, False
    return [ball, box, mirror, ground]


@pytest.mark.parametrize("what", ["exclude", "holdout", "indirect_only"])
def test_collections_of_a_layer(pair_scene: Any, tmp_path: Path, what: str) -> None:
    ball = stage(pair_scene)[0]
    setattr(in_collection(pair_scene, ball), what, True)
    pair_scene.render.film_transparent = what == "holdout"
    agree(pair_scene, tmp_path, samples=512, bounds=Bounds(0.01, 0.06))


@pytest.mark.parametrize("what", ["material", "world", "samples", "use_sky", "use_solid"])
def test_overrides_of_a_layer(pair_scene: Any, tmp_path: Path, what: str) -> None:
    """What a layer replaces or leaves out. A layer's samples: the noise differs, the mean does not."""
    stage(pair_scene)
    layer = pair_scene.view_layers[0]
    if what == "material":
        layer.material_override = diffuse((0.6, 0.7, 0.3))
    elif what == "world":
        if not hasattr(layer, "world_override"):
            pytest.skip("not in this Blender")
        own = pair_scene.world
        layer.world_override = set_world(pair_scene, (0.6, 0.2, 0.1))
        pair_scene.world = own
    elif what == "samples":
        layer.samples = 400
    else:
        setattr(layer, what, False)
    agree(pair_scene, tmp_path, samples=512, bounds=Bounds(0.01, 0.06))


def test_background_scene(pair_scene: Any, tmp_path: Path) -> None:
    """Objects and lamps of another scene behind this one; its world does not count."""
    other = bpy.data.scenes.new("Set")
    for obj in stage(pair_scene)[1:]:
        pair_scene.collection.objects.unlink(obj)
        other.collection.objects.link(obj)
    lamp = add_lamp("POINT", 60, (-2.0, -1.0, 2.0), shadow_soft_size=0.3)
    pair_scene.collection.objects.unlink(lamp)
    other.collection.objects.link(lamp)
    own = pair_scene.world
    other.world = set_world(pair_scene, (3.0, 0.1, 0.1))
    pair_scene.world, pair_scene.background_set = own, other
    agree(pair_scene, tmp_path, samples=512, bounds=Bounds(0.01, 0.06))


def test_portals(pair_scene: Any, tmp_path: Path) -> None:
    """A room with one window, and a portal in it: light of the sky, however it is sampled."""
    look_at(pair_scene, (0.0, -1.4, 1.0), (0.0, 1.0, 0.8), 20.0)
    white = diffuse(0.7)
    room = add_box(white, (3.0, 3.0, 2.0), inside=True, location=(0.0, 0.0, 1.0)).data
    room.materials.append(material(lambda tree: tree("BsdfTransparent")))
    room.polygons[1].material_index = 1
    add_sphere(diffuse((0.8, 0.4, 0.2)), 0.4, location=(0.3, 0.4, 0.4))
    frame = ((1.48, -1.5, 0), (1.48, -1.5, 2), (1.48, 0.3, 2), (1.48, 0.3, 0))
    add_mesh(frame, [(0, 1, 2, 3)], white)
    portal = add_lamp("AREA", 1.0, (1.45, 0.9, 1.0), toward=(-1.0, 0.9, 1.0), shape="RECTANGLE", size=2.0, size_y=1.2)
    portal.data.cycles.is_portal = True
    pixels = np.ones((16, 32, 4))
    pixels[..., :3] = np.linspace(0.2, 2.0, 32)[None, :, None]
    set_world(pair_scene, build=lambda tree: tree("TexEnvironment", image=image_of(pixels)))
    pair_scene.cycles.max_bounces = 1
    agree(pair_scene, tmp_path, samples=256, bounds=Bounds(0.02, 0.1))


def write_aov(tree: Any, name: str, **values: Any) -> Any:
    """An AOV Output node; in 3.4 its name is the AOV's."""
    node = tree("OutputAOV", **values)
    if hasattr(node, "aov_name"):
        node.aov_name = name
    else:
        node.name = name
    return node


def aov_material(alpha: float, muted: bool = False, grouped: bool = False, twice: bool = False) -> Any:
    """Writes the colour and the value; `alpha` of it is opaque."""

    def build(tree: Any) -> Any:
        place = tree("NewGeometry").outputs["Position"]
        write_aov(tree, "Colour", Color=place).mute = muted
        write_aov(tree, "Number", Value=tree("LightPath").outputs["Ray Depth"])
        write_aov(tree, "Number", Value=2.5)
        if twice:
            write_aov(tree, "Colour", Color=(0.5, 0.25, 0.125))
        if grouped:
            group = bpy.data.node_groups.new("Group", "ShaderNodeTree")
            write_aov(Tree(group), "Colour", Color=(1.0, 2.0, 3.0))
            tree.tree.nodes.new("ShaderNodeGroup").node_tree = group
        clear = tree("BsdfTransparent", Color=(0.9, 0.6, 0.3))
        return tree("MixShader", in0=alpha, in1=clear, in2=tree("BsdfDiffuse"))

    return material(build)


@pytest.mark.parametrize("film_transparent", [False, True])
def test_aovs(pair_scene: Any, tmp_path: Path, film_transparent: bool) -> None:
    """Written by all that a camera ray meets up to the first surface that is more opaque than not, and by the world."""
    look_down(pair_scene, 4)
    layer = pair_scene.view_layers[0]
    for name, kind in (("Colour", "COLOR"), ("Number", "VALUE"), ("Unused", "COLOR")):
        aov = layer.aovs.add()
        aov.name, aov.type = name, kind
    places = grid(16, 4)
    opaque = aov_material(1.0)
    for place, alpha in zip(places[:8], (0.0, 0.1, 0.1, 0.3, 0.7, 0.7, 0.9, 1.0), strict=True):
        add_plane(aov_material(alpha), location=place)
        if alpha in (0.0, 0.1, 0.7):
            add_plane(opaque, 0.5, location=(place[0], place[1], -1.0))
    more = ({"muted": True}, {"grouped": True}, {"twice": True})
    for place, values in zip(places[8:11], more, strict=True):
        add_plane(aov_material(1.0, **values), location=place)
    add_plane(diffuse(), location=places[11])

    def world(tree: Any) -> Any:
        write_aov(tree, "Colour", Color=(7.0, 8.0, 9.0))
        write_aov(tree, "Number", Value=5.0)
        return tree("Background", Color=(0.5, 0.2, 0.1))

    set_world(pair_scene, build=world)
    pair_scene.render.film_transparent = film_transparent
    pair_scene.cycles.film_exposure = 2.0
    pair_scene.cycles.max_bounces = 1
    names = ("Combined", "Colour", "Number")
    agree(pair_scene, tmp_path, samples=128, passes=names, bounds=Bounds(0.02, 0.1))
    passes = render(pair_scene, "TALBOT", 0, tmp_path / "one.exr")
    assert not stacked(passes, "Unused").any(), "registered, though nothing writes it"


def test_light_groups(pair_scene: Any, tmp_path: Path) -> None:
    """Lamps, a sun with a disc, emissive meshes and the world, found by light samples, by chance and by the camera;
    instances are from 4.2 on in their instancer's group where they have none; what is in none, or in one that the
    layer has not, is in the picture only."""
    look_at(pair_scene, (0.0, -5.0, 2.0), (0.0, 0.0, 0.5), 40.0)
    layer = pair_scene.view_layers[0]
    for name in ("Key", "Rest of it", "Sky", "Empty"):
        layer.lightgroups.add(name=name)
    add_plane(diffuse(), 8.0)
    mirror = add_plane(material(lambda tree: tree("BsdfGlossy", Roughness=0.1)), 3.0, location=(0.0, 1.5, 1.0))
    mirror.rotation_euler = (1.5, 0.0, 0.2)
    add_box(diffuse((0.2, 0.4, 0.8)), (0.7, 0.7, 0.7), location=(0.7, 0.1, 0.35))
    lamps = (
        add_lamp("AREA", 80, (2.0, -2.0, 3.0), toward=(0.0, 0.0, 0.0), shape="SQUARE", size=0.7),
        add_lamp("POINT", 60, (-2.0, -1.0, 2.0), shadow_soft_size=0.3),
        add_lamp("SUN", 0.5, (0.0, 0.0, 3.0), toward=(0.5, 0.6, 0.0), angle=0.3),
        add_lamp("SPOT", 90, (0.0, -2.0, 2.0), toward=(0.0, 0.0, 0.0), shadow_soft_size=0.1),
    )
    for lamp, name in zip(lamps, ("Key", "Rest of it", "Sky", "Of another layer"), strict=True):
        lamp.lightgroup = name
    for number, name in enumerate(("Rest of it", "", "Key")):
        add_sphere(glow((2.0, 1.0 + number, 0.5)), 0.2, location=(number - 1.5, -0.5, 0.3)).lightgroup = name
    for name, place in (("", (-1.2, 0.5, 1.2)), ("Rest of it", (1.2, 0.5, 1.2))):
        inside = add_sphere(glow((0.5, 1.5, 3.0)), 0.2, location=(0.0, 0.0, 0.0))
        inside.lightgroup = name
        collection = bpy.data.collections.new("Instanced")
        collection.objects.link(inside)
        pair_scene.collection.objects.unlink(inside)
        instancer = bpy.data.objects.new("Instancer", None)
        instancer.instance_type, instancer.instance_collection = "COLLECTION", collection
        instancer.location, instancer.lightgroup = place, "Key"
        pair_scene.collection.objects.link(instancer)
    set_world(pair_scene, (0.2, 0.25, 0.3)).lightgroup = "Sky"
    pair_scene.cycles.max_bounces, pair_scene.cycles.film_exposure = 2, 1.5
    passes = ("Combined", "Combined_Key", "Combined_Rest of it", "Combined_Sky")
    agree(pair_scene, tmp_path, samples=1024, passes=passes, bounds=Bounds(0.01, 0.1))
    assert not stacked(render(pair_scene, "TALBOT", 0, tmp_path / "one.exr"), "Combined_Empty").any()


@pytest.mark.parametrize("threshold", [0.0, 0.2, 0.8])
def test_data_passes_behind_clear_surfaces(pair_scene: Any, tmp_path: Path, threshold: float) -> None:
    """The first surface that is as opaque as the layer asks. Cycles lets more light pass at random
    through what is nearly opaque: all that decides here."""
    look_down(pair_scene, 4)
    layer = pair_scene.view_layers[0]
    layer.pass_alpha_threshold = threshold
    for name in ("z", "normal", "uv", "object_index", "material_index", "mist"):
        setattr(layer, f"use_pass_{name}", True)
    layer.aovs.add().name = "Colour"
    solid = aov_material(1.0)
    solid.pass_index = 9
    for number, place in enumerate(grid(16, 4)):
        clear = aov_material((0.0, 0.1, 0.3, 0.5, 0.7, 0.9, 0.95, 1.0)[number % 8])
        clear.pass_index = 2 + number % 8
        obj = add_plane(clear, location=place)
        obj.pass_index, obj.rotation_euler = 1, (0.4, 0.2, 0.0)
        if number >= 8:
            add_plane(solid, location=(place[0], place[1], -1.0)).pass_index = 5
    set_world(pair_scene, (0.5, 0.2, 0.1))
    mist = pair_scene.world.mist_settings
    mist.start, mist.depth = 18.0, 5.0
    pair_scene.cycles.max_bounces = 0
    names = ("Object Index", "Material Index") if bpy.app.version >= (5, 0, 0) else ("IndexOB", "IndexMA")
    passes = ("Depth", "Normal", "UV", "Mist", "Colour", *names)
    agree(pair_scene, tmp_path, samples=64, passes=passes, bounds=Bounds(0.05, 0.3))
