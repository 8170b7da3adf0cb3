/// The choice among local emitters: in proportion to each one's estimate at the point, by a tree of such estimates where there are many.
#pragma once

#include "base/math.h"
#include "light/emitter_table.h"
#include "light/kernels/descend_tree.h"

namespace talbot::light {

/// Estimated irradiance from `r` at p, without the cosine there. Uniform over lanes but for p; `kind` is r.kind as a constant.
template <ReachKind kind>
TALBOT_INLINE float reach_at(const Reach& r, Vec3 p) {
    const Vec3 d = p - r.center;
    const float d2 = dot(d, d);
    const float inv_d = 1.0f / std::sqrt(maxf(d2, 1e-30f));
    const float plain = minf(r.strength * minf(inv_d * inv_d, r.nearest), 1e28f);
    if constexpr (kind == ReachKind::Isotropic) return plain;

    const float sin_size = minf(r.radius * inv_d, 1.0f), cos_size = safe_sqrt(1.0f - sin_size * sin_size);
    const bool near = sin_size >= 1.0f;
    float c = 0.0f;
    if constexpr (kind == ReachKind::Lambert) {
        c = dot(d, r.axis) * inv_d;
        c = r.two_sided > 0.0f ? lane_abs(c) : c;
        const float front = c - r.behind;
        c = cos_of_difference(c, safe_sqrt(1.0f - c * c), cos_size, sin_size);
        c = near ? 1.0f : c;
        return minf(front, c) > 0.0f ? plain * c : 0.0f;
    } else if constexpr (kind == ReachKind::Oriented) {
        c = dot(d, r.axis) * inv_d;
        c = r.two_sided > 0.0f ? lane_abs(c) : c;
        const float front = c;
        c = cos_of_difference(c, safe_sqrt(1.0f - c * c), r.cos_normals, r.sin_normals);
        c = cos_of_difference(c, safe_sqrt(1.0f - c * c), cos_size, sin_size);
        c = near ? 1.0f : c;
        const float tan = safe_sqrt(1.0f - c * c) / maxf(c, 1e-6f);
        const float lit = c * r.gain * maxf(1.0f - tan * r.inv_tan_limit, 0.02f);
        const float shining = minf(minf(c - r.cos_limit + 1e-5f, c), front - r.behind);
        return shining > 0.0f ? plain * lit : 0.0f;
    } else {
        const float x = dot(r.cone.x, d), y = dot(r.cone.y, d), z = dot(r.cone.z, d);
        c = clampf(-z / maxf(std::sqrt(x * x + y * y + z * z), 1e-30f), -1.0f, 1.0f);
        c = cos_of_difference(c, safe_sqrt(1.0f - c * c), cos_size, sin_size);
        c = near ? 1.0f : c;
        const float t = saturate((c - r.cos_limit) * r.inv_smooth);
        return c < r.cos_limit - 1e-5f ? 0.0f : plain * maxf(t * t * (3.0f - 2.0f * t), 0.01f);
    }
}

struct Choice {
    int32_t* __restrict emitter = nullptr;  ///< -1: none reaches the point
    float* __restrict probability = nullptr;
};

template <ReachKind kind>
TALBOT_INLINE void add_reach(const Reach& reach, ConstColumns3 p, int n, float* __restrict weight, float* __restrict sum) {
    const Reach r = reach;
    ConstColumn px = p.x, py = p.y, pz = p.z;
    TALBOT_VECTOR_LOOP
    for (int i = 0; i < n; ++i) {
        const float w = reach_at<kind>(r, {px[i], py[i], pz[i]});
        weight[i] = w;
        sum[i] += w;
    }
}

/// weight[i] = estimate of one emitter at each lane's point, added to sum[i].
TALBOT_INLINE void weigh_emitter(const Reach& reach, ConstColumns3 p, int n, float* weight, float* sum) {
    switch (reach.kind) {
        case ReachKind::Isotropic:
            add_reach<ReachKind::Isotropic>(reach, p, n, weight, sum);
            break;
        case ReachKind::Lambert:
            add_reach<ReachKind::Lambert>(reach, p, n, weight, sum);
            break;
        case ReachKind::Oriented:
            add_reach<ReachKind::Oriented>(reach, p, n, weight, sum);
            break;
        case ReachKind::Spot:
            add_reach<ReachKind::Spot>(reach, p, n, weight, sum);
            break;
    }
}

/// The same for emitter `e` of the table; 0 where it does not light the lane's receiver (null: it does).
TALBOT_INLINE void weigh_linked(const EmitterView& table, int e, ConstColumns3 p, const int32_t* __restrict receiver, int n, float* __restrict weight,
                                float* __restrict sum) {
    const uint64_t receivers = receiver && table.receivers ? table.receivers[e] : scene::Linking{}.receivers;
    if (receivers == scene::Linking{}.receivers) return weigh_emitter(table.reach[e], p, n, weight, sum);
    float all[kSpan];
    fill(all, n, 0.0f);
    weigh_emitter(table.reach[e], p, n, weight, all);
    for (int i = 0; i < n; ++i) {
        weight[i] = is_lit(receivers, receiver[i]) ? weight[i] : 0.0f;
        sum[i] += weight[i];
    }
}

/// One emitter a lane. `u` in [0, 1). `receiver`: see LightQuery.
TALBOT_INLINE void choose_emitters(const EmitterView& table, ConstColumns3 p, const int32_t* receiver, const float* pick, int n, Choice out) {
    if (table.emitter_count == 1 && !(receiver && table.receivers)) {
        for (int i = 0; i < n; ++i) out.emitter[i] = 0;
        for (int i = 0; i < n; ++i) out.probability[i] = 1.0f;
        return;
    }
    if (table.emitter_leaf) {
        for (int i = 0; i < n; ++i) {
            const int32_t leaf = descend_tree(table.nodes, table.root, {load(p, i), receiver ? receiver[i] : -1}, pick[i], out.probability[i]);
            out.emitter[i] = leaf < 0 ? -1 : table.nodes[leaf].item;
        }
        return;
    }
    float sum[kSpan], below[kSpan], threshold[kSpan];
    float weight[kScannedEmitters][kSpan];
    fill(sum, n, 0.0f);
    for (int e = 0; e < table.emitter_count; ++e) weigh_linked(table, e, p, receiver, n, weight[e], sum);
    for (int i = 0; i < n; ++i) {
        below[i] = 0.0f;
        threshold[i] = pick[i] * sum[i];
        out.emitter[i] = -1;
        out.probability[i] = 0.0f;
    }
    // The last emitter whose running sum does not exceed the threshold: weight 0 is never chosen.
    int32_t* __restrict chosen = out.emitter;
    float* __restrict probability = out.probability;
    for (int e = 0; e < table.emitter_count; ++e) {
        const float* __restrict w = weight[e];
        TALBOT_VECTOR_LOOP
        for (int i = 0; i < n; ++i) {
            const float mine = below[i] <= threshold[i] ? w[i] : 0.0f;
            chosen[i] = mine > 0.0f ? e : chosen[i];
            probability[i] = mine > 0.0f ? mine : probability[i];
            below[i] += w[i];
        }
    }
    for (int i = 0; i < n; ++i) probability[i] /= maxf(sum[i], 1e-37f);
}

/// Probability with which choose_emitters picks `emitter[i]` (>= 0) at p. n <= kSpan.
TALBOT_INLINE void choice_probability(const EmitterView& table, ConstColumns3 p, const int32_t* receiver, const int32_t* emitter, int n,
                                      float* __restrict probability) {
    if (table.emitter_count == 1 && !(receiver && table.receivers)) {
        for (int i = 0; i < n; ++i) probability[i] = 1.0f;
        return;
    }
    if (table.emitter_leaf) {
        for (int i = 0; i < n; ++i) probability[i] = leaf_probability(table.nodes, table.emitter_leaf[emitter[i]], {load(p, i), receiver ? receiver[i] : -1});
        return;
    }
    float sum[kSpan], weight[kSpan];
    fill(sum, n, 0.0f);
    fill(probability, n, 0.0f);
    for (int e = 0; e < table.emitter_count; ++e) {
        weigh_linked(table, e, p, receiver, n, weight, sum);
        TALBOT_VECTOR_LOOP
        for (int i = 0; i < n; ++i) probability[i] = emitter[i] == e ? weight[i] : probability[i];
    }
    for (int i = 0; i < n; ++i) probability[i] /= maxf(sum[i], 1e-37f);
}

}  // namespace talbot::light
