/// Colours of thin films: how an oscillation of the reflectance with the wave number looks. Made by make_thin_film_table.py.
#pragma once

namespace talbot {

inline constexpr int kThinFilmNodes = 768;
inline constexpr float kThinFilmLongest = 9600.0f;  ///< nm, path difference of the last node; beyond it the oscillations are too many to see

inline constexpr float kThinnestFilm = 0.1f;  ///< nm: below it there is none

/// Transform of red, green and blue: three real parts, three imaginary parts, each by path difference. Of the CIE observer, and after
/// it of the fit that the paper has for it, which is what Blender before 5.0 shows: up to a tenth away.
extern const float kThinFilm[12 * kThinFilmNodes];

}  // namespace talbot
