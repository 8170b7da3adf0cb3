/// Colours of spectra, in linear Rec.709: black bodies as Cycles fits them, and monochromatic light from the CIE 1931 2-degree observer [CIE 018:2019].
#pragma once

#include <vector>

#include "base/vec.h"

namespace talbot::shader {

/// The matrix by which a Blender version goes from XYZ to Rec.709: rounded numbers in its colour configuration, from 5.0 that of the primaries.
enum class Rec709 : uint8_t { Rounded, Exact };

/// CIE XYZ to linear Rec.709, white D65.
Rgb xyz_to_rec709(double x, double y, double z, Rec709 matrix);

/// Colour of unit spectral radiance at this wavelength (380 to 780, a multiple of 5), per nm, by the observer's functions. Components may be negative.
Rgb observer_color(int nm, Rec709 matrix);

/// Rec.709 colour of luminance 1 of a black body, kelvin; not negative, held below 800 K and above 12000 K.
Rgb blackbody_color(float kelvin, Rec709 matrix);

inline constexpr float kBlackbodyCold = 800, kBlackbodyHot = 12000;
/// blackbody_color at equal steps of 1/T from hot to cold.
std::vector<Rgb> blackbody_table(Rec709 matrix);

/// Light of one wavelength, 375 to 785 nm in steps of 5, scaled as Blender's Wavelength node; not negative.
std::vector<Rgb> wavelength_table(Rec709 matrix);

}  // namespace talbot::shader
