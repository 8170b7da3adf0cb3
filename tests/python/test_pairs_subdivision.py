"""Adaptive subdivision in Cycles and in Talbot: shapes, creases, borders, UV maps, attributes, displacement."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import bpy
from pair_scenes import (
    Tree,
    add_lamp,
    add_mesh,
    change_material,
    color_card,
    diffuse,
    glow,
    grid,
    image_of,
    look_at,
    look_down,
    material,
    set_world,
)
from pairs import Bounds, agree

IN_MODIFIER = "use_adaptive_subdivision" in bpy.types.SubsurfModifier.bl_rna.properties
CUBE = [(x, y, z) for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)]
SIDES = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]


def fine(scene: Any, rate: float = 0.25) -> None:
    """Pixels of these small pictures are large: edges are parts of them."""
    if not IN_MODIFIER:
        scene.cycles.feature_set = "EXPERIMENTAL"
    scene.cycles.dicing_rate = rate
    scene.cycles.max_bounces = 1
    add_lamp("SUN", 2.0, (3, -2, 4), toward=(0, 0, 0), angle=0.1)
    set_world(scene, (0.2, 0.25, 0.3))


def adaptive(obj: Any, levels: int = 0, **values: Any) -> Any:
    """Adds the modifier. Its levels count only where Blender's Cycles dices what comes out of it."""
    modifier = obj.modifiers.new("Subdivision", "SUBSURF")
    modifier.levels = modifier.render_levels = levels
    for name, value in values.items():
        setattr(modifier, name, value)
    (modifier if IN_MODIFIER else obj.cycles).use_adaptive_subdivision = True
    return modifier


def cube(item: Any, size: float = 0.3, smooth: bool = True, **place: Any) -> Any:
    """A cube with the whole of a UV map on each side."""
    obj = add_mesh([(size * x, size * y, size * z) for x, y, z in CUBE], SIDES, item, smooth=smooth, **place)
    layer = obj.data.uv_layers.new(name="UVMap")
    for index, uv in enumerate(((0, 0), (1, 0), (1, 1), (0, 1)) * 6):
        layer.data[index].uv = uv
    return obj


def crease(mesh: Any, edges: dict[int, float]) -> None:
    """Creases by the number of the edge."""
    if hasattr(mesh, "edge_creases"):
        attribute = (
            mesh.attributes.new("crease_edge", "FLOAT", "EDGE") if hasattr(mesh, "edge_creases_ensure") else None
        )
        for index, value in edges.items():
            if attribute is not None:
                attribute.data[index].value = value
            else:
                mesh.edges[index].crease = value
    else:
        for index, value in edges.items():
            mesh.edges[index].crease = value


def test_shapes(pair_scene: Any, tmp_path: Path) -> None:
    """Catmull-Clark and simple, creases, five-sided and three-sided faces, an open sheet, flat faces."""
    look_down(pair_scene, 3.0)
    places = grid(9, 3)
    matt, turned = diffuse(), {"rotation": (0.5, 0.4, 0.2)}
    adaptive(cube(matt, location=places[0], **turned))
    adaptive(cube(matt, location=places[1], **turned), subdivision_type="SIMPLE")
    adaptive(cube(matt, smooth=False, location=places[2], **turned))
    creased = cube(matt, location=places[3], **turned)
    crease(creased.data, {0: 1.0, 3: 0.3, 5: 0.15, 8: 1.0})
    adaptive(creased)
    ring = [
        (0.4 * math.cos(i * 0.4 * math.pi), 0.4 * math.sin(i * 0.4 * math.pi), z) for z in (-0.3, 0.3) for i in range(5)
    ]
    walls = [(i, (i + 1) % 5, 5 + (i + 1) % 5, 5 + i) for i in range(5)]
    adaptive(
        add_mesh(ring, [(4, 3, 2, 1, 0), (5, 6, 7, 8, 9), *walls], matt, smooth=True, location=places[4], **turned)
    )
    tent = [(-0.4, -0.4, 0), (0.4, -0.4, 0), (0.4, 0.4, 0), (-0.4, 0.4, 0), (0, 0, 0.6)]
    roof = [(0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)]
    adaptive(add_mesh(tent, [*roof, (3, 2, 1, 0)], matt, smooth=True, location=places[5], **turned))
    adaptive(add_mesh(tent, roof, matt, smooth=True, location=places[6], **turned))
    adaptive(cube(matt, location=places[7], **turned), levels=1)
    bent = cube(matt, location=places[8], **turned)
    bent.modifiers.new("Twist", "SIMPLE_DEFORM").angle = 1.0
    adaptive(bent)
    fine(pair_scene)
    agree(pair_scene, tmp_path, samples=48, cells=3, bounds=Bounds(0.01, 0.04, 0.002))


def test_coordinates(pair_scene: Any, tmp_path: Path) -> None:
    """UV maps that are smoothed or not, generated and object coordinates, values of vertices, faces and corners."""
    look_down(pair_scene, 3.0)
    places = grid(6, 3)
    picture = image_of(color_card(8, 8))

    def mapped(tree: Tree) -> Any:
        return tree("Emission", Color=tree("TexImage", image=picture))

    turned = {"rotation": (0.5, 0.4, 0.2)}
    adaptive(cube(material(mapped), location=places[0], **turned), uv_smooth="PRESERVE_BOUNDARIES")
    adaptive(cube(material(mapped), location=places[1], **turned), uv_smooth="NONE")
    for place, output in ((places[2], "Generated"), (places[3], "Object")):
        item = material(lambda tree, name=output: tree("Emission", Color=tree("TexCoord").outputs[name]))
        adaptive(cube(item, location=place, **turned))
    for place, kind, domain in ((places[4], "FLOAT_COLOR", "CORNER"), (places[5], "FLOAT_VECTOR", "FACE")):
        item = material(lambda tree: tree("Emission", Color=tree("Attribute", attribute_name="Paint").outputs["Color"]))
        obj = cube(item, location=place, **turned)
        attribute = obj.data.attributes.new("Paint", kind, domain)
        for index, value in enumerate(attribute.data):
            color = (index % 3 / 2, index % 5 / 4, index % 2)
            if kind == "FLOAT_COLOR":
                value.color = (*color, 1)
            else:
                value.vector = color
        adaptive(obj)
    fine(pair_scene)
    agree(pair_scene, tmp_path, samples=48, cells=3, bounds=Bounds(0.01, 0.04))


def test_displaced(pair_scene: Any, tmp_path: Path) -> None:
    """What adaptive subdivision is for: cages of a few faces that displacement makes rough, near and far."""
    look_at(pair_scene, (0, -2.5, 1.6), (0, 0.4, 0.1))
    pair_scene.render.resolution_x = pair_scene.render.resolution_y = 32

    def rough(frequency: float, scale: float) -> Any:
        item = material(lambda tree: tree("BsdfDiffuse", Color=0.7))
        tree = Tree.__new__(Tree)
        tree.tree = item.node_tree
        output = next(node for node in tree.tree.nodes if node.bl_idname == "ShaderNodeOutputMaterial")
        height = tree("TexNoise", Vector=tree("TexCoord").outputs["Object"], Scale=frequency, Detail=0.0).outputs[0]
        tree.set(output.inputs["Displacement"], tree("Displacement", Height=height, Scale=scale))
        return change_material(item, displacement_method="DISPLACEMENT")

    ground = add_mesh(
        [(-4, -2, 0), (4, -2, 0), (4, 8, 0), (-4, 8, 0)],
        [(0, 1, 2, 3)],
        rough(1.5, 0.5),
        smooth=True,
        location=(0, 0, -0.5),
    )
    adaptive(ground, subdivision_type="SIMPLE")
    adaptive(cube(rough(3.0, 0.4), 0.5, location=(-0.6, 0, 0.5)))
    adaptive(cube(rough(2.0, 0.4), 0.5, location=(0.8, 1.5, 0.5)))
    fine(pair_scene, 0.5)
    # The diced triangles are each engine's own.
    agree(pair_scene, tmp_path, samples=48, cells=3, bounds=Bounds(0.01, 0.05, 0.004))


def test_coarse(pair_scene: Any, tmp_path: Path) -> None:
    """Few levels, and lengths in object space."""
    look_down(pair_scene, 2.0)
    places = grid(4, 2)
    matt = diffuse()
    for place in places[:3]:
        adaptive(cube(matt, 0.4, location=place, rotation=(0.5, 0.4, 0.2)))
    modifier = adaptive(cube(matt, 0.4, location=places[3], rotation=(0.5, 0.4, 0.2)))
    if IN_MODIFIER:
        modifier.adaptive_space = "OBJECT"
        modifier.adaptive_object_edge_length = 0.05
    fine(pair_scene, 1.0)
    pair_scene.cycles.max_subdivisions = 4
    agree(pair_scene, tmp_path, samples=48, cells=2, bounds=Bounds(0.01, 0.04))


def test_emission(pair_scene: Any, tmp_path: Path) -> None:
    """A diced mesh that shines is a lamp."""
    look_down(pair_scene, 2.0)
    adaptive(cube(glow(3.0), 0.3, location=(0, 0, 0.7)))
    add_mesh([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], [(0, 1, 2, 3)], diffuse())
    fine(pair_scene, 1.0)
    agree(pair_scene, tmp_path, samples=64, cells=3, bounds=Bounds(0.01, 0.05))
