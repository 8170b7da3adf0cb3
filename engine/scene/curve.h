/// A segment of a curve: Catmull-Rom through its two keys with their neighbours (the ends stand for neighbours that are missing), or a straight line where
/// curves are traced as cones. Object space; s in 0..1 runs from key to key.
#pragma once

#include "scene/motion.h"

namespace talbot::scene {
inline namespace TALBOT_ISA {

struct CurveSegment {
    Vec3 p[4];
    float r[4] = {0, 0, 0, 0};
    bool linear = false;
};

TALBOT_INLINE CurveSegment curve_segment(const MeshView& mesh, int32_t segment, float time) {
    const uint32_t key = mesh.segment_keys[segment], curve = mesh.segment_curves[segment];
    const uint32_t first = mesh.curve_starts[curve], last = mesh.curve_starts[curve + 1] - 1;
    const uint32_t keys[4] = {key > first ? key - 1 : first, key, key + 1, key + 1 < last ? key + 2 : last};
    CurveSegment c;
    for (int i = 0; i < 4; ++i) {
        c.p[i] = position_at(mesh, keys[i], time);
        c.r[i] = mesh.radii[keys[i]];
    }
    c.linear = mesh.curve_shape == CurveShape::ThickLinear;
    return c;
}

struct CurveWeights {
    float w[4];
};
TALBOT_INLINE CurveWeights curve_weights(bool linear, float s) {
    if (linear) return {{0, 1 - s, s, 0}};
    const float s2 = s * s, s3 = s2 * s;
    return {{0.5f * (2 * s2 - s - s3), 0.5f * (3 * s3 - 5 * s2 + 2), 0.5f * (s + 4 * s2 - 3 * s3), 0.5f * (s3 - s2)}};
}
TALBOT_INLINE CurveWeights curve_slope_weights(bool linear, float s) {
    if (linear) return {{0, -1, 1, 0}};
    const float s2 = s * s;
    return {{0.5f * (4 * s - 1 - 3 * s2), 0.5f * (9 * s2 - 10 * s), 0.5f * (1 + 8 * s - 9 * s2), 0.5f * (3 * s2 - 2 * s)}};
}
TALBOT_INLINE Vec3 weigh(const Vec3 (&p)[4], const CurveWeights& c) {
    return p[0] * c.w[0] + p[1] * c.w[1] + p[2] * c.w[2] + p[3] * c.w[3];
}
TALBOT_INLINE float weigh(const float (&r)[4], const CurveWeights& c) {
    return r[0] * c.w[0] + r[1] * c.w[1] + r[2] * c.w[2] + r[3] * c.w[3];
}

TALBOT_INLINE Vec3 curve_point(const CurveSegment& c, float s) {
    return weigh(c.p, curve_weights(c.linear, s));
}
TALBOT_INLINE float curve_radius(const CurveSegment& c, float s) {
    return maxf(weigh(c.r, curve_weights(c.linear, s)), 0.0f);
}
/// Along the curve, not normalised, never zero: where the spline stands still, its chord.
TALBOT_INLINE Vec3 curve_tangent(const CurveSegment& c, float s) {
    const Vec3 slope = weigh(c.p, curve_slope_weights(c.linear, s)), chord = c.p[2] - c.p[1], reach = c.p[3] - c.p[0];
    if (dot(slope, slope) > 1e-24f * dot(reach, reach) && dot(slope, slope) > 0.0f) return slope;
    if (dot(chord, chord) > 0.0f) return chord;
    return dot(reach, reach) > 0.0f ? reach : Vec3{0, 0, 1};
}

}  // namespace TALBOT_ISA
}  // namespace talbot::scene
