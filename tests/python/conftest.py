"""Fixtures of the tests that run inside Blender."""

from __future__ import annotations

from collections.abc import Iterator

import bpy
import pytest
from pair_scenes import SIZE, set_world


@pytest.fixture
def empty_scene() -> Iterator[bpy.types.Scene]:
    """An empty file: no objects, factory settings, add-ons as they are."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    yield bpy.context.scene
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)


@pytest.fixture
def pair_scene(empty_scene: bpy.types.Scene) -> bpy.types.Scene:
    """An empty scene for a small picture without whatever the two engines do differently on purpose."""
    scene = empty_scene
    scene.render.resolution_x = scene.render.resolution_y = SIZE
    scene.render.resolution_percentage = 100
    cycles = scene.cycles
    cycles.use_denoising = cycles.use_adaptive_sampling = False
    cycles.sampling_pattern = "TABULATED_SOBOL" if bpy.app.version >= (4, 0, 0) else "SOBOL"
    cycles.sample_clamp_indirect = 0.0
    cycles.blur_glossy = 0.0
    cycles.light_sampling_threshold = 0.0
    set_world(scene, 0.0)
    return scene
