// Rays that nodes ask for, over a span at a time.

#include "integrator/kernels/stages.h"

namespace talbot::integrator {
inline namespace TALBOT_ISA {

namespace {

constexpr int kForeignHits = 64;  // surfaces of other objects that a ray for one object passes

/// Rays whose hit belongs to another object than asked for go on behind it.
void pass_foreign(const geometry::Accelerator& accelerator, const shader::TraceRequest& request, const geometry::RayColumns& rays, const int32_t* visibility,
                  const geometry::HitColumns& hits) {
    float passed[kSpan];
    int32_t list[kSpan];
    for (int i = 0; i < request.n; ++i) passed[i] = 0.0f;
    for (int turn = 0; turn < kForeignHits; ++turn) {
        int count = 0;
        for (int i = 0; i < request.n; ++i) {
            if (hits.object[i] < 0 || hits.object[i] == request.object_only[i]) continue;
            const Vec3 o = load(rays.origin, i), d = load(rays.direction, i);
            // A little further than rounding reaches, whatever the scale.
            const float step = hits.t[i] * 1.0001f + 1e-6f * (std::fabs(o.x) + std::fabs(o.y) + std::fabs(o.z));
            store(rays.origin, i, o + d * step);
            rays.t_max[i] -= step;
            passed[i] += step;
            hits.object[i] = -1;
            if (rays.t_max[i] > 0.0f) list[count++] = i;
        }
        if (count == 0) break;
        geometry::intersect(accelerator, rays, list, count, visibility, hits, {});
    }
    for (int i = 0; i < request.n; ++i) {
        if (hits.object[i] != request.object_only[i]) hits.object[i] = -1;
        hits.t[i] += passed[i];
    }
}

}  // namespace

void trace_for_nodes(void* user, shader::TraceRequest& request) {
    const geometry::Accelerator& accelerator = *static_cast<const geometry::Accelerator*>(user);
    float origin[3][kSpan], direction[3][kSpan], t_max[kSpan];
    int32_t visibility[kSpan], list[kSpan];
    const Columns3 o{origin[0], origin[1], origin[2]}, d{direction[0], direction[1], direction[2]};
    const bool shadow = request.visibility & scene::kVisibleShadow;
    int count = 0;
    for (int i = 0; i < request.n; ++i) {
        store(o, i, load(request.origin, i));
        store(d, i, load(request.direction, i));
        t_max[i] = request.t_max[i];
        visibility[i] = int32_t(request.visibility | (shadow ? scene::kVisibleTransparentShadow : 0u));
        request.hit_object[i] = -1;
        if (t_max[i] > 0.0f) list[count++] = i;
    }
    if (request.error) geometry::offset_origin(request.origin, request.n_g, request.direction, request.error, request.n, o);
    const geometry::RayColumns rays{o, d, t_max};
    const geometry::HitColumns hits{request.hit_t, request.hit_u, request.hit_v, request.hit_object, request.hit_primitive};
    geometry::intersect(accelerator, rays, list, count, visibility, hits, {});
    if (request.object_only) pass_foreign(accelerator, request, rays, visibility, hits);
}

}  // namespace TALBOT_ISA
}  // namespace talbot::integrator
