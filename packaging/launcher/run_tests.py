"""`./talbot test`: lint, C++ tests, the order of the house, pytest inside each Blender, the packages in two."""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

from launcher import hosts, native, packaged, sanitize
from launcher.bundle import libraries
from launcher.common import BUILD, CACHE, ROOT, STAGE, LauncherError, say
from launcher.tally import Tally, run_check, run_ctest, run_reporting, run_together, skip_check

RUFF = "0.17.6"
CLANG_FORMAT_MAJOR = "14"  # Debian 12's; others break lines differently
NO_TESTS = 5  # pytest's status when the filter leaves none
REPORTS = BUILD / "reports"
PYTEST_SECONDS = 2400.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--all", action="store_true", help="Blender 4.2 and 4.5 too, and the packages")
    parser.add_argument(
        "--with-packages",
        action="store_true",
        help="the packages in two Blenders too, even where their libraries have to be built first (10 minutes)",
    )
    parser.add_argument(
        "--sanitize", action="store_true", help="C++ tests and dumped scenes under the sanitizers, by clang"
    )
    parser.add_argument(
        "--packaged",
        action="store_true",
        help="only the packages, but all of it: in every Blender, read-only, by pip, on the wrong system",
    )
    parser.add_argument("--filter", metavar="X", help="only tests whose name contains X; no lint")
    parser.add_argument(
        "--blender", metavar="WHICH", action="append", help="only inside this Blender (may be repeated)"
    )


def sources(*suffixes: str) -> list[str]:
    """Tracked and new files, but nothing that git ignores; without git, everything but build folders."""
    command = ["git", "-C", str(ROOT), "ls-files", "--cached", "--others", "--exclude-standard"]
    result = subprocess.run(command, capture_output=True, text=True) if shutil.which("git") else None
    if result is not None and result.returncode == 0:
        names = result.stdout.splitlines()
    else:
        skipped = ("build", "dist", ".")
        names = [str(path.relative_to(ROOT)) for path in ROOT.rglob("*") if path.is_file()]
        names = [name for name in names if not name.startswith(skipped)]
    return sorted(str(ROOT / name) for name in names if name.endswith(suffixes) and (ROOT / name).exists())


def ruff_program() -> str | None:
    place = CACHE / f"ruff-{RUFF}"
    program = place / "bin" / "ruff"
    if program.exists():
        return str(program)
    with native.locked(CACHE):
        for command in (
            [sys.executable, "-m", "venv", str(place)],
            [str(place / "bin" / "python"), "-m", "pip", "install", "--quiet", f"ruff=={RUFF}"],
        ):
            if subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL).returncode != 0:
                return None
    return str(program)


def lint() -> Tally:
    tally = Tally()
    python = sources(".py", ".pyi")
    ruff = ruff_program()
    if ruff is None:
        tally += skip_check("ruff", "pip could not fetch it")
    else:
        config = ["--config", str(ROOT / "ruff.toml"), "--no-cache"]
        tally += run_check("ruff format", [ruff, "format", "--check", *config, *python], REPORTS / "ruff-format.log")
        tally += run_check("ruff check", [ruff, "check", *config, *python], REPORTS / "ruff-check.log")
    version = (
        subprocess.run(["clang-format", "--version"], capture_output=True, text=True).stdout
        if shutil.which("clang-format")
        else ""
    )
    if f"version {CLANG_FORMAT_MAJOR}." not in version:
        return tally + skip_check(
            "clang-format",
            f"version {CLANG_FORMAT_MAJOR} is the one that is checked; found: {version.strip() or 'none'}",
        )
    return tally + run_clang_format()


def run_clang_format() -> Tally:
    """Names the files only: the cure is always the same."""
    result = subprocess.run(
        ["clang-format", "--dry-run", "-Werror", *sources(".cpp", ".h")],
        capture_output=True,
        text=True,
        errors="replace",
    )
    if result.returncode == 0:
        say("clang-format: fine")
        return Tally(passed=1)
    bad = sorted(set(re.findall(rf"^{re.escape(str(ROOT))}/(.+?):\d+:\d+: error", result.stderr, re.MULTILINE)))
    say("clang-format: FAILED. Run: clang-format -i " + " ".join(bad) + ("" if bad else result.stderr[-3000:]))
    return Tally(failed=1)


def pytest_options(report: Path, name_filter: str | None) -> list[str]:
    options = ["-c", str(ROOT / "tests" / "pytest.ini"), f"--junitxml={report}"]
    return options + (["-k", name_filter] if name_filter else [])


def run_house(name_filter: str | None) -> Tally:
    report = REPORTS / "house.xml"
    command = [
        sys.executable,
        "-m",
        "pytest",
        *pytest_options(report, name_filter),
        str(ROOT / "tests" / "layers"),
        str(ROOT / "tests" / "run"),
    ]
    environment = {**os.environ, "TALBOT_BUILD_DIR": str(BUILD), "PYTHONDONTWRITEBYTECODE": "1"}
    return run_reporting("Order of the house", command, report, 900, environment, (0, NO_TESTS))


def run_in_blender(which: str, name_filter: str | None) -> Tally:
    try:
        host = hosts.find_host(which, STAGE)
    except LauncherError as error:
        say(f"{error}\npytest in {which}: FAILED")
        return Tally(failed=1)
    report = REPORTS / f"pytest-{which.replace('/', '_')}.xml"
    options = [*pytest_options(report, name_filter), str(ROOT / "tests" / "python")]
    arguments = ["-b", "--factory-startup", "--python-exit-code", "1"]
    arguments += ["--python", str(ROOT / "tests" / "python" / "run_pytest.py"), "--", *options]
    environment = {**host.environment, "TALBOT_BUILD_DIR": str(BUILD)}
    return run_reporting(f"pytest in {which}", hosts.with_addon(host, arguments), report, PYTEST_SECONDS, environment)


def run(arguments: argparse.Namespace) -> int:
    tally = Tally()
    if not arguments.filter and not arguments.blender and not arguments.packaged:
        tally += lint()
    try:
        if arguments.sanitize:
            tally += sanitize.run(arguments.filter)
        elif arguments.packaged:
            tally += packaged.run(arguments.blender)
        else:
            tally += run_all(arguments)
    except LauncherError as error:
        say(str(error))
        tally += Tally(failed=1)
    print(tally, flush=True)
    return 1 if tally.failed or not tally.passed else 0


def run_all(arguments: argparse.Namespace) -> Tally:
    native.build([])
    with native.locked(BUILD):
        native.stage()
    hosts_of_tests = arguments.blender or ["bpy-5.0", "system", *(["bpy-4.2", "bpy-4.5"] if arguments.all else [])]
    steps: list[Callable[[], Tally]] = []
    for name in hosts_of_tests:
        if name in hosts.MODULES and not arguments.blender and hosts.why_no_modules():
            steps.append(partial(skip_check, f"pytest in {name}", hosts.why_no_modules()))
        else:
            steps.append(partial(run_in_blender, name, arguments.filter))
    if not arguments.blender:
        # Second: what is broken for everyone shows early, beside the longest.
        steps.insert(1, partial(run_ctest, BUILD, "C++ tests", arguments.filter))
        steps.append(partial(run_house, arguments.filter))
    tally = run_together(steps)
    if arguments.filter or arguments.blender:
        return tally
    if arguments.with_packages or arguments.all or not libraries.missing_parts():
        return tally + packaged.run_briefly()
    return tally + skip_check(
        "packages", "their libraries are not built yet: ./talbot test --with-packages, 10 minutes"
    )
