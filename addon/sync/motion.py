"""Motion blur: the scene is evaluated again at other moments of the shutter, and what has moved is sent along.

An object's steps n give 2^n + 1 moments spread evenly over the shutter: objects with more and fewer share theirs.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
from mathutils import Matrix
from numpy.typing import NDArray

from .. import versions
from .camera import camera_values, unscaled
from .context import SyncContext, column_major, matrix_columns
from .mesh import face_smooth, read_column, read_normals
from .records import Gathered, Record
from .strands import hair_sources, read_hair
from .subdivision import cage_of

F32 = NDArray[np.float32]
InstanceKey = tuple[int, int, tuple[int, ...]]
Eyes = Callable[[Any], list[tuple[Matrix, float]]]
"""Where an evaluated camera is now, and its horizontal shift, in each view of a stereo pair."""

MAX_MOMENTS = 129
MAX_TURN = math.radians(4.0)
"""Between moments the engine changes maps linearly: a turn gets one at least this often."""
SHUTTER_TABLE = 256


@dataclass
class Shutter:
    """When it is open, in frames."""

    middle: float
    length: float
    frames_per_second: float

    def frame(self, moment: float) -> tuple[int, float]:
        """Frame and subframe of a moment from 0 to 1."""
        time = self.middle + (moment - 0.5) * self.length
        whole = math.floor(time)
        return whole, time - whole


def shutter_of(scene: Any, view_layer: Any) -> Shutter | None:
    """None: no motion blur."""
    render = scene.render
    if not render.use_motion_blur or not view_layer.use_motion_blur or render.motion_blur_shutter <= 0:
        return None
    positions = ("START", "CENTER", "END")
    position = getattr(render, "motion_blur_position", None)
    position = position or versions.cycles_settings(scene).get_enum("motion_blur_position", positions, "CENTER")
    shift = {"START": 0.5, "CENTER": 0.0, "END": -0.5}[position] * render.motion_blur_shutter
    rate = render.fps / max(render.fps_base, 1e-6)
    return Shutter(scene.frame_current + scene.frame_subframe + shift, render.motion_blur_shutter, rate)


@dataclass
class Deforming:
    """A mesh whose shape may change, and its positions by moment, from the first of its instances that is there."""

    handle: int
    read: Callable[[Any], dict[str, F32] | None]
    level: int
    keys: list[InstanceKey] = field(default_factory=list)
    shapes: dict[float, dict[str, F32]] = field(default_factory=dict)


class MotionPass:
    """Collects one frame's motion. `begin` sees the scene in the middle of the shutter."""

    def __init__(self, context: SyncContext, shutter: Shutter, eyes: Eyes | None = None) -> None:
        self.context = context
        self.shutter = shutter
        self._eyes = eyes
        self._keys: list[InstanceKey] = []
        self._levels: NDArray[np.int64] = np.zeros(0, np.int64)
        self._matrices: dict[float, F32] = {}
        self._deforming: dict[int, Deforming] = {}
        self._camera_level = 0
        self._cameras: dict[float, list[tuple[Matrix, tuple[float, ...]]]] = {}

    def begin(self, depsgraph: Any, gathered: Gathered, handles: list[int], scene: Any, size: tuple[int, int]) -> None:
        """What may move, and where it is in the middle."""
        keys, _ = self._walk(depsgraph)
        self._keys = [keys[row] for row in gathered.rows.tolist()]
        levels = [_level(record, "use_motion_blur") for record in gathered.records]
        self._levels = np.array(levels, dtype=np.int64)[gathered.which]
        self._matrices[0.5] = gathered.matrices[gathered.rows]
        by_velocity: set[int] = set()
        for key, which in zip(self._keys, gathered.which.tolist(), strict=True):
            record, handle = gathered.records[which], handles[which]
            level = min(levels[which], _level(record, "use_deform_motion"))
            if handle < 0 or not level or handle in by_velocity:
                continue
            deforming = self._deforming.get(handle)
            if deforming is not None:
                deforming.level = max(deforming.level, level)
                deforming.keys.append(key)
            elif self._send_velocity(record, handle):
                by_velocity.add(handle)
            elif _may_deform(record):
                reader = _reader(self.context, record, depsgraph)
                self._deforming[handle] = Deforming(handle, reader, level, [key])
        camera = scene.camera
        if camera is not None:
            self._camera_level = _object_level(camera.evaluated_get(depsgraph), "use_motion_blur")
        self.sample(depsgraph, scene, 0.5, size, keys)

    def moments(self) -> list[float]:
        """Those besides the middle."""
        level = max([self._camera_level, *self._levels.tolist()], default=0)
        count = 2**level
        return [i / count for i in range(count + 1) if level and 2 * i != count]

    def sample(
        self, depsgraph: Any, scene: Any, moment: float, size: tuple[int, int], keys: list[InstanceKey] | None = None
    ) -> None:
        """Reads what is known at this moment of the shutter, to which the scene has been set."""
        wanted: dict[InstanceKey, list[Deforming]] = {}
        for deforming in self._deforming.values():
            for key in deforming.keys if _has_moment(deforming.level, moment) else ():
                wanted.setdefault(key, []).append(deforming)
        matrices: list[Matrix] = []
        if keys is None or wanted:
            keys, matrices = self._walk(depsgraph, wanted, moment)
        if moment not in self._matrices:
            rows = {key: row for row, key in enumerate(keys)}
            found = np.array([rows.get(key, -1) for key in self._keys], dtype=np.int64)
            there = found >= 0
            self._matrices[moment] = self._matrices[0.5].copy()
            self._matrices[moment][there] = matrix_columns(matrices)[found[there]]
        if self._camera_level and _has_moment(self._camera_level, moment):
            camera = scene.camera.evaluated_get(depsgraph)
            placed = self._eyes(camera) if self._eyes is not None else [(camera.matrix_world, None)]
            self._cameras[moment] = []
            for matrix, shift in placed:
                values = camera_values(self.context, camera, scene.render, *size, matrix, shift)
                self._cameras[moment].append((unscaled(matrix), tuple(values["view"])))

    def _walk(
        self, depsgraph: Any, wanted: dict[InstanceKey, list[Deforming]] | None = None, moment: float = 0.5
    ) -> tuple[list[InstanceKey], list[Matrix]]:
        """What each instance is at every moment, and where it is now. Shapes are read on the way: Blender lends them
        for the step only."""
        keys, matrices = [], []
        for instance in depsgraph.object_instances:
            matrices.append(instance.matrix_world.copy())
            obj, parent = instance.object, instance.parent
            owner = parent.original.as_pointer() if parent is not None else 0
            key = (obj.original.as_pointer(), owner, tuple(instance.persistent_id))
            keys.append(key)
            for deforming in wanted.get(key, ()) if wanted else ():
                shape = deforming.read(obj) if moment not in deforming.shapes else None
                if shape is not None:
                    deforming.shapes[moment] = shape
        return keys, matrices

    def _send_velocity(self, record: Record, handle: int) -> bool:
        """Points with a velocity go straight on, whatever else deforms them."""
        data = record.mesh
        velocity = None if record.hair is not None or record.dicing is not None else data.attributes.get("velocity")
        if velocity is None or velocity.data_type != "FLOAT_VECTOR" or velocity.domain != "POINT":
            return False
        count = len(velocity.data)
        speed = read_column(velocity.data, "vector", count, np.float32, 3)
        reach = speed * np.float32(0.5 * self.shutter.length / self.shutter.frames_per_second)
        shape = _positions(data)
        if len(shape) != count or not np.isfinite(reach).all() or not np.isfinite(shape).all() or not reach.any():
            return False
        positions = np.concatenate([shape - reach, shape + reach])
        self.context.session.set_mesh_motion(handle, {"positions": np.ascontiguousarray(positions, dtype=np.float32)})
        return True

    def send(self, scene: Any) -> list[dict[str, Any]]:
        """Everything that moved, with the first eye's camera; returns what `Session.set_motion` gets for each eye."""
        values: dict[str, Any] = {"shutter": _shutter_table(scene)}
        values |= self._object_values() | _rolling(scene)
        for deforming in self._deforming.values():
            self._send_shapes(deforming)
        eyes = len(next(iter(self._cameras.values()), [None]))
        out = [values | self._camera_values(eye) for eye in range(eyes)]
        self.context.session.set_motion(out[0])
        return out

    def _object_values(self) -> dict[str, Any]:
        which = np.full(len(self._keys), -1, dtype=np.int32)
        maps: list[F32] = []
        known: dict[bytes, int] = {}
        middle = self._matrices.get(0.5)
        if middle is None or not len(middle):
            return {}
        size = np.maximum(np.abs(middle).max(axis=1), 1e-6)
        moved = np.zeros(len(middle), dtype=bool)
        for matrices in self._matrices.values():
            moved |= np.abs(matrices - middle).max(axis=1) > 1e-6 * size
        for index in np.flatnonzero(moved & (self._levels > 0)).tolist():
            level = int(self._levels[index])
            steps = [self._matrices[i / 2**level][index] for i in range(2**level + 1)]
            if not np.isfinite(steps).all():
                continue
            rows = finer([Matrix(m.reshape(4, 4).T.tolist()) for m in steps])
            which[index] = known.setdefault(rows.tobytes(), len(maps))
            if which[index] == len(maps):
                maps.append(rows)
        return {"objects": maps, "object_motion": which} if maps else {}

    def _camera_values(self, eye: int) -> dict[str, Any]:
        if not self._camera_level:
            return {}
        ordered = [self._cameras[i / 2**self._camera_level][eye] for i in range(2**self._camera_level + 1)]
        views = np.array([view for _, view in ordered], dtype=np.float32)
        turned = any(matrix != ordered[0][0] for matrix, _ in ordered)
        zoomed = bool(np.ptp(views, axis=0).any())
        if not turned and not zoomed:
            return {}
        rows = finer([matrix for matrix, _ in ordered])
        values = {"camera": rows}
        if zoomed:
            at = np.linspace(0, len(views) - 1, len(rows))
            columns = [np.interp(at, np.arange(len(views)), column) for column in views.T]
            values["camera_views"] = np.ascontiguousarray(np.stack(columns, axis=1), dtype=np.float32)
        return values

    def _send_shapes(self, deforming: Deforming) -> None:
        count = 2**deforming.level + 1
        shapes = [deforming.shapes.get(i / (count - 1)) for i in range(count)]
        if any(shape is None for shape in shapes):
            return
        values = {}
        for name in ("positions", "normals"):
            arrays = [shape[name] for shape in shapes if shape is not None and name in shape]
            same_size = len(arrays) == count and all(a.shape == arrays[0].shape for a in arrays)
            if name == "positions" and (not same_size or not all(np.isfinite(a).all() for a in arrays)):
                return
            if same_size:
                values[name] = np.ascontiguousarray(np.concatenate(arrays), dtype=np.float32)
        first = values["positions"].reshape(count, -1)
        if np.abs(first - first[0]).max(initial=0.0) > 1e-7 * np.abs(first).max(initial=0.0):
            self.context.session.set_mesh_motion(deforming.handle, values)


def finer(matrices: list[Matrix]) -> F32:
    """Maps at moments spread evenly, column-major, so many that straight lines in between will do: turns go by
    quaternions, the rest linearly."""
    parts = []
    for matrix in matrices:
        turn = matrix.to_quaternion()
        if parts and turn.dot(parts[-1][0]) < 0:
            turn.negate()
        rest = np.array(turn.to_matrix().transposed() @ matrix.to_3x3())
        parts.append((turn, rest, matrix.to_translation()))
    angle = max((a[0].rotation_difference(b[0]).angle for a, b in pairwise(parts)), default=0.0)
    angle = min(angle, 2 * math.pi - angle)
    pieces = max(1, min(math.ceil(angle / MAX_TURN), (MAX_MOMENTS - 1) // max(len(parts) - 1, 1)))
    rows = []
    for (turn0, rest0, place0), (turn1, rest1, place1) in pairwise(parts):
        for piece in range(pieces):
            t = piece / pieces
            linear = turn0.slerp(turn1, t).to_matrix() @ Matrix((rest0 + (rest1 - rest0) * t).tolist())
            rows.append(column_major(Matrix.Translation(place0.lerp(place1, t)) @ linear.to_4x4()))
    rows.append(column_major(matrices[-1]))
    return np.array(rows, dtype=np.float32)


def _has_moment(level: int, moment: float) -> bool:
    return level > 0 and (moment * 2**level).is_integer()


def _object_level(obj: Any, switch: str) -> int:
    cycles = versions.cycles_settings(obj)
    if not cycles.get(switch, True):
        return 0
    return max(1, min(int(cycles.get("motion_steps", 1)), 7))


def _level(record: Record, switch: str) -> int:
    """The steps of a record's object; none where its instancer has none."""
    levels = [_object_level(holder, switch) for holder in record.holders]
    return levels[-1] if all(levels) else 0


def _may_deform(record: Record) -> bool:
    """Whether modifiers, shape keys or the data itself can change the shape from moment to moment."""
    if record.hair is not None:
        return True
    obj = record.holders[-1]
    original = obj.original.data
    return bool(len(obj.modifiers)) or getattr(original, "shape_keys", None) is not None or obj.type != "MESH"


def _positions(data: Any) -> F32:
    position = data.attributes.get("position")
    if position is not None:
        return read_column(position.data, "vector", len(position.data), np.float32, 3)
    if hasattr(data, "vertices"):
        return read_column(data.vertices, "co", len(data.vertices), np.float32, 3)
    if hasattr(data, "position_data"):
        return read_column(data.position_data, "vector", len(data.position_data), np.float32, 3)
    return read_column(data.points, "co", len(data.points), np.float32, 3)


def _reader(context: SyncContext, record: Record, depsgraph: Any) -> Callable[[Any], dict[str, F32] | None]:
    """What reads the shape of the record's geometry from its object at another moment."""
    if record.hair is not None:
        index = record.hair.index

        def hair(obj: Any) -> dict[str, F32] | None:
            source = next((s for s in hair_sources(obj, context.viewport) if s.index == index), None)
            arrays = read_hair(context, source, depsgraph.scene_eval) if source is not None else None
            return {"positions": arrays["positions"]} if arrays is not None else None

        return hair
    if record.dicing is not None:

        def cage(obj: Any) -> dict[str, F32] | None:
            with cage_of(obj.original.evaluated_get(depsgraph), depsgraph) as mesh:
                return {"positions": _positions(mesh)}

        return cage
    kind = type(record.mesh)

    def shape(obj: Any) -> dict[str, F32] | None:
        if not isinstance(obj.data, kind):
            return None
        values = {"positions": _positions(obj.data)}
        normals = _normals(obj.data)
        return values | {"normals": normals} if normals is not None else values

    return shape


def _normals(data: Any) -> F32 | None:
    """The normals that the mesh was sent with, where it is smooth."""
    if not hasattr(data, "polygons"):
        return None
    arrays: dict[str, Any] = {"face_smooth": face_smooth(data)}
    read_normals(data, arrays)
    return arrays.get("corner_normals", arrays.get("vertex_normals"))


def _shutter_table(scene: Any) -> F32:
    curve = scene.render.motion_blur_shutter_curve
    curve.initialize()
    x = np.linspace(0.0, 1.0, SHUTTER_TABLE)
    weight = np.array([max(curve.evaluate(curve.curves[0], float(v)), 0.0) for v in x])
    total = np.concatenate([[0.0], np.cumsum(0.5 * (weight[1:] + weight[:-1]))])
    if not total[-1] > 0:
        return np.array([0.0, 1.0], dtype=np.float32)
    return np.interp(x, total / total[-1], x).astype(np.float32)


def _rolling(scene: Any) -> dict[str, float]:
    cycles = versions.cycles_settings(scene)
    if cycles.get_enum("rolling_shutter_type", ("NONE", "TOP"), "NONE") != "TOP":
        return {}
    return {"rolling_duration": float(cycles.get("rolling_shutter_duration", 0.1))}
