// The library is not on every machine: TALBOT_OIDN_DIR names a folder that holds libOpenImageDenoise.so.2 (PyPI's
// package pyoidn has one in pyoidn/oidn/lib).
#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <cstdlib>
#include <thread>

#include "base/sobol.h"
#include "film/film.h"

using namespace talbot;

namespace {

constexpr int kWidth = 160, kHeight = 96;

std::vector<std::string> directories() {
    const char* directory = std::getenv("TALBOT_OIDN_DIR");
    return directory ? std::vector<std::string>{"/nonexistent", directory} : std::vector<std::string>{};
}

std::vector<float> noisy(float noise) {
    std::vector<float> color(size_t(kWidth * kHeight * 3));
    for (size_t i = 0; i < color.size(); ++i) color[i] = 0.5f + noise * (unit_float(hash_u32(uint32_t(i) + 17)) - 0.5f);
    return color;
}

double rms(const std::vector<float>& color) {
    double sum = 0;
    for (float c : color) sum += square(c - 0.5f);
    return std::sqrt(sum / double(color.size()));
}

}  // namespace

TEST(Denoise, AbsentLibraryIsOneSentence) {
    if (!film::denoiser_version(directories()).empty() || !film::denoiser_version({}).empty()) GTEST_SKIP() << "the library is present";
    auto color = noisy(1);
    const auto before = color;
    const auto result = film::denoise(color, {}, {}, kWidth, kHeight, 1, {"/nonexistent"}, nullptr);
    EXPECT_FALSE(result.ok);
    EXPECT_NE(result.message.find("Open Image Denoise"), std::string::npos);
    EXPECT_EQ(color, before);
}

TEST(Denoise, RemovesNoise) {
    if (film::denoiser_version(directories()).empty()) GTEST_SKIP() << "no Open Image Denoise: set TALBOT_OIDN_DIR";
    EXPECT_EQ(film::denoiser_version(directories())[0], '2');
    const std::vector<float> albedo(size_t(kWidth * kHeight * 3), 0.8f), normal(size_t(kWidth * kHeight * 3), 0.577f);
    for (int guides = 0; guides < 3; ++guides) {
        auto color = noisy(1);
        const double before = rms(color);
        const auto result = film::denoise(color, guides > 0 ? albedo : std::vector<float>{}, guides > 1 ? normal : std::vector<float>{}, kWidth, kHeight, 2,
                                          directories(), nullptr);
        ASSERT_TRUE(result.ok) << result.message;
        EXPECT_LT(rms(color), before / 5);
    }
}

TEST(Denoise, CancelLeavesThePicture) {
    if (film::denoiser_version(directories()).empty()) GTEST_SKIP() << "no Open Image Denoise: set TALBOT_OIDN_DIR";
    std::atomic<bool> cancel = true;
    auto color = noisy(1);
    const auto before = color;
    const auto result = film::denoise(color, {}, {}, kWidth, kHeight, 1, directories(), &cancel);
    EXPECT_FALSE(result.ok);
    EXPECT_NE(result.message.find("cancelled"), std::string::npos);
    EXPECT_EQ(color, before);
}

TEST(Denoise, CancelWhileRunning) {
    if (film::denoiser_version(directories()).empty()) GTEST_SKIP() << "no Open Image Denoise: set TALBOT_OIDN_DIR";
    constexpr int kBigWidth = 3840, kBigHeight = 2160;  // some ten seconds on one thread
    std::atomic<bool> cancel = false;
    std::vector<float> color(size_t(kBigWidth * kBigHeight) * 3, 0.5f);
    std::thread canceller([&] {
        std::this_thread::sleep_for(std::chrono::milliseconds(300));
        cancel = true;
    });
    const auto start = std::chrono::steady_clock::now();
    const auto result = film::denoise(color, {}, {}, kBigWidth, kBigHeight, 1, directories(), &cancel);
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    canceller.join();
    EXPECT_FALSE(result.ok);
    EXPECT_NE(result.message.find("cancelled"), std::string::npos);
    EXPECT_LT(seconds, 3);
}

TEST(Denoise, ShortGuidesAreRefused) {
    auto color = noisy(1);
    const std::vector<float> albedo(12);
    EXPECT_FALSE(film::denoise(color, albedo, {}, kWidth, kHeight, 1, directories(), nullptr).ok);
}
