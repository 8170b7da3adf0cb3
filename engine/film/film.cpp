#include "film/film.h"

#include <algorithm>
#include <cmath>

namespace talbot::film {

using scene::PassKind;

namespace {

constexpr int kPassCount = int(PassKind::ShadowCatcher) + 1;
constexpr float kEmptyDepth = 1e10f;
constexpr int kRowsPerLock = 16;  // resolve lets merging workers in between bands of rows

PassKind colour_of(PassKind kind) {
    switch (kind) {
        case PassKind::DiffuseDirect:
        case PassKind::DiffuseIndirect:
            return PassKind::DiffuseColor;
        case PassKind::GlossyDirect:
        case PassKind::GlossyIndirect:
            return PassKind::GlossyColor;
        case PassKind::TransmissionDirect:
        case PassKind::TransmissionIndirect:
            return PassKind::TransmissionColor;
        default:
            return kind;
    }
}

bool is_light_pass(PassKind kind) {
    return colour_of(kind) != kind;
}

bool is_data_pass(PassKind kind) {
    return kind != PassKind::Combined && kind != PassKind::Emission && kind != PassKind::Environment && kind != PassKind::SampleCount &&
           kind != PassKind::ShadowCatcher && !is_light_pass(kind);
}

// Light over colour. Where a channel of the colour is zero so is its light, and the quotient is free: the mean of the
// other channels keeps grey light grey on a red surface, as in Blender.
void divide_by_colour(const float* light, const float* colour, float scale, float* out) {
    float sum = 0;
    int known = 0;
    for (int c = 0; c < 3; ++c) {
        out[c] = colour[c] != 0.0f ? scale * light[c] / colour[c] : 0.0f;
        if (colour[c] != 0.0f) {
            sum += out[c];
            ++known;
        }
    }
    for (int c = 0; c < 3; ++c)
        if (colour[c] == 0.0f && known) out[c] = sum / float(known);
}

/// Light on catchers over their light without all else, with white where nothing was met. `combined` and `catcher` are a pixel's sums.
void catcher_ratio(const float* combined, const float* catcher, float scale, float* out) {
    std::fill_n(out, 3, 1.0f);
    if (catcher[kCatcherCount] == 0.0f) return;
    float light[3], ratio[3];
    for (int c = 0; c < 3; ++c) light[c] = combined[c] - catcher[c];
    divide_by_colour(light, catcher + kCatcherAlone, 1.0f, ratio);
    const float alpha = saturate(1.0f - combined[3] * scale);
    for (int c = 0; c < 3; ++c) out[c] = 1.0f - alpha + alpha * ratio[c];
}

/// What the picture shows where nobody asks for the catchers' pass: the matte over the catchers' shadow (black, as opaque as the shadow is dark), and
/// that over the background when the film is not transparent.
void matte_over_shadow(const float* combined, const float* catcher, float scale, float exposure, bool transparent, float* out) {
    float ratio[3];
    catcher_ratio(combined, catcher, scale, ratio);
    const float matte = saturate(1.0f - catcher[3] * scale), shadow = saturate(1.0f - (ratio[0] + ratio[1] + ratio[2]) / 3.0f),
                alpha = (1.0f - matte) * shadow + matte;
    for (int c = 0; c < 3; ++c) out[c] = scale * exposure * (catcher[c] + (transparent ? 0.0f : (1.0f - alpha) * catcher[kCatcherBackground + c]));
    out[3] = transparent ? alpha : 1.0f;
}

}  // namespace

FilmLayout::FilmLayout() {
    std::fill(std::begin(offset), std::end(offset), -1);
    static_assert(kPassCount <= int(sizeof(offset) / sizeof(offset[0])));
}

int pass_channels(PassKind kind) {
    switch (kind) {
        case PassKind::Combined:
            return 4;
        case PassKind::Depth:
        case PassKind::Mist:
        case PassKind::ObjectIndex:
        case PassKind::MaterialIndex:
        case PassKind::SampleCount:
            return 1;
        default:
            return 3;
    }
}

bool is_single_sample(PassKind kind) {
    return kind == PassKind::Depth || kind == PassKind::Position || kind == PassKind::ObjectIndex || kind == PassKind::MaterialIndex;
}

FilmLayout make_layout(std::span<const PassKind> passes, bool has_catchers, size_t aov_count, size_t group_count) {
    bool wanted[kPassCount] = {};
    for (PassKind kind : passes) {
        if (int(kind) >= kPassCount) continue;
        wanted[int(kind)] = true;
        wanted[int(colour_of(kind))] = true;
    }
    wanted[int(PassKind::Combined)] |= wanted[int(PassKind::ShadowCatcher)];  // the light with everything
    FilmLayout layout;
    for (int k = 0; k < kPassCount; ++k) {
        const PassKind kind = PassKind(k);
        if (!wanted[k] || kind == PassKind::SampleCount || kind == PassKind::ShadowCatcher) continue;
        layout.offset[k] = layout.stride;
        layout.stride += pass_channels(kind) + is_single_sample(kind);
        layout.light_passes |= is_light_pass(kind);
        layout.data_passes |= is_data_pass(kind);
        layout.data_sums |= is_data_pass(kind) && !is_single_sample(kind);
    }
    if (wanted[int(PassKind::SampleCount)]) layout.offset[int(PassKind::SampleCount)] = 0;      // answered from the counts, no storage
    if (wanted[int(PassKind::ShadowCatcher)]) layout.offset[int(PassKind::ShadowCatcher)] = 0;  // computed from others
    if (has_catchers && wanted[int(PassKind::Combined)]) {
        layout.catcher = layout.stride;
        layout.stride += kCatcherFloats;
    }
    if (aov_count > 0) {
        layout.aovs = layout.stride;
        layout.stride += int(aov_count) * kAovFloats;
        layout.data_passes = layout.data_sums = true;
    }
    if (group_count > 0) {
        layout.light_groups = layout.stride;
        layout.stride += int(group_count) * kLightGroupFloats;
    }
    return layout;
}

std::vector<PackedPixel> list_pixels(int width, int height, int side) {
    std::vector<PackedPixel> pixels;
    pixels.reserve(size_t(std::max(width, 0)) * size_t(std::max(height, 0)));
    for (int y0 = 0; y0 < height; y0 += side)
        for (int x0 = 0; x0 < width; x0 += side)
            for (int y = y0; y < std::min(y0 + side, height); ++y)
                for (int x = x0; x < std::min(x0 + side, width); ++x) pixels.push_back(pack_pixel(x, y));
    return pixels;
}

void TileFilm::reset(const FilmLayout& layout, int pixel_count, int planes) {
    layout_ = &layout;
    pixel_count_ = pixel_count;
    planes_ = planes;
    sums_.assign(size_t(pixel_count) * size_t(planes) * size_t(layout.stride), 0.0f);
    pixels_ = sums_.data();
}

Film::Film(const FilmLayout& layout, int width, int height, bool halves) : layout_(layout), width_(std::max(width, 0)), height_(std::max(height, 0)) {
    const size_t pixels = size_t(width_) * size_t(height_);
    sums_.assign(pixels * size_t(layout_.stride), 0.0f);
    samples_.assign(pixels, 0);
    if (halves) second_half_.assign(pixels * 3, 0.0f);
}

void Film::merge(const TileFilm& tile, std::span<const PackedPixel> pixels, int samples) {
    const size_t stride = size_t(layout_.stride), count = pixels.size();
    const int combined = layout_.offset[int(PassKind::Combined)];

    std::lock_guard lock(mutex_);
    for (size_t i = 0; i < count; ++i) {
        const size_t place = place_of(pixels[i]);
        float* to = sums_.data() + place * stride;
        for (size_t plane = 0; plane < size_t(tile.planes()); ++plane) {
            const float* from = tile.pixels() + (plane * count + i) * stride;
            // Only the tile that has the first sample has anything in the channels that keep one value.
            for (size_t f = 0; f < stride; ++f) to[f] += from[f];
            if (plane == 1)
                for (size_t c = 0; c < 3; ++c) second_half_[place * 3 + c] += from[size_t(combined) + c];
        }
        samples_[place] += samples;
        most_samples_ = std::max(most_samples_, samples_[place]);
    }
}

Film::HalfSums Film::half_sums(PackedPixel pixel) const {
    const size_t place = place_of(pixel);
    const float* all = sums_.data() + place * size_t(layout_.stride) + layout_.offset[int(PassKind::Combined)];
    const float* second = second_half_.data() + place * 3;
    return {{all[0], all[1], all[2]}, {second[0], second[1], second[2]}, samples_[place]};
}

/// write(the pixel's sums, 1 / samples, where to) for every pixel that has samples; the others are `empty`.
void Film::each_pixel(size_t channels, float empty, std::span<float> out, auto&& write) const {
    const size_t stride = size_t(layout_.stride), width = size_t(width_);
    if (out.size() < size_t(height_) * width * channels) throw Error("Film: the buffer for a pass is too small");
    for (int band = 0; band < height_; band += kRowsPerLock) {
        std::lock_guard lock(mutex_);
        const size_t end = size_t(std::min(band + kRowsPerLock, height_)) * width;
        for (size_t i = size_t(band) * width; i < end; ++i) {
            float* result = out.data() + i * channels;
            if (samples_[i] > 0) {
                write(sums_.data() + i * stride, 1.0f / float(samples_[i]), result);
            } else {
                std::fill_n(result, channels, empty);
            }
        }
    }
}

void Film::resolve_aov(size_t aov, bool is_color, std::span<float> out) const {
    const size_t channels = is_color ? 4 : 1, offset = size_t(layout_.aovs) + aov * kAovFloats;
    each_pixel(channels, 0.0f, out, [&](const float* pixel, float scale, float* result) {
        for (size_t c = 0; c < channels; ++c) result[c] = pixel[offset + c] * scale;
    });
}

void Film::resolve_light_group(size_t group, const scene::Settings& settings, std::span<float> out) const {
    const size_t offset = size_t(layout_.light_groups) + group * kLightGroupFloats;
    each_pixel(3, 0.0f, out, [&](const float* pixel, float scale, float* result) {
        for (size_t c = 0; c < 3; ++c) result[c] = pixel[offset + c] * scale * settings.film_exposure;
    });
}

void Film::resolve(PassKind kind, const scene::Settings& settings, std::span<float> out) const {
    const size_t channels = size_t(pass_channels(kind));
    if (out.size() < size_t(width_) * size_t(height_) * channels) throw Error("Film: the buffer for a pass is too small");
    const int offset = layout_.offset[int(kind)];
    const bool is_light = is_light_pass(kind);
    const bool has_exposure = is_light || kind == PassKind::Combined || kind == PassKind::Emission || kind == PassKind::Environment;
    const float exposure = has_exposure ? settings.film_exposure : 1.0f, empty = kind == PassKind::Depth ? kEmptyDepth : 0.0f;
    const auto each_pixel = [&](auto&& write) { this->each_pixel(channels, empty, out, write); };
    if (offset < 0) {
        std::fill_n(out.data(), size_t(height_) * size_t(width_) * channels, empty);
    } else if (kind == PassKind::SampleCount) {
        const float scale = 1.0f / float(std::max(most_samples_, 1));
        each_pixel([&](const float*, float inverse_samples, float* result) { result[0] = scale / inverse_samples; });
    } else if (kind == PassKind::ShadowCatcher) {
        const int combined = layout_.offset[int(PassKind::Combined)];
        each_pixel([&](const float* pixel, float scale, float* result) {
            if (layout_.catcher >= 0)
                catcher_ratio(pixel + combined, pixel + layout_.catcher, scale, result);
            else
                std::fill_n(result, channels, 1.0f);
        });
    } else if (kind == PassKind::Combined && layout_.catcher >= 0 && layout_.has(PassKind::ShadowCatcher)) {
        each_pixel([&](const float* pixel, float scale, float* result) {
            const float* matte = pixel + layout_.catcher;
            for (int c = 0; c < 3; ++c) result[c] = matte[c] * scale * exposure;
            result[3] = saturate(1.0f - matte[3] * scale);
        });
    } else if (kind == PassKind::Combined && layout_.catcher >= 0) {
        each_pixel([&](const float* pixel, float scale, float* result) {
            matte_over_shadow(pixel + offset, pixel + layout_.catcher, scale, exposure, settings.film_transparent, result);
        });
    } else if (is_single_sample(kind)) {
        each_pixel([&](const float* pixel, float, float* result) {
            const float* value = pixel + offset;
            for (size_t c = 0; c < channels; ++c) result[c] = value[channels] > 0.0f ? value[c] : empty;
        });
    } else if (is_light) {
        const int colour_offset = layout_.offset[int(colour_of(kind))];
        each_pixel([&](const float* pixel, float, float* result) { divide_by_colour(pixel + offset, pixel + colour_offset, exposure, result); });
    } else if (kind == PassKind::Mist) {
        each_pixel([&](const float* pixel, float scale, float* result) { result[0] = saturate(1.0f - pixel[offset] * scale); });
    } else if (kind == PassKind::Combined) {
        each_pixel([&](const float* pixel, float scale, float* result) {
            for (int c = 0; c < 3; ++c) result[c] = pixel[offset + c] * scale * exposure;
            result[3] = saturate(1.0f - pixel[offset + 3] * scale);
        });
    } else {
        each_pixel([&](const float* pixel, float scale, float* result) {
            for (size_t c = 0; c < channels; ++c) result[c] = pixel[size_t(offset) + c] * scale * exposure;
        });
    }
}

int Film::samples_at(int x, int y) const {
    if (x < 0 || y < 0 || x >= width_ || y >= height_) return 0;
    std::lock_guard lock(mutex_);
    return samples_[size_t(y) * size_t(width_) + size_t(x)];
}

void Film::clear() {
    std::lock_guard lock(mutex_);
    std::fill(sums_.begin(), sums_.end(), 0.0f);
    std::fill(second_half_.begin(), second_half_.end(), 0.0f);
    std::fill(samples_.begin(), samples_.end(), 0);
    most_samples_ = 0;
}

size_t Film::bytes() const {
    return (sums_.capacity() + second_half_.capacity()) * sizeof(float) + samples_.capacity() * sizeof(int32_t);
}

}  // namespace talbot::film
