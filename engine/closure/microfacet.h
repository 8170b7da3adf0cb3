/// Variants of the microfacet closures (ClosureSlot::variant) and their parameter order. alpha is the width of the
/// distribution (roughness squared), the tangent need not be perpendicular to the normal, ior is the index beyond the surface
/// over the index on the viewer's side (so 1/n seen from inside).
///
///   Microfacet         alpha_x alpha_y tangent(3) fresnel data by kind:
///                        None       -
///                        Dielectric ior
///                        Schlick    ior, F0(3): dielectric curve of `ior` remapped to run from F0 to 1 (Principled specular, both generations)
///                        F82        F0(3), B(3): F0 + (1 - F0) s^5 - B c s^6, s = 1 - c [Kutz et al. 2021, "Novel aspects of the Adobe Standard Material"]
///                        Conductor  n(3), k(3): exact Fresnel of an absorbing medium
///                        SchlickFilm, F82Film, ConductorFilm: the same, then thickness (nm) and index of a thin film (kernels/thin_film.h)
///   MicrofacetRefract  alpha_x alpha_y tangent(3) ior. Transmits 1 but for total internal reflection, which absorbs.
///   MicrofacetGlass    alpha ior F0 scale(3) reflection tint(3) transmission tint(3). Isotropic. The dielectric curve is remapped to run from
///                        F0(ior) * scale to 1. With SchlickFilm: then thickness and index of a thin film, relative to the viewer's side.
///   AshikhminShirley   alpha_x alpha_y tangent(3)
///
/// Lanes whose alpha_x alpha_y is below the version's limit are sharp (delta), lanes whose index is 1 pass straight on.
/// Shadowing is Smith's, separable for versions before 4.0, height-correlated later [Heitz 2014, "Understanding the Masking-Shadowing Function"].
/// Radiance is not scaled by the squared index on refraction, like Cycles.
#pragma once

#include <cstdint>

namespace talbot {

enum class FresnelKind : uint8_t { None, Dielectric, Schlick, F82, Conductor, SchlickFilm, F82Film, ConductorFilm };

inline constexpr uint8_t kVariantFresnelMask = 15;
inline constexpr uint8_t kVariantBeckmann = 16;     ///< else GGX
inline constexpr uint8_t kVariantAnisotropic = 32;  ///< else the tangent columns are not used (but must exist)

inline constexpr uint8_t kVariantCorrelated = 64;  ///< height-correlated shadowing in every version (lobes with energy compensation, whose tables assume it)

inline constexpr uint8_t microfacet_variant(FresnelKind fresnel, bool beckmann = false, bool anisotropic = false, bool correlated = false) {
    return uint8_t(uint8_t(fresnel) | (beckmann ? kVariantBeckmann : 0) | (anisotropic ? kVariantAnisotropic : 0) | (correlated ? kVariantCorrelated : 0));
}

/// MicrofacetGlass: the first parameters of its two tints, three each.
inline constexpr int kGlassReflectionTint = 5, kGlassTransmissionTint = 8;

/// Number of parameter columns after alpha_x, alpha_y, tangent.
inline constexpr int fresnel_param_count(FresnelKind kind) {
    constexpr int kCounts[] = {0, 1, 4, 6, 6, 6, 8, 8};
    return kCounts[int(kind)];
}

}  // namespace talbot
