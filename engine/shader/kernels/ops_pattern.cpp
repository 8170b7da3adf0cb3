// Wave, magic, brick, checker and gradient textures.
#include "shader/kernels/ops.h"

namespace talbot::shader {
inline namespace TALBOT_ISA {
namespace {

TALBOT_INLINE float smoothstep(float t) {
    return t * t * (3.0f - 2.0f * t);
}

/// Keeps coordinates that lie on a cell's border inside it, whatever rounding did before.
TALBOT_INLINE float nudged(float x) {
    return (x + 1e-6f) * 0.999999f;
}

/// One half of a side of a rounded polygon whose apothem is 1, from its middle (angle 0) to the divider to the next side. Straight up to `bevel`, an
/// arc beyond; the parameter along the side runs like the tangent first, like the angle at last, blended over `spline`.
struct HalfSide {
    float bevel, arc;     ///< angles: middle to the arc's start, from there to the divider
    float spline, round;  ///< part of the arc over which the parameter is blended; roundness that counts
    float scale;          ///< of the irregular last side: distances and parameters against those of the others
    Vec2 center;          ///< of the arc's circle, x along the divider, y away from the middle
    float radius2;
    float unit;  ///< of distances that the circle gives
    /// Parameter at distance 1 from the middle's line, and its width.
    TALBOT_MEMBER float width(float distance) const { return distance * lane_tan(bevel) + spline * (0.5f * distance + 0.5f) + round * arc; }
    TALBOT_MEMBER void at(float angle, float r, float& distance, float& parameter, float& whole) const {
        const float past = angle - bevel;  // along the arc
        float s, c, sb, cb;
        lane_sincos(bevel + arc - angle, s, c);
        lane_sincos(bevel, sb, cb);
        const float along = c * center.x + s * center.y;
        const float reach = along + safe_sqrt(along * along + radius2 - center.x * center.x - center.y * center.y);
        const bool straight = past <= 0.0f;
        const float l = straight ? r * lane_cos(angle) : unit * r / maxf(reach, 1e-6f);
        // The arc: the tangent's part, then a slope that goes from the tangent's to 1.
        const float slope = r * cb;
        const float blended = slope * past + 0.5f * (1.0f - slope) * past * past / maxf(spline, 1e-9f);
        const float even = spline * (0.5f * slope - 0.5f) + past;
        const float curved = r * sb + (past < spline ? blended : even);
        const float rim = r * sb + spline * (0.5f * slope + 0.5f) + round * arc;
        distance = scale * l;
        parameter = scale * (straight ? r * lane_sin(angle) : curved);
        whole = scale * lerp(width(l), rim, straight ? 0.0f : past / maxf(arc, 1e-9f));
    }
};

/// Half of a side of half angle `half` between equal sides.
TALBOT_INLINE HalfSide regular_half(float half, float roundness) {
    HalfSide h;
    h.bevel = lane_atan((1.0f - roundness) * lane_tan(half));
    h.arc = half - h.bevel;
    h.spline = (1.0f - roundness) * h.arc;
    h.round = roundness;
    h.scale = 1.0f;
    h.center = {(1.0f - roundness) / maxf(lane_cos(half), 1e-6f), 0.0f};
    h.radius2 = roundness * roundness;
    h.unit = 1.0f;
    return h;
}
/// At the corner between a side of half angle `half` and the last one of half angle `last`, which is closer to the middle by `scale`:
/// a circle that touches both where the last side's own bevel starts.
TALBOT_INLINE HalfSide irregular_half(float half, float last, float roundness, bool inner, float scale) {
    HalfSide h = regular_half(last, roundness);
    const float radius = roundness * lane_tan(last) / maxf(lane_tan(0.5f * (half + last)), 1e-6f);
    const float start = 1.0f / maxf(lane_cos(h.bevel), 1e-6f);
    const Vec2 center{lane_cos(h.arc) * start - radius * lane_cos(last), radius * lane_sin(last) - lane_sin(h.arc) * start};
    h.radius2 = radius * radius;
    h.scale = inner ? scale : 1.0f;
    h.unit = inner ? 1.0f : scale;
    // The arc lies on both sides of the divider.
    const float arc = lane_atan2(center.y + radius * lane_sin(half), center.x + radius * lane_cos(half));
    const float bevel = half - arc, round = 1.0f - lane_tan(bevel) / maxf(lane_tan(half), 1e-9f);
    h.bevel = inner ? h.bevel : bevel;
    h.arc = inner ? h.arc : arc;
    h.round = inner ? h.round : round;
    h.spline = (1.0f - h.round) * h.arc;
    h.center = {center.x, inner ? -center.y : center.y};
    return h;
}

}  // namespace

void op_radial_tiling(const Instruction& i, Registers r, int n) {
    const bool normalized = i.variant == 1;
    for (int k = 0; k < n; ++k) {
        const float x = r[5][k], y = r[6][k], sides = clampf(r[7][k], 2.0f, 1e6f), roundness = saturate(r[8][k]);
        const float theta = lane_atan2(y, x) + (y < 0.0f ? kTwoPi : 0.0f), radius = std::sqrt(x * x + y * y);
        // Equal sides, and what is left of the circle as the last one.
        const float half = kPi / sides, whole_sides = lane_floor(sides), last = kPi - whole_sides * half;
        const bool regular = whole_sides == sides;
        const float id = lane_floor(theta / (2.0f * half));
        const bool in_last = !regular && id >= whole_sides;
        const float own = in_last ? last : half, middle = 2.0f * half * id + own, angle = theta - middle;
        const bool beside_last = !regular && ((id == 0.0f && angle < 0.0f) || (id == whole_sides - 1.0f && angle > 0.0f));
        const float scale = lane_cos(half) / maxf(lane_cos(last), 1e-6f);
        const HalfSide plain = regular_half(half, roundness);
        HalfSide h = plain;
        // Corners without roundness are all alike.
        if (roundness == 0.0f && in_last) {
            h = regular_half(last, 0.0f);
            h.scale = scale;
        } else if (roundness > 0.0f && (in_last || beside_last)) {
            h = irregular_half(half, last, roundness, in_last, scale);
        }
        float distance, parameter, whole;
        h.at(lane_abs(angle), radius, distance, parameter, whole);
        // Two straight sides have no ends.
        const bool endless = sides == 2.0f && roundness == 0.0f;
        parameter = normalized && !endless ? parameter / (whole != 0.0f ? whole : 1.0f) : parameter;
        parameter = radius == 0.0f ? 0.0f : (angle < 0.0f ? -parameter : parameter);
        const float last_width = lane_tan(h.bevel) + h.scale * (h.spline * (0.5f / h.scale + 0.5f) + h.round * h.arc);
        const float width = in_last ? last_width : (endless ? 0.0f : plain.width(1.0f));
        r[0][k] = normalized ? 0.5f * parameter + 0.5f : parameter;
        r[1][k] = normalized ? distance : distance - 1.0f;
        r[2][k] = id;
        r[3][k] = width;
        r[4][k] = middle;
    }
}

void op_wave(const Instruction& i, Registers r, int n) {
    Column out = r[0];
    ConstColumn x = r[1], y = r[2], z = r[3], phase = r[4];
    const bool rings = i.variant & 1;
    const int axis = (i.variant >> 1) & 3;
    const WaveProfile profile = WaveProfile(i.variant >> 3);
    // Weights of the coordinates: bands add them, rings measure the length of what the axis leaves.
    float weight[3];
    for (int c = 0; c < 3; ++c) weight[c] = axis == 3 ? (rings ? 1.0f : 0.5f) : ((axis == c) != rings ? 1.0f : 0.0f);
    TALBOT_VECTOR_LOOP
    for (int k = 0; k < n; ++k) {
        const float px = nudged(x[k]) * weight[0], py = nudged(y[k]) * weight[1], pz = nudged(z[k]) * weight[2];
        const float s = rings ? std::sqrt(px * px + py * py + pz * pz) : px + py + pz;
        out[k] = s * 20.0f + phase[k];
    }
    switch (profile) {
        case WaveProfile::Sine:
            TALBOT_VECTOR_LOOP
            for (int k = 0; k < n; ++k) out[k] = 0.5f + 0.5f * lane_sin(out[k] - kHalfPi);
            return;
        case WaveProfile::Saw:
            TALBOT_VECTOR_LOOP
            for (int k = 0; k < n; ++k) out[k] = lane_fract(out[k] * (0.5f * kInvPi));
            return;
        case WaveProfile::Triangle:
            TALBOT_VECTOR_LOOP
            for (int k = 0; k < n; ++k) {
                const float t = out[k] * (0.5f * kInvPi);
                out[k] = 2.0f * lane_abs(t - lane_floor(t + 0.5f));
            }
            return;
    }
}

/// A step of the turbulence: one component of the three, from all of them.
template <class F>
TALBOT_INLINE void disturb(int n, float* component, const float* distortion, const float* x, const float* y, const float* z, F f) {
    TALBOT_VECTOR_LOOP
    for (int k = 0; k < n; ++k) component[k] = f(x[k], y[k], z[k]) * distortion[k];
}

void op_magic(const Instruction& i, Registers r, int n) {
    Column red = r[0], green = r[1], blue = r[2];
    ConstColumn px = r[3], py = r[4], pz = r[5], scale = r[6], distortion = r[7];
    const int depth = i.variant;
    TALBOT_VECTOR_LOOP
    for (int k = 0; k < n; ++k) {
        const float s = scale[k] * 5.0f, first = distortion[k], d = depth > 0 ? first : 1.0f;
        const float a = px[k] - kTwoPi * lane_trunc(px[k] / kTwoPi);
        const float b = py[k] - kTwoPi * lane_trunc(py[k] / kTwoPi);
        const float c = pz[k] - kTwoPi * lane_trunc(pz[k] / kTwoPi);
        red[k] = lane_sin((a + b + c) * s) * d;
        green[k] = lane_cos((-a + b - c) * s) * d;
        blue[k] = -lane_cos((-a - b + c) * s) * d;
    }
    float *x = r[0], *y = r[1], *z = r[2];
    for (int step = 1; step <= depth; ++step) {
        const auto turn = [&](float* component, auto f) { disturb(n, component, distortion, x, y, z, f); };
        switch (step) {
            case 1:
                turn(y, [](float a, float b, float c) { return -lane_cos(a - b + c); });
                break;
            case 2:
                turn(x, [](float a, float b, float c) { return lane_cos(a - b - c); });
                break;
            case 3:
                turn(z, [](float a, float b, float c) { return lane_sin(-a - b - c); });
                break;
            case 4:
                turn(x, [](float a, float b, float c) { return -lane_cos(-a + b - c); });
                break;
            case 5:
                turn(y, [](float a, float b, float c) { return -lane_sin(-a + b + c); });
                break;
            case 6:
                turn(y, [](float a, float b, float c) { return -lane_cos(-a + b + c); });
                break;
            case 7:
                turn(x, [](float a, float b, float c) { return lane_cos(a + b + c); });
                break;
            case 8:
                turn(z, [](float a, float b, float c) { return lane_sin(a + b - c); });
                break;
            case 9:
                turn(x, [](float a, float b, float c) { return -lane_cos(-a - b + c); });
                break;
            default:
                turn(y, [](float a, float b, float c) { return -lane_sin(a - b + c); });
                break;
        }
    }
    TALBOT_VECTOR_LOOP
    for (int k = 0; k < n; ++k) {
        const float d = distortion[k] != 0.0f ? 0.5f / distortion[k] : 1.0f;
        red[k] = 0.5f - red[k] * d;
        green[k] = 0.5f - green[k] * d;
        blue[k] = 0.5f - blue[k] * d;
    }
}

void op_brick(const Instruction& i, Registers r, int n) {
    Column tint = r[0], mortar = r[1];
    ConstColumn x = r[2], y = r[3], scale = r[5], size = r[6], smooth = r[7], bias = r[8], width_in = r[9], height_in = r[10], offset = r[11], squash = r[12];
    // Rows are whole numbers in floats: the division of a multiple is exact. Without both frequencies no row is another's multiple.
    const bool changes = (i.data & 0xffu) != 0 && (i.data >> 8) != 0;
    const float offset_every = changes ? float(int32_t(i.data & 0xffu)) : 1.0f, squash_every = changes ? float(int32_t(i.data >> 8)) : 1.0f;
    const float clamps = i.variant == 1 ? 1.0f : 0.0f;
    TALBOT_VECTOR_LOOP
    for (int k = 0; k < n; ++k) {
        const float px = x[k] * scale[k], py = y[k] * scale[k];
        const float narrow = squash[k], along = offset[k], border = size[k], softness = smooth[k], high = height_in[k];
        const float height = high != 0.0f ? high : 1e-6f;
        const float row = lane_floor(py / height);
        const bool squashed = lane_trunc(row / squash_every) * squash_every == row, shifted = lane_trunc(row / offset_every) * offset_every == row;
        const float stretched = width_in[k] * ((squashed & changes) ? narrow : 1.0f);
        const float shift = (shifted & changes) ? stretched * along : 0.0f;
        const float width = stretched != 0.0f ? stretched : 1e-6f;
        const float brick = lane_floor((px + shift) / width);
        const float bx = px + shift - width * brick, by = py - height * row;
        uint32_t h = (uint32_t(lane_int(row)) << 16) + (uint32_t(lane_int(brick)) & 0xffffu);
        h = (h + 1013u) & 0x7fffffffu;
        h ^= h >> 13;
        h = (h * (h * h * 60493u + 19990303u) + 1376312589u) & 0x7fffffffu;
        tint[k] = saturate(0.5f * (float(int32_t(h)) / 1073741824.0f) + bias[k]);
        const float edge = minf(minf(bx, by), minf(width - bx, height - by));
        const float depth = 1.0f - edge / (border != 0.0f ? border : 1.0f);
        const float soft = smoothstep(saturate(depth / (softness == 0.0f ? 1.0f : softness)));
        const float clear = ((depth < softness) | (clamps != 0.0f)) ? (softness == 0.0f ? 1.0f : soft) : 1.0f;
        mortar[k] = edge >= border ? 0.0f : clear;
    }
}

void op_checker(Registers r, int n) {
    Column out = r[0];
    ConstColumn x = r[1], y = r[2], z = r[3];
    TALBOT_VECTOR_LOOP
    for (int k = 0; k < n; ++k) {
        const auto odd = [](float c) {
            const float f = lane_floor(nudged(c));
            return f - 2.0f * lane_floor(f * 0.5f);
        };
        const float sum = odd(x[k]) + odd(y[k]) + odd(z[k]);
        out[k] = sum == 1.0f || sum == 3.0f ? 1.0f : 0.0f;
    }
}

void op_gradient(const Instruction& i, Registers r, int n) {
    Column out = r[0];
    ConstColumn x = r[1], y = r[2], z = r[3];
    switch (GradientKind(i.variant)) {
        case GradientKind::Linear:
            return map1(r, n, [](float a) { return saturate(a); });
        case GradientKind::Quadratic:
            return map1(r, n, [](float a) { return saturate(square(maxf(a, 0.0f))); });
        case GradientKind::Easing:
            return map1(r, n, [](float a) { return smoothstep(saturate(a)); });
        case GradientKind::Diagonal:
            return map2(r, n, [](float a, float b) { return saturate((a + b) * 0.5f); });
        case GradientKind::Radial:
            return map2(r, n, [](float a, float b) { return saturate(lane_atan2(b, a) * (0.5f * kInvPi) + 0.5f); });
        case GradientKind::Spherical:
        case GradientKind::QuadraticSphere: {
            const bool quadratic = GradientKind(i.variant) == GradientKind::QuadraticSphere;
            TALBOT_VECTOR_LOOP
            for (int k = 0; k < n; ++k) {
                const float s = maxf(0.999999f - std::sqrt(x[k] * x[k] + y[k] * y[k] + z[k] * z[k]), 0.0f);
                out[k] = saturate(quadratic ? s * s : s);
            }
            return;
        }
    }
}

}  // namespace TALBOT_ISA
}  // namespace talbot::shader
