#include "film/adaptive.h"

#include <algorithm>
#include <cmath>

namespace talbot::film {

namespace {

constexpr float kThresholdScale = 5.0f, kNormBias = 1e-4f;
constexpr scene::BlenderVersion kSparesOverexposed = 305;

}  // namespace

AdaptiveRule make_adaptive_rule(const scene::Settings& settings) {
    const float threshold = settings.adaptive_threshold > 0.0f ? settings.adaptive_threshold : std::max(0.001f, 1.0f / float(std::max(settings.samples, 1)));
    AdaptiveRule rule;
    rule.min_samples = std::max(4, settings.adaptive_min_samples > 0 ? settings.adaptive_min_samples : int(std::ceil(16.0f / std::pow(threshold, 0.3f))));
    rule.threshold = kThresholdScale * threshold;
    rule.spares_overexposed = settings.version >= kSparesOverexposed;
    rule.exposure = rule.spares_overexposed ? settings.film_exposure : 1.0f;
    return rule;
}

bool is_check(const AdaptiveRule& rule, int samples_done) {
    return samples_done > rule.min_samples + 1 && samples_done % kAdaptiveStep == 0;
}

float pixel_error(const AdaptiveRule& rule, const Film::HalfSums& sums) {
    if (sums.samples <= 0) return 0.0f;
    const float scale = rule.exposure / float(sums.samples);
    float difference = 0.0f, intensity = 0.0f;
    for (int c = 0; c < 3; ++c) {
        difference += std::fabs(sums.all[c] - 2.0f * sums.second[c]) * scale;
        intensity += sums.all[c] * scale;
    }
    intensity = std::fabs(intensity);  // negative light is noisy too
    const float norm = rule.spares_overexposed && intensity >= 1.0f ? intensity : std::sqrt(intensity);
    const float error = difference / (kNormBias + norm);
    return std::isfinite(error) ? error : 0.0f;
}

AdaptiveCheck find_noisy(const Film& film, const AdaptiveRule& rule, std::span<const PackedPixel> sampled, std::span<const PackedPixel> all, int most) {
    const int width = film.width(), height = film.height();
    AdaptiveCheck check;
    std::vector<uint8_t> goes_on(size_t(width) * size_t(height), 0);
    const auto place = [&](int x, int y) -> uint8_t& { return goes_on[size_t(y) * size_t(width) + size_t(x)]; };
    for (const PackedPixel pixel : sampled) {
        const Film::HalfSums sums = film.half_sums(pixel);
        const float error = pixel_error(rule, sums);
        if (error < rule.threshold || sums.samples >= most) continue;
        const int px = pixel_x(pixel), py = pixel_y(pixel);
        for (int y = std::max(py - 1, 0); y <= std::min(py + 1, height - 1); ++y)
            for (int x = std::max(px - 1, 0); x <= std::min(px + 1, width - 1); ++x) place(x, y) = 1;
        const double ratio = double(error) / double(rule.threshold);
        check.expected_samples += std::min(double(sums.samples) * (ratio * ratio - 1.0), double(most - sums.samples));
    }
    for (const PackedPixel pixel : all)
        if (place(pixel_x(pixel), pixel_y(pixel))) check.pixels.push_back(pixel);
    // Quiet neighbours leave with what they surround.
    check.expected_samples = std::max(check.expected_samples, double(check.pixels.size()) * kAdaptiveStep);
    return check;
}

}  // namespace talbot::film
