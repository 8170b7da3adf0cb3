"""Whatever kind of geometry a record shows, as arrays."""

from typing import Any

import bpy

from .context import SyncContext
from .mesh import read_mesh
from .records import Record
from .strands import read_curves, read_hair, read_points
from .subdivision import add_cage, cage_of


def read_record(context: SyncContext, record: Record, depsgraph: Any) -> dict[str, Any] | None:
    """The arrays of a record's geometry. In edit mode the evaluated mesh is empty; the object makes a real one."""
    if record.hair is not None:
        return read_hair(context, record.hair, depsgraph.scene_eval)
    if isinstance(record.mesh, bpy.types.Curves):
        return read_curves(context, record.mesh, depsgraph.scene_eval)
    if isinstance(record.mesh, bpy.types.PointCloud):
        return read_points(context, record.mesh)
    if record.dicing is not None:
        with cage_of(record.holders[-1], depsgraph) as cage:
            arrays = read_mesh(context, cage)
            if arrays is not None:
                add_cage(cage, record.dicing, arrays)
            return arrays
    if not record.mesh.is_editmode:
        return read_mesh(context, record.mesh)
    owner = record.holders[-1]
    try:
        return read_mesh(context, owner.to_mesh())
    finally:
        owner.to_mesh_clear()
