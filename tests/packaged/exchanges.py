"""The steps of session.py that put other files in the place of what is installed, or take it away."""

from __future__ import annotations

import importlib
import os
import re
import sys
from pathlib import Path

import bpy
from process import (
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
)

import scenes


def second_copy() -> None:
    """A legacy add-on of another version beside the extension: refused in words, and the first goes on."""
    if JOB["kind"] != "extension":
        raise Skipped("there are no extensions")
    bpy.ops.preferences.addon_install(filepath=JOB["second"], overwrite=True)
    bpy.ops.preferences.addon_enable(module="talbot")
    check(difference(render(0, "TALBOT"), State.before[0]) == 0, "the picture changed")
    bpy.ops.preferences.addon_disable(module="talbot")
    check(has_engine(), "disabling the second copy took the first along")
    remove_legacy()
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
