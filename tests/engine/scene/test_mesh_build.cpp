#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "scene/mesh_build.h"
#include "scene/view.h"

namespace talbot::scene {
namespace {

/// Two triangles of a unit square, as Blender would send one quad.
struct Quad {
    std::vector<float> positions{0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0};
    std::vector<uint32_t> corner_vertices{0, 1, 2, 3};
    std::vector<uint32_t> triangle_corners{0, 1, 2, 0, 2, 3};
    std::vector<uint32_t> triangle_faces{0, 0};
    std::vector<int32_t> face_materials{3};
    std::vector<uint8_t> face_smooth{0};
    MeshInput input() const {
        MeshInput in;
        in.name = "Quad";
        in.positions = positions;
        in.corner_vertices = corner_vertices;
        in.triangle_corners = triangle_corners;
        in.triangle_faces = triangle_faces;
        in.face_materials = face_materials;
        in.face_smooth = face_smooth;
        return in;
    }
};

TEST(MeshBuild, SpreadsFacesOverTriangles) {
    const Quad quad;
    Report report;
    const Mesh mesh = build_mesh(quad.input(), report);
    EXPECT_EQ(mesh.triangle_vertices, (std::vector<uint32_t>{0, 1, 2, 0, 2, 3}));
    EXPECT_EQ(mesh.triangle_materials, (std::vector<uint16_t>{3, 3}));
    EXPECT_EQ(mesh.triangle_smooth, (std::vector<uint8_t>{0, 0}));
    EXPECT_TRUE(mesh.triangle_corners.empty()) << "nothing is stored a corner";
    EXPECT_TRUE(report.lines().empty());
}

TEST(MeshBuild, DropsWhatCannotBeTraced) {
    Quad quad;
    quad.positions[9] = std::numeric_limits<float>::quiet_NaN();  // vertex 3
    Report report;
    const Mesh broken = build_mesh(quad.input(), report);
    EXPECT_EQ(broken.triangle_vertices, (std::vector<uint32_t>{0, 1, 2}));
    for (const Vec3& p : broken.positions) EXPECT_TRUE(std::isfinite(p.x));
    ASSERT_EQ(report.lines().size(), 1u);
    EXPECT_EQ(report.lines()[0].where, "Mesh 'Quad'");

    Quad flat;
    flat.positions[9] = 1;  // vertex 3 falls on the diagonal's end: second triangle without area
    EXPECT_EQ(build_mesh(flat.input(), report).triangle_count(), 1u);
    EXPECT_EQ(report.lines().size(), 1u) << "faces without area are no reason to warn";
}

TEST(MeshBuild, RefusesIndicesOutOfBounds) {
    Report report;
    Quad corners;
    corners.corner_vertices[2] = 4;
    EXPECT_THROW(build_mesh(corners.input(), report), Error);
    Quad triangles;
    triangles.triangle_corners[5] = 9;
    EXPECT_THROW(build_mesh(triangles.input(), report), Error);
    Quad faces;
    faces.triangle_faces[1] = 1;
    EXPECT_THROW(build_mesh(faces.input(), report), Error);
    Quad lengths;
    lengths.face_smooth = {1, 1};
    EXPECT_THROW(build_mesh(lengths.input(), report), Error);
}

TEST(MeshBuild, DecodesByteColours) {
    const Quad quad;
    MeshInput in = quad.input();
    const std::vector<uint8_t> bytes{0, 188, 255, 128, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0};
    in.attributes.push_back({"Col", Domain::Corner, 4, true, {}, bytes});
    Report report;
    const Mesh mesh = build_mesh(in, report);
    ASSERT_EQ(mesh.attributes.size(), 1u);
    EXPECT_FLOAT_EQ(mesh.attributes[0].data[0], 0);
    EXPECT_NEAR(mesh.attributes[0].data[1], 0.5029f, 1e-4f);  // 188 is the byte nearest to linear 0.5
    EXPECT_FLOAT_EQ(mesh.attributes[0].data[2], 1);
    EXPECT_FLOAT_EQ(mesh.attributes[0].data[3], 128 / 255.0f) << "alpha is linear already";
    EXPECT_EQ(mesh.triangle_corners, quad.triangle_corners) << "a corner attribute needs corners";
}

TEST(MeshBuild, RepairsMissingNormals) {
    const Quad quad;
    MeshInput in = quad.input();
    const std::vector<float> normals{0, 0, 1, 0, 0, 0, NAN, 0, 0, 0, 0, 1};
    in.vertex_normals = normals;
    Report report;
    for (const Vec3& n : build_mesh(in, report).vertex_normals) EXPECT_FLOAT_EQ(n.z, 1);
}

TEST(RepairTransform, FlattenedObjectsKeepTheirNormal) {
    // A plane scaled by zero along its own normal, rotated by 90 degrees about X: world normal -Y (or +Y).
    Affine flat{{{2, 0, 0, 1}, {0, 0, 0, 2}, {0, 2, 0, 3}}};
    ASSERT_TRUE(repair_transform(flat));
    const Vec3 n = normalize(transform_normal(inverse(flat), {0, 0, 1}));
    EXPECT_NEAR(std::abs(n.y), 1, 1e-5f);
    const Vec3 p = transform_point(flat, {0.5f, 0.5f, 0});
    EXPECT_FLOAT_EQ(p.x, 2);
    EXPECT_NEAR(p.y, 2, 1e-5f);
    EXPECT_FLOAT_EQ(p.z, 4);
}

TEST(RepairTransform, LinesPointsAndNanAreNothing) {
    Affine point{{{0, 0, 0, 1}, {0, 0, 0, 2}, {0, 0, 0, 3}}};
    EXPECT_FALSE(repair_transform(point));
    Affine line{{{1, 0, 0, 1}, {1, 0, 0, 2}, {1, 0, 0, 3}}};
    EXPECT_FALSE(repair_transform(line));
    Affine broken;
    broken.m[1][3] = INFINITY;
    EXPECT_FALSE(repair_transform(broken));
    Affine tiny{{{1e-5f, 0, 0, 0}, {0, 1e-5f, 0, 0}, {0, 0, -1e-5f, 0}}};
    EXPECT_TRUE(repair_transform(tiny));
    EXPECT_FLOAT_EQ(tiny.m[2][2], -1e-5f) << "small is not flat";
}

TEST(SceneView, ResolvesMaterialsAndAttributes) {
    Scene scene;
    Report report;
    const Quad quad;
    MeshInput in = quad.input();
    const std::vector<float> uv(8, 0.25f);
    in.attributes.push_back({"UVMap", Domain::Corner, 2, false, uv, {}});
    in.active_uv = "UVMap";
    scene.meshes = {nullptr, std::make_shared<const Mesh>(build_mesh(in, report))};
    scene.shaders.resize(3);
    scene.material_sets = {{2, kNone}, {}};
    scene.traits.resize(3);
    scene.traits[0].mesh = 1;
    scene.traits[0].material_set = 0;
    scene.traits[1].mesh = 1;
    scene.traits[1].material_set = 1;
    scene.traits[2].mesh = 0;  // removed
    scene.objects.resize(5);
    for (int i = 0; i < 4; ++i) scene.objects[size_t(i)].traits = i % 3;

    SceneTables tables;
    const AttributeId unknown = tables.attribute_id("nobody has it"), active = tables.attribute_id(kActiveUv);
    EXPECT_EQ(tables.attribute_id(kActiveUv), active);
    make_scene_view(scene, 1, tables);
    const SceneView& view = tables.view;
    EXPECT_EQ(view.attribute_count, 2);
    EXPECT_EQ(view.meshes[1].attributes[unknown].data, nullptr);
    EXPECT_EQ(view.meshes[1].attributes[active].components, 2);
    EXPECT_EQ(view.meshes[1].attributes[active].domain, Domain::Corner);
    EXPECT_EQ(view.traits[0].material_count, 2);
    EXPECT_EQ(view.material_slots[view.traits[0].material_offset], 2);
    EXPECT_EQ(view.material_slots[view.traits[0].material_offset + 1], 1) << "an empty slot is the default shader";
    EXPECT_EQ(view.material_slots[view.traits[1].material_offset], 1) << "an object without slots too";
    EXPECT_EQ(&traits_of(view, 3), &view.traits[0]) << "instances share them";
    for (int32_t object : {2, 4}) {
        EXPECT_EQ(traits_of(view, object).mesh, kNone) << object;
        EXPECT_EQ(traits_of(view, object).visibility, 0u) << object;
    }
}

}  // namespace
}  // namespace talbot::scene
