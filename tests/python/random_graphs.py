"""Random node graphs: any nodes, any properties, any links, shown as light on a small plane each.

More of them, by hand (seeds from 1000 to 3000, 256 in a picture; says which seeds differ, and how much):

    ./talbot blender --python tests/python/random_graphs.py -b -- 1000 3000
"""

from __future__ import annotations

import random
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).parent))

from pair_scenes import add_plane, first_output, grid, look_down, material
from pairs import render, stacked

PIXELS = 8
"""Width of a plane in the picture."""
ACROSS = 16
TOLERANCE = 0.01
FLOOR = 1e-3
"""Differences are relative to the value; below this share of the graph's largest value, or of 1, to that."""

SOURCES = ("TexCoord", "NewGeometry", "UVMap", "Value", "RGB", "CameraData", "ObjectInfo", "Fresnel", "LayerWeight")
FUNCTIONS = (
    *("TexNoise", "TexVoronoi", "TexWave", "TexMagic", "TexBrick", "TexChecker", "TexGradient", "TexWhiteNoise"),
    *("TexMusgrave", "TexGabor", "RadialTiling", "Math", "Math", "Math", "VectorMath", "VectorMath", "MixRGB", "Mix"),
    *("MapRange", "Clamp", "ValToRGB", "RGBCurve", "VectorCurve", "FloatCurve", "HueSaturation", "BrightContrast"),
    *("Gamma", "Invert", "RGBToBW", "SeparateColor", "CombineColor", "SeparateXYZ", "CombineXYZ", "Mapping"),
    *("SeparateHSV", "CombineHSV", "SeparateRGB", "CombineRGB", "VectorRotate", "VectorTransform", "Normal"),
    *("Blackbody", "Wavelength", "NormalMap", "Tangent", "LightPath", "Fresnel", "LayerWeight"),
)
LEFT_ALONE = {"bl_idname", "color_tag", "warning_propagation", "gradient_interpolation"}
UNSTEADY = {"ShaderNodeTexWhiteNoise"}
"""One bit more or less in what goes in, and something else comes out: they read constants only."""
RANGES = {
    "Detail": (0.0, 6.0),
    "Lacunarity": (0.5, 4.0),
    "Sides": (2.1, 8.0),
    "Smoothness": (0.1, 1.0),
    "Exponent": (0.3, 4.0),
    "Brick Width": (0.2, 2.0),
    "Row Height": (0.2, 2.0),
    "Mortar Size": (0.0, 0.1),
    "Orientation": (0.1, 1.0),
}
"""Not linked: beyond these Cycles has NaN, or what the last bit makes of a division by nearly zero."""
LEFT_OUT_OUTPUTS = {"Pointiness", "Random Per Island", "Random", "Ray Length", "Ray Depth", "Parametric", "Tangent"}


@dataclass(frozen=True)
class Difference:
    """Of one graph: 95th percentile of the relative difference where Cycles has a number, and whether Talbot always has
    one. Cycles normalises vectors of zero, or takes the sine of infinity, and shows what comes out as black."""

    seed: int
    worst: float
    finite: bool


def random_value(rng: random.Random, socket: Any) -> Any:
    """Within what the slider offers, or near zero."""
    values = socket.bl_rna.properties["default_value"]
    if socket.name in RANGES:
        one = [rng.uniform(*RANGES[socket.name]) for _ in range(3)]
        return one if socket.type == "VECTOR" else one[0]
    if socket.type in ("VALUE", "INT"):
        low, high = max(values.soft_min, -3.0), min(values.soft_max, 6.0)
        return (
            rng.uniform(low, max(high, low)) if socket.type == "VALUE" else rng.randint(int(low), int(max(high, low)))
        )
    if socket.type == "BOOLEAN":
        return rng.random() < 0.5
    size = len(socket.default_value)
    if socket.type == "RGBA":
        return [*(rng.uniform(0, 1) for _ in range(3)), 1.0][:size]
    return [rng.uniform(-2, 2) for _ in range(size)]


def random_properties(rng: random.Random, node: Any) -> None:
    own = [p for p in node.bl_rna.properties if p.identifier not in bpy.types.ShaderNode.bl_rna.properties]
    for item in own:
        if item.is_readonly or item.identifier in LEFT_ALONE:
            continue
        if item.type == "ENUM" and not item.is_enum_flag:
            try:
                setattr(node, item.identifier, rng.choice([choice.identifier for choice in item.enum_items]))
            except TypeError:  # not offered in this state of the node
                continue
        elif item.type == "BOOLEAN" and not item.is_array:
            setattr(node, item.identifier, rng.random() < 0.5)
        elif item.type == "INT" and not item.is_array:
            setattr(node, item.identifier, rng.randint(max(item.hard_min, 0), min(item.hard_max, 6)))
        elif item.type == "FLOAT" and not item.is_array:
            setattr(node, item.identifier, rng.uniform(max(item.hard_min, 0), min(item.hard_max, 2)))
    if hasattr(node, "color_ramp"):
        for _ in range(rng.randint(0, 3)):
            node.color_ramp.elements.new(rng.random()).color = [rng.random() for _ in range(4)]
        node.color_ramp.interpolation = rng.choice(("LINEAR", "CONSTANT", "EASE", "B_SPLINE", "CARDINAL"))
    if hasattr(node, "mapping") and hasattr(node.mapping, "curves"):
        for curve in node.mapping.curves:
            curve.points.new(rng.uniform(0.2, 0.8), rng.uniform(-0.5, 1.0))
        node.mapping.extend = rng.choice(("HORIZONTAL", "EXTRAPOLATED"))
        node.mapping.update()


def random_graph(rng: random.Random, tree: Any) -> Any:
    """Adds 2 to 40 nodes; returns the output to be shown."""
    outputs: list[Any] = []
    count = rng.choice((2, 3, 4, 5, 6, 8, 10, 14, 20, 30, 40))
    made = 0
    while made < count:
        kind = "ShaderNode" + rng.choice(SOURCES if made < max(1, count // 6) else FUNCTIONS)
        if not hasattr(bpy.types, kind):
            continue
        node = tree.tree.nodes.new(kind)
        made += 1
        random_properties(rng, node)
        for socket in node.inputs:
            if not socket.enabled or not hasattr(socket, "default_value") or socket.type == "STRING":
                continue
            linked = outputs and kind not in UNSTEADY and socket.name not in RANGES and rng.random() < 0.6
            if linked or socket.hide_value:
                if outputs and kind not in UNSTEADY:
                    tree.tree.links.new(rng.choice(outputs[-12:]), socket)
            elif socket.type in ("VALUE", "INT", "BOOLEAN", "VECTOR", "RGBA"):
                socket.default_value = random_value(rng, socket)
        for socket in node.outputs:
            if not socket.enabled or socket.name in LEFT_OUT_OUTPUTS:
                continue
            if kind in ("ShaderNodeValue", "ShaderNodeRGB", "ShaderNodeNormal") and socket is node.outputs[0]:
                socket.default_value = random_value(rng, socket)
            if socket.type != "SHADER":
                outputs.append(socket)
    return outputs[-1] if outputs else first_output(tree("Value"))


def one_more(tree: Any, socket: Any) -> Any:
    """The output plus one: what is black both with and without is not a number."""
    return first_output(tree("VectorMath", operation="ADD", in0=socket, in1=1.0))


def show_graphs(scene: Any, seeds: list[int], shown: Callable[[Any, Any], Any]) -> None:
    """An atlas of one plane for each seed, with what `shown` makes of its tree's output."""
    look_down(scene, ACROSS)
    scene.render.resolution_x = scene.render.resolution_y = PIXELS * ACROSS
    scene.cycles.filter_width = 0.01
    for seed, place in zip(seeds, grid(len(seeds), ACROSS), strict=True):
        rng = random.Random(seed)
        item = material(lambda tree, rng=rng: shown(tree, random_graph(rng, tree)), name=f"Graph {seed}")
        obj = add_plane(item, size=0.95, location=place)
        # Seen at an angle, and from the other side now and then.
        obj.rotation_euler = (rng.uniform(-0.6, 0.6), rng.uniform(-0.6, 0.6) + (3.14 if rng.random() < 0.2 else 0), 0.3)


def differences(scene: Any, seeds: list[int], path: Path) -> Iterator[Difference]:
    """One sample in the middle of each pixel, in both engines."""

    def picture(engine: str, shown: Callable[[Any, Any], Any]) -> NDArray[np.float32]:
        for obj in list(scene.collection.objects):
            scene.collection.objects.unlink(obj)
        show_graphs(scene, seeds, shown)
        return stacked(render(scene, engine, 0, path / "graphs.exr"), "Combined")

    scene.cycles.samples = 1
    pictures = [picture(engine, lambda _, socket: socket) for engine in ("CYCLES", "TALBOT")]
    numbers = (pictures[0] != 0) | (picture("CYCLES", one_more) != 0)
    inside = slice(2, PIXELS - 2)
    for index, seed in enumerate(seeds):
        row, column = divmod(index, ACROSS)
        theirs, ours, known = (
            p[row * PIXELS : (row + 1) * PIXELS, column * PIXELS : (column + 1) * PIXELS][inside, inside, :]
            for p in (*pictures, numbers)
        )
        largest = max(1.0, float(np.abs(theirs).max()))
        relative = (np.abs(theirs - ours) / np.maximum(np.abs(theirs), FLOOR * largest))[known]
        worst = float(np.percentile(np.nan_to_num(relative, nan=np.inf), 95)) if relative.size else 0.0
        yield Difference(seed, worst, bool(np.isfinite(ours).all()))


def empty_scene() -> Any:
    """The scene that both engines get: no noise, nothing but what the graphs show."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    scene.render.resolution_percentage = 100
    scene.cycles.use_denoising = scene.cycles.use_adaptive_sampling = False
    return scene


def main(first: int, last: int) -> None:
    with tempfile.TemporaryDirectory() as folder:
        bad = total = 0
        for start in range(first, last, ACROSS**2):
            seeds = list(range(start, min(start + ACROSS**2, last)))
            for result in differences(empty_scene(), seeds, Path(folder)):
                total += 1
                if result.worst > TOLERANCE or not result.finite:
                    bad += 1
                    print(
                        f"seed {result.seed}: {result.worst:.3g}{'' if result.finite else ', not finite'}", flush=True
                    )
    print(f"{bad} of {total} graphs differ by more than {TOLERANCE:.0%}")


if __name__ == "__main__":
    arguments = sys.argv[sys.argv.index("--") + 1 :]
    main(int(arguments[0]), int(arguments[1]))
