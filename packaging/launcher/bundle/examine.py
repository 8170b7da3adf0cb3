"""What the finished module asks of a machine and shows to it. Breaking a limit fails the package."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

from launcher.common import LauncherError

# RHEL 9 and Rocky 9, Ubuntu 22.04.
LIMITS = {"GLIBC": (2, 34), "GLIBCXX": (3, 4, 29), "CXXABI": (1, 3, 13), "GCC": (12, 0, 0)}
EXPORTS = {"PyInit__talbot"}
SYSTEM_LIBRARIES = {"libc.so.6", "libm.so.6", "libstdc++.so.6", "libgcc_s.so.1", "ld-linux-x86-64.so.2"}
# Asked of whoever has them, by every shared object.
OPTIONAL = {"__gmon_start__", "__cxa_finalize", "_ITM_deregisterTMCloneTable", "_ITM_registerTMCloneTable"}
ZIPPED_BYTES = 30_000_000
UNPACKED_BYTES = 90_000_000


def tool_output(*command: str) -> str:
    result = subprocess.run(command, capture_output=True, text=True)
    if result.returncode != 0:
        raise LauncherError(f"{' '.join(command)}: {result.stderr.strip()}")
    return result.stdout


def version_tuple(text: str) -> tuple[int, ...]:
    return tuple(int(number) for number in text.split("."))


def needed_versions(undefined: list[str]) -> dict[str, tuple[int, ...]]:
    """The newest version of each family that a list of `name@FAMILY_1.2.3` asks for."""
    newest: dict[str, tuple[int, ...]] = {}
    for symbol in undefined:
        match = re.search(r"@([A-Z]+)_(\d[\d.]*)$", symbol)
        if match:
            newest[match[1]] = max(newest.get(match[1], (0,)), version_tuple(match[2]))
    return newest


def limit_text(family: str) -> str:
    return ".".join(map(str, LIMITS[family])) if family in LIMITS else "anything known"


def too_new(undefined: list[str]) -> list[str]:
    problems = []
    for symbol in undefined:
        for family, version in needed_versions([symbol]).items():
            if family not in LIMITS or version > LIMITS[family]:
                problems.append(f"{symbol} is newer than {limit_text(family)}")
    return problems


def foreign(undefined: list[str]) -> list[str]:
    """Names that neither the C and C++ libraries nor Python answer: the host's libraries would."""
    return [name for name in undefined if "@" not in name and not re.match(r"_?Py", name) and name not in OPTIONAL]


def symbols(module: Path, which: str) -> list[str]:
    lines = tool_output("nm", "-D", "--with-symbol-versions", which, str(module)).splitlines()
    return [line.split()[-1] for line in lines if line.strip()]


def file_problems(file: Path, companions: dict[str, set[str]], prefix: str) -> list[str]:
    """`companions`: the bundle's own shared libraries by file name, and what each exports."""
    undefined = symbols(file, "--undefined-only")
    exported = set(symbols(file, "--defined-only"))
    dynamic = tool_output("readelf", "-d", str(file))
    expected = companions.get(file.name, EXPORTS)
    problems = too_new(undefined)
    problems += [f"{name} is exported" for name in sorted(exported - expected)]
    problems += [f"{name} is not exported" for name in sorted(expected - exported)]
    problems += [f"{name} would be answered by the host" for name in foreign(undefined) if not name.startswith(prefix)]
    needed = set(re.findall(r"\(NEEDED\).*\[(.*)\]", dynamic))
    problems += [f"it needs {name}" for name in sorted(needed - SYSTEM_LIBRARIES - set(companions))]
    paths = re.findall(r"\((?:RPATH|RUNPATH)\).*\[(.*)\]", dynamic)
    problems += [f"it looks for libraries in {path}" for path in paths if path != "$ORIGIN"]
    if "(TEXTREL)" in dynamic:
        problems.append("it has relocations in its code")
    return problems


def bundle_problems(files: list[Path], prefix: str) -> list[str]:
    """The module and its companions, whose every exported name has to begin with `prefix`."""
    companions = {}
    for file in files[1:]:
        companions[file.name] = {name for name in symbols(file, "--defined-only") if name.startswith(prefix)}
    return [f"{file.name}: {problem}" for file in files for problem in file_problems(file, companions, prefix)]


def describe(files: list[Path]) -> str:
    newest = needed_versions([name for file in files for name in symbols(file, "--undefined-only")])
    wants = ", ".join(f"{family}_{'.'.join(map(str, version))}" for family, version in sorted(newest.items()))
    sizes = ", ".join(f"{file.name} {file.stat().st_size / 1e6:.1f} MB" for file in files)
    return f"{sizes}; exports {', '.join(sorted(EXPORTS))}; asks for {wants}"


def check_bundle(files: list[Path], prefix: str) -> None:
    problems = bundle_problems(files, prefix)
    if problems:
        raise LauncherError("The native module cannot be shipped:\n  " + "\n  ".join(problems[:40]))


def check_sizes(zipped: dict[str, int], unpacked: int) -> None:
    """The limits are for one Python; one for several holds the libraries once and has to keep them too."""
    for name, size in zipped.items():
        if size > ZIPPED_BYTES:
            raise LauncherError(f"{name} would be {size / 1e6:.1f} MB, more than {ZIPPED_BYTES / 1e6:.0f}.")
    if unpacked > UNPACKED_BYTES:
        raise LauncherError(f"{unpacked / 1e6:.1f} MB unpacked is more than {UNPACKED_BYTES / 1e6:.0f}.")
