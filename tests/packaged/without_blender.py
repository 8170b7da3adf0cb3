"""The native module by itself: a quad shows a picture of each format that the bundle has to read.

    PYTHONPATH=WHEEL_UNPACKED python without_blender.py        on a system that has Python and numpy, and nothing else

Also a step of session.py. pictures/ holds 32 x 32 pixels in four flat quarters, written by Blender 5.0 (the EXR file is
packed by oiiotool; the animated WebP has a second picture, turned and darker, put behind the first by hand).
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np

PICTURES = Path(__file__).parent / "pictures"
FORMATS = ("png", "jpg", "exr", "hdr", "tif", "tga", "bmp", "webp", "animated.webp", "jp2")
# Bottom row first. 0.8, 0.6 ... are whole bytes too; what packs with loss may miss by two or three of them.
QUARTERS = np.array([[(0.8, 0.2, 0.2), (0.2, 0.6, 0.2)], [(0.2, 0.2, 1.0), (0.6, 0.6, 0.4)]], np.float32)
EXACT, LOSSY = 0.5 / 255, 3.5 / 255
TOLERANCES = {"jpg": LOSSY, "webp": LOSSY, "animated.webp": LOSSY, "jp2": LOSSY, "hdr": LOSSY}
SIZE = 8
Input = tuple[str, str, Any, bool, int, str]


def quad() -> dict[str, Any]:
    """From (-1, -1) to (1, 1), with a UV map over all of it."""
    uv = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], np.float32)
    return {
        "positions": np.ascontiguousarray(np.pad(2 * uv - 1, ((0, 0), (0, 1)))),
        "corner_vertices": np.arange(4, dtype=np.uint32),
        "triangle_corners": np.array([(0, 1, 2), (0, 2, 3)], np.uint32),
        "triangle_faces": np.zeros(2, np.uint32),
        "face_smooth": np.zeros(1, np.uint8),
        "attributes": [("UVMap", "CORNER", False, uv)],
        "active_uv": "UVMap",
    }


def node(kind: str, outputs: list[tuple[str, str, Any]], inputs: list[Input], **properties: Any) -> dict[str, Any]:
    return {"type": kind, "name": kind, "properties": properties, "inputs": inputs, "outputs": outputs}


def glowing_picture(image: int) -> dict[str, Any]:
    """Emission of an Image Texture."""
    texture = {"image": image, "interpolation": "Closest", "extension": "REPEAT", "projection": "FLAT"}
    colour = ("Color", "COLOR", (0.0, 0.0, 0.0, 1.0), False, 2, "Color")
    nodes = [
        node(
            "ShaderNodeOutputMaterial",
            [],
            [("Surface", "SHADER", 0.0, False, 1, "Emission")],
            target="ALL",
            is_active_output=1.0,
        ),
        node(
            "ShaderNodeEmission",
            [("Emission", "SHADER", 0.0)],
            [colour, ("Strength", "FLOAT", 1.0, False, -1, "")],
        ),
        node(
            "ShaderNodeTexImage",
            [("Color", "COLOR", (0.0, 0.0, 0.0, 1.0)), ("Alpha", "FLOAT", 0.0)],
            [("Vector", "VECTOR", (0.0, 0.0, 0.0), False, -1, "")],
            **texture,
        ),
    ]
    return {"nodes": nodes, "output_node": 0}


def render(module: Any, path: Path) -> tuple[np.ndarray, list[str]]:
    """What a camera right above sees, bottom row first, and the session's complaints."""
    session = module.Session()
    session.set_settings({"width": SIZE, "height": SIZE, "samples": 16, "filter": "box", "filter_width": 1.0})
    above = np.eye(4, dtype=np.float32)
    above[2, 3] = 2.0
    view = (-1.0, 1.0, -1.0, 1.0)
    session.set_camera({"type": "orthographic", "to_world": above.T.ravel(), "view": view})
    image = session.add_image({"name": path.name, "path": str(path), "colorspace": "Non-Color"})
    shader = session.add_shader("Picture", glowing_picture(image), {})
    placed = {
        "mesh": np.array([session.add_mesh("Quad", quad())], np.int32),
        "matrix": np.eye(4, dtype=np.float32).reshape(1, 16),
        "material_set": np.zeros(1, np.int32),
        "material_sets": [[shader]],
    }
    session.set_objects(placed)
    session.set_passes(["combined"])
    session.start()
    while not session.wait(1000):
        pass
    complaints = [f"{text} ({where})" for level, text, where, _ in session.report() if level != "info"]
    complaints += [session.error()] if session.error() else []
    pixels = session.read_pass("combined")
    return (np.zeros((SIZE, SIZE, 4)) if pixels is None else pixels.reshape(SIZE, SIZE, 4)), complaints


def problems(module: Any) -> list[str]:
    """Sentences; none when every format is read as it should be."""
    found = []
    for ending in FORMATS:
        pixels, complaints = render(module, PICTURES / f"quadrants.{ending}")
        found += [f"{ending}: {text}" for text in complaints]
        half = SIZE // 2
        for row, column in np.ndindex(2, 2):
            # Away from the edges, where packing with loss mixes the quarters.
            inside = pixels[row * half + 1 : (row + 1) * half - 1, column * half + 1 : (column + 1) * half - 1, :3]
            worst = float(np.abs(inside - QUARTERS[row, column]).max())
            if worst > TOLERANCES.get(ending, EXACT):
                found.append(f"{ending}: quarter {row}, {column} is {inside[0, 0]}, not {QUARTERS[row, column]}")
    return found


def main() -> int:
    from talbot_native import _talbot

    _talbot.check()
    found = problems(_talbot)
    python = f"{sys.version_info.major}.{sys.version_info.minor}"
    print(f"Python {python}, Embree {_talbot.embree_version}, {_talbot.chosen_instruction_set()}:", end=" ")
    print("\n  ".join(["wrong", *found]) if found else f"{len(FORMATS)} formats rendered as they should be")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
