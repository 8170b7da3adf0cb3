"""Procedural materials of the size that productions use, for nodes.py: each gives the colour of its last node."""

from collections.abc import Callable
from typing import Any


class Tree:
    """Short names for what a procedural material is made of."""

    def __init__(self, tree: Any) -> None:
        self.tree = tree
        self.place = self.new("TexCoord").outputs["Object"]

    def new(self, kind: str, **properties: Any) -> Any:
        node = self.tree.nodes.new("ShaderNode" + kind)
        for name, value in properties.items():
            setattr(node, name, value)
        return node

    def feed(self, node: Any, **values: Any) -> Any:
        """Sets or links inputs by identifier (underscores for spaces; names differ between versions); gives the first
        output that is shown."""
        for name, value in values.items():
            socket = next(s for s in node.inputs if s.enabled and s.identifier == name.replace("_", " "))
            if hasattr(value, "is_linked"):
                self.tree.links.new(value, socket)
            else:
                socket.default_value = value
        return next(s for s in node.outputs if s.enabled)

    def math(self, operation: str, a: Any, b: Any) -> Any:
        node = self.new("Math", operation=operation)
        for socket, value in zip(node.inputs, (a, b), strict=False):
            if hasattr(value, "is_linked"):
                self.tree.links.new(value, socket)
            else:
                socket.default_value = value
        return node.outputs[0]

    def ramp(self, factor: Any, *stops: tuple[float, float, float, float]) -> Any:
        """stops: (position, red, green, blue)."""
        node = self.new("ValToRGB")
        elements = node.color_ramp.elements
        while len(elements) < len(stops):
            elements.new(0.5)
        for element, (position, *color) in zip(elements, stops, strict=True):
            element.position, element.color = position, (*color, 1)
        self.tree.links.new(factor, node.inputs[0])
        return node.outputs[0]

    def mix(self, blend: str, factor: Any, a: Any, b: Any) -> Any:
        node = self.new("MixRGB", blend_type=blend)
        for socket, value in zip(node.inputs, (factor, a, b), strict=True):
            if hasattr(value, "is_linked"):
                self.tree.links.new(value, socket)
            else:
                socket.default_value = value
        return node.outputs[0]

    def mapped(self, scale: tuple[float, float, float], turn: float) -> Any:
        return self.feed(self.new("Mapping"), Vector=self.place, Scale=scale, Rotation=(0, 0, turn))

    def noise(self, at: Any, scale: float, detail: float = 6.0) -> Any:
        return self.feed(self.new("TexNoise"), Vector=at, Scale=scale, Detail=detail, Roughness=0.6)


def rust(tree: Any) -> Any:
    """Layers of paint, rust and dirt, each with its own patches."""
    t = Tree(tree)
    color = t.ramp(t.noise(t.mapped((1, 1, 1), 0), 2), (0, 0.1, 0.2, 0.4), (1, 0.15, 0.3, 0.5))
    for layer in range(8):
        at = t.mapped((1 + 0.3 * layer, 1.2, 1), 0.4 * layer)
        coarse = t.noise(at, 1.5 + layer)
        cells = t.feed(t.new("TexVoronoi", feature="SMOOTH_F1"), Vector=at, Scale=3.0 + layer)
        edge = t.math("MULTIPLY", t.math("SUBTRACT", coarse, 0.45), t.math("ADD", cells, 0.5))
        patch = t.math("SMOOTH_MIN", t.math("MULTIPLY", edge, 9.0), 1.0)
        tint = t.ramp(t.noise(at, 9.0 + 2 * layer), (0, 0.2, 0.05, 0.02), (0.5, 0.4, 0.15, 0.05), (1, 0.6, 0.3, 0.1))
        bright = t.feed(t.new("HueSaturation"), Color=tint, Hue=0.5 + 0.01 * layer, Saturation=0.9, Value=1.1)
        color = t.mix("MIX", patch, color, bright)
    return color


def wood(tree: Any) -> Any:
    """Planks with rings, fibres and knots."""
    t = Tree(tree)
    color: Any = (0.3, 0.2, 0.1, 1)
    for layer in range(7):
        at = t.mapped((0.3, 2.0 + layer, 1), 0.1 * layer)
        rings = t.feed(t.new("TexWave", wave_type="RINGS"), Vector=at, Scale=2.0, Distortion=3.0, Detail=3.0)
        fibre = t.noise(t.mapped((1, 30.0 + layer, 1), 0), 4)
        knots = t.feed(t.new("TexVoronoi"), Vector=at, Scale=0.7 + 0.1 * layer)
        tone = t.math("MULTIPLY_ADD", rings, fibre)
        grain = t.ramp(tone, (0.1, 0.15, 0.07, 0.03), (0.6, 0.45, 0.25, 0.1), (0.9, 0.6, 0.4, 0.2))
        dark = t.feed(t.new("BrightContrast"), Color=grain, Bright=-0.02, Contrast=0.1)
        color = t.mix("OVERLAY", t.math("LESS_THAN", knots, 0.7), color, dark)
        color = t.feed(t.new("Gamma"), Color=color, Gamma=1.02)
    return color


def masonry(tree: Any) -> Any:
    """Bricks whose colour, wear and stains come from fractals."""
    t = Tree(tree)
    color: Any = (0.5, 0.4, 0.35, 1)
    for layer in range(6):
        at = t.mapped((1, 1, 1), 0.02 * layer)
        bent = t.new("VectorMath", operation="ADD")
        t.tree.links.new(at, bent.inputs[0])
        t.tree.links.new(t.noise(at, 12.0 + layer), bent.inputs[1])
        brick = t.feed(t.new("TexBrick"), Vector=bent.outputs[0], Scale=4.0 + layer, Mortar_Size=0.02, Bias=0.1)
        stains = t.feed(t.new("TexMagic", turbulence_depth=3), Vector=at, Scale=2.0, Distortion=1.5)
        wear = t.ramp(t.noise(at, 25.0), (0.3, 0, 0, 0), (0.7, 1, 1, 1))
        color = t.mix("SOFT_LIGHT", wear, t.mix("MULTIPLY", 0.6, color, brick), stains)
        speck = t.feed(t.new("TexVoronoi", distance="MANHATTAN"), Vector=at, Scale=60.0)
        color = t.mix("LINEAR_LIGHT", t.math("MULTIPLY", speck, 0.02), color, (0.5, 0.5, 0.5, 1))
    return color


ALL: dict[str, Callable[[Any], Any]] = {"rust": rust, "wood": wood, "masonry": masonry}
