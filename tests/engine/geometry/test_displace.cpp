/// True displacement: where vertices go, which normals they get, what instances share, and what a second call keeps.
#include <gtest/gtest.h>

#include <functional>

#include "geometry/displace.h"
#include "geometry/shapes.h"
#include "shader/compiler.h"
#include "support/graph_builder.h"
#include "support/objects.h"

namespace talbot::geometry {
namespace {

using scene::DisplacementMethod;
using test::GraphBuilder;
using test::NodeBuilder;
using test::Socket;
using test::SocketKind;

constexpr auto F = SocketKind::Float;
constexpr auto V = SocketKind::Vector;

/// A grid of cells x cells squares over [-1, 1]^2 at z = 0, smooth, with normals.
std::shared_ptr<scene::Mesh> grid(uint32_t cells) {
    std::vector<Vec3> p;
    std::vector<uint32_t> t;
    const uint32_t n = cells + 1;
    for (uint32_t y = 0; y < n; ++y)
        for (uint32_t x = 0; x < n; ++x) p.push_back({2 * float(x) / float(cells) - 1, 2 * float(y) / float(cells) - 1, 0});
    for (uint32_t y = 0; y < cells; ++y)
        for (uint32_t x = 0; x < cells; ++x) {
            const uint32_t a = y * n + x;
            t.insert(t.end(), {a, a + 1, a + n + 1, a, a + n + 1, a + n});
        }
    auto mesh = make_mesh(std::move(p), std::move(t));
    mesh->vertex_normals.assign(mesh->positions.size(), {0, 0, 1});
    return mesh;
}

using Height = std::function<Socket(GraphBuilder&)>;

/// A material that displaces by a height of scale 0.5 around 0.
scene::Shader material(DisplacementMethod method, const Height& height, const char* space = "OBJECT", float midlevel = 0) {
    GraphBuilder g;
    g.surface(g.diffuse({0.5f, 0.5f, 0.5f}));
    const Socket h = height(g);
    const int node = g.node("ShaderNodeDisplacement").link("Height", F, h).set("Midlevel", midlevel).set("Scale", 0.5f).text("space", space).id();
    const Socket from = g.out(node, "Displacement", V);
    g.shader.graph.nodes[size_t(g.shader.graph.output_node)].inputs.push_back({"Displacement", V, {}, true, from.node, from.identifier});
    g.shader.displacement = method;
    g.shader.name = "Rough";
    return g.shader;
}

Socket constant(GraphBuilder& g, float x) {
    return g.value(x);
}
/// Position.x
Socket slope(GraphBuilder& g) {
    return g.out(g.node("ShaderNodeSeparateXYZ").link("Vector", V, g.position()).id(), "X", F);
}
Socket noise(GraphBuilder& g) {
    return g.out(g.node("ShaderNodeTexNoise").link("Vector", V, g.position()).set("Scale", 3.0f).set("Detail", 2.0f).id(), "Fac", F);
}

struct Fixture {
    scene::Scene scene;
    scene::SceneTables tables;
    shader::Programs programs;
    shader::ShaderContext context;
    Report report;
    std::vector<DisplacedMesh> known;

    void add(const std::shared_ptr<const scene::Mesh>& mesh, std::vector<scene::Handle> shaders, const Affine& to_world = {}) {
        size_t handle = size_t(std::find(scene.meshes.begin(), scene.meshes.end(), mesh) - scene.meshes.begin());
        if (handle == scene.meshes.size()) scene.meshes.push_back(mesh);
        scene::ObjectTraits traits;
        traits.mesh = scene::Handle(handle);
        scene.material_sets.push_back(std::move(shaders));
        traits.material_set = scene::Handle(scene.material_sets.size() - 1);
        tests::place(scene, traits, to_world);
    }
    void displace(int threads = 1, const std::atomic<bool>* cancel = nullptr) {
        programs = shader::compile_shaders(scene, tables, report);
        scene::make_scene_view(scene, programs.default_shader, tables);
        context.scene = &tables.view;
        WorkerPool pool(threads);
        displace_meshes(tables, programs, context, &shader::run_program, pool, known, report, cancel);
    }
    const scene::Mesh& shown(size_t object = 0) const { return *tables.keep_alive[size_t(tables.view.traits[object].mesh)]; }
};

Affine scaled(float x, float y, float z) {
    Affine a;
    a.m[0][0] = x, a.m[1][1] = y, a.m[2][2] = z;
    return a;
}

void expect_near(Vec3 a, Vec3 b, float tolerance = 2e-6f) {
    EXPECT_NEAR(a.x, b.x, tolerance);
    EXPECT_NEAR(a.y, b.y, tolerance);
    EXPECT_NEAR(a.z, b.z, tolerance);
}

TEST(Displace, MovesAlongNormalsByScaleAndMidlevel) {
    // Height 0.6 above a middle of 0.2, scale 0.5: 0.2. In object space the object's scale multiplies it, in world space it does not.
    struct Case {
        const char* space;
        float offset;
    };
    for (const Case& c : {Case{"OBJECT", 0.2f}, Case{"WORLD", 0.2f / 3}}) {
        Fixture f;
        f.scene.shaders.push_back(material(
            DisplacementMethod::Displacement, [](GraphBuilder& g) { return constant(g, 0.6f); }, c.space, 0.2f));
        f.add(sphere(2), {0}, scaled(3, 3, 3));
        f.displace();
        const scene::Mesh& before = *f.scene.meshes[0];
        for (size_t i = 0; i < before.positions.size(); ++i) expect_near(f.shown().positions[i], before.positions[i] * (1 + c.offset));
        for (size_t i = 0; i < before.positions.size(); ++i) EXPECT_GT(dot(f.shown().vertex_normals[i], before.vertex_normals[i]), 0.995f);
        EXPECT_EQ(f.tables.meshes[0].positions, f.shown().positions.data());
    }
}

TEST(Displace, MethodsDifferInNormals) {
    // Height 0.5 x: the slope's normal for Displacement, the old one for Both, and Bump moves nothing.
    for (const DisplacementMethod method : {DisplacementMethod::Bump, DisplacementMethod::Displacement, DisplacementMethod::Both}) {
        Fixture f;
        f.scene.shaders.push_back(material(method, slope));
        f.add(grid(4), {0});
        f.displace();
        const bool moves = method != DisplacementMethod::Bump;
        for (size_t i = 0; i < f.shown().positions.size(); ++i) {
            const Vec3 p = f.scene.meshes[0]->positions[i];
            expect_near(f.shown().positions[i], {p.x, p.y, moves ? 0.5f * p.x : 0});
            expect_near(f.shown().vertex_normals[i], method == DisplacementMethod::Displacement ? normalize(Vec3{-0.5f, 0, 1}) : Vec3{0, 0, 1});
        }
        EXPECT_EQ(f.known.size(), moves ? 1u : 0u);
    }
}

TEST(Displace, KeepsTheUndisplacedShapeForShaders) {
    Fixture f;
    f.scene.shaders.push_back(material(DisplacementMethod::Both, noise));
    GraphBuilder generated;
    generated.surface(generated.emission(generated.out(generated.node("ShaderNodeTexCoord").id(), "Generated", V)));
    f.scene.shaders.push_back(generated.shader);
    const auto mesh = grid(3);
    mesh->generated_scale = {0.5f, 0.5f, 1};
    mesh->generated_offset = {0.5f, 0.5f, 0};
    f.add(mesh, {0});
    f.displace();
    const auto read = [&](const char* name, size_t vertex) {
        const float* x = f.tables.meshes[0].attributes[f.tables.attribute_id(name)].data + 3 * vertex;
        return Vec3{x[0], x[1], x[2]};
    };
    for (size_t i = 0; i < mesh->positions.size(); ++i) {
        expect_near(read(scene::kUndisplaced, i), mesh->positions[i]);
        expect_near(read("@generated", i), mesh->positions[i] * mesh->generated_scale + mesh->generated_offset);
    }
}

TEST(Displace, EachMaterialMovesItsOwnFaces) {
    Fixture f;
    f.scene.shaders.push_back(material(DisplacementMethod::Displacement, [](GraphBuilder& g) { return constant(g, 1); }));
    f.scene.shaders.push_back(material(DisplacementMethod::Bump, [](GraphBuilder& g) { return constant(g, 1); }));
    const auto mesh = grid(4);
    for (size_t t = 0; t < mesh->triangle_count(); ++t) mesh->triangle_materials.push_back(t < 16 ? 0 : 1);
    f.add(mesh, {0, 1});
    f.displace();
    // The row that both share moves with the one that displaces.
    for (size_t i = 0; i < mesh->positions.size(); ++i) EXPECT_EQ(f.shown().positions[i].z, i < 15 ? 0.5f : 0.0f) << i;
    for (size_t i = 20; i < 25; ++i) expect_near(f.shown().vertex_normals[i], {0, 0, 1});
}

TEST(Displace, InstancesShareAndOtherMaterialsDoNot) {
    Fixture f;
    f.scene.shaders.push_back(material(DisplacementMethod::Displacement, [](GraphBuilder& g) { return constant(g, 1); }));
    f.scene.shaders.push_back(material(DisplacementMethod::Displacement, [](GraphBuilder& g) { return constant(g, 2); }));
    const auto mesh = grid(2);
    f.add(mesh, {0}, scaled(2, 2, 2));
    f.add(mesh, {0});
    f.add(mesh, {1});
    f.add(mesh, {});
    f.displace();
    EXPECT_EQ(&f.shown(0), &f.shown(1));
    EXPECT_EQ(f.shown(1).positions[0].z, 0.5f);
    EXPECT_EQ(f.shown(2).positions[0].z, 1.0f);
    EXPECT_EQ(&f.shown(3), mesh.get());
    EXPECT_EQ(f.tables.view.meshes, f.tables.meshes.data());
    for (size_t i = 0; i < 4; ++i) EXPECT_EQ(f.tables.meshes[size_t(f.tables.view.traits[i].mesh)].positions, f.shown(i).positions.data());
}

TEST(Displace, FlatAndSharpFacesKeepTheirEdges) {
    // A cube pushed out by 0.5 along its corners' diagonals is a cube, and its corner normals stay those of its faces.
    Fixture f;
    f.scene.shaders.push_back(material(DisplacementMethod::Displacement, [](GraphBuilder& g) { return constant(g, 1); }));
    const auto cube = box();
    for (uint32_t i = 0; i < cube->triangle_vertices.size(); ++i) cube->triangle_corners.push_back(i);
    for (size_t t = 0; t < cube->triangle_count(); ++t) {
        const uint32_t* v = &cube->triangle_vertices[3 * t];
        const Vec3 a = cube->positions[v[0]];
        for (int k = 0; k < 3; ++k) cube->corner_normals.push_back(normalize(cross(cube->positions[v[1]] - a, cube->positions[v[2]] - a)));
    }
    f.add(cube, {0});
    f.displace();
    const float step = 0.5f / std::sqrt(3.0f);
    for (size_t i = 0; i < 8; ++i) expect_near(f.shown().positions[i], cube->positions[i] * (1 + step));
    for (size_t i = 0; i < cube->corner_normals.size(); ++i) expect_near(f.shown().corner_normals[i], cube->corner_normals[i], 1e-5f);
}

TEST(Displace, MovesEveryMomentAlike) {
    Fixture f;
    f.scene.shaders.push_back(material(DisplacementMethod::Displacement, slope));
    const auto mesh = grid(2);
    mesh->motion_steps = 3;
    for (int step = 0; step < 3; ++step) {
        for (Vec3 p : mesh->positions) mesh->motion_positions.push_back(p + Vec3{0, 0, float(step)});
        mesh->motion_normals.insert(mesh->motion_normals.end(), mesh->vertex_normals.begin(), mesh->vertex_normals.end());
    }
    f.add(mesh, {0});
    f.displace();
    for (size_t i = 0; i < 27; ++i) {
        const Vec3 p = mesh->motion_positions[i];
        expect_near(f.shown().motion_positions[i], {p.x, p.y, p.z + 0.5f * p.x});
        expect_near(f.shown().motion_normals[i], normalize(Vec3{-0.5f, 0, 1}));
    }
}

TEST(Displace, WhatIsNotFiniteStaysAndIsReported) {
    // x 1e30 1e30: infinite on both sides, nothing (0) in the middle.
    const auto huge = [](GraphBuilder& g) {
        Socket h = slope(g);
        for (int i = 0; i < 3; ++i)
            h = g.out(g.node("ShaderNodeMath").text("operation", "MULTIPLY").link("Value", F, h).set("Value_001", 1e16f).id(), "Value", F);
        return h;
    };
    Fixture f;
    f.scene.shaders.push_back(material(DisplacementMethod::Displacement, huge));
    f.add(grid(2), {0});
    f.displace();
    for (size_t i = 0; i < 9; ++i) expect_near(f.shown().positions[i], f.scene.meshes[0]->positions[i]);
    ASSERT_EQ(f.report.lines().size(), 1u);
    EXPECT_NE(f.report.lines()[0].text.find("6 vertices"), std::string::npos);
    EXPECT_NE(f.report.lines()[0].where.find("Rough"), std::string::npos);
}

TEST(Displace, SameBitsForAnyThreadsAndTheSameMeshForNoChange) {
    Fixture one, many;
    for (Fixture* f : {&one, &many}) {
        f->scene.shaders.push_back(material(DisplacementMethod::Displacement, noise));
        f->add(grid(40), {0}, scaled(1.5f, 0.7f, 2));
    }
    one.displace(1);
    many.displace(5);
    for (size_t i = 0; i < one.shown().positions.size(); ++i) {
        EXPECT_EQ(one.shown().positions[i].z, many.shown().positions[i].z);
        EXPECT_EQ(one.shown().vertex_normals[i].x, many.shown().vertex_normals[i].x);
    }
    const scene::Mesh* before = &one.shown();
    one.displace();
    EXPECT_EQ(&one.shown(), before);
    one.scene.shaders[0] = material(DisplacementMethod::Displacement, slope);
    one.displace();
    EXPECT_NE(&one.shown(), before);
    EXPECT_EQ(one.shown().positions[0].z, -0.75f);  // half of the world position, -1.5
    one.scene.shaders[0].displacement = DisplacementMethod::Bump;
    one.displace();
    EXPECT_EQ(&one.shown(), one.scene.meshes[0].get());
}

TEST(Displace, CanBeCancelled) {
    Fixture f;
    f.scene.shaders.push_back(material(DisplacementMethod::Displacement, noise));
    f.add(grid(2), {0});
    const std::atomic<bool> cancel{true};
    EXPECT_THROW(f.displace(1, &cancel), Cancelled);
}

}  // namespace
}  // namespace talbot::geometry
