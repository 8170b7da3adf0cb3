"""Node probes: a small tile each, whose emission is one node's output for constant inputs, rendered with one sample.

The same recipe renders in Cycles, where the golden numbers come from, and in Talbot (probe_scene.py). Names are
`family/variant/vector`; what this Blender does not have is skipped when it is built.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator
from typing import Any

import bpy

Build = Callable[[Any], Any]
Probe = tuple[str, Build]

VECTORS = {"a": (0.37, 0.61, 0.23), "b": (-1.7, 2.3, 5.1), "c": (13.9, -8.4, 0.05)}
GABOR_ORIENTATIONS = {"2D": 2.1, "3D": (0.4, -1.1, 0.7)}


def number(tree: Any, value: float) -> Any:
    """A constant that nobody can fold: Blender's inliner and Cycles evaluate what depends on constants alone, and the
    node itself would never run."""
    zero = tree.nodes.new("ShaderNodeAttribute")
    zero.attribute_name = "nowhere"
    node = tree.nodes.new("ShaderNodeMath")
    tree.links.new(zero.outputs["Fac"], node.inputs[0])
    node.inputs[1].default_value = value
    return node.outputs[0]


def vector(tree: Any, value: tuple[float, ...]) -> Any:
    node = tree.nodes.new("ShaderNodeCombineXYZ")
    for socket, x in zip(node.inputs, value, strict=True):
        tree.links.new(number(tree, x), socket)
    return node.outputs[0]


def color(tree: Any, value: tuple[float, ...]) -> Any:
    node = tree.nodes.new("ShaderNodeCombineColor")
    for socket, x in zip(node.inputs, value, strict=True):
        tree.links.new(number(tree, x), socket)
    return node.outputs[0]


def input_of(node: Any, name: str) -> Any:
    return next(s for s in node.inputs if name in (s.identifier, s.name))


def output_of(node: Any, name: str | int) -> Any:
    if isinstance(name, int):
        return node.outputs[name]
    enabled = [s for s in node.outputs if s.enabled]
    return next((s for s in enabled if s.identifier == name), None) or next(s for s in enabled if s.name == name)


def node(
    kind: str,
    inputs: dict[str, Any] | None = None,
    output: str | int = 0,
    at: tuple[float, ...] | None = None,
    **properties: Any,
) -> Build:
    """Builder of one node: inputs by name (a tuple of floats for a vector, a builder of a socket for a link)."""

    def build(tree: Any) -> Any:
        made = tree.nodes.new(kind)
        for key, value in properties.items():
            setattr(made, key, value)
        if at is not None:
            tree.links.new(vector(tree, at), made.inputs["Vector"])
        for key, value in (inputs or {}).items():
            socket = input_of(made, key)
            if callable(value):
                tree.links.new(value(tree), socket)
            else:
                socket.default_value = value
        return output_of(made, output)

    return build


def as_color(*value: float) -> Build:
    return lambda tree: color(tree, value)


def as_number(value: float) -> Build:
    return lambda tree: number(tree, value)


def as_vector(*value: float) -> Build:
    return lambda tree: vector(tree, value)


def noises(name: str, v: tuple[float, ...]) -> Iterator[Probe]:
    kind = "ShaderNodeTexNoise"
    for d in ("1D", "2D", "3D", "4D"):
        inputs = {"Scale": 1.3, "Detail": 2.0, "Roughness": 0.5} | ({"W": as_number(0.77)} if d in ("1D", "4D") else {})
        for output in (0, 1) if d == "3D" else (0,):
            at = v if d != "1D" else None
            yield (
                f"noise/{d}/{name}/det2/{'col' if output else 'fac'}",
                node(kind, inputs, output, at, noise_dimensions=d),
            )
    inputs = {"Scale": 1.3, "Detail": 3.5, "Roughness": 0.7, "Distortion": 1.5}
    yield f"noise/3D/{name}/det3.5r.7dist1.5", node(kind, inputs, 0, v)
    for mode in ("MULTIFRACTAL", "RIDGED_MULTIFRACTAL", "HYBRID_MULTIFRACTAL", "FBM", "HETERO_TERRAIN"):
        yield f"musgrave/{mode}/{name}", musgrave(mode, v)


def musgrave(mode: str, v: tuple[float, ...]) -> Build:
    """The same fractal by the Musgrave node, or by its successor in the Noise node."""
    dimension, lacunarity, octaves, extra = 0.8, 2.1, 4.5, {"Offset": 0.6, "Gain": 1.2}

    def build(tree: Any) -> Any:
        if hasattr(bpy.types, "ShaderNodeTexMusgrave"):
            made = tree.nodes.new("ShaderNodeTexMusgrave")
            made.musgrave_type = mode
            values = {"Scale": 1.3, "Detail": octaves, "Dimension": dimension, "Lacunarity": lacunarity, **extra}
        else:
            made = tree.nodes.new("ShaderNodeTexNoise")
            made.noise_type = mode
            made.normalize = False
            roughness = lacunarity**-dimension
            values = {"Scale": 1.3, "Detail": octaves - 1, "Roughness": roughness, "Lacunarity": lacunarity, **extra}
        tree.links.new(vector(tree, v), made.inputs["Vector"])
        for socket in made.inputs:
            if socket.identifier in values:
                socket.default_value = values[socket.identifier]
        return made.outputs[0]

    return build


def voronois(name: str, v: tuple[float, ...]) -> Iterator[Probe]:
    kind = "ShaderNodeTexVoronoi"
    for d in ("1D", "2D", "3D", "4D"):
        inputs = {"Scale": 1.3} | ({"W": as_number(0.77)} if d in ("1D", "4D") else {})
        at = v if d != "1D" else None
        for feature in ("F1", "F2", "SMOOTH_F1", "DISTANCE_TO_EDGE", "N_SPHERE_RADIUS"):
            output = "Radius" if feature == "N_SPHERE_RADIUS" else "Distance"
            yield (
                f"voronoi/{d}/{feature}/{name}",
                node(kind, inputs, output, at, voronoi_dimensions=d, feature=feature),
            )
        yield f"voronoi/{d}/F1/{name}/color", node(kind, inputs, "Color", at, voronoi_dimensions=d)
        if d != "1D":
            yield f"voronoi/{d}/F1/{name}/pos", node(kind, inputs, "Position", at, voronoi_dimensions=d)
    for metric in ("MANHATTAN", "CHEBYCHEV", "MINKOWSKI"):
        inputs = {"Scale": 1.3} | ({"Exponent": 0.6} if metric == "MINKOWSKI" else {})
        yield f"voronoi/3D/F1/{metric}/{name}", node(kind, inputs, "Distance", v, distance=metric)
    if name != "c":
        inputs = {"Scale": 1.3, "Detail": 2.5, "Roughness": 0.6}
        yield f"voronoi/frac/{name}", node(kind, inputs, "Distance", v, normalize=True)


def patterns(name: str, v: tuple[float, ...]) -> Iterator[Probe]:
    for d in ("1D", "2D", "3D", "4D"):
        inputs = {"W": as_number(0.77)} if d in ("1D", "4D") else {}
        for output in ("Value", "Color"):
            at = v if d != "1D" else None
            yield (
                f"whitenoise/{d}/{output}/{name}",
                node("ShaderNodeTexWhiteNoise", inputs, output, at, noise_dimensions=d),
            )
    for wave, axes in (("BANDS", ("X", "Y", "Z", "DIAGONAL")), ("RINGS", ("X", "Y", "Z", "SPHERICAL"))):
        for axis in axes:
            for profile in ("SIN", "SAW", "TRI") if axis == "X" else ("SIN",):
                more = {"wave_type": wave, "wave_profile": profile, f"{wave.lower()}_direction": axis}
                inputs = {"Scale": 1.3, "Distortion": 0.7}
                yield f"wave/{wave}/{axis}/{profile}/{name}", node("ShaderNodeTexWave", inputs, "Fac", v, **more)
    for depth in (2, 5):
        inputs = {"Scale": 1.3, "Distortion": 1.1}
        yield f"magic/depth{depth}/{name}", node("ShaderNodeTexMagic", inputs, "Color", v, turbulence_depth=depth)
    yield f"brick/color/{name}", node("ShaderNodeTexBrick", {"Scale": 1.3, "Bias": 0.2}, "Color", v)
    yield f"brick/fac/{name}", node("ShaderNodeTexBrick", {"Scale": 1.3, "Mortar Size": 0.1}, "Fac", v)
    yield f"checker/{name}", node("ShaderNodeTexChecker", {"Scale": 1.3}, "Fac", v)
    for kind in ("LINEAR", "QUADRATIC", "EASING", "DIAGONAL", "SPHERICAL", "QUADRATIC_SPHERE", "RADIAL"):
        yield f"gradient/{kind}/{name}", node("ShaderNodeTexGradient", {}, "Fac", v, gradient_type=kind)
    for kind in ("2D", "3D"):
        yield f"gabor/{kind}/{name}", node("ShaderNodeTexGabor", {"Scale": 1.3}, "Value", v, gabor_type=kind)
        inputs = {"Scale": 0.8, "Frequency": 1.7, "Anisotropy": 0.35, f"Orientation {kind}": GABOR_ORIENTATIONS[kind]}
        for output in ("Value", "Phase", "Intensity"):
            yield f"gabor/{kind}/{output}/{name}", node("ShaderNodeTexGabor", inputs, output, v, gabor_type=kind)
    for output in range(4):
        inputs = {"Sides": 5.5, "Roundness": 0.3}
        yield f"radialtiling/{output}/{name}", node("ShaderNodeRadialTiling", inputs, output, v)


def skies(name: str, v: tuple[float, ...]) -> Iterator[Probe]:
    if name == "c":
        return
    cases = {
        "": (3.0, 0.3, (0.3, 0.2, 0.93)),
        "clear/": (1.0, 0.0, (-0.8, 0.1, 0.4)),
        "hazy/": (10.0, 1.0, (0.5, -0.4, 0.1)),
        "sunset/": (2.5, 0.6, (0.5, 0.2, -0.3)),
    }
    for kind, (case, (turbidity, albedo, sun)) in itertools.product(("PREETHAM", "HOSEK_WILKIE"), cases.items()):
        values = {"sky_type": kind, "turbidity": turbidity, "ground_albedo": albedo, "sun_direction": sun}
        yield f"sky/{kind}/{case}{name}", node("ShaderNodeTexSky", {}, 0, v, **values)
    length = math.sqrt(sum(x * x for x in v))
    for kind in ("NISHITA", "SINGLE_SCATTERING", "MULTIPLE_SCATTERING"):
        for place, z in (("above", v[2]), ("below", -0.1 * v[2])):
            values = {"sky_type": kind, "sun_disc": False, "sun_elevation": 0.2, "sun_rotation": 1.3, "altitude": 500.0}
            toward = (v[0] / length, v[1] / length, z / length)
            yield f"sky/{kind}/{place}/{name}", node("ShaderNodeTexSky", {}, 0, toward, **values)


def vectors(name: str, v: tuple[float, ...]) -> Iterator[Probe]:
    for kind in ("POINT", "TEXTURE", "VECTOR", "NORMAL"):
        inputs: dict[str, Any] = {"Rotation": (0.3, 0.5, 0.7), "Scale": (1.1, 0.9, 2.0)}
        if kind in ("POINT", "TEXTURE"):
            inputs["Location"] = (0.1, 0.2, 0.3)
        yield f"mapping/{kind}/{name}", node("ShaderNodeMapping", inputs, 0, v, vector_type=kind)
    for kind in ("AXIS_ANGLE", "X_AXIS", "Y_AXIS", "Z_AXIS", "EULER_XYZ"):
        inputs = {"Center": (0.1, 0.2, 0.3)}
        inputs |= {"Rotation": (0.3, 0.5, 0.7)} if kind == "EULER_XYZ" else {"Angle": 0.8}
        inputs |= {"Axis": (1, 2, 3)} if kind == "AXIS_ANGLE" else {}
        yield f"vecrot/{kind}/{name}", node("ShaderNodeVectorRotate", inputs, 0, v, rotation_type=kind)


def enum_items(kind: str, prop: str) -> list[str]:
    return [item.identifier for item in getattr(bpy.types, kind).bl_rna.properties[prop].enum_items]


def maths() -> Iterator[Probe]:
    def math_node(operation: str, values: tuple[float, ...]) -> Build:
        def build(tree: Any) -> Any:
            made = tree.nodes.new("ShaderNodeMath")
            made.operation = operation
            for socket, x in zip(made.inputs, values, strict=True):
                tree.links.new(number(tree, x), socket)
            return made.outputs[0]

        return build

    def vector_math(operation: str) -> Build:
        def build(tree: Any) -> Any:
            made = tree.nodes.new("ShaderNodeVectorMath")
            made.operation = operation
            values = ((0.6, -1.7, 2.3), (0.35, 2.5, -0.4), (0.2, 0.5, 1.1))
            for i, value in enumerate(values):
                tree.links.new(vector(tree, value), made.inputs[i])
            made.inputs[3].default_value = 1.3
            return next(s for s in made.outputs if s.enabled)

        return build

    for operation in enum_items("ShaderNodeMath", "operation"):
        for i, values in enumerate(((0.6, 0.35, 0.2), (-1.7, 2.5, 0.5))):
            yield f"math/{operation}/{i}", math_node(operation, values)
    for operation in enum_items("ShaderNodeVectorMath", "operation"):
        yield f"vecmath/{operation}", vector_math(operation)
    for kind in ("LINEAR", "STEPPED", "SMOOTHSTEP", "SMOOTHERSTEP"):
        inputs = {"Value": as_number(0.37), "From Min": 0.1, "From Max": 0.9, "To Min": -1, "To Max": 3}
        inputs |= {"Steps": 4} if kind == "STEPPED" else {}
        yield f"maprange/{kind}", node("ShaderNodeMapRange", inputs, 0, interpolation_type=kind, clamp=False)


def colors() -> Iterator[Probe]:
    bright = as_color(0.2, 0.5, 1.4)
    for blend in enum_items("ShaderNodeMixRGB", "blend_type"):
        inputs: dict[str, Any] = {"Fac": as_number(0.7), "Color1": bright, "Color2": as_color(0.7, 0.1, 0.4)}
        yield f"mixrgb/{blend}", node("ShaderNodeMixRGB", inputs, blend_type=blend)
    inputs = {"Hue": 0.6, "Saturation": 1.4, "Value": 0.8, "Fac": 0.9, "Color": as_color(0.2, 0.5, 0.9)}
    yield "hsv", node("ShaderNodeHueSaturation", inputs)
    yield "invert", node("ShaderNodeInvert", {"Fac": 0.8, "Color": bright})
    yield "gamma", node("ShaderNodeGamma", {"Gamma": 2.2, "Color": bright})
    yield "brightcontrast", node("ShaderNodeBrightContrast", {"Bright": 0.1, "Contrast": 0.3, "Color": bright})
    yield "rgbtobw", node("ShaderNodeRGBToBW", {"Color": bright})
    for mode in ("RGB", "HSV", "HSL"):
        inputs = {"Red": as_number(0.3), "Green": as_number(0.6), "Blue": as_number(0.8)}
        yield f"combinecolor/{mode}", node("ShaderNodeCombineColor", inputs, mode=mode)
        for output in range(3):
            inputs = {"Color": as_color(0.2, 0.7, 0.4)}
            yield f"separatecolor/{mode}/{output}", node("ShaderNodeSeparateColor", inputs, output, mode=mode)
    for kelvin in (500, 1000, 1500, 2700, 4000, 6500, 10000, 15000):
        yield f"blackbody/{kelvin}", node("ShaderNodeBlackbody", {"Temperature": as_number(kelvin)})
    for nm in (380, 420, 480, 530, 580, 630, 700, 780):
        yield f"wavelength/{nm}", node("ShaderNodeWavelength", {"Wavelength": as_number(nm)})


def ramp(x: float, **settings: Any) -> Build:
    def build(tree: Any) -> Any:
        made = tree.nodes.new("ShaderNodeValToRGB")
        band = made.color_ramp
        for key, value in settings.items():
            setattr(band, key, value)
        first, last = band.elements
        if "interpolation" in settings:
            first.color, first.position = (1, 0, 0, 1), 0.1
            last.color, last.position = (0, 0, 1, 0.5), 0.9
            band.elements.new(0.4).color = (0, 1, 0, 1)
        else:
            first.color, last.color = (0.9, 0.2, 0.1, 1), (0.2, 0.3, 0.8, 1)
        tree.links.new(number(tree, x), made.inputs[0])
        return made.outputs[0]

    return build


def curve(x: float, kind: str, points: dict[int, tuple[float, float]]) -> Build:
    def build(tree: Any) -> Any:
        made = tree.nodes.new(kind)
        for channel, (at, value) in points.items():
            made.mapping.curves[channel].points.new(at, value)
        made.mapping.update()
        is_color = kind == "ShaderNodeRGBCurve"
        link = color(tree, (x, x, x)) if is_color else number(tree, x)
        tree.links.new(link, made.inputs["Color" if is_color else "Value"])
        return made.outputs[0]

    return build


def tables() -> Iterator[Probe]:
    for x in (-0.2, 0.13, 0.5, 0.77, 1.3):
        for kind in ("LINEAR", "EASE", "CARDINAL", "B_SPLINE", "CONSTANT"):
            yield f"ramp/RGB/{kind}/{x:g}", ramp(x, interpolation=kind)
    for mode in ("HSV", "HSL"):
        for hue in ("NEAR", "FAR", "CW", "CCW"):
            yield f"ramp/{mode}/{hue}", ramp(0.3, color_mode=mode, hue_interpolation=hue)
    for x in (-0.3, 0.25, 0.6, 1.4):
        yield f"rgbcurve/{x:g}", curve(x, "ShaderNodeRGBCurve", {3: (0.3, 0.7), 0: (0.6, 0.2)})
        yield f"floatcurve/{x:g}", curve(x, "ShaderNodeFloatCurve", {0: (0.3, 0.7)})
    tilted = as_vector(0.5, 0.0, math.sqrt(0.75))
    for ior in (1.1, 1.45, 2.4, 0.7):
        yield f"fresnel/{ior:g}", node("ShaderNodeFresnel", {"IOR": as_number(ior), "Normal": tilted})
    for blend in (0.1, 0.5, 0.8):
        for output in (0, 1):
            inputs = {"Blend": as_number(blend), "Normal": tilted}
            yield f"layerweight/{output}/{blend:g}", node("ShaderNodeLayerWeight", inputs, output)


def images() -> Iterator[Probe]:
    """4 x 3 texels without colour management."""
    image = bpy.data.images.new("img", 4, 3, float_buffer=True, alpha=True)
    image.colorspace_settings.name = "Non-Color"
    texels = [(0.1 + 0.2 * x, 0.15 + 0.3 * y, 0.05 * (x + 4 * y), 1.0) for y in range(3) for x in range(4)]
    image.pixels = [c for texel in texels for c in texel]
    image.pack()
    for lookup in ("Linear", "Closest", "Cubic", "Smart"):
        for extension in enum_items("ShaderNodeTexImage", "extension"):
            for i, uv in enumerate(((0.3, 0.55, 0), (1.13, -0.21, 0), (0.02, 0.98, 0))):
                more = {"interpolation": lookup, "extension": extension, "image": image}
                yield f"image/{lookup}/{extension}/{i}", node("ShaderNodeTexImage", {}, 0, uv, **more)
    for projection in ("FLAT", "SPHERE", "TUBE", "BOX"):
        more = {"projection": projection, "image": image, "interpolation": "Closest"}
        yield f"image/proj/{projection}", node("ShaderNodeTexImage", {}, 0, (0.8, 0.35, 0.62), **more)
    for projection in ("EQUIRECTANGULAR", "MIRROR_BALL"):
        more = {"projection": projection, "image": image, "interpolation": "Closest"}
        yield f"env/{projection}", node("ShaderNodeTexEnvironment", {}, 0, (0.5, -0.3, 0.2), **more)


def ies_file(vertical: int, horizontal: int, turn: float, pole: float = 0.0, sides: float = 2.0) -> Any:
    """A text of type C photometry: brighter to some sides, over part of the turn."""
    downs = [pole + (180 - 2 * pole) * i / (vertical - 1) for i in range(vertical)]
    turns = [turn * i / max(horizontal - 1, 1) for i in range(horizontal)]
    values = [
        500 + 400 * math.cos(sides * math.radians(h)) * math.sin(math.radians(v)) + 3 * v for h in turns for v in downs
    ]
    text = bpy.data.texts.new("ies")
    text.write(f"IESNA91\nTILT=NONE\n1 1000 1.5 {vertical} {horizontal} 1 2 0 0 0\n1.0 0.9 100\n")
    text.write(" ".join(f"{x:.6g}" for x in [*downs, *turns, *values]) + "\n")
    return text


def lamps() -> Iterator[Probe]:
    """Photometric files: the full turn, half, a quarter or one direction, not quite to the poles, with a jump."""
    directions = [(math.sin(i * 2.4), math.cos(i * 2.4), 1.7 * math.sin(i * 0.7 + 0.3)) for i in range(6)]
    poles = [(0.0, 0.0, 1.0), (0.0, 0.0, -1.0)]
    shapes = {"full": (7, 9, 360), "half": (7, 5, 180), "quarter": (5, 4, 90), "one": (10, 1, 0), "gap": (7, 8, 315)}
    for name, shape in (*shapes.items(), ("poles", (6, 5, 180, 30)), ("jump", (7, 9, 360, 0, 1.3))):
        text = ies_file(*shape)
        for i, d in enumerate([*directions, *poles] if name == "jump" else directions):
            unit = tuple(x / math.sqrt(sum(y * y for y in d)) for x in d)
            yield f"ies/{name}/{i}", node("ShaderNodeTexIES", {}, 0, unit, mode="INTERNAL", ies=text)


def all_probes() -> Iterator[Probe]:
    for name, v in VECTORS.items():
        for family in (noises, voronois, patterns, skies, vectors):
            yield from family(name, v)
    for single in (maths, colors, tables, images, lamps):
        yield from single()
