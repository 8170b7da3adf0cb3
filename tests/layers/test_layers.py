"""A file includes its own layer and those to its left; a third-party library is seen by one layer's .cpp files only."""

from __future__ import annotations

import re
from pathlib import Path

from house import LAYERS, ROOT, shown, sources

INCLUDE = re.compile(r'^\s*#\s*include\s*([<"])([^>"]+)[>"]', re.MULTILINE)
# Prefix of the included path -> the layer whose .cpp files may see it.
LIBRARIES = {
    "OpenImageIO/": "asset",
    "OpenColorIO/": "asset",
    "openvdb/": "asset",
    "OpenEXR/": "asset",
    "Imath/": "asset",
    "embree3/": "geometry",
    "embree4/": "geometry",
    "opensubdiv/": "geometry",
    "OpenImageDenoise/": "film",
    "pybind11/": "python",
    "Python.h": "python",
    "numpy/": "python",
}
SYSTEM_FOLDERS = ("sys/",)


def layer_of(path: Path) -> str:
    return path.relative_to(ROOT / "engine").parts[0]


def problems_of(path: Path, text: str) -> list[str]:
    layer = layer_of(path)
    if layer not in LAYERS:
        return [f"{shown(path)}: {layer} is not a layer"]
    visible = LAYERS[: LAYERS.index(layer) + 1]
    if layer == "cli":
        visible.remove("python")
    problems = []
    for bracket, name in INCLUDE.findall(text):
        owner = next((owner for prefix, owner in LIBRARIES.items() if name.startswith(prefix)), None)
        if owner is not None:
            if layer != owner:
                problems.append(f"{shown(path)}: {name} belongs to {owner}, not to {layer}")
            elif path.suffix != ".cpp" and layer != "python":
                problems.append(f"{shown(path)}: {name} in a header")
        elif bracket == '"' and name.split("/")[0] not in visible:
            problems.append(f"{shown(path)}: {layer} may not include {name}")
        elif bracket == "<" and "/" in name and not name.startswith(SYSTEM_FOLDERS):
            problems.append(f"{shown(path)}: {name} is a library that no layer owns")
    return problems


def test_includes_follow_the_layers() -> None:
    files = sources(".h", ".cpp", folders=("engine",))
    assert len(files) > 20
    assert [problem for path in files for problem in problems_of(path, path.read_text())] == []


def test_the_rule_finds_offenders() -> None:
    shader = ROOT / "engine" / "shader" / "imaginary.h"
    assert problems_of(shader, '#include "closure/closure.h"\n#include <vector>\n#include <sys/stat.h>') == []
    assert len(problems_of(shader, '#include "geometry/surface.h"')) == 1
    assert len(problems_of(shader, "#include <embree3/rtcore.h>")) == 1
    assert len(problems_of(shader, "#include <boost/any.hpp>")) == 1
    assert len(problems_of(shader, '#include "closure.h"')) == 1
    assert len(problems_of(ROOT / "engine" / "geometry" / "imaginary.h", "#include <embree3/rtcore.h>")) == 1
    assert len(problems_of(ROOT / "engine" / "utils" / "string.h", "")) == 1
    assert len(problems_of(ROOT / "engine" / "cli" / "main.cpp", '#include "python/module.h"')) == 1
