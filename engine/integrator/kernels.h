/// The integrator's door for the session: one table of function pointers per instruction set.
///
/// The loop (kernels/render_unit.cpp): generate -> [intersect -> shade lamps, background -> sort by shader -> shade
/// surface over spans (program, emission, light samples, scatter) -> trace shadow] until no path of the unit lives.
#pragma once

#include <atomic>
#include <string>

#include "film/film.h"
#include "geometry/accelerator.h"
#include "geometry/displace.h"
#include "integrator/state.h"
#include "light/emitters.h"
#include "shader/program.h"

namespace talbot::integrator {

/// Sees every call of the tracer before it is made, in order; for measuring what tracing alone would cost.
struct RayRecorder {
    void (*record)(void* user, const geometry::RayColumns& rays, const int32_t* lanes, int n, const int32_t* visibility, bool shadow,
                   const geometry::TraceOptions& options) = nullptr;
    void* user = nullptr;
};

/// Shaders of the same kind are shaded together: they differ in constants alone.
TALBOT_INLINE int64_t span_kind(const shader::CompiledShader& shader) {
    return int64_t(shader.surface) << 32 | int64_t(shader.aov + 1) << 1 | int64_t(shader.bump_correction);
}

/// Everything a render reads; nothing in it changes while workers run.
struct RenderContext {
    const scene::SceneView* scene = nullptr;
    const scene::Settings* settings = nullptr;
    const scene::Camera* camera = nullptr;
    const shader::Programs* programs = nullptr;
    const shader::ShaderContext* shading = nullptr;
    const geometry::Accelerator* accelerator = nullptr;
    const light::EmitterTable* emitters = nullptr;
    light::EmitterSummary emitter_summary;
    const film::FilmLayout* layout = nullptr;
    const float* filter_table = nullptr;    ///< film::make_filter_table
    const int32_t* shader_order = nullptr;  ///< rank of each shader when sorted by program, so that equal programs are neighbours
    const int32_t* rank_shader = nullptr;   ///< the inverse
    int shader_count = 0;
    /// Where Russian roulette is played: on arrival at a surface (end_paths.cpp), or before the ray that would lead there is traced.
    bool roulette_on_arrival = true;
    scene::AttributeId uv_attribute = -1;  ///< of the UV pass
    bool has_transparent_shadows = false;
    bool has_catchers = false;  ///< shadow catchers
    geometry::TraceOptions camera_trace{16, true}, bounce_trace{8, false}, shadow_trace{8, false};
    const std::atomic<bool>* cancel = nullptr;
    const RayRecorder* recorder = nullptr;  ///< null: nothing is recorded
    bool time_stages = false;               ///< fill Counters::stage_ns
};

/// Pixels and a range of their samples. One worker renders it alone.
struct RenderUnit {
    const film::PackedPixel* pixels = nullptr;  ///< of the film, which is the crop
    int pixel_count = 0;
    int sample_begin = 0, sample_end = 0;
    int pixel_size = 1;   ///< coarse preview: film pixels are blocks of this many frame pixels a side
    bool halves = false;  ///< the tile has two planes, one for each half of the samples
};

struct KernelTable {
    const char* name = "";
    /// False: cancelled, the tile's sums are incomplete.
    bool (*render_unit)(const RenderContext& context, const RenderUnit& unit, Worker& worker, film::TileFilm& tile) = nullptr;
    /// For shader::TraceFunction; `user` is the Accelerator.
    void (*trace_for_nodes)(void* user, shader::TraceRequest& request) = nullptr;
    geometry::RunProgram run_program = nullptr;
};

/// Throws Error for a set that is not compiled in.
const KernelTable& kernels_for(const std::string& instruction_set);

}  // namespace talbot::integrator
