/// Microfacet reflection, refraction and glass, and Ashikhmin-Shirley.
///
/// GGX and Beckmann share one lobe; Beckmann is sampled by the visible normals of the GGX of equal width, whose tails are
/// longer: the weight stays below two.
#include "closure/kernels/microfacet.h"

#include "closure/kernels/fresnel.h"
#include "closure/kernels/lobe.h"
#include "closure/kernels/warp.h"
#include "closure/microfacet.h"

namespace talbot {
inline namespace TALBOT_ISA {
namespace {

/// Below this the densities overflow; such lanes are delta anyway.
constexpr float kMinAlpha = 1e-6f;

/// Distribution, widths and frame of one lane.
template <bool beckmann>
struct Distribution {
    float ax, ay, separable;
    int32_t sharp;  ///< 1: delta (a whole word, so that loops vectorise)

    TALBOT_MEMBER static Distribution make(float ax, float ay, const LobeUniform& u) {
        ax = clampf(ax, 0.0f, 1e3f);
        ay = clampf(ay, 0.0f, 1e3f);
        return {maxf(ax, kMinAlpha), maxf(ay, kMinAlpha), u.separable, int32_t(ax * ay <= u.delta_limit)};
    }
    TALBOT_MEMBER float d(Vec3 h) const { return beckmann ? beckmann_d(ax, ay, h) : ggx_d(ax, ay, h); }
    TALBOT_MEMBER float lambda(Vec3 w) const { return beckmann ? beckmann_lambda(ax, ay, w) : ggx_lambda(ax, ay, w); }
    TALBOT_MEMBER float g2(float lo, float li) const { return 1.0f / (1.0f + lo + li + separable * lo * li); }
    /// Density of sampled normals over |w.h| / w.z: D G1 of the distribution that is sampled.
    TALBOT_MEMBER float sampled(Vec3 h, Vec3 wo) const { return ggx_d(ax, ay, h) / (1.0f + ggx_lambda(ax, ay, wo)); }
    /// f / pdf without Fresnel: D G2 / (D_s G1_s).
    TALBOT_MEMBER float weight(Vec3 h, Vec3 wo, Vec3 wi) const {
        const float lo = lambda(wo), li = lambda(wi);
        const float smooth = beckmann ? d(h) / sampled(h, wo) : 1.0f + lo;
        return g2(lo, li) * smooth;
    }
    TALBOT_MEMBER float roughness() const { return std::sqrt(std::sqrt(ax * ay)); }
};

/// Reflectance by half-vector cosine, one struct a kind; `p` are the columns after alpha and tangent.
struct NoFresnel {
    TALBOT_MEMBER static NoFresnel load(const float* const*, int) { return {}; }
    TALBOT_MEMBER Rgb at(float) const { return vec3(1.0f); }
};
struct DielectricFresnel {
    float eta;
    TALBOT_MEMBER static DielectricFresnel load(const float* const* p, int i) { return {clampf(p[0][i], 1e-3f, 1e3f)}; }
    TALBOT_MEMBER Rgb at(float c) const { return vec3(fresnel_dielectric(c, eta)); }
};
struct SchlickFresnel {
    float eta;
    Rgb f0;
    TALBOT_MEMBER static SchlickFresnel load(const float* const* p, int i) {
        return {clampf(p[0][i], 1e-3f, 1e3f), {saturate(p[1][i]), saturate(p[2][i]), saturate(p[3][i])}};
    }
    TALBOT_MEMBER Rgb at(float c) const { return lerp(f0, vec3(1.0f), fresnel_position(c, eta)); }
};
struct F82Fresnel {
    Rgb f0, b;
    TALBOT_MEMBER static F82Fresnel load(const float* const* p, int i) { return {{p[0][i], p[1][i], p[2][i]}, {p[3][i], p[4][i], p[5][i]}}; }
    TALBOT_MEMBER Rgb at(float c) const { return {fresnel_f82(c, f0.x, b.x), fresnel_f82(c, f0.y, b.y), fresnel_f82(c, f0.z, b.z)}; }
};
struct ConductorFresnel {
    Rgb n, k;
    TALBOT_MEMBER static ConductorFresnel load(const float* const* p, int i) { return {{p[0][i], p[1][i], p[2][i]}, {p[3][i], p[4][i], p[5][i]}}; }
    TALBOT_MEMBER Rgb at(float c) const { return {fresnel_conductor(c, n.x, k.x), fresnel_conductor(c, n.y, k.y), fresnel_conductor(c, n.z, k.z)}; }
};

template <class Fresnel, bool beckmann>
struct ReflectLobe {
    static constexpr bool kDiffuse = false, kTransmits = false;
    Distribution<beckmann> dist;
    Vec3 tangent;
    int32_t use_tangent;
    Fresnel fresnel;

    TALBOT_MEMBER static ReflectLobe load(const float* const* p, int i, const LobeUniform& u) {
        return {Distribution<beckmann>::make(p[0][i], p[1][i], u), {p[2][i], p[3][i], p[4][i]}, int32_t(u.anisotropic), Fresnel::load(p + 5, i)};
    }
    TALBOT_MEMBER LobeEval eval(const LobeLane& lane, Vec3 wi_world) const {
        const Frame frame = make_frame(lane.n, tangent, use_tangent != 0);
        const Vec3 wo = to_local(frame, lane.wo), wi = to_local(frame, wi_world);
        const Vec3 h = normalize(wo + wi);
        const bool valid = (wo.z > 0.0f) & (wi.z > 0.0f) & (dist.sharp == 0);
        const float over = 1.0f / (4.0f * maxf(wo.z, 1e-7f));
        const Rgb f = fresnel.at(dot(wo, h)) * (dist.d(h) * dist.g2(dist.lambda(wo), dist.lambda(wi)) * over);
        const float pdf = dist.sampled(h, wo) * over;
        return {f * (valid ? 1.0f : 0.0f), valid ? pdf : 0.0f};
    }
    TALBOT_MEMBER LobeSample sample(const LobeLane& lane, float u, float v, float) const {
        const Frame frame = make_frame(lane.n, tangent, use_tangent != 0);
        const Vec3 wo = to_local(frame, lane.wo);
        const Vec3 hs = sample_ggx_visible(dist.ax, dist.ay, {wo.x, wo.y, maxf(wo.z, 1e-6f)}, u, v);
        const Vec3 h{dist.sharp != 0 ? 0.0f : hs.x, dist.sharp != 0 ? 0.0f : hs.y, dist.sharp != 0 ? 1.0f : hs.z};
        const float c = dot(wo, h);
        const Vec3 wi = h * (2.0f * c) - wo;
        const bool valid = (wo.z > 0.0f) & (wi.z > 0.0f);
        const float rough = dist.weight(h, wo, wi);
        const float pdf = dist.sampled(h, wo) / (4.0f * maxf(wo.z, 1e-7f));
        const Rgb weight = fresnel.at(c) * (dist.sharp != 0 ? 1.0f : rough);
        return {to_world(frame, wi), weight, dist.sharp != 0 ? kDeltaPdf : pdf, 1.0f,
                (valid ? 0 : int32_t(kSampledFailed)) | (dist.sharp != 0 ? int32_t(kSampledDelta) : 0)};
    }
    TALBOT_MEMBER Rgb albedo(const LobeLane& lane) const { return fresnel.at(saturate(dot(lane.n, lane.wo))); }
    TALBOT_MEMBER float roughness() const { return dist.roughness(); }
};

/// Reflection and refraction in one; refraction alone is the same with R = 0, T = 1 below the critical angle.
template <bool beckmann>
struct Interface {
    Distribution<beckmann> dist;
    Vec3 tangent;
    int32_t use_tangent;
    float eta;
    int32_t straight;  ///< index 1: refracted light is not bent, whatever the roughness

    TALBOT_MEMBER static Interface make(Distribution<beckmann> dist, Vec3 tangent, int32_t use_tangent, float index) {
        const float eta = clampf(index, 1e-3f, 1e3f);
        return {dist, tangent, use_tangent, eta, int32_t(std::fabs(eta - 1.0f) < 1e-4f)};
    }
    /// For wi on either side: the half vector's cosine with wo, f without Fresnel, and the density without the choice of side.
    TALBOT_MEMBER void eval(Vec3 wo, Vec3 wi, float& cosine, float& smith, float& density) const {
        const bool reflect = wi.z > 0.0f;
        const float scale = reflect ? 1.0f : eta;
        const Vec3 sum = wo + wi * scale;
        Vec3 h = normalize(sum);
        h = h * (h.z < 0.0f ? -1.0f : 1.0f);
        const float co = dot(wo, h), ci = dot(wi, h);
        const float denominator = maxf(square(co + eta * ci), 1e-14f);
        const float jacobian = reflect ? 1.0f / (4.0f * maxf(std::fabs(co), 1e-7f)) : eta * eta * std::fabs(ci) / denominator;
        const bool valid = (wo.z > 0.0f) & (co > 0.0f) & ((reflect ? ci : -ci) > 0.0f) & (dist.sharp == 0) & !((straight != 0) & !reflect);
        const float over = valid ? co * jacobian / maxf(wo.z, 1e-7f) : 0.0f;
        cosine = co;
        smith = dist.d(h) * dist.g2(dist.lambda(wo), dist.lambda(wi)) * over;
        density = dist.sampled(h, wo) * over;
    }
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
        const Vec3 unbent = -wo;
        const Vec3 through{straight != 0 ? unbent.x : refracted.x, straight != 0 ? unbent.y : refracted.y, straight != 0 ? unbent.z : refracted.z};
        const Vec3 wi{reflect ? reflected.x : through.x, reflect ? reflected.y : through.y, reflect ? reflected.z : through.z};
        const float ci = dot(wi, h);
        const float denominator = maxf(square(co + eta * ci), 1e-14f);
        const float jacobian = reflect ? 1.0f / (4.0f * maxf(co, 1e-7f)) : eta * eta * std::fabs(ci) / denominator;
        const bool valid = (wo.z > 0.0f) & (co > 0.0f) & ((reflect ? wi.z : -wi.z) > 0.0f) & (reflect | (cos_t2 > 0.0f));
        const bool delta = (dist.sharp != 0) | ((straight != 0) & !reflect);
        const float pdf = dist.sampled(h, wo) * co * jacobian / maxf(wo.z, 1e-7f) * chance;
        const float weight = dist.weight(h, wo, wi);
        const int32_t flags = (valid ? 0 : int32_t(kSampledFailed)) | (delta ? int32_t(kSampledDelta) : 0) | (reflect ? 0 : int32_t(kSampledTransmit));
        return {wi, delta ? 1.0f : weight, delta ? kDeltaPdf : pdf, flags};
    }
    TALBOT_MEMBER Vec3 facet(Vec3 wo, float u, float v) const {
        const Vec3 h = sample_ggx_visible(dist.ax, dist.ay, {wo.x, wo.y, maxf(wo.z, 1e-6f)}, u, v);
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
        const bool below = wi.z < 0.0f;
        return {vec3(below ? smith : 0.0f), below ? density : 0.0f};
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

template <bool beckmann>
struct GlassLobe {
    static constexpr bool kDiffuse = false, kTransmits = true;
    Interface<beckmann> face;
    Rgb f0, reflection, transmission;

    TALBOT_MEMBER static GlassLobe load(const float* const* p, int i, const LobeUniform& u) {
        const float base = f0_from_eta(clampf(p[1][i], 1e-3f, 1e3f));
        return {Interface<beckmann>::make(Distribution<beckmann>::make(p[0][i], p[0][i], u), {}, 0, p[1][i]),
                {saturate(base * p[2][i]), saturate(base * p[3][i]), saturate(base * p[4][i])},
                {p[5][i], p[6][i], p[7][i]},
                {p[8][i], p[9][i], p[10][i]}};
    }
    TALBOT_MEMBER void split(float c, Rgb& r, Rgb& t) const {
        const Rgb f = lerp(f0, vec3(1.0f), fresnel_position(c, face.eta));
        // Total internal reflection leaves nothing to transmit even where F0 is tinted.
        r = f * reflection;
        t = (vec3(1.0f) - f) * transmission;
    }
    TALBOT_MEMBER float chance(Rgb r, Rgb t) const {
        const float a = mean(r), b = mean(t);
        return a + b > 0.0f ? a / (a + b) : 1.0f;
    }
    TALBOT_MEMBER LobeEval eval(const LobeLane& lane, Vec3 wi_world) const {
        const Frame frame = make_frame(lane.n, {}, false);
        const Vec3 wo = to_local(frame, lane.wo), wi = to_local(frame, wi_world);
        float c, smith, density;
        face.eval(wo, wi, c, smith, density);
        Rgb r, t;
        split(c, r, t);
        const float p = chance(r, t);
        const bool reflect = wi.z > 0.0f;
        const Rgb tint{reflect ? r.x : t.x, reflect ? r.y : t.y, reflect ? r.z : t.z};
        return {tint * smith, density * (reflect ? p : 1.0f - p)};
    }
    TALBOT_MEMBER LobeSample sample(const LobeLane& lane, float u, float v, float w) const {
        const Frame frame = make_frame(lane.n, {}, false);
        const Vec3 wo = to_local(frame, lane.wo);
        const Vec3 h = face.facet(wo, u, v);
        Rgb r, t;
        split(saturate(dot(wo, h)), r, t);
        const float p = chance(r, t);
        const bool reflect = w < p;
        const float choice = reflect ? p : 1.0f - p;
        const auto s = face.scatter(wo, h, reflect, choice);
        const float scale = s.weight / maxf(choice, 1e-12f);
        const Rgb tint{reflect ? r.x : t.x, reflect ? r.y : t.y, reflect ? r.z : t.z};
        return {to_world(frame, s.wi), tint * scale, s.pdf, reflect ? 1.0f : face.eta, s.flags};
    }
    TALBOT_MEMBER Rgb albedo(const LobeLane& lane) const {
        Rgb r, t;
        split(saturate(dot(lane.n, lane.wo)), r, t);
        return r + t;
    }
    TALBOT_MEMBER float roughness() const { return face.dist.roughness(); }
};

/// [Ashikhmin & Shirley 2000, "An Anisotropic Phong BRDF Model"] without its Fresnel: f cos = cos sqrt((nx+1)(ny+1)) (n.h)^e /
/// (8 pi (h.wi) max(n.wo, n.wi)), exponents n = 2 / alpha^2 - 2.
struct AshikhminShirleyLobe {
    static constexpr bool kDiffuse = false, kTransmits = false;
    float nx, ny, rough;
    int32_t sharp;  ///< 1: delta (a whole word, so that loops vectorise)
    Vec3 tangent;
    int32_t use_tangent;

    TALBOT_MEMBER static AshikhminShirleyLobe load(const float* const* p, int i, const LobeUniform& u) {
        const float ax = clampf(p[0][i], 0.0f, 1.0f), ay = clampf(p[1][i], 0.0f, 1.0f);
        const float x = maxf(ax, 1e-4f), y = maxf(ay, 1e-4f);
        return {maxf(2.0f / (x * x) - 2.0f, 0.0f), maxf(2.0f / (y * y) - 2.0f, 0.0f), std::sqrt(std::sqrt(ax * ay)),
                int32_t(ax * ay <= u.delta_limit), {p[2][i], p[3][i], p[4][i]},       int32_t(u.anisotropic)};
    }
    /// Exponent that applies in h's direction.
    TALBOT_MEMBER float exponent(Vec3 h) const {
        const float s2 = h.x * h.x + h.y * h.y;
        const float mixed = (nx * h.x * h.x + ny * h.y * h.y) / maxf(s2, 1e-12f);
        return s2 > 1e-12f ? mixed : nx;
    }
    TALBOT_MEMBER void evaluate(Vec3 wo, Vec3 wi, Vec3 h, float& f, float& pdf) const {
        const float ho = maxf(dot(h, wo), 1e-7f);
        const float hz = clampf(h.z, 1e-6f, 1.0f);
        const float norm = std::sqrt((nx + 1.0f) * (ny + 1.0f)) * lane_pow(hz, exponent(h)) / (8.0f * kPi * ho);
        const bool valid = (wo.z > 0.0f) & (wi.z > 0.0f) & (sharp == 0);
        f = valid ? wi.z * norm / maxf(maxf(wo.z, wi.z), 1e-7f) : 0.0f;
        pdf = valid ? norm : 0.0f;
    }
    TALBOT_MEMBER LobeEval eval(const LobeLane& lane, Vec3 wi_world) const {
        const Frame frame = make_frame(lane.n, tangent, use_tangent != 0);
        const Vec3 wo = to_local(frame, lane.wo), wi = to_local(frame, wi_world);
        float f, pdf;
        evaluate(wo, wi, normalize(wo + wi), f, pdf);
        return {vec3(f), pdf};
    }
    TALBOT_MEMBER LobeSample sample(const LobeLane& lane, float u, float v, float) const {
        const Frame frame = make_frame(lane.n, tangent, use_tangent != 0);
        const Vec3 wo = to_local(frame, lane.wo);
        // Azimuth of density (n+1) / (2 pi (nx cos^2 + ny sin^2 + 1)): the tangent of a uniform angle, scaled, quadrant by quadrant.
        float s0, c0;
        lane_sincos(2.0f * kPi * u, s0, c0);
        const float kx = std::sqrt(ny + 1.0f), ky = std::sqrt(nx + 1.0f);
        const float length = 1.0f / std::sqrt(square(kx * c0) + square(ky * s0));
        const float c = kx * c0 * length, s = ky * s0 * length;
        const float e = nx * c * c + ny * s * s;
        const float cos_h = lane_pow(maxf(1.0f - v, 1e-7f), 1.0f / (e + 1.0f));
        const float sin_h = safe_sqrt(1.0f - cos_h * cos_h);
        const Vec3 h{sharp != 0 ? 0.0f : sin_h * c, sharp != 0 ? 0.0f : sin_h * s, sharp != 0 ? 1.0f : cos_h};
        const Vec3 wi = h * (2.0f * dot(wo, h)) - wo;
        float f, pdf;
        evaluate(wo, wi, h, f, pdf);
        const bool valid = (wo.z > 0.0f) & (wi.z > 0.0f) & (dot(wo, h) > 0.0f);
        const float weight = sharp != 0 ? 1.0f : wi.z / maxf(maxf(wo.z, wi.z), 1e-7f);
        return {to_world(frame, wi), vec3(weight), sharp != 0 ? kDeltaPdf : pdf, 1.0f,
                (valid ? 0 : int32_t(kSampledFailed)) | (sharp != 0 ? int32_t(kSampledDelta) : 0)};
    }
    TALBOT_MEMBER Rgb albedo(const LobeLane&) const { return vec3(1.0f); }
    TALBOT_MEMBER float roughness() const { return rough; }
};

template <bool beckmann>
void run_reflect(FresnelKind kind, const LobeCall& call) {
    switch (kind) {
        case FresnelKind::None:
            return run_lobe<ReflectLobe<NoFresnel, beckmann>>(call);
        case FresnelKind::Dielectric:
            return run_lobe<ReflectLobe<DielectricFresnel, beckmann>>(call);
        case FresnelKind::Schlick:
            return run_lobe<ReflectLobe<SchlickFresnel, beckmann>>(call);
        case FresnelKind::F82:
            return run_lobe<ReflectLobe<F82Fresnel, beckmann>>(call);
        case FresnelKind::Conductor:
            return run_lobe<ReflectLobe<ConductorFresnel, beckmann>>(call);
    }
}

}  // namespace

void run_microfacet(ClosureType type, uint8_t variant, const LobeCall& call) {
    const bool beckmann = (variant & kVariantBeckmann) != 0;
    switch (type) {
        case ClosureType::MicrofacetRefract:
            return beckmann ? run_lobe<RefractLobe<true>>(call) : run_lobe<RefractLobe<false>>(call);
        case ClosureType::MicrofacetGlass:
            return beckmann ? run_lobe<GlassLobe<true>>(call) : run_lobe<GlassLobe<false>>(call);
        case ClosureType::AshikhminShirley:
            return run_lobe<AshikhminShirleyLobe>(call);
        default: {
            const FresnelKind kind = FresnelKind(variant & kVariantFresnelMask);
            return beckmann ? run_reflect<true>(kind, call) : run_reflect<false>(kind, call);
        }
    }
}

}  // namespace TALBOT_ISA
}  // namespace talbot
