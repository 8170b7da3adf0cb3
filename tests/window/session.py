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
from mathutils import Euler

OUTPUT = Path(sys.argv[sys.argv.index("--") + 1])
FAILED: list[str] = []


def shot(name: str) -> None:
    """The whole display as a picture."""
    subprocess.run(["import", "-window", "root", str(OUTPUT / f"{name}.png")], check=True)


def middle_of(editor: bpy.types.Area) -> str:
    """The middle of an editor as ImageMagick's crop: without the headers and the text that a viewport writes on top."""
    region = next(r for r in editor.regions if r.type == "WINDOW")
    width, height = region.width // 2, region.height // 2
    top = bpy.context.window_manager.windows[0].height - region.y - region.height
    return f"{width}x{height}+{region.x + width // 2}+{top + height // 2}"


def same(one: str, other: str, crop: str) -> bool:
    """Whether two screenshots agree within the crop."""
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


def wait_for_change(editor: bpy.types.Area, before: str, after: str, what: str) -> Iterator[float]:
    """Takes the second screenshot again and again, up to half a minute (a loaded machine), until it differs."""
    crop = middle_of(editor)
    for _ in range(20):
        yield 1.5
        shot(after)
        if not same(before, after, crop):
            break
    expect(not same(before, after, crop), what)


def principled() -> bpy.types.Node | None:
    """The Principled node of the material that the steps colour, where it has one."""
    material = subject().active_material
    return material.node_tree.nodes.get("Principled BSDF") if material and material.node_tree else None


def background() -> bpy.types.Node | None:
    """The world's."""
    world = bpy.context.scene.world
    return world.node_tree.nodes.get("Background") if world and world.node_tree else None


def subject() -> bpy.types.Object:
    """The object that the steps move and colour."""
    return bpy.data.objects.get("Cube") or next(o for o in bpy.data.objects if o.type == "MESH")


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
    subject().location.x += 1
    yield from wait_for_change(
        view, "viewport_1_started", "viewport_2_object_moved", "moving an object changes the viewport"
    )
    shot("viewport_3_material")
    if principled():
        principled().inputs["Base Color"].default_value = (0.8, 0.1, 0.05, 1)
        yield from wait_for_change(
            view, "viewport_2_object_moved", "viewport_3_material", "a colour changes the viewport"
        )
    shot("viewport_4_world")
    if background():
        background().inputs["Color"].default_value = (0.2, 0.4, 0.8, 1)
        yield from wait_for_change(view, "viewport_3_material", "viewport_4_world", "the world changes the viewport")
    for lamp in bpy.data.lights:
        lamp.energy *= 3
    yield from wait_for_change(view, "viewport_4_world", "viewport_5_light", "a light changes the viewport")
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


def set_adaptive(obj: bpy.types.Object, on: bool) -> None:
    """Adaptive subdivision: a switch of the object with the experimental features, later of the modifier."""
    if hasattr(obj.modifiers[-1], "use_adaptive_subdivision"):
        obj.modifiers[-1].use_adaptive_subdivision = on
    else:
        bpy.context.scene.cycles.feature_set = "EXPERIMENTAL"
        obj.cycles.use_adaptive_subdivision = on


def subdivision_steps() -> Iterator[float]:
    """Adaptive subdivision on, off and on again, with the view near, far and turned; then Simplify's culling."""
    scene, view, obj = bpy.context.scene, area("VIEW_3D"), subject()
    region = view.spaces.active.region_3d
    region.view_perspective = "PERSP"
    region.view_location, region.view_distance = obj.location, 6.0
    yield 3.0
    shot("subdivision_1_plain")
    obj.modifiers.new("Subdivision", "SUBSURF").levels = 1
    set_adaptive(obj, True)
    what = "adaptive subdivision changes the viewport"
    yield from wait_for_change(view, "subdivision_1_plain", "subdivision_2_adaptive", what)
    for step in range(12):
        set_adaptive(obj, step % 2 == 0)
        region.view_distance *= 0.8 if step < 6 else 1.25
        region.view_rotation.rotate(Euler((0.0, 0.0, 0.3)))
        if step == 7:
            scene.cycles.preview_dicing_rate = 4.0
        if step == 9:
            obj.modifiers[-1].show_viewport = False
        yield 0.3
    obj.modifiers[-1].show_viewport = True
    set_adaptive(obj, True)
    yield 3.0
    shot("subdivision_3_turned")
    scene.render.use_simplify = True
    scene.cycles.use_distance_cull, scene.cycles.distance_cull_margin = True, 0.1
    obj.cycles.use_distance_cull = True
    obj.location.x += 0.01
    yield from wait_for_change(view, "subdivision_3_turned", "subdivision_4_culled", "what is far away is left out")
    scene.cycles.use_camera_cull = True
    for _ in range(4):
        obj.cycles.use_camera_cull = not obj.cycles.use_camera_cull
        obj.cycles.use_distance_cull = not obj.cycles.use_distance_cull
        region.view_rotation.rotate(Euler((0.3, 0.0, 0.5)))
        obj.location.x -= 0.01
        yield 0.5
    scene.render.use_simplify = False
    obj.modifiers.remove(obj.modifiers[-1])
    yield 3.0
    shot("subdivision_5_done")


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
    shot("two_viewports_1")
    subject().location.z += 0.5
    for number, one in enumerate(views, 1):
        what = f"moving an object changes viewport {number} of two"
        yield from wait_for_change(one, "two_viewports_1", "two_viewports_2", what)


class Render:
    """F12: started as the key does, in a job beside the window. `ended` tells how it ended and when."""

    def __init__(self) -> None:
        self.ended: list[str] = []
        self.when = 0.0
        self.handlers = {
            "render_complete": lambda *_: self._end("complete"),
            "render_cancel": lambda *_: self._end("cancel"),
        }
        for name, handler in self.handlers.items():
            getattr(bpy.app.handlers, name).append(handler)
        with bpy.context.temp_override(window=bpy.context.window_manager.windows[0]):
            bpy.ops.render.render("INVOKE_DEFAULT")

    def _end(self, how: str) -> None:
        self.ended.append(how)
        self.when = time.monotonic()

    def wait(self, seconds: float) -> Iterator[float]:
        """Until it has ended."""
        start = time.monotonic()
        while not self.ended and time.monotonic() - start < seconds:
            yield 0.1
        for name, handler in self.handlers.items():
            getattr(bpy.app.handlers, name).remove(handler)
        yield 1.0


def close_render_window() -> Iterator[float]:
    """Back to the first window alone."""
    for other in list(bpy.context.window_manager.windows)[1:]:
        with bpy.context.temp_override(window=other):
            bpy.ops.wm.window_close()
    yield 0.5


def render_steps() -> Iterator[float]:
    """F12 while a viewport renders too: to its end, and again with Escape in the middle of it."""
    scene = bpy.context.scene
    scene.render.resolution_percentage = 40
    scene.talbot.samples = 32
    bpy.context.preferences.view.render_display_type = "WINDOW"
    render = Render()
    yield from render.wait(60)
    shot("render_f12")
    expect(render.ended == ["complete"], f"the render ended ({render.ended or 'not at all'})")
    yield from close_render_window()

    scene.talbot.samples = 100000
    scene.talbot.use_adaptive_sampling = False  # a quiet machine would be done before Escape
    render = Render()
    yield 4.0
    expect(not render.ended, "a long render is under way")
    shot("render_before_escape")
    pressed = time.monotonic()
    subprocess.run(["xdotool", "mousemove", "600", "400", "key", "Escape"], check=True)
    yield from render.wait(20)
    shot("render_after_escape")
    expect(render.ended == ["cancel"], f"Escape ends the render ({render.ended or 'not at all'})")
    print(f"[window] Escape was obeyed after {render.when - pressed:.2f} s", flush=True)
    scene.talbot.samples = 32
    yield from close_render_window()


def panel_steps() -> Iterator[float]:
    """The properties editor in place of the first viewport: each tab, and the previews in them."""
    editor = area("VIEW_3D")
    editor.ui_type = "PROPERTIES"
    yield 0.5
    for lamp in bpy.data.lights:
        lamp.energy = 20  # what the viewport wanted is more than a preview shows
    lamp = next((o.name for o in bpy.data.objects if o.type == "LIGHT"), None)
    camera = bpy.context.scene.camera.name if bpy.context.scene.camera else None
    mesh = subject().name
    tabs = [("RENDER", mesh), ("VIEW_LAYER", mesh), ("MATERIAL", mesh), ("WORLD", mesh), ("OBJECT", mesh)]
    tabs += [("DATA", name) for name in (lamp, camera) if name]
    previewed = {"MATERIAL": (principled(), "Base Color"), "WORLD": (background(), "Color")}
    for tab, name in tabs:
        bpy.context.view_layer.objects.active = bpy.data.objects[name]
        yield 0.3
        editor.spaces.active.context = tab
        yield 10.0 if tab in {"MATERIAL", "WORLD", "DATA"} else 1.0
        place = f"panel_{tab.lower()}_{name}"
        shot(place)
        node, socket = previewed.get(tab, (None, ""))
        if node:
            node.inputs[socket].default_value = (0.1, 0.6, 0.1, 1)
            yield from wait_for_change(editor, place, f"{place}_green", f"the {tab.lower()} preview follows its colour")


def all_steps() -> Iterator[float]:
    """In this order; each leaves the window as the next wants it."""
    bpy.context.scene.render.engine = "TALBOT"
    yield 0.5
    yield from viewport_steps()
    yield from subdivision_steps()
    yield from two_viewports()
    yield from render_steps()
    yield from panel_steps()


def open_previews() -> None:
    """The preview panels start closed; a panel registered anew without that option starts open, below the others. Those
    that show a colour themselves are closed, so that only the previews change with it."""
    open_ones = ("MATERIAL_PT_preview", "TALBOT_WORLD_PT_preview", "DATA_PT_preview")
    for name in ("EEVEE_MATERIAL_PT_surface", "EEVEE_WORLD_PT_surface", *open_ones):
        panel = getattr(bpy.types, name)
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
