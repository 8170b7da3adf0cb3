"""Stand-ins for the native module and the scene reader: error paths must be tested where the real ones do not fail."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

import numpy as np
import talbot.final
import talbot.native
import talbot.preview
import talbot.sessions
import talbot.viewport
from talbot.sessions import Synced
from talbot.settings import crop
from talbot.sync.context import SyncContext

CHANNELS = {"combined": 4, "depth": 1, "mist": 1, "object_index": 1, "material_index": 1, "sample_count": 1}


class Error(RuntimeError):
    """The native module's error."""


Error.__module__ = "_talbot"


class FakeSession:
    """Renders one colour. Class attributes say what goes wrong."""

    fail_with = ""
    raise_in_start: BaseException | None = None
    lines: list[tuple[str, str, str, int]] = []
    made: list[FakeSession] = []
    steps = 1
    paths = -1
    """Camera paths traced; -1: three through each pixel."""

    def __init__(self) -> None:
        self.pass_names: list[str] = []
        self.denoiser: list[str] | None = None
        self.width, self.height = 0, 0
        self.starts = 0
        self.waits = 0
        self.building = False
        """The last start has no picture yet."""
        self.stopped = False
        self.cancelled = False
        FakeSession.made.append(self)

    def set_passes(self, names: list[str]) -> None:
        self.pass_names = names

    def start(self) -> None:
        self.starts += 1
        self.waits = 0
        if self.raise_in_start is not None:
            raise self.raise_in_start

    def wait(self, milliseconds: int) -> bool:
        self.waits += 1
        return self.waits >= self.steps

    def progress(self) -> dict[str, Any]:
        state = "failed" if self.fail_with else "done" if self.waits >= self.steps else "rendering"
        return {
            "state": state,
            "status": "Sample 3/3",
            "fraction": min(1.0, self.waits / self.steps),
            "samples_done": 3,
            "samples_total": 3,
            "seconds": 61.5,
            "remaining": -1.0,
            "memory": 5 << 20,
            "memory_peak": 9 << 20,
            "image_version": 100 * self.starts + self.waits - (100 if self.building else 0),
            "pixel_size": 1,
        }

    def statistics(self) -> dict[str, Any]:
        return {
            "camera_rays": 1000,
            "bounce_rays": 3000,
            "shadow_rays": 2000,
            "paths": self.paths if self.paths >= 0 else 3 * self.width * self.height,
            "render_seconds": 0.5,
            "update_seconds": 0.1,
        }

    def error(self) -> str:
        return self.fail_with

    def report(self) -> list[tuple[str, str, str, int]]:
        return self.lines

    def cancel(self) -> None:
        self.cancelled = True

    def stop(self) -> None:
        self.stopped = True

    def size(self) -> tuple[int, int]:
        return self.width, self.height

    def read_pass(self, name: str) -> np.ndarray | None:
        if name not in self.pass_names:
            return None
        channels = CHANNELS.get(name, 3)
        values = np.full((self.width * self.height, channels), 0.25, np.float32)
        if name == "combined":
            values[:, 3] = 1
        return values

    def set_denoiser(self, library_dirs: list[str] | None) -> None:
        self.denoiser = library_dirs

    def read_denoised(self) -> np.ndarray | None:
        return None


class FakeSync:
    """Reads nothing."""

    raise_in_full: BaseException | None = None
    warnings: list[str] = []
    rectangle = (0.0, 0.0, 1.0, 1.0)

    def __init__(self, session: FakeSession) -> None:
        self.session = session
        self.context = SyncContext(session)

    def full(self, depsgraph: Any, scene: Any, view_layer: Any, *, width: int, height: int, **_: Any) -> Any:
        if self.raise_in_full is not None:
            raise self.raise_in_full
        self.context.check()
        if scene.render.use_border:
            _, _, width, height = crop(scene.render, width, height)
        self.session.width, self.session.height = width, height
        return SimpleNamespace(warnings=self.warnings, timings={})

    def next_frame(self, *arguments: Any, **named: Any) -> Any:
        return SimpleNamespace(warnings=self.warnings, timings={})

    def update(self, depsgraph: Any) -> bool:
        return True

    def set_render_camera(self, engine: Any, depsgraph: Any, eye: int = 0) -> None:
        return

    def viewport_rectangle(self) -> tuple[float, float, float, float]:
        return self.rectangle

    def set_viewport_camera(self, context: Any, region: Any, region_data: Any, width: int, height: int) -> bool:
        changed = (width, height) != (self.session.width, self.session.height)
        self.session.width, self.session.height = width, height
        return changed


@contextmanager
def fake_engine(**behaviour: Any) -> Iterator[type[FakeSession]]:
    """The add-on with a fake native module and reader. `behaviour` sets attributes of FakeSession or FakeSync."""
    session = type("Session", (FakeSession,), {})
    sync = type("Sync", (FakeSync,), {})
    for name, value in behaviour.items():
        setattr(sync if hasattr(FakeSync, name) else session, name, value)
    FakeSession.made.clear()
    module = SimpleNamespace(
        available_memory=lambda: 1 << 40,
        __version__="0.1.0",
        Error=Error,
        Session=session,
        chosen_instruction_set=lambda: "v3",
        denoiser_version=lambda dirs: "",
    )
    users = (talbot.final, talbot.preview, talbot.viewport)

    def open_session() -> Synced:
        made = session()
        return Synced(made, sync(made))

    kept_module, kept_problem = talbot.native._module, talbot.native._problem
    talbot.native._module, talbot.native._problem = module, ""
    for user in users:
        user.open_session = open_session
    try:
        yield session
    finally:
        talbot.native._module, talbot.native._problem = kept_module, kept_problem
        for user in users:
            user.open_session = talbot.sessions.open_session


class PressedEscape:
    """An engine whose user presses Escape. (RNA's functions cannot be replaced on the class.)"""

    def __init__(self, engine: object, questions: int) -> None:
        self.engine = engine
        self.questions = questions  # answered with no before

    def test_break(self) -> bool:
        self.questions -= 1
        return self.questions < 0

    def __getattr__(self, name: str) -> object:
        return getattr(self.engine, name)
