#include "scene/islands.h"

#include <numeric>
#include <utility>

namespace talbot::scene {
namespace {

/// One word through Jenkins' lookup3 finaliser, to 0..1.
float hash_unit(uint32_t word) {
    const auto rotate = [](uint32_t x, int k) { return (x << k) | (x >> (32 - k)); };
    constexpr uint32_t start = 0xdeadbeefu + (1u << 2) + 13u;
    uint32_t a = start + word, b = start, c = start;
    c ^= b;
    c -= rotate(b, 14);
    a ^= c;
    a -= rotate(c, 11);
    b ^= a;
    b -= rotate(a, 25);
    c ^= b;
    c -= rotate(b, 16);
    a ^= c;
    a -= rotate(c, 4);
    b ^= a;
    b -= rotate(a, 14);
    c ^= b;
    c -= rotate(b, 24);
    return float(c) * (1.0f / float(0xffffffffu));
}

}  // namespace

std::vector<float> random_per_island(size_t vertices, std::span<const uint32_t> edges) {
    std::vector<uint32_t> parent(vertices);
    std::vector<uint8_t> rank(vertices, 0);
    std::iota(parent.begin(), parent.end(), 0u);
    const auto root = [&](uint32_t v) {
        while (parent[v] != v) {
            parent[v] = parent[parent[v]];
            v = parent[v];
        }
        return v;
    };
    for (size_t i = 0; i + 1 < edges.size(); i += 2) {
        if (edges[i] >= vertices || edges[i + 1] >= vertices) continue;
        uint32_t a = root(edges[i]), b = root(edges[i + 1]);
        if (a == b) continue;
        if (rank[a] < rank[b]) std::swap(a, b);
        parent[b] = a;
        if (rank[a] == rank[b]) ++rank[a];
    }
    std::vector<float> out(vertices);
    for (size_t v = 0; v < vertices; ++v) out[v] = hash_unit(root(uint32_t(v)));
    return out;
}

}  // namespace talbot::scene
