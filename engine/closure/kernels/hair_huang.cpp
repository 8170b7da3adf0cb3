/// Hair as a rough dielectric cylinder of elliptic section [Huang et al. 2022, "A Microfacet-based Hair Scattering Model"]: GGX facets on scales that
/// tilt the fibre's normal. What one sees of a fibre is the integral over its width, or over the part of it that a pixel covers.
///
/// Local frame: x major axis, y along the fibre, z = x x y; gamma is the parameter of the ellipse (sin gamma, b cos gamma), phi an azimuth from z.
/// The integral is a Simpson sum, over gamma up to Blender 4.2, over the width in 4.5 and later, with steps as coarse as Cycles': over the width, what
/// bounces inside near the edges weighs up to three times as much as in the limit of fine steps, and is part of the look. Facets inside the fibre are drawn at
/// random, by a hash of the directions and of where the fibre is hit, so that the same question has the same answer, but a thousand hits under one sun do not
/// share their error. Directions are sampled from lobes of [Chiang et al. 2016] of about the same widths, at a few places across the fibre: their density is
/// known.
#include "base/hash.h"
#include "closure/albedo.h"
#include "closure/hair.h"
#include "closure/kernels/fibre.h"
#include "closure/kernels/microfacet.h"

namespace talbot {
inline namespace TALBOT_ISA {
namespace {

constexpr int kProposals = 5;        ///< places across the fibre
constexpr float kWideShare = 0.15f;  ///< of the sampled directions are spread widely: GGX has long tails
constexpr int kMostIntervals = 256;
constexpr float kRounding = 1e-5f;
constexpr float kMargin = 1e-3f;  ///< of the half width, or radians: left out at the edges

struct HuangLobe {
    static constexpr bool kDiffuse = false, kTransmits = true, kFibre = true;
    Vec3 tangent, major;
    Rgb sigma;
    float alpha, tilt_angle, eta, b, reflect, through, back, coverage;
    float sin_tilt, cos_tilt;
    bool over_angle;  ///< the sum goes over gamma, not over the width

    static HuangLobe load(const float* const* p, int i, const LobeUniform& u) {
        HuangLobe l;
        l.over_angle = u.hair_over_angle > 0.0f;
        l.tangent = {p[0][i], p[1][i], p[2][i]};
        l.major = {p[3][i], p[4][i], p[5][i]};
        l.sigma = {clampf(p[6][i], 0.0f, 1e6f), clampf(p[7][i], 0.0f, 1e6f), clampf(p[8][i], 0.0f, 1e6f)};
        l.alpha = clampf(p[9][i], 1e-3f, 1.0f);
        // Scales point to the tip.
        l.tilt_angle = -clampf(p[10][i], -0.5f * kPi, 0.5f * kPi);
        l.eta = clampf(p[11][i], 1.0001f, 100.0f);
        const float ratio = clampf(p[12][i], 1e-2f, 1e2f);
        l.b = ratio > 1.0f ? 1.0f / ratio : ratio;
        l.reflect = clampf(p[13][i], 0.0f, 1e6f);
        l.through = clampf(p[14][i], 0.0f, 1e6f);
        l.back = clampf(p[15][i], 0.0f, 1e6f);
        l.coverage = clampf(p[16][i], 1e-6f, 1.0f);
        lane_sincos(l.tilt_angle, l.sin_tilt, l.cos_tilt);
        return l;
    }

    /// What depends on the viewer only.
    struct View {
        Fibre fibre;
        Vec3 x, z;
        Vec3 wo;          ///< local
        float phi;        ///< of wo
        float radius;     ///< half the projected width
        float h;          ///< where the fibre is hit, from -radius to radius, against `fibre.a`
        float low, high;  ///< the part of it that is seen
    };
    View look(const LobeLane& lane) const {
        View v;
        v.fibre = make_fibre(tangent, lane.wo);
        const Frame frame = make_frame(v.fibre.t, b < 1.0f ? major : v.fibre.a, true);
        v.x = frame.x;
        v.z = cross(v.x, v.fibre.t);
        v.wo = local(v, lane.wo);
        const float across2 = maxf(v.wo.x * v.wo.x + v.wo.z * v.wo.z, 1e-12f);
        v.phi = b < 1.0f ? lane_atan2(v.wo.x, v.wo.z) : 0.0f;
        v.radius = safe_sqrt(1.0f - (1.0f - b * b) * v.wo.x * v.wo.x / across2);
        v.h = clampf(-dot(lane.n, v.fibre.a), -v.radius, v.radius);
        const bool near = v.radius > coverage;
        v.low = near ? maxf(v.h - coverage, -v.radius) : -v.radius;
        v.high = near ? minf(v.h + coverage, v.radius) : v.radius;
        return v;
    }
    static Vec3 local(const View& v, Vec3 w) { return {dot(w, v.x), dot(w, v.fibre.t), dot(w, v.z)}; }

    float to_phi(float gamma) const {
        float s, c;
        lane_sincos(gamma, s, c);
        return lane_atan2(b * s, c);
    }
    float to_gamma(float phi) const {
        float s, c;
        lane_sincos(phi, s, c);
        return lane_atan2(s, b * c);
    }
    /// Where a ray of the viewer's azimuth meets the ellipse at h = x radius: the solution of b sin(phi) cos(gamma) - cos(phi) sin(gamma) = h.
    float gamma_at(const View& v, float x) const {
        x = clampf(x, -1.0f, 1.0f);
        return b < 1.0f ? lane_atan2(v.wo.z, -b * v.wo.x) - lane_acos(-x) : -lane_asin(x);
    }
    float x_at(const View& v, float gamma) const { return b < 1.0f ? -lane_cos(lane_atan2(v.wo.z, -b * v.wo.x) - gamma) : -lane_sin(gamma); }
    /// |d gamma / d x|, where the sum goes over x.
    float stretch(float x) const { return over_angle ? 1.0f : 1.0f / std::sqrt(maxf(1.0f - x * x, 1e-12f)); }
    /// The ellipse's normal at gamma, tilted towards the tip by the scales (sine and cosine given).
    Vec3 normal_at(float gamma, float sine, float cosine) const {
        float s, c;
        lane_sincos(gamma, s, c);
        const float x = b * s, l = 1.0f / std::sqrt(maxf(x * x + c * c, 1e-12f));
        return {cosine * x * l, sine, cosine * c * l};
    }
    float arc(float gamma) const {
        const float s = lane_sin(gamma);
        return safe_sqrt(1.0f - (1.0f - b * b) * s * s);
    }
    float chord(float from, float to) const {
        float s0, c0, s1, c1;
        lane_sincos(from, s0, c0);
        lane_sincos(to, s1, c1);
        return safe_sqrt(square(s0 - s1) + square(b * (c0 - c1)));
    }
    Rgb absorb(float length) const { return {lane_exp(-sigma.x * length), lane_exp(-sigma.y * length), lane_exp(-sigma.z * length)}; }
    static float cos_theta(Vec3 w) { return maxf(safe_sqrt(w.x * w.x + w.z * w.z), 1e-4f); }

    float lambda(float cosine) const {
        const float c2 = maxf(cosine * cosine, 1e-8f);
        return 0.5f * (std::sqrt(1.0f + alpha * alpha * maxf(1.0f - c2, 0.0f) / c2) - 1.0f);
    }
    float shadowing(float ci, float co) const { return 1.0f / (1.0f + lambda(ci) + lambda(co)); }
    /// The same over the masking of the first direction.
    float outgoing(float ci, float co) const {
        const float l = 1.0f + lambda(ci);
        return l / (l + lambda(co));
    }
    float facets(float cosine) const {
        const float a2 = alpha * alpha, q = cosine * cosine * (a2 - 1.0f) + 1.0f;
        return a2 / maxf(kPi * q * q, 1e-20f);
    }
    /// Light that bounces several times between the facets, as if the surface were glass.
    float energy(float cosine, float index) const { return 1.0f / maxf(glass_albedo(std::sqrt(alpha), saturate(cosine), index), 0.02f); }
    static float transmitted(float cosine, float index) { return 1.0f - saturate(fresnel_dielectric(maxf(cosine, 0.0f), index)); }
    Vec3 draw_facet(Vec3 w, Vec3 m, uint32_t seed) const {
        Vec3 s, t;
        make_basis(m, s, t);
        const float u = float(hash_words(seed, 0u) >> 8) * 0x1p-24f, v = float(hash_words(seed, 1u) >> 8) * 0x1p-24f;
        const Vec3 h = sample_ggx_visible(alpha, alpha, {dot(w, s), dot(w, t), maxf(dot(w, m), 1e-6f)}, u, v);
        return s * h.x + t * h.y + m * h.z;
    }
    static bool sees(Vec3 v, Vec3 m, Vec3 h) { return dot(v, h) > 0.0f && dot(v, m) > 0.0f; }

    float reflected(const View& v, Vec3 wi, float from, float to) const {
        const Vec3 wo = v.wo, wh = normalize(wo + wi);
        const int intervals = count_intervals(to - from, 0.7f);
        const float step = (to - from) / float(intervals);
        float sum = 0.0f;
        for (int k = 0; k <= intervals; ++k) {
            const float at = from + float(k) * step, gamma = over_angle ? at : gamma_at(v, at);
            const Vec3 m = normal_at(gamma, sin_tilt, cos_tilt), upright = normal_at(gamma, 0.0f, 1.0f);
            if (!(sees(wo, upright, wh) && sees(wi, upright, wh))) continue;
            const float c = dot(m, wo);
            sum += simpson(k, intervals) * stretch(at) * facets(dot(m, wh)) * shadowing(c, dot(m, wi)) * arc(gamma) * energy(c, eta);
        }
        return reflect * 0.25f * saturate(fresnel_dielectric(maxf(dot(wo, wh), 0.0f), eta)) * sum * step;
    }
    int count_intervals(float range, float resolution) const {
        return 2 * int(clampf(std::ceil(0.5f * range / (resolution * alpha)), 1.0f, float(kMostIntervals / 2)));
    }
    static float simpson(int k, int intervals) { return (k == 0 || k == intervals ? 1.0f : (k & 1) != 0 ? 4.0f : 2.0f) * (1.0f / 3.0f); }

    /// TT, TRT, and a residual lobe for what bounces more often [Chiang et al. 2016].
    Rgb refracted(const View& v, Vec3 wi, float from, float to, uint32_t seed) const {
        const Vec3 wo = v.wo;
        if (through <= 0.0f && back <= 0.0f) return {};
        const float inverse = 1.0f / eta;
        const int intervals = count_intervals(to - from, 0.8f);
        const float step = (to - from) / float(intervals);
        Rgb passed{}, residual{};
        for (int k = 0; k <= intervals; ++k) {
            // In: a visible facet, refracted.
            const float at = from + float(k) * step, gamma1 = over_angle ? at : gamma_at(v, at), w = simpson(k, intervals) * stretch(at);
            const Vec3 m1 = normal_at(gamma1, sin_tilt, cos_tilt), upright1 = normal_at(gamma1, 0.0f, 1.0f);
            const Vec3 h1 = draw_facet(wo, m1, seed + 2u * uint32_t(k));
            const float co1 = dot(wo, h1), cm1 = dot(wo, m1);
            if (!(co1 > 0.0f)) continue;
            const float cos_t = safe_sqrt(1.0f - (1.0f - co1 * co1) * inverse * inverse);
            const Vec3 wt = h1 * (inverse * co1 - cos_t) - wo * inverse;
            if (!(sees(wo, m1, h1) && sees(-wt, m1, h1) && sees(wo, upright1, h1) && sees(-wt, upright1, h1))) continue;
            const float phi_t = lane_atan2(wt.x, wt.z), gamma2 = 2.0f * to_phi(phi_t) - gamma1;
            const Vec3 m2 = normal_at(gamma2, -sin_tilt, cos_tilt), upright2 = normal_at(gamma2, 0.0f, 1.0f);
            const float out1 = dot(-wt, m1), cm2 = dot(-wt, m2);
            const float enter = w * transmitted(co1, eta) * energy(cm1, eta) * outgoing(cm1, out1) * cm1 / maxf(out1, 1e-6f);
            const float energy2 = energy(cm2, inverse);
            const Rgb a = absorb(chord(gamma1, gamma2 + kPi) / cos_theta(wt));
            // Out at the far side.
            if (through > 0.0f && dot(wi, wt) >= inverse - kRounding) {
                passed = passed + a * (through * enter * energy2 * leave(wt, wi, m2, cm2, inverse) * arc(gamma2));
            }
            if (back <= 0.0f) continue;
            // Reflected inside.
            const Vec3 h2 = draw_facet(-wt, m2, seed + 2u * uint32_t(k) + 1u);
            const float co2 = dot(-wt, h2);
            if (!(co2 > 0.0f)) continue;
            const float r2 = saturate(fresnel_dielectric(co2, inverse));
            const Rgb more = rest(w * transmitted(co1, eta), r2, a);
            const Vec3 wr = wt + h2 * (2.0f * co2);
            if (dot(wr, wi) < inverse - kRounding) {
                residual = residual + more;  // no facet refracts it to there
                continue;
            }
            if (!(sees(-wt, m2, h2) && sees(wr, m2, h2) && sees(-wt, upright2, h2) && sees(wr, upright2, h2))) continue;
            residual = residual + more;
            const float phi_r = lane_atan2(-wr.x, -wr.z), gamma3 = gamma1 - 2.0f * (to_phi(phi_t) - to_phi(phi_r)) + kPi;
            const Vec3 m3 = normal_at(gamma3, -sin_tilt, cos_tilt), upright3 = normal_at(gamma3, 0.0f, 1.0f);
            const Vec3 h3 = normalize(wi * inverse - wr);
            if (!(sees(-wr, m3, h3) && sees(-wr, upright3, h3) && dot(wi, h3) < 0.0f && dot(wi, m3) < 0.0f && dot(wi, upright3) < 0.0f)) continue;
            const float out2 = dot(wr, m2), cm3 = dot(-wr, m3);
            const Rgb a2 = absorb(chord(gamma3, gamma2) / cos_theta(wr));
            const float turn = r2 * energy2 * outgoing(cm2, out2) * cm2 / maxf(out2, 1e-6f);
            passed = passed + a * a2 * (back * enter * turn * energy(cm3, inverse) * leave(wr, wi, m3, cm3, inverse) * arc(gamma3));
        }
        const float sin_o = wo.y, sin_i = wi.y;
        const float m = longitudinal(sin_i, safe_sqrt(1.0f - sin_i * sin_i), sin_o, safe_sqrt(1.0f - sin_o * sin_o), 4.0f * alpha);
        return (passed * (inverse * inverse) + residual * (m * 0.5f * kInvPi * 2.0f * kInvPi)) * step;
    }
    /// Rough refraction of the inner direction w (towards the surface of inward normal m) to wi outside, without the Jacobian's squared index.
    float leave(Vec3 w, Vec3 wi, Vec3 m, float cm, float inverse) const {
        const Vec3 sum = wi * inverse - w;
        const float l2 = maxf(dot(sum, sum), 1e-12f);
        const Vec3 h = sum * (1.0f / std::sqrt(l2));
        const float cmh = dot(m, h), ci = dot(-w, h), co = dot(-wi, h);
        if (!(cmh >= 0.0f) || !(ci > 0.0f) || !(co > 0.0f)) return 0.0f;
        return transmitted(ci, inverse) * facets(cmh) * shadowing(cm, dot(-wi, m)) * ci * co / l2;
    }
    static Rgb rest(float enters, float r, Rgb a) {
        const float t = maxf(1.0f - r, 1e-5f);
        const auto series = [&](float x) { return enters * r * r * t * x * x * x / maxf(1.0f - x * (1.0f - t), 1e-6f); };
        return {series(a.x), series(a.y), series(a.z)};
    }

    Rgb value(const View& v, Vec3 wi) const {
        const float tan_tilt = sin_tilt / maxf(cos_tilt, 1e-6f);
        // Scales that the light or the viewer cannot see.
        if (tan_tilt * wi.y / cos_theta(wi) < -1.0f) return {};
        const float span = maxf(-tan_tilt * v.wo.y / cos_theta(v.wo), 0.0f);
        if (span > 1.0f) return {};
        const float half = lane_acos(span), first = to_gamma(v.phi - half), last = to_gamma(v.phi + half);
        float from, to;
        if (over_angle) {
            from = first + kMargin;
            to = last + (last < first ? kTwoPi : 0.0f) - kMargin;
            if (v.radius > coverage) {
                const float near_from = gamma_at(v, v.high / v.radius);
                float near_to = gamma_at(v, v.low / v.radius);
                near_to += near_to < near_from ? kTwoPi : 0.0f;
                const float turn = lane_floor((0.5f * (from + to) - 0.5f * (near_from + near_to)) / kTwoPi + 0.5f) * kTwoPi;
                from = maxf(from, near_from + turn);
                to = minf(to, near_to + turn);
            }
        } else {
            from = maxf(x_at(v, last) + kMargin / v.radius, v.low / v.radius);
            to = minf(x_at(v, first) - kMargin / v.radius, v.high / v.radius);
        }
        if (!(to > from)) return {};
        const uint32_t seed = hash_words(as_uint(wi.x), as_uint(wi.y), as_uint(wi.z), hash_words(as_uint(v.wo.y), as_uint(v.h)));
        const Rgb sum = vec3(reflected(v, wi, from, to)) + refracted(v, wi, from, to, seed);
        return sum / maxf(cos_theta(v.wo) * (v.high - v.low), 1e-9f);
    }

    /// Lobes to draw directions from: R, TT, TRT and a wide one at each of a few places.
    struct Proposal {
        float middle[kProposals][3], share[kProposals][4], variance[4], scale, sines[3], cosines[3];
    };
    Proposal propose(const View& v) const {
        Proposal q;
        for (int k = 0; k < kProposals; ++k) {
            const float h = lerp(v.low, v.high, (float(k) + 0.5f) / float(kProposals));
            const Vec3 n = normal_at(gamma_at(v, h / v.radius), 0.0f, 1.0f);
            const FibrePath path = follow_fibre(v.fibre, dot(v.x * n.x + v.z * n.z, v.fibre.a), eta, sigma);
            const float energy[3] = {reflect * luminance(path.carried[0]), through * luminance(path.carried[1]), back * luminance(path.carried[2])};
            const float sum = energy[0] + energy[1] + energy[2];
            for (int p = 0; p < 3; ++p) {
                q.middle[k][p] = path.middle(p);
                q.share[k][p] = sum > 0.0f ? energy[p] / sum * (1.0f - kWideShare) : 0.0f;
            }
            q.share[k][3] = sum > 0.0f ? kWideShare : 1.0f;
        }
        const float widths[3] = {1.4f, 0.9f, 2.2f}, turns[3] = {-2.0f, 1.0f, 4.0f};
        for (int p = 0; p < 3; ++p) {
            q.variance[p] = maxf(square(widths[p] * alpha), 1e-4f);
            lane_sincos(turns[p] * tilt_angle, q.sines[p], q.cosines[p]);
        }
        q.variance[3] = maxf(4.0f * alpha, 0.5f);
        // Wide enough to fill the gaps between the places.
        q.scale = maxf(0.8f * alpha, 0.3f * (v.high - v.low) + 0.02f);
        return q;
    }
    float density(const View& v, const Proposal& q, float sin_i, float phi) const {
        const float cos_i = safe_sqrt(1.0f - sin_i * sin_i);
        float m[4];
        for (int p = 0; p < 3; ++p) {
            float so, co;
            tilt(v.fibre.sin_o, v.fibre.cos_o, q.sines[p], q.cosines[p], so, co);
            m[p] = longitudinal(sin_i, cos_i, so, co, q.variance[p]);
        }
        m[3] = longitudinal(sin_i, cos_i, v.fibre.sin_o, v.fibre.cos_o, q.variance[3]) * (0.5f * kInvPi);
        float sum = 0.0f;
        for (int k = 0; k < kProposals; ++k) {
            sum += q.share[k][3] * m[3];
            for (int p = 0; p < 3; ++p) sum += q.share[k][p] * m[p] * trimmed_logistic(wrap_angle(phi - q.middle[k][p]), q.scale);
        }
        return sum / float(kProposals);
    }

    LobeEval eval(const LobeLane& lane, Vec3 wi) const {
        const View v = look(lane);
        const float pdf = density(v, propose(v), clampf(dot(v.fibre.t, wi), -1.0f, 1.0f), azimuth(v.fibre, wi));
        return {value(v, local(v, wi)), pdf};
    }
    LobeSample sample(const LobeLane& lane, float u, float vv, float w) const {
        const View v = look(lane);
        const Proposal q = propose(v);
        // The number that chose the place chooses the lobe, then the angle along.
        const float at = w * float(kProposals);
        const int k = int(clampf(at, 0.0f, float(kProposals) - 0.5f));
        float left = saturate(at - float(k));
        int lobe = 0;
        while (lobe < 3 && left >= q.share[k][lobe]) left -= q.share[k][lobe++];
        left = saturate(left / maxf(q.share[k][lobe], 1e-6f));
        float so = v.fibre.sin_o, co = v.fibre.cos_o;
        if (lobe < 3) tilt(v.fibre.sin_o, v.fibre.cos_o, q.sines[lobe], q.cosines[lobe], so, co);
        const float sin_i = sample_longitudinal(so, co, q.variance[lobe], left, vv);
        const float phi = lobe < 3 ? q.middle[k][lobe] + sample_logistic(q.scale, u) : kTwoPi * u;
        const Vec3 wi = fibre_direction(v.fibre, sin_i, phi);
        const LobeEval e = eval(lane, wi);
        return {wi, e.f / maxf(e.pdf, 1e-20f), e.pdf, 1.0f, 0};
    }
    Rgb albedo(const LobeLane& lane) const {
        const View v = look(lane);
        const FibrePath path = follow_fibre(v.fibre, -v.h, eta, sigma);
        return path.carried[0] * reflect + path.carried[1] * through + (path.carried[2] + path.carried[3]) * back;
    }
    float roughness() const { return alpha; }
};

}  // namespace

void run_hair_huang(const LobeCall& call) {
    run_lobe<HuangLobe>(call);
}

}  // namespace TALBOT_ISA
}  // namespace talbot
