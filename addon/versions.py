"""What differs between Blender versions, found by asking, not by comparing numbers, wherever that is possible."""

from typing import Any

import bpy

MEASURED_VERSIONS = (304, 402, 403, 405, 500, 502)
"""Versions whose nodes and lights were measured; the engine knows these numbers."""


def semantics_version(version: tuple[int, ...] | None = None) -> int:
    """The measured version whose meaning of nodes and lights holds: the nearest lower one, never below the lowest."""
    major, minor = (version or bpy.app.version)[:2]
    number = major * 100 + minor
    return max((v for v in MEASURED_VERSIONS if v <= number), default=MEASURED_VERSIONS[0])


def has_long_pass_names() -> bool:
    """5.0 renamed the light passes ("DiffDir" became "Diffuse Direct"); no RNA tells, so the number decides."""
    return bpy.app.version >= (5, 0, 0)


def flat_faces_split_normals() -> bool:
    """Whether flat faces alone keep smooth ones beside them from sharing their normals in Cycles, as in Blender. Up to
    5.1 it took sharp edges or custom normals. No RNA tells, so the number decides."""
    return bpy.app.version >= (5, 2, 0)


class CyclesSettings:
    """The settings Cycles keeps in a datablock (`.cycles`), readable with or without the Cycles add-on.

    Without it, Blender 3.4 leaves them as custom properties and 5.0 as system properties; both hold changed values
    only, and enumerations as the number of the item. `get` then returns the fallback for the rest.
    """

    __slots__ = ("_group", "_stored")

    def __init__(self, owner: Any, key: str = "cycles") -> None:
        self._group = getattr(owner, key, None)
        self._stored: dict[str, Any] = {}
        if self._group is not None or owner is None:
            return
        stored = None
        if hasattr(owner, "bl_system_properties_get"):
            system = owner.bl_system_properties_get()
            stored = system.get(key) if system is not None else None
        if stored is None and hasattr(owner, "get"):
            stored = owner.get(key)
        if stored is not None and hasattr(stored, "to_dict"):
            self._stored = stored.to_dict()

    def get(self, name: str, fallback: Any = None) -> Any:
        """The value of a property, or `fallback` where this Blender or file does not have it."""
        if self._group is not None:
            return getattr(self._group, name, fallback)
        return self._stored.get(name, fallback)

    def get_enum(self, name: str, items: tuple[str, ...], fallback: str) -> str:
        """An enumeration's identifier. `items` in Cycles' order, for the stored number."""
        value = self.get(name, fallback)
        if isinstance(value, int):
            return items[value] if 0 <= value < len(items) else fallback
        return value or fallback


def cycles_settings(owner: Any) -> CyclesSettings:
    """Reader of the Cycles settings of a scene, object, light, camera, material, world or view layer."""
    return CyclesSettings(owner)


def cycles_curves(scene: Any) -> CyclesSettings:
    """Reader of the scene's settings for curves."""
    return CyclesSettings(scene, "cycles_curves")


_LUMINANCE = {
    "Linear Rec.2020": (0.2627002, 0.6779981, 0.0593017),
    "ACEScg": (0.2722287, 0.6740818, 0.0536895),
}
"""Y of the primaries of the working spaces that 5.0 offers besides Rec.709."""


def luminance_weights() -> tuple[float, float, float]:
    """Luminance of the working space's red, green and blue. Rec.709's are what each Cycles makes of its configuration's
    rounded matrices, digit by digit: white is a little more than 1, which comparisons and hues of 1 tell."""
    rec709 = (0.21263911, 0.71516913, 0.07219275)
    if bpy.app.version < (4, 0, 0):
        rec709 = (0.21267298, 0.71515262, 0.07217544)
    elif bpy.app.version < (5, 0, 0):
        rec709 = (0.21267404, 0.71515161, 0.07217542)
    return _LUMINANCE.get(working_space(), rec709)


def working_space() -> str:
    """Name of the scene-linear colour space of the open file, as Blender's OpenColorIO configuration spells it."""
    chosen = getattr(getattr(bpy.data, "colorspace", None), "working_space", "")
    if chosen:
        return chosen
    return "Linear" if bpy.app.version < (4, 0, 0) else "Linear Rec.709"
