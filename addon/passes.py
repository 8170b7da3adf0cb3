"""Which render passes a view layer asks for: Blender's names, the engine's names, and how to write them.

What `wanted` lists is registered with Blender and written, always both: Blender crashes writing a multilayer file when
a registered pass was never given memory.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import versions

COMBINED = "Combined"
LIGHT_GROUP = "light_group:"
NOISY = "Noisy Image"
EMPTY_DEPTH = 1e10


@dataclass(frozen=True)
class Pass:
    """One pass of Blender's result and the engine's pass that fills it."""

    name: str  # Blender's
    native: str
    channels: int
    channel_ids: str = "RGB"
    kind: str = "COLOR"


@dataclass(frozen=True)
class _Offer:
    """A pass that a switch of the view layer (or of its Cycles settings) turns on."""

    switch: str
    short: str  # name up to 4.x
    long: str  # name from 5.0 on
    native: str
    channels: int = 3
    channel_ids: str = "RGB"
    kind: str = "COLOR"


_OFFERS = (
    _Offer("use_pass_z", "Depth", "Depth", "depth", 1, "Z", "VALUE"),
    _Offer("use_pass_mist", "Mist", "Mist", "mist", 1, "Z", "VALUE"),
    _Offer("use_pass_position", "Position", "Position", "position", 3, "XYZ", "VECTOR"),
    _Offer("use_pass_normal", "Normal", "Normal", "normal", 3, "XYZ", "VECTOR"),
    _Offer("use_pass_uv", "UV", "UV", "uv", 3, "UVA", "VECTOR"),
    _Offer("use_pass_object_index", "IndexOB", "Object Index", "object_index", 1, "X", "VALUE"),
    _Offer("use_pass_material_index", "IndexMA", "Material Index", "material_index", 1, "X", "VALUE"),
    *(
        _Offer(f"use_pass_{lobe}_{part}", short + part_short, f"{lobe.title()} {part.title()}", f"{lobe}_{part}")
        for lobe, short in (("diffuse", "Diff"), ("glossy", "Gloss"), ("transmission", "Trans"))
        for part, part_short in (("direct", "Dir"), ("indirect", "Ind"), ("color", "Col"))
    ),
    _Offer("use_pass_emit", "Emit", "Emission", "emission"),
    _Offer("use_pass_environment", "Env", "Environment", "environment"),
)

_DENOISING_DATA = (
    Pass("Denoising Normal", "denoising_normal", 3, "XYZ", "VECTOR"),
    Pass("Denoising Albedo", "denoising_albedo", 3),
    Pass("Denoising Depth", "depth", 1, "Z", "VALUE"),
)
_SAMPLE_COUNT = Pass("Debug Sample Count", "sample_count", 1, "X", "VALUE")

_SHADOW_CATCHER = Pass("Shadow Catcher", "shadow_catcher", 3)

_NOT_OFFERED = {
    "use_pass_vector": "Vector",
    "use_pass_shadow": "Shadow",
    "use_pass_ambient_occlusion": "Ambient Occlusion",
    "use_pass_cryptomatte_object": "Cryptomatte Object",
    "use_pass_cryptomatte_material": "Cryptomatte Material",
    "use_pass_cryptomatte_asset": "Cryptomatte Asset",
}
_NOT_OFFERED_CYCLES = {
    "use_pass_volume_direct": "Volume Direct",
    "use_pass_volume_indirect": "Volume Indirect",
    "use_pass_volume_scatter": "Volume Scatter",
    "use_pass_volume_transmit": "Volume Transmit",
    "use_pass_volume_majorant": "Volume Majorant",
    "pass_render_time": "Render Time",
}

DENOISING_GUIDES = ("denoising_albedo", "denoising_normal")


def denoises(scene: Any, view_layer: Any) -> bool:
    """Whether the layer's picture is to be denoised: the scene's switch and the layer's."""
    return bool(scene.talbot.use_denoising and versions.cycles_settings(view_layer).get("use_denoising", True))


def wanted(scene: Any, view_layer: Any) -> list[Pass]:
    """The passes to register and to write, Combined first, in Cycles' order."""
    long_names = versions.has_long_pass_names()
    cycles = versions.cycles_settings(view_layer)
    passes = [Pass(COMBINED, "combined", 4, "RGBA")]
    for offer in _OFFERS:
        if getattr(view_layer, offer.switch, False):
            name = offer.long if long_names else offer.short
            passes.append(Pass(name, offer.native, offer.channels, offer.channel_ids, offer.kind))
    if cycles.get("pass_debug_sample_count", False):
        passes.append(_SAMPLE_COUNT)
    catcher = cycles.get("use_pass_shadow_catcher", False)
    if catcher:
        passes.append(_SHADOW_CATCHER)
    if denoises(scene, view_layer):
        passes.append(Pass(NOISY, "combined", 4, "RGBA"))
        if catcher:
            passes.append(Pass("Noisy Shadow Catcher", "shadow_catcher", 3))
    if cycles.get("denoising_store_passes", False):
        passes.extend(_DENOISING_DATA)
    for aov in view_layer.aovs:
        if aov.is_valid and aov.type == "COLOR":
            passes.append(Pass(aov.name, f"aov_color:{aov.name}", 4, "RGBA"))
        elif aov.is_valid:
            passes.append(Pass(aov.name, f"aov_value:{aov.name}", 1, "X", "VALUE"))
    passes.extend(Pass(f"{COMBINED}_{name}", LIGHT_GROUP + name, 3) for name in light_groups(view_layer))
    return passes


def light_groups(view_layer: Any) -> list[str]:
    """Names of the layer's light groups; emitters know theirs by its place in the list."""
    return [group.name for group in view_layer.lightgroups]


def native_names(passes: list[Pass], *, denoise: bool) -> list[str]:
    """The engine's passes that these need, each once."""
    names = [p.native for p in passes]
    if denoise:
        names.extend(DENOISING_GUIDES)
    return list(dict.fromkeys(names))


def not_offered(view_layer: Any) -> Iterator[str]:
    """Names of the passes that are asked for but do not exist in Talbot."""
    for switch, name in _NOT_OFFERED.items():
        if getattr(view_layer, switch, False):
            yield name
    cycles = versions.cycles_settings(view_layer)
    for switch, name in _NOT_OFFERED_CYCLES.items():
        if cycles.get(switch, False):
            yield name


def register_all(engine: Any, scene: Any, view_layer: Any) -> None:
    """Tells Blender which passes the layer will have (sockets of the compositor, channels of files)."""
    for p in wanted(scene, view_layer):
        engine.register_pass(scene, view_layer, p.name, p.channels, p.channel_ids, p.kind)


def set_rect(render_pass: Any, values: NDArray[np.float32]) -> None:
    """Writes float32 pixels (pixels, channels), bottom row first. Up to 4.x `rect` has two dimensions, later one."""
    try:
        render_pass.rect.foreach_set(values.reshape(-1))
    except TypeError:
        render_pass.rect.foreach_set(values.reshape(-1, render_pass.channels))


def fitted(values: NDArray[np.float32] | None, p: Pass, pixels: int) -> NDArray[np.float32]:
    """The engine's array with exactly the channels of Blender's pass; an empty picture before the first sample."""
    if values is not None and values.shape[0] != pixels:
        raise RuntimeError(f"the {p.name} pass has {values.shape[0]} pixels, Blender asks for {pixels}")
    if values is None:
        empty = EMPTY_DEPTH if p.native == "depth" else 0.0
        return np.full((pixels, p.channels), empty, np.float32)
    if values.shape[1] == p.channels:
        return np.ascontiguousarray(values, np.float32)
    out = np.zeros((pixels, p.channels), np.float32)
    common = min(p.channels, values.shape[1])
    out[:, :common] = values[:, :common]
    return out


def write(
    render_layer: Any,
    view: str,
    passes: list[Pass],
    session: Any,
    pixels: int,
    *,
    denoised: NDArray[np.float32] | None = None,
) -> None:
    """Writes every pass of one view. `denoised` replaces Combined; Noisy Image stays what was rendered."""
    arrays: dict[str, NDArray[np.float32] | None] = {}
    for p in passes:
        target = render_layer.passes.find_by_name(p.name, view)
        if target is None:  # turned on after Blender had made the result
            continue
        if p.native not in arrays:
            arrays[p.native] = session.read_pass(p.native)
        values = denoised if p.name == COMBINED and denoised is not None else arrays[p.native]
        set_rect(target, fitted(values, p, pixels))
