// Which pixels go on: the halves of the samples, the error, the rule and the neighbourhood.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>

#include "base/sobol.h"
#include "film/adaptive.h"

using namespace talbot;
using namespace talbot::film;

namespace {

const float kInf = std::numeric_limits<float>::infinity();
const float kNan = std::numeric_limits<float>::quiet_NaN();

scene::Settings adaptive(float threshold, int min_samples, int samples, scene::BlenderVersion version = 500) {
    scene::Settings settings;
    settings.adaptive = true;
    settings.adaptive_threshold = threshold;
    settings.adaptive_min_samples = min_samples;
    settings.samples = samples;
    settings.version = version;
    return settings;
}

/// 16 samples in every pixel, half of them in each half: radiance 1, in noisy pixels 1.5 in the second half.
std::unique_ptr<Film> film_with_noise(int width, int height, const std::vector<PackedPixel>& noisy) {
    const scene::PassKind wanted[] = {scene::PassKind::Combined};
    auto film = std::make_unique<Film>(make_layout(wanted), width, height, true);
    const std::vector<PackedPixel> all = list_pixels(width, height, 8);
    TileFilm tile;
    tile.reset(film->layout(), int(all.size()), 2);
    for (size_t i = 0; i < all.size(); ++i) {
        const bool is_noisy = std::find(noisy.begin(), noisy.end(), all[i]) != noisy.end();
        for (int c = 0; c < 3; ++c) {
            tile.pixels()[i * 4 + size_t(c)] = 8;
            tile.pixels()[(all.size() + i) * 4 + size_t(c)] = is_noisy ? 12.0f : 8.0f;
        }
    }
    film->merge(tile, all, 16);
    return film;
}

TEST(Adaptive, HalvesAreEquallyLargeInEveryFour) {
    for (uint32_t n = 0; n < 4096; n += 4) EXPECT_EQ(sample_half(n) + sample_half(n + 1) + sample_half(n + 2) + sample_half(n + 3), 2) << n;
    EXPECT_EQ(sample_half(0), 0);
}

// Were a half a strip of the square, the difference would not fall at all; were it random, as 1 / n.
TEST(Adaptive, HalvesOfSobolPointsAreEvenlySpread) {
    const auto squared_difference = [](uint32_t n) {
        double sum = 0;
        for (uint32_t key = 0; key < 200; ++key) {
            double all = 0, second = 0;
            for (uint32_t i = 0; i < n; ++i) {
                const Vec2 u = sample_pair(hash_u32(key), i, 3);
                const double f = double(u.x) * u.x + 0.5 * double(u.y);
                all += f;
                second += sample_half(i) ? f : 0;
            }
            sum += (all - 2 * second) * (all - 2 * second) / (double(n) * n);
        }
        return sum / 200;
    };
    EXPECT_LT(squared_difference(1024), squared_difference(64) / 16);
}

TEST(Adaptive, AutomaticSettings) {
    EXPECT_EQ(make_adaptive_rule(adaptive(0.1f, 0, 4096)).min_samples, 32);
    EXPECT_EQ(make_adaptive_rule(adaptive(0.01f, 0, 4096)).min_samples, 64);
    EXPECT_EQ(make_adaptive_rule(adaptive(0.001f, 0, 4096)).min_samples, 128);
    EXPECT_EQ(make_adaptive_rule(adaptive(0.01f, 2, 4096)).min_samples, 4);
    EXPECT_EQ(make_adaptive_rule(adaptive(0.01f, 200, 4096)).min_samples, 200);
    EXPECT_FLOAT_EQ(make_adaptive_rule(adaptive(0.01f, 0, 4096)).threshold, 0.05f);
    EXPECT_FLOAT_EQ(make_adaptive_rule(adaptive(0.0f, 0, 4096)).threshold, 0.005f);
    EXPECT_FLOAT_EQ(make_adaptive_rule(adaptive(0.0f, 0, 50)).threshold, 0.1f);
    EXPECT_EQ(make_adaptive_rule(adaptive(0.0f, 0, 50)).min_samples, 52);
}

TEST(Adaptive, ChecksEverySixteenSamplesAfterTheFirst) {
    AdaptiveRule rule;
    rule.min_samples = 64;
    for (int done = 1; done < 200; ++done) EXPECT_EQ(is_check(rule, done), done == 80 || done == 96 || (done > 96 && done % 16 == 0)) << done;
    rule.min_samples = 30;
    EXPECT_TRUE(is_check(rule, 32));
    rule.min_samples = 31;
    EXPECT_FALSE(is_check(rule, 32));
}

TEST(Adaptive, ErrorOfAPixel) {
    scene::Settings settings = adaptive(0.01f, 0, 128);
    settings.film_exposure = 2;
    const AdaptiveRule rule = make_adaptive_rule(settings);
    settings.version = 304;
    const AdaptiveRule old = make_adaptive_rule(settings);
    // Dim: mean 0.09 in all; the second half has 0.01 more in red. Exposed twice: difference 0.02, sum 0.18.
    const Film::HalfSums dim{{3, 3, 3}, {1.6f, 1.5f, 1.5f}, 100};
    EXPECT_NEAR(pixel_error(rule, dim), 2 * 0.002f / (1e-4f + std::sqrt(0.18f)), 1e-6f);
    EXPECT_NEAR(pixel_error(old, dim), 0.002f / (1e-4f + std::sqrt(0.09f)), 1e-6f);
    const Film::HalfSums bright{{300, 300, 300}, {160, 150, 140}, 100};
    EXPECT_NEAR(pixel_error(rule, bright), 2 * 0.4f / (1e-4f + 18.0f), 1e-5f);
    EXPECT_NEAR(pixel_error(old, bright), 0.4f / (1e-4f + 3.0f), 1e-5f);
    EXPECT_EQ(pixel_error(rule, {{0, 0, 0}, {0, 0, 0}, 100}), 0);
    EXPECT_EQ(pixel_error(rule, {{5, 5, 5}, {5, 5, 5}, 0}), 0);
    EXPECT_GT(pixel_error(rule, {{-3, -3, -3}, {-1, -1, -1}, 100}), 0.05f);
    for (float bad : {kInf, kNan}) EXPECT_EQ(pixel_error(rule, {{bad, 1, 1}, {1, 1, 1}, 100}), 0);
}

TEST(Adaptive, NoisyPixelsBringTheirNeighbours) {
    const AdaptiveRule rule = make_adaptive_rule(adaptive(0.01f, 0, 4096));
    const std::vector<PackedPixel> all = list_pixels(9, 5, 8);
    const auto film = film_with_noise(9, 5, {pack_pixel(3, 2), pack_pixel(8, 0)});
    const AdaptiveCheck check = find_noisy(*film, rule, all, all, 4096);
    std::vector<PackedPixel> expected;
    for (PackedPixel p : all) {
        const int x = pixel_x(p), y = pixel_y(p);
        if ((std::abs(x - 3) <= 1 && std::abs(y - 2) <= 1) || (x >= 7 && y <= 1)) expected.push_back(p);
    }
    EXPECT_EQ(check.pixels, expected);
    EXPECT_GT(check.expected_samples, 2 * 16);

    // Pixels that had stopped are not judged, but they come back beside a noisy one.
    const std::vector<PackedPixel> corner{pack_pixel(8, 0)};
    EXPECT_EQ(find_noisy(*film, rule, corner, all, 4096).pixels.size(), 4u);
    EXPECT_TRUE(find_noisy(*film, rule, std::vector<PackedPixel>{pack_pixel(0, 0)}, all, 4096).pixels.empty());
    // A pixel with all its samples keeps nobody waiting.
    EXPECT_TRUE(find_noisy(*film, rule, all, all, 16).pixels.empty());
}

TEST(Adaptive, ExpectedSamplesFollowTheSquareOfTheError) {
    AdaptiveRule rule = make_adaptive_rule(adaptive(0.01f, 0, 4096));
    const auto film = film_with_noise(1, 1, {pack_pixel(0, 0)});
    const std::vector<PackedPixel> all = list_pixels(1, 1, 8);
    rule.threshold = 0.25f * pixel_error(rule, film->half_sums(all[0]));
    EXPECT_NEAR(find_noisy(*film, rule, all, all, 4096).expected_samples, 16 * 15, 0.01);
    EXPECT_NEAR(find_noisy(*film, rule, all, all, 100).expected_samples, 100 - 16, 0.01);
}

}  // namespace
