/// Clear skies over a round Earth: radiance tables for the Sky Texture, and the sun as seen through the air.
///
/// A table holds linear Rec.709 over the sky dome: column by azimuth relative to the sun (u = 0.5 towards it), row by elevation on a
/// scale that stretches the horizon. Units: radiance such that the sun above the air gives its real irradiance in W/m2 through CIE XYZ.
///
/// [Nishita et al. 1993, "Display of the Earth taking into account atmospheric scattering"] for single scattering,
/// [Garcia Linan 2024, "Spectral sky", fgarlin.com] for the model with multiple scattering: four wavelengths and a fitted multiple-scattering term.
#pragma once

#include <memory>
#include <utility>
#include <vector>

#include "base/vec.h"
#include "shader/spectra.h"

namespace talbot::shader {

enum class SkyModel : uint8_t { Single, Multiple };

struct SkyAir {
    SkyModel model = SkyModel::Multiple;
    bool full_dome = true;    ///< rows cover -90 to 90 degrees; else 0 to 90 (3.4)
    float elevation = 0.26f;  ///< of the sun, radians, -pi/2 to pi/2
    float altitude = 0;       ///< of the viewer, m
    float air = 1, aerosol = 1, ozone = 1;
    Rec709 matrix = Rec709::Exact;
    bool operator==(const SkyAir&) const = default;
};

inline constexpr int kSkyWidth = 512, kSkyHeight = 256, kSkyHalfHeight = 128;

/// Both texels of a row with this colour: a sky is the same on either side of the sun. x is in the left half.
inline void store_mirrored(std::vector<float>& table, int x, int y, Rgb c) {
    for (const int column : {x, kSkyWidth - 1 - x}) {
        float* texel = &table[size_t(3 * (y * kSkyWidth + column))];
        texel[0] = c.x;
        texel[1] = c.y;
        texel[2] = c.z;
    }
}

/// Radiance, rgb a texel, rows from the lowest elevation.
std::vector<float> make_sky_table(const SkyAir& air);

/// Radiance at the lowest and the highest point of the sun's disc of this diameter (radians).
std::pair<Rgb, Rgb> sun_radiance(const SkyAir& air, float diameter);

/// Elevation below which the Earth hides the sun, radians (0 or less).
float horizon_elevation(float altitude);

/// The last few tables: an edit elsewhere in the scene does not compute the sky again.
class SkyCache {
public:
    std::shared_ptr<const std::vector<float>> table(const SkyAir& air);

private:
    std::vector<std::pair<SkyAir, std::shared_ptr<const std::vector<float>>>> tables_;
};

// The two models.
std::vector<float> single_scattering_table(const SkyAir& air);
std::vector<float> multiple_scattering_table(const SkyAir& air);
Rgb single_scattering_sun(const SkyAir& air, float elevation, float solid_angle);
Rgb multiple_scattering_sun(const SkyAir& air, float elevation, float solid_angle);

}  // namespace talbot::shader
