"""`scene.talbot`: the render settings as Blender properties, their migration, and the operators beside them.

A property reads the value that counts (settings.py) and writes Talbot's own, so that panels and scripts show what will
be rendered, whether it was chosen in Talbot, in Cycles or nowhere.
"""

from collections.abc import Callable
from typing import Any

import bpy
from bpy.app.handlers import persistent

from . import reports
from .settings import BY_NAME, SETTINGS, Setting, effective, from_cycles, is_set

SETTINGS_VERSION = 1
"""Version of the meaning of what a file stores. Raise it together with a new entry in MIGRATIONS."""

MIGRATIONS: dict[int, Callable[[Any], None]] = {}
"""MIGRATIONS[n] turns a scene's stored settings of version n into version n + 1."""

_VERSION_KEY = "settings_version"


def _getter(setting: Setting) -> Callable[[Any], Any]:
    if setting.items:
        return lambda group: setting.to_number(effective(group, setting))
    return lambda group: effective(group, setting)


def _setter(setting: Setting) -> Callable[[Any, Any], None]:
    def assign(group: Any, value: Any) -> None:
        group[setting.name] = setting.to_number(value)
        _mark_version(group)

    return assign


def _mark_version(group: Any) -> None:
    """A file's settings carry the version they were first written with."""
    if group.get(_VERSION_KEY) is None:
        group[_VERSION_KEY] = SETTINGS_VERSION


def _changed(group: Any, _context: Any) -> None:
    """Viewports read the evaluated scene, which Blender does not renew for add-ons' properties by itself."""
    group.id_data.update_tag()


def _property(setting: Setting) -> Any:
    common = {
        "name": setting.label,
        "description": setting.description,
        "get": _getter(setting),
        "set": _setter(setting),
        "update": _changed,
    }
    if setting.items:
        items = [(*item, number) for number, item in enumerate(setting.items)]
        return bpy.props.EnumProperty(items=items, default=setting.default, **common)
    if isinstance(setting.default, bool):
        return bpy.props.BoolProperty(default=setting.default, **common)
    low, high = setting.limits
    soft_high = setting.soft_max if setting.soft_max is not None else high
    if isinstance(setting.default, int):
        return bpy.props.IntProperty(default=setting.default, min=int(low), max=int(high), **common)
    return bpy.props.FloatProperty(
        default=setting.default,
        min=low,
        max=high,
        soft_max=soft_high,
        precision=setting.precision,
        subtype="TIME_ABSOLUTE" if setting.unit == "TIME" else setting.unit,
        unit="TIME_ABSOLUTE" if setting.unit == "TIME" else "NONE",
        **common,
    )


class TalbotSceneSettings(bpy.types.PropertyGroup):
    """Render settings of a scene: what `_declare` says, while registered."""


def _declare() -> dict[str, Any]:
    """The properties, with callbacks in them.

    They are in the class only while it is registered, for Blender 4.2 never lets go of the class: with callbacks in it,
    it would keep this module, and `bpy` with it, beyond the end of Python; panels would then be freed without one, and
    the official module would crash as its process ends.
    """
    declared: dict[str, Any] = {
        "use_cycles_settings": bpy.props.BoolProperty(
            name="Use Cycles Settings",
            description="What was not changed in Talbot renders as it is set for Cycles",
            default=True,
            update=_changed,
        ),
        "show_tracebacks": bpy.props.BoolProperty(
            name="Print Tracebacks", description="Print where in Talbot an error arose, for bug reports", default=False
        ),
        "settings_version": bpy.props.IntProperty(
            name="Settings Version", description="Version of the stored settings", default=0, options={"HIDDEN"}
        ),
    }
    return declared | {setting.name: _property(setting) for setting in SETTINGS}


def migrate(scene: Any) -> None:
    """Brings a scene's stored settings up to date. A file from a newer Talbot is left as it is."""
    group = scene.talbot
    if scene.library is not None or not any(is_set(group, name) for name in BY_NAME):
        return
    version = group.get(_VERSION_KEY) or 1
    while version < SETTINGS_VERSION:
        step = MIGRATIONS.get(version)
        if step is not None:
            step(group)
        version += 1
    group[_VERSION_KEY] = version


@persistent
def _on_load(*_arguments: Any) -> None:
    reports.clear()
    for scene in bpy.data.scenes:
        migrate(scene)


class TALBOT_OT_copy_cycles_settings(bpy.types.Operator):
    """Copy the scene's Cycles settings to Talbot, so that later changes in Cycles no longer count"""

    bl_idname = "talbot.copy_cycles_settings"
    bl_label = "Copy Cycles Settings"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context: Any) -> set[str]:
        """Copies every setting that Cycles has a value for."""
        scene = context.scene
        copied = 0
        for setting in SETTINGS:
            value = from_cycles(scene, setting)
            if value is not None:
                setattr(scene.talbot, setting.name, value)
                copied += 1
        if copied == 0:
            self.report({"WARNING"}, "This scene has no Cycles settings")
            return {"CANCELLED"}
        self.report({"INFO"}, f"{copied} settings copied from Cycles")
        return {"FINISHED"}


class TALBOT_OT_clear_settings(bpy.types.Operator):
    """Forget what was changed in Talbot: the Cycles settings of the scene count again, or the defaults"""

    bl_idname = "talbot.clear_settings"
    bl_label = "Clear Talbot Settings"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context: Any) -> set[str]:
        """Removes the stored values."""
        scene = context.scene
        for name in (*BY_NAME, _VERSION_KEY):
            if is_set(scene.talbot, name):
                del scene.talbot[name]
        scene.update_tag()
        return {"FINISHED"}


_CLASSES = (TalbotSceneSettings, TALBOT_OT_copy_cycles_settings, TALBOT_OT_clear_settings)


def register() -> None:
    """Adds `Scene.talbot` and the operators."""
    TalbotSceneSettings.__annotations__ = _declare()
    register_classes(_CLASSES)
    bpy.types.Scene.talbot = bpy.props.PointerProperty(type=TalbotSceneSettings)
    if _on_load not in bpy.app.handlers.load_post:
        bpy.app.handlers.load_post.append(_on_load)


def unregister() -> None:
    """Tolerant of having been called before."""
    if _on_load in bpy.app.handlers.load_post:
        bpy.app.handlers.load_post.remove(_on_load)
    if hasattr(bpy.types.Scene, "talbot"):
        del bpy.types.Scene.talbot
    unregister_classes(_CLASSES)
    TalbotSceneSettings.__annotations__ = {}


def register_classes(classes: tuple[type, ...]) -> None:
    """In their order: a panel's parent comes before it."""
    for cls in classes:
        bpy.utils.register_class(cls)


def unregister_classes(classes: tuple[type, ...]) -> None:
    """Unregisters classes of which some may be gone already (reloaded scripts, exit)."""
    for cls in reversed(classes):
        try:
            bpy.utils.unregister_class(cls)
        except RuntimeError:
            continue
