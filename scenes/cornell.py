"""Cornell box, diffuse; the bench's simplest scene. Argument after `--`: "spheres" adds a glass and a metal sphere."""

import sys

import bmesh
import bpy


def diffuse(name: str, color: tuple[float, float, float]) -> bpy.types.Material:
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    node = tree.nodes.new("ShaderNodeBsdfDiffuse")
    node.inputs["Color"].default_value = (*color, 1.0)
    tree.links.new(node.outputs[0], tree.nodes.new("ShaderNodeOutputMaterial").inputs["Surface"])
    return material


def shader(name: str, node_type: str, roughness: float) -> bpy.types.Material:
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    node = tree.nodes.new(node_type)
    node.inputs["Color"].default_value = (0.95, 0.95, 0.95, 1.0)
    node.inputs["Roughness"].default_value = roughness
    tree.links.new(node.outputs[0], tree.nodes.new("ShaderNodeOutputMaterial").inputs["Surface"])
    return material


def add(name: str, vertices: list, faces: list, material: bpy.types.Material) -> bpy.types.Object:
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(vertices, [], faces)
    mesh.materials.append(material)
    scene_object = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(scene_object)
    return scene_object


def add_box(
    name: str,
    center: tuple[float, float, float],
    size: tuple[float, float, float],
    turn: float,
    material: bpy.types.Material,
) -> None:
    x, y, z = (0.5 * s for s in size)
    corners = [(-x, -y, -z), (x, -y, -z), (x, y, -z), (-x, y, -z), (-x, -y, z), (x, -y, z), (x, y, z), (-x, y, z)]
    faces = [(3, 2, 1, 0), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]
    box = add(name, corners, faces, material)
    box.location = center
    box.rotation_euler[2] = turn


def add_sphere(name: str, center: tuple[float, float, float], radius: float, material: bpy.types.Material) -> None:
    mesh = bpy.data.meshes.new(name)
    shape = bmesh.new()
    bmesh.ops.create_uvsphere(shape, u_segments=128, v_segments=64, radius=radius)
    for face in shape.faces:
        face.smooth = True
    shape.to_mesh(mesh)
    shape.free()
    mesh.materials.append(material)
    scene_object = bpy.data.objects.new(name, mesh)
    scene_object.location = center
    bpy.context.scene.collection.objects.link(scene_object)


def build(with_spheres: bool) -> None:
    scene = bpy.context.scene
    for scene_object in list(bpy.data.objects):
        bpy.data.objects.remove(scene_object)
    white, red, green = (
        diffuse("White", (0.73,) * 3),
        diffuse("Red", (0.65, 0.05, 0.05)),
        diffuse("Green", (0.12, 0.45, 0.15)),
    )
    add("Floor", [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], [(0, 1, 2, 3)], white)
    add("Ceiling", [(-1, -1, 2), (1, -1, 2), (1, 1, 2), (-1, 1, 2)], [(3, 2, 1, 0)], white)
    add("Back", [(-1, 1, 0), (1, 1, 0), (1, 1, 2), (-1, 1, 2)], [(0, 1, 2, 3)], white)
    add("Left", [(-1, -1, 0), (-1, 1, 0), (-1, 1, 2), (-1, -1, 2)], [(0, 1, 2, 3)], red)
    add("Right", [(1, -1, 0), (1, 1, 0), (1, 1, 2), (1, -1, 2)], [(3, 2, 1, 0)], green)
    if with_spheres:
        add_sphere("Glass", (0.4, -0.25, 0.4), 0.4, shader("Glass", "ShaderNodeBsdfGlass", 0.0))
        add_sphere("Metal", (-0.4, 0.3, 0.4), 0.4, shader("Metal", "ShaderNodeBsdfGlossy", 0.2))
    else:
        add_box("Short", (0.35, -0.3, 0.3), (0.6, 0.6, 0.6), -0.29, white)
        add_box("Tall", (-0.35, 0.3, 0.6), (0.6, 0.6, 1.2), 0.29, white)
    lamp = bpy.data.lights.new("Light", "AREA")
    lamp.shape, lamp.size, lamp.energy = "SQUARE", 0.5, 20.0
    light = bpy.data.objects.new("Light", lamp)
    light.location = (0, 0, 1.99)
    scene.collection.objects.link(light)
    world = bpy.data.worlds.new("Black")
    world.use_nodes = True
    world.node_tree.nodes.clear()
    scene.world = world
    camera = bpy.data.cameras.new("Camera")
    camera.lens = 35
    view = bpy.data.objects.new("Camera", camera)
    view.location, view.rotation_euler = (0, -3.9, 1), (1.5707963, 0, 0)
    scene.collection.objects.link(view)
    scene.camera = view
    scene.render.resolution_x = scene.render.resolution_y = 512
    scene.render.resolution_percentage = 100
    scene.cycles.samples = 128
    scene.cycles.max_bounces = scene.cycles.diffuse_bounces = scene.cycles.glossy_bounces = 7
    scene.cycles.transmission_bounces = 7


build("spheres" in sys.argv)
