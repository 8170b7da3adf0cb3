"""Bad input gives a message in Blender's words, a picture or none, and never a crash.

What the launcher, the native session and the viewport refuse by themselves is tested with them.
"""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
import pytest
from addon_fakes import PressedEscape
from talbot import final, native
from test_addon_pictures import lines, picture, scene

__all__ = ["scene"]


def add_mesh(name: str, vertices: list[tuple[float, ...]], faces: list[tuple[int, ...]]) -> bpy.types.Object:
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(vertices, [], faces)
    obj = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(obj)
    return obj


def cube_material() -> bpy.types.Material:
    return bpy.data.objects["Cube"].data.materials[0]


def test_unreadable_file(scene: bpy.types.Scene, tmp_path: Path) -> None:
    broken = tmp_path / "broken.blend"
    broken.write_bytes(b"BLENDER-v304" + b"\xff" * 500)
    with pytest.raises(RuntimeError):
        bpy.ops.wm.open_mainfile(filepath=str(broken))
    assert np.isfinite(picture(bpy.context.scene)).all(), "the file that was open still renders"


def test_vertices_that_are_no_numbers(scene: bpy.types.Scene) -> None:
    vertices = [(0, 0, 2), (1, 0, 2), (float("nan"), 1, 2), (float("inf"), 0, 2)]
    add_mesh("Broken", vertices, [(0, 1, 2), (0, 1, 3)])
    assert np.isfinite(picture(scene)).all()
    assert any("Broken" in line and "triangle" in line for line in lines(scene)), lines(scene)


def test_faces_without_area_and_twice(scene: bpy.types.Scene) -> None:
    vertices = [(0, 0, 2), (1, 0, 2), (2, 0, 2), (0, 1, 2), (0, 0, 2)]
    add_mesh("Thin", vertices, [(0, 1, 2), (0, 1, 3), (3, 1, 0), (4, 1, 3), (0, 4, 1)])
    assert np.isfinite(picture(scene)).all()


@pytest.mark.parametrize("scale", [(0, 0, 0), (0, 1, 1), (-1, 1, 1), (1e-12, 5, -3), (1e12, 1, 1)])
def test_scales(scene: bpy.types.Scene, scale: tuple[float, float, float]) -> None:
    bpy.data.objects["Cube"].scale = scale
    bpy.data.objects["Light"].scale = scale
    assert np.isfinite(picture(scene)).all()


def test_absent_image(scene: bpy.types.Scene) -> None:
    tree = cube_material().node_tree
    texture = tree.nodes.new("ShaderNodeTexImage")
    image = bpy.data.images.new("Lost", 4, 4)
    image.source, image.filepath = "FILE", "//not/here.png"
    texture.image = image
    tree.links.new(texture.outputs["Color"], tree.nodes["Principled BSDF"].inputs["Base Color"])
    pixels = picture(scene)
    assert np.isfinite(pixels).all()
    red, green, blue, _ = pixels[10, 16]
    assert min(red, blue) > 2 * green, "magenta"
    assert any("here.png" in line or "Lost" in line for line in lines(scene))


class OtherAddonsNode(bpy.types.Node):
    """A node type that no renderer knows."""

    bl_idname = "OtherAddonsNode"
    bl_label = "Of another add-on"

    def init(self, _context: bpy.types.Context) -> None:
        self.outputs.new("NodeSocketColor", "Color")


@pytest.fixture(scope="module")
def unknown_type() -> str:
    """Stays registered: Blender 3.4 may crash over nodes whose type is gone."""
    bpy.utils.register_class(OtherAddonsNode)
    return OtherAddonsNode.bl_idname


@pytest.mark.parametrize("script", [False, True])
def test_unknown_node(scene: bpy.types.Scene, unknown_type: str, script: bool) -> None:
    """Of an add-on, or a script in a Cycles that runs none: what they are linked to counts as unlinked, there too."""
    tree = cube_material().node_tree
    node = tree.nodes.new("ShaderNodeScript" if script else unknown_type)
    if script:
        node.outputs.new("NodeSocketColor", "Color")
    emission = tree.nodes.new("ShaderNodeEmission")
    emission.inputs["Color"].default_value = (0.25, 0.5, 1.0, 1.0)
    tree.links.new(node.outputs["Color"], emission.inputs["Color"])
    tree.links.new(emission.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
    scene.cycles.use_denoising = False
    colors = {}
    for engine in ("CYCLES", "TALBOT"):
        scene.render.engine = engine
        colors[engine] = picture(scene)[10, 16]
    assert colors["TALBOT"] == pytest.approx(colors["CYCLES"], abs=3e-3)
    assert any(node.name in line and "not supported" in line for line in lines(scene)), lines(scene)


def test_links_in_a_circle(scene: bpy.types.Scene) -> None:
    tree = cube_material().node_tree
    first, second = (tree.nodes.new("ShaderNodeMath") for _ in range(2))
    tree.links.new(first.outputs[0], second.inputs[0])
    tree.links.new(second.outputs[0], first.inputs[0])
    tree.links.new(second.outputs[0], tree.nodes["Principled BSDF"].inputs["Roughness"])
    assert np.isfinite(picture(scene)).all()
    assert any("Math" in line and "closes a circle" in line for line in lines(scene))


def test_group_nodes_without_groups(scene: bpy.types.Scene) -> None:
    """A group node without a tree, and a group's input and output in a material: their sockets' own values count."""
    tree = cube_material().node_tree
    principled = tree.nodes["Principled BSDF"]
    tree.nodes.new("ShaderNodeGroup")
    tree.nodes.new("NodeGroupOutput")
    tree.links.new(tree.nodes.new("NodeGroupInput").outputs[0], principled.inputs["Roughness"])
    plain = picture(scene)
    assert np.isfinite(plain).all()
    assert plain[10, 16, 1] > 0.01, "the cube is there"


def test_sockets_linked_wrongly(scene: bpy.types.Scene) -> None:
    """Shaders where numbers belong, a colour where a shader belongs."""
    tree = cube_material().node_tree
    principled, output = tree.nodes["Principled BSDF"], tree.nodes["Material Output"]
    emission = tree.nodes.new("ShaderNodeEmission")
    for name in ("Base Color", "Roughness", "Normal"):
        tree.links.new(emission.outputs[0], principled.inputs[name])
    assert np.isfinite(picture(scene)).all()
    color = tree.nodes.new("ShaderNodeRGB")
    tree.links.new(color.outputs[0], output.inputs["Surface"])
    tree.links.new(principled.outputs[0], output.inputs["Displacement"])
    assert np.isfinite(picture(scene)).all()


def test_smallest_and_widest_picture(scene: bpy.types.Scene) -> None:
    render = scene.render
    render.resolution_x = render.resolution_y = 4
    render.resolution_percentage = 1
    with pytest.raises(RuntimeError, match="too small"):
        picture(scene)
    render.resolution_x, render.resolution_y, render.resolution_percentage = 32768, 4, 100
    scene.talbot.samples = 1
    assert picture(scene).shape[:2] == (4, 32768)


def test_a_place_that_cannot_be_written(scene: bpy.types.Scene, tmp_path: Path) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("no folder")
    scene.render.filepath = str(blocked / "out.exr")
    with pytest.raises(RuntimeError):
        bpy.ops.render.render(write_still=True)
    scene.render.filepath = str(tmp_path / "out.exr")
    assert np.isfinite(picture(scene)).all()


def test_a_picture_beyond_the_memory(scene: bpy.types.Scene) -> None:
    if native.module().available_memory() > 1 << 37:
        pytest.skip("this machine could")
    render = scene.render
    render.resolution_x = render.resolution_y = 65536
    render.resolution_percentage = 100
    with pytest.raises(RuntimeError, match="Not enough memory: a picture of 65536 x 65536 pixels"):
        picture(scene)


def test_escape_at_any_question(scene: bpy.types.Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    """While the scene is read, built and rendered; the next render is whole again."""
    whole = picture(scene)
    with monkeypatch.context() as patch:
        render = final.render
        for questions in range(12):

            def interrupted(*arguments: object, questions: int = questions) -> None:
                render(PressedEscape(arguments[0], questions), *arguments[1:])

            patch.setattr(final, "render", interrupted)
            bpy.ops.render.render()
            assert lines(scene) == []
    assert np.array_equal(picture(scene), whole)
