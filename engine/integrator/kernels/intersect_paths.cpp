#include "integrator/kernels/stages.h"

namespace talbot::integrator {
inline namespace TALBOT_ISA {

void intersect_paths(const RenderContext& context, Worker& worker, const int32_t* lanes, int n, const geometry::TraceOptions& options) {
    PathColumns& paths = worker.paths;
    for (int i = 0; i < n; ++i) worker.visibility[lanes[i]] = ray_visibility(paths.flags[lanes[i]]);
    const geometry::RayColumns rays{paths.origin, paths.direction, paths.t_max, context.scene->has_motion ? paths.time : nullptr};
    if (context.recorder) context.recorder->record(context.recorder->user, rays, lanes, n, worker.visibility, false, options);
    geometry::intersect(*context.accelerator, rays, lanes, n, worker.visibility, paths.hit, options);
}

}  // namespace TALBOT_ISA
}  // namespace talbot::integrator
