// talbot-cli: renders a scene that was written by dump_scene, without Blender.
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include "asset/write_image.h"
#include "session/session.h"

namespace {

using namespace talbot;

constexpr const char* kUsage =
    "usage: talbot-cli FILE [-o OUT.exr|.png|.pfm] [--samples N] [--threads N] [--seed N] [--isa v2|v3|v4] [--size WxH] [--noise N|off] [--stats] [--quiet] "
    "[--limit]\n"
    "Renders a scene dumped by Talbot. Without -o the picture goes to FILE with the ending .exr.\n"
    "--noise is the threshold at which pixels take no more samples, 0: by the number of samples.\n"
    "--limit renders nothing: it prints which share of bare ray tracing the renderer reaches, and its stages.\n";

volatile std::sig_atomic_t interrupted = 0;

struct Options {
    std::string file, output, isa;
    int samples = 0, threads = 0, width = 0, height = 0;
    float noise = -1;  ///< the scene's own
    bool no_noise_threshold = false;
    long seed = -1;
    bool stats = false, quiet = false, limit = false;
};

bool parse_number(const std::string& text, int low, int& out) {
    char* end = nullptr;
    const long value = std::strtol(text.c_str(), &end, 10);
    if (text.empty() || *end || value < low || value > 1 << 24) return false;
    out = int(value);
    return true;
}

/// Empty when all is well, else what is wrong.
std::string parse(const std::vector<std::string>& arguments, Options& options) {
    for (size_t i = 0; i < arguments.size(); ++i) {
        const std::string& name = arguments[i];
        if (name == "--stats") {
            options.stats = true;
            continue;
        }
        if (name == "--limit") {
            options.limit = true;
            continue;
        }
        if (name == "--quiet") {
            options.quiet = true;
            continue;
        }
        if (name[0] != '-') {
            if (!options.file.empty()) return "more than one file: " + name;
            options.file = name;
            continue;
        }
        if (i + 1 >= arguments.size()) return name + " needs a value";
        const std::string& value = arguments[++i];
        bool ok = true;
        if (name == "-o") {
            options.output = value;
        } else if (name == "--samples") {
            ok = parse_number(value, 1, options.samples);
        } else if (name == "--threads") {
            ok = parse_number(value, 1, options.threads);
        } else if (name == "--seed") {
            int seed = 0;
            ok = parse_number(value, 0, seed);
            options.seed = seed;
        } else if (name == "--isa") {
            options.isa = value;
        } else if (name == "--noise") {
            char* end = nullptr;
            options.no_noise_threshold = value == "off";
            options.noise = options.no_noise_threshold ? 0.0f : std::strtof(value.c_str(), &end);
            ok = options.no_noise_threshold || (end && end != value.c_str() && !*end && options.noise >= 0.0f && options.noise <= 1.0f);
        } else if (name == "--size") {
            const size_t x = value.find('x');
            ok = x != std::string::npos && parse_number(value.substr(0, x), 1, options.width) && parse_number(value.substr(x + 1), 1, options.height);
        } else {
            return "unknown option " + name;
        }
        if (!ok) return name + " cannot be " + value;
    }
    return options.file.empty() ? "no file" : "";
}

/// The whole frame at another size; the window of the film keeps its width and centre.
void resize(scene::Scene& scene, int width, int height) {
    scene::Settings& settings = scene.settings;
    float* view = scene.camera.view;
    const float pixel_aspect = (view[3] - view[2]) * float(settings.width) / ((view[1] - view[0]) * float(settings.height));
    const float centre = 0.5f * (view[2] + view[3]), half = 0.5f * (view[1] - view[0]) * float(height) / float(width) * pixel_aspect;
    view[2] = centre - half;
    view[3] = centre + half;
    settings.width = width;
    settings.height = height;
    settings.crop_x = settings.crop_y = settings.crop_width = settings.crop_height = 0;
}

void print_statistics(const Session& session) {
    const Statistics s = session.statistics();
    const double rays = double(s.camera_rays + s.bounce_rays + s.shadow_rays);
    std::printf("instruction set  %s\n", s.instruction_set.c_str());
    std::printf("build            %.3f s (update %.3f, shaders %.3f, images %.3f, BVH %.3f, lights %.3f)\n",
                s.update_seconds + s.compile_seconds + s.textures_seconds + s.bvh_seconds + s.lights_seconds, s.update_seconds, s.compile_seconds,
                s.textures_seconds, s.bvh_seconds, s.lights_seconds);
    std::printf("render           %.3f s\n", s.render_seconds);
    std::printf("rays             %.3f M (camera %.3f, bounce %.3f, shadow %.3f), %.3f M/s\n", rays * 1e-6, double(s.camera_rays) * 1e-6,
                double(s.bounce_rays) * 1e-6, double(s.shadow_rays) * 1e-6, s.render_seconds > 0 ? rays * 1e-6 / s.render_seconds : 0.0);
    std::printf("paths            %.3f M, %.3f M/s\n", double(s.paths) * 1e-6, s.render_seconds > 0 ? double(s.paths) * 1e-6 / s.render_seconds : 0.0);
    std::printf("triangles        %zu (%zu with instances)\n", s.triangles, s.instanced_triangles);
    std::printf("memory           scene %.1f MB, BVH %.1f MB, images %.1f MB, film %.1f MB, peak %.1f MB\n", double(s.scene_bytes) * 1e-6,
                double(s.bvh_bytes) * 1e-6, double(s.texture_bytes) * 1e-6, double(s.film_bytes) * 1e-6, double(session.progress().memory_peak) * 1e-6);
}

scene::Scene load(const Options& options) {
    scene::Scene scene = load_scene(options.file);
    scene.settings.viewport = false;
    if (options.samples) scene.settings.samples = options.samples;
    if (options.threads) scene.settings.threads = options.threads;
    if (options.seed >= 0) scene.settings.seed = uint32_t(options.seed);
    if (options.noise >= 0) {
        scene.settings.adaptive = !options.no_noise_threshold;
        scene.settings.adaptive_threshold = options.noise;
    }
    if (!options.isa.empty()) scene.settings.instruction_set = options.isa;
    if (options.width) resize(scene, options.width, options.height);
    return scene;
}

int print_limit(const Options& options) {
    const TracingLimit limit = measure_tracing_limit(load(options), options.samples ? options.samples : 4);
    std::printf("share of bare tracing  %.1f %% (%.3f s of %.3f s, %.2f M rays)\n", 100 * limit.trace_seconds / limit.render_seconds, limit.trace_seconds,
                limit.render_seconds, double(limit.rays) * 1e-6);
    std::printf("nanoseconds a vertex  ");
    for (const auto& [stage, ns] : limit.stage_ns) std::printf(" %s %.1f", stage.c_str(), ns);
    std::printf("\n");
    return 0;
}

int run(const Options& options) {
    Session session;
    session.edit() = load(options);
    session.start();
    bool cancelling = false;
    while (!session.wait(250)) {
        const Progress progress = session.progress();
        if (!options.quiet) std::fprintf(stderr, "\r\033[K%5.1f %%  %s", double(progress.fraction) * 100, progress.status.c_str());
        if (interrupted && !cancelling) {
            cancelling = true;
            session.cancel();
        }
    }
    if (!options.quiet) std::fprintf(stderr, "\r\033[K");
    session.stop();
    for (const ReportLine& line : session.report().lines()) {
        const char* level = line.level == ReportLine::Level::Error ? "error" : line.level == ReportLine::Level::Warning ? "warning" : "info";
        std::fprintf(stderr, "%s: %s%s%s\n", level, line.where.c_str(), line.where.empty() ? "" : ": ", line.text.c_str());
    }
    const Progress progress = session.progress();
    if (progress.state == SessionState::Failed) throw Error(session.error());

    std::vector<float> pixels;
    const bool has_picture = session.read_pass(scene::PassKind::Combined, pixels);
    if (has_picture) {
        const std::string output = options.output.empty() ? std::filesystem::path(options.file).replace_extension(".exr").string() : options.output;
        const scene::Settings& settings = session.edit().settings;
        char seconds[32];
        std::snprintf(seconds, sizeof seconds, "%.3f", progress.seconds);
        asset::write_image(output, session.width(), session.height(), 4, pixels,
                           {{"Software", std::string("Talbot")},
                            {"talbot:samples", std::to_string(progress.samples_done)},
                            {"talbot:seed", std::to_string(settings.seed)},
                            {"talbot:instruction_set", session.statistics().instruction_set},
                            {"talbot:seconds", seconds}});
        if (!options.quiet) std::printf("%s  %s s\n", output.c_str(), seconds);
    }
    if (options.stats) print_statistics(session);
    if (interrupted) return 130;
    return has_picture ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
    const std::vector<std::string> arguments(argv + 1, argv + argc);
    if (arguments.size() == 1 && (arguments[0] == "--help" || arguments[0] == "-h")) {
        std::printf("%s", kUsage);
        return 0;
    }
    Options options;
    if (const std::string problem = parse(arguments, options); !problem.empty()) {
        std::fprintf(stderr, "talbot-cli: %s\n%s", problem.c_str(), kUsage);
        return 2;
    }
    std::signal(SIGINT, [](int) { interrupted = 1; });
    try {
        return options.limit ? print_limit(options) : run(options);
    } catch (const std::exception& error) {
        std::fprintf(stderr, "talbot-cli: %s\n", error.what());
        return 1;
    }
}
