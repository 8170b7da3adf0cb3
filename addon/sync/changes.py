"""What a depsgraph says has changed."""

from dataclasses import dataclass, field
from typing import Any

from .context import id_key

Key = tuple[str, str]
GEOMETRY_KINDS = (
    "Object",
    "Mesh",
    "Curve",
    "MetaBall",
    "TextCurve",
    "SurfaceCurve",
    "Curves",
    "PointCloud",
    "ParticleSettings",
    "Collection",
)


@dataclass
class Changes:
    """What a depsgraph's updates say."""

    geometry: set[Key] = field(default_factory=set)
    shading: set[Key] = field(default_factory=set)
    images: set[Key] = field(default_factory=set)
    all_shaders: bool = False
    all_meshes: bool = False
    objects: bool = False
    lights: bool = False
    scene: bool = False

    def only_shading(self) -> bool:
        """Whether materials and worlds are all that changed."""
        others = self.geometry or self.images or self.all_shaders or self.objects or self.lights or self.scene
        return bool(self.shading) and not others


def read_changes(depsgraph: Any) -> Changes:
    """What the depsgraph's updates ask to be read again."""
    changes = Changes()
    for update in depsgraph.updates:
        kind, name = id_key(update.id)
        if kind in GEOMETRY_KINDS:
            changes.objects = True
            # Settings of particles are nothing but geometry, and Blender does not say so.
            if update.is_updated_geometry or kind == "ParticleSettings":
                changes.geometry.add((kind, name))
        elif kind == "Image":
            changes.images.add((kind, name))
        elif kind == "ShaderNodeTree":
            # The tree of a material comes with the material; a group may be anywhere.
            changes.all_shaders |= not update.id.is_embedded_data
        elif kind in ("Material", "World", "Light"):
            changes.shading.add((kind, name))
            changes.lights |= kind == "Light"
        elif kind == "Scene":
            changes.scene = True
    return changes
