/// Lanes, spans and columns: how the engine holds many paths at once.
///
/// A *lane* is one path (or one hit, one shadow ray). A *column* is an array with one value per lane; three columns
/// make a vector. A *batch* is the paths a worker owns; a *span* is at most `kSpan` lanes that go through one program
/// or one closure together. Columns never alias each other: take their pointers into `Column` locals before a loop.
#pragma once

#include <cstdint>
#include <cstring>

#include "base/isa.h"
#include "base/vec.h"

namespace talbot {

inline constexpr int kSpan = 256;    ///< lanes of one span; scratch registers are this long
inline constexpr int kBatch = 2048;  ///< paths a worker keeps in flight

using Column = float* __restrict;
using ConstColumn = const float* __restrict;
using IntColumn = int32_t* __restrict;
using ConstIntColumn = const int32_t* __restrict;
using MaskColumn = uint8_t* __restrict;
using ConstMaskColumn = const uint8_t* __restrict;

/// Three columns: a vector or a colour per lane. No ownership.
struct Columns3 {
    float* x = nullptr;
    float* y = nullptr;
    float* z = nullptr;
};
struct ConstColumns3 {
    const float* x = nullptr;
    const float* y = nullptr;
    const float* z = nullptr;
    ConstColumns3() = default;
    TALBOT_MEMBER ConstColumns3(const float* x_, const float* y_, const float* z_) : x(x_), y(y_), z(z_) {}
    TALBOT_MEMBER ConstColumns3(Columns3 c) : x(c.x), y(c.y), z(c.z) {}
};

TALBOT_INLINE Vec3 load(ConstColumns3 c, int i) {
    return {c.x[i], c.y[i], c.z[i]};
}
TALBOT_INLINE void store(Columns3 c, int i, Vec3 v) {
    c.x[i] = v.x;
    c.y[i] = v.y;
    c.z[i] = v.z;
}

TALBOT_INLINE float as_float(int32_t i) {
    return __builtin_bit_cast(float, i);
}
TALBOT_INLINE float as_float(uint32_t i) {
    return __builtin_bit_cast(float, i);
}
TALBOT_INLINE int32_t as_int(float f) {
    return __builtin_bit_cast(int32_t, f);
}
TALBOT_INLINE uint32_t as_uint(float f) {
    return __builtin_bit_cast(uint32_t, f);
}

/// out[i] = in[index[i]]
TALBOT_INLINE void gather(const float* __restrict in, const int32_t* __restrict index, int n, float* __restrict out) {
    TALBOT_VECTOR_LOOP
    for (int i = 0; i < n; ++i) out[i] = in[index[i]];
}
TALBOT_INLINE void gather(const int32_t* __restrict in, const int32_t* __restrict index, int n, int32_t* __restrict out) {
    TALBOT_VECTOR_LOOP
    for (int i = 0; i < n; ++i) out[i] = in[index[i]];
}
/// out[index[i]] = in[i]; the indices are distinct.
TALBOT_INLINE void scatter(const float* __restrict in, const int32_t* __restrict index, int n, float* __restrict out) {
    TALBOT_VECTOR_LOOP
    for (int i = 0; i < n; ++i) out[index[i]] = in[i];
}
TALBOT_INLINE void scatter(const int32_t* __restrict in, const int32_t* __restrict index, int n, int32_t* __restrict out) {
    TALBOT_VECTOR_LOOP
    for (int i = 0; i < n; ++i) out[index[i]] = in[i];
}
TALBOT_INLINE void gather3(ConstColumns3 in, const int32_t* index, int n, Columns3 out) {
    gather(in.x, index, n, out.x);
    gather(in.y, index, n, out.y);
    gather(in.z, index, n, out.z);
}
TALBOT_INLINE void scatter3(ConstColumns3 in, const int32_t* index, int n, Columns3 out) {
    scatter(in.x, index, n, out.x);
    scatter(in.y, index, n, out.y);
    scatter(in.z, index, n, out.z);
}
TALBOT_INLINE void fill(float* __restrict out, int n, float value) {
    for (int i = 0; i < n; ++i) out[i] = value;
}
/// Positions i where the mask (bytes or words) is set, in order; returns their number. `out` has room for n.
template <class Mask>
TALBOT_INLINE int compress(const Mask* __restrict mask, int n, int32_t* __restrict out) {
    int count = 0;
    for (int i = 0; i < n; ++i) {
        out[count] = i;
        count += mask[i] != 0;
    }
    return count;
}

}  // namespace talbot
