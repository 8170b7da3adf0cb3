"""IES photometric files [ANSI/IES LM-63] as a table of radiant intensity over angles."""

import math
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

F32 = NDArray[np.float32]

WATT_PER_CANDELA = 4.0 * math.pi / 177.83
"""Candela to the watts of a point lamp, for light of D65: 177.83 lumen a watt."""
TYPE_C = 1
HEADER_NUMBERS = 13
"""Numbers between TILT and the angles."""


class BadFile(ValueError):
    """What is wrong with an IES file, in one sentence."""


def ies_text(node: Any) -> str | None:
    """What the node's text or file holds; None when there is none."""
    if node.mode == "INTERNAL":
        return node.ies.as_string() if node.ies is not None else None
    path = bpy.path.abspath(node.filepath, library=getattr(node.id_data, "library", None)) if node.filepath else ""
    if not path:
        return None
    try:
        with open(path, encoding="latin-1") as file:
            return file.read()
    except OSError as error:
        raise BadFile(f"the file '{path}' cannot be read ({error.strerror})") from error


def _numbers(text: str) -> list[float]:
    """All numbers behind the TILT line; a tilt table that is included is skipped."""
    lines = text.replace("\r", "\n").split("\n")
    start = next((i for i, line in enumerate(lines) if line.strip().upper().startswith("TILT=")), None)
    if start is None:
        raise BadFile("it has no TILT line")
    words = " ".join(lines[start + 1 :]).replace(",", " ").split()
    try:
        numbers = [float(word) for word in words]
    except ValueError as error:
        raise BadFile("it holds something that is not a number") from error
    if lines[start].strip().upper().endswith("INCLUDE"):
        if len(numbers) < 2 or not 0 <= numbers[1] < len(numbers):
            raise BadFile("its tilt table is broken")
        numbers = numbers[2 + 2 * int(numbers[1]) :]
    return numbers


def parse_ies(text: str) -> F32:
    """[horizontal count, vertical count, horizontal angles, vertical angles, values by horizontal angle], angles in
    radians, horizontal ones completed to the full turn where the file leaves out what symmetry gives."""
    numbers = _numbers(text)
    if len(numbers) < HEADER_NUMBERS:
        raise BadFile("it ends before the angles")
    if not all(math.isfinite(x) for x in numbers):
        raise BadFile("it holds numbers that are not finite")
    vertical_count, horizontal_count = int(numbers[3]), int(numbers[4])
    if int(numbers[5]) != TYPE_C:
        raise BadFile("only photometry of type C is supported")
    if vertical_count < 2 or horizontal_count < 1:
        raise BadFile("it has too few angles")
    factor = numbers[2] * numbers[10] * numbers[11] * WATT_PER_CANDELA
    body = numbers[HEADER_NUMBERS:]
    if len(body) < vertical_count + horizontal_count + vertical_count * horizontal_count:
        raise BadFile("it ends before the last value")
    vertical = np.array(body[:vertical_count])
    horizontal = np.array(body[vertical_count : vertical_count + horizontal_count])
    first = vertical_count + horizontal_count
    values = np.array(body[first : first + vertical_count * horizontal_count]).reshape(horizontal_count, vertical_count)
    if (np.diff(vertical) <= 0).any() or (np.diff(horizontal) <= 0).any():
        raise BadFile("its angles do not increase")
    horizontal, values = _full_turn(horizontal, values)
    head = np.array([len(horizontal), len(vertical)], dtype=np.float64)
    angles = np.radians(np.concatenate((horizontal, vertical)))
    return np.concatenate((head, angles, (values * factor).reshape(-1))).astype(np.float32)


def _full_turn(horizontal: NDArray[np.float64], values: NDArray[np.float64]) -> tuple[Any, Any]:
    if horizontal[0] == 90.0:
        horizontal = horizontal - 90.0
    if horizontal[0] != 0.0:
        raise BadFile("its horizontal angles do not begin at 0 or 90 degrees")
    if len(horizontal) == 1:
        return np.array([0.0, 360.0]), np.concatenate((values, values))
    for half in (90.0, 180.0):
        if horizontal[-1] == half:
            horizontal = np.concatenate((horizontal, 2.0 * half - horizontal[-2::-1]))
            values = np.concatenate((values, values[-2::-1]))
    # Some files leave out the last angle, which is the first one again.
    if 180.0 < horizontal[-1] < 360.0:
        horizontal = np.append(horizontal, 360.0)
        values = np.concatenate((values, values[:1]))
    return horizontal, values
