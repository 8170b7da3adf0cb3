"""The render settings: what each is called, what it defaults to, and which value counts.

A property that was set in Talbot wins. Otherwise the scene's Cycles setting of the same name counts, so that a file
made for Cycles renders as its author meant it, and otherwise the default. Names, ranges and defaults are Cycles' own.
"""

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from . import versions

MAX_SAMPLES = 1 << 24
PREVIEW_SAMPLES = 32
"""Samples of material, world and light previews."""
PREVIEW_SECONDS = 4.0

SUBSET_SWITCH = "use_sample_subset"


@dataclass(frozen=True)
class Setting:
    """One property of `scene.talbot` that has a namesake in Cycles."""

    name: str
    label: str
    description: str
    default: bool | int | float | str
    limits: tuple[float, float] = (0, 0)
    soft_max: float | None = None
    items: tuple[tuple[str, str, str], ...] = ()
    precision: int = 3
    unit: str = "NONE"

    def to_number(self, value: bool | int | float | str) -> bool | int | float:
        """The value as it is stored: enumerations by the number of their item."""
        if not self.items:
            return type(self.default)(value)
        return value if isinstance(value, int) else self.identifiers().index(value)

    def identifiers(self) -> tuple[str, ...]:
        """Identifiers of an enumeration's items."""
        return tuple(item[0] for item in self.items)


_FILTERS = (
    ("BOX", "Box", "Average over the pixel's square"),
    ("GAUSSIAN", "Gaussian", "Bell curve of the filter width"),
    ("BLACKMAN_HARRIS", "Blackman-Harris", "Bell-like window of the filter width; sharp and free of ringing"),
)
_LAYER_SAMPLES = (
    ("USE", "Use", "A view layer's own number of samples replaces the scene's"),
    ("BOUNDED", "Bounded", "A view layer's own number of samples counts where it is the smaller"),
    ("IGNORE", "Ignore", "View layers use the scene's number of samples"),
)

SETTINGS = (
    Setting("samples", "Samples", "Paths through each pixel of a final render", 4096, (1, MAX_SAMPLES)),
    Setting(
        "preview_samples", "Viewport Samples", "Paths through each viewport pixel; 0: no end", 1024, (0, MAX_SAMPLES)
    ),
    Setting("seed", "Seed", "Another seed gives another pattern of noise", 0, (0, 2**31 - 1)),
    Setting("use_animated_seed", "Animate Seed", "Change the noise from frame to frame", False),
    Setting(
        "sample_offset",
        "Sample Offset",
        "Number of the first sample: machines that share a frame render different samples",
        0,
        (0, MAX_SAMPLES),
    ),
    Setting(
        "use_adaptive_sampling", "Noise Threshold", "Stop sampling the pixels whose noise is below the threshold", True
    ),
    Setting("adaptive_threshold", "Threshold", "Noise to stop at; 0: chosen by the samples", 0.01, (0, 1), precision=4),
    Setting("adaptive_min_samples", "Min Samples", "Samples every pixel gets; 0: chosen", 0, (0, 4096)),
    Setting("use_preview_adaptive_sampling", "Noise Threshold", "The same, in the viewport", True),
    Setting(
        "preview_adaptive_threshold", "Threshold", "Viewport noise to stop at; 0: chosen", 0.1, (0, 1), precision=4
    ),
    Setting(
        "preview_adaptive_min_samples", "Min Samples", "Samples every viewport pixel gets; 0: chosen", 0, (0, 4096)
    ),
    Setting("use_denoising", "Denoise", "Remove noise from the finished picture (Open Image Denoise)", True),
    Setting("use_preview_denoising", "Denoise", "Remove noise from the viewport when its samples are done", False),
    Setting("time_limit", "Time Limit", "Stop a final render after this time; 0: no limit", 0.0, (0, 1e9), unit="TIME"),
    Setting("use_layer_samples", "Layer Samples", "What the samples of a view layer mean", "USE", items=_LAYER_SAMPLES),
    Setting("light_sampling_threshold", "Light Threshold", "Light below this is sampled at random", 0.01, (0, 1)),
    Setting("min_light_bounces", "Min Light Bounces", "Bounces before paths end at random", 0, (0, 1024)),
    Setting(
        "min_transparent_bounces",
        "Min Transparent Bounces",
        "Transparent surfaces passed before paths end at random",
        0,
        (0, 1024),
    ),
    Setting("max_bounces", "Total", "Bounces of a path in all", 12, (0, 1024)),
    Setting("diffuse_bounces", "Diffuse", "Diffuse bounces", 4, (0, 1024)),
    Setting("glossy_bounces", "Glossy", "Glossy bounces", 4, (0, 1024)),
    Setting("transmission_bounces", "Transmission", "Bounces through glass and the like", 12, (0, 1024)),
    Setting("volume_bounces", "Volume", "Scatterings in volumes", 0, (0, 1024)),
    Setting("transparent_max_bounces", "Transparent", "Transparent surfaces a ray may pass", 8, (0, 1024)),
    Setting(
        "sample_clamp_direct", "Direct Light", "Largest direct light of a sample; 0: no limit", 0.0, (0, 1e8), 100.0
    ),
    Setting(
        "sample_clamp_indirect",
        "Indirect Light",
        "Largest light of a sample after the first bounce: fewer bright specks, less light; 0: no limit",
        10.0,
        (0, 1e8),
        100.0,
    ),
    Setting("caustics_reflective", "Reflective", "Light that mirrors and gloss throw on diffuse surfaces", True),
    Setting("caustics_refractive", "Refractive", "Light that glass throws on diffuse surfaces", True),
    Setting(
        "blur_glossy", "Filter Glossy", "Roughen gloss seen after blurry bounces: fewer bright specks", 1.0, (0, 10)
    ),
    Setting("film_exposure", "Exposure", "Brightness of the picture as it is rendered", 1.0, (0, 10)),
    Setting("film_transparent_glass", "Transparent Glass", "Glass lets a transparent background show through", False),
    Setting(
        "film_transparent_roughness",
        "Roughness Threshold",
        "Glass rougher than this stays opaque to the background",
        0.1,
        (0, 1),
    ),
    Setting("pixel_filter_type", "Pixel Filter", "Shape of the pixel filter", "BLACKMAN_HARRIS", items=_FILTERS),
    Setting("filter_width", "Width", "Width of the filter in pixels: wider is softer", 1.5, (0.01, 10), unit="PIXEL"),
)

BY_NAME = {setting.name: setting for setting in SETTINGS}


def from_cycles(scene: Any, setting: Setting) -> bool | int | float | str | None:
    """The scene's Cycles value of a setting, None where Cycles stored none."""
    cycles = versions.cycles_settings(scene)
    if setting.items:
        return cycles.get_enum(setting.name, setting.identifiers(), "") or None
    # 5.0 and newer: the offset is part of a panel with a switch of its own.
    if setting.name == "sample_offset" and cycles.get(SUBSET_SWITCH, None) is False:
        return 0
    value = cycles.get(setting.name)
    return None if value is None else type(setting.default)(value)


def effective(group: Any, setting: Setting) -> bool | int | float | str:
    """The value that counts. `group` is `scene.talbot`, original or evaluated."""
    stored = group.get(setting.name)
    if stored is not None:
        if setting.items:
            return setting.identifiers()[stored]
        return type(setting.default)(stored)
    if group.use_cycles_settings:
        value = from_cycles(group.id_data, setting)
        if value is not None:
            return value
    return setting.default


def is_set(group: Any, name: str) -> bool:
    """Whether the user chose the value in Talbot. (RNA's own `is_property_set` says yes for computed properties.)"""
    return group.get(name) is not None


def frame_seed(seed: int, frame: int) -> int:
    """One seed for each frame: neighbours share no noise."""
    mixed = (seed * 0x9E3779B1 + frame * 0x85EBCA6B) & 0xFFFFFFFF
    for shift, factor in ((16, 0x7FEB352D), (15, 0x846CA68B)):
        mixed = ((mixed ^ (mixed >> shift)) * factor) & 0xFFFFFFFF
    return mixed ^ (mixed >> 16)


def _sample_range(scene: Any, view_layer: Any, *, viewport: bool, preview: bool) -> tuple[int, int, int]:
    """First sample, number of samples, and that of the whole picture of which they are a subset."""
    talbot = scene.talbot
    if viewport:
        samples = talbot.preview_samples or MAX_SAMPLES
        return 0, samples, samples
    samples = talbot.samples
    if preview:
        samples = min(samples, PREVIEW_SAMPLES)
        return 0, samples, samples
    own = view_layer.samples if view_layer is not None else 0
    if own > 0 and talbot.use_layer_samples == "USE":
        samples = own
    elif own > 0 and talbot.use_layer_samples == "BOUNDED":
        samples = min(samples, own)
    offset = talbot.sample_offset
    cycles = versions.cycles_settings(scene)
    if not is_set(talbot, "sample_offset") and talbot.use_cycles_settings and cycles.get(SUBSET_SWITCH, False):
        return offset, max(1, min(cycles.get("sample_subset_length", samples), samples - offset)), samples
    return offset, samples, samples


def _noise_threshold(threshold: float, samples: int, whole: int) -> float:
    """A subset of a picture's samples may be noisier, so that the subsets together come to the threshold."""
    if samples == whole:
        return threshold
    return (threshold or max(0.001, 1.0 / whole)) * (samples / whole) ** 0.5


def resolution(render: Any) -> tuple[int, int]:
    """Size of the whole frame in pixels, rounded down as Blender does."""
    percentage = render.resolution_percentage
    return max(1, render.resolution_x * percentage // 100), max(1, render.resolution_y * percentage // 100)


def crop(render: Any, width: int, height: int) -> tuple[int, int, int, int]:
    """Render border as x, y, width, height in pixels from the bottom left (Blender truncates); zeros: none."""
    if not render.use_border:
        return 0, 0, 0, 0

    def pixel(fraction: float, size: int) -> int:
        # Blender multiplies in single precision: 0.9 of 20 is 18 there, and 17.9999995 here.
        return int(np.float32(fraction) * np.float32(size))

    left, right = pixel(render.border_min_x, width), pixel(render.border_max_x, width)
    bottom, top = pixel(render.border_min_y, height), pixel(render.border_max_y, height)
    return left, bottom, max(0, right - left), max(0, top - bottom)


def ocio_config() -> str:
    """Path of the OpenColorIO configuration Blender itself uses, "" when there is none."""
    override = os.environ.get("OCIO", "")
    if override:
        return override
    folder = bpy.utils.system_resource("DATAFILES", path="colormanagement")
    path = Path(folder or "") / "config.ocio"
    return str(path) if folder and path.is_file() else ""


_MIST_FALLOFFS = ("QUADRATIC", "LINEAR", "INVERSE_QUADRATIC")


def engine_settings(
    scene: Any, view_layer: Any, render: Any, *, viewport: bool = False, preview: bool = False
) -> dict[str, Any]:
    """The dictionary for `Session.set_settings`: fields of the engine's Settings.

    `width`, `height` and the crop are those of the final frame; the viewport's caller replaces them.
    """
    talbot = scene.talbot
    first_sample, samples, whole = _sample_range(scene, view_layer, viewport=viewport, preview=preview)
    width, height = resolution(render)
    crop_x, crop_y, crop_width, crop_height = (0, 0, 0, 0) if viewport else crop(render, width, height)
    interactive = "preview_" if viewport else ""
    time_limit = 0.0 if viewport else talbot.time_limit
    seed = talbot.seed & 0xFFFFFFFF
    values: dict[str, Any] = {
        "version": versions.semantics_version(),
        "width": width,
        "height": height,
        "crop_x": crop_x,
        "crop_y": crop_y,
        "crop_width": crop_width,
        "crop_height": crop_height,
        "samples": samples,
        "first_sample": first_sample,
        "seed": frame_seed(seed, scene.frame_current) if talbot.use_animated_seed else seed,
        "time_limit": PREVIEW_SECONDS if preview else time_limit,
        "adaptive": talbot.use_preview_adaptive_sampling if viewport else talbot.use_adaptive_sampling,
        "adaptive_threshold": _noise_threshold(getattr(talbot, f"{interactive}adaptive_threshold"), samples, whole),
        "adaptive_min_samples": getattr(talbot, f"{interactive}adaptive_min_samples"),
        "max_bounces": talbot.max_bounces,
        "diffuse_bounces": talbot.diffuse_bounces,
        "glossy_bounces": talbot.glossy_bounces,
        "transmission_bounces": talbot.transmission_bounces,
        "volume_bounces": talbot.volume_bounces,
        "transparent_bounces": talbot.transparent_max_bounces,
        "min_light_bounces": talbot.min_light_bounces,
        "min_transparent_bounces": talbot.min_transparent_bounces,
        "clamp_direct": talbot.sample_clamp_direct,
        "clamp_indirect": talbot.sample_clamp_indirect,
        "caustics_reflective": talbot.caustics_reflective,
        "caustics_refractive": talbot.caustics_refractive,
        "filter_glossy": talbot.blur_glossy,
        "offscreen_dicing_scale": float(versions.cycles_settings(scene).get("offscreen_dicing_scale", 4.0)),
        "light_threshold": talbot.light_sampling_threshold,
        "filter": talbot.pixel_filter_type.lower(),
        "filter_width": talbot.filter_width,
        "film_exposure": talbot.film_exposure,
        "film_transparent": render.film_transparent,
        "film_transparent_glass": talbot.film_transparent_glass,
        "film_transparent_roughness": talbot.film_transparent_roughness,
        "pass_alpha_threshold": view_layer.pass_alpha_threshold,
        "threads": render.threads if render.threads_mode == "FIXED" else 0,
        "ocio_config": ocio_config(),
        "working_space": versions.working_space(),
        "luminance_weights": list(versions.luminance_weights()),
        "viewport": viewport,
    }
    world = getattr(view_layer, "world_override", None) or scene.world
    if world is not None:
        mist = world.mist_settings
        values["mist_start"] = mist.start
        values["mist_depth"] = mist.depth
        values["mist_falloff"] = _MIST_FALLOFFS.index(mist.falloff)
    return values
