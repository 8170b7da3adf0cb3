"""Panels of objects while Talbot renders: who sees them, shadow terminator, light and shadow linking, light group.

In Blender before 5.0 most of these are Cycles' own, and in 5.0 their parent has no place for the others.
"""

from typing import Any

import bpy

from .ui import TalbotPanel
from .ui_data import draw_light_group, draw_properties


class ObjectPanel(TalbotPanel):
    """In the object's tab, closed at first."""

    bl_context = "object"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: Any) -> bool:
        return context.object is not None and super().poll(context)


class TALBOT_OBJECT_PT_visibility(ObjectPanel, bpy.types.Panel):
    bl_label = "Ray Visibility"

    def draw(self, context: Any) -> None:
        ob = context.object
        column = self.column()
        draw_properties(column, ob, "visible_camera", "visible_diffuse", "visible_glossy", "visible_transmission")
        draw_properties(column, ob, "visible_volume_scatter", "visible_shadow")
        column.separator()
        draw_properties(column, ob, "is_shadow_catcher", "is_holdout")


class TALBOT_OBJECT_PT_shading(ObjectPanel, bpy.types.Panel):
    bl_label = "Shading"

    @classmethod
    def poll(cls, context: Any) -> bool:
        seen = {"MESH", "CURVE", "SURFACE", "FONT", "META", "CURVES", "POINTCLOUD", "VOLUME", "LIGHT"}
        # Instances take the light group of an empty.
        return super().poll(context) and context.object.type in seen | {"EMPTY"}

    def draw(self, context: Any) -> None:
        draw_light_group(self.column(), context.object, context.view_layer)


class TALBOT_OBJECT_PT_shadow_terminator(ObjectPanel, bpy.types.Panel):
    bl_label = "Shadow Terminator"
    bl_parent_id = "TALBOT_OBJECT_PT_shading"

    @classmethod
    def poll(cls, context: Any) -> bool:
        return super().poll(context) and context.object.type == "MESH"

    def draw(self, context: Any) -> None:
        ob = context.object
        names = ("shadow_terminator_geometry_offset", "shadow_terminator_shading_offset")
        owner = ob if hasattr(ob, names[0]) else getattr(ob, "cycles", None)
        draw_properties(self.column(), owner, *names, "shadow_terminator_offset")


class _LinkingPanel(ObjectPanel):
    """The collection of receivers or of blockers (`who`) of what an object emits. From 4.0 on."""

    bl_parent_id = "TALBOT_OBJECT_PT_shading"
    who: str

    @classmethod
    def poll(cls, context: Any) -> bool:
        return super().poll(context) and hasattr(context.object, "light_linking") and context.object.type != "EMPTY"

    def draw(self, context: Any) -> None:
        linking = context.object.light_linking
        collection = f"{self.who}_collection"
        column = self.column()
        column.template_ID(linking, collection, new=f"object.light_linking_{collection}_new")
        if getattr(linking, collection) is None:
            return
        row = column.row()
        row.column().template_light_linking_collection(row, linking, collection)
        buttons = row.column(align=True)
        buttons.operator(f"object.light_linking_{self.who}s_link", icon="ADD", text="").link_state = "INCLUDE"
        buttons.operator("object.light_linking_unlink_from_collection", icon="REMOVE", text="")
        buttons.operator(f"object.light_linking_{self.who}s_select", icon="RESTRICT_SELECT_OFF", text="")


class TALBOT_OBJECT_PT_light_linking(_LinkingPanel, bpy.types.Panel):
    bl_label = "Light Linking"
    who = "receiver"


class TALBOT_OBJECT_PT_shadow_linking(_LinkingPanel, bpy.types.Panel):
    bl_label = "Shadow Linking"
    who = "blocker"


CLASSES = (
    TALBOT_OBJECT_PT_visibility,
    TALBOT_OBJECT_PT_shading,
    TALBOT_OBJECT_PT_shadow_terminator,
    TALBOT_OBJECT_PT_light_linking,
    TALBOT_OBJECT_PT_shadow_linking,
)
