"""Lamps and worlds as the engine gets them."""

from __future__ import annotations

from typing import Any

import bpy
import pytest
from sync_recorder import synchronise

OLD = bpy.app.version < (4, 1, 0)


def add_light(kind: str, **values: Any) -> Any:
    light = bpy.data.lights.new(kind.title(), kind)
    for name, value in values.items():
        setattr(light, name, value)
    obj = bpy.data.objects.new(kind.title(), light)
    bpy.context.scene.collection.objects.link(obj)
    return obj


def test_lamps(empty_scene: Any) -> None:
    add_light("POINT", energy=100, shadow_soft_size=0.5, color=(1, 0.5, 0.25))
    add_light("SPOT", energy=50, spot_size=1.0, spot_blend=0.5)
    add_light("SUN", energy=3, angle=0.1)
    area = add_light("AREA", energy=20, shape="ELLIPSE", size=2, size_y=3, spread=1.5)
    area.visible_glossy = False
    area.scale = (1, 2, 1)
    bpy.context.view_layer.update()
    session, _, result = synchronise()
    assert result.warnings == []
    lights = {light["type"]: light for light in session.lights}
    assert lights["point"]["power"] == 100 and lights["point"]["radius"] == 0.5
    assert lights["point"]["color"] == (1, 0.5, 0.25)
    assert lights["spot"]["spot_angle"] == 1.0 and lights["spot"]["spot_blend"] == 0.5
    assert lights["sun"]["power"] == 3 and lights["sun"]["sun_angle"] == pytest.approx(0.1)
    assert (lights["area"]["shape"], lights["area"]["size_x"], lights["area"]["size_y"]) == ("ellipse", 2, 3)
    assert lights["area"]["spread"] == 1.5
    assert not lights["area"]["visibility"] & 4
    assert lights["area"]["to_world"][5] == 2, "the engine applies the object's scale"
    assert all(not light["visibility"] & 1 for light in session.lights), "new lamps are not seen by the camera"
    assert all(light["use_mis"] and light["cast_shadow"] for light in session.lights)


def test_broken_lamps_are_left_out(empty_scene: Any) -> None:
    add_light("POINT").scale.x = float("nan")
    add_light("SUN")
    bpy.context.view_layer.update()
    session, _, result = synchronise()
    assert [light["type"] for light in session.lights] == ["sun"]
    assert result.warnings == ["Light 'Point': its matrix or strength is not finite; it is not rendered"]


def test_lamp_settings_of_newer_versions(empty_scene: Any) -> None:
    obj = add_light("POINT", energy=10)
    light = obj.data
    if not hasattr(light, "exposure"):
        pytest.skip("this Blender's lamps have no exposure")
    light.exposure = 2
    light.normalize = False
    light.use_temperature = True
    light.temperature = 3000
    light.use_shadow = False
    light.use_soft_falloff = False
    session, _, _ = synchronise()
    values = session.lights[0]
    assert values["power"] == 40
    assert not values["normalize"] and not values["cast_shadow"] and not values["soft_falloff"]
    assert values["color"] == pytest.approx((1.7708, 0.8443, 0.2722), abs=2e-3)


def test_lamp_nodes(empty_scene: Any) -> None:
    obj = add_light("AREA")
    session, _, _ = synchronise()
    plain = session.lights[0]["shader"]
    obj.data.use_nodes = True
    session, _, _ = synchronise()
    assert session.shaders[session.lights[0]["shader"]][0] == "Light 'Area'"
    if OLD:
        assert plain == -1


def test_world(empty_scene: Any) -> None:
    session, _, _ = synchronise()
    assert session.world == {"shader": -1}
    world = bpy.data.worlds.new("Sky")
    bpy.context.scene.world = world
    world.color = (0.1, 0.2, 0.3)
    world.cycles_visibility.glossy = False
    world.cycles.sampling_method = "MANUAL"
    world.cycles.sample_map_resolution = 256
    session, _, _ = synchronise()
    assert session.world["visibility"] == 63 & ~4
    assert session.world["map_resolution"] == 256
    assert session.shaders[session.world["shader"]][0] == "World 'Sky'"
    if not world.use_nodes:
        node = session.node("World 'Sky'", "ShaderNodeBackground")
        assert node["inputs"][0][2] == pytest.approx((0.1, 0.2, 0.3, 1.0))
    bpy.context.view_layer.use_sky = False
    session, _, _ = synchronise()
    assert session.world == {"shader": -1}
