/// Lamps and suns: Blender's units to radiance, by version. Two generations are known by measurement: Blender 3.4's and, from 4.2 on, today's.
#include <algorithm>
#include <cmath>

#include "light/emitter_table.h"

namespace talbot::light {
namespace {

constexpr scene::BlenderVersion kTodaysUnits = 402;

Vec3 column(const Affine& m, int c) {
    return {m.m[0][c], m.m[1][c], m.m[2][c]};
}
Vec3 any_unit(Vec3 v, Vec3 fallback) {
    const Vec3 n = normalize(v);
    return dot(n, n) > 0.5f ? n : fallback;
}

/// Emission of the lamp's own shader: a constant factor, or a program to run (`shader` >= 0) and its estimate.
struct LampShader {
    Rgb factor{1, 1, 1};
    int32_t program_shader = -1;
    float estimate = 1;
};
LampShader lamp_shader(const scene::Light& light, const shader::Programs& programs) {
    LampShader out;
    if (light.shader < 0 || size_t(light.shader) >= programs.shaders.size()) return out;
    const shader::CompiledShader& compiled = programs.shaders[size_t(light.shader)];
    if (compiled.emission_is_constant || compiled.emission < 0) {
        out.factor = compiled.emission_is_constant ? compiled.constant_emission : Rgb{};
        out.estimate = std::abs(mean(out.factor));
        return out;
    }
    out.program_shader = light.shader;
    // An estimate of 0 is only a guess for a program: the lamp must stay reachable.
    out.estimate = std::max(compiled.emission_estimate, 1e-3f);
    return out;
}

/// Directions in the frame of a spot's cone: today's spots are squeezed with their object, 3.4's are not.
ConeFrame cone_frame(const Affine& to_world, bool today) {
    Affine m = to_world;
    if (!today) {
        const Vec3 z = any_unit(column(to_world, 2), {0, 0, 1});
        Vec3 x = column(to_world, 0);
        x = any_unit(x - z * dot(x, z), {1, 0, 0});
        const Vec3 y = cross(z, x);
        for (int r = 0; r < 3; ++r) {
            m.m[r][0] = r == 0 ? x.x : r == 1 ? x.y : x.z;
            m.m[r][1] = r == 0 ? y.x : r == 1 ? y.y : y.z;
            m.m[r][2] = r == 0 ? z.x : r == 1 ? z.y : z.z;
        }
    }
    const Affine inv = inverse(m);
    const auto row = [&](int r) { return Vec3{inv.m[r][0], inv.m[r][1], inv.m[r][2]}; };
    return {row(0), row(1), row(2)};
}

void add_point_or_spot(const scene::Light& light, bool today, Lamp& lamp, Reach& reach) {
    const float r = std::max(light.radius, 0.0f);
    const double pi = M_PI;
    lamp.radius = r;
    if (r > 0) {
        lamp.kind = int32_t(light.soft_falloff || !today ? EmitterKind::FacingDisk : EmitterKind::Sphere);
        lamp.power = lamp.power * float(light.normalize || !today ? 1.0 / (4 * pi * pi * double(r) * double(r)) : 1.0 / pi);
        reach.strength *= mean(lamp.power) * float(pi) * r * r;
    } else {
        lamp.kind = int32_t(EmitterKind::Point);
        lamp.power = lamp.power * float(light.normalize || !today ? 1.0 / (4 * pi) : 1.0 / pi);
        reach.strength *= mean(lamp.power);
    }
    reach.center = lamp.center;
    reach.radius = r;
    lamp.cone = cone_frame(light.to_world, today);
    if (light.type != scene::LightType::Spot) return;

    const double half = std::clamp(double(light.spot_angle) * 0.5, 1e-4, pi / 2);
    const double blend = std::clamp(double(light.spot_blend), 0.0, 1.0);
    lamp.is_spot = 1;
    lamp.axis_power = today ? 0.0f : 1.0f;
    lamp.cos_outer = float(std::cos(half));
    lamp.inv_smooth = blend > 0 ? float(std::min(1.0 / ((1 - std::cos(half)) * blend), 1e12)) : 1e12f;
    lamp.inv_tan_outer = float(1 / std::tan(half));
    // A squeezed cone around a soft spot has no simple bound.
    if (r > 0 && today && !keeps_angles(light.to_world)) return;
    reach.kind = ReachKind::Spot;
    reach.cos_limit = lamp.cos_outer;
    reach.inv_smooth = lamp.inv_smooth;
    reach.cone = lamp.cone;
}

void add_area(const scene::Light& light, bool today, Report& report, Lamp& lamp, Reach& reach, Rect& rect) {
    const Vec3 x = column(light.to_world, 0), y = column(light.to_world, 1), z = column(light.to_world, 2);
    const bool square = light.shape == scene::AreaShape::Square || light.shape == scene::AreaShape::Disk;
    const float size_y = square ? light.size_x : light.size_y;
    rect.center = lamp.center;
    rect.half_x = 0.5f * length(x) * std::abs(light.size_x);
    rect.half_y = 0.5f * length(y) * std::abs(size_y);
    rect.ellipse_area = kPi * rect.half_x * rect.half_y;
    rect.axis_x = any_unit(x, {1, 0, 0});
    rect.axis_y = any_unit(y - rect.axis_x * dot(rect.axis_x, y), {0, 1, 0});
    if (std::abs(dot(x, y)) > 1e-3f * length(x) * length(y)) report.warning("A sheared area light shines as a rectangle", light.name);
    rect.normal = cross(rect.axis_x, rect.axis_y);
    if (dot(rect.normal, z) > 0) rect.normal = -rect.normal;
    const bool ellipse = light.shape == scene::AreaShape::Disk || light.shape == scene::AreaShape::Ellipse;
    rect.is_ellipse = ellipse ? 1.0f : 0.0f;

    const double area = 4.0 * double(rect.half_x) * double(rect.half_y) * (ellipse ? M_PI / 4 : 1.0);
    lamp.kind = int32_t(EmitterKind::Rect);
    const double density = today ? (light.normalize ? 1 / (M_PI * area) : 1 / M_PI) : 1 / (4 * area);
    lamp.power = area > 0 ? lamp.power * float(density) : Rgb{};

    // Spread: max(tan h - tan t, 0) / (tan h - h), written with tan h divided out.
    const double smallest = today ? 0.0 : M_PI / 180;
    double h = 0.5 * std::clamp(double(light.spread), smallest, M_PI);
    if (h < M_PI / 2 * (1 - 1e-5)) {
        // A beam without spread: pi over the cone of 1e-5 rad, kept as a profile of the same flux.
        const bool beam = h < 1e-5;
        h = std::max(h, 1e-5);
        lamp.inv_tan_limit = float(1 / std::tan(h));
        lamp.gain = float(beam ? 3 * M_PI : h <= 0.05 ? 3 * std::tan(h) / (h * h * h) : std::tan(h) / (std::tan(h) - h));
        rect.tan_limit = float(std::tan(h));
        reach.cos_limit = float(std::cos(h));
        reach.inv_tan_limit = lamp.inv_tan_limit;
        reach.gain = lamp.gain;
    }
    reach.kind = ReachKind::Oriented;
    reach.center = rect.center;
    reach.radius = ellipse ? std::max(rect.half_x, rect.half_y) : std::hypot(rect.half_x, rect.half_y);
    reach.axis = rect.normal;
    reach.behind = 0;
    reach.strength *= mean(lamp.power) * float(area);
}

/// Rays that may hit the lamp.
template <class LampOrSun>
void set_hit_visibility(const scene::Light& light, LampOrSun& out) {
    const uint32_t camera = light.visibility & scene::kVisibleCamera, others = light.use_mis ? light.visibility & ~camera : 0;
    const bool linked = light.linking.blockers >= 0;
    out.hit_visibility = int32_t(scene::with_catcher_bits(linked ? camera : camera | others, light.is_shadow_catcher));
    out.linked_visibility = linked ? int32_t(scene::with_catcher_bits(others, light.is_shadow_catcher)) : 0;
}

void add_sun(const scene::Light& light, scene::Handle handle, int32_t light_group, bool today, const LampShader& own, EmitterTable& table) {
    Sun sun;
    sun.direction = any_unit(column(light.to_world, 2), {0, 0, 1});
    Vec3 x = column(light.to_world, 0);
    sun.axis_x = any_unit(x - sun.direction * dot(sun.direction, x), {1, 0, 0});
    sun.axis_y = cross(sun.direction, sun.axis_x);
    const double half = std::clamp(double(light.sun_angle) * 0.5, 0.0, today ? M_PI / 2 : 89.0 * M_PI / 180);
    const double s = std::sin(half), t = std::tan(half);
    double factor = 1;
    if (half > 1e-6) {
        sun.cos_half = float(std::cos(half));
        sun.one_minus_cos = float(2 * std::sin(half / 2) * std::sin(half / 2));
        sun.tangent_profile = !today;
        factor = today ? (light.normalize ? 1 / (M_PI * s * s) : 1.0) : 1 / (M_PI * t * t);
    }
    sun.power = light.color * own.factor * float(double(light.power) * factor);
    sun.program_shader = own.program_shader;
    sun.visibility = int32_t(scene::with_catcher_bits(light.visibility, light.is_shadow_catcher));
    set_hit_visibility(light, sun);
    sun.blockers = light.cast_shadow ? int32_t(shadow_mask(light.linking)) : 0;
    sun.receivers = light.linking.receivers;
    sun.max_bounces = light.max_bounces;
    sun.light_group = light_group;
    sun.handle = handle;
    sun.to_world = light.to_world;
    sun.to_object = inverse(light.to_world);
    if (is_finite(sun.power) && max_component(vec3(std::abs(mean(sun.power)))) > 0) table.suns.push_back(sun);
}

}  // namespace

void add_lamps(const scene::Scene& scene, const shader::Programs& programs, Report& report, EmitterTable& table) {
    const bool today = scene.settings.version >= kTodaysUnits;
    for (size_t i = 0; i < scene.lights.size(); ++i) {
        const scene::Light& light = scene.lights[i];
        if (light.is_portal || light.visibility == 0) continue;
        const LampShader own = lamp_shader(light, programs);
        const int32_t group = scene::known_light_group(scene, light.light_group);
        if (light.type == scene::LightType::Sun) {
            add_sun(light, scene::Handle(i), group, today, own, table);
            continue;
        }

        Lamp lamp;
        Reach reach;
        lamp.center = column(light.to_world, 3);
        lamp.power = light.color * own.factor * light.power;
        lamp.program_shader = own.program_shader;
        lamp.visibility = int32_t(scene::with_catcher_bits(light.visibility, light.is_shadow_catcher));
        set_hit_visibility(light, lamp);
        lamp.blockers = light.cast_shadow ? int32_t(shadow_mask(light.linking)) : 0;
        lamp.receivers = light.linking.receivers;
        lamp.max_bounces = light.max_bounces;
        lamp.light_group = group;
        lamp.handle = scene::Handle(i);
        lamp.to_world = light.to_world;
        lamp.to_object = inverse(light.to_world);
        reach.strength = own.program_shader >= 0 ? own.estimate : 1.0f;
        if (light.type == scene::LightType::Area) {
            Rect rect;
            add_area(light, today, report, lamp, reach, rect);
            lamp.rect = int32_t(table.rects.size());
            table.rects.push_back(rect);
        } else {
            add_point_or_spot(light, today, lamp, reach);
        }
        // Lamps may have negative power; the choice needs its size only.
        reach.strength = std::abs(reach.strength);
        if (!is_finite(lamp.power) || !is_finite(lamp.center) || !std::isfinite(reach.strength)) {
            report.warning("A light with infinite power or position is left out", light.name);
            continue;
        }
        if (reach.strength == 0) continue;
        lamp.emitter = int32_t(table.emitters.size());
        table.emitters.push_back({lamp.kind, int32_t(table.lamps.size()), -1, lamp.rect});
        table.reach.push_back(reach);
        table.receivers.push_back(lamp.receivers);
        table.lamps.push_back(lamp);
    }
}

}  // namespace talbot::light
