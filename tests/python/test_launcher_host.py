"""What the launcher promises about the Blender it starts."""

from __future__ import annotations

import importlib.util
import os
import sys
from pathlib import Path

import bpy
import pytest


def test_runs_in_background() -> None:
    assert bpy.app.background


def test_arguments_reach_the_script_like_in_blender() -> None:
    assert "--" in sys.argv
    assert any(argument.startswith("--junitxml=") for argument in sys.argv[sys.argv.index("--") :])


def test_add_on_comes_from_the_stage() -> None:
    spec = importlib.util.find_spec("talbot")
    assert spec is not None and spec.submodule_search_locations is not None
    assert list(spec.submodule_search_locations) == [
        os.path.join(os.environ["BLENDER_USER_SCRIPTS"], "addons", "talbot")
    ]


def test_user_configuration_is_not_touched() -> None:
    config = Path(bpy.utils.user_resource("CONFIG"))
    assert Path.home() / ".config" not in config.parents


def test_a_render_dumps_its_scene_when_asked(
    empty_scene: bpy.types.Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    empty_scene.collection.objects.link(camera)
    empty_scene.camera = camera
    empty_scene.render.engine = "TALBOT"
    empty_scene.render.resolution_x = empty_scene.render.resolution_y = 8
    empty_scene.talbot.samples = 1
    monkeypatch.setenv("TALBOT_DUMP", str(tmp_path / "scene.talbot"))
    bpy.ops.render.render()
    assert (tmp_path / "scene.talbot").stat().st_size > 100
