/// Samples in chunks over tiles. Tiles, chunks and the order in which a tile's chunks are summed depend on the picture
/// alone, so the result is the same for any number of threads.

#include <algorithm>

#include "session/state.h"

namespace talbot {

namespace {

/// Enough tiles to share out even in a small picture; large enough to keep batches full.
int tile_side(int width, int height) {
    int side = 64;
    while (side > 16 && ((width + side - 1) / side) * ((height + side - 1) / side) < 64) side /= 2;
    return side;
}

/// One chunk of samples over all tiles of `film`; throws Cancelled.
void render_chunk(Session::State& s, const integrator::KernelTable& kernels, const integrator::RenderContext& context, film::Film& film, int begin, int end,
                  int pixel_size) {
    const int side = tile_side(film.width(), film.height());
    const int columns = (film.width() + side - 1) / side, rows = (film.height() + side - 1) / side;
    std::atomic<int> next{0};
    s.data.pool->run([&](int index) {
        film::TileFilm tile;
        for (;;) {
            while (s.paused && !s.cancel) std::this_thread::sleep_for(std::chrono::milliseconds(10));
            const int t = next.fetch_add(1);
            if (t >= columns * rows || s.cancel) return;
            integrator::RenderUnit unit;
            unit.x = (t % columns) * side;
            unit.y = (t / columns) * side;
            unit.width = std::min(side, film.width() - unit.x);
            unit.height = std::min(side, film.height() - unit.y);
            unit.sample_begin = begin;
            unit.sample_end = end;
            unit.pixel_size = pixel_size;
            tile.reset(film.layout(), unit.width, unit.height);
            if (!kernels.render_unit(context, unit, *s.data.workers[size_t(index)], tile)) return;
            film.merge(tile, unit.x, unit.y, end - begin);
            std::lock_guard lock(s.mutex);
            const int done = next.load();
            const float tiles = float(std::min(done, columns * rows)) / float(columns * rows);
            if (pixel_size == 1) s.progress.fraction = (float(begin) + tiles * float(end - begin)) / float(s.scene.settings.samples);
            s.progress.image_version++;
        }
    });
    if (s.cancel) throw Cancelled{};
}

void render_coarse(Session::State& s, const integrator::KernelTable& kernels, const integrator::RenderContext& context, int pixel_size) {
    const int width = (s.width + pixel_size - 1) / pixel_size, height = (s.height + pixel_size - 1) / pixel_size;
    if (width < 8 || height < 8) return;
    auto film = std::make_unique<film::Film>(s.film->layout(), width, height);
    render_chunk(s, kernels, context, *film, 0, 1, pixel_size);
    std::lock_guard lock(s.mutex);
    s.coarse = std::move(film);
    s.coarse_size = pixel_size;
    s.progress.pixel_size = pixel_size;
    s.progress.image_version++;
}

void add_counters(Session::State& s) {
    std::lock_guard lock(s.mutex);
    Statistics& stats = s.statistics;
    stats.camera_rays = stats.bounce_rays = stats.shadow_rays = stats.paths = 0;
    for (const auto& worker : s.data.workers) {
        stats.camera_rays += worker->counters.camera_rays;
        stats.bounce_rays += worker->counters.bounce_rays;
        stats.shadow_rays += worker->counters.shadow_rays;
        stats.paths += worker->counters.paths;
    }
}

}  // namespace

integrator::RenderContext make_context(Session::State& s, const film::FilmLayout& layout) {
    RenderData& data = s.data;
    integrator::RenderContext context;
    context.scene = &data.tables.view;
    context.settings = &s.scene.settings;
    context.camera = &s.scene.camera;
    context.programs = &data.programs;
    context.shading = &data.shading;
    context.accelerator = &data.accelerator;
    context.emitters = data.emitters.get();
    context.emitter_summary = light::summarize(*data.emitters);
    context.layout = &layout;
    context.filter_table = data.filter_table.data();
    context.shader_order = data.shader_order.data();
    context.rank_shader = data.rank_shader.data();
    context.shader_count = int(data.rank_shader.size());
    context.uv_attribute = data.tables.attribute_id(scene::kActiveUv);
    context.has_transparent_shadows = data.has_transparent_shadows;
    context.cancel = &s.cancel;
    return context;
}

void render_samples(Session::State& s) {
    const scene::Settings& settings = s.scene.settings;
    const integrator::KernelTable& kernels = integrator::kernels_for(s.statistics.instruction_set);
    const integrator::RenderContext context = make_context(s, s.film->layout());
    s.set_status(SessionState::Rendering, "Rendering");
    const auto begin = Clock::now();
    if (settings.viewport)
        for (int pixel_size : {8, 4, 2}) render_coarse(s, kernels, context, pixel_size);

    // Small first chunks show a picture soon; later ones keep batches full.
    int done = 0, chunk = settings.viewport ? 1 : 4;
    while (done < settings.samples) {
        const int end = std::min(settings.samples, done + chunk);
        render_chunk(s, kernels, context, *s.film, done, end, 1);
        done = end;
        if (done >= 4 * chunk) chunk = std::min(chunk * 2, 16);
        const double elapsed = seconds_since(begin);
        {
            std::lock_guard lock(s.mutex);
            s.coarse.reset();
            s.progress.pixel_size = 1;
            s.progress.samples_done = done;
            s.progress.fraction = float(done) / float(settings.samples);
            s.progress.remaining = elapsed / done * (settings.samples - done);
            s.progress.status = "Sample " + std::to_string(done) + "/" + std::to_string(settings.samples);
            s.statistics.render_seconds = elapsed;
        }
        add_counters(s);
        if (settings.time_limit > 0 && elapsed >= double(settings.time_limit)) break;
    }
}

}  // namespace talbot
