/// The loops that all closures share. A lobe is a struct that holds one lane's parameters and has
///
///   static Lobe load(const float* const* params, int i, const LobeUniform&)
///   LobeEval   eval(const LobeLane&, Vec3 wi) const       f (RGB, without the closure's weight) times cosine, and pdf
///   LobeSample sample(const LobeLane&, float u, float v, float w) const
///   Rgb        albedo(const LobeLane&) const              estimate; guides the choice of slot, feeds colour passes
///   float      roughness() const
///   static constexpr bool kDiffuse                         bump shadowing of the diffuse kind
///   static constexpr bool kTransmits                       the far side of the surface may be reached
///   static constexpr bool kFibre                           (hair only) round: neither bump shadowing nor a wrong side of the surface
///
/// Everything is selects, no branches, so that the loops vectorise.
#pragma once

#include "closure/closure.h"

namespace talbot {
inline namespace TALBOT_ISA {

inline constexpr float kDeltaPdf = 1e8f;

/// The same for all lanes. Switches are 0 or 1, for arithmetic in lanes.
struct LobeUniform {
    bool anisotropic = false;
    float correction = 1;  ///< soften the bump terminator
    float polynomial = 0, bump_all = 1, separable = 0, toon_wide = 0, sharp_alpha2 = 0, conductor_approximate = 0, film_fitted = 0,
          hair_over_angle = 0;  ///< ClosureSemantics
};

TALBOT_INLINE LobeUniform make_uniform(const ClosureGeometry& g, bool anisotropic, bool correlated) {
    const ClosureSemantics& s = g.semantics;
    LobeUniform u;
    u.anisotropic = anisotropic;
    u.correction = float(g.bump_correction);
    u.polynomial = float(s.bump_by_polynomial);
    u.bump_all = float(s.bump_cuts_glossy);
    u.separable = float(s.shadowing_separable && !correlated);
    u.toon_wide = float(s.toon_lights_wide);
    u.sharp_alpha2 = s.sharp_alpha2;
    u.conductor_approximate = float(s.conductor_approximate);
    u.film_fitted = float(s.film_fitted);
    u.hair_over_angle = float(s.hair_over_angle);
    return u;
}

struct LobeLane {
    Vec3 n, wo;
};
struct LobeEval {
    Rgb f;
    float pdf = 0;
};
struct LobeSample {
    Vec3 wi;
    Rgb weight;
    float pdf = 0;
    float eta = 1;
    int32_t flags = 0;
};

TALBOT_INLINE bool is_present(Rgb w) {
    return maxf(w.x, maxf(w.y, w.z)) > 0.0f;
}
/// NaN, infinity and negative numbers from absurd parameters become 0.
TALBOT_INLINE float clean(float x) {
    return ((x >= 0.0f) & (x <= 1e30f)) ? x : 0.0f;
}

/// Frame around n whose x axis is the tangent made perpendicular; an unusable tangent falls back to any.
struct Frame {
    Vec3 x, y, z;
};
TALBOT_INLINE Frame make_frame(Vec3 n, Vec3 tangent, bool use_tangent) {
    Vec3 bx, by;
    make_basis(n, bx, by);
    const Vec3 t = tangent - n * dot(n, tangent);
    const float l2 = dot(t, t);
    const bool usable = use_tangent & (l2 > 1e-12f) & (l2 < 1e30f);
    const float s = 1.0f / std::sqrt(usable ? l2 : 1.0f);
    const Vec3 x{usable ? t.x * s : bx.x, usable ? t.y * s : bx.y, usable ? t.z * s : bx.z};
    return {x, cross(n, x), n};
}
TALBOT_INLINE Vec3 to_local(const Frame& f, Vec3 v) {
    return {dot(f.x, v), dot(f.y, v), dot(f.z, v)};
}
TALBOT_INLINE Vec3 to_world(const Frame& f, Vec3 v) {
    return f.x * v.x + f.y * v.y + f.z * v.z;
}

template <class Lobe>
inline constexpr bool kIsFibre = requires {
    Lobe::kFibre;
};

/// Darkens where bump mapping would let light through: n is the closure's normal, ns the interpolated one.
/// Before 4.5: a polynomial for diffuse only. Later the GGX form of [Conty Estevez et al. 2019, "A Microfacet-Based Shadowing Function to Solve the Bump
/// Terminator Problem"] for diffuse and, from 5.0 on for all, nothing from directions that are above one normal and below the other.
template <bool diffuse>
TALBOT_INLINE float bump_shadow(const LobeUniform& uniform, Vec3 n, Vec3 ns, Vec3 wi) {
    const float n_wi = dot(n, wi), ns_wi = dot(ns, wi), n_ns = dot(n, ns);
    const float same_side = n_wi * n_ns * ns_wi < 0.0f ? 0.0f : 1.0f;
    if constexpr (!diffuse) return maxf(same_side, 1.0f - uniform.bump_all);
    // Before 4.5.
    const float denominator = n_wi * n_ns;
    const float g = clampf(ns_wi / (denominator != 0.0f ? denominator : 1.0f), 0.0f, 1.0f);
    const float polynomial = g + g * g - g * g * g;
    const float old_term = same_side * lerp(1.0f, polynomial, uniform.correction);
    // Later.
    const float c2 = minf(n_ns * n_ns, 1.0f);
    const float alpha2 = saturate(0.125f * (1.0f - c2) / maxf(c2, 1e-8f));
    const float cos2 = maxf(ns_wi * ns_wi, 1e-8f);
    const float g1 = 2.0f / (1.0f + std::sqrt(1.0f + alpha2 * maxf(1.0f - cos2, 0.0f) / cos2));
    const float smooth = c2 > 0.9999995f ? 1.0f : g1;  // not bent
    const float new_term = same_side * lerp(1.0f, smooth, uniform.correction);
    return uniform.polynomial != 0.0f ? old_term : new_term;
}

/// 0 where light would be refracted, below the closure's normal, and yet stay above the surface.
template <class Lobe>
TALBOT_INLINE float refracted_side(Vec3 n, Vec3 ns, Vec3 wi) {
    if constexpr (!Lobe::kTransmits || Lobe::kDiffuse || kIsFibre<Lobe>) return 1.0f;
    return (dot(n, wi) < 0.0f) & (dot(ns, wi) > 0.0f) ? 0.0f : 1.0f;
}

template <class Lobe>
TALBOT_INLINE void eval_lanes(const LobeUniform& uniform, const ClosureColumns& columns, const ClosureGeometry& geometry, ConstColumns3 wi_columns, int n,
                              Columns3 f, float* pdf) {
    // Local copies: pointers behind references could change with every store, as far as the compiler knows.
    const LobeUniform u = uniform;
    const ClosureColumns c = columns;
    const ClosureGeometry g = geometry;
    TALBOT_VECTOR_LOOP
    for (int i = 0; i < n; ++i) {
        const LobeLane lane{load(c.normal, i), load(g.wo, i)};
        const Vec3 wi = load(wi_columns, i);
        const Rgb weight = load(c.weight, i);
        const Lobe lobe = Lobe::load(c.params, i, u);
        const LobeEval e = lobe.eval(lane, wi);
        const float side = refracted_side<Lobe>(lane.n, load(g.ns, i), wi);
        const float bump = kIsFibre<Lobe> ? 1.0f : bump_shadow<Lobe::kDiffuse>(u, lane.n, load(g.ns, i), wi) * side;
        const bool present = is_present(weight);
        f.x[i] = present ? clean(e.f.x * bump * weight.x) : 0.0f;
        f.y[i] = present ? clean(e.f.y * bump * weight.y) : 0.0f;
        f.z[i] = present ? clean(e.f.z * bump * weight.z) : 0.0f;
        pdf[i] = present ? clean(e.pdf) * side : 0.0f;
    }
}

/// What every sampled direction goes through: the closure's weight, bump shadowing, and the test against the real surface.
template <class Lobe>
TALBOT_INLINE void finish_samples(const LobeUniform& k, const ClosureColumns& c, const ClosureGeometry& g, int n, const ClosureSamples& out) {
    TALBOT_VECTOR_LOOP
    for (int i = 0; i < n; ++i) {
        const Vec3 normal = load(c.normal, i), wi{out.wi.x[i], out.wi.y[i], out.wi.z[i]};
        const Rgb weight = load(c.weight, i);
        const int32_t flags = out.flags[i];
        const float pdf = out.pdf[i];
        // A direction that leaves through the wrong side of the real surface is lost. One that is worth nothing to this lobe is not: the others may reflect
        // there.
        const float side = dot(load(g.ng, i), wi);
        const float out_of_surface = (flags & kSampledTransmit) != 0 ? -side : side;
        const float outward = kIsFibre<Lobe> ? 1.0f : out_of_surface;
        // Sampled directions of glossy lobes are not cut, only evaluated ones.
        const float bump = Lobe::kDiffuse ? bump_shadow<Lobe::kDiffuse>(k, normal, load(g.ns, i), wi) : 1.0f;
        const Rgb r{clean(out.weight.x[i] * bump * weight.x), clean(out.weight.y[i] * bump * weight.y), clean(out.weight.z[i] * bump * weight.z)};
        const float length2 = dot(wi, wi);
        const bool ok =
            (outward > 0.0f) & (pdf > 0.0f) & (pdf < 1e30f) & ((flags & kSampledFailed) == 0) & is_present(weight) & (length2 > 0.9f) & (length2 < 1.1f);
        store(out.wi, i, {ok ? wi.x : normal.x, ok ? wi.y : normal.y, ok ? wi.z : normal.z});
        store(out.weight, i, {ok ? r.x : 0.0f, ok ? r.y : 0.0f, ok ? r.z : 0.0f});
        out.pdf[i] = ok ? pdf : 0.0f;
        out.flags[i] = ok ? flags : int32_t(kSampledFailed);
    }
}

template <class Lobe>
TALBOT_INLINE void sample_lanes(const LobeUniform& uniform, const ClosureColumns& columns, const ClosureGeometry& geometry, const float* u_column,
                                const float* v_column, const float* w_column, int n, const ClosureSamples& samples) {
    const LobeUniform k = uniform;
    const ClosureColumns c = columns;
    const ClosureGeometry g = geometry;
    const ClosureSamples out = samples;
    ConstColumn u = u_column, v = v_column, w = w_column;
    TALBOT_VECTOR_LOOP
    for (int i = 0; i < n; ++i) {
        const Lobe lobe = Lobe::load(c.params, i, k);
        const LobeLane lane{load(c.normal, i), load(g.wo, i)};
        const LobeSample s = lobe.sample(lane, u[i], v[i], w[i]);
        store(out.wi, i, s.wi);
        store(out.weight, i, s.weight);
        out.pdf[i] = s.pdf;
        out.flags[i] = s.flags;
        out.roughness[i] = lobe.roughness();
        out.eta[i] = s.eta;
    }
    finish_samples<Lobe>(k, c, g, n, out);
}

/// A lobe whose estimate is rough has a better one for the colour passes.
template <class Lobe>
TALBOT_INLINE Rgb mean_albedo(const Lobe& lobe, const LobeLane& lane) {
    if constexpr (requires { lobe.mean_albedo(lane); })
        return lobe.mean_albedo(lane);
    else
        return lobe.albedo(lane);
}

template <class Lobe>
TALBOT_INLINE void albedo_lanes(const LobeUniform& uniform, const ClosureColumns& columns, const ClosureGeometry& geometry, int n, Columns3 out) {
    const LobeUniform u = uniform;
    const ClosureColumns c = columns;
    const ClosureGeometry g = geometry;
    TALBOT_VECTOR_LOOP
    for (int i = 0; i < n; ++i) {
        const Rgb weight = load(c.weight, i);
        const LobeLane lane{load(c.normal, i), load(g.wo, i)};
        const Lobe lobe = Lobe::load(c.params, i, u);
        const Rgb a = mean_albedo(lobe, lane);
        out.x[i] = clean(a.x * weight.x);
        out.y[i] = clean(a.y * weight.y);
        out.z[i] = clean(a.z * weight.z);
    }
}

template <class Lobe>
TALBOT_INLINE void weight_lanes(const LobeUniform& uniform, const ClosureColumns& columns, const ClosureGeometry& geometry, int n, float* out) {
    const LobeUniform u = uniform;
    const ClosureColumns c = columns;
    const ClosureGeometry g = geometry;
    TALBOT_VECTOR_LOOP
    for (int i = 0; i < n; ++i) {
        const Rgb weight = load(c.weight, i);
        const LobeLane lane{load(c.normal, i), load(g.wo, i)};
        const Lobe lobe = Lobe::load(c.params, i, u);
        const Rgb a = lobe.albedo(lane);
        const float w = clean((a.x * weight.x + a.y * weight.y + a.z * weight.z) * (1.0f / 3.0f));
        // An estimate of zero must not hide a lobe that scatters.
        out[i] = is_present(weight) ? maxf(w, 1e-4f * clean(max_component(weight))) : 0.0f;
    }
}

/// What is asked of a lobe; the families' dispatchers forward it, so that each type is switched on in one place.
struct LobeCall {
    enum Kind { Eval, Sample, Albedo, Weight } kind = Eval;
    const ClosureColumns* columns = nullptr;
    const ClosureGeometry* geometry = nullptr;
    LobeUniform uniform;
    int n = 0;
    ConstColumns3 wi;
    Columns3 rgb;             ///< f or albedo
    float* scalar = nullptr;  ///< pdf or weight
    const float *u = nullptr, *v = nullptr, *w = nullptr;
    const ClosureSamples* samples = nullptr;
};

template <class Lobe>
void run_lobe(const LobeCall& call) {
    switch (call.kind) {
        case LobeCall::Eval:
            return eval_lanes<Lobe>(call.uniform, *call.columns, *call.geometry, call.wi, call.n, call.rgb, call.scalar);
        case LobeCall::Sample:
            return sample_lanes<Lobe>(call.uniform, *call.columns, *call.geometry, call.u, call.v, call.w, call.n, *call.samples);
        case LobeCall::Albedo:
            return albedo_lanes<Lobe>(call.uniform, *call.columns, *call.geometry, call.n, call.rgb);
        case LobeCall::Weight:
            return weight_lanes<Lobe>(call.uniform, *call.columns, *call.geometry, call.n, call.scalar);
    }
}

/// One a family (file).
void run_diffuse(ClosureType type, const LobeCall& call);
void run_microfacet(ClosureType type, uint8_t variant, const LobeCall& call);
void run_interface(ClosureType type, uint8_t variant, const LobeCall& call);
void run_sheen(ClosureType type, const LobeCall& call);
void run_toon(ClosureType type, const LobeCall& call);
void run_hair(ClosureType type, uint8_t variant, const LobeCall& call);
void run_hair_huang(const LobeCall& call);
void run_principled_v1(ClosureType type, const LobeCall& call);

}  // namespace TALBOT_ISA
}  // namespace talbot
