#include "scene/islands.h"

#include <numeric>
#include <utility>

#include "base/hash.h"

namespace talbot::scene {

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
    for (size_t v = 0; v < vertices; ++v) out[v] = hash_to_unit(hash_words(root(uint32_t(v))));
    return out;
}

}  // namespace talbot::scene
