#include <cmath>

#include "geometry/surface.h"
#include "scene/motion.h"

namespace talbot::geometry {
inline namespace TALBOT_ISA {
namespace {

/// From the triangle to the curved surface over it, on the side of `side`; zero where the triangle is flat.
Vec3 smooth_offset(const scene::SceneView& scene, const shader::ShadingSpan& span, int i, Vec3 side) {
    const scene::MeshView& mesh = scene.meshes[scene::traits_of(scene, span.object[i]).mesh];
    if (mesh.kind != scene::GeometryKind::Triangles) return {};
    const size_t triangle = size_t(span.primitive[i]);
    const bool by_corner = mesh.corner_normals && mesh.triangle_corners;
    if (!by_corner && !mesh.vertex_normals) return {};
    if (mesh.triangle_smooth && !mesh.triangle_smooth[triangle]) return {};

    const uint32_t* vertices = mesh.triangle_vertices + 3 * triangle;
    const uint32_t* corners = by_corner ? mesh.triangle_corners + 3 * triangle : vertices;
    const Vec3* normals = by_corner ? mesh.corner_normals : mesh.vertex_normals;
    const float time = span.time ? span.time[i] : 0.5f;
    const scene::Placement placed = scene::placement_at(scene, span.object[i], time);
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

void shadow_origins(const scene::SceneView& scene, const shader::ShadingSpan& span, ConstColumns3 normal, ConstColumns3 direction, const float* error,
                    const int32_t* list, int count, Columns3 origin) {
    const int n = span.n;
    offset_origin(span.p, span.n_g, direction, error, n, origin);
    float cutoff[kSpan], amount[kSpan];
    for (int i = 0; i < n; ++i) cutoff[i] = scene::traits_of(scene, span.object[i]).geometry_offset;
    ConstColumn sx = normal.x, sy = normal.y, sz = normal.z, gx = span.n_g.x, gy = span.n_g.y, gz = span.n_g.z;
    ConstColumn dx = direction.x, dy = direction.y, dz = direction.z;
    TALBOT_VECTOR_LOOP
    for (int i = 0; i < n; ++i) {
        const float towards = sx[i] * dx[i] + sy[i] * dy[i] + sz[i] * dz[i], smooth = std::fabs(towards);
        const float front = gx[i] * dx[i] + gy[i] * dy[i] + gz[i] * dz[i], flat = towards < 0.0f ? -front : front;
        const float g = cutoff[i], part = smooth < g ? 2.0f - (flat + smooth) / g : 1.0f - flat / g;
        amount[i] = g > 0.0f ? saturate(part) : 0.0f;
    }
    for (int k = 0; k < count; ++k) {
        const int i = list[k];
        if (!(amount[i] > 0.0f)) continue;
        const Vec3 n_g = load(span.n_g, i), side = dot(load(normal, i), load(direction, i)) < 0.0f ? -n_g : n_g;
        const Vec3 offset = smooth_offset(scene, span, i, side) * amount[i];
        // A light behind the flat triangle is seen from its front: from behind, everything would be dark.
        if (dot(offset, offset) > 0.0f) store(origin, i, load(span.p, i) + offset + n_g * way_off_surface(error[i], dot(n_g, side)));
    }
}

}  // namespace TALBOT_ISA
}  // namespace talbot::geometry
