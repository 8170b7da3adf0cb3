"""What Cycles would render and the engine cannot yet: said by name, so that no picture is silently another one."""

from typing import Any

from .. import versions
from .context import SyncContext

KINDS = {"VOLUME": "volumes"}
"""Kinds of object that are left out. (Grease pencil is drawn by Blender, over the finished picture.)"""


def warn_kind(context: SyncContext, obj: Any) -> None:
    """An object of a kind that is left out."""
    if obj.type in KINDS:
        context.warn(f"Object '{obj.name}': {KINDS[obj.type]} are not supported yet and not rendered")


def warn_object(context: SyncContext, obj: Any) -> None:
    """An object with something on it that is left out."""
    where = f"Object '{obj.name}'"
    cycles = versions.cycles_settings(obj)
    if cycles.get("is_caustics_caster", False):
        context.warn(f"{where}: shadow caustics are not supported yet; paths find the light behind it by chance only")


def warn_scene(context: SyncContext, scene: Any) -> None:
    """Settings of the scene whose effect is missing."""
    cycles = versions.cycles_settings(scene)
    if cycles.get("use_fast_gi", False):
        context.warn(f"Scene '{scene.name}': fast global illumination is ignored; the full one is rendered")
