"""Runs inside one Blender for `./talbot test --packaged`: installs what users install, and puts it through its paces.

    python session.py JOB.json                      beside a `bpy`
    blender -b ... --python session.py -- JOB.json  in a Blender program

The job (see packaging/launcher/packaged.py) says which steps; each leaves a line in the job's report, a JUnit file that
is written anew after every step, so that a crash shows what came before it. How the process ends is part of the test.
"""

from __future__ import annotations

import importlib
import json
import os
import re
import sys
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

ARGUMENTS = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else sys.argv[1:]
JOB: dict[str, Any] = json.loads(Path(ARGUMENTS[0]).read_text())
sys.dont_write_bytecode = True
sys.path[:0] = [str(Path(__file__).parent), JOB["packaging"]]

if JOB["as_program"]:
    # The official program has its libraries in the global scope, the module keeps them to itself.
    sys.setdlopenflags(os.RTLD_NOW | os.RTLD_GLOBAL)
import bpy

sys.setdlopenflags(os.RTLD_NOW)
import numpy as np
import without_blender

import scenes

IN_TURN = 20
SYSTEM = r"lib(c|m|stdc\+\+|gcc_s)\.so|ld-linux"
EXTENSION = "bl_ext.user_default.talbot"
FOLDER = Path(JOB["folder"])
IMAGES = FOLDER / "images"
Picture = np.ndarray


class Skipped(Exception):
    """Cannot be tried here; the text says why."""


class State:
    """What later steps compare with."""

    before: dict[int, Picture] = {}
    cycles: dict[int, Picture] = {}


def check(holds: bool, text: str) -> None:
    if not holds:
        raise AssertionError(text)


def render(index: int, engine: str, **settings: object) -> Picture:
    scene = scenes.build(index, IMAGES)
    try:
        scene.render.engine = engine
    except TypeError:
        raise AssertionError(f"there is no engine {engine}") from None
    for name, value in settings.items():
        setattr(scene.cycles, name, value)
    return render_scene(scene)


def render_scene(scene: bpy.types.Scene) -> Picture:
    path = FOLDER / "rendered.exr"
    path.unlink(missing_ok=True)
    if hasattr(scene.render.image_settings, "media_type"):
        scene.render.image_settings.media_type = "IMAGE"
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(str(path))
    pixels = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(pixels)
    bpy.data.images.remove(image)
    check(bool(np.isfinite(pixels).all()) and float(pixels[:3].max()) >= 0, "the picture is not of numbers")
    return pixels


def difference(a: Picture, b: Picture) -> float:
    """Largest, beside the picture's mean."""
    check(a.shape == b.shape, "the pictures differ in size")
    return float(np.abs(a - b).max() / max(float(np.abs(b).mean()), 1e-6))


def cycles_changed(index: int) -> float:
    """How Cycles' picture differs from the one before Talbot came."""
    return difference(render(index, "CYCLES"), State.cycles[index])


def module_name() -> str:
    return EXTENSION if JOB["kind"] == "extension" else "talbot"


def has_engine() -> bool:
    engines = bpy.types.RenderEngine.__subclasses__()
    return any(getattr(engine, "bl_idname", "") == "TALBOT" and engine.is_registered for engine in engines)


def install_file(path: str) -> None:
    """By Blender's own commands."""
    if JOB["kind"] == "extension":
        bpy.ops.extensions.package_install_files(filepath=path, repo="user_default", enable_on_install=True)
    else:
        bpy.ops.preferences.addon_install(filepath=path, overwrite=True)
        bpy.ops.preferences.addon_enable(module="talbot")


def cycles_alone() -> None:
    """Cycles' pictures before Talbot is anywhere near."""
    for index in range(len(scenes.SCENES)):
        State.cycles[index] = render(index, "CYCLES")


def load_another_embree() -> None:
    """As another add-on may have done: into the scope where every module's names are looked up."""
    import ctypes

    for name in ("libembree4.so.4", "libembree3.so.3"):
        try:
            ctypes.CDLL(name, os.RTLD_NOW | os.RTLD_GLOBAL)
            return
        except OSError:
            continue
    raise Skipped("there is no other Embree on this system")


def install() -> None:
    if JOB["kind"] == "pip":
        importlib.import_module("talbot").register()
    elif JOB["kind"] == "stage":
        import addon_utils

        sys.path.append(f"{os.environ['BLENDER_USER_SCRIPTS']}/addons")
        check(addon_utils.enable("talbot") is not None, "the add-on cannot be enabled")
    else:
        install_file(JOB["zip"])
    check(has_engine(), "the engine is not registered")
    check(native().problem() == "", native().problem())


def native() -> Any:
    return importlib.import_module(f"{module_name()}.native")


def enable() -> None:
    """In a process that finds the add-on installed."""
    if JOB["kind"] == "extension":
        import addon_utils

        check(addon_utils.enable(EXTENSION, default_set=True) is not None, "the extension cannot be enabled")
    else:
        bpy.ops.preferences.addon_enable(module="talbot")
    check(has_engine() and native().problem() == "", native().problem())


def pictures() -> None:
    """Five scenes; the system build leaves its pictures for the others."""
    expected = FOLDER / f"{JOB['host']}.npz"
    for index in range(len(scenes.SCENES)):
        State.before[index] = render(index, "TALBOT")
        check(float(State.before[index].mean()) > 0.05, f"scene {index} is dark")
    if JOB["kind"] == "stage":
        np.savez(expected, **{str(index): picture for index, picture in State.before.items()})
        return
    stored = np.load(expected)
    print("largest differences from the system build:", end="")
    for index, picture in State.before.items():
        print(f" {difference(picture, stored[str(index)]):.2g}", end="")
    print(flush=True)
    for index, picture in State.before.items():
        found = difference(picture, stored[str(index)])
        check(found <= JOB["tolerance"], f"scene {index} differs from the system build's by {found:.3g} of its mean")


def formats() -> None:
    """Every format that has to be read, an animated one too."""
    found = without_blender.problems(native().module())
    check(found == [], "; ".join(found))


def in_turn_with_cycles() -> None:
    """Both engines twenty times in turn: nothing changes anything."""
    for turn in range(IN_TURN):
        index = turn % len(scenes.SCENES)
        found = cycles_changed(index)
        check(found == 0, f"turn {turn}: Cycles' own picture of scene {index} changed by {found:.3g}")
        found = difference(render(index, "TALBOT"), State.before[index])
        check(found == 0, f"turn {turn}: scene {index} changed by {found:.3g}")


def who_answers() -> None:
    """No library of this process answers a name of ours, in the module and in the libraries it brings."""
    import answers

    module = Path(native().module().__file__)
    files = {file.name: file for file in (module, *module.parent.glob("libtalbot-*.so"))}
    check(len(files) > 1, "the bundle's own libraries are missing")
    for file in files.values():
        report = answers.report(str(file))
        # The bundle's libraries may answer each other's.
        strangers = [text for text in report["strangers"] if not text.split(" by ")[-1].startswith(f"{module.parent}/")]
        check(strangers == [], "; ".join(strangers[:5]))
        foreign = [name for name in report["needed"] if name not in files and not re.match(SYSTEM, name)]
        check(foreign == [], f"{file.name} needs {foreign}")


def denoise() -> None:
    if not native().denoiser_version():
        raise Skipped("this Blender has no Open Image Denoise")
    noisy, clean = render(0, "TALBOT"), render(0, "TALBOT", use_denoising=True)
    steps = [
        float(np.abs(np.diff(picture.reshape(scenes.SIZE, scenes.SIZE, 4), axis=1)).mean())
        for picture in (noisy, clean)
    ]
    check(steps[1] < 0.7 * steps[0], f"the denoised picture is not smoother: {steps}")


def threads() -> None:
    """As many as Blender says, whatever the libraries inside would like."""
    from threading import Event, Thread

    def most_threads(wanted: int) -> int:
        scene = scenes.build(0, IMAGES)
        scene.render.engine = "TALBOT"
        scene.cycles.samples = 256
        scene.render.threads_mode, scene.render.threads = "FIXED", wanted
        done, seen = Event(), []

        def watch() -> None:
            while not done.wait(0.005):
                seen.append(len(os.listdir("/proc/self/task")))

        watcher = Thread(target=watch)
        watcher.start()
        try:
            render_scene(scene)
        finally:
            done.set()
            watcher.join()
        return max(seen)

    one, five = most_threads(1), most_threads(5)
    check(five >= one + 4, f"with one thread {one} threads were seen, with five {five}")


def disable_and_enable() -> None:
    bpy.ops.preferences.addon_disable(module=module_name())
    check(not has_engine(), "the engine is still there")
    check(cycles_changed(0) == 0, "Cycles' own picture changed")
    bpy.ops.preferences.addon_enable(module=module_name())
    check(difference(render(0, "TALBOT"), State.before[0]) == 0, "the picture changed")


def upgrade() -> None:
    """While the old native module is loaded: the new files come, and Blender goes on."""
    install_file(JOB["upgrade"])
    check(installed_version() == JOB["next_version"], f"installed is {installed_version()}")
    check(has_engine(), "the engine is gone")
    check(cycles_changed(0) == 0, "Cycles' own picture changed")


def skew() -> None:
    """New Python files and the old native module: one sentence, and nothing is rendered."""
    check(sys.modules[module_name()].VERSION == JOB["next_version"], "the new Python files are not in use")
    problem = native().problem()
    check("restart Blender" in problem, f"not told to restart: {problem!r}")
    refuses_to_render("restart Blender")


def refuses_to_render(words: str) -> None:
    scene = scenes.build(0, IMAGES)
    scene.render.engine = "TALBOT"
    try:
        bpy.ops.render.render()
    except RuntimeError as error:
        check(words in str(error), str(error))
    else:
        raise AssertionError("rendered without a native module that fits")


def installed_version() -> str:
    """What the files say that are there now."""
    source = (user_folder() / "__init__.py").read_text()
    found = re.search(r'"version": \(([\d, ]+)\)', source)
    check(found is not None, "no version in the installed file")
    return found[1].replace(", ", ".")


def user_folder() -> Path:
    """Where Blender has put the add-on."""
    return Path(importlib.import_module(module_name()).__file__).parent


def other_systems() -> None:
    """The package of another Python and of another system: Blender's sentence or ours, and no wrong engine."""
    for name in ("of_another_python", "of_another_system"):
        said = ""
        try:
            install_file(JOB[name])
        except RuntimeError as error:
            said = str(error)
        if has_engine():
            said = native().problem()
            refuses_to_render(said)
        words = "isn't compatible with" if name == "of_another_python" else "is not for this Blender's Python"
        check(words in said and len(said.strip().splitlines()) == 1, f"{name}: {said!r}")
        uninstall()


def read_only() -> None:
    """Into a folder that cannot be written nothing new comes, in words, and what is there works. Blender turns an
    extension off before it looks whether it may replace it."""
    before = installed_files()
    said = ""
    try:
        install_file(JOB["upgrade"])
    except RuntimeError as error:
        said = str(error)
    check("ermission denied" in said, f"said is {said!r}")
    check(installed_files() == before, "the installed files changed")
    enable()
    one_picture()


def installed_files() -> dict[str, int]:
    user = Path(os.environ["BLENDER_USER_RESOURCES"])
    return {str(path): path.stat().st_size for path in user.rglob("*") if path.is_file() and "config" not in path.parts}


def second_copy() -> None:
    """A legacy add-on beside the extension: refused in words, and the first goes on."""
    if JOB["kind"] != "extension":
        raise Skipped("there are no extensions")
    bpy.ops.preferences.addon_install(filepath=JOB["legacy"], overwrite=True)
    bpy.ops.preferences.addon_enable(module="talbot")
    check(difference(render(0, "TALBOT"), State.before[0]) == 0, "the picture changed")
    bpy.ops.preferences.addon_disable(module="talbot")
    check(has_engine(), "disabling the second copy took the first along")
    remove_legacy()
    check(difference(render(0, "TALBOT"), State.before[0]) == 0, "the picture changed")


def one_picture() -> None:
    """The first scene, as the process before rendered it."""
    stored = np.load(FOLDER / f"{JOB['host']}.npz")
    found = difference(render(0, "TALBOT"), stored["0"])
    check(found <= JOB["tolerance"], f"it differs from the system build's by {found:.3g} of its mean")


def downgrade() -> None:
    """Back to the version whose native module is loaded; the next process finds it."""
    install_file(JOB["zip"])
    check(native().problem() == "", native().problem())
    check(difference(render(0, "TALBOT"), State.before[0]) == 0, "the picture changed")


def remove_legacy() -> None:
    try:
        bpy.ops.preferences.addon_remove(module="talbot")
    except RuntimeError as error:
        # Without a window it fails after its work is done.
        check("tag_redraw" in str(error), str(error))


def uninstall() -> None:
    if JOB["kind"] == "extension":
        repos = list(bpy.context.preferences.extensions.repos)
        index = next(index for index, repo in enumerate(repos) if repo.module == "user_default")
        bpy.ops.extensions.package_uninstall(repo_directory=repos[index].directory, repo_index=index, pkg_id="talbot")
    else:
        remove_legacy()
    check(not has_engine(), "the engine is still there")
    left = [path for path in Path(os.environ["BLENDER_USER_RESOURCES"]).rglob("_talbot*")]
    check(left == [], f"left behind: {left}")


def write_report(results: list[tuple[str, str, str]]) -> None:
    """JUnit: name, what happened ("", "failed" or "skipped") and the text."""
    suite = ElementTree.Element("testsuite", name=JOB["title"])
    for name, outcome, text in results:
        case = ElementTree.SubElement(suite, "testcase", name=f"{JOB['title']}: {name}")
        if outcome == "failed":
            ElementTree.SubElement(case, "failure", message=text.strip().split("\n")[-1]).text = text
        elif outcome == "skipped":
            ElementTree.SubElement(case, "skipped", message=text)
    unfinished = Path(JOB["report"] + ".part")
    ElementTree.ElementTree(suite).write(unfinished)
    unfinished.rename(JOB["report"])


def main() -> None:
    steps: dict[str, Callable[[], None]] = {
        step.__name__: step
        for step in (
            cycles_alone,
            load_another_embree,
            install,
            enable,
            pictures,
            formats,
            in_turn_with_cycles,
            who_answers,
            denoise,
            threads,
            disable_and_enable,
            second_copy,
            upgrade,
            skew,
            other_systems,
            read_only,
            downgrade,
            one_picture,
            uninstall,
        )
    }
    scenes.write_images(IMAGES)
    results: list[tuple[str, str, str]] = []
    for name in JOB["steps"]:
        print(f"--- {name}", flush=True)
        # A crash in this step is this step's failure.
        write_report([*results, (name, "failed", JOB["ended"])])
        try:
            steps[name]()
            results.append((name, "", ""))
        except Skipped as reason:
            results.append((name, "skipped", str(reason)))
        except Exception:
            results.append((name, "failed", traceback.format_exc()))
        write_report(results)


main()
