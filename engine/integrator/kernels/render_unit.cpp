/// The loop: one worker, one unit, until no path of the unit lives. Lanes are refilled as paths end, so spans stay
/// full at depth and in small pictures.

#include "integrator/kernels/stages.h"

namespace talbot::integrator {
inline namespace TALBOT_ISA {

namespace {

/// Splits the lanes that were just traced into those that hit and those that left the scene.
void split_hits(const Worker& worker, const int32_t* lanes, int n, int32_t* hits, int& hit_count, int32_t* missed, int& missed_count) {
    const int32_t* object = worker.paths.hit.object;
    for (int i = 0; i < n; ++i) {
        const int32_t lane = lanes[i];
        const bool hit = object[lane] >= 0;
        hits[hit_count] = lane;
        missed[missed_count] = lane;
        hit_count += hit;
        missed_count += !hit;
    }
}

/// Counting sort of the hit lanes by their shader's rank: equal programs become neighbours, equal shaders within them too. Stable, so the order does
/// not depend on anything but the paths.
void sort_by_program(const RenderContext& context, Worker& worker, int n) {
    int32_t* buckets = worker.buckets;
    const int count = context.shader_count;
    std::memset(buckets, 0, size_t(count) * 4);
    for (int i = 0; i < n; ++i) {
        worker.shader[i] = context.shader_order[worker.shader[i]];
        ++buckets[worker.shader[i]];
    }
    int32_t sum = 0;
    for (int b = 0; b < count; ++b) {
        const int32_t size = buckets[b];
        buckets[b] = sum;
        sum += size;
    }
    for (int i = 0; i < n; ++i) {
        const int32_t rank = worker.shader[i], to = buckets[rank]++;
        worker.sorted[to] = worker.hits[i];
        worker.sorted_shader[to] = context.rank_shader[rank];
    }
    // Afterwards buckets[b] is the end of shader rank b.
}

/// Follows all paths of the unit. False: cancelled.
bool follow_paths(const RenderContext& context, const RenderUnit& unit, Worker& worker, film::TileFilm& tile) {
    worker.free_count = kBatch;
    for (int i = 0; i < kBatch; ++i) worker.free_lanes[i] = kBatch - 1 - i;
    worker.shadow.n = 0;
    int64_t cursor = 0;
    int active = 0;
    for (;;) {
        if (context.cancel && context.cancel->load(std::memory_order_relaxed)) return false;
        StageClock clock(context, worker.counters);
        const int fresh = generate_paths(context, unit, cursor, worker);
        if (active + fresh == 0) return true;
        clock.lap(Stage::Generate);

        intersect_paths(context, worker, worker.fresh, fresh, context.camera_trace);
        intersect_paths(context, worker, worker.active, active, context.bounce_trace);
        clock.lap(Stage::Intersect);
        worker.counters.camera_rays += uint64_t(fresh);
        worker.counters.bounce_rays += uint64_t(active);
        if (context.emitter_summary.has_visible_lamps) {
            shade_lamps(context, worker, worker.active, active, tile);
            shade_lamps(context, worker, worker.fresh, fresh, tile);
        }
        if (context.scene->has_blockers) find_linked_light(context, worker, worker.active, active, tile);

        int hit_count = 0, missed_count = 0;
        split_hits(worker, worker.active, active, worker.hits, hit_count, worker.missed, missed_count);
        split_hits(worker, worker.fresh, fresh, worker.hits, hit_count, worker.missed, missed_count);
        shade_background(context, worker, worker.missed, missed_count, tile);
        for (int i = 0; i < missed_count; ++i) worker.free_lanes[worker.free_count++] = worker.missed[i];

        clock.lap(Stage::Background);
        geometry::hit_shaders(*context.scene, worker.paths.hit, worker.hits, hit_count, worker.shader);
        worker.counters.vertices += uint64_t(hit_count);
        if (context.has_catchers) hit_count = meet_catchers(context, worker, hit_count, tile);
        hit_count = end_paths(context, worker, hit_count);
        sort_by_program(context, worker, hit_count);
        clock.lap(Stage::Sort);

        active = 0;
        int begin = 0;
        const int32_t* ends = worker.buckets;
        for (int rank = 0; rank < context.shader_count && begin < hit_count; ++rank) {
            int end = ends[rank];
            // Neighbouring ranks of the same kind share spans.
            const auto kind = [&](int r) { return span_kind(context.programs->shaders[size_t(context.rank_shader[r])]); };
            const int first = rank;
            while (rank + 1 < context.shader_count && kind(rank + 1) == kind(first)) end = ends[++rank];
            for (; begin < end; begin += kSpan) {
                const int n = end - begin < kSpan ? end - begin : kSpan;
                const int survivors = shade_surface(context, worker, worker.sorted + begin, worker.sorted_shader + begin, n, tile, worker.active + active);
                active += survivors;
            }
            begin = end;
        }
        clock.skip();
        trace_shadow(context, worker, tile);
        clock.lap(Stage::Shadow);
    }
}

}  // namespace

bool render_unit(const RenderContext& context, const RenderUnit& unit, Worker& worker, film::TileFilm& tile) {
    worker.catcher_pass = false;
    if (!follow_paths(context, unit, worker, tile)) return false;
    if (!context.has_catchers) return true;
    worker.catcher_pass = true;
    return follow_paths(context, unit, worker, tile);
}

}  // namespace TALBOT_ISA
}  // namespace talbot::integrator
