#include "shader/hosek_sky.h"

#include <algorithm>
#include <cmath>

namespace talbot::shader {

std::array<HosekChannel, 3> hosek_sky(double turbidity, double albedo, double elevation) {
    turbidity = std::clamp(turbidity, 1.0, 10.0);
    albedo = std::clamp(albedo, 0.0, 1.0);
    // The curve's parameter: the cube root spreads the sun's lowest positions, where the sky changes most.
    const double s = std::cbrt(std::clamp(elevation / M_PI_2, 0.0, 1.0));
    double bernstein[6];
    constexpr double kBinomial[6] = {1, 5, 10, 10, 5, 1};
    for (int k = 0; k < 6; ++k) bernstein[k] = kBinomial[k] * std::pow(s, k) * std::pow(1 - s, 5 - k);

    const int low = std::min(int(turbidity), 9) - 1;
    const double hazy = turbidity - (low + 1);
    std::array<HosekChannel, 3> sky;
    for (int channel = 0; channel < 3; ++channel) {
        for (int ground = 0; ground < 2; ++ground) {
            for (int step = 0; step < 2; ++step) {
                const double weight = (ground ? albedo : 1 - albedo) * (step ? hazy : 1 - hazy);
                for (int k = 0; k < 6; ++k) {
                    for (int i = 0; i < 9; ++i) sky[size_t(channel)].shape[size_t(i)] += weight * bernstein[k] * kHosekShape[channel][ground][low + step][k][i];
                    sky[size_t(channel)].radiance += weight * bernstein[k] * kHosekRadiance[channel][ground][low + step][k];
                }
            }
        }
    }
    return sky;
}

}  // namespace talbot::shader
