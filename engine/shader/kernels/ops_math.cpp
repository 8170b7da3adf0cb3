// Scalar and vector arithmetic.
#include "shader/kernels/ops.h"

namespace talbot::shader {
inline namespace TALBOT_ISA {
namespace {

TALBOT_INLINE float safe_divide(float a, float b) {
    return b == 0.0f ? 0.0f : a / b;
}

TALBOT_INLINE float truncated_modulo(float a, float b) {
    const float q = a / (b == 0.0f ? 1.0f : b);
    const float m = a - b * lane_trunc(q);
    return b == 0.0f ? 0.0f : m;
}

TALBOT_INLINE float floored_modulo(float a, float b) {
    const float q = a / (b == 0.0f ? 1.0f : b);
    const float m = a - b * lane_floor(q);
    return b == 0.0f ? 0.0f : m;
}

TALBOT_INLINE float smooth_minimum(float a, float b, float c) {
    const float h = maxf(c - lane_abs(a - b), 0.0f) / (c == 0.0f ? 1.0f : c);
    const float smooth = minf(a, b) - h * h * h * c * (1.0f / 6.0f);
    return c == 0.0f ? minf(a, b) : smooth;
}

TALBOT_INLINE float wrap(float a, float high, float low) {
    const float range = high - low;
    const float w = a - range * lane_floor((a - low) / (range == 0.0f ? 1.0f : range));
    return range == 0.0f ? low : w;
}

TALBOT_INLINE float ping_pong(float a, float b) {
    const float period = b * 2.0f;
    const float p = lane_abs(lane_fract((a - b) / (b == 0.0f ? 1.0f : period)) * period - b);
    return b == 0.0f ? 0.0f : p;
}

TALBOT_INLINE float logarithm(float a, float b) {
    const float base = lane_log2(b > 0.0f ? b : 2.0f);
    const float l = lane_log2(a > 0.0f ? a : 1.0f) / (base == 0.0f ? 1.0f : base);
    return a > 0.0f && b > 0.0f && base != 0.0f ? l : 0.0f;
}

TALBOT_INLINE Vec3 read3(Registers r, int first, int i) {
    return {r[first][i], r[first + 1][i], r[first + 2][i]};
}

/// Result in r[0..2], N vectors and then single numbers after it.
template <class F>
TALBOT_INLINE void map_v1(Registers r, int n, F f) {
    Column x = r[0], y = r[1], z = r[2];
    ConstColumn ax = r[3], ay = r[4], az = r[5];
    TALBOT_VECTOR_LOOP
    for (int i = 0; i < n; ++i) {
        const Vec3 v = f(Vec3{ax[i], ay[i], az[i]});
        x[i] = v.x;
        y[i] = v.y;
        z[i] = v.z;
    }
}
template <class F>
TALBOT_INLINE void map_v2(Registers r, int n, F f) {
    Column x = r[0], y = r[1], z = r[2];
    ConstColumn ax = r[3], ay = r[4], az = r[5], bx = r[6], by = r[7], bz = r[8];
    TALBOT_VECTOR_LOOP
    for (int i = 0; i < n; ++i) {
        const Vec3 v = f(Vec3{ax[i], ay[i], az[i]}, Vec3{bx[i], by[i], bz[i]});
        x[i] = v.x;
        y[i] = v.y;
        z[i] = v.z;
    }
}

TALBOT_INLINE Vec3 project(Vec3 a, Vec3 b) {
    const float l2 = dot(b, b);
    return b * (l2 > 0.0f ? dot(a, b) / l2 : 0.0f);
}

TALBOT_INLINE Vec3 refract(Vec3 a, Vec3 n, float eta) {
    const float d = dot(n, a);
    const float k = 1.0f - eta * eta * (1.0f - d * d);
    const Vec3 v = a * eta - n * (eta * d + std::sqrt(maxf(k, 0.0f)));
    return k < 0.0f ? Vec3{} : v;
}

/// Rodrigues' formula.
TALBOT_INLINE Vec3 rotate(Vec3 v, Vec3 axis, float angle) {
    const Vec3 k = normalize(axis);
    float s, c;
    lane_sincos(angle, s, c);
    const Vec3 turned = v * c + cross(k, v) * s + k * (dot(k, v) * (1.0f - c));
    return dot(k, k) > 0.0f ? turned : v;
}

}  // namespace

void op_unary(const Instruction& i, Registers r, int n) {
    switch (UnaryKind(i.variant)) {
        case UnaryKind::Absolute:
            return map1(r, n, [](float a) { return lane_abs(a); });
        case UnaryKind::Negate:
            return map1(r, n, [](float a) { return -a; });
        case UnaryKind::SquareRoot:
            return map1(r, n, [](float a) { return std::sqrt(maxf(a, 0.0f)); });
        case UnaryKind::InverseSquareRoot:
            return map1(r, n, [](float a) { return a > 0.0f ? 1.0f / std::sqrt(maxf(a, 1e-38f)) : 0.0f; });
        case UnaryKind::Exponent:
            return map1(r, n, [](float a) { return lane_exp(a); });
        case UnaryKind::Sine:
            return map1(r, n, [](float a) { return lane_sin(a); });
        case UnaryKind::Cosine:
            return map1(r, n, [](float a) { return lane_cos(a); });
        case UnaryKind::Tangent:
            return map1(r, n, [](float a) { return lane_tan(a); });
        case UnaryKind::ArcSine:
            return map1(r, n, [](float a) { return lane_asin(a); });
        case UnaryKind::ArcCosine:
            return map1(r, n, [](float a) { return lane_acos(a); });
        case UnaryKind::ArcTangent:
            return map1(r, n, [](float a) { return lane_atan(a); });
        case UnaryKind::HyperbolicSine:
            return map1(r, n, [](float a) { return lane_sinh(a); });
        case UnaryKind::HyperbolicCosine:
            return map1(r, n, [](float a) { return lane_cosh(a); });
        case UnaryKind::HyperbolicTangent:
            return map1(r, n, [](float a) { return lane_tanh(a); });
        case UnaryKind::Floor:
            return map1(r, n, [](float a) { return lane_floor(a); });
        case UnaryKind::Ceil:
            return map1(r, n, [](float a) { return lane_ceil(a); });
        case UnaryKind::Truncate:
            return map1(r, n, [](float a) { return lane_trunc(a); });
        case UnaryKind::Round:
            return map1(r, n, [](float a) { return lane_round(a); });
        case UnaryKind::Fraction:
            return map1(r, n, [](float a) { return lane_fract(a); });
        case UnaryKind::Sign:
            return map1(r, n, [](float a) { return lane_sign(a); });
        case UnaryKind::Saturate:
            return map1(r, n, [](float a) { return saturate(a); });
        case UnaryKind::OneMinus:
            return map1(r, n, [](float a) { return 1.0f - a; });
        case UnaryKind::Reciprocal:
            return map1(r, n, [](float a) { return safe_divide(1.0f, a); });
        case UnaryKind::Sanitize:
            return map1(r, n, [](float a) { return lane_abs(a) <= 3.4e38f ? a : 0.0f; });
    }
}

void op_binary(const Instruction& i, Registers r, int n) {
    switch (BinaryKind(i.variant)) {
        case BinaryKind::Add:
            return map2(r, n, [](float a, float b) { return a + b; });
        case BinaryKind::Subtract:
            return map2(r, n, [](float a, float b) { return a - b; });
        case BinaryKind::Multiply:
            return map2(r, n, [](float a, float b) { return a * b; });
        case BinaryKind::Divide:
            return map2(r, n, [](float a, float b) { return safe_divide(a, b); });
        case BinaryKind::Power:
            return map2(r, n, [](float a, float b) { return lane_safe_pow(a, b); });
        case BinaryKind::Logarithm:
            return map2(r, n, [](float a, float b) { return logarithm(a, b); });
        case BinaryKind::Minimum:
            return map2(r, n, [](float a, float b) { return minf(a, b); });
        case BinaryKind::Maximum:
            return map2(r, n, [](float a, float b) { return maxf(a, b); });
        case BinaryKind::LessThan:
            return map2(r, n, [](float a, float b) { return a < b ? 1.0f : 0.0f; });
        case BinaryKind::GreaterThan:
            return map2(r, n, [](float a, float b) { return a > b ? 1.0f : 0.0f; });
        case BinaryKind::Modulo:
            return map2(r, n, [](float a, float b) { return truncated_modulo(a, b); });
        case BinaryKind::FlooredModulo:
            return map2(r, n, [](float a, float b) { return floored_modulo(a, b); });
        case BinaryKind::Snap:
            return map2(r, n, [](float a, float b) { return lane_floor(safe_divide(a, b)) * b; });
        case BinaryKind::PingPong:
            return map2(r, n, [](float a, float b) { return ping_pong(a, b); });
        case BinaryKind::ArcTangent2:
            return map2(r, n, [](float a, float b) { return lane_atan2(a, b); });
        case BinaryKind::GammaPower:
            return map2(r, n, [](float a, float b) {
                const float power = a > 0.0f ? lane_pow(a, b) : a;
                return b == 0.0f ? 1.0f : power;
            });
    }
}

void op_ternary(const Instruction& i, Registers r, int n) {
    switch (TernaryKind(i.variant)) {
        case TernaryKind::MultiplyAdd:
            return map3(r, n, [](float a, float b, float c) { return a * b + c; });
        case TernaryKind::Lerp:
            return map3(r, n, [](float a, float b, float c) { return a + (b - a) * c; });
        case TernaryKind::Clamp:
            return map3(r, n, [](float a, float b, float c) { return minf(maxf(a, b), c); });
        case TernaryKind::ClampRange:
            return map3(r, n, [](float a, float b, float c) { return minf(maxf(a, minf(b, c)), maxf(b, c)); });
        case TernaryKind::Select:
            return map3(r, n, [](float a, float b, float c) { return a != 0.0f ? b : c; });
        case TernaryKind::Compare:
            return map3(r, n, [](float a, float b, float c) { return lane_abs(a - b) <= maxf(c, 1.1920929e-07f) ? 1.0f : 0.0f; });
        case TernaryKind::SmoothMinimum:
            return map3(r, n, [](float a, float b, float c) { return smooth_minimum(a, b, c); });
        case TernaryKind::SmoothMaximum:
            return map3(r, n, [](float a, float b, float c) { return -smooth_minimum(-a, -b, c); });
        case TernaryKind::Wrap:
            return map3(r, n, [](float a, float b, float c) { return wrap(a, b, c); });
    }
}

void op_vector(const Instruction& i, Registers r, int n) {
    switch (VectorKind(i.variant)) {
        case VectorKind::Dot: {
            Column o = r[0];
            ConstColumn ax = r[1], ay = r[2], az = r[3], bx = r[4], by = r[5], bz = r[6];
            TALBOT_VECTOR_LOOP
            for (int k = 0; k < n; ++k) o[k] = ax[k] * bx[k] + ay[k] * by[k] + az[k] * bz[k];
            return;
        }
        case VectorKind::Length:
            return map3(r, n, [](float a, float b, float c) { return std::sqrt(a * a + b * b + c * c); });
        case VectorKind::Normalize:
            return map_v1(r, n, [](Vec3 a) { return normalize(a); });
        case VectorKind::Cross:
            return map_v2(r, n, [](Vec3 a, Vec3 b) { return cross(a, b); });
        case VectorKind::Project:
            return map_v2(r, n, [](Vec3 a, Vec3 b) { return project(a, b); });
        case VectorKind::Reflect:
            return map_v2(r, n, [](Vec3 a, Vec3 b) {
                const Vec3 m = normalize(b);
                return a - m * (2.0f * dot(m, a));
            });
        case VectorKind::Refract: {
            ConstColumn eta = r[9];
            Column x = r[0], y = r[1], z = r[2];
            TALBOT_VECTOR_LOOP
            for (int k = 0; k < n; ++k) {
                const Vec3 v = refract(read3(r, 3, k), normalize(read3(r, 6, k)), eta[k]);
                x[k] = v.x;
                y[k] = v.y;
                z[k] = v.z;
            }
            return;
        }
        case VectorKind::FaceForward: {
            Column x = r[0], y = r[1], z = r[2];
            TALBOT_VECTOR_LOOP
            for (int k = 0; k < n; ++k) {
                const float s = dot(read3(r, 9, k), read3(r, 6, k)) < 0.0f ? 1.0f : -1.0f;
                x[k] = r[3][k] * s;
                y[k] = r[4][k] * s;
                z[k] = r[5][k] * s;
            }
            return;
        }
        case VectorKind::RotateAxis: {
            ConstColumn angle = r[9];
            Column x = r[0], y = r[1], z = r[2];
            TALBOT_VECTOR_LOOP
            for (int k = 0; k < n; ++k) {
                const Vec3 v = rotate(read3(r, 3, k), read3(r, 6, k), angle[k]);
                x[k] = v.x;
                y[k] = v.y;
                z[k] = v.z;
            }
            return;
        }
        case VectorKind::EulerMatrix: {
            // R = Rz Ry Rx.
            TALBOT_VECTOR_LOOP
            for (int k = 0; k < n; ++k) {
                float sx, cx, sy, cy, sz, cz;
                lane_sincos(r[9][k], sx, cx);
                lane_sincos(r[10][k], sy, cy);
                lane_sincos(r[11][k], sz, cz);
                r[0][k] = cy * cz;
                r[1][k] = sx * sy * cz - cx * sz;
                r[2][k] = cx * sy * cz + sx * sz;
                r[3][k] = cy * sz;
                r[4][k] = sx * sy * sz + cx * cz;
                r[5][k] = cx * sy * sz - sx * cz;
                r[6][k] = -sy;
                r[7][k] = sx * cy;
                r[8][k] = cx * cy;
            }
            return;
        }
        case VectorKind::Basis: {
            TALBOT_VECTOR_LOOP
            for (int k = 0; k < n; ++k) {
                const Vec3 n = read3(r, 6, k);
                Vec3 t{n.z - n.y, n.x - n.z, n.y - n.x};
                const bool diagonal = dot(t, t) < 1e-12f;
                t = normalize(Vec3{t.x, diagonal ? n.x + n.z : t.y, diagonal ? -n.y - n.x : t.z});
                const Vec3 b = cross(n, t);
                r[0][k] = t.x;
                r[1][k] = t.y;
                r[2][k] = t.z;
                r[3][k] = b.x;
                r[4][k] = b.y;
                r[5][k] = b.z;
            }
            return;
        }
        case VectorKind::SafeNormal:
            return map_v2(r, n, [](Vec3 a, Vec3 b) {
                const float l2 = dot(a, a);
                const bool good = l2 > 1e-30f && l2 < 1e30f;
                const float s = 1.0f / std::sqrt(good ? l2 : 1.0f);
                return Vec3{good ? a.x * s : b.x, good ? a.y * s : b.y, good ? a.z * s : b.z};
            });
    }
}

void op_affine(const Instruction& i, Registers r, int n) {
    // Results r[0..2], matrix rows r[3..14], vector r[15..17].
    Column x = r[0], y = r[1], z = r[2];
    ConstColumn vx = r[15], vy = r[16], vz = r[17];
    ConstColumn a = r[3], b = r[4], c = r[5], d = r[6], e = r[7], f = r[8], g = r[9], h = r[10], p = r[11], q = r[12], s = r[13], t = r[14];
    switch (i.variant) {
        case 0:
            TALBOT_VECTOR_LOOP
            for (int k = 0; k < n; ++k) {
                x[k] = a[k] * vx[k] + b[k] * vy[k] + c[k] * vz[k] + d[k];
                y[k] = e[k] * vx[k] + f[k] * vy[k] + g[k] * vz[k] + h[k];
                z[k] = p[k] * vx[k] + q[k] * vy[k] + s[k] * vz[k] + t[k];
            }
            return;
        case 1:
            TALBOT_VECTOR_LOOP
            for (int k = 0; k < n; ++k) {
                x[k] = a[k] * vx[k] + b[k] * vy[k] + c[k] * vz[k];
                y[k] = e[k] * vx[k] + f[k] * vy[k] + g[k] * vz[k];
                z[k] = p[k] * vx[k] + q[k] * vy[k] + s[k] * vz[k];
            }
            return;
        default:
            TALBOT_VECTOR_LOOP
            for (int k = 0; k < n; ++k) {
                x[k] = a[k] * vx[k] + e[k] * vy[k] + p[k] * vz[k];
                y[k] = b[k] * vx[k] + f[k] * vy[k] + q[k] * vz[k];
                z[k] = c[k] * vx[k] + g[k] * vy[k] + s[k] * vz[k];
            }
            return;
    }
}

}  // namespace TALBOT_ISA
}  // namespace talbot::shader
