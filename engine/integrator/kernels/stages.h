/// The stages, in the order of the loop. Each works on lists of lanes and leaves the path columns ready for the next.
#pragma once

#include <ctime>

#include "base/math.h"
#include "base/sobol.h"
#include "geometry/surface.h"
#include "integrator/kernels.h"

namespace talbot::integrator {
inline namespace TALBOT_ISA {

/// Starts paths in free lanes: samples [cursor, ...) of the unit in pixel order within a sample. Returns how many; their lanes are in worker.fresh.
int generate_paths(const RenderContext& context, const RenderUnit& unit, int64_t& cursor, Worker& worker);

/// Closest hits of the listed lanes.
void intersect_paths(const RenderContext& context, Worker& worker, const int32_t* lanes, int n, const geometry::TraceOptions& options);

/// Sends the radiance `rgb` that n <= kSpan paths found (weighted already, lane by lane of the list) to the film: throughput, clamp, category by the
/// number of scatterings. `seen` is its category where there was none. Uses rgb, itmp, tmp3 and the shares of the scratch.
void add_found_light(const RenderContext& context, Worker& worker, const int32_t* lanes, int n, Columns3 rgb, film::Category seen, film::TileFilm& tile);

/// Lamps between the origin and the hit: they emit and let the ray pass.
void shade_lamps(const RenderContext& context, Worker& worker, const int32_t* lanes, int n, film::TileFilm& tile);

/// Emitters with blockers of their own that the listed paths' rays would meet, where something has just scattered them: shadow rays say what arrives.
void find_linked_light(const RenderContext& context, Worker& worker, const int32_t* lanes, int n, film::TileFilm& tile);

/// World and suns for rays that left the scene; these paths end.
void shade_background(const RenderContext& context, Worker& worker, const int32_t* lanes, int n, film::TileFilm& tile);

/// For the first n lanes of worker.hits (shaders in worker.shader): marks the paths whose camera ray has met a shadow catcher, and in the catchers' pass
/// frees those that cannot meet one any more. Returns how many stay, in their order.
int meet_catchers(const RenderContext& context, Worker& worker, int n, film::TileFilm& tile);

/// The world behind catchers that the listed camera paths met.
void add_catcher_background(const RenderContext& context, Worker& worker, const int32_t* lanes, int n, film::TileFilm& tile);

/// Whether contributions of a path with these flags count in this pass of the unit.
TALBOT_INLINE bool counts(const Worker& worker, int32_t flags) {
    return !worker.catcher_pass || (flags & kPathCatcherPass) != 0;
}

/// Tells the film which of the listed paths' contributions belong to the matte; for scenes with shadow catchers.
TALBOT_INLINE void mark_matte(const PathColumns& paths, const int32_t* lanes, int n, int32_t* matte) {
    for (int i = 0; i < n; ++i) matte[i] = (paths.flags[lanes[i]] & kPathCatcherHit) == 0;
}

/// Bounces of the paths, in the span's columns.
TALBOT_INLINE light::PathDepths path_depths(const PathColumns& paths, const int32_t* lanes, int n, shader::ShadingSpan& span) {
    for (int i = 0; i < n; ++i) {
        const int32_t lane = lanes[i];
        span.depth[i] = total_bounces(paths.bounces[lane]);
        span.diffuse_depth[i] = diffuse_bounces(paths.bounces[lane]);
        span.glossy_depth[i] = glossy_bounces(paths.bounces[lane]);
        span.transmission_depth[i] = transmission_bounces(paths.bounces[lane]);
        span.transparent_depth[i] = paths.vertex[lane] >> 16;
    }
    return {span.depth, span.diffuse_depth, span.glossy_depth, span.transparent_depth, span.transmission_depth};
}

/// Plays Russian roulette with the first n lanes of worker.hits (shaders in worker.shader) and frees those that bring nothing more. Returns how many
/// stay, in their order.
int end_paths(const RenderContext& context, Worker& worker, int n);

/// Up to kSpan lanes whose `shaders` share a program: emission, light samples into the shadow queue, next direction. Writes the lanes that go on to
/// `survivors` and returns their number.
int shade_surface(const RenderContext& context, Worker& worker, const int32_t* lanes, const int32_t* shaders, int n, film::TileFilm& tile, int32_t* survivors);

/// First-hit passes of camera paths in the span whose program has run.
void write_data_passes(const RenderContext& context, Worker& worker, const shader::Program& program, const ClosureGeometry& geometry, film::TileFilm& tile);

/// BSDF over all slots towards s.wi (f) and the mixture's density there (pdf). `lamp_visibility`: which kinds of lobe a lamp lights, null: all.
/// With `shares`, the parts of f that are diffuse and glossy go to s.f_diffuse and s.f_glossy (0..1 a channel).
void eval_closures(SpanScratch& s, const shader::Program& program, const ClosureGeometry& geometry, const int32_t* lamp_visibility, bool shares, Columns3 f,
                   float* pdf);

/// What the AOV program of the span's shaders (a surface's, or the world's) gives, for those of its lanes whose camera ray has met nothing opaque yet:
/// it is added up over all that is met on the way, as in Cycles. Overwrites the registers.
void write_aovs(const RenderContext& context, Worker& worker, int program, const int32_t* lanes, film::TileFilm& tile);

/// Light samples of the span whose program has run; pushes shadow rays.
void sample_light(const RenderContext& context, Worker& worker, const shader::Program& program, const ClosureGeometry& geometry, light::Stratum stratum);

/// Chooses a slot and a direction for each lane and updates the path. Returns survivors.
int scatter_paths(const RenderContext& context, Worker& worker, const shader::Program& program, const ClosureGeometry& geometry, int32_t* survivors);

/// Shadow rays of this turn: what is not blocked reaches the film.
void trace_shadow(const RenderContext& context, Worker& worker, film::TileFilm& tile);

/// Adds the time since the last call to a stage, when stages are timed.
class StageClock {
public:
    TALBOT_MEMBER StageClock(const RenderContext& context, Counters& counters) : counters_(context.time_stages ? &counters : nullptr), last_(0) {
        if (counters_) last_ = now();
    }
    TALBOT_MEMBER void lap(Stage stage) {
        if (!counters_) return;
        const uint64_t t = now();
        counters_->stage_ns[int(stage)] += t - last_;
        last_ = t;
    }
    /// Forgets the time since the last call: somebody else has counted it.
    TALBOT_MEMBER void skip() {
        if (counters_) last_ = now();
    }

private:
    TALBOT_MEMBER static uint64_t now() {
        timespec t;
        clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
        return uint64_t(t.tv_sec) * 1000000000u + uint64_t(t.tv_nsec);
    }
    Counters* counters_;
    uint64_t last_;
};

/// Three registers in a row.
TALBOT_INLINE ConstColumns3 triple_columns(uint16_t first, const float* registers) {
    const float* x = registers + size_t(first) * kSpan;
    return {x, x + kSpan, x + 2 * kSpan};
}

/// The slot's columns over the span's registers.
TALBOT_INLINE ClosureColumns slot_columns(const ClosureSlot& slot, const float* registers) {
    ClosureColumns c;
    c.weight = triple_columns(slot.weight, registers);
    c.normal = triple_columns(slot.normal, registers);
    for (int i = 0; i < slot.param_count; ++i) c.params[i] = registers + size_t(slot.params[i]) * kSpan;
    return c;
}

/// Adds s.slot_f towards s.wi to the diffuse or glossy part (s.f_diffuse, s.f_glossy). What is neither is transmission: all that crosses but for diffuse
/// lobes, which translucency is one of.
TALBOT_INLINE void add_shares(SpanScratch& s, const ClosureSlot& slot, const ClosureGeometry& geometry) {
    const bool diffuse = slot.lobe == LobeKind::Diffuse;
    const Columns3 part = diffuse ? s.f_diffuse : s.f_glossy;
    for (int i = 0; i < s.span.n; ++i) {
        const float counts = diffuse || dot(load(s.wi, i), load(geometry.ns, i)) > 0.0f ? 1.0f : 0.0f;
        store(part, i, load(part, i) + load(s.slot_f, i) * counts);
    }
}

/// Shadow terminator's shading offset: a reflecting closure's cosine c = N . wi becomes cos(frequency acos c), 0 at the latest where that passes 90 degrees.
TALBOT_INLINE float terminator_factor(float frequency, float c) {
    const float cosine = minf(c, 1.0f);
    return frequency > 1.0f && c > 0.0f ? maxf(lane_cos(frequency * lane_acos(cosine)), 0.0f) / cosine : 1.0f;
}

/// scene::Visibility bit of the kind of ray, from its flags: transmission wins, then camera, diffuse, glossy. Where only catchers are seen, their bit.
TALBOT_INLINE int32_t ray_visibility(int32_t flags) {
    const int32_t transmission = flags & shader::kRayTransmission;
    const int32_t camera = flags & shader::kRayCamera;
    const int32_t diffuse = flags & shader::kRayDiffuse;
    const int32_t bit = transmission ? scene::kVisibleTransmission : camera ? scene::kVisibleCamera : diffuse ? scene::kVisibleDiffuse : scene::kVisibleGlossy;
    return flags & kPathCatcherPass ? bit << scene::kCatcherShift : bit;
}

/// Receiver sets of the objects that sent the listed paths' rays, -1 of the camera's: for emitters that are linked.
TALBOT_INLINE void path_receivers(const PathColumns& paths, const int32_t* lanes, int n, int32_t* receiver) {
    for (int i = 0; i < n; ++i) {
        const int32_t flags = paths.flags[lanes[i]];
        receiver[i] = flags & shader::kRayCamera ? -1 : (flags >> kPathReceiverShift) & (scene::kReceiverSets - 1);
    }
}

/// One pair of the sampler for each lane's vertex.
TALBOT_INLINE void sample_pairs(const shader::ShadingSpan& span, Pair pair, Column u, Column v) {
    const uint32_t* __restrict key = span.key;
    const uint32_t* __restrict sample = span.sample;
    const uint32_t* __restrict vertex = span.vertex;
    TALBOT_VECTOR_LOOP
    for (int i = 0; i < span.n; ++i) {
        const Vec2 p = sample_pair(key[i], sample[i], pair_dimension(vertex[i], pair));
        u[i] = p.x;
        v[i] = p.y;
    }
}

/// Scales a contribution whose channels sum to more than `limit` (0: no limit); non-finite becomes black.
TALBOT_INLINE Rgb clamp_contribution(Rgb c, float limit) {
    const float s = std::fabs(c.x) + std::fabs(c.y) + std::fabs(c.z);
    const float scale = limit > 0.0f && s > limit ? limit / s : 1.0f;
    const bool finite = s < 3.0e38f;  // false for NaN too
    return {finite ? c.x * scale : 0.0f, finite ? c.y * scale : 0.0f, finite ? c.z * scale : 0.0f};
}

/// After how many scatterings, and how many transparent surfaces in a row, Russian roulette begins.
struct RouletteStart {
    int light = 0, transparent = 0;
};
TALBOT_INLINE RouletteStart roulette_start(const scene::Settings& settings) {
    return {settings.min_light_bounces + 1, settings.min_transparent_bounces + 1};
}

/// Probability with which Russian roulette lets a path go on that has arrived at a surface: all of them until half of the light is lost, then the root of
/// the rest. The root ends paths later than their throughput alone would, because what the eye sees of a picture is closer to the root of radiance; the
/// factor is where (variance x rays) is least: 10 to 21 % less in the bench's scenes than with a factor of 1, 1 to 16 % in others.
TALBOT_INLINE float survival_probability(RouletteStart start, int32_t flags, int32_t bounces, int crossed, Rgb throughput) {
    const bool straight_on = (flags & kPathCrossed) != 0;
    const int met = straight_on ? crossed : total_bounces(bounces), first = straight_on ? start.transparent : start.light;
    const float keep = minf(1.0f, std::sqrt(2.0f * max_magnitude(throughput)));
    return met > first ? keep : 1.0f;
}

/// Power heuristic [Veach 1997, eq. 9.13 with beta = 2].
TALBOT_INLINE float power_heuristic(float a, float b) {
    // Divided through by a^2, so that large densities do not overflow.
    const float r = b / a;
    return a > 0.0f ? 1.0f / (1.0f + r * r) : 0.0f;
}

}  // namespace TALBOT_ISA
}  // namespace talbot::integrator
