#include <gtest/gtest.h>

#include <set>

#include "scene/islands.h"

namespace talbot::scene {
namespace {

TEST(Islands, OneNumberForEachConnectedPart) {
    // A square, a triangle, a vertex on its own; edges to nowhere join nothing.
    const uint32_t edges[] = {0, 1, 2, 3, 1, 2, 3, 0, 4, 5, 6, 4, 0, 100, 7, 4000000000u};
    const std::vector<float> values = random_per_island(8, edges);
    ASSERT_EQ(values.size(), 8u);
    for (size_t v : {1, 2, 3}) EXPECT_EQ(values[v], values[0]);
    for (size_t v : {5, 6}) EXPECT_EQ(values[v], values[4]);
    EXPECT_EQ(std::set<float>(values.begin(), values.end()).size(), 3u);
    for (float x : values) EXPECT_TRUE(x >= 0 && x <= 1);
}

TEST(Islands, WhoStandsForAnIslandFollowsTheOrderOfEdges) {
    // Equal ranks: the first vertex of the edge stands; a lone vertex joins the higher rank.
    const uint32_t first[] = {1, 0}, grown[] = {0, 1, 2, 0};
    const std::vector<float> alone = random_per_island(3, {});
    EXPECT_EQ(random_per_island(3, first)[0], alone[1]);
    EXPECT_EQ(random_per_island(3, grown)[2], alone[0]);
}

}  // namespace
}  // namespace talbot::scene
