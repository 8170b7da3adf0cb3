"""Blender's hashes of names and numbers."""

import numpy as np
from numpy.typing import NDArray


def name_key(name: str) -> int:
    """Blender's hash of a name."""
    key = 0
    for byte in name.encode():
        key = (key * 37 + byte) & 0xFFFFFFFF
    return key


def mixed_keys(keys: NDArray[np.uint32]) -> NDArray[np.uint32]:
    """A number and a zero, mixed [Jenkins 2006, "lookup3"]: Random of objects that are no instances (of their name's
    hash), of curves and of points (of their index)."""
    start = np.uint32((0xDEADBEEF + (2 << 2) + 13) & 0xFFFFFFFF)
    a, b, c = keys + start, np.full_like(keys, start), np.full_like(keys, start)

    def mix(left: NDArray[np.uint32], right: NDArray[np.uint32], bits: int) -> NDArray[np.uint32]:
        return (left ^ right) - ((right << np.uint32(bits)) | (right >> np.uint32(32 - bits)))

    c = mix(c, b, 14)
    a = mix(a, c, 11)
    b = mix(b, a, 25)
    c = mix(c, b, 16)
    a = mix(a, c, 4)
    b = mix(b, a, 14)
    return mix(c, b, 24)
