"""Light linking as the engine gets it: receiver sets, masks, blocker groups."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
import pytest
from sync_recorder import synchronise

pytestmark = pytest.mark.skipif(bpy.app.version < (4, 0, 0), reason="Blender has no light linking")
EVERYTHING = ((1 << 64) - 1, -1)


def add_triangle(name: str) -> Any:
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [], [(0, 1, 2)])
    obj = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(obj)
    return obj


def add_light(name: str) -> Any:
    obj = bpy.data.objects.new(name, bpy.data.lights.new(name, "POINT"))
    bpy.context.scene.collection.objects.link(obj)
    return obj


def collect(*members: Any, state: str = "INCLUDE") -> Any:
    collection = bpy.data.collections.new("Linking")
    for obj in members:
        collection.objects.link(obj)
        collection.collection_objects[-1].light_linking.link_state = state
    return collection


def lit_by(session: Any, light: dict[str, Any]) -> set[str]:
    """Names of the objects that a lamp lights."""
    mask, _ = light.get("linking", EVERYTHING)
    sets = session.objects["receiver_set"]
    names = [session.objects["names"][index] for index in session.objects["name"]]
    return {name for name, number in zip(names, sets, strict=True) if mask >> int(number) & 1}


def test_nothing_linked_is_nothing_sent(empty_scene: Any) -> None:
    add_triangle("A")
    lamp = add_light("Lamp")
    assert lamp.light_linking.receiver_collection is None
    session, _, _ = synchronise()
    assert "receiver_set" not in session.objects and "linking" not in session.lights[0]
    assert "blocks" not in session.objects


def test_receivers(empty_scene: Any) -> None:
    a, b, c = (add_triangle(name) for name in "ABC")
    only_a, not_a, nothing, free = (add_light(name) for name in ("only a", "not a", "nothing", "free"))
    only_a.light_linking.receiver_collection = collect(a)
    not_a.light_linking.receiver_collection = collect(a, state="EXCLUDE")
    nothing.light_linking.receiver_collection = collect(free)
    c.light_linking.receiver_collection = collect(b)
    session, _, result = synchronise()
    assert not result.warnings
    lights = {light["name"]: light for light in session.lights}
    assert lit_by(session, lights["only a"]) == {"A"}
    assert lit_by(session, lights["not a"]) == {"B", "C"}
    assert lit_by(session, lights["nothing"]) == set()
    assert "linking" not in lights["free"]
    names = [session.objects["names"][index] for index in session.objects["name"]]
    own = [session.objects["linkings"][i] if i >= 0 else EVERYTHING for i in session.objects["linking"]]
    assert lit_by(session, {"linking": own[names.index("C")]}) == {"B"}
    assert own[names.index("A")] == own[names.index("B")] == EVERYTHING


def test_blockers(empty_scene: Any) -> None:
    a, b, hidden = (add_triangle(name) for name in ("A", "B", "hidden"))
    hidden.visible_shadow = False
    lamp, other = add_light("Lamp"), add_light("Other")
    lamp.light_linking.blocker_collection = collect(a, hidden)
    other.light_linking.blocker_collection = collect(a, b, state="EXCLUDE")
    session, _, _ = synchronise()
    group = {light["name"]: light["linking"][1] for light in session.lights}
    assert sorted(group.values()) == [0, 1]
    names = [session.objects["names"][index] for index in session.objects["name"]]
    blocks = dict(zip(names, session.objects["blocks"].tolist(), strict=True))
    own = 1 << group["Lamp"]
    named = 1 << 31
    assert blocks == {"A": [own, named], "B": [0, named], "hidden": [3, named]}
    visible = dict(zip(names, session.objects["visibility"].tolist(), strict=True))
    assert not visible["hidden"] & 32


def test_too_many_sets(empty_scene: Any) -> None:
    """Every object in a set of its own: all lights reach everything, and it is said."""
    for number in range(70):
        obj = add_triangle(f"T{number:02}")
        add_light(f"L{number:02}").light_linking.receiver_collection = collect(obj)
    session, _, result = synchronise()
    assert [w for w in result.warnings if "sets, more than the 64" in w]
    assert all("linking" not in light for light in session.lights)
    assert not session.objects["receiver_set"].any()


def test_many_blockers(empty_scene: Any) -> None:
    """Sixty-three collections; what is beyond is said."""
    objects = [add_triangle(f"T{number:02}") for number in range(65)]
    for number, obj in enumerate(objects):
        add_light(f"L{number:02}").light_linking.blocker_collection = collect(obj)
    session, _, result = synchronise()
    assert len([w for w in result.warnings if "more than 63 collections of shadow linking" in w]) == 2
    groups = {light["name"]: light["linking"][1] for light in session.lights if "linking" in light}
    assert sorted(groups.values()) == list(range(63))
    names = [session.objects["names"][index] for index in session.objects["name"]]
    masks = session.objects["blocks"].view(np.uint64).reshape(-1)
    blocks = {name: int(mask) for name, mask in zip(names, masks, strict=True)}
    assert all(blocks[f"T{name[1:]}"] == 1 << 63 | 1 << group for name, group in groups.items())
