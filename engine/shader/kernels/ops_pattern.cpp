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

void op_magic(const Instruction& i, Registers r, int n) {
    Column red = r[0], green = r[1], blue = r[2];
    ConstColumn px = r[3], py = r[4], pz = r[5], scale = r[6], distortion = r[7];
    const int depth = i.variant;
    TALBOT_VECTOR_LOOP
    for (int k = 0; k < n; ++k) {
        const float s = scale[k] * 5.0f;
        const float a = px[k] - kTwoPi * lane_trunc(px[k] / kTwoPi);
        const float b = py[k] - kTwoPi * lane_trunc(py[k] / kTwoPi);
        const float c = pz[k] - kTwoPi * lane_trunc(pz[k] / kTwoPi);
        red[k] = lane_sin((a + b + c) * s);
        green[k] = lane_cos((-a + b - c) * s);
        blue[k] = -lane_cos((-a - b + c) * s);
    }
    for (int step = 1; step <= depth; ++step) {
        TALBOT_VECTOR_LOOP
        for (int k = 0; k < n; ++k) {
            const float d = distortion[k];
            float x = red[k], y = green[k], z = blue[k];
            if (step == 1) {
                x *= d;
                y *= d;
                z *= d;
            }
            // Which component is disturbed, and by which signs of the three.
            switch (step) {
                case 1:
                    y = -lane_cos(x - y + z) * d;
                    break;
                case 2:
                    x = lane_cos(x - y - z) * d;
                    break;
                case 3:
                    z = lane_sin(-x - y - z) * d;
                    break;
                case 4:
                    x = -lane_cos(-x + y - z) * d;
                    break;
                case 5:
                    y = -lane_sin(-x + y + z) * d;
                    break;
                case 6:
                    y = -lane_cos(-x + y + z) * d;
                    break;
                case 7:
                    x = lane_cos(x + y + z) * d;
                    break;
                case 8:
                    z = lane_sin(x + y - z) * d;
                    break;
                case 9:
                    x = -lane_cos(-x - y + z) * d;
                    break;
                default:
                    y = -lane_sin(x - y + z) * d;
                    break;
            }
            red[k] = x;
            green[k] = y;
            blue[k] = z;
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
    const int32_t offset_every = int32_t(i.data & 0xffu), squash_every = int32_t(i.data >> 8);
    const bool clamps = i.variant == 1;
    for (int k = 0; k < n; ++k) {
        const float px = x[k] * scale[k], py = y[k] * scale[k];
        const float height = height_in[k] != 0.0f ? height_in[k] : 1e-6f;
        const int32_t row = lane_int(lane_floor(py / height));
        float width = width_in[k], shift = 0.0f;
        if (offset_every && squash_every) {
            width *= row % squash_every == 0 ? squash[k] : 1.0f;
            shift = row % offset_every == 0 ? width * offset[k] : 0.0f;
        }
        width = width != 0.0f ? width : 1e-6f;
        const int32_t brick = lane_int(lane_floor((px + shift) / width));
        const float bx = px + shift - width * float(brick), by = py - height * float(row);
        uint32_t h = (uint32_t(row) << 16) + (uint32_t(brick) & 0xffffu);
        h = (h + 1013u) & 0x7fffffffu;
        h ^= h >> 13;
        h = (h * (h * h * 60493u + 19990303u) + 1376312589u) & 0x7fffffffu;
        tint[k] = saturate(0.5f * (float(int32_t(h)) / 1073741824.0f) + bias[k]);
        const float edge = minf(minf(bx, by), minf(width - bx, height - by));
        const float depth = 1.0f - edge / (size[k] != 0.0f ? size[k] : 1.0f);
        const float soft = smooth[k] == 0.0f ? 1.0f : smoothstep(saturate(depth / (smooth[k] == 0.0f ? 1.0f : smooth[k])));
        mortar[k] = edge >= size[k] ? 0.0f : ((depth < smooth[k]) | clamps ? soft : 1.0f);
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
