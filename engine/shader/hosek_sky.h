/// The clear sky of [Hosek & Wilkie 2012, "An Analytic Model for Full Spectral Sky-Dome Radiance"].
///
/// L(theta, gamma) = L_M (1 + A exp(B / (cos theta + 0.01))) (C + D exp(E gamma) + F cos^2 gamma + G chi(I, gamma) + H sqrt(cos theta)),
/// chi(g, gamma) = (1 + cos^2 gamma) / (1 + g^2 - 2 g cos gamma)^1.5 (section 5); nine numbers and L_M for each of X, Y and Z.
#pragma once

#include <array>

namespace talbot::shader {

/// [channel][albedo 0, 1][turbidity 1 .. 10][control point of a Bezier curve over the sun's height][A .. I]
extern const float kHosekShape[3][2][10][6][9];
extern const float kHosekRadiance[3][2][10][6];

struct HosekChannel {
    std::array<double, 9> shape{};  ///< A .. I
    double radiance = 0;            ///< L_M; times 683 lm/W a luminance for Y
};

/// X, Y and Z of one sky. turbidity 1 .. 10, albedo 0 .. 1 (both held there), elevation of the sun in radians, at least 0.
std::array<HosekChannel, 3> hosek_sky(double turbidity, double albedo, double elevation);

}  // namespace talbot::shader
