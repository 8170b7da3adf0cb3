"""What `./talbot` promises before any Blender starts."""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import pytest
from launcher import cli, hosts, native, run_tests, tally

ROOT = Path(__file__).resolve().parents[2]


def shell(script: str, **environment: str) -> subprocess.CompletedProcess[str]:
    source = f'. "{ROOT}/packaging/launcher/packages.sh"\n{script}'
    return subprocess.run(
        ["/bin/bash", "-c", source], capture_output=True, text=True, env={**os.environ, **environment}, timeout=60
    )


def test_packages_of_a_command() -> None:
    assert " blender " in f" {' '.join(shell('talbot_wanted_packages render').stdout.split())} "
    assert "libembree-dev" in shell("talbot_wanted_packages ui x.blend").stdout.split()
    assert "blender" not in shell("talbot_wanted_packages render --blender bpy-5.0").stdout.split()
    assert "libegl1" in shell("talbot_wanted_packages blender --blender bpy-5.0 -b").stdout.split()
    packaging = shell("talbot_wanted_packages package").stdout.split()
    assert "nasm" in packaging and "blender" not in packaging
    assert {"nasm", "ccache"} <= set(shell("talbot_wanted_packages test").stdout.split())
    assert "nasm" not in shell("talbot_wanted_packages bench").stdout.split()
    assert "clang" in shell("talbot_wanted_packages test --sanitize").stdout.split()
    assert shell("talbot_wanted_packages").stdout.split() == ["python3"]


@pytest.mark.skipif(not Path("/usr/bin/dpkg-query").exists(), reason="not Debian")
def test_missing_packages_are_named() -> None:
    assert shell("talbot_missing_packages dpkg no-such-package").stdout.split() == ["no-such-package"]


@pytest.mark.skipif(not Path("/usr/bin/dpkg-query").exists(), reason="not Debian")
def test_without_root_the_missing_are_listed() -> None:
    result = shell("id() { echo 1000; }; talbot_wanted_packages() { echo no-such-package; }; talbot_ensure_packages x")
    assert result.returncode == 1
    assert "apt-get install --no-install-recommends no-such-package" in result.stderr


@pytest.mark.skipif(not Path("/usr/bin/dpkg-query").exists(), reason="not Debian")
def test_without_network_the_missing_are_listed() -> None:
    script = (
        "id() { echo 0; }; apt-get() { echo Temporary failure; return 100; }; talbot_wanted_packages() { echo nope; }"
    )
    result = shell(f"{script}; talbot_ensure_packages x")
    assert result.returncode == 1
    assert "Temporary failure" in result.stderr and "nope" in result.stderr


def test_another_distribution_gets_a_list() -> None:
    script = 'command() { [ "$2" != dpkg-query ]; }; talbot_missing_elsewhere() { echo ninja; }; talbot_ensure_packages'
    result = shell(f"{script} render")
    assert result.returncode == 1
    assert "not Debian" in result.stderr and "ninja" in result.stderr
    assert shell(f"{script} help").returncode == 0


def test_help_and_unknown_commands(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main([]) == 0
    text = capsys.readouterr().out
    assert all(name in text for name in ("render", "test", "blender", "ui", "doctor", "package", "bench"))
    with pytest.raises(SystemExit) as end:
        cli.main(["rendre"])
    assert end.value.code == 2


@pytest.mark.parametrize(
    "words",
    [
        ["render", "--size", "12"],
        ["render", "--size", "0x0"],
        ["render", "--samples", "0"],
        ["render", "--threads", "x"],
    ],
)
def test_bad_values_are_refused(words: list[str]) -> None:
    with pytest.raises(SystemExit) as end:
        cli.main(words)
    assert end.value.code == 2


def test_a_missing_file_is_a_message(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["render", "/no/such.blend"]) == 1
    assert "There is no file /no/such.blend" in capsys.readouterr().err


def test_an_unknown_blender_is_a_message(tmp_path: Path) -> None:
    with pytest.raises(hosts.LauncherError, match=r"bpy-5\.0"):
        hosts.find_host("bpy-1.0", tmp_path)


def test_a_folder_that_cannot_be_written_is_a_message(tmp_path: Path) -> None:
    (tmp_path / "file").touch()  # root may write everywhere, but not below a file
    with pytest.raises(hosts.LauncherError, match="cannot be written"), native.locked(tmp_path / "file" / "build"):
        pass


def test_a_build_from_another_place_is_dropped(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cache = tmp_path / "CMakeCache.txt"
    (tmp_path / "engine").mkdir()
    cache.write_text(f"CMAKE_HOME_DIRECTORY:INTERNAL={ROOT}\n")
    native.drop_foreign(tmp_path)
    assert cache.exists() and (tmp_path / "engine").exists()
    cache.write_text("CMAKE_HOME_DIRECTORY:INTERNAL=/somewhere/else\n")
    native.drop_foreign(tmp_path)
    assert list(tmp_path.iterdir()) == []
    assert "/somewhere/else" in capsys.readouterr().err


def test_official_modules_want_a_module_of_their_python(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hosts, "native_module", lambda: Path("_talbot.cpython-313-x86_64-linux-gnu.so"))
    with pytest.raises(hosts.LauncherError, match=r"CPython 3\.11.*cpython-313"):
        hosts.find_host("bpy-5.0", tmp_path)
    monkeypatch.setattr(hosts, "native_module", lambda: Path("_talbot.cpython-311-x86_64-linux-gnu.so"))
    assert hosts.why_no_modules() == ""


def test_the_users_configuration_is_left_alone(tmp_path: Path) -> None:
    environment = hosts.user_environment("test", tmp_path)
    assert environment["BLENDER_USER_SCRIPTS"] == str(tmp_path)
    config = [value for key, value in environment.items() if key in ("BLENDER_USER_CONFIG", "BLENDER_USER_RESOURCES")]
    assert len(config) == 2 and all(value.startswith(str(native.BUILD)) for value in config)


@pytest.mark.skipif(not Path("/usr/bin/blender").exists(), reason="no Blender of the distribution")
def test_a_virtual_environment_in_front_does_not_hide_the_systems_python(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "python3").symlink_to("/bin/true")
    monkeypatch.setenv("PATH", f"{tmp_path}:/usr/bin:/bin")
    path = hosts.find_host(None, tmp_path).environment["PATH"].split(":")
    assert path.index("/usr/bin") < path.index(str(tmp_path))


def write_report(path: Path, cases: str) -> Path:
    path.write_text(f'<?xml version="1.0"?><testsuites><testsuite>{cases}</testsuite></testsuites>')
    return path


def test_reports_are_counted(tmp_path: Path) -> None:
    cases = (
        '<testcase name="a" status="run"/><testcase name="b"><failure message="no">why</failure></testcase>'
        '<testcase name="c"><skipped message="no library"/></testcase><testcase name="d" status="notrun"/>'
        '<testcase name="e" status="fail"><system-out>output</system-out></testcase>'
    )
    count, failures, skips = tally.read_junit(write_report(tmp_path / "r.xml", cases))
    assert str(count) == "1 passed, 2 failed, 2 skipped"
    assert "why" in failures[0] and "output" in failures[1]
    assert "no library" in skips[0]
    with pytest.raises(ValueError):
        tally.read_junit(tmp_path / "none.xml")


def test_a_wrong_status_or_a_hang_at_the_end_is_a_failure(tmp_path: Path) -> None:
    report = tmp_path / "r.xml"
    good = '<testsuite><testcase name="a"/></testsuite>'
    program = f"import sys, time; open({str(report)!r}, 'w').write({good!r})"
    run = [sys.executable, "-c"]
    assert tally.run_reporting("good", [*run, program], report, 60) == tally.Tally(1, 0, 0)
    assert tally.run_reporting("status", [*run, f"{program}; sys.exit(139)"], report, 60) == tally.Tally(1, 1, 0)
    assert tally.run_reporting("none", [*run, "pass"], report, 60) == tally.Tally(0, 1, 0)
    slow = f"{program}; f = open({str(report)!r}); time.sleep(600)"
    assert tally.run_reporting("hang", [*run, slow], report, 10) == tally.Tally(1, 1, 0)


def test_steps_run_beside_each_other(tmp_path: Path) -> None:
    counts = [partial(tally.Tally, passed=1), partial(tally.Tally, failed=1), partial(tally.Tally, skipped=1)]
    assert tally.run_together(counts) == tally.Tally(1, 1, 1)

    def broken() -> tally.Tally:
        while not tally.running:
            time.sleep(0.01)
        raise OSError("no space")

    endless = partial(tally.run_logged, [sys.executable, "-c", "import time; time.sleep(600)"], tmp_path / "log", 600)
    started = time.monotonic()
    with pytest.raises(OSError, match="no space"):
        tally.run_together([endless, broken])
    assert not tally.running and time.monotonic() - started < 60


@pytest.mark.parametrize("option", ["", "--all", "--with-packages"])
@pytest.mark.parametrize("built", [True, False])
def test_packages_wait_for_their_libraries(monkeypatch: pytest.MonkeyPatch, option: str, built: bool) -> None:
    parser = argparse.ArgumentParser()
    run_tests.add_arguments(parser)
    monkeypatch.setattr(native, "build", lambda targets: None)
    monkeypatch.setattr(native, "stage", lambda: None)
    monkeypatch.setattr(run_tests, "run_together", lambda steps: tally.Tally(passed=1))
    monkeypatch.setattr(run_tests.packaged, "run_briefly", lambda: tally.Tally(passed=2))
    monkeypatch.setattr(run_tests.libraries, "missing_parts", lambda: [] if built else ["zlib"])
    count = run_tests.run_all(parser.parse_args(option.split()))
    assert count == (tally.Tally(passed=3) if built or option else tally.Tally(passed=1, skipped=1))
