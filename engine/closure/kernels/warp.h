/// Random numbers to directions.
#pragma once

#include "base/math.h"
#include "base/vec.h"

namespace talbot {
inline namespace TALBOT_ISA {

/// Cosine-distributed around n (pdf cos / pi). The smallest
/// height is kept off zero so that the pdf never is.
TALBOT_INLINE Vec3 cosine_direction(Vec3 n, float u, float v) {
    const float r2 = minf(v, 0.9999999f);
    const float r = std::sqrt(r2);
    float s, c;
    lane_sincos(2.0f * kPi * u, s, c);
    Vec3 t, b;
    make_basis(n, t, b);
    return t * (r * c) + b * (r * s) + n * std::sqrt(1.0f - r2);
}

/// Uniform in the cone around n whose cosine is cos_max; pdf 1 / (2 pi (1 - cos_max)). `cosine` receives the angle's.
TALBOT_INLINE Vec3 cone_direction(Vec3 n, float one_minus_cos_max, float u, float v, float& cosine) {
    const float d = v * one_minus_cos_max;  // 1 - cosine
    cosine = 1.0f - d;
    const float r = safe_sqrt(d * (2.0f - d));
    float s, c;
    lane_sincos(2.0f * kPi * u, s, c);
    Vec3 t, b;
    make_basis(n, t, b);
    return t * (r * c) + b * (r * s) + n * cosine;
}

}  // namespace TALBOT_ISA
}  // namespace talbot
