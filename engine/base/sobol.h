/// Random numbers: Owen-scrambled Sobol' points in padded pairs, keyed by (seed, pixel, sample, dimension), so that a
/// render does not depend on threads, tiles or order.
///
/// Each pair of dimensions is the 2D Sobol' sequence [Sobol' 1967], its index shuffled and its coordinates scrambled by
/// hash-based nested uniform (Owen) scrambling [Burley 2020, "Practical Hash-based Owen Scrambling", section 3] with
/// the permutation of [Vegdahl 2021, "Building a Better LK Hash"]. The second Sobol' coordinate is the index times Pascal's matrix modulo 2,
/// computed in five steps instead of 32 [Ahmed 2024, "An Implementation Algorithm of 2D Sobol Sequence"].
#pragma once

#include "base/lanes.h"

namespace talbot {

/// Purposes of random pairs within one path vertex. Dimension = vertex * kPairsPerVertex + purpose.
enum class Pair : uint32_t {
    PixelFilter = 0,  ///< camera only
    Lens = 1,         ///< camera only
    Time = 2,         ///< camera only: u time, v spare
    BsdfSlot = 0,     ///< u: which closure; v: lobe within a closure (reflect or refract)
    BsdfDirection = 1,
    LightPick = 2,  ///< u: which emitter; v: which part of it (triangle)
    LightPosition = 3,
    DistantPick = 4,
    DistantPosition = 5,
    Roulette = 6,  ///< u: path roulette; v: shadow roulette
    Shader = 7,    ///< nodes that ask for random numbers
};
inline constexpr uint32_t kPairsPerVertex = 8;
/// Camera pairs are vertex 0, the first hit is vertex 1.
TALBOT_INLINE uint32_t pair_dimension(uint32_t vertex, Pair purpose) {
    return vertex * kPairsPerVertex + uint32_t(purpose);
}

/// Integer finaliser with good avalanche [Wellons 2018, "lowbias32"].
TALBOT_INLINE uint32_t hash_u32(uint32_t x) {
    x ^= x >> 16;
    x *= 0x7feb352du;
    x ^= x >> 15;
    x *= 0x846ca68bu;
    x ^= x >> 16;
    return x;
}
TALBOT_INLINE uint32_t hash_combine(uint32_t a, uint32_t b) {
    return hash_u32(a ^ (b * 0x9e3779b9u + 0x7f4a7c15u));
}

TALBOT_INLINE uint32_t reverse_bits(uint32_t x) {
    x = (x << 16) | (x >> 16);
    x = ((x & 0x00ff00ffu) << 8) | ((x & 0xff00ff00u) >> 8);
    x = ((x & 0x0f0f0f0fu) << 4) | ((x & 0xf0f0f0f0u) >> 4);
    x = ((x & 0x33333333u) << 2) | ((x & 0xccccccccu) >> 2);
    return ((x & 0x55555555u) << 1) | ((x & 0xaaaaaaaau) >> 1);
}

/// Owen scrambling of a number whose bits are already reversed (lowest bit = most significant).
TALBOT_INLINE uint32_t owen_hash_reversed(uint32_t x, uint32_t seed) {
    x ^= x * 0x3d20adeau;
    x += seed;
    x *= (seed >> 16) | 1u;
    x ^= x * 0x05526c56u;
    x ^= x * 0x53a22864u;
    return x;
}

/// Second coordinate of the 2D Sobol' sequence, bits in reversed order: Pascal's matrix modulo 2 times the index.
TALBOT_INLINE uint32_t sobol_second_reversed(uint32_t i) {
    i ^= (i & 0xffff0000u) >> 16;
    i ^= (i & 0xff00ff00u) >> 8;
    i ^= (i & 0xf0f0f0f0u) >> 4;
    i ^= (i & 0xccccccccu) >> 2;
    i ^= (i & 0xaaaaaaaau) >> 1;
    return i;
}

/// Top 24 bits to [0, 1).
TALBOT_INLINE float unit_float(uint32_t bits) {
    return float(int32_t(bits >> 8)) * 0x1p-24f;
}

/// The pair of `dimension` for a pixel's sample. `key` = hash of (seed, pixel).
TALBOT_INLINE Vec2 sample_pair(uint32_t key, uint32_t sample, uint32_t dimension) {
    const uint32_t s = hash_combine(key, dimension);
    const uint32_t index = reverse_bits(owen_hash_reversed(reverse_bits(sample), s));
    const uint32_t x = owen_hash_reversed(index, hash_u32(s ^ 0x68bc21ebu));
    const uint32_t y = owen_hash_reversed(sobol_second_reversed(index), hash_u32(s ^ 0x02e5be93u));
    return {unit_float(reverse_bits(x)), unit_float(reverse_bits(y))};
}

/// One 32-bit key for a pixel of a render.
TALBOT_INLINE uint32_t pixel_key(uint32_t seed, uint32_t pixel) {
    return hash_combine(hash_u32(seed + 0x51633e2du), pixel);
}

}  // namespace talbot
