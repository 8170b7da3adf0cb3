/// The microfiber sheen's linear map and albedo by viewing cosine and roughness
/// [Zeltner, Burley & Chiang 2022, "Practical Multiple-Scattering Sheen Using Linearly Transformed Cosines"], by the rational fits
/// that the MaterialX project publishes for the paper's tables. The albedo is within 0.006 of the measured values of Cycles,
/// worst at normal incidence and middle roughness.
#pragma once

#include "base/math.h"
#include "base/vec.h"

namespace talbot {
inline namespace TALBOT_ISA {

struct SheenFit {
    float a, b, albedo;
};

/// c: cosine between normal and viewer; y: roughness.
TALBOT_INLINE SheenFit sheen_fit(float c, float y) {
    const float x = saturate(c);
    SheenFit fit;
    fit.a = maxf((2.58126f * x + 0.813703f * y) * y / (1.0f + 0.310327f * x * x + 2.60994f * x * y), 1e-5f);
    fit.b = std::sqrt(1.0f - x) * (y - 1.0f) * y * y * y / (0.0000254053f + 1.71228f * x - 1.71506f * x * y + 1.34174f * y * y);
    const float s = maxf(y * (0.0206607f + 1.58491f * y) / (0.0379424f + y * (1.32227f + y)), 1e-4f);
    const float m = y * (-0.193854f + y * (-1.14885f + y * (1.7932f - 0.95943f * y * y))) / (0.046391f + y);
    const float o = y * (0.000654023f + (-0.0207818f + 0.119681f * y) * y) / (1.26264f + y * (-1.92021f + y));
    const float peak = lane_exp(maxf(-0.5f * square((x - m) / s), -80.0f)) / (s * 2.50662827f);
    fit.albedo = saturate(peak + o);
    return fit;
}

}  // namespace TALBOT_ISA
}  // namespace talbot
