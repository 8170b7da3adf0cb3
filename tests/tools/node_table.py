"""The table of engine/shader/README.md from reports of the node probes.

`TALBOT_NODE_REPORT=a.json ./talbot test --blender system --filter node_conformance`, the same with b.json and bpy-4.2
and so on, then `python3 tests/tools/node_table.py 3.4=a.json 4.2=b.json 4.5=c.json 5.0=d.json 5.2=e.json`. (5.2 is
Debian sid's: newest_blender.sh makes a tree with it.)
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

EXACT = 1e-4


def family(name: str) -> str:
    """Sky models are as different as nodes."""
    parts = name.split("/")
    return "/".join(parts[:2]) if parts[0] == "sky" else parts[0]


def main() -> None:
    versions = [argument.split("=", 1) for argument in sys.argv[1:]]
    worst: dict[str, dict[str, float]] = {}
    count: dict[str, int] = {}
    for version, path in versions:
        for name, difference in json.loads(Path(path).read_text()).items():
            row = worst.setdefault(family(name), {})
            row[version] = max(row.get(version, 0.0), difference)
            count[family(name)] = count.get(family(name), 0) + 1
    print("| probes | number | versions | answer | largest difference |")
    print("|---|---|---|---|---|")
    for name in sorted(worst):
        largest = max(worst[name].values())
        answer = "exact" if largest <= EXACT else "unsupported"
        print(f"| {name} | {count[name]} | {', '.join(worst[name])} | {answer} | {largest:.1g} |")


if __name__ == "__main__":
    main()
