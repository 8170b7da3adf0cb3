/// Integer hashes of cells and coordinates, as Blender's textures use them (their patterns are part of the pictures).
///
/// hash_words: the final mixing (with one more round for four words) of Bob Jenkins' public-domain lookup3, 2006.
/// pcg_*: [Jarzynski & Olano 2020, "Hash Functions for GPU Rendering"].
#pragma once

#include "base/lanes.h"

namespace talbot {

TALBOT_INLINE uint32_t rotate_left(uint32_t x, int k) {
    return (x << k) | (x >> (32 - k));
}

namespace detail {
struct JenkinsState {
    uint32_t a, b, c;
};
/// What the hash is made of in its last step: (c ^ b) - rotate_left(b, 24).
struct JenkinsEnd {
    uint32_t b, c;
};
TALBOT_INLINE JenkinsEnd jenkins_rounds(JenkinsState state) {
    auto [a, b, c] = state;
    c ^= b;
    c -= rotate_left(b, 14);
    a ^= c;
    a -= rotate_left(c, 11);
    b ^= a;
    b -= rotate_left(a, 25);
    c ^= b;
    c -= rotate_left(b, 16);
    a ^= c;
    a -= rotate_left(c, 4);
    b ^= a;
    b -= rotate_left(a, 14);
    return {b, c};
}
inline constexpr uint32_t jenkins_start(uint32_t words) {
    return 0xdeadbeefu + (words << 2) + 13u;
}
/// The state before the last rounds, for one to four words.
TALBOT_INLINE JenkinsState jenkins_state(uint32_t x) {
    const uint32_t s = jenkins_start(1);
    return {s + x, s, s};
}
TALBOT_INLINE JenkinsState jenkins_state(uint32_t x, uint32_t y) {
    const uint32_t s = jenkins_start(2);
    return {s + x, s + y, s};
}
TALBOT_INLINE JenkinsState jenkins_state(uint32_t x, uint32_t y, uint32_t z) {
    const uint32_t s = jenkins_start(3);
    return {s + x, s + y, s + z};
}
TALBOT_INLINE JenkinsState jenkins_state(uint32_t x, uint32_t y, uint32_t z, uint32_t w) {
    const uint32_t s = jenkins_start(4);
    uint32_t a = s + x, b = s + y, c = s + z;
    a -= c;
    a ^= rotate_left(c, 4);
    c += b;
    b -= a;
    b ^= rotate_left(a, 6);
    a += c;
    c -= b;
    c ^= rotate_left(b, 8);
    b += a;
    a -= c;
    a ^= rotate_left(c, 16);
    c += b;
    b -= a;
    b ^= rotate_left(a, 19);
    a += c;
    c -= b;
    c ^= rotate_left(b, 4);
    b += a;
    return {a + w, b, c};
}
}  // namespace detail

/// Of one to four words.
template <class... Words>
TALBOT_INLINE uint32_t hash_words(Words... words) {
    const detail::JenkinsEnd e = detail::jenkins_rounds(detail::jenkins_state(words...));
    return (e.c ^ e.b) - rotate_left(e.b, 24);
}
/// The lower 24 bits are those of hash_words, the others are not: cheaper by a rotation, for those who need a few bits only.
template <class... Words>
TALBOT_INLINE uint32_t hash_low(Words... words) {
    const detail::JenkinsEnd e = detail::jenkins_rounds(detail::jenkins_state(words...));
    return (e.c ^ e.b) - (e.b >> 8);
}

/// [0, 1]
TALBOT_INLINE float hash_to_unit(uint32_t h) {
    // In two halves: conversion of unsigned words is not vectorised everywhere.
    return (float(int32_t(h >> 16)) * 65536.0f + float(int32_t(h & 0xffffu))) * (1.0f / 4294967295.0f);
}

// Floats are hashed by their bits.
TALBOT_INLINE float unit_hash(float x) {
    return hash_to_unit(hash_words(as_uint(x)));
}
TALBOT_INLINE float unit_hash(float x, float y) {
    return hash_to_unit(hash_words(as_uint(x), as_uint(y)));
}
TALBOT_INLINE float unit_hash(float x, float y, float z) {
    return hash_to_unit(hash_words(as_uint(x), as_uint(y), as_uint(z)));
}
TALBOT_INLINE float unit_hash(float x, float y, float z, float w) {
    return hash_to_unit(hash_words(as_uint(x), as_uint(y), as_uint(z), as_uint(w)));
}

struct Hash4 {
    float x, y, z, w;
};

namespace detail {
TALBOT_INLINE float pcg_unit(uint32_t v) {
    return float(int32_t(v & 0x7fffffffu)) * (1.0f / 2147483647.0f);
}
/// Signed words: the shift keeps the sign.
TALBOT_INLINE uint32_t fold16(uint32_t v) {
    return v ^ uint32_t(int32_t(v) >> 16);
}
}  // namespace detail

/// What the pcg_ hashes begin with, coordinate by coordinate: that of i + n is that of i plus n times the step.
inline constexpr uint32_t kPcgStep = 1664525u;
TALBOT_INLINE uint32_t pcg_start(int32_t i) {
    return uint32_t(i) * kPcgStep + 1013904223u;
}
TALBOT_INLINE Hash4 pcg_2d(uint32_t x, uint32_t y) {
    x += y * kPcgStep;
    y += x * kPcgStep;
    x = detail::fold16(x);
    y = detail::fold16(y);
    x += y * kPcgStep;
    y += x * kPcgStep;
    return {detail::pcg_unit(x), detail::pcg_unit(y), 0, 0};
}
TALBOT_INLINE Hash4 pcg_3d(uint32_t x, uint32_t y, uint32_t z) {
    x += y * z;
    y += z * x;
    z += x * y;
    x = detail::fold16(x);
    y = detail::fold16(y);
    z = detail::fold16(z);
    x += y * z;
    y += z * x;
    z += x * y;
    return {detail::pcg_unit(x), detail::pcg_unit(y), detail::pcg_unit(z), 0};
}
TALBOT_INLINE Hash4 pcg_4d(uint32_t x, uint32_t y, uint32_t z, uint32_t w) {
    x += y * w;
    y += z * x;
    z += x * y;
    w += y * z;
    x = detail::fold16(x);
    y = detail::fold16(y);
    z = detail::fold16(z);
    w = detail::fold16(w);
    x += y * w;
    y += z * x;
    z += x * y;
    w += y * z;
    return {detail::pcg_unit(x), detail::pcg_unit(y), detail::pcg_unit(z), detail::pcg_unit(w)};
}

}  // namespace talbot
