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

}  // namespace

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
        mortar[k] = edge >= size[k] ? 0.0f : (depth < smooth[k] ? soft : 1.0f);
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
