/// Reflectance of a surface under a thin film: light that is reflected at the film's top and (again and again) at its bottom interferes
/// [Belcour & Barla 2017, "A Practical Extension to Microfacet Theory for the Modeling of Varying Iridescence"]. Indices 1: outside, 2: film, 3: below.
/// c is the cosine outside; thickness in nm.
#pragma once

#include "base/math.h"
#include "closure/kernels/fresnel.h"
#include "closure/thin_film.h"

namespace talbot {
inline namespace TALBOT_ISA {

struct ThinFilm {
    float thickness, ior;
    float fitted;  ///< 1: as before Blender 5.0
};

/// Reflectance and phase of one polarisation; the phase as cosine and sine.
struct Polarised {
    float r, re, im;
};

/// Amplitudes between dielectrics of relative index eta. Beyond the critical angle r = 1.
TALBOT_INLINE void reflect_polarised(float c, float eta, Polarised& s, Polarised& p, float& cos_t) {
    const float t2 = 1.0f - (1.0f - c * c) / (eta * eta);
    cos_t = safe_sqrt(t2);
    const float rs = (c - eta * cos_t) / maxf(c + eta * cos_t, 1e-12f), rp = (eta * c - cos_t) / maxf(eta * c + cos_t, 1e-12f);
    const bool total = t2 <= 0.0f;
    s = {total ? 1.0f : rs * rs, rs < 0.0f ? -1.0f : 1.0f, 0.0f};
    p = {total ? 1.0f : rp * rp, rp < 0.0f ? -1.0f : 1.0f, 0.0f};
}

/// The same at a conductor n + i k under a dielectric of index `above` [Born & Wolf 1999, "Principles of Optics", 14.4.1].
TALBOT_INLINE void reflect_polarised(float c, float above, float n, float k, Polarised& s, Polarised& p) {
    const float n2 = n * n, k2 = k * k, cross = 2.0f * n * k;
    const float t = n2 - k2 - above * above * (1.0f - c * c), length = safe_sqrt(t * t + cross * cross);
    const float u2 = maxf(0.5f * (length + t), 0.0f), v2 = maxf(0.5f * (length - t), 0.0f);
    const float u = std::sqrt(u2), v = std::sqrt(v2), ac = above * c;
    s.r = saturate((square(ac - u) + v2) / maxf(square(ac + u) + v2, 1e-20f));
    const float a = (n2 - k2) * c, b = cross * c;
    p.r = saturate((square(a - above * u) + square(b - above * v)) / maxf(square(a + above * u) + square(b + above * v), 1e-20f));
    const float s_re = ac * ac - u2 - v2, s_im = -2.0f * ac * v;
    const float s_l = 1.0f / std::sqrt(maxf(s_re * s_re + s_im * s_im, 1e-30f));
    s.re = s_re * s_l;
    s.im = s_im * s_l;
    const float p_re = square((n2 + k2) * c) - above * above * (u2 + v2), p_im = 2.0f * ac * (cross * u - (n2 - k2) * v);
    const float p_l = 1.0f / std::sqrt(maxf(p_re * p_re + p_im * p_im, 1e-30f));
    p.re = p_re * p_l;
    p.im = p_im * p_l;
}

/// The eye's answer to an oscillation of this path difference (nm), one channel.
TALBOT_INLINE void film_response(float path, float fitted, int channel, float& re, float& im) {
    const float at = minf(maxf(path * ((kThinFilmNodes - 1) / kThinFilmLongest), 0.0f), float(kThinFilmNodes) - 1.001f);
    const int32_t i = int32_t(at);
    const float f = at - float(i);
    const float* real = kThinFilm + channel * kThinFilmNodes + (fitted != 0.0f ? 6 * kThinFilmNodes : 0);
    const float* imaginary = real + 3 * kThinFilmNodes;
    re = lerp(real[i], real[i + 1], f);
    im = lerp(imaginary[i], imaginary[i + 1], f);
}

/// Sum over the number of times the light went through the film, (10) of the paper, for one polarisation and channel. top: from outside into the film.
TALBOT_INLINE float airy_sum(const Polarised& top, const Polarised& bottom, float path, float fitted, int channel) {
    const float t = 1.0f - top.r, both = minf(top.r * bottom.r, 0.9999f), root = std::sqrt(both);
    const float through = t * t * bottom.r / (1.0f - both);
    // Seen from inside the top turns the phase the other way: by half a turn more.
    const float re = -top.re * bottom.re, im = -top.re * bottom.im;
    float sum = top.r + through, amplitude = through - t, ar = re, ai = im;
#pragma GCC unroll 3
    for (int m = 1; m <= 3; ++m) {
        float sr, si;
        film_response(float(m) * path, fitted, channel, sr, si);
        amplitude *= root;
        sum += 2.0f * amplitude * (ar * sr + ai * si);
        const float next = ar * re - ai * im;
        ai = ar * im + ai * re;
        ar = next;
    }
    return sum;
}

/// Very thin films fade out (below 30 nm before Blender 5.0, then 1 nm): their index goes to that of the outside.
TALBOT_INLINE float film_index(ThinFilm film) {
    const float t = saturate(film.thickness / (film.fitted != 0.0f ? 30.0f : 1.0f));
    return lerp(1.0f, maxf(film.ior, 1e-3f), t * t * (3.0f - 2.0f * t));
}

/// Over a dielectric of index eta.
TALBOT_INLINE Rgb film_dielectric(float c, ThinFilm film, float eta) {
    const float n2 = film_index(film);
    Polarised top[2], bottom[2];
    float cos2, cos3;
    reflect_polarised(saturate(c), n2, top[0], top[1], cos2);
    reflect_polarised(cos2, eta / n2, bottom[0], bottom[1], cos3);
    const bool total = (cos2 <= 0.0f) | (cos3 <= 0.0f);
    const float path = 2.0f * n2 * film.thickness * cos2;
    float rgb[3];
    for (int k = 0; k < 3; ++k)
        rgb[k] = total ? 1.0f : saturate(0.5f * (airy_sum(top[0], bottom[0], path, film.fitted, k) + airy_sum(top[1], bottom[1], path, film.fitted, k)));
    return {rgb[0], rgb[1], rgb[2]};
}

/// Over a conductor. f82: where not negative, the reflectance at 82 degrees that replaces the conductor's own curve (F82 model).
TALBOT_INLINE Rgb film_conductor(float c, ThinFilm film, Rgb n, Rgb k, Rgb f82) {
    const float n2 = film_index(film);
    Polarised top[2];
    float cos2;
    reflect_polarised(saturate(c), n2, top[0], top[1], cos2);
    const float path = 2.0f * n2 * film.thickness * cos2;
    const float in[3][3] = {{n.x, k.x, f82.x}, {n.y, k.y, f82.y}, {n.z, k.z, f82.z}};
    float rgb[3];
    for (int channel = 0; channel < 3; ++channel) {
        const float eta = in[channel][0], kappa = in[channel][1], edge = in[channel][2];
        Polarised bottom[2];
        reflect_polarised(cos2, n2, eta, kappa, bottom[0], bottom[1]);
        const float q = eta / n2, l2 = square(kappa / n2);
        const float f0 = (square(q - 1.0f) + l2) / (square(q + 1.0f) + l2);
        constexpr float kS = 6.0f / 7.0f, kS5 = kS * kS * kS * kS * kS;
        const float model = fresnel_f82(cos2, f0, (7.0f / (kS5 * kS)) * (lerp(f0, 1.0f, kS5) - edge));
        bottom[0].r = edge >= 0.0f ? model : bottom[0].r;
        bottom[1].r = edge >= 0.0f ? model : bottom[1].r;
        const float sum = 0.5f * (airy_sum(top[0], bottom[0], path, film.fitted, channel) + airy_sum(top[1], bottom[1], path, film.fitted, channel));
        rgb[channel] = cos2 > 0.0f ? saturate(sum) : 1.0f;
    }
    return {rgb[0], rgb[1], rgb[2]};
}

/// Principled's tint of the reflectance: by F0 over what the index gives, the less the more is reflected anyway.
TALBOT_INLINE Rgb film_scaled(Rgb f, Rgb f0, float eta) {
    const float real = f0_from_eta(eta);
    const auto scaled = [&](float x, float wanted) {
        const float s = saturate((x - 1.0f) / minf(real - 1.0f, -1e-6f));
        return real > 1e-5f ? x * lerp(1.0f, wanted / maxf(real, 1e-5f), s) : x;
    };
    return {scaled(f.x, f0.x), scaled(f.y, f0.y), scaled(f.z, f0.z)};
}

}  // namespace TALBOT_ISA
}  // namespace talbot
