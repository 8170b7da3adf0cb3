"""What the launcher promises about the Blender it starts."""

from __future__ import annotations

import importlib.util
import os
import sys
from pathlib import Path

import bpy


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
