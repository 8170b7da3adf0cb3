/// Light linking in the table: who is chosen, with what density, by receiver set.

#include <gtest/gtest.h>

#include "light/fixture.h"

namespace talbot::light::test {
namespace {

using scene::LightType;

TEST(Links, OneLampOfTwoIsChosenForSure) {
    Fixture f;
    f.add_light(LightType::Point, 10, {0, 0, 1}).linking.receivers = 0b01;
    f.add_light(LightType::Point, 50, {1, 0, 1}).linking.receivers = 0b10;
    f.build();
    ASSERT_TRUE(summarize(*f.table).has_links);
    for (int receiver : {0, 1, 2}) {
        int chosen = 0;
        sample_many(
            f, Stratum::Local, {}, 500,
            [&](const Samples& s, int n) {
                for (int i = 0; i < n; ++i) {
                    if (s.pdf[i] == 0) continue;
                    ++chosen;
                    EXPECT_FLOAT_EQ(s.pdf[i], 1);
                    EXPECT_FLOAT_EQ(s.distance[i], receiver == 0 ? 1.0f : std::sqrt(2.0f));
                }
            },
            1, true, 0, receiver);
        EXPECT_EQ(chosen, receiver < 2 ? 500 : 0) << receiver;
    }
}

TEST(Links, WorldAndSunsShareTheSamplesOfEachSet) {
    Fixture f;
    for (uint64_t mask : {1, 2, 3}) {
        f.add_light(LightType::Sun, float(mask), {}).linking.receivers = mask;
        f.scene.lights.back().sun_angle = 0.1f;
    }
    f.build();
    EXPECT_NEAR(irradiance(f, Stratum::Distant, {}, {0, 0, 1}, 1 << 14, 1, 0), 4, 0.03);
    EXPECT_NEAR(irradiance(f, Stratum::Distant, {}, {0, 0, 1}, 1 << 14, 1, 1), 5, 0.03);
    EXPECT_EQ(irradiance(f, Stratum::Distant, {}, {0, 0, 1}, 1 << 10, 1, 7), 0);
    // A ray that finds the discs: each counts for its receivers, with the density that samples have for them.
    for (int32_t receiver : {0, 1}) {
        float w[3] = {0, 0, 1}, rgb[3];
        const int32_t visible = scene::kVisibleDiffuse;
        const Sun &own = f.table->suns[size_t(receiver)], &both = f.table->suns[2];
        const float of_both = both.probability / (both.probability + own.probability) * 0.5f * kInvPi / both.one_minus_cos,
                    of_own = own.probability / (both.probability + own.probability) * 0.5f * kInvPi / own.one_minus_cos;
        for (float bsdf : {-1.0f, of_both}) {
            shade_suns(*f.table, {w, w + 1, w + 2}, &visible, &bsdf, 1, f.programs, f.context, f.scratch, {rgb, rgb + 1, rgb + 2}, {}, &receiver);
            const float weight = of_own / of_both;
            EXPECT_NEAR(rgb[0], bsdf < 0 ? both.power.x + own.power.x : 0.5f * both.power.x + own.power.x / (1 + weight * weight), 1e-3f * rgb[0]) << receiver;
        }
    }
}

/// Many lamps, of which a set sees some: the mean is that of those alone, and rays find them with the density of the samples.
TEST(Links, ManyLamps) {
    Fixture f, alone;
    for (int i = 0; i < 150; ++i) {
        const Vec3 at{float(i % 15) - 7, float(i / 15) - 5, 2};
        scene::Light& lamp = f.add_light(LightType::Point, 10, at);
        lamp.radius = 0.1f;
        lamp.soft_falloff = false;
        lamp.linking.receivers = i % 3 == 0 ? 0b10 : 0b01;
        if (i % 3 == 0) {
            alone.scene.lights.push_back(lamp);
            alone.scene.lights.back().linking = {};
        }
    }
    f.build();
    alone.build();
    const Vec3 p{0.3f, -0.2f, 0.5f}, up{0, 0, 1};
    const double expected = irradiance(alone, Stratum::Local, p, up, 1 << 17);
    EXPECT_NEAR(irradiance(f, Stratum::Local, p, up, 1 << 17, 1, 1) / expected, 1, 0.02);
    for (int32_t i : {0, 1, 50, 51}) {
        float o[3] = {p.x, p.y, p.z}, rgb[3], pdf = -1;
        const Vec3 to = f.table->lamps[size_t(i)].center - p, d = normalize(to);
        float w[3] = {d.x, d.y, d.z};
        const float t = length(to) - 0.1f;
        const int32_t receiver = 1;
        shade_lamps(*f.table, {o, o + 1, o + 2}, {w, w + 1, w + 2}, &i, &t, 1, f.programs, f.context, f.scratch, {rgb, rgb + 1, rgb + 2}, &pdf, {}, &receiver);
        EXPECT_EQ(rgb[0] > 0, i % 3 == 0) << i;
        EXPECT_EQ(pdf > 0, i % 3 == 0) << i;
    }
}

/// Paths do not meet a lamp with blockers of its own, but from the camera; the rays that look for it do.
TEST(Links, OwnBlockersNeedRaysOfTheirOwn) {
    Fixture f;
    f.add_light(LightType::Point, 10, {0, 0, 1}).radius = 0.2f;
    f.scene.lights[0].soft_falloff = false;
    f.scene.lights[0].linking.blockers = 40;
    f.add_light(LightType::Sun, 10, {0, 0, 1}).sun_angle = 0.2f;
    f.scene.lights[1].linking.blockers = 41;
    f.build();
    sample_many(f, Stratum::Local, {}, 64, [&](const Samples& s, int n) {
        for (int i = 0; i < n; ++i) {
            EXPECT_FALSE(s.is_delta[i]);
            EXPECT_EQ(scene::blocker_group(uint32_t(s.blockers[i])), 40);
        }
    });
    const EmitterSummary summary = summarize(*f.table);
    EXPECT_TRUE(summary.has_linked_lamps);
    EXPECT_EQ(summary.linked_suns, std::vector<int32_t>{0});
    EXPECT_EQ(scene::blocker_group(uint32_t(lamp_blockers(*f.table, 0))), 40);
    EXPECT_EQ(scene::blocker_group(uint32_t(sun_blockers(*f.table, 0))), 41);
    float o[3] = {}, d[3] = {0, 0, 1}, rgb[3];
    const float far = 1e9f, delta = -1;
    for (const int32_t visible : {int32_t(scene::kVisibleCamera), int32_t(scene::kVisibleGlossy)}) {
        const bool camera = visible == scene::kVisibleCamera;
        for (const bool linked : {false, true}) {
            int32_t lamp = 0;
            float t = 0;
            intersect_lamps(*f.table, {o, o + 1, o + 2}, {d, d + 1, d + 2}, &far, &visible, 1, &lamp, &t, nullptr,
                            linked ? light::Met::Linked : light::Met::ByPaths);
            EXPECT_EQ(lamp, camera == linked ? -1 : 0);
            shade_suns(*f.table, {d, d + 1, d + 2}, &visible, &delta, 1, f.programs, f.context, f.scratch, {rgb, rgb + 1, rgb + 2}, {}, nullptr,
                       linked ? light::Met::Linked : light::Met::ByPaths);
            EXPECT_EQ(rgb[0] > 0, camera != linked);
        }
    }
}

}  // namespace
}  // namespace talbot::light::test
