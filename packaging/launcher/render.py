"""`./talbot render`: one picture of one frame, with a progress line, the place of the picture and the time."""

from __future__ import annotations

import argparse
import json
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

from launcher import hosts, native
from launcher.common import ROOT, LauncherError, say
from launcher.scene_files import open_arguments, scene_file

RESULT = "talbot-render: "
PROGRESS = re.compile(r"\bFra: ?(\d+)\b")
# What Blender says at every start and end, of no use here.
CHATTER = re.compile(
    r"^(Blender \d|Blender quit|Read blend: | Time: |Read prefs: |$)|\| (Saved: |Read blend: | ?Time: )|^Saved: '"
)
QUIET_SECONDS = 10.0


def size(text: str) -> list[int]:
    match = re.fullmatch(r"(\d+)[xX](\d+)", text)
    if not match:
        raise argparse.ArgumentTypeError(f"{text!r} is not WIDTHxHEIGHT")
    if not (4 <= int(match[1]) <= 65536 and 4 <= int(match[2]) <= 65536):
        raise argparse.ArgumentTypeError(f"{text!r} is not within Blender's 4 to 65536 pixels")
    return [int(match[1]), int(match[2])]


def positive(text: str) -> int:
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"{text} is not positive")
    return value


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "file", nargs="?", metavar="FILE", help=".blend file, or .py that builds a scene (default: scenes/default)"
    )
    parser.add_argument(
        "-o", "--output", metavar="OUT", help="picture to write; the ending chooses the format (default: ./NAME.png)"
    )
    parser.add_argument("--engine", default="TALBOT", help="render engine (default: TALBOT)")
    parser.add_argument("--samples", type=positive, help="samples per pixel")
    parser.add_argument("--size", type=size, metavar="WxH", help="resolution in pixels")
    parser.add_argument("--frame", type=int)
    parser.add_argument("--seed", type=int)
    parser.add_argument("--threads", type=positive)
    parser.add_argument("--scripts", action="store_true", help="let scripts inside the .blend file run")
    parser.add_argument("--dump", metavar="FILE", help="also write the scene as Talbot sees it, for talbot-cli")
    parser.add_argument("--blender", metavar="WHICH", help="path to a Blender, or bpy-4.2, bpy-4.5, bpy-5.0")


class ProgressLine:
    """Blender's status lines on one line of a terminal; elsewhere one of them every ten seconds."""

    def __init__(self) -> None:
        self.live = sys.stderr.isatty()
        self.shown = False
        self.last = time.monotonic()

    def show(self, line: str) -> None:
        text = line.rstrip()
        if " render " in text and "| Fra" in text:
            text = text.split("| ", 1)[1]
        if self.live:
            width = shutil.get_terminal_size().columns - 1
            print(f"\r{text[:width]:{width}}", end="", file=sys.stderr, flush=True)
            self.shown = True
        elif time.monotonic() - self.last >= QUIET_SECONDS:
            self.last = time.monotonic()
            say(text)

    def clear(self) -> None:
        if self.shown:
            print("\r" + " " * (shutil.get_terminal_size().columns - 1) + "\r", end="", file=sys.stderr, flush=True)
            self.shown = False


def run(arguments: argparse.Namespace) -> int:
    path = scene_file(arguments.file)
    output = Path(arguments.output or (path.stem if arguments.file else "render")).absolute()
    if output.is_dir() and arguments.output:
        raise LauncherError(f"{output} is a folder: name the picture")
    if not output.suffix:
        output = output.with_name(output.name + ".png")
    if not output.parent.is_dir():
        raise LauncherError(f"There is no folder {output.parent}")
    host = hosts.find_host(arguments.blender, native.prepare())
    job = {
        "output": str(output),
        "engine": arguments.engine,
        "samples": arguments.samples,
        "size": arguments.size,
        "frame": arguments.frame,
        "seed": arguments.seed,
        "threads": arguments.threads,
    }
    blender = ["-b", "-y" if arguments.scripts else "-Y"]
    if arguments.threads:
        blender += ["-t", str(arguments.threads)]
    blender += ["--python-exit-code", "1", *open_arguments(path)]
    blender += ["--python", str(ROOT / "packaging" / "render_job.py"), "--", json.dumps(job)]
    if arguments.dump:
        host.environment["TALBOT_DUMP"] = str(Path(arguments.dump).absolute())
    started = time.monotonic()
    process = subprocess.Popen(
        hosts.with_addon(host, blender),
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
        env=host.environment,
    )
    assert process.stdout is not None
    progress = ProgressLine()
    result: dict[str, object] = {}
    shown: set[str] = set()  # an error is reported by Blender and raised by its operator
    for line in process.stdout:
        if line.startswith(RESULT):
            result = json.loads(line[len(RESULT) :])
        elif PROGRESS.search(line):
            progress.show(line)
        elif not CHATTER.search(line) and line not in shown:
            shown.add(line)
            progress.clear()
            print(line, end="", file=sys.stderr, flush=True)
    code = process.wait()
    progress.clear()
    if code != 0 or not result:
        say(
            f"No picture: Blender ended with status {code}."
            if code >= 0
            else f"No picture: Blender was ended by signal {-code}."
        )
        return code if code > 0 else 1
    seconds = time.monotonic() - started
    print(f"Saved: {result['path']}")
    if arguments.dump:
        print(f"Scene: {Path(arguments.dump).absolute()}")
    print(f"Time: {result['seconds']:.2f} s for the picture, {seconds:.2f} s with Blender's start and end")
    return 0
