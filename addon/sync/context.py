"""What the modules of one synchronisation share: the session, the version, what shaders ask of meshes, warnings."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from .. import native

ACTIVE_UV = "@uv"
ACTIVE_COLOR = "@color"
ACTIVE_TANGENT = "@tangent"
GENERATED = "@generated"
INSTANCER = "@instancer"
POINTINESS = "@pointiness"
ISLAND = "@island"
PARTICLE = "@particle"
CURVE_NORMAL = "@curve_normal"
UNMAPPED_TANGENT = "@unmapped:"
PROPERTY_PREFIXES = {"OBJECT": "object:", "INSTANCER": "instancer:"}
"""Names in `SyncContext.wanted` that stand for a mesh's own choice, Generated, the instancer's coordinates, and what
topology gives. Behind the prefix for unmapped tangents is who asks for the active map's: meshes without one need them
for that material only."""


INSTANCERS_HAVE_LIGHT_GROUPS = 402
"""Seen in 4.2, but not in 3.4."""


class Interrupted(Exception):
    """The user cancelled while the scene was read. What the session holds is incomplete."""


@dataclass
class SyncContext:
    """Lives as long as its session; holds names and handles, and Blender's data where it says so."""

    session: Any
    version: int = 502
    viewport: bool = False
    warnings: list[str] = field(default_factory=list)
    timings: dict[str, float] = field(default_factory=dict)
    interrupted: Callable[[], bool] | None = None
    """Asked between stages and meshes; set and removed by the callback that synchronises."""
    wanted: set[str] = field(default_factory=set)
    """Attributes some shader reads; "@tangent:NAME" for tangents, properties behind a prefix."""

    aovs: frozenset[str] = frozenset()
    """Names of the view layer's AOVs: which AOV Output nodes count."""

    light_groups: dict[str, int] = field(default_factory=dict)
    """The view layer's, by name. Others light too, but in no pass."""

    frame: float = 0.0
    seconds: float = 0.0
    """The scene's time, for Scene Time nodes."""

    layers: tuple[Any, ...] = ()
    """View layer and scene, whose properties Attribute nodes read: Blender's, for the same callback only."""

    def light_group(self, holder: Any, instancer: Any = None) -> int:
        """Place of the group that a thing is in; -1: in none of the layer's. Its instancer's, where it says nothing."""
        name = holder.lightgroup
        if not name and instancer is not None and self.version >= INSTANCERS_HAVE_LIGHT_GROUPS:
            name = instancer.lightgroup
        return self.light_groups.get(name, -1)

    def set_scene(self, scene: Any, view_layer: Any) -> bool:
        """What shaders read of both. True when the time differs from before."""
        self.layers = view_layer, scene
        before = self.frame, self.seconds
        self.frame = scene.frame_current + scene.frame_subframe
        self.seconds = self.frame * scene.render.fps_base / scene.render.fps
        return before != (self.frame, self.seconds)

    def warn(self, text: str) -> None:
        """Adds a warning once."""
        if text not in self.warnings:
            self.warnings.append(text)

    def check(self) -> None:
        """Raises Interrupted when the user has cancelled."""
        if self.interrupted is not None and self.interrupted():
            raise Interrupted

    @contextmanager
    def timed(self, stage: str) -> Iterator[None]:
        """Adds the time of the block to a stage."""
        self.check()
        started = time.perf_counter()
        try:
            yield
        finally:
            self.timings[stage] = self.timings.get(stage, 0.0) + time.perf_counter() - started


def id_key(datablock: Any) -> tuple[str, str]:
    """Identity of a datablock across evaluations and undo: kind and full name (the library's is in it)."""
    original = getattr(datablock, "original", None) or datablock
    kind = "Light" if isinstance(original, bpy.types.Light) else original.bl_rna.identifier
    return kind, original.name_full


def column_major(matrix: Any) -> list[float]:
    """16 floats of a 4x4 matrix, column by column."""
    return [value for column in matrix.col for value in column]


def matrix_columns(matrices: list[Any]) -> NDArray[np.float32]:
    """(n, 16) of copies of 4x4 matrices, column by column."""
    return np.frombuffer(native.module().matrix_columns(matrices), dtype=np.float32).reshape(-1, 16)
