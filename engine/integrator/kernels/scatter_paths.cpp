/// The next direction: a closure slot by its share of the scattering, a direction from it, the whole mixture's value and
/// density there; bounce counts and limits.

#include <limits>

#include "integrator/kernels/stages.h"

namespace talbot::integrator {
inline namespace TALBOT_ISA {

namespace {

constexpr float kInfinity = 3.0e38f;

/// Slot of each lane with probability slot_weight / weight_sum; -1 where nothing scatters. Its weight goes to tmp2, its LobeKind to list2.
/// Velvet is of the glossy passes, but its bounces are diffuse, as in Cycles.
void choose_slots(SpanScratch& s, const shader::Program& program) {
    const int n = s.span.n;
    const IntColumn chosen = s.chosen, lobe = s.list2;
    const Column left = s.tmp, its_weight = s.tmp2;
    const ConstColumn u = s.u0, sum = s.weight_sum;
    TALBOT_VECTOR_LOOP
    for (int i = 0; i < n; ++i) {
        chosen[i] = -1;
        lobe[i] = int32_t(LobeKind::None);
        left[i] = u[i] * sum[i];
        its_weight[i] = 0.0f;
    }
    for (int k = 0; k < int(program.slots.size()); ++k) {
        const ConstColumn weight = s.slot_weight + size_t(k) * kSpan;
        const ClosureSlot& slot = program.slots[size_t(k)];
        const int32_t kind = int32_t(slot.type == ClosureType::AshikhminVelvet ? LobeKind::Diffuse : slot.lobe);
        TALBOT_VECTOR_LOOP
        for (int i = 0; i < n; ++i) {
            // The last slot with any weight catches what rounding leaves over.
            const bool open = (left[i] >= 0.0f) & (weight[i] > 0.0f);
            chosen[i] = open ? k : chosen[i];
            lobe[i] = open ? kind : lobe[i];
            its_weight[i] = open ? weight[i] : its_weight[i];
            left[i] = left[i] - weight[i];
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

/// Delta lobes keep their own weight, divided by the probability of the choice. Needs what choose_slots left.
void divide_by_choice(SpanScratch& s, const shader::Program& program) {
    const int n = s.span.n;
    const Column fx = s.f.x, fy = s.f.y, fz = s.f.z;
    const ConstColumn weight = s.tmp2, sum = s.weight_sum;
    const IntColumn flags = s.sampled_flags;
    TALBOT_VECTOR_LOOP
    for (int i = 0; i < n; ++i) {
        const bool chosen = weight[i] > 0.0f;
        const float inverse = chosen ? sum[i] / weight[i] : 0.0f;
        flags[i] = chosen ? flags[i] : int32_t(kSampledFailed);
        fx[i] *= inverse;
        fy[i] *= inverse;
        fz[i] *= inverse;
    }
    if (!s.shifts_terminator) return;
    for (int i = 0; i < n; ++i) {
        if (s.sampled_flags[i] & (kSampledFailed | kSampledTransmit | kSampledTransparent)) continue;
        const ConstColumns3 normal = slot_columns(program.slots[size_t(s.chosen[i])], s.registers).normal;
        store(s.f, i, load(s.f, i) * terminator_factor(s.terminator_frequency[i], dot(load(normal, i), load(s.wi, i))));
    }
}

/// One more bounce: in total, and of its kind. Each count stops at 255.
TALBOT_INLINE int32_t count_bounce(int32_t bounces, int32_t diffuse, int32_t glossy, int32_t transmitted) {
    const auto next = [](int32_t count, int32_t more) { return uint32_t(count + more > 255 ? 255 : count + more); };
    return int32_t(next(total_bounces(bounces), 1) | next(diffuse_bounces(bounces), diffuse) << 8 | next(glossy_bounces(bounces), glossy) << 16 |
                   next(transmission_bounces(bounces), transmitted) << 24);
}

/// What becomes of each lane: throughput in s.rgb, flags in s.path_flags, bounces in s.list2. Returns how many go on; they are in s.list.
int advance_paths(const RenderContext& context, SpanScratch& s) {
    const scene::Settings& settings = *context.settings;
    const int n = s.span.n;
    // Before 5.0 a ray crosses one transparent surface more than the limit says.
    const int transparent_limit = settings.version < 500 ? settings.transparent_bounces + 1 : settings.transparent_bounces;
    const int max_bounces = settings.max_bounces, max_diffuse = settings.diffuse_bounces, max_glossy = settings.glossy_bounces,
              max_transmission = settings.transmission_bounces;
    const float clear_roughness = settings.film_transparent_glass ? settings.film_transparent_roughness : -1.0f;
    constexpr RouletteStart never{std::numeric_limits<int>::max(), std::numeric_limits<int>::max()};
    const RouletteStart start = context.roulette_on_arrival ? never : roulette_start(settings);
    const ConstColumn fx = s.f.x, fy = s.f.y, fz = s.f.z, tx = s.throughput.x, ty = s.throughput.y, tz = s.throughput.z, roughness = s.sampled_roughness,
                      u = s.roulette_u;
    const ConstIntColumn sampled_flags = s.sampled_flags, old_bounces = s.bounces, crossed = s.span.transparent_depth;
    const Column rx = s.rgb.x, ry = s.rgb.y, rz = s.rgb.z;
    const IntColumn flags = s.path_flags, lobe_then_bounces = s.list2, goes_on = s.itmp;
    TALBOT_VECTOR_LOOP
    for (int i = 0; i < n; ++i) {
        const int32_t sampled = sampled_flags[i], lobe = lobe_then_bounces[i], before = flags[i];
        const bool transparent = (sampled & kSampledTransparent) != 0, transmitted = (sampled & kSampledTransmit) != 0, delta = (sampled & kSampledDelta) != 0;
        const bool diffuse = lobe == int32_t(LobeKind::Diffuse);
        const int32_t counted = count_bounce(old_bounces[i], !transmitted & diffuse, !transmitted & !diffuse, transmitted);
        const int32_t bounces = transparent ? old_bounces[i] : counted;
        const bool at_limit = (total_bounces(bounces) > max_bounces) | (diffuse_bounces(bounces) > max_diffuse) | (glossy_bounces(bounces) > max_glossy) |
                              (transmission_bounces(bounces) > max_transmission);
        const bool through_glass = transmitted & (roughness[i] <= clear_roughness);
        const int32_t crossing = before | kPathCrossed | (crossed[i] + 1 >= transparent_limit ? kPathTerminate : 0);
        const int32_t scattered = kPathDataDone | (before & (kPathCatcherHit | kPathCatcherPass)) | (through_glass ? before & kPathSeesBackground : 0) |
                                  (at_limit ? kPathEndAtSurface : 0) | (delta ? int32_t(kPathDelta) | shader::kRaySingular : 0) |
                                  (transmitted ? shader::kRayTransmission : shader::kRayReflection) | (diffuse ? shader::kRayDiffuse : shader::kRayGlossy);
        const int32_t next = transparent ? crossing : scattered;

        const Rgb throughput{tx[i] * fx[i], ty[i] * fy[i], tz[i] * fz[i]};
        const float strongest = max_magnitude(throughput);
        const float keep = survival_probability(start, next, bounces, crossed[i] + transparent, throughput);
        goes_on[i] = ((sampled & kSampledFailed) == 0) & (strongest > 0.0f) & (strongest < kInfinity) & (u[i] < keep);
        const float inverse = 1.0f / keep;
        rx[i] = throughput.x * inverse;
        ry[i] = throughput.y * inverse;
        rz[i] = throughput.z * inverse;
        flags[i] = next;
        lobe_then_bounces[i] = bounces;
    }
    return compress(s.itmp, n, s.list);
}

/// The diffuse and glossy shares of a path's first scattering, for the light passes.
void keep_shares(PathColumns& paths, const SpanScratch& s, const shader::Program& program, int count) {
    for (int k = 0; k < count; ++k) {
        const int i = s.list[k];
        const int32_t sampled = s.sampled_flags[i];
        if ((sampled & kSampledTransparent) || total_bounces(s.bounces[i]) > 0) continue;
        Vec3 diffuse = load(s.f_diffuse, i), glossy = load(s.f_glossy, i);
        if (sampled & kSampledDelta) {
            const bool is_diffuse = program.slots[size_t(s.chosen[i])].lobe == LobeKind::Diffuse, transmitted = (sampled & kSampledTransmit) != 0;
            diffuse = vec3(!transmitted && is_diffuse ? 1.0f : 0.0f);
            glossy = vec3(!transmitted && !is_diffuse ? 1.0f : 0.0f);
        }
        store(paths.diffuse_share, s.lane[i], diffuse);
        store(paths.glossy_share, s.lane[i], glossy);
    }
}

/// What a ray finds lights the object that scattered it.
void keep_receivers(const RenderContext& context, SpanScratch& s, int count) {
    for (int k = 0; k < count; ++k) {
        const int i = s.list[k];
        if (!(s.sampled_flags[i] & kSampledTransparent))
            s.path_flags[i] |= scene::traits_of(*context.scene, s.span.object[i]).receiver_set << kPathReceiverShift;
    }
}

/// Writes the lanes that go on back to their paths; their rays begin at s.tmp3.
void send_on(PathColumns& paths, const SpanScratch& s, int count) {
    for (int k = 0; k < count; ++k) {
        const int i = s.list[k];
        const int32_t lane = s.lane[i];
        paths.bounces[lane] = s.list2[i];
        store(paths.origin, lane, load(s.tmp3, i));
        store(paths.throughput, lane, load(s.rgb, i));
        paths.cone_width[lane] = s.span.footprint[i];
        if (s.sampled_flags[i] & kSampledTransparent) {
            const float t = paths.hit.t[lane];
            paths.flags[lane] = s.path_flags[i] | (paths.flags[lane] & kPathDataDone);
            paths.t_max[lane] = maxf(paths.t_max[lane] - t, 0.0f);
            paths.mis_t[lane] += t;
            paths.vertex[lane] = ((s.span.transparent_depth[i] + 1) << 16) + int32_t(s.span.vertex[i]) + 1;
        } else {
            paths.flags[lane] = s.path_flags[i];
            store(paths.direction, lane, load(s.wi, i));
            paths.t_max[lane] = kInfinity;
            paths.mis_t[lane] = 0.0f;
            paths.vertex[lane] += 1;
            paths.bsdf_pdf[lane] = s.pdf[i];
            paths.min_pdf[lane] = minf(paths.min_pdf[lane], s.pdf[i]);
        }
    }
}

}  // namespace

int scatter_paths(const RenderContext& context, Worker& worker, const shader::Program& program, const ClosureGeometry& geometry, int32_t* survivors) {
    PathColumns& paths = worker.paths;
    SpanScratch& s = worker.scratch;
    const int n = s.span.n;
    const int slots = int(program.slots.size());
    if (slots == 0) return 0;

    sample_pairs(s.span, Pair::BsdfDirection, s.u1, s.v1);
    // One diffuse slot leaves nothing to choose.
    if (slots > 1 || program.slots[0].type != ClosureType::Diffuse)
        sample_pairs(s.span, Pair::BsdfSlot, s.u0, s.v0);
    else
        fill(s.u0, n, 0.0f), fill(s.v0, n, 0.0f);
    choose_slots(s, program);
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
    divide_by_choice(s, program);
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

    const int alive = advance_paths(context, s);
    if (shares) keep_shares(paths, s, program, alive);
    if (context.emitter_summary.has_links) keep_receivers(context, s, alive);
    send_on(paths, s, alive);
    gather(s.lane, s.list, alive, survivors);
    return alive;
}

}  // namespace TALBOT_ISA
}  // namespace talbot::integrator
