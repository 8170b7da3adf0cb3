// Image lookup over lanes in three steps, each a plain loop over columns: texel indices and weights of one axis (1, 2 or
// 4 taps), gather and filter (by texel format), decode. Lanes that read different images are done image by image.
#include "asset/half.h"
#include "asset/texture.h"

namespace talbot::asset {
inline namespace TALBOT_ISA {

namespace {

/// Taps of one axis for a block of lanes.
struct Taps {
    int32_t index[4][kSpan];
    float weight[4][kSpan];
};

struct Block {
    Taps x, y;
    float u[kSpan], v[kSpan];
};

/// Texel coordinate of u: the lower tap is floor(position). Bounded, so that the cast to int is defined for any u, NaN too.
TALBOT_INLINE void find_positions(ConstColumn u, int n, int size, float shift, Extension extension, Column position) {
    const float s = float(size);
    switch (extension) {
        case Extension::Repeat:
            for (int i = 0; i < n; ++i) {
                const float t = u[i] - __builtin_floorf(u[i]);
                position[i] = minf(maxf(t * s - shift, -8.0f), s + 8.0f);
            }
            break;
        case Extension::Mirror:
            for (int i = 0; i < n; ++i) {
                const float t = u[i] - 2.0f * __builtin_floorf(u[i] * 0.5f);
                const float m = t > 1.0f ? 2.0f - t : t;
                position[i] = minf(maxf(m * s - shift, -8.0f), s + 8.0f);
            }
            break;
        default:
            for (int i = 0; i < n; ++i) position[i] = minf(maxf(u[i] * s - shift, -8.0f), s + 8.0f);
            break;
    }
}

/// Brings tap indices into [0, size); what Clip finds outside weighs nothing (Blender reads transparent black there).
TALBOT_INLINE void wrap_taps(IntColumn index, Column weight, int n, int size, Extension extension) {
    const int last = size - 1;
    switch (extension) {
        case Extension::Repeat:
            for (int i = 0; i < n; ++i) {
                int j = index[i];
                j = j < 0 ? j + size : j;
                j = j > last ? j - size : j;
                j = j < 0 ? 0 : j;
                index[i] = j > last ? last : j;
            }
            break;
        case Extension::Mirror:
            for (int i = 0; i < n; ++i) {
                int j = index[i];
                j = j < 0 ? -1 - j : j;
                j = j > last ? 2 * size - 1 - j : j;
                j = j < 0 ? 0 : j;
                index[i] = j > last ? last : j;
            }
            break;
        case Extension::Clip:
            for (int i = 0; i < n; ++i) {
                const int j = index[i];
                weight[i] = ((j < 0) | (j > last)) ? 0.0f : weight[i];
                const int k = j < 0 ? 0 : j;
                index[i] = k > last ? last : k;
            }
            break;
        default:
            for (int i = 0; i < n; ++i) {
                const int j = index[i] < 0 ? 0 : index[i];
                index[i] = j > last ? last : j;
            }
            break;
    }
}

/// Taps of one axis: nearest texel (1), linear (2), cubic B-spline (4).
template <int kTaps>
TALBOT_INLINE void find_taps(ConstColumn u, int n, int size, Extension extension, Taps& taps) {
    float position[kSpan];
    find_positions(u, n, size, kTaps == 1 ? 0.0f : 0.5f, extension, position);
    IntColumn i0 = taps.index[0];
    IntColumn i1 = taps.index[1];
    IntColumn i2 = taps.index[2];
    IntColumn i3 = taps.index[3];
    Column w0 = taps.weight[0];
    Column w1 = taps.weight[1];
    Column w2 = taps.weight[2];
    Column w3 = taps.weight[3];
    for (int i = 0; i < n; ++i) {
        const float base = __builtin_floorf(position[i]);
        const float t = position[i] - base;
        const int j = int(base);
        if constexpr (kTaps == 1) {
            i0[i] = j;
            w0[i] = 1.0f;
        } else if constexpr (kTaps == 2) {
            i0[i] = j;
            i1[i] = j + 1;
            w0[i] = 1.0f - t;
            w1[i] = t;
        } else {
            const float r = 1.0f - t, t2 = t * t;
            i0[i] = j - 1;
            i1[i] = j;
            i2[i] = j + 1;
            i3[i] = j + 2;
            w0[i] = r * r * r * (1.0f / 6.0f);
            w1[i] = (0.5f * t - 1.0f) * t2 + 2.0f / 3.0f;
            w3[i] = t * t2 * (1.0f / 6.0f);
            w2[i] = 1.0f - w0[i] - w1[i] - w3[i];
        }
    }
    for (int k = 0; k < kTaps; ++k) wrap_taps(taps.index[k], taps.weight[k], n, size, extension);
}

struct Rgba {
    float r, g, b, a;
};

/// One texel, integers as they are stored. Index: 64 bits wide for images whose channels 32 bits cannot count.
template <TexelFormat kFormat, class Index>
TALBOT_INLINE Rgba fetch(const void* texels, Index i) {
    if constexpr (kFormat == TexelFormat::Byte4) {
        const uint32_t t = static_cast<const uint32_t*>(texels)[i];
        return {float(int32_t(t & 255u)), float(int32_t(t >> 8 & 255u)), float(int32_t(t >> 16 & 255u)), float(int32_t(t >> 24))};
    } else if constexpr (kFormat == TexelFormat::Short4 || kFormat == TexelFormat::Half4) {
        const uint32_t low = static_cast<const uint32_t*>(texels)[2 * i], high = static_cast<const uint32_t*>(texels)[2 * i + 1];
        if constexpr (kFormat == TexelFormat::Half4)
            return {half_to_float(low & 0xffffu), half_to_float(low >> 16), half_to_float(high & 0xffffu), half_to_float(high >> 16)};
        else
            return {float(int32_t(low & 0xffffu)), float(int32_t(low >> 16)), float(int32_t(high & 0xffffu)), float(int32_t(high >> 16))};
    } else if constexpr (kFormat == TexelFormat::Float4) {
        const float* t = static_cast<const float*>(texels);
        return {t[4 * i], t[4 * i + 1], t[4 * i + 2], t[4 * i + 3]};
    } else if constexpr (kFormat == TexelFormat::Byte1) {
        const float t = float(int32_t(static_cast<const uint8_t*>(texels)[i]));
        return {t, t, t, 255.0f};
    } else if constexpr (kFormat == TexelFormat::Short1) {
        const float t = float(int32_t(static_cast<const uint16_t*>(texels)[i]));
        return {t, t, t, 65535.0f};
    } else if constexpr (kFormat == TexelFormat::Half1) {
        const float t = half_to_float(static_cast<const uint16_t*>(texels)[i]);
        return {t, t, t, 1.0f};
    } else {
        const float t = static_cast<const float*>(texels)[i];
        return {t, t, t, 1.0f};
    }
}

/// Weighted sum of kTaps x kTaps texels, times scale.
template <TexelFormat kFormat, int kTaps, class Index>
TALBOT_INLINE void gather_taps(const Texture& texture, const Taps& x, const Taps& y, int n, float scale, Column r, Column g, Column b, Column a) {
    const void* texels = texture.texels;
    const Index width = texture.width;
    TALBOT_VECTOR_LOOP
    for (int i = 0; i < n; ++i) {
        Rgba sum{0, 0, 0, 0};
        for (int k = 0; k < kTaps; ++k) {
            const Index row = Index(y.index[k][i]) * width;
            const float wy = y.weight[k][i] * scale;
            for (int j = 0; j < kTaps; ++j) {
                const Rgba t = fetch<kFormat, Index>(texels, row + Index(x.index[j][i]));
                const float w = x.weight[j][i] * wy;
                sum.r += w * t.r;
                sum.g += w * t.g;
                sum.b += w * t.b;
                sum.a += w * t.a;
            }
        }
        r[i] = sum.r;
        g[i] = sum.g;
        b[i] = sum.b;
        a[i] = sum.a;
    }
}

template <int kTaps>
void filter_block(const Texture& texture, const float* u, const float* v, int n, Extension extension, Block& block, float scale, float* r, float* g, float* b,
                  float* a) {
    find_taps<kTaps>(u, n, texture.width, extension, block.x);
    find_taps<kTaps>(v, n, texture.height, extension, block.y);
    const bool is_large = int64_t(texture.width) * texture.height * 4 > INT32_MAX;
    switch (texture.format) {
        case TexelFormat::Byte4:
            gather_taps<TexelFormat::Byte4, kTaps, int32_t>(texture, block.x, block.y, n, scale, r, g, b, a);
            break;
        case TexelFormat::Byte1:
            gather_taps<TexelFormat::Byte1, kTaps, int32_t>(texture, block.x, block.y, n, scale, r, g, b, a);
            break;
        case TexelFormat::Half1:
            gather_taps<TexelFormat::Half1, kTaps, int32_t>(texture, block.x, block.y, n, scale, r, g, b, a);
            break;
        case TexelFormat::Short1:
            gather_taps<TexelFormat::Short1, kTaps, int32_t>(texture, block.x, block.y, n, scale, r, g, b, a);
            break;
        case TexelFormat::Float1:
            gather_taps<TexelFormat::Float1, kTaps, int32_t>(texture, block.x, block.y, n, scale, r, g, b, a);
            break;
        case TexelFormat::Half4:
            if (is_large)
                gather_taps<TexelFormat::Half4, kTaps, int64_t>(texture, block.x, block.y, n, scale, r, g, b, a);
            else
                gather_taps<TexelFormat::Half4, kTaps, int32_t>(texture, block.x, block.y, n, scale, r, g, b, a);
            break;
        case TexelFormat::Short4:
            if (is_large)
                gather_taps<TexelFormat::Short4, kTaps, int64_t>(texture, block.x, block.y, n, scale, r, g, b, a);
            else
                gather_taps<TexelFormat::Short4, kTaps, int32_t>(texture, block.x, block.y, n, scale, r, g, b, a);
            break;
        case TexelFormat::Float4:
            if (is_large)
                gather_taps<TexelFormat::Float4, kTaps, int64_t>(texture, block.x, block.y, n, scale, r, g, b, a);
            else
                gather_taps<TexelFormat::Float4, kTaps, int32_t>(texture, block.x, block.y, n, scale, r, g, b, a);
            break;
    }
}

/// Levels are within [0, 255] but for rounding, being convex sums of bytes: the table's 257th entry catches that. No clamp here: the
/// compiler would split the loop at it and vectorise neither half.
void decode_column(ConstColumn table, int n, Column c) {
    TALBOT_VECTOR_LOOP
    for (int i = 0; i < n; ++i) {
        const int k = int(c[i]);
        const float low = table[k], high = table[k + 1];
        c[i] = low + (high - low) * (c[i] - float(k));
    }
}

/// Colour over alpha where alpha is not 0; `scale` brings alpha to 0..1, `limit` is the largest colour.
void unassociate_columns(int n, float scale, float limit, Column r, Column g, Column b, ConstColumn a) {
    for (int i = 0; i < n; ++i) {
        const float alpha = a[i] * scale;
        const float inverse = 1.0f / (alpha == 0.0f ? 1.0f : alpha);
        r[i] = minf(r[i] * inverse, limit);
        g[i] = minf(g[i] * inverse, limit);
        b[i] = minf(b[i] * inverse, limit);
    }
}

void scale_column(int n, float scale, Column a) {
    for (int i = 0; i < n; ++i) a[i] *= scale;
}

void lookup_one(const Texture& texture, const float* u, const float* v, int n, Interpolation interpolation, Extension extension, bool unassociate, Block& block,
                float* r, float* g, float* b, float* a) {
    if (!texture.texels || texture.width <= 0 || texture.height <= 0) {
        fill(r, n, 1.0f);
        fill(g, n, 0.0f);
        fill(b, n, 1.0f);
        fill(a, n, 1.0f);
        return;
    }
    const bool is_byte = texture.format == TexelFormat::Byte1 || texture.format == TexelFormat::Byte4;
    const bool is_short = texture.format == TexelFormat::Short1 || texture.format == TexelFormat::Short4;
    // Encoded texels are filtered as levels 0..255, the decode table's own unit.
    const float full = is_byte ? 255.0f : is_short ? 65535.0f : 1.0f;
    const float unit = texture.decode ? 255.0f : 1.0f;
    const float scale = unit / full;
    if (interpolation == Interpolation::Closest)
        filter_block<1>(texture, u, v, n, extension, block, scale, r, g, b, a);
    else if (interpolation == Interpolation::Linear)
        filter_block<2>(texture, u, v, n, extension, block, scale, r, g, b, a);
    else
        filter_block<4>(texture, u, v, n, extension, block, scale, r, g, b, a);
    if (unassociate && texture.is_associated) unassociate_columns(n, 1.0f / unit, texture.decode ? 255.0f : 3.4e38f, r, g, b, a);
    if (texture.decode) {
        decode_column(texture.decode, n, r);
        decode_column(texture.decode, n, g);
        decode_column(texture.decode, n, b);
        scale_column(n, 1.0f / unit, a);
    }
}

/// Index of the texture a lane reads (-1: none), and its coordinates within a UDIM tile.
TALBOT_INLINE int32_t find_texture(const TextureTable& table, int32_t handle, float& u, float& v) {
    if (handle < 0 || handle >= table.count) return -1;
    const int first_tile = table.textures[handle].first_tile;
    if (first_tile < 0) return handle;
    const float tile_u = __builtin_floorf(u), tile_v = __builtin_floorf(v);
    if (!(tile_u >= 0.0f && tile_u <= 9.0f && tile_v >= 0.0f && tile_v <= 9.0f)) return -1;
    u -= tile_u;
    v -= tile_v;
    return table.tiles[first_tile + int(tile_u) + 10 * int(tile_v)];
}

void lookup_block(const TextureTable& table, const int32_t* handle, const float* u, const float* v, int n, Interpolation interpolation, Extension extension,
                  bool unassociate, float* r, float* g, float* b, float* a) {
    Block block;
    const Texture missing;
    // The common case: the whole span reads one untiled image.
    int differing = 0;
    for (int i = 0; i < n; ++i) differing |= handle[i] ^ handle[0];
    const bool is_valid = handle[0] >= 0 && handle[0] < table.count;
    if (differing == 0 && (!is_valid || table.textures[handle[0]].first_tile < 0)) {
        lookup_one(is_valid ? table.textures[handle[0]] : missing, u, v, n, interpolation, extension, unassociate, block, r, g, b, a);
        return;
    }

    int32_t index[kSpan], rest[kSpan], lanes[kSpan];
    float local_u[kSpan], local_v[kSpan], group_u[kSpan], group_v[kSpan], out[4][kSpan];
    for (int i = 0; i < n; ++i) {
        local_u[i] = u[i];
        local_v[i] = v[i];
        index[i] = find_texture(table, handle[i], local_u[i], local_v[i]);
        rest[i] = i;
    }
    for (int left = n; left > 0;) {
        const int32_t current = index[rest[0]];
        int count = 0, remaining = 0;
        for (int k = 0; k < left; ++k) {
            const int32_t lane = rest[k];
            if (index[lane] == current)
                lanes[count++] = lane;
            else
                rest[remaining++] = lane;
        }
        left = remaining;
        gather(local_u, lanes, count, group_u);
        gather(local_v, lanes, count, group_v);
        lookup_one(current >= 0 ? table.textures[current] : missing, group_u, group_v, count, interpolation, extension, unassociate, block, out[0], out[1],
                   out[2], out[3]);
        scatter(out[0], lanes, count, r);
        scatter(out[1], lanes, count, g);
        scatter(out[2], lanes, count, b);
        scatter(out[3], lanes, count, a);
    }
}

}  // namespace

void lookup_texture(const TextureTable& table, const int32_t* handle, const float* u, const float* v, int n, Interpolation interpolation, Extension extension,
                    Columns3 rgb, float* alpha, bool unassociate) {
    for (int i = 0; i < n; i += kSpan) {
        const int count = n - i < kSpan ? n - i : kSpan;
        lookup_block(table, handle + i, u + i, v + i, count, interpolation, extension, unassociate, rgb.x + i, rgb.y + i, rgb.z + i, alpha + i);
    }
}

}  // namespace TALBOT_ISA
}  // namespace talbot::asset
