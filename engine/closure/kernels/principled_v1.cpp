/// The lobes that only the first Principled BSDF has (Blender before 4.0) [Burley 2012, "Physically Based Shading at Disney"; 2015,
/// "Extending the Disney BRDF to a BSDF with Integrated Subsurface Scattering"]. They may reflect more than they receive at grazing angles: known, and kept.
#include "base/math.h"
#include "closure/kernels/fresnel.h"
#include "closure/kernels/lobe.h"
#include "closure/kernels/microfacet.h"
#include "closure/kernels/warp.h"

namespace talbot {
inline namespace TALBOT_ISA {
namespace {

struct DiffuseV1Lobe {
    static constexpr bool kDiffuse = true, kTransmits = false;
    float rough;
    TALBOT_MEMBER static DiffuseV1Lobe load(const float* const* p, int i, const LobeUniform&) { return {saturate(p[0][i])}; }
    /// pi times f.
    TALBOT_MEMBER float value(const LobeLane& lane, Vec3 wi) const {
        const float fl = pow5(saturate(1.0f - dot(lane.n, wi))), fv = pow5(saturate(1.0f - dot(lane.n, lane.wo)));
        const float rr = rough * (dot(wi, lane.wo) + 1.0f);
        return (1.0f - 0.5f * fl) * (1.0f - 0.5f * fv) + rr * (fl + fv + fl * fv * (rr - 1.0f));
    }
    TALBOT_MEMBER LobeEval eval(const LobeLane& lane, Vec3 wi) const {
        const float c = maxf(dot(lane.n, wi), 0.0f) * kInvPi;
        return {vec3(c * value(lane, wi)), c};
    }
    TALBOT_MEMBER LobeSample sample(const LobeLane& lane, float u, float v, float) const {
        const Vec3 wi = cosine_direction(lane.n, u, v);
        return {wi, vec3(value(lane, wi)), maxf(dot(lane.n, wi), 0.0f) * kInvPi, 1.0f, 0};
    }
    TALBOT_MEMBER Rgb albedo(const LobeLane&) const { return vec3(1.0f); }
    TALBOT_MEMBER float roughness() const { return 1.0f; }
};

/// f cos = (1 - h.wi)^5 cos.
struct SheenV1Lobe {
    static constexpr bool kDiffuse = true, kTransmits = false;
    TALBOT_MEMBER static SheenV1Lobe load(const float* const*, int, const LobeUniform&) { return {}; }
    TALBOT_MEMBER float value(const LobeLane& lane, Vec3 wi) const {
        const float half = 0.5f * (1.0f + dot(wi, lane.wo));  // cos^2 of half the angle between them
        return dot(lane.n, lane.wo) > 0.0f ? pow5(saturate(1.0f - safe_sqrt(half))) : 0.0f;
    }
    TALBOT_MEMBER LobeEval eval(const LobeLane& lane, Vec3 wi) const {
        const float c = maxf(dot(lane.n, wi), 0.0f);
        return {vec3(c * value(lane, wi)), c * kInvPi};
    }
    TALBOT_MEMBER LobeSample sample(const LobeLane& lane, float u, float v, float) const {
        const Vec3 wi = cosine_direction(lane.n, u, v);
        return {wi, vec3(kPi * value(lane, wi)), maxf(dot(lane.n, wi), 0.0f) * kInvPi, 1.0f, 0};
    }
    TALBOT_MEMBER Rgb albedo(const LobeLane& lane) const { return vec3(0.05f + 0.4f * pow5(saturate(1.0f - dot(lane.n, lane.wo)))); }
    TALBOT_MEMBER float roughness() const { return 1.0f; }
};

/// D = (a^2 - 1) / (pi ln a^2 (1 + (a^2 - 1) cos^2)), separable Smith GGX masking of width 1/4, dielectric Fresnel of index 1.5.
/// The factor 1/4 of the model is in the closure's weight.
struct ClearcoatV1Lobe {
    static constexpr bool kDiffuse = false, kTransmits = false;
    float a2;
    int32_t sharp;
    TALBOT_MEMBER static ClearcoatV1Lobe load(const float* const* p, int i, const LobeUniform& u) {
        const float a = clampf(p[0][i], 0.0f, 1.0f);
        return {clampf(a * a, 1e-8f, 0.9999f), int32_t(a * a <= u.sharp_alpha2)};
    }
    TALBOT_MEMBER float d(Vec3 h) const {
        const float q = h.x * h.x + h.y * h.y + a2 * h.z * h.z;  // 1 + (a2 - 1) z^2 without cancellation
        return (a2 - 1.0f) / (kPi * lane_log(a2) * q);
    }
    TALBOT_MEMBER void evaluate(Vec3 wo, Vec3 wi, Vec3 h, float& f, float& pdf, float& weight) const {
        const float ho = maxf(dot(h, wo), 1e-6f);
        const float density = d(h);
        const float g = 1.0f / ((1.0f + ggx_lambda(0.25f, 0.25f, wo)) * (1.0f + ggx_lambda(0.25f, 0.25f, wi)));
        const float fresnel = fresnel_dielectric(ho, 1.5f);
        const bool valid = (wo.z > 0.0f) & (wi.z > 0.0f);
        const float oz = maxf(wo.z, 1e-7f), hz = maxf(h.z, 1e-7f);
        f = valid ? density * g * fresnel / (4.0f * oz) : 0.0f;
        pdf = valid ? density * hz / (4.0f * ho) : 0.0f;
        weight = valid ? (sharp != 0 ? fresnel : fresnel * g * ho / (oz * hz)) : 0.0f;
    }
    TALBOT_MEMBER LobeEval eval(const LobeLane& lane, Vec3 wi_world) const {
        const Frame frame = make_frame(lane.n, {}, false);
        const Vec3 wo = to_local(frame, lane.wo), wi = to_local(frame, wi_world);
        float f, pdf, weight;
        evaluate(wo, wi, normalize(wo + wi), f, pdf, weight);
        return {vec3(sharp != 0 ? 0.0f : f), sharp != 0 ? 0.0f : pdf};
    }
    TALBOT_MEMBER LobeSample sample(const LobeLane& lane, float u, float v, float) const {
        const Frame frame = make_frame(lane.n, {}, false);
        const Vec3 wo = to_local(frame, lane.wo);
        const float cos2 = (1.0f - lane_exp(lane_log(a2) * (1.0f - v))) / (1.0f - a2);
        const float z = sharp != 0 ? 1.0f : safe_sqrt(cos2), r = sharp != 0 ? 0.0f : safe_sqrt(1.0f - cos2);
        float s, c;
        lane_sincos(2.0f * kPi * u, s, c);
        const Vec3 h{r * c, r * s, z};
        const float ho = dot(wo, h);
        const Vec3 wi = h * (2.0f * ho) - wo;
        float f, pdf, weight;
        evaluate(wo, wi, h, f, pdf, weight);
        return {to_world(frame, wi), vec3(weight), sharp != 0 ? kDeltaPdf : pdf, 1.0f,
                (ho > 0.0f ? 0 : int32_t(kSampledFailed)) | (sharp != 0 ? int32_t(kSampledDelta) : 0)};
    }
    TALBOT_MEMBER Rgb albedo(const LobeLane& lane) const { return vec3(fresnel_dielectric(saturate(dot(lane.n, lane.wo)), 1.5f)); }
    TALBOT_MEMBER float roughness() const { return std::sqrt(std::sqrt(a2)); }
};

}  // namespace

void run_principled_v1(ClosureType type, const LobeCall& call) {
    switch (type) {
        case ClosureType::PrincipledSheenV1:
            return run_lobe<SheenV1Lobe>(call);
        case ClosureType::PrincipledClearcoatV1:
            return run_lobe<ClearcoatV1Lobe>(call);
        default:
            return run_lobe<DiffuseV1Lobe>(call);
    }
}

}  // namespace TALBOT_ISA
}  // namespace talbot
