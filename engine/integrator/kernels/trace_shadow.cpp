/// Shadow rays. Opaque casters are asked first, all at once; only rays that survive look for transparent ones, surface by surface.

#include "integrator/kernels/stages.h"

namespace talbot::integrator {
inline namespace TALBOT_ISA {

namespace {

geometry::TraceOptions trace_options(const RenderContext& context) {
    geometry::TraceOptions options = context.shadow_trace;
    options.blockers = context.scene->has_blockers ? context.scene : nullptr;
    return options;
}

/// Multiplies rgb of queue entries list[0..n) by the transparency of the surfaces they just hit, which share a program; moves the rays behind them.
/// Entries that go on are kept in place at the front of list; returns their number.
int cross_surfaces(const RenderContext& context, Worker& worker, int32_t* list, int n, const shader::CompiledShader& compiled) {
    ShadowQueue& queue = worker.shadow;
    SpanScratch& s = worker.scratch;
    const PathColumns& paths = worker.paths;
    if (compiled.transparency < 0 && !compiled.transparency_is_constant) {
        for (int i = 0; i < n; ++i) queue.blocked[list[i]] = 1;
        return 0;
    }
    shader::ShadingSpan& span = s.span;
    span.n = n;
    span.is_background = false;
    span.is_lamp = false;
    span.uniform_constants = true;
    for (int i = 0; i < n; ++i) {
        const int32_t k = list[i], lane = queue.lane[k];
        store(span.wo, i, -load(queue.direction, k));
        span.ray_length[i] = queue.passed[k] + queue.hit.t[k];
        span.footprint[i] = paths.cone_width[lane];
        span.constants[i] = compiled.constants;
        span.ray_flags[i] = shader::kRayShadow;
        span.depth[i] = total_bounces(queue.bounces[k]) + 1;
        span.diffuse_depth[i] = diffuse_bounces(queue.bounces[k]);
        span.glossy_depth[i] = glossy_bounces(queue.bounces[k]);
        span.transmission_depth[i] = transmission_bounces(queue.bounces[k]);
        span.transparent_depth[i] = queue.crossed[k];
        span.key[i] = paths.key[lane];
        span.sample[i] = paths.sample[lane];
        span.vertex[i] = uint32_t(paths.vertex[lane] & 0xffff);
        store(s.wi, i, load(queue.direction, k));
        s.time[i] = queue.time[k];
    }
    span.time = context.scene->has_motion ? s.time : nullptr;
    geometry::shade_points(*context.scene, queue.hit, queue.origin, list, n, span, s.error);
    span.error = s.error;
    ConstColumns3 through;
    if (!compiled.transparency_is_constant) {
        const shader::Program& program = *context.programs->programs[size_t(compiled.transparency)];
        shader::run_program(program, *context.programs, span, *context.shading, s.registers);
        const float* r = s.registers + size_t(program.transparency) * kSpan;
        through = {r, r + kSpan, r + 2 * kSpan};
    }
    geometry::offset_origin(span.p, span.n_g, s.wi, s.error, n, s.tmp3);
    int alive = 0;
    for (int i = 0; i < n; ++i) {
        const int32_t k = list[i];
        const Rgb t = compiled.transparency_is_constant ? compiled.constant_transparency : load(through, i);
        const Rgb c = load(queue.rgb, k) * t;
        store(queue.rgb, k, c);
        ++queue.crossed[k];
        if (!(max_magnitude(c) > 0.0f) || queue.crossed[k] > context.settings->transparent_bounces) {
            queue.blocked[k] = 1;
            continue;
        }
        store(queue.origin, k, load(s.tmp3, i));
        queue.t_max[k] = maxf(queue.t_max[k] - queue.hit.t[k], 0.0f);
        queue.passed[k] += queue.hit.t[k];
        list[alive++] = k;
    }
    return alive;
}

void trace_transparent(const RenderContext& context, Worker& worker, const geometry::TraceOptions& options) {
    ShadowQueue& queue = worker.shadow;
    const geometry::RayColumns rays{queue.origin, queue.direction, queue.t_max, context.scene->has_motion ? queue.time : nullptr};
    const uint32_t transparent = uint32_t(scene::kVisibleTransparentShadow) << (worker.catcher_pass ? scene::kCatcherShift : 0);
    int n = 0;
    for (int k = 0; k < queue.n; ++k) {
        queue.visibility[k] = int32_t(transparent | (uint32_t(queue.visibility[k]) & scene::kBlockerBits));
        queue.list[n] = k;
        n += !queue.blocked[k] && queue.t_max[k] > 0.0f;
    }
    while (n > 0) {
        geometry::intersect(*context.accelerator, rays, queue.list, n, queue.visibility, queue.hit, options);
        worker.counters.shadow_rays += uint64_t(n);
        int hits = 0;
        for (int i = 0; i < n; ++i) {
            const int32_t k = queue.list[i];
            if (queue.hit.object[k] >= 0) queue.list[hits++] = k;
        }
        geometry::hit_shaders(*context.scene, queue.hit, queue.list, hits, queue.shader);
        // Spans of one shader each: take the first entry's kin, cross, repeat with the rest.
        int going = 0;
        while (hits > 0) {
            int32_t* kin = worker.scratch.list;
            const int32_t shader = queue.shader[0];
            int count = 0, rest = 0;
            for (int i = 0; i < hits; ++i) {
                if (queue.shader[i] == shader && count < kSpan) {
                    kin[count++] = queue.list[i];
                } else {
                    queue.list[rest] = queue.list[i];
                    queue.shader[rest++] = queue.shader[i];
                }
            }
            hits = rest;
            const int alive = cross_surfaces(context, worker, kin, count, context.programs->shaders[size_t(shader)]);
            std::memcpy(queue.going + going, kin, size_t(alive) * 4);
            going += alive;
        }
        std::memcpy(queue.list, queue.going, size_t(going) * 4);
        n = going;
    }
}

void add_unblocked(const RenderContext& context, Worker& worker, film::TileFilm& tile) {
    ShadowQueue& queue = worker.shadow;
    for (int indirect = 0; indirect < 2; ++indirect) {
        int n = 0;
        for (int k = 0; k < queue.n; ++k) {
            queue.list[n] = k;
            n += !queue.blocked[k] && queue.indirect[k] == indirect && counts(worker, worker.paths.flags[queue.lane[k]]);
        }
        // The film takes plain columns: gather a span at a time.
        SpanScratch& s = worker.scratch;
        for (int begin = 0; begin < n; begin += kSpan) {
            const int m = n - begin < kSpan ? n - begin : kSpan;
            gather(queue.pixel, queue.list + begin, m, s.itmp);
            gather3(queue.rgb, queue.list + begin, m, s.rgb);
            film::Contributions c;
            c.pixel = s.itmp;
            c.rgb = s.rgb;
            c.n = m;
            if (context.has_catchers) {
                gather(queue.lane, queue.list + begin, m, s.list2);
                mark_matte(worker.paths, s.list2, m, s.matte);
                c.matte = s.matte;
            }
            if (context.layout->light_groups >= 0) {
                gather(queue.light_group, queue.list + begin, m, s.film_group);
                c.light_group = s.film_group;
            }
            if (context.layout->light_passes) {
                gather3(queue.diffuse_share, queue.list + begin, m, s.share_a);
                gather3(queue.glossy_share, queue.list + begin, m, s.share_b);
                c.diffuse = s.share_a;
                c.glossy = s.share_b;
            }
            film::add(tile, worker.catcher_pass ? film::Category::Catcher : indirect ? film::Category::Indirect : film::Category::Direct, c);
        }
    }
}

}  // namespace

void trace_shadow(const RenderContext& context, Worker& worker, film::TileFilm& tile) {
    ShadowQueue& queue = worker.shadow;
    if (queue.n == 0) return;
    int n = 0;
    for (int k = 0; k < queue.n; ++k) {
        queue.blocked[k] = 0;
        queue.list[n] = k;
        n += queue.t_max[k] > 0.0f;
    }
    const geometry::RayColumns rays{queue.origin, queue.direction, queue.t_max, context.scene->has_motion ? queue.time : nullptr};
    const geometry::TraceOptions options = trace_options(context);
    if (context.recorder) context.recorder->record(context.recorder->user, rays, queue.list, n, queue.visibility, true, options);
    geometry::occluded(*context.accelerator, rays, queue.list, n, queue.visibility, queue.blocked, options);
    worker.counters.shadow_rays += uint64_t(n);
    if (context.has_transparent_shadows) trace_transparent(context, worker, options);
    add_unblocked(context, worker, tile);
    queue.n = 0;
}

}  // namespace TALBOT_ISA
}  // namespace talbot::integrator
