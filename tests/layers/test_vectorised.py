"""The loops listed in tests/vectorised.txt are vectorised, as wide as listed.

A loop that silently stops vectorising costs two to eight times its speed. Each line of the list reads

    engine/LAYER/kernels/FILE.cpp  FUNCTION[:COUNT]  BYTES

and asks that g++ 12 reports at least COUNT loops (1 by default) inside FUNCTION of that file as vectorised with vectors
of at least BYTES, when it compiles for x86-64-v4. A template's loop counts once for each instance. FUNCTION may be `*`:
loops anywhere, also in included helpers.
"""

from __future__ import annotations

import json
import re
import shlex
import subprocess
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import pytest
from house import BUILD, ROOT

LIST = ROOT / "tests" / "vectorised.txt"
REPORT = re.compile(r"^(.+?):(\d+):\d+: optimized: loop vectorized using (\d+) byte vectors", re.MULTILINE)


@dataclass(frozen=True)
class Demand:
    file: str
    function: str
    count: int
    width: int


def read_list(text: str) -> list[Demand]:
    demands = []
    for line in text.splitlines():
        words = line.partition("#")[0].split()
        if words:
            file, function, width = words
            name, _, count = function.partition(":")
            demands.append(Demand(file, name, int(count or 1), int(width)))
    return demands


def function_lines(source: str, name: str) -> list[range]:
    """Lines of the definitions of `name` (overloads included): from its name to the next closing brace in column 0."""
    lines = source.splitlines()
    found = []
    for index, line in enumerate(lines):
        if not re.match(rf"^\S.*\b{re.escape(name)}\s*[(<]", line) or line.rstrip().endswith(";"):
            continue
        end = next((at for at in range(index, len(lines)) if lines[at].startswith("}")), len(lines))
        found.append(range(index + 1, end + 2))
    return found


def compile_command(file: Path) -> list[str] | None:
    """The build's own command for one of the instruction sets, turned into one for x86-64-v4 that writes nothing."""
    entries = json.loads((BUILD / "compile_commands.json").read_text())
    entry = next((entry for entry in entries if entry["file"] == str(file)), None)
    if entry is None:
        return None
    command = re.sub(r"-march=x86-64-v\d", "-march=x86-64-v4 -mprefer-vector-width=512", entry["command"])
    command = re.sub(r"-DTALBOT_ISA=v\d", "-DTALBOT_ISA=v4", command)
    words = shlex.split(command)
    if words[0].endswith("ccache"):
        words = words[1:]
    words[words.index("-o") + 1] = "/dev/null"
    return [*words, "-fopt-info-vec-optimized"]


def is_gcc12(compiler: str) -> bool:
    output = subprocess.run([compiler, "--version"], capture_output=True, text=True).stdout
    return "Free Software Foundation" in output and re.search(r"\) 12\.", output) is not None


def compile_report(file: str) -> str:
    command = compile_command(ROOT / file)
    assert command is not None, f"{file} of {LIST.name} is not built"
    result = subprocess.run(command, capture_output=True, text=True, cwd=BUILD)
    assert result.returncode == 0, result.stderr
    return result.stdout + result.stderr


def count_loops(report: str, demand: Demand, source: str) -> int:
    places = [(file, int(line)) for file, line, width in REPORT.findall(report) if int(width) >= demand.width]
    if demand.function == "*":
        return len(places)
    extents = function_lines(source, demand.function)
    return sum(1 for file, line in places if file.endswith(demand.file) and any(line in extent for extent in extents))


def test_listed_loops_are_vectorised() -> None:
    if not (BUILD / "compile_commands.json").exists():
        pytest.skip(f"no build in {BUILD}")
    demands = read_list(LIST.read_text())
    files = sorted({demand.file for demand in demands})
    assert files
    command = compile_command(ROOT / files[0])
    if command is None or not is_gcc12(command[0]):
        pytest.skip("the vectorisation report is read from g++ 12 for x86-64 only")
    with ThreadPoolExecutor(2) as pool:
        reports = dict(zip(files, pool.map(compile_report, files), strict=True))
    bad = []
    for demand in demands:
        found = count_loops(reports[demand.file], demand, (ROOT / demand.file).read_text())
        if found < demand.count:
            bad.append(f"{demand.file} {demand.function}: {found} loops of {demand.width} bytes, {demand.count} wanted")
    assert bad == []


def test_no_demand_is_listed_twice() -> None:
    counts = Counter((demand.file, demand.function) for demand in read_list(LIST.read_text()))
    assert [key for key, count in counts.items() if count > 1] == []


def test_the_reader_counts_loops_of_a_function() -> None:
    source = "void first(int n) {\n  for (;;) {}\n}\n\nvoid second(int n,\n            int m) {\n  for (;;) {}\n}\n"
    report = (
        "/x/engine/a/kernels/k.cpp:2:3: optimized: loop vectorized using 64 byte vectors\n"
        "/x/engine/a/kernels/k.cpp:2:3: optimized: loop vectorized using 32 byte vectors\n"
        "/x/engine/a/kernels/k.cpp:7:3: optimized: loop vectorized using 32 byte vectors\n"
        "/x/engine/base/lanes.h:9:3: optimized: loop vectorized using 64 byte vectors\n"
    )
    file = "engine/a/kernels/k.cpp"
    assert count_loops(report, Demand(file, "first", 1, 64), source) == 1
    assert count_loops(report, Demand(file, "second", 1, 64), source) == 0
    assert count_loops(report, Demand(file, "second", 1, 32), source) == 1
    assert count_loops(report, Demand(file, "*", 1, 64), source) == 2
    assert read_list("# none\n\na/k.cpp  f:3  64  # why\n") == [Demand("a/k.cpp", "f", 3, 64)]
