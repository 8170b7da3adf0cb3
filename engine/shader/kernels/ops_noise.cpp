// Perlin noise and its fractal sums, white noise [Perlin 2002, "Improving Noise"; Musgrave et al., "Texturing and Modeling"].
#include "base/hash.h"
#include "shader/kernels/ops.h"

namespace talbot::shader {
inline namespace TALBOT_ISA {
namespace {

TALBOT_INLINE float fade(float t) {
    return t * t * t * (t * (t * 6.0f - 15.0f) + 10.0f);
}

TALBOT_INLINE float negate_if(float x, uint32_t bit) {
    return as_float(as_uint(x) ^ (bit << 31));
}

TALBOT_INLINE float gradient(uint32_t hash, float x) {
    const uint32_t h = hash & 15u;
    const float g = 1.0f + float(int32_t(h & 7u));
    return negate_if(g, h >> 3) * x;
}
TALBOT_INLINE float gradient(uint32_t hash, float x, float y) {
    const uint32_t h = hash & 7u;
    const float u = h < 4u ? x : y, v = 2.0f * (h < 4u ? y : x);
    return negate_if(u, h & 1u) + negate_if(v, (h >> 1) & 1u);
}
TALBOT_INLINE float gradient(uint32_t hash, float x, float y, float z) {
    const uint32_t h = hash & 15u;
    const float u = h < 8u ? x : y;
    const float other = ((h == 12u) | (h == 14u)) ? x : z;
    const float v = h < 4u ? y : other;
    return negate_if(u, h & 1u) + negate_if(v, (h >> 1) & 1u);
}
TALBOT_INLINE float gradient(uint32_t hash, float x, float y, float z, float w) {
    const uint32_t h = hash & 31u;
    const float u = h < 24u ? x : y, v = h < 16u ? y : z, s = h < 8u ? z : w;
    return negate_if(u, h & 1u) + negate_if(v, (h >> 1) & 1u) + negate_if(s, (h >> 2) & 1u);
}

/// Cell and place in it. Cells beyond the integers saturate.
struct Cell {
    uint32_t i;
    float f;
};
TALBOT_INLINE Cell cell_of(float x) {
    const float c = lane_floor(x);
    return {uint32_t(int32_t(minf(maxf(c, -2147483648.0f), 2147483520.0f))), x - c};
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
    return lerp(lerp(gradient(hash_words(a.i, b.i), a.f, b.f), gradient(hash_words(a.i + 1, b.i), a.f - 1.0f, b.f), u),
                lerp(gradient(hash_words(a.i, b.i + 1), a.f, b.f - 1.0f), gradient(hash_words(a.i + 1, b.i + 1), a.f - 1.0f, b.f - 1.0f), u), v);
}
TALBOT_INLINE float square_of(Cell a, Cell b, uint32_t ci, float cf, float u, float v) {
    return lerp(lerp(gradient(hash_words(a.i, b.i, ci), a.f, b.f, cf), gradient(hash_words(a.i + 1, b.i, ci), a.f - 1.0f, b.f, cf), u),
                lerp(gradient(hash_words(a.i, b.i + 1, ci), a.f, b.f - 1.0f, cf), gradient(hash_words(a.i + 1, b.i + 1, ci), a.f - 1.0f, b.f - 1.0f, cf), u),
                v);
}
TALBOT_INLINE float square_of(Cell a, Cell b, uint32_t ci, float cf, uint32_t di, float df, float u, float v) {
    return lerp(lerp(gradient(hash_words(a.i, b.i, ci, di), a.f, b.f, cf, df), gradient(hash_words(a.i + 1, b.i, ci, di), a.f - 1.0f, b.f, cf, df), u),
                lerp(gradient(hash_words(a.i, b.i + 1, ci, di), a.f, b.f - 1.0f, cf, df),
                     gradient(hash_words(a.i + 1, b.i + 1, ci, di), a.f - 1.0f, b.f - 1.0f, cf, df), u),
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
    if constexpr (D == 1) return finite_or_zero(lerp(gradient(hash_words(a.i), a.f), gradient(hash_words(a.i + 1), a.f - 1.0f), u)) * 0.25f;
    if constexpr (D == 2) return finite_or_zero(square_of(a, b, u, v)) * 0.6616f;
    if constexpr (D == 3) return finite_or_zero(lerp(square_of(a, b, c.i, c.f, u, v), square_of(a, b, c.i + 1, c.f - 1.0f, u, v), t)) * 0.9820f;
    if constexpr (D == 4) return finite_or_zero(lerp(cube_of(a, b, c, d.i, d.f, u, v, t), cube_of(a, b, c, d.i + 1, d.f - 1.0f, u, v, t), fade(d.f))) * 0.8344f;
}

/// out = signed noise at scale * (x, y, z, w).
template <int D>
TALBOT_INLINE void perlin_loop(ConstColumn x, ConstColumn y, ConstColumn z, ConstColumn w, ConstColumn scale, bool wrap, int n, Column out) {
    const float wrapping = wrap ? 1.0f : 0.0f;
    TALBOT_VECTOR_LOOP
    for (int k = 0; k < n; ++k) {
        const float s = scale[k];
        float px = finite_or_zero(x[k] * s), py = finite_or_zero(y[k] * s), pz = finite_or_zero(z[k] * s), pw = finite_or_zero(w[k] * s);
        px += (wrapped(px) - px) * wrapping;
        py += (wrapped(py) - py) * wrapping;
        pz += (wrapped(pz) - pz) * wrapping;
        pw += (wrapped(pw) - pw) * wrapping;
        out[k] = perlin<D>(px, py, pz, pw);
    }
}

void signed_noise(int dimensions, bool wrap, const float* const* p, const float* scale, int n, float* out) {
    switch (dimensions) {
        case 1:
            return perlin_loop<1>(p[0], p[1], p[2], p[3], scale, wrap, n, out);
        case 2:
            return perlin_loop<2>(p[0], p[1], p[2], p[3], scale, wrap, n, out);
        case 3:
            return perlin_loop<3>(p[0], p[1], p[2], p[3], scale, wrap, n, out);
        default:
            return perlin_loop<4>(p[0], p[1], p[2], p[3], scale, wrap, n, out);
    }
}

}  // namespace

void op_signed_noise(const Instruction& i, Registers r, int n) {
    float one[kSpan];
    fill(one, n, 1.0f);
    const float* p[4] = {r[1], r[2], r[3], r[4]};
    signed_noise((i.variant & 3) + 1, i.variant & 64, p, one, n, r[0]);
}

void op_noise(const Instruction& i, Registers r, int n) {
    // Octaves outside, lanes inside: lane k takes part in octave o fully while o <= detail, with the fraction of detail in the next one.
    Column out = r[0];
    const float* p[4] = {r[1], r[2], r[3], r[4]};
    ConstColumn detail = r[5], roughness = r[6], lacunarity = r[7], offset = r[8], gain = r[9];
    const int dimensions = (i.variant & 3) + 1;
    const NoiseKind kind = NoiseKind((i.variant >> 2) & 7);
    const bool normalize = i.variant & 32, wrap = i.variant & 64;
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
    for (int k = 0; k < n; ++k) last = maxf(last, minf(maxf(detail[k], 0.0f), 15.0f));
    const int octaves = int(lane_ceil(last)) + 1;
    for (int o = 0; o < octaves; ++o) {
        signed_noise(dimensions, wrap, p, frequency, n, noise);
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
