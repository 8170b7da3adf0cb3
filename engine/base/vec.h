/// Small vectors and affine maps. Plain data; one lane at a time. Loops over lanes keep components in separate
/// columns (`base/lanes.h`) and may build these inside the loop body: compilers keep them in registers.
#pragma once

#include <cmath>
#include <cstdint>

#include "base/isa.h"

namespace talbot {

inline constexpr float kPi = 3.14159265358979323846f;
inline constexpr float kInvPi = 0.31830988618379067154f;

struct Vec2 {
    float x = 0, y = 0;
};

struct Vec3 {
    float x = 0, y = 0, z = 0;
};

/// Radiance, reflectance or transmittance in the scene's linear working space (Rec.709 primaries unless the file says otherwise).
using Rgb = Vec3;

/// Affine map, row-major 3x4: p' = (row . p) + t. `m[r][3]` is the translation.
struct Affine {
    float m[3][4] = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}};
};

TALBOT_INLINE Vec3 vec3(float s) {
    return {s, s, s};
}
TALBOT_INLINE Vec3 operator+(Vec3 a, Vec3 b) {
    return {a.x + b.x, a.y + b.y, a.z + b.z};
}
TALBOT_INLINE Vec3 operator-(Vec3 a, Vec3 b) {
    return {a.x - b.x, a.y - b.y, a.z - b.z};
}
TALBOT_INLINE Vec3 operator-(Vec3 a) {
    return {-a.x, -a.y, -a.z};
}
TALBOT_INLINE Vec3 operator*(Vec3 a, Vec3 b) {
    return {a.x * b.x, a.y * b.y, a.z * b.z};
}
TALBOT_INLINE Vec3 operator*(Vec3 a, float s) {
    return {a.x * s, a.y * s, a.z * s};
}
TALBOT_INLINE Vec3 operator*(float s, Vec3 a) {
    return a * s;
}
TALBOT_INLINE Vec3 operator/(Vec3 a, float s) {
    return a * (1.0f / s);
}
TALBOT_INLINE float dot(Vec3 a, Vec3 b) {
    return a.x * b.x + a.y * b.y + a.z * b.z;
}
TALBOT_INLINE Vec3 cross(Vec3 a, Vec3 b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
TALBOT_INLINE float length(Vec3 a) {
    return std::sqrt(dot(a, a));
}
TALBOT_INLINE float minf(float a, float b) {
    return a < b ? a : b;
}
TALBOT_INLINE float maxf(float a, float b) {
    return a > b ? a : b;
}
TALBOT_INLINE float clampf(float x, float lo, float hi) {
    return minf(maxf(x, lo), hi);
}
TALBOT_INLINE float saturate(float x) {
    return clampf(x, 0.0f, 1.0f);
}
TALBOT_INLINE float lerp(float a, float b, float t) {
    return a + (b - a) * t;
}
TALBOT_INLINE Vec3 lerp(Vec3 a, Vec3 b, float t) {
    return a + (b - a) * t;
}
TALBOT_INLINE float max_component(Vec3 a) {
    return maxf(a.x, maxf(a.y, a.z));
}
/// The largest component, whatever its sign.
TALBOT_INLINE float max_magnitude(Vec3 a) {
    return maxf(std::fabs(a.x), maxf(std::fabs(a.y), std::fabs(a.z)));
}
TALBOT_INLINE float mean(Vec3 a) {
    return (a.x + a.y + a.z) * (1.0f / 3.0f);
}
TALBOT_INLINE bool is_finite(Vec3 v) {
    // x - x is NaN for infinities and NaN.
    const float zero = (v.x - v.x) + (v.y - v.y) + (v.z - v.z);
    return zero == 0.0f;
}
TALBOT_INLINE float square(float x) {
    return x * x;
}
TALBOT_INLINE float safe_sqrt(float x) {
    return std::sqrt(maxf(x, 0.0f));
}
/// Zero stays zero instead of becoming NaN.
TALBOT_INLINE Vec3 normalize(Vec3 a) {
    const float l2 = dot(a, a);
    return a * (l2 > 0.0f ? 1.0f / std::sqrt(l2) : 0.0f);
}
/// Rec.709 luminance (the working space's own weights are in `scene::Settings::luminance_weights`).
TALBOT_INLINE float luminance(Rgb c) {
    return 0.2126f * c.x + 0.7152f * c.y + 0.0722f * c.z;
}

TALBOT_INLINE Vec3 transform_point(const Affine& t, Vec3 p) {
    return {t.m[0][0] * p.x + t.m[0][1] * p.y + t.m[0][2] * p.z + t.m[0][3], t.m[1][0] * p.x + t.m[1][1] * p.y + t.m[1][2] * p.z + t.m[1][3],
            t.m[2][0] * p.x + t.m[2][1] * p.y + t.m[2][2] * p.z + t.m[2][3]};
}
TALBOT_INLINE Vec3 transform_direction(const Affine& t, Vec3 d) {
    return {t.m[0][0] * d.x + t.m[0][1] * d.y + t.m[0][2] * d.z, t.m[1][0] * d.x + t.m[1][1] * d.y + t.m[1][2] * d.z,
            t.m[2][0] * d.x + t.m[2][1] * d.y + t.m[2][2] * d.z};
}
/// Normals go by the inverse transpose: pass the INVERSE of the map the points go by. Not normalised.
TALBOT_INLINE Vec3 transform_normal(const Affine& inverse, Vec3 n) {
    return {inverse.m[0][0] * n.x + inverse.m[1][0] * n.y + inverse.m[2][0] * n.z, inverse.m[0][1] * n.x + inverse.m[1][1] * n.y + inverse.m[2][1] * n.z,
            inverse.m[0][2] * n.x + inverse.m[1][2] * n.y + inverse.m[2][2] * n.z};
}
TALBOT_INLINE float determinant(const Affine& t) {
    return t.m[0][0] * (t.m[1][1] * t.m[2][2] - t.m[1][2] * t.m[2][1]) - t.m[0][1] * (t.m[1][0] * t.m[2][2] - t.m[1][2] * t.m[2][0]) +
           t.m[0][2] * (t.m[1][0] * t.m[2][1] - t.m[1][1] * t.m[2][0]);
}

/// Right-handed orthonormal basis around a unit n [Duff et al. 2017, "Building an Orthonormal Basis, Revisited"].
TALBOT_INLINE void make_basis(Vec3 n, Vec3& t, Vec3& b) {
    const float s = std::copysign(1.0f, n.z);
    const float a = -1.0f / (s + n.z);
    const float c = n.x * n.y * a;
    t = {1.0f + s * n.x * n.x * a, s * c, -s * n.x};
    b = {c, s + n.y * n.y * a, -n.y};
}

Affine inverse(const Affine& t);                           ///< A singular map gives the zero map.
Affine compose(const Affine& outer, const Affine& inner);  ///< outer after inner.
/// True when the map keeps angles: rotation, mirroring and uniform scale, each to `tolerance`.
TALBOT_INLINE bool keeps_angles(const Affine& t, float tolerance = 1e-3f) {
    const Vec3 x{t.m[0][0], t.m[1][0], t.m[2][0]}, y{t.m[0][1], t.m[1][1], t.m[2][1]}, z{t.m[0][2], t.m[1][2], t.m[2][2]};
    const float xx = dot(x, x), eps = tolerance * xx;
    return std::fabs(dot(y, y) - xx) <= 2.0f * eps && std::fabs(dot(z, z) - xx) <= 2.0f * eps && std::fabs(dot(x, y)) <= eps && std::fabs(dot(y, z)) <= eps &&
           std::fabs(dot(z, x)) <= eps;
}

}  // namespace talbot
