"""Bumped normals seen at a grazing angle, pixel by pixel beside the Cycles of the same Blender.

The finite difference's way and directions show there, and where the bent normal is turned back for reflections.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from pair_scenes import Builder, Tree, add_lamp, add_plane, find_input, look_at, material, node_tree
from pairs import Bounds, agree, render, stacked
from test_pairs_closures import OLD, node, principled, show_values


def shown(tree: Tree, normal: Any) -> Any:
    """The normal as a colour, 0.5 where it is 0."""
    return tree("Emission", Color=tree("VectorMath", operation="MULTIPLY_ADD", in0=normal, in1=0.5, in2=0.5))


def slope(tree: Tree) -> Any:
    point = tree("TexCoord").outputs["Object"]
    return tree("SeparateXYZ", Vector=point).outputs["Y"]


def parabola(tree: Tree) -> Any:
    height = slope(tree)
    return tree("Math", operation="MULTIPLY", in0=height, in1=height)


def cells(tree: Tree) -> Any:
    return tree("TexVoronoi", Vector=tree("TexCoord").outputs["Object"], Scale=8.0).outputs["Distance"]


def bump(height: Callable[[Tree], Any], distance: float) -> Callable[[Tree], Any]:
    return lambda tree: shown(tree, tree("Bump", Height=height(tree), Distance=distance))


def errors(scene: Any, path: Path) -> Any:
    """Largest difference over the channels of each pixel, for one sample in the middle of each."""
    scene.render.resolution_x = scene.render.resolution_y = 64
    scene.cycles.samples = 1
    scene.cycles.pixel_filter_type, scene.cycles.filter_width = "BLACKMAN_HARRIS", 0.01
    cycles, talbot = (stacked(render(scene, engine, 0, path), "Combined") for engine in ("CYCLES", "TALBOT"))
    return np.abs(talbot - cycles).max(-1)


@pytest.mark.parametrize("distance", [1.0, -1.0, 4.0, -4.0])
def test_even_slopes(pair_scene: Any, tmp_path: Path, distance: float) -> None:
    add_plane(material(bump(slope, distance)), 60.0)
    look_at(pair_scene, (0, -6, 1), (0, 0, 0.4))
    assert errors(pair_scene, tmp_path / "pair.exr").max() < 1e-3


@pytest.mark.parametrize("scale", [1.0, -1.0])
def test_displacement_as_bump(pair_scene: Any, tmp_path: Path, scale: float) -> None:
    """A material shows its displacement as bump unless it is told otherwise."""
    item = bpy.data.materials.new("Pair")
    tree = node_tree(item)
    displacement = tree("Displacement", Height=slope(tree), Midlevel=0.0, Scale=scale)
    tree("OutputMaterial", Surface=shown(tree, tree("NewGeometry").outputs["Normal"]), Displacement=displacement)
    add_plane(item, 60.0)
    look_at(pair_scene, (0, -6, 1), (0, 0, 0.4))
    assert errors(pair_scene, tmp_path / "pair.exr").max() < 1e-3


@pytest.mark.parametrize("height", [parabola, cells])
def test_uneven_heights(pair_scene: Any, tmp_path: Path, height: Callable[[Tree], Any]) -> None:
    """Both differ with how far and which way the finite difference goes; single precision leaves a little."""
    add_plane(material(bump(height, 0.1)), 60.0)
    look_at(pair_scene, (0, -6, 1), (0, 0, 0.4))
    assert np.percentile(errors(pair_scene, tmp_path / "pair.exr"), 95) < 0.02


@pytest.mark.skipif(bpy.app.version < (4, 0, 0), reason="3.4 adds the film's pixel, 1/64 m here, to the way")
@pytest.mark.parametrize("kind", ["EQUIRECTANGULAR", "FISHEYE_EQUISOLID"])
def test_panoramas(pair_scene: Any, tmp_path: Path, kind: str) -> None:
    add_plane(material(bump(cells, 0.1)), 60.0)
    camera = look_at(pair_scene, (0, -6, 1), (0, 0, 0.4)).data
    camera.type = "PANO"
    owner = camera if hasattr(camera, "panorama_type") else camera.cycles
    owner.panorama_type = kind
    owner.fisheye_fov, owner.fisheye_lens = math.pi, 10.5
    assert np.percentile(errors(pair_scene, tmp_path / "pair.exr"), 95) < 0.02


GLOSSY = "BsdfGlossy" if hasattr(bpy.types, "ShaderNodeBsdfGlossy") else "BsdfAnisotropic"
CLOSURES: list[Builder] = [
    *(node("BsdfDiffuse", Roughness=r) for r in (0.0, 0.7)),
    *(node(GLOSSY, distribution=name, Roughness=0.5) for name in ("GGX", "ASHIKHMIN_SHIRLEY")),
    node("BsdfAnisotropic", distribution="GGX", Roughness=0.5, Anisotropy=0.6),
    node("BsdfGlass", distribution="GGX", Roughness=0.5),
    *(node("BsdfToon", Size=0.5, Smooth=0.4, component=part) for part in ("DIFFUSE", "GLOSSY")),
    principled(Roughness=0.5),
    principled(Roughness=0.5, Metallic=1.0),
    principled(Roughness=0.5, Transmission=1.0),
    principled(Clearcoat=1.0, Clearcoat_Roughness=0.5),
    principled(Sheen=1.0, Sheen_Roughness=0.3),
]
if OLD:
    CLOSURES.append(node("BsdfVelvet", Sigma=1.0))
else:  # Cycles 3.4 lights Beckmann's distribution from below bent normals
    CLOSURES.append(node(GLOSSY, distribution="BECKMANN", Roughness=0.5))
    CLOSURES.append(node("BsdfGlass", distribution="MULTI_GGX", Roughness=0.5))
    CLOSURES += [node("BsdfSheen", distribution=name, Roughness=0.2) for name in ("MICROFIBER", "ASHIKHMIN")]


def bent(build: Builder, degrees: float) -> Builder:
    """The shader with all its normals turned away from the viewer."""

    def make(tree: Tree) -> Any:
        shader = build(tree)
        turn = math.radians(degrees)
        normal = tree("CombineXYZ", Y=math.sin(turn), Z=math.cos(turn))
        for name in ("Normal", "Coat Normal", "Clearcoat Normal"):
            if name in shader.inputs:
                tree.set(find_input(shader, name), normal)
        return shader

    return make


@pytest.mark.parametrize("degrees", [-15, 10, 24, 50])
def test_closures_with_bent_normals(pair_scene: Any, tmp_path: Path, degrees: float) -> None:
    """Seen from 5 and 25 degrees above the floor, so that some normals face away."""
    builders = [bent(build, degrees) for build in CLOSURES]
    show_values(pair_scene, tmp_path, builders)


def test_bump_in_a_panorama(pair_scene: Any, tmp_path: Path) -> None:
    """In 3.4 the slope is taken over a step that grows with the size of a pixel, however near the surface is."""
    camera = look_at(pair_scene, (0.0, -2.0, 1.5), (0.0, 0.0, 0.0)).data
    camera.type = "PANO"
    holder = camera if hasattr(camera, "panorama_type") else camera.cycles
    holder.panorama_type = "EQUIRECTANGULAR"

    def build(tree: Tree) -> Any:
        height = tree("TexNoise", Vector=tree("TexCoord").outputs["Object"], Scale=8.0, Detail=1.0)
        return tree("BsdfDiffuse", Normal=tree("Bump", Distance=0.1, Height=height.outputs[0]))

    add_plane(material(build), 8.0)
    add_lamp("SUN", 3.0, (3, 2, 4), toward=(0, 0, 0), angle=0.0)
    pair_scene.render.resolution_x, pair_scene.render.resolution_y = 40, 20
    pair_scene.cycles.max_bounces = 0
    agree(pair_scene, tmp_path, samples=128, batches=8, bounds=Bounds(0.005, 0.03))
