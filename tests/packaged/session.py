"""Runs inside one Blender for `./talbot test --packaged`: installs what users install, and puts it through its paces.

    python session.py JOB.json                      beside a `bpy`
    blender -b ... --python session.py -- JOB.json  in a Blender program

The job (see packaging/launcher/packaged.py) says which steps; each leaves a line in the job's report, a JUnit file that
is written anew after every step, so that a crash shows what came before it. How the process ends is part of the test.
"""

from __future__ import annotations

import importlib
import os
import re
import sys
import traceback
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

sys.dont_write_bytecode = True
sys.path.insert(0, str(Path(__file__).parent))
# Before bpy: it says how its libraries are loaded.
from process import (
    FOLDER,
    IMAGES,
    JOB,
    Skipped,
    State,
    check,
    cycles_changed,
    difference,
    enable,
    has_engine,
    install_file,
    module_name,
    native,
    one_picture,
    render,
    render_scene,
)

# isort: split
import bpy
import exchanges
import numpy as np
import without_blender

import scenes

sys.path.insert(0, JOB["packaging"])

IN_TURN = 20
SYSTEM = r"lib(c|m|stdc\+\+|gcc_s)\.so|ld-linux"


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
            exchanges.second_copy,
            exchanges.upgrade,
            exchanges.skew,
            exchanges.other_systems,
            exchanges.read_only,
            exchanges.downgrade,
            one_picture,
            exchanges.uninstall,
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
