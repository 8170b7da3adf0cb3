"""Every closure of the node set on balls under a lamp and a sky of two colours, in Cycles and in Talbot."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
import pytest
from pair_scenes import Builder, Tree, add_lamp, add_plane, add_sphere, atlas, diffuse, find_input, set_world
from pairs import Bounds, agree

BOUNDS = Bounds(0.02, 0.05)
OLD = bpy.app.version < (4, 0, 0)
"""Blender 3.4. What its Cycles alone does, and Talbot does not follow, is left out with this:

* multiple scattering of GGX by a random walk, where Talbot has the energy compensation of 4.0 and later;
* samples of clearcoat and of anisotropic Beckmann that do not follow their densities;
* Alpha and Transmission of one Principled BSDF, where light passes more than once: it comes out coloured and brighter.
"""


def two_skies(tree: Tree) -> Any:
    """Warm above, cold below, so that refraction and reflection differ."""
    up = tree("SeparateXYZ", in0=tree("TexCoord").outputs["Generated"]).outputs["Z"]
    factor = tree("MapRange", in0=up, From_Min=-1.0, From_Max=1.0)
    return tree("MixRGB", in0=factor, in1=(0.2, 0.4, 0.9), in2=(1.0, 0.7, 0.4))


def show(
    scene: Any, path: Path, builders: list[Builder], light: str, bounces: int = 4, bounds: Bounds = BOUNDS
) -> None:
    """One ball for each shader; cells of the statistics are cells of the atlas.

    Either a sun without size and no bounces: that is the closures' values alone. Or a sky that is not sampled: their
    sampling alone. Both together would compare Cycles with its own errors: its values of rough refraction are too high
    where no microfacet can refract, so that sampling its lights makes rough glass brighter than not sampling them.
    """
    across = next(n for n in range(1, 9) if n * n >= len(builders))
    for obj in atlas(scene, builders, across, add_sphere):
        obj.rotation_euler = (0.5, 0.3, 0.2)
    if light == "sun":
        add_lamp("SUN", 3.0, (2, -1, 3), toward=(0, 0, 0), angle=0.0)
        scene.cycles.max_bounces = 0
    else:
        set_world(scene, build=two_skies).cycles.sampling_method = "NONE"
        scene.cycles.max_bounces = bounces
    scene.render.resolution_x = scene.render.resolution_y = 8 * across
    scene.cycles.pixel_filter_type = "BOX"
    agree(scene, path, samples=128, cells=across, bounds=bounds)


LIGHTS = pytest.mark.parametrize("light", ["sun", "sky"])


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
    """
    items = getattr(bpy.types, f"ShaderNode{kind}").bl_rna.properties["distribution"].enum_items
    left_out = ({"MULTI_GGX"} if OLD else set()) | ({"ASHIKHMIN_SHIRLEY"} if light == "sky" else set())
    return [item.identifier for item in items if item.identifier not in left_out]


@LIGHTS
def test_diffuse_translucent_transparent(pair_scene: Any, tmp_path: Path, light: str) -> None:
    color = (0.8, 0.5, 0.3)
    builders: list[Builder] = [node("BsdfDiffuse", Color=color, Roughness=r) for r in (0.0, 0.3, 1.0)]
    if light == "sky":  # under a sun only the terminator's facets differ
        builders.append(node("BsdfTranslucent", Color=color))
    builders += [
        node("BsdfTransparent", Color=color),
        node("Emission", Color=color, Strength=0.7),
        lambda tree: tree("MixShader", in0=0.3, in1=tree("BsdfDiffuse", Color=color), in2=tree("BsdfTransparent")),
        lambda tree: tree("AddShader", in0=tree("BsdfTranslucent", Color=color), in1=tree("Emission", Strength=0.2)),
        lambda tree: tree(
            "MixShader",
            in0=tree("LayerWeight", Blend=0.4).outputs["Facing"],
            in1=tree("BsdfDiffuse", Color=color),
            in2=tree("BsdfGlossy", Roughness=0.3),
        ),
    ]
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
    own_way = OLD and (distribution, light) == ("BECKMANN", "sky")
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
            Tangent=tree("Tangent", direction_type="RADIAL", axis="X"),
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
if OLD:  # later sheens are a fit of Cycles' table only: bright edges differ by some percent
    CORNERS["sheen"] = [principled(Sheen=1.0, Sheen_Tint=tint, Specular=0.0) for tint in (0.0, 1.0)]
else:
    CORNERS["metal"].append(principled(Metallic=1.0, Roughness=0.5, distribution="MULTI_GGX"))
    CORNERS["transmission"].append(principled(Transmission=1.0, Roughness=0.5, distribution="MULTI_GGX"))
    CORNERS["emission and alpha"].append(principled(Alpha=0.5, Transmission=0.5))


@LIGHTS
@pytest.mark.parametrize("corner", CORNERS)
def test_principled(pair_scene: Any, tmp_path: Path, light: str, corner: str) -> None:
    if (corner, light) == ("transmission", "sun") or (OLD and (corner, light) == ("coat", "sky")):
        pytest.skip("nothing to see, or Cycles does something of its own here")
    show(pair_scene, tmp_path, CORNERS[corner], light, bounces=8, bounds=BOUNDS)


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
    if light == "sky":
        builders.append(principled(Transmission=1.0, Roughness=0.3, **film))
        if bpy.app.version >= (5, 0, 0):
            builders.append(node("BsdfGlass", Roughness=0.3, **thick))
    show(pair_scene, tmp_path, builders, light, bounces=8)


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
