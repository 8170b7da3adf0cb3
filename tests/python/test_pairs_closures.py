"""Every closure of the node set on balls under a lamp and a sky of two colours, in Cycles and in Talbot."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from pair_scenes import (
    Builder,
    Tree,
    add_lamp,
    add_plane,
    add_sphere,
    atlas,
    diffuse,
    find_input,
    floor_atlas,
    look_at,
    material,
    set_world,
)
from pairs import Bounds, agree, render, stacked

BOUNDS = Bounds(0.02, 0.05)
OLD = bpy.app.version < (4, 0, 0)
"""Blender 3.4. What its Cycles alone does, and Talbot does not follow, is left out with this:

* multiple scattering of GGX by a random walk, where Talbot has the energy compensation of 4.0 and later;
* samples of clearcoat and of anisotropic Beckmann that do not follow their densities;
* samples of toon closures, which crowd around their axis;
* Alpha and Transmission of one Principled BSDF, where light passes more than once: it comes out coloured and brighter.
"""


def two_skies(tree: Tree) -> Any:
    """Warm above, cold below, so that refraction and reflection differ."""
    up = tree("SeparateXYZ", in0=tree("TexCoord").outputs["Generated"]).outputs["Z"]
    factor = tree("MapRange", in0=up, From_Min=-1.0, From_Max=1.0)
    return tree("MixRGB", in0=factor, in1=(0.2, 0.4, 0.9), in2=(1.0, 0.7, 0.4))


def side(builders: list[Builder]) -> int:
    """Of the smallest square atlas that holds them."""
    return next(n for n in range(1, 9) if n * n >= len(builders))


def show(
    scene: Any, path: Path, builders: list[Builder], light: str, bounces: int = 4, bounds: Bounds = BOUNDS
) -> None:
    """One ball for each shader, or one square of a floor; cells of the statistics are cells of the atlas.

    Either a sun without size and no bounces: that is the closures' values alone. Or a sky that is not sampled: their
    sampling alone.
    """
    if light == "grazing sun":
        return show_values(scene, path, builders)
    across = side(builders)
    scene.render.resolution_x = scene.render.resolution_y = 8 * across
    if light == "grazing sky":
        floor_atlas(scene, builders, across, math.radians(5))
    else:
        for obj in atlas(scene, builders, across, add_sphere):
            obj.rotation_euler = (0.5, 0.3, 0.2)
    if light == "sun":
        add_lamp("SUN", 3.0, (2, -1, 3), toward=(0, 0, 0), angle=0.0)
        scene.cycles.max_bounces = 0
    else:
        set_world(scene, build=two_skies).cycles.sampling_method = "NONE"
        scene.cycles.max_bounces = bounces
    scene.cycles.pixel_filter_type = "BOX"
    agree(scene, path, samples=128, cells=across, bounds=bounds)


def show_values(
    scene: Any, path: Path, builders: list[Builder], sun: tuple[float, float, float] = (0.5, 3, 0.6)
) -> None:
    """A floor under a low sun, pixel by pixel, from two heights: what the closures are worth, without any noise."""
    across = side(builders)
    scene.render.resolution_x = scene.render.resolution_y = 8 * across
    add_lamp("SUN", 3.0, sun, toward=(0, 0, 0), angle=0.0)
    scene.cycles.max_bounces = 0
    objects: list[Any] = []
    for degrees in (5, 25):
        for obj in objects:
            bpy.data.objects.remove(obj)
        objects = floor_atlas(scene, builders, across, math.radians(degrees))
        errors = relative_errors(scene, path / "pair.exr")
        worst = np.unravel_index(errors.argmax(), errors.shape)
        where = f"row {worst[0] // 8} column {worst[1] // 8}"
        assert errors.max() < 0.004, f"{degrees} degrees, {where}: {errors.max():.2%}"


def relative_errors(scene: Any, path: Path) -> Any:
    """Largest relative difference over the channels of each pixel, for one sample in the middle of each."""
    scene.cycles.samples = 1
    scene.cycles.pixel_filter_type, scene.cycles.filter_width = "BLACKMAN_HARRIS", 0.01
    cycles, talbot = (stacked(render(scene, engine, 0, path), "Combined") for engine in ("CYCLES", "TALBOT"))
    return (np.abs(talbot - cycles) / np.maximum(cycles, 0.01 * cycles.mean())).max(-1)


LIGHTS = pytest.mark.parametrize("light", ["sun", "sky", "grazing sun", "grazing sky"])


def node(kind: str, **values: Any) -> Builder:
    """A shader node. Values whose property or socket this Blender does not have are left at their defaults."""

    def make(tree: Tree) -> Any:
        new = tree(kind)
        for key, value in values.items():
            if key in new.bl_rna.properties:
                setattr(new, key, value)
        for key, value in values.items():
            if key not in new.bl_rna.properties:
                tree.set(find_input(new, key), value)
        return new

    return make


def distributions(kind: str, light: str = "sky") -> list[str]:
    """The microfacet distributions of a node that are compared.

    Cycles samples Ashikhmin-Shirley otherwise than it evaluates it: a ball's brightness depends on which one is used.
    So does a Beckmann floor's at a grazing angle, by 0.3 %: it samples the exact shadowing and evaluates a fit of it.
    """
    items = getattr(bpy.types, f"ShaderNode{kind}").bl_rna.properties["distribution"].enum_items
    left_out = ({"MULTI_GGX"} if OLD else set()) | ({"ASHIKHMIN_SHIRLEY"} if light.endswith("sky") else set())
    left_out |= {"BECKMANN"} if light == "grazing sky" else set()
    return [item.identifier for item in items if item.identifier not in left_out]


@LIGHTS
def test_diffuse_translucent_transparent(pair_scene: Any, tmp_path: Path, light: str) -> None:
    color = (0.8, 0.5, 0.3)
    builders: list[Builder] = [node("BsdfDiffuse", Color=color, Roughness=r) for r in (0.0, 0.3, 1.0)]
    if light.endswith("sky"):  # under a sun only the terminator's facets differ
        builders.append(node("BsdfTranslucent", Color=color))
    if light != "grazing sun":  # one sample sees through or not, and either the sun or what shines
        builders += [
            node("BsdfTransparent", Color=color),
            lambda tree: tree("MixShader", in0=0.3, in1=tree("BsdfDiffuse", Color=color), in2=tree("BsdfTransparent")),
            node("Emission", Color=color, Strength=0.7),
            lambda tree: tree("AddShader", in0=tree("BsdfTranslucent"), in1=tree("Emission", Strength=0.2)),
        ]
    builders.append(
        lambda tree: tree(
            "MixShader",
            in0=tree("LayerWeight", Blend=0.4).outputs["Facing"],
            in1=tree("BsdfDiffuse", Color=color),
            in2=tree("BsdfGlossy", Roughness=0.3),
        )
    )
    show(pair_scene, tmp_path, builders, light)


@LIGHTS
def test_glossy(pair_scene: Any, tmp_path: Path, light: str) -> None:
    color = (0.9, 0.6, 0.3)
    builders = [
        node("BsdfGlossy", distribution=name, Color=color, Roughness=roughness)
        for name in distributions(
            "BsdfGlossy" if hasattr(bpy.types, "ShaderNodeBsdfGlossy") else "BsdfAnisotropic", light
        )
        for roughness in (0.25, 0.5, 0.9)
    ]
    show(pair_scene, tmp_path, builders, light)


@LIGHTS
@pytest.mark.parametrize("distribution", ["GGX", "BECKMANN", "ASHIKHMIN_SHIRLEY", "MULTI_GGX"])
def test_anisotropic(pair_scene: Any, tmp_path: Path, light: str, distribution: str) -> None:
    """Around the default tangent, turned, and around another axis."""
    own_way = OLD and distribution == "BECKMANN" and light.endswith("sky")
    if distribution not in distributions("BsdfAnisotropic", light) or own_way:
        pytest.skip("Cycles does something of its own here")
    kind = "BsdfAnisotropic"
    builders: list[Builder] = [
        node(kind, distribution=distribution, Roughness=0.4, Anisotropy=a, Rotation=r)
        for a, r in ((0.6, 0.0), (0.6, 0.2), (-0.5, 0.0), (0.8, 0.1))
    ]
    builders.append(
        lambda tree: tree(
            kind,
            distribution=distribution,
            Roughness=0.5,
            Anisotropy=0.7,
            # A floor has no direction around an axis in it.
            Tangent=tree("Tangent", direction_type="RADIAL", axis="Z" if light.startswith("grazing") else "X"),
        )
    )
    show(pair_scene, tmp_path, builders, light)


@pytest.mark.parametrize("kind", ["BsdfGlass", "BsdfRefraction"])
def test_glass(pair_scene: Any, tmp_path: Path, kind: str) -> None:
    color = (0.9, 0.95, 0.8)
    builders = [
        node(kind, distribution=name, Color=color, Roughness=roughness, IOR=ior)
        for name in distributions(kind)
        for roughness, ior in ((0.0, 1.5), (0.3, 1.33), (0.7, 1.8))
    ]
    show(pair_scene, tmp_path, builders, "sky", bounces=8)


PRINCIPLED_NEW = {"Specular": "Specular IOR Level", "Transmission": "Transmission Weight", "Clearcoat": "Coat Weight"}
PRINCIPLED_NEW |= {"Clearcoat_Roughness": "Coat Roughness", "Sheen": "Sheen Weight", "Emission": "Emission Color"}


def principled(**values: Any) -> Builder:
    """Sockets by 3.4's names; those that a Blender lacks are left out."""

    def make(tree: Tree) -> Any:
        new = tree("BsdfPrincipled")
        new.inputs["Base Color"].default_value = (0.8, 0.3, 0.2, 1.0)
        for key, value in values.items():
            socket = new.inputs.get(key.replace("_", " ")) or new.inputs.get(PRINCIPLED_NEW.get(key, ""))
            if key in new.bl_rna.properties:
                setattr(new, key, value)
            elif socket is not None:
                tint_as_color = socket.type == "RGBA" and isinstance(value, float)
                tree.set(socket, (1.0, 1.0 - value, 1.0 - value) if tint_as_color else value)
        return new

    return make


CORNERS: dict[str, list[Builder]] = {
    "dielectric": [
        *(principled(Roughness=r, Specular=s) for r in (0.0, 0.3, 1.0) for s in (0.0, 0.5, 1.0)),
        *(principled(Roughness=0.4, IOR=ior) for ior in (1.0, 1.2, 2.5)),
        principled(Roughness=0.3, Specular_Tint=1.0),
        principled(Diffuse_Roughness=0.8, Specular=0.0),
        principled(Base_Color=(0.0, 0.0, 0.0)),
        principled(Base_Color=(1.0, 1.0, 1.0), Roughness=0.7),
    ],
    "metal": [
        *(principled(Metallic=1.0, Roughness=r) for r in (0.0, 0.3, 0.6, 1.0)),
        principled(Metallic=0.5, Roughness=0.4),
        principled(Metallic=1.0, Roughness=0.3, Specular_Tint=0.7),
        principled(Metallic=1.0, Roughness=0.5, Anisotropic=0.7),
        principled(Metallic=1.0, Roughness=0.5, Anisotropic=0.7, Anisotropic_Rotation=0.2),
    ],
    "transmission": [
        *(principled(Transmission=1.0, Roughness=r, IOR=i) for r in (0.0, 0.3, 0.8) for i in (1.2, 1.8)),
        principled(Transmission=0.5, Roughness=0.3),
        principled(Transmission=1.0, Roughness=0.1, Transmission_Roughness=0.5),
    ],
    "coat": [
        principled(Clearcoat=1.0, Clearcoat_Roughness=0.25, Roughness=0.6),
        principled(Clearcoat=1.0, Clearcoat_Roughness=0.5, Roughness=0.6),
        principled(Clearcoat=0.3, Clearcoat_Roughness=0.3, Metallic=0.5),
        principled(Clearcoat=1.0, Clearcoat_Roughness=0.4, Coat_Tint=(0.3, 0.8, 0.9), Coat_IOR=1.8),
    ],
    "emission and alpha": [
        principled(Emission=(0.2, 0.5, 1.0), Emission_Strength=0.6),
        principled(Alpha=0.4),
        principled(Alpha=0.5, Emission=(0.2, 0.5, 1.0), Emission_Strength=1.0),
        principled(Emission=(0.2, 0.5, 1.0), Emission_Strength=1.0, Metallic=0.5),
    ],
}
CORNERS["sheen"] = [principled(Sheen=1.0, Sheen_Tint=tint, Specular=0.0) for tint in (0.0, 1.0)]
CORNERS["sheen"] += [principled(Sheen=0.6, Sheen_Roughness=r) for r in (0.1, 0.5, 1.0)]
if not OLD:
    CORNERS["metal"].append(principled(Metallic=1.0, Roughness=0.5, distribution="MULTI_GGX"))
    CORNERS["transmission"].append(principled(Transmission=1.0, Roughness=0.5, distribution="MULTI_GGX"))
    CORNERS["emission and alpha"].append(principled(Alpha=0.5, Transmission=0.5))


@LIGHTS
@pytest.mark.parametrize("corner", CORNERS)
def test_principled(pair_scene: Any, tmp_path: Path, light: str, corner: str) -> None:
    if (corner == "transmission" and light.endswith("sun")) or (OLD and corner == "coat" and light.endswith("sky")):
        pytest.skip("nothing to see, or Cycles does something of its own here")
    if (corner, light) == ("emission and alpha", "grazing sun"):
        pytest.skip("one sample sees through or not, and either the sun or what shines")
    show(pair_scene, tmp_path, CORNERS[corner], light, bounces=8)


@pytest.mark.parametrize("sun", [(0.5, 3, -0.6), (0.3, -2, -0.7), (0.1, 1, -2)], ids=["opposite", "behind", "below"])
@pytest.mark.parametrize("kind", ["BsdfGlass", "BsdfRefraction", "BsdfPrincipled"])
def test_lamps_behind_rough_glass(pair_scene: Any, tmp_path: Path, kind: str, sun: tuple[float, float, float]) -> None:
    """Cycles shows light from directions that no facet can bend it to, and that its samples never take.

    Where a smooth surface would reflect everything, 3.4 still refracts one part in 10 thousand of what glass receives.
    """
    opaque = OLD and kind != "BsdfRefraction"
    builders = [
        principled(distribution=name, Roughness=roughness, IOR=ior, Transmission=1.0)
        if kind == "BsdfPrincipled"
        else node(kind, distribution=name, Roughness=roughness, IOR=ior)
        for name in distributions(kind, "sun")
        for roughness, ior in ((0.3, 1.45), (0.47, 1.1), (0.8, 1.33 if opaque else 0.7), (1.0, 1.8))
    ]
    show_values(pair_scene, tmp_path, builders, sun)


@LIGHTS
@pytest.mark.parametrize("kind", ["BsdfVelvet", "BsdfSheen", "BsdfToon", "BsdfMetallic"])
def test_other_nodes(pair_scene: Any, tmp_path: Path, light: str, kind: str) -> None:
    if not hasattr(bpy.types, f"ShaderNode{kind}"):
        pytest.skip("not in this Blender")
    if OLD and kind == "BsdfToon" and light.endswith("sky"):
        pytest.skip("Cycles does something of its own here")
    color = (0.8, 0.5, 0.3)
    metals = distributions("BsdfMetallic", light) if kind == "BsdfMetallic" else []
    builders = {
        "BsdfVelvet": [node(kind, Color=color, Sigma=s) for s in (0.2, 0.5, 1.0)],
        "BsdfSheen": [
            node(kind, Color=color, Roughness=r, distribution=d)
            for r in (0.4, 0.6, 1.0)
            for d in ("MICROFIBER", "ASHIKHMIN")
        ],
        "BsdfToon": [
            node(kind, Color=color, Size=size, Smooth=smooth, component=component)
            for size, smooth in ((0.3, 0.1), (0.8, 0.5))
            for component in ("DIFFUSE", "GLOSSY")
        ],
        "BsdfMetallic": [
            node(kind, Roughness=0.4, Anisotropy=anisotropy, fresnel_type=fresnel, distribution=distribution)
            for fresnel in ("F82", "PHYSICAL_CONDUCTOR")
            for distribution in metals
            for anisotropy in (0.0, 0.7)
        ],
    }[kind]
    show(pair_scene, tmp_path, builders, light)


@LIGHTS
def test_thin_film(pair_scene: Any, tmp_path: Path, light: str) -> None:
    """On every node that has one, from both sides of what a film is: thin, thick, of a low and of a high index."""
    probe = bpy.data.materials.new("Probe")
    probe.use_nodes = True
    if "Thin Film Thickness" not in probe.node_tree.nodes["Principled BSDF"].inputs:
        pytest.skip("not in this Blender")
    film = {"Thin_Film_Thickness": 380.0, "Thin_Film_IOR": 1.33}
    thick = {"Thin_Film_Thickness": 900.0, "Thin_Film_IOR": 1.8}
    builders = [
        principled(Roughness=0.3, Specular=1.0, **film),
        principled(Roughness=0.4, **thick),
        principled(Roughness=0.3, IOR=2.2, **film),
    ]
    if bpy.app.version >= (5, 0, 0):
        builders.append(principled(Metallic=1.0, Roughness=0.3, **film))
        builders += [
            node("BsdfMetallic", fresnel_type=kind, Roughness=0.4, **values)
            for kind, values in (("F82", film), ("PHYSICAL_CONDUCTOR", thick))
        ]
    if light.endswith("sky"):
        builders.append(principled(Transmission=1.0, Roughness=0.3, **film))
        if bpy.app.version >= (5, 0, 0):
            builders.append(node("BsdfGlass", Roughness=0.3, **thick))
    show(pair_scene, tmp_path, builders, light, bounces=8)


@pytest.mark.parametrize("kind", ["coat", "specular", "metal", "glossy"])
def test_narrow_highlights(pair_scene: Any, tmp_path: Path, kind: str) -> None:
    """Through a telescope, pixel by pixel.

    Below a roughness of 0.1 Cycles' distribution shows its rounding: 3 % at 0.05, 17 % at 0.03, where Talbot follows
    the formula.
    """
    glossy = "BsdfGlossy" if hasattr(bpy.types, "ShaderNodeBsdfGlossy") else "BsdfAnisotropic"
    build = {
        "coat": principled(Clearcoat=1.0, Clearcoat_Roughness=0.1, Specular=0.0),
        "specular": principled(Roughness=0.1),
        "metal": principled(Metallic=1.0, Roughness=0.1),
        "glossy": node(glossy, distribution="BECKMANN", Roughness=0.1),
    }[kind]
    add_plane(material(build), 4.0)
    look_at(pair_scene, (0, -6, 6), lens=1000.0)
    add_lamp("SUN", 3.0, (0, 6, 6), toward=(0, 0, 0), angle=0.0)
    pair_scene.cycles.max_bounces = 0
    difference = relative_errors(pair_scene, tmp_path / "pair.exr")
    assert np.percentile(difference, 95) < 0.005


def test_both_sides(pair_scene: Any, tmp_path: Path) -> None:
    """Squares that turn their front or their back to the camera, lit from above."""
    builders: list[Builder] = [
        node("BsdfTranslucent"),
        node("BsdfGlossy", Roughness=0.5),
        principled(Roughness=0.4),
        lambda tree: tree(
            "MixShader",
            in0=tree("NewGeometry").outputs["Backfacing"],
            in1=tree("BsdfDiffuse"),
            in2=tree("Emission", Color=(1, 0, 0)),
        ),
    ]
    for number, obj in enumerate(atlas(pair_scene, builders + builders, 3)):
        obj.rotation_euler = (0.3 + (number > 3) * 3.14159, 0.2, 0.0)
    add_plane(diffuse((0.3, 0.8, 0.4)), 4.0, location=(0, 0, -1))
    add_lamp("AREA", 100, (3, -2, 3), toward=(0, 0, -1), shape="SQUARE", size=1.0)
    set_world(pair_scene, (0.3, 0.4, 0.5))
    agree(pair_scene, tmp_path, samples=64, cells=3)
