"""True displacement in Cycles and in Talbot: methods, spaces, normals, materials on parts of a mesh, motion, light."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from pair_scenes import (
    Tree,
    add_lamp,
    add_mesh,
    add_plane,
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
    sphere_shape,
)
from pairs import ALLOWANCE, Bounds, agree

Build = Callable[[Tree], Any]


def lit(scene: Any) -> None:
    """A slanted lamp and a dim sky."""
    add_lamp("SUN", 2.0, (3, -2, 4), toward=(0, 0, 0), angle=0.1)
    set_world(scene, (0.2, 0.25, 0.3))
    scene.cycles.max_bounces = 1


def displacing(method: str, build: Build, surface: Build | None = None) -> Any:
    """A material (matt, or of `surface`) with the displacement that `build` returns."""
    item = material(surface or (lambda tree: tree("BsdfDiffuse", Color=0.7)))
    tree = Tree.__new__(Tree)
    tree.tree = item.node_tree
    output = next(node for node in tree.tree.nodes if node.bl_idname == "ShaderNodeOutputMaterial")
    tree.set(output.inputs["Displacement"], build(tree))
    return change_material(item, displacement_method=method)


def ball(item: Any, smooth: bool = True, radius: float = 0.35, **place: Any) -> Any:
    """A ball of 64 x 32 faces."""
    vertices, faces = sphere_shape(64, 32, radius)
    return add_mesh(vertices, faces, item, smooth=smooth, **place)


def sheet(item: Any, size: float = 0.9, cells: int = 40, smooth: bool = True, **place: Any) -> Any:
    """A square of cells x cells faces with a UV map."""
    side = np.linspace(-0.5, 0.5, cells + 1)
    vertices = [(size * x, size * y, 0.0) for y in side for x in side]
    corners = [(y * (cells + 1) + x) for y in range(cells) for x in range(cells)]
    obj = add_mesh(vertices, [(a, a + 1, a + cells + 2, a + cells + 1) for a in corners], item, smooth=smooth, **place)
    layer = obj.data.uv_layers.new(name="UVMap")
    for loop in obj.data.loops:
        x, y, _ = vertices[loop.vertex_index]
        layer.data[loop.index].uv = (x / size + 0.5, y / size + 0.5)
    return obj


def noise(tree: Tree, coordinate: str = "Object", scale: float = 3.0) -> Any:
    """A smooth noise."""
    return tree("TexNoise", Vector=tree("TexCoord").outputs[coordinate], Scale=scale, Detail=0.0).outputs[0]


def along_normal(coordinate: str = "Object", frequency: float = 3.0, **values: Any) -> Build:
    """Displacement by noise along the normal."""
    return lambda tree: tree("Displacement", Height=noise(tree, coordinate, frequency), **({"Scale": 0.3} | values))


def along_vector(space: str, **values: Any) -> Build:
    """Displacement by a vector that noise makes."""

    def build(tree: Tree) -> Any:
        parts = [noise(tree, "Object", scale) for scale in (2.0, 3.0, 4.0)]
        vector = tree("CombineXYZ", X=parts[0], Y=parts[1], Z=parts[2])
        return tree("VectorDisplacement", Vector=vector, Midlevel=0.5, space=space, **({"Scale": 0.4} | values))

    return build


def test_methods(pair_scene: Any, tmp_path: Path) -> None:
    """Bump, displacement and both, on smooth and on flat faces."""
    look_down(pair_scene, 3.0)
    places = grid(6, 3)
    for number, (method, smooth) in enumerate(
        (method, smooth) for smooth in (True, False) for method in ("BUMP", "DISPLACEMENT", "BOTH")
    ):
        ball(displacing(method, along_normal(Scale=0.15)), smooth, location=places[number])
    lit(pair_scene)
    # Both on flat faces, before 5.0: 1 % brighter than in Cycles.
    systematic = ALLOWANCE if bpy.app.version >= (5, 0, 0) else 0.008
    agree(pair_scene, tmp_path, samples=48, cells=3, bounds=Bounds(0.01, 0.03, systematic))


def test_spaces(pair_scene: Any, tmp_path: Path) -> None:
    """Object and world space under uneven, mirroring and turning maps; vectors in each space; midlevel."""
    look_down(pair_scene, 3.0)
    places = grid(9, 3)
    stretched = (1.3, 0.6, 0.9)
    builds: Sequence[tuple[Build, tuple[float, float, float]]] = (
        (along_normal(space="OBJECT"), stretched),
        (along_normal(space="WORLD"), stretched),
        (along_normal(space="OBJECT", Midlevel=0.2), (-1.0, 0.8, 1.0)),
        (along_vector("OBJECT"), stretched),
        (along_vector("WORLD"), stretched),
        (along_vector("TANGENT"), (1.0, 1.0, 1.0)),
        (along_normal("Generated"), stretched),
        (along_normal("Normal"), (1.0, 1.0, 1.0)),
        (along_normal("Object", 6.0, Scale=0.5), (0.7, 0.7, 0.7)),
    )
    for number, (build, scale) in enumerate(builds):
        shape = sheet if number == 5 else ball
        obj = shape(displacing("DISPLACEMENT", build), location=places[number], rotation=(0.3, 0.2 * number, 0.1))
        obj.scale = scale
    lit(pair_scene)
    agree(pair_scene, tmp_path, samples=48, cells=3, bounds=Bounds(0.01, 0.04))


def test_what_surfaces_see(pair_scene: Any, tmp_path: Path) -> None:
    """Coordinates of a displaced surface: generated ones stay, positions and normals move; images displace."""
    look_down(pair_scene, 2.0)
    places = grid(4, 2)
    picture = image_of(color_card(16, 16))

    def from_image(tree: Tree) -> Any:
        return tree("Displacement", Height=tree("TexImage", image=picture, interpolation="Cubic"), Scale=0.2)

    def seen(output: str) -> Build:
        return lambda tree: tree("Emission", Color=tree("TexCoord").outputs[output])

    geometry: Build = lambda tree: tree("Emission", Color=tree("NewGeometry").outputs["Normal"])  # noqa: E731
    ball(displacing("DISPLACEMENT", along_normal(), seen("Generated")), location=places[0])
    ball(displacing("DISPLACEMENT", along_normal(), seen("Object")), location=places[1])
    sheet(displacing("DISPLACEMENT", from_image, seen("UV")), location=places[2], rotation=(0.7, 0, 0))
    sheet(displacing("DISPLACEMENT", from_image, geometry), location=places[3], rotation=(0.7, 0, 0))
    agree(pair_scene, tmp_path, samples=48, cells=2, bounds=Bounds(0.01, 0.04))


def test_parts_and_instances(pair_scene: Any, tmp_path: Path) -> None:
    """Slots with and without displacement on one mesh; objects that share a mesh, one with a material of its own."""
    look_at(pair_scene, (0, -3, 3), (0, 0, 0.1), 50.0)
    rough = displacing("DISPLACEMENT", along_normal(Scale=0.2))
    shape = sheet(rough, location=(-0.6, 0.5, 0))
    shape.data.materials.append(diffuse((0.8, 0.2, 0.1)))
    shape.data.materials.append(displacing("BOTH", along_normal(Scale=0.2)))
    count = len(shape.data.polygons)
    shape.data.polygons.foreach_set("material_index", (np.arange(count) % 40) * 3 // 40)
    for number in range(2):
        twin = shape.copy()
        twin.location = (0.6, 0.5 - number, 0)
        twin.rotation_euler = (0, 0, 1.0)
        pair_scene.collection.objects.link(twin)
    twin.material_slots[0].link = "OBJECT"
    twin.material_slots[0].material = displacing("DISPLACEMENT", along_normal(Scale=0.5))
    add_plane(diffuse(0.4), 4.0, location=(0, 0, -0.3))
    lit(pair_scene)
    agree(pair_scene, tmp_path, samples=64, bounds=Bounds(0.01, 0.05))


def test_light_of_displaced_emitters(pair_scene: Any, tmp_path: Path) -> None:
    """A glowing sheet that stands above the floor only by its displacement."""
    look_down(pair_scene, 3.0)
    add_plane(diffuse(), 3.0)
    height: Build = lambda tree: tree("Displacement", Height=noise(tree), Midlevel=-3.0, Scale=0.3)  # noqa: E731
    emitter = displacing("DISPLACEMENT", height, lambda tree: tree("Emission", Strength=5.0))
    sheet(emitter, 0.6, 12, location=(0, 0, -0.01))
    pair_scene.cycles.max_bounces = 1
    agree(pair_scene, tmp_path, samples=64)


@pytest.mark.parametrize("smooth", [True, False])
def test_motion(pair_scene: Any, tmp_path: Path, smooth: bool) -> None:
    """A shape that deforms while the shutter is open: every moment moves by the same offset."""
    look_down(pair_scene, 1.6)
    obj = sheet(displacing("DISPLACEMENT", along_normal(Scale=0.3)), smooth=smooth, rotation=(0.6, 0, 0))
    obj.shape_key_add(name="Basis")
    key = obj.shape_key_add(name="Moved", from_mix=False)
    for point in key.data:
        point.co.x += 0.4 * point.co.y
        point.co.z += 0.3
    key.value = 0.0
    key.keyframe_insert("value", frame=1)
    key.value = 1.0
    key.keyframe_insert("value", frame=2)
    pair_scene.render.use_motion_blur = True
    pair_scene.render.motion_blur_shutter = 1.0
    add_plane(glow(0.3), 3.0, location=(0, 0, -1))
    lit(pair_scene)
    pair_scene.frame_set(1)
    agree(pair_scene, tmp_path, samples=96, bounds=Bounds(0.01, 0.05))
