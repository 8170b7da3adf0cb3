/// The world's importance map: the background program on a grid of directions, summed to two nested distributions.
#include <algorithm>
#include <cmath>

#include "light/emitter_table.h"
#include "light/kernels/emission.h"

namespace talbot::light {
namespace {

/// Width of the map. Images deserve half their own resolution (the map's cells are sampled twice as finely); other
/// programs get cells in which the sun's disc is not lost.
int automatic_width(const scene::Scene& scene, const shader::ShaderContext& context) {
    int width = 512;
    const scene::ShaderGraph& graph = scene.shaders[size_t(scene.world.shader)].graph;
    for (const scene::Node& node : graph.nodes) {
        const auto found = node.properties.find("image");
        if (found == node.properties.end() || !context.textures) continue;
        const double* handle = std::get_if<double>(&found->second);
        if (!handle || !(*handle >= 0) || !(*handle < double(context.textures->count))) continue;
        width = std::max(width, context.textures->textures[int(*handle)].width / 2);
    }
    return std::min(width, 2048);
}

/// A direction next to the disc for one inside it: the map holds the sky without its sun.
Vec3 beside_sun(const WorldMap& map, Vec3 d) {
    const Vec3 chord = d - map.sun;
    // A little more than the disc: its edge is not sharp in a map.
    const float reach = 1.1f * std::sqrt(2 * map.sun_one_minus_cos);
    if (map.sun_one_minus_cos >= 1 || dot(chord, chord) > reach * reach) return d;
    const float a = dot(chord, map.sun_x), b = dot(chord, map.sun_y), length = std::sqrt(a * a + b * b);
    const Vec3 outward = length > 0 ? map.sun_x * (a / length) + map.sun_y * (b / length) : map.sun_x;
    const Vec3 moved = map.sun + outward * (1.02f * reach);
    return moved * (1 / std::sqrt(dot(moved, moved)));
}

/// What evaluating one span of the background takes.
struct SpanMemory {
    std::vector<float> registers, columns, buffer;
    LightScratch scratch;
    Columns3 direction, radiance;

    explicit SpanMemory(const shader::Programs& programs)
        : registers(size_t(std::max(programs.max_registers, 3)) * kSpan), columns(size_t(kLightScratchColumns) * kSpan), buffer(size_t(6 * kSpan)) {
        scratch.registers = registers.data();
        scratch.columns = columns.data();
        float* b = buffer.data();
        direction = {b, b + kSpan, b + 2 * kSpan};
        radiance = {b + 3 * kSpan, b + 4 * kSpan, b + 5 * kSpan};
    }
    SpanMemory(const SpanMemory&) = delete;
    SpanMemory& operator=(const SpanMemory&) = delete;
};

/// Mean luminance (mean of channels) over the sun's disc.
float disc_mean(const shader::Programs& programs, const shader::ShaderContext& context, scene::Handle handle, const WorldMap& map) {
    constexpr int kRings = 8, kSpokes = 8, kCount = kRings * kSpokes;
    SpanMemory memory(programs);
    const Columns3 &direction = memory.direction, &radiance = memory.radiance;
    for (int i = 0; i < kCount; ++i) {
        const float drop = (float(i / kSpokes) + 0.5f) / kRings * map.sun_one_minus_cos, radius = std::sqrt(drop * (2 - drop));
        const float angle = float(2 * M_PI) * (float(i % kSpokes) + 0.5f) / kSpokes;
        store(direction, i, map.sun * (1 - drop) + map.sun_x * (radius * std::cos(angle)) + map.sun_y * (radius * std::sin(angle)));
    }
    evaluate_background(programs, context, memory.scratch, handle, direction, {}, kCount, radiance);
    double sum = 0;
    for (int i = 0; i < kCount; ++i) sum += double(lane_abs(mean(load(radiance, i))));
    return float(sum / kCount);
}

}  // namespace

float make_world_map(const std::vector<float>& fine, int width, int height, EmitterTable& table) {
    const int fine_width = 2 * width, fine_height = 2 * height;
    // Weight of a cell: its own samples, and as much again from a border of one sample around it, because what interpolation spreads beyond a
    // bright texel's cell must stay reachable.
    std::vector<double> weight(size_t(width) * size_t(height));
    // Rows first: sums of a cell's two samples, and of them with one more on either side.
    std::vector<double> own(weight.size() * 2), around(weight.size() * 2);
    for (int y = 0; y < fine_height; ++y) {
        const float* row = &fine[size_t(y) * size_t(fine_width)];
        for (int x = 0; x < width; ++x) {
            const size_t k = size_t(y) * size_t(width) + size_t(x);
            own[k] = double(row[2 * x]) + double(row[2 * x + 1]);
            around[k] = own[k] + double(row[x > 0 ? 2 * x - 1 : fine_width - 1]) + double(row[x + 1 < width ? 2 * x + 2 : 0]);
        }
    }
    double sum = 0, solid = 0, low = 1e30, high = 0;
    for (int y = 0; y < height; ++y) {
        const double sine = std::sin(M_PI * (y + 0.5) / height);
        const size_t first = size_t(2 * y) * size_t(width), second = first + size_t(width);
        const size_t above = y > 0 ? first - size_t(width) : first, below = y + 1 < height ? second + size_t(width) : second;
        for (size_t x = 0; x < size_t(width); ++x) {
            const double inner = (own[first + x] + own[second + x]) / 4;
            const double outer = (around[above + x] + around[first + x] + around[second + x] + around[below + x]) / 16;
            weight[size_t(y) * size_t(width) + x] = 0.5 * inner + 0.5 * outer;
            sum += inner * sine;
            solid += sine;
            low = std::min(low, inner);
            high = std::max(high, inner);
        }
    }
    const double average = sum / solid;
    // A sky that is (almost) uniform comes with the scattered ray, like a constant one.
    if (!(average > 0) || !std::isfinite(average) || high <= 1.1 * low) return 0;

    table.world_rows.assign(size_t(height + 1), 0.0f);
    table.world_columns.assign(size_t(height) * size_t(width + 1), 0.0f);
    table.world_density.assign(size_t(height) * size_t(width), 0.0f);
    std::vector<double> row_sums;
    double total = 0;
    for (int y = 0; y < height; ++y) {
        const double sine = std::sin(M_PI * (y + 0.5) / height);
        double running = 0;
        float* columns = &table.world_columns[size_t(y) * size_t(width + 1)];
        for (int x = 0; x < width; ++x) {
            double& w = weight[size_t(y) * size_t(width) + size_t(x)];
            w = (w + 0.005 * average) * sine;  // no direction has density 0: features finer than the map stay bounded
            running += w;
            columns[x + 1] = float(running);
        }
        for (int x = 0; x <= width; ++x) columns[x] = float(double(columns[x]) / running);
        columns[width] = 1;
        row_sums.push_back(running);
        total += running;
    }
    double running = 0;
    for (int y = 0; y < height; ++y) {
        running += row_sums[size_t(y)];
        table.world_rows[size_t(y + 1)] = float(running / total);
    }
    table.world_rows[size_t(height)] = 1;
    // The density is that of the rounded running shares, so that it is exact for what is sampled.
    for (int y = 0; y < height; ++y) {
        const double row = double(table.world_rows[size_t(y + 1)]) - double(table.world_rows[size_t(y)]);
        const float* columns = &table.world_columns[size_t(y) * size_t(width + 1)];
        for (int x = 0; x < width; ++x) {
            table.world_density[size_t(y) * size_t(width) + size_t(x)] = float(row * height * (double(columns[x + 1]) - double(columns[x])) * width);
        }
    }
    table.view.world.width = width;
    table.view.world.height = height;
    return float(average);
}

float add_world(const scene::Scene& scene, const shader::Programs& programs, const shader::ShaderContext& context, WorkerPool& pool,
                const std::atomic<bool>* cancel, EmitterTable& table) {
    EmitterSummary& summary = table.summary;
    summary.world_visibility = scene::with_catcher_bits(scene.world.visibility, true);
    summary.world_is_black = true;
    table.view.world_visibility = int32_t(summary.world_visibility);
    table.view.world_max_bounces = scene.world.max_bounces;
    const scene::Handle handle = scene.world.shader;
    if (handle < 0 || size_t(handle) >= programs.shaders.size() || scene.world.visibility == 0) return 0;
    const shader::CompiledShader& compiled = programs.shaders[size_t(handle)];
    if (compiled.emission_is_constant) {
        summary.world_is_constant = true;
        summary.constant_world = compiled.constant_emission;
        const Rgb c = compiled.constant_emission;
        summary.world_is_black = c.x == 0 && c.y == 0 && c.z == 0;
        summary.world_shader = handle;
        return 0;
    }
    if (compiled.emission < 0) return 0;
    summary.world_is_black = false;
    summary.world_shader = handle;
    table.view.world_shader = handle;
    if (!scene.world.use_importance_map || !scene.world.sample_as_light) return 0;

    WorldMap& map = table.view.world;
    if (compiled.sun.half_angle > 0) {
        map.sun = compiled.sun.direction;
        make_basis(map.sun, map.sun_x, map.sun_y);
        map.sun_one_minus_cos = float(2 * std::pow(std::sin(0.5 * double(compiled.sun.half_angle)), 2));
    }
    // Luminance at twice the map's resolution.
    const int asked = scene.world.map_resolution > 0 ? scene.world.map_resolution : automatic_width(scene, context);
    const int width = std::clamp(asked, 8, 4096) & ~1, height = width / 2;
    const int fine_width = 2 * width, fine_height = 2 * height;
    std::vector<float> fine(size_t(fine_width) * size_t(fine_height));
    pool.parallel_for(size_t(fine_height), 8, [&](size_t begin, size_t end, int) {
        SpanMemory memory(programs);
        const Columns3 &direction = memory.direction, &radiance = memory.radiance;
        for (size_t row = begin; row < end; ++row) {
            if (cancel && cancel->load()) throw Cancelled{};
            for (int x0 = 0; x0 < fine_width; x0 += kSpan) {
                const int n = std::min(kSpan, fine_width - x0);
                const float v = (float(row) + 0.5f) / float(fine_height);
                for (int i = 0; i < n; ++i) store(direction, i, beside_sun(map, map_direction((float(x0 + i) + 0.5f) / float(fine_width), v)));
                evaluate_background(programs, context, memory.scratch, handle, direction, {}, n, radiance);
                for (int i = 0; i < n; ++i) fine[row * size_t(fine_width) + size_t(x0 + i)] = lane_abs(mean(load(radiance, i)));
            }
        }
    });

    const float sky = make_world_map(fine, width, height, table);
    if (compiled.sun.half_angle <= 0 || sky <= 0) return sky;
    // The disc's part of all light; the rest of its radiance is the sky's that the map knows.
    const float sun = 0.5f * disc_mean(programs, context, handle, map) * map.sun_one_minus_cos;
    const float share = sun / (sun + sky);
    map.sun_share = share < 0.01f ? 0.0f : std::min(share, 0.9f);
    return sky + sun;
}

}  // namespace talbot::light
