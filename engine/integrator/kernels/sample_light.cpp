/// Next-event estimation: one light sample a lane from one stratum, weighted against the density with which scattering would have
/// found the same direction, then a shadow ray.

#include "base/sobol.h"
#include "integrator/kernels/stages.h"

namespace talbot::integrator {
inline namespace TALBOT_ISA {

void sample_light(const RenderContext& context, Worker& worker, const shader::Program& program, const ClosureGeometry& geometry, light::Stratum stratum) {
    const scene::Settings& settings = *context.settings;
    PathColumns& paths = worker.paths;
    SpanScratch& s = worker.scratch;
    ShadowQueue& queue = worker.shadow;
    const int n = s.span.n;
    bool scatters = false;
    for (const ClosureSlot& slot : program.slots) scatters = scatters || (slot.lobe != LobeKind::None && slot.lobe != LobeKind::Transparent);
    if (!scatters) return;

    const bool distant = stratum == light::Stratum::Distant;
    const Pair pick = distant ? Pair::DistantPick : Pair::LightPick, position = distant ? Pair::DistantPosition : Pair::LightPosition;
    TALBOT_VECTOR_LOOP
    for (int i = 0; i < n; ++i) {
        const Vec2 a = sample_pair(s.span.key[i], s.span.sample[i], pair_dimension(s.span.vertex[i], pick));
        const Vec2 b = sample_pair(s.span.key[i], s.span.sample[i], pair_dimension(s.span.vertex[i], position));
        s.u0[i] = a.x;
        s.v0[i] = a.y;
        s.u1[i] = b.x;
        s.v1[i] = b.y;
    }
    light::LightQuery query;
    query.p = s.span.p;
    query.n_s = s.span.n_s;
    query.pick_u = s.u0;
    query.pick_v = s.v0;
    query.u = s.u1;
    query.v = s.v1;
    query.bounce = s.span.depth;
    query.n = n;
    light::sample_emitters(*context.emitters, stratum, query, *context.programs, *context.shading, s.emitter, s.light);
    std::memcpy(s.wi.x, s.light.wi.x, size_t(n) * 4);
    std::memcpy(s.wi.y, s.light.wi.y, size_t(n) * 4);
    std::memcpy(s.wi.z, s.light.wi.z, size_t(n) * 4);
    const bool shares = context.layout->light_passes;
    eval_closures(s, program, geometry, s.light.visibility, shares, s.f, s.pdf);

    const float limit_direct = 3.0f * settings.clamp_direct, limit_indirect = 3.0f * settings.clamp_indirect;
    const float inverse_threshold = settings.light_threshold > 0.0f ? 1.0f / settings.light_threshold : 0.0f;
    // Contribution of each lane in s.rgb, 0 where there is none.
    const ConstColumn light_pdf = s.light.pdf, bsdf_pdf = s.pdf;
    const ConstMaskColumn is_delta = s.light.is_delta;
    const Column scale = s.tmp;
    TALBOT_VECTOR_LOOP
    for (int i = 0; i < n; ++i) {
        const float pdf = light_pdf[i];
        const float r = is_delta[i] != 0 ? 0.0f : bsdf_pdf[i] / pdf;
        const float weight = 1.0f / ((1.0f + r * r) * pdf);
        scale[i] = pdf > 0.0f ? weight : 0.0f;
    }
    const ConstColumn fx = s.f.x, fy = s.f.y, fz = s.f.z, ex = s.light.radiance.x, ey = s.light.radiance.y, ez = s.light.radiance.z;
    const Column rx = s.rgb.x, ry = s.rgb.y, rz = s.rgb.z;
    TALBOT_VECTOR_LOOP
    for (int i = 0; i < n; ++i) {
        rx[i] = fx[i] * ex[i] * scale[i];
        ry[i] = fy[i] * ey[i] * scale[i];
        rz[i] = fz[i] * ez[i] * scale[i];
    }
    for (int i = 0; i < n; ++i) {
        Rgb c = load(s.rgb, i);
        const float strongest = max_component(c);
        if (!(strongest > 0.0f) || (s.path_flags[i] & (kPathEndAtSurface | kPathTerminate))) continue;
        // Weak samples: trace only some, at higher weight.
        if (strongest * inverse_threshold < 1.0f && inverse_threshold > 0.0f) {
            const float keep = strongest * inverse_threshold;
            if ((distant ? s.roulette_v[i] : 1.0f - s.roulette_v[i]) >= keep) continue;
            c = c / keep;
        }
        const int bounces = total_bounces(s.bounces[i]);
        c = clamp_contribution(c * load(s.throughput, i), bounces > 0 ? limit_indirect : limit_direct);
        const int32_t lane = s.lane[i];
        const int k = queue.n++;
        store(queue.rgb, k, c);
        // The ray ends just short of the light: emissive triangles must not block themselves.
        const float distance = s.light.distance[i];
        Vec3 direction = load(s.wi, i);
        const Vec3 origin = geometry::shadow_origin(*context.scene, s.span, i, direction, s.error[i]);
        float t_max = 3.0e38f;
        if (distance < 1.0e30f) {
            const Vec3 target = load(s.span.p, i) + direction * distance;
            const Vec3 d = target - origin;
            const float l = length(d);
            direction = l > 0.0f ? d / l : direction;
            t_max = l * (1.0f - 2e-4f);
        }
        store(queue.origin, k, origin);
        store(queue.direction, k, direction);
        queue.t_max[k] = s.light.casts_shadow[i] ? t_max : -1.0f;
        queue.pixel[k] = paths.pixel[lane];
        queue.indirect[k] = bounces > 0;
        queue.lane[k] = lane;
        queue.bounces[k] = s.bounces[i];
        queue.time[k] = paths.time[lane];
        queue.visibility[k] = scene::kVisibleShadow;
        queue.crossed[k] = s.span.transparent_depth[i];
        if (shares) {
            store(queue.diffuse_share, k, bounces > 0 ? load(paths.diffuse_share, lane) : load(s.f_diffuse, i));
            store(queue.glossy_share, k, bounces > 0 ? load(paths.glossy_share, lane) : load(s.f_glossy, i));
        }
    }
}

}  // namespace TALBOT_ISA
}  // namespace talbot::integrator
