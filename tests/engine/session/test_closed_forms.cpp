/// Whole renders against closed forms: furnaces, lamps, configuration factors, plates and spheres.
#include <functional>

#include "support/stage.h"

namespace talbot {
namespace {

using namespace test;

TEST(ClosedForms, FurnaceBox) {
    const double expected[] = {1.5, 1.75, 1.875, 1.9375};
    for (int n = 0; n < 4; ++n) {
        Stage stage(1024);
        stage.mesh(cube_corners(), kCube, stage.glowing(0.5f, 1));
        stage.bounces(n);
        // The limit of all bounces and that of diffuse ones say the same here.
        (n % 2 == 0 ? stage.scene.settings.max_bounces : stage.scene.settings.diffuse_bounces) = 12;
        stage.look({0.3f, 0.2f, -1}, {0, 0, -1});
        expect_render(stage, expected[n], std::to_string(n) + " bounces", 0.002);
    }
    Stage deep(4096);
    deep.mesh(cube_corners(), kCube, deep.glowing(0.8f, 1));
    deep.bounces(100);
    deep.look({0.3f, 0.2f, -1}, {0, 0, -1});
    expect_render(deep, 5, "roulette does not bias", 0.002);
}

// Where surfaces emit what they absorb of a sky of radiance 1, everything has radiance 1, however paths end.
TEST(ClosedForms, RouletteUnderASky) {
    const std::vector<uint32_t> open(kCube.begin() + 6, kCube.end());
    for (float albedo : {0.5f, 0.9f}) {
        Stage stage(1024);
        stage.mesh(cube_corners(), open, stage.glowing(albedo, 1 - albedo));
        stage.world(1);
        stage.bounces(200);
        stage.look({0.3f, 0.2f, 0.5f}, {0, 1, 0.4f});
        expect_render(stage, 1, "albedo " + std::to_string(albedo), 0.005);
    }
}

TEST(ClosedForms, WhiteFurnace) {
    std::vector<Vec3> positions;
    std::vector<uint32_t> triangles;
    make_sphere(3, positions, triangles);
    for (float albedo : {1.0f, 0.5f}) {
        Stage stage(1024);
        stage.mesh(positions, triangles, stage.diffuse(albedo));
        stage.world(1);
        stage.bounces(4);
        stage.look({0.2f, -0.1f, 1}, {0, 0, -1}, 2, 0.5f);
        expect_render(stage, double(albedo), "sphere in a constant world", 0.001);
    }
}

TEST(ClosedForms, PointSpotAndSun) {
    struct Case {
        const char* name;
        int version;
        LightType type;
        std::function<void(Light&)> change;
        double expected;
    };
    const auto turned = [](Light& l, float degrees) {
        const float c = std::cos(degrees * kDegree), s = std::sin(degrees * kDegree);
        l.to_world.m[1][1] = l.to_world.m[2][2] = c;
        l.to_world.m[1][2] = -s;
        l.to_world.m[2][1] = s;
    };
    const double intensity = 1000 / (4 * M_PI) / M_PI;  // of a white plane at distance 1
    const double h = 5 * M_PI / 180;
    const Case cases[] = {
        {"point", 502, LightType::Point, [](Light&) {}, intensity / 100},
        {"point in 3.4", 304, LightType::Point, [](Light&) {}, intensity / 100},
        {"soft point", 502, LightType::Point, [](Light& l) { l.radius = 0.5f; }, intensity / 100.25},
        {"sphere", 502, LightType::Point, [](Light& l) { l.radius = 0.5f, l.soft_falloff = false; }, intensity / 100},
        {"spot", 502, LightType::Spot, [&](Light& l) { turned(l, 10); }, intensity / 100},
        {"spot in 3.4", 304, LightType::Spot, [&](Light& l) { turned(l, 10); }, intensity / 100 * std::cos(10 * M_PI / 180)},
        {"sun", 502, LightType::Sun, [&](Light& l) { turned(l, 60), l.power = 1; }, 0.5 / M_PI},
        {"disc of a sun", 502, LightType::Sun, [](Light& l) { l.power = 1, l.sun_angle = 10 * kDegree; }, 1 / M_PI},
        // Rays that may not hit a lamp leave all of its light to the light samples.
        {"wide sun without MIS", 502, LightType::Sun, [](Light& l) { l.power = 1, l.sun_angle = 120 * kDegree, l.use_mis = false; }, 1 / M_PI},
        {"sphere without MIS", 502, LightType::Point, [](Light& l) { l.radius = 5, l.soft_falloff = false, l.use_mis = false; }, intensity / 100},
        // E / (pi tan^2 h) / cos^3 t over the disc: 2 (1 / cos h - 1) / tan^2 h.
        {"disc of a sun in 3.4", 304, LightType::Sun, [](Light& l) { l.power = 1, l.sun_angle = 10 * kDegree; },
         2 * (1 / std::cos(h) - 1) / (std::tan(h) * std::tan(h)) / M_PI},
    };
    for (const Case& c : cases) {
        Stage stage(64, c.version);
        stage.floor();
        Light& l = stage.light(c.type, 1000, {0, 0, 10});
        c.change(l);
        stage.look({}, {0, 0, -1});
        expect_render(stage, c.expected, c.name, 0.001);
    }
}

/// A sun of irradiance 1 from this far off the zenith, towards +x.
void low_sun(Stage& stage, float degrees) {
    const float c = std::cos(degrees * kDegree), s = std::sin(degrees * kDegree);
    Light& sun = stage.light(LightType::Sun, 1, {});
    sun.to_world.m[0][0] = sun.to_world.m[2][2] = c;
    sun.to_world.m[0][2] = s;
    sun.to_world.m[2][0] = -s;
}

// The shading offset o turns the cosine of t into that of t / (1 - o / 2).
TEST(ClosedForms, ShadowTerminatorShadingOffset) {
    for (int version : {304, 500}) {
        Stage stage(16, version);
        stage.floor();
        low_sun(stage, 60);
        stage.look({}, {0, 0, -1});
        stage.scene.traits[0].shadow_terminator_shading_offset = 0.4f;
        expect_render(stage, std::cos(75 * M_PI / 180) / M_PI, "offset", 0.001);
    }
}

// Two materials with the same program, a normal that leans by 60 degrees, and a sun at 70: one softens the terminator, the other does not.
TEST(ClosedForms, BumpCorrectionIsTheMaterialsOwn) {
    Stage stage(16, 500);
    for (bool correction : {false, true}) {
        GraphBuilder g;
        const int lean = g.node("ShaderNodeCombineXYZ").set("X", std::sin(60 * kDegree)).set("Y", 0.0f).set("Z", std::cos(60 * kDegree)).id();
        const int diffuse = g.node("ShaderNodeBsdfDiffuse")
                                .color("Color", {1, 1, 1})
                                .set("Roughness", 0.0f)
                                .link("Normal", scene::SocketKind::Vector, g.out(lean, "Vector", scene::SocketKind::Vector))
                                .id();
        g.surface(g.out(diffuse, "BSDF", scene::SocketKind::Shader));
        g.shader.use_bump_map_correction = correction;
        stage.quad({correction ? 1.0f : -1.0f, 0, 0}, {1, 0, 0}, {0, 1, 0}, stage.shader(std::move(g)));
    }
    low_sun(stage, 70);
    stage.look({}, {0, 0, -1});
    const double tan2 = 3, cos2 = std::pow(std::cos(70 * M_PI / 180), 2);
    const double shadowed = 2 / (1 + std::sqrt(1 + 0.125 * tan2 * (1 - cos2) / cos2)), plain = std::cos(10 * M_PI / 180) / M_PI;
    expect_render(stage, 0.5 * (plain + plain * shadowed), "half of the picture", 0.001);
}

TEST(ClosedForms, AreaLamps) {
    // Irradiance over pi of a square of side 1 at height 1, by its configuration factor (both generations' radiances).
    const double factor = 0.239456470461;
    for (int version : {304, 502}) {
        Stage stage(256, version);
        stage.floor();
        stage.light(LightType::Area, 100, {0, 0, 1});
        stage.look({}, {0, 0, -1});
        expect_render(stage, factor * (version == 304 ? 100 / 4.0 : 100 / M_PI), "square in " + std::to_string(version), 0.002);
    }
    const double offsets[][2] = {{0, .5}, {.5, .437982632705}, {1, .27639320225}, {2, .0527864045}};
    for (const auto& c : offsets) {
        Stage stage(1024);
        stage.floor();
        Light& l = stage.light(LightType::Area, float(M_PI * M_PI), {0, 0, 1});
        l.shape = AreaShape::Disk;
        l.size_x = 2;
        stage.look({float(c[0]), 0, 0}, {0, 0, -1});
        expect_render(stage, c[1], "disk, offset " + std::to_string(c[0]), 0.002);
    }
}

TEST(ClosedForms, EmissiveMeshes) {
    struct Case {
        const char* name;
        Vec3 center, x, y, at;
        double factor;
    };
    const Case cases[] = {{"square on the axis", {0, 0, 1}, {.5f, 0, 0}, {0, .5f, 0}, {0, 0, 0}, .239456470461},
                          {"square beside", {0, 0, 1}, {.5f, 0, 0}, {0, .5f, 0}, {1, 0, 0}, .0843536643881},
                          {"square half below the horizon", {1, 0, 0}, {0, .5f, 0}, {0, 0, .5f}, {0, 0, 0}, .02785538242}};
    for (const Case& c : cases) {
        Stage stage(256);
        stage.floor();
        stage.quad(c.center, c.x, c.y, stage.emitter(1));
        stage.look(c.at, {0, 0, -1});
        expect_render(stage, c.factor, c.name, 0.002);
    }
    Stage triangle(512);
    triangle.floor();
    triangle.mesh({{1, 0, 1}, {0, 1, 1}, {0, 0, 2}}, {0, 1, 2}, triangle.emitter(1));
    triangle.look({}, {0, 0, -1});
    expect_render(triangle, .0962250448649, "triangle", 0.002);

    // Without light samples the scattered rays must find the same.
    Stage rays(16384);
    rays.floor();
    rays.quad({0, 0, 1}, {.5f, 0, 0}, {0, .5f, 0}, rays.emitter(1));
    rays.scene.settings.use_emission_sampling = false;
    rays.look({}, {0, 0, -1});
    expect_render(rays, .239456470461, "scattered rays alone", 0.002);
}

TEST(ClosedForms, ParallelPlates) {
    // Infinite plates of reflectance 0.8 (emitting M = 1) and 0.3: B1 = 1 / (1 - 0.24), B2 = 0.3 B1.
    for (bool first : {true, false}) {
        Stage stage(4096);
        stage.quad({0, 0, 0}, {5000, 0, 0}, {0, 5000, 0}, stage.glowing(0.8f, 1 / kPi));
        stage.quad({0, 0, 1}, {5000, 0, 0}, {0, 5000, 0}, stage.diffuse(0.3f));
        stage.bounces(100);
        stage.look({0, 0, first ? 0.0f : 1.0f}, {0, 0, first ? -1.0f : 1.0f});
        expect_render(stage, (first ? 1.0 : 0.3) / 0.76 / M_PI, first ? "emitting plate" : "other plate", 0.002);
    }
}

TEST(ClosedForms, Spheres) {
    std::vector<Vec3> positions;
    std::vector<uint32_t> triangles;
    make_sphere(6, positions, triangles);
    // Reflectance 1/2 around a point of flux 4 pi^2: radiance 1 everywhere.
    Stage inside(8192);
    inside.mesh(positions, triangles, inside.diffuse(0.5f));
    inside.light(LightType::Point, float(4 * M_PI * M_PI), {});
    inside.bounces(100);
    inside.look({0, 0, 1}, {0.1f, 0.2f, 1}, 0.1f, 0.05f);
    expect_render(inside, 1, "sphere around a point", 0.001);

    // Concentric spheres of radius 1 (emitting M = 1) and 2, both of reflectance 1/2: B1 = 10/9, B2 = 2/9.
    for (bool inner : {true, false}) {
        Stage stage(inner ? 1024 : 8192);
        stage.mesh(positions, triangles, stage.glowing(0.5f, 1 / kPi));
        stage.mesh(positions, triangles, stage.diffuse(0.5f), {}, 2);
        stage.bounces(100);
        const Vec3 d{0.1f, 0.2f, inner ? -1.0f : 1.0f};
        stage.look({0, 0, inner ? 1.0f : 2.0f}, d, 0.3f, 0.05f);
        expect_render(stage, (inner ? 10.0 : 2.0) / 9 / M_PI, inner ? "inner sphere" : "outer sphere", 0.002);
    }
}

/// A world that varies: radiance = the direction's components. On a plane that faces up their cosine-weighted means over pi are 0, 0 and 2/3.
TEST(ClosedForms, VaryingWorld) {
    Stage stage(2048);
    stage.floor();
    GraphBuilder g;
    const Socket direction = g.position();
    g.surface(g.out(g.node("ShaderNodeBackground").link("Color", scene::SocketKind::Color, direction).set("Strength", 1.0f).id(), "Background",
                    scene::SocketKind::Shader));
    stage.scene.world.shader = stage.shader(std::move(g));
    stage.look({}, {0, 0, -1});
    expect_render(stage, 2.0 / 3, "cosine sky", 0.001, 2);
    const Estimate sideways = render(stage, 0);
    EXPECT_LT(std::abs(sideways.mean), kBias * sideways.error + 1e-4);
}

/// A sphere of radiance 1 at 3 m, seen in a GGX mirror at 45 degrees: lamp samples where it is rough, scattered rays where it is
/// smooth, and one mean.
TEST(ClosedForms, GlossyReflectionOfALamp) {
    const double cases[][3] = {{.02, .3, .893804725}, {.1, .05, .009673146}, {.1, .3, .258065469}, {.1, 1, .796185825}, {.3, .3, .036325304}};
    for (const auto& c : cases) {
        Stage stage(4096);
        GraphBuilder g;
        g.surface(g.out(g.node("ShaderNodeBsdfGlossy")
                            .text("distribution", "GGX")
                            .color("Color", {1, 1, 1})
                            .set("Roughness", float(std::sqrt(c[0])))
                            .set("Anisotropy", 0.0f)
                            .set("Rotation", 0.0f)
                            .id(),
                        "BSDF", scene::SocketKind::Shader));
        stage.quad({}, {50, 0, 0}, {0, 50, 0}, stage.shader(std::move(g)));
        const float r = float(c[1]), at = 3 / std::sqrt(2.0f);
        Light& l = stage.light(LightType::Point, float(4 * M_PI * M_PI) * r * r, {at, 0, at});
        l.radius = r;
        l.soft_falloff = false;
        stage.look({}, {1, 0, -1}, 0.01f, 1e-4f);
        expect_render(stage, c[2], "alpha " + std::to_string(c[0]) + ", radius " + std::to_string(c[1]), 0.001);
    }
}

}  // namespace
}  // namespace talbot
