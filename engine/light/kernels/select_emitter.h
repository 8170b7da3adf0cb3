/// The choice among local emitters: in proportion to each one's estimate at the point, or by power where there are many.
#pragma once

#include "base/math.h"
#include "light/emitter_table.h"

namespace talbot::light {

/// cos(max(theta - delta, 0)) from the cosines and sines of both.
TALBOT_INLINE float cos_of_difference(float c, float s, float cd, float sd) {
    return c >= cd ? 1.0f : c * cd + s * sd;
}

/// Estimated irradiance from `r` at p, without the cosine there. Uniform over lanes but for p; `kind` is r.kind as a constant.
template <ReachKind kind>
TALBOT_INLINE float reach_at(const Reach& r, Vec3 p) {
    const Vec3 d = p - r.center;
    const float d2 = dot(d, d), r2 = r.radius * r.radius;
    const float plain = minf(r.strength / maxf(maxf(d2, r2), 1e-18f), 1e28f);
    if constexpr (kind == ReachKind::Isotropic) return plain;

    const float inv_d = 1.0f / std::sqrt(maxf(d2, 1e-30f));
    const float sin_size = minf(r.radius * inv_d, 1.0f), cos_size = safe_sqrt(1.0f - sin_size * sin_size);
    const bool near = d2 <= r2;
    float c = 0.0f;
    if constexpr (kind == ReachKind::Oriented) {
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
TALBOT_INLINE void offer(const Reach& reach, int32_t index, ConstColumns3 p, int n, float* __restrict sum, float* __restrict u, float* __restrict weight,
                         int32_t* __restrict emitter) {
    const Reach r = reach;
    ConstColumn px = p.x, py = p.y, pz = p.z;
    TALBOT_VECTOR_LOOP
    for (int i = 0; i < n; ++i) {
        const float w = reach_at<kind>(r, {px[i], py[i], pz[i]});
        const float before = sum[i], after = before + w, scaled = u[i] * after;
        const bool take = scaled < w;
        // What is left of the random number is uniform again: the running choice is an inverse CDF read backwards, and stays stratified.
        const float left = take ? scaled / maxf(w, 1e-37f) : (scaled - w) / maxf(before, 1e-37f);
        u[i] = clampf(left, 0.0f, 0.99999994f);
        sum[i] = after;
        weight[i] = take ? w : weight[i];
        emitter[i] = take ? index : emitter[i];
    }
}

/// One emitter a lane. `u` in [0, 1).
TALBOT_INLINE void choose_emitters(const EmitterView& table, ConstColumns3 p, const float* pick, int n, Choice out) {
    if (table.emitter_count == 1) {
        for (int i = 0; i < n; ++i) out.emitter[i] = 0;
        for (int i = 0; i < n; ++i) out.probability[i] = 1.0f;
        return;
    }
    if (table.alias) {
        for (int i = 0; i < n; ++i) {
            const float scaled = pick[i] * float(table.emitter_count);
            const int32_t k = int32_t(minf(scaled, float(table.emitter_count - 1)));
            const int32_t chosen = scaled - float(k) < table.alias[k].accept ? k : table.alias[k].alias;
            out.emitter[i] = chosen;
            out.probability[i] = table.alias[chosen].probability;
        }
        return;
    }
    float sum[kSpan], u[kSpan];
    for (int i = 0; i < n; ++i) {
        sum[i] = 0.0f;
        u[i] = pick[i];
        out.emitter[i] = -1;
        out.probability[i] = 0.0f;
    }
    for (int e = 0; e < table.emitter_count; ++e) {
        switch (table.reach[e].kind) {
            case ReachKind::Isotropic: offer<ReachKind::Isotropic>(table.reach[e], e, p, n, sum, u, out.probability, out.emitter); break;
            case ReachKind::Oriented: offer<ReachKind::Oriented>(table.reach[e], e, p, n, sum, u, out.probability, out.emitter); break;
            case ReachKind::Spot: offer<ReachKind::Spot>(table.reach[e], e, p, n, sum, u, out.probability, out.emitter); break;
        }
    }
    for (int i = 0; i < n; ++i) out.probability[i] /= maxf(sum[i], 1e-37f);
}

template <ReachKind kind>
TALBOT_INLINE void weigh(const Reach& reach, int32_t index, ConstColumns3 p, int n, float* __restrict sum, float* __restrict weight,
                         const int32_t* __restrict emitter) {
    const Reach r = reach;
    ConstColumn px = p.x, py = p.y, pz = p.z;
    TALBOT_VECTOR_LOOP
    for (int i = 0; i < n; ++i) {
        const float w = reach_at<kind>(r, {px[i], py[i], pz[i]});
        sum[i] += w;
        weight[i] = emitter[i] == index ? w : weight[i];
    }
}

/// Probability with which choose_emitters picks `emitter[i]` (>= 0) at p. n <= kSpan.
TALBOT_INLINE void choice_probability(const EmitterView& table, ConstColumns3 p, const int32_t* emitter, int n, float* __restrict probability) {
    if (table.emitter_count == 1) {
        for (int i = 0; i < n; ++i) probability[i] = 1.0f;
        return;
    }
    if (table.alias) {
        for (int i = 0; i < n; ++i) probability[i] = table.alias[emitter[i]].probability;
        return;
    }
    float sum[kSpan];
    for (int i = 0; i < n; ++i) sum[i] = probability[i] = 0.0f;
    for (int e = 0; e < table.emitter_count; ++e) {
        switch (table.reach[e].kind) {
            case ReachKind::Isotropic: weigh<ReachKind::Isotropic>(table.reach[e], e, p, n, sum, probability, emitter); break;
            case ReachKind::Oriented: weigh<ReachKind::Oriented>(table.reach[e], e, p, n, sum, probability, emitter); break;
            case ReachKind::Spot: weigh<ReachKind::Spot>(table.reach[e], e, p, n, sum, probability, emitter); break;
        }
    }
    for (int i = 0; i < n; ++i) probability[i] /= maxf(sum[i], 1e-37f);
}

}  // namespace talbot::light
