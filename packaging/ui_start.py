"""Runs inside Blender for `./talbot ui`: Talbot as the engine, and every 3D viewport in rendered mode."""

from __future__ import annotations

import sys

import bpy


def main() -> None:
    bpy.context.preferences.view.show_splash = False  # it would cover the picture
    for scene in bpy.data.scenes:
        scene.render.engine = "TALBOT"
    own_scene = "default.py" in " ".join(sys.argv)
    for screen in bpy.data.screens:
        for area in screen.areas:
            if area.type != "VIEW_3D":
                continue
            space = area.spaces.active
            space.shading.type = "RENDERED"
            if own_scene and bpy.context.scene.camera:
                # A file keeps the view it was saved with; our scene has none and is shown as it renders.
                space.region_3d.view_perspective = "CAMERA"


main()
