/// One image file or packed file, decoded: 1 or 4 channels, bottom row first, values as the file has them.
#pragma once

#include <atomic>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "base/error.h"

namespace talbot::asset {

/// How texels came: as fractions of 255 or 65535, as halves (held as floats), as floats.
enum class Depth : uint8_t { Byte, Short, Half, Float };

struct RawImage {
    int width = 0, height = 0;
    int channels = 4;  ///< 1: grey, 4: RGBA
    Depth depth = Depth::Byte;
    bool has_alpha = false;    ///< else alpha is full
    bool is_straight = false;  ///< the file's colour is not multiplied by alpha
    std::vector<uint8_t> bytes;
    std::vector<uint16_t> shorts;
    std::vector<float> floats;  ///< Half and Float; finite
};

/// Throws Error with the reader's reason, or Cancelled.
RawImage read_image_file(const std::string& path, const std::atomic<bool>* cancel);
/// `name` only helps to tell the format.
RawImage read_image_bytes(std::span<const uint8_t> bytes, const std::string& name, const std::atomic<bool>* cancel);

}  // namespace talbot::asset
