"""Objects and instances: one pass over the depsgraph's instances, everything else in bulk.

An instance costs one lookup by (object, data, parent); what those three decide is read once for all their instances.
"""

import gc
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np

from .. import versions
from .context import INSTANCER, PARTICLE, PROPERTY_PREFIXES, SyncContext, column_major, matrix_columns
from .culling import Culling
from .hashes import mixed_keys, name_key
from .lights import light_values
from .linking import LinkPass, Subject
from .materials import ShaderSync
from .named import named_property
from .records import IS_HOLDOUT, IS_INSTANCE, IS_SHADOW_CATCHER, Gathered, Record, Runs
from .strands import HairSource, hair_sources
from .subdivision import dicing_of
from .unsupported import warn_kind, warn_object

VISIBILITY = (
    ("visible_camera", 1),
    ("visible_diffuse", 2),
    ("visible_glossy", 4),
    ("visible_transmission", 8),
    ("visible_volume_scatter", 16),
    ("visible_shadow", 32),
)
VISIBLE_RAYCAST = 128
SKIP, LIGHT = -1, -2
GEOMETRY = ("MESH", "CURVES", "POINTCLOUD")


@contextmanager
def collector_paused() -> Iterator[None]:
    """While many objects are made and none of them is garbage, Python's collector would look at all again and again."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


class ObjectPass:
    """One pass over the instances of a depsgraph."""

    def __init__(
        self, context: SyncContext, shaders: ShaderSync, depsgraph: Any, view_layer: Any, culling: Culling | None = None
    ) -> None:
        self.context = context
        self.culling = culling
        self.shaders = shaders
        self.depsgraph = depsgraph
        self.view_layer = view_layer
        self.override = view_layer.material_override
        self.out = Gathered()
        self._links = LinkPass(context)
        self._light_subjects: list[Subject] = []
        self._light_holders: list[tuple[Any, ...]] = []
        self._names: dict[str, int] = {}
        self._sets: dict[tuple[int, ...], int] = {}
        self._attributes: dict[tuple[Any, ...], int] = {}

    @collector_paused()
    def run(self) -> Gathered:
        """Gathers records, rows and lamps."""
        out = self.out
        instances = self.depsgraph.object_instances
        use_strand = self.view_layer.use_strand
        cache: dict[tuple[Any, Any, Any, bool], tuple[bool, tuple[int, ...]]] = {}
        runs = Runs()
        random: list[int] = []
        last_source = last_data = last_parent = last_visible = None
        is_light, shown = False, ()
        matrices: list[Any] = []
        # One value a time: in bulk Blender walks the instances again for each, which takes longer, and before 5.0 it
        # forgets what the first object instances: that memory is never free again.
        for row, instance in enumerate(instances):
            matrices.append(instance.matrix_world.copy())
            visible = instance.show_self
            obj = instance.object if visible or (use_strand and instance.show_particles) else None
            data = obj.data if obj is not None else None
            if data is None:
                last_data = None
                runs.begin(row, ())
                random.append(0)
                continue
            # Objects of instances are made for the step: what they stand for is what lasts.
            parent = instance.parent
            if parent is not None:
                source, number = instance.instance_object, instance.random_id
            else:
                source, number = obj, name_key(obj.name)
            random.append(number)
            # Most are as the one before. The cache holds these objects: they are found again as the same.
            if (
                source is not last_source
                or data is not last_data
                or parent is not last_parent
                or visible is not last_visible
            ):
                last_source, last_data, last_parent, last_visible = key = (source, data, parent, visible)
                known = cache.get(key)
                if known is None:
                    grows = use_strand and instance.show_particles
                    known = cache[key] = self._shown(obj, data, parent, visible, grows)
                is_light, shown = known
                runs.begin(row, shown)
            if is_light:
                self._light(obj, parent, number, column_major(matrices[row]))
        out.rows, out.which = runs.expand(len(matrices))
        out.random = np.array(random, dtype=np.int64).astype(np.uint32)[out.rows]
        out.matrices = matrix_columns(matrices)
        if self.culling is not None:
            self._cull(self.culling)
        dupli = np.array([record.flags & IS_INSTANCE for record in out.records], np.bool_)
        real = ~dupli[out.which]
        out.random[real] = mixed_keys(out.random[real])
        self._link()
        # Only now all shaders are known.
        wanted = self.shaders.wanted() | self.context.wanted
        if INSTANCER in wanted and dupli.any():
            self._read_dupli(instances)
        properties = sorted(name for name in wanted if name.startswith(tuple(PROPERTY_PREFIXES.values())))
        for record in out.records if properties else ():
            record.attribute_set = self._attribute_set(record.holders, properties)
        for light, holders in zip(out.lights if properties else (), self._light_holders, strict=False):
            light["attributes"] = self._named_properties(holders, properties)
        if PARTICLE in wanted and dupli.any():
            self._read_particles(instances)
        return out

    def _cull(self, culling: Culling) -> None:
        """Forgets rows that are left out, and records without a row."""
        out = self.out
        rules = np.array([culling.rules(record.holders[-1]) for record in out.records], np.bool_).reshape(-1, 2)
        boxes = np.array([record.holders[-1].bound_box for record in out.records], np.float32).reshape(-1, 8, 3)
        shown = ~culling.hidden(boxes[out.which], out.matrices[out.rows], *rules[out.which].T)
        used, which = np.unique(out.which[shown], return_inverse=True)
        out.rows, out.which = out.rows[shown], which.reshape(-1)
        out.random = out.random[shown]
        out.records = [out.records[index] for index in used.tolist()]

    def _link(self) -> None:
        """Who lights whom: known only when all objects are."""
        self.out.linked = linked = self._links.resolve()
        for light, subject in zip(self.out.lights, self._light_subjects, strict=True):
            if linked is not None and subject in linked.linkings:
                light["linking"] = linked.linkings[subject]

    def _read_particles(self, instances: Any) -> None:
        """Instances one by one: Blender has no bulk call that tells their particles. Each gets a record of its own."""
        out, frame = self.out, self.depsgraph.scene_eval.frame_current_final
        shown: dict[int, list[int]] = {}
        for place, row in enumerate(out.rows.tolist()):
            shown.setdefault(row, []).append(place)
        for row, instance in enumerate(instances):
            system = instance.particle_system if row in shown and instance.is_instance else None
            if system is None:
                continue
            values = particle_values(system.particles, instance.persistent_id[0], frame)
            for place in shown[row] if values else ():
                record = out.records[out.which[place]]
                kept = out.attribute_sets[record.attribute_set] if record.attribute_set >= 0 else ()
                out.which[place] = len(out.records)
                out.records.append(replace(record, attribute_set=len(out.attribute_sets)))
                out.attribute_sets.append([*kept, *values])

    def _read_dupli(self, instances: Any) -> None:
        values = np.array([(*instance.orco, *instance.uv) for instance in instances], dtype=np.float32).reshape(-1, 5)
        self.out.dupli = (values[:, :3] * np.float32(0.5) - np.float32(0.5), values[:, 3:])

    def _light(self, obj: Any, parent: Any, random: int, matrix: list[float]) -> None:
        random &= 0xFFFFFFFF  # Blender gives instances' numbers a sign
        if parent is None:
            random = int(mixed_keys(np.array([random], dtype=np.uint32))[0])
        values = light_values(self.context, self.shaders, obj, matrix, self._visibility(obj, parent), random)
        if values is not None:
            values["light_group"] = self.context.light_group(obj, parent)
            self.out.lights.append(values)
            holder = parent if parent is not None else obj
            values |= {"object_color": tuple(holder.color), "pass_index": obj.pass_index}
            self._light_subjects.append(self._links.subject(obj, parent))
            self._light_holders.append(self._holders(obj, parent))

    def _shown(self, obj: Any, data: Any, parent: Any, visible: bool, grows: bool) -> tuple[bool, tuple[int, ...]]:
        """Whether it is a lamp, and the records of what it shows: itself, strands that grow on it."""
        index = self._record(obj, data, parent) if visible else SKIP
        strands = self._hair_records(obj, data, parent) if grows else ()
        return index == LIGHT, ((index, *strands) if index >= 0 else strands)

    def _record(self, obj: Any, data: Any, parent: Any) -> int:
        kind = obj.type
        if parent is None:
            warn_object(self.context, obj)
        if kind == "LIGHT":
            return LIGHT
        if kind not in GEOMETRY:
            warn_kind(self.context, obj)
            return SKIP
        used = self.view_layer.use_strand if kind == "CURVES" else self.view_layer.use_solid
        there = len(data.points) if kind != "MESH" else len(data.polygons) or data.is_editmode
        if not used or not there:
            return SKIP
        return self._add_record(obj, data, parent, self._material_set(obj, data), None)

    def _hair_records(self, obj: Any, data: Any, parent: Any) -> tuple[int, ...]:
        """One for each particle system with strands."""
        if obj.type != "MESH":
            return ()
        records = []
        # What Blender makes for an instance is gone when the strands are read.
        owner = obj.original.evaluated_get(self.depsgraph)
        for source in hair_sources(owner, self.context.viewport):
            slot = source.system.settings.material - 1
            index = self._add_record(obj, data, parent, self._material_set(obj, data, slot), source)
            if index >= 0:
                records.append(index)
        return tuple(records)

    def _add_record(self, obj: Any, data: Any, parent: Any, material_set: int, hair: HairSource | None) -> int:
        visibility = self._visibility(obj, parent)
        if visibility == 0:
            return SKIP
        cycles = versions.cycles_settings(obj)
        holder = parent if parent is not None else obj
        flags = IS_INSTANCE if parent is not None else 0
        if obj.is_holdout or holder.holdout_get(view_layer=self.view_layer):
            flags |= IS_HOLDOUT
        if obj.is_shadow_catcher or (parent is not None and parent.is_shadow_catcher):
            flags |= IS_SHADOW_CATCHER
        source = obj.original.data if obj.original.data is not None else data
        kind = {"CURVES": "Curves", "POINTCLOUD": "PointCloud"}.get(obj.type, "Mesh")
        owners = {("Object", obj.original.name_full), (kind, source.name_full), (kind, data.name_full)}
        if hair is not None:
            owners.add(("ParticleSettings", hair.system.settings.name_full))
        if parent is not None:
            owners.add(("Object", parent.original.name_full))
        shading = getattr(obj, "shadow_terminator_shading_offset", None)
        geometry = getattr(obj, "shadow_terminator_geometry_offset", None)
        holders = self._holders(obj, parent)
        whole = hair is None and holders[-1].data == data
        self.out.records.append(
            Record(
                mesh=data,
                # Modified meshes have lost their name; the user knows the original's.
                mesh_name=source.name if hair is None else hair.system.name,
                owners=owners,
                name=self._name(obj.name),
                material_set=material_set,
                visibility=visibility,
                pass_index=obj.pass_index,
                # The instancer's, as Blender has it in the objects that it makes for instances; Python gives the object
                # that is instanced instead, as long as somebody holds it.
                color=tuple(holder.color),
                flags=flags,
                shading_offset=float(cycles.get("shadow_terminator_offset", 0.0) if shading is None else shading),
                geometry_offset=float(
                    cycles.get("shadow_terminator_geometry_offset", 0.1) if geometry is None else geometry
                ),
                holders=holders,
                subject=self._links.subject(obj, parent),
                light_group=self.context.light_group(obj, parent),
                hair=hair,
                dicing=dicing_of(self.context, holders[-1], self.depsgraph.scene_eval) if whole else None,
            )
        )
        return len(self.out.records) - 1

    def _holders(self, obj: Any, parent: Any) -> tuple[Any, ...]:
        """Instancer, if any, and object: those that last longer than the step of the walk."""
        return tuple(h.original.evaluated_get(self.depsgraph) for h in (parent, obj) if h is not None)

    def _visibility(self, obj: Any, parent: Any) -> int:
        mask = 0
        for name, bit in VISIBILITY:
            if getattr(obj, name) and (parent is None or getattr(parent, name)):
                mask |= bit
        holder = parent if parent is not None else obj
        if getattr(holder, "visible_raycast", False):  # Blender 5.2 and newer
            mask |= VISIBLE_RAYCAST
        if holder.indirect_only_get(view_layer=self.view_layer):
            mask &= ~1
        return mask

    def _name(self, name: str) -> int:
        index = self._names.get(name)
        if index is None:
            index = self._names[name] = len(self.out.names)
            self.out.names.append(name)
        return index

    def _material_set(self, obj: Any, data: Any, only: int | None = None) -> int:
        """The materials of an object's slots; of hair the one slot it names, or the last."""
        if self.override is not None:
            handles: tuple[int, ...] = (self.shaders.material(self.override),)
        else:
            materials = [slot.material for slot in obj.material_slots] or list(data.materials)
            if only is not None:
                materials = materials[max(0, min(only, len(materials) - 1)) :][:1]
            handles = tuple(self.shaders.material(m) if m is not None else -1 for m in materials)
        index = self._sets.get(handles)
        if index is None:
            index = self._sets[handles] = len(self.out.material_sets)
            self.out.material_sets.append(list(handles))
        return index

    def _attribute_set(self, holders: tuple[Any, ...], properties: list[str]) -> int:
        values = self._named_properties(holders, properties)
        if not values:
            return -1
        key = tuple(values)
        index = self._attributes.get(key)
        if index is None:
            index = self._attributes[key] = len(self.out.attribute_sets)
            self.out.attribute_sets.append(values)
        return index

    def _named_properties(self, holders: tuple[Any, ...], properties: list[str]) -> list[tuple[str, tuple[float, ...]]]:
        """Custom properties that some shader asks for by name. Instances have the colour of their instancer."""
        owners = {"object": holders[-1:], "instancer": holders}
        values = []
        for wanted in properties:
            prefix, name = wanted.split(":", 1)
            asked = holders[:1] if wanted == "object:color" else owners[prefix]
            found = next((v for v in (named_property(owner, name) for owner in asked) if v), None)
            if found is not None:
                values.append((wanted, found))
        return values


def particle_values(particles: Any, index: int, frame: float) -> list[tuple[str, tuple[float, ...]]]:
    """What Particle Info reads, by names as in engine/scene/view.h. Children of particles have nothing of the kind."""
    if not 0 <= index < len(particles):
        return []
    particle = particles[index]
    random = float(mixed_keys(np.array([index], dtype=np.uint32))[0]) / 0xFFFFFFFF
    return [
        ("@particle_state", (float(index), frame - particle.birth_time, particle.lifetime, particle.size)),
        ("@particle_location", (*particle.location, random)),
        ("@particle_velocity", tuple(particle.velocity)),
        ("@particle_spin", tuple(particle.angular_velocity)),
    ]
