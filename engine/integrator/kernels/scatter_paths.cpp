/// The next direction: a closure slot by its share of the scattering, a direction from it, the whole mixture's value and
/// density there; bounce counts and limits.

#include "base/sobol.h"
#include "integrator/kernels/stages.h"

namespace talbot::integrator {
inline namespace TALBOT_ISA {

namespace {

constexpr float kInfinity = 3.0e38f;

/// Slot of each lane with probability slot_weight / weight_sum; -1 where nothing scatters.
void choose_slots(SpanScratch& s, int slots) {
    const int n = s.span.n;
    for (int i = 0; i < n; ++i) {
        s.chosen[i] = -1;
        s.tmp[i] = s.u0[i] * s.weight_sum[i];
    }
    for (int k = 0; k < slots; ++k) {
        const float* weight = s.slot_weight + size_t(k) * kSpan;
        TALBOT_VECTOR_LOOP
        for (int i = 0; i < n; ++i) {
            // The last slot with any weight catches what rounding leaves over.
            const bool open = (s.tmp[i] >= 0.0f) & (weight[i] > 0.0f);
            s.chosen[i] = open ? k : s.chosen[i];
            s.tmp[i] = s.tmp[i] - weight[i];
        }
    }
}

/// Samples the lanes that chose slot k; writes span columns wi, f (= f/pdf of this slot), pdf, flags, roughness, eta.
void sample_slot(SpanScratch& s, const ClosureSlot& slot, const ClosureGeometry& geometry, const int32_t* list, int count) {
    const int n = s.span.n;
    const ClosureColumns all = slot_columns(slot, s.registers);
    ClosureSamples out;
    if (count == n) {
        out = {s.wi, s.f, s.pdf, s.sampled_flags, s.sampled_roughness, s.sampled_eta};
        closure_sample(slot, all, geometry, s.u1, s.v1, s.v0, n, out);
        return;
    }
    float* next = s.compact;
    auto take = [&] {
        float* column = next;
        next += kSpan;
        return column;
    };
    auto compact = [&](const float* column) {
        float* to = take();
        gather(column, list, count, to);
        return to;
    };
    ClosureColumns c;
    c.weight = {compact(all.weight.x), compact(all.weight.y), compact(all.weight.z)};
    c.normal = {compact(all.normal.x), compact(all.normal.y), compact(all.normal.z)};
    for (int i = 0; i < slot.param_count; ++i) c.params[i] = compact(all.params[i]);
    ClosureGeometry g = geometry;
    g.wo = {compact(geometry.wo.x), compact(geometry.wo.y), compact(geometry.wo.z)};
    g.ng = {compact(geometry.ng.x), compact(geometry.ng.y), compact(geometry.ng.z)};
    g.ns = {compact(geometry.ns.x), compact(geometry.ns.y), compact(geometry.ns.z)};
    const float *u = compact(s.u1), *v = compact(s.v1), *w = compact(s.v0);
    out.wi = {take(), take(), take()};
    out.weight = {take(), take(), take()};
    out.pdf = take();
    out.flags = s.itmp;
    out.roughness = take();
    out.eta = take();
    static_assert(3 + 3 + kMaxClosureParams + 9 + 3 + 9 <= kCompactColumns);
    closure_sample(slot, c, g, u, v, w, count, out);
    scatter3(out.wi, list, count, s.wi);
    scatter3(out.weight, list, count, s.f);
    scatter(out.pdf, list, count, s.pdf);
    scatter(out.flags, list, count, s.sampled_flags);
    scatter(out.roughness, list, count, s.sampled_roughness);
    scatter(out.eta, list, count, s.sampled_eta);
}

/// For lanes whose sampled lobe is not a delta: f/pdf and pdf of the whole mixture replace the one slot's. Needs s.wi.
/// The diffuse and glossy parts of f go to s.f_diffuse and s.f_glossy as shares of it.
void eval_mixture(SpanScratch& s, const shader::Program& program, const ClosureGeometry& geometry, bool shares) {
    const int n = s.span.n;
    const Columns3 sum = s.rgb;
    eval_closures(s, program, geometry, nullptr, shares, sum, s.tmp);
    const Columns3 f = s.f;
    TALBOT_VECTOR_LOOP
    for (int i = 0; i < n; ++i) {
        const float pdf = s.tmp[i];
        const bool smooth = (s.sampled_flags[i] & (kSampledDelta | kSampledTransparent | kSampledFailed)) == 0;
        const bool use = smooth & (pdf > 0.0f);
        const float inverse = 1.0f / pdf;
        f.x[i] = use ? sum.x[i] * inverse : f.x[i];
        f.y[i] = use ? sum.y[i] * inverse : f.y[i];
        f.z[i] = use ? sum.z[i] * inverse : f.z[i];
        s.pdf[i] = use ? pdf : s.pdf[i];
        // One slot alone stands for the mixture with the probability it was chosen with.
        s.sampled_flags[i] |= (smooth & !(pdf > 0.0f)) ? int32_t(kSampledFailed) : 0;
    }
}

TALBOT_INLINE int32_t count_bounce(int32_t bounces, LobeKind lobe, bool transmitted) {
    const int total = total_bounces(bounces) + 1, diffuse = diffuse_bounces(bounces), glossy = glossy_bounces(bounces),
              transmission = transmission_bounces(bounces);
    const bool is_diffuse = !transmitted && lobe == LobeKind::Diffuse, is_glossy = !transmitted && lobe != LobeKind::Diffuse;
    auto cap = [](int x) { return x > 255 ? 255 : x; };
    return int32_t(uint32_t(cap(total)) | uint32_t(cap(diffuse + is_diffuse)) << 8 | uint32_t(cap(glossy + is_glossy)) << 16 |
                   uint32_t(cap(transmission + transmitted)) << 24);
}

}  // namespace

int scatter_paths(const RenderContext& context, Worker& worker, const shader::Program& program, const ClosureGeometry& geometry, int32_t* survivors) {
    const scene::Settings& settings = *context.settings;
    PathColumns& paths = worker.paths;
    SpanScratch& s = worker.scratch;
    const int n = s.span.n;
    const int slots = int(program.slots.size());
    if (slots == 0) return 0;

    TALBOT_VECTOR_LOOP
    for (int i = 0; i < n; ++i) {
        const Vec2 a = sample_pair(s.span.key[i], s.span.sample[i], pair_dimension(s.span.vertex[i], Pair::BsdfSlot));
        const Vec2 b = sample_pair(s.span.key[i], s.span.sample[i], pair_dimension(s.span.vertex[i], Pair::BsdfDirection));
        s.u0[i] = a.x;
        s.v0[i] = a.y;
        s.u1[i] = b.x;
        s.v1[i] = b.y;
    }
    choose_slots(s, slots);
    int used = 0;  // slots anybody chose
    for (int k = 0; k < slots; ++k) {
        int count = 0;
        for (int i = 0; i < n; ++i) {
            s.list[count] = i;
            count += s.chosen[i] == k;
        }
        if (count == 0) continue;
        ++used;
        sample_slot(s, program.slots[size_t(k)], geometry, s.list, count);
    }
    if (used == 0) return 0;
    // Delta lobes keep their own weight, divided by the probability of the choice.
    for (int i = 0; i < n; ++i) {
        if (s.chosen[i] < 0) {
            s.sampled_flags[i] = kSampledFailed;
            continue;
        }
        const float p = s.slot_weight[size_t(s.chosen[i]) * kSpan + i] / s.weight_sum[i];
        store(s.f, i, load(s.f, i) / p);
        if (s.shifts_terminator && !(s.sampled_flags[i] & (kSampledTransmit | kSampledTransparent))) {
            const ConstColumns3 normal = slot_columns(program.slots[size_t(s.chosen[i])], s.registers).normal;
            store(s.f, i, load(s.f, i) * terminator_factor(s.terminator_frequency[i], dot(load(normal, i), load(s.wi, i))));
        }
    }
    const bool shares = context.layout->light_passes;
    int scattering = 0;
    for (const ClosureSlot& slot : program.slots) scattering += slot.lobe != LobeKind::None && slot.lobe != LobeKind::Transparent;
    if (slots > 1 && scattering > 0) {
        eval_mixture(s, program, geometry, shares);
    } else if (shares) {
        // One slot: all of it is one kind, by the side it went to.
        for (Columns3 c : {s.f_diffuse, s.f_glossy}) fill(c.x, n, 0.0f), fill(c.y, n, 0.0f), fill(c.z, n, 0.0f);
        for (Columns3 c : {s.slot_f}) fill(c.x, n, 1.0f), fill(c.y, n, 1.0f), fill(c.z, n, 1.0f);
        add_shares(s, program.slots[0], geometry);
    }
    geometry::offset_origin(s.span.p, s.span.n_g, s.wi, s.error, n, s.tmp3);

    // Before 5.0 a ray crosses one transparent surface more than the limit says.
    const int transparent_limit = settings.version < 500 ? settings.transparent_bounces + 1 : settings.transparent_bounces;
    int alive = 0;
    for (int i = 0; i < n; ++i) {
        const int32_t lane = s.lane[i];
        const int32_t sampled = s.sampled_flags[i];
        if (sampled & kSampledFailed) continue;
        Rgb throughput = load(s.throughput, i) * load(s.f, i);
        const float strongest = max_component(throughput);
        if (!(strongest > 0.0f) || !(strongest < kInfinity)) continue;

        const float t = s.span.ray_length[i];
        int32_t flags = s.path_flags[i];
        const int32_t vertex = paths.vertex[lane];
        const int crossed = vertex >> 16;
        const bool transparent = (sampled & kSampledTransparent) != 0;
        int32_t bounces = s.bounces[i];
        if (transparent) {
            flags |= kPathCrossed | (crossed + 1 >= transparent_limit ? kPathTerminate : 0);
        } else {
            const bool transmitted = (sampled & kSampledTransmit) != 0;
            const bool delta = (sampled & kSampledDelta) != 0;
            const LobeKind lobe = program.slots[size_t(s.chosen[i])].lobe;
            bounces = count_bounce(bounces, lobe, transmitted);
            const bool at_limit = total_bounces(bounces) > settings.max_bounces || diffuse_bounces(bounces) > settings.diffuse_bounces ||
                                  glossy_bounces(bounces) > settings.glossy_bounces || transmission_bounces(bounces) > settings.transmission_bounces;
            const bool through_glass = settings.film_transparent_glass && transmitted && s.sampled_roughness[i] <= settings.film_transparent_roughness;
            flags &= kPathDataDone | (through_glass ? flags & kPathSeesBackground : 0);
            flags |= kPathDataDone | (at_limit ? kPathEndAtSurface : 0) | (delta ? kPathDelta : 0);
            flags |= transmitted ? shader::kRayTransmission : shader::kRayReflection;
            flags |= lobe == LobeKind::Diffuse ? shader::kRayDiffuse : shader::kRayGlossy;
            flags |= delta ? shader::kRaySingular : 0;
            if (shares && total_bounces(s.bounces[i]) == 0) {
                Vec3 d = load(s.f_diffuse, i), g = load(s.f_glossy, i);
                if (delta) {
                    d = vec3(!transmitted && lobe == LobeKind::Diffuse ? 1.0f : 0.0f);
                    g = vec3(!transmitted && lobe != LobeKind::Diffuse ? 1.0f : 0.0f);
                }
                store(paths.diffuse_share, lane, d);
                store(paths.glossy_share, lane, g);
            }
        }

        if (!context.roulette_on_arrival) {
            const float keep = survival_probability(settings, flags, bounces, crossed + transparent, throughput);
            if (s.roulette_u[i] >= keep) continue;
            throughput = throughput / keep;
        }
        paths.bounces[lane] = bounces;
        store(paths.origin, lane, load(s.tmp3, i));
        store(paths.throughput, lane, throughput);
        paths.cone_width[lane] = s.span.footprint[i];
        paths.flags[lane] = transparent ? (flags | (paths.flags[lane] & kPathDataDone)) : flags;
        if (transparent) {
            paths.t_max[lane] = maxf(paths.t_max[lane] - t, 0.0f);
            paths.mis_t[lane] += t;
            paths.vertex[lane] = (vertex & 0xffff) + 1 + ((crossed + 1) << 16);
        } else {
            store(paths.direction, lane, load(s.wi, i));
            paths.t_max[lane] = kInfinity;
            paths.mis_t[lane] = 0.0f;
            paths.vertex[lane] = vertex + 1;
            paths.bsdf_pdf[lane] = s.pdf[i];
            paths.min_pdf[lane] = minf(paths.min_pdf[lane], s.pdf[i]);
        }
        survivors[alive++] = lane;
    }
    return alive;
}

}  // namespace TALBOT_ISA
}  // namespace talbot::integrator
