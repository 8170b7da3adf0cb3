/// The film: passes as sums over samples. Stages know one door, `add`; which passes a contribution feeds is data.
///
/// A worker accumulates into a `TileFilm` of its own (sums of one tile over one sample range) and merges it into the
/// `Film` in a fixed order, so sums do not depend on the number of threads.
#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <span>
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
    bool has(scene::PassKind kind) const { return offset[int(kind)] >= 0; }
};
FilmLayout make_layout(std::span<const scene::PassKind> passes);
int pass_channels(scene::PassKind kind);

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

/// Sums of one tile.
class TileFilm {
public:
    void reset(const FilmLayout& layout, int width, int height);
    const FilmLayout& layout() const { return *layout_; }
    float* pixels() { return sums_.data(); }
    const float* pixels() const { return sums_.data(); }
    int width() const { return width_; }
    int height() const { return height_; }

private:
    const FilmLayout* layout_ = nullptr;
    int width_ = 0, height_ = 0;
    std::vector<float> sums_;
};

/// The frame (or its crop). Row-major, bottom row first.
class Film {
public:
    Film(const FilmLayout& layout, int width, int height);
    const FilmLayout& layout() const { return layout_; }
    int width() const { return width_; }
    int height() const { return height_; }
    /// Adds a tile's sums at (x, y) and `samples` to its pixels' counts. Thread-safe.
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
/// First-hit data pass of `channels` columns, weighted (1 at opaque first hits; transparent ones carry their share).
void add_data(TileFilm& tile, scene::PassKind kind, const int32_t* pixel, const float* const* columns, const float* weight, int n);

}  // namespace TALBOT_ISA
}  // namespace talbot::film
