#include "python/values.h"

#include <algorithm>

#include "base/error.h"

namespace talbot::python {
namespace {

using namespace talbot::scene;

constexpr const char* kFilters[] = {"box", "gaussian", "blackman_harris"};
constexpr const char* kCameraTypes[] = {"perspective", "orthographic", "panoramic"};
constexpr const char* kPanoramaTypes[] = {"equirectangular",   "equiangular_cubemap", "mirrorball",         "fisheye_equidistant",
                                          "fisheye_equisolid", "fisheye_polynomial",  "central_cylindrical"};
constexpr const char* kLightTypes[] = {"point", "spot", "sun", "area"};
constexpr const char* kAreaShapes[] = {"square", "rectangle", "disk", "ellipse"};
constexpr const char* kAlphaModes[] = {"straight", "premultiplied", "channel_packed", "none"};
constexpr const char* kDisplacementMethods[] = {"bump", "displacement", "both"};
/// In the order of PassKind.
constexpr const char* kPasses[] = {"combined",
                                   "depth",
                                   "normal",
                                   "position",
                                   "uv",
                                   "mist",
                                   "object_index",
                                   "material_index",
                                   "diffuse_direct",
                                   "diffuse_indirect",
                                   "diffuse_color",
                                   "glossy_direct",
                                   "glossy_indirect",
                                   "glossy_color",
                                   "transmission_direct",
                                   "transmission_indirect",
                                   "transmission_color",
                                   "emission",
                                   "environment",
                                   "denoising_albedo",
                                   "denoising_normal",
                                   "sample_count",
                                   "shadow_catcher"};
static_assert(std::size(kPasses) == size_t(PassKind::ShadowCatcher) + 1);

void require(bool ok, const char* message) {
    if (!ok) throw Error(message);
}

}  // namespace

Settings read_settings(const py::dict& values) {
    Settings s;
    Fields f(values, "Settings");
    f("version", s.version);
    f("width", s.width);
    f("height", s.height);
    f("crop_x", s.crop_x);
    f("crop_y", s.crop_y);
    f("crop_width", s.crop_width);
    f("crop_height", s.crop_height);
    f("samples", s.samples);
    f("first_sample", s.first_sample);
    f("seed", s.seed);
    f("time_limit", s.time_limit);
    f("adaptive", s.adaptive);
    f("adaptive_threshold", s.adaptive_threshold);
    f("adaptive_min_samples", s.adaptive_min_samples);
    f("max_bounces", s.max_bounces);
    f("diffuse_bounces", s.diffuse_bounces);
    f("glossy_bounces", s.glossy_bounces);
    f("transmission_bounces", s.transmission_bounces);
    f("volume_bounces", s.volume_bounces);
    f("transparent_bounces", s.transparent_bounces);
    f("min_light_bounces", s.min_light_bounces);
    f("min_transparent_bounces", s.min_transparent_bounces);
    f("clamp_direct", s.clamp_direct);
    f("clamp_indirect", s.clamp_indirect);
    f("caustics_reflective", s.caustics_reflective);
    f("caustics_refractive", s.caustics_refractive);
    f("filter_glossy", s.filter_glossy);
    f("light_threshold", s.light_threshold);
    f("filter", s.filter, kFilters);
    f("filter_width", s.filter_width);
    f("film_exposure", s.film_exposure);
    f("film_transparent", s.film_transparent);
    f("film_transparent_glass", s.film_transparent_glass);
    f("film_transparent_roughness", s.film_transparent_roughness);
    f("mist_start", s.mist_start);
    f("mist_depth", s.mist_depth);
    f("mist_falloff", s.mist_falloff);
    f("pass_alpha_threshold", s.pass_alpha_threshold);
    f("use_emission_sampling", s.use_emission_sampling);
    f("threads", s.threads);
    f("ocio_config", s.ocio_config);
    f("working_space", s.working_space);
    f("luminance_weights", std::span<float>(s.luminance_weights));
    f("instruction_set", s.instruction_set);
    f("offscreen_dicing_scale", s.offscreen_dicing_scale);
    f("viewport", s.viewport);
    f.finish();
    require(s.width >= 1 && s.height >= 1 && s.width <= 65536 && s.height <= 65536, "The picture must have between 1 and 65536 pixels a side");
    const bool crop = s.crop_width > 0 && s.crop_height > 0;
    require(s.crop_width >= 0 && s.crop_height >= 0 && (crop || s.crop_width == s.crop_height), "The render border is empty");
    require(!crop || (s.crop_x >= 0 && s.crop_y >= 0 && s.crop_x <= s.width - s.crop_width && s.crop_y <= s.height - s.crop_height),
            "The render border lies outside the picture");
    require(s.samples >= 1 && s.first_sample >= 0 && s.samples <= (1 << 24) && s.first_sample <= (1 << 30), "The number of samples is out of range");
    require(s.mist_falloff >= 0 && s.mist_falloff <= 2, "Unknown mist falloff");
    return s;
}

Camera read_camera(const py::dict& values) {
    Camera c;
    Fields f(values, "Camera");
    f("type", c.type, kCameraTypes);
    f("panorama", c.panorama, kPanoramaTypes);
    f("to_world", c.to_world);
    f("view", std::span<float>(c.view));
    f("clip_start", c.clip_start);
    f("clip_end", c.clip_end);
    f("aperture_radius", c.aperture_radius);
    f("focus_distance", c.focus_distance);
    f("aperture_blades", c.aperture_blades);
    f("aperture_rotation", c.aperture_rotation);
    f("aperture_ratio", c.aperture_ratio);
    f("fov", c.fov);
    f("lens_mm", c.lens_mm);
    f("sensor_width_mm", c.sensor_width_mm);
    f("sensor_height_mm", c.sensor_height_mm);
    f("latitude_min", c.latitude_min);
    f("latitude_max", c.latitude_max);
    f("longitude_min", c.longitude_min);
    f("longitude_max", c.longitude_max);
    f("polynomial", std::span<float>(c.polynomial));
    f("cylinder", std::span<float>(c.cylinder));
    f.finish();
    return c;
}

World read_world(const py::dict& values) {
    World w;
    Fields f(values, "World");
    f("shader", w.shader);
    f("visibility", w.visibility);
    f("use_importance_map", w.use_importance_map);
    f("map_resolution", w.map_resolution);
    f("max_bounces", w.max_bounces);
    f("sample_as_light", w.sample_as_light);
    f("light_group", w.light_group);
    f.finish();
    return w;
}

Light read_light(const py::dict& values) {
    Light l;
    Fields f(values, "Light");
    f("name", l.name);
    f("type", l.type, kLightTypes);
    f("to_world", l.to_world);
    f("color", l.color);
    f("power", l.power);
    f("normalize", l.normalize);
    f("radius", l.radius);
    f("soft_falloff", l.soft_falloff);
    f("spot_angle", l.spot_angle);
    f("spot_blend", l.spot_blend);
    f("sun_angle", l.sun_angle);
    f("shape", l.shape, kAreaShapes);
    f("size_x", l.size_x);
    f("size_y", l.size_y);
    f("spread", l.spread);
    f("shader", l.shader);
    f("visibility", l.visibility);
    f("cast_shadow", l.cast_shadow);
    f("use_mis", l.use_mis);
    f("is_portal", l.is_portal);
    f("max_bounces", l.max_bounces);
    f("light_group", l.light_group);
    f("random", l.random);
    f("object_color", std::span<float>(l.object_color));
    f("pass_index", l.pass_index);
    f("attributes", l.attributes);
    f("linking", l.linking);
    f("is_shadow_catcher", l.is_shadow_catcher);
    f.finish();
    return l;
}

Image read_image(const py::dict& values) {
    Image i;
    Fields f(values, "Image");
    f("name", i.name);
    f("path", i.path);
    f("bytes", i.bytes);
    f("pixels", i.pixels);
    f("width", i.width);
    f("height", i.height);
    f("pixels_are_float", i.pixels_are_float);
    f("colorspace", i.colorspace);
    f("alpha", i.alpha, kAlphaModes);
    f("tiles", i.tiles);
    f.finish();
    if (!i.pixels.empty() || i.width != 0 || i.height != 0) {
        const bool plausible = i.width > 0 && i.height > 0 && i.width <= 65536 && i.height <= 65536;
        if (!plausible || i.pixels.size() != size_t(i.width) * size_t(i.height) * 4) {
            throw py::value_error("Image '" + i.name + "': 'pixels' must have width * height * 4 numbers");
        }
    }
    return i;
}

Shader read_shader(const py::dict& values) {
    Shader s;
    Fields f(values, "Shader");
    f("pass_index", s.pass_index);
    f("sample_as_light", s.sample_as_light);
    f("emission_front", s.emission_front);
    f("emission_back", s.emission_back);
    f("use_transparent_shadow", s.use_transparent_shadow);
    f("use_bump_map_correction", s.use_bump_map_correction);
    f("displacement", s.displacement, kDisplacementMethods);
    f.finish();
    return s;
}

PassKind pass_kind(const std::string& name) {
    const auto found = std::find_if(std::begin(kPasses), std::end(kPasses), [&](const char* n) { return name == n; });
    if (found == std::end(kPasses)) throw Error("Unknown pass '" + name + "'");
    return PassKind(found - std::begin(kPasses));
}

std::optional<Aov> aov_of(const std::string& name) {
    constexpr std::string_view color = "aov_color:", value = "aov_value:";
    if (name.starts_with(color)) return Aov{name.substr(color.size()), true};
    if (name.starts_with(value)) return Aov{name.substr(value.size()), false};
    return {};
}

std::vector<Aov> read_aovs(const std::vector<std::string>& names) {
    std::vector<Aov> out;
    for (const std::string& name : names) {
        const std::optional<Aov> aov = aov_of(name);
        if (aov && std::find(out.begin(), out.end(), *aov) == out.end()) out.push_back(*aov);
    }
    return out;
}

std::optional<std::string> light_group_of(const std::string& name) {
    constexpr std::string_view prefix = "light_group:";
    if (!name.starts_with(prefix)) return {};
    return name.substr(prefix.size());
}

std::vector<std::string> read_light_groups(const std::vector<std::string>& names) {
    std::vector<std::string> out;
    for (const std::string& name : names) {
        const std::optional<std::string> group = light_group_of(name);
        if (group && std::find(out.begin(), out.end(), *group) == out.end()) out.push_back(*group);
    }
    return out;
}

std::vector<PassKind> read_passes(const std::vector<std::string>& names) {
    std::vector<PassKind> out;
    for (const std::string& name : names) {
        if (aov_of(name) || light_group_of(name)) continue;
        const PassKind kind = pass_kind(name);
        if (std::find(out.begin(), out.end(), kind) == out.end()) out.push_back(kind);
    }
    return out;
}

}  // namespace talbot::python
