#include "light/kernels/moving_mesh.h"
#include "light/kernels/shapes.h"
#include "light/kernels/world_map.h"

namespace talbot::light {
inline namespace TALBOT_ISA {

void pdf_triangles(const EmitterTable& table_, const scene::SceneView& scene, ConstColumns3 origin, const float* t, const int32_t* object,
                   const int32_t* primitive, const int32_t* receiver, const float* time, int n, float* pdf) {
    const EmitterView& table = table_.view;
    for (int i = 0; i < n; ++i) pdf[i] = 0.0f;
    for (int begin = 0; begin < n; begin += kSpan) {
        const int end = n < begin + kSpan ? n : begin + kSpan;
        int32_t lane[kSpan], emitter[kSpan], triangle[kSpan], set[kSpan];
        int count = 0;
        for (int i = begin; i < end; ++i) {
            if (object[i] < 0 || object[i] >= table.object_count) continue;
            const int32_t e = table.object_emitter[object[i]];
            if (e < 0) continue;
            const int32_t k = table.primitive_to_triangle[table.meshes[table.emitters[e].mesh].map + primitive[i]];
            if (k < 0) continue;
            lane[count] = i;
            emitter[count] = e;
            triangle[count++] = k;
        }
        if (count == 0) continue;
        float p[3][kSpan], probability[kSpan];
        gather3(origin, lane, count, {p[0], p[1], p[2]});
        if (receiver) gather(receiver, lane, count, set);
        choice_probability(table, {p[0], p[1], p[2]}, receiver ? set : nullptr, emitter, count, probability);
        for (int j = 0; j < count; ++j) {
            const Vec3 o{p[0][j], p[1][j], p[2][j]};
            const float distance = t[lane[j]];
            const Emitter& e = table.emitters[emitter[j]];
            float shape = 0.0f;
            if (e.kind == int32_t(EmitterKind::Rect)) {
                shape = pdf_rect(view_rect(table.rects[e.rect], o), distance);
            } else {
                const MeshEmitter& mesh = table.meshes[e.mesh];
                const LightTriangle& own = table.triangles[triangle[j]];
                const float now = time ? time[lane[j]] : 0.5f;
                const Affine to_world = map_of(mesh, scene, now);
                const WorldTriangle w = triangle_at(mesh, own, to_world, scene, now);
                const TriangleView view = view_triangle(w.a, w.b, w.c, o);
                const float side = own.sides == 3 ? 0.0f : (own.sides == 1 ? -mesh.front_sign : mesh.front_sign);
                shape =
                    view.height * side < 0.0f ? 0.0f : pdf_triangle(view, distance) * leaf_probability(table.nodes, own.leaf, mesh_query(mesh, to_world, o));
            }
            const float value = shape * probability[j];
            pdf[lane[j]] = value < 1e30f ? value : 0.0f;
        }
    }
}

void pdf_background(const EmitterTable& table, ConstColumns3 direction, const int32_t* receiver, int n, float* pdf) {
    const WorldMap& map = table.view.world;
    if (map.probability == 0.0f) {
        for (int i = 0; i < n; ++i) pdf[i] = 0.0f;
        return;
    }
    pdf_world(map, direction, n, pdf);
    for (int i = 0; i < n; ++i) pdf[i] *= map.probability * (receiver ? table.view.distant_scale[receiver[i]] : 1.0f);
}

}  // namespace TALBOT_ISA
}  // namespace talbot::light
