"""Memory over a long animation in one process."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import bpy
import pytest
from pair_scenes import add_box, add_lamp, add_mesh, change_material, diffuse, look_at, material, set_world

FRAMES = 200


def resident() -> int:
    """Bytes of this process that are in memory."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE")


def add_sheet(cells: int, item: Any) -> Any:
    """A square of cells x cells faces."""
    vertices = [(x / cells * 4 - 2, y / cells * 4 - 2, 0.0) for y in range(cells + 1) for x in range(cells + 1)]
    corners = [y * (cells + 1) + x for y in range(cells) for x in range(cells)]
    return add_mesh(vertices, [(a, a + 1, a + cells + 2, a + cells + 1) for a in corners], item, smooth=True)


def build(scene: Any) -> None:
    """Instances on faces, which know where they are, of the scene's first object; a sheet that waves, by a modifier and
    by displacement; a box that flies; a changing colour; blur."""
    bed = add_sheet(20, diffuse())
    child = add_box(material(lambda tree: tree("BsdfDiffuse", Color=tree("UVMap", from_instancer=True))), (0.01,) * 3)
    child.parent, bed.instance_type = bed, "FACES"

    def rough(tree: Any) -> Any:
        return tree("BsdfDiffuse", Color=tree("TexNoise"))

    item = material(rough)
    nodes, links = item.node_tree.nodes, item.node_tree.links
    displacement = nodes.new("ShaderNodeDisplacement")
    displacement.inputs["Scale"].default_value = 0.1
    links.new(nodes["Noise Texture"].outputs[0], displacement.inputs["Height"])
    links.new(displacement.outputs[0], nodes["Material Output"].inputs["Displacement"])
    change_material(item, displacement_method="DISPLACEMENT")
    sheet = add_sheet(60, item)
    sheet.modifiers.new("Wave", "WAVE")
    paint = diffuse()
    box = add_box(paint, (0.5, 0.5, 0.5))
    color = next(node for node in paint.node_tree.nodes if node.bl_idname == "ShaderNodeBsdfDiffuse").inputs["Color"]
    for frame, place in ((1, (-1, 0, 1)), (FRAMES, (1, 1, 1))):
        box.location = place
        box.keyframe_insert("location", frame=frame)
        color.default_value = (frame / FRAMES, 0.5, 0.5, 1.0)
        color.keyframe_insert("default_value", frame=frame)
    add_lamp("SUN", 2.0, (2, -2, 4), toward=(0, 0, 0))
    set_world(scene, 0.3)
    look_at(scene, (0, -6, 4))
    scene.render.use_motion_blur = True


@pytest.mark.parametrize("persistent", [False, True])
def test_two_hundred_frames(empty_scene: Any, persistent: bool) -> None:
    """The last ten frames take no more than 2 % beyond the tenth to the twentieth."""
    scene = empty_scene
    build(scene)
    scene.render.engine = "TALBOT"
    scene.render.resolution_x = scene.render.resolution_y = 16
    scene.cycles.samples = 1
    scene.cycles.use_denoising = False
    scene.render.use_persistent_data = persistent
    sizes = []
    for frame in range(1, FRAMES + 1):
        scene.frame_set(frame)
        bpy.ops.render.render()
        sizes.append(resident())
    early, late = max(sizes[10:20]), max(sizes[-10:])
    assert late <= 1.02 * early, f"{early / 1e6:.1f} MB after 20 frames, {late / 1e6:.1f} MB after {FRAMES}"
