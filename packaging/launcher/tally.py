"""Counting tests: every step of `./talbot test` ends in a Tally, and failures are shown where they happen."""

from __future__ import annotations

import os
import signal
import subprocess
import time
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path

from launcher.common import say

CTEST_SECONDS = 1500.0
SHOWN = 30000  # characters of output shown for one failed step
AT_ONCE = 2  # steps: much of each is one thread's work


@dataclass
class Tally:
    passed: int = 0
    failed: int = 0
    skipped: int = 0

    def __add__(self, other: Tally) -> Tally:
        return Tally(self.passed + other.passed, self.failed + other.failed, self.skipped + other.skipped)

    def __str__(self) -> str:
        return f"{self.passed} passed, {self.failed} failed, {self.skipped} skipped"


def read_junit(path: Path) -> tuple[Tally, list[str], list[str]]:
    """Counts, failures and reasons of skips from ctest's or pytest's report; ValueError when there is none."""
    try:
        root = ElementTree.parse(path).getroot()
    except (OSError, ElementTree.ParseError) as error:
        raise ValueError(f"no test report: {error}") from None
    tally = Tally()
    failures: list[str] = []
    skips: list[str] = []
    for case in root.iter("testcase"):
        name = case.get("name", "?")
        bad = [child for child in case if child.tag in ("failure", "error")]
        skipped = case.find("skipped")
        if bad or case.get("status") == "fail":
            tally.failed += 1
            output = case.findtext("system-out") or ""
            details = "\n".join(child.text or child.get("message") or "" for child in bad).strip()
            failures.append(f"FAILED {name}\n{details}\n{output.strip()}"[-SHOWN:])
        elif skipped is not None or case.get("status") in ("notrun", "disabled"):
            tally.skipped += 1
            reason = (skipped.get("message") if skipped is not None else "") or case.findtext("system-out") or ""
            skips.append(f"skipped {name}: {reason.strip()[-300:]}")
        else:
            tally.passed += 1
    return tally, failures, skips


@dataclass
class Finished:
    code: int
    output: str
    seconds: float


running: set[subprocess.Popen[bytes]] = set()
"""What run_logged waits for, in all threads."""


def kill_group(process: subprocess.Popen[bytes]) -> None:
    if process.poll() is None:
        os.killpg(process.pid, signal.SIGKILL)


def run_logged(command: list[str], log: Path, timeout: float, environment: dict[str, str] | None = None) -> Finished:
    """Output into a file. A hang is ended by force (the whole group): leaving Blender is part of what is tested."""
    log.parent.mkdir(parents=True, exist_ok=True)
    started = time.monotonic()
    with open(log, "w") as file:
        process = subprocess.Popen(
            command,
            stdout=file,
            stderr=subprocess.STDOUT,
            stdin=subprocess.DEVNULL,
            env=environment,
            start_new_session=True,
        )
        running.add(process)
        try:
            code = process.wait(timeout)
        except subprocess.TimeoutExpired:
            kill_group(process)
            process.wait()
            code = -signal.SIGALRM
        except KeyboardInterrupt:
            kill_group(process)
            raise
        finally:
            running.discard(process)
    return Finished(code, log.read_text(errors="replace"), time.monotonic() - started)


def describe(code: int, timeout: float) -> str:
    if code == -signal.SIGALRM:
        return f"did not end within {timeout:.0f} s"
    return f"ended by signal {-code}" if code < 0 else f"ended with status {code}"


def run_reporting(
    title: str,
    command: list[str],
    report: Path,
    timeout: float,
    environment: dict[str, str] | None = None,
    good: tuple[int, ...] = (0,),
) -> Tally:
    """Runs something that writes a JUnit report. A status that does not fit the report is one more failure."""
    report.unlink(missing_ok=True)
    log = report.with_suffix(".log")
    finished = run_logged(command, log, timeout, environment)
    try:
        tally, failures, skips = read_junit(report)
    except ValueError as error:
        tally, failures, skips = Tally(failed=1), [f"{error}\n{finished.output[-SHOWN:]}"], []
    if finished.code not in good and tally.failed == 0:
        tally += Tally(failed=1)
        failures.append(f"all tests passed, but it {describe(finished.code, timeout)}\n{finished.output[-3000:]}")
    # At once: another step may speak meanwhile.
    say("\n".join([*failures, *(f"  {text}" for text in skips), f"{title}: {tally} ({finished.seconds:.0f} s)"]))
    return tally


def run_together(steps: list[Callable[[], Tally]]) -> Tally:
    """A few at a time, in this order; each speaks when it has ended."""
    tally = Tally()
    with ThreadPoolExecutor(AT_ONCE) as pool:
        futures = [pool.submit(step) for step in steps]
        try:
            for future in as_completed(futures):
                tally += future.result()
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            for process in list(running):
                kill_group(process)
            raise
    return tally


def run_check(title: str, command: list[str], log: Path, environment: dict[str, str] | None = None) -> Tally:
    """A tool that says what is wrong and ends with a status: counts as one test."""
    finished = run_logged(command, log, 600, environment)
    if finished.code == 0:
        say(f"{title}: fine")
        return Tally(passed=1)
    say(f"{finished.output[-SHOWN:]}\n{title}: FAILED ({describe(finished.code, 600)})")
    return Tally(failed=1)


def skip_check(title: str, reason: str) -> Tally:
    say(f"{title}: skipped, {reason}")
    return Tally(skipped=1)


def run_ctest(build: Path, title: str, name_filter: str | None, environment: dict[str, str] | None = None) -> Tally:
    report = build / "reports" / "ctest.xml"
    command = [
        "ctest",
        "--test-dir",
        str(build),
        "--parallel",
        str(len(os.sched_getaffinity(0))),
        "--output-on-failure",
    ]
    command += ["--timeout", "600", "--output-junit", str(report)]
    if name_filter:
        command += ["-R", name_filter]
    return run_reporting(title, command, report, CTEST_SECONDS, environment)
