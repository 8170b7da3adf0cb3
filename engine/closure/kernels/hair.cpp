/// Hair: the model of Chiang et al., and the older reflection and transmission lobes.
#include "closure/hair.h"

#include "closure/kernels/fibre.h"

namespace talbot {
inline namespace TALBOT_ISA {
namespace {

/// [Chiang et al. 2016]: R, TT and TRT, each a longitudinal times an azimuthal distribution, tilted by the cuticle's scales, and a residual lobe
/// for what bounces more often. The scales tilt the viewer's side, in older versions the light's.
template <bool tilts_viewer>
struct ChiangLobe {
    static constexpr bool kDiffuse = false, kTransmits = true, kFibre = true;
    Vec3 tangent;
    Rgb sigma;
    float variance, scale, primary, eta;
    float sines[3], cosines[3];  ///< of the three lobes' tilts

    TALBOT_MEMBER static ChiangLobe load(const float* const* p, int i, const LobeUniform&) {
        ChiangLobe l;
        l.tangent = {p[0][i], p[1][i], p[2][i]};
        l.sigma = {clampf(p[3][i], 0.0f, 1e6f), clampf(p[4][i], 0.0f, 1e6f), clampf(p[5][i], 0.0f, 1e6f)};
        l.variance = clampf(p[6][i], 1e-6f, 100.0f);
        l.scale = clampf(p[7][i], 1e-4f, 100.0f);
        l.primary = clampf(p[8][i], 1e-6f, 100.0f);
        l.eta = clampf(p[10][i], 1.0001f, 100.0f);
        const float alpha = clampf(p[9][i], -kPi, kPi);
        const float turns[3] = {2.0f, -1.0f, -4.0f};
        for (int k = 0; k < 3; ++k) lane_sincos(turns[k] * alpha, l.sines[k], l.cosines[k]);
        return l;
    }
    TALBOT_MEMBER float width(int p) const {
        const float wide = p == 1 ? 0.25f * variance : 4.0f * variance;
        return p == 0 ? primary : wide;
    }
    TALBOT_MEMBER void shares(const FibrePath& path, float (&share)[4]) const {
        float sum = 0.0f;
        for (int p = 0; p < 4; ++p) {
            share[p] = luminance(path.carried[p]);
            sum += share[p];
        }
        const float inverse = 1.0f / maxf(sum, 1e-12f);
        for (int p = 0; p < 4; ++p) share[p] *= inverse;
    }
    TALBOT_MEMBER LobeEval value(const Fibre& fibre, const FibrePath& path, float sin_i, float phi) const {
        const float cos_i = safe_sqrt(1.0f - sin_i * sin_i);
        float share[4];
        shares(path, share);
        LobeEval e;
        for (int p = 0; p < 3; ++p) {
            float si = sin_i, ci = cos_i, so = fibre.sin_o, co = fibre.cos_o;
            if constexpr (tilts_viewer) {
                tilt(fibre.sin_o, fibre.cos_o, -sines[p], cosines[p], so, co);
            } else {
                tilt(sin_i, cos_i, -sines[p], cosines[p], si, ci);
            }
            const float m = longitudinal(si, ci, so, co, width(p)) * trimmed_logistic(wrap_angle(phi - path.middle(p)), scale);
            e.f = e.f + path.carried[p] * m;
            // The density of a theta that was drawn before it was tilted.
            e.pdf += share[p] * m * (tilts_viewer ? 1.0f : ci / maxf(cos_i, 1e-4f));
        }
        const float rest = longitudinal(sin_i, cos_i, fibre.sin_o, fibre.cos_o, 4.0f * variance) * (0.5f * kInvPi);
        e.f = e.f + path.carried[3] * rest;
        e.pdf += share[3] * rest;
        return e;
    }
    TALBOT_MEMBER static float sin_gamma(const LobeLane& lane, const Fibre& fibre) { return dot(lane.n, fibre.a); }
    TALBOT_MEMBER LobeEval eval(const LobeLane& lane, Vec3 wi) const {
        const Fibre fibre = make_fibre(tangent, lane.wo);
        const FibrePath path = follow_fibre(fibre, sin_gamma(lane, fibre), eta, sigma);
        return value(fibre, path, clampf(dot(fibre.t, wi), -1.0f, 1.0f), azimuth(fibre, wi));
    }
    TALBOT_MEMBER LobeSample sample(const LobeLane& lane, float u, float v, float w) const {
        const Fibre fibre = make_fibre(tangent, lane.wo);
        const FibrePath path = follow_fibre(fibre, sin_gamma(lane, fibre), eta, sigma);
        float share[4];
        shares(path, share);
        // Which lobe; the number that chose it is used again.
        int lobe = 0;
        float left = w, chance = share[0];
        for (int p = 1; p < 4; ++p) {
            const bool next = (left >= chance) & (lobe == p - 1) & (share[p] > 0.0f);
            left = next ? left - chance : left;
            chance = next ? share[p] : chance;
            lobe = next ? p : lobe;
        }
        left = saturate(left / maxf(chance, 1e-12f));
        const float sine = lobe == 0 ? sines[0] : (lobe == 1 ? sines[1] : sines[2]), cosine = lobe == 0 ? cosines[0] : (lobe == 1 ? cosines[1] : cosines[2]);
        const float s = lobe < 3 ? sine : 0.0f, c = lobe < 3 ? cosine : 1.0f;
        float so = fibre.sin_o, co = fibre.cos_o;
        if constexpr (tilts_viewer) tilt(fibre.sin_o, fibre.cos_o, -s, c, so, co);
        float sin_i = sample_longitudinal(so, co, width(lobe), left, v);
        if constexpr (!tilts_viewer) {
            float unused;
            tilt(sin_i, safe_sqrt(1.0f - sin_i * sin_i), s, c, sin_i, unused);
        }
        sin_i = clampf(sin_i, -1.0f, 1.0f);
        const float phi = lobe < 3 ? path.middle(lobe) + sample_logistic(scale, u) : kTwoPi * u;
        const LobeEval e = value(fibre, path, sin_i, phi);
        return {fibre_direction(fibre, sin_i, phi), e.f / maxf(e.pdf, 1e-20f), e.pdf, 1.0f, lobe == 0 ? 0 : int32_t(kSampledTransmit)};
    }
    TALBOT_MEMBER Rgb albedo(const LobeLane& lane) const {
        const Fibre fibre = make_fibre(tangent, lane.wo);
        const FibrePath path = follow_fibre(fibre, sin_gamma(lane, fibre), eta, sigma);
        return path.carried[0] + path.carried[1] + path.carried[2] + path.carried[3];
    }
    TALBOT_MEMBER float roughness() const { return primary; }
};

/// The lobes of Hair BSDF: reflection or transmission; a Cauchy distribution in the half angle theta_h = (theta_i + theta_o) / 2, shifted and limited
/// to where theta_i exists; in azimuth cos(phi / 2 s) / 4 s around the viewer (reflection), or Cauchy around the far side, on [-pi/2, pi/2]. As in
/// Cycles values and samples differ: lamps are seen on the lobe's side of the normal only, and by reflections within a quarter turn of the viewer.
/// After the lobes of [Marschner et al. 2003, "Light Scattering from Human Hair Fibers"].
template <bool transmits>
struct StrandLobe {
    static constexpr bool kDiffuse = false, kTransmits = transmits, kFibre = true;
    static constexpr float kPole = 1e-3f;  ///< around the fibre's own direction the density has no bound: nothing is scattered there
    Vec3 tangent;
    float along, around, offset;

    TALBOT_MEMBER static StrandLobe load(const float* const* p, int i, const LobeUniform&) {
        return {{p[0][i], p[1][i], p[2][i]}, clampf(p[3][i], 1e-3f, 1.0f), clampf(p[4][i], 1e-3f, 1.0f), clampf(p[5][i], -kPi, kPi)};
    }
    /// Ends of the Cauchy distribution, as angles.
    TALBOT_MEMBER void limits(float theta_o, float& low, float& high) const {
        low = lane_atan((0.5f * (theta_o - kHalfPi) - offset) / along);
        high = lane_atan((0.5f * (theta_o + kHalfPi) - offset) / along);
    }
    /// Per solid angle, in both angles.
    TALBOT_MEMBER float density(float theta_i, float theta_o, float phi) const {
        float low, high;
        limits(theta_o, low, high);
        const float t = 0.5f * (theta_i + theta_o) - offset;
        const float theta = along / (2.0f * (t * t + along * along) * maxf(high - low, 1e-6f) * maxf(lane_cos(theta_i), 1e-4f));
        const float p = kPi - lane_abs(phi);
        const float far = around / (2.0f * lane_atan(kHalfPi / around) * (p * p + around * around));
        const float near = lane_cos(minf(0.5f * lane_abs(phi) / around, kHalfPi)) * 0.25f / around;
        return lane_abs(theta_i) < kHalfPi - kPole ? theta * (transmits ? far : near) : 0.0f;
    }
    TALBOT_MEMBER LobeEval eval(const LobeLane& lane, Vec3 wi) const {
        const Fibre fibre = make_fibre(tangent, lane.wo);
        const float sin_i = dot(fibre.t, wi);
        const float phi = azimuth(fibre, wi), side = dot(lane.n, wi);
        const bool seen = transmits ? side < 0.0f : (side >= 0.0f) & (lane_abs(phi) <= kHalfPi);
        const float d = seen ? density(lane_asin(sin_i), lane_asin(fibre.sin_o), phi) : 0.0f;
        return {vec3(d), d};
    }
    TALBOT_MEMBER LobeSample sample(const LobeLane& lane, float u, float v, float) const {
        const Fibre fibre = make_fibre(tangent, lane.wo);
        const float theta_o = lane_asin(fibre.sin_o);
        float low, high;
        limits(theta_o, low, high);
        const float theta_i = 2.0f * (along * lane_tan(lerp(low, high, u)) + offset) - theta_o;
        const float far = kPi + around * lane_tan(2.0f * lane_atan(kHalfPi / around) * (v - 0.5f));
        const float near = 2.0f * around * lane_asin(1.0f - 2.0f * v);
        const float phi = wrap_angle(transmits ? far : near);
        const float d = density(theta_i, theta_o, phi);
        return {fibre_direction(fibre, lane_sin(clampf(theta_i, -kHalfPi, kHalfPi)), phi), vec3(1.0f), d, 1.0f,
                d > 0.0f ? (transmits ? int32_t(kSampledTransmit) : 0) : int32_t(kSampledFailed)};
    }
    TALBOT_MEMBER Rgb albedo(const LobeLane&) const { return vec3(1.0f); }
    TALBOT_MEMBER float roughness() const { return std::sqrt(along * around); }
};

}  // namespace

void run_hair(ClosureType type, uint8_t variant, const LobeCall& call) {
    switch (type) {
        case ClosureType::HairReflection:
            return run_lobe<StrandLobe<false>>(call);
        case ClosureType::HairTransmission:
            return run_lobe<StrandLobe<true>>(call);
        default:
            return (variant & kVariantTiltsLight) != 0 ? run_lobe<ChiangLobe<false>>(call) : run_lobe<ChiangLobe<true>>(call);
    }
}

}  // namespace TALBOT_ISA
}  // namespace talbot
