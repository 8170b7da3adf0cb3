"""Lamps, in each version's own units: the engine knows what they mean by the version of the settings."""

import math
from typing import Any

from .. import versions
from .context import SyncContext
from .materials import ShaderSync

TYPES = {"POINT": "point", "SPOT": "spot", "SUN": "sun", "AREA": "area"}


def light_color(light: Any) -> tuple[float, float, float]:
    """Colour times the temperature's, where the version has one."""
    color = tuple(light.color)
    if getattr(light, "use_temperature", False):
        return tuple(a * b for a, b in zip(color, light.temperature_color, strict=True))
    return color


def light_values(
    context: SyncContext, shaders: ShaderSync, owner: Any, matrix: list[float], visibility: int, random: int
) -> dict[str, Any] | None:
    """The dictionary of one lamp; None when it gives no light. `owner` is the light object (or an instance of it)."""
    light = owner.data
    if light.type not in TYPES:
        context.warn(f"Light '{owner.name}': type {light.type} is not supported")
        return None
    color, power = light_color(light), light.energy * 2.0 ** getattr(light, "exposure", 0.0)
    if not all(math.isfinite(number) for number in (*matrix, *color, power)):
        context.warn(f"Light '{owner.name}': its matrix or strength is not finite; it is not rendered")
        return None
    cycles = versions.cycles_settings(light)
    cast_shadow = cycles.get("cast_shadow")
    if cast_shadow is None:
        cast_shadow = light.use_shadow
    values: dict[str, Any] = {
        "name": owner.name,
        "type": TYPES[light.type],
        "to_world": matrix,
        "color": color,
        "power": power,
        "normalize": bool(getattr(light, "normalize", True)),
        "shader": shaders.light(light),
        "visibility": visibility,
        "cast_shadow": bool(cast_shadow),
        "use_mis": bool(cycles.get("use_multiple_importance_sampling", True)),
        "max_bounces": int(cycles.get("max_bounces", 1024)),
        "random": random,
        "is_shadow_catcher": owner.is_shadow_catcher,
    }
    if light.type in ("POINT", "SPOT"):
        values["radius"] = light.shadow_soft_size
        values["soft_falloff"] = bool(getattr(light, "use_soft_falloff", True))
    if light.type == "SPOT":
        values |= {"spot_angle": light.spot_size, "spot_blend": light.spot_blend}
    elif light.type == "SUN":
        values["sun_angle"] = light.angle
    elif light.type == "AREA":
        round_or_square = light.shape in ("SQUARE", "DISK")
        values |= {
            "shape": light.shape.lower(),
            "size_x": light.size,
            "size_y": light.size if round_or_square else light.size_y,
            "spread": light.spread,
            "is_portal": bool(cycles.get("is_portal", False)),
        }
    return values
