/// Microfacet reflection with every kind of Fresnel, the same passed through a thin pane, and Ashikhmin-Shirley.
#include "closure/microfacet.h"

#include "closure/albedo.h"
#include "closure/kernels/distribution.h"
#include "closure/kernels/fresnel.h"
#include "closure/kernels/thin_film.h"
#include "closure/kernels/warp.h"

namespace talbot {
inline namespace TALBOT_ISA {
namespace {

/// Reflectance by half-vector cosine, and its mean over a lobe seen at a cosine as Cycles has it in its colour passes: one struct a kind; `p` are the columns
/// after alpha and tangent.
struct NoFresnel {
    TALBOT_MEMBER static NoFresnel load(const float* const*, int, const LobeUniform&) { return {}; }
    TALBOT_MEMBER Rgb at(float) const { return vec3(1.0f); }
    TALBOT_MEMBER Rgb over_lobe(float, float c) const { return at(c); }
};
struct DielectricFresnel {
    float eta;
    TALBOT_MEMBER static DielectricFresnel load(const float* const* p, int i, const LobeUniform&) { return {clampf(p[0][i], 1e-3f, 1e3f)}; }
    TALBOT_MEMBER Rgb at(float c) const { return vec3(fresnel_dielectric(c, eta)); }
    TALBOT_MEMBER Rgb over_lobe(float, float c) const { return at(c); }
};
struct SchlickFresnel {
    float eta;
    Rgb f0;
    TALBOT_MEMBER static SchlickFresnel load(const float* const* p, int i, const LobeUniform&) {
        return {clampf(p[0][i], 1e-3f, 1e3f), {saturate(p[1][i]), saturate(p[2][i]), saturate(p[3][i])}};
    }
    TALBOT_MEMBER Rgb at(float c) const { return lerp(f0, vec3(1.0f), fresnel_position(c, eta)); }
    TALBOT_MEMBER Rgb over_lobe(float rough, float c) const { return lerp(f0, vec3(1.0f), mean_fresnel_position(rough, c, eta)); }
};
struct F82Fresnel {
    Rgb f0, b;
    TALBOT_MEMBER static F82Fresnel load(const float* const* p, int i, const LobeUniform&) {
        return {{p[0][i], p[1][i], p[2][i]}, {p[3][i], p[4][i], p[5][i]}};
    }
    TALBOT_MEMBER Rgb at(float c) const { return {fresnel_f82(c, f0.x, b.x), fresnel_f82(c, f0.y, b.y), fresnel_f82(c, f0.z, b.z)}; }
    TALBOT_MEMBER Rgb over_lobe(float, float c) const { return at(c); }
};
struct ConductorFresnel {
    Rgb n, k;
    float approximate;
    TALBOT_MEMBER static ConductorFresnel load(const float* const* p, int i, const LobeUniform& u) {
        return {{p[0][i], p[1][i], p[2][i]}, {p[3][i], p[4][i], p[5][i]}, u.conductor_approximate};
    }
    TALBOT_MEMBER Rgb at(float c) const {
        return {fresnel_conductor(c, n.x, k.x, approximate), fresnel_conductor(c, n.y, k.y, approximate), fresnel_conductor(c, n.z, k.z, approximate)};
    }
    TALBOT_MEMBER Rgb over_lobe(float, float c) const { return at(c); }
};

/// A thin film over one of the above; where there is none, the plain curve.
template <class Base, int columns>
struct FilmFresnel {
    Base base;
    ThinFilm film;
    TALBOT_MEMBER static FilmFresnel load(const float* const* p, int i, const LobeUniform& u) {
        return {Base::load(p, i, u), {clampf(p[columns][i], 0.0f, 1e6f), clampf(p[columns + 1][i], 1e-3f, 1e3f), u.film_fitted}};
    }
    TALBOT_MEMBER Rgb at(float c) const {
        const Rgb f = filmed(base, saturate(c)), plain = base.at(c);
        const bool covered = film.thickness > kThinnestFilm;
        return {covered ? f.x : plain.x, covered ? f.y : plain.y, covered ? f.z : plain.z};
    }
    TALBOT_MEMBER Rgb over_lobe(float rough, float c) const {
        const Rgb f = filmed(base, saturate(c)), plain = base.over_lobe(rough, c);
        const bool covered = film.thickness > kThinnestFilm;
        return {covered ? f.x : plain.x, covered ? f.y : plain.y, covered ? f.z : plain.z};
    }
    TALBOT_MEMBER Rgb filmed(const SchlickFresnel& s, float c) const { return film_scaled(film_dielectric(c, film, s.eta), s.f0, s.eta); }
    TALBOT_MEMBER Rgb filmed(const ConductorFresnel& s, float c) const { return film_conductor(c, film, s.n, s.k, vec3(-1.0f)); }
    /// Reflectances at 0 and 82 degrees as those of a metal [Gulbrandsen 2014, "Artist Friendly Metallic Fresnel"].
    TALBOT_MEMBER Rgb filmed(const F82Fresnel& s, float c) const {
        const Rgb edge = s.at(1.0f / 7.0f);
        const float in[3][2] = {{s.f0.x, edge.x}, {s.f0.y, edge.y}, {s.f0.z, edge.z}};
        float n[3], k[3];
        for (int channel = 0; channel < 3; ++channel) {
            const float r = clampf(in[channel][0], 0.0f, 0.999f), root = std::sqrt(r);
            n[channel] = lerp((1.0f + root) / (1.0f - root), (1.0f - r) / (1.0f + r), in[channel][1]);
            k[channel] = safe_sqrt((r * square(n[channel] + 1.0f) - square(n[channel] - 1.0f)) / (1.0f - r));
        }
        return film_conductor(c, film, {n[0], n[1], n[2]}, {k[0], k[1], k[2]}, edge);
    }
};

template <class Fresnel, bool beckmann>
struct ReflectLobe {
    static constexpr bool kDiffuse = false, kTransmits = false;
    Distribution<beckmann> dist;
    Vec3 tangent;
    int32_t use_tangent;
    Fresnel fresnel;

    TALBOT_MEMBER static ReflectLobe load(const float* const* p, int i, const LobeUniform& u) {
        return {Distribution<beckmann>::make(p[0][i], p[1][i], u), {p[2][i], p[3][i], p[4][i]}, int32_t(u.anisotropic), Fresnel::load(p + 5, i, u)};
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
        const Vec3 hs = dist.sample_visible({wo.x, wo.y, maxf(wo.z, 1e-6f)}, u, v);
        const Vec3 h{dist.sharp != 0 ? 0.0f : hs.x, dist.sharp != 0 ? 0.0f : hs.y, dist.sharp != 0 ? 1.0f : hs.z};
        const float c = dot(wo, h);
        const Vec3 wi = h * (2.0f * c) - wo;
        const bool valid = (wo.z > 0.0f) & (wi.z > 0.0f);
        const float rough = dist.weight(wo, wi);
        const float pdf = dist.sampled(h, wo) / (4.0f * maxf(wo.z, 1e-7f));
        const Rgb weight = fresnel.at(c) * (dist.sharp != 0 ? 1.0f : rough);
        return {to_world(frame, wi), weight, dist.sharp != 0 ? kDeltaPdf : pdf, 1.0f,
                (valid ? 0 : int32_t(kSampledFailed)) | (dist.sharp != 0 ? int32_t(kSampledDelta) : 0)};
    }
    TALBOT_MEMBER Rgb albedo(const LobeLane& lane) const { return fresnel.at(saturate(dot(lane.n, lane.wo))); }
    TALBOT_MEMBER Rgb mean_albedo(const LobeLane& lane) const { return fresnel.over_lobe(dist.roughness(), saturate(dot(lane.n, lane.wo))); }
    TALBOT_MEMBER float roughness() const { return dist.roughness(); }
};

/// Light that a thin pane spreads on its far side as a rough mirror would on the near one.
struct PaneLobe {
    static constexpr bool kDiffuse = false, kTransmits = true;
    ReflectLobe<NoFresnel, false> mirror;
    TALBOT_MEMBER static PaneLobe load(const float* const* p, int i, const LobeUniform& u) { return {ReflectLobe<NoFresnel, false>::load(p, i, u)}; }
    TALBOT_MEMBER static Vec3 across(const LobeLane& lane, Vec3 w) { return w - lane.n * (2.0f * dot(lane.n, w)); }
    TALBOT_MEMBER LobeEval eval(const LobeLane& lane, Vec3 wi) const { return mirror.eval(lane, across(lane, wi)); }
    TALBOT_MEMBER LobeSample sample(const LobeLane& lane, float u, float v, float w) const {
        LobeSample s = mirror.sample(lane, u, v, w);
        s.wi = across(lane, s.wi);
        s.flags |= int32_t(kSampledTransmit);
        return s;
    }
    TALBOT_MEMBER Rgb albedo(const LobeLane&) const { return vec3(1.0f); }
    TALBOT_MEMBER float roughness() const { return mirror.roughness(); }
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
        return {maxf(2.0f / (x * x) - 2.0f, 0.0f),  maxf(2.0f / (y * y) - 2.0f, 0.0f), std::sqrt(std::sqrt(ax * ay)),
                int32_t(ax * ay <= u.sharp_alpha2), {p[2][i], p[3][i], p[4][i]},       int32_t(u.anisotropic)};
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
        case FresnelKind::SchlickFilm:
            return run_lobe<ReflectLobe<FilmFresnel<SchlickFresnel, 4>, beckmann>>(call);
        case FresnelKind::F82Film:
            return run_lobe<ReflectLobe<FilmFresnel<F82Fresnel, 6>, beckmann>>(call);
        case FresnelKind::ConductorFilm:
            return run_lobe<ReflectLobe<FilmFresnel<ConductorFresnel, 6>, beckmann>>(call);
    }
}

}  // namespace

void run_microfacet(ClosureType type, uint8_t variant, const LobeCall& call) {
    const bool beckmann = (variant & kVariantBeckmann) != 0;
    switch (type) {
        case ClosureType::AshikhminShirley:
            return run_lobe<AshikhminShirleyLobe>(call);
        case ClosureType::MicrofacetThin:
            return run_lobe<PaneLobe>(call);
        default: {
            const FresnelKind kind = FresnelKind(variant & kVariantFresnelMask);
            return beckmann ? run_reflect<true>(kind, call) : run_reflect<false>(kind, call);
        }
    }
}

}  // namespace TALBOT_ISA
}  // namespace talbot
