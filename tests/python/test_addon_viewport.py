"""The viewport's life with a fake engine, a fake window and no graphics card."""

from __future__ import annotations

import gc
import weakref
from collections.abc import Callable, Iterator
from types import SimpleNamespace

import numpy as np
import pytest
from addon_fakes import FakeSession, fake_engine
from talbot import reports, viewport
from talbot.engine import EngineState


class FakeEngine:
    """What the viewport needs of Blender's engine."""

    def __init__(self) -> None:
        self.stats: list[tuple[str, str]] = []
        self.redraws = 0

    def update_stats(self, stats: str, info: str) -> None:
        self.stats.append((stats, info))

    def tag_redraw(self) -> None:
        self.redraws += 1


class Window:
    """A region, a scene, and the timers and textures that were made."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.region = SimpleNamespace(width=8, height=6)
        self.context = SimpleNamespace(region=self.region, region_data=None, space_data=None)
        self.talbot = SimpleNamespace(use_preview_denoising=False, show_tracebacks=False)
        render = SimpleNamespace(use_border=False, use_simplify=False)
        scene = SimpleNamespace(name="Viewport Test", talbot=self.talbot, render=render)
        self.depsgraph = SimpleNamespace(scene_eval=scene, view_layer_eval=None)
        self.textures: list[tuple[tuple[int, int], np.ndarray]] = []
        self.drawn: list[tuple[int, int]] = []
        self.placed: list[tuple[tuple[float, float], tuple[float, float]]] = []
        self.timers: list[Callable[[], float | None]] = []
        types = SimpleNamespace(
            Buffer=lambda kind, size, data: np.array(data),
            GPUTexture=lambda size, format, data: self.upload(size, data),
        )
        gpu = SimpleNamespace(types=types, state=SimpleNamespace(blend_set=lambda mode: None))
        monkeypatch.setattr(viewport, "gpu", gpu)
        monkeypatch.setattr(viewport, "draw_texture_2d", self.draw)
        timers = SimpleNamespace(register=lambda tick, first_interval: self.timers.append(tick))
        monkeypatch.setattr(viewport, "bpy", SimpleNamespace(app=SimpleNamespace(timers=timers)))

    def draw(self, texture: int, at: tuple[float, float], width: float, height: float) -> None:
        self.drawn.append((width, height))
        self.placed.append((at, (width, height)))

    def upload(self, size: tuple[int, int], data: np.ndarray) -> int:
        self.textures.append((size, data))
        return len(self.textures)


@pytest.fixture
def window(monkeypatch: pytest.MonkeyPatch) -> Iterator[Window]:
    yield Window(monkeypatch)


def started(window: Window) -> tuple[viewport.Viewport, FakeEngine]:
    view, engine = viewport.Viewport(), FakeEngine()
    view.update(engine, window.context, window.depsgraph)
    return view, engine


def test_first_update_reads_all_later_ones_what_changed(window: Window) -> None:
    with fake_engine(steps=100):
        view, engine = started(window)
        session = FakeSession.made[0]
        assert session.starts == 1
        view.update(engine, window.context, window.depsgraph)
        assert (len(FakeSession.made), session.starts) == (1, 2)
        assert session.pass_names == ["combined"]


def test_draws_each_new_picture_once(window: Window) -> None:
    with fake_engine(steps=100):
        view, engine = started(window)
        for _ in range(3):
            view.draw(engine, window.context, window.depsgraph)
        assert len(window.textures) == 1
        assert window.textures[0][0] == (8, 6)
        assert window.drawn == [(8, 6)] * 3
        FakeSession.made[0].waits = 5
        view.draw(engine, window.context, window.depsgraph)
        assert len(window.textures) == 2
        assert engine.stats[-1][1] == "Sample 3/3"


def test_the_old_picture_stays_until_there_is_a_new_one(window: Window) -> None:
    with fake_engine(steps=100):
        view, engine = started(window)
        view.draw(engine, window.context, window.depsgraph)
        session = FakeSession.made[0]
        session.building = True
        view.update(engine, window.context, window.depsgraph)
        view.draw(engine, window.context, window.depsgraph)
        assert (session.starts, len(window.textures), len(window.drawn)) == (2, 1, 2)
        session.building = False
        view.draw(engine, window.context, window.depsgraph)
        assert (len(window.textures), len(window.drawn)) == (2, 3)


def test_resize_starts_again(window: Window) -> None:
    with fake_engine(steps=100):
        view, engine = started(window)
        view.draw(engine, window.context, window.depsgraph)
        window.region.width = 12
        view.draw(engine, window.context, window.depsgraph)
        assert FakeSession.made[0].starts == 2
        assert window.textures[-1][0] == (12, 6)


def test_timer_redraws_while_it_renders_and_ends_with_it(window: Window) -> None:
    with fake_engine(steps=3):
        view, engine = started(window)
        assert len(window.timers) == 1
        tick = window.timers[0]
        session = FakeSession.made[0]
        assert tick() is not None and engine.redraws == 1
        assert tick() is not None and engine.redraws == 1  # nothing new
        session.waits = 1
        assert tick() is not None and engine.redraws == 2
        session.waits = 3
        assert tick() is None and engine.redraws == 3  # the last picture
        view.update(engine, window.context, window.depsgraph)
        assert len(window.timers) == 2


def test_timer_ends_with_the_viewport(window: Window) -> None:
    with fake_engine(steps=3):
        view, engine = started(window)
        view.close()
        assert window.timers[0]() is None
        assert engine.redraws == 0


def test_timer_keeps_nothing_alive(window: Window) -> None:
    with fake_engine(steps=3):
        view, engine = started(window)
        alive = weakref.ref(view)
        del view
        gc.collect()
        assert alive() is None
        assert window.timers[0]() is None
        assert engine.redraws == 0


def test_close_stops_the_session_twice_is_fine(window: Window) -> None:
    with fake_engine(steps=3):
        state = EngineState()
        state.viewport, _engine = started(window)
        state.close()
        state.close()
        assert FakeSession.made[0].stopped


def test_two_viewports_do_not_share(window: Window) -> None:
    with fake_engine(steps=3):
        started(window)
        started(window)
        assert len(FakeSession.made) == 2


def test_failure_raises_and_the_next_edit_starts_anew(window: Window) -> None:
    with fake_engine(steps=3, fail_with="World: broken") as session_type:
        view, engine = started(window)
        with pytest.raises(RuntimeError, match="World: broken"):
            view.draw(engine, window.context, window.depsgraph)
        view.failure = "World: broken"  # as the engine notes it
        session_type.fail_with = ""
        view.update(engine, window.context, window.depsgraph)
        view.draw(engine, window.context, window.depsgraph)
        assert view.failure == ""
        assert len(FakeSession.made) == 2


def test_failed_reading_is_not_repeated_at_each_draw(window: Window) -> None:
    with fake_engine(raise_in_full=KeyError("uv")):
        view, engine = viewport.Viewport(), FakeEngine()
        with pytest.raises(KeyError):
            view.update(engine, window.context, window.depsgraph)
        view.failure = "Internal error"
        view.draw(engine, window.context, window.depsgraph)
        view.draw(engine, window.context, window.depsgraph)
        assert len(FakeSession.made) == 1
        assert engine.stats[-1] == ("Talbot", "Error: Internal error")


def test_warnings_are_listed(window: Window) -> None:
    with fake_engine(warnings=["Object Fur: hair is not rendered"]):
        started(window)
    assert [str(line) for line in reports.of_scene("Viewport Test").lines] == ["Object Fur: hair is not rendered"]


def test_denoised_picture_is_drawn_when_there_is_one(window: Window) -> None:
    def read_denoised(session: FakeSession) -> np.ndarray | None:
        return np.full((48, 4), 0.5, np.float32) if session.waits >= 3 else None

    window.talbot.use_preview_denoising = True
    with fake_engine(steps=4, read_denoised=read_denoised):
        view, engine = started(window)
        session = FakeSession.made[0]
        assert session.denoiser is not None
        view.draw(engine, window.context, window.depsgraph)
        assert window.textures[-1][1].reshape(-1)[0] == 0.25
        session.waits = 3
        view.draw(engine, window.context, window.depsgraph)
        view.draw(engine, window.context, window.depsgraph)
    assert len(window.textures) == 2
    assert window.textures[-1][1].reshape(-1)[0] == 0.5
    assert session.pass_names == ["combined", "denoising_albedo", "denoising_normal"]


def test_denoising_is_the_sessions_work(window: Window) -> None:
    """Switching it on or off starts again with other passes; nothing waits for it while drawing."""
    with fake_engine(steps=4):
        view, engine = started(window)
        session = FakeSession.made[0]
        assert session.denoiser is None
        window.talbot.use_preview_denoising = True
        view.update(engine, window.context, window.depsgraph)
        assert session.denoiser is not None and session.starts == 2
        window.talbot.use_preview_denoising = False
        view.update(engine, window.context, window.depsgraph)
        assert session.denoiser is None and session.pass_names == ["combined"]


def test_region_is_drawn_where_it_lies(window: Window) -> None:
    with fake_engine(steps=4, rectangle=(0.25, 0.5, 0.5, 0.25)):
        view, engine = started(window)
        view.draw(engine, window.context, window.depsgraph)
        window.region.width = 16  # stretched with the window
        view.draw(engine, window.context, window.depsgraph)
    assert window.placed == [((2, 3), (4, 1.5)), ((4, 3), (8, 1.5))]
