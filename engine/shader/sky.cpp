#include "shader/sky.h"

#include <algorithm>
#include <cmath>

namespace talbot::shader {

std::vector<float> make_sky_table(const SkyAir& air) {
    return air.model == SkyModel::Single ? single_scattering_table(air) : multiple_scattering_table(air);
}

std::pair<Rgb, Rgb> sun_radiance(const SkyAir& air, float diameter) {
    const float half = 0.5f * diameter;
    const float solid_angle = float(2 * M_PI * (1 - std::cos(double(half))));
    const float low = air.elevation - half, high = air.elevation + half;
    if (air.model == SkyModel::Multiple) return {multiple_scattering_sun(air, low, solid_angle), multiple_scattering_sun(air, high, solid_angle)};
    if (high <= 0) return {};
    return {single_scattering_sun(air, std::max(low, 0.0f), solid_angle), single_scattering_sun(air, high, solid_angle)};
}

float horizon_elevation(float altitude) {
    constexpr float kEarth = 6371.0f;
    return std::asin(kEarth / (kEarth + std::max(altitude, 0.0f) / 1000.0f)) - float(M_PI_2);
}

std::shared_ptr<const std::vector<float>> SkyCache::table(const SkyAir& air) {
    constexpr size_t kKept = 4;
    for (const auto& [key, made] : tables_)
        if (key == air) return made;
    if (tables_.size() >= kKept) tables_.erase(tables_.begin());
    return tables_.emplace_back(air, std::make_shared<const std::vector<float>>(make_sky_table(air))).second;
}

}  // namespace talbot::shader
