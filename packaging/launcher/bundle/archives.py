"""Writes the wheel, the extension and the legacy add-on. The same input gives the same bytes.

wheel       talbot/ (the add-on), talbot_native/_talbot.so, talbot-VERSION.dist-info/
extension   the add-on, blender_manifest.toml, wheels/THE_WHEEL     (Blender 4.2 and newer unpacks the wheel)
legacy      talbot/ with the add-on and _talbot.so in one folder    (Blender 3.4 to 4.1)
"""

from __future__ import annotations

import base64
import hashlib
import io
import zipfile
from dataclasses import dataclass, field
from pathlib import Path

from launcher.common import ROOT

EPOCH = (1980, 1, 1, 0, 0, 0)
PLATFORM = "manylinux_2_34_x86_64"
MODULE = "_talbot.so"
NATIVE_PACKAGE = '"""The native part of Talbot, without Blender: `from talbot_native import _talbot`."""\n'


@dataclass
class Contents:
    """What goes into all three, by path: Python sources, the native module and its libraries, notices by library."""

    addon: dict[str, bytes]
    native: dict[str, bytes]
    notices: dict[str, bytes]
    manifest: str
    pythons: list[str]
    version: str
    requires_python: str = field(init=False)

    def __post_init__(self) -> None:
        self.requires_python = f">={min(self.pythons, key=lambda text: int(text.split('.')[1]))}"


def read_addon() -> dict[str, bytes]:
    """The add-on's files but the manifest, which belongs to the extension alone, and the stub for type checkers."""
    folder = ROOT / "addon"
    found = {}
    for path in sorted(folder.rglob("*.py")):
        found[path.relative_to(folder).as_posix()] = path.read_bytes()
    return found


def write_zip(entries: dict[str, bytes], store: tuple[str, ...] = ()) -> bytes:
    """Names that end in / are folders. What ends in one of `store` is packed already."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, data in entries.items():
            info = zipfile.ZipInfo(name, EPOCH)
            info.external_attr = (0o40755 << 16 | 0x10) if name.endswith("/") else (0o100644 << 16)
            stored = name.endswith(("/", *store))
            info.compress_type = zipfile.ZIP_STORED if stored else zipfile.ZIP_DEFLATED
            archive.writestr(info, data, compresslevel=None if stored else 9)
    return buffer.getvalue()


def wheel_tags(pythons: list[str]) -> list[str]:
    return [f"cp{version.replace('.', '')}-none-{PLATFORM}" for version in pythons]


def wheel_name(contents: Contents) -> str:
    short = ".".join(f"cp{version.replace('.', '')}" for version in contents.pythons)
    return f"talbot-{contents.version}-{short}-none-{PLATFORM}.whl"


def metadata(contents: Contents) -> str:
    lines = [
        "Metadata-Version: 2.1",
        "Name: talbot",
        f"Version: {contents.version}",
        "Summary: Physically based path tracer for the CPU, a render engine of Blender",
        "License: GPL-3.0-or-later, with parts under the licences in the licenses folder",
        f"Requires-Python: {contents.requires_python}",
        "Requires-Dist: numpy",
        "",
        "Beside Blender as a Python module: `import bpy, talbot; talbot.register()`.",
        "",
    ]
    return "\n".join(lines)


def record_line(name: str, data: bytes) -> str:
    digest = base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=").decode()
    return f"{name},sha256={digest},{len(data)}\n"


def make_wheel(contents: Contents) -> bytes:
    info = f"talbot-{contents.version}.dist-info"
    tags = "".join(f"Tag: {tag}\n" for tag in wheel_tags(contents.pythons))
    entries = {f"talbot/{name}": data for name, data in contents.addon.items()}
    entries["talbot_native/__init__.py"] = NATIVE_PACKAGE.encode()
    entries |= {f"talbot_native/{name}": data for name, data in contents.native.items()}
    entries |= {f"{info}/licenses/{name}": data for name, data in contents.notices.items()}
    entries[f"{info}/METADATA"] = metadata(contents).encode()
    entries[f"{info}/WHEEL"] = f"Wheel-Version: 1.0\nGenerator: talbot\nRoot-Is-Purelib: false\n{tags}".encode()
    record = "".join(record_line(name, data) for name, data in entries.items())
    entries[f"{info}/RECORD"] = f"{record}{info}/RECORD,,\n".encode()
    return write_zip(entries)


def make_extension(contents: Contents, wheel_data: bytes) -> bytes:
    """The manifest first; the wheel is a zip and not packed again."""
    wheel = wheel_name(contents)
    manifest = contents.manifest.replace("\n\n[permissions]", f'\nwheels = ["./wheels/{wheel}"]\n\n[permissions]')
    entries = {"blender_manifest.toml": manifest.encode(), "LICENSE": contents.notices["talbot/LICENSE"]}
    entries |= contents.addon
    entries[f"wheels/{wheel}"] = wheel_data
    return write_zip(entries, (".whl",))


def make_legacy(contents: Contents) -> bytes:
    """The folder's own entry comes first: Blender removes the old folder before an upgrade only where it sees one.
    Otherwise it overwrites a library that is mapped, and crashes."""
    entries = {"talbot/": b""}
    entries |= {f"talbot/{name}": data for name, data in contents.addon.items()}
    entries |= {f"talbot/{name}": data for name, data in contents.native.items()}
    entries |= {f"talbot/licenses/{name}": data for name, data in contents.notices.items()}
    return write_zip(entries)


def make_all(contents: Contents) -> dict[str, bytes]:
    """Extension, legacy add-on and wheel, by file name, in this order."""
    wheel = make_wheel(contents)
    return {
        f"talbot-{contents.version}-linux-x64.zip": make_extension(contents, wheel),
        f"talbot-{contents.version}-legacy.zip": make_legacy(contents),
        wheel_name(contents): wheel,
    }


def read_tree(folder: Path) -> dict[str, bytes]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()
    }


def unpacked_size(archive: bytes) -> int:
    with zipfile.ZipFile(io.BytesIO(archive)) as file:
        return sum(entry.file_size for entry in file.infolist())
