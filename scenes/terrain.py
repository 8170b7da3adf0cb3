"""1.6 million triangles of terrain under sun and constant sky: the bench's traversal scene."""

import math

import bpy
import numpy as np


def height(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Ridges of a few octaves of rotated sines."""
    z = np.zeros_like(x)
    amplitude, frequency, angle = 1.0, 0.55, 0.0
    for _ in range(8):
        u = x * math.cos(angle) - y * math.sin(angle)
        v = x * math.sin(angle) + y * math.cos(angle)
        z += amplitude * np.sin(u * frequency + 1.3 * angle) * np.cos(v * frequency * 1.1)
        amplitude, frequency, angle = amplitude * 0.5, frequency * 2.03, angle + 1.1
    return z


def build(side: int = 895) -> None:
    scene = bpy.context.scene
    for scene_object in list(bpy.data.objects):
        bpy.data.objects.remove(scene_object)
    axis = np.linspace(-10, 10, side, dtype=np.float32)
    x, y = np.meshgrid(axis, axis, indexing="xy")
    positions = np.stack([x, y, height(x, y).astype(np.float32)], axis=-1).reshape(-1, 3)
    i = np.arange(side * side).reshape(side, side)
    corners = np.stack([i[:-1, :-1], i[:-1, 1:], i[1:, 1:], i[1:, :-1]], axis=-1).reshape(-1).astype(np.int32)
    faces = corners.size // 4
    mesh = bpy.data.meshes.new("Terrain")
    mesh.vertices.add(len(positions))
    mesh.vertices.foreach_set("co", positions.reshape(-1))
    mesh.loops.add(corners.size)
    mesh.loops.foreach_set("vertex_index", corners)
    mesh.polygons.add(faces)
    mesh.polygons.foreach_set("loop_start", np.arange(0, corners.size, 4, dtype=np.int32))
    if bpy.app.version < (4, 1, 0):
        mesh.polygons.foreach_set("loop_total", np.full(faces, 4, dtype=np.int32))
    mesh.update()
    material = bpy.data.materials.new("Rock")
    material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    node = tree.nodes.new("ShaderNodeBsdfDiffuse")
    node.inputs["Color"].default_value = (0.5, 0.45, 0.4, 1.0)
    tree.links.new(node.outputs[0], tree.nodes.new("ShaderNodeOutputMaterial").inputs["Surface"])
    mesh.materials.append(material)
    scene.collection.objects.link(bpy.data.objects.new("Terrain", mesh))

    sun = bpy.data.lights.new("Sun", "SUN")
    sun.energy, sun.angle = 3.0, math.radians(0.53)
    light = bpy.data.objects.new("Sun", sun)
    light.rotation_euler = (math.radians(55), 0, math.radians(40))
    scene.collection.objects.link(light)
    world = bpy.data.worlds.new("Sky")
    world.use_nodes = True
    world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.4, 0.6, 1.0, 1.0)
    scene.world = world
    camera = bpy.data.cameras.new("Camera")
    camera.lens = 35
    view = bpy.data.objects.new("Camera", camera)
    view.location, view.rotation_euler = (0, -13, 7), (math.radians(64), 0, 0)
    scene.collection.objects.link(view)
    scene.camera = view
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 640, 360, 100
    scene.cycles.samples = 64
    scene.cycles.max_bounces = scene.cycles.diffuse_bounces = 5


build()
