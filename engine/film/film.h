/// The film: passes as sums over samples. Stages know one door, `add`; which passes a contribution feeds is data.
///
/// A worker accumulates into a `TileFilm` of its own (sums of a list of pixels over one sample range) and merges it into
/// the `Film`; the lists of a sample range share no pixel, so sums do not depend on the number of threads.
///
/// Within a pixel each pass owns its channels as floats. What they hold:
///   Combined                          sums of r, g, b and of transparency (alpha = 1 - mean transparency)
///   light, emission, colour, normal,
///   UV and denoising passes           sums over samples; `resolve` divides by the sample count
///   Mist                              sum of (1 - mist) * weight
///   AOVs of the scene                 sums of r, g, b (or of the value), and how often something was written
///   light groups of the scene         sums of r, g, b: the part of Combined that comes from their emitters
///   SampleCount                       nothing: it is a pixel's samples over those of the pixel that took most
///   ShadowCatcher                     nothing of its own, see `catcher`; where it is asked for, Combined is the matte, with nothing in the catchers' place,
///                                     else the matte over the shadows and the background
///   Depth, Position, ObjectIndex,
///   MaterialIndex                     the first sample's value and, one float more, whether there is one: nothing to average there
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
    int catcher = -1;           ///< where shadow catchers are: sums of the matte (r, g, b, transparency), of the catchers alone (r, g, b), the number of
                                ///< samples that met one first, and the background behind them (r, g, b)
    int aovs = -1;              ///< where the first of the scene's AOVs is, the others kAovFloats apart
    int light_groups = -1;      ///< where the first of the scene's light groups is, the others kLightGroupFloats apart
    bool light_passes = false;  ///< any of diffuse/glossy/transmission direct/indirect
    bool data_passes = false;   ///< any pass of the first hit (depth, normal, colours ...)
    bool data_sums = false;     ///< any of these that takes every sample
    FilmLayout();
    TALBOT_MEMBER bool has(scene::PassKind kind) const { return offset[int(kind)] >= 0; }
};
/// Within FilmLayout::catcher.
inline constexpr int kCatcherAlone = 4, kCatcherCount = 7, kCatcherBackground = 8, kCatcherFloats = 11;
inline constexpr int kAovFloats = 4, kLightGroupFloats = 3;
/// A light pass is divided by its colour pass, so it brings that one along. `aov_count`, `group_count`: of Scene::aovs and Scene::light_groups.
FilmLayout make_layout(std::span<const scene::PassKind> passes, bool has_catchers = false, size_t aov_count = 0, size_t group_count = 0);
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
    Catcher,      ///< found by a path that sees shadow catchers only
};

/// A pixel's place in a film: x in the low 16 bits, y in the high ones, from the bottom left.
using PackedPixel = uint32_t;
TALBOT_INLINE PackedPixel pack_pixel(int x, int y) {
    return uint32_t(x) | uint32_t(y) << 16;
}
TALBOT_INLINE int pixel_x(PackedPixel p) {
    return int(p & 0xffffu);
}
TALBOT_INLINE int pixel_y(PackedPixel p) {
    return int(p >> 16);
}
/// All pixels of a film, square tiles of this side one after another: neighbours in the list are neighbours in the picture.
std::vector<PackedPixel> list_pixels(int width, int height, int side);

/// Which half of a render's samples its n-th belongs to (0 or 1). Both halves of the first 4 k samples are equally large and as evenly spread as the whole
/// [Christensen, Kensler, Kilpatrick 2018, "Progressive Multi-Jittered Sample Sequences", section 10.2.1], so that their difference tells the error.
TALBOT_INLINE int sample_half(uint32_t n) {
    return __builtin_parity(n & 0xaaaaaaaau);
}

/// n contributions. `pixel` indexes the tile: a place in its list of pixels, plus the list's length in the second half's plane.
struct Contributions {
    const int32_t* pixel = nullptr;
    ConstColumns3 rgb;                     ///< radiance times throughput, clamped already
    ConstColumns3 diffuse, glossy;         ///< share of the first scattering (0..1 a channel; the rest is transmission); null when no light passes are wanted
    const int32_t* matte = nullptr;        ///< 1: belongs to the matte; null where there are no shadow catchers
    const int32_t* light_group = nullptr;  ///< of what shines, -1: of none; null where there are no light groups
    int n = 0;
};

/// Sums of a list of pixels, in one plane or in two: one for each half of the samples. The layout must outlive it.
class TileFilm {
public:
    void reset(const FilmLayout& layout, int pixel_count, int planes = 1);
    TALBOT_MEMBER const FilmLayout& layout() const { return *layout_; }
    TALBOT_MEMBER float* pixels() { return pixels_; }
    TALBOT_MEMBER const float* pixels() const { return pixels_; }
    int pixel_count() const { return pixel_count_; }
    int planes() const { return planes_; }

private:
    const FilmLayout* layout_ = nullptr;
    int pixel_count_ = 0, planes_ = 1;
    float* pixels_ = nullptr;  ///< sums_.data(): kernels touch no containers
    std::vector<float> sums_;
};

/// The frame (or its crop). Row-major, bottom row first.
class Film {
public:
    /// `halves`: keeps what `half_sums` needs. The layout has to hold Combined then, and tiles two planes.
    Film(const FilmLayout& layout, int width, int height, bool halves = false);
    const FilmLayout& layout() const { return layout_; }
    int width() const { return width_; }
    int height() const { return height_; }
    bool halves() const { return !second_half_.empty(); }
    /// Adds a tile's sums to its pixels, which lie in the film, and `samples` to their counts. Thread-safe.
    void merge(const TileFilm& tile, std::span<const PackedPixel> pixels, int samples);
    /// Mean of a pass as it goes to Blender: exposure applied where it belongs, light passes divided by colour, alpha composed, depth 1e10 where empty.
    /// out: width*height*pass_channels(kind). Thread-safe, any time.
    void resolve(scene::PassKind kind, const scene::Settings& settings, std::span<float> out) const;
    /// Means of an AOV: width*height*4 of a colour (alpha counts what was written), width*height of a value.
    void resolve_aov(size_t aov, bool is_color, std::span<float> out) const;
    /// Means of a light group: width*height*3.
    void resolve_light_group(size_t group, const scene::Settings& settings, std::span<float> out) const;
    int samples_at(int x, int y) const;
    /// Red, green and blue of a pixel's sums over all samples and over those of the second half, and its samples. Not while workers merge.
    struct HalfSums {
        float all[3], second[3];
        int samples;
    };
    HalfSums half_sums(PackedPixel pixel) const;
    void clear();
    size_t bytes() const;

private:
    void each_pixel(size_t channels, float empty, std::span<float> out, auto&& write) const;
    size_t place_of(PackedPixel p) const { return size_t(pixel_y(p)) * size_t(width_) + size_t(pixel_x(p)); }
    FilmLayout layout_;
    int width_ = 0, height_ = 0;
    std::vector<float> sums_;
    std::vector<float> second_half_;  ///< Combined's red, green and blue over the second half of the samples; or empty
    std::vector<int32_t> samples_;
    int most_samples_ = 0;  ///< in any pixel
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
void add_alpha(TileFilm& tile, const int32_t* pixel, const float* transparency, int n, const int32_t* matte = nullptr);
/// Camera paths that meet a shadow catcher first: the matte lets their throughput (mean of channels) pass.
void add_catcher_hits(TileFilm& tile, const int32_t* pixel, const float* throughput, int n);
/// The world behind them.
void add_background(TileFilm& tile, const int32_t* pixel, ConstColumns3 rgb, int n);
/// One of the scene's AOVs, as it comes: neither throughput nor opacity weigh it. `writes`: by how many nodes.
void add_aov(TileFilm& tile, int aov, int writes, const int32_t* pixel, ConstColumns3 rgb, int n);
/// First-hit data pass of `pass_channels(kind)` columns, weighted (1 at opaque first hits; transparent ones carry their share).
/// Single-sample passes keep the latest value. Mist takes `mist_amount`. Passes that are not wanted are ignored.
void add_data(TileFilm& tile, scene::PassKind kind, const int32_t* pixel, const float* const* columns, const float* weight, int n);

}  // namespace TALBOT_ISA
}  // namespace talbot::film
