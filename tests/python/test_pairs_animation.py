"""What a frame shows that lies between two, and that drivers say, in Cycles and in Talbot."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
import pytest
from pair_scenes import (
    add_box,
    add_lamp,
    add_plane,
    add_sphere,
    animate,
    color_card,
    diffuse,
    image_of,
    look_at,
    material,
    open_shutter,
    set_world,
)
from pairs import Bounds, agree


def drive(owner: Any, path: str, expression: str, index: int = -1) -> None:
    """A driver of the frame: of those simple expressions that need no scripts."""
    owner.driver_add(path, index).driver.expression = expression


@pytest.mark.parametrize("blur", [False, True])
def test_subframes(pair_scene: Any, tmp_path: Path, blur: bool) -> None:
    """A frame and three quarters: an object, a shape, a colour, a lamp and the camera."""
    camera = look_at(pair_scene, (0, -5, 2), (0, 0, 0.5), 40.0)
    animate(camera.data, "lens", (3, 34.0), (5, 46.0))
    set_world(pair_scene, 0.3)
    paint = diffuse((0.7, 0.5, 0.3))
    color = next(node for node in paint.node_tree.nodes if node.bl_idname == "ShaderNodeBsdfDiffuse").inputs["Color"]
    animate(color, "default_value", (3, (0.9, 0.1, 0.1, 1.0)), (5, (0.1, 0.1, 0.9, 1.0)))
    add_plane(diffuse(), 8.0)
    box = add_box(paint, (0.8, 0.8, 0.8))
    animate(box, "location", (3, (-1.5, 0, 0.4)), (5, (1.0, 0.5, 0.8)))
    ball = add_sphere(diffuse((0.3, 0.7, 0.4)), 0.4, location=(0.8, -0.8, 0.4))
    ball.shape_key_add(name="Basis")
    key = ball.shape_key_add(name="Flat")
    for point in key.data:
        point.co.z *= 0.3
    animate(key, "value", (3, 0.0), (5, 1.0))
    lamp = add_lamp("AREA", 100, (2, -2, 3), toward=(0, 0, 0), shape="SQUARE", size=1.0)
    animate(lamp.data, "energy", (3, 20.0), (5, 120.0))
    if blur:
        open_shutter(pair_scene)
    pair_scene.cycles.max_bounces = 1
    pair_scene.frame_set(3, subframe=0.75)
    assert -1.5 < box.matrix_world.translation.x < 1.0
    # Cycles until 3.5 leaves normals of what deforms shorter than one.
    bounds = Bounds(0.01, 0.06, 0.02 if blur and bpy.app.version < (3, 6, 0) else 0.004)
    agree(pair_scene, tmp_path, samples=96, batches=8, bounds=bounds)


def test_drivers(pair_scene: Any, tmp_path: Path) -> None:
    """Places, nodes, lamps, lenses and modifiers that follow the frame, and a ball that follows another's place."""
    camera = look_at(pair_scene, (0, -5, 2), (0, 0, 0.5), 40.0)
    drive(camera.data, "lens", "30 + frame * 2")
    world = set_world(pair_scene, 0.3)
    strength = next(node for node in world.node_tree.nodes if node.bl_idname == "ShaderNodeBackground").inputs[
        "Strength"
    ]
    drive(strength, "default_value", "frame / 8")

    card = image_of(color_card())
    paint = material(
        lambda tree: tree(
            "BsdfDiffuse",
            Color=tree("TexImage", image=card, Vector=tree("Mapping", Vector=tree("TexCoord").outputs["UV"])),
        )
    )
    mapping = next(node for node in paint.node_tree.nodes if node.bl_idname == "ShaderNodeMapping")
    drive(mapping.inputs["Location"], "default_value", "frame / 10", 0)
    add_plane(paint, 5.0)
    box = add_box(diffuse((0.7, 0.3, 0.3)), (0.6, 0.6, 0.6), location=(0, 0, 0.5))
    drive(box, "location", "frame / 4 - 1", 0)
    drive(box, "rotation_euler", "frame / 3", 2)
    array = box.modifiers.new("Array", "ARRAY")
    drive(array, "count", "2 + frame / 5")
    other = add_sphere(diffuse((0.3, 0.7, 0.4)), 0.3, location=(0, 0, 0.9))
    driver = other.driver_add("location", 1).driver
    variable = driver.variables.new()
    variable.name, variable.type = "x", "TRANSFORMS"
    variable.targets[0].id, variable.targets[0].transform_type = box, "LOC_X"
    driver.expression = "x * 2 - 1"
    lamp = add_lamp("SPOT", 100, (1.5, -2, 3), toward=(0, 0, 0), shadow_soft_size=0.3)
    drive(lamp.data, "energy", "frame * 60")
    drive(lamp.data, "spot_size", "0.4 + frame / 10")
    pair_scene.cycles.max_bounces = 1
    pair_scene.frame_set(6)
    assert box.matrix_world.translation.x == pytest.approx(0.5)
    agree(pair_scene, tmp_path, samples=96, batches=8, bounds=Bounds(0.01, 0.06))
