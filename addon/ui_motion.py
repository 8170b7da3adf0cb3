"""Panels of motion blur and curves. The values are Blender's or Cycles' and are shared with it."""

from typing import Any

import bpy

from .ui import TalbotPanel
from .ui_data import draw_properties
from .ui_object import ObjectPanel


class TALBOT_RENDER_PT_motion_blur(TalbotPanel, bpy.types.Panel):
    bl_label = "Motion Blur"
    bl_options = {"DEFAULT_CLOSED"}

    def draw_header(self, context: Any) -> None:
        self.layout.prop(context.scene.render, "use_motion_blur", text="")

    def draw(self, context: Any) -> None:
        render, cycles = context.scene.render, getattr(context.scene, "cycles", None)
        column = self.column()
        column.active = render.use_motion_blur
        draw_properties(column, render if hasattr(render, "motion_blur_position") else cycles, "motion_blur_position")
        column.prop(render, "motion_blur_shutter")
        draw_properties(column, cycles, "rolling_shutter_type")
        if getattr(cycles, "rolling_shutter_type", "NONE") != "NONE":
            column.prop(cycles, "rolling_shutter_duration")


class TALBOT_RENDER_PT_motion_blur_curve(TalbotPanel, bpy.types.Panel):
    bl_label = "Shutter Curve"
    bl_parent_id = "TALBOT_RENDER_PT_motion_blur"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: Any) -> None:
        self.layout.active = context.scene.render.use_motion_blur
        self.layout.template_curve_mapping(context.scene.render, "motion_blur_shutter_curve")


class TALBOT_RENDER_PT_curves(TalbotPanel, bpy.types.Panel):
    bl_label = "Curves"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: Any) -> bool:
        return hasattr(context.scene, "cycles_curves") and super().poll(context)

    def draw(self, context: Any) -> None:
        curves = context.scene.cycles_curves
        column = self.column()
        column.prop(curves, "shape", text="Shape")
        if curves.shape == "RIBBONS":
            column.prop(curves, "subdivisions", text="Curve Subdivisions")


class TALBOT_OBJECT_PT_motion_blur(ObjectPanel, bpy.types.Panel):
    bl_label = "Motion Blur"

    @classmethod
    def poll(cls, context: Any) -> bool:
        return super().poll(context) and getattr(context.object, "cycles", None) is not None

    def draw_header(self, context: Any) -> None:
        self.layout.prop(context.object.cycles, "use_motion_blur", text="")

    def draw(self, context: Any) -> None:
        cycles = context.object.cycles
        column = self.column()
        column.active = context.scene.render.use_motion_blur and cycles.use_motion_blur
        column.prop(cycles, "motion_steps", text="Steps")
        if context.object.type != "CAMERA":
            column.prop(cycles, "use_deform_motion", text="Deformation")


CLASSES = (
    TALBOT_RENDER_PT_motion_blur,
    TALBOT_RENDER_PT_motion_blur_curve,
    TALBOT_RENDER_PT_curves,
    TALBOT_OBJECT_PT_motion_blur,
)
