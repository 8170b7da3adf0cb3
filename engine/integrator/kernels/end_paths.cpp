/// Paths that end where they arrived: Russian roulette, and lanes from which nothing more can come, dropped before they are sorted and shaded.
///
/// Under a sky the roulette is played here, on arrival, and not on departure from the last surface: light that a ray finds outside the scene or on the
/// surface itself has cost its ray already and is taken in full; only what shading, light samples and further rays would cost is thinned.

#include "base/sobol.h"
#include "integrator/kernels/stages.h"

namespace talbot::integrator {
inline namespace TALBOT_ISA {

int end_paths(const RenderContext& context, Worker& worker, int n) {
    const RouletteStart start = roulette_start(*context.settings);
    PathColumns& paths = worker.paths;
    int kept = 0;
    for (int i = 0; i < n; ++i) {
        const int32_t lane = worker.hits[i];
        const shader::CompiledShader& shader = context.programs->shaders[size_t(worker.shader[i])];
        const int32_t vertex = paths.vertex[lane];
        int32_t flags = paths.flags[lane];
        if (context.roulette_on_arrival) {
            const float keep = survival_probability(start, flags, paths.bounces[lane], vertex >> 16, load(paths.throughput, lane));
            if (keep < 1.0f && sample_pair(paths.key[lane], paths.sample[lane], pair_dimension(uint32_t(vertex & 0xffff), Pair::Roulette)).x >= keep)
                paths.flags[lane] = flags |= kPathTerminate;
        }
        // Light of the surface itself and holes in a transparent film still count.
        const bool may_add = shader.emission >= 0 || (flags & kPathSeesBackground);
        const bool ends = (flags & kPathTerminate) || ((flags & kPathEndAtSurface) && shader.transparency < 0);
        if (ends && !may_add) {
            worker.free_lanes[worker.free_count++] = lane;
            continue;
        }
        worker.hits[kept] = lane;
        worker.shader[kept++] = worker.shader[i];
    }
    return kept;
}

}  // namespace TALBOT_ISA
}  // namespace talbot::integrator
