/// Adaptive sampling: which pixels go on after a number of samples. The rules are Cycles', so that a file's noise threshold means here what it means there.
///
/// The samples of a pixel fall into two halves (`sample_half`); how far the halves' means lie apart says how noisy the
/// whole is [Dammertz, Hanika, Keller, Lensch 2010, "A Hierarchical Automatic Stopping Condition for Monte Carlo Global
/// Illumination", section 2.1]:
///     error = exposure * sum over r, g, b of |mean(all) - mean(second half)| / (0.0001 + norm)
///     norm  = sqrt(i) where the exposed sum i = r + g + b is below 1, else i   (before 3.5: sqrt(i) everywhere and no exposure)
/// A pixel is noisy while its error is at least 5 thresholds. Noisy pixels and their eight neighbours go on, others stop;
/// a stopped pixel beside one that is found noisy later goes on again. Checked every 16 samples after the first min_samples + 1.
/// Decisions depend on sums alone, which do not depend on the number of threads, and neither do they.
#pragma once

#include <span>
#include <vector>

#include "film/film.h"

namespace talbot::film {

struct AdaptiveRule {
    float threshold = 0;  ///< of the error above
    int min_samples = 0;
    float exposure = 1;
    bool spares_overexposed = true;  ///< norm grows faster above 1
};
/// Settings of 0 are automatic: the threshold is 1 / samples, at least 0.001; min_samples 16 / threshold^0.3, at least 4.
AdaptiveRule make_adaptive_rule(const scene::Settings& settings);

inline constexpr int kAdaptiveStep = 16;
/// Whether to look for noisy pixels after this many samples.
bool is_check(const AdaptiveRule& rule, int samples_done);

/// 0 where nothing was sampled or the sums have overflowed: more samples would not help.
float pixel_error(const AdaptiveRule& rule, const Film::HalfSums& sums);

struct AdaptiveCheck {
    std::vector<PackedPixel> pixels;  ///< that go on, in the order of `all`
    double expected_samples = 0;      ///< that these will take, guessed from their error, which falls as 1 / sqrt(samples)
};
/// `sampled`: the pixels of the last samples, a part of `all`. `most`: samples of a pixel, at most.
AdaptiveCheck find_noisy(const Film& film, const AdaptiveRule& rule, std::span<const PackedPixel> sampled, std::span<const PackedPixel> all, int most);

}  // namespace talbot::film
