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


def _numbers(value: Any) -> tuple[float, ...] | None:
    if isinstance(value, (bool, int, float)):
        return (float(value),)
    try:
        numbers = tuple(float(v) for v in value)
    except (TypeError, ValueError):
        return None
    return numbers if 1 <= len(numbers) <= 4 else None
