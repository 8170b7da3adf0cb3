/// Colours of spectra, in linear Rec.709: Planck's radiator and monochromatic light, from the CIE 1931 2-degree observer [CIE 018:2019].
#pragma once

#include <vector>

#include "base/vec.h"

namespace talbot::shader {

/// Rec.709 colour of luminance 1 of a black body, kelvin. Negative components are kept.
Rgb blackbody_color(double kelvin);

inline constexpr float kBlackbodyCold = 800, kBlackbodyHot = 12000;
/// blackbody_color at equal steps of 1/T from hot to cold.
const std::vector<Rgb>& blackbody_table();

/// Light of one wavelength, 375 to 785 nm in steps of 5, scaled as Blender's Wavelength node; not negative.
const std::vector<Rgb>& wavelength_table();

}  // namespace talbot::shader
