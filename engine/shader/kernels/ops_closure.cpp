#include "shader/ops_closure.h"

#include "closure/albedo.h"
#include "closure/kernels/fresnel.h"
#include "closure/kernels/thin_film.h"
#include "closure/sheen.h"
#include "shader/kernels/ops.h"

namespace talbot::shader {
inline namespace TALBOT_ISA {
namespace {

/// f(in, out) lane by lane.
template <int outs, int ins, class F>
TALBOT_INLINE void lanes(Registers r, int n, F f) {
    float* o[outs];
    const float* a[ins];
    for (int k = 0; k < outs; ++k) o[k] = r[k];
    for (int k = 0; k < ins; ++k) a[k] = r[outs + k];
    TALBOT_VECTOR_LOOP
    for (int i = 0; i < n; ++i) {
        float in[ins], out[outs];
        for (int k = 0; k < ins; ++k) in[k] = a[k][i];
        f(in, out);
        for (int k = 0; k < outs; ++k) o[k][i] = out[k];
    }
}
TALBOT_INLINE Vec3 at(const float* in, int k) {
    return {in[k], in[k + 1], in[k + 2]};
}
TALBOT_INLINE void put(float* out, int k, Vec3 v) {
    out[k] = v.x;
    out[k + 1] = v.y;
    out[k + 2] = v.z;
}

/// Cosine between n and wo, the first six operands.
TALBOT_INLINE float view_cosine(const float* in) {
    return saturate(dot(at(in, 0), at(in, 3)));
}
TALBOT_INLINE float rough_of(float ax, float ay) {
    return std::sqrt(std::sqrt(maxf(ax * ay, 0.0f)));
}
/// Before 4.0 light is followed from facet to facet at random; there a bounce after the first escapes more often than an average
/// one. The square root fits Blender 3.4's albedos of coloured metal within 1 %.
TALBOT_INLINE float escape_chance(float average, float old) {
    return old != 0.0f ? std::sqrt(average) : average;
}

/// Mean of the dielectric curve over all angles, a rational fit over indices above 1.
TALBOT_INLINE float mean_dielectric(float eta) {
    const float e = maxf(eta, 1.0f);
    return (e - 1.0f) / (4.08567f + 1.00071f * e);
}
/// Mean of lerp(F0, 1, position on the curve of eta) over all angles.
TALBOT_INLINE Rgb mean_schlick(Rgb f0, float eta) {
    const float base = f0_from_eta(eta);
    return lerp(f0, vec3(1.0f), saturate((mean_dielectric(eta) - base) / maxf(1.0f - base, 1e-4f)));
}
/// Mean of F82: the integral of 2 c (F0 + (1 - F0) s^5 - B c s^6), exactly.
TALBOT_INLINE float mean_f82(float f0, float b) {
    return saturate(lerp(f0, 1.0f, 1.0f / 21.0f) - b * (1.0f / 126.0f));
}
TALBOT_INLINE float mean_conductor(float n, float k, float approximate) {
    const float f0 = fresnel_conductor(1.0f, n, k, approximate), f82 = fresnel_conductor(1.0f / 7.0f, n, k, approximate);
    const float schlick = f0 + (1.0f - f0) * pow5(6.0f / 7.0f);
    return mean_f82(f0, fresnel_f82_b(f0, f82 / maxf(schlick, 1e-6f)));
}

TALBOT_INLINE Vec3 rotate_tangent(Vec3 n, Vec3 t, float turns) {
    float s, c;
    lane_sincos(kTwoPi * turns, s, c);
    return t * c + cross(n, t) * s + n * (dot(n, t) * (1.0f - c));
}

/// In the plane of ng (z) and n: the mirror direction's height is Ix sin 2p + Iz cos 2p where p is n's angle from ng; it equals
/// the least height h at 2p = atan2(Ix, Iz) + acos(h / L), beyond which n is turned back to there.
TALBOT_INLINE Vec3 valid_reflection(Vec3 n, Vec3 ng, Vec3 wo) {
    const float iz = dot(ng, wo);
    const float least = minf(0.9f * iz, 0.01f);
    const float height = 2.0f * dot(n, wo) * dot(ng, n) - iz;
    const Vec3 side = n - ng * dot(n, ng);
    const float l2 = dot(side, side);
    const Vec3 x = side * (1.0f / std::sqrt(maxf(l2, 1e-20f)));
    const float ix = dot(x, wo);
    const float length2 = maxf(ix * ix + iz * iz, 1e-12f);
    const float root = safe_sqrt(length2 - least * least);
    const float cos2 = clampf((iz * least - ix * root) / length2, -1.0f, 1.0f);
    const float z = safe_sqrt(0.5f * (1.0f + cos2)), s = safe_sqrt(0.5f * (1.0f - cos2));
    const Vec3 bent = ng * z + x * s;
    const bool keep = (height >= least) | (l2 < 1e-12f) | (iz <= 0.0f);
    return {keep ? n.x : bent.x, keep ? n.y : bent.y, keep ? n.z : bent.z};
}

/// [Chiang et al. 2016], from perceptual roughness to variance and logistic scale, and from colour to absorption.
TALBOT_INLINE float hair_variance(float b) {
    const float b2 = b * b, b4 = b2 * b2, b16 = square(b4) * square(b4);
    return square(0.726f * b + 0.812f * b2 + 3.7f * b16 * b4);
}
TALBOT_INLINE float hair_scale(float b) {
    const float b2 = b * b, b4 = b2 * b2, b16 = square(b4) * square(b4);
    return (0.265f * b + 1.194f * b2 + 5.372f * b16 * b4 * b2) * 0.62665706865775f;  // sqrt(pi / 8)
}
TALBOT_INLINE float hair_absorption(float color, float b) {
    const float scale = ((((0.245f * b + 5.574f) * b - 10.73f) * b + 2.532f) * b - 0.215f) * b + 5.969f;
    return square(lane_log(maxf(color, 0.0f)) / scale);
}

/// Any axis across the fibre, but the same all along it; where it has no normal of its own.
TALBOT_INLINE Vec3 any_axis(Vec3 t) {
    const bool diagonal = (t.x == t.y) & (t.x == t.z);
    const float sign = diagonal ? -1.0f : 1.0f;
    const Vec3 z{t.z - t.y, t.x - sign * t.z, sign * t.y - t.x};
    return cross(t, z);
}

}  // namespace

void op_closure(const Instruction& instruction, Registers r, int n, const OpScope&) {
    switch (ClosureOp(instruction.variant)) {
        case ClosureOp::AlphaFromRoughness:
            return map1(r, n, [](float a) { return square(saturate(a)); });
        case ClosureOp::GlossyAlpha:
            return lanes<2, 2>(r, n, [](const float* in, float* out) {
                const float alpha = square(saturate(in[0])), a = clampf(in[1], -0.99f, 0.99f);
                const float narrow = 1.0f - std::fabs(a);
                const float small = alpha * narrow, large = minf(alpha / narrow, 1.0f);
                out[0] = a < 0.0f ? large : small;
                out[1] = a < 0.0f ? small : large;
            });
        case ClosureOp::PrincipledAlpha:
            return lanes<2, 2>(r, n, [](const float* in, float* out) {
                const float alpha = square(saturate(in[0])), aspect = std::sqrt(1.0f - 0.9f * saturate(in[1]));
                out[0] = minf(alpha / aspect, 1.0f);
                out[1] = alpha * aspect;
            });
        case ClosureOp::RotateTangent:
            return lanes<3, 7>(r, n, [](const float* in, float* out) { put(out, 0, rotate_tangent(at(in, 0), at(in, 3), in[6])); });
        case ClosureOp::ValidReflection:
            return lanes<3, 9>(r, n, [](const float* in, float* out) { put(out, 0, valid_reflection(at(in, 0), at(in, 3), at(in, 6))); });
        case ClosureOp::EnergyReflect:
            return lanes<3, 12>(r, n, [](const float* in, float* out) {
                const float rough = rough_of(in[6], in[7]);
                const float albedo = ggx_albedo(rough, view_cosine(in)), escape = escape_chance(ggx_average(rough), in[11]);
                for (int k = 0; k < 3; ++k) out[k] = multiple_scattering(saturate(in[8 + k]), albedo, escape);
            });
        case ClosureOp::EnergyShare:
            return lanes<3, 12>(r, n, [](const float* in, float* out) {
                const float rough = rough_of(in[6], in[7]);
                const float albedo = ggx_albedo(rough, view_cosine(in)), escape = escape_chance(ggx_average(rough), in[11]);
                for (int k = 0; k < 3; ++k) out[k] = albedo * multiple_scattering(saturate(in[8 + k]), albedo, escape);
            });
        case ClosureOp::EnergyGlass:
            return lanes<3, 12>(r, n, [](const float* in, float* out) {
                const float rough = rough_of(in[6], in[6]), eta = clampf(in[7], 1e-3f, 1e3f);
                const float albedo = glass_albedo(rough, view_cosine(in), eta), escape = escape_chance(glass_average(rough, eta), in[11]);
                for (int k = 0; k < 3; ++k) out[k] = multiple_scattering(saturate(in[8 + k]), albedo, escape);
            });
        case ClosureOp::F82:
            return lanes<6, 6>(r, n, [](const float* in, float* out) {
                for (int k = 0; k < 3; ++k) {
                    out[k] = fresnel_f82_b(in[k], in[3 + k]);
                    out[3 + k] = mean_f82(in[k], out[k]);
                }
            });
        case ClosureOp::ConductorMean:
            return lanes<3, 7>(r, n, [](const float* in, float* out) {
                for (int k = 0; k < 3; ++k) out[k] = mean_conductor(in[k], in[3 + k], in[6]);
            });
        case ClosureOp::Specular:
            return lanes<10, 13>(r, n, [](const float* in, float* out) {
                const float ior = clampf(in[8], 1e-3f, 1e3f), level = maxf(in[9], 0.0f);
                const float f0 = f0_from_eta(ior) * 2.0f * level;
                const float adjusted = eta_from_f0(f0);
                const float scaled = ior < 1.0f ? 1.0f / adjusted : adjusted;
                const float eta = level == 0.5f ? ior : scaled;
                const Rgb tinted{saturate(f0 * in[10]), saturate(f0 * in[11]), saturate(f0 * in[12])};
                const float position = mean_fresnel_position(rough_of(in[6], in[7]), view_cosine(in), eta);
                out[0] = eta;
                put(out, 1, tinted);
                put(out, 4, lerp(tinted, vec3(1.0f), position));
                put(out, 7, mean_schlick(tinted, eta));
            });
        case ClosureOp::Coat:
            return lanes<3, 9>(r, n, [](const float* in, float* out) {
                const float cosine = view_cosine(in), eta = clampf(in[7], 1.0f, 1e3f), rough = rough_of(in[6], in[6]);
                const float kept = ggx_albedo(rough, cosine), gain = multiple_scattering(mean_dielectric(eta), kept, ggx_average(rough));
                const float mean = lerp(f0_from_eta(eta), 1.0f, mean_fresnel_position(rough, cosine, eta)) * kept * gain;
                out[0] = in[8] != 0.0f ? fresnel_dielectric(cosine, eta) : mean;
                out[1] = 1.0f / std::sqrt(maxf(1.0f - (1.0f - cosine * cosine) / (eta * eta), 1e-4f));
                out[2] = in[8] != 0.0f ? 1.0f : gain;
            });
        case ClosureOp::ThinPane:
            return lanes<7, 14>(r, n, [](const float* in, float* out) {
                const float cosine = view_cosine(in), eta = clampf(in[7], 1e-3f, 1e3f);
                const float plain = fresnel_dielectric(cosine, eta);
                const float path = 1.0f / std::sqrt(maxf(1.0f - (1.0f - cosine * cosine) / (eta * eta), 1e-4f));
                // Two interfaces blur more than one, measured in Cycles 5.2 (1 % of alpha, indices from 1.1 to 2.5).
                const float blur = std::sqrt(3.392f * maxf(eta - 1.0f, 0.0f) * square(eta - 0.5f) / (eta * eta * eta));
                const float alpha = minf(in[6] * blur, 1.0f);
                const float kept = 1.0f / maxf(ggx_albedo(rough_of(in[6], in[6]), cosine), 0.02f);
                const float passed = 1.0f / maxf(ggx_albedo(rough_of(alpha, alpha), cosine), 0.02f);
                for (int k = 0; k < 3; ++k) {
                    const float color = lane_pow(maxf(in[8 + k], 1e-12f), path), tinted = saturate(plain * in[11 + k]);
                    // The tint is on the sum of the reflections: on each, it would be 1 to 3 % too bright beside Cycles.
                    const float back = square((1.0f - plain) * color) / maxf(1.0f - square(plain * color), 1e-6f);
                    out[k] = saturate(plain * (1.0f + back)) * in[11 + k] * kept;
                    out[3 + k] = square(1.0f - tinted) * color / maxf(1.0f - square(tinted * color), 1e-6f) * passed;
                }
                out[6] = alpha;
            });
        case ClosureOp::SheenAlbedo:
            return lanes<1, 7>(r, n, [](const float* in, float* out) { out[0] = sheen_terms(view_cosine(in), clampf(in[6], 1e-3f, 1.0f)).albedo; });
        case ClosureOp::FresnelAt:
            return lanes<1, 7>(r, n, [](const float* in, float* out) { out[0] = fresnel_dielectric(view_cosine(in), clampf(in[6], 1e-3f, 1e3f)); });
        case ClosureOp::SpecularV1:
            return lanes<7, 6>(r, n, [](const float* in, float* out) {
                const Rgb base = at(in, 0);
                const float lightness = 0.3f * base.x + 0.6f * base.y + 0.1f * base.z;
                const Rgb hue = base * (lightness > 0.0f ? 1.0f / lightness : 0.0f);
                const float specular = maxf(in[3], 0.0f), metallic = saturate(in[5]);
                const Rgb plastic = lerp(vec3(1.0f), hue, in[4]) * (0.08f * specular);
                const Rgb f0 = lerp(plastic, base, metallic);
                const float eta = 2.0f / (1.0f - std::sqrt(minf(0.08f * specular, 0.98f))) - 1.0f;
                out[0] = eta;
                put(out, 1, f0);
                put(out, 4, mean_schlick(f0, eta));
            });
        case ClosureOp::SheenTintV1:
            return lanes<3, 4>(r, n, [](const float* in, float* out) {
                const Rgb base = at(in, 0);
                const float light = luminance(base);
                put(out, 0, lerp(vec3(1.0f), base * (light > 0.0f ? 1.0f / light : 0.0f), in[3]));
            });
        case ClosureOp::GlassIndex:
            return map2(r, n, [](float ior, float back) {
                const float eta = clampf(ior, 1e-3f, 1e3f);
                return back != 0.0f ? 1.0f / eta : eta;
            });
        case ClosureOp::FilmAlbedo:
            return lanes<3, 13>(r, n, [](const float* in, float* out) {
                const float eta = clampf(in[6], 1e-3f, 1e3f);
                const ThinFilm film{clampf(in[10], 0.0f, 1e6f), clampf(in[11], 1e-3f, 1e3f), in[12]};
                put(out, 0, film_scaled(film_dielectric(view_cosine(in), film, eta), at(in, 7), eta));
            });
        case ClosureOp::HairWidths:
            return lanes<3, 3>(r, n, [](const float* in, float* out) {
                const float along = clampf(in[0], 1e-3f, 1.0f), around = clampf(in[1], 1e-3f, 1.0f);
                out[0] = hair_variance(along);
                out[1] = hair_scale(around);
                out[2] = hair_variance(clampf((1.0f - saturate(in[2])) * along, 1e-3f, 1.0f));
            });
        case ClosureOp::HairPigment:
            return lanes<3, 2>(r, n, [](const float* in, float* out) {
                const float amount = -lane_log(maxf(1.0f - in[0], 1e-4f));
                const float eumelanin = amount * (1.0f - in[1]), pheomelanin = amount * in[1];
                put(out, 0, Rgb{0.506f, 0.841f, 1.653f} * eumelanin + Rgb{0.343f, 0.733f, 1.924f} * pheomelanin);
            });
        case ClosureOp::HairColor:
            return lanes<3, 4>(r, n, [](const float* in, float* out) {
                for (int k = 0; k < 3; ++k) out[k] = hair_absorption(in[k], in[3]);
            });
        case ClosureOp::HairSection:
            return lanes<4, 13>(r, n, [](const float* in, float* out) {
                const Vec3 t = at(in, 0), wo = at(in, 3), own = at(in, 9);
                const Vec3 across = own - t * dot(t, own);
                const bool usable = (dot(across, across) > 1e-12f) & (dot(across, across) < 1e30f);
                const Vec3 any = any_axis(t);
                const Vec3 x = normalize(Vec3{usable ? across.x : any.x, usable ? across.y : any.y, usable ? across.z : any.z});
                const Vec3 side = cross(t, wo);
                const float h = dot(side, at(in, 6)), width2 = maxf(dot(side, side), 1e-12f);
                const float ratio = clampf(in[12], 1e-2f, 1e2f), b = ratio > 1.0f ? 1.0f / ratio : ratio;
                const float wx = dot(wo, x);
                const float radius2 = 1.0f - (1.0f - b * b) * wx * wx / width2;
                put(out, 0, x);
                out[3] = h * h >= radius2 * width2 ? 1.0f : 0.0f;
            });
    }
}

}  // namespace TALBOT_ISA
}  // namespace talbot::shader
