/// Lambert, rough diffuse (Fujii's qualitative Oren-Nayar, without and with the multiple-scattering term), translucent, transparent.
#include "base/math.h"
#include "closure/kernels/lobe.h"
#include "closure/kernels/warp.h"

namespace talbot {
inline namespace TALBOT_ISA {
namespace {

struct DiffuseLobe {
    static constexpr bool kDiffuse = true, kTransmits = false;
    TALBOT_MEMBER static DiffuseLobe load(const float* const*, int, const LobeUniform&) { return {}; }
    TALBOT_MEMBER LobeEval eval(const LobeLane& lane, Vec3 wi) const {
        const float c = maxf(dot(lane.n, wi), 0.0f) * kInvPi;
        return {vec3(c), c};
    }
    TALBOT_MEMBER LobeSample sample(const LobeLane& lane, float u, float v, float) const {
        const Vec3 wi = cosine_direction(lane.n, u, v);
        return {wi, vec3(1.0f), maxf(dot(lane.n, wi), 0.0f) * kInvPi, 1.0f, 0};
    }
    TALBOT_MEMBER Rgb albedo(const LobeLane&) const { return vec3(1.0f); }
    TALBOT_MEMBER float roughness() const { return 1.0f; }
};

struct TranslucentLobe {
    static constexpr bool kDiffuse = true, kTransmits = true;
    TALBOT_MEMBER static TranslucentLobe load(const float* const*, int, const LobeUniform&) { return {}; }
    TALBOT_MEMBER LobeEval eval(const LobeLane& lane, Vec3 wi) const {
        const float c = maxf(-dot(lane.n, wi), 0.0f) * kInvPi;
        return {vec3(c), c};
    }
    TALBOT_MEMBER LobeSample sample(const LobeLane& lane, float u, float v, float) const {
        const Vec3 wi = cosine_direction(-lane.n, u, v);
        return {wi, vec3(1.0f), maxf(-dot(lane.n, wi), 0.0f) * kInvPi, 1.0f, kSampledTransmit};
    }
    TALBOT_MEMBER Rgb albedo(const LobeLane&) const { return vec3(1.0f); }
    TALBOT_MEMBER float roughness() const { return 1.0f; }
};

struct TransparentLobe {
    static constexpr bool kDiffuse = false, kTransmits = true;
    TALBOT_MEMBER static TransparentLobe load(const float* const*, int, const LobeUniform&) { return {}; }
    TALBOT_MEMBER LobeEval eval(const LobeLane&, Vec3) const { return {}; }
    TALBOT_MEMBER LobeSample sample(const LobeLane& lane, float, float, float) const {
        return {-lane.wo, vec3(1.0f), kDeltaPdf, 1.0f, kSampledDelta | kSampledTransmit | kSampledTransparent};
    }
    TALBOT_MEMBER Rgb albedo(const LobeLane&) const { return vec3(1.0f); }
    TALBOT_MEMBER float roughness() const { return 0.0f; }
};

/// [Fujii 2012, "A tiny improvement of Oren-Nayar reflectance model"]: f = A + B t with A = 1 / (pi + (pi/2 - 2/3) s), B = s A,
/// t = (cos phi sin sin) / max(cos, cos) where positive.
struct FujiiLobe {
    static constexpr bool kDiffuse = true, kTransmits = false;
    float a, b;
    TALBOT_MEMBER static FujiiLobe load(const float* const* params, int i, const LobeUniform&) {
        const float s = saturate(params[0][i]);
        const float a = 1.0f / (kPi + (0.5f * kPi - 2.0f / 3.0f) * s);
        return {a, a * s};
    }
    TALBOT_MEMBER float single(const LobeLane& lane, Vec3 wi, float nl, float nv) const {
        const float t = dot(wi, lane.wo) - nl * nv;
        const float scaled = t / maxf(maxf(nl, nv), 1e-6f);
        return a + b * (t > 0.0f ? scaled : t);
    }
    TALBOT_MEMBER LobeEval eval(const LobeLane& lane, Vec3 wi) const {
        const float nl = maxf(dot(lane.n, wi), 0.0f), nv = maxf(dot(lane.n, lane.wo), 0.0f);
        return {vec3(nl * single(lane, wi, nl, nv)), nl * kInvPi};
    }
    TALBOT_MEMBER LobeSample sample(const LobeLane& lane, float u, float v, float) const {
        const Vec3 wi = cosine_direction(lane.n, u, v);
        const float nl = maxf(dot(lane.n, wi), 0.0f), nv = maxf(dot(lane.n, lane.wo), 0.0f);
        return {wi, vec3(kPi * single(lane, wi, nl, nv)), nl * kInvPi, 1.0f, 0};
    }
    TALBOT_MEMBER Rgb albedo(const LobeLane&) const { return vec3(1.0f); }
    TALBOT_MEMBER float roughness() const { return 1.0f; }
};

/// Adds light that leaves after several bounces between the facets; its colour is a power series of the albedo.
struct OrenNayarLobe {
    static constexpr bool kDiffuse = true, kTransmits = false;
    FujiiLobe base;
    Rgb multiple;  ///< factor of (1 - E(nl)) (1 - E(nv)); the closure's weight brings the albedo once more, as Cycles has it
    TALBOT_MEMBER static OrenNayarLobe load(const float* const* params, int i, const LobeUniform& u) {
        const float s = saturate(params[0][i]);
        const float average = minf((kPi + (2.0f * kPi - 5.6f) * (1.0f / 3.0f) * s) / (kPi + (0.5f * kPi - 2.0f / 3.0f) * s), 0.999f);
        const float k = kInvPi * average / (1.0f - average);
        const auto series = [&](float rho) { return k * rho * rho / (1.0f - rho * (1.0f - average)); };
        return {FujiiLobe::load(params, i, u), {series(saturate(params[1][i])), series(saturate(params[2][i])), series(saturate(params[3][i]))}};
    }
    /// 1 - E(c): what single scattering loses. E = pi A + B G(c).
    TALBOT_MEMBER float lost(float cosine) const {
        const float c = clampf(cosine, 1e-6f, 1.0f);
        const float s = safe_sqrt(1.0f - c * c);
        const float g = s * (lane_acos(c) - 2.0f / 3.0f - s * c) + (2.0f / 3.0f) * (s / c) * (1.0f - s * s * s);
        return maxf(1.0f - (kPi * base.a + base.b * g), 0.0f);
    }
    TALBOT_MEMBER Rgb value(const LobeLane& lane, Vec3 wi, float nl, float nv) const {
        const float single = base.single(lane, wi, nl, nv);
        const float both = base.b > 0.0f ? lost(nl) * lost(nv) : 0.0f;
        return vec3(single) + multiple * both;
    }
    TALBOT_MEMBER LobeEval eval(const LobeLane& lane, Vec3 wi) const {
        const float nl = maxf(dot(lane.n, wi), 0.0f), nv = maxf(dot(lane.n, lane.wo), 0.0f);
        return {value(lane, wi, nl, nv) * nl, nl * kInvPi};
    }
    TALBOT_MEMBER LobeSample sample(const LobeLane& lane, float u, float v, float) const {
        const Vec3 wi = cosine_direction(lane.n, u, v);
        const float nl = maxf(dot(lane.n, wi), 0.0f), nv = maxf(dot(lane.n, lane.wo), 0.0f);
        return {wi, value(lane, wi, nl, nv) * kPi, nl * kInvPi, 1.0f, 0};
    }
    TALBOT_MEMBER Rgb albedo(const LobeLane&) const { return vec3(1.0f); }
    TALBOT_MEMBER float roughness() const { return 1.0f; }
};

}  // namespace

void run_diffuse(ClosureType type, const LobeCall& call) {
    switch (type) {
        case ClosureType::OrenNayar:
            return run_lobe<OrenNayarLobe>(call);
        case ClosureType::OrenNayarFujii:
            return run_lobe<FujiiLobe>(call);
        case ClosureType::Translucent:
            return run_lobe<TranslucentLobe>(call);
        case ClosureType::Transparent:
            return run_lobe<TransparentLobe>(call);
        default:
            return run_lobe<DiffuseLobe>(call);
    }
}

}  // namespace TALBOT_ISA
}  // namespace talbot
