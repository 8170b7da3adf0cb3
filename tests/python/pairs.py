"""The same scene rendered by Cycles and by Talbot, and the statistics that decide whether the pictures agree.

A picture is rendered with several seeds by each engine. Its means over the whole and over cells of a grid are compared,
channel by channel and pass by pass:

* Welch's t-test: is there a difference beyond the noise? One in a thousand runs of *all* pairs together may fail by
  chance (Sidak over FAMILY_TESTS). Differences below ALLOWANCE, where the tables and polynomials of both engines end,
  do not count.
* Equivalence (two one-sided t-tests at EQUIVALENCE_ALPHA): the noise must be small enough to show that the difference
  is below the bound. A pair with too few samples fails instead of passing.

Seeds are fixed and both engines are deterministic, so a result does not change from run to run.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

FAMILY_ALPHA = 1e-3
FAMILY_TESTS = 40_000
"""At least the number of t-tests of all pairs in one Blender; counted while they run."""
TEST_ALPHA = 1.0 - (1.0 - FAMILY_ALPHA) ** (1.0 / FAMILY_TESTS)
EQUIVALENCE_ALPHA = 1e-3
ALLOWANCE = 1e-3
"""Relative difference that is the engines' own rounding: float32 coordinates, albedo tables."""
DARK = 0.25
"""Cells darker than this share of the picture's mean are judged by that share of it."""
FAR = 100.0
"""Depth passes say 1e10 where there is nothing."""

Array = NDArray[np.float64]

_tests_made = 0


@dataclass(frozen=True)
class Bounds:
    """What a pair promises: largest relative differences of means.

    `systematic` is a difference that is known and does not count; the test that asks for more than ALLOWANCE says why.
    """

    whole: float = 0.005
    cell: float = 0.04
    systematic: float = ALLOWANCE


def student_p(t: Array, dof: Array) -> Array:
    """P(|T| > t), by the finite series for even degrees of freedom; odd and broken ones are rounded down."""
    even = np.maximum(2, 2 * (np.asarray(dof) // 2)).astype(int)
    angle = np.arctan(np.asarray(t) / np.sqrt(even))
    term, total = np.ones_like(angle), np.zeros_like(angle)
    for k in range(int(even.max()) // 2):
        total += np.where(2 * k < even, term, 0.0)
        term = term * (2 * k + 1) / (2 * k + 2) * np.cos(angle) ** 2
    return np.maximum(0.0, 1.0 - np.sin(angle) * total)


@dataclass(frozen=True)
class Comparison:
    """Means of both engines, and the p-values: `different` small: they differ; `equivalent` small: they agree."""

    cycles: Array
    talbot: Array
    error: Array
    scale: Array
    different: Array
    equivalent: Array


def compare(cycles: Array, talbot: Array, floor: Array, bound: float, systematic: float) -> Comparison:
    """Batches in the first axis. `floor` is the least value that relative differences refer to."""
    count = len(cycles), len(talbot)
    means = cycles.mean(0), talbot.mean(0)
    variances = cycles.var(0, ddof=1) / count[0], talbot.var(0, ddof=1) / count[1]
    scale = np.maximum(np.maximum(np.abs(means[0]), np.abs(means[1])), np.maximum(floor, 1e-9))
    total = variances[0] + variances[1] + (1e-7 * scale) ** 2
    # Satterthwaite
    share = [v**2 / (n - 1) for v, n in zip(variances, count, strict=True)]
    dof = total**2 / np.maximum(share[0] + share[1], 1e-300)
    dof = np.clip(dof, min(count) - 1, sum(count) - 2)
    error = np.sqrt(total)
    difference = np.abs(means[0] - means[1])
    different = student_p(np.maximum(0.0, difference - systematic * scale) / error, dof)
    room = bound * scale - difference
    equivalent = np.where(room > 0, student_p(np.maximum(room, 0.0) / error, dof) / 2, 1.0)
    return Comparison(means[0], means[1], error, scale, different, equivalent)


def read_exr(path: Path) -> dict[str, NDArray[np.float32]]:
    """Channels of an uncompressed scanline file of floats, rows from the bottom, by "Pass.Channel"."""
    data = path.read_bytes()
    position = 8
    channels: list[str] = []
    window = (0, 0, 0, 0)
    while data[position] != 0:
        name, kind = (part.decode() for part in data[position:].split(b"\0", 2)[:2])
        position += len(name) + len(kind) + 2
        size = struct.unpack_from("<i", data, position)[0]
        value = data[position + 4 : position + 4 + size]
        position += 4 + size
        if name == "channels":
            while value[0] != 0:
                channel = value.split(b"\0", 1)[0]
                assert struct.unpack_from("<i", value, len(channel) + 1)[0] == 2, "32-bit float"
                channels.append(channel.decode())
                value = value[len(channel) + 17 :]
        elif name == "compression":
            assert value == b"\0"
        elif name == "dataWindow":
            window = struct.unpack("<4i", value)
    width, height = window[2] - window[0] + 1, window[3] - window[1] + 1
    lines = np.empty((height, len(channels), width), np.float32)
    start = position + 1
    for row, offset in enumerate(np.frombuffer(data, "<u8", height, start)):
        lines[row] = np.frombuffer(data, "<f4", len(channels) * width, int(offset) + 8).reshape(len(channels), width)
    # "Layer.Pass.Channel"
    return {name.split(".", 1)[1]: lines[::-1, index] for index, name in enumerate(channels)}


def render(scene: bpy.types.Scene, engine: str, seed: int, path: Path) -> dict[str, NDArray[np.float32]]:
    """One picture of every pass that is switched on, linear."""
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "MULTI_LAYER_IMAGE"
    settings.file_format = "OPEN_EXR_MULTILAYER"
    settings.color_depth, settings.exr_codec = "32", "NONE"
    if hasattr(settings, "use_exr_interleave"):
        settings.use_exr_interleave = True
    scene.render.engine = engine
    scene.render.filepath = str(path)
    scene.render.use_file_extension = False
    scene.cycles.seed = seed
    bpy.ops.render.render(write_still=True)
    return read_exr(path)


def stacked(channels: dict[str, NDArray[np.float32]], name: str) -> Array:
    """One pass as (height, width, channels)."""
    found = [values for key, values in channels.items() if key.rpartition(".")[0] == name]
    assert found, f"no {name} in {sorted(channels)}"
    values = np.stack(found, -1).astype(np.float64)
    return np.minimum(values, FAR) if name == "Depth" else values


def cell_means(picture: Array, cells: int) -> Array:
    """Means over a grid of cells x cells: (cells, cells, channels), the first row at the bottom."""
    height, width, _ = picture.shape
    rows, columns = np.arange(cells) * height // cells, np.arange(cells) * width // cells
    sums = np.add.reduceat(np.add.reduceat(picture, rows, 0), columns, 1)
    return sums / np.outer(np.diff([*rows, height]), np.diff([*columns, width]))[..., None]


def describe(result: Comparison, bad: NDArray[np.bool_], name: str, bound: float) -> list[str]:
    """The worst cells of a pass."""
    out = []
    order = np.argsort(-np.abs(result.cycles - result.talbot) / result.scale, axis=None)
    for flat in [index for index in order if bad.flat[index]][:8]:
        where = np.unravel_index(flat, bad.shape)
        cycles, talbot, error = result.cycles[where], result.talbot[where], result.error[where]
        verdict = "DIFFERENT" if result.different[where] < TEST_ALPHA else "not shown to be equal"
        place = "whole" if len(where) == 1 else f"row {where[0]} column {where[1]}"
        relative, noise = (talbot - cycles) / result.scale[where], error / result.scale[where]
        out.append(
            f"{name}, {place}, channel {where[-1]}: Cycles {cycles:.6g}, Talbot {talbot:.6g} "
            f"({relative:+.2%} +- {noise:.2%}, bound {bound:.1%}): {verdict}"
        )
    more = int(bad.sum()) - len(out)
    return [*out, f"{name}: and {more} more"] if more > 0 else out


def judge(cycles: Array, talbot: Array, name: str, cells: int, bounds: Bounds) -> list[str]:
    """What is wrong with one pass, given its batches (batch, height, width, channels)."""
    global _tests_made
    problems = []
    tiles = [np.stack([cell_means(picture, cells) for picture in batch]) for batch in (cycles, talbot)]
    means = [batch.mean((1, 2)) for batch in (cycles, talbot)]
    floor = DARK * np.maximum(np.abs(tiles[0]).mean((0, 1, 2)), np.abs(tiles[1]).mean((0, 1, 2)))
    for pair, bound in ((means, bounds.whole), (tiles, bounds.cell)):
        result = compare(pair[0], pair[1], floor, bound, bounds.systematic)
        _tests_made += result.different.size
        bad = (result.different < TEST_ALPHA) | (result.equivalent > EQUIVALENCE_ALPHA)
        problems += describe(result, bad, name, bound)
    return problems


def agree(
    scene: bpy.types.Scene,
    path: Path,
    *,
    samples: int = 32,
    batches: int = 16,
    cells: int = 4,
    bounds: Bounds | None = None,
    passes: Sequence[str] = ("Combined",),
) -> None:
    """Fails with the worst differences when the two engines' pictures of the scene do not agree."""
    scene.cycles.samples = samples
    pictures: dict[str, list[dict[str, NDArray[np.float32]]]] = {}
    for engine in ("CYCLES", "TALBOT"):
        pictures[engine] = [render(scene, engine, seed, path / "pair.exr") for seed in range(batches)]
    problems = []
    for name in passes:
        both = [np.stack([stacked(picture, name) for picture in pictures[e]]) for e in ("CYCLES", "TALBOT")]
        for values, engine in zip(both, ("Cycles", "Talbot"), strict=True):
            assert np.isfinite(values).all(), f"{name} of {engine} is not finite"
        assert np.abs(both[0]).max() > 0, f"{name} of Cycles is black: the test says nothing"
        problems += judge(both[0], both[1], name, cells, bounds or Bounds())
    assert _tests_made <= FAMILY_TESTS, "more tests than the family's false-alarm rate was made for"
    assert not problems, "\n".join(problems)
