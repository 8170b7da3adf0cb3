// Things that move while the shutter is open: where they are hit at each moment.
#include <gtest/gtest.h>

#include <cmath>

#include "geometry/shapes.h"
#include "scene/motion.h"

namespace talbot::geometry {
namespace {

/// A square [-1, 1]^2 that faces +z.
std::shared_ptr<scene::Mesh> square() {
    return make_mesh({{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}}, {0, 1, 2, 0, 2, 3});
}

/// Rays down the z axis at x = 0 .. 4, each at a moment that grows with it.
struct Probe {
    Rays rays;
    std::vector<float> time;

    void add(float x, float moment) {
        rays.add({x, 0.3f, 10}, {0, 0, -1});
        time.push_back(moment);
    }
    Span shade(const World& world, const Accelerator& accelerator, int width, std::vector<int32_t>& hit) {
        const size_t all = time.size();
        rays.t.assign(all, -1), rays.u.assign(all, -1), rays.v.assign(all, -1);
        rays.object.assign(all, -2), rays.primitive.assign(all, -2);
        RayColumns columns = rays.columns();
        columns.time = time.data();
        intersect(accelerator, columns, nullptr, int(all), rays.visibility.data(), rays.hits(), {width, false});
        hit.clear();
        for (size_t i = 0; i < all; ++i)
            if (rays.object[i] >= 0) hit.push_back(int32_t(i));
        Span s(int(hit.size()));
        for (int i = 0; i < s.span.n; ++i) store(s.span.wo, i, {0, 0, 1});
        times.clear();
        for (int32_t lane : hit) times.push_back(time[size_t(lane)]);
        s.span.time = times.data();
        shade_points(world.tables.view, rays.hits(), rays.columns().origin, hit.data(), s.span.n, s.span, s.error.data());
        return s;
    }
    std::vector<float> times;
};

/// Where the moving square is at a moment: it goes from x = 0 to 2 in the first half and to 4 and z = 2 in the second.
Vec3 expected_place(float t) {
    return t < 0.5f ? Vec3{4 * t, 0, 0} : Vec3{4 * t, 0, 4 * (t - 0.5f)};
}

void expect_moves(const World& world, const Accelerator& accelerator) {
    for (int width : {1, 8, 16}) {
        Probe probe;
        for (float x = -0.9f; x < 5; x += 0.1f)
            for (float t = 0; t < 1.001f; t += 0.125f) probe.add(x, std::min(t, 1.0f));
        std::vector<int32_t> hit;
        const Span out = probe.shade(world, accelerator, width, hit);
        size_t next = 0;
        for (size_t i = 0; i < probe.time.size(); ++i) {
            const Vec3 place = expected_place(probe.time[i]);
            const float from_edge = 1 - std::abs(probe.rays.o[0][i] - place.x);
            if (std::abs(from_edge) < 1e-3f) {
                next += probe.rays.object[i] >= 0;
                continue;
            }
            ASSERT_EQ(probe.rays.object[i] >= 0, from_edge > 0) << "x " << probe.rays.o[0][i] << " time " << probe.time[i];
            if (probe.rays.object[i] < 0) continue;
            const Vec3 p = load(out.span.p, int(next)), n = load(out.span.n_s, int(next));
            EXPECT_NEAR(p.x, probe.rays.o[0][i], 5e-5f);
            EXPECT_NEAR(p.z, place.z, 5e-5f);
            EXPECT_NEAR(n.z, 1, 1e-6f);
            EXPECT_LT(out.error[next], 1e-4f);
            ++next;
        }
        EXPECT_EQ(next, hit.size());
    }
}

TEST(Motion, ObjectsMove) {
    World world;
    const int object = world.add(square(), translate_rotate_scale({2, 0, 0}, {0, 0, 1}, 0, vec3(1)));
    world.scene.motion.objects.emplace_back();
    for (float t : {0.f, 0.5f, 1.f}) world.scene.motion.objects[0].push_back(translate_rotate_scale(expected_place(t), {0, 0, 1}, 0, vec3(1)));
    world.scene.motion.of_objects.assign(world.scene.objects.size(), scene::kNone);
    world.scene.motion.of_objects[size_t(object)] = 0;
    Accelerator accelerator;
    accelerator.build(world.view(), {});
    expect_moves(world, accelerator);
    // And they stop again.
    world.scene.motion.of_objects.clear();
    accelerator.build(world.view(), {});
    Probe probe;
    for (float t : {0.f, 0.5f, 1.f}) probe.add(2, t);
    std::vector<int32_t> hit;
    probe.shade(world, accelerator, 8, hit);
    EXPECT_EQ(hit.size(), 3u);
}

TEST(Motion, MeshesDeform) {
    World world;
    auto mesh = square();
    mesh->vertex_normals.assign(4, {0, 0, 1});
    mesh->motion_steps = 3;
    for (float t : {0.f, 0.5f, 1.f})
        for (Vec3 p : mesh->positions) mesh->motion_positions.push_back(p + expected_place(t));
    for (int step = 0; step < 3; ++step) mesh->motion_normals.insert(mesh->motion_normals.end(), 4, {0, 0, 1});
    world.add(mesh);
    Accelerator accelerator;
    accelerator.build(world.view(), {});
    expect_moves(world, accelerator);
}

TEST(Motion, CopiesThatPartAreBothThere) {
    World world;
    const auto mesh = square();
    world.add(mesh);
    world.add(mesh);
    world.scene.motion.objects.emplace_back();
    for (float t : {0.f, 1.f}) world.scene.motion.objects[0].push_back(translate_rotate_scale({8 * t - 4, 0, 0}, {0, 0, 1}, 0, vec3(1)));
    world.scene.motion.of_objects = {scene::kNone, 0};
    Accelerator accelerator;
    accelerator.build(world.view(), {});
    Probe probe;
    probe.add(-4, 0), probe.add(0, 0), probe.add(4, 1);
    std::vector<int32_t> hit;
    probe.shade(world, accelerator, 8, hit);
    EXPECT_EQ(hit.size(), 3u);
}

TEST(Motion, StepsCoverTheShutter) {
    for (int steps : {2, 3, 9, 129}) {
        for (float t = 0; t <= 1; t += 0.01f) {
            const scene::MotionStep m = scene::motion_step(steps, t);
            EXPECT_GE(m.step, 0);
            EXPECT_LT(m.step + 1, steps);
            EXPECT_NEAR((float(m.step) + m.part) / float(steps - 1), t, 1e-5f);
        }
        const scene::MotionStep end = scene::motion_step(steps, 1);
        EXPECT_EQ(end.step, steps - 2);
        EXPECT_EQ(end.part, 1);
        EXPECT_EQ(scene::motion_step(steps, 7).step, steps - 2);
        EXPECT_EQ(scene::motion_step(steps, -7).step, 0);
    }
}

}  // namespace
}  // namespace talbot::geometry
