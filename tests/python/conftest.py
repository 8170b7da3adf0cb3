"""Fixtures of the tests that run inside Blender."""

from __future__ import annotations

from collections.abc import Iterator

import bpy
import pytest


@pytest.fixture
def empty_scene() -> Iterator[bpy.types.Scene]:
    """An empty file: no objects, factory settings, add-ons as they are."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    yield bpy.context.scene
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
