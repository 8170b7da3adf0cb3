/// What the hair closures share: angles around a fibre, and the longitudinal and azimuthal distributions of
/// [d'Eon et al. 2011, "An Energy-Conserving Hair Reflectance Model"] and [Chiang et al. 2016, "A Practical and Controllable Hair and Fur Model for
/// Production Path Tracing"].
///
/// Frame: t along the fibre, f the viewer's direction made perpendicular to t ("front"), a = t x f / |.| across. theta is the angle of a direction to
/// the plane across the fibre (sin theta = t . w), phi its azimuth from f towards a. gamma is the azimuth of the fibre's normal where it is hit.
#pragma once

#include "base/math.h"
#include "closure/kernels/fresnel.h"
#include "closure/kernels/lobe.h"

namespace talbot {
inline namespace TALBOT_ISA {

struct Fibre {
    Vec3 t, a, f;
    float sin_o, cos_o;  ///< of the viewer's theta
};
TALBOT_INLINE Fibre make_fibre(Vec3 tangent, Vec3 wo) {
    const float l2 = dot(tangent, tangent);
    const bool usable = (l2 > 1e-20f) & (l2 < 1e30f);
    const float s = 1.0f / std::sqrt(usable ? l2 : 1.0f);
    const Vec3 t{usable ? tangent.x * s : 1.0f, usable ? tangent.y * s : 0.0f, usable ? tangent.z * s : 0.0f};
    const Frame frame = make_frame(t, cross(t, wo), true);
    const float sin_o = clampf(dot(t, wo), -1.0f, 1.0f);
    return {t, frame.x, cross(frame.x, t), sin_o, safe_sqrt(1.0f - sin_o * sin_o)};
}
TALBOT_INLINE float azimuth(const Fibre& fibre, Vec3 w) {
    return lane_atan2(dot(fibre.a, w), dot(fibre.f, w));
}
TALBOT_INLINE Vec3 fibre_direction(const Fibre& fibre, float sin_theta, float phi) {
    float s, c;
    lane_sincos(phi, s, c);
    const float cos_theta = safe_sqrt(1.0f - sin_theta * sin_theta);
    return fibre.t * sin_theta + fibre.f * (cos_theta * c) + fibre.a * (cos_theta * s);
}

TALBOT_INLINE float wrap_angle(float x) {
    return x - kTwoPi * lane_floor(x * (1.0f / kTwoPi) + 0.5f);
}

/// ln I0(x), x >= 0, the modified Bessel function of order 0; absolute error 2e-7 [Abramowitz & Stegun 1964, 9.8.1 and 9.8.2].
TALBOT_INLINE float log_bessel_i0(float x) {
    const float q = square(minf(x, 3.75f) * (1.0f / 3.75f));
    const float small = 1.0f + q * (3.5156229f + q * (3.0899424f + q * (1.2067492f + q * (0.2659732f + q * (0.0360768f + q * 0.0045813f)))));
    const float big = maxf(x, 3.75f), r = 3.75f / big;
    float p = 0.00392377f;
    p = p * r - 0.01647633f;
    p = p * r + 0.02635537f;
    p = p * r - 0.02057706f;
    p = p * r + 0.00916281f;
    p = p * r - 0.00157565f;
    p = p * r + 0.00225319f;
    p = p * r + 0.01328592f;
    p = p * r + 0.39894228f;
    const float tail = big - 0.5f * lane_log(big);
    const float l = lane_log(x < 3.75f ? small : p);
    return x < 3.75f ? l : l + tail;
}

/// Longitudinal scattering of variance v, per cos theta dtheta, for any v: exp(-sin sin / v) I0(cos cos / v) / (2 v sinh(1/v)) [d'Eon et al. 2011, (7)].
TALBOT_INLINE float longitudinal(float sin_i, float cos_i, float sin_o, float cos_o, float v) {
    const float inverse = 1.0f / v;
    const float exponent = log_bessel_i0(cos_i * cos_o * inverse) - sin_i * sin_o * inverse - inverse;
    return lane_exp(minf(exponent, 80.0f)) * inverse / (1.0f - lane_exp(-2.0f * inverse));
}
/// sin theta of a direction drawn from it [d'Eon et al. 2013, "Importance Sampling for Physically-Based Hair Fiber Models"].
TALBOT_INLINE float sample_longitudinal(float sin_o, float cos_o, float v, float u, float w) {
    const float x = clampf(u, 1e-6f, 1.0f);
    const float c = clampf(1.0f + v * lane_log(x + (1.0f - x) * lane_exp(-2.0f / v)), -1.0f, 1.0f);
    return clampf(-c * sin_o + safe_sqrt(1.0f - c * c) * lane_cos(kTwoPi * w) * cos_o, -1.0f, 1.0f);
}

/// Logistic distribution of scale s on [-pi, pi].
TALBOT_INLINE float logistic_tail(float s) {
    return 1.0f / (1.0f + lane_exp(minf(kPi / s, 85.0f)));
}
TALBOT_INLINE float trimmed_logistic(float x, float s) {
    const float e = lane_exp(-lane_abs(x) / s);
    return e / (s * square(1.0f + e) * (1.0f - 2.0f * logistic_tail(s)));
}
TALBOT_INLINE float sample_logistic(float s, float u) {
    const float tail = logistic_tail(s);
    const float c = clampf(tail + u * (1.0f - 2.0f * tail), 1e-7f, 1.0f - 1e-7f);
    return clampf(s * lane_log(c / (1.0f - c)), -kPi, kPi);
}

/// Turns (sin, cos) of an angle by -delta; the angle stays a theta, its cosine positive.
TALBOT_INLINE void tilt(float sin_theta, float cos_theta, float sin_delta, float cos_delta, float& s, float& c) {
    s = sin_theta * cos_delta - cos_theta * sin_delta;
    c = lane_abs(cos_theta * cos_delta + sin_theta * sin_delta);
}

/// Refraction in the plane across the fibre, by the effective index, and what each lobe carries: R, TT, TRT, and all that is left.
struct FibrePath {
    float gamma_o, gamma_t;
    Rgb carried[4];
    /// Azimuth of lobe p's middle.
    TALBOT_MEMBER float middle(int p) const { return 2.0f * gamma_o - float(p) * (2.0f * gamma_t - kPi); }
};
TALBOT_INLINE FibrePath follow_fibre(const Fibre& fibre, float sin_gamma, float eta, Rgb sigma) {
    FibrePath path;
    const float h = clampf(sin_gamma, -1.0f, 1.0f);
    const float sin_theta_t = fibre.sin_o / eta, cos_theta_t = maxf(safe_sqrt(1.0f - sin_theta_t * sin_theta_t), 1e-4f);
    const float bent = clampf(h * fibre.cos_o / maxf(safe_sqrt(eta * eta - fibre.sin_o * fibre.sin_o), 1e-4f), -1.0f, 1.0f);
    path.gamma_o = lane_asin(h);
    path.gamma_t = lane_asin(bent);
    const float length = 2.0f * safe_sqrt(1.0f - bent * bent) / cos_theta_t;
    const Rgb t{lane_exp(-sigma.x * length), lane_exp(-sigma.y * length), lane_exp(-sigma.z * length)};
    const float f = saturate(fresnel_dielectric(fibre.cos_o * safe_sqrt(1.0f - h * h), eta));
    path.carried[0] = vec3(f);
    path.carried[1] = t * square(1.0f - f);
    path.carried[2] = path.carried[1] * t * f;
    const Rgb again = t * f;
    path.carried[3] =
        path.carried[2] * Rgb{again.x / maxf(1.0f - again.x, 1e-6f), again.y / maxf(1.0f - again.y, 1e-6f), again.z / maxf(1.0f - again.z, 1e-6f)};
    return path;
}

}  // namespace TALBOT_ISA
}  // namespace talbot
