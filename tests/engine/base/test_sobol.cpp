#include <gtest/gtest.h>

#include <set>
#include <vector>

#include "base/sobol.h"

namespace talbot {
namespace {

/// The points of one pair must form a (0, m, 2)-net: every elementary interval of area 2^-m holds exactly one of 2^m points.
TEST(Sobol, PairsAreNets) {
    for (uint32_t seed : {0u, 7u, 12345u}) {
        for (uint32_t dimension : {0u, 3u, 17u}) {
            constexpr int m = 8;
            std::vector<Vec2> points;
            for (uint32_t i = 0; i < (1u << m); ++i) points.push_back(sample_pair(pixel_key(seed, 99), i, dimension));
            for (int split = 0; split <= m; ++split) {
                std::set<std::pair<int, int>> cells;
                for (Vec2 p : points) cells.insert({int(p.x * float(1 << split)), int(p.y * float(1 << (m - split)))});
                EXPECT_EQ(cells.size(), points.size()) << "split " << split;
            }
        }
    }
}

TEST(Sobol, DimensionsAndPixelsAreUncorrelated) {
    constexpr int n = 1 << 14;
    for (int other = 1; other < 6; ++other) {
        double sum = 0;
        for (uint32_t i = 0; i < n; ++i) {
            const Vec2 a = sample_pair(pixel_key(1, 5), i, 2);
            const Vec2 b = sample_pair(pixel_key(1, 5u + uint32_t(other & 1)), i, 2u + uint32_t(other));
            sum += (double(a.x) - 0.5) * (double(b.x) - 0.5);
        }
        EXPECT_LT(std::abs(sum / n * 12), 0.04) << other;
    }
}

TEST(Sobol, ValuesStayBelowOne) {
    EXPECT_LT(unit_float(0xffffffffu), 1.0f);
    EXPECT_EQ(unit_float(0), 0.0f);
}

}  // namespace
}  // namespace talbot
