"""`./talbot bench sync [CASE ...]`: seconds of reading Blender's scene, beside Cycles in the same Blender.

    ./talbot bench sync [CASE ...] [--blender WHICH] [--engines CYCLES,TALBOT] [--json FILE]

CASE is the beginning of a case's name (sync_job.py): a mesh of a million triangles, 100 thousand instances, 20 thousand
legacy hairs of 9 keys, a Curves object of 100 thousand curves of 8 keys (Blenders that let scripts make them), and an
animation with persistent data in which the camera alone moves. Cold is the first render of a process, warm the fastest
of the next three, or of an animation's next three frames. Talbot's seconds are everything between Blender's call and
the start of the session; Cycles' run from the first object that it names until it begins to build: what it reads before
(shaders, the passes over objects without a change) is not in them.
"""

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
JOB = Path(__file__).with_name("sync_job.py")
CASES = ("triangles", "instances", "hair", "curves", "animation")


def run_job(case: str, engine: str, blender: str) -> dict[str, Any]:
    """In a Blender of its own; what sync_job.py wrote, or {"error": ...}."""
    with tempfile.TemporaryDirectory() as folder:
        job = {"case": case, "engine": engine, "folder": folder}
        command = [str(ROOT / "talbot"), "blender", *(["--blender", blender] if blender else [])]
        command += ["-b", "--factory-startup", "--python", str(JOB), "--", "JOB=" + json.dumps(job)]
        done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
        result = Path(folder) / "result.json"
        if result.exists():
            answer: dict[str, Any] = json.loads(result.read_text())
            return answer
        return {"error": " | ".join(done.stdout.splitlines()[-3:])}


def cell(answer: dict[str, Any], column: str) -> str:
    """Seconds, or nothing."""
    return f"{answer[column]:9.3f}" if column in answer else f"{'-':>9}"


def main() -> int:
    parser = argparse.ArgumentParser(prog="talbot bench sync", description="Seconds of reading the scene.")
    parser.add_argument("cases", nargs="*", help="beginnings of names")
    parser.add_argument("--blender", default="", help="which Blender, as in ./talbot blender")
    parser.add_argument("--engines", default="CYCLES,TALBOT")
    parser.add_argument("--json", default="")
    options = parser.parse_args()
    cases = [case for case in CASES if not options.cases or case.startswith(tuple(options.cases))]
    if not cases:
        parser.error("no such case; there are " + ", ".join(CASES))
    engines = options.engines.split(",")
    columns = [(engine, column) for engine in engines for column in ("cold", "warm")]
    print(f"{'seconds':12}" + "".join(f"{engine.title()} {column}".rjust(13) for engine, column in columns))
    results: dict[str, dict[str, Any]] = {}
    failed = False
    for case in cases:
        results[case] = {engine: run_job(case, engine, options.blender) for engine in engines}
        print(f"{case:12}" + "".join(cell(results[case][engine], column).rjust(13) for engine, column in columns))
        for engine, answer in results[case].items():
            if "error" in answer:
                failed = True
                print(f"    {engine} failed: {answer['error']}")
    if options.json:
        Path(options.json).write_text(json.dumps(results, indent=1))
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
