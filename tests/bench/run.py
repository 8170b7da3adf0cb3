"""`./talbot bench`: time, noise and memory of Talbot beside Cycles, in the same Blender on the same scenes.

    ./talbot bench [SCENE ...] [--blender WHICH] [--seeds N] [--seconds S] [--size W] [--json FILE] [--against FILE]
    ./talbot bench limit [SCENE ...] [--blender WHICH]       (limit.py)
    ./talbot bench nodes [NAME ...] [--blender WHICH]        (nodes.py)
    ./talbot bench sync [CASE ...] [--blender WHICH]         (sync.py)

SCENE is a .blend file, a script that builds a scene (script.py:argument), or a folder of .blend files; without one, the
scenes of this project. Each engine renders about `--seconds` a picture, once for each seed, without clamping,
adaptive sampling, denoising and light threshold, with a box filter and the file's own bounces. Columns:

    load     all that is not sampling: synchronisation, compiling, BVH (a picture of one sample, less its sampling)
    rend     seconds of sampling for the samples in the next column (slope between one sample and that many)
    var      relative variance of one sample: mean over pixels of the variance over seeds, over the squared mean; the
             worst 0.1 % of pixels are left out (fireflies; the untrimmed figure is in the JSON)
    gain     time to equal error: (time x variance) of Cycles over Talbot's. Two seeds are for a look, ten for a verdict
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import limit
import nodes
import numpy as np
import sync

ROOT = Path(__file__).resolve().parents[2]
JOB = Path(__file__).with_name("render_job.py")
OTHERS = {"limit": limit.main, "nodes": nodes.main, "sync": sync.main}
DEFAULT_SCENES = ["scenes/cornell.py", "scenes/cornell.py:spheres", "scenes/terrain.py", "scenes/default.py"]


def find_scenes(names: list[str]) -> list[str]:
    scenes: list[str] = []
    for name in names or [str(ROOT / s) for s in DEFAULT_SCENES]:
        path = Path(name.split(":")[0])
        if path.is_dir():
            scenes += sorted(str(p) for p in path.rglob("*.blend"))
        elif path.exists():
            scenes.append(name)
        else:
            sys.exit(f"bench: no such file or folder: {name}")
    return scenes


def run_job(scene: str, engine: str, options: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Renders in a Blender of its own; returns what render_job.py wrote, or {"error": ...}."""
    result = folder / "result.json"
    result.unlink(missing_ok=True)
    path, _, argument = scene.partition(":")
    job = {
        "engine": engine,
        "seeds": options.seeds,
        "seconds": options.seconds,
        "width": options.size,
        "folder": str(folder),
        "threads": options.threads,
    }
    command = [str(ROOT / "talbot"), "blender"]
    if options.blender:
        command += ["--blender", options.blender]
    command += ["-b", "--factory-startup", "-Y"]
    command += [os.path.abspath(path)] if path.endswith(".blend") else ["--python", os.path.abspath(path)]
    command += ["--python", str(JOB), "--", *([argument] if argument else []), "JOB=" + json.dumps(job)]
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
    if not result.exists():
        return {"error": "\n".join(done.stdout.splitlines()[-5:])}
    answer: dict[str, Any] = json.loads(result.read_text())
    if "error" not in answer:
        answer |= noise([np.load(folder / f"{seed}.npy") for seed in range(options.seeds)])
    return answer


def noise(pictures: list[np.ndarray]) -> dict[str, float]:
    """Relative variance of one picture over its seeds, plain and without the worst 0.1 % of pixels, and the mean."""
    stack = np.stack(pictures)[..., :3].astype(np.float64)
    mean = float(stack.mean())
    variance = stack.var(axis=0, ddof=1).mean(axis=-1).reshape(-1)
    trimmed = np.sort(variance)[: max(1, int(variance.size * 0.999))]
    scale = max(mean * mean, 1e-12)
    return {"mean": mean, "variance": float(trimmed.mean()) / scale, "variance_all": float(variance.mean()) / scale}


def describe(scene: str) -> str:
    path, _, argument = scene.partition(":")
    return Path(path).stem + (f" ({argument})" if argument else "")


def row(name: str, engine: str, r: dict[str, Any], gain: str) -> str:
    if "error" in r:
        return f"{name:28.28} {engine:7} failed: {r['error']}"
    rays = f"{r['mrays']:6.2f}" if "mrays" in r else "      "
    return (
        f"{name:28.28} {engine:7} {r['load']:7.2f} {r['render']:7.2f} {r['samples']:7d} {rays} "
        f"{r['variance'] * r['samples']:9.4f} {r['mean']:9.5f} {r['memory'] / 1e6:7.0f} {gain:>6}"
    )


def main() -> int:
    if len(sys.argv) > 1 and sys.argv[1] in OTHERS:
        return OTHERS[sys.argv.pop(1)]()
    parser = argparse.ArgumentParser(prog="talbot bench", description="Measure Talbot beside Cycles.")
    parser.add_argument("scenes", nargs="*", help=".blend files, scene scripts or folders")
    parser.add_argument("--blender", default="", help="which Blender, as in ./talbot blender")
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--seconds", type=float, default=4.0, help="render time aimed at, a picture")
    parser.add_argument("--size", type=int, default=0, help="width in pixels (0: 480, or the scene's when smaller)")
    parser.add_argument("--threads", type=int, default=0)
    parser.add_argument("--engines", default="CYCLES,TALBOT")
    parser.add_argument("--json", default="")
    parser.add_argument("--against", default="", help="an earlier --json file, for a verdict")
    options = parser.parse_args()
    if options.seeds < 2:
        parser.error("variance needs two seeds at least")

    print(
        f"{'scene':28} {'engine':7} {'load s':>7} {'rend s':>7} {'samples':>7} {'Mray/s':>6} {'var x spp':>9} "
        f"{'mean':>9} {'MB':>7} {'gain':>6}"
    )
    results: dict[str, dict[str, Any]] = {}
    gains: list[float] = []
    for scene in find_scenes(options.scenes):
        name = describe(scene)
        results[name] = {}
        for engine in options.engines.split(","):
            with tempfile.TemporaryDirectory() as folder:
                r = run_job(scene, engine, options, Path(folder))
            results[name][engine] = r
            gain = ""
            cycles = results[name].get("CYCLES", {})
            if engine == "TALBOT" and "error" not in r and "variance" in cycles and r["variance"] > 0:
                value = cycles["render"] * cycles["variance"] / max(r["render"] * r["variance"], 1e-12)
                r["gain"] = value
                gains.append(value)
                gain = f"{value:.2f}"
            print(row(name, engine, r, gain), flush=True)
    if gains:
        print(f"geometric mean of the gain over {len(gains)} scenes: {np.exp(np.mean(np.log(gains))):.2f}")
    if options.json:
        Path(options.json).write_text(json.dumps(results, indent=1))
    if options.against:
        verdict(results, json.loads(Path(options.against).read_text()))
    return 0


def verdict(now: dict[str, Any], before: dict[str, Any]) -> None:
    """Talbot now against Talbot then: ratio of time x variance, scene by scene."""
    for name, engines in now.items():
        a, b = engines.get("TALBOT", {}), before.get(name, {}).get("TALBOT", {})
        if "variance" in a and "variance" in b:
            ratio = b["render"] * b["variance"] / max(a["render"] * a["variance"], 1e-12)
            word = "better" if ratio > 1.05 else "worse" if ratio < 0.95 else "same"
            print(f"{name:28} {ratio:5.2f} times the efficiency of before: {word}")


if __name__ == "__main__":
    sys.exit(main())
