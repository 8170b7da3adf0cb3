"""What `./talbot package` promises, as far as it can be shown without building libraries for it."""

from __future__ import annotations

import csv
import errno
import hashlib
import io
import os
import re
import subprocess
import sys
import zipfile
from base64 import urlsafe_b64decode
from pathlib import Path
from types import SimpleNamespace

import pytest
import tomllib
from launcher import package, packaged
from launcher.bundle import archives, examine, headers, isolate, libraries
from launcher.bundle.parts import PARTS, PYBIND11, Part
from launcher.common import ROOT, LauncherError, project_version

PYTHONS = ["3.11", "3.13"]
NATIVE = {"_talbot.so": b"\x7fELF module", "libtalbot-tbb-01234567.so": b"\x7fELF library"}


@pytest.fixture
def contents() -> archives.Contents:
    manifest = package.check_manifest(ROOT / "addon")
    notices = {"talbot/LICENSE": b"GPL", "embree/LICENSE.txt": b"Apache"}
    return archives.Contents(archives.read_addon(), NATIVE, notices, manifest, PYTHONS, project_version())


def entries(data: bytes) -> zipfile.ZipFile:
    return zipfile.ZipFile(io.BytesIO(data))


def test_the_wheel_is_for_both_pythons_and_records_its_files(contents: archives.Contents) -> None:
    assert archives.wheel_name(contents) == f"talbot-{project_version()}-cp311.cp313-none-manylinux_2_34_x86_64.whl"
    wheel = entries(archives.make_wheel(contents))
    info = f"talbot-{project_version()}.dist-info"
    said = wheel.read(f"{info}/WHEEL").decode()
    assert "Tag: cp311-none-manylinux_2_34_x86_64\nTag: cp313-none-manylinux_2_34_x86_64\n" in said
    assert f"Version: {project_version()}\n" in wheel.read(f"{info}/METADATA").decode()
    rows = {row[0]: row for row in csv.reader(wheel.read(f"{info}/RECORD").decode().splitlines())}
    assert set(rows) == set(wheel.namelist())
    for path, digest, size in rows.values():
        if path.endswith("RECORD"):
            continue
        data = wheel.read(path)
        assert len(data) == int(size)
        coded = digest.removeprefix("sha256=")
        assert urlsafe_b64decode(coded + "=" * (-len(coded) % 4)) == hashlib.sha256(data).digest()
    assert "talbot/sync/depsgraph.py" in wheel.namelist()
    assert all(wheel.read(f"talbot_native/{name}") == data for name, data in NATIVE.items())
    assert f"{info}/licenses/embree/LICENSE.txt" in wheel.namelist()


def test_the_extension_names_its_wheel(contents: archives.Contents) -> None:
    wheel = archives.wheel_name(contents)
    extension = entries(archives.make_extension(contents, archives.make_wheel(contents)))
    manifest = extension.read("blender_manifest.toml").decode()
    assert f'\nwheels = ["./wheels/{wheel}"]\n' in manifest
    assert manifest.index("wheels") < manifest.index("[permissions]")
    assert "__init__.py" in extension.namelist()
    assert not any(name.endswith(".so") for name in extension.namelist())
    assert extension.getinfo(f"wheels/{wheel}").compress_type == zipfile.ZIP_STORED


def test_the_legacy_zip_begins_with_its_folder(contents: archives.Contents) -> None:
    """Without that entry Blender overwrites the mapped library at an upgrade, and crashes."""
    legacy = entries(archives.make_legacy(contents))
    first = legacy.infolist()[0]
    assert first.filename == "talbot/" and first.is_dir()
    assert all(name.startswith("talbot/") for name in legacy.namelist())
    assert all(legacy.read(f"talbot/{name}") == data for name, data in NATIVE.items())
    assert "talbot/blender_manifest.toml" not in legacy.namelist()
    assert not any(name.endswith((".pyc", ".pyi")) for name in legacy.namelist())


def test_the_same_input_gives_the_same_bytes(contents: archives.Contents) -> None:
    assert archives.make_wheel(contents) == archives.make_wheel(contents)
    assert archives.make_legacy(contents) == archives.make_legacy(contents)


def test_what_asks_for_newer_systems_is_refused() -> None:
    fine = ["memcpy@GLIBC_2.14", "pthread_create@GLIBC_2.34", "_ZSt4cerr@GLIBCXX_3.4.29", "_Unwind_Resume@GCC_3.0"]
    assert examine.too_new(fine) == []
    assert examine.needed_versions(fine)["GLIBC"] == (2, 34)
    assert len(examine.too_new([*fine, "hypot@GLIBC_2.35"])) == 1
    assert len(examine.too_new(["_ZNSt18condition_variable4waitERSt11unique_lockISt5mutexE@GLIBCXX_3.4.30"])) == 1
    assert len(examine.too_new(["TIFFOpen@LIBTIFF_4.0"])) == 1


def test_names_that_the_host_would_answer_are_refused() -> None:
    undefined = ["malloc@GLIBC_2.2.5", "PyErr_SetString", "_Py_Dealloc", "__gmon_start__", "rtcNewDevice", "tbb_start"]
    assert examine.foreign(undefined) == ["rtcNewDevice", "tbb_start"]


ENTRY = 'extern "C" __attribute__((visibility("default"))) void* PyInit__talbot(void) { return nullptr; }\n'


def compiled(path: Path, source: str, *options: str) -> Path:
    command = ["c++", "-x", "c++", "-shared", "-fPIC", "-", "-x", "none", "-o", str(path), *options]
    subprocess.run(command, input=source, text=True, check=True)
    return path


def test_a_module_is_read_as_it_is(tmp_path: Path) -> None:
    module = compiled(tmp_path / "_talbot.so", ENTRY, "-fvisibility=hidden")
    assert examine.bundle_problems([module], "talbot_") == []
    leaky = ENTRY + "int leak() { return 1; }\nvoid rtcNewDevice();\nvoid* use = (void*)rtcNewDevice;"
    problems = examine.bundle_problems([compiled(module, leaky, "-Wl,-rpath,/opt/lib")], "talbot_")
    assert any("_Z4leakv is exported" in problem for problem in problems)
    assert any("rtcNewDevicev would be answered by the host" in problem for problem in problems)
    assert "_talbot.so: it looks for libraries in /opt/lib" in problems
    with pytest.raises(LauncherError, match="cannot be shipped"):
        examine.check_bundle([module], "talbot_")


def test_the_module_names_the_pythons_it_is_for(tmp_path: Path) -> None:
    """The entry by itself, built for Pythons that this one is not."""
    others = "PYTHON(3,1,PyInit_first) PYTHON(3,2,PyInit_second)"
    entries = (
        'extern "C" void* PyInit_first() { return nullptr; }\nextern "C" void* PyInit_second() { return nullptr; }\n'
    )
    source = (ROOT / "packaging" / "bundle" / "entry.cpp").read_text()
    compiled(tmp_path / "_talbot.so", source + entries, f"-DTALBOT_PYTHONS={others}")
    script = f"import sys; sys.path.insert(0, {str(tmp_path)!r}); import _talbot"
    result = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    here = f"{sys.version_info.major}.{sys.version_info.minor}"
    said = f"ImportError: it is built for Python 3.1 3.2, and this is {here}"
    assert (result.returncode, result.stderr.strip().splitlines()[-1]) == (1, said)


def test_a_shared_library_inside_gets_names_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With the tool replaced: what it is told to do to which file."""
    library = compiled(tmp_path / "libthing.so.1", 'extern "C" int thing() { return 3; }', "-Wl,-soname,libthing.so.1")
    source = 'extern "C" int thing();\n' + ENTRY.replace("nullptr", "thing() == 3 ? (void*)thing : nullptr")
    module = compiled(tmp_path / "_talbot.so", source, "-fvisibility=hidden", str(library))
    calls: list[tuple[str, ...]] = []
    real = examine.tool_output

    def record(*command: str) -> str:
        if command[0] != "patchelf":
            return real(*command)
        if command[1] == "--rename-dynamic-symbols":
            assert "thing talbot_thing\n" in Path(command[2]).read_text()
        calls.append(command[1:])
        return ""

    monkeypatch.setattr(isolate, "patchelf", lambda: "patchelf")
    monkeypatch.setattr(isolate, "tool_output", record)
    monkeypatch.setattr(isolate, "SHARED_PARTS", {"thing": ("MIT", "libthing1", "libthing.so.1")})
    monkeypatch.setattr(isolate, "PARTS", ())
    monkeypatch.setattr(isolate, "find_shared", lambda soname: library)
    files = isolate.isolate(module, tmp_path / "isolated")
    own = isolate.own_name("libthing.so.1", library.read_bytes())
    assert [path.name for path in files] == ["_talbot.so", own] and own.startswith("libtalbot-thing-")
    assert ("--replace-needed", "libthing.so.1", own, str(files[0])) in calls
    assert ("--set-rpath", "$ORIGIN", str(files[0])) in calls
    assert ("--set-soname", own, str(files[1])) in calls
    # As they are now, not renamed, they would be refused.
    problems = examine.bundle_problems(files, "talbot_")
    assert f"{own}: thing is exported" in problems and "_talbot.so: thing would be answered by the host" in problems


def test_sizes_are_limits() -> None:
    examine.check_sizes({"a.zip": examine.ZIPPED_BYTES}, examine.UNPACKED_BYTES)
    with pytest.raises(LauncherError, match=r"a\.zip would be 30\.0 MB"):
        examine.check_sizes({"a.zip": examine.ZIPPED_BYTES + 1}, 0)
    with pytest.raises(LauncherError, match="unpacked"):
        examine.check_sizes({}, examine.UNPACKED_BYTES + 1)


def test_a_version_that_disagrees_is_refused(tmp_path: Path) -> None:
    with pytest.raises(LauncherError, match="is missing"):
        package.check_manifest(tmp_path)
    (tmp_path / "blender_manifest.toml").write_text('version = "0.0.7"\n')
    with pytest.raises(LauncherError, match=r"says version 0\.0\.7"):
        package.check_manifest(tmp_path)


def test_nothing_half_written_is_left(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(path: Path) -> None:
        raise LauncherError("refused")

    monkeypatch.setattr(package, "validate", refuse)
    (tmp_path / "talbot-1-linux-x64.zip").write_bytes(b"the one before")
    files = {"talbot-1-legacy.zip": archives.write_zip({"a": b"b"}), "talbot-1-linux-x64.zip": archives.write_zip({})}
    with pytest.raises(LauncherError, match="refused"):
        package.write_all(files, tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["talbot-1-linux-x64.zip"]
    assert (tmp_path / "talbot-1-linux-x64.zip").read_bytes() == b"the one before"


def test_a_full_disk_is_a_message(contents: archives.Contents, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(file: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(package.os, "fsync", full)
    with pytest.raises(LauncherError, match=r"Nothing was packaged.*No space left"):
        package.package(contents, tmp_path / "dist")
    assert list((tmp_path / "dist").iterdir()) == []


def test_a_place_that_cannot_be_written_is_a_message(contents: archives.Contents, tmp_path: Path) -> None:
    (tmp_path / "file").touch()  # root may write everywhere, but not below a file
    with pytest.raises(LauncherError, match=r"cannot be written: Not a directory"):
        package.package(contents, tmp_path / "file" / "dist")


def test_another_compiler_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(package, "COMPILER_MAJOR", "11")
    with pytest.raises(LauncherError, match=r"g\+\+ 11 on Debian 12"):
        package.check_compiler()


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(libraries, "PLACE", tmp_path)
    monkeypatch.setattr(libraries, "DOWNLOADS", tmp_path / "downloads")
    monkeypatch.setattr(libraries, "PREFIX", tmp_path / "prefix")
    return tmp_path


def fake_part(content: bytes) -> Part:
    return Part("thing", "t/thing/thing_1.orig.tar.gz", hashlib.sha256(content).hexdigest(), "MIT", ())


def test_too_small_a_disk_is_told_first(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(libraries, "PLACE", place / "build" / "bundle")  # neither is there yet
    monkeypatch.setattr(package.shutil, "disk_usage", lambda path: SimpleNamespace(free=7e8))
    with pytest.raises(LauncherError, match=rf"take 1 GB to build; 0\.7 GB are free in {place}"):
        package.check_space()
    (place / "prefix").mkdir()
    package.check_space()


def test_a_disk_that_fills_up_is_a_message(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fill(part: Part) -> None:
        Path("/dev/full").write_text("x")

    monkeypatch.setattr(libraries, "build_part", fill)
    with pytest.raises(LauncherError, match=rf"{PARTS[0].name} could not be built: .*No space left"):
        libraries.build_all()
    assert list((place / "done").iterdir()) == []


def test_without_network_there_is_one_sentence(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(libraries, "mirrors", lambda: ["http://127.0.0.1:1/debian"])
    with pytest.raises(LauncherError, match=r"(?s)thing could not be fetched.*needs the network once"):
        libraries.download(fake_part(b"content"))
    assert list((place / "downloads").iterdir()) == []


def test_a_source_that_is_there_and_right_is_used_and_a_damaged_one_is_not(
    place: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(libraries, "mirrors", list)
    archive = place / "downloads" / "thing_1.orig.tar.gz"
    archive.parent.mkdir()
    archive.write_bytes(b"content")
    assert libraries.download(fake_part(b"content")) == archive
    archive.write_bytes(b"half of the cont")
    with pytest.raises(LauncherError, match="could not be fetched"):
        libraries.download(fake_part(b"content"))
    assert not archive.exists()


def test_an_interrupted_build_is_made_anew(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    built: list[str] = []
    monkeypatch.setattr(libraries, "build_part", lambda part: built.append(part.name))
    libraries.build_all()
    assert built == [part.name for part in PARTS]
    built.clear()
    libraries.build_all()
    assert built == []
    (place / "done" / "openexr").unlink()  # as after a crash: the stamp is written last
    (place / "done" / "zlib").write_text("another recipe")
    libraries.build_all()
    assert built == ["zlib", "openexr"]


def test_another_recipe_rebuilds_what_needs_it(monkeypatch: pytest.MonkeyPatch) -> None:
    before = libraries.recipes()
    changed = tuple(
        Part(**{**part.__dict__, "options": (*part.options, "-DX=1")}) if part.name == "imath" else part
        for part in PARTS
    )
    monkeypatch.setattr(libraries, "PARTS", changed)
    after = libraries.recipes()
    assert {name for name in before if before[name] != after[name]} == {
        "imath",
        "openexr",
        "openimageio",
    }


def test_ccache_changes_no_recipe(monkeypatch: pytest.MonkeyPatch) -> None:
    with_and_without = []
    for answer in ("/usr/bin/ccache", None):
        monkeypatch.setattr(libraries.shutil, "which", lambda name, answer=answer: answer)
        with_and_without.append(libraries.recipes())
    assert with_and_without[0] == with_and_without[1]


def test_parts_are_in_the_order_they_need(monkeypatch: pytest.MonkeyPatch) -> None:
    seen: set[str] = set()
    for part in PARTS:
        assert seen.issuperset(part.needs), part.name
        assert len(part.sha256) == 64 and part.notices
        seen.add(part.name)


def test_an_unknown_python_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(headers, "system_include", lambda version: None)
    with pytest.raises(LauncherError, match=r"no headers of Python 3\.9 here; known are 3\.11, 3\.13"):
        headers.python_include("3.9")


def test_the_configuration_of_other_platforms_keeps_step() -> None:
    text = (ROOT / "packaging" / "wheels" / "pyproject.toml").read_text()
    config = tomllib.loads(text)
    assert config["project"]["version"] == project_version()
    assert f"pybind11=={PYBIND11}" in config["build-system"]["requires"]
    built = [word.removeprefix("cp3").removesuffix("-*") for word in config["tool"]["cibuildwheel"]["build"]]
    assert [f"3.{minor}" for minor in built] == list(headers.DEFAULT_PYTHONS)
    cmake = (ROOT / "CMakeLists.txt").read_text() + (ROOT / "engine" / "cmake" / "flags.cmake").read_text()
    defined = set(re.findall(r"^\s*(?:option|set)\((TALBOT_\w+)", cmake, re.MULTILINE))
    assert set(re.findall(r"\b(TALBOT_\w+)", text)) <= defined
    engine = (ROOT / "engine" / "CMakeLists.txt").read_text()
    assert all(f"COMPONENT {name}" in engine for name in config["tool"]["scikit-build"]["install"]["components"])


@pytest.mark.parametrize(
    ("cases", "again"),
    [
        ([("4.2: cycles_alone", packaged.ENDED)], True),
        ([("4.2: cycles_alone", "AssertionError: dark")], False),
        ([("4.2: install", packaged.ENDED)], False),
        ([("4.2: cycles_alone", ""), ("4.2: install", packaged.ENDED)], False),
    ],
)
def test_only_what_happens_without_talbot_is_tried_again(
    tmp_path: Path, cases: list[tuple[str, str]], again: bool
) -> None:
    texts = [f'<failure message="{message}"/>' if message else "" for _, message in cases]
    lines = [f'<testcase name="{name}">{text}</testcase>' for (name, _), text in zip(cases, texts, strict=True)]
    (tmp_path / "report.xml").write_text(f"<testsuite>{''.join(lines)}</testsuite>")
    assert packaged.ended_alone(tmp_path / "report.xml") is again
    assert not packaged.ended_alone(tmp_path / "none.xml")


def test_published_tables_carry_their_notices() -> None:
    notices = package.data_notices()
    assert b"Copyright (c) 2012 - 2013, Lukas Hosek and Alexander Wilkie" in notices["hosek-wilkie/NOTICE"]
    assert b"Apache License, Version 2.0" in notices["ltc-sheen/NOTICE"]
    assert not any(b"//" in notice or b"#include" in notice for notice in notices.values())
