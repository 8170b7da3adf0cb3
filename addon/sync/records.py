"""What a pass over the objects finds, and as what it is sent."""

import hashlib
from dataclasses import dataclass, field
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .linking import Resolved, Subject, linking_arrays
from .strands import HairSource
from .subdivision import Dicing

IS_INSTANCE, IS_HOLDOUT, IS_SHADOW_CATCHER = 1, 2, 4


@dataclass
class Record:
    """What all instances of one (object, data, parent) share."""

    mesh: Any
    mesh_name: str
    owners: set[tuple[str, str]]
    name: int
    material_set: int
    visibility: int
    pass_index: int
    color: tuple[float, ...]
    flags: int
    shading_offset: float
    geometry_offset: float
    holders: tuple[Any, ...]
    subject: Subject
    light_group: int = -1
    attribute_set: int = -1
    hair: HairSource | None = None
    """Strands that grow on `mesh`, instead of the mesh itself."""
    dicing: Dicing | None = None

    def key(self) -> tuple[int, int]:
        """What this geometry is, among all of a pass."""
        if self.hair is None:
            return (self.mesh.as_pointer(), -1)
        return (self.hair.owner.original.as_pointer(), self.hair.index)


class Runs:
    """What each row of the depsgraph's instances shows: neighbours that show the same cost one entry together."""

    def __init__(self) -> None:
        self._starts: list[int] = []
        self._shown: list[tuple[int, ...]] = []

    def begin(self, row: int, shown: tuple[int, ...]) -> None:
        """From this row on, until the next beginning: these records."""
        self._starts.append(row)
        self._shown.append(shown)

    def expand(self, rows: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Of each thing shown by so many rows: its row, and its record."""
        lengths = np.diff(np.array([*self._starts, rows], np.int64))
        sizes = np.array([len(shown) for shown in self._shown], np.int64)
        records = np.array(list(chain.from_iterable(self._shown)), np.int64)
        per_row = np.repeat(sizes, lengths)
        row = np.repeat(np.arange(rows), per_row)
        # A row's records lie in `records` from where its run's do.
        skipped = np.repeat(np.cumsum(sizes) - sizes, lengths) - (np.cumsum(per_row) - per_row)
        return row, records[np.arange(len(row)) + np.repeat(skipped, per_row)]


@dataclass
class Gathered:
    """The result of the pass. `mesh`, `holders` and `hair` of the records are Blender's: for the same callback only."""

    records: list[Record] = field(default_factory=list)
    rows: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    """Of the instances that are shown; for each of them its record and its random number."""
    which: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    lights: list[dict[str, Any]] = field(default_factory=list)
    linked: Resolved | None = None
    names: list[str] = field(default_factory=list)
    material_sets: list[list[int]] = field(default_factory=list)
    attribute_sets: list[list[tuple[str, tuple[float, ...]]]] = field(default_factory=list)
    matrices: NDArray[np.float32] = field(default_factory=lambda: np.zeros((0, 16), np.float32))
    random: NDArray[np.uint32] = field(default_factory=lambda: np.zeros(0, np.uint32))
    dupli: tuple[NDArray[np.float32], NDArray[np.float32]] | None = None


def object_arrays(gathered: Gathered, mesh_handles: list[int]) -> dict[str, Any]:
    """The dictionary for `Session.set_objects`. `mesh_handles` by record."""
    records = gathered.records
    rows = gathered.rows

    def column(values: list[Any], dtype: Any, columns: int = 1) -> Any:
        return np.array(values, dtype=dtype).reshape((len(records), columns) if columns > 1 else len(records))

    arrays: dict[str, Any] = {
        "matrix": np.ascontiguousarray(gathered.matrices[rows]),
        "traits": gathered.which.astype(np.int32),
        "random": gathered.random,
        "mesh": column(mesh_handles, np.int32),
        "name": column([r.name for r in records], np.int32),
        "names": gathered.names,
        "material_set": column([r.material_set for r in records], np.int32),
        "material_sets": gathered.material_sets,
        "visibility": column([r.visibility for r in records], np.uint32),
        "pass_index": column([r.pass_index for r in records], np.int32),
        "color": column([r.color for r in records], np.float32, 4),
        "flags": column([r.flags for r in records], np.uint32),
        "shading_offset": column([r.shading_offset for r in records], np.float32),
        "geometry_offset": column([r.geometry_offset for r in records], np.float32),
        "light_group": column([r.light_group for r in records], np.int32),
        "attribute_set": column([r.attribute_set for r in records], np.int32),
        "attribute_sets": gathered.attribute_sets,
    }
    if gathered.linked is not None:
        arrays |= linking_arrays(gathered.linked, [r.subject for r in records])
    if gathered.dupli is not None:
        arrays["dupli_generated"] = np.ascontiguousarray(gathered.dupli[0][rows])
        arrays["dupli_uv"] = np.ascontiguousarray(gathered.dupli[1][rows])
    return arrays


def fingerprint(arrays: dict[str, Any]) -> dict[str, Any]:
    """What is kept of the arrays to compare later ones with: of a million instances not a million rows."""
    out = {}
    for name, values in arrays.items():
        if isinstance(values, np.ndarray):
            out[name] = (values.shape, hashlib.blake2b(values, digest_size=16).digest())
        else:
            out[name] = values
    return out
