/// Writing pictures, for the standalone program and tests.
#pragma once

#include <map>
#include <span>
#include <string>

#include "base/error.h"

namespace talbot::asset {

/// Pixels of 1, 3 or 4 channels, bottom row first, linear Rec.709, alpha multiplied in. The ending decides: .exr (32-bit floats) and .pfm (1 or 3 channels)
/// as they are; .png and anything else OpenImageIO writes as 8-bit sRGB. `metadata` where the format has room for it. Throws Error.
void write_image(const std::string& path, int width, int height, int channels, std::span<const float> pixels,
                 const std::map<std::string, std::string>& metadata);

}  // namespace talbot::asset
