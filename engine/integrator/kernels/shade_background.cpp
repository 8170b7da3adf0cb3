/// What rays meet besides surfaces: lamps on the way, and the world and suns at the end. Light found by a scattered ray is weighted against
/// the light samples that could have found it (multiple importance sampling); behind a delta lobe or the camera it counts fully.

#include <algorithm>

#include "integrator/kernels/stages.h"

namespace talbot::integrator {
inline namespace TALBOT_ISA {

namespace {

/// What the lamps' programs ask of the paths; nothing where they have none.
light::PathDepths depths_of_met(const RenderContext& context, const PathColumns& paths, const int32_t* lanes, int n, shader::ShadingSpan& span) {
    return context.emitter_summary.has_lamp_programs ? path_depths(paths, lanes, n, span) : light::PathDepths{};
}

/// Fills the neutral columns of a background span from path lanes.
void background_span(const Worker& worker, const int32_t* lanes, int n, shader::ShadingSpan& span, int32_t constants) {
    const PathColumns& paths = worker.paths;
    span.n = n;
    span.is_background = true;
    span.is_lamp = false;
    span.uniform_constants = true;
    for (int i = 0; i < n; ++i) {
        const int32_t lane = lanes[i];
        const Vec3 d = load(paths.direction, lane);
        store(span.p, i, d);
        store(span.n_s, i, -d);
        store(span.n_g, i, -d);
        store(span.wo, i, -d);
        store(span.origin, i, load(paths.origin, lane));
        span.u[i] = span.v[i] = 0.0f;
        span.ray_length[i] = 3.0e38f;
        span.footprint[i] = paths.cone_spread[lane];
        span.object[i] = span.primitive[i] = -1;
        span.constants[i] = constants;
        span.ray_flags[i] = paths.flags[lane] & shader::kRayAny;
        span.backfacing[i] = 0;
        span.key[i] = paths.key[lane];
        span.sample[i] = paths.sample[lane];
        span.vertex[i] = uint32_t(paths.vertex[lane] & 0xffff);
    }
    path_depths(paths, lanes, n, span);
    for (int i = 0; i < n; ++i) ++span.depth[i];  // light that is met is one bounce further
}

void world_radiance(const RenderContext& context, Worker& worker, const int32_t* lanes, int n, Columns3 rgb) {
    const light::EmitterSummary& summary = context.emitter_summary;
    SpanScratch& s = worker.scratch;
    PathColumns& paths = worker.paths;
    if (summary.world_is_black) {
        for (int i = 0; i < n; ++i) store(rgb, i, Rgb{});
        return;
    }
    if (summary.world_is_constant) {
        for (int i = 0; i < n; ++i) store(rgb, i, summary.constant_world);
    } else {
        const shader::CompiledShader& compiled = context.programs->shaders[size_t(summary.world_shader)];
        const shader::Program& program = *context.programs->programs[size_t(compiled.emission)];
        background_span(worker, lanes, n, s.span, compiled.constants);
        shader::run_program(program, *context.programs, s.span, *context.shading, s.registers);
        for (int c = 0; c < 3; ++c) {
            const float* column = s.registers + size_t(program.emission + c) * kSpan;
            std::memcpy(c == 0 ? rgb.x : c == 1 ? rgb.y : rgb.z, column, size_t(n) * 4);
        }
    }
    // Weight against the importance map's samples; a constant world is never light-sampled.
    if (context.emitter_summary.has_distant && !summary.world_is_constant) {
        gather3(paths.direction, lanes, n, s.wi);
        const bool links = context.emitter_summary.has_links;
        for (int i = 0; links && i < n; ++i) s.chosen[i] = std::max(s.receiver[i], 0);
        light::pdf_background(*context.emitters, s.wi, links ? s.chosen : nullptr, n, s.pdf);
        for (int i = 0; i < n; ++i) {
            const int32_t lane = lanes[i];
            if ((paths.flags[lane] & kPathDelta) || s.pdf[i] <= 0.0f) continue;
            store(rgb, i, load(rgb, i) * power_heuristic(paths.bsdf_pdf[lane], s.pdf[i]));
        }
    }
    for (int i = 0; i < n; ++i) {
        const int32_t lane = lanes[i];
        const bool seen = summary.world_visibility & uint32_t(ray_visibility(paths.flags[lane]));
        if (!seen) store(rgb, i, Rgb{});
    }
}

/// What the discs of all suns that paths may meet bring, or of one.
void sun_radiance(const RenderContext& context, Worker& worker, const int32_t* lanes, int n, int sun, Columns3 rgb) {
    const PathColumns& paths = worker.paths;
    SpanScratch& s = worker.scratch;
    for (int i = 0; i < n; ++i) {
        const int32_t lane = lanes[i];
        store(s.wi, i, load(paths.direction, lane));
        s.itmp[i] = ray_visibility(paths.flags[lane]);
        s.pdf[i] = paths.flags[lane] & kPathDelta ? -1.0f : paths.bsdf_pdf[lane];
    }
    light::shade_suns(*context.emitters, s.wi, s.itmp, s.pdf, n, *context.programs, *context.shading, s.emitter, rgb,
                      depths_of_met(context, paths, lanes, n, s.span), context.emitter_summary.has_links ? s.receiver : nullptr, light::Met::ByPaths, sun);
}

/// A transparent film sees no world, and so nothing of its AOVs either.
void write_world_aovs(const RenderContext& context, Worker& worker, const int32_t* lanes, int n, film::TileFilm& tile) {
    const light::EmitterSummary& summary = context.emitter_summary;
    if (context.layout->aovs < 0 || summary.world_shader < 0 || context.settings->film_transparent || worker.catcher_pass) return;
    const shader::CompiledShader& compiled = context.programs->shaders[size_t(summary.world_shader)];
    if (compiled.aov < 0 || !(summary.world_visibility & scene::kVisibleCamera)) return;
    background_span(worker, lanes, n, worker.scratch.span, compiled.constants);
    write_aovs(context, worker, compiled.aov, lanes, tile);
}

/// Whether the pixel shows what is behind everything along this path. As in Cycles the catchers' pass counts too: what a catcher lets through makes its
/// shadow lighter by as much again.
bool shows_background(const Worker& worker, int32_t lane) {
    const int32_t asked = kPathSeesBackground | (worker.catcher_pass ? kPathCatcherPass : 0);
    return (worker.paths.flags[lane] & asked) == asked;
}

}  // namespace

void shade_background(const RenderContext& context, Worker& worker, const int32_t* lanes, int n, film::TileFilm& tile) {
    const scene::Settings& settings = *context.settings;
    PathColumns& paths = worker.paths;
    SpanScratch& s = worker.scratch;
    for (int begin = 0; begin < n; begin += kSpan) {
        const int32_t* span_lanes = lanes + begin;
        const int m = n - begin < kSpan ? n - begin : kSpan;
        if (context.emitter_summary.has_links) path_receivers(paths, span_lanes, m, s.receiver);
        write_world_aovs(context, worker, span_lanes, m, tile);
        world_radiance(context, worker, span_lanes, m, s.rgb);

        if (context.layout->data_passes && !worker.catcher_pass) {
            // Nothing decided what single samples keep: they are empty.
            int count = 0;
            for (int i = 0; i < m; ++i) {
                const int32_t lane = span_lanes[i];
                const bool first = paths.sample[lane] == uint32_t(settings.first_sample);
                s.itmp[count] = paths.pixel[lane];
                count += first && (paths.flags[lane] & (kPathSeesBackground | kPathDataDone)) == kPathSeesBackground;
            }
            fill(s.tmp, count, 0.0f);
            const float* columns[] = {s.tmp, s.tmp, s.tmp};
            using scene::PassKind;
            for (PassKind kind : {PassKind::Depth, PassKind::Position, PassKind::ObjectIndex, PassKind::MaterialIndex})
                film::add_data(tile, kind, s.itmp, columns, s.tmp, count);
        }
        // A transparent film sees no world: the pixel lets that much through.
        if (settings.film_transparent) {
            int count = 0;
            for (int i = 0; i < m; ++i) {
                const int32_t lane = span_lanes[i];
                if (!(paths.flags[lane] & kPathSeesBackground)) continue;
                store(s.rgb, i, Rgb{});
                if (!shows_background(worker, lane)) continue;
                s.itmp[count] = paths.pixel[lane];
                if (context.has_catchers) mark_matte(paths, &lane, 1, s.matte + count);
                s.tmp[count++] = mean(load(paths.throughput, lane));
            }
            film::add_alpha(tile, s.itmp, s.tmp, count, context.has_catchers ? s.matte : nullptr);
        }
        if (context.has_catchers && !settings.film_transparent) {
            int count = 0;
            for (int i = 0; i < m; ++i) {
                const int32_t lane = span_lanes[i];
                if (!shows_background(worker, lane)) continue;
                s.itmp[count] = paths.pixel[lane];
                store(s.tmp3, count++, load(s.rgb, i) * load(paths.throughput, lane));
            }
            film::add_background(tile, s.itmp, s.tmp3, count);
        }
        const std::vector<int32_t>& suns = context.emitter_summary.visible_suns;
        const bool groups = context.layout->light_groups >= 0;
        if (groups) {
            std::fill_n(s.light_group, m, context.emitter_summary.world_light_group);
        } else if (!suns.empty()) {
            sun_radiance(context, worker, span_lanes, m, -1, s.tmp3);
            for (int i = 0; i < m; ++i) store(s.rgb, i, load(s.rgb, i) + load(s.tmp3, i));
        }
        add_found_light(context, worker, span_lanes, m, s.rgb, film::Category::Environment, tile);
        for (size_t k = 0; groups && k < suns.size(); ++k) {
            sun_radiance(context, worker, span_lanes, m, suns[k], s.rgb);
            std::fill_n(s.light_group, m, light::sun_light_group(*context.emitters, suns[k]));
            add_found_light(context, worker, span_lanes, m, s.rgb, film::Category::Environment, tile);
        }
    }
}

void add_catcher_background(const RenderContext& context, Worker& worker, const int32_t* lanes, int n, film::TileFilm& tile) {
    const PathColumns& paths = worker.paths;
    SpanScratch& s = worker.scratch;
    if (context.emitter_summary.has_links) path_receivers(paths, lanes, n, s.receiver);
    world_radiance(context, worker, lanes, n, s.rgb);
    gather(paths.pixel, lanes, n, s.itmp);
    for (int i = 0; i < n; ++i) store(s.rgb, i, load(s.rgb, i) * load(paths.throughput, lanes[i]));
    film::add_background(tile, s.itmp, s.rgb, n);
}

void shade_lamps(const RenderContext& context, Worker& worker, const int32_t* lanes, int n, film::TileFilm& tile) {
    PathColumns& paths = worker.paths;
    SpanScratch& s = worker.scratch;
    constexpr int kMaxLampsOnRay = 64;
    // Rays count from the last scattering point, which may lie behind transparent surfaces: soft lamps turn towards it, and densities are those there.
    const Columns3 origin = s.f, direction = s.wi;
    float *t_max = s.tmp, *t_min = s.weight_sum, *t = s.tmp2, *passed = s.pdf;
    for (int begin = 0; begin < n; begin += kSpan) {
        int m = n - begin < kSpan ? n - begin : kSpan;
        std::memcpy(s.list, lanes + begin, size_t(m) * 4);
        gather(paths.mis_t, s.list, m, t_min);
        // A lamp lets the ray pass: walk from lamp to lamp.
        for (int turn = 0; turn < kMaxLampsOnRay && m > 0; ++turn) {
            gather3(paths.origin, s.list, m, origin);
            gather3(paths.direction, s.list, m, direction);
            gather(paths.mis_t, s.list, m, passed);
            gather(paths.t_max, s.list, m, t_max);
            gather(paths.hit.t, s.list, m, t);
            gather(paths.hit.object, s.list, m, s.itmp);
            gather(paths.flags, s.list, m, s.list2);
            TALBOT_VECTOR_LOOP
            for (int i = 0; i < m; ++i) {
                t_max[i] = passed[i] + (s.itmp[i] >= 0 ? t[i] : t_max[i]);
                s.list2[i] = ray_visibility(s.list2[i]);
                store(origin, i, load(origin, i) - load(direction, i) * passed[i]);
            }
            light::intersect_lamps(*context.emitters, origin, direction, t_max, s.list2, m, s.chosen, t, t_min);
            int count = 0;
            for (int i = 0; i < m; ++i) {
                if (s.chosen[i] < 0) continue;
                const int32_t lane = s.list[i];
                s.list[count] = lane;
                s.chosen[count] = s.chosen[i];
                store(origin, count, load(origin, i));
                store(direction, count, load(direction, i));
                t_min[count++] = t[i];
            }
            m = count;
            if (m == 0) break;
            const bool links = context.emitter_summary.has_links;
            if (links) path_receivers(paths, s.list, m, s.receiver);
            light::shade_lamps(*context.emitters, origin, direction, s.chosen, t_min, m, *context.programs, *context.shading, s.emitter, s.rgb, s.slot_pdf,
                               depths_of_met(context, paths, s.list, m, s.span), links ? s.receiver : nullptr);
            for (int i = 0; i < m; ++i) {
                const int32_t lane = s.list[i];
                const float w = (paths.flags[lane] & kPathDelta) || s.slot_pdf[i] <= 0.0f ? 1.0f : power_heuristic(paths.bsdf_pdf[lane], s.slot_pdf[i]);
                store(s.rgb, i, load(s.rgb, i) * w);
            }
            for (int i = 0; context.layout->light_groups >= 0 && i < m; ++i) s.light_group[i] = light::lamp_light_group(*context.emitters, s.chosen[i]);
            add_found_light(context, worker, s.list, m, s.rgb, film::Category::Emission, tile);
        }
    }
}

}  // namespace TALBOT_ISA
}  // namespace talbot::integrator
