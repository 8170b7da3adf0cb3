#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <limits>
#include <thread>
#include <unordered_map>

#include "asset/color_space.h"
#include "asset/half.h"
#include "asset/read_image.h"
#include "asset/texture.h"
#include "base/pool.h"

namespace talbot::asset {

namespace {

constexpr int kFirstTile = 1001, kTiles = 100;

/// A texture and the memory behind it.
struct Texels {
    Texture texture;  ///< without tiles
    std::vector<uint8_t> bytes;
    std::vector<uint16_t> shorts;  ///< also halves
    std::vector<float> floats;
    size_t size() const { return bytes.capacity() + shorts.capacity() * 2 + floats.capacity() * 4; }
};

struct Part {
    int tile = 0;  ///< UDIM number, 0: the image itself
    Texels texels;
};

struct Entry {
    std::shared_ptr<const scene::Image> source;
    std::vector<Part> parts;
    bool is_loaded = false;
    bool is_tiled() const { return !parts.empty() && parts[0].tile != 0; }
};

template <class T>
void multiply_alpha(std::vector<T>& rgba, uint64_t full) {
    for (size_t i = 0; i + 3 < rgba.size(); i += 4)
        for (size_t c = 0; c < 3; ++c) rgba[i + c] = T((uint64_t(rgba[i + c]) * rgba[i + 3] + full / 2) / full);
}

template <class T>
void fill_alpha(std::vector<T>& rgba, T full) {
    for (size_t i = 3; i < rgba.size(); i += 4) rgba[i] = full;
}

/// Integers to RGBA floats 0..1.
template <class T>
std::vector<float> to_floats(const std::vector<T>& texels, int channels, float full) {
    const size_t n = texels.size() / size_t(channels);
    std::vector<float> rgba(n * 4);
    for (size_t i = 0; i < n; ++i)
        for (size_t c = 0; c < 4; ++c) rgba[4 * i + c] = channels == 4 ? float(texels[4 * i + c]) / full : c == 3 ? 1.0f : float(texels[i]) / full;
    return rgba;
}

/// Floats to halves, if that changes none by more than `tolerance`.
bool pack_halves(const std::vector<float>& floats, float tolerance, std::vector<uint16_t>& halves) {
    halves.resize(floats.size());
    for (size_t i = 0; i < floats.size(); ++i) {
        halves[i] = float_to_half(floats[i]);
        if (std::abs(half_to_float(halves[i]) - floats[i]) > tolerance) {
            halves = {};
            return false;
        }
    }
    return true;
}

/// Colour space and alpha rules (texture.h), and the smallest format that keeps the values.
Texels make_texels(RawImage&& raw, const scene::Image& image, const Conversion& conversion, const ColorSpaces& spaces, const float* srgb_table,
                   bool is_packed) {
    const bool is_rgba = raw.channels == 4;
    const bool multiplies = !conversion.is_data && (image.alpha == scene::AlphaMode::Straight || image.alpha == scene::AlphaMode::Premultiplied);
    Texels texels;
    Texture& texture = texels.texture;
    texture.width = raw.width;
    texture.height = raw.height;
    texture.is_associated = raw.has_alpha && multiplies;
    const bool multiply_now = texture.is_associated && raw.is_straight;
    const bool ignore_alpha = raw.has_alpha && image.alpha == scene::AlphaMode::None;

    const bool is_integer = raw.depth == Depth::Byte || raw.depth == Depth::Short;
    // Blender decodes packed 16-bit files itself, before filtering (measured).
    const bool keeps_encoding =
        conversion.kind == ConversionKind::None || (conversion.kind == ConversionKind::Srgb && (raw.depth == Depth::Byte || !is_packed));
    if (is_integer && keeps_encoding) {
        if (conversion.kind == ConversionKind::Srgb) texture.decode = srgb_table;
        if (raw.depth == Depth::Byte) {
            texture.format = is_rgba ? TexelFormat::Byte4 : TexelFormat::Byte1;
            if (ignore_alpha) fill_alpha<uint8_t>(raw.bytes, 255);
            if (multiply_now) multiply_alpha(raw.bytes, 255);
            texels.bytes = std::move(raw.bytes);
        } else {
            texture.format = is_rgba ? TexelFormat::Short4 : TexelFormat::Short1;
            if (ignore_alpha) fill_alpha<uint16_t>(raw.shorts, 65535);
            if (multiply_now) multiply_alpha(raw.shorts, 65535);
            texels.shorts = std::move(raw.shorts);
        }
    } else {
        std::vector<float> floats = raw.depth == Depth::Byte    ? to_floats(raw.bytes, raw.channels, 255)
                                    : raw.depth == Depth::Short ? to_floats(raw.shorts, raw.channels, 65535)
                                                                : std::move(raw.floats);
        bool has_four = is_rgba || is_integer;
        if (conversion.kind != ConversionKind::None) {
            if (!has_four) {
                std::vector<float> rgba(floats.size() * 4, 1.0f);
                for (size_t i = 0; i < floats.size(); ++i) rgba[4 * i] = rgba[4 * i + 1] = rgba[4 * i + 2] = floats[i];
                floats = std::move(rgba);
                has_four = true;
            }
            // Curves hold for the colour itself, not for its product with alpha.
            const bool divide = texture.is_associated && !raw.is_straight;
            const auto scale_colour = [&](bool by_alpha) {
                for (size_t i = 0; i < floats.size(); i += 4) {
                    const float a = floats[i + 3];
                    const float s = by_alpha ? a : a != 0.0f ? 1.0f / a : 1.0f;
                    for (size_t c = 0; c < 3; ++c) floats[i + c] *= s;
                }
            };
            if (divide) scale_colour(false);
            spaces.convert(conversion, floats.data(), floats.size() / 4);
            if (texture.is_associated) scale_colour(true);
        } else if (multiply_now) {
            for (size_t i = 0; i < floats.size(); i += 4)
                for (size_t c = 0; c < 3; ++c) floats[i + c] *= floats[i + 3];
        }
        if (ignore_alpha) fill_alpha(floats, 1.0f);
        for (float& f : floats) f = std::isfinite(f) ? f : 0.0f;
        // Halves where the file has no more, or the values need no more. 3e-8 is half of the smallest half: only RGBE's faintest texels feel it.
        const float tolerance = is_integer || raw.depth == Depth::Half ? std::numeric_limits<float>::infinity() : conversion.is_data ? 0.0f : 3e-8f;
        if (pack_halves(floats, tolerance, texels.shorts)) {
            texture.format = has_four ? TexelFormat::Half4 : TexelFormat::Half1;
        } else {
            texels.floats = std::move(floats);
            texture.format = has_four ? TexelFormat::Float4 : TexelFormat::Float1;
        }
    }
    texture.texels = !texels.bytes.empty()    ? static_cast<const void*>(texels.bytes.data())
                     : !texels.shorts.empty() ? static_cast<const void*>(texels.shorts.data())
                                              : static_cast<const void*>(texels.floats.data());
    return texels;
}

RawImage raw_from_pixels(const scene::Image& image) {
    const size_t count = size_t(std::max(image.width, 0)) * size_t(std::max(image.height, 0)) * 4;
    if (count == 0 || image.pixels.size() < count) throw Error("it has no pixels");
    RawImage raw;
    raw.width = image.width;
    raw.height = image.height;
    raw.has_alpha = true;
    if (image.pixels_are_float) {
        raw.depth = Depth::Float;
        raw.floats.assign(image.pixels.begin(), image.pixels.begin() + std::ptrdiff_t(count));
        for (float& f : raw.floats) f = std::isfinite(f) ? f : 0.0f;
    } else {
        raw.is_straight = true;
        raw.bytes.resize(count);
        for (size_t i = 0; i < count; ++i) raw.bytes[i] = uint8_t(saturate(image.pixels[i]) * 255.0f + 0.5f);
    }
    return raw;
}

std::string tile_path(std::string path, int tile) {
    const int n = tile - kFirstTile;
    std::string by_position = "u";
    by_position.append(std::to_string(n % 10 + 1)).append("_v").append(std::to_string(n / 10 + 1));
    for (const auto& [token, text] : {std::pair{"<UDIM>", std::to_string(tile)}, std::pair{"<UVTILE>", by_position}}) {
        for (size_t at = path.find(token); at != std::string::npos; at = path.find(token)) path.replace(at, std::string(token).size(), text);
    }
    return path;
}

Entry make_entry(const std::shared_ptr<const scene::Image>& image) {
    Entry entry;
    entry.source = image;
    if (!image) return entry;
    const bool in_memory = !image->pixels.empty() || !image->bytes.empty();
    const bool has_token = image->path.find("<UDIM>") != std::string::npos || image->path.find("<UVTILE>") != std::string::npos;
    if (in_memory || !has_token) {
        entry.parts.emplace_back();
        return entry;
    }
    std::vector<int> tiles = image->tiles;
    std::erase_if(tiles, [](int tile) { return tile < kFirstTile || tile >= kFirstTile + kTiles; });
    std::sort(tiles.begin(), tiles.end());
    tiles.erase(std::unique(tiles.begin(), tiles.end()), tiles.end());
    if (tiles.empty()) {  // not said: what is on the disk
        std::error_code error;
        for (int tile = kFirstTile; tile < kFirstTile + kTiles; ++tile)
            if (std::filesystem::is_regular_file(tile_path(image->path, tile), error)) tiles.push_back(tile);
        if (tiles.empty()) tiles.push_back(kFirstTile);
    }
    for (int tile : tiles) entry.parts.push_back({tile, {}});
    return entry;
}

std::string label(const scene::Image& image) {
    return "Image '" + image.name + "'";
}

}  // namespace

struct TextureStore::State {
    std::vector<std::shared_ptr<Entry>> entries;  ///< one a scene image; shared where the image is
    std::string color_key;
    std::vector<Texture> textures;
    std::vector<int32_t> tiles;
    TextureTable table;
    std::array<float, 257> srgb_table;

    void load(Entry& entry, Part& part, ColorSpaces& spaces, Report& report, const std::atomic<bool>* cancel) const;
    void build_table();
};

void TextureStore::State::load(Entry& entry, Part& part, ColorSpaces& spaces, Report& report, const std::atomic<bool>* cancel) const {
    const scene::Image& image = *entry.source;
    part.texels = {};
    part.texels.texture.is_missing = true;
    try {
        const bool has_pixels = !image.pixels.empty(), is_packed = !has_pixels && !image.bytes.empty();
        if (!has_pixels && !is_packed && image.path.empty()) throw Error("it has no file");
        if (is_packed && image.tiles.size() > 1 && &part == entry.parts.data()) report.warning("Of packed tiles only the first is used", label(image));
        RawImage raw = has_pixels  ? raw_from_pixels(image)
                       : is_packed ? read_image_bytes(image.bytes, image.path.empty() ? image.name : image.path, cancel)
                                   : read_image_file(part.tile ? tile_path(image.path, part.tile) : image.path, cancel);
        const bool is_float = raw.depth == Depth::Half || raw.depth == Depth::Float;
        Conversion conversion = spaces.find(image.colorspace, is_float);
        if (!conversion.is_known) report.warning("Unknown colour space '" + image.colorspace + "', taken for " + (is_float ? "linear" : "sRGB"), label(image));
        if (has_pixels && image.pixels_are_float) conversion.kind = ConversionKind::None;  // linear, whatever its colour space says
        part.texels = make_texels(std::move(raw), image, conversion, spaces, srgb_table.data(), is_packed);
    } catch (const std::bad_alloc&) {
        report.warning("Not enough memory for the image, magenta is used", label(image));
    } catch (const std::exception& error) {
        std::string reason = error.what();
        while (!reason.empty() && (reason.back() == '\n' || reason.back() == '.')) reason.pop_back();
        report.warning("The image cannot be read, magenta is used: " + (reason.empty() ? "unknown reason" : reason), label(image));
    }
}

void TextureStore::State::build_table() {
    textures.assign(entries.size(), {});
    tiles.clear();
    for (size_t i = 0; i < entries.size(); ++i) {
        textures[i].is_missing = true;
        if (!entries[i]) continue;
        const Entry& entry = *entries[i];
        if (entry.parts.empty()) continue;
        if (!entry.is_tiled()) {
            textures[i] = entry.parts[0].texels.texture;
            continue;
        }
        textures[i].is_missing = false;
        textures[i].first_tile = int(tiles.size());
        tiles.resize(tiles.size() + kTiles, -1);
        for (const Part& part : entry.parts) {
            tiles[size_t(textures[i].first_tile + part.tile - kFirstTile)] = int32_t(textures.size());
            textures.push_back(part.texels.texture);
        }
    }
    table = {textures.data(), int(entries.size()), tiles.data()};
}

TextureStore::TextureStore() : state_(new State) {
    for (size_t i = 0; i < state_->srgb_table.size(); ++i) state_->srgb_table[i] = srgb_to_linear(float(std::min<size_t>(i, 255)) / 255.0f);
}

TextureStore::~TextureStore() = default;

void TextureStore::update(const scene::Scene& scene, Report& report, const std::atomic<bool>* cancel) {
    const auto check_cancel = [&] {
        if (cancel && cancel->load(std::memory_order_relaxed)) throw Cancelled{};
    };
    const std::string color_key = scene.settings.ocio_config + '\n' + scene.settings.working_space;
    std::unordered_map<const scene::Image*, std::shared_ptr<Entry>> known;
    if (color_key == state_->color_key) {
        for (const auto& entry : state_->entries)
            if (entry && entry->source) known[entry->source.get()] = entry;
    }
    state_->color_key = color_key;

    struct Job {
        Entry* entry;
        Part* part;
    };
    std::vector<Job> jobs;
    std::vector<std::shared_ptr<Entry>> entries;
    entries.reserve(scene.images.size());
    for (const auto& image : scene.images) {
        std::shared_ptr<Entry>& entry = known[image.get()];
        if (!entry) entry = std::make_shared<Entry>(make_entry(image));
        entries.push_back(entry);
    }
    state_->entries = std::move(entries);
    known.clear();
    std::vector<Entry*> loading;
    for (const auto& entry : state_->entries) {
        if (entry->is_loaded || std::find(loading.begin(), loading.end(), entry.get()) != loading.end()) continue;
        loading.push_back(entry.get());
        for (Part& part : entry->parts) jobs.push_back({entry.get(), &part});
    }
    state_->build_table();
    check_cancel();
    if (!jobs.empty()) {
        ColorSpaces spaces(scene.settings.ocio_config, scene.settings.working_space, report);
        const auto load = [&](size_t begin, size_t end, int) {
            for (size_t i = begin; i < end; ++i) {
                check_cancel();
                state_->load(*jobs[i].entry, *jobs[i].part, spaces, report, cancel);
            }
        };
        const int machine = std::max(int(std::thread::hardware_concurrency()), 1);
        const int threads = int(std::min<size_t>(size_t(scene.settings.threads > 0 ? scene.settings.threads : machine), jobs.size()));
        if (threads > 1) {
            WorkerPool(threads).parallel_for(jobs.size(), 1, load);
        } else {
            load(0, jobs.size(), 0);
        }
        for (Entry* entry : loading) entry->is_loaded = true;
    }
    state_->build_table();
}

const TextureTable& TextureStore::table() const {
    return state_->table;
}

size_t TextureStore::bytes() const {
    size_t sum = 0;
    std::vector<const Entry*> counted;
    for (const auto& entry : state_->entries) {
        if (std::find(counted.begin(), counted.end(), entry.get()) != counted.end()) continue;
        counted.push_back(entry.get());
        for (const Part& part : entry->parts) sum += part.texels.size();
    }
    return sum;
}

}  // namespace talbot::asset
