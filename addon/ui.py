"""Talbot's own panels, where a Cycles user looks for them. Blender's panels are enabled in compat_ui.py."""

from dataclasses import dataclass
from typing import Any

import bpy

from . import native, reports
from .properties import TALBOT_OT_clear_settings, TALBOT_OT_copy_cycles_settings

ENGINE = "TALBOT"


class TalbotPanel:
    """What all panels share."""

    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "render"
    COMPAT_ENGINES = {ENGINE}

    layout: Any

    @classmethod
    def poll(cls, context: Any) -> bool:
        """Only while Talbot renders."""
        return context.engine in cls.COMPAT_ENGINES

    def column(self) -> Any:
        """A column in the style of the properties editor."""
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        return layout.column()


def _props(layout: Any, owner: Any, *names: str) -> None:
    for name in names:
        layout.prop(owner, name)


class TALBOT_RENDER_PT_native(TalbotPanel, bpy.types.Panel):
    """Shown only while the native module cannot be used."""

    bl_label = "Talbot cannot render"

    @classmethod
    def poll(cls, context: Any) -> bool:
        return context.engine in cls.COMPAT_ENGINES and bool(native.problem())

    def draw(self, context: Any) -> None:
        _wrapped(self.layout, native.problem(), "ERROR", context.region.width)


class TALBOT_RENDER_PT_sampling(TalbotPanel, bpy.types.Panel):
    bl_label = "Sampling"

    def draw(self, context: Any) -> None:
        column = self.column()
        column.prop(context.scene.talbot, "use_cycles_settings")
        row = self.layout.row(align=True)
        row.operator(TALBOT_OT_copy_cycles_settings.bl_idname)
        row.operator(TALBOT_OT_clear_settings.bl_idname, text="", icon="LOOP_BACK")


@dataclass(frozen=True)
class Sampling:
    """The settings of a sampling panel, by name: the viewport's and the final render's differ in nothing else."""

    use_threshold: str
    threshold: str
    samples: str
    min_samples: str
    denoise: str
    more: tuple[str, ...] = ()


VIEWPORT_SAMPLING = Sampling(
    "use_preview_adaptive_sampling",
    "preview_adaptive_threshold",
    "preview_samples",
    "preview_adaptive_min_samples",
    "use_preview_denoising",
)
RENDER_SAMPLING = Sampling(
    "use_adaptive_sampling", "adaptive_threshold", "samples", "adaptive_min_samples", "use_denoising", ("time_limit",)
)


class SamplingPanel(TalbotPanel):
    """Noise threshold and samples."""

    bl_parent_id = "TALBOT_RENDER_PT_sampling"
    sampling: Sampling

    def draw(self, context: Any) -> None:
        """The threshold with its switch, then what it changes the meaning of."""
        talbot, names = context.scene.talbot, self.sampling
        adaptive = getattr(talbot, names.use_threshold)
        column = self.column()
        row = column.column(align=True, heading="Noise Threshold").row(align=True)
        row.prop(talbot, names.use_threshold, text="")
        sub = row.row()
        sub.active = adaptive
        sub.prop(talbot, names.threshold, text="")
        column.prop(talbot, names.samples, text="Max Samples" if adaptive else "Samples")
        sub = column.row()
        sub.active = adaptive
        sub.prop(talbot, names.min_samples)
        _props(column, talbot, *names.more)


class DenoisePanel(TalbotPanel):
    """The denoiser's switch and which library there is."""

    bl_label = "Denoise"
    bl_options = {"DEFAULT_CLOSED"}
    sampling: Sampling

    def draw_header(self, context: Any) -> None:
        """The switch."""
        self.layout.prop(context.scene.talbot, self.sampling.denoise, text="")

    def draw(self, context: Any) -> None:
        """The library's version, or that there is none."""
        _draw_denoiser(self.layout, context)


class TALBOT_RENDER_PT_sampling_viewport(SamplingPanel, bpy.types.Panel):
    bl_label = "Viewport"
    sampling = VIEWPORT_SAMPLING


class TALBOT_RENDER_PT_sampling_viewport_denoise(DenoisePanel, bpy.types.Panel):
    bl_parent_id = "TALBOT_RENDER_PT_sampling_viewport"
    sampling = VIEWPORT_SAMPLING


class TALBOT_RENDER_PT_sampling_render(SamplingPanel, bpy.types.Panel):
    bl_label = "Render"
    sampling = RENDER_SAMPLING


class TALBOT_RENDER_PT_sampling_render_denoise(DenoisePanel, bpy.types.Panel):
    bl_parent_id = "TALBOT_RENDER_PT_sampling_render"
    sampling = RENDER_SAMPLING


class TALBOT_RENDER_PT_sampling_advanced(TalbotPanel, bpy.types.Panel):
    bl_label = "Advanced"
    bl_parent_id = "TALBOT_RENDER_PT_sampling"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: Any) -> None:
        talbot = context.scene.talbot
        column = self.column()
        row = column.row(align=True)
        row.prop(talbot, "seed")
        row.prop(talbot, "use_animated_seed", text="", icon="TIME")
        _props(column, talbot, "sample_offset", "min_light_bounces", "min_transparent_bounces")
        column.prop(talbot, "light_sampling_threshold")
        column.prop(talbot, "use_layer_samples")
        column.prop(talbot, "show_tracebacks")


class TALBOT_RENDER_PT_light_paths(TalbotPanel, bpy.types.Panel):
    bl_label = "Light Paths"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: Any) -> None:
        """A heading; the settings are in the panels below it."""


class TALBOT_RENDER_PT_light_paths_max_bounces(TalbotPanel, bpy.types.Panel):
    bl_label = "Max Bounces"
    bl_parent_id = "TALBOT_RENDER_PT_light_paths"

    def draw(self, context: Any) -> None:
        talbot = context.scene.talbot
        column = self.column()
        column.prop(talbot, "max_bounces")
        sub = column.column(align=True)
        _props(sub, talbot, "diffuse_bounces", "glossy_bounces", "transmission_bounces", "volume_bounces")
        column.prop(talbot, "transparent_max_bounces")


class TALBOT_RENDER_PT_light_paths_clamping(TalbotPanel, bpy.types.Panel):
    bl_label = "Clamping"
    bl_parent_id = "TALBOT_RENDER_PT_light_paths"

    def draw(self, context: Any) -> None:
        _props(self.column(), context.scene.talbot, "sample_clamp_direct", "sample_clamp_indirect")


class TALBOT_RENDER_PT_light_paths_caustics(TalbotPanel, bpy.types.Panel):
    bl_label = "Caustics"
    bl_parent_id = "TALBOT_RENDER_PT_light_paths"

    def draw(self, context: Any) -> None:
        column = self.column()
        column.prop(context.scene.talbot, "blur_glossy")
        sub = column.column(heading="Caustics", align=True)
        _props(sub, context.scene.talbot, "caustics_reflective", "caustics_refractive")


class TALBOT_RENDER_PT_film(TalbotPanel, bpy.types.Panel):
    bl_label = "Film"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: Any) -> None:
        self.column().prop(context.scene.talbot, "film_exposure")


class TALBOT_RENDER_PT_film_filter(TalbotPanel, bpy.types.Panel):
    bl_label = "Pixel Filter"
    bl_parent_id = "TALBOT_RENDER_PT_film"

    def draw(self, context: Any) -> None:
        talbot = context.scene.talbot
        column = self.column()
        column.prop(talbot, "pixel_filter_type", text="Type")
        if talbot.pixel_filter_type != "BOX":
            column.prop(talbot, "filter_width")


class TALBOT_RENDER_PT_film_transparent(TalbotPanel, bpy.types.Panel):
    bl_label = "Transparent"
    bl_parent_id = "TALBOT_RENDER_PT_film"

    def draw_header(self, context: Any) -> None:
        self.layout.prop(context.scene.render, "film_transparent", text="")

    def draw(self, context: Any) -> None:
        talbot = context.scene.talbot
        column = self.column()
        column.active = context.scene.render.film_transparent
        column.prop(talbot, "film_transparent_glass")
        sub = column.column()
        sub.active = talbot.film_transparent_glass
        sub.prop(talbot, "film_transparent_roughness")


class TALBOT_RENDER_PT_performance(TalbotPanel, bpy.types.Panel):
    bl_label = "Performance"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: Any) -> None:
        render = context.scene.render
        column = self.column()
        column.prop(render, "threads_mode")
        sub = column.column()
        sub.enabled = render.threads_mode == "FIXED"
        sub.prop(render, "threads")
        column.prop(render, "use_persistent_data", text="Persistent Data")


class TALBOT_RENDER_PT_warnings(TalbotPanel, bpy.types.Panel):
    """What the last render could not do as asked, with the names of the objects and nodes."""

    bl_label = "Warnings"
    MAX_SHOWN = 60

    def draw_header_preset(self, context: Any) -> None:
        """The count stands at the right end, readable while the panel is closed."""
        self.layout.label(text=str(len(_problems(context.scene)) or "none"))

    def draw(self, context: Any) -> None:
        layout = self.layout
        lines = _problems(context.scene)
        if not lines:
            layout.label(text="The last render had no problems", icon="CHECKMARK")
        column = layout.column(align=True)
        for line in lines[: self.MAX_SHOWN]:
            _wrapped(column, str(line), "CANCEL" if line.level == "error" else "ERROR", context.region.width)
        if len(lines) > self.MAX_SHOWN:
            column.label(text=f"and {len(lines) - self.MAX_SHOWN} more")
        for line in reports.of_scene(context.scene.name).lines:
            if line.level == "info":
                _wrapped(layout, str(line), "INFO", context.region.width)


def _problems(scene: Any) -> list[reports.Line]:
    return [line for line in reports.of_scene(scene.name).lines if line.level != "info"]


def _wrapped(layout: Any, text: str, icon: str, width: int) -> None:
    """A label of several rows; Blender's labels do not wrap."""
    scale = bpy.context.preferences.system.ui_scale or 1.0  # 0 without a window
    columns = max(20, int(width / (7 * scale)) - 6)
    row = ""
    rows: list[str] = []
    for word in text.split():
        if row and len(row) + 1 + len(word) > columns:
            rows.append(row)
            row = word
        else:
            row = f"{row} {word}" if row else word
    rows.append(row)
    column = layout.column(align=True)
    for number, part in enumerate(rows):
        column.label(text=part, icon=icon if number == 0 else "BLANK1")


def _draw_denoiser(layout: Any, context: Any) -> None:
    version = native.denoiser_version()
    if version:
        layout.label(text=f"Open Image Denoise {version}", icon="CHECKMARK")
    else:
        text = "Open Image Denoise was not found: pictures stay as rendered. The official Blender builds bring it"
        _wrapped(layout, text, "INFO", context.region.width)


CLASSES = (
    TALBOT_RENDER_PT_native,
    TALBOT_RENDER_PT_sampling,
    TALBOT_RENDER_PT_sampling_viewport,
    TALBOT_RENDER_PT_sampling_viewport_denoise,
    TALBOT_RENDER_PT_sampling_render,
    TALBOT_RENDER_PT_sampling_render_denoise,
    TALBOT_RENDER_PT_sampling_advanced,
    TALBOT_RENDER_PT_light_paths,
    TALBOT_RENDER_PT_light_paths_max_bounces,
    TALBOT_RENDER_PT_light_paths_clamping,
    TALBOT_RENDER_PT_light_paths_caustics,
    TALBOT_RENDER_PT_film,
    TALBOT_RENDER_PT_film_filter,
    TALBOT_RENDER_PT_film_transparent,
    TALBOT_RENDER_PT_performance,
    TALBOT_RENDER_PT_warnings,
)
