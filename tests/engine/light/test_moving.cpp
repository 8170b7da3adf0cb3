/// Emissive meshes in motion: at each moment of the shutter they are sampled as one that stands there.
#include <gtest/gtest.h>

#include "fixture.h"
#include "scene/motion.h"

namespace talbot::light::test {
namespace {

const std::vector<Vec3> kCorners = {{-0.5f, -0.3f, 0}, {0.5f, -0.3f, 0.1f}, {0.4f, 0.4f, 0}, {-0.5f, 0.3f, 0.2f}};
const std::vector<uint32_t> kTriangles = {0, 1, 2, 0, 2, 3};
const Vec3 kPoint{0.3f, 0.2f, -1.5f}, kNormal{0, 0, 1};

Affine placed(float x, float angle) {
    Affine m;
    m.m[0][0] = m.m[1][1] = std::cos(angle);
    m.m[1][0] = std::sin(angle);
    m.m[0][1] = -m.m[1][0];
    m.m[0][3] = x;
    return m;
}

std::vector<Vec3> bent(float by) {
    std::vector<Vec3> out = kCorners;
    out[1].z += by;
    out[3].x -= by;
    return out;
}

struct Light {
    double irradiance = 0, mean_density_error = 0;
};

/// Irradiance at a moment, and how far the density of the rays is from the samples' own.
Light light_at(Fixture& f, float time) {
    constexpr int count = 1 << 14;
    Light light;
    sample_many(
        f, Stratum::Local, kPoint, count,
        [&](const Samples& s, int n) {
            for (int i = 0; i < n; ++i) {
                if (s.pdf[i] <= 0) continue;
                light.irradiance += double(s.r[i]) * double(std::max(dot(s.wi(i), kNormal), 0.0f)) / double(s.pdf[i]) / count;
                float p[3] = {kPoint.x, kPoint.y, kPoint.z}, pdf = 0, best = 1e30f;
                // The triangle that was sampled is the one whose density agrees.
                for (int32_t object = 0, primitive = 0; primitive < 2; ++primitive) {
                    pdf_triangles(*f.table, f.tables.view, {p, p + 1, p + 2}, &s.distance[i], &object, &primitive, nullptr, &time, 1, &pdf);
                    best = std::min(best, std::abs(pdf / s.pdf[i] - 1));
                }
                light.mean_density_error += double(best) / count;
            }
        },
        1, false, 0, -1, time);
    return light;
}

void expect_as_if_standing(Fixture& moving, const std::function<void(Fixture&, int, float)>& add_standing) {
    moving.build();
    for (float time : {0.0f, 0.3f, 1.0f}) {
        Fixture standing;
        add_standing(standing, standing.emission({2, 2, 2}), time);
        standing.build();
        const double expected = irradiance(standing, Stratum::Local, kPoint, kNormal);
        const Light light = light_at(moving, time);
        EXPECT_GT(expected, 0.1);
        EXPECT_NEAR(light.irradiance / expected, 1, 0.01) << time;
        EXPECT_LT(light.mean_density_error, 1e-3) << time;
    }
}

TEST(Moving, ObjectsAreSampledWhereTheyAre) {
    Fixture f;
    f.add_mesh(kCorners, kTriangles, f.emission({2, 2, 2}), placed(0, 0));
    f.scene.motion.objects = {{placed(-1, 0), placed(1, 0)}};
    f.scene.motion.of_objects.assign(f.scene.objects.size(), 0);
    expect_as_if_standing(f, [](Fixture& s, int shader, float time) { s.add_mesh(kCorners, kTriangles, shader, placed(2 * time - 1, 0)); });
}

TEST(Moving, TurningObjectsToo) {
    Fixture f;
    f.add_mesh(kCorners, kTriangles, f.emission({2, 2, 2}), placed(0, 0));
    f.scene.motion.objects = {{placed(0, 0), placed(0.2f, 0.4f), placed(0.4f, 0.8f)}};
    f.scene.motion.of_objects.assign(f.scene.objects.size(), 0);
    expect_as_if_standing(f, [](Fixture& s, int shader, float time) {
        // Between steps the maps are interpolated as they are.
        const bool second = time > 0.5f;
        const float part = 2 * time - (second ? 1.0f : 0.0f);
        const Affine a = second ? placed(0.2f, 0.4f) : placed(0, 0), b = second ? placed(0.4f, 0.8f) : placed(0.2f, 0.4f);
        s.add_mesh(kCorners, kTriangles, shader, scene::lerp(a, b, part));
    });
}

TEST(Moving, ShapesThatChange) {
    Fixture f;
    f.add_mesh(kCorners, kTriangles, f.emission({2, 2, 2}), placed(0.2f, 0));
    scene::Mesh mesh = *f.scene.meshes[0];
    mesh.motion_steps = 2;
    for (float by : {0.0f, 1.0f}) {
        const std::vector<Vec3> shape = bent(by);
        mesh.motion_positions.insert(mesh.motion_positions.end(), shape.begin(), shape.end());
    }
    f.scene.meshes[0] = std::make_shared<scene::Mesh>(mesh);
    expect_as_if_standing(f, [](Fixture& s, int shader, float time) { s.add_mesh(bent(time), kTriangles, shader, placed(0.2f, 0)); });
}

}  // namespace
}  // namespace talbot::light::test
