#include <gtest/gtest.h>

#include <limits>
#include <thread>

#include "film/film.h"

using namespace talbot;
using namespace talbot::film;
using scene::PassKind;

namespace {

const float kInf = std::numeric_limits<float>::infinity();
const float kNan = std::numeric_limits<float>::quiet_NaN();

std::vector<float> resolved(const Film& film, PassKind kind, const scene::Settings& settings = {}) {
    std::vector<float> out(size_t(film.width() * film.height() * pass_channels(kind)), -7.0f);
    film.resolve(kind, settings, out);
    return out;
}

struct Rows {
    std::vector<float> r, g, b;
    explicit Rows(std::initializer_list<Vec3> values) {
        for (const Vec3& v : values) {
            r.push_back(v.x);
            g.push_back(v.y);
            b.push_back(v.z);
        }
    }
    ConstColumns3 columns() const { return {r.data(), g.data(), b.data()}; }
};

void add_rgb(TileFilm& tile, Category category, std::vector<int32_t> pixels, const Rows& rgb, const Rows* diffuse = nullptr, const Rows* glossy = nullptr) {
    Contributions c;
    c.pixel = pixels.data();
    c.rgb = rgb.columns();
    if (diffuse) c.diffuse = diffuse->columns();
    if (glossy) c.glossy = glossy->columns();
    c.n = int(pixels.size());
    add(tile, category, c);
}

void add_scalar(TileFilm& tile, PassKind kind, std::vector<int32_t> pixels, std::vector<float> values, std::vector<float> weights) {
    const float* columns[1] = {values.data()};
    add_data(tile, kind, pixels.data(), columns, weights.data(), int(pixels.size()));
}

}  // namespace

TEST(FilmLayout, PassesDoNotOverlapAndLightBringsColour) {
    const PassKind wanted[] = {PassKind::Combined, PassKind::Depth, PassKind::GlossyIndirect, PassKind::Depth, PassKind::SampleCount};
    const FilmLayout layout = make_layout(wanted);
    EXPECT_TRUE(layout.has(PassKind::GlossyColor));
    EXPECT_FALSE(layout.has(PassKind::DiffuseColor));
    EXPECT_TRUE(layout.has(PassKind::SampleCount));
    EXPECT_TRUE(layout.light_passes);
    EXPECT_TRUE(layout.data_passes);
    EXPECT_EQ(layout.stride, 4 + (1 + 1) + 3 + 3);
    const PassKind plain[] = {PassKind::Combined, PassKind::Emission};
    EXPECT_FALSE(make_layout(plain).light_passes);
    EXPECT_FALSE(make_layout(plain).data_passes);
    EXPECT_EQ(make_layout(plain).stride, 7);
}

TEST(Film, LightPassesTimesColourAddUpToCombined) {
    const PassKind wanted[] = {PassKind::Combined,           PassKind::DiffuseDirect,        PassKind::DiffuseIndirect, PassKind::GlossyDirect,
                               PassKind::TransmissionDirect, PassKind::TransmissionIndirect, PassKind::Emission,        PassKind::Environment};
    const FilmLayout layout = make_layout(wanted);
    TileFilm tile;
    tile.reset(layout, 2);
    const Rows diffuse({{0.5f, 0.25f, 0}, {0, 0, 0}}), glossy({{0.25f, 0.25f, 1}, {0, 0, 0}});
    add_rgb(tile, Category::Direct, {0, 1}, Rows({{4, 8, 2}, {1, 2, 3}}), &diffuse, &glossy);
    add_rgb(tile, Category::Indirect, {0, 0}, Rows({{2, 2, 2}, {1, 1, 1}}), &diffuse, &glossy);
    add_rgb(tile, Category::Emission, {1}, Rows({{0, 0, 10}}));
    add_rgb(tile, Category::Environment, {1}, Rows({{0, 20, 0}}));
    const Rows colour({{0.8f, 0.4f, 0.0f}});
    const int32_t pixel = 0;
    const float weight = 1;
    const float* columns[3] = {colour.r.data(), colour.g.data(), colour.b.data()};
    add_data(tile, PassKind::DiffuseColor, &pixel, columns, &weight, 1);
    Film film(layout, 2, 1);
    film.merge(tile, list_pixels(2, 1, 8), 2);

    scene::Settings settings;
    settings.film_exposure = 3;
    const auto combined = resolved(film, PassKind::Combined, settings);
    EXPECT_FLOAT_EQ(combined[0], 3 * (4 + 2 + 1) / 2.0f);
    EXPECT_FLOAT_EQ(combined[4], 3 * 1 / 2.0f);
    EXPECT_FLOAT_EQ(combined[5], 3 * (2 + 20) / 2.0f);
    EXPECT_FLOAT_EQ(combined[6], 3 * (3 + 10) / 2.0f);
    EXPECT_FLOAT_EQ(combined[3], 1);  // nobody asked for alpha
    const auto direct = resolved(film, PassKind::DiffuseDirect, settings), diffuse_colour = resolved(film, PassKind::DiffuseColor, settings);
    EXPECT_FLOAT_EQ(direct[0] * diffuse_colour[0], 3 * 4 * 0.5f / 2);
    EXPECT_FLOAT_EQ(direct[1] * diffuse_colour[1], 3 * 8 * 0.25f / 2);
    EXPECT_FLOAT_EQ(diffuse_colour[0], 0.4f);  // mean over samples, no exposure
    EXPECT_FLOAT_EQ(direct[2], 0.5f * (direct[0] + direct[1]));
    const auto indirect = resolved(film, PassKind::DiffuseIndirect, settings);
    EXPECT_FLOAT_EQ(indirect[0] * diffuse_colour[0], 3 * 2 * 0.5f / 2);
    EXPECT_EQ(resolved(film, PassKind::TransmissionDirect)[3], 0);  // colour never added: no quotient
    EXPECT_FLOAT_EQ(tile.pixels()[layout.offset[int(PassKind::TransmissionDirect)] + 0], 4 * 0.25f);
    EXPECT_FLOAT_EQ(tile.pixels()[layout.offset[int(PassKind::TransmissionIndirect)] + 0], 2 * 0.25f + 1);
    EXPECT_FLOAT_EQ(resolved(film, PassKind::Emission, settings)[5], 15);
    EXPECT_FLOAT_EQ(resolved(film, PassKind::Environment, settings)[4], 30);
    EXPECT_EQ(resolved(film, PassKind::Environment, settings)[5], 0);
}

TEST(Film, AovsAreMeansOfWhatCameAsItCame) {
    const PassKind wanted[] = {PassKind::Combined};
    const FilmLayout layout = make_layout(wanted, false, 2);
    EXPECT_TRUE(layout.data_passes);
    TileFilm tile;
    tile.reset(layout, 2);
    const std::vector<int32_t> pixels{1, 1, 1};
    add_aov(tile, 0, 1, pixels.data(), Rows({{1, 2, 3}, {4, 5, -6}, {kNan, 0, 0}}).columns(), 3);
    add_aov(tile, 1, 1, pixels.data(), Rows({{7, 7, 7}}).columns(), 1);
    Film film(layout, 2, 1);
    film.merge(tile, list_pixels(2, 1, 8), 4);
    std::vector<float> color(8), value(2);
    film.resolve_aov(0, true, color);
    film.resolve_aov(1, false, value);
    EXPECT_EQ(color, (std::vector<float>{0, 0, 0, 0, 1.25f, 1.75f, -0.75f, 0.5f}));
    EXPECT_EQ(value, (std::vector<float>{0, 1.75f}));
    EXPECT_THROW(film.resolve_aov(0, true, value), Error);
}

TEST(Film, NonFiniteContributionsAreDropped) {
    const PassKind wanted[] = {PassKind::Combined, PassKind::DiffuseDirect, PassKind::Normal, PassKind::Depth};
    const FilmLayout layout = make_layout(wanted);
    TileFilm tile;
    tile.reset(layout, 1);
    const Rows share({{1, 1, 1}, {1, 1, 1}, {kNan, 0, 0}});
    add_rgb(tile, Category::Direct, {0, 0, 0}, Rows({{1, kNan, 1}, {kInf, 1, 1}, {1, 2, 3}}), &share, &share);
    add_rgb(tile, Category::Emission, {0, 0}, Rows({{-kInf, 0, 0}, {1, 1, 1}}));
    const int32_t pixel = 0;
    const float t[] = {kNan, 0.25f};
    const int32_t pixels[] = {0, 0};
    add_alpha(tile, pixels, t, 2);
    const float bad[] = {kNan}, one[] = {1};
    const float* columns[3] = {bad, one, one};
    add_data(tile, PassKind::Normal, &pixel, columns, one, 1);
    add_scalar(tile, PassKind::Depth, {0}, {kInf}, {1});
    Film film(layout, 1, 1);
    film.merge(tile, list_pixels(1, 1, 8), 1);
    EXPECT_EQ(resolved(film, PassKind::Combined), (std::vector<float>{2, 3, 4, 0.75f}));
    EXPECT_EQ(resolved(film, PassKind::DiffuseDirect), (std::vector<float>{0, 0, 0}));
    EXPECT_EQ(resolved(film, PassKind::Normal), (std::vector<float>{0, 0, 0}));
    EXPECT_EQ(resolved(film, PassKind::Depth)[0], 1e10f);
}

TEST(Film, DepthIsTheFirstSamplesValue) {
    const PassKind wanted[] = {PassKind::Depth, PassKind::ObjectIndex, PassKind::Position, PassKind::Mist};
    const FilmLayout layout = make_layout(wanted);
    Film film(layout, 3, 1);
    TileFilm tile;
    tile.reset(layout, 3);
    // Pixel 0: a veil, then the wall behind it. Pixel 1: a wall. Pixel 2: a veil before nothing. Later samples write sums only.
    add_scalar(tile, PassKind::Depth, {0, 0, 1, 2, 2}, {2, 5, 3, 4, 0}, {1, 1, 1, 1, 0});
    add_scalar(tile, PassKind::ObjectIndex, {1}, {42}, {1});
    add_scalar(tile, PassKind::Mist, {0, 0}, {0.2f, 0.6f}, {0.25f, 0.75f});
    film.merge(tile, list_pixels(3, 1, 8), 1);
    tile.reset(layout, 3);
    film.merge(tile, list_pixels(3, 1, 8), 1);
    EXPECT_EQ(resolved(film, PassKind::Depth), (std::vector<float>{5, 3, 1e10f}));
    EXPECT_EQ(resolved(film, PassKind::ObjectIndex), (std::vector<float>{0, 42, 0}));
    EXPECT_EQ(resolved(film, PassKind::Position), std::vector<float>(9, 0.0f));
    const auto mist = resolved(film, PassKind::Mist);
    EXPECT_FLOAT_EQ(mist[0], 1 - (0.8f * 0.25f + 0.4f * 0.75f) / 2);
    EXPECT_EQ(mist[2], 1);
}

TEST(Film, PixelsLandWhereTheyBelong) {
    const PassKind wanted[] = {PassKind::Combined, PassKind::SampleCount};
    const FilmLayout layout = make_layout(wanted);
    Film film(layout, 5, 4);
    TileFilm tile;
    tile.reset(layout, 4);
    for (int i = 0; i < 4; ++i) add_rgb(tile, Category::Emission, {i}, Rows({{float(i + 1), 0, 0}}));
    const PackedPixel pixels[] = {pack_pixel(4, 3), pack_pixel(0, 0), pack_pixel(2, 1), pack_pixel(1, 3)};
    film.merge(tile, pixels, 1);
    const float expected[4][5] = {{2, 0, 0, 0, 0}, {0, 0, 3, 0, 0}, {0, 0, 0, 0, 0}, {0, 4, 0, 0, 1}};
    const auto combined = resolved(film, PassKind::Combined);
    for (int y = 0; y < 4; ++y)
        for (int x = 0; x < 5; ++x) EXPECT_EQ(combined[size_t((y * 5 + x) * 4)], expected[y][x]) << x << " " << y;
    EXPECT_EQ(film.samples_at(0, 0), 1);
    EXPECT_EQ(film.samples_at(1, 0), 0);
    EXPECT_EQ(film.samples_at(-1, 9), 0);
    film.merge(tile, std::span(pixels).first(1), 3);
    EXPECT_FLOAT_EQ(resolved(film, PassKind::SampleCount)[0], 0.25f);
    EXPECT_FLOAT_EQ(resolved(film, PassKind::SampleCount)[19], 1);
    EXPECT_EQ(combined[3 + 4], 0);  // no sample yet: transparent black
    film.clear();
    EXPECT_EQ(film.samples_at(0, 0), 0);
    EXPECT_EQ(resolved(film, PassKind::Combined), std::vector<float>(80, 0.0f));
}

TEST(Film, ListsHoldEachPixelOnceTileByTile) {
    const std::vector<PackedPixel> list = list_pixels(5, 3, 2);
    const int expected[][2] = {{0, 0}, {1, 0}, {0, 1}, {1, 1}, {2, 0}, {3, 0}, {2, 1}, {3, 1}, {4, 0}, {4, 1}, {0, 2}, {1, 2}, {2, 2}, {3, 2}, {4, 2}};
    ASSERT_EQ(list.size(), std::size(expected));
    for (size_t i = 0; i < list.size(); ++i) EXPECT_EQ(list[i], pack_pixel(expected[i][0], expected[i][1])) << i;
    const PackedPixel corner = pack_pixel(65535, 65535);
    EXPECT_EQ(pixel_x(corner), 65535);
    EXPECT_EQ(pixel_y(corner), 65535);
    EXPECT_TRUE(list_pixels(0, 7, 16).empty());
}

TEST(Film, EmptyFilmAndShortBuffer) {
    const PassKind wanted[] = {PassKind::Combined};
    const FilmLayout layout = make_layout(wanted);
    Film none(layout, 0, 0);
    EXPECT_TRUE(resolved(none, PassKind::Combined).empty());
    Film film(layout, 2, 2);
    std::vector<float> shorter(15);
    EXPECT_THROW(film.resolve(PassKind::Combined, {}, shorter), Error);
    EXPECT_EQ(resolved(film, PassKind::Depth), std::vector<float>(4, 1e10f));  // not asked for
}

TEST(Film, ResolveWhileWorkersMerge) {
    const PassKind wanted[] = {PassKind::Combined, PassKind::Depth};
    const FilmLayout layout = make_layout(wanted);
    Film film(layout, 64, 64);
    constexpr int kRounds = 50;
    const auto work = [&](int y) {
        TileFilm tile;
        tile.reset(layout, 64 * 32);
        std::vector<PackedPixel> pixels = list_pixels(64, 32, 64);
        for (PackedPixel& p : pixels) p += pack_pixel(0, y);
        for (int i = 0; i < 64 * 32; ++i) add_rgb(tile, Category::Emission, {i}, Rows({{1, 2, 3}}));
        for (int round = 0; round < kRounds; ++round) film.merge(tile, pixels, 1);
    };
    std::thread a(work, 0), b(work, 32);
    for (int round = 0; round < 20; ++round) {
        const auto combined = resolved(film, PassKind::Combined);
        for (size_t i = 0; i < combined.size(); i += 4) EXPECT_TRUE(combined[i] == 0 || std::abs(combined[i] - 1) < 1e-6f) << combined[i];
    }
    a.join();
    b.join();
    EXPECT_EQ(film.samples_at(5, 5), kRounds);
    EXPECT_EQ(resolved(film, PassKind::Combined)[2], 3);
}

TEST(Film, MistFalloffs) {
    scene::Settings settings;
    settings.mist_start = 2;
    settings.mist_depth = 8;
    const float expected[] = {0.0625f, 0.25f, 0.5f};
    for (int falloff = 0; falloff < 3; ++falloff) {
        settings.mist_falloff = falloff;
        EXPECT_FLOAT_EQ(mist_amount(settings, 4), expected[falloff]);
        EXPECT_EQ(mist_amount(settings, 1), 0);
        EXPECT_EQ(mist_amount(settings, 100), 1);
    }
}
