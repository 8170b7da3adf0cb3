// Colour: blending, colour models, ramps and curves.
#include "shader/kernels/ops.h"

namespace talbot::shader {
inline namespace TALBOT_ISA {
namespace {

TALBOT_INLINE float min3(Vec3 c) {
    return minf(c.x, minf(c.y, c.z));
}

/// Hue in turns from the sector formula all three models share.
TALBOT_INLINE float hue_of(Vec3 c, float high, float delta) {
    const float scale = delta != 0.0f ? 1.0f / delta : 0.0f;
    const float red = (c.y - c.z) * scale;
    const float green = (c.z - c.x) * scale + 2.0f;
    const float blue = (c.x - c.y) * scale + 4.0f;
    const float h = (c.x == high ? red : (c.y == high ? green : blue)) * (1.0f / 6.0f);
    return h < 0.0f ? h + 1.0f : h;
}

TALBOT_INLINE Vec3 rgb_to_hsv(Vec3 c) {
    const float high = max_component(c), delta = high - min3(c);
    const float s = high != 0.0f ? delta / (high != 0.0f ? high : 1.0f) : 0.0f;
    return {s != 0.0f ? hue_of(c, high, delta) : 0.0f, s, high};
}

/// Each channel is a trapezium over the hue circle. Hue outside [0, 1] counts as the last sixth.
TALBOT_INLINE Vec3 hsv_to_rgb(Vec3 c) {
    const float h = c.x * 6.0f, v = c.z, drop = c.z * c.y;
    const auto channel = [=](float start) {
        const float k = h + start, t = k >= 6.0f ? k - 6.0f : k;
        return v - drop * saturate(minf(t, 4.0f - t));
    };
    const float inside = minf(c.x, 1.0f - c.x);  // negative outside
    const float q = v - drop * (h - lane_floor(h));
    const float r = channel(5.0f), g = channel(3.0f), b = channel(1.0f);
    return {inside >= 0.0f ? r : v, inside >= 0.0f ? g : v - drop, inside >= 0.0f ? b : q};
}

TALBOT_INLINE Vec3 rgb_to_hsl(Vec3 c) {
    const float high = max_component(c), low = min3(c), delta = high - low, l = (high + low) * 0.5f;
    const float divisor = l > 0.5f ? 2.0f - high - low : high + low;
    const bool grey = delta == 0.0f;
    return {grey ? 0.0f : hue_of(c, high, delta), grey ? 0.0f : delta / (divisor != 0.0f ? divisor : 1.0f), minf(l, 1.0f)};
}

TALBOT_INLINE Vec3 hsl_to_rgb(Vec3 c) {
    const Vec3 n{saturate(lane_abs(c.x * 6.0f - 3.0f) - 1.0f), saturate(2.0f - lane_abs(c.x * 6.0f - 2.0f)), saturate(2.0f - lane_abs(c.x * 6.0f - 4.0f))};
    const float chroma = (1.0f - lane_abs(2.0f * c.z - 1.0f)) * c.y;
    return {(n.x - 0.5f) * chroma + c.z, (n.y - 0.5f) * chroma + c.z, (n.z - 0.5f) * chroma + c.z};
}

TALBOT_INLINE float overlay(float f, float a, float b) {
    const float dark = a * (1.0f - f + 2.0f * f * b);
    const float light = 1.0f - (1.0f - f + 2.0f * f * (1.0f - b)) * (1.0f - a);
    return a < 0.5f ? dark : light;
}
TALBOT_INLINE float dodge(float f, float a, float b) {
    const float d = 1.0f - f * b;
    const float x = d <= 0.0f ? 1.0f : minf(a / (d <= 0.0f ? 1.0f : d), 1.0f);
    return a != 0.0f ? x : 0.0f;
}
TALBOT_INLINE float burn(float f, float a, float b) {
    const float d = 1.0f - f + f * b;
    return d <= 0.0f ? 0.0f : saturate(1.0f - (1.0f - a) / (d <= 0.0f ? 1.0f : d));
}
TALBOT_INLINE float soft_light(float f, float a, float b) {
    const float screen = 1.0f - (1.0f - b) * (1.0f - a);
    return (1.0f - f) * a + f * ((1.0f - a) * b * a + a * screen);
}
TALBOT_INLINE float divide(float f, float a, float b) {
    const float x = (1.0f - f) * a + f * a / (b != 0.0f ? b : 1.0f);
    return b != 0.0f ? x : a;
}

/// Channel by channel.
template <class F>
TALBOT_INLINE void blend_channels(Registers r, int n, F f) {
    ConstColumn t = r[3];
    for (int c = 0; c < 3; ++c) {
        Column o = r[c];
        ConstColumn a = r[4 + c], b = r[7 + c];
        TALBOT_VECTOR_LOOP
        for (int k = 0; k < n; ++k) o[k] = f(t[k], a[k], b[k]);
    }
}
/// Whole colours; f(t, a, b).
template <class F>
TALBOT_INLINE void blend_colors(Registers r, int n, F f) {
    Column x = r[0], y = r[1], z = r[2];
    ConstColumn t = r[3], ax = r[4], ay = r[5], az = r[6], bx = r[7], by = r[8], bz = r[9];
    TALBOT_VECTOR_LOOP
    for (int k = 0; k < n; ++k) {
        const Vec3 v = f(t[k], Vec3{ax[k], ay[k], az[k]}, Vec3{bx[k], by[k], bz[k]});
        x[k] = v.x;
        y[k] = v.y;
        z[k] = v.z;
    }
}

TALBOT_INLINE Vec3 choose(bool c, Vec3 a, Vec3 b) {
    return {c ? a.x : b.x, c ? a.y : b.y, c ? a.z : b.z};
}

}  // namespace

void op_blend(const Instruction& i, Registers r, int n) {
    switch (BlendKind(i.variant)) {
        case BlendKind::Mix:
            return blend_channels(r, n, [](float t, float a, float b) { return a + (b - a) * t; });
        case BlendKind::Darken:
            return blend_channels(r, n, [](float t, float a, float b) { return a + (minf(a, b) - a) * t; });
        case BlendKind::Multiply:
            return blend_channels(r, n, [](float t, float a, float b) { return a + (a * b - a) * t; });
        case BlendKind::Burn:
            return blend_channels(r, n, [](float t, float a, float b) { return burn(t, a, b); });
        case BlendKind::Lighten:
            return blend_channels(r, n, [](float t, float a, float b) { return a + (maxf(a, b) - a) * t; });
        case BlendKind::Screen:
            return blend_channels(r, n, [](float t, float a, float b) { return 1.0f - (1.0f - t + t * (1.0f - b)) * (1.0f - a); });
        case BlendKind::Dodge:
            return blend_channels(r, n, [](float t, float a, float b) { return dodge(t, a, b); });
        case BlendKind::Add:
            return blend_channels(r, n, [](float t, float a, float b) { return a + b * t; });
        case BlendKind::Overlay:
            return blend_channels(r, n, [](float t, float a, float b) { return overlay(t, a, b); });
        case BlendKind::SoftLight:
            return blend_channels(r, n, [](float t, float a, float b) { return soft_light(t, a, b); });
        case BlendKind::LinearLight:
            return blend_channels(r, n, [](float t, float a, float b) { return a + t * (2.0f * b - 1.0f); });
        case BlendKind::Difference:
            return blend_channels(r, n, [](float t, float a, float b) { return a + (lane_abs(a - b) - a) * t; });
        case BlendKind::Exclusion:
            return blend_channels(r, n, [](float t, float a, float b) { return maxf(a + (b - 2.0f * a * b) * t, 0.0f); });
        case BlendKind::Subtract:
            return blend_channels(r, n, [](float t, float a, float b) { return a - b * t; });
        case BlendKind::Divide:
            return blend_channels(r, n, [](float t, float a, float b) { return divide(t, a, b); });
        case BlendKind::Hue:
            return blend_colors(r, n, [](float t, Vec3 a, Vec3 b) {
                const Vec3 ha = rgb_to_hsv(a), hb = rgb_to_hsv(b);
                return choose(hb.y != 0.0f, lerp(a, hsv_to_rgb({hb.x, ha.y, ha.z}), t), a);
            });
        case BlendKind::Saturation:
            return blend_colors(r, n, [](float t, Vec3 a, Vec3 b) {
                const Vec3 ha = rgb_to_hsv(a), hb = rgb_to_hsv(b);
                return choose(ha.y != 0.0f, hsv_to_rgb({ha.x, lerp(ha.y, hb.y, t), ha.z}), a);
            });
        case BlendKind::Color:
            return blend_colors(r, n, [](float t, Vec3 a, Vec3 b) {
                const Vec3 ha = rgb_to_hsv(a), hb = rgb_to_hsv(b);
                return choose(hb.y != 0.0f, lerp(a, hsv_to_rgb({hb.x, hb.y, ha.z}), t), a);
            });
        case BlendKind::Value:
            return blend_colors(r, n, [](float t, Vec3 a, Vec3 b) {
                const Vec3 ha = rgb_to_hsv(a), hb = rgb_to_hsv(b);
                return hsv_to_rgb({ha.x, ha.y, lerp(ha.z, hb.z, t)});
            });
    }
}

void op_color_convert(const Instruction& i, Registers r, int n) {
    Column x = r[0], y = r[1], z = r[2];
    ConstColumn a = r[3], b = r[4], c = r[5];
    const auto run = [&](auto f) {
        TALBOT_VECTOR_LOOP
        for (int k = 0; k < n; ++k) {
            const Vec3 v = f(Vec3{a[k], b[k], c[k]});
            x[k] = v.x;
            y[k] = v.y;
            z[k] = v.z;
        }
    };
    switch (ConvertKind(i.variant)) {
        case ConvertKind::RgbToHsv:
            return run([](Vec3 v) { return rgb_to_hsv(v); });
        case ConvertKind::HsvToRgb:
            return run([](Vec3 v) { return hsv_to_rgb(v); });
        case ConvertKind::RgbToHsl:
            return run([](Vec3 v) { return rgb_to_hsl(v); });
        case ConvertKind::HslToRgb:
            return run([](Vec3 v) { return hsl_to_rgb(v); });
    }
}

void op_hue_saturation(const Instruction& i, Registers r, int n) {
    const float truncates = i.variant == 1 ? 1.0f : 0.0f;
    Column x = r[0], y = r[1], z = r[2];
    ConstColumn hue = r[3], saturation = r[4], value = r[5], factor = r[6], a = r[7], b = r[8], c = r[9];
    TALBOT_VECTOR_LOOP
    for (int k = 0; k < n; ++k) {
        const Vec3 in{a[k], b[k], c[k]};
        const Vec3 h = rgb_to_hsv(in);
        const float turned = h.x + hue[k] + 0.5f, down = lane_floor(turned);
        const Vec3 v =
            lerp(in, hsv_to_rgb({turned - (down + (lane_trunc(turned) - down) * truncates), saturate(h.y * saturation[k]), h.z * value[k]}), factor[k]);
        x[k] = maxf(v.x, 0.0f);
        y[k] = maxf(v.y, 0.0f);
        z[k] = maxf(v.z, 0.0f);
    }
}

/// Two neighbours of a table at once: half as many loads.
using Neighbours [[gnu::aligned(4), gnu::may_alias]] = uint64_t;

/// A curve's value at `x` of its range, 0 to 1. Beyond the ends x stays in the first or last cell: that is the extrapolation.
TALBOT_INLINE float curve_at(const float* table, int32_t offset, int32_t last, float x, float extrapolate) {
    const float f = x * float(last);
    const float inside = minf(maxf(f, 0.0f), float(last));
    const int32_t whole = int32_t(inside);
    const int32_t cell = whole < last - 1 ? whole : last - 1;
    const float t = inside - float(cell) + (f - inside) * extrapolate;
    const uint64_t both = *reinterpret_cast<const Neighbours*>(table + offset + cell);
    const float a = as_float(uint32_t(both)), b = as_float(uint32_t(both >> 32));
    return a + (b - a) * t;
}

void op_ramp(const Instruction& i, Registers r, int n, const OpScope& s) {
    const float* __restrict table = s.programs.tables.data();
    Column red = r[0], green = r[1], blue = r[2], alpha = r[3];
    ConstColumn factor = r[4], offset = r[5], count = r[6];
    const bool constant = i.variant == 1;
    TALBOT_VECTOR_LOOP
    for (int k = 0; k < n; ++k) {
        const int32_t last = as_int(count[k]) - 1;
        const float f = saturate(factor[k]) * float(last);
        const int32_t cell = minf(f, float(last)) < 0.0f ? 0 : int32_t(minf(f, float(last)));
        const int32_t next = cell < last ? cell + 1 : last;
        const float t = constant ? 0.0f : f - float(cell);
        const int32_t a = as_int(offset[k]) + 4 * cell, b = as_int(offset[k]) + 4 * next;
        red[k] = table[a] + (table[b] - table[a]) * t;
        green[k] = table[a + 1] + (table[b + 1] - table[a + 1]) * t;
        blue[k] = table[a + 2] + (table[b + 2] - table[a + 2]) * t;
        alpha[k] = table[a + 3] + (table[b + 3] - table[a + 3]) * t;
    }
}

void op_curve(const Instruction& i, Registers r, int n, const OpScope& s) {
    const float* __restrict table = s.programs.tables.data();
    Column y = r[0];
    ConstColumn x = r[1], offset = r[2], count = r[3], low = r[4], scale = r[5];
    const float extrapolate = i.variant == 1 ? 1.0f : 0.0f;
    TALBOT_VECTOR_LOOP
    for (int k = 0; k < n; ++k) y[k] = curve_at(table, as_int(offset[k]), as_int(count[k]) - 1, (x[k] - low[k]) * scale[k], extrapolate);
}

void op_curves(const Instruction& i, Registers r, int n, const OpScope& s) {
    const float* __restrict table = s.programs.tables.data();
    Column red = r[0], green = r[1], blue = r[2];
    ConstColumn x = r[3], y = r[4], z = r[5], offset = r[6], count = r[7], low = r[8], scale = r[9];
    const float extrapolate = i.variant == 1 ? 1.0f : 0.0f;
    TALBOT_VECTOR_LOOP
    for (int k = 0; k < n; ++k) {
        const int32_t first = as_int(offset[k]), steps = as_int(count[k]), last = steps - 1;
        red[k] = curve_at(table, first, last, (x[k] - low[k]) * scale[k], extrapolate);
        green[k] = curve_at(table, first + steps, last, (y[k] - low[k]) * scale[k], extrapolate);
        blue[k] = curve_at(table, first + 2 * steps, last, (z[k] - low[k]) * scale[k], extrapolate);
    }
}

void op_lookup(const Instruction& i, Registers r, int n, const OpScope& s) {
    const float* __restrict table = s.programs.tables.data();
    Column red = r[0], green = r[1], blue = r[2];
    ConstColumn x = r[3], offset = r[4], low = r[5], scale = r[6];
    const float steps = float(i.data), last = steps - 1.0f;
    TALBOT_VECTOR_LOOP
    for (int k = 0; k < n; ++k) {
        const float f = minf(maxf((x[k] - low[k]) * scale[k], 0.0f), steps);
        const int32_t cell = int32_t(minf(f, last)), a = as_int(offset[k]) + 4 * cell;
        const float t = f - float(cell);
        red[k] = table[a] + (table[a + 4] - table[a]) * t;
        green[k] = table[a + 1] + (table[a + 5] - table[a + 1]) * t;
        blue[k] = table[a + 2] + (table[a + 6] - table[a + 2]) * t;
    }
}

void op_grid(const Instruction& i, Registers r, int n, const OpScope& s) {
    const float* __restrict table = s.programs.tables.data();
    Column red = r[0], green = r[1], blue = r[2];
    ConstColumn u = r[3], v = r[4], offset = r[5];
    const int32_t width = int32_t(i.data >> 16), height = int32_t(i.data & 0xffff);
    TALBOT_VECTOR_LOOP
    for (int k = 0; k < n; ++k) {
        const float x = clampf(u[k] * float(width) - 0.5f, 0.0f, float(width - 1)), y = clampf(v[k] * float(height) - 0.5f, 0.0f, float(height - 1));
        const int32_t x0 = int32_t(x), y0 = int32_t(y);
        const int32_t x1 = x0 + 1 < width ? x0 + 1 : x0, y1 = y0 + 1 < height ? y0 + 1 : y0;
        const float fx = x - float(x0), fy = y - float(y0);
        const int32_t first = as_int(offset[k]);
        const int32_t a = first + 3 * (y0 * width + x0), b = first + 3 * (y0 * width + x1);
        const int32_t c = first + 3 * (y1 * width + x0), d = first + 3 * (y1 * width + x1);
        const float wa = (1.0f - fx) * (1.0f - fy), wb = fx * (1.0f - fy), wc = (1.0f - fx) * fy, wd = fx * fy;
        red[k] = table[a] * wa + table[b] * wb + table[c] * wc + table[d] * wd;
        green[k] = table[a + 1] * wa + table[b + 1] * wb + table[c + 1] * wc + table[d + 1] * wd;
        blue[k] = table[a + 2] * wa + table[b + 2] * wb + table[c + 2] * wc + table[d + 2] * wd;
    }
}

}  // namespace TALBOT_ISA
}  // namespace talbot::shader
