// Rays per second by packet width. Not a test: run it with
//   test_geometry --gtest_also_run_disabled_tests --gtest_filter='*BenchTrace*'
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <ctime>

#include "geometry/shapes.h"

namespace talbot::geometry {
namespace {

/// Of this thread alone, so that a busy machine disturbs less.
double seconds(const std::function<void()>& work) {
    const auto now = [] {
        timespec t;
        clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
        return double(t.tv_sec) + 1e-9 * double(t.tv_nsec);
    };
    const double start = now();
    work();
    return now() - start;
}

/// Best of several, in million rays a second, a batch at a time as the renderer does.
double rate(const Accelerator& accelerator, Rays& rays, TraceOptions options, bool shadow) {
    const int n = rays.size();
    rays.trace(accelerator, options, nullptr, 0);
    rays.occluded.assign(size_t(n), 0);
    std::vector<int32_t> index(static_cast<size_t>(n));
    for (int i = 0; i < n; ++i) index[size_t(i)] = i;
    double best = 1e30;
    for (int repeat = 0; repeat < 5; ++repeat) {
        best = std::min(best, seconds([&] {
                            for (int first = 0; first < n; first += kBatch) {
                                const int count = std::min(kBatch, n - first);
                                if (shadow)
                                    occluded(accelerator, rays.columns(), index.data() + first, count, rays.visibility.data(), rays.occluded.data(), options);
                                else
                                    intersect(accelerator, rays.columns(), index.data() + first, count, rays.visibility.data(), rays.hits(), options);
                            }
                        }));
    }
    return n / best * 1e-6;
}

void bench(const char* name, const std::shared_ptr<scene::Mesh>& mesh, Vec3 eye, float view, int copies = 1) {
    World world;
    for (int i = 0; i < copies; ++i)
        world.add(std::make_shared<scene::Mesh>(*mesh), translate_rotate_scale({0, 0, -1e-3f * float(i)}, {0, 0, 1}, 0, {1, 1, 1}));
    Accelerator accelerator;
    BuildOptions options;
    options.threads = 1;
    const double build = seconds([&] { accelerator.build(world.view(), options); });
    std::printf("%s: %zu triangles, built in %.2f s (one thread), %.1f MB (%.0f B a triangle)\n", name, mesh->triangle_count(), build,
                double(accelerator.bytes()) * 1e-6, double(accelerator.bytes()) / double(mesh->triangle_count()));

    // Camera rays in scanlines, then what a diffuse surface sends on from where they hit.
    Rays camera, bounce, shadow;
    constexpr int side = 512;
    for (int y = 0; y < side; ++y)
        for (int x = 0; x < side; ++x)
            camera.add(eye, normalize({(float(x) / side - 0.5f) * view, 1, (float(y) / side - 0.5f) * view - 0.3f * (eye.z > 0.5f)}));
    camera.trace(accelerator, {});
    std::mt19937 random(1);
    for (int i = 0; i < camera.size(); ++i) {
        if (camera.object[size_t(i)] < 0) continue;
        const size_t k = size_t(i);
        const Vec3 d{camera.d[0][k], camera.d[1][k], camera.d[2][k]}, p = eye + d * (camera.t[k] * 0.9999f);
        Vec3 w = random_direction(random);
        const uint32_t* t = mesh->triangle_vertices.data() + 3 * camera.primitive[k];
        const Vec3 a = mesh->positions[t[0]], b = mesh->positions[t[1]], c = mesh->positions[t[2]];
        Vec3 normal = normalize(cross(b - a, c - a));
        if (dot(normal, d) > 0) normal = -normal;
        w = normalize(w + normal);
        bounce.add(p, w);
        shadow.add(p, w, 0.5f);
    }
    for (int width : {1, 8, 16})
        std::printf("  width %2d: camera %6.2f (coherent %6.2f), bounce %6.2f, shadow %6.2f Mrays/s\n", width, rate(accelerator, camera, {width, false}, false),
                    rate(accelerator, camera, {width, true}, false), rate(accelerator, bounce, {width, false}, false),
                    rate(accelerator, shadow, {width, false}, true));

    // Shading points of the camera rays' hits, in spans, the materials' order being as good as random.
    std::vector<int32_t> hit;
    for (int i = 0; i < camera.size(); ++i)
        if (camera.object[size_t(i)] >= 0) hit.push_back(i);
    for (bool shuffled : {false, true}) {
        if (shuffled) std::shuffle(hit.begin(), hit.end(), random);
        Span span(kSpan);
        std::fill(span.floats.begin(), span.floats.end(), 0.5f);
        const int spans = int(hit.size()) / kSpan;
        double best = 1e30;
        for (int repeat = 0; repeat < 5; ++repeat) {
            best = std::min(best, seconds([&] {
                                for (int i = 0; i < spans; ++i)
                                    shade_points(world.tables.view, camera.hits(), camera.columns().origin, hit.data() + i * kSpan, kSpan, span.span,
                                                 span.error.data());
                            }));
        }
        std::printf("  shading points, %s: %.1f ns each\n", shuffled ? "random order" : "in order", best / (spans * kSpan) * 1e9);
    }
}

TEST(BenchTrace, DISABLED_Terrain) {
    bench("terrain", terrain(894), {0, -1.2f, 0.6f}, 1);
}

TEST(BenchTrace, DISABLED_Box) {
    auto mesh = box(1u << 2);
    const auto add = [&](const Affine& place) {
        const auto inner = box();
        const uint32_t base = uint32_t(mesh->positions.size());
        for (Vec3 p : inner->positions) mesh->positions.push_back(transform_point(place, p));
        for (uint32_t i : inner->triangle_vertices) mesh->triangle_vertices.push_back(base + i);
    };
    add(translate_rotate_scale({-0.35f, 0.3f, -0.4f}, {0, 0, 1}, 0.3f, {0.3f, 0.3f, 0.6f}));
    add(translate_rotate_scale({0.35f, -0.3f, -0.7f}, {0, 0, 1}, -0.3f, {0.3f, 0.3f, 0.3f}));
    bench("box", mesh, {0, -3.2f, 0}, 0.9f);
    bench("boxes", mesh, {0, -3.2f, 0}, 0.9f, 5);
}

}  // namespace
}  // namespace talbot::geometry
