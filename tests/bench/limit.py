"""`./talbot bench limit [SCENE ...]`: the share of bare ray tracing that the path tracer reaches; the rest by stages.

Each scene is dumped from Blender and rendered by talbot-cli on one thread; its rays are recorded and traced again by
themselves (the fastest of 1, 8 and 16 lanes wide; same rays, order and BVH). Printed beside: nanoseconds a path vertex
for each stage of the loop.
"""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DEFAULT_SCENES = ["scenes/cornell.py", "scenes/terrain.py"]


def measure(scene: Path, blender: list[str]) -> str:
    with tempfile.TemporaryDirectory() as folder:
        dump, picture = Path(folder) / "scene.talbot", Path(folder) / "picture.exr"
        command = [
            str(ROOT / "talbot"),
            "render",
            str(scene),
            "-o",
            str(picture),
            "--samples",
            "1",
            "--dump",
            str(dump),
        ]
        done = subprocess.run(
            command + blender, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False
        )
        if not dump.exists():
            return "no scene was written: " + " | ".join(done.stdout.splitlines()[-3:])
        subprocess.run(["ninja", "-C", str(ROOT / "build"), "talbot-cli"], stdout=subprocess.DEVNULL, check=True)
        cli = ROOT / "build" / "engine" / "talbot-cli"
        size = [] if scene.suffix == ".py" else ["--size", "480x270"]
        return subprocess.run(
            [str(cli), str(dump), "--limit", "--samples", "4", *size],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            check=False,
        ).stdout.rstrip()


def main() -> int:
    arguments = sys.argv[1:]
    blender: list[str] = []
    if "--blender" in arguments:
        at = arguments.index("--blender")
        blender = arguments[at : at + 2]
        del arguments[at : at + 2]
    for scene in arguments or [str(ROOT / s) for s in DEFAULT_SCENES]:
        print(f"{os.path.basename(scene)}\n{measure(Path(scene).absolute(), blender)}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
