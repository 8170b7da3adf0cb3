// A session as the viewport uses it: looked at all the time while it renders and denoises, edited and cancelled in the middle.
// What matters most here is that the thread sanitizer has nothing to say.
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <random>
#include <thread>

#include "base/cpu.h"
#include "session/session.h"
#include "support/scenes.h"

namespace talbot {
namespace {

using scene::PassKind;

const std::vector<std::string> kStub{TALBOT_OIDN_STUB_DIR};

scene::Scene watched_scene() {
    scene::Scene scene = tests::box_with_lamp();
    scene.passes = {PassKind::Combined, PassKind::Depth, PassKind::DenoisingAlbedo, PassKind::DenoisingNormal};
    scene.settings.width = 48;
    scene.settings.height = 40;
    scene.settings.samples = 32;
    return scene;
}

/// Everything a viewport reads; the number of floats of the picture.
size_t look(const Session& session) {
    const Progress progress = session.progress();
    EXPECT_GE(progress.fraction, 0);
    EXPECT_TRUE(session.error().empty()) << session.error();
    EXPECT_LE(session.statistics().render_seconds, 3600);
    std::vector<float> picture, depth, denoised;
    session.read_denoised(denoised);
    session.read_pass(PassKind::Depth, depth);
    return session.read_pass(PassKind::Combined, picture) ? picture.size() : 0;
}

TEST(Watched, EditedAndCancelledInTheMiddle) {
    std::mt19937 random(3);
    Session session;
    session.edit() = watched_scene();
    session.set_denoiser(&kStub);
    int cancelled = 0, done = 0;
    for (int round = 0; round < 24; ++round) {
        scene::Scene& scene = session.edit();
        scene.settings.viewport = round % 3 != 0;
        scene.settings.adaptive = round % 2 == 0;
        scene.settings.width = 40 + round;
        scene.dirty |= round % 4 == 0 ? scene::kDirtyAll : scene::kDirtySettings;
        session.start();
        // Every third round to its end; the others are stopped wherever they are after a while: building, rendering, denoising.
        const auto until = std::chrono::steady_clock::now() + std::chrono::milliseconds(round % 3 == 2 ? 600000 : int(random() % 120));
        while (!session.wait(1) && std::chrono::steady_clock::now() < until) look(session);
        session.cancel();
        session.stop();
        const SessionState state = session.progress().state;
        EXPECT_TRUE(state == SessionState::Done || state == SessionState::Cancelled) << int(state);
        ++(state == SessionState::Done ? done : cancelled);
        if (state == SessionState::Done) {
            EXPECT_EQ(look(session), size_t(session.width()) * size_t(session.height()) * 4);
        }
    }
    EXPECT_GE(done, 8);
    EXPECT_GE(cancelled, 4);
}

TEST(Watched, WhatIsNewIsNeverEmpty) {
    Session session;
    session.edit() = watched_scene();
    uint64_t seen = 0;
    for (int round = 0; round < 12; ++round) {
        session.edit().settings.viewport = true;
        session.edit().dirty = scene::kDirtyAll;
        session.start();
        int looks = 0;
        for (bool ended = false; !ended;) {
            ended = session.wait(1);
            const uint64_t version = session.progress().image_version;
            if (version == seen) continue;
            EXPECT_GT(version, seen);
            seen = version;
            std::vector<float> picture;
            ASSERT_TRUE(session.read_pass(PassKind::Combined, picture));
            EXPECT_GT(*std::max_element(picture.begin(), picture.end()), 0.0f) << "look " << looks;
            ++looks;
        }
        EXPECT_GE(looks, 1);
    }
}

TEST(Watched, DenoisedIsTheWholePicture) {
    Session session;
    session.edit() = watched_scene();
    session.set_denoiser(&kStub);
    session.start();
    while (!session.wait(1)) look(session);
    std::vector<float> picture, denoised;
    ASSERT_TRUE(session.read_pass(PassKind::Combined, picture));
    ASSERT_TRUE(session.read_denoised(denoised));
    ASSERT_EQ(denoised.size(), picture.size());
    for (size_t i = 0; i < picture.size(); ++i) EXPECT_EQ(denoised[i], i % 4 == 3 ? picture[i] : 2 * picture[i]);
}

TEST(Watched, CancelEndsTheDenoising) {
    Session session;
    session.edit() = watched_scene();
    session.set_denoiser(&kStub);
    for (int attempt = 0; attempt < 20; ++attempt) {
        session.start();
        while (session.progress().status != "Denoising" && !session.wait(0)) std::this_thread::yield();
        if (session.progress().state != SessionState::Rendering) continue;  // this thread slept all through it
        session.cancel();
        session.stop();
        std::vector<float> denoised;
        if (session.progress().state == SessionState::Done) continue;
        EXPECT_EQ(session.progress().state, SessionState::Cancelled);
        EXPECT_FALSE(session.read_denoised(denoised));
        return;
    }
    FAIL() << "the denoising was never caught";
}

TEST(Watched, APictureBeyondTheMemoryIsRefusedInWords) {
    if (available_memory() > size_t(1) << 38) GTEST_SKIP() << "this machine could";
    Session session;
    session.edit() = watched_scene();
    session.edit().settings.width = session.edit().settings.height = 65536;
    session.start();
    while (!session.wait(1000)) {
    }
    EXPECT_EQ(session.progress().state, SessionState::Failed);
    EXPECT_NE(session.error().find("Not enough memory: a picture of 65536 x 65536 pixels"), std::string::npos) << session.error();
    EXPECT_TRUE(session.progress().status == session.error());
    session.edit() = watched_scene();
    session.start();
    while (!session.wait(1000)) {
    }
    EXPECT_EQ(session.progress().state, SessionState::Done) << session.error();
}

}  // namespace
}  // namespace talbot
