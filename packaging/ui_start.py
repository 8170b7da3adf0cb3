"""Runs inside Blender for `./talbot ui`: Talbot as the engine, and every 3D viewport in rendered mode."""

from __future__ import annotations

import bpy


def main() -> None:
    for scene in bpy.data.scenes:
        scene.render.engine = "TALBOT"
    for screen in bpy.data.screens:
        for area in screen.areas:
            if area.type == "VIEW_3D":
                area.spaces.active.shading.type = "RENDERED"


main()
