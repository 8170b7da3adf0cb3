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

/// erf for x >= 0, absolute error 2e-7 [Abramowitz & Stegun 1964, 7.1.26].
TALBOT_INLINE float erf_positive(float x, float exp_minus_x2) {
    const float t = 1.0f / (1.0f + 0.3275911f * x);
    const float p = ((((1.061405429f * t - 1.453152027f) * t + 1.421413741f) * t - 0.284496736f) * t + 0.254829592f) * t;
    return 1.0f - p * exp_minus_x2;
}

/// Inverse of erf on (-1, 1), relative error 4e-7 [Giles 2010, "Approximating the erfinv Function"].
TALBOT_INLINE float erf_inverse(float x) {
    const float w = -lane_log(maxf((1.0f - x) * (1.0f + x), 1e-12f));
    const float a = w - 2.5f, b = std::sqrt(w) - 3.0f;
    float p = 2.81022636e-08f, q = -0.000200214257f;
    p = 3.43273939e-07f + p * a, q = 0.000100950558f + q * b;
    p = -3.5233877e-06f + p * a, q = 0.00134934322f + q * b;
    p = -4.39150654e-06f + p * a, q = -0.00367342844f + q * b;
    p = 0.00021858087f + p * a, q = 0.00573950773f + q * b;
    p = -0.00125372503f + p * a, q = -0.0076224613f + q * b;
    p = -0.00417768164f + p * a, q = 0.00943887047f + q * b;
    p = 0.246640727f + p * a, q = 1.00167406f + q * b;
    p = 1.50140941f + p * a, q = 2.83297682f + q * b;
    return (w < 5.0f ? p : q) * x;
}

inline constexpr float kHalfInvSqrtPi = 0.28209479177387814f;

/// 1 / G1 of Beckmann, exact: (1 + erf a) / 2 + tan exp(-a^2) / (2 sqrt pi), a = 1 / tan of the stretched angle.
TALBOT_INLINE float beckmann_visible_norm(float ax, float ay, Vec3 w) {
    const float tan = std::sqrt(stretched_tan2(ax, ay, w));
    const float a = minf(1.0f / maxf(tan, 1e-6f), 9.0f), e = lane_exp(-a * a);
    return 0.5f * (1.0f + erf_positive(a, e)) + tan * e * kHalfInvSqrtPi;
}

/// A normal of Beckmann as seen from w (w.z > 0). Slopes of the stretched surface: Gaussian across the view, and along it the density
/// (1 - x tan) exp(-x^2), whose distribution function is inverted in b = erf(x) by Newton's method: it is concave in b, so the steps converge
/// from one side [Heitz & d'Eon 2014], [Jakob 2014, "An Improved Visible Normal Sampling Routine for the Beckmann Distribution"].
TALBOT_INLINE Vec3 sample_beckmann_visible(float ax, float ay, Vec3 w, float u, float v) {
    const float x = ax * w.x, y = ay * w.y;
    const float sin2 = x * x + y * y;
    const float inv_sin = sin2 > 1e-24f ? 1.0f / std::sqrt(sin2) : 0.0f;
    const float cos_phi = sin2 > 1e-24f ? x * inv_sin : 1.0f, sin_phi = y * inv_sin;
    const float tan = std::sqrt(sin2) / maxf(w.z, 1e-6f);
    const float a = minf(1.0f / maxf(tan, 1e-6f), 9.0f), e = lane_exp(-a * a);
    const float limit = erf_positive(a, e);
    const float target = u * (0.5f * (1.0f + limit) + tan * e * kHalfInvSqrtPi);
    constexpr float kEdge = 0.9999998f;
    float b = clampf(u * (1.0f + limit) - 1.0f, -kEdge, kEdge);
    float slope = erf_inverse(b);
    // Unrolled, or the loop over lanes around it would not vectorise.
#pragma GCC unroll 6
    for (int step = 0; step < 6; ++step) {
        const float value = 0.5f * (1.0f + b) + tan * lane_exp(-slope * slope) * kHalfInvSqrtPi - target;
        const float derivative = maxf(0.5f * (1.0f - slope * tan), 1e-4f);
        b = clampf(b - value / derivative, -kEdge, minf(limit, kEdge));
        slope = erf_inverse(b);
    }
    const float across = erf_inverse(clampf(2.0f * v - 1.0f, -kEdge, kEdge));
    const float sx = cos_phi * slope - sin_phi * across, sy = sin_phi * slope + cos_phi * across;
    return normalize(Vec3{-ax * sx, -ay * sy, 1.0f});
}

}  // namespace TALBOT_ISA
}  // namespace talbot
