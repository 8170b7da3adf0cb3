"""Renders node probes: a wall of emitting tiles, one pixel each.

New golden numbers, by the Cycles of the running Blender:
`blender -b --factory-startup --python tests/python/probe_scene.py -- tests/python/golden/nodes_3.4.json`.
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
from typing import Any

import bpy
import numpy as np

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

from node_probes import all_probes

TILES = 30
"""Tiles a side of the picture."""


def reset_scene(engine: str) -> Any:
    """An empty scene without light, looked at from above, a square metre to the pixel."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    scene.render.engine = engine
    scene.render.resolution_x = scene.render.resolution_y = TILES
    scene.render.resolution_percentage = 100
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    scene.view_settings.view_transform = "Raw" if bpy.app.version < (4, 0, 0) else "Standard"
    settings = scene.cycles
    settings.samples = 1
    settings.max_bounces = 0
    settings.use_adaptive_sampling = settings.use_denoising = False
    settings.sample_clamp_indirect = settings.sample_clamp_direct = 0
    settings.pixel_filter_type = "BLACKMAN_HARRIS"
    settings.filter_width = 0.01
    data = bpy.data.cameras.new("camera")
    data.type = "ORTHO"
    data.ortho_scale = TILES
    camera = bpy.data.objects.new("camera", data)
    camera.location = (TILES / 2, TILES / 2, 50)
    scene.collection.objects.link(camera)
    scene.camera = camera
    return scene


def add_tile(scene: Any, index: int, material: Any) -> None:
    x, y = index % TILES, index // TILES
    mesh = bpy.data.meshes.new(f"tile{index}")
    mesh.from_pydata([(x, y, 0), (x + 1, y, 0), (x + 1, y + 1, 0), (x, y + 1, 0)], [], [(0, 1, 2, 3)])
    mesh.materials.append(material)
    scene.collection.objects.link(bpy.data.objects.new(f"tile{index}", mesh))


def build_probes(scene: Any) -> list[str]:
    """One tile for every probe this Blender can build; their names."""
    names: list[str] = []
    for name, build in all_probes():
        material = bpy.data.materials.new(name)
        material.use_nodes = True
        tree = material.node_tree
        tree.nodes.clear()
        output = tree.nodes.new("ShaderNodeOutputMaterial")
        try:
            socket = build(tree)
        except (RuntimeError, AttributeError, TypeError):
            # No such node, property or enum item in this version.
            bpy.data.materials.remove(material)
            continue
        emission = tree.nodes.new("ShaderNodeEmission")
        tree.links.new(socket, emission.inputs["Color"])
        tree.links.new(emission.outputs[0], output.inputs["Surface"])
        add_tile(scene, len(names), material)
        names.append(name)
    return names


def read_pixels(path: str) -> Any:
    image = bpy.data.images.load(path)
    image.colorspace_settings.name = "Non-Color"
    width, height = image.size
    pixels = np.empty(width * height * 4, dtype=np.float32)
    image.pixels.foreach_get(pixels)
    bpy.data.images.remove(image)
    return pixels.reshape(height, width, 4)


def render_probes(engine: str) -> dict[str, list[float]]:
    """Every probe's colour, as this engine sees it."""
    scene = reset_scene(engine)
    names = build_probes(scene)
    assert len(names) <= TILES * TILES
    with tempfile.TemporaryDirectory() as folder:
        scene.render.filepath = os.path.join(folder, "probes.exr")
        bpy.ops.render.render(write_still=True)
        pixels = read_pixels(scene.render.filepath)
    return {name: [float(c) for c in pixels[i // TILES, i % TILES, :3]] for i, name in enumerate(names)}


def main() -> None:
    path = sys.argv[sys.argv.index("--") + 1]
    values = render_probes("CYCLES")
    rows = [f"{json.dumps(name)}: [{', '.join(f'{c:.7g}' for c in value)}]" for name, value in values.items()]
    with open(path, "w") as file:
        file.write("{\n" + ",\n".join(rows) + "\n}\n")
    print(f"{len(values)} probes in {path}")


if __name__ == "__main__":
    main()
