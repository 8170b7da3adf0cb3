"""Panels of objects' data while Talbot renders: lights, camera, world and material settings.

Cycles' own panels for these are hidden from other engines; the values are Blender's or Cycles' and are shared with it.
"""

from typing import Any

import bpy

from .ui import TalbotPanel


def draw_properties(layout: Any, owner: Any, *names: str) -> None:
    """Those of the properties that this Blender has."""
    for name in names:
        if owner is not None and hasattr(owner, name):
            layout.prop(owner, name)


def draw_light_group(layout: Any, owner: Any, view_layer: Any) -> None:
    """The group's name, with a button that makes one of that name."""
    row = layout.row(align=True)
    row.prop_search(owner, "lightgroup", view_layer, "lightgroups", text="Light Group", results_are_suggestions=True)
    button = row.column(align=True)
    button.enabled = bool(owner.lightgroup) and owner.lightgroup not in view_layer.lightgroups
    button.operator("scene.view_layer_add_lightgroup", icon="ADD", text="").name = owner.lightgroup


def _cycles(owner: Any) -> Any:
    return getattr(owner, "cycles", None)


class TALBOT_LIGHT_PT_light(TalbotPanel, bpy.types.Panel):
    bl_label = "Light"
    bl_context = "data"

    @classmethod
    def poll(cls, context: Any) -> bool:
        return context.light is not None and super().poll(context)

    def draw(self, context: Any) -> None:
        light = context.light
        self.layout.row().prop(light, "type", expand=True)
        column = self.column()
        column.prop(light, "color")
        draw_properties(column, light, "use_temperature")
        if getattr(light, "use_temperature", False):
            column.prop(light, "temperature")
        column.prop(light, "energy")
        draw_properties(column, light, "exposure", "normalize")
        column.separator()
        if light.type in {"POINT", "SPOT"}:
            column.prop(light, "shadow_soft_size", text="Radius")
            draw_properties(column, light, "use_soft_falloff")
        elif light.type == "SUN":
            column.prop(light, "angle")
        else:
            column.prop(light, "shape")
            if light.shape in {"SQUARE", "DISK"}:
                column.prop(light, "size")
            else:
                sub = column.column(align=True)
                sub.prop(light, "size", text="Size X")
                sub.prop(light, "size_y", text="Y")
        self._draw_rays(column, light)

    def _draw_rays(self, column: Any, light: Any) -> None:
        cycles = _cycles(light)
        column.separator()
        draw_properties(column, cycles, "max_bounces")
        sub = column.column(align=True)
        sub.active = not (light.type == "AREA" and getattr(cycles, "is_portal", False))
        if cycles is not None and hasattr(cycles, "cast_shadow"):
            sub.prop(cycles, "cast_shadow")
        else:
            sub.prop(light, "use_shadow", text="Cast Shadow")
        draw_properties(sub, cycles, "use_multiple_importance_sampling")
        if light.type == "AREA":
            draw_properties(column, cycles, "is_portal")


class TALBOT_LIGHT_PT_beam(TalbotPanel, bpy.types.Panel):
    bl_label = "Beam Shape"
    bl_parent_id = "TALBOT_LIGHT_PT_light"
    bl_context = "data"

    @classmethod
    def poll(cls, context: Any) -> bool:
        return context.light is not None and context.light.type in {"SPOT", "AREA"} and super().poll(context)

    def draw(self, context: Any) -> None:
        light = context.light
        column = self.column()
        if light.type == "SPOT":
            draw_properties(column, light, "spot_size", "spot_blend", "show_cone")
        else:
            column.prop(light, "spread")


class TALBOT_LIGHT_PT_nodes(TalbotPanel, bpy.types.Panel):
    bl_label = "Nodes"
    bl_context = "data"

    @classmethod
    def poll(cls, context: Any) -> bool:
        return context.light is not None and super().poll(context)

    def draw(self, context: Any) -> None:
        light = context.light
        if light.node_tree is None or not light.use_nodes:
            self.layout.prop(light, "use_nodes", icon="NODETREE")
        else:
            draw_output(self.layout, light, "OUTPUT_LIGHT")


class TALBOT_WORLD_PT_preview(TalbotPanel, bpy.types.Panel):
    bl_label = "Preview"
    bl_context = "world"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: Any) -> bool:
        return context.world is not None and super().poll(context)

    def draw(self, context: Any) -> None:
        self.layout.template_preview(context.world)


class TALBOT_WORLD_PT_settings(TalbotPanel, bpy.types.Panel):
    bl_label = "Settings"
    bl_context = "world"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: Any) -> bool:
        return _cycles(context.world) is not None and super().poll(context)

    def draw(self, context: Any) -> None:
        cycles = context.world.cycles
        column = self.column()
        draw_properties(column, cycles, "sampling_method")
        if cycles.sampling_method == "MANUAL":
            draw_properties(column, cycles, "sample_map_resolution")
        draw_properties(column, cycles, "max_bounces")
        draw_light_group(column, context.world, context.view_layer)


class TALBOT_WORLD_PT_visibility(TalbotPanel, bpy.types.Panel):
    bl_label = "Ray Visibility"
    bl_context = "world"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: Any) -> bool:
        return hasattr(context.world, "cycles_visibility") and super().poll(context)

    def draw(self, context: Any) -> None:
        visibility = context.world.cycles_visibility
        draw_properties(self.column(), visibility, "camera", "diffuse", "glossy", "transmission", "scatter")


class TALBOT_WORLD_PT_mist(TalbotPanel, bpy.types.Panel):
    bl_label = "Mist Pass"
    bl_context = "world"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: Any) -> bool:
        return context.world is not None and super().poll(context)

    def draw(self, context: Any) -> None:
        draw_properties(self.column(), context.world.mist_settings, "start", "depth", "falloff")


class TALBOT_MATERIAL_PT_settings(TalbotPanel, bpy.types.Panel):
    bl_label = "Settings"
    bl_context = "material"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: Any) -> bool:
        return context.material is not None and super().poll(context)

    def draw(self, context: Any) -> None:
        material = context.material
        column = self.column()
        column.prop(material, "pass_index")
        cycles = _cycles(material)
        draw_properties(column, cycles, "sample_as_light", "emission_sampling")
        shadow_owner = cycles if hasattr(cycles, "use_transparent_shadow") else material
        draw_properties(column, shadow_owner, "use_transparent_shadow")
        draw_properties(column, cycles, "use_bump_map_correction")
        draw_properties(column, material, "use_bump_map_correction")


class TALBOT_CAMERA_PT_panorama(TalbotPanel, bpy.types.Panel):
    bl_label = "Panorama"
    bl_context = "data"

    @classmethod
    def poll(cls, context: Any) -> bool:
        return context.camera is not None and context.camera.type == "PANO" and super().poll(context)

    def draw(self, context: Any) -> None:
        camera = context.camera
        owner = camera if hasattr(camera, "panorama_type") else _cycles(camera)
        column = self.column()
        if owner is None:
            column.label(text="Enable the Cycles add-on to choose a panorama", icon="INFO")
            return
        column.prop(owner, "panorama_type")
        kind = owner.panorama_type
        if kind == "EQUIRECTANGULAR":
            draw_properties(column, owner, "latitude_min", "latitude_max", "longitude_min", "longitude_max")
        elif kind in {"FISHEYE_EQUIDISTANT", "FISHEYE_EQUISOLID"}:
            draw_properties(column, owner, *(("fisheye_lens",) if kind.endswith("SOLID") else ()), "fisheye_fov")
        elif kind == "FISHEYE_LENS_POLYNOMIAL":
            draw_properties(column, owner, "fisheye_fov", *(f"fisheye_polynomial_k{power}" for power in range(5)))
        elif kind == "CENTRAL_CYLINDRICAL":
            names = ("range_u_min", "range_u_max", "range_v_min", "range_v_max", "radius")
            draw_properties(column, owner, *(f"central_cylindrical_{name}" for name in names))


def draw_output(layout: Any, owner: Any, output_type: str) -> None:
    """The tree's active output, its sockets unfolded, as the material panels show them."""
    from bpy_extras.node_utils import find_node_input

    layout.use_property_split = True
    tree = owner.node_tree
    output = tree.get_output_node("CYCLES") if hasattr(tree, "get_output_node") else None
    if output is None or output.type != output_type:
        layout.label(text="No output node", icon="INFO")
        return
    socket = find_node_input(output, "Surface")
    if socket is None:
        layout.label(text="Incompatible output node", icon="INFO")
    else:
        layout.template_node_view(tree, output, socket)


CLASSES = (
    TALBOT_LIGHT_PT_light,
    TALBOT_LIGHT_PT_beam,
    TALBOT_LIGHT_PT_nodes,
    TALBOT_WORLD_PT_preview,
    TALBOT_WORLD_PT_settings,
    TALBOT_WORLD_PT_visibility,
    TALBOT_WORLD_PT_mist,
    TALBOT_MATERIAL_PT_settings,
    TALBOT_CAMERA_PT_panorama,
)
