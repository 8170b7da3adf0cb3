"""The default scene: a still life of glass, metal and stone under an area light and a gradient sky.

Builds it in the running Blender (any supported version) with nodes that every one of them has:
    ./talbot render                          renders it
    ./talbot blender --python scenes/default.py   shows it
"""

import itertools
import math
from collections.abc import Callable

import bmesh
import bpy
from mathutils import Matrix, Vector


def new_material(name: str) -> tuple[bpy.types.Material, bpy.types.NodeTree, bpy.types.Node]:
    """A material whose tree holds an output node only."""
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    return material, tree, tree.nodes.new("ShaderNodeOutputMaterial")


def principled(name: str, color: tuple[float, float, float], **inputs: float) -> bpy.types.Material:
    """Principled BSDF with the given colour and inputs (by identifier)."""
    material, tree, output = new_material(name)
    node = tree.nodes.new("ShaderNodeBsdfPrincipled")
    node.inputs["Base Color"].default_value = (*color, 1.0)
    for key, value in inputs.items():
        node.inputs[key].default_value = value
    tree.links.new(node.outputs[0], output.inputs["Surface"])
    return material


def glass(name: str, color: tuple[float, float, float], roughness: float) -> bpy.types.Material:
    material, tree, output = new_material(name)
    node = tree.nodes.new("ShaderNodeBsdfGlass")
    node.inputs["Color"].default_value = (*color, 1.0)
    node.inputs["Roughness"].default_value = roughness
    node.inputs["IOR"].default_value = 1.5
    tree.links.new(node.outputs[0], output.inputs["Surface"])
    return material


def metal(name: str, color: tuple[float, float, float], roughness: float) -> bpy.types.Material:
    return principled(name, color, Metallic=1.0, Roughness=roughness)


def speckled(
    name: str, dark: tuple[float, float, float], light: tuple[float, float, float], scale: float
) -> bpy.types.Material:
    """Diffuse stone: two colours mixed by noise through a colour ramp, with a little bump."""
    material, tree, output = new_material(name)
    noise = tree.nodes.new("ShaderNodeTexNoise")
    noise.inputs["Scale"].default_value = scale
    noise.inputs["Detail"].default_value = 6.0
    coordinates = tree.nodes.new("ShaderNodeTexCoord")
    ramp = tree.nodes.new("ShaderNodeValToRGB")
    ramp.color_ramp.elements[0].position, ramp.color_ramp.elements[0].color = 0.42, (*dark, 1.0)
    ramp.color_ramp.elements[1].position, ramp.color_ramp.elements[1].color = 0.58, (*light, 1.0)
    bump = tree.nodes.new("ShaderNodeBump")
    bump.inputs["Strength"].default_value = 0.25
    bump.inputs["Distance"].default_value = 0.02
    diffuse = tree.nodes.new("ShaderNodeBsdfDiffuse")
    tree.links.new(coordinates.outputs["Object"], noise.inputs["Vector"])
    tree.links.new(noise.outputs[0], ramp.inputs[0])
    tree.links.new(noise.outputs[0], bump.inputs["Height"])
    tree.links.new(ramp.outputs["Color"], diffuse.inputs["Color"])
    tree.links.new(bump.outputs["Normal"], diffuse.inputs["Normal"])
    tree.links.new(diffuse.outputs[0], output.inputs["Surface"])
    return material


def tiles(name: str) -> bpy.types.Material:
    """Floor: soft two-tone checker under a faint varnish."""
    material, tree, output = new_material(name)
    coordinates = tree.nodes.new("ShaderNodeTexCoord")
    checker = tree.nodes.new("ShaderNodeTexChecker")
    checker.inputs["Color1"].default_value = (0.55, 0.5, 0.44, 1.0)
    checker.inputs["Color2"].default_value = (0.2, 0.21, 0.23, 1.0)
    checker.inputs["Scale"].default_value = 1.6
    node = tree.nodes.new("ShaderNodeBsdfPrincipled")
    node.inputs["Roughness"].default_value = 0.35
    tree.links.new(coordinates.outputs["Object"], checker.inputs["Vector"])
    tree.links.new(checker.outputs["Color"], node.inputs["Base Color"])
    tree.links.new(node.outputs[0], output.inputs["Surface"])
    return material


def add_mesh(
    name: str,
    build: Callable[[bmesh.types.BMesh], None],
    material: bpy.types.Material,
    matrix: Matrix,
    smooth: bool = True,
) -> bpy.types.Object:
    mesh = bpy.data.meshes.new(name)
    shape = bmesh.new()
    build(shape)
    for face in shape.faces:
        face.smooth = smooth
    shape.to_mesh(mesh)
    shape.free()
    mesh.materials.append(material)
    scene_object = bpy.data.objects.new(name, mesh)
    scene_object.matrix_world = matrix
    bpy.context.scene.collection.objects.link(scene_object)
    return scene_object


def revolve(profile: list[tuple[float, float]], steps: int = 96) -> Callable[[bmesh.types.BMesh], None]:
    """Surface of revolution around z of the (radius, height) profile; closed where the radius is zero."""

    def build(shape: bmesh.types.BMesh) -> None:
        rings = []
        for radius, height in profile:
            if radius == 0.0:
                rings.append([shape.verts.new((0, 0, height))])
                continue
            angles = [2 * math.pi * i / steps for i in range(steps)]
            rings.append([shape.verts.new((radius * math.cos(a), radius * math.sin(a), height)) for a in angles])
        for lower, upper in itertools.pairwise(rings):
            for i in range(steps):
                j = (i + 1) % steps
                corners = [lower[i % len(lower)], lower[j % len(lower)], upper[j % len(upper)], upper[i % len(upper)]]
                shape.faces.new(list(dict.fromkeys(corners)))

    return build


def rounded(points: list[tuple[float, float]], per_segment: int = 8) -> list[tuple[float, float]]:
    """Catmull-Rom curve through the profile's points."""
    result = []
    for i in range(len(points) - 1):
        a, b, c, d = (points[min(max(k, 0), len(points) - 1)] for k in (i - 1, i, i + 1, i + 2))
        for s in range(per_segment):
            t = s / per_segment
            result.append(
                tuple(
                    0.5 * (2 * q + (r - p) * t + (2 * p - 5 * q + 4 * r - w) * t * t + (3 * q - p - 3 * r + w) * t**3)
                    for p, q, r, w in zip(a, b, c, d, strict=True)
                )
            )
    result.append(points[-1])
    return [(max(r, 0.0), h) for r, h in result]


def add_world() -> None:
    world = bpy.data.worlds.new("Sky")
    bpy.context.scene.world = world
    world.use_nodes = True
    tree = world.node_tree
    tree.nodes.clear()
    output = tree.nodes.new("ShaderNodeOutputWorld")
    background = tree.nodes.new("ShaderNodeBackground")
    background.inputs["Strength"].default_value = 0.55
    coordinates = tree.nodes.new("ShaderNodeTexCoord")
    separate = tree.nodes.new("ShaderNodeSeparateXYZ")
    ramp = tree.nodes.new("ShaderNodeValToRGB")
    elements = ramp.color_ramp.elements
    elements[0].position, elements[0].color = 0.0, (0.95, 0.75, 0.55, 1.0)
    elements[1].position, elements[1].color = 0.75, (0.16, 0.32, 0.7, 1.0)
    middle = elements.new(0.15)
    middle.color = (0.75, 0.8, 0.9, 1.0)
    tree.links.new(coordinates.outputs["Generated"], separate.inputs[0])
    tree.links.new(separate.outputs["Z"], ramp.inputs[0])
    tree.links.new(ramp.outputs["Color"], background.inputs["Color"])
    tree.links.new(background.outputs[0], output.inputs["Surface"])


def aim(location: tuple[float, float, float], target: tuple[float, float, float]) -> Matrix:
    """A matrix at `location` whose -z axis points to `target`."""
    direction = Vector(target) - Vector(location)
    return Matrix.Translation(location) @ direction.to_track_quat("-Z", "Y").to_matrix().to_4x4()


def build() -> None:
    scene = bpy.context.scene
    for scene_object in list(bpy.data.objects):
        bpy.data.objects.remove(scene_object)

    def floor(shape: bmesh.types.BMesh) -> None:
        bmesh.ops.create_grid(shape, x_segments=1, y_segments=1, size=12)

    def ball(shape: bmesh.types.BMesh) -> None:
        bmesh.ops.create_uvsphere(shape, u_segments=96, v_segments=48, radius=1.0)

    def monkey(shape: bmesh.types.BMesh) -> None:
        bmesh.ops.create_monkey(shape)

    def cube(shape: bmesh.types.BMesh) -> None:
        bmesh.ops.create_cube(shape, size=1.0)
        bmesh.ops.bevel(
            shape, geom=list(shape.edges), offset=0.04, segments=4, profile=0.5, affect="EDGES", clamp_overlap=True
        )

    def place(x: float, y: float, z: float, scale: float, turn: float = 0.0, tilt: float = 0.0) -> Matrix:
        return (
            Matrix.Translation((x, y, z))
            @ Matrix.Rotation(math.radians(turn), 4, "Z")
            @ Matrix.Rotation(math.radians(tilt), 4, "X")
            @ Matrix.Scale(scale, 4)
        )

    add_mesh("Floor", floor, tiles("Tiles"), Matrix.Identity(4), smooth=False)
    vase = rounded(
        [(0.0, 0.0), (0.32, 0.0), (0.42, 0.1), (0.55, 0.5), (0.42, 0.95), (0.2, 1.25), (0.22, 1.45), (0.3, 1.52)]
    )
    add_mesh(
        "Vase",
        revolve(vase),
        speckled("Stone", (0.16, 0.1, 0.07), (0.78, 0.72, 0.62), 9.0),
        place(-1.15, 0.55, 0.0, 1.15),
    )
    add_mesh("Glass ball", ball, glass("Glass", (0.98, 1.0, 0.99), 0.0), place(0.25, -0.75, 0.5, 0.5))
    add_mesh("Frosted ball", ball, glass("Frosted glass", (0.75, 0.9, 0.95), 0.25), place(-0.75, -0.95, 0.26, 0.26))
    add_mesh("Copper ball", ball, metal("Copper", (0.95, 0.55, 0.36), 0.18), place(1.15, -0.2, 0.34, 0.34))
    add_mesh(
        "Block",
        cube,
        principled("Lacquer", (0.5, 0.03, 0.035), Roughness=0.12),
        place(0.95, 0.85, 0.4, 0.8, 24),
        smooth=False,
    )
    head = add_mesh("Suzanne", monkey, metal("Gold", (1.0, 0.76, 0.34), 0.08), place(0.95, 0.85, 1.2, 0.52, -18, -14))
    subdivision = head.modifiers.new("Subdivision", "SUBSURF")
    subdivision.levels = subdivision.render_levels = 2

    lamp = bpy.data.lights.new("Window", "AREA")
    lamp.shape, lamp.size, lamp.size_y = "RECTANGLE", 2.4, 1.4
    lamp.energy = 320.0
    lamp.color = (1.0, 0.9, 0.78)
    lamp_object = bpy.data.objects.new("Window", lamp)
    lamp_object.matrix_world = aim((-3.2, -1.6, 3.6), (0.0, 0.2, 0.4))
    scene.collection.objects.link(lamp_object)
    add_world()

    camera = bpy.data.cameras.new("Camera")
    camera.lens = 50
    camera.dof.use_dof = True
    camera.dof.focus_distance = 5.6
    camera.dof.aperture_fstop = 4.0
    camera_object = bpy.data.objects.new("Camera", camera)
    camera_object.matrix_world = aim((1.1, -6.1, 2.35), (0.0, 0.05, 0.78))
    scene.collection.objects.link(camera_object)
    scene.camera = camera_object
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 1280, 720, 100
    scene.cycles.samples = 128


build()
