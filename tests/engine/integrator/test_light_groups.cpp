/// Light groups: each pass holds what its emitters bring, whichever way their light is found, and together they are the picture.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "session/session.h"
#include "support/graph_builder.h"
#include "support/objects.h"
#include "support/scenes.h"

namespace talbot {
namespace {

constexpr int kSide = 16;
const std::vector<std::string> kGroups{"lamp", "panel", "sun", "far sun", "mesh", "world"};

/// A matt and a shiny wall, a lamp, a panel, two suns with discs, a glowing sheet and the world, all seen by a wide camera.
scene::Scene room(bool constant_world) {
    scene::Scene scene;
    tests::plain_settings(scene, kSide, kSide, 256);
    scene.settings.version = 500;
    scene.settings.max_bounces = scene.settings.diffuse_bounces = scene.settings.glossy_bounces = 2;
    scene.settings.threads = 2;
    scene.camera.to_world.m[2][3] = 3;
    scene.camera.view[0] = scene.camera.view[2] = -1, scene.camera.view[1] = scene.camera.view[3] = 1;
    const scene::Handle matt = tests::add_shader(scene, tests::one_node("BsdfDiffuse", {0.7f, 0.6f, 0.5f}));
    const scene::Handle shiny = tests::add_shader(scene, tests::one_node("BsdfGlossy", {0.8f, 0.8f, 0.8f}));
    const scene::Handle glow = tests::add_shader(scene, tests::one_node("Emission", {2, 1, 3}));
    tests::add_object(scene, tests::add_quads(scene, {{-2, -2, 0}, {0, -2, 0}, {0, 2, 0}, {-2, 2, 0}}), matt);
    tests::add_object(scene, tests::add_quads(scene, {{0, -2, 0}, {2, -2, 0.5f}, {2, 2, 0.5f}, {0, 2, 0}}), shiny);
    tests::add_object(scene, tests::add_quads(scene, {{-1, 1, 0.2f}, {0, 1.5f, 0.2f}, {0.2f, 1.8f, 1}, {-1, 1, 1}}), glow);
    scene.traits.back().light_group = 4;

    scene.lights.resize(4);
    scene.lights[0].radius = 0.1f;
    scene.lights[0].power = 40;
    scene.lights[0].to_world.m[0][3] = -1, scene.lights[0].to_world.m[2][3] = 1;
    scene.lights[1].type = scene::LightType::Area;
    scene.lights[1].power = 30;
    scene.lights[1].to_world.m[0][3] = 1, scene.lights[1].to_world.m[2][3] = 2;
    for (int k : {2, 3}) {
        scene.lights[size_t(k)].type = scene::LightType::Sun;
        scene.lights[size_t(k)].sun_angle = 0.4f;
        scene.lights[size_t(k)].power = float(k);
    }
    const float c = std::cos(0.7f), s = std::sin(0.7f);
    scene.lights[3].to_world = {{{1, 0, 0, 0}, {0, c, -s, 0}, {0, s, c, 0}}};
    for (size_t i = 0; i < 4; ++i) {
        scene.lights[i].visibility = scene::kVisibleAll;
        scene.lights[i].light_group = scene::Handle(i);
    }

    if (constant_world) {
        scene.world.shader = tests::add_shader(scene, tests::one_node("Background", {0.3f, 0.4f, 0.5f}));
    } else {
        test::GraphBuilder sky;
        const int size = sky.node("ShaderNodeVectorMath").text("operation", "ABSOLUTE").link("Vector", scene::SocketKind::Vector, sky.position()).id();
        const test::Socket color = sky.out(size, "Vector", scene::SocketKind::Vector);
        const int background = sky.node("ShaderNodeBackground").link("Color", scene::SocketKind::Color, color).set("Strength", 0.5f).id();
        sky.surface(sky.out(background, "Background", scene::SocketKind::Shader));
        scene.world.shader = scene::Handle(scene.shaders.size());
        scene.shaders.push_back(sky.shader);
    }
    scene.world.light_group = 5;
    scene.light_groups = kGroups;
    return scene;
}

struct Picture {
    std::vector<float> combined;             ///< RGBA
    std::vector<std::vector<float>> groups;  ///< RGB
};
Picture render(const scene::Scene& scene) {
    Session session;
    session.edit() = scene;
    session.start();
    while (!session.wait(1000)) {
    }
    EXPECT_EQ(session.progress().state, SessionState::Done) << session.error();
    Picture out;
    EXPECT_TRUE(session.read_pass(scene::PassKind::Combined, out.combined));
    for (const std::string& name : scene.light_groups) EXPECT_TRUE(session.read_light_group(name, out.groups.emplace_back()));
    EXPECT_FALSE(session.read_light_group("another", out.groups.emplace_back()));
    out.groups.pop_back();
    return out;
}

double sum(const std::vector<float>& values, size_t stride) {
    double total = 0;
    for (size_t i = 0; i < values.size(); ++i) total += i % stride < 3 ? double(values[i]) : 0;
    return total;
}

void expect_sum(const Picture& picture) {
    for (size_t p = 0; p < size_t(kSide) * kSide; ++p) {
        for (size_t c = 0; c < 3; ++c) {
            double total = 0;
            for (const std::vector<float>& group : picture.groups) total += double(group[p * 3 + c]);
            EXPECT_NEAR(total, double(picture.combined[p * 4 + c]), 1e-5 * (1 + total)) << p;
        }
    }
}

TEST(LightGroups, TogetherTheyAreThePicture) {
    for (const bool constant_world : {true, false}) {
        scene::Scene scene = room(constant_world);
        scene.settings.film_exposure = 1.5f;
        expect_sum(render(scene));
        scene.settings.clamp_direct = scene.settings.clamp_indirect = 0.2f;
        expect_sum(render(scene));
    }
}

/// With half of the probability of each choice, but the same mean.
TEST(LightGroups, EachIsAsIfItsEmittersWereAlone) {
    const scene::Scene whole = room(false);
    const Picture together = render(whole);
    for (size_t group = 0; group < kGroups.size(); ++group) {
        scene::Scene alone = whole;
        for (size_t i = 0; i < alone.lights.size(); ++i) alone.lights[i].power *= i == group ? 1.0f : 0.0f;
        if (group != 4) alone.shaders[2].graph = tests::one_node("Emission", {});
        if (group != 5) alone.world.shader = scene::kNone;
        const double expected = sum(render(alone).combined, 4);
        ASSERT_GT(expected, 10);
        EXPECT_NEAR(sum(together.groups[group], 3) / expected, 1, 0.02) << kGroups[group];
    }
}

/// Emitters with blockers of their own are found by rays of their own.
TEST(LightGroups, HoldLinkedEmittersToo) {
    scene::Scene scene = room(true);
    scene.linkings.push_back({});
    scene.linkings[0].blockers = 1;
    scene.traits[2].linking = 0;
    scene.traits[0].blocks = 2;
    for (scene::Light& light : scene.lights) light.linking.blockers = 1;
    expect_sum(render(scene));
}

TEST(LightGroups, SumsOfEmittersOfOneGroupAndOfNone) {
    scene::Scene scene = room(true);
    scene.light_groups = {"some", "empty"};
    for (scene::Light& light : scene.lights) light.light_group = 0;
    scene.traits[2].light_group = scene::kNone;
    scene.world.light_group = 7;  // of another view layer
    const Picture picture = render(scene);
    EXPECT_EQ(sum(picture.groups[1], 3), 0);
    const double some = sum(picture.groups[0], 3);
    EXPECT_GT(some, 0);
    EXPECT_LT(some, sum(picture.combined, 4));
}

/// Nothing of the picture changes by being sorted.
TEST(LightGroups, DoNotTouchThePicture) {
    scene::Scene scene = room(true);
    scene.lights.resize(2);
    const Picture with = render(scene);
    scene.light_groups.clear();
    const Picture without = render(scene);
    EXPECT_EQ(with.combined, without.combined);
}

}  // namespace
}  // namespace talbot
