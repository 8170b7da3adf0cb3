#include "asset/write_image.h"

#include <OpenImageIO/imageio.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <vector>

namespace talbot::asset {

namespace {

void write_pfm(const std::string& path, int width, int height, int channels, std::span<const float> pixels) {
    // Portable float map: bottom row first, a negative scale for little-endian numbers; no place for alpha.
    std::ofstream file(path, std::ios::binary);
    file << (channels == 1 ? "Pf\n" : "PF\n") << width << ' ' << height << '\n' << (std::endian::native == std::endian::little ? "-1.0\n" : "1.0\n");
    const size_t kept = channels == 1 ? 1 : 3;
    for (size_t i = 0; i < size_t(width) * size_t(height); ++i)
        file.write(reinterpret_cast<const char*>(pixels.data() + i * size_t(channels)), std::streamsize(kept * sizeof(float)));
    if (!file.flush()) throw Error("The picture cannot be written: " + path);
}

uint8_t encode(float v) {
    const float s = v <= 0.0031308f ? 12.92f * v : 1.055f * std::pow(v, 1.0f / 2.4f) - 0.055f;
    return uint8_t(std::clamp(s, 0.0f, 1.0f) * 255.0f + 0.5f);
}

/// Straight alpha, as these formats have it.
std::vector<uint8_t> encode_pixels(std::span<const float> pixels, size_t count, size_t channels) {
    std::vector<uint8_t> bytes(count * channels);
    for (size_t i = 0; i < count; ++i) {
        const float* in = pixels.data() + i * channels;
        const float alpha = channels == 4 ? in[3] : 1.0f;
        for (size_t c = 0; c < channels; ++c)
            bytes[i * channels + c] = c == 3 ? uint8_t(std::clamp(alpha, 0.0f, 1.0f) * 255.0f + 0.5f) : encode(alpha > 0.0f ? in[c] / alpha : in[c]);
    }
    return bytes;
}

}  // namespace

void write_image(const std::string& path, int width, int height, int channels, std::span<const float> pixels,
                 const std::map<std::string, std::string>& metadata) {
    if (width < 1 || height < 1 || (channels != 1 && channels != 3 && channels != 4) || pixels.size() < size_t(width) * size_t(height) * size_t(channels))
        throw Error("There is no picture to write to " + path);
    if (path.ends_with(".pfm")) return write_pfm(path, width, height, channels, pixels);

    const bool is_exr = path.ends_with(".exr");
    const auto output = OIIO::ImageOutput::create(path);
    if (!output) throw Error("The picture cannot be written: " + OIIO::geterror());
    OIIO::ImageSpec spec(width, height, channels, is_exr ? OIIO::TypeDesc::FLOAT : OIIO::TypeDesc::UINT8);
    for (const auto& [key, value] : metadata) spec.attribute(key, value);
    if (!is_exr) spec.attribute("oiio:UnassociatedAlpha", 1);
    if (!output->open(path, spec)) throw Error("The picture cannot be written: " + output->geterror());
    const size_t count = size_t(width) * size_t(height), row = size_t(width) * size_t(channels);
    bool ok = false;
    if (is_exr) {
        const auto stride = OIIO::stride_t(row * sizeof(float));
        ok = output->write_image(OIIO::TypeDesc::FLOAT, pixels.data() + (size_t(height) - 1) * row, OIIO::AutoStride, -stride);
    } else {
        const std::vector<uint8_t> bytes = encode_pixels(pixels, count, size_t(channels));
        ok = output->write_image(OIIO::TypeDesc::UINT8, bytes.data() + (size_t(height) - 1) * row, OIIO::AutoStride, -OIIO::stride_t(row));
    }
    if (!ok || !output->close()) throw Error("The picture cannot be written: " + output->geterror());
}

}  // namespace talbot::asset
