"""`./talbot bench nodes [NAME ...]`: what a shader node costs, beside Cycles in the same Blender.

    ./talbot bench nodes [NAME ...] [--blender WHICH] [--every] [--threads N] [--json FILE]

NAME is the beginning of a probe's name (tests/python/node_probes.py) or of a material's (materials.py); without one, up
to three probes of each family and all materials are measured, with `--every` all probes. A plane that fills the picture
shows the sum of many copies of the node, no two with the same input; the same picture with the inputs alone is taken
off. Columns are nanoseconds of processor time an evaluation, and Cycles' over Talbot's. A material is evaluated once a
pixel and sample.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
JOB = Path(__file__).with_name("nodes_job.py")
FLOOR = 0.05
"""Nanoseconds; what is cheaper drowns in the empty picture."""


def table(answer: dict[str, dict[str, float]]) -> list[float]:
    """Prints it; the ratios of what both engines could measure."""
    print(f"{'node':40} {'Cycles ns':>10} {'Talbot ns':>10} {'ratio':>7}")
    ratios: list[float] = []
    for name, row in answer.items():
        cycles, talbot = row.get("CYCLES", 0.0), row.get("TALBOT", 0.0)
        ratio = ""
        if cycles > FLOOR:
            ratios.append(cycles / max(talbot, FLOOR))
            ratio = f"{ratios[-1]:.1f}"
        print(f"{name:40.40} {cycles:10.2f} {talbot:10.2f} {ratio:>7}")
    return ratios


def main() -> int:
    parser = argparse.ArgumentParser(prog="talbot bench nodes", description="What shader nodes cost, beside Cycles.")
    parser.add_argument("names", nargs="*", help="beginnings of names")
    parser.add_argument("--blender", default="", help="which Blender, as in ./talbot blender")
    parser.add_argument("--every", action="store_true", help="all probes, not three of each family")
    parser.add_argument("--threads", type=int, default=0)
    parser.add_argument("--json", default="")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        result = Path(folder) / "result.json"
        job = {"names": options.names, "every": options.every, "threads": options.threads, "folder": folder}
        command = [str(ROOT / "talbot"), "blender", *(["--blender", options.blender] if options.blender else [])]
        command += ["-b", "--factory-startup", "--python", str(JOB), "--", "JOB=" + json.dumps(job)]
        done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
        if not result.exists():
            sys.exit("bench nodes: " + os.linesep.join(done.stdout.splitlines()[-5:]))
        answer: dict[str, Any] = json.loads(result.read_text())
        if "error" in answer:
            sys.exit(f"bench nodes: {answer['error']}")
    ratios = table(answer)
    if ratios:
        print(f"geometric mean of {len(ratios)}: {np.exp(np.mean(np.log(ratios))):.2f}, least: {min(ratios):.2f}")
    if options.json:
        Path(options.json).write_text(json.dumps(answer, indent=1))
    return 0
