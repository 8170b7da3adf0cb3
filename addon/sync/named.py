"""Custom properties and paths that shaders name."""

from typing import Any


def named_property(holder: Any, name: str) -> tuple[float, ...] | None:
    """A custom property of a datablock (of an object: or its data), or a property by its path, as 1 to 4 numbers."""
    for owner in (holder, getattr(holder, "data", None)):
        if owner is None:
            continue
        value = owner.get(name)
        if value is None:
            try:
                value = owner.path_resolve(name)
            except (ValueError, TypeError, AttributeError):
                continue
        numbers = _numbers(value)
        if numbers is not None:
            return numbers
    return None


def color_and_number(values: tuple[float, ...]) -> tuple[float, float, float, float, float]:
    """What an Attribute node makes of 1 to 4 numbers: Color, Alpha and Fac, as op_attribute of the engine does."""
    red, green, blue = (values * 3 if len(values) == 1 else (*values, 0.0))[:3]
    alpha = values[3] if len(values) == 4 else 1.0
    return red, green, blue, alpha, red if len(values) <= 2 else (red + green + blue) / 3.0


def _numbers(value: Any) -> tuple[float, ...] | None:
    if isinstance(value, (bool, int, float)):
        return (float(value),)
    try:
        numbers = tuple(float(v) for v in value)
    except (TypeError, ValueError):
        return None
    return numbers if 1 <= len(numbers) <= 4 else None
