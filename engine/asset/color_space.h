/// From an image's colour space to the working space, by Blender's own OpenColorIO configuration or, without one, for
/// sRGB and linear only.
#pragma once

#include <cstddef>
#include <memory>
#include <string>

#include "base/error.h"

namespace talbot::asset {

enum class ConversionKind : unsigned char {
    None,     ///< linear in the working space already, or data
    Srgb,     ///< the sRGB curve, channel by channel
    General,  ///< whatever `convert` does
};

struct Conversion {
    ConversionKind kind = ConversionKind::None;
    bool is_data = false;  ///< no colour: alpha does not multiply it either
    bool is_known = true;  ///< false: the name is in no configuration, and the kind a guess
    const void* processor = nullptr;
};

class ColorSpaces {
public:
    /// An empty path is the built-in set. A configuration that cannot be read is one warning, and the built-in set.
    ColorSpaces(const std::string& config_path, const std::string& working_space, Report& report);
    ~ColorSpaces();
    /// `is_float`: unknown or empty names mean linear for floats, sRGB else. Thread-safe; the result lives as long as this.
    Conversion find(const std::string& name, bool is_float);
    /// n RGBA texels in place; alpha is left alone. Kinds Srgb and General.
    void convert(const Conversion& conversion, float* rgba, size_t n) const;

private:
    struct State;
    std::unique_ptr<State> state_;
};

/// The sRGB decoding curve, IEC 61966-2-1.
float srgb_to_linear(float v);

}  // namespace talbot::asset
