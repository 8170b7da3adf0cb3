"""Particle Info on objects that particles are shown as, in Cycles and in Talbot."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pair_scenes import add_plane, add_sphere, look_down, material
from pairs import render, stacked

OUTPUTS = ("Index", "Random", "Age", "Lifetime", "Size", "Location", "Velocity", "Angular Velocity")


@pytest.mark.parametrize("output", OUTPUTS)
def test_particle_info(pair_scene: Any, tmp_path: Path, output: str) -> None:
    shown = add_sphere(material(lambda tree: tree("ParticleInfo").outputs[output]), location=(50, 0, 0))
    emitter = add_plane(material(lambda tree: tree("Emission")), size=3.0)
    emitter.show_instancer_for_render = False
    emitter.modifiers.new("Particles", "PARTICLE_SYSTEM")
    settings = emitter.particle_systems[-1].settings
    settings.count, settings.frame_start, settings.frame_end, settings.lifetime = 20, 1, 4, 50
    settings.render_type, settings.instance_object = "OBJECT", shown
    settings.particle_size, settings.size_random = 0.4, 0.5
    settings.normal_factor, settings.effector_weights.gravity = 0.3, 0.0
    settings.use_rotations, settings.angular_velocity_mode, settings.angular_velocity_factor = True, "RAND", 2.0
    scene = pair_scene
    for frame in range(1, 6):
        scene.frame_set(frame)
    look_down(scene, 3)
    scene.cycles.samples, scene.cycles.filter_width = 1, 0.01
    cycles, talbot = (
        stacked(render(scene, engine, 0, tmp_path / "x.exr"), "Combined") for engine in ("CYCLES", "TALBOT")
    )
    cycles, talbot = cycles[..., 1:], talbot[..., 1:]  # not alpha
    # Edges of the balls may fall to either side.
    different = np.abs(cycles - talbot).max(-1) > 1e-3 * np.abs(cycles).max()
    assert different.mean() < 0.01
    assert len(np.unique(np.round(cycles, 5))) > (1 if output in ("Lifetime", "Velocity") else 4)
