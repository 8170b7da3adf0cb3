#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "asset/half.h"
#include "asset/texture.h"
#include "base/sobol.h"

using namespace talbot;
using namespace talbot::asset;

namespace {

struct Golden {
    Interpolation interpolation;
    Extension extension;
    int position;
    float rgb[3];
};

// An image node rendered by Blender 5.2.2 (Mirror) and 3.4.1 and 5.2.2 (the rest, equal).
const Golden kGolden[] = {
    {Interpolation::Linear, Extension::Repeat, 0, {0.24f, 0.495f, 0.265f}},
    {Interpolation::Linear, Extension::Repeat, 1, {0.104f, 0.711f, 0.375f}},
    {Interpolation::Linear, Extension::Repeat, 2, {0.352f, 0.486f, 0.287f}},
    {Interpolation::Linear, Extension::Extend, 0, {0.24f, 0.495f, 0.265f}},
    {Interpolation::Linear, Extension::Extend, 1, {0.6999999f, 0.15f, 0.15f}},
    {Interpolation::Linear, Extension::Extend, 2, {0.1f, 0.75f, 0.4f}},
    {Interpolation::Linear, Extension::Clip, 0, {0.24f, 0.495f, 0.265f}},
    {Interpolation::Linear, Extension::Clip, 1, {0, 0, 0}},
    {Interpolation::Linear, Extension::Clip, 2, {0.03248f, 0.2436f, 0.12992f}},
    {Interpolation::Linear, Extension::Mirror, 0, {0.24f, 0.495f, 0.265f}},
    {Interpolation::Linear, Extension::Mirror, 1, {0.696f, 0.189f, 0.175f}},
    {Interpolation::Linear, Extension::Mirror, 2, {0.1f, 0.75f, 0.4f}},
    {Interpolation::Closest, Extension::Repeat, 0, {0.3f, 0.45f, 0.25f}},
    {Interpolation::Closest, Extension::Repeat, 1, {0.1f, 0.75f, 0.4f}},
    {Interpolation::Closest, Extension::Repeat, 2, {0.1f, 0.75f, 0.4f}},
    {Interpolation::Closest, Extension::Extend, 0, {0.3f, 0.45f, 0.25f}},
    {Interpolation::Closest, Extension::Extend, 1, {0.7f, 0.15f, 0.15f}},
    {Interpolation::Closest, Extension::Extend, 2, {0.1f, 0.75f, 0.4f}},
    {Interpolation::Closest, Extension::Clip, 0, {0.3f, 0.45f, 0.25f}},
    {Interpolation::Closest, Extension::Clip, 1, {0, 0, 0}},
    {Interpolation::Closest, Extension::Clip, 2, {0.1f, 0.75f, 0.4f}},
    {Interpolation::Closest, Extension::Mirror, 0, {0.3f, 0.45f, 0.25f}},
    {Interpolation::Closest, Extension::Mirror, 1, {0.7f, 0.15f, 0.15f}},
    {Interpolation::Closest, Extension::Mirror, 2, {0.1f, 0.75f, 0.4f}},
    {Interpolation::Cubic, Extension::Repeat, 0, {0.2436f, 0.4944938f, 0.2655625f}},
    {Interpolation::Cubic, Extension::Repeat, 1, {0.2294923f, 0.6122246f, 0.3405228f}},
    {Interpolation::Cubic, Extension::Repeat, 2, {0.3681366f, 0.4724353f, 0.2819909f}},
    {Interpolation::Cubic, Extension::Extend, 0, {0.2409f, 0.4948313f, 0.2651125f}},
    {Interpolation::Cubic, Extension::Extend, 1, {0.7000001f, 0.15f, 0.15f}},
    {Interpolation::Cubic, Extension::Extend, 2, {0.1065037f, 0.7412193f, 0.3957721f}},
    {Interpolation::Cubic, Extension::Clip, 0, {0.2403148f, 0.4921846f, 0.2638342f}},
    {Interpolation::Cubic, Extension::Clip, 1, {0.01205124f, 0.002582408f, 0.002582408f}},
    {Interpolation::Cubic, Extension::Clip, 2, {0.03405073f, 0.2238843f, 0.1196355f}},
    {Interpolation::Cubic, Extension::Mirror, 0, {0.2409f, 0.4948313f, 0.2651125f}},
    {Interpolation::Cubic, Extension::Mirror, 1, {0.664627f, 0.2219252f, 0.1891069f}},
    {Interpolation::Cubic, Extension::Mirror, 2, {0.1089733f, 0.7369601f, 0.39355f}},
    {Interpolation::Smart, Extension::Repeat, 0, {0.2436f, 0.4944938f, 0.2655625f}},
    {Interpolation::Smart, Extension::Repeat, 1, {0.2294923f, 0.6122246f, 0.3405228f}},
    {Interpolation::Smart, Extension::Repeat, 2, {0.3681366f, 0.4724353f, 0.2819909f}},
    {Interpolation::Smart, Extension::Extend, 0, {0.2409f, 0.4948313f, 0.2651125f}},
    {Interpolation::Smart, Extension::Extend, 1, {0.7000001f, 0.15f, 0.15f}},
    {Interpolation::Smart, Extension::Extend, 2, {0.1065037f, 0.7412193f, 0.3957721f}},
    {Interpolation::Smart, Extension::Clip, 0, {0.2403148f, 0.4921846f, 0.2638342f}},
    {Interpolation::Smart, Extension::Clip, 1, {0.01205124f, 0.002582408f, 0.002582408f}},
    {Interpolation::Smart, Extension::Clip, 2, {0.03405073f, 0.2238843f, 0.1196355f}},
    {Interpolation::Smart, Extension::Mirror, 0, {0.2409f, 0.4948313f, 0.2651125f}},
    {Interpolation::Smart, Extension::Mirror, 1, {0.664627f, 0.2219252f, 0.1891069f}},
    {Interpolation::Smart, Extension::Mirror, 2, {0.1089733f, 0.7369601f, 0.39355f}},
};

struct Result {
    std::vector<float> r, g, b, a;
    explicit Result(size_t n) : r(n, -1), g(n, -1), b(n, -1), a(n, -1) {}
    Columns3 rgb() { return {r.data(), g.data(), b.data()}; }
};

Result look(const TextureTable& table, const std::vector<int32_t>& handles, const std::vector<float>& u, const std::vector<float>& v,
            Interpolation interpolation, Extension extension, bool unassociate = false) {
    Result result(u.size());
    lookup_texture(table, handles.data(), u.data(), v.data(), int(u.size()), interpolation, extension, result.rgb(), result.a.data(), unassociate);
    return result;
}

Texture make_texture(const std::vector<float>& texels, int width, int height, TexelFormat format = TexelFormat::Float4) {
    Texture texture;
    texture.texels = texels.data();
    texture.width = width;
    texture.height = height;
    texture.format = format;
    return texture;
}

// ---- the naive oracle: one texel at a time, in double

double cubic_weight(double d) {
    d = std::abs(d);
    return d < 1 ? 2.0 / 3 - d * d + d * d * d / 2 : d < 2 ? (2 - d) * (2 - d) * (2 - d) / 6 : 0;
}

int wrap(int i, int n, Extension extension) {
    switch (extension) {
        case Extension::Repeat:
            return ((i % n) + n) % n;
        case Extension::Mirror: {
            const int j = ((i % (2 * n)) + 2 * n) % (2 * n);
            return j < n ? j : 2 * n - 1 - j;
        }
        case Extension::Extend:
            return std::clamp(i, 0, n - 1);
        default:
            return i < 0 || i >= n ? -1 : i;
    }
}

void naive_lookup(const std::vector<double>& rgba, int width, int height, double u, double v, Interpolation interpolation, Extension extension, double out[4]) {
    for (int c = 0; c < 4; ++c) {
        const auto texel = [&](int x, int y) -> double {
            const int i = wrap(x, width, extension), j = wrap(y, height, extension);
            return i < 0 || j < 0 ? 0 : rgba[size_t((j * width + i) * 4 + c)];
        };
        if (interpolation == Interpolation::Closest) {
            out[c] = texel(int(std::floor(u * width)), int(std::floor(v * height)));
            continue;
        }
        const double x = u * width - 0.5, y = v * height - 0.5;
        const int x0 = int(std::floor(x)), y0 = int(std::floor(y));
        out[c] = 0;
        for (int j = y0 - 1; j <= y0 + 2; ++j)
            for (int i = x0 - 1; i <= x0 + 2; ++i) {
                const double wx = interpolation == Interpolation::Linear ? std::max(0.0, 1 - std::abs(x - i)) : cubic_weight(x - i);
                const double wy = interpolation == Interpolation::Linear ? std::max(0.0, 1 - std::abs(y - j)) : cubic_weight(y - j);
                out[c] += wx * wy * texel(i, j);
            }
    }
}

/// A texture of random texels in any format, with its values as the oracle sees them.
struct RandomTexture {
    std::vector<uint8_t> bytes;
    std::vector<uint16_t> shorts;
    std::vector<float> floats;
    std::vector<double> values;  // RGBA
    Texture texture;
    RandomTexture(TexelFormat format, int width, int height, uint32_t seed) {
        const bool single = format == TexelFormat::Byte1 || format == TexelFormat::Short1 || format == TexelFormat::Half1 || format == TexelFormat::Float1;
        const size_t count = size_t(width * height) * (single ? 1 : 4);
        std::vector<double> stored;
        for (size_t i = 0; i < count; ++i) {
            const uint32_t h = hash_u32(uint32_t(i) + seed * 1000);
            switch (format) {
                case TexelFormat::Byte1:
                case TexelFormat::Byte4:
                    bytes.push_back(uint8_t(h));
                    stored.push_back(bytes.back() / 255.0);
                    break;
                case TexelFormat::Short1:
                case TexelFormat::Short4:
                    shorts.push_back(uint16_t(h));
                    stored.push_back(shorts.back() / 65535.0);
                    break;
                case TexelFormat::Half1:
                case TexelFormat::Half4:
                    shorts.push_back(float_to_half((unit_float(h) - 0.25f) * 8));
                    stored.push_back(double(half_to_float(shorts.back())));
                    break;
                default:
                    floats.push_back((unit_float(h) - 0.25f) * 8);
                    stored.push_back(double(floats.back()));
                    break;
            }
        }
        for (size_t i = 0; i < size_t(width * height); ++i)
            for (size_t c = 0; c < 4; ++c) values.push_back(single ? (c == 3 ? 1.0 : stored[i]) : stored[4 * i + c]);
        texture.texels = !bytes.empty() ? static_cast<const void*>(bytes.data()) : !shorts.empty() ? static_cast<const void*>(shorts.data()) : floats.data();
        texture.width = width;
        texture.height = height;
        texture.format = format;
    }
};

}  // namespace

TEST(Lookup, BlendersOwnPictures) {
    std::vector<float> texels;
    for (int y = 0; y < 3; ++y)
        for (int x = 0; x < 4; ++x) texels.insert(texels.end(), {0.1f + 0.2f * float(x), 0.15f + 0.3f * float(y), 0.05f * float(x + 4 * y), 1.0f});
    const Texture texture = make_texture(texels, 4, 3);
    const TextureTable table{&texture, 1, nullptr};
    const float u[] = {0.3f, 1.13f, 0.02f}, v[] = {0.55f, -0.21f, 0.98f};
    for (const Golden& golden : kGolden) {
        const Result result = look(table, {0}, {u[golden.position]}, {v[golden.position]}, golden.interpolation, golden.extension);
        EXPECT_NEAR(result.r[0], golden.rgb[0], 2e-6) << int(golden.interpolation) << " " << int(golden.extension) << " " << golden.position;
        EXPECT_NEAR(result.g[0], golden.rgb[1], 2e-6);
        EXPECT_NEAR(result.b[0], golden.rgb[2], 2e-6);
    }
}

TEST(Lookup, EveryFormatLikeTheOracle) {
    const int sizes[][2] = {{1, 1}, {2, 3}, {7, 5}, {64, 33}};
    constexpr int kLanes = 600;  // more than two spans
    for (int format = 0; format <= int(TexelFormat::Short4); ++format)
        for (const auto& size : sizes) {
            const RandomTexture random(TexelFormat(format), size[0], size[1], uint32_t(format));
            const TextureTable table{&random.texture, 1, nullptr};
            std::vector<float> u, v;
            for (uint32_t i = 0; i < kLanes; ++i) {
                u.push_back(unit_float(hash_u32(i)) * 5 - 2);
                v.push_back(unit_float(hash_u32(i + 7777)) * 5 - 2);
            }
            for (int interpolation = 0; interpolation < 4; ++interpolation)
                for (int extension = 0; extension < 4; ++extension) {
                    const Result result = look(table, std::vector<int32_t>(kLanes, 0), u, v, Interpolation(interpolation), Extension(extension));
                    int wrong = 0;
                    for (size_t i = 0; i < kLanes; ++i) {
                        // The nearest texel is undecided next to an edge.
                        const double eu = std::abs(u[i] * size[0] - std::round(u[i] * size[0])), ev = std::abs(v[i] * size[1] - std::round(v[i] * size[1]));
                        if (Interpolation(interpolation) == Interpolation::Closest && (eu < 1e-4 || ev < 1e-4)) continue;
                        double expected[4];
                        naive_lookup(random.values, size[0], size[1], u[i], v[i], Interpolation(interpolation), Extension(extension), expected);
                        const float got[] = {result.r[i], result.g[i], result.b[i], result.a[i]};
                        // Texel positions carry the rounding of u * width: up to 64 * 3 * 6e-8 texels, times a slope of 8.
                        for (int c = 0; c < 4; ++c) wrong += std::abs(got[c] - expected[c]) > 2e-4;
                    }
                    EXPECT_EQ(wrong, 0) << "format " << format << " size " << size[0] << " interpolation " << interpolation << " extension " << extension;
                }
        }
}

TEST(Lookup, LanesDoNotSeeTheirNeighbours) {
    const RandomTexture a(TexelFormat::Byte4, 16, 16, 1), b(TexelFormat::Float1, 8, 4, 2), c(TexelFormat::Half4, 3, 3, 3);
    const Texture textures[] = {a.texture, b.texture, c.texture, {}};
    const TextureTable table{textures, 4, nullptr};
    std::vector<int32_t> handles;
    std::vector<float> u, v;
    for (uint32_t i = 0; i < 700; ++i) {
        handles.push_back(int32_t(hash_u32(i) % 7) - 1);  // also none, missing and out of range
        u.push_back(unit_float(hash_u32(i * 3)) * 2);
        v.push_back(unit_float(hash_u32(i * 5 + 1)) * 2);
    }
    const Result together = look(table, handles, u, v, Interpolation::Linear, Extension::Repeat);
    for (size_t i = 0; i < handles.size(); ++i) {
        const Result alone = look(table, {handles[i]}, {u[i]}, {v[i]}, Interpolation::Linear, Extension::Repeat);
        EXPECT_EQ(together.r[i], alone.r[0]) << i;
        EXPECT_EQ(together.a[i], alone.a[0]) << i;
        if (handles[i] < 0 || handles[i] > 2) {
            EXPECT_EQ(together.r[i], 1);
            EXPECT_EQ(together.g[i], 0);
            EXPECT_EQ(together.b[i], 1);
            EXPECT_EQ(together.a[i], 1);
        }
    }
}

TEST(Lookup, Tiles) {
    const std::vector<float> first{0.25f}, second{0.5f, 0.75f};
    Texture tiled;
    tiled.first_tile = 0;
    const Texture textures[] = {make_texture(first, 1, 1, TexelFormat::Float1), tiled, make_texture(first, 1, 1, TexelFormat::Float1),
                                make_texture(second, 2, 1, TexelFormat::Float1)};
    std::vector<int32_t> tiles(100, -1);
    tiles[0] = 2;
    tiles[1 + 10 * 2] = 3;  // 1022
    const TextureTable table{textures, 2, tiles.data()};
    const float nan = std::numeric_limits<float>::quiet_NaN();
    const Result result = look(table, {1, 1, 1, 1, 1, 1, 0, 1}, {0.5f, 1.25f, 1.75f, 3.5f, -0.5f, 12, 7.5f, nan},
                               {0.5f, 2.5f, 2.5f, 0.5f, 0.5f, 0.5f, 0.5f, 0.5f}, Interpolation::Closest, Extension::Repeat);
    const float expected_green[] = {0.25f, 0.5f, 0.75f, 0, 0, 0, 0.25f, 0};
    for (size_t i = 0; i < 8; ++i) EXPECT_EQ(result.g[i], expected_green[i]) << i;
    EXPECT_EQ(result.r[3], 1);  // no such tile: magenta
}

TEST(Lookup, AnyCoordinateIsSafe) {
    const RandomTexture random(TexelFormat::Byte4, 5, 3, 9);
    const TextureTable table{&random.texture, 1, nullptr};
    const float inf = std::numeric_limits<float>::infinity(), nan = std::numeric_limits<float>::quiet_NaN();
    const std::vector<float> odd{nan, inf, -inf, 3e38f, -3e38f, 1e10f, -1e-30f, 0, 1, -1};
    for (int interpolation = 0; interpolation < 4; ++interpolation)
        for (int extension = 0; extension < 4; ++extension)
            for (float v : odd) {
                const Result result = look(table, std::vector<int32_t>(odd.size(), 0), odd, std::vector<float>(odd.size(), v), Interpolation(interpolation),
                                           Extension(extension));
                for (size_t i = 0; i < odd.size(); ++i) EXPECT_TRUE(result.r[i] >= -1e-5f && result.r[i] <= 1.00001f && result.a[i] >= 0) << result.r[i];
            }
}

TEST(Lookup, HalfRoundTrip) {
    for (uint32_t h = 0; h < 0x7c00u; ++h) {
        ASSERT_EQ(float_to_half(half_to_float(h)), h);
        ASSERT_EQ(float_to_half(half_to_float(h | 0x8000u)), h | 0x8000u);
    }
    EXPECT_EQ(half_to_float(float_to_half(1e30f)), 65504);
    EXPECT_EQ(half_to_float(float_to_half(-1e30f)), -65504);
    EXPECT_EQ(half_to_float(float_to_half(1.0f + 0x1p-11f)), 1.0f);            // tie to even
    EXPECT_EQ(half_to_float(float_to_half(1.0f + 0x3p-11f)), 1.0f + 0x1p-9f);  // tie to even
    EXPECT_EQ(half_to_float(0x0001), 0x1p-24f);
    EXPECT_EQ(half_to_float(0x3555), 0.333251953125f);
}
