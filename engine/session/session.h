/// A session renders one scene: edits -> update plan -> workers -> film. Any number of sessions live side by side. The
/// caller's thread never blocks but in `wait` and `stop`.
#pragma once

#include <atomic>
#include <memory>
#include <string>
#include <vector>

#include "base/error.h"
#include "scene/scene.h"

namespace talbot {

enum class SessionState : uint8_t { Idle, Updating, Rendering, Paused, Done, Cancelled, Failed };

struct Progress {
    SessionState state = SessionState::Idle;
    std::string status;  ///< "Building BVH", "Sample 12/128"
    float fraction = 0;  ///< of the render
    int samples_done = 0, samples_total = 0;
    double seconds = 0;                  ///< since start
    double remaining = -1;               ///< s, -1: unknown
    size_t memory = 0, memory_peak = 0;  ///< bytes of the scene, BVH, textures, film
    uint64_t image_version = 0;          ///< grows when the film holds something new
    int pixel_size = 1;                  ///< > 1: a coarse preview is on the film
};

struct Statistics {
    double update_seconds = 0, compile_seconds = 0, textures_seconds = 0, bvh_seconds = 0, lights_seconds = 0, render_seconds = 0;
    uint64_t camera_rays = 0, bounce_rays = 0, shadow_rays = 0, paths = 0;
    std::string instruction_set;
    size_t triangles = 0, instanced_triangles = 0, scene_bytes = 0, bvh_bytes = 0, texture_bytes = 0, film_bytes = 0;
};

class Session {
public:
    Session();
    ~Session();  ///< stops and joins

    /// The scene, for editing. Stops the workers first (within 200 ms); set the dirty bits. Do not call while another thread edits.
    scene::Scene& edit();
    /// Updates what is dirty and renders in the background. Errors appear in `progress().state == Failed` and `error()`.
    void start();
    /// Waits until done, failed, cancelled, or `milliseconds` have passed. True when the session is no longer running.
    bool wait(int milliseconds);
    void cancel();  ///< asks; returns at once
    void stop();    ///< asks and joins
    void pause(bool paused);

    Progress progress() const;
    Statistics statistics() const;
    std::string error() const;
    Report& report();

    int width() const;  ///< of the rendered area
    int height() const;
    /// Current mean of a pass: width*height*channels, bottom row first. Returns false when the pass was not asked for or nothing is rendered yet.
    bool read_pass(scene::PassKind kind, std::vector<float>& out) const;
    /// The same for an AOV: width*height*4 of a colour, width*height of a value. False too when it is none of Scene::aovs.
    bool read_aov(const scene::Aov& aov, std::vector<float>& out) const;
    /// And for one of Scene::light_groups: width*height*3.
    bool read_light_group(const std::string& name, std::vector<float>& out) const;

    /// From the next start on Combined is denoised in the background when its samples are done, with albedo and normal guides (where asked for as passes);
    /// then the session is. `library_dirs`: where to look for Open Image Denoise first; null: not denoised.
    void set_denoiser(const std::vector<std::string>* library_dirs);
    /// Denoised Combined, width*height*4. False while there is none; the report says when there cannot be one.
    bool read_denoised(std::vector<float>& rgba_out) const;

    struct State;

private:
    std::unique_ptr<State> state_;
};

/// How near a render comes to what tracing its rays alone would cost: one thread, the same rays in the same order and BVH.
struct TracingLimit {
    double render_seconds = 0;
    double trace_seconds = 0;  ///< the fastest of 1, 8 and 16 lanes wide, chosen apart for camera, bounce and shadow rays
    uint64_t rays = 0, vertices = 0;
    std::vector<std::pair<std::string, double>> stage_ns;  ///< nanoseconds a path vertex
};
/// Renders `samples` samples twice (once recording), then replays the rays. Throws Error.
TracingLimit measure_tracing_limit(const scene::Scene& scene, int samples);

/// Writes and reads a whole scene (versioned binary; images and packed files included), for talbot-cli. Throws Error.
void dump_scene(const scene::Scene& scene, const std::string& path);
scene::Scene load_scene(const std::string& path);

}  // namespace talbot
