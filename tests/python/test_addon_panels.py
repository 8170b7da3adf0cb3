"""Every panel of Talbot draws, for every kind of object, with properties and operators that this Blender has."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import bpy
import pytest
from talbot.ui import TalbotPanel

KINDS = ("MESH", "LIGHT", "CAMERA", "EMPTY")


class Layout:
    """What a panel draws on: refuses what is not there."""

    def __init__(self, drawn: set[str]) -> None:
        self.drawn = drawn

    def _inside(self, **_style: Any) -> Layout:
        return Layout(self.drawn)

    row = column = split = box = grid_flow = _inside

    def prop(self, owner: Any, name: str, **_style: Any) -> None:
        assert name in owner.bl_rna.properties, f"{owner} has no {name}"
        self.drawn.add(name)

    def prop_search(self, owner: Any, name: str, where: Any, collection: str, **_style: Any) -> None:
        self.prop(where, collection)
        self.prop(owner, name)

    def operator(self, name: str, **_style: Any) -> SimpleNamespace:
        module, _, function = name.partition(".")
        getattr(getattr(bpy.ops, module), function).get_rna_type()  # KeyError where there is none
        self.drawn.add(name)
        return SimpleNamespace()

    def template_ID(self, owner: Any, name: str, new: str = "") -> None:
        self.prop(owner, name)
        self.operator(new)

    def template_light_linking_collection(self, _context_layout: Any, owner: Any, name: str) -> None:
        assert "template_light_linking_collection" in bpy.types.UILayout.bl_rna.functions
        self.prop(owner, name)

    def template_curve_mapping(self, owner: Any, name: str, **_style: Any) -> None:
        self.prop(owner, name)

    def template_preview(self, *_arguments: Any, **_style: Any) -> None: ...

    def template_node_view(self, *_arguments: Any, **_style: Any) -> None: ...

    def label(self, **_style: Any) -> None: ...

    def separator(self, **_style: Any) -> None: ...


def all_panels() -> list[type]:
    found, waiting = [], [TalbotPanel]
    while waiting:
        for panel in waiting.pop().__subclasses__():
            waiting.append(panel)
            if issubclass(panel, bpy.types.Panel) and panel.is_registered:
                found.append(panel)
    return found


def instance(panel: type, layout: Layout) -> Any:
    """Blender alone makes panels: the methods and constants of one, and a layout."""
    members: dict[str, Any] = {}
    for base in reversed(panel.__mro__):
        if not base.__module__.startswith("bpy") and base is not object:
            members |= {name: value for name, value in vars(base).items() if not name.startswith("__")}
    made = type(panel.__name__, (), {name: v for name, v in members.items() if name != "layout"})()
    made.layout = layout
    return made


def context_of(scene: bpy.types.Scene, kind: str) -> SimpleNamespace:
    data = {
        "MESH": bpy.data.meshes.new("Mesh"),
        "LIGHT": bpy.data.lights.new("Light", "SPOT"),
        "CAMERA": bpy.data.cameras.new("Camera"),
        "EMPTY": None,
    }[kind]
    obj = bpy.data.objects.new(kind, data)
    scene.collection.objects.link(obj)
    layer = scene.view_layers[0]
    obj.lightgroup = "Key"
    if hasattr(obj, "light_linking"):
        obj.light_linking.receiver_collection = obj.light_linking.blocker_collection = scene.collection
    material, world = bpy.data.materials.new("Material"), bpy.data.worlds.new("World")
    for tree in (material, world):
        tree.use_nodes = True
    return SimpleNamespace(
        engine="TALBOT",
        scene=scene,
        view_layer=layer,
        object=obj,
        active_object=obj,
        mesh=data if kind == "MESH" else None,
        light=data if kind == "LIGHT" else None,
        camera=data if kind == "CAMERA" else None,
        material=material,
        world=world,
        region=SimpleNamespace(width=400),
        space_data=SimpleNamespace(type="PROPERTIES", context="RENDER"),
    )


@pytest.mark.parametrize("kind", KINDS)
def test_panels_draw(empty_scene: bpy.types.Scene, kind: str) -> None:
    context = context_of(empty_scene, kind)
    if kind == "CAMERA":
        context.camera.type = "PANO"
    drawn: set[str] = set()
    polled = [panel for panel in all_panels() if panel.poll(context)]
    assert len(polled) > 15
    for panel in polled:
        made = instance(panel, Layout(drawn))
        if hasattr(panel, "draw_header"):
            made.draw_header(context)
        made.draw(context)
    assert ("lightgroup" in drawn) and "scene.view_layer_add_lightgroup" in drawn
    assert ("shadow_terminator_geometry_offset" in drawn) == (kind == "MESH")
    linked = hasattr(context.object, "light_linking") and kind != "EMPTY"
    assert ({"receiver_collection", "object.light_linking_blockers_select"} <= drawn) == linked


@pytest.mark.parametrize("name", ["aov", "lightgroups"])
def test_lists_of_passes_are_open(name: str) -> None:
    assert "TALBOT" in getattr(bpy.types, f"VIEWLAYER_PT_layer_passes_{name}").COMPAT_ENGINES
