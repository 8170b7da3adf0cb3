"""Repeat zones, closures, bundles, menu switches, constants of newer Blenders: Cycles and Talbot show the same."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from inlined_graphs import GRAPHS, NotHere
from pair_scenes import add_plane, grid, look_down, material
from pairs import render, stacked

PIXELS, ACROSS = 8, 8


def pictures(scene: Any, path: Path) -> list[Any]:
    """One sample in the middle of each pixel, by both engines."""
    look_down(scene, ACROSS)
    scene.render.resolution_x = scene.render.resolution_y = PIXELS * ACROSS
    scene.cycles.filter_width, scene.cycles.samples = 0.01, 1
    return [stacked(render(scene, engine, 0, path / "one.exr"), "Combined") for engine in ("CYCLES", "TALBOT")]


def compare(pair: list[Any], places: dict[str, Any]) -> list[str]:
    """Which planes differ in the middle."""
    bad = []
    for name, place in places.items():
        x, y = (int((place[axis] + ACROSS / 2) * PIXELS) for axis in (0, 1))
        cells = [picture[y - 2 : y + 2, x - 2 : x + 2] for picture in pair]
        difference = np.abs(cells[0] - cells[1]) / np.maximum(np.abs(cells[0]), 1.0)
        # Cycles interpolates colours of bytes less precisely.
        if not difference.max() < (5e-4 if name.endswith("bytes") else 1e-4):
            bad.append(f"{name}: Cycles {cells[0][2, 2]}, Talbot {cells[1][2, 2]}")
    return bad


def test_inlined_graphs(pair_scene: Any, tmp_path: Path) -> None:
    if not hasattr(bpy.types.Material, "inline_shader_nodes"):
        pytest.skip("this Blender has no inliner")
    pair_scene.frame_set(7)
    places = {}
    for (name, build), place in zip(GRAPHS.items(), grid(len(GRAPHS), ACROSS), strict=True):
        try:
            item = material(build, name)
        except NotHere:
            continue
        places[name] = place
        add_plane(item, 0.95, location=place)
    assert len(places) > 20
    assert not compare(pictures(pair_scene, tmp_path), places)


def sample_floor(tree: Any, kind: str, attribute: str) -> Any:
    """What a ray that begins below the plane reads of the floor."""
    node = tree("Raycast", Length=10.0)
    below = tree("VectorMath", in0=tree("NewGeometry").outputs["Position"], in1=(0.01, 0.02, -0.5))
    tree.set(node.inputs["Position"], below.outputs[0])
    tree.set(node.inputs["Direction"], tree("CombineXYZ", Z=-1.0))
    node.sample_attribute_items.new(kind, "read")
    node.inputs["read"].default_value = attribute
    return node.outputs["read"]


FLOOR = {
    "number": ("FLOAT", "POINT", "value", (0.1, 0.4, 0.7, 1.3)),
    "whole": ("INT", "POINT", "value", (1, 4, 7, 13)),
    "face": ("FLOAT", "FACE", "value", (0.37,)),
    "corner": ("FLOAT", "CORNER", "value", (0.1, 0.4, 0.7, 1.3)),
    "vector": ("FLOAT_VECTOR", "POINT", "vector", ((1, 2, 3), (0, 1, 0), (-1, 0, 2), (1, 1, 1))),
    "tint": ("FLOAT_COLOR", "POINT", "color", ((1, 0, 0, 1), (0, 1, 0, 0.5), (0, 0, 1, 1), (1, 1, 1, 0))),
    "bytes": ("BYTE_COLOR", "CORNER", "color", ((1, 0, 0, 1), (0, 1, 0, 0.5), (0, 0, 1, 1), (1, 1, 1, 0))),
}


def read_all(tree: Any) -> Any:
    """Cycles has attributes only where the surface's own material reads them."""
    total = None
    for name in FLOOR:
        color = tree("Attribute", attribute_name=name).outputs["Color"]
        total = color if total is None else tree("MixRGB", in0=0.5, in1=total, in2=color).outputs[0]
    return total


def test_attributes_where_a_ray_ends(pair_scene: Any, tmp_path: Path) -> None:
    if not hasattr(bpy.types, "ShaderNodeRaycast"):
        pytest.skip("this Blender has no Raycast node")
    cases = [(kind, name) for kind in ("FLOAT", "VECTOR", "RGBA") for name in (*FLOOR, "UVMap", "missing", "")]
    places = {}
    for (kind, name), place in zip(cases, grid(len(cases), ACROSS), strict=True):
        item = material(lambda tree, kind=kind, name=name: sample_floor(tree, kind, name))
        places[f"{kind} of {name}"] = place
        add_plane(item, 0.95, location=place)
    floor = add_plane(material(read_all), 10.0, location=(0.0, 0.0, -3.0)).data
    for name, (kind, domain, field, values) in FLOOR.items():
        data = floor.attributes.new(name, kind, domain).data
        for element, value in zip(data, values, strict=True):
            setattr(element, field, value)
    assert not compare(pictures(pair_scene, tmp_path), places)
