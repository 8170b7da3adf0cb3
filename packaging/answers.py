"""Which library file answers each name that the native module asks for, in this very process.

The loader writes the address of every answer into the module's tables (Python loads modules with all names bound at
once); this reads them back and looks up in which mapped file each address lies. No tools, no restart, nothing guessed.
Imported inside Blender by `./talbot doctor` and by the tests of the packages.
"""

from __future__ import annotations

import ctypes
import os
import re
import struct
from bisect import bisect_right
from collections import defaultdict
from functools import cache
from typing import NamedTuple

FAMILIES = (
    ("Embree", r"(talbot_)?rtc[A-Z]"),
    ("TBB", r"(talbot_)?(TBB_|_Z\w*3tbb)"),
    ("OpenImageIO", r"_Z\w*OpenImageIO"),
    ("OpenColorIO", r"_Z\w*OpenColorIO"),
    ("OpenEXR", r"exr_|_Z\w*(Imf_|Imath_|Iex_|IlmThread_)"),
    ("OpenVDB", r"_Z\w*openvdb"),
    ("image codecs", r"(png|jpeg|TIFF|WebP|opj|inflate|deflate|XML)_?[A-Za-z]*"),
    ("Python", r"_?Py"),
)
"""First that fits; the rest is the C and C++ libraries'."""

R_X86_64_64, R_X86_64_GLOB_DAT, R_X86_64_JUMP_SLOT = 1, 6, 7
SHT_RELA, SHT_DYNAMIC, SHT_DYNSYM = 4, 6, 11
DT_NEEDED = 1


class Section(NamedTuple):
    kind: int
    address: int
    offset: int
    size: int
    link: int


class Answer(NamedTuple):
    name: str
    file: str  # "" when nobody answers


class Mappings:
    """The files of this process by address."""

    def __init__(self) -> None:
        rows: list[tuple[int, int, str]] = []
        with open("/proc/self/maps") as maps:
            for line in maps:
                fields = line.rstrip("\n").split(maxsplit=5)
                start, end = (int(word, 16) for word in fields[0].split("-"))
                rows.append((start, end, fields[5] if len(fields) == 6 else ""))
        self.rows = rows
        self.starts = [row[0] for row in rows]

    def file_at(self, address: int) -> str:
        index = bisect_right(self.starts, address) - 1
        if index < 0 or address >= self.rows[index][1]:
            return ""
        return self.rows[index][2]

    def base_of(self, path: str) -> int:
        return min(start for start, _, file in self.rows if file == path)


def read_sections(data: bytes) -> list[Section]:
    if data[:6] != b"\x7fELF\x02\x01":
        raise ValueError("not a 64-bit little-endian ELF file")
    table, size, count = struct.unpack_from("<Q", data, 0x28)[0], *struct.unpack_from("<HH", data, 0x3A)
    rows = (struct.unpack_from("<IIQQQQIIQQ", data, table + index * size) for index in range(count))
    return [Section(row[1], row[3], row[4], row[5], row[6]) for row in rows]


def text_at(data: bytes, offset: int) -> str:
    return data[offset : data.index(b"\0", offset)].decode()


class Module:
    """A native module that is loaded: its file and what the loader made of it."""

    def __init__(self, path: str) -> None:
        self.path = os.path.realpath(path)
        with open(self.path, "rb") as file:
            self.data = file.read()
        self.sections = read_sections(self.data)

    def needed(self) -> list[str]:
        """The libraries it names itself."""
        section = next(section for section in self.sections if section.kind == SHT_DYNAMIC)
        strings = self.sections[section.link]
        names = []
        for position in range(section.offset, section.offset + section.size, 16):
            tag, value = struct.unpack_from("<qQ", self.data, position)
            if tag == DT_NEEDED:
                names.append(text_at(self.data, strings.offset + value))
        return names

    def answers(self) -> list[Answer]:
        """Every name it was bound to, its own exported ones included."""
        symbols = next(section for section in self.sections if section.kind == SHT_DYNSYM)
        strings = self.sections[symbols.link]
        mappings = Mappings()
        base = mappings.base_of(self.path)
        found: dict[str, str] = {}
        for section in self.sections:
            if section.kind != SHT_RELA:
                continue
            for position in range(section.offset, section.offset + section.size, 24):
                slot, info, _ = struct.unpack_from("<QQq", self.data, position)
                if info & 0xFFFFFFFF not in (R_X86_64_64, R_X86_64_GLOB_DAT, R_X86_64_JUMP_SLOT) or not info >> 32:
                    continue
                start = struct.unpack_from("<I", self.data, symbols.offset + 24 * (info >> 32))[0]
                name = text_at(self.data, strings.offset + start)
                address = struct.unpack("<Q", ctypes.string_at(base + slot, 8))[0]
                found[name] = mappings.file_at(address) if address else ""
        return [Answer(name, file) for name, file in sorted(found.items())]

    def strangers(self, found: list[Answer]) -> list[Answer]:
        """Names that are answered by a library which the module does not name: by the host's copy of something.
        Python's names are the host's to answer; so are the C library's, for the whole process: a program may bring an
        allocator, and keeps a copy of `stderr`."""
        allowed = (*self.needed(), "ld-linux", "[vdso]")
        return [
            answer
            for answer in found
            if answer.file
            and answer.file != self.path
            and family(answer.name) != "Python"
            and not os.path.basename(answer.file).startswith(allowed)
            and not is_system(answer.name)
        ]


@cache
def system_libraries() -> list[ctypes.CDLL]:
    """The C and C++ libraries, which every process here has once."""
    return [ctypes.CDLL(name) for name in ("libc.so.6", "libm.so.6", "libgcc_s.so.1", "libstdc++.so.6")]


def is_system(name: str) -> bool:
    return any(hasattr(library, name) for library in system_libraries())


def family(name: str) -> str:
    return next((title for title, pattern in FAMILIES if re.match(pattern, name)), "C and C++")


def by_family(found: list[Answer]) -> dict[str, dict[str, int]]:
    """How many names of each family each file answers."""
    table: dict[str, dict[str, int]] = defaultdict(lambda: defaultdict(int))
    for answer in found:
        table[family(answer.name)][answer.file] += 1
    return {title: dict(files) for title, files in table.items()}


def report(path: str) -> dict[str, object]:
    """All of it as plain data, for JSON."""
    module = Module(path)
    found = module.answers()
    return {
        "file": module.path,
        "needed": module.needed(),
        "families": by_family(found),
        "strangers": [f"{answer.name} is answered by {answer.file}" for answer in module.strangers(found)],
    }
