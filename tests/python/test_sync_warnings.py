"""What cannot be sent yet is said by name."""

from __future__ import annotations

from typing import Any

import bpy
from sync_recorder import synchronise


def add_square(name: str) -> Any:
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [], [(0, 1, 2, 3)])
    mesh.update()
    obj = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(obj)
    return obj


def test_what_is_missing_is_said(empty_scene: Any) -> None:
    scene = bpy.context.scene
    add_square("Plain")
    _, _, result = synchronise()
    assert result.warnings == []
    scene.cycles.use_fast_gi = True
    _, _, result = synchronise()
    assert result.warnings == ["Scene 'Scene': fast global illumination is ignored; the full one is rendered"]
    scene.cycles.use_fast_gi = False
    bpy.data.objects["Plain"].cycles.is_caustics_caster = True
    bpy.data.objects["Plain"].update_tag()
    _, _, result = synchronise()
    (warning,) = result.warnings
    assert warning.startswith("Object 'Plain': shadow caustics are not supported yet")
