/// Whole renders against closed forms. Each case is rendered in sixteen independently scrambled batches and passes when two one-sided
/// t-tests bound its error by the tolerance (equivalence, so that too few samples fail) and a two-sided test does not find a bias.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <map>

#include "session/session.h"
#include "support/graph_builder.h"

namespace talbot {
namespace {

using scene::AreaShape;
using scene::Light;
using scene::LightType;
using test::GraphBuilder;

constexpr int kBatches = 16;
constexpr double kEquivalence = 3.733;  ///< one-sided 0.1 % point of Student's t with 15 degrees of freedom
constexpr double kBias = 6.2;           ///< two-sided point of a family of 50 tests at 0.1 % together
constexpr double kRounding = 2e-4;      ///< single precision, and facets of what should be round
constexpr float kDegree = kPi / 180;

/// A scene that is looked at through a few pixels.
struct Stage {
    scene::Scene scene;

    explicit Stage(int samples = 256, int version = 502) {
        scene::Settings& s = scene.settings;
        s.version = version;
        s.width = s.height = 4;
        s.samples = samples;
        s.filter = scene::PixelFilter::Box;
        s.clamp_direct = s.clamp_indirect = s.light_threshold = s.filter_glossy = 0;
        s.max_bounces = s.diffuse_bounces = s.glossy_bounces = s.transmission_bounces = 0;
        s.threads = 2;
    }
    int shader(GraphBuilder&& graph) {
        scene.shaders.push_back(graph.shader);
        return int(scene.shaders.size()) - 1;
    }
    int diffuse(float albedo) {
        GraphBuilder g;
        g.surface(g.diffuse({albedo, albedo, albedo}));
        return shader(std::move(g));
    }
    int emitter(float radiance) {
        GraphBuilder g;
        g.surface(g.emission({1, 1, 1}, radiance));
        return shader(std::move(g));
    }
    int glowing(float albedo, float radiance) {
        GraphBuilder g;
        g.surface(g.add(g.diffuse({albedo, albedo, albedo}), g.emission({1, 1, 1}, radiance)));
        return shader(std::move(g));
    }
    void world(float radiance) {
        GraphBuilder g;
        g.surface(g.out(g.node("ShaderNodeBackground").color("Color", {1, 1, 1}).set("Strength", radiance).id(), "Background", scene::SocketKind::Shader));
        scene.world.shader = shader(std::move(g));
    }
    void mesh(const std::vector<Vec3>& positions, const std::vector<uint32_t>& triangles, int material, Vec3 at = {}, float scale = 1) {
        auto mesh = std::make_shared<scene::Mesh>();
        mesh->positions = positions;
        mesh->triangle_vertices = triangles;
        mesh->triangle_smooth.assign(triangles.size() / 3, 0);
        scene.meshes.push_back(mesh);
        scene.material_sets.push_back({material});
        scene::Object object;
        object.mesh = int(scene.meshes.size()) - 1;
        object.material_set = int(scene.material_sets.size()) - 1;
        const float t[3] = {at.x, at.y, at.z};
        for (int r = 0; r < 3; ++r) {
            object.to_world.m[r][r] = scale;
            object.to_world.m[r][3] = t[r];
        }
        scene.objects.push_back(object);
    }
    void quad(Vec3 center, Vec3 x, Vec3 y, int material) {
        mesh({center - x - y, center + x - y, center + x + y, center - x + y}, {0, 1, 2, 0, 2, 3}, material);
    }
    void floor(float albedo = 1) { quad({}, {50, 0, 0}, {0, 50, 0}, diffuse(albedo)); }
    Light& light(LightType type, float power, Vec3 at) {
        Light l;
        l.type = type;
        l.power = power;
        l.to_world.m[0][3] = at.x;
        l.to_world.m[1][3] = at.y;
        l.to_world.m[2][3] = at.z;
        scene.lights.push_back(l);
        return scene.lights.back();
    }
    /// Parallel rays along `direction` that meet `target` after `distance`, in a square of `size`.
    void look(Vec3 target, Vec3 direction, float distance = 0.01f, float size = 1e-3f) {
        const Vec3 z = -normalize(direction);
        Vec3 x, y;
        make_basis(z, x, y);
        const Vec3 c[4] = {x, y, z, target + z * distance};
        scene::Camera& camera = scene.camera;
        camera.type = scene::CameraType::Orthographic;
        camera.clip_start = 1e-4f;
        for (int k = 0; k < 4; ++k) {
            camera.to_world.m[0][k] = c[k].x;
            camera.to_world.m[1][k] = c[k].y;
            camera.to_world.m[2][k] = c[k].z;
        }
        camera.view[0] = camera.view[2] = -size / 2;
        camera.view[1] = camera.view[3] = size / 2;
    }
    void bounces(int n) {
        scene::Settings& s = scene.settings;
        s.max_bounces = s.diffuse_bounces = s.glossy_bounces = s.transmission_bounces = n;
    }
};

/// Mean and standard error over the batches, of one channel.
struct Estimate {
    double mean = 0, error = 0;
};
Estimate render(const Stage& stage, int channel = 0) {
    Session session;
    session.edit() = stage.scene;
    double sum = 0, squares = 0;
    for (int b = 0; b < kBatches; ++b) {
        session.edit().settings.seed = uint32_t(1000 + b);
        session.edit().dirty |= scene::kDirtySettings;
        session.start();
        while (!session.wait(1000)) {
        }
        EXPECT_EQ(session.progress().state, SessionState::Done) << session.error();
        std::vector<float> pixels;
        EXPECT_TRUE(session.read_pass(scene::PassKind::Combined, pixels));
        double mean = 0;
        for (size_t i = size_t(channel); i < pixels.size(); i += 4) {
            EXPECT_TRUE(std::isfinite(pixels[i]));
            mean += double(pixels[i]);
        }
        mean /= double(pixels.size()) / 4;
        sum += mean;
        squares += mean * mean;
    }
    const double m = sum / kBatches;
    return {m, std::sqrt(std::max(squares / kBatches - m * m, 0.0) / (kBatches - 1))};
}

/// `tolerance` relative to `expected`.
void expect_render(const Stage& stage, double expected, const std::string& name, double tolerance = 0.005, int channel = 0) {
    const Estimate e = render(stage, channel);
    const double off = std::abs(e.mean - expected);
    EXPECT_LT(off + kEquivalence * e.error, tolerance * std::abs(expected)) << name << ": " << e.mean << " +- " << e.error << ", not " << expected;
    EXPECT_LT(off, kBias * e.error + kRounding * std::abs(expected)) << name << ": biased, " << e.mean << " +- " << e.error << ", not " << expected;
}

std::vector<Vec3> cube_corners() {
    std::vector<Vec3> p;
    for (int k = 0; k < 8; ++k) p.push_back({k & 1 ? 1.0f : -1.0f, k & 2 ? 1.0f : -1.0f, k & 4 ? 1.0f : -1.0f});
    return p;
}
const std::vector<uint32_t> kCube{0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4, 2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5};

/// Octahedron, each face split `levels` times, on the unit sphere.
void make_sphere(int levels, std::vector<Vec3>& positions, std::vector<uint32_t>& triangles) {
    positions = {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}};
    triangles = {0, 2, 4, 2, 1, 4, 1, 3, 4, 3, 0, 4, 2, 0, 5, 1, 2, 5, 3, 1, 5, 0, 3, 5};
    for (int level = 0; level < levels; ++level) {
        std::map<std::pair<uint32_t, uint32_t>, uint32_t> middles;
        const auto middle = [&](uint32_t a, uint32_t b) {
            const auto [entry, is_new] = middles.try_emplace({std::min(a, b), std::max(a, b)}, uint32_t(positions.size()));
            if (is_new) positions.push_back(normalize(positions[a] + positions[b]));
            return entry->second;
        };
        std::vector<uint32_t> finer;
        for (size_t k = 0; k < triangles.size(); k += 3) {
            const uint32_t a = triangles[k], b = triangles[k + 1], c = triangles[k + 2], ab = middle(a, b), bc = middle(b, c), ca = middle(c, a);
            for (uint32_t v : {a, ab, ca, ab, b, bc, ca, bc, c, ab, bc, ca}) finer.push_back(v);
        }
        triangles = finer;
    }
}

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
    Stage deep(2048);
    deep.mesh(cube_corners(), kCube, deep.glowing(0.8f, 1));
    deep.bounces(100);
    deep.look({0.3f, 0.2f, -1}, {0, 0, -1});
    expect_render(deep, 5, "roulette does not bias", 0.005);
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
        stage.scene.objects[0].shadow_terminator_shading_offset = 0.4f;
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
    expect_render(rays, .239456470461, "scattered rays alone", 0.005);
}

TEST(ClosedForms, ParallelPlates) {
    // Infinite plates of reflectance 0.8 (emitting M = 1) and 0.3: B1 = 1 / (1 - 0.24), B2 = 0.3 B1.
    for (bool first : {true, false}) {
        Stage stage(4096);
        stage.quad({0, 0, 0}, {5000, 0, 0}, {0, 5000, 0}, stage.glowing(0.8f, 1 / kPi));
        stage.quad({0, 0, 1}, {5000, 0, 0}, {0, 5000, 0}, stage.diffuse(0.3f));
        stage.bounces(100);
        stage.look({0, 0, first ? 0.0f : 1.0f}, {0, 0, first ? -1.0f : 1.0f});
        expect_render(stage, (first ? 1.0 : 0.3) / 0.76 / M_PI, first ? "emitting plate" : "other plate", 0.005);
    }
}

TEST(ClosedForms, Spheres) {
    std::vector<Vec3> positions;
    std::vector<uint32_t> triangles;
    make_sphere(6, positions, triangles);
    // Reflectance 1/2 around a point of flux 4 pi^2: radiance 1 everywhere.
    Stage inside(2048);
    inside.mesh(positions, triangles, inside.diffuse(0.5f));
    inside.light(LightType::Point, float(4 * M_PI * M_PI), {});
    inside.bounces(100);
    inside.look({0, 0, 1}, {0.1f, 0.2f, 1}, 0.1f, 0.05f);
    expect_render(inside, 1, "sphere around a point", 0.005);

    // Concentric spheres of radius 1 (emitting M = 1) and 2, both of reflectance 1/2: B1 = 10/9, B2 = 2/9.
    for (bool inner : {true, false}) {
        Stage stage(2048);
        stage.mesh(positions, triangles, stage.glowing(0.5f, 1 / kPi));
        stage.mesh(positions, triangles, stage.diffuse(0.5f), {}, 2);
        stage.bounces(100);
        const Vec3 d{0.1f, 0.2f, inner ? -1.0f : 1.0f};
        stage.look({0, 0, inner ? 1.0f : 2.0f}, d, 0.3f, 0.05f);
        expect_render(stage, (inner ? 10.0 : 2.0) / 9 / M_PI, inner ? "inner sphere" : "outer sphere", 0.005);
    }
}

/// A world that varies: radiance = the direction's components. On a plane that faces up their cosine-weighted means over pi are 0, 0 and 2/3.
TEST(ClosedForms, VaryingWorld) {
    Stage stage(2048);
    stage.floor();
    GraphBuilder g;
    const test::Socket direction = g.position();
    g.surface(g.out(g.node("ShaderNodeBackground").link("Color", scene::SocketKind::Color, direction).set("Strength", 1.0f).id(), "Background",
                    scene::SocketKind::Shader));
    stage.scene.world.shader = stage.shader(std::move(g));
    stage.look({}, {0, 0, -1});
    expect_render(stage, 2.0 / 3, "cosine sky", 0.005, 2);
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
        expect_render(stage, c[2], "alpha " + std::to_string(c[0]) + ", radius " + std::to_string(c[1]), 0.005);
    }
}

}  // namespace
}  // namespace talbot
