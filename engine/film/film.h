/// The film: passes as sums over samples. Stages know one door, `add`; which passes a contribution feeds is data.
///
/// A worker accumulates into a `TileFilm` of its own (sums of one tile over one sample range) and merges it into the
/// `Film` in a fixed order, so sums do not depend on the number of threads.
///
/// Within a pixel each pass owns its channels as floats. What they hold:
///   Combined                          sums of r, g, b and of transparency (alpha = 1 - mean transparency)
///   light, emission, colour, normal,
///   UV and denoising passes           sums over samples; `resolve` divides by the sample count
///   Mist                              sum of (1 - mist) * weight
///   Depth, Position, ObjectIndex,
///   MaterialIndex                     one sample's value and, one float more, its weight: nothing to average there
#pragma once

#include <atomic>
#include <cmath>
#include <cstdint>
#include <mutex>
#include <span>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/lanes.h"
#include "scene/scene.h"

namespace talbot::film {

/// Where the floats of each pass lie within a pixel. Index by PassKind; -1: not wanted.
struct FilmLayout {
    int offset[64];
    int stride = 0;             ///< floats a pixel
    bool light_passes = false;  ///< any of diffuse/glossy/transmission direct/indirect
    bool data_passes = false;   ///< any pass of the first hit (depth, normal, colours ...)
    FilmLayout();
    TALBOT_MEMBER bool has(scene::PassKind kind) const { return offset[int(kind)] >= 0; }
};
/// A light pass is divided by its colour pass, so it brings that one along.
FilmLayout make_layout(std::span<const scene::PassKind> passes);
int pass_channels(scene::PassKind kind);
/// True for the passes that keep one sample's value (see above).
bool is_single_sample(scene::PassKind kind);
/// Mist of a hit at `distance` from the camera: 0 near, 1 far, falloff applied.
TALBOT_INLINE float mist_amount(const scene::Settings& settings, float distance) {
    const float m = settings.mist_depth > 0.0f ? saturate((distance - settings.mist_start) / settings.mist_depth) : float(distance > settings.mist_start);
    return settings.mist_falloff == 0 ? m * m : settings.mist_falloff == 1 ? m : std::sqrt(m);
}

/// What a contribution is, for the passes.
enum class Category : uint8_t {
    Emission,     ///< seen directly: emissive surface or lamp
    Environment,  ///< seen directly: world
    Direct,       ///< one scattering: light sampled at the first hit, or found by the first scattered ray
    Indirect,     ///< more than one
};

/// n contributions. `pixel` indexes the tile (row-major, bottom row first).
struct Contributions {
    const int32_t* pixel = nullptr;
    ConstColumns3 rgb;              ///< radiance times throughput, clamped already
    ConstColumns3 diffuse, glossy;  ///< share of the first scattering (0..1 a channel; the rest is transmission); null when no light passes are wanted
    int n = 0;
};

/// Sums of one tile. The layout must outlive it.
class TileFilm {
public:
    void reset(const FilmLayout& layout, int width, int height);
    TALBOT_MEMBER const FilmLayout& layout() const { return *layout_; }
    TALBOT_MEMBER float* pixels() { return pixels_; }
    TALBOT_MEMBER const float* pixels() const { return pixels_; }
    int width() const { return width_; }
    int height() const { return height_; }

private:
    const FilmLayout* layout_ = nullptr;
    int width_ = 0, height_ = 0;
    float* pixels_ = nullptr;  ///< sums_.data(): kernels touch no containers
    std::vector<float> sums_;
};

/// The frame (or its crop). Row-major, bottom row first.
class Film {
public:
    Film(const FilmLayout& layout, int width, int height);
    const FilmLayout& layout() const { return layout_; }
    int width() const { return width_; }
    int height() const { return height_; }
    /// Adds a tile's sums at (x, y) and `samples` to its pixels' counts. Thread-safe. What lies outside the film is dropped.
    void merge(const TileFilm& tile, int x, int y, int samples);
    /// Mean of a pass as it goes to Blender: exposure applied where it belongs, light passes divided by colour, alpha composed, depth 1e10 where empty.
    /// out: width*height*pass_channels(kind). Thread-safe, any time.
    void resolve(scene::PassKind kind, const scene::Settings& settings, std::span<float> out) const;
    int samples_at(int x, int y) const;
    void clear();
    size_t bytes() const;

private:
    FilmLayout layout_;
    int width_ = 0, height_ = 0;
    std::vector<float> sums_;
    std::vector<int32_t> samples_;
    mutable std::mutex mutex_;
};

/// Open Image Denoise, found and loaded at run time. One sentence when it is not there.
struct DenoiseResult {
    bool ok = false;
    std::string message;
};
/// color, albedo, normal: width*height*3, linear; albedo and normal may be empty. Result replaces color. `library_dirs`: where to look first.
DenoiseResult denoise(std::span<float> color, std::span<const float> albedo, std::span<const float> normal, int width, int height, int threads,
                      const std::vector<std::string>& library_dirs, const std::atomic<bool>* cancel);
/// "2.3.3", or "" when no library is found.
std::string denoiser_version(const std::vector<std::string>& library_dirs);

/// Pixel filter as 1024 inverse-CDF offsets (pixels, centred on 0): position = centre + filter[u * 1024].
std::vector<float> make_filter_table(scene::PixelFilter filter, float width);

inline namespace TALBOT_ISA {  // kernels

/// The one door for radiance.
void add(TileFilm& tile, Category category, const Contributions& c);
/// Alpha: 1 - transparency, one value a path, summed. Only with film_transparent or holdouts.
void add_alpha(TileFilm& tile, const int32_t* pixel, const float* transparency, int n);
/// First-hit data pass of `pass_channels(kind)` columns, weighted (1 at opaque first hits; transparent ones carry their share).
/// Single-sample passes keep the latest value until one came with a weight of at least 0.5 (Blender's pass_alpha_threshold): exactly Blender's rule when
/// only the first sample's lanes are sent, and very nearly when all are. Mist takes `mist_amount`. Passes that are not wanted are ignored.
void add_data(TileFilm& tile, scene::PassKind kind, const int32_t* pixel, const float* const* columns, const float* weight, int n);

}  // namespace TALBOT_ISA
}  // namespace talbot::film
