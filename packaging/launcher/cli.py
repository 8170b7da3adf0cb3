"""The command line of `./talbot`."""

from __future__ import annotations

import argparse
import os
import sys

from launcher import doctor, hosts, native, package, render, run_tests
from launcher.common import ROOT, LauncherError, say
from launcher.scene_files import open_arguments, scene_file


def take_blender(arguments: list[str]) -> tuple[str | None, list[str]]:
    """--blender WHICH, when it comes first; what follows is not ours."""
    if arguments[:1] != ["--blender"]:
        return None, arguments
    if len(arguments) < 2:
        raise LauncherError("--blender needs a value")
    return arguments[1], arguments[2:]


def command_blender(arguments: list[str]) -> int:
    which, arguments = take_blender(arguments)
    hosts.become(hosts.find_host(which, native.prepare()), arguments)
    return 0


def command_bench(arguments: list[str]) -> int:
    script = ROOT / "tests" / "bench" / "run.py"
    if not script.exists():
        raise LauncherError(f"{script} is missing")
    native.prepare()
    sys.stdout.flush()
    os.execv(sys.executable, [sys.executable, str(script), *arguments])


def command_ui(arguments: argparse.Namespace) -> int:
    host = hosts.find_host(arguments.blender, native.prepare())
    if host.is_module:
        raise LauncherError(f"{host.name} has no window; name a Blender program.")
    if not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise LauncherError("There is no display to open a window on (DISPLAY and WAYLAND_DISPLAY are empty).")
    opening = open_arguments(scene_file(arguments.file))
    hosts.become(host, [*opening, "--python", str(ROOT / "packaging" / "ui_start.py")])
    return 0


def make_parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="./talbot", description="Talbot, a path tracer for Blender.")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    render.add_arguments(commands.add_parser("render", help="render one picture"))
    run_tests.add_arguments(commands.add_parser("test", help="run all tests"))
    blender = commands.add_parser("blender", help="start Blender with the add-on", add_help=False)
    blender.add_argument("arguments", nargs=argparse.REMAINDER, metavar="[--blender WHICH] ARGS...")
    ui = commands.add_parser("ui", help="open the window, viewport in rendered mode")
    ui.add_argument("file", nargs="?", metavar="FILE")
    ui.add_argument("--blender", metavar="WHICH", help="path to a Blender program")
    examine = commands.add_parser("doctor", help="say what was found and what is wrong")
    examine.add_argument("--blender", metavar="WHICH")
    package.add_arguments(commands.add_parser("package", help="make what users install, in dist/"))
    bench = commands.add_parser("bench", help="measure against Cycles", add_help=False)
    bench.add_argument("arguments", nargs=argparse.REMAINDER, metavar="[SCENES] [--blender WHICH]")
    return parser


def main(arguments: list[str]) -> int:
    try:
        # These two hand their arguments on untouched, so argparse must not look at them.
        if arguments[:1] == ["blender"]:
            return command_blender(arguments[1:])
        if arguments[:1] == ["bench"]:
            return command_bench(arguments[1:])
        if arguments[:1] in ([], ["help"]):
            make_parser().print_help()
            return 0
        parsed = make_parser().parse_args(arguments)
        if parsed.command == "render":
            return render.run(parsed)
        if parsed.command == "test":
            return run_tests.run(parsed)
        if parsed.command == "ui":
            return command_ui(parsed)
        if parsed.command == "doctor":
            return doctor.run(parsed.blender)
        return package.run(parsed)
    except LauncherError as error:
        say(str(error))
        return 1
    except KeyboardInterrupt:
        return 130
