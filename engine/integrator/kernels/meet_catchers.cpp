/// Shadow catchers. Where a camera ray meets one first, the pixel shows what else lights or darkens it: its light with everything (the ordinary path) over its
/// light with catchers and real lights alone (the catchers' pass: the same paths again, which see nothing else from there on). All other paths are the matte.

#include "integrator/kernels/stages.h"

namespace talbot::integrator {
inline namespace TALBOT_ISA {

int meet_catchers(const RenderContext& context, Worker& worker, int n, film::TileFilm& tile) {
    PathColumns& paths = worker.paths;
    SpanScratch& s = worker.scratch;
    int kept = 0;
    for (int begin = 0; begin < n; begin += kSpan) {
        const int end = n < begin + kSpan ? n : begin + kSpan;
        int count = 0;
        for (int k = begin; k < end; ++k) {
            const int32_t lane = worker.hits[k], shader = worker.shader[k];
            int32_t& flags = paths.flags[lane];
            const bool first = (flags & kPathSeesBackground) && !(flags & (kPathCatcherHit | kPathTerminate));
            if (first && scene::traits_of(*context.scene, paths.hit.object[lane]).is_shadow_catcher) {
                flags |= kPathCatcherHit | (worker.catcher_pass ? kPathCatcherPass : 0);
                s.list[count++] = lane;
            }
            if (worker.catcher_pass && !(flags & kPathCatcherPass)) {
                const shader::CompiledShader& compiled = context.programs->shaders[size_t(shader)];
                const bool passes = compiled.transparency >= 0 || compiled.transparency_is_constant || context.settings->film_transparent_glass;
                if (!first || !passes) {
                    worker.free_lanes[worker.free_count++] = lane;
                    continue;
                }
            }
            worker.hits[kept] = lane;
            worker.shader[kept++] = shader;
        }
        if (count == 0 || worker.catcher_pass) continue;
        gather(paths.pixel, s.list, count, s.itmp);
        for (int i = 0; i < count; ++i) s.tmp[i] = mean(load(paths.throughput, s.list[i]));
        film::add_catcher_hits(tile, s.itmp, s.tmp, count);
        if (!context.settings->film_transparent) add_catcher_background(context, worker, s.list, count, tile);
    }
    return kept;
}

}  // namespace TALBOT_ISA
}  // namespace talbot::integrator
