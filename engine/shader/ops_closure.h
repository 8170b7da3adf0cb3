/// Operations that prepare closure parameters (Op::Closure); loops in kernels/ops_closure.cpp. "n" is the closure's normal, "wo" the
/// direction to the viewer; vectors and colours count three.
#pragma once

#include <cstdint>

namespace talbot::shader {

enum class ClosureOp : uint8_t {
    AlphaFromRoughness,  ///< roughness -> alpha, clamped
    GlossyAlpha,         ///< roughness, anisotropy -> alpha_x, alpha_y (Glossy BSDF: alpha (1 - a), alpha / (1 - a))
    PrincipledAlpha,     ///< roughness, anisotropy -> alpha_x, alpha_y (Principled, Metallic: aspect sqrt(1 - 0.9 a))
    RotateTangent,       ///< n, tangent, turns -> tangent
    ValidReflection,     ///< n, ng, wo -> n bent so that the mirror direction stays above the surface
    EnergyReflect,       ///< n, wo, alpha_x, alpha_y, mean reflectance rgb, old -> factor rgb. old: 1 before 4.0
    EnergyShare,         ///< the same -> what single and multiple scattering leave, E + Fms (1 - E), rgb
    EnergyGlass,         ///< n, wo, alpha, ior, mean reflectance rgb, old -> factor rgb
    F82,                 ///< F0 rgb, tint rgb -> B rgb, mean reflectance rgb
    ConductorMean,       ///< n rgb, k rgb, approximate -> mean reflectance rgb
    Specular,            ///< n, wo, alpha_x, alpha_y, ior, level, tint rgb -> index of the curve, F0 rgb, albedo rgb, mean reflectance rgb
    Coat,                ///< n, wo, alpha, ior, before 4.5 -> albedo, path length through the coat, factor for several bounces
    ThinPane,            ///< n, wo, alpha, ior, colour of one passage rgb, tint of reflections rgb -> reflected rgb, transmitted rgb, alpha of transmission
    SheenAlbedo,         ///< n, wo, roughness -> albedo
    FresnelAt,           ///< n, wo, ior -> dielectric reflectance for the whole surface
    SpecularV1,          ///< base rgb, specular, tint, metallic -> index of the curve, F0 rgb, mean reflectance rgb
    SheenTintV1,         ///< base rgb, tint -> rgb
    GlassIndex,          ///< ior, backfacing -> relative index
    FilmAlbedo,          ///< n, wo, index, F0 rgb, thickness, film's index, nm below which it fades -> reflectance rgb of the whole surface
    HairWidths,          ///< roughness, radial roughness, coat -> longitudinal variance, azimuthal scale, variance of the first reflection
    HairPigment,         ///< melanin, redness -> absorption rgb
    HairColor,           ///< color rgb, radial roughness -> absorption rgb
    HairSection,         ///< tangent, wo, n, curve's normal, aspect ratio -> major axis, 1 where the ray passes beside the elliptic fibre
};

}  // namespace talbot::shader
