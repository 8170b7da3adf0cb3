/// Light samples against closed forms and against what Cycles renders with the same lamps.
#include <gtest/gtest.h>

#include "fixture.h"

namespace talbot::light::test {
namespace {

using scene::AreaShape;
using scene::LightType;

constexpr float kDegree = kPi / 180;
const Vec3 kUp{0, 0, 1};

/// Radiance of a white plane at the origin under one lamp of 1000 W (a sun: 1 W/m2) at height 10, turned by `tilt` about X: what Blender's
/// pictures hold.
double plane(int version, LightType type, const std::function<void(scene::Light&)>& change, float tilt = 0, Vec3 scale = {1, 1, 1}) {
    Fixture f(version);
    scene::Light& light = f.add_light(type, type == LightType::Sun ? 1.0f : 1000.0f, {0, 0, 10});
    const float c = std::cos(tilt), s = std::sin(tilt);
    Affine& m = light.to_world;
    m.m[1][1] = c;
    m.m[1][2] = -s;
    m.m[2][1] = s;
    m.m[2][2] = c;
    const float k[3] = {scale.x, scale.y, scale.z};
    for (int row = 0; row < 3; ++row) {
        for (int col = 0; col < 3; ++col) m.m[row][col] *= k[col];
    }
    change(light);
    f.build();
    // The pictures' mean is over a square of 10 cm.
    double sum = 0;
    for (int k = 0; k < 256; ++k) {
        const Vec3 p{(float(k % 16) - 7.5f) / 160, (float(k / 16) - 7.5f) / 160, 0};
        sum += irradiance(f, type == LightType::Sun ? Stratum::Distant : Stratum::Local, p, kUp, 512, uint32_t(k));
    }
    return sum / 256 / M_PI;
}
void expect_near(double value, double expected, double relative, const std::string& what) {
    EXPECT_NEAR(value, expected, relative * expected) << what;
}

TEST(Irradiance, PointLampsMatchCycles) {
    for (int version : {304, 402, 405, 500, 502}) {
        const std::string v = std::to_string(version);
        expect_near(plane(version, LightType::Point, [](auto& l) { l.radius = 0; }), 0.253297, 1e-5, v);
        expect_near(plane(version, LightType::Point, [](auto& l) { l.radius = 0.5f; }), 0.252665, 1e-4, v);
    }
    const auto hard = [](auto& l) {
        l.radius = 0.5f;
        l.soft_falloff = false;
    };
    expect_near(plane(502, LightType::Point, hard), 0.253298, 1e-4, "true sphere");
    expect_near(plane(304, LightType::Point, hard), 0.252665, 1e-4, "3.4 knows no sphere");
    const auto whole = [](auto& l) { l.normalize = false; };
    expect_near(plane(502, LightType::Point, [&](auto& l) { whole(l), l.radius = 0; }), 1.013186, 1e-5, "normalize off");
    expect_near(plane(502, LightType::Point, [&](auto& l) { whole(l), l.radius = 0.5f; }), 0.79377, 1e-4, "normalize off, radius");
}

TEST(Irradiance, SpotLampsMatchCycles) {
    const double angles[] = {0, 10, 20, 21, 22, 22.4};
    const double today[] = {0.253297, 0.253297, 0.253297, 0.233288, 0.054091, 0.007686};
    const double old[] = {0.253294, 0.249446, 0.238019, 0.217819, 0.050204, 0.007133};
    for (int k = 0; k < 6; ++k) {
        const auto spot = [](auto& l) { l.radius = 0; };
        // Near the edge the mean depends on the pixel filter's overhang.
        const double tolerance = k == 5 ? 1.5e-2 : k == 4 ? 3e-3 : 1e-3;
        expect_near(plane(502, LightType::Spot, spot, float(angles[k]) * kDegree), today[k], tolerance, std::to_string(angles[k]));
        expect_near(plane(304, LightType::Spot, spot, float(angles[k]) * kDegree), old[k], tolerance, std::to_string(angles[k]));
    }
    for (float blend : {0.0f, 1.0f}) {
        const auto spot = [=](auto& l) { l.radius = 0, l.spot_blend = blend; };
        expect_near(plane(502, LightType::Spot, spot, 20 * kDegree), blend > 0 ? 0.028303 : 0.253297, 1e-3, "blend");
        expect_near(plane(304, LightType::Spot, spot, 20 * kDegree), blend > 0 ? 0.026601 : 0.238019, 1e-3, "blend");
    }
    // An object squeezed in Y squeezes today's cone; 3.4's does not care.
    const auto sharp = [](auto& l) { l.radius = 0, l.spot_blend = 0; };
    EXPECT_EQ(plane(502, LightType::Spot, sharp, 20 * kDegree, {1, 0.5f, 1}), 0);
    expect_near(plane(304, LightType::Spot, sharp, 20 * kDegree, {1, 0.5f, 1}), 0.238019, 1e-4, "3.4 ignores scale");
    // Outside, and behind.
    EXPECT_EQ(plane(502, LightType::Spot, sharp, 23 * kDegree), 0);
    EXPECT_EQ(plane(502, LightType::Spot, sharp, 180 * kDegree), 0);
}

TEST(Irradiance, AreaLampsMatchCycles) {
    struct Case {
        AreaShape shape;
        float x, y, spread;
        double today, old;
    };
    const Case cases[] = {
        {AreaShape::Square, .01f, 1, 180, 1.013177, .795774},
        {AreaShape::Disk, .01f, 1, 180, 1.013177, .795748},
        {AreaShape::Rectangle, .01f, .02f, 180, 1.013177, .795774},
        {AreaShape::Square, .2f, 1, 180, 1.013042, .795668},
        {AreaShape::Disk, .2f, 1, 180, 1.013076, .795668},
        {AreaShape::Rectangle, .2f, .4f, 180, 1.01284, .795486},
        {AreaShape::Ellipse, .2f, .4f, 180, 1.012924, .795549},
        {AreaShape::Square, 1, 1, 180, 1.009812, .793091},
        {AreaShape::Disk, 1, 1, 180, 1.010651, .793765},
        {AreaShape::Rectangle, 1, 2, 180, 1.004815, .789175},
        {AreaShape::Ellipse, 1, 2, 180, 1.006892, .79081},
        {AreaShape::Square, 3, 1, 180, .983701, .772604},
        {AreaShape::Disk, 3, 1, 180, .990883, .778242},
        {AreaShape::Rectangle, 3, 6, 180, .943228, .740784},
        {AreaShape::Ellipse, 3, 6, 180, .959718, .753744},
        {AreaShape::Square, .01f, 1, 90, 4.70295, 3.693761},
        {AreaShape::Square, .01f, 1, 30, 43.507819, 34.171089},
        {AreaShape::Square, 1, 1, 170, 1.15653, .908321},
        {AreaShape::Square, 1, 1, 120, 2.497311, 1.961353},
        {AreaShape::Square, 1, 1, 60, 10.125495, 7.952455},
        {AreaShape::Square, 1, 1, 10, 223.1902, 175.331144},
    };
    for (const Case& c : cases) {
        const auto area = [&](scene::Light& l) {
            l.shape = c.shape;
            l.size_x = c.x;
            l.size_y = c.y;
            l.spread = c.spread * kDegree;
        };
        const std::string name = std::to_string(int(c.shape)) + " " + std::to_string(c.x) + " " + std::to_string(c.spread);
        expect_near(plane(502, LightType::Area, area), c.today, 5e-4, name);
        expect_near(plane(304, LightType::Area, area), c.old, 5e-4, "3.4 " + name);
    }
    const auto small = [](auto& l) { l.size_x = 0.01f; };
    expect_near(plane(502, LightType::Area, small, 0, {2, 1, 1}), 1.013177, 1e-4, "scaled");
    expect_near(plane(502, LightType::Area, [&](auto& l) { small(l), l.normalize = false; }), 0.000101321, 1e-4, "normalize off");
    EXPECT_EQ(plane(502, LightType::Area, small, 180 * kDegree), 0) << "one-sided";
}

TEST(Irradiance, SunsMatchCycles) {
    const auto angle = [](float degrees, bool normalize = true) { return [=](scene::Light& l) { l.sun_angle = degrees * kDegree, l.normalize = normalize; }; };
    for (int version : {304, 402, 502}) expect_near(plane(version, LightType::Sun, angle(0)), 0.318310, 1e-5, "delta");
    expect_near(plane(502, LightType::Sun, angle(10)), 0.318310, 1e-4, "today");
    expect_near(plane(304, LightType::Sun, angle(10)), 0.317703, 1e-4, "3.4");
    expect_near(plane(502, LightType::Sun, angle(10, false)), 0.007596, 2e-4, "normalize off");
    expect_near(plane(502, LightType::Sun, angle(0, false)), 0.318311, 1e-4, "normalize off, delta");
    expect_near(plane(502, LightType::Sun, angle(0), 60 * kDegree), 0.318310 * 0.5, 1e-4, "tilted");
}

/// E / M of an emitter of radiance 1.
double configuration(Fixture& f, Vec3 p, Vec3 n, uint32_t seed = 1) {
    f.build();
    return irradiance(f, Stratum::Local, p, n, 1 << 16, seed) / M_PI;
}
void add_square(Fixture& f, Vec3 center, Vec3 x, Vec3 y) {
    const Vec3 a = center - x - y, b = center + x - y, c = center + x + y, d = center - x + y;
    f.add_mesh({a, b, c, d}, {0, 1, 2, 0, 2, 3}, f.emission({1, 1, 1}));
}

TEST(Irradiance, SquareFactors) {
    const double on_axis[][2] = {{.5, .55412642398}, {1, .239456470461}, {2, .0734776348125}};
    for (const auto& c : on_axis) {
        Fixture f;
        add_square(f, {0, 0, float(c[0])}, {.5f, 0, 0}, {0, .5f, 0});
        expect_near(configuration(f, {}, kUp), c[1], 2e-4, "CF1");
        EXPECT_EQ(f.table->rects.size(), 1u) << "two triangles are one rectangle";
    }
    Fixture beside, vertical;
    add_square(beside, {0, 0, 1}, {.5f, 0, 0}, {0, .5f, 0});
    expect_near(configuration(beside, {1, 0, 0}, kUp), .0843536643881, 2e-4, "CF2");
    expect_near(configuration(beside, {}, normalize(Vec3{1, 0, 1})), .169321294062, 2e-4, "CF2 tilted");
    add_square(vertical, {1, 0, 0}, {0, .5f, 0}, {0, 0, .5f});
    expect_near(configuration(vertical, {}, kUp), .02785538242, 5e-4, "CF3");
}

TEST(Irradiance, TriangleFactors) {
    Fixture f;
    f.add_mesh({{1, 0, 1}, {0, 1, 1}, {0, 0, 2}}, {0, 1, 2}, f.emission({1, 1, 1}));
    expect_near(configuration(f, {}, kUp), .0962250448649, 2e-4, "CF6");
    // The square of CF1 as four triangles about its centre: by triangles, not as a rectangle.
    Fixture fan;
    fan.add_mesh({{-.5f, -.5f, 1}, {.5f, -.5f, 1}, {.5f, .5f, 1}, {-.5f, .5f, 1}, {0, 0, 1}}, {0, 1, 4, 1, 2, 4, 2, 3, 4, 3, 0, 4}, fan.emission({1, 1, 1}));
    expect_near(configuration(fan, {}, kUp), .239456470461, 3e-4, "fan");
    EXPECT_TRUE(fan.table->rects.empty());
}

// Points of a leaning square and of a leaning triangle are on them but for rounding: neither lights itself.
TEST(Irradiance, FlatShapesDoNotLightThemselves) {
    const Affine lean = look_at({3, -2, 5}, {4, 1, 2});
    const Vec3 normal = normalize(Vec3{lean.m[0][2], lean.m[1][2], lean.m[2][2]});
    for (const std::vector<uint32_t>& triangles : {std::vector<uint32_t>{0, 1, 2, 0, 2, 3}, {0, 1, 2}}) {
        Fixture f;
        f.add_mesh({{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}}, triangles, f.emission({1, 1, 1}), lean);
        f.build();
        for (int k = 0; k < 64; ++k) {
            const Vec3 p = transform_point(lean, {0.013f * float(k), 0.011f * float(k) - 0.6f, 0});
            EXPECT_LT(irradiance(f, Stratum::Local, p, normal, 256), 1e-3) << k;
            EXPECT_LT(irradiance(f, Stratum::Local, p, normal * -1.0f, 256), 1e-3) << k;
        }
    }
}
TEST(Irradiance, DiskAndSphereFactors) {
    const double disk[][2] = {{0, .5}, {.5, .437982632705}, {1, .27639320225}, {2, .0527864045}};
    for (const auto& c : disk) {
        Fixture f;
        scene::Light& l = f.add_light(LightType::Area, float(M_PI * M_PI), {0, 0, 1});  // radiance P / (pi A) = 1
        l.shape = AreaShape::Disk;
        l.size_x = 2;
        expect_near(configuration(f, {float(c[0]), 0, 0}, kUp), c[1], 1e-3, "CF4");
    }
    const double sphere[][2] = {{0, .25}, {45, .176776695}, {80, .0546958164}, {90, .0288344428}, {110, .00214956752}};
    for (const auto& c : sphere) {
        Fixture f;
        scene::Light& l = f.add_light(LightType::Point, float(4 * M_PI * M_PI), {0, 0, 2});
        l.radius = 1;
        l.soft_falloff = false;
        const float a = float(c[0]) * kDegree;
        expect_near(configuration(f, {}, {std::sin(a), 0, std::cos(a)}), c[1], 1e-3, "CF5");
    }
}

TEST(Irradiance, InstancesShareTheirTriangles) {
    // Two squares of one mesh, one mirrored and squeezed; the sum of CF1 at 1 and at 2 with half the area.
    Fixture f;
    const int shader = f.emission({1, 1, 1});
    f.add_mesh({{-.5f, -.5f, 1}, {.5f, -.5f, 1}, {.5f, .5f, 1}, {-.5f, .5f, 1}, {0, 0, 1}}, {0, 1, 4, 1, 2, 4, 2, 3, 4, 3, 0, 4}, shader);
    Affine half;
    half.m[0][0] = -1;
    half.m[2][2] = -2;
    f.add_instance(0, shader, half);
    f.scene.material_sets[1] = f.scene.material_sets[0];
    f.scene.traits[1].material_set = 0;
    f.build();
    EXPECT_EQ(f.table->triangles.size(), 4u);
    const double up = irradiance(f, Stratum::Local, {}, kUp, 1 << 16) / M_PI, down = irradiance(f, Stratum::Local, {}, -kUp, 1 << 16) / M_PI;
    expect_near(up, .239456470461, 1e-3, "one at 1");
    expect_near(down, .0734776348125, 1e-3, "one at -2");
}

TEST(Irradiance, SidesThatAreNotSampled) {
    for (bool front : {true, false}) {
        Fixture f;
        add_square(f, {0, 0, 1}, {.5f, 0, 0}, {0, .5f, 0});  // front towards +Z
        f.programs.shaders[0].emission_front = front;
        f.programs.shaders[0].emission_back = !front;
        const double below = configuration(f, {}, kUp), above = configuration(f, {0, 0, 2}, -kUp);
        expect_near(front ? above : below, .239456470461, 1e-3, "sampled side");
        EXPECT_EQ(front ? below : above, 0);
        const Met met = meet(f, {}, kUp);
        EXPECT_EQ(met.pdf > 0, !front);
    }
}

TEST(Irradiance, BouncesLimitALamp) {
    Fixture f;
    scene::Light& l = f.add_light(LightType::Area, 100, {0, 0, 1});
    l.max_bounces = 1;
    f.build();
    for (int bounce : {0, 1, 2}) {
        double sum = 0;
        sample_many(
            f, Stratum::Local, {}, 64,
            [&](const Samples& s, int n) {
                for (int i = 0; i < n; ++i) sum += double(s.pdf[i]);
            },
            1, false, bounce);
        EXPECT_EQ(sum > 0, bounce <= 1) << bounce;
        float o[3] = {0, 0, 0}, d[3] = {0, 0, 1}, rgb[3], pdf, t = 1;
        const int32_t lamp = 0, b = bounce;
        shade_lamps(*f.table, {o, o + 1, o + 2}, {d, d + 1, d + 2}, &lamp, &t, 1, f.programs, f.context, f.scratch, {rgb, rgb + 1, rgb + 2}, &pdf, {&b});
        EXPECT_GT(rgb[0], 0.0f) << "rays that meet it see it";
    }
}

/// Spans whose lanes chose one rectangle go another way than mixed ones: to the same bits.
TEST(Samples, OfALaneDoNotDependOnItsNeighbours) {
    Fixture f;
    for (const AreaShape shape : {AreaShape::Rectangle, AreaShape::Ellipse, AreaShape::Disk}) {
        scene::Light& l = f.add_light(LightType::Area, 100, {0.4f * float(f.scene.lights.size()), 0.2f, 1});
        l.shape = shape;
        l.size_x = 0.8f;
        l.size_y = 0.5f;
        l.spread = 2.0f;
    }
    f.build();
    float p[3][kSpan], n_s[3][kSpan], u[4][kSpan];
    int32_t bounce[kSpan];
    std::mt19937 engine(5);
    for (int i = 0; i < kSpan; ++i) {
        for (auto& column : p) column[i] = unit_float(engine()) - 0.5f;
        for (auto& column : u) column[i] = unit_float(engine());
        for (auto& column : n_s) column[i] = 0.0f;
        n_s[2][i] = 1.0f;
        bounce[i] = 0;
    }
    const auto sample = [&](int begin, int n, Samples& samples) {
        LightQuery query;
        query.p = {p[0] + begin, p[1] + begin, p[2] + begin};
        query.n_s = {n_s[0] + begin, n_s[1] + begin, n_s[2] + begin};
        query.pick_u = u[0] + begin;
        query.pick_v = u[1] + begin;
        query.u = u[2] + begin;
        query.v = u[3] + begin;
        query.depths.bounces = bounce + begin;
        query.n = n;
        sample_emitters(*f.table, Stratum::Local, query, f.programs, f.context, f.scratch, samples.out());
    };
    static Samples all, alone;
    sample(0, kSpan, all);
    int lit = 0;
    for (int i = 0; i < kSpan; ++i) {
        sample(i, 1, alone);
        lit += all.r[i] > 0;
        ASSERT_EQ(all.wx[i], alone.wx[0]) << i;
        ASSERT_EQ(all.wy[i], alone.wy[0]) << i;
        ASSERT_EQ(all.wz[i], alone.wz[0]) << i;
        ASSERT_EQ(all.r[i], alone.r[0]) << i;
        ASSERT_EQ(all.distance[i], alone.distance[0]) << i;
        ASSERT_EQ(all.pdf[i], alone.pdf[0]) << i;
        ASSERT_EQ(all.is_delta[i], alone.is_delta[0]) << i;
    }
    EXPECT_GT(lit, kSpan / 4);
}

}  // namespace
}  // namespace talbot::light::test
