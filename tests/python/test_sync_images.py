"""Images: files, packed bytes, pixels, tiles, sequences."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from sync_recorder import synchronise


def show(image: Any, kind: str = "ShaderNodeTexImage") -> Any:
    """A plane whose material shows the image; the node."""
    bpy.ops.mesh.primitive_plane_add()
    material = bpy.data.materials.new("Shows")
    material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    output, emission, node = (tree.nodes.new(k) for k in ("ShaderNodeOutputMaterial", "ShaderNodeEmission", kind))
    node.image = image
    tree.links.new(node.outputs["Color"], emission.inputs["Color"])
    tree.links.new(emission.outputs[0], output.inputs["Surface"])
    bpy.context.object.data.materials.append(material)
    return node


def save_picture(path: Path, value: float) -> None:
    """A 2x2 PNG of one grey."""
    image = bpy.data.images.new("Saved", 2, 2)
    image.pixels.foreach_set([value] * 3 * 4 + [1.0] * 4)
    image.filepath_raw = str(path)
    image.file_format = "PNG"
    image.save()
    bpy.data.images.remove(image)


def only_image(session: Any) -> dict[str, Any]:
    (values,) = session.images.values()
    return values


def test_file(empty_scene: Any, tmp_path: Path) -> None:
    save_picture(tmp_path / "a.png", 0.5)
    image = bpy.data.images.load(str(tmp_path / "a.png"))
    image.colorspace_settings.name = "Non-Color"
    image.alpha_mode = "CHANNEL_PACKED"
    node = show(image)
    session, _, result = synchronise()
    values = only_image(session)
    assert result.warnings == []
    assert values["path"] == str(tmp_path / "a.png")
    assert "pixels" not in values and "bytes" not in values
    assert (values["colorspace"], values["alpha"]) == ("Non-Color", "channel_packed")
    sent = session.node("Material 'Shows'", "ShaderNodeTexImage")
    assert sent["properties"]["image"] in session.images
    assert sent["properties"]["interpolation"] == node.interpolation
    assert sent["properties"]["extension"] == "REPEAT"


def test_missing_and_none(empty_scene: Any, tmp_path: Path) -> None:
    save_picture(tmp_path / "gone.png", 0.5)
    image = bpy.data.images.load(str(tmp_path / "gone.png"))
    (tmp_path / "gone.png").unlink()
    show(image)
    session, _, _ = synchronise()
    assert only_image(session)["path"].endswith("gone.png"), "the engine says that it is missing"
    bpy.data.images.remove(image)
    session, _, _ = synchronise()
    assert session.images == {}
    assert session.node("Material 'Shows'", "ShaderNodeTexImage")["properties"]["image"] == -1


def test_packed(empty_scene: Any, tmp_path: Path) -> None:
    save_picture(tmp_path / "p.png", 0.5)
    content = (tmp_path / "p.png").read_bytes()
    image = bpy.data.images.load(str(tmp_path / "p.png"))
    image.pack()
    (tmp_path / "p.png").unlink()
    show(image)
    session, _, _ = synchronise()
    assert only_image(session)["bytes"] == content


@pytest.mark.parametrize("is_float", [False, True])
def test_generated(empty_scene: Any, is_float: bool) -> None:
    image = bpy.data.images.new("Made", 4, 2, float_buffer=is_float)
    image.generated_color = (1.0, 0.5, 0.0, 1.0)
    show(image, "ShaderNodeTexEnvironment")
    session, _, _ = synchronise()
    values = only_image(session)
    assert (values["width"], values["height"]) == (4, 2)
    assert values["pixels"].dtype == np.float32 and values["pixels"].shape == (32,)
    assert values["pixels_are_float"] is is_float
    assert values["pixels"][:4] == pytest.approx([1.0, 0.214 if is_float else 0.502, 0.0, 1.0], abs=2e-3)


def test_painted(empty_scene: Any, tmp_path: Path) -> None:
    save_picture(tmp_path / "t.png", 0.0)
    image = bpy.data.images.load(str(tmp_path / "t.png"))
    image.pixels.foreach_set([1.0, 0.0, 0.0, 1.0] * 4)
    image.update()
    show(image)
    session, _, _ = synchronise()
    assert only_image(session)["pixels"].reshape(4, 4).tolist() == [[1, 0, 0, 1]] * 4


def test_tiles(empty_scene: Any, tmp_path: Path) -> None:
    for number in (1001, 1012):
        save_picture(tmp_path / f"u.{number}.png", 0.5)
    image = bpy.data.images.load(str(tmp_path / "u.1001.png"))
    image.source = "TILED"
    image.filepath = str(tmp_path / "u.<UDIM>.png")
    image.tiles.new(1012)
    show(image)
    session, _, _ = synchronise()
    values = only_image(session)
    assert values["path"].endswith("u.<UDIM>.png")
    assert values["tiles"] == [1001, 1012]


def test_sequence(empty_scene: Any, tmp_path: Path) -> None:
    for frame in (1, 2, 3):
        save_picture(tmp_path / f"s.{frame:04d}.png", 0.1 * frame)
    image = bpy.data.images.load(str(tmp_path / "s.0001.png"))
    image.source = "SEQUENCE"
    node = show(image)
    node.image_user.frame_duration = 3
    node.image_user.frame_start = 1
    node.image_user.use_auto_refresh = True
    for frame, expected in ((2, "s.0002.png"), (5, "s.0003.png")):
        bpy.context.scene.frame_set(frame)
        session, _, _ = synchronise()
        assert only_image(session)["path"].endswith(expected)


def test_shared_between_materials(empty_scene: Any) -> None:
    image = bpy.data.images.new("Shared", 1, 1)
    show(image)
    show(image)
    session, _, _ = synchronise()
    assert session.calls.count("add_image") == 1
