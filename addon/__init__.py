"""Talbot, a path tracer for Blender. One package is both a legacy add-on (3.4) and an extension (4.2 and newer).

This module registers and unregisters, nothing else.
"""

import atexit

from . import compat_ui, engine, native, properties, ui, ui_data, ui_layer, ui_motion, ui_object

bl_info = {
    "name": "Talbot",
    "author": "The Talbot developers",
    "description": "Physically based path tracer for the CPU",
    "version": (0, 1, 0),
    "blender": (3, 4, 0),
    "location": "Properties > Render > Render Engine",
    "category": "Render",
}

VERSION = ".".join(map(str, bl_info["version"]))
"""Also in the manifest. Read here: Blender takes `bl_info` from extensions once they are loaded, and the upgrade of a
legacy add-on reloads this module alone."""

_CLASSES = (
    engine.TalbotRenderEngine,
    *ui.CLASSES,
    *ui_data.CLASSES,
    *ui_object.CLASSES,
    *ui_layer.CLASSES,
    *ui_motion.CLASSES,
)
_registered = False


def register() -> None:
    """Registers everything, even when the native module is absent: the engine then says so at each render.

    Of two installed copies (an extension and a legacy add-on, say) the first one stays: they would answer for each
    other.
    """
    global _registered
    other = engine.registered_elsewhere()
    if other:
        print(f"Talbot: {other} is enabled already; disable it to use {__name__}")
        return
    problem = native.load(VERSION)
    if problem:
        print(f"Talbot: {problem}")
    properties.register()
    properties.register_classes(_CLASSES)
    compat_ui.register()
    _registered = True
    # Some Blender builds hang or crash at exit when a Python RenderEngine is still registered.
    atexit.register(unregister)


def unregister() -> None:
    """Undoes `register`; may be called twice, and at exit when Blender has torn half of it down."""
    global _registered
    atexit.unregister(unregister)
    if not _registered:
        return  # what is there belongs to another copy
    _registered = False
    compat_ui.unregister()
    # Live engines are freed by Blender itself; their finalizers stop the native work.
    properties.unregister_classes(_CLASSES)
    properties.unregister()
