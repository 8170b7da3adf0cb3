// Pixel filters, sampled by inverting their cumulative distribution: every sample then has weight 1.
#include <algorithm>
#include <cmath>

#include "film/film.h"

namespace talbot::film {

namespace {

constexpr int kEntries = 1024;
constexpr double kTwoPi = 6.283185307179586;

// Share of the filter's weight below t, t = 0..1 over its support. Not normalised.
double cumulative(scene::PixelFilter filter, double t) {
    switch (filter) {
        case scene::PixelFilter::Gaussian:  // exp(-2 (6x / 3w)^2), x = (t - 1/2) 3w: the exponent is -18 at the ends
            return std::erf(6.0 * std::sqrt(2.0) * (t - 0.5));
        case scene::PixelFilter::BlackmanHarris:  // term by term integral of the window
            return 0.35875 * t - 0.48829 * std::sin(kTwoPi * t) / kTwoPi + 0.14128 * std::sin(2 * kTwoPi * t) / (2 * kTwoPi) -
                   0.01168 * std::sin(3 * kTwoPi * t) / (3 * kTwoPi);
        default:
            return t;
    }
}

double support(scene::PixelFilter filter, double width) {
    switch (filter) {
        case scene::PixelFilter::Gaussian:
            return 3.0 * width;
        case scene::PixelFilter::BlackmanHarris:
            return 2.0 * width;
        default:
            return 1.0;  // Blender's box is one pixel, whatever the width says
    }
}

}  // namespace

std::vector<float> make_filter_table(scene::PixelFilter filter, float width) {
    const double size = support(filter, std::max(double(width), 0.0));
    const double low = cumulative(filter, 0.0), high = cumulative(filter, 1.0);
    std::vector<float> table(kEntries);
    // Entry k stands for u in [k, k + 1) / 1024; all filters are even, so half of it says everything.
    for (int k = 0; k < kEntries / 2; ++k) {
        const double wanted = low + (high - low) * (k + 0.5) / kEntries;
        double a = 0.0, b = 0.5;
        for (int step = 0; step < 52; ++step) {
            const double middle = 0.5 * (a + b);
            (cumulative(filter, middle) < wanted ? a : b) = middle;
        }
        table[size_t(k)] = float((0.5 * (a + b) - 0.5) * size);
        table[size_t(kEntries - 1 - k)] = -table[size_t(k)];
    }
    return table;
}

}  // namespace talbot::film
