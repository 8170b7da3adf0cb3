/// Emission that varies: samples of lamps, meshes and worlds run the shader's program at the point they found.
#include <gtest/gtest.h>

#include "fixture.h"
#include "shader/compiler.h"
#include "support/graph_builder.h"

namespace talbot::light::test {
namespace {

using scene::LightType;
using scene::SocketKind;

/// A shader whose emission is the position (a direction for worlds and suns) times `strength`.
scene::Shader position_shader(const char* node, const char* output, float strength) {
    talbot::test::GraphBuilder g;
    const talbot::test::Socket at = g.position();
    g.surface(g.out(g.node(node).link("Color", SocketKind::Color, at).set("Strength", strength).id(), output, SocketKind::Shader));
    return g.shader;
}

void compile_and_build(Fixture& f) {
    f.programs = shader::compile_shaders(f.scene, f.tables, f.report);
    f.build();
}

void expect_positions(Fixture& f, Stratum stratum, Vec3 p, float factor, const char* name) {
    int found = 0;
    sample_many(f, stratum, p, 1024, [&](const Samples& s, int n) {
        for (int i = 0; i < n; ++i) {
            if (s.pdf[i] <= 0) continue;
            ++found;
            const Vec3 at = stratum == Stratum::Distant ? s.wi(i) : p + s.wi(i) * s.distance[i];
            const float scale = s.is_delta[i] && stratum == Stratum::Local ? factor / (s.distance[i] * s.distance[i]) : factor;
            const Rgb radiance = s.radiance(i);
            EXPECT_NEAR(radiance.x, at.x * scale, 2e-3f * scale) << name;
            EXPECT_NEAR(radiance.y, at.y * scale, 2e-3f * scale) << name;
            EXPECT_NEAR(radiance.z, at.z * scale, 2e-3f * scale) << name;
        }
    });
    EXPECT_GT(found, 900) << name;
}

TEST(Programs, Lamps) {
    for (LightType type : {LightType::Point, LightType::Area}) {
        for (float radius : {0.0f, 0.5f}) {
            Fixture f;
            f.scene.shaders.push_back(position_shader("ShaderNodeEmission", "Emission", 2));
            scene::Light& l = f.add_light(type, 4 * kPi, {1, 2, 3});
            l.radius = radius;
            l.shader = 0;
            compile_and_build(f);
            ASSERT_TRUE(f.table->view.has_lamp_programs);
            const float factor = type == LightType::Area ? 8 : radius > 0 ? 2 / (kPi * radius * radius) : 2;
            expect_positions(f, Stratum::Local, {0, 0, 0}, factor, type == LightType::Area ? "area" : "point");
            if (type == LightType::Point && radius == 0) continue;
            // The same seen by a ray.
            const Vec3 d = normalize(Vec3{1, 2, 3});
            const Met met = meet(f, {}, d);
            EXPECT_NEAR(met.radiance, double(factor) * met.distance * double(d.x), 1e-2 * double(factor));
        }
    }
}

TEST(Programs, SunsAndWorlds) {
    Fixture sun;
    sun.scene.shaders.push_back(position_shader("ShaderNodeEmission", "Emission", 2));
    scene::Light& l = sun.add_light(LightType::Sun, 3, {});
    l.shader = 0;
    l.to_world = look_at({1, 2, 3}, {});
    compile_and_build(sun);
    expect_positions(sun, Stratum::Distant, {5, 0, 0}, 6, "sun");

    Fixture sky;
    sky.scene.shaders.push_back(position_shader("ShaderNodeBackground", "Background", 2));
    sky.scene.world.shader = 0;
    compile_and_build(sky);
    EXPECT_TRUE(sky.table->summary.has_distant);
    EXPECT_FALSE(sky.table->summary.world_is_constant);
    expect_positions(sky, Stratum::Distant, {5, 0, 0}, 2, "world");
    sample_many(sky, Stratum::Distant, {}, 512, [&](const Samples& s, int n) {
        for (int i = 0; i < n; ++i) {
            float w[3] = {s.wx[i], s.wy[i], s.wz[i]}, pdf = 0;
            pdf_background(*sky.table, {w, w + 1, w + 2}, nullptr, 1, &pdf);
            EXPECT_NEAR(pdf, s.pdf[i], 0.1f * s.pdf[i]) << "a neighbouring cell at most";
        }
    });
}

/// The sun's disc in a Sky Texture is drawn by samples of its own, and their density integrates to the disc's part.
TEST(Programs, SkyWithSun) {
    Fixture sky;
    talbot::test::GraphBuilder g;
    const auto texture = g.node("ShaderNodeTexSky").text("sky_type", "MULTIPLE_SCATTERING").number("sun_elevation", 0.9).number("sun_rotation", 0.7);
    const auto color = g.out(texture.id(), "Color", SocketKind::Color);
    g.surface(g.out(g.node("ShaderNodeBackground").link("Color", SocketKind::Color, color).set("Strength", 1).id(), "Background", SocketKind::Shader));
    sky.scene.shaders.push_back(g.shader);
    sky.scene.world.shader = 0;
    compile_and_build(sky);
    const WorldMap& map = sky.table->view.world;
    ASSERT_GT(map.sun_share, 0.3f);
    const Vec3 sun{std::cos(0.9f) * std::sin(0.7f), std::cos(0.9f) * std::cos(0.7f), std::sin(0.9f)};
    int hits = 0, count = 0;
    double irradiance = 0, squares = 0;
    sample_many(sky, Stratum::Distant, {}, 1 << 14, [&](const Samples& s, int n) {
        for (int i = 0; i < n; ++i) {
            ++count;
            const Vec3 chord = s.wi(i) - sun;
            const bool inside = std::sqrt(dot(chord, chord)) < 0.00475f;
            hits += inside;
            if (!(s.pdf[i] > 0)) continue;
            float w[3] = {s.wx[i], s.wy[i], s.wz[i]}, pdf = 0;
            pdf_background(*sky.table, {w, w + 1, w + 2}, nullptr, 1, &pdf);
            if (inside) {
                EXPECT_NEAR(pdf, s.pdf[i], 1e-3f * s.pdf[i]);
            }
            const double x = double(s.r[i]) * double(std::max(s.wi(i).z, 0.0f)) / double(s.pdf[i]);
            irradiance += x;
            squares += x * x;
        }
    });
    EXPECT_NEAR(double(hits) / count, double(map.sun_share), 0.02);
    // Few lights are this even: without the disc's samples the deviation is dozens of times the mean.
    const double mean = irradiance / count, deviation = std::sqrt(squares / count - mean * mean);
    EXPECT_LT(deviation, 0.6 * mean);
}

TEST(Programs, Meshes) {
    Fixture f;
    f.scene.shaders.push_back(position_shader("ShaderNodeEmission", "Emission", 2));
    // A rectangle, but not of one colour: by triangles.
    f.add_mesh({{-1, -1, 2}, {1, -1, 2}, {1, 1, 2}, {-1, 1, 2}}, {0, 1, 2, 0, 2, 3}, 0);
    compile_and_build(f);
    EXPECT_TRUE(f.table->rects.empty());
    expect_positions(f, Stratum::Local, {0.1f, 0, 0}, 2, "near mesh");
    expect_positions(f, Stratum::Local, {1, 2, -30}, 2, "far mesh");
}

}  // namespace
}  // namespace talbot::light::test
