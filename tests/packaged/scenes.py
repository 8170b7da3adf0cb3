"""Five small scenes that use every library inside the bundle: Embree's geometries, image codecs, colour spaces."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import bpy
import numpy as np

SIZE = 48
SAMPLES = 8
# Written by Blender itself, read by each build's own codecs.
FORMATS = {"PNG": "png", "JPEG": "jpg", "OPEN_EXR": "exr", "HDR": "hdr", "TIFF": "tif", "TARGA": "tga", "BMP": "bmp"}
NEWER_FORMATS = {"WEBP": "webp", "JPEG2000": "jp2"}


def write_images(folder: Path) -> None:
    """One picture in each format this Blender writes; at a second call they are there."""
    folder.mkdir(parents=True, exist_ok=True)
    size = 32
    y, x = np.mgrid[0:size, 0:size] / (size - 1)
    pixels = np.stack([x, y, 0.5 + 0.5 * np.sin(9 * x * y), np.ones_like(x)], axis=-1).astype(np.float32)
    scene = bpy.context.scene
    settings = scene.render.image_settings
    for kind, ending in (FORMATS | NEWER_FORMATS).items():
        path = folder / f"picture.{ending}"
        if path.exists():
            continue
        image = bpy.data.images.new("picture", size, size, float_buffer=kind in ("OPEN_EXR", "HDR"))
        image.pixels.foreach_set(pixels.ravel())
        try:
            if hasattr(settings, "media_type"):
                settings.media_type = "IMAGE"
            settings.file_format = kind
            image.save_render(str(path), scene=scene)
        except (TypeError, RuntimeError):
            if kind in FORMATS:
                raise
        bpy.data.images.remove(image)


def clear() -> bpy.types.Scene:
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    scene.render.resolution_x = scene.render.resolution_y = SIZE
    scene.render.resolution_percentage = 100
    scene.cycles.samples = SAMPLES
    scene.cycles.use_denoising = scene.cycles.use_adaptive_sampling = False
    scene.cycles.seed = 3
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.location = (0.0, -6.0, 2.0)
    camera.rotation_euler = (math.radians(75), 0.0, 0.0)
    scene.collection.objects.link(camera)
    scene.camera = camera
    world = bpy.data.worlds.new("World")
    world.use_nodes = True
    world.node_tree.nodes["Background"].inputs[0].default_value = (0.3, 0.4, 0.6, 1.0)
    scene.world = world
    return scene


def material(name: str, node_type: str, **inputs: object) -> bpy.types.Material:
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    tree = made.node_tree
    tree.nodes.clear()
    node = tree.nodes.new(node_type)
    for key, value in inputs.items():
        node.inputs[key.replace("_", " ")].default_value = value
    tree.links.new(node.outputs[0], tree.nodes.new("ShaderNodeOutputMaterial").inputs["Surface"])
    return made


def textured(path: Path) -> bpy.types.Material:
    made = material(path.name, "ShaderNodeBsdfDiffuse")
    tree = made.node_tree
    texture = tree.nodes.new("ShaderNodeTexImage")
    texture.image = bpy.data.images.load(str(path))
    target = next(node for node in tree.nodes if node.type == "BSDF_DIFFUSE")
    tree.links.new(texture.outputs["Color"], target.inputs["Color"])
    return made


def add_object(name: str, add: Callable[..., object], made: bpy.types.Material, **where: object) -> bpy.types.Object:
    add(**where)
    added = bpy.context.object
    added.name = name
    added.data.materials.append(made)
    return added


def add_ground() -> None:
    grey = material("Ground", "ShaderNodeBsdfDiffuse", Color=(0.6, 0.6, 0.6, 1.0))
    add_object("Ground", bpy.ops.mesh.primitive_plane_add, grey, size=20.0)


def add_lamp() -> None:
    light = bpy.data.lights.new("Lamp", "AREA")
    light.energy, light.size = 400.0, 1.5
    lamp = bpy.data.objects.new("Lamp", light)
    lamp.location = (2.0, -2.0, 4.0)
    lamp.rotation_euler = (math.radians(35), math.radians(25), 0.0)
    bpy.context.scene.collection.objects.link(lamp)


def balls(_: Path) -> None:
    add_ground()
    add_lamp()
    glass = material("Glass", "ShaderNodeBsdfGlass", IOR=1.5)
    metal = material("Metal", "ShaderNodeBsdfGlossy", Roughness=0.2, Color=(0.9, 0.7, 0.4, 1.0))
    add_object("A", bpy.ops.mesh.primitive_uv_sphere_add, glass, location=(-1.1, 0.0, 1.0), radius=1.0)
    add_object("B", bpy.ops.mesh.primitive_ico_sphere_add, metal, location=(1.1, 0.0, 1.0), radius=1.0)


def pictures(folder: Path) -> None:
    add_lamp()
    paths = sorted(folder.glob("picture.*"))
    for index, path in enumerate(paths):
        place = (1.4 * (index % 3 - 1), 0.0, 0.8 + 1.3 * (index // 3))
        turned = (math.radians(90), 0.0, 0.0)
        made = textured(path)
        add_object(path.name, bpy.ops.mesh.primitive_plane_add, made, size=1.2, location=place, rotation=turned)


def surroundings(folder: Path) -> None:
    """A picture as the sky, and colour spaces other than sRGB."""
    add_ground()
    world = bpy.context.scene.world
    texture = world.node_tree.nodes.new("ShaderNodeTexEnvironment")
    texture.image = bpy.data.images.load(str(folder / "picture.exr"))
    world.node_tree.links.new(texture.outputs[0], world.node_tree.nodes["Background"].inputs[0])
    made = textured(folder / "picture.png")
    image = next(node for node in made.node_tree.nodes if node.type == "TEX_IMAGE").image
    names = bpy.types.ColorManagedInputColorspaceSettings.bl_rna.properties["name"].enum_items.keys()
    image.colorspace_settings.name = next(name for name in names if name.startswith(("Filmic Log", "AgX Log", "ACES")))
    add_object("Cube", bpy.ops.mesh.primitive_cube_add, made, location=(0.0, 0.0, 1.0), rotation=(0.0, 0.0, 0.6))


def movement(_: Path) -> None:
    """Motion blur of objects: Embree's moving instances."""
    add_ground()
    add_lamp()
    red = material("Red", "ShaderNodeBsdfDiffuse", Color=(0.8, 0.1, 0.1, 1.0))
    ball = add_object("Ball", bpy.ops.mesh.primitive_ico_sphere_add, red, location=(-1.0, 0.0, 1.0), radius=0.8)
    ball.keyframe_insert("location", frame=0)
    ball.location = (1.0, 0.0, 1.4)
    ball.keyframe_insert("location", frame=2)
    bpy.context.scene.frame_set(1)
    bpy.context.scene.render.use_motion_blur = True


def strands(_: Path) -> None:
    """Curves, and many instances of one mesh under a sun."""
    add_ground()
    sun = bpy.data.objects.new("Sun", bpy.data.lights.new("Sun", "SUN"))
    sun.data.energy = 3.0
    sun.rotation_euler = (0.6, 0.3, 0.0)
    bpy.context.scene.collection.objects.link(sun)
    green = material("Green", "ShaderNodeBsdfDiffuse", Color=(0.2, 0.6, 0.2, 1.0))
    head = add_object("Head", bpy.ops.mesh.primitive_uv_sphere_add, green, location=(0.0, 0.0, 1.2), radius=0.5)
    bpy.ops.object.curves_random_add(location=(0.0, 0.0, 1.2))
    bpy.context.object.data.materials.append(green)
    mesh = head.data
    for index in range(60):
        copy = bpy.data.objects.new(f"Copy {index}", mesh)
        copy.location = (-3.0 + 0.6 * (index % 10), 2.0 + 0.6 * (index // 10), 0.2)
        copy.scale = (0.25, 0.25, 0.25)
        bpy.context.scene.collection.objects.link(copy)


SCENES: tuple[Callable[[Path], None], ...] = (balls, pictures, surroundings, movement, strands)


def build(index: int, folder: Path) -> bpy.types.Scene:
    scene = clear()
    SCENES[index](folder)
    return scene
