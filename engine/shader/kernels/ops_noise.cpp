// Perlin noise and its fractal sums, white noise [Perlin 2002, "Improving Noise"; Musgrave et al., "Texturing and Modeling"].
#include "base/hash.h"
#include "shader/kernels/ops.h"

namespace talbot::shader {
inline namespace TALBOT_ISA {
namespace {

TALBOT_INLINE float fade(float t) {
    return t * t * t * (t * (t * 6.0f - 15.0f) + 10.0f);
}

/// Turns x's sign where the bit of h is set that `left` shifts to the top.
TALBOT_INLINE float negate_by(float x, uint32_t h, int left) {
    return as_float(as_uint(x) ^ ((h << left) & 0x80000000u));
}

// Gradients by a few low bits of h.
TALBOT_INLINE float gradient(uint32_t h, float x) {
    return negate_by(1.0f + float(int32_t(h & 7u)), h, 28) * x;
}
TALBOT_INLINE float gradient(uint32_t h, float x, float y) {
    const bool swap = (h & 4u) != 0u;
    return negate_by(swap ? y : x, h, 31) + negate_by(2.0f * (swap ? x : y), h, 30);
}
TALBOT_INLINE float gradient(uint32_t h, float x, float y, float z) {
    const float u = (h & 8u) != 0u ? y : x;
    const float other = (h & 13u) == 12u ? x : z;
    const float v = (h & 12u) != 0u ? other : y;
    return negate_by(u, h, 31) + negate_by(v, h, 30);
}
TALBOT_INLINE float gradient(uint32_t h, float x, float y, float z, float w) {
    const float u = (h & 24u) == 24u ? y : x, v = (h & 16u) != 0u ? z : y, s = (h & 24u) != 0u ? w : z;
    return negate_by(u, h, 31) + negate_by(v, h, 30) + negate_by(s, h, 29);
}

/// Cell and place in it. Cells beyond the integers are all the same.
struct Cell {
    uint32_t i;
    float f;
};
TALBOT_INLINE Cell cell_of(float x) {
    const float c = lane_floor(x);
    return {uint32_t(int32_t(lane_abs(c) < 2147483520.0f ? c : 0.0f)), x - c};
}

/// Large coordinates lose their fraction: newer versions wrap them. The half keeps huge ones off the lattice, where noise is 0.
TALBOT_INLINE float wrapped(float x) {
    const float folded = x - 100000.0f * lane_trunc(x * 1e-5f);
    return folded + (lane_abs(x) >= 1e6f ? 0.5f : 0.0f);
}
TALBOT_INLINE float finite_or_zero(float x) {
    return lane_abs(x) < 1e30f ? x : 0.0f;
}

// Sums over the corners of a square, a cube and a cube in four dimensions. Written out: loops over corners inside the loop over lanes would keep
// the compiler from vectorising it.
TALBOT_INLINE float square_of(Cell a, Cell b, float u, float v) {
    return lerp(lerp(gradient(hash_low(a.i, b.i), a.f, b.f), gradient(hash_low(a.i + 1, b.i), a.f - 1.0f, b.f), u),
                lerp(gradient(hash_low(a.i, b.i + 1), a.f, b.f - 1.0f), gradient(hash_low(a.i + 1, b.i + 1), a.f - 1.0f, b.f - 1.0f), u), v);
}
TALBOT_INLINE float square_of(Cell a, Cell b, uint32_t ci, float cf, float u, float v) {
    return lerp(lerp(gradient(hash_low(a.i, b.i, ci), a.f, b.f, cf), gradient(hash_low(a.i + 1, b.i, ci), a.f - 1.0f, b.f, cf), u),
                lerp(gradient(hash_low(a.i, b.i + 1, ci), a.f, b.f - 1.0f, cf), gradient(hash_low(a.i + 1, b.i + 1, ci), a.f - 1.0f, b.f - 1.0f, cf), u), v);
}
TALBOT_INLINE float square_of(Cell a, Cell b, uint32_t ci, float cf, uint32_t di, float df, float u, float v) {
    return lerp(lerp(gradient(hash_low(a.i, b.i, ci, di), a.f, b.f, cf, df), gradient(hash_low(a.i + 1, b.i, ci, di), a.f - 1.0f, b.f, cf, df), u),
                lerp(gradient(hash_low(a.i, b.i + 1, ci, di), a.f, b.f - 1.0f, cf, df),
                     gradient(hash_low(a.i + 1, b.i + 1, ci, di), a.f - 1.0f, b.f - 1.0f, cf, df), u),
                v);
}
TALBOT_INLINE float cube_of(Cell a, Cell b, Cell c, uint32_t di, float df, float u, float v, float t) {
    return lerp(square_of(a, b, c.i, c.f, di, df, u, v), square_of(a, b, c.i + 1, c.f - 1.0f, di, df, u, v), t);
}

/// Scaled to about [-1, 1].
template <int D>
TALBOT_INLINE float perlin(float x, float y, float z, float w) {
    const Cell a = cell_of(x), b = cell_of(y), c = cell_of(z), d = cell_of(w);
    const float u = fade(a.f), v = fade(b.f), t = fade(c.f);
    if constexpr (D == 1) return finite_or_zero(lerp(gradient(hash_low(a.i), a.f), gradient(hash_low(a.i + 1), a.f - 1.0f), u)) * 0.25f;
    if constexpr (D == 2) return finite_or_zero(square_of(a, b, u, v)) * 0.6616f;
    if constexpr (D == 3) return finite_or_zero(lerp(square_of(a, b, c.i, c.f, u, v), square_of(a, b, c.i + 1, c.f - 1.0f, u, v), t)) * 0.9820f;
    if constexpr (D == 4) return finite_or_zero(lerp(cube_of(a, b, c, d.i, d.f, u, v, t), cube_of(a, b, c, d.i + 1, d.f - 1.0f, u, v, t), fade(d.f))) * 0.8344f;
}

template <int D, bool Wrap>
TALBOT_INLINE float perlin_at(float x, float y, float z, float w) {
    x = finite_or_zero(x);
    y = finite_or_zero(y);
    z = finite_or_zero(z);
    w = finite_or_zero(w);
    if constexpr (Wrap) return perlin<D>(wrapped(x), wrapped(y), wrapped(z), wrapped(w));
    return perlin<D>(x, y, z, w);
}

/// out = signed noise at scale * (x, y, z, w).
template <int D, bool Wrap>
void perlin_loop(const float* const* p, const float* scale_column, int n, float* out_column) {
    ConstColumn x = p[0], y = p[1], z = p[2], w = p[3], scale = scale_column;
    Column out = out_column;
    TALBOT_VECTOR_LOOP
    for (int k = 0; k < n; ++k) out[k] = perlin_at<D, Wrap>(x[k] * scale[k], y[k] * scale[k], z[k] * scale[k], w[k] * scale[k]);
}
/// out += amplitude * signed noise at scale * (x, y, z, w): an octave that is the same for all lanes.
template <int D, bool Wrap>
void add_perlin(const float* const* p, float scale, float amplitude, int n, float* out_column) {
    ConstColumn x = p[0], y = p[1], z = p[2], w = p[3];
    Column out = out_column;
    TALBOT_VECTOR_LOOP
    for (int k = 0; k < n; ++k) out[k] += perlin_at<D, Wrap>(x[k] * scale, y[k] * scale, z[k] * scale, w[k] * scale) * amplitude;
}

struct Perlin {
    void (*loop)(const float* const* p, const float* scale, int n, float* out);
    void (*add)(const float* const* p, float scale, float amplitude, int n, float* out);
};
template <bool Wrap>
constexpr Perlin kPerlin[] = {{perlin_loop<1, Wrap>, add_perlin<1, Wrap>},
                              {perlin_loop<2, Wrap>, add_perlin<2, Wrap>},
                              {perlin_loop<3, Wrap>, add_perlin<3, Wrap>},
                              {perlin_loop<4, Wrap>, add_perlin<4, Wrap>}};
Perlin perlin_of(const Instruction& i) {
    return (i.variant & 64) != 0 ? kPerlin<true>[i.variant & 3] : kPerlin<false>[i.variant & 3];
}

/// Whether all lanes have the same bits.
bool is_uniform(const float* column, int n) {
    const uint32_t first = as_uint(column[0]);
    uint32_t differ = 0;
    for (int k = 0; k < n; ++k) differ |= as_uint(column[k]) ^ first;
    return differ == 0;
}

}  // namespace

void op_signed_noise(const Instruction& i, Registers r, int n) {
    const float* p[4] = {r[1], r[2], r[3], r[4]};
    fill(r[0], n, 0.0f);
    perlin_of(i).add(p, 1.0f, 1.0f, n, r[0]);
}

void op_noise(const Instruction& i, Registers r, int n) {
    // Octaves outside, lanes inside: lane k takes part in octave o fully while o <= detail, with the fraction of detail in the next one.
    Column out = r[0];
    const float* p[4] = {r[1], r[2], r[3], r[4]};
    ConstColumn detail = r[5], roughness = r[6], lacunarity = r[7], offset = r[8], gain = r[9];
    const Perlin perlin = perlin_of(i);
    const NoiseKind kind = NoiseKind((i.variant >> 2) & 7);
    const bool normalize = i.variant & 32;
    float frequency[kSpan], amplitude[kSpan], noise[kSpan], total[kSpan], weight[kSpan], signal[kSpan];
    float last = 0.0f;
    TALBOT_VECTOR_LOOP
    for (int k = 0; k < n; ++k) {
        frequency[k] = 1.0f;
        amplitude[k] = 1.0f;
        total[k] = 0.0f;
        weight[k] = 1.0f;
        signal[k] = 0.0f;
        out[k] = kind == NoiseKind::Multifractal ? 1.0f : 0.0f;
    }
    const bool even = is_uniform(detail, n);
    for (int k = 0; k < (even ? 1 : n); ++k) last = maxf(last, minf(maxf(detail[k], 0.0f), 15.0f));
    const int octaves = int(lane_ceil(last)) + 1;
    int first = 0;
    if (kind == NoiseKind::Fbm && even && is_uniform(roughness, n) && is_uniform(lacunarity, n)) {
        // Nearly always: whole octaves that all lanes share, in one loop each. The same sums, to the last bit.
        float f = 1.0f, a = 1.0f, sum = 0.0f;
        for (; float(first) <= last; ++first) {
            perlin.add(p, f, a, n, out);
            sum += a;
            a *= roughness[0];
            f *= lacunarity[0];
        }
        fill(frequency, n, f);
        fill(amplitude, n, a);
        fill(total, n, sum);
    }
    for (int o = first; o < octaves; ++o) {
        perlin.loop(p, frequency, n, noise);
        const float octave = float(o);
        switch (kind) {
            case NoiseKind::Fbm:
                TALBOT_VECTOR_LOOP
                for (int k = 0; k < n; ++k) {
                    const float share = saturate(minf(maxf(detail[k], 0.0f), 15.0f) - octave + 1.0f);
                    const float sum = out[k] + noise[k] * amplitude[k], max = total[k] + amplitude[k];
                    // The fractional octave blends results, after normalisation.
                    const float before = normalize ? 0.5f * out[k] / (total[k] != 0.0f ? total[k] : 1.0f) : out[k];
                    const float after = normalize ? 0.5f * sum / max : sum;
                    const bool partial = share > 0.0f && share < 1.0f;
                    const float blended = lerp(before, after, share) * (normalize ? 2.0f : 1.0f);
                    out[k] = share >= 1.0f ? sum : (partial ? blended : out[k]);
                    total[k] = share >= 1.0f ? max : (partial && normalize ? 1.0f : total[k]);
                }
                break;
            case NoiseKind::Multifractal:
                TALBOT_VECTOR_LOOP
                for (int k = 0; k < n; ++k) {
                    const float share = saturate(minf(maxf(detail[k], 0.0f), 15.0f) - octave + 1.0f);
                    out[k] *= share * amplitude[k] * noise[k] + 1.0f;
                }
                break;
            case NoiseKind::HeteroTerrain:
                TALBOT_VECTOR_LOOP
                for (int k = 0; k < n; ++k) {
                    const float share = saturate(minf(maxf(detail[k], 0.0f), 15.0f) - octave + 1.0f);
                    const float raised = noise[k] + offset[k];
                    out[k] = o == 0 ? raised : out[k] + share * raised * amplitude[k] * out[k];
                }
                break;
            case NoiseKind::HybridMultifractal:
                TALBOT_VECTOR_LOOP
                for (int k = 0; k < n; ++k) {
                    const float share = saturate(minf(maxf(detail[k], 0.0f), 15.0f) - octave + 1.0f);
                    const float s = (noise[k] + offset[k]) * amplitude[k];
                    const float w = minf(weight[k], 1.0f);
                    out[k] += weight[k] > 0.001f ? share * w * s : 0.0f;
                    weight[k] = weight[k] > 0.001f ? w * gain[k] * s : weight[k];
                }
                break;
            case NoiseKind::RidgedMultifractal:
                TALBOT_VECTOR_LOOP
                for (int k = 0; k < n; ++k) {
                    // No fractional octave here.
                    const bool active = octave <= minf(maxf(detail[k], 0.0f), 15.0f);
                    const float ridge = offset[k] - lane_abs(noise[k]);
                    const float s = ridge * ridge * (o == 0 ? 1.0f : saturate(signal[k] * gain[k]));
                    out[k] += active ? s * amplitude[k] : 0.0f;
                    signal[k] = s;
                }
                break;
        }
        TALBOT_VECTOR_LOOP
        for (int k = 0; k < n; ++k) {
            amplitude[k] *= roughness[k];
            frequency[k] *= lacunarity[k];
        }
    }
    if (kind == NoiseKind::Fbm && normalize) {
        TALBOT_VECTOR_LOOP
        for (int k = 0; k < n; ++k) out[k] = 0.5f * out[k] / (total[k] != 0.0f ? total[k] : 1.0f) + 0.5f;
    }
}

void op_white_noise(const Instruction& i, Registers r, int n) {
    Column value = r[0], red = r[1], green = r[2], blue = r[3];
    ConstColumn x = r[4], y = r[5], z = r[6], w = r[7];
    switch (i.variant) {
        case 1:
            TALBOT_VECTOR_LOOP
            for (int k = 0; k < n; ++k) {
                value[k] = red[k] = unit_hash(w[k]);
                green[k] = unit_hash(w[k], 1.0f);
                blue[k] = unit_hash(w[k], 2.0f);
            }
            return;
        case 2:
            TALBOT_VECTOR_LOOP
            for (int k = 0; k < n; ++k) {
                value[k] = red[k] = unit_hash(x[k], y[k]);
                green[k] = unit_hash(x[k], y[k], 1.0f);
                blue[k] = unit_hash(x[k], y[k], 2.0f);
            }
            return;
        case 3:
            TALBOT_VECTOR_LOOP
            for (int k = 0; k < n; ++k) {
                value[k] = red[k] = unit_hash(x[k], y[k], z[k]);
                green[k] = unit_hash(x[k], y[k], z[k], 1.0f);
                blue[k] = unit_hash(x[k], y[k], z[k], 2.0f);
            }
            return;
        default:
            TALBOT_VECTOR_LOOP
            for (int k = 0; k < n; ++k) {
                value[k] = red[k] = unit_hash(x[k], y[k], z[k], w[k]);
                green[k] = unit_hash(z[k], x[k], w[k], y[k]);
                blue[k] = unit_hash(w[k], z[k], y[k], x[k]);
            }
            return;
    }
}

}  // namespace TALBOT_ISA
}  // namespace talbot::shader
