// Adaptive sampling in whole renders.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "film/adaptive.h"
#include "session/state.h"
#include "support/scenes.h"

namespace talbot {
namespace {

using scene::PassKind;

struct Picture {
    std::vector<float> combined, share;  ///< share: samples of each pixel over those of the pixel that took most
    Statistics statistics;
    Progress progress;
    int samples(size_t pixel) const { return int(std::lround(share[pixel] * float(progress.samples_done))); }
};

Picture render(scene::Scene scene) {
    scene.passes = {PassKind::Combined, PassKind::SampleCount};
    Session session;
    session.edit() = std::move(scene);
    session.start();
    while (!session.wait(1000)) {
    }
    EXPECT_EQ(session.progress().state, SessionState::Done) << session.error();
    Picture picture;
    EXPECT_TRUE(session.read_pass(PassKind::Combined, picture.combined));
    EXPECT_TRUE(session.read_pass(PassKind::SampleCount, picture.share));
    picture.statistics = session.statistics();
    picture.progress = session.progress();
    return picture;
}

/// A box with lamps; the lower half of the picture is a glowing plane without noise.
scene::Scene half_noisy(int samples, float threshold) {
    scene::Scene scene = tests::box_with_lamp();
    scene.settings.samples = samples;
    scene.settings.adaptive = true;
    scene.settings.adaptive_threshold = threshold;
    const scene::Handle glow = tests::add_shader(scene, tests::one_node("Emission", {0.5f, 0.5f, 0.5f}));
    tests::add_object(scene, tests::add_quads(scene, {{-1, -1, -0.5f}, {1, -1, -0.5f}, {1, 0, -0.5f}, {-1, 0, -0.5f}}), glow);
    return scene;
}

double mean_of(const std::vector<float>& rgba) {
    double sum = 0;
    for (size_t i = 0; i < rgba.size(); i += 4) sum += double(rgba[i]) + rgba[i + 1] + rgba[i + 2];
    return sum / (double(rgba.size()) / 4 * 3);
}

TEST(Adaptive, FlatRegionsStopAtTheFirstCheckAndNoisyOnesGoOn) {
    scene::Scene scene = half_noisy(512, 0.005f);
    scene::Settings& settings = scene.settings;
    settings.adaptive_min_samples = 40;
    const Picture picture = render(scene);
    const int first = 48;  // the first check
    double upper = 0;
    for (size_t i = 0; i < picture.share.size(); ++i) {
        const int y = int(i) / settings.width;
        EXPECT_GE(picture.samples(i), first);
        if (y < settings.height / 2 - 2) {
            EXPECT_EQ(picture.samples(i), first) << i;
        }
        if (y >= settings.height / 2) upper += picture.samples(i);
    }
    EXPECT_GT(upper / double(settings.width * settings.height / 2), 1.5 * first);
    double sum = 0;
    for (float share : picture.share) sum += double(share) * picture.progress.samples_done;
    EXPECT_NEAR(sum, double(picture.statistics.paths), 1);
    EXPECT_EQ(picture.progress.fraction, 1);
}

TEST(Adaptive, SameBitsForAnyNumberOfThreads) {
    scene::Scene scene = half_noisy(256, 0.005f);
    scene.settings.adaptive_min_samples = 20;
    scene.settings.threads = 1;
    const Picture one = render(scene);
    for (int threads : {2, 3}) {
        scene.settings.threads = threads;
        const Picture other = render(scene);
        EXPECT_EQ(one.combined, other.combined);
        EXPECT_EQ(one.share, other.share);
    }
}

// Which pixels a worker renders together changes nothing but the order in which a pixel's light is summed.
TEST(Adaptive, AnyListsOfPixelsGiveTheSameSums) {
    Session::State s;
    s.scene = half_noisy(32, 0.02f);
    s.scene.dirty = scene::kDirtyAll;
    update_render_data(s);
    const integrator::RenderContext context = make_context(s, s.film->layout());
    const integrator::KernelTable& kernels = integrator::kernels_for(s.statistics.instruction_set);
    const auto render_lists = [&](std::vector<film::PackedPixel> all, size_t size) {
        film::Film film(s.film->layout(), s.width, s.height, true);
        film::TileFilm tile;
        for (size_t first = 0; first < all.size(); first += size) {
            const std::span pixels = std::span(all).subspan(first, std::min(size, all.size() - first));
            integrator::RenderUnit unit{pixels.data(), int(pixels.size()), 0, 16};
            unit.halves = true;
            tile.reset(film.layout(), unit.pixel_count, 2);
            EXPECT_TRUE(kernels.render_unit(context, unit, *s.data.workers[0], tile));
            film.merge(tile, pixels, 16);
        }
        std::vector<float> sums;
        for (film::PackedPixel p : film::list_pixels(s.width, s.height, 64)) {
            const film::Film::HalfSums h = film.half_sums(p);
            sums.insert(sums.end(), h.all, h.all + 3);
            sums.insert(sums.end(), h.second, h.second + 3);
        }
        return sums;
    };
    std::vector<film::PackedPixel> all = film::list_pixels(s.width, s.height, 64);
    const std::vector<float> whole = render_lists(all, all.size());
    EXPECT_GT(whole[0], 0);
    const std::vector<film::PackedPixel> small = film::list_pixels(s.width, s.height, 8);
    std::reverse(all.begin(), all.end());
    for (const std::vector<float>& other : {render_lists(small, 64), render_lists(small, 7), render_lists(all, 1000)}) {
        ASSERT_EQ(other.size(), whole.size());
        for (size_t i = 0; i < whole.size(); ++i) EXPECT_NEAR(other[i], whole[i], 1e-5f * (1 + std::fabs(whole[i]))) << i;
    }
}

TEST(Adaptive, MinSamplesAreTaken) {
    scene::Scene scene = half_noisy(256, 0.5f);
    scene.settings.adaptive_min_samples = 100;
    const Picture picture = render(scene);
    for (size_t i = 0; i < picture.share.size(); ++i) EXPECT_EQ(picture.samples(i), 112);
}

TEST(Adaptive, MoreMinSamplesThanSamplesTakesAll) {
    scene::Scene scene = half_noisy(40, 0.5f);
    scene.settings.adaptive_min_samples = 1000;
    const Picture picture = render(scene);
    EXPECT_EQ(picture.progress.samples_done, 40);
    for (float share : picture.share) EXPECT_EQ(share, 1);
}

TEST(Adaptive, ThresholdZeroIsAutomatic) {
    scene::Scene scene = half_noisy(128, 0.0f);
    const Picture automatic = render(scene);
    scene.settings.adaptive_threshold = 1.0f / 128;
    EXPECT_EQ(automatic.combined, render(scene).combined);
    EXPECT_LT(*std::min_element(automatic.share.begin(), automatic.share.end()), 0.8f);
}

TEST(Adaptive, OnePixelAndBlackPictures) {
    scene::Scene scene = half_noisy(4096, 0.1f);
    scene.settings.width = scene.settings.height = 1;
    EXPECT_LT(render(scene).progress.samples_done, 2048);

    scene::Scene black;
    tests::plain_settings(black, 20, 10, 4096);
    black.settings.adaptive = true;
    black.settings.adaptive_threshold = 0.1f;
    const Picture picture = render(black);
    EXPECT_EQ(picture.combined, render(black).combined);
    EXPECT_EQ(mean_of(picture.combined), 0);
    for (size_t i = 0; i < picture.share.size(); ++i) EXPECT_EQ(picture.samples(i), 48);
}

// A pixel whose sum has overflowed is not finite ever again.
TEST(Adaptive, OverflowStops) {
    scene::Scene scene;
    tests::plain_settings(scene, 8, 8, 4096);
    scene.settings.adaptive = true;
    scene.settings.adaptive_threshold = 0.1f;
    const scene::Handle glow = tests::add_shader(scene, tests::one_node("Emission", {3e38f, 1, 1}));
    tests::add_object(scene, tests::add_quads(scene, tests::cube(1)), glow);
    EXPECT_EQ(render(scene).progress.samples_done, 48);
}

// Stopping when two halves agree favours pixels that missed rare light: with the least samples of the rule that is below half a percent here.
TEST(Adaptive, MeanStaysTheSame) {
    scene::Scene scene = half_noisy(512, 0.01f);
    const Picture some = render(scene);
    scene.settings.adaptive = false;
    const Picture full = render(scene);
    EXPECT_LT(some.statistics.paths, full.statistics.paths / 2);
    EXPECT_NEAR(mean_of(some.combined) / mean_of(full.combined), 1, 0.005);
}

// Passes that are means of data are the same in pixels that stopped early and late.
TEST(Adaptive, PassesAreDividedByTheirOwnSamples) {
    scene::Scene scene = tests::box_with_lamp();
    scene.settings.samples = 256;
    scene.settings.adaptive = true;
    scene.settings.adaptive_threshold = 0.005f;
    scene.settings.adaptive_min_samples = 40;
    scene.passes = {PassKind::DiffuseColor, PassKind::SampleCount};
    Session session;
    session.edit() = scene;
    session.start();
    while (!session.wait(1000)) {
    }
    std::vector<float> color, share;
    ASSERT_TRUE(session.read_pass(PassKind::DiffuseColor, color));
    ASSERT_TRUE(session.read_pass(PassKind::SampleCount, share));
    EXPECT_LT(*std::min_element(share.begin(), share.end()), *std::max_element(share.begin(), share.end()));
    for (size_t i = 0; i < share.size(); ++i) {
        const size_t x = i % size_t(scene.settings.width), y = i / size_t(scene.settings.width);
        if (x < 16 && y < 20) continue;  // the glowing square
        EXPECT_NEAR(color[3 * i], 0.6f, 1e-4f) << i;
    }
}

TEST(Adaptive, ProgressGrowsAndTimeLimitHolds) {
    scene::Scene scene = half_noisy(1 << 20, 0.0001f);
    scene.settings.adaptive_min_samples = 4;
    scene.settings.time_limit = 2.0f;  // long enough for a guess also under a sanitizer on a busy machine
    Session session;
    session.edit() = scene;
    session.start();
    float before = 0;
    bool knew = false;
    while (!session.wait(10)) {
        const Progress p = session.progress();
        EXPECT_GE(p.fraction, before);
        before = p.fraction;
        knew = knew || p.remaining > 0;
    }
    EXPECT_EQ(session.progress().state, SessionState::Done);
    EXPECT_TRUE(knew);
    EXPECT_LT(session.progress().samples_done, 1 << 20);
}

}  // namespace
}  // namespace talbot
