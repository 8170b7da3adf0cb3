"""What a pass over a scene of many instances takes, and what is left of it."""

from __future__ import annotations

import tracemalloc
from typing import Any

import bpy
import pytest
from pair_scenes import add_mesh
from sync_recorder import RecordingSession


class ForgetfulSession(RecordingSession):
    """Keeps nothing of what grows with the instances."""

    def set_objects(self, arrays: dict[str, Any]) -> None:
        self.counts = {name: len(values) for name, values in arrays.items()}


@pytest.mark.parametrize("persistent", [False, True])
def test_instances_take_no_memory(empty_scene: Any, persistent: bool) -> None:
    """What is left of a pass does not grow with the instances, and on the way little is held of each."""
    from talbot.sync.depsgraph import SceneSync

    scene = bpy.context.scene
    scene.render.use_persistent_data = persistent
    cells = 150
    points = [(x, y, 0) for y in range(cells + 1) for x in range(cells + 1)]
    corners = [y * (cells + 1) + x for y in range(cells) for x in range(cells)]
    parent = add_mesh(points, [(a, a + 1, a + cells + 2, a + cells + 1) for a in corners])
    add_mesh([(0, 0, 0), (1, 0, 0), (1, 1, 0)], [(0, 1, 2)]).parent = parent
    parent.instance_type = "FACES"
    depsgraph = bpy.context.evaluated_depsgraph_get()
    session = ForgetfulSession()
    sync = SceneSync(session)
    tracemalloc.start()
    for _ in range(2):  # the first time modules, names and meshes are kept too
        before = tracemalloc.get_traced_memory()[0]
        tracemalloc.reset_peak()
        sync.full(depsgraph, scene, depsgraph.view_layer_eval, width=16, height=16, viewport=False)
        after, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    count = session.counts["matrix"]
    assert count > cells * cells
    assert session.counts["mesh"] == session.counts["visibility"] < 4, "instances share a row"
    assert (after - before) / count < 4
    assert (peak - before) / count < 250
