/// The way through a light tree: from the root to one item by the importance of the nodes on the way, and back up for its probability. One lane at a time: the
/// lanes of a span part at the first node.
#pragma once

#include "base/math.h"
#include "light/emitter_table.h"

namespace talbot::light {

/// cos(max(theta - delta, 0)) from the cosines and sines of both.
TALBOT_INLINE float cos_of_difference(float c, float s, float cd, float sd) {
    return c >= cd ? 1.0f : c * cd + s * sd;
}

/// Who asks a tree: a point in its space, and the receiver set there (-1: lit by all).
struct TreeQuery {
    Vec3 p;
    int32_t receiver = -1;
    TreeSpace space = TreeSpace::KeepsAngles;
};

/// Estimate of the irradiance from all below the node [Conty Estevez, Kulla 2018, eq. 3], without the cosine at the receiver: rays that find an emitter do
/// not remember the normal they left. 0 only where nothing below can light the point.
TALBOT_INLINE float node_importance(const TreeNode& node, const TreeQuery& query) {
    if (!is_lit(node.receivers, query.receiver)) return 0.0f;
    if (query.space == TreeSpace::Flat) return node.strength;
    const Vec3 d = query.p - node.center;
    const float d2 = dot(d, d), inv_d = 1.0f / std::sqrt(maxf(d2, 1e-30f));
    const float plain = minf(node.strength * minf(inv_d * inv_d, 1.0f / maxf(node.radius * node.radius, 1e-18f)), 1e28f);
    if (query.space != TreeSpace::KeepsAngles || node.cos_normals <= -1.0f) return plain;
    const float sin_size = minf(node.radius * inv_d, 1.0f);
    if (sin_size >= 1.0f) return plain;
    float c = dot(d, node.axis) * inv_d;
    c = node.two_sided > 0.0f ? lane_abs(c) : c;
    c = cos_of_difference(c, safe_sqrt(1.0f - c * c), node.cos_normals, node.sin_normals);
    c = cos_of_difference(c, safe_sqrt(1.0f - c * c), safe_sqrt(1.0f - sin_size * sin_size), sin_size);
    // A little more than the cone: rounding must not cut off what grazes.
    return c > node.cos_limit - 1e-4f ? plain * maxf(c, 0.02f) : 0.0f;
}

/// Leaf that `u` in [0, 1) leads to from node `root`; -1: nothing there lights the point. `probability` is that of the choice.
TALBOT_INLINE int32_t descend_tree(const TreeNode* nodes, int32_t root, const TreeQuery& query, float u, float& probability) {
    int32_t k = root;
    probability = 1.0f;
    if (nodes[k].children < 0) return is_lit(nodes[k].receivers, query.receiver) ? k : -1;
    while (nodes[k].children >= 0) {
        const int32_t left = nodes[k].children;
        const float a = node_importance(nodes[left], query), b = node_importance(nodes[left + 1], query), sum = a + b;
        if (!(sum > 0.0f)) return -1;
        const float share = a / sum;
        const bool goes_left = u < share;
        k = goes_left ? left : left + 1;
        probability *= goes_left ? share : b / sum;
        u = goes_left ? u / share : (u - share) / maxf(1.0f - share, 1e-7f);
        u = clampf(u, 0.0f, 0.9999999f);
    }
    return k;
}

/// Probability with which descend_tree arrives at `leaf` from the root above it.
TALBOT_INLINE float leaf_probability(const TreeNode* nodes, int32_t leaf, const TreeQuery& query) {
    if (nodes[leaf].parent < 0) return is_lit(nodes[leaf].receivers, query.receiver) ? 1.0f : 0.0f;
    float probability = 1.0f;
    for (int32_t k = leaf; nodes[k].parent >= 0; k = nodes[k].parent) {
        const int32_t left = nodes[nodes[k].parent].children;
        const float a = node_importance(nodes[left], query), b = node_importance(nodes[left + 1], query), sum = a + b;
        if (!(sum > 0.0f)) return 0.0f;
        probability *= (k == left ? a : b) / sum;
    }
    return probability;
}

}  // namespace talbot::light
