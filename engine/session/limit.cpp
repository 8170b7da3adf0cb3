/// Measures how near the path tracer comes to bare ray tracing.

#include <algorithm>
#include <array>
#include <ctime>

#include "session/state.h"

namespace talbot {

namespace {

constexpr int kRuns = 15;

enum Kind { kCamera, kBounce, kShadow, kKinds };

/// Rays in the order they were traced, a call of the tracer after another.
struct Recording {
    std::vector<float> origin[3], direction[3], t_max;
    std::vector<int32_t> visibility;
    struct Call {
        size_t begin = 0;
        int n = 0;
        Kind kind = kCamera;
    };
    std::vector<Call> calls;
};

void record(void* user, const geometry::RayColumns& rays, const int32_t* lanes, int n, const int32_t* visibility, bool shadow,
            const geometry::TraceOptions& options) {
    Recording& r = *static_cast<Recording*>(user);
    if (n == 0) return;
    r.calls.push_back({r.t_max.size(), n, shadow ? kShadow : options.coherent ? kCamera : kBounce});
    const float* from[7] = {rays.origin.x, rays.origin.y, rays.origin.z, rays.direction.x, rays.direction.y, rays.direction.z, rays.t_max};
    std::vector<float>* to[7] = {&r.origin[0], &r.origin[1], &r.origin[2], &r.direction[0], &r.direction[1], &r.direction[2], &r.t_max};
    for (int column = 0; column < 7; ++column)
        for (int i = 0; i < n; ++i) to[column]->push_back(from[column][lanes[i]]);
    for (int i = 0; i < n; ++i) r.visibility.push_back(visibility[lanes[i]]);
}

/// The thread's own seconds: what else the machine does is not counted.
double cpu_seconds() {
    timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return double(t.tv_sec) + 1e-9 * double(t.tv_nsec);
}

/// Seconds to trace all rays of each kind, this many lanes wide.
std::array<double, kKinds> replay(const geometry::Accelerator& accelerator, Recording& r, int width) {
    std::vector<float> t(kBatch * 2), u(kBatch * 2), v(kBatch * 2);
    std::vector<int32_t> object(kBatch * 2), primitive(kBatch * 2);
    std::vector<uint8_t> blocked(kBatch * 2);
    const geometry::HitColumns hits{t.data(), u.data(), v.data(), object.data(), primitive.data()};
    std::array<double, kKinds> seconds{};
    for (const Recording::Call& call : r.calls) {
        auto at = [&](std::vector<float>& column) { return column.data() + call.begin; };
        const geometry::RayColumns rays{
            {at(r.origin[0]), at(r.origin[1]), at(r.origin[2])}, {at(r.direction[0]), at(r.direction[1]), at(r.direction[2])}, at(r.t_max)};
        geometry::TraceOptions options;
        options.width = width;
        options.coherent = call.kind == kCamera;
        const double begin = cpu_seconds();
        if (call.kind == kShadow)
            geometry::occluded(accelerator, rays, nullptr, call.n, r.visibility.data() + call.begin, blocked.data(), options);
        else
            geometry::intersect(accelerator, rays, nullptr, call.n, r.visibility.data() + call.begin, hits, options);
        seconds[call.kind] += cpu_seconds() - begin;
    }
    return seconds;
}

/// Seconds for all tiles and samples.
double render_all(Session::State& s, const integrator::RenderContext& context, int samples) {
    const integrator::KernelTable& kernels = integrator::kernels_for(s.statistics.instruction_set);
    constexpr size_t side = 64;
    const std::vector<film::PackedPixel> all = film::list_pixels(s.width, s.height, int(side));
    film::TileFilm tile;
    const double begin = cpu_seconds();
    for (size_t first = 0; first < all.size(); first += side * side) {
        const std::span pixels = std::span(all).subspan(first, std::min(side * side, all.size() - first));
        tile.reset(s.film->layout(), int(pixels.size()));
        kernels.render_unit(context, {pixels.data(), int(pixels.size()), 0, samples}, *s.data.workers[0], tile);
        s.film->merge(tile, pixels, samples);
    }
    return cpu_seconds() - begin;
}

}  // namespace

TracingLimit measure_tracing_limit(const scene::Scene& scene, int samples) {
    FlushDenormals flush;
    Session::State s;
    s.scene = scene;
    s.scene.settings.threads = 1;
    s.scene.settings.viewport = false;
    s.scene.settings.adaptive = false;
    // Guides serve the denoiser, whose own time does not count either.
    std::erase_if(s.scene.passes, [](scene::PassKind p) { return p == scene::PassKind::DenoisingAlbedo || p == scene::PassKind::DenoisingNormal; });
    s.scene.dirty = scene::kDirtyAll;
    update_render_data(s);
    integrator::RenderContext context = make_context(s, s.film->layout());

    TracingLimit result;
    integrator::Worker& worker = *s.data.workers[0];
    worker.counters = {};
    context.time_stages = true;
    render_all(s, context, samples);
    result.vertices = worker.counters.vertices;
    static constexpr const char* kNames[] = {"generate", "intersect", "background", "sort", "surface", "light", "scatter", "shadow"};
    for (int stage = 0; stage < integrator::kStageCount; ++stage)
        result.stage_ns.emplace_back(kNames[stage], double(worker.counters.stage_ns[stage]) / double(std::max<uint64_t>(result.vertices, 1)));

    Recording recording;
    const integrator::RayRecorder recorder{&record, &recording};
    context.time_stages = false;
    context.recorder = &recorder;
    render_all(s, context, samples);
    result.rays = recording.t_max.size();

    // In turns, since processors change their pace; the least of a few runs, of the renderer as of bare tracing: what else the machine does only adds.
    context.recorder = nullptr;
    std::array<double, kKinds> best;
    best.fill(1e30);
    result.render_seconds = 1e30;
    for (int run = 0; run < kRuns; ++run) {
        result.render_seconds = std::min(result.render_seconds, render_all(s, context, samples));
        for (int width : {1, 8, 16}) {
            const std::array<double, kKinds> seconds = replay(s.data.accelerator, recording, width);
            for (int kind = 0; kind < kKinds; ++kind) best[kind] = std::min(best[kind], seconds[kind]);
        }
    }
    for (double seconds : best) result.trace_seconds += seconds;
    return result;
}

}  // namespace talbot
