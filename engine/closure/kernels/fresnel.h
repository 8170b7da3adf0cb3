/// Fresnel terms. c is the cosine between direction and microfacet normal, eta the relative index beyond the surface.
#pragma once

#include "base/vec.h"

namespace talbot {
inline namespace TALBOT_ISA {

/// Unpolarised reflectance of a dielectric; 1 under total internal reflection.
TALBOT_INLINE float fresnel_dielectric(float c, float eta) {
    const float g2 = eta * eta - 1.0f + c * c;
    const float g = safe_sqrt(g2);
    const float a = (g - c) / (g + c);
    const float b = (c * (g + c) - 1.0f) / (c * (g - c) + 1.0f);
    const float r = 0.5f * a * a * (1.0f + b * b);
    return g2 > 0.0f ? minf(r, 1.0f) : 1.0f;
}

/// Reflectance at normal incidence.
TALBOT_INLINE float f0_from_eta(float eta) {
    return square((eta - 1.0f) / (eta + 1.0f));
}
TALBOT_INLINE float eta_from_f0(float f0) {
    const float s = std::sqrt(clampf(f0, 0.0f, 0.99f));
    return (1.0f + s) / (1.0f - s);
}

/// Where c lies on the dielectric curve of eta: 0 at normal incidence, 1 at grazing.
TALBOT_INLINE float fresnel_position(float c, float eta) {
    const float f0 = f0_from_eta(eta);
    return saturate((fresnel_dielectric(c, eta) - f0) / maxf(1.0f - f0, 1e-6f));
}

TALBOT_INLINE float pow5(float x) {
    return square(square(x)) * x;
}

/// F82 of one channel. b: see fresnel_f82_b.
TALBOT_INLINE float fresnel_f82(float c, float f0, float b) {
    const float s = saturate(1.0f - c);
    const float s5 = pow5(s);
    return saturate(f0 + (1.0f - f0) * s5 - b * c * s5 * s);
}
/// The coefficient that makes the curve pass through tint times Schlick's value at 82 degrees (cosine 1/7).
TALBOT_INLINE float fresnel_f82_b(float f0, float tint) {
    constexpr float kS = 6.0f / 7.0f, kS5 = kS * kS * kS * kS * kS;
    return (f0 + (1.0f - f0) * kS5) * (7.0f / (kS5 * kS)) * (1.0f - tint);
}

/// Unpolarised reflectance of a conductor n + i k, one channel, seen from vacuum. approximate: 1 as for indices so large that light goes
/// straight down inside (Blender before 5.0; [Pharr & Humphreys 2004, "Physically Based Rendering", 9.2]).
TALBOT_INLINE float fresnel_conductor(float c, float n, float k, float approximate) {
    const float c2 = c * c, s2 = 1.0f - c2;
    const float n2 = n * n, k2 = k * k;
    const float m2 = n2 + k2, both = 2.0f * n * c;
    const float near_s = (m2 - both + c2) / maxf(m2 + both + c2, 1e-20f), near_p = (m2 * c2 - both + 1.0f) / (m2 * c2 + both + 1.0f);
    const float t0 = n2 - k2 - s2;
    const float a2b2 = safe_sqrt(t0 * t0 + 4.0f * n2 * k2);
    const float a = safe_sqrt(0.5f * (a2b2 + t0));
    const float t1 = a2b2 + c2, t2 = 2.0f * a * c;
    const float rs = (t1 - t2) / maxf(t1 + t2, 1e-20f);
    const float t3 = c2 * a2b2 + s2 * s2, t4 = t2 * s2;
    const float rp = rs * (t3 - t4) / maxf(t3 + t4, 1e-20f);
    return saturate(0.5f * (approximate != 0.0f ? near_s + near_p : rs + rp));
}

}  // namespace TALBOT_ISA
}  // namespace talbot
