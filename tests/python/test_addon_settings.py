"""Which value of a setting counts, and what the engine is told."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import addon_utils
import bpy
import pytest
from talbot import properties, settings
from talbot.settings import SETTINGS, engine_settings


@pytest.fixture
def scene(empty_scene: bpy.types.Scene) -> bpy.types.Scene:
    return empty_scene


@pytest.fixture
def without_cycles() -> Iterator[None]:
    addon_utils.disable("cycles", default_set=False)
    yield
    addon_utils.enable("cycles", default_set=False)


def engine(scene: bpy.types.Scene, **kinds: bool) -> dict[str, object]:
    return engine_settings(scene, scene.view_layers[0], scene.render, **kinds)


def test_names_defaults_and_ranges_are_those_of_cycles(scene: bpy.types.Scene) -> None:
    for setting in SETTINGS:
        theirs = scene.cycles.bl_rna.properties.get(setting.name)
        ours = scene.talbot.bl_rna.properties[setting.name]
        assert theirs is not None, setting.name
        assert ours.type == theirs.type, setting.name
        if theirs.type == "ENUM":
            assert [i.identifier for i in ours.enum_items] == [i.identifier for i in theirs.enum_items]
            assert ours.default == theirs.default
        else:
            assert ours.default == pytest.approx(theirs.default), setting.name
        assert ours.description != theirs.description, setting.name


def test_plain_file_has_the_defaults_of_cycles(scene: bpy.types.Scene) -> None:
    for setting in SETTINGS:
        assert getattr(scene.talbot, setting.name) == pytest.approx(getattr(scene.cycles, setting.name)), setting.name


def test_cycles_settings_count_until_changed(scene: bpy.types.Scene) -> None:
    scene.cycles.samples = 33
    scene.cycles.pixel_filter_type = "GAUSSIAN"
    scene.cycles.sample_clamp_indirect = 3.5
    scene.cycles.caustics_reflective = False
    assert scene.talbot.samples == 33
    assert scene.talbot.pixel_filter_type == "GAUSSIAN"
    values = engine(scene)
    assert (values["samples"], values["filter"], values["clamp_indirect"]) == (33, "gaussian", 3.5)
    assert values["caustics_reflective"] is False
    scene.talbot.samples = 8
    scene.talbot.pixel_filter_type = "BOX"
    scene.cycles.samples = 44
    values = engine(scene)
    assert (values["samples"], values["filter"]) == (8, "box")
    assert values["clamp_indirect"] == 3.5


def test_setting_the_default_is_a_choice(scene: bpy.types.Scene) -> None:
    scene.cycles.max_bounces = 3
    scene.talbot.max_bounces = 12
    assert engine(scene)["max_bounces"] == 12


def test_cycles_can_be_ignored(scene: bpy.types.Scene) -> None:
    scene.cycles.samples = 33
    scene.talbot.use_cycles_settings = False
    assert scene.talbot.samples == 4096


def test_evaluated_scene_gives_the_same(scene: bpy.types.Scene) -> None:
    scene.cycles.samples = 33
    scene.talbot.max_bounces = 2
    evaluated = bpy.context.evaluated_depsgraph_get().scene_eval
    values = engine_settings(evaluated, evaluated.view_layers[0], evaluated.render)
    assert (values["samples"], values["max_bounces"]) == (33, 2)


def test_settings_can_be_animated(scene: bpy.types.Scene) -> None:
    scene.talbot.blur_glossy = 1.0
    scene.talbot.keyframe_insert("blur_glossy", frame=1)
    scene.talbot.blur_glossy = 3.0
    scene.talbot.keyframe_insert("blur_glossy", frame=11)
    scene.frame_set(6)
    assert scene.talbot.blur_glossy == pytest.approx(2.0)


def test_without_the_cycles_addon(scene: bpy.types.Scene, without_cycles: None) -> None:
    assert not hasattr(scene, "cycles")
    assert scene.talbot.samples == 4096
    assert engine(scene)["clamp_indirect"] == 10.0


def test_stored_cycles_values_without_the_addon(scene: bpy.types.Scene) -> None:
    scene.cycles.samples = 33
    scene.cycles.pixel_filter_type = "GAUSSIAN"
    scene.cycles.use_denoising = False
    addon_utils.disable("cycles", default_set=False)
    try:
        assert not hasattr(scene, "cycles")
        assert scene.talbot.samples == 33
        assert scene.talbot.pixel_filter_type == "GAUSSIAN"
        assert scene.talbot.use_denoising is False
        assert scene.talbot.max_bounces == 12
    finally:
        addon_utils.enable("cycles", default_set=False)


def test_copy_and_clear(scene: bpy.types.Scene) -> None:
    scene.cycles.samples = 33
    scene.cycles.filter_width = 2.5
    assert bpy.ops.talbot.copy_cycles_settings() == {"FINISHED"}
    scene.cycles.samples = 44
    assert scene.talbot.samples == 33
    assert scene.talbot.filter_width == 2.5
    assert bpy.ops.talbot.clear_settings() == {"FINISHED"}
    assert scene.talbot.samples == 44


def test_copy_without_anything_to_copy(scene: bpy.types.Scene, without_cycles: None) -> None:
    assert bpy.ops.talbot.copy_cycles_settings() == {"CANCELLED"}


def test_settings_are_saved(scene: bpy.types.Scene, tmp_path: Path) -> None:
    scene.talbot.samples = 5
    scene.talbot.pixel_filter_type = "BOX"
    scene.cycles.max_bounces = 7
    path = str(tmp_path / "settings.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_homefile(use_empty=True)
    bpy.ops.wm.open_mainfile(filepath=path)
    talbot = bpy.context.scene.talbot
    assert (talbot.samples, talbot.pixel_filter_type, talbot.max_bounces) == (5, "BOX", 7)
    assert talbot["settings_version"] == properties.SETTINGS_VERSION


def test_migration_runs_each_step_once(scene: bpy.types.Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[int] = []
    steps = {1: lambda group: calls.append(1), 2: lambda group: group.__setitem__("samples", group["samples"] * 2)}
    scene.talbot.samples = 5
    monkeypatch.setattr(properties, "MIGRATIONS", steps)
    monkeypatch.setattr(properties, "SETTINGS_VERSION", 3)
    properties.migrate(scene)
    properties.migrate(scene)
    assert calls == [1]
    assert scene.talbot.samples == 10
    assert scene.talbot["settings_version"] == 3


def test_migration_leaves_untouched_scenes_alone(scene: bpy.types.Scene) -> None:
    properties.migrate(scene)
    assert "settings_version" not in scene.talbot.keys()


def test_layer_samples(scene: bpy.types.Scene) -> None:
    scene.talbot.samples = 64
    scene.view_layers[0].samples = 100
    for mode, samples in (("USE", 100), ("BOUNDED", 64), ("IGNORE", 64)):
        scene.talbot.use_layer_samples = mode
        assert engine(scene)["samples"] == samples
    assert engine(scene, viewport=True)["samples"] == 1024
    assert engine(scene, preview=True)["samples"] == settings.PREVIEW_SAMPLES


def test_endless_viewport(scene: bpy.types.Scene) -> None:
    scene.talbot.preview_samples = 0
    assert engine(scene, viewport=True)["samples"] == settings.MAX_SAMPLES


def test_sample_subset(scene: bpy.types.Scene) -> None:
    scene.talbot.samples = 100
    scene.cycles.sample_offset = 30
    if not hasattr(scene.cycles, "use_sample_subset"):
        assert (engine(scene)["first_sample"], engine(scene)["samples"]) == (30, 100)
        return
    assert engine(scene)["first_sample"] == 0
    scene.cycles.use_sample_subset = True
    scene.cycles.sample_subset_length = 20
    assert (engine(scene)["first_sample"], engine(scene)["samples"]) == (30, 20)
    assert engine(scene)["adaptive_threshold"] == pytest.approx(0.01 * 0.2**0.5)
    scene.cycles.adaptive_threshold = 0.0
    assert engine(scene)["adaptive_threshold"] == pytest.approx(0.01 * 0.2**0.5)  # of the whole picture: 1 / 100
    scene.cycles.sample_subset_length = 2000
    assert engine(scene)["samples"] == 70


def test_noise_threshold(scene: bpy.types.Scene) -> None:
    scene.cycles.adaptive_threshold = 0.03
    scene.cycles.adaptive_min_samples = 7
    scene.cycles.preview_adaptive_threshold = 0.0
    names = ("adaptive", "adaptive_threshold", "adaptive_min_samples")
    assert [engine(scene)[name] for name in names] == [True, pytest.approx(0.03), 7]
    assert [engine(scene, viewport=True)[name] for name in names] == [True, 0.0, 0]
    scene.cycles.use_adaptive_sampling = False
    scene.cycles.use_preview_adaptive_sampling = False
    assert not engine(scene)["adaptive"] and not engine(scene, viewport=True)["adaptive"]


def test_animated_seed(scene: bpy.types.Scene) -> None:
    scene.talbot.seed = 3
    assert engine(scene)["seed"] == 3
    scene.talbot.use_animated_seed = True
    seeds = set()
    for frame in range(1, 50):
        scene.frame_set(frame)
        seeds.add(engine(scene)["seed"])
    assert len(seeds) == 49
    assert all(0 <= seed < 2**32 for seed in seeds)


def test_resolution_crop_and_threads(scene: bpy.types.Scene) -> None:
    render = scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = 253, 131, 50
    values = engine(scene)
    assert (values["width"], values["height"], values["crop_width"], values["threads"]) == (126, 65, 0, 0)
    render.use_border = True
    render.border_min_x, render.border_max_x = 0.25, 0.75
    render.border_min_y, render.border_max_y = 0.5, 1.0
    render.threads_mode, render.threads = "FIXED", 3
    values = engine(scene)
    assert (values["crop_x"], values["crop_y"], values["crop_width"], values["crop_height"]) == (31, 32, 63, 33)
    assert values["threads"] == 3


def test_crop_is_what_blender_makes_of_the_border(scene: bpy.types.Scene) -> None:
    """Where the fraction of a border falls on a pixel's edge, single precision decides."""
    render = scene.render
    render.use_border = True
    render.border_min_x, render.border_max_x = 0.1, 0.7
    render.border_min_y, render.border_max_y = 0.3, 0.9
    assert settings.crop(render, 30, 20) == (3, 6, 18, 12)


def test_alpha_threshold_is_the_layers(scene: bpy.types.Scene) -> None:
    assert engine(scene)["pass_alpha_threshold"] == 0.5
    scene.view_layers[0].pass_alpha_threshold = 0.25
    assert engine(scene)["pass_alpha_threshold"] == 0.25


def test_mist_and_colour(scene: bpy.types.Scene) -> None:
    scene.world = bpy.data.worlds.new("Mist")
    scene.world.mist_settings.start, scene.world.mist_settings.depth = 2.0, 9.0
    scene.world.mist_settings.falloff = "INVERSE_QUADRATIC"
    values = engine(scene)
    assert (values["mist_start"], values["mist_depth"], values["mist_falloff"]) == (2.0, 9.0, 2)
    assert Path(str(values["ocio_config"])).is_file()
    assert values["working_space"] in Path(str(values["ocio_config"])).read_text(encoding="utf-8", errors="replace")
