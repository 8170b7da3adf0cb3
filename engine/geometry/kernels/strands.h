/// Shading points of curves and spheres, one lane at a time: hair is bound by memory and tracing. Conventions in surface.h.
#pragma once

#include <cmath>

#include "scene/curve.h"
#include "shader/shading.h"

namespace talbot::geometry {
inline namespace TALBOT_ISA {

TALBOT_INLINE float sum_of_sizes(Vec3 p) {
    return std::fabs(p.x) + std::fabs(p.y) + std::fabs(p.z);
}

/// Lane i of the span. `hit_point` gives where the ray met the curve, world space; asked for thick curves only.
template <class HitPoint>
TALBOT_INLINE void shade_curve(const scene::Placement& object, const scene::MeshView& mesh, int i, const HitPoint& hit_point, shader::ShadingSpan& out,
                               float* error) {
    const float time = out.time ? out.time[i] : 0.5f;
    const scene::CurveSegment curve = scene::curve_segment(mesh, out.primitive[i], time);
    const float u = out.u[i], radius = curve_radius(curve, u);
    const Vec3 tangent = normalize(curve_tangent(curve, u));
    const Vec3 viewer = normalize(transform_direction(object.to_object, load(out.wo, i)));
    Vec3 across = cross(tangent, viewer);
    const float across2 = dot(across, across);
    if (across2 > 1e-12f) {
        across = across * (1.0f / std::sqrt(across2));
    } else {
        Vec3 other;
        make_basis(tangent, across, other);
    }
    const Vec3 front = cross(across, tangent);

    Vec3 center = curve_point(curve, u), outward = front;
    const float sine = clampf(out.v[i], -1.0f, 1.0f);
    if (mesh.curve_shape == scene::CurveShape::Ribbon) {
        // The tracer's ribbon is made of straight pieces; so is the fibre around it, or a ray might start on the wrong side of a piece.
        const float pieces = float(mesh.ribbon_pieces), piece = minf(std::floor(u * pieces), pieces - 1.0f);
        center = lerp(curve_point(curve, piece / pieces), curve_point(curve, (piece + 1.0f) / pieces), u * pieces - piece);
        out.v[i] = sine;
        outward = across * sine + front * safe_sqrt(1.0f - sine * sine);
    } else {
        // Round ends are round: not only across.
        const Vec3 offset = transform_point(object.to_object, hit_point()) - center;
        if (dot(offset, offset) > 0.25f * radius * radius && dot(offset, offset) > 0.0f) outward = normalize(offset);
        out.v[i] = 0.0f;
    }
    const Vec3 normal = normalize(transform_normal(object.to_object, outward));
    const Vec3 p = transform_point(object.to_world, center + outward * radius);
    store(out.p, i, p);
    store(out.n_s, i, normal);
    store(out.n_g, i, normal);
    out.backfacing[i] = 0;
    const float world_radius = radius * length(transform_direction(object.to_world, outward));
    // A twentieth of it keeps rays off the front: enough for what rounding makes of the position.
    error[i] = -maxf(world_radius, 1e-20f) - 2e-5f * sum_of_sizes(p);
}

/// A sphere at its hit point, world space.
TALBOT_INLINE void shade_sphere(const scene::Placement& object, const scene::MeshView& mesh, int i, Vec3 hit_point, shader::ShadingSpan& out, float* error) {
    const float time = out.time ? out.time[i] : 0.5f;
    const size_t point = size_t(out.primitive[i]);
    const Vec3 center = scene::position_at(mesh, point, time);
    const float radius = mesh.radii[point];
    const Vec3 wo = load(out.wo, i);
    Vec3 outward = transform_point(object.to_object, hit_point) - center;
    if (!(dot(outward, outward) > 0.0f)) outward = transform_direction(object.to_object, wo);
    outward = normalize(outward);
    const Vec3 offset = transform_direction(object.to_world, outward), normal = normalize(offset);
    const Vec3 p = transform_point(object.to_world, center + outward * radius);
    const bool back = dot(normal, wo) < 0.0f;
    const Vec3 n = back ? -normal : normal;
    store(out.p, i, p);
    store(out.n_s, i, n);
    store(out.n_g, i, n);
    out.u[i] = out.v[i] = 0.0f;
    out.backfacing[i] = back ? 1 : 0;
    // The tracer's distance and this point are each off by a few roundings of where things are, and of the radius.
    const float world_radius = radius * length(offset);
    error[i] = 1e-4f * world_radius + 2e-6f * sum_of_sizes(p);
}

}  // namespace TALBOT_ISA
}  // namespace talbot::geometry
