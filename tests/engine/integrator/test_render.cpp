/// The loop as a whole: the same bits for any number of threads and any instruction set, closed boxes, and what bad input does.

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <thread>

#include "base/cpu.h"
#include "session/session.h"
#include "support/graph_builder.h"
#include "support/render.h"
#include "support/scenes.h"

namespace talbot {
namespace {

std::vector<float> render(scene::Scene scene, int threads, const std::string& isa = {}) {
    scene.settings.threads = threads;
    scene.settings.instruction_set = isa;
    return tests::rendered(std::move(scene));
}

double mean_of(const std::vector<float>& rgba) {
    double sum = 0;
    for (size_t i = 0; i < rgba.size(); i += 4) sum += double(rgba[i]) + rgba[i + 1] + rgba[i + 2];
    return sum / (double(rgba.size()) / 4 * 3);
}

TEST(Render, SameBitsForAnyNumberOfThreads) {
    const scene::Scene scene = tests::box_with_lamp();
    const std::vector<float> one = render(scene, 1);
    for (int threads : {2, 3, 5}) EXPECT_EQ(one, render(scene, threads)) << threads << " threads";
}

TEST(Render, EveryInstructionSetGivesTheSameBits) {
    const scene::Scene scene = tests::box_with_lamp();
    const std::vector<float> first = render(scene, 2, compiled_isas()[0]);
    EXPECT_GT(mean_of(first), 0.01);
    for (const char* isa : compiled_isas())
        if (machine_runs(isa)) EXPECT_EQ(first, render(scene, 2, isa)) << isa;
}

/// A closed box of emission 1 and albedo 1/2: each bounce adds half of the one before.
TEST(Render, FurnaceBoxByBounces) {
    const double expected[] = {1.5, 1.75, 1.875, 1.9375};
    for (int bounces = 0; bounces < 4; ++bounces) {
        scene::Scene scene = tests::furnace_box(0.5f, 1.0f);
        scene.settings.max_bounces = scene.settings.diffuse_bounces = bounces;
        EXPECT_NEAR(mean_of(render(scene, 2)), expected[bounces], expected[bounces] * 2e-3) << bounces << " bounces";
    }
}

TEST(Render, CancelsQuicklyAtAnyMoment) {
    for (int delay : {0, 1, 5, 20, 60}) {
        scene::Scene scene = tests::box_with_lamp();
        scene.settings.samples = 1 << 20;
        Session session;
        session.edit() = scene;
        session.start();
        session.wait(delay);
        session.cancel();
        EXPECT_TRUE(session.wait(200)) << delay << " ms";
        EXPECT_EQ(session.progress().state, SessionState::Cancelled);
    }
}

TEST(Render, EmptySceneIsBlack) {
    scene::Scene scene;
    scene.settings.width = scene.settings.height = 8;
    scene.settings.samples = 2;
    EXPECT_EQ(mean_of(render(scene, 1)), 0.0);
}

TEST(Render, NoPixelsIsAnError) {
    Session session;
    session.edit().settings.width = 0;
    session.start();
    while (!session.wait(1000)) {
    }
    EXPECT_EQ(session.progress().state, SessionState::Failed);
    EXPECT_NE(session.error().find("no pixels"), std::string::npos);
}

TEST(Render, NothingIsNotANumber) {
    scene::Scene scene = tests::box_with_lamp();
    scene.objects[0].to_world.m[0][0] = std::nanf("");
    for (float value : render(scene, 2)) ASSERT_TRUE(std::isfinite(value));
}

/// A mirror of one percent over something clear, before a bright wall: 64 samples of a pixel would meet it half a time if it were drawn by its strength.
TEST(Render, RareLobesBeforeTheCameraAreNoNoise) {
    constexpr float kMirror = 0.01f, kWall = 100;
    scene::Scene scene;
    tests::plain_settings(scene, 16, 16, 64);
    scene.settings.max_bounces = scene.settings.glossy_bounces = 2;
    scene.camera.to_world.m[2][3] = 2;
    test::GraphBuilder pane;
    const int glossy = pane.node("ShaderNodeBsdfGlossy").color("Color", {kMirror, kMirror, kMirror}).set("Roughness", 0.0f).id();
    pane.surface(pane.add(pane.out(glossy, "BSDF", scene::SocketKind::Shader), pane.transparent({0.9f, 0.9f, 0.9f})));
    scene.shaders.push_back(pane.shader);
    tests::add_object(scene, tests::add_quads(scene, {{-9, -9, 0}, {9, -9, 0}, {9, 9, 0}, {-9, 9, 0}}), 0);
    const scene::Handle wall = tests::add_shader(scene, tests::one_node("Emission", {kWall, kWall, kWall}));
    tests::add_object(scene, tests::add_quads(scene, {{-99, -99, 9}, {99, -99, 9}, {99, 99, 9}, {-99, 99, 9}}), wall);
    double squares = 0;
    const std::vector<float> pixels = render(scene, 1);
    EXPECT_NEAR(mean_of(pixels), double(kMirror * kWall), 0.02);
    for (size_t i = 0; i < pixels.size(); i += 4) squares += std::pow(double(pixels[i]) - double(kMirror * kWall), 2);
    EXPECT_LT(std::sqrt(squares / (double(pixels.size()) / 4)), 0.2);
}

/// A dielectric of the air's index over diffuse: what its lobe draws is worth nothing to it, but the other scatters there.
TEST(Render, LobesThatReflectNothingTakeNothingFromOthers) {
    scene::Scene scene = tests::furnace_box(0.5f, 1.0f);
    scene.settings.version = 500;
    scene.settings.max_bounces = scene.settings.diffuse_bounces = scene.settings.glossy_bounces = 1;
    test::GraphBuilder wall;
    const int principled = wall.node("ShaderNodeBsdfPrincipled").color("Base Color", {0.5f, 0.5f, 0.5f}).set("Roughness", 1.0f).set("IOR", 1.0f).id();
    wall.surface(wall.add(wall.out(principled, "BSDF", scene::SocketKind::Shader), wall.emission({1, 1, 1}, 1.0f)));
    scene.shaders[0] = wall.shader;
    EXPECT_NEAR(mean_of(render(scene, 2)), 1.75, 1.75 * 2e-3);
}

}  // namespace
}  // namespace talbot
