"""Generated coordinates: the place in the texture space of a mesh, 0 to 1 in its box, before modifiers deform it."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

F32 = NDArray[np.float32]


def texture_space(mesh: Any) -> tuple[F32, F32]:
    """Scale and offset of generated = position * scale + offset."""
    size = np.array(mesh.texspace_size, dtype=np.float32)
    scale = np.where(size != 0, 0.5 / np.where(size != 0, size, 1.0), 0.0).astype(np.float32)
    return scale, (0.5 - np.array(mesh.texspace_location, dtype=np.float32) * scale).astype(np.float32)


def generated_of(mesh: Any, points: F32) -> F32:
    """(N, 3) of positions in object space."""
    scale, offset = texture_space(mesh)
    return np.ascontiguousarray(points * scale + offset, dtype=np.float32)
