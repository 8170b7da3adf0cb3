"""Whole renders through Blender with the real engine: what arrives in the file, not what it looks like."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from talbot import final, native, passes, preview, reports

WIDTH, HEIGHT = 32, 20


@pytest.fixture
def scene(tmp_path: Path) -> bpy.types.Scene:
    """Blender's default file: a cube, a point light, a camera."""
    if native.problem():
        pytest.fail(native.problem())
    bpy.ops.wm.read_homefile(use_empty=False, use_factory_startup=True)
    scene = bpy.context.scene
    render = scene.render
    render.engine = "TALBOT"
    render.resolution_x, render.resolution_y, render.resolution_percentage = WIDTH, HEIGHT, 100
    render.filepath = str(tmp_path / "out.exr")
    render.use_file_extension = False
    render.image_settings.file_format = "OPEN_EXR"
    render.image_settings.color_depth = "32"
    render.image_settings.color_mode = "RGBA"
    scene.talbot.samples = 4
    scene.talbot.use_adaptive_sampling = False
    scene.talbot.use_denoising = False
    return scene


def picture(scene: bpy.types.Scene) -> np.ndarray:
    """Renders, and gives the pixels of the file (height, width, 4), bottom row first."""
    path = scene.render.filepath
    Path(path).unlink(missing_ok=True)
    bpy.ops.render.render(write_still=True)
    return load(path)


def load(path: str) -> np.ndarray:
    image = bpy.data.images.load(path)
    image.colorspace_settings.name = "Non-Color"
    pixels = np.empty(image.size[0] * image.size[1] * 4, np.float32)
    image.pixels.foreach_get(pixels)
    pixels = pixels.reshape(image.size[1], image.size[0], 4)
    bpy.data.images.remove(image)
    return pixels


def lines(scene: bpy.types.Scene) -> list[str]:
    return [str(line) for line in reports.of_scene(scene.name).lines if line.level != "info"]


def test_default_scene(scene: bpy.types.Scene) -> None:
    pixels = picture(scene)
    assert pixels.shape == (HEIGHT, WIDTH, 4)
    assert np.isfinite(pixels).all()
    assert (pixels[..., 3] == 1).all()
    middle, corner = pixels[HEIGHT // 2, WIDTH // 2, :3], pixels[0, 0, :3]
    assert middle.mean() > 2 * corner.mean() > 0
    assert corner == pytest.approx([0.051] * 3, abs=0.01)


def test_default_scene_has_no_warnings(scene: bpy.types.Scene) -> None:
    picture(scene)
    assert lines(scene) == []


def test_same_pixels_again_and_with_one_thread(scene: bpy.types.Scene) -> None:
    first = picture(scene)
    assert np.array_equal(first, picture(scene))
    scene.render.threads_mode, scene.render.threads = "FIXED", 1
    assert np.array_equal(first, picture(scene))


def test_seed_changes_the_noise(scene: bpy.types.Scene) -> None:
    first = picture(scene)
    scene.talbot.seed = 1
    assert not np.array_equal(first, picture(scene))


def test_border_is_a_part_of_the_whole(scene: bpy.types.Scene) -> None:
    whole = picture(scene)
    render = scene.render
    render.use_border = render.use_crop_to_border = True
    render.border_min_x, render.border_max_x = 0.25, 0.75
    render.border_min_y, render.border_max_y = 0.3, 0.9
    # The same paths, but other neighbours in a batch: rounding may differ.
    assert np.allclose(picture(scene), whole[6:18, 8:24], rtol=1e-5, atol=1e-7)
    render.use_crop_to_border = False
    pasted = picture(scene)
    assert np.allclose(pasted[6:18, 8:24], whole[6:18, 8:24], rtol=1e-5, atol=1e-7)
    assert pasted[:6].max() == 0


def test_transparent_film(scene: bpy.types.Scene) -> None:
    scene.render.film_transparent = True
    pixels = picture(scene)
    assert pixels[0, 0].tolist() == [0, 0, 0, 0]
    assert pixels[HEIGHT // 2, WIDTH // 2, 3] == 1


def test_exposure(scene: bpy.types.Scene) -> None:
    first = picture(scene)
    scene.talbot.film_exposure = 2.0
    assert picture(scene)[..., :3] == pytest.approx(first[..., :3] * 2, rel=1e-5)


def animate(data: bpy.types.bpy_struct, path: str, first: object, last: object) -> None:
    """Keys on frames 1 and 3."""
    for frame, value in ((1, first), (3, last)):
        setattr(data, path, value)
        data.keyframe_insert(path, frame=frame)


def test_animation_with_persistent_data_is_the_same(scene: bpy.types.Scene, tmp_path: Path) -> None:
    """Of everything that may change between frames, one thing of each kind changes."""
    cube = bpy.data.objects["Cube"]
    animate(cube, "location", (0, 0, 0), (1, 0, 0))
    animate(bpy.data.lights["Light"], "energy", 1000.0, 100.0)
    animate(bpy.data.objects["Camera"], "location", (7.3, -6.9, 4.9), (7.0, -6.5, 5.5))
    bpy.ops.mesh.primitive_uv_sphere_add(segments=12, ring_count=6, location=(2, 0, 0))
    bent = bpy.context.object
    bent.modifiers.new("Displace", "DISPLACE")
    animate(bent.modifiers["Displace"], "strength", 0.0, 0.5)
    bpy.ops.mesh.primitive_plane_add(size=3, location=(0, 0, -1))
    animate(bpy.context.object, "hide_render", False, True)
    socket = bpy.data.materials["Material"].node_tree.nodes["Principled BSDF"].inputs["Base Color"]
    animate(socket, "default_value", (0.8, 0.8, 0.8, 1), (0.8, 0.1, 0.1, 1))
    background = scene.world.node_tree.nodes["Background"].inputs["Strength"]
    animate(background, "default_value", 1.0, 3.0)
    scene.talbot.use_animated_seed = True
    scene.frame_start, scene.frame_end = 1, 3
    frames = []
    for persistent in (False, True):
        scene.render.use_persistent_data = persistent
        scene.render.filepath = str(tmp_path / f"{persistent}_##.exr")
        bpy.ops.render.render(animation=True)
        frames.append([load(str(tmp_path / f"{persistent}_{frame:02d}.exr")) for frame in (1, 2, 3)])
    bpy.data.objects.remove(bent)
    scene.frame_set(1)
    scene.render.filepath = str(tmp_path / "still.exr")
    after = picture(scene)
    scene.render.use_persistent_data = False
    fresh = picture(scene)
    plain, kept = frames
    assert not np.array_equal(plain[0], plain[1])
    for one, other in zip(plain, kept, strict=True):
        assert np.array_equal(one, other)
    assert np.array_equal(after, fresh)
    assert not np.array_equal(after, plain[0])


def test_stereo_eyes_differ(scene: bpy.types.Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scene.render.use_multiview = True
    scene.render.image_settings.views_format = "INDIVIDUAL"
    scene.render.filepath = str(tmp_path / "eye")
    scene.render.use_file_extension = True
    eyes: list[np.ndarray] = []
    set_rect = passes.set_rect

    def spy(render_pass: bpy.types.RenderPass, values: np.ndarray) -> None:
        eyes.append(values.reshape(HEIGHT, WIDTH, 4).copy())
        set_rect(render_pass, values)

    monkeypatch.setattr(passes, "set_rect", spy)
    bpy.ops.render.render(write_still=True)
    assert (tmp_path / "eye_L.exr").is_file() and (tmp_path / "eye_R.exr").is_file()
    left, right = eyes
    assert left.shape == right.shape == (HEIGHT, WIDTH, 4)
    assert not np.array_equal(left, right)
    assert abs(left.mean() / right.mean() - 1) < 0.1


def test_all_passes(scene: bpy.types.Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    """What goes into each pass, and a file of them all."""
    layer = scene.view_layers[0]
    for name in ("z", "mist", "position", "normal", "uv", "object_index", "material_index", "emit", "environment"):
        setattr(layer, f"use_pass_{name}", True)
    for lobe in ("diffuse", "glossy", "transmission"):
        for part in ("direct", "indirect", "color"):
            setattr(layer, f"use_pass_{lobe}_{part}", True)
    bpy.data.objects["Cube"].pass_index = 7
    if hasattr(scene.render.image_settings, "media_type"):
        scene.render.image_settings.media_type = "MULTI_LAYER_IMAGE"
    scene.render.image_settings.file_format = "OPEN_EXR_MULTILAYER"
    seen: dict[str, np.ndarray] = {}
    set_rect = passes.set_rect

    def spy(render_pass: bpy.types.RenderPass, values: np.ndarray) -> None:
        seen[render_pass.name] = values.reshape(HEIGHT, WIDTH, -1).copy()
        set_rect(render_pass, values)

    monkeypatch.setattr(passes, "set_rect", spy)
    bpy.ops.render.render(write_still=True)
    assert Path(scene.render.filepath).is_file()
    assert set(seen) == {p.name for p in passes.wanted(scene, layer)}
    assert all(np.isfinite(values).all() for values in seen.values())
    at = (9, 19)  # on the cube's right side
    distance = (bpy.data.objects["Camera"].matrix_world.inverted() @ bpy.data.objects["Cube"].location).length
    assert seen["Depth"][at][0] == pytest.approx(distance, abs=1.8)
    assert seen["Depth"][0, 0][0] == np.float32(1e10)
    assert np.linalg.norm(seen["Normal"][at]) == pytest.approx(1, abs=0.01)
    long_names = "Diffuse Direct" in seen
    direct, indirect, color = (
        ("Diffuse Direct", "Diffuse Indirect", "Diffuse Color") if long_names else ("DiffDir", "DiffInd", "DiffCol")
    )
    assert seen["Object Index" if long_names else "IndexOB"][at][0] == 7
    gloss = ("Glossy Direct", "Glossy Indirect", "Glossy Color") if long_names else ("GlossDir", "GlossInd", "GlossCol")
    total = (seen[direct] + seen[indirect]) * seen[color] + (seen[gloss[0]] + seen[gloss[1]]) * seen[gloss[2]]
    assert total[at] == pytest.approx(seen["Combined"][at][:3], rel=1e-3)
    environment = seen["Environment" if long_names else "Env"]
    assert environment[0, 0] == pytest.approx(seen["Combined"][0, 0, :3], rel=1e-5)


def test_denoising_without_the_library_keeps_the_picture(
    scene: bpy.types.Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    if native.denoiser_version():
        pytest.skip("Open Image Denoise is here")
    noisy = picture(scene)
    scene.talbot.use_denoising = True
    assert np.array_equal(picture(scene), noisy)
    assert any("Open Image Denoise" in line for line in lines(scene))


def test_denoising(scene: bpy.types.Scene) -> None:
    if not native.denoiser_version():
        pytest.skip("Open Image Denoise was not found")
    noisy = picture(scene)
    scene.talbot.use_denoising = True
    clean = picture(scene)
    assert not np.array_equal(clean, noisy)
    assert clean.mean() == pytest.approx(noisy.mean(), rel=0.1)


def big_session() -> Any:
    """A black picture that is soon rendered and takes a while to denoise."""
    session = native.module().Session()
    session.set_settings({"width": 1400, "height": 1400, "samples": 1})
    session.set_passes(["combined"])
    session.set_denoiser(native.library_dirs())
    return session


def wait_for_status(session: Any, status: str) -> None:
    while session.progress()["status"] != status:
        assert not session.wait(1), session.progress()


def test_denoising_blocks_nobody_and_an_edit_ends_it() -> None:
    if not native.denoiser_version():
        pytest.skip("Open Image Denoise was not found")
    session = big_session()
    session.start()
    wait_for_status(session, "Denoising")
    assert session.read_pass("combined").shape == (1400 * 1400, 4)
    assert session.read_denoised() is None
    session.set_settings({"width": 8, "height": 8, "samples": 1})
    assert session.progress()["state"] == "cancelled"
    session.start()
    while not session.wait(100):
        pass
    assert session.read_denoised().shape == (64, 4)
    session.set_denoiser(None)
    session.start()
    while not session.wait(100):
        pass
    assert session.read_denoised() is None


def test_denoiser_that_is_not_there_is_a_warning() -> None:
    if native.denoiser_version():
        pytest.skip("Open Image Denoise is here")
    session = big_session()
    session.start()
    while not session.wait(100):
        pass
    assert session.progress()["state"] == "done"
    assert session.read_denoised() is None
    assert [line[:2] for line in session.report()] == [
        ("warning", "Denoising needs the Open Image Denoise library (version 2), which was not found")
    ]


def test_empty_scene_is_a_picture(scene: bpy.types.Scene) -> None:
    for name in ("Cube", "Light"):
        bpy.data.objects.remove(bpy.data.objects[name])
    pixels = picture(scene)
    assert pixels[..., 0] == pytest.approx(0.0509, abs=0.001)


def test_no_camera_is_a_message(scene: bpy.types.Scene) -> None:
    bpy.data.objects.remove(bpy.data.objects["Camera"])
    with pytest.raises(RuntimeError, match="camera"):
        bpy.ops.render.render()


def test_time_limit(scene: bpy.types.Scene) -> None:
    scene.talbot.samples = 1 << 20
    scene.talbot.time_limit = 0.5
    assert np.isfinite(picture(scene)).all()


def test_preview(scene: bpy.types.Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    """The path of previews with an ordinary scene: Blender makes its own preview scenes with a window only."""
    expected = picture(scene)
    monkeypatch.setattr(final, "render", preview.render)
    scene.talbot.samples = 100000
    pixels = picture(scene)
    assert pixels.mean() == pytest.approx(expected.mean(), rel=0.05)
    assert not np.array_equal(pixels, expected)
