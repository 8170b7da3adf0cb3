"""The world: its shader, who sees it, how it is sampled."""

from typing import Any

from .. import versions
from .context import SyncContext
from .materials import ShaderSync

SAMPLING = ("NONE", "AUTOMATIC", "MANUAL")
VISIBILITY = (("camera", 1), ("diffuse", 2), ("glossy", 4), ("transmission", 8), ("scatter", 16))


def world_visibility(world: Any) -> int:
    """Cycles' ray visibility of the world, as bits; the sky blocks no light, so the shadow bit is always there."""
    group = getattr(world, "cycles_visibility", None)
    if group is None:
        return 63
    return 32 | sum(bit for name, bit in VISIBILITY if getattr(group, name, True))


def world_values(context: SyncContext, shaders: ShaderSync, scene: Any, view_layer: Any) -> dict[str, Any]:
    """The dictionary for `Session.set_world`."""
    world = getattr(view_layer, "world_override", None) or scene.world
    if world is None or not view_layer.use_sky:
        return {"shader": -1}
    cycles = versions.cycles_settings(world)
    method = cycles.get_enum("sampling_method", SAMPLING, "AUTOMATIC")
    return {
        "shader": shaders.world(world),
        "visibility": world_visibility(world),
        "use_importance_map": method != "NONE",
        "map_resolution": int(cycles.get("sample_map_resolution", 1024)) if method == "MANUAL" else 0,
        "max_bounces": int(cycles.get("max_bounces", 1024)),
        "sample_as_light": method != "NONE",
        "light_group": context.light_group(world),
    }
