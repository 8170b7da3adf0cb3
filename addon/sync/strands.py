"""Hair, curves and points as arrays: particle hair key by key for want of a bulk call, Curves and PointClouds whole."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import versions
from .context import ACTIVE_COLOR, ACTIVE_UV, CURVE_NORMAL, GENERATED, SyncContext
from .curve_normals import curve_normals
from .generated import generated_of
from .hashes import mixed_keys
from .mesh import INTEGERS, VALUE_FIELDS, read_column

F32 = NDArray[np.float32]
Attributes = list[tuple[str, str, bool, Any]]

INTERCEPT, LENGTH, RANDOM = "@intercept", "@length", "@random"
"""What Hair Info and Point Info read; always stored, names as in engine/scene/view.h."""
SURFACE_UV = "surface_uv_coordinate"
CURVE_RADIUS, POINT_RADIUS = 0.005, 0.01
"""Radii of Curves and PointClouds that have none of their own, as in Cycles."""
SHAPES = ("RIBBONS", "THICK", "THICK_LINEAR")


@dataclass
class HairSource:
    """A particle system that is rendered as strands, on an evaluated object."""

    owner: Any
    modifier: Any
    index: int

    @property
    def system(self) -> Any:
        """Blender's particle system."""
        return self.modifier.particle_system


def hair_sources(obj: Any, viewport: bool) -> list[HairSource]:
    """The systems of an evaluated object whose strands are rendered."""
    out = []
    for index, modifier in enumerate(obj.modifiers):
        if modifier.type != "PARTICLE_SYSTEM" or not (modifier.show_viewport if viewport else modifier.show_render):
            continue
        settings = modifier.particle_system.settings
        if settings.type == "HAIR" and settings.render_type == "PATH":
            out.append(HairSource(obj, modifier, index))
    return out


def curve_settings(scene: Any) -> dict[str, Any]:
    """How the scene wants its curves traced."""
    curves = versions.cycles_curves(scene)
    shape = curves.get_enum("shape", SHAPES, "RIBBONS")
    names = {"RIBBONS": "ribbon", "THICK": "thick", "THICK_LINEAR": "thick_linear"}
    return {"curve_shape": names.get(shape, "ribbon"), "curve_subdivisions": int(curves.get("subdivisions", 2))}


# -- particle hair


def read_hair(context: SyncContext, source: HairSource, scene: Any) -> dict[str, Any] | None:
    """The strands of a particle system in the object's space; None when it has none."""
    settings, system, obj = source.system.settings, source.system, source.owner
    parents, children = len(system.particles), len(system.child_particles)
    if context.viewport:
        children = children * settings.display_percentage // 100
    first = parents if settings.child_type != "NONE" and children else 0
    strands = parents + children - first
    keys = 2 ** (settings.display_step if context.viewport else settings.render_step) + 1
    if settings.kink == "SPIRAL":
        keys += settings.kink_extra_steps
    if strands <= 0:
        return None
    positions = np.empty((strands, keys, 3), dtype=np.float32)
    co_hair = system.co_hair
    for strand in range(strands):
        if strand % 1024 == 0:
            context.check()
        number = first + strand
        positions[strand] = [co_hair(obj, particle_no=number, step=step) for step in range(keys)]
    end_where_cut(positions)
    inverse = np.array(obj.matrix_world.inverted_safe(), dtype=np.float64)
    local = (positions.astype(np.float64) @ inverse[:3, :3].T + inverse[:3, 3]).astype(np.float32)

    # Keys that do not move on are no keys.
    steps = np.linalg.norm(np.diff(local, axis=1), axis=2)
    keep = np.concatenate([np.ones((strands, 1), dtype=bool), steps > 0], axis=1)
    along = np.concatenate([np.zeros((strands, 1), dtype=np.float32), np.cumsum(steps, axis=1)], axis=1)
    length = along[:, -1]
    part = (along / np.where(length > 0, length, 1.0)[:, None]).astype(np.float32)
    last = keys - 1 - np.argmax(keep[:, ::-1], axis=1)
    radii = strand_radii(settings, part)
    if settings.use_close_tip:
        radii[np.arange(strands), last] = 0.0
    starts = np.zeros(strands + 1, dtype=np.uint32)
    starts[1:] = np.cumsum(keep.sum(axis=1))
    return {
        "positions": np.ascontiguousarray(local[keep]),
        "radii": np.ascontiguousarray(radii[keep]),
        "curve_starts": starts,
        "attributes": [
            (INTERCEPT, "VERTEX", False, np.ascontiguousarray(part[keep])),
            (LENGTH, "FACE", False, np.ascontiguousarray(length, dtype=np.float32)),
            (RANDOM, "FACE", False, random_numbers(strands)),
            *_emitter_attributes(context, source, local[:, 0], range(first, first + strands)),
        ],
        **_active_names(obj.data),
        **curve_settings(scene),
    }


def end_where_cut(positions: F32) -> None:
    """Children shorter than their parents have fewer keys; Blender answers zeros for the rest. The strand ends before.
    `positions`: strands x keys x 3, changed in place."""
    is_key = positions.any(axis=2)
    last = positions.shape[1] - 1 - np.argmax(is_key[:, ::-1], axis=1)
    for strand in np.flatnonzero(~is_key[:, -1] & is_key.any(axis=1)):
        positions[strand, last[strand] + 1 :] = positions[strand, last[strand]]


def strand_radii(settings: Any, part: F32) -> F32:
    """Radius at a part of the way from root to tip."""
    x = 1.0 - part
    shape = settings.shape
    if shape < 0:
        x = x ** (1.0 + shape)
    elif shape > 0:
        x = x ** (1.0 / max(1.0 - shape, 1e-6))
    scale = settings.radius_scale * 0.5
    root, tip = settings.root_radius * scale, settings.tip_radius * scale
    return np.ascontiguousarray(x * (root - tip) + tip, dtype=np.float32)


def _active_names(mesh: Any) -> dict[str, Any]:
    uv = next((layer for layer in mesh.uv_layers if layer.active_render), None)
    colors = mesh.color_attributes
    color = getattr(colors, "default_color_name", "")
    if not color and 0 <= colors.render_color_index < len(colors):
        color = colors[colors.render_color_index].name
    return {"active_uv": uv.name if uv is not None else "", "active_color": color}


def _emitter_attributes(context: SyncContext, source: HairSource, roots: F32, numbers: range) -> Attributes:
    """UV maps and colours of the surface at the roots, as far as shaders ask for them."""
    mesh, system = source.owner.data, source.system
    active = _active_names(mesh)
    wanted = set(context.wanted)
    if ACTIVE_UV in wanted:
        wanted.add(active["active_uv"])
    if ACTIVE_COLOR in wanted:
        wanted.add(active["active_color"])
    out: Attributes = []
    if GENERATED in wanted:
        out.append((GENERATED, "FACE", False, generated_of(mesh, roots)))
    particles = system.particles

    def read(function: Any, number_name: str, index: int, columns: int) -> F32:
        values = np.zeros((len(numbers), columns), dtype=np.float32)
        for row, number in enumerate(numbers):
            # Children go by their number; the particle is a formality then.
            particle = particles[number if number < len(particles) else 0]
            arguments = {"particle": particle, "particle_no": number, number_name: index}
            values[row] = tuple(function(source.modifier, **arguments))[:columns]
        return values

    if len(particles):
        for index, layer in enumerate(mesh.uv_layers):
            if layer.name in wanted:
                out.append((layer.name, "FACE", False, read(system.uv_on_emitter, "uv_no", index, 2)))
        for index, layer in enumerate(getattr(mesh, "vertex_colors", ())):
            if layer.name in wanted:
                encoded = read(system.mcol_on_emitter, "vcol_no", index, 3)
                out.append((layer.name, "FACE", True, linear_of_srgb(encoded)))
    return out


def linear_of_srgb(values: F32) -> F32:
    """[IEC 61966-2-1]"""
    low = values / 12.92
    high = ((np.maximum(values, 0.0) + 0.055) / 1.055) ** 2.4
    return np.where(values <= 0.04045, low, high).astype(np.float32)


def random_numbers(count: int) -> F32:
    """One number of 0 to 1 for each curve or point."""
    keys = mixed_keys(np.arange(count, dtype=np.uint32))
    return (keys.astype(np.float64) / 0xFFFFFFFF).astype(np.float32)


# -- Curves and PointCloud data


def read_curves(context: SyncContext, data: Any, scene: Any) -> dict[str, Any] | None:
    """The curves of a Curves datablock; None when there are none."""
    keys, curves = len(data.points), len(data.curves)
    if not keys or not curves:
        return None
    starts = np.empty(curves + 1, dtype=np.uint32)
    starts[:-1] = read_column(data.curves, "first_point_index", curves, np.int32)
    starts[-1] = keys
    positions = _positions(data, keys)
    steps = np.linalg.norm(np.diff(positions, axis=0), axis=1)
    steps[starts[1:-1].astype(np.int64) - 1] = 0.0  # from one curve to the next
    total = np.concatenate([[0.0], np.cumsum(steps, dtype=np.float64)])
    counts = np.diff(starts.astype(np.int64))
    begin = np.repeat(total[starts[:-1]], counts)
    length = total[starts[1:].astype(np.int64) - 1] - total[starts[:-1]]
    part = (total - begin) / np.repeat(np.where(length > 0, length, 1.0), counts)
    attributes: Attributes = [
        (INTERCEPT, "VERTEX", False, part.astype(np.float32)),
        (LENGTH, "FACE", False, length.astype(np.float32)),
        (RANDOM, "FACE", False, random_numbers(curves)),
    ]
    if CURVE_NORMAL in context.wanted:
        attributes.append((CURVE_NORMAL, "VERTEX", False, curve_normals(data, positions, starts)))
    attributes += _generic(context, data, {"POINT": ("VERTEX", keys), "CURVE": ("FACE", curves)})
    return {
        "positions": positions,
        "radii": _radii(data, keys, CURVE_RADIUS),
        "curve_starts": starts,
        "attributes": attributes,
        "active_uv": SURFACE_UV,
        **curve_settings(scene),
        **_straight(context, data, curves),
    }


def _straight(context: SyncContext, data: Any, count: int) -> dict[str, Any]:
    """5.0 and newer render curves that are all of straight lines as cones, whatever the scene's shape is."""
    kind = data.attributes.get("curve_type")
    if context.version < 500 or kind is None or kind.domain != "CURVE" or kind.data_type != "INT8":
        return {}
    poly = read_column(kind.data, "value", count, np.int32) == 1
    return {"curve_shape": "thick_linear"} if poly.all() else {}


def read_points(context: SyncContext, data: Any) -> dict[str, Any] | None:
    """The points of a PointCloud datablock; None when there are none."""
    count = len(data.points)
    if not count:
        return None
    positions = _positions(data, count)
    attributes: Attributes = [(RANDOM, "VERTEX", False, random_numbers(count))]
    attributes += _generic(context, data, {"POINT": ("VERTEX", count)})
    return {"positions": positions, "radii": _radii(data, count, POINT_RADIUS), "attributes": attributes}


def _positions(data: Any, count: int) -> F32:
    position = data.attributes.get("position")
    if position is not None:
        return read_column(position.data, "vector", count, np.float32, 3)
    if hasattr(data, "position_data"):
        return read_column(data.position_data, "vector", count, np.float32, 3)
    return read_column(data.points, "co", count, np.float32, 3)


def _radii(data: Any, count: int, fallback: float) -> F32:
    radius = data.attributes.get("radius")
    if radius is None or radius.data_type != "FLOAT" or len(radius.data) != count:
        return np.full(count, fallback, dtype=np.float32)
    return read_column(radius.data, "value", count, np.float32)


def _generic(context: SyncContext, data: Any, domains: dict[str, tuple[str, int]]) -> Attributes:
    """Named attributes that some shader asks for."""
    wanted = set(context.wanted)
    if ACTIVE_UV in wanted:
        wanted.add(SURFACE_UV)
    out: Attributes = []
    for attribute in data.attributes:
        if attribute.name not in wanted:
            continue
        domain, count = domains.get(attribute.domain, ("", 0))
        if attribute.data_type not in VALUE_FIELDS or not domain or len(attribute.data) != count:
            context.warn(f"'{data.name}': attribute '{attribute.name}' ({attribute.data_type}) is not supported")
            continue
        field, columns = VALUE_FIELDS[attribute.data_type]
        dtype = INTEGERS.get(attribute.data_type, np.float32)
        values = np.ascontiguousarray(read_column(attribute.data, field, count, dtype, columns), dtype=np.float32)
        out.append((attribute.name, domain, attribute.data_type in ("FLOAT_COLOR", "BYTE_COLOR"), values))
    return out
