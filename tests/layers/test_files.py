"""Files stay small enough to read, and nothing is left for later without an issue."""

from __future__ import annotations

import re
from pathlib import Path

from house import ROOT, shown, sources

LONGEST = {".h": 800, ".cpp": 800, ".py": 400, ".sh": 400}
LATER = re.compile(r"\b(TO" + r"DO|FIX" + r"ME|XX" + r"X|HA" + r"CK)\b(?!\(#\d+\))")


def all_sources() -> list[Path]:
    return [*sources(".h", ".cpp", ".py", ".pyi", ".sh", ".cmake"), ROOT / "talbot", ROOT / "CMakeLists.txt"]


def test_no_file_is_too_long() -> None:
    lengths = {shown(path): len(path.read_text().splitlines()) for path in sources(*LONGEST)}
    limits = {name: LONGEST[Path(name).suffix] for name in lengths}
    assert {name: length for name, length in lengths.items() if length > limits[name]} == {}


def test_nothing_is_left_for_later_without_an_issue() -> None:
    found = [
        f"{shown(path)}:{number}: {line.strip()}"
        for path in all_sources()
        for number, line in enumerate(path.read_text().splitlines(), 1)
        if LATER.search(line)
    ]
    assert found == []


def test_versions_agree() -> None:
    version = re.search(r"project\(talbot VERSION ([\d.]+)", (ROOT / "CMakeLists.txt").read_text())
    assert version is not None
    manifest = ROOT / "addon" / "blender_manifest.toml"
    assert f'\nversion = "{version[1]}"' in manifest.read_text()
    assert f"## {version[1]}" in (ROOT / "CHANGELOG.md").read_text()


def test_links_of_the_readme_lead_somewhere() -> None:
    text = (ROOT / "README.md").read_text()
    targets = re.findall(r"\]\(([^)#]+)", text)
    assert targets
    assert [target for target in targets if "://" not in target and not (ROOT / target).exists()] == []
