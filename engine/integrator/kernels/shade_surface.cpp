/// One span of surface hits: shading points, node program, emission, then light samples and scattering.

#include <algorithm>

#include "closure/microfacet.h"
#include "integrator/kernels/stages.h"

namespace talbot::integrator {
inline namespace TALBOT_ISA {

namespace {

void gather_span(const RenderContext& context, Worker& worker, const int32_t* lanes, const int32_t* shaders, int n) {
    const PathColumns& paths = worker.paths;
    SpanScratch& s = worker.scratch;
    shader::ShadingSpan& span = s.span;
    span.n = n;
    span.is_background = false;
    span.is_lamp = false;
    std::memcpy(s.lane, lanes, size_t(n) * 4);
    gather3(paths.throughput, lanes, n, s.throughput);
    gather(paths.flags, lanes, n, s.path_flags);
    gather(paths.bounces, lanes, n, s.bounces);
    gather3(paths.direction, lanes, n, span.wo);
    span.time = context.scene->has_motion ? s.time : nullptr;
    if (span.time) gather(paths.time, lanes, n, span.time);
    TALBOT_VECTOR_LOOP
    for (int i = 0; i < n; ++i) {
        const int32_t lane = lanes[i];
        const float t = paths.hit.t[lane];
        span.wo.x[i] = -span.wo.x[i];
        span.wo.y[i] = -span.wo.y[i];
        span.wo.z[i] = -span.wo.z[i];
        span.ray_length[i] = t + paths.mis_t[lane];
        span.footprint[i] = paths.cone_width[lane] + paths.cone_spread[lane] * t;
        span.ray_flags[i] = s.path_flags[i] & shader::kRayAny;
        span.depth[i] = total_bounces(s.bounces[i]);
        span.diffuse_depth[i] = diffuse_bounces(s.bounces[i]);
        span.glossy_depth[i] = glossy_bounces(s.bounces[i]);
        span.transmission_depth[i] = transmission_bounces(s.bounces[i]);
        span.transparent_depth[i] = paths.vertex[lane] >> 16;
        span.key[i] = paths.key[lane];
        span.sample[i] = paths.sample[lane];
        span.vertex[i] = uint32_t(paths.vertex[lane] & 0xffff);
    }
    bool uniform = true;
    for (int i = 0; i < n; ++i) {
        span.constants[i] = context.programs->shaders[size_t(shaders[i])].constants;
        uniform = uniform && span.constants[i] == span.constants[0];
    }
    span.uniform_constants = uniform;
    s.shifts_terminator = false;
    for (int i = 0; i < n; ++i) {
        s.terminator_frequency[i] = scene::traits_of(*context.scene, paths.hit.object[lanes[i]]).terminator_frequency;
        s.shifts_terminator = s.shifts_terminator || s.terminator_frequency[i] != 1.0f;
    }
}

/// Radiance the surface emits towards the path, weighted against the light samples that could have found it.
void add_emission(const RenderContext& context, Worker& worker, const shader::Program& program, film::TileFilm& tile) {
    const PathColumns& paths = worker.paths;
    SpanScratch& s = worker.scratch;
    const shader::ShadingSpan& span = s.span;
    const float* registers = s.registers + size_t(program.emission) * kSpan;
    const ConstColumns3 emitted{registers, registers + kSpan, registers + 2 * kSpan};

    const bool links = context.emitter_summary.has_links;
    if (links) path_receivers(paths, s.lane, span.n, s.receiver);
    int weighted = 0;  // lanes that light sampling might have found
    for (int i = 0; i < span.n; ++i) {
        const Rgb e = load(emitted, i);
        // find_linked_light brings what others than the camera see of linked emitters.
        const bool linked =
            context.scene->has_blockers && !(s.path_flags[i] & shader::kRayCamera) && scene::traits_of(*context.scene, span.object[i]).linking.blockers >= 0;
        const bool dark = linked || (e.x == 0.0f && e.y == 0.0f && e.z == 0.0f);
        if (!dark && !(s.path_flags[i] & kPathDelta)) s.list[weighted++] = i;
        s.tmp[i] = linked ? 0.0f : 1.0f;
        // Emitters that do not light what sent the ray are dark for it.
        if (links && s.receiver[i] >= 0 && !((scene::traits_of(*context.scene, span.object[i]).linking.receivers >> s.receiver[i]) & 1)) s.tmp[i] = 0.0f;
    }
    if (weighted > 0) {
        for (int k = 0; k < weighted; ++k) {
            const int i = s.list[k];
            const Vec3 d = -load(span.wo, i);
            const float t = span.ray_length[i];
            store(s.f, k, load(span.p, i) - d * t);
            s.tmp2[k] = t;
            if (span.time) s.wi.x[k] = span.time[i];
            s.chosen[k] = span.object[i];
            s.list2[k] = span.primitive[i];
            s.itmp[k] = links ? s.receiver[i] : 0;
        }
        light::pdf_triangles(*context.emitters, *context.scene, s.f, s.tmp2, s.chosen, s.list2, links ? s.itmp : nullptr, span.time ? s.wi.x : nullptr,
                             weighted, s.slot_pdf);
        for (int k = 0; k < weighted; ++k) {
            if (s.slot_pdf[k] > 0.0f) s.tmp[s.list[k]] *= power_heuristic(paths.bsdf_pdf[s.lane[s.list[k]]], s.slot_pdf[k]);
        }
    }

    for (int i = 0; i < span.n; ++i) store(s.rgb, i, load(emitted, i) * s.tmp[i]);
    for (int i = 0; context.layout->light_groups >= 0 && i < span.n; ++i) s.light_group[i] = scene::traits_of(*context.scene, span.object[i]).light_group;
    add_found_light(context, worker, s.lane, span.n, s.rgb, film::Category::Emission, tile);
}

/// What survivors of the roulette bring from here on stands for those that ended.
void settle_roulette(const RenderContext& context, Worker& worker) {
    const RouletteStart start = roulette_start(*context.settings);
    SpanScratch& s = worker.scratch;
    for (int i = 0; i < s.span.n; ++i) {
        const Rgb throughput = load(s.throughput, i);
        const float keep = survival_probability(start, s.path_flags[i], s.bounces[i], s.span.transparent_depth[i], throughput);
        if (keep < 1.0f) store(s.throughput, i, throughput / keep);
    }
}

/// Holdout closures and objects cut a hole where the background would be seen too: what they absorb becomes transparency of the pixel. For all other paths
/// the object is like any other.
void add_holdout(const RenderContext& context, Worker& worker, const shader::Program& program, film::TileFilm& tile) {
    SpanScratch& s = worker.scratch;
    const shader::ShadingSpan& span = s.span;
    const auto is_holdout = [](const ClosureSlot& slot) { return slot.type == ClosureType::Holdout; };
    if (!context.scene->has_holdouts && std::none_of(program.slots.begin(), program.slots.end(), is_holdout)) return;
    int count = 0;
    for (int i = 0; i < span.n; ++i) s.tmp[i] = 0.0f;
    for (const ClosureSlot& slot : program.slots) {
        if (!is_holdout(slot)) continue;
        const ClosureColumns c = slot_columns(slot, s.registers);
        for (int i = 0; i < span.n; ++i) s.tmp[i] += mean(load(c.weight, i));
    }
    for (int i = 0; i < span.n; ++i) {
        if (!(s.path_flags[i] & kPathSeesBackground)) continue;
        const bool object = scene::traits_of(*context.scene, span.object[i]).is_holdout;
        const float absorbed = object ? 1.0f : s.tmp[i];
        if (object) {
            for (const ClosureSlot& slot : program.slots) {
                float* w = s.registers + size_t(slot.weight) * kSpan;
                w[i] = w[kSpan + i] = w[2 * kSpan + i] = 0.0f;
            }
            if (program.emission != shader::kNoRegister) {
                float* e = s.registers + size_t(program.emission) * kSpan;
                e[i] = e[kSpan + i] = e[2 * kSpan + i] = 0.0f;
            }
        }
        if (absorbed == 0.0f) continue;
        s.itmp[count] = worker.paths.pixel[s.lane[i]];
        if (context.has_catchers) mark_matte(worker.paths, s.lane + i, 1, s.matte + count);
        s.tmp2[count++] = absorbed * mean(load(s.throughput, i));
    }
    if (!worker.catcher_pass) film::add_alpha(tile, s.itmp, s.tmp2, count, context.has_catchers ? s.matte : nullptr);
}

/// Drops lobes that the caustics switches forbid behind a diffuse scattering, widens narrow ones (filter glossy), and
/// leaves only transparency to paths at a bounce limit, and nothing at the limit of transparency.
void restrict_closures(const RenderContext& context, Worker& worker, const shader::Program& program) {
    const scene::Settings& settings = *context.settings;
    SpanScratch& s = worker.scratch;
    const int n = s.span.n;
    const auto can_blur = [](const ClosureSlot& slot) { return closure_alphas(slot.type).count > 0; };
    if (settings.filter_glossy > 0.0f && std::any_of(program.slots.begin(), program.slots.end(), can_blur)) {
        const float inverse = 1.0f / settings.filter_glossy;
        bool any = false;
        for (int i = 0; i < n; ++i) {
            const float p = worker.paths.min_pdf[s.lane[i]] * inverse;
            s.tmp[i] = p < 1.0f ? 0.5f * std::sqrt(1.0f - p) : 0.0f;
            any = any || p < 1.0f;
        }
        if (any) {
            for (const ClosureSlot& slot : program.slots) {
                float* params[kMaxClosureParams] = {};
                for (int k = 0; k < slot.param_count; ++k) params[k] = s.registers + size_t(slot.params[k]) * kSpan;
                closure_blur(slot, params, s.tmp, n);
            }
        }
    }
    const bool one_caustic = settings.version >= 400 && settings.caustics_reflective != settings.caustics_refractive;
    for (const ClosureSlot& slot : program.slots) {
        if (one_caustic && slot.type == ClosureType::MicrofacetGlass) {
            // Of glass that is both, one side goes black.
            const int first = settings.caustics_reflective ? kGlassTransmissionTint : kGlassReflectionTint;
            for (int k = first; k < first + 3; ++k) {
                float* tint = s.registers + size_t(slot.params[k]) * kSpan;
                for (int i = 0; i < n; ++i) tint[i] = (s.path_flags[i] & shader::kRayDiffuse) ? 0.0f : tint[i];
            }
        }
        const bool transmits = slot.lobe == LobeKind::Transmission;
        const bool glass = slot.type == ClosureType::MicrofacetGlass;  // has both sides: dropped only when neither is allowed
        const bool fibres = slot.type == ClosureType::AshikhminVelvet || (slot.type >= ClosureType::HairChiang && slot.type <= ClosureType::HairTransmission);
        const bool one_sided = (slot.lobe == LobeKind::Glossy && !settings.caustics_reflective) || (transmits && !settings.caustics_refractive);
        // Fibres make no caustics.
        const bool drop = !fibres && (glass ? !settings.caustics_reflective && !settings.caustics_refractive : one_sided);
        const bool passes = slot.type == ClosureType::Transparent;
        float* w = s.registers + size_t(slot.weight) * kSpan;
        for (int i = 0; i < n; ++i) {
            const bool dead =
                (drop && (s.path_flags[i] & shader::kRayDiffuse)) || (!passes && (s.path_flags[i] & kPathEndAtSurface)) || (s.path_flags[i] & kPathTerminate);
            const float keep = dead ? 0.0f : 1.0f;
            w[i] *= keep;
            w[kSpan + i] *= keep;
            w[2 * kSpan + i] *= keep;
        }
    }
}

/// The surface that the camera sees first draws each of its lobes once in nine times or more: what is rare there is seen as noise in every pixel, whereas
/// further on it is averaged away. Cycles does the same.
void draw_rare_lobes(SpanScratch& s, size_t slots) {
    constexpr float kLeastShare = 0.125f;
    const int n = s.span.n;
    const ConstIntColumn bounces = s.bounces, crossed = s.span.transparent_depth;
    const Column least = s.tmp, sum = s.weight_sum;
    TALBOT_VECTOR_LOOP
    for (int i = 0; i < n; ++i) {
        least[i] = (total_bounces(bounces[i]) | crossed[i]) == 0 ? kLeastShare * sum[i] : 0.0f;
        sum[i] = 0.0f;
    }
    for (size_t k = 0; k < slots; ++k) {
        const Column weight = s.slot_weight + k * kSpan;
        TALBOT_VECTOR_LOOP
        for (int i = 0; i < n; ++i) {
            weight[i] = weight[i] > 0.0f ? maxf(weight[i], least[i]) : 0.0f;
            sum[i] += weight[i];
        }
    }
}

}  // namespace

int shade_surface(const RenderContext& context, Worker& worker, const int32_t* lanes, const int32_t* shaders, int n, film::TileFilm& tile, int32_t* survivors) {
    SpanScratch& s = worker.scratch;
    StageClock clock(context, worker.counters);
    gather_span(context, worker, lanes, shaders, n);
    const shader::CompiledShader& compiled = context.programs->shaders[size_t(shaders[0])];
    geometry::shade_points(*context.scene, worker.paths.hit, worker.paths.origin, lanes, n, s.span, s.error);
    s.span.error = s.error;

    if (compiled.aov >= 0 && !worker.catcher_pass) write_aovs(context, worker, compiled.aov, lanes, tile);
    int alive = 0;
    if (compiled.surface >= 0) {
        const shader::Program& program = *context.programs->programs[size_t(compiled.surface)];
        shader::run_program(program, *context.programs, s.span, *context.shading, s.registers);

        ClosureGeometry geometry;
        geometry.wo = s.span.wo;
        geometry.ng = s.span.n_g;
        geometry.ns = program.normal != shader::kNoRegister ? triple_columns(program.normal, s.registers) : s.span.n_s;
        geometry.semantics = closure_semantics_of(context.settings->version);
        geometry.bump_correction = compiled.bump_correction;

        add_holdout(context, worker, program, tile);
        if (program.emission != shader::kNoRegister) add_emission(context, worker, program, tile);
        if (context.roulette_on_arrival) settle_roulette(context, worker);
        if (context.layout->data_passes && !worker.catcher_pass) write_data_passes(context, worker, program, geometry, tile);
        restrict_closures(context, worker, program);

        // Sampling weights of the slots, shared by light samples (densities) and scattering (choice).
        for (int i = 0; i < n; ++i) s.weight_sum[i] = 0.0f;
        for (size_t k = 0; k < program.slots.size(); ++k) {
            const ClosureSlot& slot = program.slots[k];
            float* weight = s.slot_weight + k * kSpan;
            if (slot.lobe == LobeKind::None) {
                fill(weight, n, 0.0f);
                continue;
            }
            closure_sampling_weight(slot, slot_columns(slot, s.registers), geometry, n, weight);
            for (int i = 0; i < n; ++i) s.weight_sum[i] += weight[i];
        }
        if (program.slots.size() > 1) draw_rare_lobes(s, program.slots.size());
        sample_pairs(s.span, Pair::Roulette, s.roulette_u, s.roulette_v);
        clock.lap(Stage::Surface);
        if (context.emitter_summary.has_local) sample_light(context, worker, program, geometry, light::Stratum::Local);
        if (context.emitter_summary.has_distant) sample_light(context, worker, program, geometry, light::Stratum::Distant);
        clock.lap(Stage::Light);
        alive = scatter_paths(context, worker, program, geometry, survivors);
    }
    // Lanes that did not survive are free: survivors keep the span's order, so one walk finds the others.
    int k = 0;
    for (int i = 0; i < n; ++i) {
        const bool lives = (k < alive) & (survivors[k < alive ? k : 0] == lanes[i]);
        worker.free_lanes[worker.free_count] = lanes[i];
        worker.free_count += !lives;
        k += lives;
    }
    clock.lap(Stage::Scatter);
    return alive;
}

}  // namespace TALBOT_ISA
}  // namespace talbot::integrator
