#include "asset/color_space.h"

#include <OpenColorIO/OpenColorIO.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>
#include <mutex>
#include <regex>
#include <sstream>

namespace OCIO = OCIO_NAMESPACE;

namespace talbot::asset {

namespace {

bool is_one_of(const std::string& name, std::initializer_list<const char*> names) {
    return std::any_of(names.begin(), names.end(), [&](const char* n) { return name == n; });
}

/// The names that Blender's configurations have had for these, with no configuration at hand.
Conversion built_in(const std::string& name, bool is_float) {
    if (is_one_of(name, {"Non-Color", "Raw", "Generic Data", "Non-Colour Data", "Utility - Raw"})) return {ConversionKind::None, true, true, nullptr};
    if (is_one_of(name, {"Linear", "Linear Rec.709", "Linear BT.709", "scene_linear", "lin_rec709"})) return {ConversionKind::None, false, true, nullptr};
    if (is_one_of(name, {"sRGB", "sRGB EOTF", "sRGB Encoded Rec.709 (sRGB)", "srgb_rec709_scene", "Utility - sRGB - Texture"}))
        return {ConversionKind::Srgb, false, true, nullptr};
    return {is_float ? ConversionKind::None : ConversionKind::Srgb, false, name.empty(), nullptr};
}

/// Removes the colour spaces and view transforms (items of the file's lists) that contain `text`.
std::string without_items(const std::string& config, const std::string& text) {
    std::string kept, item;
    std::istringstream lines(config);
    const auto flush = [&] {
        if (item.find(text) == std::string::npos) kept += item;
        item.clear();
    };
    for (std::string line; std::getline(lines, line);) {
        if (line.starts_with("  - !<") || line.empty() || line[0] != ' ') flush();
        item += line + '\n';
    }
    flush();
    return kept;
}

/// A configuration that is newer than the library mostly differs in its version line and in built-in transforms of displays,
/// which images do not need: it is read without them.
OCIO::ConstConfigRcPtr read_config(const std::string& path) {
    try {
        return OCIO::Config::CreateFromFile(path.c_str());
    } catch (const OCIO::Exception&) {
        std::ifstream file(path);
        std::stringstream content;
        content << file.rdbuf();
        const std::string older = "ocio_profile_version: 2." + std::to_string(OCIO_VERSION_MINOR);
        std::string text = std::regex_replace(content.str(), std::regex("ocio_profile_version: *2\\.[0-9]+"), older, std::regex_constants::format_first_only);
        if (text == content.str()) throw;
        for (;;) {
            try {
                std::istringstream stream(text);
                const OCIO::ConfigRcPtr config = OCIO::Config::CreateFromStream(stream)->createEditableCopy();
                config->setWorkingDir(std::filesystem::path(path).parent_path().c_str());
                return config;
            } catch (const OCIO::Exception& error) {
                std::cmatch match;
                if (!std::regex_search(error.what(), match, std::regex("built-in transform style '([^']+)'"))) throw;
                std::string shorter = without_items(text, match[1].str());
                if (shorter.size() >= text.size()) throw;
                text = std::move(shorter);
            }
        }
    }
}

ConversionKind classify(const OCIO::CPUProcessor& processor) {
    bool is_none = true, is_srgb = true;
    for (int i = 0; i <= 32; ++i) {
        const float v = float(i) / 32;
        for (int mask = 1; mask < 8; ++mask) {
            const std::array<float, 3> in{mask & 1 ? v : 0, mask & 2 ? v : 0, mask & 4 ? v : 0};
            std::array<float, 3> out = in;
            processor.applyRGB(out.data());
            for (size_t c = 0; c < 3; ++c) {
                is_none &= std::abs(out[c] - in[c]) < 1e-4f;
                is_srgb &= std::abs(out[c] - srgb_to_linear(in[c])) < 5e-4f;
            }
        }
    }
    return is_none ? ConversionKind::None : is_srgb ? ConversionKind::Srgb : ConversionKind::General;
}

}  // namespace

float srgb_to_linear(float v) {
    return v <= 0.04045f ? v / 12.92f : std::pow((v + 0.055f) / 1.055f, 2.4f);
}

struct ColorSpaces::State {
    OCIO::ConstConfigRcPtr config;
    std::string working_space;
    std::mutex mutex;
    std::map<std::string, Conversion> known;
    std::map<std::string, OCIO::ConstCPUProcessorRcPtr> processors;
};

ColorSpaces::ColorSpaces(const std::string& config_path, const std::string& working_space, Report& report) : state_(new State) {
    if (config_path.empty()) return;
    try {
        state_->config = read_config(config_path);
        state_->working_space = state_->config->getColorSpace(working_space.c_str()) ? working_space : OCIO::ROLE_SCENE_LINEAR;
        if (!state_->config->getColorSpace(state_->working_space.c_str())) throw OCIO::Exception("it has no scene_linear space");
    } catch (const std::exception& error) {
        state_->config.reset();
        report.warning("The colour management configuration cannot be read, only sRGB and linear images are converted: " + std::string(error.what()),
                       config_path);
    }
}

ColorSpaces::~ColorSpaces() = default;

Conversion ColorSpaces::find(const std::string& name, bool is_float) {
    const std::lock_guard lock(state_->mutex);
    if (!state_->config) return built_in(name, is_float);
    const std::string key = name + (is_float ? "\nfloat" : "\nint");
    if (const auto found = state_->known.find(key); found != state_->known.end()) return found->second;
    Conversion conversion = built_in(name, is_float);
    try {
        if (const OCIO::ConstColorSpaceRcPtr space = state_->config->getColorSpace(name.c_str())) {
            conversion = {};
            conversion.is_data = space->isData();
            if (!conversion.is_data) {
                const auto processor = state_->config->getProcessor(name.c_str(), state_->working_space.c_str())->getDefaultCPUProcessor();
                conversion.kind = classify(*processor);
                if (conversion.kind == ConversionKind::General) conversion.processor = (state_->processors[name] = processor).get();
            }
        }
    } catch (const OCIO::Exception&) {
        conversion = built_in(name, is_float);  // named, but its tables are missing
        conversion.is_known = false;
    }
    return state_->known[key] = conversion;
}

void ColorSpaces::convert(const Conversion& conversion, float* rgba, size_t n) const {
    if (conversion.kind == ConversionKind::Srgb) {
        for (size_t i = 0; i < n; ++i)
            for (size_t c = 0; c < 3; ++c) rgba[4 * i + c] = srgb_to_linear(rgba[4 * i + c]);
    } else if (conversion.processor) {
        constexpr size_t kChunk = 1 << 20;  // descriptions count in long
        for (size_t i = 0; i < n; i += kChunk) {
            const OCIO::PackedImageDesc texels(rgba + 4 * i, long(std::min(kChunk, n - i)), 1, 4);
            // Blender's conversions leave alpha alone; so does a colour space processor.
            static_cast<const OCIO::CPUProcessor*>(conversion.processor)->apply(const_cast<OCIO::PackedImageDesc&>(texels));
        }
    }
}

}  // namespace talbot::asset
