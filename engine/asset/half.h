/// Half floats as texels hold them: finite, 16 bits. Denormals go through the integer, for workers flush denormal floats.
#pragma once

#include "base/lanes.h"

namespace talbot::asset {

TALBOT_INLINE float half_to_float(uint32_t h) {
    const uint32_t magnitude = h & 0x7fffu;
    const float normal = as_float((magnitude << 13) + 0x38000000u);
    const float denormal = float(int32_t(magnitude)) * 0x1p-24f;
    const float value = magnitude < 0x400u ? denormal : normal;
    return as_float(as_uint(value) | ((h & 0x8000u) << 16));
}

/// Nearest half (ties to even) of a finite float; what is too large becomes the largest, 65504.
TALBOT_INLINE uint16_t float_to_half(float f) {
    const uint32_t bits = as_uint(f), sign = bits >> 16 & 0x8000u, magnitude = bits & 0x7fffffffu;
    if (magnitude >= 0x477fe000u) return uint16_t(sign | 0x7bffu);
    if (magnitude < 0x38800000u) return uint16_t(sign | uint32_t(std::nearbyint(as_float(magnitude) * 0x1p24f)));
    return uint16_t(sign | ((magnitude - 0x38000000u + 0xfffu + (magnitude >> 13 & 1u)) >> 13));
}

}  // namespace talbot::asset
