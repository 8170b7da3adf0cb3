#include "geometry/surface.h"

#include <cmath>

#include "geometry/kernels/strands.h"

namespace talbot::geometry {
inline namespace TALBOT_ISA {
namespace {

constexpr int kBlock = 64;              ///< lanes whose vertices are fetched before the arithmetic; stays in the first-level cache
constexpr float kEps = 5.9604645e-08f;  ///< 2^-24

/// Vertices and normals of a block's triangles, object space. `flat` is 1 where the geometric normal is asked for.
struct Corners {
    alignas(64) float p[9][kBlock];
    alignas(64) float n[9][kBlock];
    alignas(64) int32_t flat[kBlock];
    alignas(64) float u[kBlock], v[kBlock];
    alignas(64) int32_t object[kBlock], primitive[kBlock];
};

TALBOT_INLINE void fetch(const Vec3* __restrict from, const uint32_t* index, int k, float (&to)[9][kBlock]) {
    for (int corner = 0; corner < 3; ++corner) {
        const Vec3 p = from[index[corner]];
        to[3 * corner][k] = p.x;
        to[3 * corner + 1][k] = p.y;
        to[3 * corner + 2][k] = p.z;
    }
}

/// For lanes that others shade: something harmless.
TALBOT_INLINE void clear_lane(int k, Corners& c) {
    for (auto& column : c.p) column[k] = 0;
    for (auto& column : c.n) column[k] = 0;
    c.flat[k] = 1;
}

/// The same a moment of the shutter: `moving` holds what `from` holds, step by step, `count` elements each.
TALBOT_INLINE void fetch_moving(const Vec3* moving, uint32_t count, int steps, float time, const uint32_t* index, int k, float (&to)[9][kBlock]) {
    const scene::MotionStep m = scene::motion_step(steps, time);
    const Vec3* at = moving + size_t(m.step) * count;
    for (int corner = 0; corner < 3; ++corner) {
        const Vec3 p = lerp(at[index[corner]], at[size_t(count) + index[corner]], m.part);
        to[3 * corner][k] = p.x;
        to[3 * corner + 1][k] = p.y;
        to[3 * corner + 2][k] = p.z;
    }
}

TALBOT_INLINE void fetch_lane(const scene::MeshView& mesh, int k, float time, Corners& c) {
    if (mesh.kind != scene::GeometryKind::Triangles) return clear_lane(k, c);
    const size_t triangle = size_t(c.primitive[k]);
    const uint32_t* vertices = mesh.triangle_vertices + 3 * triangle;
    if (mesh.motion_positions)
        fetch_moving(mesh.motion_positions, mesh.position_count, mesh.motion_steps, time, vertices, k, c.p);
    else
        fetch(mesh.positions, vertices, k, c.p);
    const bool by_corner = mesh.corner_normals && mesh.triangle_corners;
    const bool smooth = (by_corner || mesh.vertex_normals) && (!mesh.triangle_smooth || mesh.triangle_smooth[triangle]);
    c.flat[k] = !smooth;
    if (smooth && mesh.motion_normals)
        fetch_moving(mesh.motion_normals, mesh.normal_count, mesh.motion_steps, time, by_corner ? mesh.triangle_corners + 3 * triangle : vertices, k, c.n);
    else if (smooth)
        fetch(by_corner ? mesh.corner_normals : mesh.vertex_normals, by_corner ? mesh.triangle_corners + 3 * triangle : vertices, k, c.n);
    else
        for (auto& column : c.n) column[k] = 0;
}

TALBOT_INLINE Vec3 abs3(Vec3 a) {
    return {std::fabs(a.x), std::fabs(a.y), std::fabs(a.z)};
}
TALBOT_INLINE Vec3 max3(Vec3 a, Vec3 b) {
    return {maxf(a.x, b.x), maxf(a.y, b.y), maxf(a.z, b.z)};
}
TALBOT_INLINE Affine abs_affine(const Affine& a) {
    Affine r;
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 4; ++j) r.m[i][j] = std::fabs(a.m[i][j]);
    return r;
}

/// Sum of the components: bounds the length of a vector without negative ones, for want of a root.
TALBOT_INLINE float sum3(Vec3 a) {
    return a.x + a.y + a.z;
}

/// The affine map at `offset` floats into the scene's objects: gathers, when the compiler vectorises.
TALBOT_INLINE Affine load_affine(const float* __restrict base, int32_t offset) {
    Affine a;
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 4; ++j) a.m[i][j] = base[offset + 4 * i + j];
    return a;
}

struct ShadeColumns {
    Column px, py, pz, nsx, nsy, nsz, ngx, ngy, ngz, error;
    ConstColumn wox, woy, woz;
    IntColumn backfacing;
};

/// One lane. `sign` is -1 where the map mirrors, so that the normal keeps pointing out.
TALBOT_INLINE void shade_lane(const Corners& c, int k, const Affine& to_world, const Affine& to_object, float sign, const ShadeColumns& out) {
    const Vec3 a{c.p[0][k], c.p[1][k], c.p[2][k]}, b{c.p[3][k], c.p[4][k], c.p[5][k]}, d{c.p[6][k], c.p[7][k], c.p[8][k]};
    const Vec3 e1 = b - a, e2 = d - a;

    // Geometric normal from the edges in world space, scaled so that neither tiny nor huge triangles leave the range of floats.
    const Vec3 w1 = transform_direction(to_world, e1), w2 = transform_direction(to_world, e2);
    const float extent = max_component(max3(abs3(w1), abs3(w2)));
    const float scale = extent > 0 ? 1.0f / extent : 0.0f;
    const Vec3 s1 = w1 * scale, s2 = w2 * scale, s3 = s2 - s1;
    const Vec3 area = cross(s1, s2);
    const float area2 = dot(area, area);
    const float inv_area = area2 > 0 ? 1.0f / std::sqrt(area2) : 0.0f;
    const Vec3 n = area * (inv_area * sign);

    // Error box (derivation in the header).
    const Affine m = abs_affine(to_world), inv = abs_affine(to_object);
    const Vec3 world = transform_point(m, max3(abs3(a), max3(abs3(b), abs3(d))));
    const Vec3 box = (world * 14.0f + transform_direction(m, transform_point(inv, world)) * 10.0f) * kEps;
    const float box_length = sum3(box);

    // Keep away from the edges: the height over edge i of a triangle with area A is 2 A / |edge i|.
    const float reach = 2.0f * box_length * scale * inv_area;
    const float l1 = sum3(abs3(s1)), l2 = sum3(abs3(s2)), l3 = sum3(abs3(s3));
    const float margin_a = minf(reach * l3, 0.25f), margin_b = minf(reach * l2, 0.25f), margin_c = minf(reach * l1, 0.25f);
    float u = maxf(c.u[k], margin_b), v = maxf(c.v[k], margin_c);
    const float sum = u + v;
    const float shrink = minf(1.0f, (1.0f - margin_a) / maxf(sum, 1e-20f));
    u *= shrink;
    v *= shrink;
    const Vec3 p = transform_point(to_world, a + (e1 * u + e2 * v));

    // The tracer's own normal is a cross product of rounded edges: what it loses, times how far the vertices are. Capped at
    // 2.4e-4 of the longest edge, reached by triangles 1000 times as long as high.
    const Vec3 reach1 = abs3(s1), reach2 = abs3(s2);
    const Vec3 lost{reach1.y * reach2.z + reach1.z * reach2.y, reach1.z * reach2.x + reach1.x * reach2.z, reach1.x * reach2.y + reach1.y * reach2.x};
    const float sliver = extent * (4.0f * kEps) * minf(dot(max3(reach1, reach2), lost) * inv_area, 1024.0f);
    const float error = dot(box, abs3(n)) + box_length * 0.001953125f + sliver;

    const float w = 1.0f - c.u[k] - c.v[k];
    const Vec3 na{c.n[0][k], c.n[1][k], c.n[2][k]}, nb{c.n[3][k], c.n[4][k], c.n[5][k]}, nc{c.n[6][k], c.n[7][k], c.n[8][k]};
    const Vec3 smooth = transform_normal(to_object, na * w + (nb * c.u[k] + nc * c.v[k]));
    const float smooth2 = dot(smooth, smooth);
    const bool is_flat = c.flat[k] != 0 || !(smooth2 > 1e-30f) || !(smooth2 < 1e30f);
    const float inv_smooth = 1.0f / std::sqrt(is_flat ? 1.0f : smooth2);
    const Vec3 ns{is_flat ? n.x : smooth.x * inv_smooth, is_flat ? n.y : smooth.y * inv_smooth, is_flat ? n.z : smooth.z * inv_smooth};

    const bool back = n.x * out.wox[k] + n.y * out.woy[k] + n.z * out.woz[k] < 0;
    const float side = back ? -1.0f : 1.0f;
    out.px[k] = p.x;
    out.py[k] = p.y;
    out.pz[k] = p.z;
    out.ngx[k] = n.x * side;
    out.ngy[k] = n.y * side;
    out.ngz[k] = n.z * side;
    out.nsx[k] = ns.x * side;
    out.nsy[k] = ns.y * side;
    out.nsz[k] = ns.z * side;
    out.error[k] = error;
    out.backfacing[k] = back ? 1 : 0;
}

TALBOT_INLINE float mirror_sign(const Affine& a) {
    return determinant(a) < 0 ? -1.0f : 1.0f;
}

TALBOT_INLINE void shade_mixed(const scene::SceneView& scene, const Corners& c, int n, const ShadeColumns& out) {
    static_assert(sizeof(scene::Object) % sizeof(float) == 0);
    constexpr int32_t stride = int32_t(sizeof(scene::Object) / sizeof(float)), inverse_stride = int32_t(sizeof(Affine) / sizeof(float));
    const float* __restrict to_world = &scene.objects->to_world.m[0][0];
    const float* __restrict to_object = &scene.to_object->m[0][0];
    TALBOT_VECTOR_LOOP
    for (int k = 0; k < n; ++k) {
        const Affine m = load_affine(to_world, c.object[k] * stride);
        shade_lane(c, k, m, load_affine(to_object, c.object[k] * inverse_stride), mirror_sign(m), out);
    }
}

TALBOT_INLINE void shade_uniform(const scene::SceneView& scene, const Corners& c, int n, const ShadeColumns& out) {
    const Affine to_world = scene.objects[c.object[0]].to_world, to_object = scene.to_object[c.object[0]];
    const float sign = mirror_sign(to_world);
    TALBOT_VECTOR_LOOP
    for (int k = 0; k < n; ++k) shade_lane(c, k, to_world, to_object, sign, out);
}

}  // namespace

void shade_points(const scene::SceneView& scene, const HitColumns& hits, ConstColumns3 origin, const int32_t* index, int n, shader::ShadingSpan& out,
                  float* error) {
    Corners c;
    const auto time_of = [&](int i) { return out.time ? out.time[i] : 0.5f; };
    for (int first = 0; first < n; first += kBlock) {
        const int count = n - first < kBlock ? n - first : kBlock;
        bool uniform = true;
        for (int k = 0; k < count; ++k) {
            const int32_t lane = index[first + k];
            c.object[k] = hits.object[lane];
            c.primitive[k] = hits.primitive[lane];
            c.u[k] = hits.u[lane];
            c.v[k] = hits.v[lane];
            uniform &= c.object[k] == c.object[0];
        }
        __builtin_memcpy(out.object + first, c.object, size_t(count) * sizeof(int32_t));
        __builtin_memcpy(out.primitive + first, c.primitive, size_t(count) * sizeof(int32_t));
        __builtin_memcpy(out.u + first, c.u, size_t(count) * sizeof(float));
        __builtin_memcpy(out.v + first, c.v, size_t(count) * sizeof(float));
        const ShadeColumns columns{out.p.x + first,   out.p.y + first,   out.p.z + first,   out.n_s.x + first,     out.n_s.y + first,
                                   out.n_s.z + first, out.n_g.x + first, out.n_g.y + first, out.n_g.z + first,     error + first,
                                   out.wo.x + first,  out.wo.y + first,  out.wo.z + first,  out.backfacing + first};
        // Vertices lane by lane: what costs is the memory, not the loop. The arithmetic goes over the whole block.
        if (uniform) {
            const scene::MeshView mesh = scene.meshes[scene::traits_of(scene, c.object[0]).mesh];
            for (int k = 0; k < count; ++k) fetch_lane(mesh, k, time_of(first + k), c);
            shade_uniform(scene, c, count, columns);
        } else {
            for (int k = 0; k < count; ++k) fetch_lane(scene.meshes[scene::traits_of(scene, c.object[k]).mesh], k, time_of(first + k), c);
            shade_mixed(scene, c, count, columns);
        }
        // Objects that move: once more, where they are now.
        for (int k = 0; scene.has_motion && k < count; ++k) {
            if (scene::motion_of(scene, c.object[k]).steps == 0) continue;
            const scene::Placement placed = scene::placement_at(scene, c.object[k], time_of(first + k));
            shade_lane(c, k, placed.to_world, placed.to_object, mirror_sign(placed.to_world), columns);
        }
        if (!scene.has_strands) continue;
        for (int k = 0; k < count; ++k) {
            const scene::MeshView& mesh = scene.meshes[scene::traits_of(scene, c.object[k]).mesh];
            if (mesh.kind == scene::GeometryKind::Triangles) continue;
            const scene::Placement placed = scene::placement_at(scene, c.object[k], time_of(first + k));
            const int32_t lane = index[first + k];
            const auto from = [&] { return load(origin, lane) - load(out.wo, first + k) * hits.t[lane]; };
            if (mesh.kind == scene::GeometryKind::Curves) shade_curve(placed, mesh, first + k, from, out, error);
            if (mesh.kind == scene::GeometryKind::Points) shade_sphere(placed, mesh, first + k, from(), out, error);
        }
    }
}

void hit_shaders(const scene::SceneView& scene, const HitColumns& hits, const int32_t* index, int n, int32_t* shader) {
    for (int i = 0; i < n; ++i) {
        const int32_t lane = index[i];
        const scene::TraitsView& traits = scene::traits_of(scene, hits.object[lane]);
        const uint16_t* materials = scene.meshes[traits.mesh].triangle_materials;
        const int32_t slot = materials ? int32_t(materials[hits.primitive[lane]]) : 0;
        const int32_t last = traits.material_count - 1;
        shader[i] = scene.material_slots[traits.material_offset + (slot < last ? slot : last)];
    }
}

void offset_origin(ConstColumns3 p, ConstColumns3 n_g, ConstColumns3 direction, const float* error, int n, Columns3 origin) {
    // Pointers may be equal (origin and p), which only ever touches the same lane.
    const float *px = p.x, *py = p.y, *pz = p.z;
    ConstColumn nx = n_g.x, ny = n_g.y, nz = n_g.z, dx = direction.x, dy = direction.y, dz = direction.z, e = error;
    float *ox = origin.x, *oy = origin.y, *oz = origin.z;
    TALBOT_VECTOR_LOOP
    for (int i = 0; i < n; ++i) {
        const float side = dx[i] * nx[i] + dy[i] * ny[i] + dz[i] * nz[i];
        const float distance = way_off_surface(e[i], side);
        const float x = px[i] + nx[i] * distance, y = py[i] + ny[i] * distance, z = pz[i] + nz[i] * distance;
        ox[i] = x;
        oy[i] = y;
        oz[i] = z;
    }
}

}  // namespace TALBOT_ISA
}  // namespace talbot::geometry
