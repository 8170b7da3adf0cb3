/// The electric-light cases of CIE 171:2006 (exact values where the printed tables hold the errors of their patches), inter-reflection in spheres and
/// between mirrors, lamps cut by the horizon, shadows. Lengths in metres; a unit of flux is whatever the case's is.
#include <array>
#include <initializer_list>

#include "support/stage.h"

namespace talbot {
namespace {

using namespace test;

/// The standard's room: 4 x 4 x 3 m, y from the wall of the points A to F.
constexpr Vec3 kNorth{2, 0, 1.5f}, kSouth{2, 4, 1.5f}, kFloor{2, 2, 0}, kCeiling{2, 2, 3};

void north_wall(Stage& stage, int material) {
    stage.quad(kNorth, {2, 0, 0}, {0, 0, 1.5f}, material);
}
void level(Stage& stage, Vec3 center, int material) {
    stage.quad(center, {2, 0, 0}, {0, 2, 0}, material);
}

/// Irradiance at a point of a white surface: pi times what it scatters of a first bounce.
void expect_irradiance(Stage& stage, Vec3 at, Vec3 direction, double expected, const std::string& name, double tolerance = 0.002) {
    stage.look(at, direction);
    expect_render(stage, expected / M_PI, name, tolerance);
}

std::string at_point(const char* name, int index) {
    return std::string(name) + ", point " + std::to_string(index);
}

TEST(LightingCases, PointSources) {  // 5.2
    struct Point {
        float x, y;
        double cosine, isotropic;
    };
    const Point points[] = {{0, 0, 111.1111, 88.4194}, {.5f, 0, 105.1863, 0},         {1, 0, 90.0000, 75.4938}, {1.5f, 0, 71.1111, 0},
                            {.5f, .5f, 99.7230, 0},    {1, .5f, 85.6633, 0},          {1.5f, .5f, 68.0529, 0},  {1, 1, 74.3802, 0},
                            {1.5f, 1, 59.9750, 0},     {1.5f, 1.5f, 49.3827, 48.1294}};
    for (const Point& p : points) {
        const std::string name = std::to_string(p.x) + ", " + std::to_string(p.y);
        Stage cosine(64);
        cosine.floor();
        Light& disk = cosine.light(LightType::Area, float(1000 * M_PI), {0, 0, 3});
        disk.shape = AreaShape::Disk;
        disk.size_x = 0.01f;
        expect_irradiance(cosine, {p.x, p.y, 0}, {0, 0, -1}, p.cosine, "cosine " + name, 0.001);
        if (p.isotropic == 0) continue;
        Stage isotropic(64);
        isotropic.floor();
        isotropic.light(LightType::Point, 10000, {0, 0, 3});
        expect_irradiance(isotropic, {p.x, p.y, 0}, {0, 0, -1}, p.isotropic, "isotropic " + name, 0.001);
    }
}

TEST(LightingCases, SquareInTheCeiling) {  // 5.3
    const double wall[] = {32.6769, 75.1939, 81.3232, 69.0606, 53.4035, 40.0019}, floor[] = {61.4241, 79.2552, 95.6673, 105.7782};
    for (bool lamp : {false, true}) {
        Stage stage(256);
        north_wall(stage, stage.diffuse(1));
        level(stage, kFloor, stage.diffuse(1));
        if (lamp)
            stage.light(LightType::Area, float(1000 * M_PI), {2, 2, 3});
        else
            stage.quad({2, 2, 3}, {.5f, 0, 0}, {0, .5f, 0}, stage.emitter(1000));
        for (int i = 0; i < 6; ++i) expect_irradiance(stage, {2, 0, 2.75f - 0.5f * float(i)}, {0, -1, 0}, wall[i], at_point("wall", i));
        for (int i = 0; i < 4; ++i) expect_irradiance(stage, {2, 0.25f + 0.5f * float(i), 0}, {0, 0, -1}, floor[i], at_point("floor", i));
    }
}

TEST(LightingCases, FluxOfALampArrivesOnTheWalls) {  // 5.4
    Stage stage(1024);
    north_wall(stage, stage.diffuse(1));
    level(stage, kFloor, stage.diffuse(1));
    stage.light(LightType::Point, 10000, {2, 2, 1.5f});
    stage.look(kFloor, {0, 0, -1}, 1, 4);
    expect_render(stage, 138.166 / M_PI, "floor", 0.002);
    // The picture is square: two of the wall's halves, of 2 m width and 3 m height, are seen in squares of 1 m each.
    double sum = 0, error = 0;
    for (float x : {0.5f, 1.5f})
        for (float z : {0.5f, 1.5f, 2.5f}) {
            stage.look({x, 0, z}, {0, -1, 0}, 1, 1);
            const Estimate e = render(stage);
            sum += e.mean / 6;
            error += e.error / 6;
        }
    EXPECT_NEAR(sum, 116.223 / M_PI, 0.002 * 116.223 / M_PI);
    EXPECT_LT(kEquivalence * error, 0.001 * sum);
}

TEST(LightingCases, LightFromTheGround) {  // 5.6
    const double wall[] = {45.1226, 35.9005, 27.9916, 21.6385, 16.7163, 12.9674}, ceiling[] = {26.7952, 30.9387, 33.9757, 35.5666};
    Stage stage(1024);
    north_wall(stage, stage.diffuse(1));
    level(stage, kCeiling, stage.diffuse(1));
    level(stage, kFloor, stage.emitter(float(100 / M_PI)));
    for (int i = 0; i < 6; ++i) expect_irradiance(stage, {2, 0, 0.25f + 0.5f * float(i)}, {0, -1, 0}, wall[i], at_point("wall", i));
    for (int i = 0; i < 4; ++i) expect_irradiance(stage, {2, 0.25f + 0.5f * float(i), 3}, {0, 0, 1}, ceiling[i], at_point("ceiling", i));
}

TEST(LightingCases, LightPastABox) {  // 5.7
    const double wall[] = {16.0706, 16.3297, 15.3988, 13.3220, 10.3169, 7.0790}, floor[] = {3.3823, 3.6290, 3.0130};
    Stage stage(2048);
    north_wall(stage, stage.diffuse(1));
    level(stage, kFloor, stage.diffuse(1));
    stage.quad(kSouth, {2, 0, 0}, {0, 0, 1.5f}, stage.emitter(float(100 / M_PI)));
    const int black = stage.diffuse(0);
    for (float y : {2.5f, 2.7f}) stage.quad({2, y, 0.5f}, {2, 0, 0}, {0, 0, 0.5f}, black);
    stage.quad({2, 2.6f, 1}, {2, 0, 0}, {0, 0.1f, 0}, black);
    for (int i = 0; i < 6; ++i) expect_irradiance(stage, {2, 0, 2.75f - 0.5f * float(i)}, {0, -1, 0}, wall[i], at_point("wall", i));
    for (int i = 0; i < 3; ++i) expect_irradiance(stage, {2, 0.25f + 0.5f * float(i), 0}, {0, 0, -1}, floor[i], at_point("floor", i), 0.005);
    stage.look({2, 2.25f, 0}, {0, 0, -1});
    EXPECT_EQ(render(stage).mean, 0) << "behind the box";  // at 1.75 m the shadow ends
}

TEST(LightingCases, InterReflectionInACube) {  // 5.8: mean over a wall, and its centre
    const std::array<double, 3> cases[] = {{.2, 26.0417, 227.82}, {.5, 104.1667, 310.98}, {.8, 416.667, 629.89}};
    for (const auto& [albedo, indirect, center] : cases) {
        Stage stage(albedo > 0.6 ? 8192 : 2048);
        stage.mesh(cube_corners(), kCube, stage.diffuse(float(albedo)), {}, 2);
        stage.light(LightType::Point, 10000, {});
        stage.bounces(200);
        const std::string name = "reflectance " + std::to_string(albedo);
        stage.look({0, 0, -2}, {0, 0, -1}, 1, 4);
        expect_render(stage, albedo / M_PI * (10000.0 / 96 + indirect), name + ", mean", 0.005);
        stage.look({0, 0, -2}, {0, 0, -1});
        expect_render(stage, albedo / M_PI * center, name + ", centre", 0.005);
    }
}

// Whatever the place of the lamp, what a diffuse sphere gets from itself is uniform: E = rho Phi / (A (1 - rho)).
TEST(LightingCases, InterReflectionInASphere) {
    std::vector<Vec3> positions;
    std::vector<uint32_t> triangles;
    make_sphere(6, positions, triangles);
    const std::array<double, 2> cases[] = {{.25, .083333}, {.75, .75}};
    for (const auto& [albedo, indirect] : cases) {
        Stage stage(albedo > 0.6 ? 8192 : 2048);
        stage.mesh(positions, triangles, stage.diffuse(float(albedo)));
        stage.light(LightType::Point, kPi, {.5f, 0, 0});
        stage.bounces(200);
        stage.look({-1, 0, 0}, {-1, 0, 0}, 0.05f);
        expect_render(stage, albedo / M_PI * (.111111 + indirect), "sphere of reflectance " + std::to_string(albedo), 0.002);
    }
}

TEST(LightingCases, MirrorsThatShine) {
    for (float reflectance : {0.5f, 0.9f}) {
        Stage stage(4096);
        GraphBuilder g;
        const int mirror = g.node("ShaderNodeBsdfGlossy")
                               .text("distribution", "GGX")
                               .color("Color", {reflectance, reflectance, reflectance})
                               .set("Roughness", 0.0f)
                               .set("Anisotropy", 0.0f)
                               .set("Rotation", 0.0f)
                               .id();
        g.surface(g.add(g.out(mirror, "BSDF", scene::SocketKind::Shader), g.emission({1, 1, 1}, 1)));
        const int material = stage.shader(std::move(g));
        for (float z : {0.0f, 1.0f}) stage.quad({0, 0, z}, {5000, 0, 0}, {0, 5000, 0}, material);
        stage.bounces(400);
        stage.look({}, {0.1f, 0, -1});
        expect_render(stage, 1 / (1 - double(reflectance)), "reflectance " + std::to_string(reflectance), reflectance > 0.6f ? 0.005 : 0.002);
    }
}

TEST(LightingCases, SpheresCutByTheHorizon) {
    const std::array<double, 2> cases[] = {{0, .25}, {45, .176776695}, {80, .0546958164}, {90, .0288344428}, {110, .00214956752}};
    for (const auto& [degrees, factor] : cases) {
        Stage stage(1024);
        stage.floor();
        const double angle = degrees * M_PI / 180;
        Light& sphere = stage.light(LightType::Point, float(4 * M_PI * M_PI), {float(2 * std::sin(angle)), 0, float(2 * std::cos(angle))});
        sphere.radius = 1;
        sphere.soft_falloff = false;
        stage.look({}, {0, 0, -1});
        expect_render(stage, factor, std::to_string(degrees) + " degrees", degrees > 100 ? 0.005 : 0.002);
    }
}

TEST(LightingCases, SphereBeforeADome) {
    std::vector<Vec3> positions;
    std::vector<uint32_t> triangles;
    make_sphere(6, positions, triangles);
    const std::array<double, 3> cases[] = {{2, 0, .75}, {2, 1, .8211145618}, {2, 3, .9573307541}, {1, 2, .9105572809}};
    for (const auto& [height, offset, expected] : cases) {
        Stage stage(4096);
        stage.floor();
        stage.mesh(positions, triangles, stage.diffuse(0), {0, 0, float(height)});
        stage.world(1);
        stage.look({float(offset), 0, 0}, {0, 0, -1});
        expect_render(stage, expected, "height " + std::to_string(height) + ", offset " + std::to_string(offset), 0.002);
    }
}

TEST(LightingCases, Penumbra) {
    const std::array<double, 2> cases[] = {{-.75, .0584064584}, {-.5, .0661826138}, {-.25, .0556557327}, {0, .0367388174}, {.25, .0158979379}};
    for (const auto& [x, factor] : cases) {
        Stage stage(4096);
        stage.quad({0, 0.5f, 0}, {4, 0, 0}, {0, 4, 0}, stage.diffuse(1));  // a small one, its diagonal elsewhere: places are exact to 1e-6 of its size
        stage.quad({0, 0, 2}, {.5f, 0, 0}, {0, .5f, 0}, stage.emitter(1));
        stage.quad({25, 0, 1}, {25, 0, 0}, {0, 50, 0}, stage.diffuse(0));
        stage.look({float(x), 0, 0}, {0, 0, -1});
        expect_render(stage, factor, "x = " + std::to_string(x), 0.002);
    }
}

// A mirror beside the point shows it the lamp a second time.
TEST(LightingCases, MirrorBeside) {
    Stage stage(16384);
    stage.floor();
    stage.quad({0, 0, 1}, {.5f, 0, 0}, {0, .5f, 0}, stage.emitter(1));
    GraphBuilder g;
    g.surface(g.out(g.node("ShaderNodeBsdfGlossy")
                        .text("distribution", "GGX")
                        .color("Color", {.9f, .9f, .9f})
                        .set("Roughness", 0.0f)
                        .set("Anisotropy", 0.0f)
                        .set("Rotation", 0.0f)
                        .id(),
                    "BSDF", scene::SocketKind::Shader));
    stage.quad({2, 0, 25}, {0, 50, 0}, {0, 0, 25}, stage.shader(std::move(g)));
    stage.bounces(1);
    stage.scene.settings.max_bounces = 2;
    stage.look({1, 0, 0}, {0, 0, -1});
    expect_render(stage, .0843536644 + .0030295884, "square lamp and its image", 0.003);
}

}  // namespace
}  // namespace talbot
