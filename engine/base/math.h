/// Elementary functions for loops over lanes: no branches, calls or tables, so that a plain loop over columns vectorises
/// for every instruction set. Also what host code uses where it must agree with kernels.
///
/// Errors stated with each function are bounds over the stated range, as tested against long double (u = 2^-24 = 6e-8, half a unit in the last
/// place of 1); "rel" is relative, "abs" absolute. Denormals count as zero. No function returns NaN or traps for finite input; for infinite or NaN
/// input the result is some finite or infinite number unless said otherwise. Polynomials are our own weighted minimax fits (Lawson's
/// iteration); range reduction as in [Cody & Waite 1980, "Software Manual for the Elementary Functions"].
#pragma once

#include <cmath>

#include "base/lanes.h"

namespace talbot {

inline constexpr float kHalfPi = 1.57079632679489661923f;
inline constexpr float kTwoPi = 6.28318530717958647693f;
inline constexpr float kLn2 = 0.69314718055994530942f;
inline constexpr float kLog2e = 1.44269504088896340736f;
inline constexpr float kSqrt2 = 1.41421356237309504880f;

/// Exact.
TALBOT_INLINE float lane_abs(float x) {
    return as_float(as_uint(x) & 0x7fffffffu);
}
/// Magnitude of x with the sign bit of s.
TALBOT_INLINE float lane_copysign(float x, float s) {
    return as_float((as_uint(x) & 0x7fffffffu) | (as_uint(s) & 0x80000000u));
}
/// -1, 0 or 1; sign(0) = 0.
TALBOT_INLINE float lane_sign(float x) {
    return x > 0.0f ? 1.0f : (x < 0.0f ? -1.0f : 0.0f);
}
/// Exact for all x.
TALBOT_INLINE float lane_floor(float x) {
    return __builtin_floorf(x);
}
TALBOT_INLINE float lane_ceil(float x) {
    return __builtin_ceilf(x);
}
TALBOT_INLINE float lane_trunc(float x) {
    return __builtin_truncf(x);
}
/// Halves go up, as floor(x + 0.5).
TALBOT_INLINE float lane_round(float x) {
    return __builtin_floorf(x + 0.5f);
}
/// x - floor(x), in [0, 1]; 1 only by rounding of tiny negative x.
TALBOT_INLINE float lane_fract(float x) {
    return x - __builtin_floorf(x);
}
/// Truncation to integer; saturates (a plain cast of a huge number is undefined). NaN gives -2147483648.
TALBOT_INLINE int32_t lane_int(float x) {
    return int32_t(minf(maxf(x, -2147483648.0f), 2147483520.0f));
}

namespace detail {
/// p * 2^i for i in [-254, 254], in two steps so that neither factor leaves the range.
TALBOT_INLINE float scale_by_power(float p, int32_t i) {
    const int32_t half = i >> 1;
    return p * as_float((half + 127) << 23) * as_float((i - half + 127) << 23);
}
}  // namespace detail

/// rel 2u for results that are normal numbers; 0 below 2^-150, infinite from 2^128 on.
TALBOT_INLINE float lane_exp2(float x) {
    x = minf(maxf(x, -152.0f), 130.0f);
    const float k = __builtin_floorf(x + 0.5f);
    const float f = x - k;
    float p = 1.547832115e-04f;
    p = p * f + 1.340070000e-03f;
    p = p * f + 9.617993433e-03f;
    p = p * f + 5.550326544e-02f;
    p = p * f + 2.402265151e-01f;
    p = p * f + 6.931472070e-01f;
    p = p * f + 1.0f;
    return detail::scale_by_power(p, int32_t(k));
}
/// rel 3u for results that are normal numbers.
TALBOT_INLINE float lane_exp(float x) {
    x = minf(maxf(x, -105.0f), 90.0f);
    const float k = __builtin_floorf(x * kLog2e + 0.5f);
    const float f = (x - k * 0x1.62e4p-1f) - k * 1.4286068203094172e-06f;  // ln 2 in two parts, the first short
    float p = 1.395619066e-03f;
    p = p * f + 8.375212392e-03f;
    p = p * f + 4.166608126e-02f;
    p = p * f + 1.666641447e-01f;
    p = p * f + 5.000000169e-01f;
    p = p * f + 1.0f;
    p = p * f + 1.0f;
    return detail::scale_by_power(p, int32_t(k));
}

namespace detail {
/// x = m 2^e with m in [1/sqrt 2, sqrt 2); returns ln m.
TALBOT_INLINE float log_mantissa(float x, float& e) {
    const int32_t bits = as_int(x);
    const int32_t exponent = (bits - 0x3f3504f3) >> 23;
    e = float(exponent);
    const float t = as_float(bits - (exponent << 23)) - 1.0f;
    const float s = t / (2.0f + t);  // ln(1 + t) = 2 atanh s
    const float z = s * s;
    float p = 1.179249369e-01f;
    p = p * z + 1.426858400e-01f;
    p = p * z + 2.000016863e-01f;
    p = p * z + 3.333333282e-01f;
    // 2s = t - s t keeps the leading term exact.
    return t - s * (t - 2.0f * z * p);
}
}  // namespace detail

/// x > 0: rel 4u. x <= 0: some finite number (callers exclude it).
TALBOT_INLINE float lane_log2(float x) {
    float e;
    const float m = detail::log_mantissa(maxf(x, 1.17549435e-38f), e);
    return m * 4.4269504089e-01f + m + e;  // log2(e) = 1 + 0.4427
}
/// x > 0: rel 3u. x <= 0: some finite number.
TALBOT_INLINE float lane_log(float x) {
    float e;
    const float m = detail::log_mantissa(maxf(x, 1.17549435e-38f), e);
    return e * 0x1.62e4p-1f + (e * 1.4286068203094172e-06f + m);
}
/// x > 0: rel (4 + 4 |y log2 x|) u. x <= 0 counts as 1.2e-38: 0 for y >= 4, 1 for y = 0.
TALBOT_INLINE float lane_pow(float x, float y) {
    return lane_exp2(y * lane_log2(x));
}
/// pow for any base: 0^0 = 1, 0^y = 0 (y > 0; also for y < 0), negative bases take integer exponents only, else 0.
TALBOT_INLINE float lane_safe_pow(float x, float y) {
    const float a = lane_pow(lane_abs(x), y);
    const float n = __builtin_truncf(y);
    const float odd = n - 2.0f * __builtin_floorf(n * 0.5f);
    const float negative = n == y ? (odd != 0.0f ? -a : a) : 0.0f;
    const float nonzero = x < 0.0f ? negative : a;
    const float zero = y == 0.0f ? 1.0f : 0.0f;
    return x == 0.0f ? zero : nonzero;
}

namespace detail {
/// r = x - k pi/2, |r| <= pi/4 and a little (clamped where x is too large to say); pi/2 in four parts of 8 bits, 8 bits, 8 bits and the rest, so that the
/// products are exact without fused multiply-add.
TALBOT_INLINE float reduce_quarter_turns(float x, int32_t& quadrant) {
    const float k = __builtin_floorf(minf(maxf(x * 0.63661977236758134f, -8388608.0f), 8388608.0f) + 0.5f);
    quadrant = int32_t(k);
    float r = x - k * 0x1.92p+0f;
    r = r - k * 0x1.fap-12f;
    r = r - k * 0x1.54p-20f;
    r = r - k * 0x1.10b4611a62633p-30f;
    return minf(maxf(r, -0.8f), 0.8f);
}
TALBOT_INLINE float sin_reduced(float r) {
    const float z = r * r;
    float p = 2.718237221e-06f;
    p = p * z - 1.983932713e-04f;
    p = p * z + 8.333329362e-03f;
    p = p * z - 1.666666664e-01f;
    return r + r * z * p;
}
TALBOT_INLINE float cos_reduced(float r) {
    const float z = r * r;
    float p = 2.443773005e-05f;
    p = p * z - 1.388736145e-03f;
    p = p * z + 4.166664675e-02f;
    return 1.0f - 0.5f * z + z * z * p;
}
}  // namespace detail

/// |x| <= 1e5: abs 2u; in [-1, 1] beyond.
TALBOT_INLINE void lane_sincos(float x, float& s, float& c) {
    int32_t q;
    const float r = detail::reduce_quarter_turns(x, q);
    const float sr = detail::sin_reduced(r);
    const float cr = detail::cos_reduced(r);
    const float a = (q & 1) ? cr : sr;
    const float b = (q & 1) ? sr : cr;
    s = as_float(as_uint(a) ^ ((uint32_t(q) & 2u) << 30));
    c = as_float(as_uint(b) ^ (((uint32_t(q) + 1u) & 2u) << 30));
}
TALBOT_INLINE float lane_sin(float x) {
    float s, c;
    lane_sincos(x, s, c);
    return s;
}
TALBOT_INLINE float lane_cos(float x) {
    float s, c;
    lane_sincos(x, s, c);
    return c;
}
/// |x| <= 1e5: rel 5u away from the poles; the poles are large and finite.
TALBOT_INLINE float lane_tan(float x) {
    float s, c;
    lane_sincos(x, s, c);
    return s / (c == 0.0f ? 1e-20f : c);
}

namespace detail {
/// atan over [0, 1], then both halves of [0, pi/2] by the callers.
TALBOT_INLINE float atan_unit(float a) {
    const bool upper = a > 0.41421356f;
    const float t = upper ? (a - 1.0f) / (a + 1.0f) : a;
    const float z = t * t;
    float p = -6.078858019e-02f;
    p = p * z + 1.059427695e-01f;
    p = p * z - 1.424362859e-01f;
    p = p * z + 1.999847855e-01f;
    p = p * z - 3.333331534e-01f;
    const float r = t + t * z * p;
    return upper ? r + 0.785398163397448f : r;
}
TALBOT_INLINE float asin_half(float x) {  // |x| <= 0.5
    const float z = x * x;
    float p = 3.759764720e-02f;
    p = p * z + 1.438055942e-02f;
    p = p * z + 3.182314381e-02f;
    p = p * z + 4.451509558e-02f;
    p = p * z + 7.500513963e-02f;
    p = p * z + 1.666665982e-01f;
    return x + x * z * p;
}
}  // namespace detail

/// rel 3u; infinities give +-pi/2.
TALBOT_INLINE float lane_atan(float x) {
    const float a = lane_abs(x);
    const bool inverted = a > 1.0f;
    const float r = detail::atan_unit(inverted ? 1.0f / a : a);
    return lane_copysign(inverted ? kHalfPi - r : r, x);
}
/// rel 4u; atan2(0, 0) = 0.
TALBOT_INLINE float lane_atan2(float y, float x) {
    const float ax = lane_abs(x), ay = lane_abs(y);
    const float hi = maxf(ax, ay), lo = minf(ax, ay);
    float r = detail::atan_unit(hi > 0.0f ? lo / hi : 0.0f);
    r = ay > ax ? kHalfPi - r : r;
    r = x < 0.0f ? kPi - r : r;
    return lane_copysign(r, y);
}
/// Arguments beyond [-1, 1] are clamped. rel 5u.
TALBOT_INLINE float lane_asin(float x) {
    const float a = minf(lane_abs(x), 1.0f);
    const bool outer = a > 0.5f;
    const float root = std::sqrt((1.0f - a) * 0.5f);
    const float r = detail::asin_half(outer ? root : a);
    return lane_copysign(outer ? kHalfPi - 2.0f * r : r, x);
}
/// Arguments beyond [-1, 1] are clamped. abs 6u, rel 3u near 1.
TALBOT_INLINE float lane_acos(float x) {
    const float c = clampf(x, -1.0f, 1.0f);
    const float a = lane_abs(c);
    const bool outer = a > 0.5f;
    const float root = std::sqrt((1.0f - a) * 0.5f);
    const float r = detail::asin_half(outer ? root : c);
    const float tail = 2.0f * r;
    return outer ? (c < 0.0f ? kPi - tail : tail) : kHalfPi - r;
}

/// rel 10u; beyond +-88 infinite.
TALBOT_INLINE float lane_sinh(float x) {
    const float a = lane_abs(x);
    const float e = lane_exp(a - kLn2);  // e^|x| / 2 without overflow before its time
    const float z = x * x;
    const float series = a * (1.0f + z * (1.6666667e-01f + z * (8.3333333e-03f + z * (1.9841270e-04f + z * 2.7557319e-06f))));
    return lane_copysign(a < 1.0f ? series : e - 0.25f / e, x);
}
/// rel 10u.
TALBOT_INLINE float lane_cosh(float x) {
    const float e = lane_exp(lane_abs(x) - kLn2);
    return e + 0.25f / e;
}
/// rel 10u.
TALBOT_INLINE float lane_tanh(float x) {
    const float a = minf(lane_abs(x), 20.0f);
    const float e = lane_exp(-2.0f * a);
    const float small = lane_sinh(a) / lane_cosh(a);
    return lane_copysign(a < 0.5f ? small : (1.0f - e) / (1.0f + e), x);
}

}  // namespace talbot
