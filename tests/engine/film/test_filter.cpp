#include <gtest/gtest.h>

#include <cmath>

#include "base/sobol.h"
#include "film/film.h"

using namespace talbot;
using scene::PixelFilter;

namespace {

// The filters as Blender defines them, at x pixels from the centre.
double weight(PixelFilter filter, double width, double x) {
    switch (filter) {
        case PixelFilter::Box:
            return std::abs(x) <= 0.5 ? 1 : 0;
        case PixelFilter::Gaussian: {
            const double v = 6 * x / (3 * width);
            return std::abs(x) <= 1.5 * width ? std::exp(-2 * v * v) : 0;
        }
        default: {
            const double t = 2 * M_PI * (x / (2 * width) + 0.5);
            return std::abs(x) <= width ? 0.35875 - 0.48829 * std::cos(t) + 0.14128 * std::cos(2 * t) - 0.01168 * std::cos(3 * t) : 0;
        }
    }
}

double half_support(PixelFilter filter, double width) {
    return filter == PixelFilter::Box ? 0.5 : filter == PixelFilter::Gaussian ? 1.5 * width : width;
}

double integral(PixelFilter filter, double width, double a, double b, int power) {
    double sum = 0;
    constexpr int kSteps = 20000;
    for (int i = 0; i < kSteps; ++i) {
        const double x = a + (b - a) * (i + 0.5) / kSteps;
        sum += weight(filter, width, x) * std::pow(x, power);
    }
    return sum * (b - a) / kSteps;
}

class Filters : public testing::TestWithParam<std::tuple<PixelFilter, float>> {};

}  // namespace

TEST_P(Filters, EntriesAreInverseDistribution) {
    const auto [filter, width] = GetParam();
    const auto table = film::make_filter_table(filter, width);
    ASSERT_EQ(table.size(), 1024u);
    const double reach = half_support(filter, width), total = integral(filter, width, -reach, reach, 0);
    double second = 0, fourth = 0;
    for (size_t k = 0; k < table.size(); ++k) {
        EXPECT_EQ(table[k], -table[1023 - k]);
        EXPECT_TRUE(k == 0 || table[k] > table[k - 1]);
        second += std::pow(table[k], 2) / 1024;
        fourth += std::pow(table[k], 4) / 1024;
    }
    for (size_t k = 0; k < table.size(); k += 31) EXPECT_NEAR(integral(filter, width, -reach, table[k], 0) / total, (double(k) + 0.5) / 1024, 2e-4) << k;
    EXPECT_NEAR(second / (integral(filter, width, -reach, reach, 2) / total), 1, 2e-3);
    // The last entry stands for a whole thousandth of tail, whose far end it leaves out.
    EXPECT_NEAR(fourth / (integral(filter, width, -reach, reach, 4) / total), 1, 2e-2);
}

TEST_P(Filters, ChiSquared) {
    const auto [filter, width] = GetParam();
    const auto table = film::make_filter_table(filter, width);
    constexpr int kBins = 16, kSamples = 20000;
    const double reach = half_support(filter, width);
    double counts[kBins] = {};
    for (uint32_t i = 0; i < kSamples; ++i) {
        const float x = table[size_t(unit_float(hash_u32(i * 2 + 1)) * 1024)];
        counts[std::min(kBins - 1, int((x + reach) / (2 * reach) * kBins))] += 1;
    }
    double chi2 = 0, total = integral(filter, width, -reach, reach, 0);
    int used = 0;
    for (int b = 0; b < kBins; ++b) {
        const double expected = kSamples * integral(filter, width, -reach + 2 * reach * b / kBins, -reach + 2 * reach * (b + 1) / kBins, 0) / total;
        // A table of 1024 has no entry for bins rarer than that; their counts are compared in the moments above.
        if (expected < kSamples / 256.0) continue;
        chi2 += (counts[b] - expected) * (counts[b] - expected) / expected;
        ++used;
    }
    // Quantising u moves a bin's edge by up to half an entry, 10 samples of 20000: allow that beside the 1e-4 quantile (44 for 15 degrees).
    EXPECT_LT(chi2, 44) << used;
    EXPECT_GE(used, 4);
}

INSTANTIATE_TEST_SUITE_P(All, Filters,
                         testing::Combine(testing::Values(PixelFilter::Box, PixelFilter::Gaussian, PixelFilter::BlackmanHarris), testing::Values(1.5f, 0.6f)));

TEST(Filter, BoxIgnoresWidth) {
    EXPECT_EQ(film::make_filter_table(PixelFilter::Box, 1), film::make_filter_table(PixelFilter::Box, 7));
    EXPECT_NEAR(film::make_filter_table(PixelFilter::Box, 3).back(), 0.5f, 1e-3f);
}

TEST(Filter, ZeroWidthIsAPoint) {
    for (float x : film::make_filter_table(PixelFilter::BlackmanHarris, 0)) EXPECT_EQ(x, 0);
}
