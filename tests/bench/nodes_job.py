"""Runs inside Blender for nodes.py: the time of a picture of many copies of one node, less that of its inputs alone."""

import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import bpy

sys.path.insert(0, str(Path(__file__).parents[1] / "python"))
sys.path.insert(0, str(Path(__file__).parent))

import materials
from job import run
from node_probes import all_probes

SIZE = 256
COPIES = 16
SECONDS = 1.0
"""Aimed at, for a picture."""
A_FAMILY = 3
Build = Callable[[Any], Any]


def wall() -> bpy.types.Scene:
    """A plane that fills an orthographic picture, no light but its own."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    scene.render.resolution_x = scene.render.resolution_y = SIZE
    scene.render.resolution_percentage = 100
    settings = scene.cycles
    settings.device = "CPU"
    settings.max_bounces = 0
    settings.use_adaptive_sampling = settings.use_denoising = False
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.data.type, camera.data.ortho_scale, camera.location = "ORTHO", 2, (0, 0, 5)
    mesh = bpy.data.meshes.new("Wall")
    mesh.from_pydata([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], [], [(0, 1, 2, 3)])
    plane = bpy.data.objects.new("Wall", mesh)
    for made in (camera, plane):
        scene.collection.objects.link(made)
    scene.camera = camera
    return scene


class Varied:
    """Inputs that differ from pixel to pixel and from copy to copy: neither folded nor shared."""

    def __init__(self, tree: Any) -> None:
        self.tree = tree
        self.place = tree.nodes.new("ShaderNodeTexCoord").outputs["Object"]

    def shifted(self, copy: int, source: Any = None) -> Any:
        """The place in the picture times a number of the copy, added to the source."""
        node = self.tree.nodes.new("ShaderNodeVectorMath")
        node.operation = "MULTIPLY_ADD"
        self.tree.links.new(self.place, node.inputs[0])
        node.inputs[1].default_value = [0.4 + 0.01 * copy, 0.3 - 0.01 * copy, 0.2]
        if source is not None:
            self.tree.links.new(source, node.inputs[2])
        return node.outputs[0]

    def sum(self, outputs: list[Any]) -> Any:
        total = outputs[0]
        for output in outputs[1:]:
            node = self.tree.nodes.new("ShaderNodeVectorMath")
            self.tree.links.new(total, node.inputs[0])
            self.tree.links.new(output, node.inputs[1])
            total = node.outputs[0]
        return total


def show(output: Any) -> None:
    """The wall glows with it."""
    tree = output.id_data
    emission = tree.nodes.new("ShaderNodeEmission")
    tree.links.new(output, emission.inputs["Color"])
    target = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(emission.outputs[0], target.inputs["Surface"])


def copies(build: Build | None, links: int) -> bool:
    """The wall's new material: copies of a node, or (None) of what feeds its linked inputs. False: nothing to vary."""
    material = new_material()
    varied = Varied(material.node_tree)
    outputs = []
    for copy in range(COPIES):
        if build is None:
            outputs += [varied.shifted(copy + COPIES * link) for link in range(links)]
            continue
        output = build(material.node_tree)
        fed = [s for s in output.node.inputs if s.is_linked and s.type in {"VECTOR", "RGBA", "VALUE"}]
        for link, socket in enumerate(fed):
            material.node_tree.links.new(varied.shifted(copy + COPIES * link, socket.links[0].from_socket), socket)
        if not fed:
            return False
        outputs.append(output)
    show(varied.sum(outputs))
    return True


def new_material() -> Any:
    material = bpy.data.materials.new("Measured")
    material.use_nodes = True
    material.node_tree.nodes.clear()
    slots = bpy.data.meshes["Wall"].materials
    slots.clear()
    slots.append(material)
    return material


def seconds(scene: bpy.types.Scene, samples: int) -> float:
    """Processor time of all threads together: other work on the machine hardly counts."""
    scene.cycles.samples = samples
    begin = time.process_time()
    bpy.ops.render.render()
    return time.process_time() - begin


def sample_time(scene: bpy.types.Scene) -> float:
    """Seconds of one sample of the picture: the slope between one and many."""
    seconds(scene, 1)
    one = min(seconds(scene, 1), seconds(scene, 1))
    slope = max((seconds(scene, 9) - one) / 8, 1e-5)
    many = max(8, min(4096, round(SECONDS / slope)))
    return (min(seconds(scene, many + 1), seconds(scene, many + 1)) - one) / many


def linked_inputs(build: Build) -> int:
    output = build(new_material().node_tree)
    return sum(s.is_linked for s in output.node.inputs)


def chosen(job: dict[str, Any]) -> Iterator[tuple[str, Build]]:
    """Probes that this Blender can build, each at one vector."""
    families: dict[str, list[tuple[str, Build]]] = {}
    for name, build in all_probes():
        parts = name.split("/")
        if {"b", "c"} & set(parts) or (job["names"] and not name.startswith(tuple(job["names"]))):
            continue
        try:
            linked_inputs(build)
        except (RuntimeError, AttributeError, TypeError):
            continue  # no such node, property or item in this version
        families.setdefault(parts[0], []).append((name, build))
    for members in families.values():
        keep = members if job["every"] else [members[i * (len(members) - 1) // (A_FAMILY - 1)] for i in range(A_FAMILY)]
        yield from dict(keep).items()


def measure(job: dict[str, Any]) -> dict[str, dict[str, float]]:
    scene = wall()
    if job["threads"]:
        scene.render.threads_mode, scene.render.threads = "FIXED", job["threads"]
    pixels = SIZE * SIZE
    empty: dict[tuple[str, int], float] = {}
    answer: dict[str, dict[str, float]] = {}
    for name, build in chosen(job):
        links = linked_inputs(build)
        for engine in ("CYCLES", "TALBOT"):
            scene.render.engine = engine
            if (engine, links) not in empty:
                copies(None, max(links, 1))
                empty[engine, links] = sample_time(scene)
            if copies(build, 0):
                cost = (sample_time(scene) - empty[engine, links]) / (pixels * COPIES) * 1e9
                answer.setdefault(name, {})[engine] = max(cost, 0.0)
    for name, paint in materials.ALL.items():
        if job["names"] and not name.startswith(tuple(job["names"])):
            continue
        for engine in ("CYCLES", "TALBOT"):
            scene.render.engine = engine
            copies(None, 1)
            before = sample_time(scene)
            tree = new_material().node_tree
            show(paint(tree))
            cost = (sample_time(scene) - before) / pixels * 1e9
            answer.setdefault(f"{name} ({len(tree.nodes)} nodes)", {})[engine] = max(cost, 0.0)
    return answer


run(measure)
