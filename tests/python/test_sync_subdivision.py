"""Cages of adaptive subdivision as the engine gets them, and that nobody else notices."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
import pytest
from sync_recorder import synchronise
from test_pairs_subdivision import IN_MODIFIER, adaptive, crease, cube, fine

BEFORE_MODIFIER = "open_adaptive_subdivision_panel" in bpy.types.SubsurfModifier.bl_rna.properties


@pytest.fixture
def box(empty_scene: Any) -> Any:
    """A cube that is subdivided adaptively, its modifier's levels 1 and 2."""
    obj = cube(None)
    modifier = adaptive(obj)
    modifier.levels, modifier.render_levels = 1, 2
    fine(bpy.context.scene, 2.0)
    bpy.context.scene.cycles.preview_dicing_rate = 6.0
    bpy.context.scene.cycles.max_subdivisions = 9
    return obj


def test_cage(box: Any) -> None:
    """The cage where Cycles dices the cage, else what the modifier makes of it; the evaluated scene stays as it was."""
    crease(box.data, {4: 0.5})
    modifier = box.modifiers[-1]
    modifier.uv_smooth, modifier.boundary_smooth = "SMOOTH_ALL", "PRESERVE_CORNERS"
    session, _, result = synchronise()
    arrays = session.mesh(box.data.name)
    assert result.warnings == []
    faces = 6 if BEFORE_MODIFIER else 24  # a depsgraph of the window has the window's levels
    assert arrays["face_starts"].tolist() == list(range(0, 4 * faces + 1, 4))
    named = ("subdivision", "uv_smoothing", "sharp_corners", "in_pixels", "edge_length", "max_level")
    assert [arrays[name] for name in named] == ["catmull_clark", "all", True, True, 2.0, 9]
    if BEFORE_MODIFIER:
        assert arrays["crease_sharpness"].tolist() == pytest.approx([5.0])
        assert sorted(arrays["crease_edges"][0].tolist()) == sorted(box.data.edges[4].vertices)
    assert "vertex_normals" not in arrays
    depsgraph = bpy.context.evaluated_depsgraph_get()
    evaluated = box.evaluated_get(depsgraph)
    assert evaluated.modifiers[-1].show_viewport and evaluated.modifiers[-1].show_render
    assert len(evaluated.data.polygons) == 24
    depsgraph.update()
    synchronise()
    depsgraph.update()
    assert [update.id.name for update in depsgraph.updates] == []


def test_who_is_not_adaptive(box: Any) -> None:
    """Switched off, not the last, of another kind: the modifier's own levels."""
    modifier = box.modifiers[-1]
    modifier.show_viewport = False
    assert "subdivision" in synchronise()[0].mesh(box.data.name)  # a final render has its own switch
    assert "subdivision" not in synchronise(viewport=True)[0].mesh(box.data.name)
    modifier.show_viewport = True
    modifier.show_render = False
    assert "subdivision" not in synchronise()[0].mesh(box.data.name)
    modifier.show_render = True
    box.modifiers.new("Last", "WIREFRAME")
    assert "subdivision" not in synchronise()[0].mesh(box.data.name)
    box.modifiers.remove(box.modifiers[-1])
    if not IN_MODIFIER:
        bpy.context.scene.cycles.feature_set = "SUPPORTED"
        assert "subdivision" not in synchronise()[0].mesh(box.data.name)


def test_whose_pixels(box: Any) -> None:
    """The camera that renders, or the scene's choice; the rate of the window in the window."""
    scene = bpy.context.scene
    cameras = []
    for name, place in (("Renders", 5.0), ("Dices", 9.0)):
        camera = bpy.data.objects.new(name, bpy.data.cameras.new(name))
        scene.collection.objects.link(camera)
        camera.location.z = place
        cameras.append(camera)
    scene.camera = cameras[0]
    session, sync, _ = synchronise()
    assert session.dicing_camera == session.camera
    sent = session.calls.count("add_mesh")
    depsgraph = bpy.context.evaluated_depsgraph_get()
    scene.cycles.dicing_camera = cameras[1]
    scene.cycles.dicing_rate = 3.0
    scene.update_tag()
    depsgraph.update()
    sync.next_frame(depsgraph, depsgraph.scene_eval, depsgraph.view_layer_eval, width=160, height=90)
    assert np.reshape(session.dicing_camera["to_world"], (4, 4))[3, 2] == 9.0
    assert session.mesh(box.data.name)["edge_length"] == 3.0
    assert session.calls.count("add_mesh") == sent
    assert synchronise(viewport=True)[0].mesh(box.data.name)["edge_length"] == 6.0


def test_simple_keeps_its_shading(box: Any) -> None:
    """Flat pieces have no normals that are smooth: the cage's are sent."""
    box.modifiers[-1].subdivision_type = "SIMPLE"
    arrays = synchronise()[0].mesh(box.data.name)
    assert arrays["subdivision"] == "simple"
    assert len(arrays["vertex_normals"]) == len(arrays["positions"])
