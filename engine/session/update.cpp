/// The update plan: dirty bits -> what is rebuilt, in dependency order. Everything below a rebuilt thing is rebuilt too.

#include <algorithm>
#include <cmath>
#include <numeric>

#include "base/cpu.h"
#include "scene/memory.h"
#include "session/state.h"

namespace talbot {

namespace {

/// Shaders that may share a span become neighbours in the sort of hits.
void order_shaders(RenderData& data) {
    const auto& shaders = data.programs.shaders;
    data.rank_shader.resize(shaders.size());
    std::iota(data.rank_shader.begin(), data.rank_shader.end(), 0);
    std::stable_sort(data.rank_shader.begin(), data.rank_shader.end(),
                     [&](int32_t a, int32_t b) { return integrator::span_kind(shaders[size_t(a)]) < integrator::span_kind(shaders[size_t(b)]); });
    data.shader_order.resize(shaders.size());
    for (size_t rank = 0; rank < data.rank_shader.size(); ++rank) data.shader_order[size_t(data.rank_shader[rank])] = int32_t(rank);
}

bool is_opaque(const shader::CompiledShader& shader) {
    const Rgb t = shader.constant_transparency;
    return shader.transparency_is_constant ? t.x == 0 && t.y == 0 && t.z == 0 : shader.transparency < 0;
}

bool reads_camera(const shader::CompiledShader& shader) {
    return shader.displacement_reads_camera;
}

/// Objects that may let shadow rays through answer to another mask bit than opaque ones: most shadow rays never meet them.
void mark_transparent_casters(RenderData& data) {
    data.has_transparent_shadows = false;
    for (scene::TraitsView& traits : data.tables.traits) {
        if (traits.mesh < 0 || !(traits.visibility & scene::kVisibleShadow)) continue;
        bool transparent = false;
        for (int slot = 0; slot < traits.material_count; ++slot) {
            const int32_t shader = data.tables.material_slots[size_t(traits.material_offset + slot)];
            transparent = transparent || !is_opaque(data.programs.shaders[size_t(shader)]);
        }
        if (!transparent) continue;
        traits.visibility = (traits.visibility & ~uint32_t(scene::kVisibleShadow)) | scene::kVisibleTransparentShadow;
        data.has_transparent_shadows = true;
    }
}

void check_settings(const scene::Settings& s) {
    if (s.width < 1 || s.height < 1) throw Error("the picture has no pixels (" + std::to_string(s.width) + " x " + std::to_string(s.height) + ")");
    if (s.width > 65536 || s.height > 65536) throw Error("the picture is larger than 65536 pixels a side");
    if (s.samples < 1) throw Error("fewer than one sample was asked for");
}

void make_workers(Session::State& s) {
    RenderData& data = s.data;
    const int threads = s.scene.settings.threads > 0 ? s.scene.settings.threads : int(std::max(1u, std::thread::hardware_concurrency()));
    if (!data.pool || data.pool->size() != threads) {
        data.workers.clear();
        data.pool = std::make_unique<WorkerPool>(threads);
    }
    const int registers = std::max(data.programs.max_registers, 8);
    if (data.worker_registers < registers) data.workers.clear();
    if (int(data.workers.size()) != threads) {
        data.workers.clear();
        for (int i = 0; i < threads; ++i) data.workers.push_back(std::make_unique<integrator::Worker>(registers));
        data.worker_registers = registers;
    }
    for (auto& worker : data.workers) worker->counters = {};
}

bool has_catchers(const scene::Scene& scene) {
    return std::any_of(scene.traits.begin(), scene.traits.end(),
                       [](const scene::ObjectTraits& traits) { return traits.is_shadow_catcher && traits.mesh != scene::kNone; });
}

struct FilmPlan {
    film::FilmLayout layout;
    int width = 0, height = 0;
};

FilmPlan plan_film(const scene::Scene& scene) {
    const scene::Settings& settings = scene.settings;
    std::vector<scene::PassKind> passes = scene.passes;
    if (settings.adaptive) passes.push_back(scene::PassKind::Combined);  // whose noise decides
    const bool crop = settings.crop_width > 0;
    return {film::make_layout(passes, has_catchers(scene), scene.aovs.size(), scene.light_groups.size()), crop ? settings.crop_width : settings.width,
            crop ? settings.crop_height : settings.height};
}

/// Before anything is built: a system that promises more memory than it has throws nothing, it ends the process when the memory is touched.
void check_memory(const scene::Scene& scene) {
    const FilmPlan plan = plan_film(scene);
    // A pixel's sums, count and half buffer; Combined twice more, for whoever reads it and in the host's result.
    const size_t pixel = size_t(plan.layout.stride) * sizeof(float) + sizeof(int32_t) + (scene.settings.adaptive ? 12 : 0) + 32;
    const double needed = double(std::max(plan.width, 0)) * double(std::max(plan.height, 0)) * double(pixel), left = double(available_memory());
    if (needed < left) return;
    const auto gibibytes = [](double bytes) { return std::to_string(std::lround(bytes / (1 << 30))) + " GiB"; };
    throw Error("Not enough memory: a picture of " + std::to_string(plan.width) + " x " + std::to_string(plan.height) + " pixels with these passes takes " +
                gibibytes(needed) + ", " + gibibytes(left) + " are left");
}

void make_film(Session::State& s) {
    const FilmPlan plan = plan_film(s.scene);
    auto film = std::make_unique<film::Film>(plan.layout, plan.width, plan.height, s.scene.settings.adaptive);
    std::lock_guard lock(s.mutex);
    s.film = std::move(film);
    s.coarse.reset();
    s.width = plan.width;
    s.height = plan.height;
}

}  // namespace

void update_render_data(Session::State& s) {
    RenderData& data = s.data;
    scene::Scene& scene = s.scene;
    const uint32_t dirty = scene.dirty;
    auto stop_if_cancelled = [&] {
        if (s.cancel) throw Cancelled{};
    };
    auto timed = [&](const char* status, double Statistics::*field, auto&& job) {
        stop_if_cancelled();
        s.set_status(SessionState::Updating, status);
        const auto t = Clock::now();
        job();
        std::lock_guard lock(s.mutex);
        s.statistics.*field += seconds_since(t);
    };
    check_settings(scene.settings);
    check_memory(scene);
    const auto begin = Clock::now();
    {
        std::lock_guard lock(s.mutex);
        s.statistics = {};
        s.statistics.instruction_set = scene.settings.instruction_set.empty() ? choose_isa() : scene.settings.instruction_set;
    }

    const bool images = dirty & scene::kDirtyImages, shaders = (dirty & (scene::kDirtyShaders | scene::kDirtySettings)) || images;
    bool objects = dirty & (scene::kDirtyMeshes | scene::kDirtyObjects);
    objects |= scene::has_blockers(scene) != data.tables.view.has_blockers;
    if (images) timed("Loading images", &Statistics::textures_seconds, [&] { data.textures.update(scene, s.report, &s.cancel); });
    if (shaders) {
        timed("Compiling shaders", &Statistics::compile_seconds, [&] {
            data.programs = shader::compile_shaders(scene, data.tables, s.report, &data.skies);
            order_shaders(data);
        });
    }
    make_workers(s);
    if (dirty & scene::kDirtyPasses) data.tables.attribute_id(scene::kActiveUv);
    if (dirty & scene::kDirtyCamera) objects |= std::any_of(data.programs.shaders.begin(), data.programs.shaders.end(), reads_camera);
    if (shaders || objects || (dirty & scene::kDirtyPasses)) {
        timed("Updating objects", &Statistics::update_seconds, [&] {
            scene::make_scene_view(scene, data.programs.default_shader, data.tables, data.pool.get());
            mark_transparent_casters(data);
            for (scene::TraitsView& traits : data.tables.traits) traits.visibility = scene::with_catcher_bits(traits.visibility, traits.is_shadow_catcher);
            data.has_catchers = has_catchers(scene);
        });
    }
    if (shaders || objects || (dirty & (scene::kDirtyPasses | scene::kDirtyLights))) scene::make_lamp_views(scene, data.tables);
    data.tables.view.settings = &scene.settings;
    data.tables.view.camera = &scene.camera;
    data.shading.scene = &data.tables.view;
    data.shading.textures = &data.textures.table();
    {
        std::lock_guard lock(s.mutex);
        data.shading.trace = {integrator::kernels_for(s.statistics.instruction_set).trace_for_nodes, &data.accelerator};
    }
    data.shading.film_width = float(scene.settings.width);
    data.shading.film_height = float(scene.settings.height);
    if (shaders || objects || (dirty & scene::kDirtyPasses)) {
        timed("Subdividing", &Statistics::update_seconds,
              [&] { geometry::dice_meshes(data.tables, scene, geometry::dicing_budget(), *data.pool, data.diced, s.report, &s.cancel); });
        timed("Displacing", &Statistics::update_seconds, [&] {
            geometry::displace_meshes(data.tables, data.programs, data.shading, integrator::kernels_for(s.statistics.instruction_set).run_program, *data.pool,
                                      data.displaced, s.report, &s.cancel);
        });
    }
    if (shaders || objects) {
        const size_t estimate = scene::memory_of(scene, data.tables) + geometry::estimate_bytes(data.tables);
        {
            std::lock_guard lock(s.mutex);
            s.progress.memory = estimate + data.textures.bytes();
            s.progress.memory_peak = std::max(s.progress.memory_peak, s.progress.memory);
        }
        timed("Building BVH", &Statistics::bvh_seconds, [&] {
            geometry::BuildOptions options;
            options.threads = data.pool->size();
            options.flatten = !scene.settings.viewport;
            options.progress = [&](double fraction) {
                s.set_status(SessionState::Updating, "Building BVH " + std::to_string(int(fraction * 100)) + " %");
                return !s.cancel;
            };
            options.before_sort = [&](double primitives) {
                if (primitives < 1e6) return;
                const std::string millions = std::to_string(std::lround(primitives * 1e-6));
                s.set_status(SessionState::Updating, "Building BVH: Embree sorts " + millions + " million primitives and cannot be interrupted");
            };
            data.accelerator.build(data.tables, options);
        });
    }
    if (shaders || objects || (dirty & (scene::kDirtyLights | scene::kDirtyWorld))) {
        timed("Building lights", &Statistics::lights_seconds,
              [&] { data.emitters = light::build_emitters(scene, data.tables, data.programs, data.shading, *data.pool, s.report, &s.cancel); });
    }
    stop_if_cancelled();
    if (data.filter_table.empty() || (dirty & scene::kDirtySettings))
        data.filter_table = film::make_filter_table(scene.settings.filter, scene.settings.filter_width);
    make_film(s);
    scene.dirty = 0;
    scene.dirty_meshes.clear();

    std::lock_guard lock(s.mutex);
    Statistics& stats = s.statistics;
    stats.update_seconds = seconds_since(begin);
    for (int32_t i = 0; i < data.tables.view.object_count; ++i) {
        const int32_t mesh = scene::traits_of(data.tables.view, i).mesh;
        if (mesh >= 0) stats.instanced_triangles += data.tables.meshes[size_t(mesh)].triangle_count;
    }
    for (const auto& mesh : scene.meshes)
        if (mesh) stats.triangles += mesh->triangle_count();
    stats.scene_bytes = scene::memory_of(scene, data.tables) + data.accelerator.own_bytes();
    stats.bvh_bytes = data.accelerator.bytes();
    stats.texture_bytes = data.textures.bytes();
    stats.film_bytes = s.film->bytes();
    s.progress.memory = stats.scene_bytes + stats.bvh_bytes + stats.texture_bytes + stats.film_bytes;
    s.progress.memory_peak = std::max(s.progress.memory_peak, s.progress.memory);
}

}  // namespace talbot
