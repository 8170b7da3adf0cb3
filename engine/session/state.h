/// The session's insides: what the update plan builds and the controller thread drives.
#pragma once

#include <chrono>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>

#include "asset/texture.h"
#include "base/pool.h"
#include "film/film.h"
#include "geometry/dice.h"
#include "integrator/kernels.h"
#include "session/session.h"
#include "shader/compiler.h"

namespace talbot {

using Clock = std::chrono::steady_clock;
inline double seconds_since(Clock::time_point t) {
    return std::chrono::duration<double>(Clock::now() - t).count();
}

/// What a render reads, rebuilt piece by piece as the scene's dirty bits say.
struct RenderData {
    scene::SceneTables tables;
    shader::Programs programs;
    shader::SkyCache skies;
    asset::TextureStore textures;
    std::vector<geometry::DicedMesh> diced;
    std::vector<geometry::DisplacedMesh> displaced;
    geometry::Accelerator accelerator;
    light::EmitterTablePtr emitters;
    shader::ShaderContext shading;
    std::vector<float> filter_table;
    std::vector<int32_t> shader_order, rank_shader;
    bool has_transparent_shadows = false;
    bool has_catchers = false;
    std::unique_ptr<WorkerPool> pool;
    std::vector<std::unique_ptr<integrator::Worker>> workers;
    int worker_registers = 0;
};

struct Session::State {
    scene::Scene scene;
    Report report;
    RenderData data;
    std::unique_ptr<film::Film> film;    ///< full resolution
    std::unique_ptr<film::Film> coarse;  ///< a preview at coarse_size until the first full sample is in; else null
    int coarse_size = 1;
    int width = 0, height = 0;
    std::optional<std::vector<std::string>> denoiser;  ///< its library directories; none: not denoised
    std::vector<float> denoised;                       ///< rgba; empty: not yet

    std::thread controller;
    std::atomic<bool> cancel{false};
    std::atomic<bool> paused{false};

    mutable std::mutex mutex;  ///< progress, statistics, error, film pointers, denoised
    std::condition_variable changed;
    Progress progress;
    Statistics statistics;
    std::string error;
    Clock::time_point started;

    void set_status(SessionState state, const std::string& status);
};

/// Brings `data` up to date with the scene. Throws Error, Cancelled, std::bad_alloc.
void update_render_data(Session::State& s);

/// What kernels read, for a film of this layout. Valid until the scene is edited.
integrator::RenderContext make_context(Session::State& s, const film::FilmLayout& layout);

/// Renders until all samples are done, the time is up, or cancelled (throws Cancelled).
void render_samples(Session::State& s);

}  // namespace talbot
