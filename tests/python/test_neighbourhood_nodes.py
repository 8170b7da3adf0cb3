"""Nodes that look around the point, in a small scene, against the Cycles of the same Blender."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable
from typing import Any

import bpy
import numpy as np
import pytest
from probe_scene import read_pixels

SAMPLES = 32


def link_node(tree: Any, kind: str, output: str | int, **properties: Any) -> Any:
    """A node whose output goes to the emission; its inputs are set by name."""
    made = tree.nodes.new(kind)
    for key, value in properties.items():
        if key in made.inputs:
            made.inputs[key].default_value = value
        else:
            setattr(made, key, value)
    return made.outputs[output]


def occlusion(**properties: Any) -> Callable[[Any], Any]:
    return lambda tree: link_node(tree, "ShaderNodeAmbientOcclusion", "Color", samples=4, Distance=0.8, **properties)


def bevel(tree: Any) -> Any:
    normal = link_node(tree, "ShaderNodeBevel", 0, Radius=0.2)
    shift = tree.nodes.new("ShaderNodeVectorMath")
    shift.operation = "MULTIPLY_ADD"
    shift.inputs[1].default_value = shift.inputs[2].default_value = (0.5, 0.5, 0.5)
    tree.links.new(normal, shift.inputs[0])
    return shift.outputs[0]


def raycast(output: str, **properties: Any) -> Callable[[Any], Any]:
    """Along the normal of the point, or up from the floor of the scene."""

    def build(tree: Any) -> Any:
        if not hasattr(bpy.types, "ShaderNodeRaycast"):
            pytest.skip("this Blender has no Raycast node")
        source = link_node(tree, "ShaderNodeRaycast", output, Length=1.5, **properties)
        shift = tree.nodes.new("ShaderNodeVectorMath")
        shift.operation = "MULTIPLY_ADD"
        shift.inputs[1].default_value = shift.inputs[2].default_value = (0.25, 0.25, 0.25)
        tree.links.new(source, shift.inputs[0])
        return shift.outputs[0]

    return build


def raycast_up(tree: Any) -> Any:
    """From half a metre above each point, up and askew: no unit vector."""
    output = raycast("Hit Distance")(tree)
    node = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeRaycast")
    above = tree.nodes.new("ShaderNodeVectorMath")
    above.inputs[1].default_value = (0, 0, 0.5)
    tree.links.new(tree.nodes.new("ShaderNodeNewGeometry").outputs["Position"], above.inputs[0])
    tree.links.new(above.outputs[0], node.inputs["Position"])
    direction = tree.nodes.new("ShaderNodeCombineXYZ")
    direction.inputs["X"].default_value, direction.inputs["Z"].default_value = -0.7, 2.0
    tree.links.new(direction.outputs[0], node.inputs["Direction"])
    return output


CASES: dict[str, tuple[Callable[[Any], Any], float]] = {
    "occlusion": (occlusion(Color=(0.9, 0.6, 0.3, 1.0)), 0.02),
    "occlusion inside": (occlusion(inside=True), 0.02),
    "occlusion of the object": (occlusion(only_local=True), 0.02),
    "bevel": (bevel, 0.02),
    "wireframe": (lambda tree: link_node(tree, "ShaderNodeWireframe", 0, Size=0.08), 0.02),
    "wireframe in pixels": (
        lambda tree: link_node(tree, "ShaderNodeWireframe", 0, Size=2.0, use_pixel_size=True),
        0.02,
    ),
    "raycast hit": (raycast("Is Hit"), 0.002),
    "raycast self": (raycast("Self Hit"), 0.002),
    "raycast distance": (raycast("Hit Distance"), 0.002),
    "raycast position": (raycast("Hit Position"), 0.002),
    "raycast normal": (raycast("Hit Normal"), 0.002),
    "raycast of the object": (raycast("Hit Distance", only_local=True), 0.002),
    "raycast up": (raycast_up, 0.004),
    "pointiness": (lambda tree: link_node(tree, "ShaderNodeNewGeometry", "Pointiness"), 0.002),
}
"""What feeds the emission, and how far pixels may be off on average, noise included."""


def add_objects(material: Any) -> None:
    bpy.ops.mesh.primitive_plane_add(size=6)
    bpy.context.object.data.materials.append(material)
    bpy.ops.mesh.primitive_cube_add(location=(-0.6, 0.2, 0.6), size=1.2, rotation=(0, 0, 0.3))
    bpy.context.object.data.materials.append(material)
    bpy.ops.mesh.primitive_uv_sphere_add(location=(1, 0.1, 0.6), radius=0.6, segments=16, ring_count=8)
    bpy.ops.object.shade_smooth()
    bpy.context.object.scale = (1, 0.7, 1.2)
    bpy.context.object.data.materials.append(material)
    bpy.ops.mesh.primitive_monkey_add(location=(0.3, -1.2, 0.5), size=0.9)
    bpy.context.object.data.materials.append(material)


def picture(engine: str, build: Callable[[Any], Any]) -> Any:
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    scene.render.engine = engine
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 72, 48, 100
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    scene.cycles.samples = SAMPLES
    scene.cycles.use_adaptive_sampling = scene.cycles.use_denoising = False
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    camera.location, camera.rotation_euler = (2.2, -5, 3.2), (1.02, 0, 0.4)
    scene.collection.objects.link(camera)
    scene.camera = camera
    material = bpy.data.materials.new("probe")
    material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    output, emission = tree.nodes.new("ShaderNodeOutputMaterial"), tree.nodes.new("ShaderNodeEmission")
    tree.links.new(emission.outputs[0], output.inputs["Surface"])
    tree.links.new(build(tree), emission.inputs["Color"])
    add_objects(material)
    with tempfile.TemporaryDirectory() as folder:
        scene.render.filepath = os.path.join(folder, "picture.exr")
        bpy.ops.render.render(write_still=True)
        return read_pixels(scene.render.filepath)[:, :, :3]


@pytest.mark.parametrize("name", CASES)
def test_like_cycles(name: str) -> None:
    build, noise = CASES[name]
    cycles, talbot = picture("CYCLES", build), picture("TALBOT", build)
    assert talbot.mean() == pytest.approx(cycles.mean(), rel=0.02 if "pixels" in name else 0.005)
    assert np.abs(talbot - cycles).mean() < noise
