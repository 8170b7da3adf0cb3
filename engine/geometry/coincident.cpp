#include "geometry/coincident.h"

#include <algorithm>
#include <array>
#include <bit>
#include <compare>
#include <cstring>
#include <numeric>
#include <string>
#include <unordered_map>
#include <utility>

#include "base/error.h"

namespace talbot::geometry {
namespace {

constexpr size_t kPollEvery = 1 << 17;

/// job(i) for i < n, with a poll now and then: whoever waits for a mesh of millions may cancel anywhere.
template <class Job>
void for_each(size_t n, const std::function<void()>& poll, Job&& job) {
    for (size_t begin = 0; begin < n; begin += kPollEvery) {
        poll();
        const size_t end = std::min(n, begin + kPollEvery);
        for (size_t i = begin; i < end; ++i) job(i);
    }
}

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

/// Of many hashes, which may be there twice: two bitmaps, small enough for the caches; few others share their bits.
class Twins {
public:
    explicit Twins(size_t n) : once_(std::bit_ceil(std::max<size_t>(16 * n, 64)) / 64, 0), again_(once_) {}
    void add(uint64_t h) {
        const uint64_t bit = h & (once_.size() * 64 - 1), mask = uint64_t(1) << (bit & 63);
        again_[bit / 64] |= once_[bit / 64] & mask;
        once_[bit / 64] |= mask;
    }
    bool may_have_one(uint64_t h) const { return again_[(h & (again_.size() * 64 - 1)) / 64] >> (h & 63) & 1; }

private:
    std::vector<uint64_t> once_, again_;
};

/// For every vertex the first one in the same position; empty when all positions differ, as they do in most meshes.
std::vector<uint32_t> first_at_position(const std::vector<Vec3>& positions, const std::function<void()>& poll) {
    const size_t n = positions.size();
    Twins twins(n);
    for_each(n, poll, [&](size_t i) { twins.add(hash_position(positions[i])); });
    size_t candidates = 0;
    for_each(n, poll, [&](size_t i) { candidates += twins.may_have_one(hash_position(positions[i])); });

    // Those go through a table with open addressing; a slot holds a vertex plus one.
    std::vector<uint32_t> table(std::bit_ceil(2 * candidates + 1), 0), first;
    for_each(n, poll, [&](size_t i) {
        const uint64_t h = hash_position(positions[i]);
        if (!twins.may_have_one(h) || !equal(positions[i], positions[i])) return;  // NaN equals nothing
        size_t slot = (h >> 20) & (table.size() - 1);
        while (table[slot] != 0 && !equal(positions[i], positions[table[slot] - 1])) slot = (slot + 1) & (table.size() - 1);
        if (table[slot] == 0) {
            table[slot] = uint32_t(i) + 1;
            return;
        }
        if (first.empty()) {
            first.resize(n);
            std::iota(first.begin(), first.end(), 0u);
        }
        first[i] = table[slot] - 1;
    });
    return first;
}

}  // namespace

std::vector<uint32_t> repeated_triangles(const scene::Mesh& mesh, const std::function<void()>& poll) {
    const size_t vertices = mesh.positions.size(), triangles = mesh.triangle_count();
    for_each(mesh.triangle_vertices.size(), poll, [&](size_t i) {
        if (mesh.triangle_vertices[i] >= vertices) throw Error("a triangle names a vertex that does not exist", "Mesh '" + mesh.name + "'");
    });
    const std::vector<uint32_t> first = first_at_position(mesh.positions, poll);
    const auto corners = [&](size_t i) {
        std::array<uint32_t, 3> c{mesh.triangle_vertices[3 * i], mesh.triangle_vertices[3 * i + 1], mesh.triangle_vertices[3 * i + 2]};
        if (!first.empty())
            for (uint32_t& v : c) v = first[v];
        std::sort(c.begin(), c.end());
        return c;
    };

    // Triangles by their lowest vertex (a counting sort: neighbours in memory stay neighbours), then equal ones within each vertex.
    std::vector<uint32_t> start(vertices + 1, 0), order(triangles);
    for_each(triangles, poll, [&](size_t i) { ++start[corners(i)[0] + 1]; });
    std::partial_sum(start.begin(), start.end(), start.begin());
    std::vector<uint32_t> next(start.begin(), start.end() - 1);
    for_each(triangles, poll, [&](size_t i) { order[next[corners(i)[0]]++] = uint32_t(i); });
    struct Rest {
        uint32_t middle, highest, triangle;
        auto operator<=>(const Rest&) const = default;
    };
    std::vector<Rest> bucket;
    std::vector<uint32_t> repeated;
    for_each(vertices, poll, [&](size_t v) {
        if (start[v + 1] - start[v] < 2) return;
        bucket.clear();
        for (size_t k = start[v]; k < start[v + 1]; ++k) {
            const auto c = corners(order[k]);
            bucket.push_back({c[1], c[2], order[k]});
        }
        std::sort(bucket.begin(), bucket.end());
        for (size_t k = 1; k < bucket.size(); ++k)
            if (bucket[k].middle == bucket[k - 1].middle && bucket[k].highest == bucket[k - 1].highest) repeated.push_back(bucket[k].triangle);
    });
    std::sort(repeated.begin(), repeated.end());
    return repeated;
}

std::vector<uint32_t> unshadowed_visibility(const scene::SceneView& view, const std::function<const scene::Mesh*(int32_t object)>& mesh_of) {
    const auto same_mesh = [](const scene::Mesh& a, const scene::Mesh& b) {
        return &a == &b || (a.kind == scene::GeometryKind::Triangles && b.kind == a.kind && a.motion_steps == 1 && b.motion_steps == 1 &&
                            a.triangle_vertices == b.triangle_vertices && a.positions.size() == b.positions.size() &&
                            std::equal(a.positions.begin(), a.positions.end(), b.positions.begin(), equal));
    };
    // Of the map and of a few numbers of the mesh.
    const auto hash = [&](int32_t i, const scene::Mesh& mesh) {
        uint64_t h = hash_position(mesh.positions.front()) + mesh.triangle_vertices.size();
        for (const auto& row : view.objects[i].to_world.m)
            for (float x : row) h = mix(h, std::bit_cast<uint32_t>(x));
        return h;
    };
    const int32_t n = view.object_count;
    std::vector<uint32_t> masks(size_t(n), 0);
    Twins twins(static_cast<size_t>(n));
    for (int32_t i = 0; i < n; ++i) {
        const scene::Mesh* mesh = mesh_of(i);
        if (!mesh) continue;
        masks[size_t(i)] = scene::traits_of(view, i).visibility;
        if (scene::motion_of(view, i).steps == 0) twins.add(hash(i, *mesh));
    }

    // The first of every equal set keeps what all before it do not see.
    constexpr uint32_t unlinked = scene::kVisibleAll & ~uint32_t(scene::kVisibleShadow);  // rays that ask for no blockers
    std::unordered_multimap<uint64_t, int32_t> seen;
    for (int32_t i = 0; i < n; ++i) {
        const scene::Mesh* mesh = mesh_of(i);
        if (!mesh || scene::motion_of(view, i).steps > 0) continue;
        const uint64_t h = hash(i, *mesh);
        if (!twins.may_have_one(h)) continue;
        const scene::TraitsView& traits = scene::traits_of(view, i);
        const auto [begin, end] = seen.equal_range(h);
        for (auto at = begin; at != end; ++at) {
            const int32_t k = at->second;
            if (std::memcmp(&view.objects[k].to_world, &view.objects[i].to_world, sizeof(Affine)) != 0 || !same_mesh(*mesh_of(k), *mesh)) continue;
            const scene::TraitsView& other = scene::traits_of(view, k);
            masks[size_t(i)] &= ~(other.visibility & (other.blocks == traits.blocks ? ~0u : unlinked));
        }
        seen.emplace(h, i);
    }
    return masks;
}

}  // namespace talbot::geometry
