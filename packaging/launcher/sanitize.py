"""`./talbot test --sanitize`: C++ tests and dumped scenes under address, undefined-behaviour and thread sanitizers.

clang builds both, so this is also where a second compiler sees the whole engine.
"""

from __future__ import annotations

import os
from pathlib import Path

from launcher import native
from launcher.common import BUILD, ROOT, LauncherError
from launcher.tally import Tally, run_check, run_logged, run_reporting

SUPPRESSIONS = ROOT / "tests" / "tools"
HUGE = ("terrain",)  # minutes under a sanitizer, and nothing that the others lack
PROGRAM_SECONDS = 3600.0
KINDS = {"asan": "address,undefined", "tsan": "thread"}


def best_instruction_set() -> str:
    """One set is enough to find errors; v3 where the machine has it."""
    try:
        flags = Path("/proc/cpuinfo").read_text().split("flags", 1)[1].split("\n", 1)[0].split()
    except (OSError, IndexError):
        return ""
    return "v3" if {"avx2", "bmi2", "fma"} <= set(flags) else "v2" if "sse4_2" in flags else ""


def environment() -> dict[str, str]:
    return {
        **os.environ,
        # Libraries of the distribution keep memory until the end; what we leak ourselves is reported.
        "LSAN_OPTIONS": f"suppressions={SUPPRESSIONS}/lsan.supp:print_suppressions=0",
        "ASAN_OPTIONS": "detect_stack_use_after_return=1:strict_string_checks=1:abort_on_error=0"
        ":fast_unwind_on_malloc=0",  # whole stacks, or the suppressions find no library in them
        "UBSAN_OPTIONS": "halt_on_error=1:print_stacktrace=1",
        # The distribution's TBB and Embree are not instrumented: what they synchronise looks like a race.
        "TSAN_OPTIONS": f"suppressions={SUPPRESSIONS}/tsan.supp:ignore_noninstrumented_modules=1:halt_on_error=1",
    }


def dump_scenes(folder: Path) -> list[Path]:
    """Small dumps of scenes/*.py, by the ordinary build inside Blender; the sanitized program renders them alone."""
    native.prepare()  # takes as long as it takes; the renders have a limit
    folder.mkdir(parents=True, exist_ok=True)
    dumps = []
    for scene in sorted((ROOT / "scenes").glob("*.py")):
        if scene.stem in HUGE:
            continue
        dump = folder / f"{scene.stem}.talbot"
        command = [str(ROOT / "talbot"), "render", str(scene), "-o", str(dump.with_suffix(".png")), "--dump", str(dump)]
        command += ["--size", "64x48", "--samples", "1"]
        finished = run_logged(command, dump.with_suffix(".log"), 600)
        if finished.code != 0 or not dump.exists():
            raise LauncherError(f"{finished.output}\n{scene} could not be dumped")
        dumps.append(dump)
    return dumps


def run(name_filter: str | None) -> Tally:
    tally = Tally()
    scenes = dump_scenes(BUILD / "reports" / "scenes")
    for kind, sanitizers in KINDS.items():
        build = ROOT / f"build-{kind}"
        options = ["-DCMAKE_CXX_COMPILER=clang++", f"-DTALBOT_SANITIZE={sanitizers}", "-DTALBOT_PYTHON=OFF"]
        options += ["-DCMAKE_BUILD_TYPE=Release"]
        if best_instruction_set():
            options.append(f"-DTALBOT_ISAS={best_instruction_set()}")
        try:
            native.build([], build, options)
        except LauncherError as error:
            raise LauncherError(f"{sanitizers}: {error}") from None
        # Whole programs, not test by test as ctest does: starting a sanitized engine takes seconds.
        for test in sorted(path for path in (build / "tests" / "engine").glob("test_*") if os.access(path, os.X_OK)):
            report = build / "reports" / f"{test.name}.xml"
            command = [str(test), f"--gtest_output=xml:{report}", f"--gtest_filter=*{name_filter or ''}*"]
            tally += run_reporting(f"{test.name}, {sanitizers}", command, report, PROGRAM_SECONDS, environment())
        program = build / "engine" / "talbot-cli"
        for scene in scenes:
            if name_filter and name_filter not in scene.name:
                continue
            output = build / "reports" / f"{scene.stem}.exr"
            command = [str(program), str(scene), "-o", str(output), "--samples", "2", "--threads", "4"]
            tally += run_check(f"{scene.name}, {sanitizers}", command, output.with_suffix(".log"), environment())
    return tally
