/// Parameter order of the hair closures. The tangent runs along the fibre from its root; the closure's normal is the fibre's own where
/// it is hit, and says how far from its middle. Angles in radians, absorption per fibre radius.
///
///   HairChiang        tangent(3) absorption(3) longitudinal variance, azimuthal scale, longitudinal variance of the first reflection, tilt of the scales, ior
///   HairHuang         tangent(3) major axis of the section(3) absorption(3) roughness (GGX alpha), tilt, ior, minor over major axis, strengths of R, TT and
///                     TRT, half of a pixel's width over the fibre's radius (1 and more: the whole fibre is seen at once)
///   HairReflection    tangent(3) roughness along, roughness around, offset
///   HairTransmission  the same
#pragma once

#include <cstdint>

namespace talbot {

inline constexpr uint8_t kVariantTiltsLight = 1;  ///< HairChiang: the scales tilt the light's direction, not the viewer's (before 4.2)

}  // namespace talbot
