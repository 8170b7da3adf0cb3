"""Panels of the view layer while Talbot renders: its passes and what it leaves out."""

from typing import Any

import bpy

from . import passes
from .ui import TalbotPanel


class _LayerPanel(TalbotPanel):
    bl_context = "view_layer"


class TALBOT_VIEWLAYER_PT_passes(_LayerPanel, bpy.types.Panel):
    bl_label = "Data"
    bl_parent_id = "VIEWLAYER_PT_layer_passes"

    def draw(self, context: Any) -> None:
        layer = context.view_layer
        column = self.column()
        sub = column.column(heading="Include")
        sub.prop(layer, "use_pass_combined")
        for switch in ("z", "mist", "position", "normal", "uv"):
            sub.prop(layer, f"use_pass_{switch}")
        sub = column.column(heading="Indexes")
        sub.prop(layer, "use_pass_object_index")
        sub.prop(layer, "use_pass_material_index")
        cycles = getattr(layer, "cycles", None)
        if cycles is not None:
            sub = column.column(heading="Debug")
            sub.prop(cycles, "pass_debug_sample_count", text="Sample Count")
            sub = column.column(heading="Denoising")
            sub.prop(cycles, "use_denoising", text="Denoise This Layer")
            sub.prop(cycles, "denoising_store_passes", text="Denoising Data")


class TALBOT_VIEWLAYER_PT_passes_light(_LayerPanel, bpy.types.Panel):
    bl_label = "Light"
    bl_parent_id = "VIEWLAYER_PT_layer_passes"

    def draw(self, context: Any) -> None:
        layer = context.view_layer
        column = self.column()
        for lobe in ("diffuse", "glossy", "transmission"):
            row = column.row(heading=lobe.title(), align=True)
            for part in ("direct", "indirect", "color"):
                row.prop(layer, f"use_pass_{lobe}_{part}", text=part.title(), toggle=True)
        sub = column.column(heading="Other")
        sub.prop(layer, "use_pass_emit", text="Emission")
        sub.prop(layer, "use_pass_environment")
        if getattr(layer, "cycles", None) is not None:
            sub.prop(layer.cycles, "use_pass_shadow_catcher")
        for name in passes.not_offered(layer):
            column.label(text=f"{name} is not available in Talbot yet", icon="ERROR")


class TALBOT_VIEWLAYER_PT_filter(_LayerPanel, bpy.types.Panel):
    bl_label = "Filter"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: Any) -> None:
        layer = context.view_layer
        column = self.column()
        sub = column.column(heading="Include")
        sub.prop(layer, "use_sky", text="Environment")
        sub.prop(layer, "use_solid", text="Surfaces")
        sub.prop(layer, "use_strand", text="Hair")
        sub.prop(layer, "use_motion_blur", text="Motion Blur")
        if not hasattr(bpy.types, "VIEWLAYER_PT_override"):
            column.prop(layer, "material_override")
            column.prop(layer, "samples")


CLASSES = (TALBOT_VIEWLAYER_PT_passes, TALBOT_VIEWLAYER_PT_passes_light, TALBOT_VIEWLAYER_PT_filter)
