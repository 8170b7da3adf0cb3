/// Rays that a node sends: a glowing wall before the camera tells what its rays meet, by the colour it shows.

#include <gtest/gtest.h>

#include "support/graph_builder.h"
#include "support/render.h"
#include "support/scenes.h"

namespace talbot {
namespace {

using scene::SocketKind;

/// Two walls of one object, 2 and 5 m before the camera, and a screen of another, 1 m behind it.
struct Room {
    scene::Scene scene;

    explicit Room(test::GraphBuilder&& graph) {
        tests::plain_settings(scene, 8, 8, 1);
        scene.settings.version = 502;
        scene.shaders.push_back(graph.shader);
        const auto wall = [](float z, float r) { return std::vector<Vec3>{{-r, -r, z}, {r, -r, z}, {r, r, z}, {-r, r, z}}; };
        std::vector<Vec3> walls = wall(-2, 9), far = wall(-5, 9);
        walls.insert(walls.end(), far.begin(), far.end());
        tests::add_object(scene, tests::add_quads(scene, walls), 0);
        tests::add_object(scene, tests::add_quads(scene, wall(1, 9)), tests::add_shader(scene, tests::one_node("BsdfDiffuse", {0, 0, 0})));
    }
    /// The middle of the picture.
    Vec3 color() const {
        const std::vector<float> pixels = tests::rendered(scene);
        const float* p = &pixels[4 * (4 * 8 + 4)];
        return {p[0], p[1], p[2]};
    }
};

struct Ray {
    float length = 10;
    bool only_local = false;
    bool backwards = false;  ///< away from the viewer instead of along the normal
};

Vec3 seen(const char* output, SocketKind kind, const Ray& ray) {
    test::GraphBuilder g;
    test::NodeBuilder node = g.node("ShaderNodeRaycast").set("Length", ray.length).number("only_local", ray.only_local);
    if (ray.backwards) node.link("Direction", SocketKind::Vector, g.xyz({0, 0, -1}));
    g.surface(g.emission(g.out(node.id(), output, kind)));
    return Room(std::move(g)).color();
}

TEST(Raycast, MeetsWhatIsThere) {
    EXPECT_EQ(seen("Is Hit", SocketKind::Float, {}).x, 1);
    EXPECT_EQ(seen("Self Hit", SocketKind::Float, {}).x, 0);
    EXPECT_NEAR(seen("Hit Distance", SocketKind::Float, {}).x, 3, 1e-5);
    EXPECT_NEAR(seen("Hit Position", SocketKind::Vector, {}).z, 1, 1e-5);
    EXPECT_NEAR(seen("Hit Normal", SocketKind::Vector, {}).z, 1, 1e-6);
}

TEST(Raycast, MeetsItsOwnObjectElsewhere) {
    EXPECT_EQ(seen("Self Hit", SocketKind::Float, {.backwards = true}).x, 1);
    EXPECT_NEAR(seen("Hit Distance", SocketKind::Float, {.only_local = true, .backwards = true}).x, 3, 1e-5);
}

TEST(Raycast, WithoutAHitTheDistanceIsTheLength) {
    for (const Ray& ray : {Ray{.length = 2.5f}, Ray{.length = 7, .only_local = true}}) {
        EXPECT_EQ(seen("Is Hit", SocketKind::Float, ray).x, 0);
        EXPECT_EQ(seen("Hit Distance", SocketKind::Float, ray).x, ray.length);
        EXPECT_EQ(seen("Hit Position", SocketKind::Vector, ray).z, 0);
    }
    EXPECT_EQ(seen("Is Hit", SocketKind::Float, {.length = -1}).x, 0);
}

TEST(Raycast, ReadsAttributesWhereItEnds) {
    for (const auto& [kind, expected] : {std::pair{SocketKind::Color, Vec3{0.25f, 0.5f, 3.0f}}, std::pair{SocketKind::Float, Vec3{1.25f, 1.25f, 1.25f}}}) {
        test::GraphBuilder g;
        test::NodeBuilder node = g.node("ShaderNodeRaycast").set("Length", 10.0f).text("attribute_7", "Paint");
        g.surface(g.emission(g.out(node.id(), "Attribute_7", kind)));
        Room room(std::move(g));
        EXPECT_EQ(room.color().x, 0) << "nothing has it";
        auto screen = std::make_shared<scene::Mesh>(*room.scene.meshes[1]);
        screen->attributes.push_back({"Paint", scene::Domain::Triangle, 3, true, {0.25f, 0.5f, 3.0f, 0.25f, 0.5f, 3.0f}});
        room.scene.meshes[1] = screen;
        const Vec3 seen = room.color();
        EXPECT_NEAR(seen.x, expected.x, 1e-6);
        EXPECT_NEAR(seen.y, expected.y, 1e-6);
        EXPECT_NEAR(seen.z, expected.z, 1e-6);
    }
}

TEST(Raycast, ObjectsMayBeLeftOut) {
    test::GraphBuilder g;
    g.surface(g.emission(g.out(g.node("ShaderNodeRaycast").set("Length", 10.0f).id(), "Is Hit", SocketKind::Float)));
    Room room(std::move(g));
    room.scene.traits[1].visibility &= ~uint32_t(scene::kVisibleRaycast);
    EXPECT_EQ(room.color().x, 0);
}

}  // namespace
}  // namespace talbot
