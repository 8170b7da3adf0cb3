/// One lane's microfacet distribution: GGX or Beckmann with its widths, both sampled by their visible normals.
#pragma once

#include "closure/kernels/lobe.h"
#include "closure/kernels/microfacet.h"

namespace talbot {
inline namespace TALBOT_ISA {

/// Below this the densities overflow; such lanes are delta anyway.
inline constexpr float kMinAlpha = 1e-6f;

/// Distribution, widths and frame of one lane.
template <bool beckmann>
struct Distribution {
    float ax, ay, separable;
    int32_t sharp;  ///< 1: delta (a whole word, so that loops vectorise)

    TALBOT_MEMBER static Distribution make(float ax, float ay, const LobeUniform& u) {
        ax = clampf(ax, 0.0f, 1e3f);
        ay = clampf(ay, 0.0f, 1e3f);
        return {maxf(ax, kMinAlpha), maxf(ay, kMinAlpha), u.separable, int32_t(ax * ay <= u.sharp_alpha2)};
    }
    TALBOT_MEMBER float d(Vec3 h) const { return beckmann ? beckmann_d(ax, ay, h) : ggx_d(ax, ay, h); }
    TALBOT_MEMBER float lambda(Vec3 w) const { return beckmann ? beckmann_lambda(ax, ay, w) : ggx_lambda(ax, ay, w); }
    TALBOT_MEMBER float g2(float lo, float li) const { return 1.0f / (1.0f + lo + li + separable * lo * li); }
    /// Density of sampled normals over |w.h| / w.z: D G1 of the distribution that is sampled.
    TALBOT_MEMBER float sampled(Vec3 h, Vec3 wo) const {
        return beckmann ? beckmann_d(ax, ay, h) / beckmann_visible_norm(ax, ay, wo) : ggx_d(ax, ay, h) / (1.0f + ggx_lambda(ax, ay, wo));
    }
    /// A visible normal; wo.z > 0.
    TALBOT_MEMBER Vec3 sample_visible(Vec3 wo, float u, float v) const {
        return beckmann ? sample_beckmann_visible(ax, ay, wo, u, v) : sample_ggx_visible(ax, ay, wo, u, v);
    }
    /// f / pdf without Fresnel: G2 over the G1 of sampling.
    TALBOT_MEMBER float weight(Vec3 wo, Vec3 wi) const {
        const float lo = lambda(wo), li = lambda(wi);
        return g2(lo, li) * (beckmann ? beckmann_visible_norm(ax, ay, wo) : 1.0f + lo);
    }
    TALBOT_MEMBER float roughness() const { return std::sqrt(std::sqrt(ax * ay)); }
};

}  // namespace TALBOT_ISA
}  // namespace talbot
