/// Light and shadow linking in whole renders: what lights what, in closed form, for light samples and for rays that find the emitter.

#include <gtest/gtest.h>

#include <cmath>

#include "support/objects.h"
#include "support/render.h"
#include "support/scenes.h"

namespace talbot {
namespace {

constexpr float kAlbedo = 0.8f;

/// Two floors, left and right of x = 0, seen from 2 m above; each pixel of the 2 x 1 picture shows a square metre of one.
scene::Scene two_floors(int bounces) {
    scene::Scene scene;
    tests::plain_settings(scene, 2, 1, 4096);
    scene.settings.version = 500;
    scene.settings.max_bounces = scene.settings.diffuse_bounces = bounces;
    scene.camera.type = scene::CameraType::Orthographic;
    scene.camera.to_world.m[2][3] = 2;
    scene.camera.view[0] = -1, scene.camera.view[1] = 1, scene.camera.view[2] = -0.5f, scene.camera.view[3] = 0.5f;
    const scene::Handle grey = tests::add_shader(scene, tests::one_node("BsdfDiffuse", {kAlbedo, kAlbedo, kAlbedo}));
    tests::add_object(scene, tests::add_quads(scene, {{-2, -2, 0}, {0, -2, 0}, {0, 2, 0}, {-2, 2, 0}}), grey);
    tests::add_object(scene, tests::add_quads(scene, {{0, -2, 0}, {2, -2, 0}, {2, 2, 0}, {0, 2, 0}}), grey);
    scene.traits[1].receiver_set = 1;
    return scene;
}

scene::Light sun(float power, float angle) {
    scene::Light light;
    light.type = scene::LightType::Sun;
    light.power = power;
    light.sun_angle = angle;
    return light;
}

/// Shines downwards on both floors alike.
scene::Light panel(float power, bool use_mis = true) {
    scene::Light light;
    light.type = scene::LightType::Area;
    light.power = power;
    light.size_x = 1;
    light.to_world.m[2][3] = 1.5f;
    light.use_mis = use_mis;
    return light;
}

struct Floors {
    double left = 0, right = 0;
};
Floors render(scene::Scene scene) {
    scene.settings.threads = 1;
    const std::vector<float> pixels = tests::rendered(std::move(scene));
    return {double(pixels[0]), double(pixels[4])};
}

TEST(Links, SunsLightTheirReceiversOnly) {
    for (float angle : {0.0f, 0.5f}) {
        scene::Scene scene = two_floors(0);
        scene.lights = {sun(1, angle), sun(2, angle), sun(4, angle)};
        scene.lights[0].linking.receivers = 1;
        scene.lights[1].linking.receivers = 2;
        const Floors floors = render(scene);
        EXPECT_NEAR(floors.left, 5 * double(kAlbedo) / M_PI, 0.005);
        EXPECT_NEAR(floors.right, 6 * double(kAlbedo) / M_PI, 0.005);
    }
}

TEST(Links, AFloorThatNothingLightsIsBlack) {
    scene::Scene scene = two_floors(2);
    scene.lights = {sun(1, 0.5f), panel(10)};
    for (scene::Light& light : scene.lights) light.linking.receivers = 1;
    const Floors floors = render(scene);
    EXPECT_GT(floors.left, 0.1);
    EXPECT_EQ(floors.right, 0);
}

/// The sums of linked lamps are those of one lamp alone on each side, whichever way light is found.
TEST(Links, LampsAndMeshesAreAsIfAlone) {
    const auto glow = [](scene::Scene& scene, float strength, float y, uint64_t receivers) {
        const scene::Handle shader = tests::add_shader(scene, tests::one_node("Emission", {strength, strength, strength}));
        // Faces down; two triangles that are no rectangle.
        tests::add_object(scene, tests::add_quads(scene, {{-0.5f, y - 0.3f, 0.8f}, {-0.5f, y + 0.4f, 0.8f}, {0.5f, y + 0.2f, 0.8f}, {0.5f, y - 0.3f, 0.8f}}),
                          shader);
        scene.traits.back().visibility &= ~uint32_t(scene::kVisibleCamera | scene::kVisibleShadow);
        scene.traits.back().linking = scene::Handle(scene.linkings.size());
        scene.linkings.push_back({receivers, -1});
    };
    for (const bool sampled : {true, false}) {
        scene::Scene left = two_floors(1), right = two_floors(1), both = two_floors(1);
        for (scene::Scene* scene : {&left, &right, &both}) scene->settings.use_emission_sampling = sampled;
        glow(left, 3, -0.5f, ~uint64_t(0));
        glow(right, 5, 0.5f, ~uint64_t(0));
        glow(both, 3, -0.5f, 1);
        glow(both, 5, 0.5f, 2);
        left.lights = {panel(3, false)};  // the meshes are in the way of rays

        right.lights = {panel(7, false)};
        both.lights = {panel(3, false), panel(7, false)};
        both.lights[0].linking.receivers = 1;
        both.lights[1].linking.receivers = 2;
        const Floors linked = render(both);
        EXPECT_NEAR(linked.left / render(left).left, 1, 0.02) << sampled;
        EXPECT_NEAR(linked.right / render(right).right, 1, 0.02) << sampled;
    }
}

/// A roof between lamp and floors casts a shadow only for lamps that it blocks.
TEST(Links, ShadowsOfChosenBlockersOnly) {
    for (const bool glass : {false, true}) {
        scene::Scene open = two_floors(1);
        open.lights = {panel(5)};
        scene::Scene covered = open;
        const scene::Handle roof =
            tests::add_shader(covered, glass ? tests::one_node("BsdfTransparent", {0.25f, 0.25f, 0.25f}) : tests::one_node("BsdfDiffuse", {}));
        tests::add_object(covered, tests::add_quads(covered, {{-2, -2, 1}, {2, -2, 1}, {2, 2, 1}, {-2, 2, 1}}), roof);
        covered.traits.back().visibility &= ~uint32_t(scene::kVisibleCamera);
        const double whole = render(open).left, part = glass ? 0.25 : 0.0;
        EXPECT_NEAR(render(covered).left, part * whole, 0.01 * whole) << glass;

        scene::Scene linked = covered;
        linked.lights[0].linking.blockers = 40;
        linked.traits.back().blocks = scene::kChosenOrNot;
        EXPECT_NEAR(render(linked).left, whole, 0.02 * whole) << "none of the objects blocks";
        linked.traits.back().blocks |= uint64_t(1) << 39;
        EXPECT_NEAR(render(linked).left, whole, 0.02 * whole) << "another group";
        linked.traits.back().blocks |= uint64_t(1) << 40;
        EXPECT_NEAR(render(linked).left, part * whole, 0.01 * whole) << glass;
        // An instance is asked by its own mask: the mesh is now used twice, the second time out of the way.
        tests::place(linked, linked.traits.back());
        linked.objects.back().to_world.m[0][3] = 100;
        linked.traits.back().blocks = 0;
        EXPECT_NEAR(render(linked).left, part * whole, 0.01 * whole) << glass;
        std::swap(linked.traits[2].blocks, linked.traits[3].blocks);
        EXPECT_NEAR(render(linked).left, whole, 0.02 * whole) << glass;
    }
}

TEST(Links, EmissiveMeshesHaveBlockersToo) {
    scene::Scene open = two_floors(1);
    const scene::Handle shader = tests::add_shader(open, tests::one_node("Emission", {3, 3, 3}));
    tests::add_object(open, tests::add_quads(open, {{-0.5f, -0.5f, 1.5f}, {-0.5f, 0.5f, 1.5f}, {0.5f, 0.5f, 1.5f}, {0.5f, -0.5f, 1.5f}}), shader);
    open.traits.back().visibility &= ~uint32_t(scene::kVisibleCamera);
    scene::Scene linked = open;
    const scene::Handle roof = tests::add_shader(linked, tests::one_node("BsdfDiffuse", {0, 0, 0}));
    tests::add_object(linked, tests::add_quads(linked, {{-2, -2, 1}, {2, -2, 1}, {2, 2, 1}, {-2, 2, 1}}), roof);
    linked.traits.back().visibility &= ~uint32_t(scene::kVisibleCamera);
    EXPECT_EQ(render(linked).left, 0);
    linked.traits[2].linking = 0;
    linked.linkings = {{~uint64_t(0), 0}};
    linked.traits[3].blocks = scene::kChosenOrNot;
    EXPECT_NEAR(render(linked).left / render(open).left, 1, 0.02);
}

/// What a mirror shows of linked emitters is hidden by their blockers, and, as in Cycles, by what no blockers are chosen with regard to.
TEST(Links, MirrorsSeeByTheBlockers) {
    const auto scene_of = [](int kind, bool roof) {
        scene::Scene scene = two_floors(1);
        scene.material_sets[0] = {tests::add_shader(scene, tests::one_node("BsdfGlossy", {0.8f, 0.8f, 0.8f}))};
        if (kind == 0) scene.lights = {panel(5)};
        if (kind == 1) scene.lights = {sun(5, 1.0f)};
        if (kind == 2) {
            const scene::Handle glow = tests::add_shader(scene, tests::one_node("Emission", {3, 3, 3}));
            tests::add_object(scene, tests::add_quads(scene, {{-9, -9, 1.5f}, {-9, 9, 1.5f}, {9, 9, 1.5f}, {9, -9, 1.5f}}), glow);
            scene.traits.back().visibility &= ~uint32_t(scene::kVisibleCamera);
            scene.traits.back().linking = 0;
            scene.linkings = {{~uint64_t(0), 3}};
        } else {
            scene.lights[0].linking.blockers = 3;
            scene.lights[0].visibility &= ~uint32_t(scene::kVisibleCamera);
        }
        if (roof) {
            const scene::Handle black = tests::add_shader(scene, tests::one_node("BsdfDiffuse", {0, 0, 0}));
            tests::add_object(scene, tests::add_quads(scene, {{-9, -9, 1}, {-9, 9, 1}, {9, 9, 1}, {9, -9, 1}}), black);
            scene.traits.back().visibility &= ~uint32_t(scene::kVisibleCamera);
        }
        return scene;
    };
    for (int kind = 0; kind < 3; ++kind) {
        const double whole = render(scene_of(kind, false)).left;
        EXPECT_GT(whole, 0) << kind;
        scene::Scene roofed = scene_of(kind, true);
        EXPECT_EQ(render(roofed).left, 0) << kind << ": nothing is said of the roof";
        roofed.traits.back().blocks = scene::kChosenOrNot;
        EXPECT_NEAR(render(roofed).left / whole, 1, 0.01) << kind << ": it is no blocker";
        roofed.traits.back().blocks |= uint64_t(1) << 3;
        EXPECT_EQ(render(roofed).left, 0) << kind << ": it is one";
    }
}

}  // namespace
}  // namespace talbot
