/// Images in memory as kernels look them up: linear working-space texels, bottom row first, read by span.
///
/// Loading (OpenImageIO) and colour conversion (OpenColorIO, Blender's own config) happen once in `load_images`; lookups are ours.
/// Pixel centres are at half-integers: texel x covers u in [x, x+1)/width.
///
/// The order of things is Blender's (measured in 3.4.1 and 5.0): integer texels in sRGB stay encoded, are multiplied by their alpha
/// *encoded*, are filtered *encoded*, and decoded last; every other colour space is converted to linear when loaded. An image whose colour space is data,
/// or whose alpha is channel-packed or ignored, is not multiplied by alpha.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <vector>

#include "base/error.h"
#include "base/lanes.h"
#include "scene/scene.h"

namespace talbot::asset {

/// 1: grey with alpha 1; 4: RGBA. Byte and Short are fractions of 255 and 65535.
enum class TexelFormat : uint8_t { Byte1, Byte4, Half1, Half4, Float1, Float4, Short1, Short4 };
enum class Interpolation : uint8_t { Linear, Closest, Cubic, Smart };
enum class Extension : uint8_t { Repeat, Extend, Clip, Mirror };

/// One image or one UDIM tile. Texels are finite.
struct Texture {
    const void* texels = nullptr;  ///< null: missing, reads as magenta (1, 0, 1, 1)
    int width = 0, height = 0;
    TexelFormat format = TexelFormat::Float4;
    const float* decode =
        nullptr;                 ///< encoded RGB (Byte, Short): linear value at k/255, 257 entries, interpolated between (error < 1e-5); null: linear already
    bool is_associated = false;  ///< colour is multiplied by alpha
    int first_tile = -1;         ///< UDIM: index of tile 1001's entry in TextureTable::tiles, else -1
    bool is_missing = false;
};

/// Read-only while rendering. Index = scene image handle.
struct TextureTable {
    const Texture* textures = nullptr;
    int count = 0;
    const int32_t* tiles = nullptr;  ///< 100 entries a tiled image (u + 10 v): index into `textures`, -1: no such tile
};

/// Owns the texels. Images already loaded (same shared_ptr) are kept on update.
class TextureStore {
public:
    TextureStore();
    ~TextureStore();
    /// Loads what is new, drops what is gone. Missing or corrupt files become magenta and one warning each.
    /// Throws Cancelled when *cancel turns true.
    void update(const scene::Scene& scene, Report& report, const std::atomic<bool>* cancel);
    const TextureTable& table() const;
    size_t bytes() const;  ///< memory of all texels

private:
    struct State;
    std::unique_ptr<State> state_;
};

inline namespace TALBOT_ISA {  // kernels

/// RGBA of image `handle[i]` at (u, v). A handle that is none (-1) or out of range, a missing image and a UDIM tile that is not there read as magenta with
/// alpha 1, as in Blender. `unassociate`: divide the colour by alpha where the image's colour is multiplied by it (Blender does when the node's Alpha output
/// is used); otherwise it comes multiplied. Any n; u and v may be anything, NaN too.
void lookup_texture(const TextureTable& table, const int32_t* handle, const float* u, const float* v, int n, Interpolation interpolation, Extension extension,
                    Columns3 rgb, float* alpha, bool unassociate = false);

}  // namespace TALBOT_ISA
}  // namespace talbot::asset
