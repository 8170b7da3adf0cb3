/// Microfacet distributions in the local frame (z = normal), anisotropic. D: normal distribution, lambda: Smith's auxiliary
/// function, G1 = 1 / (1 + lambda). [Walter et al. 2007, "Microfacet Models for Refraction through Rough Surfaces"],
/// [Heitz 2014, "Understanding the Masking-Shadowing Function in Microfacet-Based BRDFs"].
#pragma once

#include "base/math.h"
#include "base/vec.h"

namespace talbot {
inline namespace TALBOT_ISA {

/// tan^2 of w scaled by the widths: (ax x / z)^2 + (ay y / z)^2.
TALBOT_INLINE float stretched_tan2(float ax, float ay, Vec3 w) {
    const float z2 = maxf(w.z * w.z, 1e-12f);
    return (square(ax * w.x) + square(ay * w.y)) / z2;
}

TALBOT_INLINE float ggx_lambda(float ax, float ay, Vec3 w) {
    return 0.5f * (std::sqrt(1.0f + stretched_tan2(ax, ay, w)) - 1.0f);
}
TALBOT_INLINE float ggx_d(float ax, float ay, Vec3 h) {
    const float q = square(h.x / ax) + square(h.y / ay) + h.z * h.z;
    return 1.0f / (kPi * ax * ay * q * q);
}

/// Walter's rational approximation of Beckmann's lambda.
TALBOT_INLINE float beckmann_lambda(float ax, float ay, Vec3 w) {
    const float t = maxf(stretched_tan2(ax, ay, w), 1e-12f);
    const float a = 1.0f / std::sqrt(t);
    const float inside = ((0.396f * a - 1.259f) * a + 1.0f) / ((2.181f * a + 3.535f) * a);
    return a < 1.6f ? maxf(inside, 0.0f) : 0.0f;
}
TALBOT_INLINE float beckmann_d(float ax, float ay, Vec3 h) {
    const float z2 = maxf(h.z * h.z, 1e-8f);
    return lane_exp(maxf(-(square(h.x / ax) + square(h.y / ay)) / z2, -80.0f)) / (kPi * ax * ay * z2 * z2);
}

/// A normal of GGX as seen from w (w.z > 0): the reflected direction is uniform on a spherical cap of the stretched
/// configuration [Dupuy & Benyoub 2023, "Sampling Visible GGX Normals with Spherical Caps"]. pdf = G1(w) D(h) max(w.h, 0) / w.z.
TALBOT_INLINE Vec3 sample_ggx_visible(float ax, float ay, Vec3 w, float u, float v) {
    const Vec3 ws = normalize(Vec3{ax * w.x, ay * w.y, w.z});
    float s, c;
    lane_sincos(2.0f * kPi * u, s, c);
    const float z = (1.0f - v) * (1.0f + ws.z) - ws.z;
    const float r = safe_sqrt(1.0f - z * z);
    const Vec3 h{r * c + ws.x, r * s + ws.y, z + ws.z};
    return normalize(Vec3{h.x * ax, h.y * ay, maxf(h.z, 1e-12f)});
}

}  // namespace TALBOT_ISA
}  // namespace talbot
