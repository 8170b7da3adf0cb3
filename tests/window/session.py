"""What run.sh does in the window: one step after another on a timer, a screenshot after each.

Exits with an error when a step raises, when an edit does not change the picture of the viewport that it must change, or
when a render does not end.
"""

from __future__ import annotations

import subprocess
import sys
import time
import traceback
from collections.abc import Iterator
from pathlib import Path

import bpy

OUTPUT = Path(sys.argv[sys.argv.index("--") + 1])
FAILED: list[str] = []


def shot(name: str) -> None:
    """The whole display as a picture."""
    subprocess.run(["import", "-window", "root", str(OUTPUT / f"{name}.png")], check=True)


def same(one: str, other: str, crop: str = "500x400+300+250") -> bool:
    """Whether two screenshots agree in the viewport's middle."""
    pictures = [
        subprocess.run(
            ["convert", str(OUTPUT / f"{name}.png"), "-crop", crop, "rgb:-"], check=True, capture_output=True
        ).stdout
        for name in (one, other)
    ]
    return pictures[0] == pictures[1]


def expect(ok: bool, what: str) -> None:
    """Notes a failure and goes on."""
    print(f"[window] {'ok' if ok else 'FAILED'}: {what}", flush=True)
    if not ok:
        FAILED.append(what)


def wait_for_change(before: str, after: str, what: str) -> Iterator[float]:
    """Takes the second screenshot again and again, up to half a minute (a loaded machine), until it differs."""
    for _ in range(20):
        yield 1.5
        shot(after)
        if not same(before, after):
            break
    expect(not same(before, after), what)


def area(kind: str) -> bpy.types.Area:
    """The first editor of a kind."""
    screen = bpy.context.window_manager.windows[0].screen
    return next(a for a in screen.areas if a.type == kind)


def viewport_steps() -> Iterator[float]:
    """Rendered mode: refinement, edits, navigation, camera view, switching off and on."""
    view = area("VIEW_3D")
    space = view.spaces.active
    space.shading.type = "RENDERED"
    yield 4.0
    shot("viewport_1_started")
    cube = bpy.data.objects.get("Cube") or next(o for o in bpy.data.objects if o.type == "MESH")
    cube.location.x += 1
    yield from wait_for_change("viewport_1_started", "viewport_2_object_moved", "moving an object changes the viewport")
    shot("viewport_3_material")
    material = cube.active_material
    if material and material.node_tree and "Principled BSDF" in material.node_tree.nodes:
        material.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = (0.8, 0.1, 0.05, 1)
        yield from wait_for_change("viewport_2_object_moved", "viewport_3_material", "a colour changes the viewport")
    shot("viewport_4_world")
    world = bpy.context.scene.world
    if world and world.node_tree and "Background" in world.node_tree.nodes:
        world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.2, 0.4, 0.8, 1)
        yield from wait_for_change("viewport_3_material", "viewport_4_world", "the world changes the viewport")
    for lamp in bpy.data.lights:
        lamp.energy *= 3
    yield from wait_for_change("viewport_4_world", "viewport_5_light", "a light changes the viewport")
    for step in range(10):
        space.region_3d.view_distance *= 0.96
        space.region_3d.view_location.z += 0.05
        yield 0.05
        if step == 5:
            shot("viewport_6_moving")
    yield 2.0
    shot("viewport_7_moved")
    space.region_3d.view_perspective = "CAMERA"
    yield 3.0
    shot("viewport_8_camera")
    space.shading.type = "SOLID"
    yield 1.0
    space.shading.type = "RENDERED"
    yield 2.0


def two_viewports() -> Iterator[float]:
    """A second viewport beside the first."""
    window = bpy.context.window_manager.windows[0]
    view = area("VIEW_3D")
    region = next(r for r in view.regions if r.type == "WINDOW")
    with bpy.context.temp_override(window=window, area=view, region=region):
        bpy.ops.screen.area_split(direction="VERTICAL", factor=0.5)
    yield 1.0
    views = [a for a in window.screen.areas if a.type == "VIEW_3D"]
    expect(len(views) == 2, "the viewport was split")
    for one in views:
        one.spaces.active.shading.type = "RENDERED"
    views[-1].spaces.active.region_3d.view_perspective = "PERSP"
    yield 4.0
    shot("two_viewports")


def render_steps() -> Iterator[float]:
    """F12 while a viewport renders too."""
    scene = bpy.context.scene
    scene.render.resolution_percentage = 40
    scene.talbot.samples = 32
    ended: list[str] = []
    done, cancelled = (lambda *_: ended.append("complete")), (lambda *_: ended.append("cancel"))
    bpy.app.handlers.render_complete.append(done)
    bpy.app.handlers.render_cancel.append(cancelled)
    bpy.context.preferences.view.render_display_type = "WINDOW"
    window = bpy.context.window_manager.windows[0]
    with bpy.context.temp_override(window=window):
        bpy.ops.render.render("INVOKE_DEFAULT")
    start = time.monotonic()
    while not ended and time.monotonic() - start < 60:
        yield 0.2
    yield 1.0
    shot("render_f12")
    expect(ended == ["complete"], f"the render ended ({ended or 'not at all'})")
    for other in list(bpy.context.window_manager.windows)[1:]:
        with bpy.context.temp_override(window=other):
            bpy.ops.wm.window_close()
    yield 0.5


def panel_steps() -> Iterator[float]:
    """The properties editor in place of the first viewport: each tab, and the previews in them."""
    editor = area("VIEW_3D")
    editor.ui_type = "PROPERTIES"
    yield 0.5
    lamp = next((o.name for o in bpy.data.objects if o.type == "LIGHT"), None)
    camera = bpy.context.scene.camera.name if bpy.context.scene.camera else None
    mesh = next(o.name for o in bpy.data.objects if o.type == "MESH")
    tabs = [("RENDER", mesh), ("VIEW_LAYER", mesh), ("MATERIAL", mesh), ("WORLD", mesh), ("OBJECT", mesh)]
    tabs += [("DATA", name) for name in (lamp, camera) if name]
    for tab, name in tabs:
        bpy.context.view_layer.objects.active = bpy.data.objects[name]
        yield 0.3
        editor.spaces.active.context = tab
        yield 10.0 if tab in {"MATERIAL", "DATA"} else 1.0
        shot(f"panel_{tab.lower()}_{name}")


def all_steps() -> Iterator[float]:
    """In this order; each leaves the window as the next wants it."""
    bpy.context.scene.render.engine = "TALBOT"
    yield 0.5
    yield from viewport_steps()
    yield from two_viewports()
    yield from render_steps()
    yield from panel_steps()


def open_previews() -> None:
    """The preview panels start closed; a panel registered anew without that option starts open, below the others."""
    open_ones = ("MATERIAL_PT_preview", "WORLD_PT_preview", "DATA_PT_preview")
    for name in ("EEVEE_MATERIAL_PT_surface", *open_ones):
        panel = getattr(bpy.types, name, None)
        if panel is not None:
            bpy.utils.unregister_class(panel)
            panel.bl_options = set() if name in open_ones else {"DEFAULT_CLOSED"}
            bpy.utils.register_class(panel)


STEPS = all_steps()
open_previews()
bpy.context.preferences.view.show_splash = False  # before the window's first drawing


def tick() -> float | None:
    """The timer: runs to the next yield."""
    try:
        return next(STEPS)
    except StopIteration:
        print(f"[window] {len(FAILED)} failed", flush=True)
    except Exception:
        traceback.print_exc()
        FAILED.append("a step raised")
    if FAILED:
        sys.stdout.flush()
        sys.exit(1)
    bpy.ops.wm.quit_blender()
    return None


bpy.app.timers.register(tick, first_interval=2.0)
