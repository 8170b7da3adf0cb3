/// Sheen: the Ashikhmin-Premoze velvet and the microfiber layer.
#include "closure/sheen.h"

#include "base/math.h"
#include "closure/kernels/lobe.h"
#include "closure/kernels/warp.h"

namespace talbot {
inline namespace TALBOT_ISA {
namespace {

/// [Ashikhmin, Premoze & Shirley 2000, "A Microfacet-based BRDF Generator"]: D = exp(-cot^2 / s^2) / (pi s^2 sin^4), V-cavity shadowing.
struct VelvetLobe {
    static constexpr bool kDiffuse = false, kTransmits = false;
    float inv_s2;
    TALBOT_MEMBER static VelvetLobe load(const float* const* p, int i, const LobeUniform&) { return {1.0f / square(clampf(p[0][i], 0.01f, 100.0f))}; }
    TALBOT_MEMBER float value(const LobeLane& lane, Vec3 wi) const {
        const float nv = dot(lane.n, lane.wo), nl = dot(lane.n, wi);
        const Vec3 h = normalize(lane.wo + wi);
        const float nh = dot(lane.n, h), hv = maxf(std::fabs(dot(h, lane.wo)), 1e-7f);
        const float nh2 = nh * nh;
        const float s2 = maxf(1.0f - nh2, 1e-9f);
        const float d = lane_exp(maxf(-nh2 * inv_s2 / s2, -80.0f)) * inv_s2 * kInvPi / (s2 * s2);
        const float g = minf(1.0f, minf(2.0f * nh * nl, 2.0f * nh * nv) / hv);
        const bool valid = (nv > 1e-5f) & (nl > 0.0f) & (nh2 < 1.0f - 1e-7f);
        return valid ? 0.25f * d * g / nv : 0.0f;
    }
    TALBOT_MEMBER LobeEval eval(const LobeLane& lane, Vec3 wi) const { return {vec3(value(lane, wi)), dot(lane.n, wi) > 0.0f ? 0.5f * kInvPi : 0.0f}; }
    TALBOT_MEMBER LobeSample sample(const LobeLane& lane, float u, float v, float) const {
        float cosine;
        const Vec3 wi = cone_direction(lane.n, 1.0f, u, v, cosine);
        return {wi, vec3(value(lane, wi) * 2.0f * kPi), 0.5f * kInvPi, 1.0f, 0};
    }
    TALBOT_MEMBER Rgb albedo(const LobeLane&) const { return vec3(1.0f); }
    TALBOT_MEMBER float roughness() const { return 1.0f; }
};

/// A cosine lobe under a linear map [Heitz et al. 2016, "Real-Time Polygonal-Light Shading with Linearly Transformed Cosines"] whose
/// three numbers depend on viewing angle and roughness. Where the normal turns away from the viewer (smooth rims) they are those of 90 degrees.
struct SheenLtcLobe {
    static constexpr bool kDiffuse = true, kTransmits = false;
    float rough;
    TALBOT_MEMBER static SheenLtcLobe load(const float* const* p, int i, const LobeUniform&) { return {clampf(p[0][i], 1e-3f, 1.0f)}; }
    /// x axis: the viewer's direction laid onto the surface.
    TALBOT_MEMBER static Frame frame(const LobeLane& lane) { return make_frame(lane.n, lane.wo, true); }
    TALBOT_MEMBER static float density(const SheenTerms& terms, Vec3 w) {
        const float mx = terms.a * w.x + terms.b * w.z, my = terms.a * w.y;
        return maxf(w.z, 0.0f) * kInvPi * square(terms.a / (mx * mx + my * my + w.z * w.z));
    }
    TALBOT_MEMBER LobeEval eval(const LobeLane& lane, Vec3 wi) const {
        const SheenTerms terms = sheen_terms(dot(lane.n, lane.wo), rough);
        const float pdf = density(terms, to_local(frame(lane), wi));
        return {vec3(pdf * terms.albedo), pdf};
    }
    TALBOT_MEMBER LobeSample sample(const LobeLane& lane, float u, float v, float) const {
        const SheenTerms terms = sheen_terms(dot(lane.n, lane.wo), rough);
        const Vec3 c = cosine_direction({0.0f, 0.0f, 1.0f}, u, v);
        const Vec3 w = normalize(Vec3{(c.x - terms.b * c.z) / terms.a, c.y / terms.a, c.z});
        return {to_world(frame(lane), w), vec3(terms.albedo), density(terms, w), 1.0f, 0};
    }
    TALBOT_MEMBER Rgb albedo(const LobeLane& lane) const { return vec3(sheen_terms(dot(lane.n, lane.wo), rough).albedo); }
    TALBOT_MEMBER float roughness() const { return 1.0f; }
};

}  // namespace

void run_sheen(ClosureType type, const LobeCall& call) {
    type == ClosureType::SheenLtc ? run_lobe<SheenLtcLobe>(call) : run_lobe<VelvetLobe>(call);
}

}  // namespace TALBOT_ISA
}  // namespace talbot
