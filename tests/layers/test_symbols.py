"""Kernels of one instruction set share no code with another's.

The linker keeps one copy of an inline function that two object files define. If one of them was compiled for AVX-512,
the survivor may be that one, and the program dies on a machine without. So every symbol that a kernel's object file
defines for others to see (global, weak or unique) has to carry its instruction set's namespace in its name.
"""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest
from house import BUILD

OBJECT = re.compile(r"talbot_\w+?_(v\d|generic)\.dir/.*kernels/.*\.o$")
# References to the C++ runtime, which hold no code of ours.
HARMLESS = ("DW.ref.", "__clang_call_terminate", "__odr_asan", "_ZTI", "_ZTS")


def kernel_objects() -> list[tuple[Path, str]]:
    found = []
    for path in sorted(BUILD.rglob("*.o")):
        match = OBJECT.search(str(path))
        if match:
            found.append((path, match[1]))
    return found


def shared_symbols(nm_output: str, isa: str) -> list[str]:
    """Lines of `nm -C --defined-only` that another object file could be bound to, and that do not name their set."""
    bad = []
    for line in nm_output.splitlines():
        match = re.match(r"^[0-9a-f]* (\w) (.+)$", line)
        if not match or (match[1].islower() and match[1] not in "uvw"):
            continue
        if f"::{isa}::" not in match[2] and not match[2].startswith(HARMLESS):
            bad.append(match[2])
    return bad


def test_kernels_share_no_symbols() -> None:
    objects = kernel_objects()
    if not objects:
        pytest.skip(f"no kernels in {BUILD}")
    assert shutil.which("nm")
    bad = {}
    for path, isa in objects:
        output = subprocess.run(["nm", "-C", "--defined-only", str(path)], capture_output=True, text=True, check=True)
        symbols = shared_symbols(output.stdout, isa)
        if symbols:
            bad[str(path.relative_to(BUILD))] = symbols[:20]
    assert bad == {}


def test_the_rule_finds_offenders() -> None:
    listing = (
        "0000000000000000 T talbot::closure::v4::eval(int)\n"
        "0000000000000000 t helper(int)\n"
        "0000000000000000 W std::vector<int>::push_back(int&&)\n"
        "0000000000000000 u talbot::table\n"
        "0000000000000000 T talbot::closure::v3::eval(int)\n"
        "0000000000000000 V DW.ref.__gxx_personality_v0\n"
    )
    assert shared_symbols(listing, "v4") == [
        "std::vector<int>::push_back(int&&)",
        "talbot::table",
        "talbot::closure::v3::eval(int)",
    ]
