/// Shadow catchers in closed form: a floor that catches, under a sun, half of it in the shadow of something the camera does not see.

#include <gtest/gtest.h>

#include "support/render.h"
#include "support/scenes.h"

namespace talbot {
namespace {

using scene::PassKind;

/// Four pixels in a row, from left to right: in full shadow, lit, behind a grey object, beyond the floor.
scene::Scene four_places() {
    scene::Scene scene;
    tests::plain_settings(scene, 4, 1, 64);
    scene.settings.version = 500;
    scene.settings.max_bounces = 0;
    scene.settings.film_transparent = true;
    scene.camera.type = scene::CameraType::Orthographic;
    scene.camera.to_world.m[2][3] = 3;
    scene.camera.view[0] = -2, scene.camera.view[1] = 2, scene.camera.view[2] = -0.5f, scene.camera.view[3] = 0.5f;
    const scene::Handle grey = tests::add_shader(scene, tests::one_node("BsdfDiffuse", {0.5f, 0.5f, 0.5f}));
    const auto quad = [&](float x0, float x1, float z) {
        tests::add_object(scene, tests::add_quads(scene, {{x0, -1, z}, {x1, -1, z}, {x1, 1, z}, {x0, 1, z}}), grey);
    };
    quad(-2, 1, 0);
    scene.traits.back().is_shadow_catcher = true;
    quad(-2, -1, 1);
    scene.traits.back().visibility &= ~uint32_t(scene::kVisibleCamera);
    quad(0, 1, 1);
    scene::Light sun;
    sun.type = scene::LightType::Sun;
    sun.power = kPi;
    scene.lights = {sun};
    return scene;
}

std::vector<float> render(scene::Scene scene, PassKind kind) {
    scene.settings.threads = 1;
    return tests::rendered(std::move(scene), kind);
}

void expect_pixels(const std::vector<float>& found, const std::vector<float>& expected, double error = 1e-4) {
    ASSERT_EQ(found.size(), expected.size());
    for (size_t i = 0; i < found.size(); ++i) EXPECT_NEAR(found[i], expected[i], error) << "pixel " << i / (found.size() / 4) << " channel " << i;
}

TEST(Catcher, TransparentFilm) {
    const std::vector<float> composed = render(four_places(), PassKind::Combined);
    expect_pixels(composed, {0, 0, 0, 1, 0, 0, 0, 0, 0.5f, 0.5f, 0.5f, 1, 0, 0, 0, 0});
}

TEST(Catcher, ItsPassBesideTheMatte) {
    scene::Scene scene = four_places();
    scene.passes = {PassKind::Combined, PassKind::ShadowCatcher};
    expect_pixels(render(scene, PassKind::ShadowCatcher), {0, 0, 0, 1, 1, 1, 1, 1, 1, 1, 1, 1});
    expect_pixels(render(scene, PassKind::Combined), {0, 0, 0, 0, 0, 0, 0, 0, 0.5f, 0.5f, 0.5f, 1, 0, 0, 0, 0});
}

/// The background shows through the catcher, as dark as its shadow.
TEST(Catcher, OverTheBackground) {
    scene::Scene scene = four_places();
    scene.settings.film_transparent = false;
    scene.world.shader = tests::add_shader(scene, tests::one_node("Background", {1, 2, 3}));
    scene.world.visibility = scene::kVisibleCamera;
    expect_pixels(render(scene, PassKind::Combined), {0, 0, 0, 1, 1, 2, 3, 1, 0.5f, 0.5f, 0.5f, 1, 1, 2, 3, 1});
}

/// A sun that is not real adds to the catcher's light; one that is does not.
TEST(Catcher, LightThatIsNotReal) {
    scene::Scene scene = four_places();
    scene.passes = {PassKind::Combined, PassKind::ShadowCatcher};
    scene.lights.push_back(scene.lights[0]);
    scene.lights[1].power = 0.5f * kPi;
    scene.lights[1].is_shadow_catcher = false;
    expect_pixels(render(scene, PassKind::ShadowCatcher), {0, 0, 0, 1.5f, 1.5f, 1.5f, 1, 1, 1, 1, 1, 1}, 0.03);
}

TEST(Catcher, WithoutCatchersThePassIsWhite) {
    scene::Scene scene = four_places();
    scene.traits[0].is_shadow_catcher = false;
    scene.passes = {PassKind::Combined, PassKind::ShadowCatcher};
    expect_pixels(render(scene, PassKind::ShadowCatcher), std::vector<float>(12, 1.0f));
}

}  // namespace
}  // namespace talbot
