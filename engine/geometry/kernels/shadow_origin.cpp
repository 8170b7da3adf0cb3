#include <cmath>

#include "geometry/surface.h"
#include "scene/motion.h"

namespace talbot::geometry {
inline namespace TALBOT_ISA {
namespace {

/// From the triangle to the curved surface over it, on the side of `side`; zero where the triangle is flat.
Vec3 smooth_offset(const scene::SceneView& scene, const shader::ShadingSpan& span, int i, Vec3 side) {
    const scene::ObjectView& object = scene.objects[span.object[i]];
    const scene::MeshView& mesh = scene.meshes[object.mesh];
    if (mesh.kind != scene::GeometryKind::Triangles) return {};
    const size_t triangle = size_t(span.primitive[i]);
    const bool by_corner = mesh.corner_normals && mesh.triangle_corners;
    if (!by_corner && !mesh.vertex_normals) return {};
    if (mesh.triangle_smooth && !mesh.triangle_smooth[triangle]) return {};

    const uint32_t* vertices = mesh.triangle_vertices + 3 * triangle;
    const uint32_t* corners = by_corner ? mesh.triangle_corners + 3 * triangle : vertices;
    const Vec3* normals = by_corner ? mesh.corner_normals : mesh.vertex_normals;
    const float time = span.time ? span.time[i] : 0.5f;
    const scene::Placement placed = scene::placement_at(object, time);
    const float weight[3] = {1.0f - span.u[i] - span.v[i], span.u[i], span.v[i]};
    Vec3 p, n, vertex[3], normal[3];
    for (int k = 0; k < 3; ++k) {
        vertex[k] = transform_point(placed.to_world, scene::position_at(mesh, vertices[k], time));
        normal[k] = normalize(transform_normal(placed.to_object, normals[corners[k]]));
        p = p + vertex[k] * weight[k];
        n = n + normal[k] * weight[k];
    }
    if (dot(n, side) < 0.0f) {
        n = -n;
        for (Vec3& v : normal) v = -v;
    }

    float height = 0.0f, nearest = 3.0e38f;
    for (int k = 0; k < 3; ++k) {
        const int a = (k + 1) % 3, b = (k + 2) % 3;
        height += weight[k] * weight[a] * dot(normal[a] - normal[k], vertex[a] - vertex[k]);
        const float top = maxf(maxf(dot(vertex[a] - vertex[k], normal[k]), dot(vertex[b] - vertex[k], normal[k])), 0.0f);
        nearest = minf(nearest, maxf(dot(vertex[k] - p, normal[k]) + top, 0.0f));
    }
    const Vec3 offset = n * maxf(nearest, 0.5f * height);
    const float length2 = dot(offset, offset);
    return length2 < 1e30f ? offset : Vec3{};  // degenerate normals
}

}  // namespace

Vec3 shadow_origin(const scene::SceneView& scene, const shader::ShadingSpan& span, int i, Vec3 direction, float error) {
    const Vec3 p = load(span.p, i), n_g = load(span.n_g, i);
    const float cutoff = scene.objects[span.object[i]].geometry_offset;
    const float towards = dot(load(span.n_s, i), direction), smooth = std::fabs(towards);
    const Vec3 side = towards < 0.0f ? -n_g : n_g;
    const float flat = dot(side, direction);
    const float amount = cutoff > 0.0f ? saturate(smooth < cutoff ? 2.0f - (flat + smooth) / cutoff : 1.0f - flat / cutoff) : 0.0f;
    Vec3 offset;
    if (amount > 0.0f) offset = smooth_offset(scene, span, i, side) * amount;
    // A light behind the flat triangle is seen from its front: from behind, everything would be dark.
    const bool raised = dot(offset, offset) > 0.0f;
    return p + offset + n_g * way_off_surface(error, dot(n_g, raised ? side : direction));
}

}  // namespace TALBOT_ISA
}  // namespace talbot::geometry
