/// Light trees: binary, one item a leaf, split by the surface area orientation heuristic [Conty Estevez, Kulla 2018, "Importance Sampling of Many Lights with
/// Adaptive Tree Splitting", section 4].
#include <algorithm>
#include <cmath>
#include <numeric>

#include "light/emitter_table.h"

namespace talbot::light {
namespace {

constexpr int kBuckets = 12;
constexpr size_t kThoroughItems = 4096;

/// Normals within `normals` of the axis, light within `limit` of a normal; radians. Two-sided: the axis counts in both directions.
struct Cone {
    Vec3 axis{0, 0, 1};
    double normals = 0, limit = 0;
    bool two_sided = false, empty = true;
};

Cone whole_sphere(double limit) {
    Cone cone;
    cone.normals = M_PI;
    cone.limit = limit;
    cone.empty = false;
    return cone;
}

/// The smallest cone about both, by section 4.1's algorithm 1.
Cone unite(Cone a, Cone b) {
    if (a.empty) return b;
    if (b.empty) return a;
    const double limit = std::max(a.limit, b.limit);
    if (a.two_sided != b.two_sided) return whole_sphere(limit);
    if (a.normals < b.normals) std::swap(a, b);
    if (a.two_sided && dot(a.axis, b.axis) < 0) b.axis = -b.axis;
    const double between = std::acos(std::clamp(double(dot(a.axis, b.axis)), -1.0, 1.0));
    a.limit = limit;
    if (std::min(between + b.normals, M_PI) <= a.normals) return a;
    const double normals = (a.normals + between + b.normals) / 2;
    if (normals >= (a.two_sided ? M_PI / 2 : M_PI)) return whole_sphere(limit);
    // The axis turns from a's towards b's.
    const double turn = normals - a.normals;
    const Vec3 across = b.axis - a.axis * dot(a.axis, b.axis);
    if (!(length(across) > 0)) return whole_sphere(limit);
    a.axis = normalize(a.axis * float(std::cos(turn)) + normalize(across) * float(std::sin(turn)));
    a.normals = normals;
    return a;
}

/// Measure of the directions into which the cone sends light, section 4.2.
double measure(const Cone& cone) {
    const double o = cone.normals, w = std::min(o + cone.limit, M_PI);
    const double one = 2 * M_PI * (1 - std::cos(o)) + M_PI / 2 * (2 * w * std::sin(o) - std::cos(o - 2 * w) - 2 * o * std::sin(o) + std::cos(o));
    return cone.two_sided ? std::min(2 * one, 4 * M_PI) : one;
}

struct Bounds {
    Vec3 low = vec3(1e30f), high = vec3(-1e30f);
    Cone cone;
    double strength = 0;
    uint64_t receivers = 0;

    void add(const Bounds& b) {
        low = {std::min(low.x, b.low.x), std::min(low.y, b.low.y), std::min(low.z, b.low.z)};
        high = {std::max(high.x, b.high.x), std::max(high.y, b.high.y), std::max(high.z, b.high.z)};
        cone = unite(cone, b.cone);
        strength += b.strength;
        receivers |= b.receivers;
    }
    double cost() const {
        const Vec3 d = high - low;
        const double area = 2 * (double(d.x) * d.y + double(d.y) * d.z + double(d.z) * d.x);
        // Lamps in a row have no area, only a length.
        return strength * measure(cone) * (area + 1e-3 * double(dot(d, d)) + 1e-30);
    }
};

Bounds bounds_of(const TreeItem& item) {
    Bounds b;
    b.low = item.center - vec3(item.radius);
    b.high = item.center + vec3(item.radius);
    b.strength = double(item.strength);
    b.receivers = item.receivers;
    b.cone.empty = false;
    b.cone.axis = item.axis;
    b.cone.two_sided = item.two_sided;
    b.cone.normals = std::acos(std::clamp(double(item.cos_normals), -1.0, 1.0));
    b.cone.limit = std::acos(std::clamp(double(item.cos_limit), 0.0, 1.0));
    return b;
}

float component(Vec3 v, int axis) {
    return axis == 0 ? v.x : axis == 1 ? v.y : v.z;
}

void set_bounds(const Bounds& b, TreeNode& node) {
    node.center = (b.low + b.high) * 0.5f;
    node.radius = 0.5f * length(b.high - b.low);
    node.strength = float(std::min(b.strength, 1e28));
    node.axis = b.cone.axis;
    // A little wider than computed: rounding must not cut off what grazes.
    const double normals = b.cone.normals > 0 ? std::min(b.cone.normals + 1e-3, M_PI) : 0;
    node.cos_normals = normals >= M_PI ? -1.0f : float(std::cos(normals));
    node.sin_normals = float(std::sin(normals));
    node.cos_limit = float(std::cos(b.cone.limit));
    node.two_sided = b.cone.two_sided ? 1.0f : 0.0f;
    node.receivers = b.receivers;
}

/// Part of `order` that a node holds.
struct Range {
    size_t begin = 0, end = 0;
    int32_t node = 0;
};

/// Sorts the range into two at the cheapest of all buckets' borders; where items lie in one place, by number.
size_t split(const std::vector<TreeItem>& items, const std::vector<Bounds>& bounds, std::vector<uint32_t>& order, const Range& range) {
    Vec3 low = vec3(1e30f), high = vec3(-1e30f);
    for (size_t i = range.begin; i < range.end; ++i) {
        const Vec3 c = items[order[i]].center;
        low = {std::min(low.x, c.x), std::min(low.y, c.y), std::min(low.z, c.z)};
        high = {std::max(high.x, c.x), std::max(high.y, c.y), std::max(high.z, c.z)};
    }
    const Vec3 size = high - low;
    const float longest = max_component(size);
    const auto bucket_of = [&](uint32_t item, int axis) {
        const float place = (component(items[item].center, axis) - component(low, axis)) / component(size, axis);
        return std::clamp(int(place * kBuckets), 0, kBuckets - 1);
    };
    double best = INFINITY;
    int best_axis = -1, best_bucket = 0;
    for (int axis = 0; axis < 3; ++axis) {
        // In long lists the longest side only: what the others could save is not worth the time.
        if (!(component(size, axis) > 0) || (range.end - range.begin > kThoroughItems && component(size, axis) < longest)) continue;
        Bounds buckets[kBuckets];
        for (size_t i = range.begin; i < range.end; ++i) buckets[bucket_of(order[i], axis)].add(bounds[order[i]]);
        double above[kBuckets] = {};
        Bounds sum;
        for (int k = kBuckets - 1; k > 0; --k) {
            sum.add(buckets[k]);
            above[k] = sum.strength > 0 ? sum.cost() : -1;
        }
        // Thin slabs are worse than their area says.
        const double regular = double(longest) / double(component(size, axis));
        sum = {};
        for (int k = 0; k + 1 < kBuckets; ++k) {
            sum.add(buckets[k]);
            if (!(sum.strength > 0) || above[k + 1] < 0) continue;
            const double cost = regular * (sum.cost() + above[k + 1]);
            if (cost < best) {
                best = cost;
                best_axis = axis;
                best_bucket = k;
            }
        }
    }
    const size_t half = (range.begin + range.end) / 2;
    if (best_axis < 0) return half;
    const auto first = order.begin() + std::ptrdiff_t(range.begin), last = order.begin() + std::ptrdiff_t(range.end);
    const auto middle = std::stable_partition(first, last, [&](uint32_t item) { return bucket_of(item, best_axis) <= best_bucket; });
    const size_t at = size_t(middle - order.begin());
    return at == range.begin || at == range.end ? half : at;
}

}  // namespace

int32_t add_tree(const std::vector<TreeItem>& items, EmitterTable& table, std::vector<int32_t>& leaves) {
    std::vector<TreeNode>& nodes = table.nodes;
    std::vector<Bounds> bounds;
    bounds.reserve(items.size());
    for (const TreeItem& item : items) bounds.push_back(bounds_of(item));
    std::vector<uint32_t> order(items.size());
    std::iota(order.begin(), order.end(), 0u);
    leaves.assign(items.size(), -1);

    const int32_t root = int32_t(nodes.size());
    std::vector<Range> open{{0, items.size(), root}};
    nodes.emplace_back();
    while (!open.empty()) {
        const Range range = open.back();
        open.pop_back();
        if (range.end - range.begin == 1) {
            leaves[order[range.begin]] = range.node;
            nodes[size_t(range.node)].item = int32_t(order[range.begin]);
            continue;
        }
        const size_t middle = split(items, bounds, order, range);
        const int32_t left = int32_t(nodes.size());
        nodes[size_t(range.node)].children = left;
        for (int32_t child : {left, left + 1}) {
            nodes.emplace_back();
            nodes.back().parent = range.node;
            open.push_back(child == left ? Range{range.begin, middle, child} : Range{middle, range.end, child});
        }
    }
    // Children come after their parents: bounds from the last node to the first.
    std::vector<Bounds> of_node(nodes.size() - size_t(root));
    for (size_t k = nodes.size(); k-- > size_t(root);) {
        TreeNode& node = nodes[k];
        Bounds& own = of_node[k - size_t(root)];
        if (node.children < 0) own = bounds[size_t(node.item)];
        set_bounds(own, node);
        if (node.children < 0) {
            node.center = items[size_t(node.item)].center;
            node.radius = items[size_t(node.item)].radius;
        }
        if (node.parent >= 0) of_node[size_t(node.parent - root)].add(own);
    }
    return root;
}

}  // namespace talbot::light
