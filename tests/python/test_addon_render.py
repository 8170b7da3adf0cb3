"""The life of a render with a fake engine: results, errors, cancel, several layers and views."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
import pytest
from addon_fakes import Error, FakeSession, PressedEscape, fake_engine
from talbot import final, passes, reports


@pytest.fixture
def scene(empty_scene: bpy.types.Scene, tmp_path: Path) -> bpy.types.Scene:
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    empty_scene.collection.objects.link(camera)
    empty_scene.camera = camera
    render = empty_scene.render
    render.engine = "TALBOT"
    render.resolution_x, render.resolution_y, render.resolution_percentage = 32, 18, 100
    render.filepath = str(tmp_path / "out.exr")
    render.use_file_extension = False
    empty_scene.talbot.use_denoising = False
    set_multilayer(render)
    return empty_scene


def set_multilayer(render: bpy.types.RenderSettings) -> None:
    if hasattr(render.image_settings, "media_type"):
        render.image_settings.media_type = "MULTI_LAYER_IMAGE"
    render.image_settings.file_format = "OPEN_EXR_MULTILAYER"


def render_file(scene: bpy.types.Scene) -> Path:
    path = Path(scene.render.filepath)
    path.unlink(missing_ok=True)
    bpy.ops.render.render(write_still=True)
    return path


def last_lines(scene: bpy.types.Scene, *levels: str) -> list[str]:
    levels = levels or ("warning", "error")
    return [str(line) for line in reports.of_scene(scene.name).lines if line.level in levels]


def test_writes_a_file(scene: bpy.types.Scene) -> None:
    with fake_engine():
        assert render_file(scene).is_file()
    assert len(FakeSession.made) == 1
    assert FakeSession.made[0].stopped


@pytest.mark.parametrize(
    ("behaviour", "message"),
    [
        ({"fail_with": "Shader 'Glass': out of registers"}, "Shader 'Glass': out of registers"),
        ({"raise_in_start": Error("No triangles fit")}, "No triangles fit"),
        ({"raise_in_start": MemoryError()}, "Out of memory"),
        ({"raise_in_full": KeyError("uv")}, "Internal error in Talbot (KeyError: 'uv')"),
        ({"raise_in_full": Error("Mesh 'Cube' is broken")}, "Mesh 'Cube' is broken"),
        ({"lines": [("error", "The picture is useless", "World", 1)]}, "World: The picture is useless"),
    ],
)
def test_errors_are_reported_and_nothing_is_written(
    scene: bpy.types.Scene, behaviour: dict, message: str, capfd: pytest.CaptureFixture[str]
) -> None:
    with fake_engine(**behaviour), pytest.raises(RuntimeError) as caught:
        render_file(scene)
    assert message in str(caught.value)
    assert not Path(scene.render.filepath).exists()
    assert any(message in line for line in last_lines(scene))
    captured = capfd.readouterr()
    assert "Traceback" not in captured.out + captured.err


def test_traceback_on_demand(scene: bpy.types.Scene, capfd: pytest.CaptureFixture[str]) -> None:
    scene.talbot.show_tracebacks = True
    with fake_engine(raise_in_full=KeyError("uv")), pytest.raises(RuntimeError):
        render_file(scene)
    assert "Traceback" in capfd.readouterr().err


def test_renders_again_after_an_error(scene: bpy.types.Scene) -> None:
    with fake_engine(fail_with="broken"), pytest.raises(RuntimeError):
        render_file(scene)
    with fake_engine():
        assert render_file(scene).is_file()
    assert last_lines(scene) == []


def test_missing_native_module(scene: bpy.types.Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    from talbot import native

    monkeypatch.setattr(native, "_module", None)
    monkeypatch.setattr(native, "_problem", "The native module is missing")
    with pytest.raises(RuntimeError, match="The native module is missing"):
        render_file(scene)
    assert not Path(scene.render.filepath).exists()


def test_warnings_are_listed_and_the_file_is_written(scene: bpy.types.Scene, capfd: pytest.CaptureFixture[str]) -> None:
    lines = [("warning", "image not found", "Material Wood", 3), ("info", "built in 2 s", "", 1)]
    with fake_engine(lines=lines, warnings=["Object Hair: hair is not rendered"]):
        assert render_file(scene).is_file()
    expected = "Material Wood: image not found (3 times)"
    assert last_lines(scene) == ["Object Hair: hair is not rendered", expected]
    assert last_lines(scene, "info")[0] == "built in 2 s"
    assert "3 samples in 0.50 s, 0.01 million rays a second" in last_lines(scene, "info")[1]
    captured = capfd.readouterr()
    assert expected in captured.out + captured.err
    assert "built in 2 s" not in captured.out + captured.err


def test_summary_tells_the_mean_of_unequal_samples(scene: bpy.types.Scene) -> None:
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 20, 10, 100
    with fake_engine(paths=300):
        render_file(scene)
    assert "1.5 of 3 samples a pixel in 0.50 s" in last_lines(scene, "info")[0]


def test_many_warnings_are_summed_up(scene: bpy.types.Scene, capfd: pytest.CaptureFixture[str]) -> None:
    lines = [("warning", f"warning number {n}", "", 1) for n in range(100)]
    with fake_engine(lines=lines):
        render_file(scene)
    captured = capfd.readouterr()
    assert "70 more warnings" in captured.out + captured.err
    assert len(last_lines(scene)) == 100


def all_passes(layer: bpy.types.ViewLayer, on: bool) -> None:
    for name in layer.bl_rna.properties.keys():
        if name.startswith("use_pass_") and not layer.bl_rna.properties[name].is_readonly:
            setattr(layer, name, on)
    layer.cycles.denoising_store_passes = on
    layer.cycles.pass_debug_sample_count = on


@pytest.mark.parametrize("denoise", [False, True])
def test_every_registered_pass_is_written(
    scene: bpy.types.Scene, denoise: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    layer = scene.view_layers[0]
    all_passes(layer, True)
    scene.talbot.use_denoising = denoise
    registered: set[str] = set()
    in_result: set[str] = set()
    written: set[str] = set()
    set_rect, register_all = passes.set_rect, passes.register_all

    def spy_rect(render_pass: bpy.types.RenderPass, values: np.ndarray) -> None:
        written.add(render_pass.name)
        set_rect(render_pass, values)

    def spy_register(engine: object, scene: bpy.types.Scene, view_layer: bpy.types.ViewLayer) -> None:
        registered.update(p.name for p in passes.wanted(scene, view_layer))
        register_all(engine, scene, view_layer)

    write = passes.write

    def spy_write(render_layer: bpy.types.RenderLayer, *arguments: object, **named: object) -> None:
        in_result.update(p.name for p in render_layer.passes)
        write(render_layer, *arguments, **named)

    monkeypatch.setattr(passes, "set_rect", spy_rect)
    monkeypatch.setattr(passes, "register_all", spy_register)
    monkeypatch.setattr(passes, "write", spy_write)
    with fake_engine():
        assert render_file(scene).is_file()
    assert written == registered == in_result
    assert len(registered) == (24 if denoise else 23)
    assert any("Vector pass is not available" in line for line in last_lines(scene))


def test_passes_without_the_native_pass_are_empty(scene: bpy.types.Scene) -> None:
    depth = passes.Pass("Depth", "depth", 1, "Z", "VALUE")
    combined = passes.Pass("Combined", "combined", 4, "RGBA")
    assert passes.fitted(None, depth, 5).tolist() == [[np.float32(1e10)]] * 5
    assert passes.fitted(None, combined, 5).tolist() == [[0, 0, 0, 0]] * 5
    with pytest.raises(RuntimeError, match="3 pixels, Blender asks for 5"):
        passes.fitted(np.ones((3, 4), np.float32), combined, 5)
    assert passes.fitted(np.ones((5, 3), np.float32), combined, 5).tolist() == [[1, 1, 1, 0]] * 5


def test_two_layers_share_one_frame(scene: bpy.types.Scene) -> None:
    other = scene.view_layers.new("Other")
    other.use_pass_z = True
    with fake_engine(warnings=["said by both layers"]):
        assert render_file(scene).is_file()
    assert len(FakeSession.made) == 2
    assert [session.pass_names for session in FakeSession.made] == [["combined"], ["combined", "depth"]]
    assert last_lines(scene) == ["said by both layers"]


def test_stereo_renders_each_view(scene: bpy.types.Scene) -> None:
    scene.render.use_multiview = True
    with fake_engine():
        bpy.ops.render.render()
    assert [session.starts for session in FakeSession.made] == [2]


@pytest.mark.parametrize("cropped", [False, True])
def test_border(scene: bpy.types.Scene, cropped: bool) -> None:
    render = scene.render
    render.use_border, render.use_crop_to_border = True, cropped
    render.border_min_x, render.border_max_x = 0.26, 0.75
    render.border_min_y, render.border_max_y = 0.1, 0.5
    if hasattr(render.image_settings, "media_type"):
        render.image_settings.media_type = "IMAGE"
    render.image_settings.file_format = "OPEN_EXR"
    with fake_engine():
        path = render_file(scene)
    image = bpy.data.images.load(str(path))
    assert tuple(image.size) == ((16, 8) if cropped else (32, 18))


def test_animation_keeps_nothing(scene: bpy.types.Scene, tmp_path: Path) -> None:
    scene.frame_start, scene.frame_end = 1, 3
    scene.render.filepath = str(tmp_path / "frame_####.exr")
    with fake_engine():
        bpy.ops.render.render(animation=True)
        assert [session.stopped for session in FakeSession.made] == [True] * 3
    assert len(list(tmp_path.glob("frame_*.exr"))) == 3


@pytest.mark.parametrize(("layers", "sessions"), [(1, 1), (2, 6)])
def test_persistent_data_keeps_one_session(scene: bpy.types.Scene, tmp_path: Path, layers: int, sessions: int) -> None:
    if layers == 2:
        scene.view_layers.new("Other")
    scene.frame_start, scene.frame_end = 1, 3
    scene.render.filepath = str(tmp_path / "frame_####.exr")
    scene.render.use_persistent_data = True
    with fake_engine():
        bpy.ops.render.render(animation=True)
        assert len(FakeSession.made) == sessions
        assert sum(session.starts for session in FakeSession.made) == 3 * layers
        scene.render.use_persistent_data = False


def test_metadata(scene: bpy.types.Scene) -> None:
    scene.talbot.seed = 11
    with fake_engine(warnings=["Object Hair: hair is not rendered"]):
        content = render_file(scene).read_bytes()
    for text in (b"talbot.version", b"talbot.seed", b"hair is not rendered", b"01:01.50", b"talbot.instruction_set"):
        assert text in content, text


@pytest.mark.parametrize(("questions", "waits"), [(0, None), (1, 1), (4, 4)])
def test_cancel_ends_the_session(
    scene: bpy.types.Scene, monkeypatch: pytest.MonkeyPatch, questions: int, waits: int | None
) -> None:
    """While the scene is read, and in the first and a later slice of the render."""
    render = final.render
    monkeypatch.setattr(
        final, "render", lambda engine, state, depsgraph: render(PressedEscape(engine, questions), state, depsgraph)
    )
    with fake_engine(steps=1000):
        render_file(scene)
    session = FakeSession.made[0]
    if waits is None:
        assert session.starts == 0
    else:
        assert session.cancelled and session.stopped and session.waits == waits
    assert last_lines(scene) == []
