#include "light/kernels/sample_local.h"

#include <algorithm>

#include "light/kernels/moving_mesh.h"

namespace talbot::light {
inline namespace TALBOT_ISA {
namespace {

TALBOT_INLINE void describe_lamp(const EmitterView& table, int32_t index, bool is_delta, int i, LocalSampled& out) {
    const Lamp& lamp = table.lamps[index];
    out.lamp[i] = index;
    out.object[i] = -1;
    out.visibility[i] = lamp.visibility;
    out.blockers[i] = lamp.blockers;
    out.max_bounces[i] = lamp.max_bounces;
    out.only_sampled[i] = is_delta || is_only_sampled(lamp.hit_visibility, lamp.linked_visibility);
}

TALBOT_INLINE void describe_mesh(const MeshEmitter& mesh, int i, LocalSampled& out) {
    out.lamp[i] = -1;
    out.object[i] = mesh.object;
    out.visibility[i] = mesh.visibility;
    out.blockers[i] = mesh.blockers;
    out.max_bounces[i] = INT32_MAX;
    out.only_sampled[i] = 0;
}

template <EmitterKind kind>
TALBOT_INLINE void sample_kind(const EmitterView& table, const LocalGroup& in, LocalSampled& out) {
    const Lamp* __restrict lamps = table.lamps;
    const int n = in.n;
    TALBOT_VECTOR_LOOP
    for (int i = 0; i < n; ++i) {
        const Lamp& lamp = lamps[out.lamp[i]];
        const Vec3 p{in.px[i], in.py[i], in.pz[i]};
        ShapeSample s;
        float gain = 1.0f;
        if constexpr (kind == EmitterKind::Point) {
            const Vec3 to = lamp.center - p;
            const float d2 = dot(to, to);
            s.distance = std::sqrt(d2);
            s.wi = to * (1.0f / maxf(s.distance, 1e-30f));
            gain = 1.0f / maxf(d2, 1e-30f);
            s.pdf = d2 > 0.0f ? 1.0f : 0.0f;
        } else if constexpr (kind == EmitterKind::FacingDisk) {
            s = sample_facing_disk(lamp.center, lamp.radius, p, in.u[i], in.v[i]);
        } else {
            s = sample_sphere(lamp.center, lamp.radius, p, in.u[i], in.v[i]);
        }
        gain *= spot_profile(lamp, -s.wi);
        out.x[i] = s.wi.x;
        out.y[i] = s.wi.y;
        out.z[i] = s.wi.z;
        out.distance[i] = s.distance;
        out.pdf[i] = s.pdf;
        out.r[i] = lamp.power.x * gain;
        out.g[i] = lamp.power.y * gain;
        out.b[i] = lamp.power.z * gain;
    }
}

/// Of each lane: its rectangle, and the profile of its spread.
struct RectColumns {
    int32_t index[kSpan];
    float inv_tan[kSpan], gain[kSpan];
};

/// `kOne`: all lanes have the same rectangle, which then stays in registers. Both ways give the same bits: products are not fused with
/// sums in this file (CMakeLists.txt).
template <bool kOne>
TALBOT_INLINE void sample_rect_lanes(const Rect* __restrict rects, const RectColumns& columns, const LocalGroup& in, LocalSampled& out) {
    const int n = in.n;
    const Rect one = rects[columns.index[0]];
    TALBOT_VECTOR_LOOP
    for (int i = 0; i < n; ++i) {
        const Rect& rect = kOne ? one : rects[columns.index[i]];
        const RectView view = view_rect(rect, {in.px[i], in.py[i], in.pz[i]});
        const ShapeSample s = sample_rect(rect, view, in.u[i], in.v[i]);
        const float x = s.a + view.x, y = s.b + view.y;
        const float profile = spread_profile(columns.inv_tan[i], columns.gain[i], x, y, view.z);
        const float lit = ellipse_margin(rect, s.a, s.b) >= 0.0f ? profile : 0.0f;
        out.x[i] = s.wi.x;
        out.y[i] = s.wi.y;
        out.z[i] = s.wi.z;
        out.distance[i] = s.distance;
        out.pdf[i] = s.pdf;
        out.r[i] *= lit;
        out.g[i] *= lit;
        out.b[i] *= lit;
        out.coordinate_u[i] = s.a;
        out.coordinate_v[i] = s.b;
    }
}

}  // namespace

void sample_point_lamps(const EmitterView& table, EmitterKind kind, const LocalGroup& in, LocalSampled& out) {
    for (int i = 0; i < in.n; ++i) describe_lamp(table, table.emitters[in.emitter[i]].lamp, kind == EmitterKind::Point, i, out);
    switch (kind) {
        case EmitterKind::Point:
            sample_kind<EmitterKind::Point>(table, in, out);
            break;
        case EmitterKind::FacingDisk:
            sample_kind<EmitterKind::FacingDisk>(table, in, out);
            break;
        default:
            sample_kind<EmitterKind::Sphere>(table, in, out);
            break;
    }
    if (!table.has_lamp_programs) return;
    for (int i = 0; i < in.n; ++i) {
        const Lamp& lamp = table.lamps[out.lamp[i]];
        const Vec3 away{-out.x[i], -out.y[i], -out.z[i]};
        const Vec3 p{in.px[i], in.py[i], in.pz[i]};
        const Vec3 normal = kind == EmitterKind::Sphere ? normalize(p - away * out.distance[i] - lamp.center) : away;
        out.nx[i] = normal.x;
        out.ny[i] = normal.y;
        out.nz[i] = normal.z;
        lamp_coordinates(lamp, kind == EmitterKind::Sphere ? normal : away, out.coordinate_u[i], out.coordinate_v[i]);
    }
}

void sample_rects(const EmitterView& table, const shader::Programs& programs, const LocalGroup& in, LocalSampled& out) {
    // Everything that is not geometry first: lamps and meshes that are rectangles share the rest.
    RectColumns columns;
    const int n = in.n;
    const auto describe = [&](int i) {
        const Emitter& emitter = table.emitters[in.emitter[i]];
        columns.index[i] = emitter.rect;
        if (emitter.lamp >= 0) {
            const Lamp& lamp = table.lamps[emitter.lamp];
            store({out.r, out.g, out.b}, i, lamp.power);
            columns.inv_tan[i] = lamp.inv_tan_limit;
            columns.gain[i] = lamp.gain;
            describe_lamp(table, emitter.lamp, false, i, out);
        } else {
            const MeshEmitter& mesh = table.meshes[emitter.mesh];
            store({out.r, out.g, out.b}, i, programs.shaders[size_t(table.triangles[mesh.first].shader)].constant_emission);
            columns.inv_tan[i] = 0.0f;
            columns.gain[i] = 1.0f;
            describe_mesh(mesh, i, out);
        }
    };
    int others = 0;
    for (int i = 0; i < n; ++i) others += in.emitter[i] != in.emitter[0];
    if (others == 0) {
        describe(0);
        for (auto* column : {columns.inv_tan, columns.gain, out.r, out.g, out.b}) std::fill_n(column, n, column[0]);
        for (auto* column : {columns.index, out.lamp, out.object, out.visibility, out.blockers, out.max_bounces, out.only_sampled})
            std::fill_n(column, n, column[0]);
        sample_rect_lanes<true>(table.rects, columns, in, out);
    } else {
        for (int i = 0; i < n; ++i) describe(i);
        sample_rect_lanes<false>(table.rects, columns, in, out);
    }
    if (!table.has_lamp_programs) return;
    for (int i = 0; i < n; ++i) {
        const Rect& rect = table.rects[columns.index[i]];
        out.nx[i] = rect.normal.x;
        out.ny[i] = rect.normal.y;
        out.nz[i] = rect.normal.z;
        rect_coordinates(rect, out.coordinate_u[i], out.coordinate_v[i], out.coordinate_u[i], out.coordinate_v[i]);
    }
}

void sample_meshes(const EmitterView& table, const shader::Programs& programs, const shader::ShaderContext& context, LightScratch& scratch,
                   const LocalGroup& in, LocalSampled& out) {
    const int n = in.n;
    // World-space vertices of each lane's triangle, in columns.
    float v[9][kSpan];
    float choice[kSpan], sides[kSpan];
    int32_t shader[kSpan], primitive[kSpan];
    for (int i = 0; i < n; ++i) {
        const MeshEmitter& mesh = table.meshes[table.emitters[in.emitter[i]].mesh];
        const Affine to_world = map_of(mesh, *context.scene, in.time[i]);
        const int32_t leaf = descend_tree(table.nodes, mesh.root, mesh_query(mesh, to_world, {in.px[i], in.py[i], in.pz[i]}), in.part[i], choice[i]);
        if (leaf < 0) choice[i] = 0.0f;
        const LightTriangle& triangle = table.triangles[mesh.first + (leaf < 0 ? 0 : table.nodes[leaf].item)];
        const WorldTriangle now = triangle_at(mesh, triangle, to_world, *context.scene, in.time[i]);
        store({v[0], v[1], v[2]}, i, now.a);
        store({v[3], v[4], v[5]}, i, now.b);
        store({v[6], v[7], v[8]}, i, now.c);
        // With both sides sampled 0; else the sign that the height of a lit point has.
        sides[i] = triangle.sides == 3 ? 0.0f : (triangle.sides == 1 ? -mesh.front_sign : mesh.front_sign);
        shader[i] = triangle.shader;
        primitive[i] = triangle.primitive;
        store({out.r, out.g, out.b}, i, programs.shaders[size_t(triangle.shader)].constant_emission);
        describe_mesh(mesh, i, out);
    }
    TALBOT_VECTOR_LOOP
    for (int i = 0; i < n; ++i) {
        const TriangleView t =
            view_triangle({v[0][i], v[1][i], v[2][i]}, {v[3][i], v[4][i], v[5][i]}, {v[6][i], v[7][i], v[8][i]}, {in.px[i], in.py[i], in.pz[i]});
        const ShapeSample s = sample_triangle(t, in.u[i], in.v[i]);
        out.x[i] = s.wi.x;
        out.y[i] = s.wi.y;
        out.z[i] = s.wi.z;
        out.distance[i] = s.distance;
        out.pdf[i] = t.height * sides[i] < 0.0f ? 0.0f : s.pdf * choice[i];
        out.coordinate_u[i] = s.a;
        out.coordinate_v[i] = s.b;
    }
    if (!table.has_mesh_programs) return;
    float wo[3][kSpan];
    for (int i = 0; i < n; ++i) store({wo[0], wo[1], wo[2]}, i, {-out.x[i], -out.y[i], -out.z[i]});
    const ConstColumns3 to_point{wo[0], wo[1], wo[2]};
    const EmissiveHits hits{{}, to_point, out.distance, out.coordinate_u, out.coordinate_v, out.object, primitive, shader, nullptr, in.depths, in.time, n};
    apply_mesh_programs(programs, context, scratch, hits, {out.r, out.g, out.b});
}

}  // namespace TALBOT_ISA
}  // namespace talbot::light
