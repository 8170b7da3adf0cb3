"""Blocks that the scenes of the pairs are built from: grids of small objects, node trees in one line each, lamps."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix, Vector

SIZE = 32


class Tree:
    """A node tree that is built by calls: `tree("TexNoise", Scale=3.0, noise_dimensions="2D")` adds a node.

    A keyword is a property where the node has one of that name, else an input: a value, or a socket or node to link.
    """

    def __init__(self, tree: Any) -> None:
        self.tree = tree
        tree.nodes.clear()

    def __call__(self, kind: str, **values: Any) -> Any:
        name = kind if kind.startswith(("Shader", "Node")) else f"ShaderNode{kind}"
        node = self.tree.nodes.new(name)
        properties = {key: value for key, value in values.items() if key in node.bl_rna.properties}
        for key, value in properties.items():
            setattr(node, key, value)
        for key, value in values.items():
            if key not in properties:
                self.set(find_input(node, key), value)
        return node

    def set(self, socket: Any, value: Any) -> None:
        """Links a socket, or stores a value."""
        if isinstance(value, bpy.types.NodeSocket):
            self.tree.links.new(value, socket)
        elif isinstance(value, bpy.types.Node):
            self.tree.links.new(first_output(value), socket)
        elif socket.type == "RGBA" and not isinstance(value, (int, float)):
            socket.default_value = (*value[:3], value[3] if len(value) > 3 else 1.0)
        elif socket.type in ("RGBA", "VECTOR") and isinstance(value, (int, float)):
            socket.default_value = [value] * len(socket.default_value)
        else:
            socket.default_value = value


def first_output(node: Any) -> Any:
    """The first output that is in use: Mix has one for each type."""
    return next(socket for socket in node.outputs if socket.enabled)


def find_input(node: Any, key: str) -> Any:
    """An input in use by its name with _ for a blank, or by number: in0, in1 ..."""
    enabled = [socket for socket in node.inputs if socket.enabled]
    if key.startswith("in") and key[2:].isdigit():
        return enabled[int(key[2:])]
    return next(socket for socket in enabled if socket.name == key.replace("_", " "))


Builder = Callable[[Tree], Any]


def node_tree(owner: Any) -> Tree:
    """The empty tree of a material, world or lamp. (From 5.0 on materials always have one.)"""
    if owner.node_tree is None or not owner.use_nodes:
        owner.use_nodes = True
    return Tree(owner.node_tree)


def material(build: Builder, name: str = "Pair", output: str = "Surface") -> Any:
    """A material of the shader (or the colour, which then is emitted) that `build` returns."""
    new = bpy.data.materials.new(name)
    tree = node_tree(new)
    result = build(tree)
    socket = result if isinstance(result, bpy.types.NodeSocket) else first_output(result)
    if socket.type != "SHADER":
        socket = first_output(tree("Emission", Color=socket))
    tree.set(find_input(tree("OutputMaterial"), output), socket)
    return new


def change_material(item: Any, **values: Any) -> Any:
    """Sets properties that were Cycles' own in older Blenders and are the material's since."""
    for name, value in values.items():
        setattr(item.cycles if hasattr(item.cycles, name) else item, name, value)
    return item


def diffuse(color: Sequence[float] | float = 0.8) -> Any:
    """A matt material."""
    return material(lambda tree: tree("BsdfDiffuse", Color=color))


def glow(color: Sequence[float] | float = 1.0, strength: float = 1.0) -> Any:
    """An emitting material."""
    return material(lambda tree: tree("Emission", Color=color, Strength=strength))


def set_world(scene: Any, color: Sequence[float] | float = 0.0, build: Builder | None = None) -> Any:
    """A world of one colour, or of the colour or shader that `build` returns."""
    scene.world = bpy.data.worlds.new("World")
    tree = node_tree(scene.world)
    result = build(tree) if build is not None else tree("Background", Color=color)
    socket = result if isinstance(result, bpy.types.NodeSocket) else first_output(result)
    if socket.type != "SHADER":
        socket = first_output(tree("Background", Color=socket))
    tree.tree.links.new(socket, tree("OutputWorld").inputs["Surface"])
    # Cycles takes seconds for the map that it makes by itself.
    scene.world.cycles.sampling_method, scene.world.cycles.sample_map_resolution = "MANUAL", 64
    return scene.world


def add_object(data: Any, location: Sequence[float] = (0, 0, 0), rotation: Sequence[float] = (0, 0, 0)) -> Any:
    """An object of any datablock (None: an empty), linked to the scene."""
    obj = bpy.data.objects.new("Pair", data)
    obj.location, obj.rotation_euler = location, rotation
    bpy.context.scene.collection.objects.link(obj)
    return obj


def add_mesh(vertices: Any, faces: Any, *materials: Any, smooth: bool = False, **place: Any) -> Any:
    """An object of vertices and faces."""
    mesh = bpy.data.meshes.new("Pair")
    mesh.from_pydata([tuple(map(float, v)) for v in vertices], [], [tuple(map(int, f)) for f in faces])
    mesh.polygons.foreach_set("use_smooth", [smooth] * len(mesh.polygons))
    for item in materials:
        mesh.materials.append(item)
    mesh.update()
    return add_object(mesh, **place)


def add_plane(item: Any, size: float = 1.0, **place: Any) -> Any:
    """A square in x and y with a UV map, facing up."""
    half = size / 2
    square = ((-half, -half, 0), (half, -half, 0), (half, half, 0), (-half, half, 0))
    obj = add_mesh(square, [(0, 1, 2, 3)], item, **place)
    layer = obj.data.uv_layers.new(name="UVMap")
    for loop, uv in enumerate(((0, 0), (1, 0), (1, 1), (0, 1))):
        layer.data[loop].uv = uv
    return obj


def sphere_shape(segments: int, rings: int, radius: float) -> tuple[list[Vector], list[tuple[int, ...]]]:
    """Vertices and faces of a ball, poles at top and bottom."""
    vertices = [Vector((0, 0, radius))]
    for ring in range(1, rings):
        theta = math.pi * ring / rings
        for segment in range(segments):
            phi = 2 * math.pi * segment / segments
            around = Vector((math.cos(phi), math.sin(phi), 0)) * math.sin(theta)
            vertices.append((around + Vector((0, 0, math.cos(theta)))) * radius)
    vertices.append(Vector((0, 0, -radius)))
    last = len(vertices) - 1
    faces: list[tuple[int, ...]] = []
    for segment in range(segments):
        following = (segment + 1) % segments
        faces.append((0, 1 + segment, 1 + following))
        for ring in range(rings - 2):
            upper, lower = 1 + ring * segments, 1 + (ring + 1) * segments
            faces.append((upper + segment, lower + segment, lower + following, upper + following))
        bottom = 1 + (rings - 2) * segments
        faces.append((last, bottom + following, bottom + segment))
    return vertices, faces


def add_sphere(item: Any, radius: float = 0.45, smooth: bool = True, segments: int = 24, **place: Any) -> Any:
    """A ball."""
    vertices, faces = sphere_shape(segments, segments // 2, radius)
    return add_mesh(vertices, faces, item, smooth=smooth, **place)


def add_box(item: Any, size: Sequence[float] = (1, 1, 1), inside: bool = False, **place: Any) -> Any:
    """A box around its origin; `inside`: its faces look inwards."""
    corners = [(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [face[::-1] if inside else face for face in faces]
    return add_mesh(np.array(corners) * size, faces, item, **place)


def add_lamp(
    kind: str, energy: float, location: Sequence[float], toward: Sequence[float] | None = None, **values: Any
) -> Any:
    """A lamp; it shines down, or toward a point. `cast_shadow` and the like of Cycles begin with `cycles_`."""
    lamp = bpy.data.lights.new("Pair", kind)
    lamp.energy = energy
    for key, value in values.items():
        if key.startswith("cycles_"):
            name = key.removeprefix("cycles_")
            if hasattr(lamp.cycles, name):
                setattr(lamp.cycles, name, value)
        else:
            setattr(lamp, key, value)
    obj = add_object(lamp, location)
    if toward is not None:
        obj.rotation_euler = (Vector(toward) - Vector(location)).to_track_quat("-Z", "Y").to_euler()
    return obj


def look_down(scene: Any, width: float, height: float = 20.0) -> Any:
    """An orthographic camera over the origin that sees `width` metres across."""
    camera = bpy.data.cameras.new("Camera")
    camera.type, camera.ortho_scale, camera.clip_end = "ORTHO", width, 1000.0
    scene.camera = add_object(camera, (0, 0, height))
    return scene.camera


def look_at(scene: Any, location: Sequence[float], target: Sequence[float] = (0, 0, 0), lens: float = 50.0) -> Any:
    """A perspective camera."""
    camera = bpy.data.cameras.new("Camera")
    camera.lens = lens
    scene.camera = add_object(camera, location)
    turn = (Vector(target) - Vector(location)).to_track_quat("-Z", "Y")
    scene.camera.matrix_world = Matrix.Translation(location) @ turn.to_matrix().to_4x4()
    return scene.camera


def grid(count: int, across: int) -> list[tuple[float, float, float]]:
    """Centres of unit cells of a square grid around the origin, row by row from the bottom left."""
    assert count <= across * across
    middle = (across - 1) / 2
    return [(number % across - middle, number // across - middle, 0.0) for number in range(count)]


def atlas(scene: Any, builders: Sequence[Builder], across: int, shape: Callable[..., Any] = add_plane) -> list[Any]:
    """One small object for each material, seen from above."""
    look_down(scene, across)
    places = grid(len(builders), across)
    return [shape(material(build), location=place) for build, place in zip(builders, places, strict=True)]


def floor_atlas(scene: Any, builders: Sequence[Builder], across: int, elevation: float) -> list[Any]:
    """The squares of an atlas drawn out so that they are squares again for an orthographic camera that near the floor.

    What lies in one plane neither shades nor mirrors its neighbours.
    """
    camera, stretch = look_down(scene, across), 1.0 / math.sin(elevation)
    camera.location = (0, -200 * math.cos(elevation), 200 * math.sin(elevation))
    camera.rotation_euler = (math.pi / 2 - elevation, 0, 0)
    objects = []
    for (x, y, z), build in zip(grid(len(builders), across), builders, strict=False):
        objects.append(add_plane(material(build), location=(x, y * stretch, z)))
        objects[-1].scale = (1.0, stretch, 1.0)
    return objects


def image_of(pixels: Any, name: str = "Pair", **values: Any) -> Any:
    """A generated image of an array (height, width, 4), bottom row first."""
    pixels = np.asarray(pixels, np.float32)
    values = {"alpha": True, "float_buffer": True} | values
    image = bpy.data.images.new(name, pixels.shape[1], pixels.shape[0], **values)
    image.colorspace_settings.name = "Non-Color"
    image.pixels.foreach_set(np.ascontiguousarray(pixels).reshape(-1))
    image.update()
    return image


def color_card(width: int = 8, height: int = 6, seed: int = 1) -> Any:
    """Pixels of random colours, opaque."""
    pixels = np.random.default_rng(seed).random((height, width, 4))
    pixels[..., 3] = 1
    return pixels


def new_geometry_group(name: str) -> tuple[Any, Any, Any]:
    """An empty geometry nodes group, geometry in and out, with the nodes of both ends."""
    group = bpy.data.node_groups.new(name, "GeometryNodeTree")
    for way in ("INPUT", "OUTPUT"):
        if hasattr(group, "interface"):
            group.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
        else:
            (group.inputs if way == "INPUT" else group.outputs).new("NodeSocketGeometry", "Geometry")
    return group, group.nodes.new("NodeGroupInput"), group.nodes.new("NodeGroupOutput")


def open_shutter(scene: Any, length: float = 1.0, position: str = "CENTER") -> None:
    """Motion blur; its position is Cycles' own property until 4.1."""
    scene.render.use_motion_blur, scene.render.motion_blur_shutter = True, length
    owner = scene.render if hasattr(scene.render, "motion_blur_position") else scene.cycles
    owner.motion_blur_position = position


def animate(owner: Any, path: str, *keys: tuple[int, Any]) -> None:
    """Keyframes of a property."""
    for frame, value in keys:
        setattr(owner, path, value)
        owner.keyframe_insert(path, frame=frame)


def set_custom_normals(obj: Any) -> None:
    """Normals that lean to one side."""
    mesh = obj.data
    if hasattr(mesh, "use_auto_smooth"):
        mesh.use_auto_smooth = True
    normals = [(v.co.normalized() + 0.6 * v.co.normalized().orthogonal()).normalized() for v in mesh.vertices]
    mesh.normals_split_custom_set_from_vertices([tuple(normal) for normal in normals])
