/// What kernels see of a scene.

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "base/pool.h"
#include "scene/view.h"
#include "support/objects.h"
#include "support/scenes.h"

namespace talbot {
namespace {

/// A smooth triangle whose normals lean apart, once in the scene.
scene::Scene one_leaning_triangle() {
    scene::Scene scene;
    scene::Mesh mesh;
    mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    mesh.triangle_vertices = {0, 1, 2};
    mesh.vertex_normals = {{0, 0, 1}, {0.6f, 0, 0.8f}, {0, 0.6f, 0.8f}};
    scene.meshes = {std::make_shared<const scene::Mesh>(mesh)};
    scene::ObjectTraits traits;
    traits.mesh = 0;
    tests::place(scene, traits);
    return scene;
}

scene::SceneTables view_of(const scene::Scene& scene) {
    scene::SceneTables tables;
    scene::make_scene_view(scene, 0, tables);
    return tables;
}

TEST(View, UnevenScalesMakeMappedNormalsAlike) {
    scene::Scene scene = one_leaning_triangle();
    scene.objects[0].to_world.m[0][0] = 0.25f;
    scene.objects[0].to_world.m[2][2] = -2;
    const scene::SceneTables tables = view_of(scene);
    ASSERT_TRUE(tables.meshes[0].has_mapped_normals);
    for (int i = 0; i < 3; ++i) {
        const Vec3 mapped = transform_normal(tables.to_object[0], tables.meshes[0].vertex_normals[i]);
        EXPECT_NEAR(length(mapped), 1, 1e-6) << i;
        const Vec3 own = scene.meshes[0]->vertex_normals[size_t(i)];
        EXPECT_NEAR(length(cross(own, tables.meshes[0].vertex_normals[i])), 0, 1e-6) << i;
    }
}

TEST(View, OtherNormalsStay) {
    const auto stays = [](scene::Scene& scene) {
        const scene::SceneTables tables = view_of(scene);
        EXPECT_FALSE(tables.meshes[0].has_mapped_normals);
        EXPECT_EQ(tables.meshes[0].vertex_normals, scene.meshes[0]->vertex_normals.data());
    };
    scene::Scene scene = one_leaning_triangle();
    for (int i = 0; i < 3; ++i) scene.objects[0].to_world.m[i][i] = -3;
    stays(scene);  // alike in all directions
    scene.objects[0].to_world.m[0][0] = 1;
    scene.settings.viewport = true;
    stays(scene);
    scene.settings.viewport = false;
    tests::place(scene, scene.traits[0], scene.objects[0].to_world);
    stays(scene);  // used twice
    scene.traits[1].visibility = 0;
    EXPECT_TRUE(view_of(scene).meshes[0].has_mapped_normals) << "what nobody sees is no user";
    scene.motion.objects = {{Affine(), Affine()}};
    scene.motion.of_objects = {0, scene::kNone};
    stays(scene);
}

TEST(View, MappedNormalsAreMadeAnewOnlyForWhatChanged) {
    scene::Scene scene = one_leaning_triangle();
    scene.objects[0].to_world.m[0][0] = 0.25f;
    scene::SceneTables tables = view_of(scene);
    const Vec3* first = tables.meshes[0].vertex_normals;
    const Vec3 value = first[1];
    tables.mapped_normals.at(0).normals[1] = {7, 7, 7};  // seen again as long as nothing is made anew
    scene.camera.to_world.m[0][3] = 1;
    scene::make_scene_view(scene, 0, tables);
    EXPECT_EQ(tables.meshes[0].vertex_normals, first);
    EXPECT_EQ(tables.meshes[0].vertex_normals[1].x, 7);
    scene.objects[0].to_world.m[0][0] = 0.5f;
    scene::make_scene_view(scene, 0, tables);
    EXPECT_NE(tables.meshes[0].vertex_normals[1].x, 7) << "the map changed";
    scene.objects[0].to_world.m[0][0] = 0.25f;
    scene.meshes[0] = std::make_shared<const scene::Mesh>(*scene.meshes[0]);
    scene::make_scene_view(scene, 0, tables);
    EXPECT_EQ(tables.meshes[0].vertex_normals[1].x, value.x) << "another mesh";
    // With helpers the same bits; a mesh of many vertices is shared among them.
    scene::Mesh large = *scene.meshes[0];
    for (int i = 0; i < 1 << 16; ++i) large.vertex_normals.push_back(large.vertex_normals[size_t(i % 3)]);
    scene.meshes[0] = std::make_shared<const scene::Mesh>(large);
    WorkerPool pool(2);
    scene::SceneTables shared;
    scene::make_scene_view(scene, 0, shared, &pool);
    const std::vector<Vec3>&a = shared.mapped_normals.at(0).normals, b = view_of(scene).mapped_normals.at(0).normals;
    ASSERT_EQ(a.size(), b.size());
    EXPECT_EQ(std::memcmp(a.data(), b.data(), a.size() * sizeof(Vec3)), 0);
}

TEST(View, KnowsOfBlockers) {
    scene::Scene scene = one_leaning_triangle();
    EXPECT_FALSE(scene::has_blockers(scene));
    scene.lights.resize(1);
    scene.lights[0].linking.receivers = 1;
    EXPECT_FALSE(scene::has_blockers(scene));
    scene.lights[0].linking.blockers = 0;
    EXPECT_TRUE(view_of(scene).view.has_blockers);
}

}  // namespace
}  // namespace talbot
