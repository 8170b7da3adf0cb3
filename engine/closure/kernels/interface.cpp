/// Rough interfaces: refraction, and glass that reflects and refracts.
///
/// What does not apply is masked by numbers, 0 or 1: long arms of selects and selects between booleans keep these loops from vectorising. NaN
/// times 0 is cleaned by the loops of lobe.h.
#include "closure/kernels/distribution.h"
#include "closure/kernels/fresnel.h"
#include "closure/kernels/thin_film.h"
#include "closure/microfacet.h"

namespace talbot {
inline namespace TALBOT_ISA {
namespace {

/// Reflection and refraction in one; refraction alone is the same with R = 0, T = 1 below the critical angle.
template <bool beckmann>
struct Interface {
    Distribution<beckmann> dist;
    Vec3 tangent;
    int32_t use_tangent;
    float eta;
    float straight;  ///< 1 where the index is 1: refracted light is not bent, whatever the roughness

    TALBOT_MEMBER static Interface make(Distribution<beckmann> dist, Vec3 tangent, int32_t use_tangent, float index) {
        const float eta = clampf(index, 1e-3f, 1e3f);
        return {dist, tangent, use_tangent, eta, std::fabs(eta - 1.0f) < 1e-4f ? 1.0f : 0.0f};
    }
    /// For wi on either side: the half vector's cosine with wo, f without Fresnel, and the density without the choice of side. Beyond the directions that
    /// facets bend light to, where no sample goes, the formula goes on as in Cycles: lamps that shine from there through frosted glass are seen.
    TALBOT_MEMBER void eval(Vec3 wo, Vec3 wi, float& cosine, float& smith, float& density) const {
        const bool reflect = wi.z > 0.0f;
        const float scale = reflect ? 1.0f : eta;
        const Vec3 sum = wo + wi * scale;
        Vec3 h = normalize(sum);
        h = h * (h.z < 0.0f ? -1.0f : 1.0f);
        const float ci = dot(wi, h), denominator = maxf(square(dot(wo, h) + eta * ci), 1e-14f);
        const float co = std::fabs(dot(wo, h));
        const float m = reflect ? 1.0f : 0.0f;
        const float jacobian = m / (4.0f * maxf(co, 1e-7f)) + (1.0f - m) * eta * eta * std::fabs(ci) / denominator;
        const bool valid = wo.z > 0.0f;
        const float over = (valid ? 1.0f : 0.0f) * (1.0f - delta(m)) * co * jacobian / maxf(wo.z, 1e-7f);
        cosine = co;
        smith = dist.d(h) * dist.g2(dist.lambda(wo), dist.lambda(wi)) * over;
        density = dist.sampled(h, wo) * over;
    }
    /// 1 where the choice of side (m: 1 reflects, 0 refracts) makes a delta lobe. Numbers instead of booleans: selects between booleans
    /// do not vectorise, and the compiler makes some from clamped parameters.
    TALBOT_MEMBER float delta(float m) const { return maxf(dist.sharp != 0 ? 1.0f : 0.0f, straight * (1.0f - m)); }
    struct Bent {
        Vec3 wi;
        float weight, pdf;
        int32_t flags;
    };
    /// Scatters at facet h: reflected or refracted; `chance` is the probability of that choice.
    TALBOT_MEMBER Bent scatter(Vec3 wo, Vec3 h, bool reflect, float chance) const {
        const float co = dot(wo, h);
        const float cos_t2 = 1.0f - (1.0f - co * co) / (eta * eta);
        const float cos_t = safe_sqrt(cos_t2);
        const Vec3 reflected = h * (2.0f * co) - wo;
        const Vec3 refracted = h * (co / eta - cos_t) - wo * (1.0f / eta);
        const float m = reflect ? 1.0f : 0.0f;
        const Vec3 wi = reflected * m + (refracted * (1.0f - straight) - wo * straight) * (1.0f - m);
        const float ci = dot(wi, h);
        const float denominator = maxf(square(co + eta * ci), 1e-14f);
        const float jacobian = m / (4.0f * maxf(co, 1e-7f)) + (1.0f - m) * eta * eta * std::fabs(ci) / denominator;
        const bool valid = (wo.z > 0.0f) & (co > 0.0f) & ((2.0f * m - 1.0f) * wi.z > 0.0f) & (maxf(m, cos_t2) > 0.0f);
        const float d = delta(m);
        const float pdf = dist.sampled(h, wo) * co * jacobian / maxf(wo.z, 1e-7f) * chance;
        const float weight = dist.weight(wo, wi);
        const int32_t flags = (valid ? 0 : int32_t(kSampledFailed)) | int32_t(d) * kSampledDelta | int32_t(1.0f - m) * kSampledTransmit;
        return {wi, weight * (1.0f - d) + d, pdf * (1.0f - d) + kDeltaPdf * d, flags};
    }
    TALBOT_MEMBER Vec3 facet(Vec3 wo, float u, float v) const {
        const Vec3 h = dist.sample_visible({wo.x, wo.y, maxf(wo.z, 1e-6f)}, u, v);
        return {dist.sharp != 0 ? 0.0f : h.x, dist.sharp != 0 ? 0.0f : h.y, dist.sharp != 0 ? 1.0f : h.z};
    }
};

template <bool beckmann>
struct RefractLobe {
    static constexpr bool kDiffuse = false, kTransmits = true;
    Interface<beckmann> face;

    TALBOT_MEMBER static RefractLobe load(const float* const* p, int i, const LobeUniform& u) {
        return {Interface<beckmann>::make(Distribution<beckmann>::make(p[0][i], p[1][i], u), {p[2][i], p[3][i], p[4][i]}, int32_t(u.anisotropic), p[5][i])};
    }
    TALBOT_MEMBER LobeEval eval(const LobeLane& lane, Vec3 wi_world) const {
        const Frame frame = make_frame(lane.n, face.tangent, face.use_tangent != 0);
        const Vec3 wo = to_local(frame, lane.wo), wi = to_local(frame, wi_world);
        float c, smith, density;
        face.eval(wo, wi, c, smith, density);
        const float below = wi.z < 0.0f ? 1.0f : 0.0f;
        return {vec3(smith * below), density * below};
    }
    TALBOT_MEMBER LobeSample sample(const LobeLane& lane, float u, float v, float) const {
        const Frame frame = make_frame(lane.n, face.tangent, face.use_tangent != 0);
        const Vec3 wo = to_local(frame, lane.wo);
        const auto s = face.scatter(wo, face.facet(wo, u, v), false, 1.0f);
        return {to_world(frame, s.wi), vec3(s.weight), s.pdf, face.eta, s.flags};
    }
    TALBOT_MEMBER Rgb albedo(const LobeLane& lane) const {
        const float c = dot(lane.n, lane.wo);
        return vec3(1.0f - c * c < face.eta * face.eta ? 1.0f : 0.05f);
    }
    TALBOT_MEMBER float roughness() const { return face.dist.roughness(); }
};

template <bool beckmann, bool has_film>
struct GlassLobe {
    static constexpr bool kDiffuse = false, kTransmits = true;
    Interface<beckmann> face;
    Rgb f0, reflection, transmission;
    ThinFilm film;

    TALBOT_MEMBER static GlassLobe load(const float* const* p, int i, const LobeUniform& u) {
        const float base = f0_from_eta(clampf(p[1][i], 1e-3f, 1e3f));
        return {Interface<beckmann>::make(Distribution<beckmann>::make(p[0][i], p[0][i], u), {}, 0, p[1][i]),
                {saturate(base * p[2][i]), saturate(base * p[3][i]), saturate(base * p[4][i])},
                {p[5][i], p[6][i], p[7][i]},
                {p[8][i], p[9][i], p[10][i]},
                has_film ? ThinFilm{clampf(p[11][i], 0.0f, 1e6f), clampf(p[12][i], 1e-3f, 1e3f), u.film_fitted} : ThinFilm{}};
    }
    TALBOT_MEMBER void split(float c, Rgb& r, Rgb& t) const {
        Rgb f = lerp(f0, vec3(1.0f), fresnel_position(c, face.eta));
        if constexpr (has_film) {
            const Rgb filmed = film_scaled(film_dielectric(c, film, face.eta), f0, face.eta);
            const bool covered = film.thickness > kThinnestFilm;
            f = {covered ? filmed.x : f.x, covered ? filmed.y : f.y, covered ? filmed.z : f.z};
        }
        // Total internal reflection leaves nothing to transmit even where F0 is tinted.
        r = f * reflection;
        t = (vec3(1.0f) - f) * transmission;
    }
    /// Probability to reflect, by energy; but what can happen is drawn once in 16 times or more: a glass seen from before reflects one part in 25, often of
    /// something much brighter than what is behind it.
    TALBOT_MEMBER float chance(Rgb r, Rgb t) const {
        constexpr float kLeast = 1.0f / 16.0f;
        const float a = mean(r), b = mean(t);
        const float least = a > 0.0f ? kLeast : 0.0f, most = b > 0.0f ? 1.0f - kLeast : 1.0f;
        return a + b > 0.0f ? clampf(a / (a + b), least, most) : 1.0f;
    }
    TALBOT_MEMBER LobeEval eval(const LobeLane& lane, Vec3 wi_world) const {
        const Frame frame = make_frame(lane.n, {}, false);
        const Vec3 wo = to_local(frame, lane.wo), wi = to_local(frame, wi_world);
        float c, smith, density;
        face.eval(wo, wi, c, smith, density);
        Rgb r, t;
        split(c, r, t);
        const float p = chance(r, t);
        const float m = wi.z > 0.0f ? 1.0f : 0.0f;
        return {(r * m + t * (1.0f - m)) * smith, density * (m * p + (1.0f - m) * (1.0f - p))};
    }
    TALBOT_MEMBER LobeSample sample(const LobeLane& lane, float u, float v, float w) const {
        const Frame frame = make_frame(lane.n, {}, false);
        const Vec3 wo = to_local(frame, lane.wo);
        const Vec3 h = face.facet(wo, u, v);
        Rgb r, t;
        split(saturate(dot(wo, h)), r, t);
        const float p = chance(r, t);
        const bool reflect = w < p;
        const float m = reflect ? 1.0f : 0.0f;
        const float choice = m * p + (1.0f - m) * (1.0f - p);
        const auto s = face.scatter(wo, h, reflect, choice);
        const float scale = s.weight / maxf(choice, 1e-12f);
        return {to_world(frame, s.wi), (r * m + t * (1.0f - m)) * scale, s.pdf, m + (1.0f - m) * face.eta, s.flags};
    }
    TALBOT_MEMBER Rgb albedo(const LobeLane& lane) const {
        Rgb r, t;
        split(saturate(dot(lane.n, lane.wo)), r, t);
        return r + t;
    }
    TALBOT_MEMBER float roughness() const { return face.dist.roughness(); }
};

}  // namespace

void run_interface(ClosureType type, uint8_t variant, const LobeCall& call) {
    const bool beckmann = (variant & kVariantBeckmann) != 0, film = FresnelKind(variant & kVariantFresnelMask) == FresnelKind::SchlickFilm;
    if (type == ClosureType::MicrofacetRefract) return beckmann ? run_lobe<RefractLobe<true>>(call) : run_lobe<RefractLobe<false>>(call);
    if (film) return beckmann ? run_lobe<GlassLobe<true, true>>(call) : run_lobe<GlassLobe<false, true>>(call);
    return beckmann ? run_lobe<GlassLobe<true, false>>(call) : run_lobe<GlassLobe<false, false>>(call);
}

}  // namespace TALBOT_ISA
}  // namespace talbot
