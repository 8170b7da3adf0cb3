"""Blender's own panels and node menu, opened to Talbot, and closed again when it leaves."""

import sys
from collections.abc import Callable, Iterator
from typing import Any

import bpy

from .ui import ENGINE

_EXCLUDED = {
    "VIEWLAYER_PT_filter",  # 5.0: has the switches of hair, volumes and motion blur too
    "RENDER_PT_freestyle",
    "OBJECT_PT_shading",  # 5.0: has less than Talbot's own
    "DATA_PT_light",  # Talbot's own light panel shows the type
    "EEVEE_WORLD_PT_mist",
    "WORLD_PT_viewport_display",
}
"""Panels of Blender's general list that would promise what Talbot does not do, or say it twice."""

_EXTRA = (
    "DATA_PT_camera_dof",
    "DATA_PT_camera_dof_aperture",
    "EEVEE_MATERIAL_PT_context_material",
    "EEVEE_MATERIAL_PT_surface",
    "EEVEE_WORLD_PT_surface",
    "MATERIAL_PT_preview",
    "VIEWLAYER_PT_layer_passes",
    "VIEWLAYER_PT_layer_passes_aov",
    "VIEWLAYER_PT_layer_passes_lightgroups",
    "VIEWLAYER_PT_override",
    "WORLD_PT_context_world",
    "DATA_PT_preview",
)
"""Panels that Blender lists for its own engines only."""

_changed: list[tuple[Any, set[str]]] = []
_poll_before: Callable[[Any], bool] | None = None


def _panels() -> Iterator[Any]:
    for panel in bpy.types.Panel.__subclasses__():
        if panel.__name__ not in _EXCLUDED and "BLENDER_RENDER" in getattr(panel, "COMPAT_ENGINES", ()):
            yield panel
    for name in _EXTRA:
        panel = getattr(bpy.types, name, None)
        if panel is not None and hasattr(panel, "COMPAT_ENGINES"):
            yield panel


def register() -> None:
    """Opens the panels. A new set for each: several classes may share one."""
    for panel in _panels():
        if ENGINE not in panel.COMPAT_ENGINES:
            _changed.append((panel, panel.COMPAT_ENGINES))
            panel.COMPAT_ENGINES = set(panel.COMPAT_ENGINES) | {ENGINE}
    _open_node_menu()


def unregister() -> None:
    """Puts back what there was."""
    while _changed:
        panel, before = _changed.pop()
        panel.COMPAT_ENGINES = before
    _close_node_menu()


def _node_items() -> Any:
    return sys.modules.get("nodeitems_builtins")


def _open_node_menu() -> None:
    """Up to 3.4 the shader editor's Add menu asks for the engine by name; newer menus are open to any."""
    global _poll_before
    items = _node_items()
    poll = getattr(items, "cycles_shader_nodes_poll", None)
    if poll is not None and _poll_before is None:
        _poll_before = poll
        items.cycles_shader_nodes_poll = lambda context: context.engine == ENGINE or poll(context)


def _close_node_menu() -> None:
    global _poll_before
    if _poll_before is not None:
        _node_items().cycles_shader_nodes_poll = _poll_before
        _poll_before = None
