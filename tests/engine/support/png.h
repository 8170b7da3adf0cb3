/// A PNG file in memory, for tests: what the values are is decided here, not by an image library.
#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

namespace talbot::test {

inline void put_big_endian(std::vector<uint8_t>& out, uint32_t v) {
    for (int shift = 24; shift >= 0; shift -= 8) out.push_back(uint8_t(v >> shift));
}

inline void put_chunk(std::vector<uint8_t>& out, std::string_view type, const std::vector<uint8_t>& data) {
    put_big_endian(out, uint32_t(data.size()));
    const size_t start = out.size();
    out.insert(out.end(), type.begin(), type.end());
    out.insert(out.end(), data.begin(), data.end());
    uint32_t crc = ~0u;
    for (size_t i = start; i < out.size(); ++i) {
        crc ^= out[i];
        for (int bit = 0; bit < 8; ++bit) crc = crc >> 1 ^ (crc & 1 ? 0xedb88320u : 0u);
    }
    put_big_endian(out, ~crc);
}

/// values: width * height * channels (1 grey, 2 grey and alpha, 3 RGB, 4 RGBA), top row first, of 8 or 16 bits.
inline std::vector<uint8_t> make_png(int width, int height, int channels, int depth, const std::vector<int>& values) {
    std::vector<uint8_t> raw;
    for (int y = 0; y < height; ++y) {
        raw.push_back(0);
        for (int i = 0; i < width * channels; ++i) {
            const int v = values[size_t(y * width * channels + i)];
            if (depth == 16) raw.push_back(uint8_t(v >> 8));
            raw.push_back(uint8_t(v));
        }
    }
    // zlib stream of stored blocks.
    std::vector<uint8_t> packed{0x78, 0x01};
    uint32_t a = 1, b = 0;
    for (uint8_t byte : raw) {
        a = (a + byte) % 65521;
        b = (b + a) % 65521;
    }
    for (size_t at = 0; at < raw.size(); at += 65535) {
        const size_t size = raw.size() - at < 65535 ? raw.size() - at : 65535;
        packed.push_back(at + size == raw.size());
        packed.push_back(uint8_t(size));
        packed.push_back(uint8_t(size >> 8));
        packed.push_back(uint8_t(~size));
        packed.push_back(uint8_t(~size >> 8));
        packed.insert(packed.end(), raw.begin() + std::ptrdiff_t(at), raw.begin() + std::ptrdiff_t(at + size));
    }
    put_big_endian(packed, b << 16 | a);

    static constexpr uint8_t kColorTypes[] = {0, 0, 4, 2, 6};
    std::vector<uint8_t> header;
    put_big_endian(header, uint32_t(width));
    put_big_endian(header, uint32_t(height));
    header.insert(header.end(), {uint8_t(depth), kColorTypes[channels], 0, 0, 0});
    std::vector<uint8_t> out{0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
    put_chunk(out, "IHDR", header);
    put_chunk(out, "IDAT", packed);
    put_chunk(out, "IEND", {});
    return out;
}

}  // namespace talbot::test
