/// Next-event estimation: one light sample a lane from one stratum, weighted against the density with which scattering would have
/// found the same direction, then a shadow ray.

#include "integrator/kernels/stages.h"

namespace talbot::integrator {
inline namespace TALBOT_ISA {

namespace {

/// What each lane's light sample brings, by its density and the mixture's there: in s.rgb. Weak samples are thinned: some go on, at higher weight. Returns
/// how many lanes send a shadow ray; they are in s.list.
int weigh_samples(const scene::Settings& settings, SpanScratch& s, bool distant) {
    const int n = s.span.n;
    const float limit_direct = 3.0f * settings.clamp_direct, limit_indirect = 3.0f * settings.clamp_indirect;
    const bool thins = settings.light_threshold > 0.0f;
    const float inverse_threshold = thins ? 1.0f / settings.light_threshold : 0.0f;
    const ConstColumn light_pdf = s.light.pdf, bsdf_pdf = s.pdf, roulette = s.roulette_v;
    const ConstMaskColumn is_delta = s.light.is_delta;
    const ConstIntColumn path_flags = s.path_flags, bounces = s.bounces;
    const ConstColumn fx = s.f.x, fy = s.f.y, fz = s.f.z, ex = s.light.radiance.x, ey = s.light.radiance.y, ez = s.light.radiance.z;
    const ConstColumn tx = s.throughput.x, ty = s.throughput.y, tz = s.throughput.z;
    const Column rx = s.rgb.x, ry = s.rgb.y, rz = s.rgb.z, scale = s.tmp;
    const IntColumn sends = s.itmp;
    TALBOT_VECTOR_LOOP
    for (int i = 0; i < n; ++i) {
        const float pdf = light_pdf[i];
        const float r = is_delta[i] != 0 ? 0.0f : bsdf_pdf[i] / pdf;
        const float weight = 1.0f / ((1.0f + r * r) * pdf);
        scale[i] = pdf > 0.0f ? weight : 0.0f;
    }
    TALBOT_VECTOR_LOOP
    for (int i = 0; i < n; ++i) {
        const Rgb c{fx[i] * ex[i] * scale[i], fy[i] * ey[i] * scale[i], fz[i] * ez[i] * scale[i]};
        const float strongest = max_magnitude(c), chance = strongest * inverse_threshold;
        const bool weak = thins & (chance < 1.0f);
        const float u = distant ? roulette[i] : 1.0f - roulette[i];
        sends[i] = (strongest > 0.0f) & ((path_flags[i] & (kPathEndAtSurface | kPathTerminate)) == 0) & (!weak | (u < chance));
        const float boost = weak ? 1.0f / chance : 1.0f;
        const float limit = total_bounces(bounces[i]) > 0 ? limit_indirect : limit_direct;
        const Rgb sent = clamp_contribution({c.x * boost * tx[i], c.y * boost * ty[i], c.z * boost * tz[i]}, limit);
        rx[i] = sent.x;
        ry[i] = sent.y;
        rz[i] = sent.z;
    }
    return compress(s.itmp, n, s.list);
}

/// Queues the shadow rays of the first `count` lanes of s.list, towards the light sample in direction s.wi.
void push_shadow_rays(const RenderContext& context, Worker& worker, ConstColumns3 normal, int count) {
    const PathColumns& paths = worker.paths;
    SpanScratch& s = worker.scratch;
    ShadowQueue& queue = worker.shadow;
    const int n = s.span.n;
    const Columns3 origin = s.tmp3, towards = s.f;
    geometry::shadow_origins(*context.scene, s.span, normal, s.wi, s.error, s.list, count, origin);
    const ConstColumn px = s.span.p.x, py = s.span.p.y, pz = s.span.p.z, wx = s.wi.x, wy = s.wi.y, wz = s.wi.z, ox = origin.x, oy = origin.y, oz = origin.z;
    const ConstColumn distance = s.light.distance;
    const Column dx = towards.x, dy = towards.y, dz = towards.z, t_max = s.tmp;
    TALBOT_VECTOR_LOOP
    for (int i = 0; i < n; ++i) {
        const Vec3 w{wx[i], wy[i], wz[i]};
        const Vec3 d = Vec3{px[i], py[i], pz[i]} + w * distance[i] - Vec3{ox[i], oy[i], oz[i]};
        const float l = length(d), inverse = 1.0f / l;
        const bool near = distance[i] < 1.0e30f, aims = near & (l > 0.0f);
        dx[i] = aims ? d.x * inverse : w.x;
        dy[i] = aims ? d.y * inverse : w.y;
        dz[i] = aims ? d.z * inverse : w.z;
        // The ray ends just short of the light: emissive triangles must not block themselves.
        t_max[i] = near ? l * (1.0f - 2e-4f) : 3.0e38f;
    }

    const int first = queue.n;
    queue.n += count;
    const auto from = [first](Columns3 c) { return Columns3{c.x + first, c.y + first, c.z + first}; };
    gather3(s.rgb, s.list, count, from(queue.rgb));
    gather3(origin, s.list, count, from(queue.origin));
    gather3(towards, s.list, count, from(queue.direction));
    gather(t_max, s.list, count, queue.t_max + first);
    gather(s.lane, s.list, count, queue.lane + first);
    gather(s.bounces, s.list, count, queue.bounces + first);
    gather(s.span.transparent_depth, s.list, count, queue.crossed + first);
    fill(queue.passed + first, count, 0.0f);
    const int32_t* lanes = queue.lane + first;
    gather(paths.pixel, lanes, count, queue.pixel + first);
    if (context.scene->has_motion) gather(paths.time, lanes, count, queue.time + first);
    for (int j = 0; j < count; ++j) {
        const int k = first + j;
        queue.visibility[k] = s.light.blockers[s.list[j]];
        if (queue.visibility[k] == 0) queue.t_max[k] = -1.0f;
        // Among the catchers.
        if (worker.catcher_pass)
            queue.visibility[k] = int32_t(scene::kVisibleShadow << scene::kCatcherShift | (uint32_t(queue.visibility[k]) & scene::kBlockerBits));
        queue.indirect[k] = total_bounces(queue.bounces[k]) > 0;
    }
    if (context.layout->light_groups >= 0) gather(s.light.light_group, s.list, count, queue.light_group + first);
    if (!context.layout->light_passes) return;
    for (int j = 0; j < count; ++j) {
        const int k = first + j, i = s.list[j];
        store(queue.diffuse_share, k, queue.indirect[k] ? load(paths.diffuse_share, lanes[j]) : load(s.f_diffuse, i));
        store(queue.glossy_share, k, queue.indirect[k] ? load(paths.glossy_share, lanes[j]) : load(s.f_glossy, i));
    }
}

}  // namespace

void sample_light(const RenderContext& context, Worker& worker, const shader::Program& program, const ClosureGeometry& geometry, light::Stratum stratum) {
    SpanScratch& s = worker.scratch;
    const int n = s.span.n;
    bool scatters = false;
    for (const ClosureSlot& slot : program.slots) scatters = scatters || (slot.lobe != LobeKind::None && slot.lobe != LobeKind::Transparent);
    if (!scatters) return;

    const bool distant = stratum == light::Stratum::Distant;
    const Pair pick = distant ? Pair::DistantPick : Pair::LightPick, position = distant ? Pair::DistantPosition : Pair::LightPosition;
    sample_pairs(s.span, pick, s.u0, s.v0);
    sample_pairs(s.span, position, s.u1, s.v1);
    light::LightQuery query;
    query.p = s.span.p;
    query.n_s = s.span.n_s;
    query.pick_u = s.u0;
    query.pick_v = s.v0;
    query.u = s.u1;
    query.v = s.v1;
    query.depths = {s.span.depth, s.span.diffuse_depth, s.span.glossy_depth, s.span.transparent_depth, s.span.transmission_depth};
    query.time = s.span.time;
    if (context.emitter_summary.has_links) {
        for (int i = 0; i < n; ++i) s.receiver[i] = scene::traits_of(*context.scene, s.span.object[i]).receiver_set;
        query.receiver = s.receiver;
    }
    query.n = n;
    light::LightSamples samples = s.light;
    if (context.layout->light_groups < 0) samples.light_group = nullptr;
    light::sample_emitters(*context.emitters, stratum, query, *context.programs, *context.shading, s.emitter, samples);
    if (worker.catcher_pass) {
        // Light that is not real does not shine on the catchers alone.
        for (int i = 0; i < n; ++i) s.light.pdf[i] = uint32_t(s.light.visibility[i]) >> scene::kCatcherShift ? s.light.pdf[i] : 0.0f;
    }
    std::memcpy(s.wi.x, s.light.wi.x, size_t(n) * 4);
    std::memcpy(s.wi.y, s.light.wi.y, size_t(n) * 4);
    std::memcpy(s.wi.z, s.light.wi.z, size_t(n) * 4);
    eval_closures(s, program, geometry, s.light.visibility, context.layout->light_passes, s.f, s.pdf);
    push_shadow_rays(context, worker, geometry.ns, weigh_samples(*context.settings, s, distant));
}

}  // namespace TALBOT_ISA
}  // namespace talbot::integrator
