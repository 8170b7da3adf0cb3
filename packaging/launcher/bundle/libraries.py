"""Fetches and builds the third-party libraries, once: static, position-independent, hidden symbols; in build/bundle.

downloads/  the sources, by their checksums        source/NAME  unpacked
work/NAME   CMake's build folder                   prefix/      headers and archives of all of them
done/NAME   the recipe that was built; written last, so that whatever was interrupted is made anew
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import subprocess
import sys
import tarfile
from pathlib import Path

from launcher.bundle.parts import PARTS, Part
from launcher.common import BUILD, ROOT, LauncherError, say
from launcher.native import locked

PLACE = BUILD / "bundle"
DOWNLOADS = PLACE / "downloads"
PREFIX = PLACE / "prefix"
HELPER = "/usr/lib/apt/apt-helper"
C_FLAGS = "-fvisibility=hidden -ffunction-sections -fdata-sections"
CXX_FLAGS = f"{C_FLAGS} -fvisibility-inlines-hidden"


def mirrors() -> list[str]:
    """Where apt gets its packages from, in the order of its configuration; other archives answer "not found"."""
    command = ["apt-get", "indextargets", "--format", "$(SITE)", "Created-By: Packages"]
    try:
        result = subprocess.run(command, capture_output=True, text=True)
    except OSError:
        return []
    return list(dict.fromkeys(line.rstrip("/") for line in result.stdout.splitlines() if line))


def checksum(path: Path) -> str:
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def fetch_wheel(name: str, version: str, sha256: str, place: Path) -> Path:
    """A wheel of PyPI in `place`, which is made anew."""
    shutil.rmtree(place, ignore_errors=True)
    place.mkdir(parents=True)
    command = [sys.executable, "-m", "pip", "download", "--quiet", "--disable-pip-version-check", "--no-deps"]
    command += ["--only-binary=:all:", "--dest", str(place), f"{name}=={version}"]
    result = subprocess.run(command, capture_output=True, text=True)
    wheels = sorted(place.glob("*.whl"))
    if result.returncode != 0 or not wheels:
        raise LauncherError(
            f"{result.stderr[-1500:]}\n{name} {version} could not be fetched: it needs the network once."
        )
    if checksum(wheels[0]) != sha256:
        raise LauncherError(f"{wheels[0].name} is not the file that was expected (its checksum differs).")
    return wheels[0]


def download(part: Part) -> Path:
    """By apt's own downloader, which knows the machine's proxies; checked before it gets its name."""
    target = DOWNLOADS / Path(part.source).name
    if target.exists():
        if checksum(target) == part.sha256:
            return target
        target.unlink()
    if not os.path.exists(HELPER):
        raise LauncherError("The sources of the libraries come from Debian's archive by apt, which is not here.")
    DOWNLOADS.mkdir(parents=True, exist_ok=True)
    arriving = target.with_name(target.name + ".part")
    said = ""
    sites = mirrors()
    for site in sites:
        arriving.unlink(missing_ok=True)
        command = [HELPER, "download-file", f"{site}/pool/main/{part.source}", str(arriving), f"SHA256:{part.sha256}"]
        result = subprocess.run(command, capture_output=True, text=True)
        if result.returncode == 0 and arriving.exists() and checksum(arriving) == part.sha256:
            arriving.rename(target)
            return target
        said += f"{result.stdout}{result.stderr}"
    arriving.unlink(missing_ok=True)
    asked = ", ".join(sites) or "apt names no archive"
    raise LauncherError(
        f"{said[-1500:]}\nThe source of {part.name} could not be fetched ({asked}). "
        f"A package needs the network once; or put {target.name} into {DOWNLOADS}."
    )


def unpack(archive: Path, target: Path) -> None:
    shutil.rmtree(target, ignore_errors=True)
    target.parent.mkdir(parents=True, exist_ok=True)
    unpacking = target.with_name(target.name + ".part")
    shutil.rmtree(unpacking, ignore_errors=True)
    with tarfile.open(archive) as file:
        file.extractall(unpacking)
    (top,) = unpacking.iterdir()
    top.rename(target)
    unpacking.rmdir()


def strike_unused(part: Part, source: Path) -> None:
    path = source / part.unused_in
    words = re.split(r"(\s+)", path.read_text())
    for name in part.unused:
        if name not in words:
            raise LauncherError(f"{path} does not name {name}, which should be left out of it")
        words.remove(name)  # the first is in the list of sources
    path.write_text("".join(words))


def configure_command(part: Part, source: Path, work: Path) -> list[str]:
    project = ROOT / "packaging" / "bundle" / part.name if part.own_project else source / part.folder
    command = ["cmake", "-S", str(project), "-B", str(work), "-G", "Ninja", "-DCMAKE_BUILD_TYPE=Release"]
    command += [
        f"-DCMAKE_INSTALL_PREFIX={PREFIX}",
        f"-DCMAKE_PREFIX_PATH={PREFIX}",
        "-DCMAKE_INSTALL_LIBDIR:STRING=lib",
    ]
    command += ["-DBUILD_SHARED_LIBS=OFF", "-DCMAKE_POSITION_INDEPENDENT_CODE=ON"]
    command += [f"-DCMAKE_C_FLAGS={C_FLAGS}", f"-DCMAKE_CXX_FLAGS={CXX_FLAGS}"]
    command += ["-DCMAKE_FIND_PACKAGE_NO_PACKAGE_REGISTRY=ON"]
    if shutil.which("ccache"):
        command += ["-DCMAKE_C_COMPILER_LAUNCHER=ccache", "-DCMAKE_CXX_COMPILER_LAUNCHER=ccache"]
    if part.own_project:
        command.append(f"-DTALBOT_SOURCE={source}")
    return [*command, *part.options]


def compiler() -> str:
    result = subprocess.run(["c++", "--version"], capture_output=True, text=True)
    return result.stdout.split("\n")[0]


def recipes() -> dict[str, str]:
    """What each library is made from, those it needs included: another recipe is another build."""
    found: dict[str, str] = {}
    said = compiler()
    for part in PARTS:
        command = configure_command(part, Path("source"), Path("work"))
        made_by = [word for word in command if "_COMPILER_LAUNCHER=" not in word]  # ccache may come and go
        text = "\n".join([said, part.sha256, *made_by, *part.unused])
        text += "".join(found[name] for name in part.needs)
        found[part.name] = hashlib.sha256(text.encode()).hexdigest()
    return found


def run_step(command: list[str], log: Path, name: str) -> None:
    with open(log, "a") as file:
        result = subprocess.run(command, stdout=file, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL)
    if result.returncode != 0:
        tail = log.read_text(errors="replace")[-6000:]
        raise LauncherError(f"{tail}\n{name} could not be built. The log is {log}.")


def build_part(part: Part) -> None:
    source, work = PLACE / "source" / part.name, PLACE / "work" / part.name
    unpack(download(part), source)
    if part.unused_in:
        strike_unused(part, source)
    shutil.rmtree(work, ignore_errors=True)
    work.mkdir(parents=True)
    log = PLACE / f"{part.name}.log"
    log.unlink(missing_ok=True)
    run_step(configure_command(part, source, work), log, part.name)
    run_step(["cmake", "--build", str(work)], log, part.name)
    run_step(["cmake", "--install", str(work)], log, part.name)
    notices = PREFIX / "notices" / part.name
    notices.mkdir(parents=True, exist_ok=True)
    for name in part.notices:
        shutil.copy(source / name, notices / Path(name).name)
    shared = PREFIX / "shared"
    shared.mkdir(exist_ok=True)
    if part.shared:
        shutil.copyfile(PREFIX / "lib" / part.shared, shared / part.shared)
    # Nothing may link a shared library by accident.
    for library in (PREFIX / "lib").glob("*.so*"):
        library.unlink()
    shutil.rmtree(work)


def missing_parts() -> list[tuple[Part, str]]:
    """What was not built yet, or otherwise, and its recipe."""
    wanted, done = recipes(), PLACE / "done"
    return [
        (part, wanted[part.name])
        for part in PARTS
        if not (done / part.name).exists() or (done / part.name).read_text() != wanted[part.name]
    ]


def build_all() -> Path:
    """The folder with headers and archives; seconds when nothing changed."""
    done = PLACE / "done"
    with locked(PLACE):
        done.mkdir(exist_ok=True)
        missing = missing_parts()
        if missing:
            say(f"Building {len(missing)} libraries for the bundle, once (about 10 minutes on two cores)")
        for part, recipe in missing:
            say(f"  {part.name}")
            (done / part.name).unlink(missing_ok=True)
            try:
                build_part(part)
                (done / part.name).write_text(recipe)
            except OSError as error:
                raise LauncherError(f"{part.name} could not be built: {error}") from None
    return PREFIX
