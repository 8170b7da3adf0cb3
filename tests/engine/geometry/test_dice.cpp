/// Adaptive subdivision: closed cages stay closed, vertices are where the limit surface is, attributes and motion follow, memory bounds it.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <numeric>

#include "geometry/dice.h"
#include "geometry/tessellate.h"
#include "support/objects.h"

namespace talbot::geometry {
namespace {

using scene::Mesh;
using scene::SubdivisionScheme;

using Faces = std::vector<std::vector<uint32_t>>;

Mesh cage(const std::vector<Vec3>& positions, const Faces& faces, SubdivisionScheme scheme = SubdivisionScheme::CatmullClark) {
    Mesh mesh;
    mesh.name = "Cage";
    mesh.positions = positions;
    mesh.subdivision.scheme = scheme;
    mesh.subdivision.in_pixels = false;
    mesh.subdivision.face_starts.push_back(0);
    for (const auto& face : faces) {
        mesh.subdivision.corner_vertices.insert(mesh.subdivision.corner_vertices.end(), face.begin(), face.end());
        mesh.subdivision.face_starts.push_back(uint32_t(mesh.subdivision.corner_vertices.size()));
    }
    return mesh;
}

/// From -1 to 1. Vertex v: bit 0 of v is x, bit 1 is y, bit 2 is z.
Mesh cube(SubdivisionScheme scheme = SubdivisionScheme::CatmullClark) {
    std::vector<Vec3> positions;
    for (int v = 0; v < 8; ++v) positions.push_back({v & 1 ? 1.0f : -1.0f, v & 2 ? 1.0f : -1.0f, v & 4 ? 1.0f : -1.0f});
    return cage(positions, {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}}, scheme);
}

/// Every face has the whole square.
void add_uv(Mesh& mesh) {
    scene::Attribute uv;
    uv.name = "UVMap";
    uv.domain = scene::Domain::Corner;
    uv.components = 2;
    for (size_t f = 0; f + 1 < mesh.subdivision.face_starts.size(); ++f) uv.data.insert(uv.data.end(), {0, 0, 1, 0, 1, 1, 0, 1});
    mesh.attributes.push_back(uv);
}

Mesh dice(const Mesh& mesh, float length, int threads = 1) {
    WorkerPool pool(threads);
    DicingMeter meter;
    meter.edge_length = length;
    return *tessellate(mesh, meter, 1 << 24, pool, nullptr);
}

/// A camera at z = 2 that looks down: what is below it is much coarser than what is near.
Mesh dice_by_camera(const Mesh& mesh, float pixels, int threads = 1, float offscreen = 4) {
    scene::Camera camera;
    camera.to_world.m[0][3] = 0.8f;
    camera.to_world.m[2][3] = 2.0f;
    WorkerPool pool(threads);
    DicingMeter meter;
    meter.camera = &camera;
    meter.to_camera = inverse(camera.to_world);
    meter.pixel = 1 / 200.0f;
    meter.edge_length = pixels;
    meter.offscreen = offscreen;
    return *tessellate(mesh, meter, 1 << 24, pool, nullptr);
}

/// How often each directed edge is used.
std::map<std::pair<uint32_t, uint32_t>, int> edges_of(const Mesh& mesh) {
    std::map<std::pair<uint32_t, uint32_t>, int> edges;
    for (size_t i = 0; i < mesh.triangle_vertices.size(); i += 3)
        for (size_t k = 0; k < 3; ++k) ++edges[{mesh.triangle_vertices[i + k], mesh.triangle_vertices[i + (k + 1) % 3]}];
    return edges;
}

void expect_closed(const Mesh& mesh) {
    const auto edges = edges_of(mesh);
    for (const auto& [edge, count] : edges) {
        ASSERT_EQ(count, 1);
        ASSERT_TRUE(edges.contains({edge.second, edge.first}));
    }
    // Euler: a ball.
    EXPECT_EQ(int64_t(mesh.positions.size()) - int64_t(edges.size() / 2) + int64_t(mesh.triangle_count()), 2);
}

Vec3 position(const Mesh& mesh, size_t corner) {
    return mesh.positions[mesh.triangle_vertices[corner]];
}

double area(const Mesh& mesh) {
    double sum = 0;
    for (size_t i = 0; i < mesh.triangle_vertices.size(); i += 3)
        sum += 0.5 * length(cross(position(mesh, i + 1) - position(mesh, i), position(mesh, i + 2) - position(mesh, i)));
    return sum;
}

double volume(const Mesh& mesh) {
    double sum = 0;
    for (size_t i = 0; i < mesh.triangle_vertices.size(); i += 3) sum += dot(position(mesh, i), cross(position(mesh, i + 1), position(mesh, i + 2))) / 6.0;
    return sum;
}

TEST(Dice, ClosedCagesStayClosed) {
    expect_closed(dice(cube(), 0.05f));
    expect_closed(dice(cube(), 100));
    expect_closed(dice(cube(SubdivisionScheme::Simple), 0.1f));
    // Edges of one face are cut tens of times as often as the opposite ones.
    const Mesh near = dice_by_camera(cube(), 4);
    expect_closed(near);
    EXPECT_GT(near.triangle_count(), 1000u);
    // A prism of five sides, and a pyramid: faces of 5, 4 and 3 corners.
    std::vector<Vec3> positions;
    Faces prism{{4, 3, 2, 1, 0}, {5, 6, 7, 8, 9}};
    for (uint32_t i = 0; i < 10; ++i) positions.push_back({std::cos(float(i % 5) * 1.2566371f), std::sin(float(i % 5) * 1.2566371f), i < 5 ? -1.0f : 1.0f});
    for (uint32_t i = 0; i < 5; ++i) prism.push_back({i, (i + 1) % 5, 5 + (i + 1) % 5, 5 + i});
    expect_closed(dice(cage(positions, prism), 0.07f));
    expect_closed(dice_by_camera(cage(positions, prism), 6));
    const Faces pyramid{{3, 2, 1, 0}, {0, 1, 4}, {1, 2, 4}, {2, 3, 4}, {3, 0, 4}};
    expect_closed(dice(cage({{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}, {0, 0, 1}}, pyramid), 0.06f));
}

TEST(Dice, VerticesAreOnTheLimitSurface) {
    const Mesh fine = dice(cube(), 0.02f);
    // A corner of a cube: (9 v + 4 edge neighbours + 3 vertices across) / 24 [Halstead et al. 1993].
    for (size_t v = 0; v < 8; ++v) {
        EXPECT_NEAR(fine.positions[v].x, v & 1 ? 0.5f : -0.5f, 1e-5f);
        EXPECT_NEAR(fine.positions[v].y, v & 2 ? 0.5f : -0.5f, 1e-5f);
        EXPECT_NEAR(fine.positions[v].z, v & 4 ? 0.5f : -0.5f, 1e-5f);
    }
    // The limit of a cube is nearly a ball, seen from everywhere from outside.
    float least = 9, most = 0;
    for (size_t v = 0; v < fine.positions.size(); ++v) {
        least = std::min(least, length(fine.positions[v]));
        most = std::max(most, length(fine.positions[v]));
        EXPECT_NEAR(length(fine.vertex_normals[v]), 1, 1e-5f);
        EXPECT_GT(dot(fine.vertex_normals[v], fine.positions[v]), 0.9f * length(fine.positions[v]));
    }
    EXPECT_NEAR(least, 0.8333f, 0.01f);
    EXPECT_NEAR(most, 0.8819f, 0.02f);
    EXPECT_NEAR(volume(fine), volume(dice(cube(), 0.1f)), 0.03);
    EXPECT_GT(volume(fine), 2.5);
}

TEST(Dice, EdgesAreAboutAsLongAsAskedFor) {
    const Mesh coarse = dice(cube(), 0.08f), fine = dice(cube(), 0.04f);
    EXPECT_NEAR(double(fine.triangle_count()) / double(coarse.triangle_count()), 4, 0.8);
    // No straight piece is longer than sqrt(2) times; diagonals are that of a square of those.
    double sum = 0;
    for (size_t i = 0; i < fine.triangle_vertices.size(); i += 3)
        for (size_t k = 0; k < 3; ++k) {
            const float l = length(position(fine, i + k) - position(fine, i + (k + 1) % 3));
            EXPECT_LT(l, 2.3f * 0.04f);
            sum += l / (3.0 * double(fine.triangle_count()));
        }
    EXPECT_GT(sum, 0.7 * 0.04);
    EXPECT_LT(sum, 1.5 * 0.04);
    // An edge is halved max_level times at most.
    Mesh bounded = cube();
    bounded.subdivision.max_level = 3;
    EXPECT_EQ(dice(bounded, 1e-4f).triangle_count(), 6u * 64 * 2);
    // Coarser where the camera does not look.
    EXPECT_GT(dice_by_camera(cube(), 2, 1, 1).triangle_count(), 2 * dice_by_camera(cube(), 2, 1, 16).triangle_count());
}

TEST(Dice, CreasesAndSimpleKeepTheShape) {
    Mesh sharp = cube();
    for (uint32_t v = 0; v < 8; ++v)
        for (uint32_t bit = 1; bit < 8; bit *= 2)
            if (!(v & bit)) {
                sharp.subdivision.crease_edges.insert(sharp.subdivision.crease_edges.end(), {v, v | bit});
                sharp.subdivision.crease_sharpness.push_back(10);
            }
    EXPECT_NEAR(area(dice(sharp, 0.1f)), 24, 0.01);
    EXPECT_NEAR(area(dice(cube(SubdivisionScheme::Simple), 0.1f)), 24, 1e-4);
    sharp.subdivision.crease_sharpness.assign(12, 1);
    EXPECT_LT(area(dice(sharp, 0.1f)), 20);
    // An open sheet's corners are rounded, or stay.
    Mesh sheet = cage({{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}}, {{0, 1, 2, 3}});
    EXPECT_LT(area(dice(sheet, 0.05f)), 3.5);
    sheet.subdivision.sharp_corners = true;
    EXPECT_NEAR(area(dice(sheet, 0.05f)), 4, 1e-4);
}

TEST(Dice, AttributesFollow) {
    Mesh mesh = cube(SubdivisionScheme::Simple);
    add_uv(mesh);
    mesh.attributes.push_back({"@tangent:UVMap", scene::Domain::Corner, 4, false, std::vector<float>(24 * 4)});
    scene::Attribute x{"x", scene::Domain::Vertex, 1, false, {}}, number{"number", scene::Domain::Face, 1, false, {0, 1, 2, 3, 4, 5}};
    for (const Vec3& p : mesh.positions) x.data.push_back(p.x);
    mesh.attributes.insert(mesh.attributes.end(), {x, number});
    mesh.subdivision.face_materials = {0, 1, 2, 3, 4, 5};
    mesh.subdivision.face_smooth = {1, 0, 1, 0, 1, 0};
    const Mesh fine = dice(mesh, 0.3f);
    const std::vector<float>&uv = fine.attributes[0].data, &tangents = fine.attributes[1].data;
    double covered = 0;
    for (size_t t = 0; t < fine.triangle_count(); ++t) {
        const uint32_t* c = &fine.triangle_corners[3 * t];
        const auto at = [&](int k, size_t i) { return uv[2 * size_t(c[k]) + i]; };
        const double turn = (at(1, 0) - at(0, 0)) * (at(2, 1) - at(0, 1)) - (at(1, 1) - at(0, 1)) * (at(2, 0) - at(0, 0));
        EXPECT_GT(turn, 0);  // no seam is crossed
        covered += 0.5 * turn;
        const uint32_t face = fine.triangle_faces[t];
        EXPECT_EQ(fine.triangle_materials[t], face);
        EXPECT_EQ(fine.triangle_smooth[t], face % 2 == 0);
        for (int k = 0; k < 3; ++k) {
            const uint32_t v = fine.triangle_vertices[3 * t + size_t(k)];
            EXPECT_NEAR(fine.attributes[2].data[v], fine.positions[v].x, 1e-5f);
            // The map's first direction is the face's first edge.
            const uint32_t* cage_face = &mesh.subdivision.corner_vertices[4 * size_t(face)];
            const Vec3 edge = normalize(mesh.positions[cage_face[1]] - mesh.positions[cage_face[0]]);
            const float* tangent = &tangents[4 * size_t(c[k])];
            EXPECT_NEAR(dot(edge, Vec3{tangent[0], tangent[1], tangent[2]}), 1, 1e-4f);
            EXPECT_EQ(tangent[3], 1);
        }
    }
    // Without normals of its own flat pieces share the mean of theirs at edges; with them they are shaded as the cage was.
    for (const Vec3& p : mesh.positions) mesh.vertex_normals.push_back(normalize(p));
    const Mesh shaded = dice(mesh, 0.3f);
    for (size_t v = 0; v < shaded.positions.size(); ++v) {
        EXPECT_GT(dot(shaded.vertex_normals[v], normalize(shaded.positions[v])), 0.9999f);
        EXPECT_GT(dot(fine.vertex_normals[v], normalize(fine.positions[v])), 0.57f);
    }
    EXPECT_NEAR(covered, 6, 1e-4);
    EXPECT_EQ(fine.attributes[3].data, number.data);
}

TEST(Dice, MovesAsTheCageMoves) {
    Mesh mesh = cube();
    mesh.motion_steps = 2;
    mesh.motion_positions = mesh.positions;
    for (const Vec3& p : mesh.positions) mesh.motion_positions.push_back(p * 2 + Vec3{0, 0, 3});
    const Mesh fine = dice(mesh, 0.2f);
    const size_t n = fine.positions.size();
    ASSERT_EQ(fine.motion_positions.size(), 2 * n);
    ASSERT_EQ(fine.motion_normals.size(), 2 * n);
    for (size_t i = 0; i < n; ++i) {
        EXPECT_LT(length(fine.motion_positions[i] - fine.positions[i]), 1e-6f);
        EXPECT_LT(length(fine.motion_positions[n + i] - fine.positions[i] * 2 - Vec3{0, 0, 3}), 1e-5f);
        EXPECT_LT(length(fine.motion_normals[n + i] - fine.vertex_normals[i]), 1e-4f);
    }
}

TEST(Dice, BadCagesAreDicedAsFarAsTheyGo) {
    EXPECT_EQ(dice(cage({}, {}), 0.1f).triangle_count(), 0u);
    // Faces that visit a vertex twice, of two corners, with vertices that are not finite: left out; three faces at an edge, a face that is there twice and one
    // that faces the other way: diced.
    const float nan = std::numeric_limits<float>::quiet_NaN();
    const std::vector<Vec3> positions{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0.5f, 0.5f, 1}, {nan, 0, 0}, {7, 7, 7}};
    EXPECT_EQ(dice(cage(positions, {{0, 1, 1, 2}, {0, 1}, {0, 1, 5}, {}}), 0.1f).triangle_count(), 0u);
    const Mesh odd = dice(cage(positions, {{0, 1, 2, 3}, {0, 1, 4}, {1, 0, 4}, {0, 1, 4}, {3, 2, 1, 0}}), 0.2f);
    EXPECT_GT(odd.triangle_count(), 5u * 8);
    for (const Vec3& p : odd.positions) EXPECT_TRUE(is_finite(p));
    for (const Vec3& n : odd.vertex_normals) EXPECT_NEAR(length(n), 1, 1e-4f);
    // All in one place.
    for (const Vec3& n : dice(cage({{}, {}, {}, {}}, {{0, 1, 2, 3}}), 0.1f).vertex_normals) EXPECT_NEAR(length(n), 1, 1e-4f);
}

TEST(Dice, IsTheSameForAnyNumberOfThreads) {
    Mesh mesh = cube();
    add_uv(mesh);
    const Mesh one = dice_by_camera(mesh, 3, 1), four = dice_by_camera(mesh, 3, 4);
    EXPECT_EQ(one.triangle_vertices, four.triangle_vertices);
    EXPECT_EQ(one.triangle_corners, four.triangle_corners);
    EXPECT_EQ(one.attributes[0].data, four.attributes[0].data);
    ASSERT_EQ(one.positions.size(), four.positions.size());
    EXPECT_EQ(0, std::memcmp(one.positions.data(), four.positions.data(), one.positions.size() * sizeof(Vec3)));
    EXPECT_EQ(0, std::memcmp(one.vertex_normals.data(), four.vertex_normals.data(), one.positions.size() * sizeof(Vec3)));
}

struct Fixture {
    scene::Scene scene;
    scene::SceneTables tables;
    Report report;
    std::vector<DicedMesh> known;

    /// A camera at the origin that looks along -z, 100 pixels a unit wide.
    explicit Fixture(Mesh mesh) {
        mesh.subdivision.in_pixels = true;
        mesh.subdivision.edge_length = 2;
        scene.meshes.push_back(std::make_shared<const Mesh>(std::move(mesh)));
        scene.settings.width = 100;
    }
    void place(float z) {
        scene::ObjectTraits traits;
        traits.mesh = 0;
        Affine to_world;
        to_world.m[2][3] = z;
        tests::place(scene, traits, to_world);
    }
    const Mesh& dice(size_t budget = 1 << 24, const std::atomic<bool>* cancel = nullptr) {
        scene::make_scene_view(scene, 0, tables);
        WorkerPool pool(2);
        dice_meshes(tables, scene, budget, pool, known, report, cancel);
        return *tables.keep_alive[0];
    }
};

TEST(Dice, InstancesShareTheFinest) {
    Fixture near(cube()), far(cube()), both(cube());
    near.place(-4), far.place(-40), both.place(-40), both.place(-4);
    const size_t fine = near.dice().triangle_count(), coarse = far.dice().triangle_count();
    EXPECT_GT(fine, 10 * coarse);
    EXPECT_EQ(both.dice().triangle_count(), fine);
    EXPECT_EQ(both.tables.meshes[0].triangle_count, fine);
}

TEST(Dice, WhatIsDicedAlikeStays) {
    Fixture f(cube());
    f.place(-4);
    const Mesh* first = &f.dice();
    EXPECT_EQ(&f.dice(), first);
    f.scene.objects[0].to_world.m[2][3] = -8;
    const Mesh* moved = &f.dice();
    EXPECT_LT(moved->triangle_count(), 4000u);
    f.scene.settings.viewport = true;
    const Mesh* seen = &f.dice();
    f.scene.objects[0].to_world.m[2][3] = -4;
    EXPECT_EQ(&f.dice(), seen);
    f.scene.dicing_camera.to_world.m[2][3] = 1;
    EXPECT_NE(&f.dice(), seen);
}

TEST(Dice, MemoryAndCancelEndIt) {
    Fixture f(cube());
    f.place(-4);
    const size_t whole = f.dice().triangle_count();
    f.known.clear();
    EXPECT_LE(f.dice(whole / 2).triangle_count(), whole / 2);
    ASSERT_EQ(f.report.lines().size(), 1u);
    EXPECT_NE(f.report.lines()[0].text.find("2 times coarser"), std::string::npos);
    EXPECT_EQ(f.report.lines()[0].where, "Mesh 'Cage'");
    f.known.clear();
    EXPECT_EQ(f.dice(10).triangle_count(), 0u);  // the cage of this test has no triangles of its own
    EXPECT_NE(f.report.lines()[1].text.find("left out"), std::string::npos);
    f.known.clear();
    const std::atomic<bool> cancel{true};
    EXPECT_THROW(f.dice(1 << 24, &cancel), Cancelled);
}

}  // namespace
}  // namespace talbot::geometry
