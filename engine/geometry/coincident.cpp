#include "geometry/coincident.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <string>
#include <unordered_map>

#include "base/error.h"

namespace talbot::geometry {
namespace {

uint64_t mix(uint64_t h, uint32_t word) {
    h = (h ^ word) * 0xff51afd7ed558ccdu;
    return h ^ (h >> 32);
}

uint64_t hash_position(Vec3 p) {
    p = p + vec3(0);  // -0 becomes 0
    return mix(mix(mix(0x9e3779b97f4a7c15u, std::bit_cast<uint32_t>(p.x)), std::bit_cast<uint32_t>(p.y)), std::bit_cast<uint32_t>(p.z));
}

bool equal(Vec3 a, Vec3 b) {
    return a.x == b.x && a.y == b.y && a.z == b.z;
}

struct Triangle {
    Vec3 p[3];
};

bool same_corners(const Triangle& a, const Triangle& b) {
    constexpr int orders[6][3] = {{0, 1, 2}, {1, 2, 0}, {2, 0, 1}, {0, 2, 1}, {2, 1, 0}, {1, 0, 2}};
    for (const auto& order : orders)
        if (equal(a.p[0], b.p[order[0]]) && equal(a.p[1], b.p[order[1]]) && equal(a.p[2], b.p[order[2]])) return true;
    return false;
}

}  // namespace

std::vector<uint32_t> repeated_triangles(const scene::Mesh& mesh) {
    const size_t vertices = mesh.positions.size(), triangles = mesh.triangle_count();
    const auto triangle = [&](size_t i) {
        const uint32_t* v = mesh.triangle_vertices.data() + 3 * i;
        return Triangle{{mesh.positions[v[0]], mesh.positions[v[1]], mesh.positions[v[2]]}};
    };
    for (uint32_t v : mesh.triangle_vertices)
        if (v >= vertices) throw Error("a triangle names a vertex that does not exist", "Mesh '" + mesh.name + "'");

    // Open addressing; a slot holds a triangle's index plus one. Corners' hashes are added up: their order does not matter.
    size_t slots = 16;
    while (slots < 2 * triangles) slots *= 2;
    std::vector<uint32_t> table(slots, 0), repeated;
    for (size_t i = 0; i < triangles; ++i) {
        const Triangle t = triangle(i);
        const uint64_t h = hash_position(t.p[0]) + hash_position(t.p[1]) + hash_position(t.p[2]);
        size_t slot = (h ^ (h >> 31)) & (slots - 1);
        while (table[slot] != 0 && !same_corners(t, triangle(table[slot] - 1))) slot = (slot + 1) & (slots - 1);
        if (table[slot] != 0)
            repeated.push_back(uint32_t(i));
        else
            table[slot] = uint32_t(i) + 1;
    }
    return repeated;
}

std::vector<uint32_t> unshadowed_visibility(const scene::SceneTables& tables, std::span<const scene::Mesh* const> meshes) {
    // Hash of the map and of a few numbers of the mesh; then the first of every equal set keeps what all before it do not see.
    const auto same_mesh = [](const scene::Mesh& a, const scene::Mesh& b) {
        return &a == &b || (a.triangle_vertices == b.triangle_vertices && a.positions.size() == b.positions.size() &&
                            std::equal(a.positions.begin(), a.positions.end(), b.positions.begin(), equal));
    };
    std::vector<uint32_t> masks(meshes.size(), 0);
    std::unordered_multimap<uint64_t, size_t> seen;
    for (size_t i = 0; i < meshes.size(); ++i) {
        if (!meshes[i]) continue;
        const scene::ObjectView& object = tables.view.objects[i];
        uint64_t h = hash_position(meshes[i]->positions.front()) + meshes[i]->triangle_vertices.size();
        for (const auto& row : object.to_world.m)
            for (float x : row) h = mix(h, std::bit_cast<uint32_t>(x));
        masks[i] = object.visibility;
        const auto [begin, end] = seen.equal_range(h);
        for (auto at = begin; at != end; ++at) {
            const size_t k = at->second;
            if (std::memcmp(&tables.view.objects[k].to_world, &object.to_world, sizeof(Affine)) == 0 && same_mesh(*meshes[k], *meshes[i]))
                masks[i] &= ~tables.view.objects[k].visibility;
        }
        seen.emplace(h, i);
    }
    return masks;
}

}  // namespace talbot::geometry
