"""`./talbot doctor`: what was found, which instruction set runs, and what is wrong. Status 1 when something is."""

from __future__ import annotations

import json
import os
import platform
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

from launcher import hosts, native
from launcher.common import BUILD, CACHE, ROOT, STAGE, LauncherError, project_version

LIBRARIES = (
    "libembree-dev",
    "libopenimageio-dev",
    "libopencolorio-dev",
    "libosd-dev",
    "libopenvdb-dev",
    "libtbb-dev",
    "pybind11-dev",
    "libgtest-dev",
)

# Runs in a Python of its own: a library that crashes must not take the doctor along.
NATIVE_PROBE = """
import json, sys
sys.path.insert(0, sys.argv[1])
import _talbot
facts = {"version": _talbot.__version__, "embree": _talbot.embree_version, "python": _talbot.python_abi,
         "sets": _talbot.compiled_instruction_sets(), "chosen": "", "problem": "",
         "denoiser": _talbot.denoiser_version([])}
try:
    facts["chosen"] = _talbot.chosen_instruction_set()
    _talbot.check()
except _talbot.Error as error:
    facts["problem"] = str(error)
print(json.dumps(facts))
"""

ADDON_PROBE = """
import bpy, json, sys
sys.path.insert(0, PACKAGING)
versions = {name: ".".join(map(str, getattr(bpy.app, name).version)) for name in ("oiio", "ocio", "openvdb")}
engines = {getattr(kind, "bl_idname", "") for kind in bpy.types.RenderEngine.__subclasses__()}
facts = {"engine": "TALBOT" in engines, "blender": bpy.app.version_string, "libraries": versions}
try:
    import answers, talbot.native
    facts["answers"] = answers.report(talbot.native.module().__file__)
    facts["problem"] = talbot.native.problem()
except Exception as error:
    facts["problem"] = str(error)
print("talbot-doctor:", json.dumps(facts))
"""


def first_line(command: list[str]) -> str:
    try:
        result = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=60)
    except (OSError, subprocess.TimeoutExpired) as error:
        return f"not usable ({error})"
    return result.stdout.strip().split("\n")[0]


def package_version(name: str) -> str:
    result = subprocess.run(["dpkg-query", "-W", "-f=${Version}", name], capture_output=True, text=True)
    return result.stdout if result.returncode == 0 else "not installed"


def cpu_name() -> str:
    try:
        text = Path("/proc/cpuinfo").read_text()
    except OSError:
        return platform.machine()
    match = re.search(r"^model name\s*:\s*(.+)$", text, re.MULTILINE)
    return match[1] if match else platform.machine()


def row(name: str, value: str) -> None:
    print(f"  {name:22} {value}")


def show_machine() -> None:
    print("Machine")
    release = Path("/etc/os-release")
    pretty = re.search(r'^PRETTY_NAME="?([^"\n]+)', release.read_text(), re.MULTILINE) if release.exists() else None
    row("system", pretty[1] if pretty else platform.platform())
    row("processor", f"{cpu_name()}, {len(os.sched_getaffinity(0))} threads for us")
    row("python", f"{platform.python_version()} ({sys.executable})")
    for program in ("g++", "cmake", "ninja", "ccache"):
        row(program, first_line([program, "--version"]) if shutil.which(program) else "not installed")
    if shutil.which("dpkg-query"):
        for name in LIBRARIES:
            row(name, package_version(name))


def check_native() -> list[str]:
    module = native.native_module()
    print("Native module")
    if module is None:
        return ["the native module was not built"]
    python = native.SYSTEM_PYTHON if os.path.exists(native.SYSTEM_PYTHON) else sys.executable
    result = subprocess.run([python, "-c", NATIVE_PROBE, str(module.parent)], capture_output=True, text=True)
    if result.returncode != 0:
        return [f"the native module does not load: {(result.stderr.strip().splitlines() or ['it crashed'])[-1]}"]
    facts = json.loads(result.stdout)
    row("talbot", f"{facts['version']} ({module})")
    row("embree", facts["embree"])
    row("python", facts["python"])
    row("instruction sets", " ".join(facts["sets"]))
    row("chosen", facts["chosen"] + (" (TALBOT_ISA)" if os.environ.get("TALBOT_ISA") else ""))
    row("Open Image Denoise", facts["denoiser"] or "not found in the system (the official Blender builds bring it)")
    return [facts["problem"]] if facts["problem"] else []


def check_host(which: str | None) -> list[str]:
    try:
        host = hosts.find_host(which, STAGE)
    except LauncherError as error:
        return [str(error)]
    print(f"Blender ({host.name})")
    probe = ADDON_PROBE.replace("PACKAGING", repr(str(ROOT / "packaging")))
    command = hosts.with_addon(host, ["-b", "--factory-startup", "--python-expr", probe])
    result = subprocess.run(command, capture_output=True, text=True, env=host.environment, errors="replace")
    line = re.search(r"^talbot-doctor: (.*)$", result.stdout, re.MULTILINE)
    if line is None or result.returncode != 0:
        output = (result.stdout + result.stderr).strip()[-2000:]
        return [f"{host.name}: Blender ended with status {result.returncode}: {output}"]
    facts = json.loads(line[1])
    row("version", facts["blender"])
    row("program", host.command[0])
    for name, version in facts["libraries"].items():
        row(name, version)
    row("add-on", "registered" if facts["engine"] else "NOT registered")
    problems = [f"{host.name}: {facts['problem']}"] if facts.get("problem") else []
    if not facts["engine"]:
        problems.append(f"{host.name}: the add-on did not register its engine:\n{result.stderr.strip()[-2000:]}")
    return problems + show_answers(host.name, facts.get("answers"))


def show_answers(host: str, answers: dict[str, Any] | None) -> list[str]:
    """Which library answers the native module's names in this Blender, by kind of name, and whether that is right."""
    if answers is None:
        return []
    print("  Who answers the native module's names")
    for title, files in sorted(answers["families"].items()):
        for file, count in sorted(files.items()):
            own = file == answers["file"]
            print(f"    {title:14} {count:5}  {'the module itself' if own else file or 'nobody (optional)'}")
    strangers = answers["strangers"]
    right = "each by a library that it was linked with"
    row("verdict", f"WRONG: {len(strangers)} names are answered by others" if strangers else right)
    return [f"{host}: {text}" for text in strangers[:5]]


def run(which: str | None) -> int:
    print(f"Talbot {project_version()}")
    problems: list[str] = []
    try:
        native.prepare()
    except LauncherError as error:
        problems.append(f"the build failed, see {BUILD}/build.log:\n{str(error)[-2000:]}")
    show_machine()
    problems += check_native()
    problems += check_host(which)
    if which is None:
        for name in hosts.MODULES:
            if (CACHE / name / "talbot-complete").exists():
                problems += check_host(name)
    print("Wrong" if problems else "All well.")
    for problem in problems:
        print(f"  * {problem}")
    return 1 if problems else 0
