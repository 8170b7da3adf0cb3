/// Light trees: probabilities that sum to one and match the choices, nothing that shines left out, and less variance than a choice by power.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "light/fixture.h"
#include "light/kernels/descend_tree.h"

namespace talbot::light::test {
namespace {

using scene::LightType;

Vec3 random_point(std::mt19937& engine, float size) {
    const float x = unit_float(engine()), y = unit_float(engine()), z = unit_float(engine());
    return Vec3{2 * x - 1, 2 * y - 1, 2 * z - 1} * size;
}

std::vector<TreeItem> random_items(std::mt19937& engine, int count) {
    std::vector<TreeItem> items;
    for (int i = 0; i < count; ++i) {
        TreeItem item;
        item.center = random_point(engine, 10);
        item.radius = i % 3 ? 0.1f * unit_float(engine()) : 0;
        item.axis = normalize(random_point(engine, 1));
        item.strength = std::exp(6 * unit_float(engine()));
        item.cos_normals = i % 4 == 0 ? -1.0f : i % 4 == 1 ? 1.0f : unit_float(engine());
        item.cos_limit = i % 5 == 0 ? 0.8f : 0.0f;
        item.two_sided = i % 7 == 0;
        item.receivers = i % 6 == 0 ? 0b10 : i % 6 == 1 ? 0b01 : ~uint64_t(0);
        items.push_back(item);
    }
    return items;
}

/// In exact terms: is p within `limit` of some normal of the item's cone?
bool may_light(const TreeItem& item, Vec3 p) {
    const Vec3 d = normalize(p - item.center);
    const double c = double(dot(d, item.axis)), theta = std::acos(std::clamp(item.two_sided ? std::abs(c) : c, -1.0, 1.0));
    return theta - std::acos(double(item.cos_normals)) < std::acos(double(item.cos_limit)) - 1e-3;
}

TEST(Tree, ProbabilitiesAreThoseOfTheChoices) {
    std::mt19937 engine(5);
    for (int count : {1, 2, 3, 10, 300}) {
        EmitterTable table;
        std::vector<int32_t> leaves;
        const std::vector<TreeItem> items = random_items(engine, count);
        const int32_t root = add_tree(items, table, leaves);
        EXPECT_EQ(table.nodes.size(), size_t(2 * count - 1));
        for (TreeSpace space : {TreeSpace::KeepsAngles, TreeSpace::Bent, TreeSpace::Flat}) {
            for (int32_t receiver : {-1, 0, 1}) {
                const TreeQuery query{random_point(engine, 12), receiver, space};
                std::vector<double> expected, observed(items.size(), 0);
                double sum = 0;
                for (size_t i = 0; i < items.size(); ++i) {
                    expected.push_back(double(leaf_probability(table.nodes.data(), leaves[i], query)));
                    sum += expected[i];
                    const bool lit = is_lit(items[i].receivers, receiver);
                    if (!lit) {
                        EXPECT_EQ(expected[i], 0);
                    }
                    if (lit && space != TreeSpace::KeepsAngles) {
                        EXPECT_GT(expected[i], 0);
                    }
                }
                constexpr int kSamples = 20000;
                int none = 0;
                for (int k = 0; k < kSamples; ++k) {
                    float probability = 0;
                    const int32_t leaf = descend_tree(table.nodes.data(), root, query, (float(k) + 0.5f) / kSamples, probability);
                    if (leaf < 0) {
                        ++none;
                        continue;
                    }
                    const size_t item = size_t(table.nodes[size_t(leaf)].item);
                    EXPECT_NEAR(double(probability), expected[item], 1e-4 * expected[item]);
                    observed[item] += 1.0 / kSamples;
                }
                // What is not chosen is where a node promises more than its children keep.
                EXPECT_NEAR(sum + double(none) / kSamples, 1, 2e-3) << count << " " << receiver;
                for (size_t i = 0; i < items.size(); ++i) EXPECT_NEAR(observed[i], expected[i], 3.0 / kSamples + 1e-3 * expected[i]);
            }
        }
    }
}

TEST(Tree, NothingThatShinesIsLeftOut) {
    std::mt19937 engine(9);
    EmitterTable table;
    std::vector<int32_t> leaves;
    const std::vector<TreeItem> items = random_items(engine, 500);
    add_tree(items, table, leaves);
    int shining = 0, dark = 0;
    for (int k = 0; k < 200; ++k) {
        const Vec3 p = random_point(engine, 15);
        for (size_t i = 0; i < items.size(); ++i) {
            const float probability = leaf_probability(table.nodes.data(), leaves[i], {p});
            if (may_light(items[i], p)) {
                ++shining;
                EXPECT_GT(probability, 0.0f) << i;
            }
            dark += probability == 0;
        }
    }
    EXPECT_GT(shining, 10000);
    EXPECT_GT(dark, 10000) << "the cones cull nothing";
}

/// Lamps in one place, in a row, and without end: any list has a tree.
TEST(Tree, DegenerateLists) {
    for (int kind = 0; kind < 3; ++kind) {
        EmitterTable table;
        std::vector<int32_t> leaves;
        std::vector<TreeItem> items(1000);
        for (size_t i = 0; i < items.size(); ++i) {
            items[i].strength = kind == 2 ? std::pow(10.0f, float(i % 50) - 25) : 1.0f;
            items[i].center = kind == 1 ? Vec3{float(i), 0, 0} : Vec3{};
        }
        add_tree(items, table, leaves);
        double sum = 0;
        for (int32_t leaf : leaves) sum += double(leaf_probability(table.nodes.data(), leaf, {{1, 2, 3}}));
        EXPECT_NEAR(sum, 1, 1e-3) << kind;
    }
}

/// A hall of 1,000 lamps on the ceiling: the sum in closed form, and the variance of one sample beside that of a choice by power.
TEST(Tree, AHallOfLamps) {
    Fixture f;
    std::mt19937 engine(3);
    for (int i = 0; i < 1000; ++i)
        f.add_light(LightType::Point, 5 + 10 * unit_float(engine()), {float(i % 40) - 20 + 0.3f * unit_float(engine()), float(i / 40) - 12, 3});
    f.build();
    for (const Vec3 p : {Vec3{0, 0, 0}, Vec3{15, -8, 1}, Vec3{-19, 11, 2.5f}}) {
        double exact = 0, power = 0, by_power = 0;
        for (const Lamp& lamp : f.table->lamps) power += double(lamp.power.x);
        for (const Lamp& lamp : f.table->lamps) {
            const Vec3 to = lamp.center - p;
            const double d2 = double(dot(to, to)), part = double(lamp.power.x) * double(to.z) / (d2 * std::sqrt(d2));
            exact += part;
            by_power += part * part * power / double(lamp.power.x);
        }
        double sum = 0, squares = 0;
        constexpr int kSamples = 1 << 16;
        sample_many(
            f, Stratum::Local, p, kSamples,
            [&](const Samples& s, int n) {
                for (int i = 0; i < n; ++i) {
                    if (s.pdf[i] <= 0) continue;
                    const double value = double(s.r[i]) * double(s.wz[i]) / double(s.pdf[i]);
                    sum += value;
                    squares += value * value;
                }
            },
            1, true);
        const double mean = sum / kSamples, variance = squares / kSamples - mean * mean;
        EXPECT_NEAR(mean, exact, 5 * std::sqrt(variance / kSamples));
        EXPECT_LT(variance, 0.25 * (by_power - exact * exact));
    }
}

/// A ball of 10,000 emissive triangles, instanced, mirrored and squeezed: light samples and the rays that find the triangles agree on the density.
TEST(Tree, AMeshOfManyTriangles) {
    std::vector<Vec3> positions;
    std::vector<uint32_t> triangles;
    constexpr uint32_t kRings = 50, kSectors = 100;
    for (uint32_t r = 0; r <= kRings; ++r)
        for (uint32_t s = 0; s <= kSectors; ++s) {
            const float t = kPi * float(r) / kRings, a = kTwoPi * float(s % kSectors) / kSectors;
            positions.push_back({std::sin(t) * std::cos(a), std::sin(t) * std::sin(a), std::cos(t)});
        }
    for (uint32_t r = 0; r < kRings; ++r)
        for (uint32_t s = 0; s < kSectors; ++s) {
            const uint32_t a = r * (kSectors + 1) + s, b = a + kSectors + 1;
            triangles.insert(triangles.end(), {a, b, b + 1, a, b + 1, a + 1});
        }
    for (int kind = 0; kind < 3; ++kind) {
        Fixture f;
        const int glow = f.emission({3, 3, 3});
        f.programs.shaders[size_t(glow)].emission_back = false;
        Affine m;
        for (int i = 0; i < 3; ++i) m.m[i][i] = kind == 1 && i == 0 ? -1.0f : kind == 2 && i == 2 ? 0.3f : 1.0f;
        m.m[2][3] = 3;
        f.add_mesh(positions, triangles, glow, m);
        f.build();
        // A sphere of radius r in distance d: E = pi L (r / d)^2.
        const double light = irradiance(f, Stratum::Local, {}, {0, 0, 1}, 1 << 15);
        if (kind < 2) {
            EXPECT_NEAR(light / (M_PI * 3 / 9), 1, 0.01) << kind;
        }
        int compared = 0;
        sample_many(f, Stratum::Local, {0.2f, -0.4f, 0.1f}, 128, [&](const Samples& s, int n) {
            for (int i = 0; i < n; ++i) {
                if (s.pdf[i] <= 0) continue;
                const Met met = meet(f, {0.2f, -0.4f, 0.1f}, s.wi(i));
                if (std::abs(met.distance - double(s.distance[i])) > 1e-3) continue;  // behind another triangle
                ++compared;
                EXPECT_NEAR(met.pdf / double(s.pdf[i]), 1, 0.02) << kind;
            }
        });
        EXPECT_GT(compared, 60) << kind;
    }
}

}  // namespace
}  // namespace talbot::light::test
