#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

#include "geometry/shapes.h"
#include "support/objects.h"

namespace talbot::geometry {
namespace {

constexpr int kWidths[] = {1, 8, 16};

BuildOptions flattened(bool flatten, std::function<bool(double)> progress = {}) {
    BuildOptions options;
    options.flatten = flatten;
    options.progress = std::move(progress);
    return options;
}

/// A ray down the z axis of a mesh that was moved there.
Rays one_ray(Vec3 origin, Vec3 direction = {0, 0, -1}) {
    Rays rays;
    rays.add(origin, direction);
    return rays;
}

/// Rays from everywhere to everywhere around the unit box.
Rays many_rays(int n, uint32_t seed) {
    Rays rays;
    std::mt19937 random(seed);
    std::uniform_real_distribution<float> uniform(-2, 2);
    for (int i = 0; i < n; ++i) rays.add({uniform(random), uniform(random), uniform(random)}, random_direction(random));
    return rays;
}

/// Closest hit by brute force in double precision (the oracle): t, or infinity.
double nearest(const World& world, Vec3 origin, Vec3 direction) {
    double best = std::numeric_limits<double>::infinity();
    for (const scene::Object& object : world.scene.objects) {
        const scene::Mesh& mesh = *world.scene.meshes[size_t(world.scene.traits[size_t(object.traits)].mesh)];
        for (size_t i = 0; i < mesh.triangle_vertices.size(); i += 3) {
            double p[3][3];
            for (size_t k = 0; k < 3; ++k) {
                const Vec3 v = mesh.positions[mesh.triangle_vertices[i + k]];
                for (int r = 0; r < 3; ++r) {
                    const float* m = object.to_world.m[r];
                    p[k][r] = double(m[0]) * v.x + double(m[1]) * v.y + double(m[2]) * v.z + m[3];
                }
            }
            const double o[3] = {origin.x, origin.y, origin.z}, d[3] = {direction.x, direction.y, direction.z};
            double e1[3], e2[3], s[3];
            for (int r = 0; r < 3; ++r) e1[r] = p[1][r] - p[0][r], e2[r] = p[2][r] - p[0][r], s[r] = o[r] - p[0][r];
            const auto dot3 = [](const double* a, const double* b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; };
            const double h[3] = {d[1] * e2[2] - d[2] * e2[1], d[2] * e2[0] - d[0] * e2[2], d[0] * e2[1] - d[1] * e2[0]};
            const double q[3] = {s[1] * e1[2] - s[2] * e1[1], s[2] * e1[0] - s[0] * e1[2], s[0] * e1[1] - s[1] * e1[0]};
            const double det = dot3(e1, h), u = dot3(s, h) / det, v = dot3(d, q) / det, t = dot3(e2, q) / det;
            if (u >= 0 && v >= 0 && u + v <= 1 && t > 0) best = std::min(best, t);
        }
    }
    return best;
}

World mixed_world() {
    World world;
    world.add(sphere(2), translate_rotate_scale({0.5f, 0, 0}, {1, 2, 3}, 1, {0.7f, 0.8f, 0.9f}));
    const auto shared = box();
    world.add(shared, translate_rotate_scale({-0.6f, 0.2f, 0.3f}, {3, 1, 2}, 2, {0.3f, 0.5f, 0.2f}));
    world.add(shared, translate_rotate_scale({0.1f, -0.9f, 0.5f}, {1, 0, 2}, -1, {-0.3f, 0.3f, 0.4f}));
    world.add(terrain(20));
    return world;
}

TEST(Accelerator, EmbreeIsTheOneCompiledFor) {
    EXPECT_NO_THROW(check_embree());
    EXPECT_TRUE(embree_version().starts_with("3.") || embree_version().starts_with("4."));
}

TEST(Accelerator, MatchesBruteForce) {
    World world = mixed_world();
    for (bool flatten : {true, false}) {
        Accelerator accelerator;
        accelerator.build(world.view(), flattened(flatten));
        Rays rays = many_rays(3000, 1);
        for (int width : kWidths) {
            rays.trace(accelerator, {width, false});
            rays.trace_shadow(accelerator, {width, false});
            int hits = 0;
            for (size_t i = 0; i < rays.t_max.size(); ++i) {
                const double t = nearest(world, {rays.o[0][i], rays.o[1][i], rays.o[2][i]}, {rays.d[0][i], rays.d[1][i], rays.d[2][i]});
                ASSERT_EQ(rays.object[i] >= 0, std::isfinite(t)) << i;
                ASSERT_EQ(rays.occluded[i] != 0, std::isfinite(t)) << i;
                if (rays.object[i] < 0) continue;
                ++hits;
                ASSERT_NEAR(rays.t[i], t, 1e-5 * (1 + t)) << i;
            }
            EXPECT_GT(hits, 300);
        }
    }
}

TEST(Accelerator, SameBitsForAnyThreadsWidthsAndNeighbours) {
    World world = mixed_world();
    world.add(terrain(200), translate_rotate_scale({0, 0, -0.5f}, {0, 0, 1}, 0.2f, {1, 1, 1}));
    Rays reference;
    for (int threads : {1, 2, 5}) {
        Accelerator accelerator;
        BuildOptions options;
        options.threads = threads;
        accelerator.build(world.view(), options);
        Rays rays = many_rays(20000, 2);
        if (threads == 1) {
            rays.trace(accelerator, {1, false});
            reference = rays;
        }
        std::vector<int32_t> order(size_t(rays.size()));
        for (size_t i = 0; i < order.size(); ++i) order[i] = int32_t(i);
        std::mt19937 random{uint32_t(threads)};
        for (int width : kWidths) {
            for (bool coherent : {false, true}) {
                std::shuffle(order.begin(), order.end(), random);
                rays.trace(accelerator, {width, coherent}, order.data());
                EXPECT_EQ(rays.object, reference.object);
                EXPECT_EQ(rays.primitive, reference.primitive);
                EXPECT_EQ(rays.t, reference.t);
                EXPECT_EQ(rays.u, reference.u);
                EXPECT_EQ(rays.v, reference.v);
            }
        }
    }
}

TEST(Accelerator, FirstOfCoincidingTrianglesWins) {
    // Every triangle of the sphere three times, then the whole object twice more in place, flattened and instanced.
    auto repeated = sphere(2);
    const auto once = repeated->triangle_vertices;
    for (int k = 0; k < 2; ++k) {
        for (size_t i = 0; i < once.size(); i += 3)
            repeated->triangle_vertices.insert(repeated->triangle_vertices.end(), {once[i + 1], once[i + size_t(2 * k)], once[i + 2 - size_t(2 * k)]});
    }
    const Affine place = translate_rotate_scale({0.1f, 0.2f, 0.3f}, {1, 2, 3}, 1, {1, 1.2f, 1.3f});
    // And a copy whose triangles share no vertices.
    for (size_t i = 0; i < once.size(); ++i) {
        repeated->triangle_vertices.push_back(uint32_t(repeated->positions.size()));
        repeated->positions.push_back(repeated->positions[once[i]]);
    }
    for (int kind = 0; kind < 3; ++kind) {
        World world;
        world.add(box(), translate_rotate_scale({9, 9, 9}, {1, 0, 0}, 0, {1, 1, 1}));
        world.add(repeated, place);
        if (kind == 1) world.add(repeated, place);
        if (kind == 2) world.add(std::make_shared<scene::Mesh>(*repeated), place);
        Accelerator accelerator;
        accelerator.build(world.view(), {});
        Rays rays = many_rays(20000, 3);
        for (int width : kWidths) {
            for (bool coherent : {false, true}) {
                rays.trace(accelerator, {width, coherent});
                int hits = 0;
                for (size_t i = 0; i < rays.t_max.size(); ++i) {
                    if (rays.object[i] < 1) continue;
                    ++hits;
                    ASSERT_EQ(rays.object[i], 1);
                    ASSERT_LT(rays.primitive[i], int32_t(once.size() / 3));
                }
                EXPECT_GT(hits, 3000);
            }
        }
    }
}

TEST(Accelerator, VisibilityHidesFromSomeRays) {
    World world;
    const auto mesh = box();
    world.add(mesh, translate_rotate_scale({0, 0, 5}, {1, 0, 0}, 0, {1, 1, 1}), scene::kVisibleShadow);
    world.add(mesh, {}, scene::kVisibleCamera | scene::kVisibleDiffuse);
    world.add(mesh, translate_rotate_scale({0, 0, 8}, {1, 0, 0}, 0, {1, 1, 1}), 0);
    world.add(box(), translate_rotate_scale({0, 0, -5}, {1, 0, 0}, 0, {1, 1, 1}), scene::kVisibleGlossy);
    Accelerator accelerator;
    accelerator.build(world.view(), {});
    Rays rays;
    for (int k = 0; k < 4; ++k) rays.add({0.1f, 0.2f, 20}, {0, 0, -1});
    rays.visibility = {scene::kVisibleShadow, scene::kVisibleCamera, scene::kVisibleGlossy, scene::kVisibleVolume};
    for (int width : kWidths) {
        rays.trace(accelerator, {width, false});
        EXPECT_EQ(rays.object, (std::vector<int32_t>{0, 1, 3, -1}));
        rays.trace_shadow(accelerator, {width, false});
        EXPECT_EQ(rays.occluded, (std::vector<uint8_t>{1, 1, 1, 0}));
    }
}

TEST(Accelerator, CopyInPlaceIsSeenByRaysThatTheFirstHidesFrom) {
    World world;
    const auto mesh = box();
    world.add(mesh, {}, scene::kVisibleCamera);
    world.add(mesh, {}, scene::kVisibleCamera | scene::kVisibleDiffuse);
    world.add(std::make_shared<scene::Mesh>(*mesh), {}, scene::kVisibleAll);
    Accelerator accelerator;
    accelerator.build(world.view(), {});
    Rays rays;
    for (int k = 0; k < 3; ++k) rays.add({0.1f, 0.2f, 20}, {0, 0, -1});
    rays.visibility = {scene::kVisibleCamera, scene::kVisibleDiffuse, scene::kVisibleShadow};
    rays.trace(accelerator, {8, false});
    EXPECT_EQ(rays.object, (std::vector<int32_t>{0, 1, 2}));
}

TEST(Accelerator, MissesLeaveOtherLanesAlone) {
    World world;
    world.add(box());
    Accelerator accelerator;
    accelerator.build(world.view(), {});
    Rays rays;
    for (int k = 0; k < 20; ++k) rays.add({0, 0, 4}, {0, 0, k % 2 ? -1.f : 1.f});
    rays.t_max[3] = 2.9f;
    rays.d[0][5] = std::numeric_limits<float>::quiet_NaN();
    rays.o[1][7] = std::numeric_limits<float>::infinity();
    const std::vector<int32_t> index{1, 0, 3, 5, 7, 9};
    for (int width : kWidths) {
        rays.trace(accelerator, {width, false}, index.data(), int(index.size()));
        EXPECT_EQ(rays.object[1], 0);
        EXPECT_EQ(rays.object[0], -1);
        EXPECT_EQ(rays.object[3], -1);
        EXPECT_EQ(rays.object[5], -1);
        EXPECT_EQ(rays.object[7], -1);
        EXPECT_EQ(rays.object[9], 0);
        EXPECT_FLOAT_EQ(rays.t[9], 3);
        EXPECT_EQ(rays.object[2], -2);
        EXPECT_EQ(rays.object[19], -2);
    }
}

TEST(Accelerator, BadGeometryIsHarmless) {
    const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
    auto bad = make_mesh({{-1, -1, 0}, {1, -1, 0}, {0, 1, 0}, {nan, 0, 0}, {0, inf, 0}, {0, 0, 0}}, {0, 1, 3, 0, 1, 4, 0, 0, 0, 0, 5, 5, 0, 1, 2});
    World world;
    world.add(bad);
    world.add(make_mesh({}, {}));
    world.add(box(), translate_rotate_scale({0, 0, 0}, {1, 0, 0}, 0, {0, 0, 0}));
    world.add(box(), translate_rotate_scale({nan, 0, 0}, {1, 0, 0}, 0, {1, 1, 1}));
    const int flat = world.add(box(), translate_rotate_scale({10, 0, 1}, {1, 0, 0}, 0, {1, 1, 0}));
    const auto dots = terrain(3);
    world.add(dots, translate_rotate_scale({20, 0, 0}, {1, 2, 3}, 1, {1e-6f, 1e-6f, 1e-6f}));
    world.add(dots, translate_rotate_scale({20, 0, 1}, {1, 2, 3}, 1, {1e-6f, 0, 0}));
    tests::place(world.scene, {});
    world.scene.objects.emplace_back();
    Accelerator accelerator;
    accelerator.build(world.view(), {});
    Rays ray = one_ray({0.01f, 0.02f, 5});
    ray.add({10.1f, 0.2f, 5}, {0, 0, -1});
    ray.add({20, 0, 5}, {0, 0, -1});
    for (int width : kWidths) {
        ray.trace(accelerator, {width, false});
        EXPECT_EQ(ray.object[0], 0);
        EXPECT_EQ(ray.primitive[0], 4);
        EXPECT_EQ(ray.object[1], flat);
    }

    world.scene.meshes[0] = make_mesh({{0, 0, 0}}, {0, 0, 7});
    EXPECT_THROW(accelerator.build(world.view(), {}), Error);
}

TEST(Accelerator, EmptySceneHitsNothing) {
    Accelerator accelerator;
    Rays ray = one_ray({0, 0, 5});
    ray.trace(accelerator, {8, false});
    EXPECT_EQ(ray.object[0], -1);
    World world;
    accelerator.build(world.view(), {});
    ray.trace(accelerator, {8, false});
    ray.trace_shadow(accelerator, {8, false});
    EXPECT_EQ(ray.object[0], -1);
    EXPECT_EQ(ray.occluded[0], 0);
}

TEST(Accelerator, EditsMatchAFreshBuild) {
    std::mt19937 random(5);
    std::uniform_real_distribution<float> uniform(-1, 1);
    const std::vector<std::shared_ptr<scene::Mesh>> meshes{sphere(1), box(), terrain(5), sphere(2)};
    for (bool flatten : {false, true}) {
        World world;
        Accelerator edited;
        for (int step = 0; step < 25; ++step) {
            const auto place = [&] {
                return translate_rotate_scale({uniform(random), uniform(random), uniform(random)}, {uniform(random), uniform(random), 1}, uniform(random),
                                              vec3(0.2f + 0.1f * uniform(random)));
            };
            auto& objects = world.scene.objects;
            auto& traits = world.scene.traits;
            const size_t pick = objects.empty() ? 0 : random() % objects.size();
            switch (step < 4 ? 0 : random() % 6) {
                case 0:
                    world.add(meshes[random() % meshes.size()], place());
                    break;
                case 1:
                    objects[pick].to_world = place();
                    break;
                case 2:
                    traits[pick].visibility ^= scene::kVisibleGlossy;
                    break;
                case 3:
                    traits[pick].mesh = scene::Handle(random() % world.scene.meshes.size());
                    break;
                case 4:
                    traits[pick].visibility = 0;
                    break;
                case 5:
                    world.scene.meshes[random() % world.scene.meshes.size()] = sphere(int(random() % 3));
                    break;
            }
            if (step == 20) objects.pop_back(), traits.pop_back();
            edited.build(world.view(), flattened(flatten));
            Accelerator fresh;
            fresh.build(world.view(), flattened(flatten));
            Rays a = many_rays(500, uint32_t(step));
            for (size_t i = 0; i < a.visibility.size(); i += 2) a.visibility[i] = scene::kVisibleGlossy;
            Rays b = a;
            a.trace(edited, {8, false});
            b.trace(fresh, {8, false});
            ASSERT_EQ(a.object, b.object) << step;
            ASSERT_EQ(a.primitive, b.primitive) << step;
            ASSERT_EQ(a.t, b.t) << step;
        }
    }
}

TEST(Accelerator, CancelStopsAndTheNextBuildWorks) {
    World world = mixed_world();
    world.add(terrain(300));
    for (bool flatten : {true, false}) {
        Accelerator accelerator;
        double last = 0;
        const auto watch = [&](double fraction) {
            EXPECT_GE(fraction, last);
            EXPECT_LE(fraction, 1);
            last = fraction;
            return true;
        };
        for (double stop : {0.0, 0.05, 0.5}) {
            EXPECT_THROW(accelerator.build(world.view(), flattened(flatten, [&](double fraction) { return fraction < stop; })), Cancelled);
            Rays ray = one_ray({0, 0, 5});
            ray.trace(accelerator, {8, false});
            EXPECT_EQ(ray.object[0], -1);
        }
        accelerator.build(world.view(), flattened(flatten, watch));
        Rays ray = one_ray({0, 0, 5});
        ray.trace(accelerator, {8, false});
        EXPECT_GE(ray.object[0], 0);
        EXPECT_GT(accelerator.bytes(), 1000000u);
        EXPECT_GT(last, 0.5);
    }
}

TEST(Accelerator, SaysWhatEmbreeIsAboutToSort) {
    World world;
    const auto shared = sphere(3), alone = terrain(40);
    world.add(shared);
    world.add(shared, translate_rotate_scale({5, 0, 0}, {1, 2, 3}, 1, {1, 1, 1}));
    world.add(alone);
    const auto triangles = [](const auto& mesh) { return double(mesh->triangle_count()); };
    for (bool flatten : {true, false}) {
        BuildOptions options = flattened(flatten, [](double) { return true; });
        std::vector<double> sorted;
        options.before_sort = [&](double primitives) { sorted.push_back(primitives); };
        Accelerator accelerator;
        accelerator.build(world.view(), options);
        // Meshes that are placed as instances, then the top: instances and whatever lies flat in it.
        std::vector<double> expected{triangles(shared), 3};
        if (flatten)
            expected[1] = 2 + triangles(alone);
        else
            expected.insert(expected.begin() + 1, triangles(alone));
        EXPECT_EQ(sorted, expected);
    }
}

TEST(Accelerator, EstimateIsAboveWhatIsTakenButNotFar) {
    World world;
    EXPECT_EQ(estimate_bytes(world.view()), 0u);
    world.add(terrain(150));
    for (int i = 0; i < 50; ++i) world.add(sphere(3), translate_rotate_scale({float(i), 0, 0}, {1, 2, 3}, float(i), {1, 1, 1}));
    const auto shared = sphere(3);
    for (int i = 0; i < 200; ++i) world.add(shared, translate_rotate_scale({float(i), 5, 0}, {1, 2, 3}, float(i), {1, 1, 1}));
    for (bool flatten : {true, false}) {
        Accelerator accelerator;
        size_t peak = 0;
        accelerator.build(world.view(), flattened(flatten, [&](double) {
                              peak = std::max(peak, accelerator.bytes());
                              return true;
                          }));
        peak = std::max(peak, accelerator.bytes());
        EXPECT_LT(peak, estimate_bytes(world.tables));
        EXPECT_GT(peak, estimate_bytes(world.tables) / 3);
    }
}

TEST(Accelerator, MemoryGoesBackWhenObjectsGo) {
    World world;
    world.add(terrain(300));
    Accelerator accelerator;
    accelerator.build(world.view(), {});
    const size_t full = accelerator.bytes();
    world.scene.traits[0].mesh = scene::kNone;
    accelerator.build(world.view(), {});
    EXPECT_LT(accelerator.bytes(), full / 4);
}

}  // namespace
}  // namespace talbot::geometry
