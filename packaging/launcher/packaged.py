"""`./talbot test --packaged`: what users install, in every Blender at hand, from installing to leaving.

Each host runs the system build once for comparison; then, with its libraries private and in the global scope (as in the
official program), processes of their own: one that installs, renders and upgrades; one that may not write where it is
installed; one that finds it installed and removes it; one that uses the wheel as a Python package; one that is given
packages of another Python and another system. tests/packaged/session.py has the steps.

`./talbot test --with-packages` takes them through two Blenders, from installing to leaving.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from launcher import hosts, native, package
from launcher.bundle import archives, headers
from launcher.common import BUILD, ROOT, STAGE, LauncherError, say
from launcher.tally import Tally, run_reporting, skip_check

PLACE = BUILD / "packaged"
SESSION = ROOT / "tests" / "packaged" / "session.py"
HOSTS = ("system", "bpy-4.2", "bpy-4.5", "bpy-5.0")
BRIEF_HOSTS = ("system", "bpy-5.0")
SECONDS = 1800.0
# Of the picture's mean. Embree, TBB and the compiler are the system build's; codecs are of other versions.
TOLERANCE = 1e-4
NEXT_VERSION = "99.0.0"
# What a report says of the step in which the process ended; the step without Talbot.
ENDED, ALONE = "the process ended in this step", "cycles_alone"

STAGE_STEPS = ["install", "pictures", "formats"]
FIRST_STEPS = [
    ALONE,
    "load_another_embree",
    "install",
    "pictures",
    "formats",
    "in_turn_with_cycles",
    "who_answers",
    "denoise",
    "threads",
    "disable_and_enable",
    "second_copy",
    "upgrade",
    "skew",
    "downgrade",
]
READ_ONLY_STEPS = ["enable", "read_only"]
SECOND_STEPS = ["enable", "one_picture", "uninstall"]
PACKAGE_STEPS = ["install", "one_picture", "formats", "who_answers"]
OTHER_STEPS = ["other_systems"]


@dataclass
class Files:
    """What is tested. `upgrade` is the same with a higher version in the Python part: new Python, old library."""

    extension: Path
    legacy: Path
    wheel: Path
    extension_upgrade: Path
    legacy_upgrade: Path
    of_another_python: Path
    of_another_system: Path


def next_version(contents: archives.Contents) -> archives.Contents:
    """The same with a higher version in the Python part and the names; the native module keeps its own."""
    old, new = contents.version, NEXT_VERSION
    texts = {f'"{old}"': f'"{new}"', f"({', '.join(old.split('.'))})": f"({', '.join(new.split('.'))})"}

    def renamed(text: str) -> str:
        for before, after in texts.items():
            text = text.replace(before, after)
        return text

    addon = {name: renamed(data.decode()).encode() for name, data in contents.addon.items()}
    return replace(contents, addon=addon, manifest=renamed(contents.manifest), version=new)


def make_files() -> Files:
    contents = package.gather(list(headers.DEFAULT_PYTHONS))
    extension, legacy, wheel = package.package(contents, PLACE / "files")
    next_extension, next_legacy, _ = package.package(next_version(contents), PLACE / "files")
    python = retagged(extension, ".".join(tag.split("-")[0] for tag in archives.wheel_tags(contents.pythons)), "cp39")
    system = retagged(extension, archives.PLATFORM, "win_amd64")
    return Files(extension, legacy, wheel, next_extension, next_legacy, python, system)


def retagged(extension: Path, tag: str, other: str) -> Path:
    """The same extension, whose wheel says that it is for another Python or another system."""
    target = PLACE / "files" / f"{other}-{extension.name}"
    with zipfile.ZipFile(extension) as source, zipfile.ZipFile(target, "w") as archive:
        for name in source.namelist():
            data = source.read(name)
            if name == "blender_manifest.toml":
                data = data.replace(tag.encode(), other.encode())
            archive.writestr(name.replace(tag, other), data)
    return target


def session_environment(host: hosts.Host, user: Path, site: Path | None) -> dict[str, str]:
    """Nothing of the user's, nothing of the stage: only what the session installs (or the wheel in `site`)."""
    environment = {key: value for key, value in host.environment.items() if not key.startswith("BLENDER_USER_")}
    environment |= {"BLENDER_USER_RESOURCES": str(user), "PYTHONDONTWRITEBYTECODE": "1"}
    environment.pop("PYTHONPATH", None)
    if site is not None:
        environment["PYTHONPATH"] = str(site)
    return environment


@contextmanager
def read_only(user: Path) -> Iterator[list[str]]:
    """Takes away the right to write below `user`, but for Blender's settings; what has to stand before a command, so
    that this holds for root too."""
    places = [path for path in (user, *user.rglob("*")) if path.is_dir() and "config" not in path.parts]
    try:
        for place in places:
            place.chmod(0o555)
        powers = "-dac_override,-dac_read_search"
        yield ["setpriv", f"--bounding-set={powers}", f"--inh-caps={powers}"] if os.getuid() == 0 else []
    finally:
        for place in places:
            place.chmod(0o755)


def user_folder(host: hosts.Host, kind: str, as_program: bool) -> Path:
    return PLACE / "user" / re.sub(r"\W+", "-", session_title(host, kind, as_program))


def session_title(host: hosts.Host, kind: str, as_program: bool) -> str:
    return f"{host.name}, {kind}, {'global scope' if as_program else 'own scope'}"


def run_session(
    host: hosts.Host, kind: str, steps: list[str], files: Files, as_program: bool = False, **more: Any
) -> Tally:
    """One process; how it ends counts."""
    title = session_title(host, kind, as_program)
    name = re.sub(r"\W+", "-", f"{title} {steps[-1]}")
    user = user_folder(host, kind, as_program)
    if more.pop("fresh", True):
        shutil.rmtree(user, ignore_errors=True)
    user.mkdir(parents=True, exist_ok=True)
    report = PLACE / "reports" / f"{name}.xml"
    report.parent.mkdir(parents=True, exist_ok=True)
    folder = PLACE / "pictures" / host.name
    folder.mkdir(parents=True, exist_ok=True)
    job = {
        "title": title,
        "kind": kind,
        "host": host.name,
        "as_program": as_program,
        "steps": steps,
        "report": str(report),
        "folder": str(folder),
        "packaging": str(ROOT / "packaging"),
        "tolerance": TOLERANCE,
        "zip": str(files.extension if kind == "extension" else files.legacy),
        "upgrade": str(files.extension_upgrade if kind == "extension" else files.legacy_upgrade),
        "second": str(files.legacy_upgrade),
        "ended": ENDED,
        "next_version": NEXT_VERSION,
        "of_another_python": str(files.of_another_python),
        "of_another_system": str(files.of_another_system),
    }
    path = PLACE / "jobs" / f"{name}.json"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(job))
    environment = session_environment(host, user, more.pop("site", None))
    if kind == "stage":
        environment["BLENDER_USER_SCRIPTS"] = str(STAGE)
    if host.is_module:
        command = [host.command[0], str(SESSION), str(path)]
    else:
        command = [*host.command, "-b", "--factory-startup", "--python-exit-code", "1"]
        command += ["--python", str(SESSION), "--", str(path)]
    command = [*more.pop("before", []), *command]
    tally = run_reporting(title, command, report, SECONDS, environment)
    if ended_alone(report):
        say(f"{title}: Blender ended by itself while Cycles rendered, before Talbot was there; once more")
        tally = run_reporting(title, command, report, SECONDS, environment)
    return tally


def ended_alone(report: Path) -> bool:
    """Whether the process ended before anything of Talbot was installed. That says nothing about Talbot: 5.0 did so
    once, on a loaded machine, and not again. A second time counts."""
    cases = list(ElementTree.parse(report).getroot().iter("testcase")) if report.exists() else []
    failure = cases[0].find("failure") if len(cases) == 1 else None
    return failure is not None and failure.get("message") == ENDED and str(cases[0].get("name")).endswith(ALONE)


def unpacked_wheel(wheel: Path) -> Path:
    """As pip would put it; pip itself must accept it too."""
    site = PLACE / "site"
    shutil.rmtree(site, ignore_errors=True)
    command = [sys.executable, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-deps"]
    command += ["--no-index", "--target", str(site), str(wheel)]
    result = subprocess.run(command, capture_output=True, text=True)
    if result.returncode != 0:
        raise LauncherError(f"pip refuses {wheel.name}: {result.stderr.strip()}")
    return site


def from_installing_to_leaving(host: hosts.Host, files: Files, as_program: bool, brief: bool) -> Tally:
    kind = "extension" if host.is_module else "legacy"
    tally = run_session(host, kind, FIRST_STEPS, files, as_program)
    if not brief:
        with read_only(user_folder(host, kind, as_program)) as before:
            tally += run_session(host, kind, READ_ONLY_STEPS, files, as_program, fresh=False, before=before)
    return tally + run_session(host, kind, SECOND_STEPS, files, as_program, fresh=False)


def test_host(which: str, files: Files, site: Path) -> Tally:
    host = hosts.find_host(which, STAGE)
    tally = run_session(host, "stage", STAGE_STEPS, files)
    for as_program in (False, True) if host.is_module else (False,):
        tally += from_installing_to_leaving(host, files, as_program, brief=False)
    if host.is_module:
        tally += run_session(host, "pip", PACKAGE_STEPS, files, site=site)
        tally += run_session(host, "extension", OTHER_STEPS, files)
    return tally


def test_host_briefly(which: str, files: Files) -> Tally:
    """The harder scope only: a module with its libraries visible to everyone, as in the official program."""
    host = hosts.find_host(which, STAGE)
    tally = run_session(host, "stage", STAGE_STEPS, files)
    return tally + from_installing_to_leaving(host, files, host.is_module, brief=True)


def run(which: list[str] | None) -> Tally:
    native.prepare()
    files = make_files()
    site = unpacked_wheel(files.wheel)
    tally = Tally(passed=1)  # pip took the wheel
    for name in which or HOSTS:
        tally += test_host(name, files, site)
    return tally


def run_briefly() -> Tally:
    """Part of `./talbot test --with-packages`. The stage is there already."""
    title = "packages"
    try:
        package.check_compiler()
    except LauncherError as error:
        return skip_check(title, str(error))
    files = make_files()
    tally = Tally(passed=1)  # sizes, exported names and versions asked for were checked
    for name in BRIEF_HOSTS:
        why = hosts.why_no_modules() if name in hosts.MODULES else ""
        tally += skip_check(f"{title} in {name}", why) if why else test_host_briefly(name, files)
    return tally
