// Adding to a tile. Lanes of one span may share a pixel, so these loops go lane by lane; a pixel's floats lie side by
// side, which makes that one cache line or two a lane.
#include "film/film.h"

namespace talbot::film {
inline namespace TALBOT_ISA {

namespace {

TALBOT_INLINE void add3(float* sum, Vec3 v) {
    sum[0] += v.x;
    sum[1] += v.y;
    sum[2] += v.z;
}

TALBOT_INLINE void add_simple(float* pixels, int stride, int combined, int own, const Contributions& c) {
    for (int i = 0; i < c.n; ++i) {
        const Vec3 v = load(c.rgb, i);
        if (!is_finite(v)) continue;
        float* pixel = pixels + size_t(c.pixel[i]) * size_t(stride);
        if (combined >= 0) add3(pixel + combined, v);
        if (own >= 0) add3(pixel + own, v);
    }
}

}  // namespace

void add(TileFilm& tile, Category category, const Contributions& c) {
    using scene::PassKind;
    const FilmLayout& layout = tile.layout();
    float* pixels = tile.pixels();
    const int stride = layout.stride;
    const auto offset = [&](PassKind kind) { return layout.offset[int(kind)]; };
    const int combined = offset(PassKind::Combined);
    if (layout.catcher >= 0) {
        if (category == Category::Catcher) return add_simple(pixels, stride, layout.catcher + kCatcherAlone, -1, c);
        for (int i = 0; c.matte && i < c.n; ++i) {
            const Vec3 v = load(c.rgb, i);
            if (c.matte[i] && is_finite(v)) add3(pixels + size_t(c.pixel[i]) * size_t(stride) + layout.catcher, v);
        }
    }
    if (layout.light_groups >= 0 && c.light_group) {
        for (int i = 0; i < c.n; ++i) {
            const Vec3 v = load(c.rgb, i);
            if (c.light_group[i] < 0 || !is_finite(v)) continue;
            add3(pixels + size_t(c.pixel[i]) * size_t(stride) + layout.light_groups + c.light_group[i] * kLightGroupFloats, v);
        }
    }

    if (category == Category::Emission || category == Category::Environment) {
        add_simple(pixels, stride, combined, offset(category == Category::Emission ? PassKind::Emission : PassKind::Environment), c);
        return;
    }
    if (!layout.light_passes || !c.diffuse.x || !c.glossy.x) {
        add_simple(pixels, stride, combined, -1, c);
        return;
    }
    const bool direct = category == Category::Direct;
    const int diffuse = offset(direct ? PassKind::DiffuseDirect : PassKind::DiffuseIndirect);
    const int glossy = offset(direct ? PassKind::GlossyDirect : PassKind::GlossyIndirect);
    const int transmission = offset(direct ? PassKind::TransmissionDirect : PassKind::TransmissionIndirect);
    for (int i = 0; i < c.n; ++i) {
        const Vec3 v = load(c.rgb, i);
        if (!is_finite(v)) continue;
        float* pixel = pixels + size_t(c.pixel[i]) * size_t(stride);
        if (combined >= 0) add3(pixel + combined, v);
        const Vec3 d = v * load(c.diffuse, i), g = v * load(c.glossy, i);
        if (!is_finite(d) || !is_finite(g)) continue;
        if (diffuse >= 0) add3(pixel + diffuse, d);
        if (glossy >= 0) add3(pixel + glossy, g);
        if (transmission >= 0) add3(pixel + transmission, v - d - g);
    }
}

void add_alpha(TileFilm& tile, const int32_t* pixel, const float* transparency, int n, const int32_t* matte) {
    const FilmLayout& layout = tile.layout();
    const int combined = layout.offset[int(scene::PassKind::Combined)];
    if (combined < 0) return;
    float* pixels = tile.pixels() + combined + 3;
    for (int i = 0; i < n; ++i) {
        const float t = transparency[i];
        if (t - t == 0.0f) pixels[size_t(pixel[i]) * size_t(layout.stride)] += t;
    }
    if (layout.catcher < 0 || !matte) return;
    float* alphas = tile.pixels() + layout.catcher + 3;
    for (int i = 0; i < n; ++i)
        if (matte[i] && transparency[i] - transparency[i] == 0.0f) alphas[size_t(pixel[i]) * size_t(layout.stride)] += transparency[i];
}

void add_catcher_hits(TileFilm& tile, const int32_t* pixel, const float* throughput, int n) {
    const FilmLayout& layout = tile.layout();
    if (layout.catcher < 0) return;
    for (int i = 0; i < n; ++i) {
        float* sums = tile.pixels() + size_t(pixel[i]) * size_t(layout.stride) + layout.catcher;
        sums[3] += throughput[i] - throughput[i] == 0.0f ? throughput[i] : 0.0f;
        sums[kCatcherCount] += 1.0f;
    }
}

void add_background(TileFilm& tile, const int32_t* pixel, ConstColumns3 rgb, int n) {
    const FilmLayout& layout = tile.layout();
    if (layout.catcher < 0) return;
    for (int i = 0; i < n; ++i) {
        const Vec3 v = load(rgb, i);
        if (is_finite(v)) add3(tile.pixels() + size_t(pixel[i]) * size_t(layout.stride) + layout.catcher + kCatcherBackground, v);
    }
}

void add_aov(TileFilm& tile, int aov, int writes, const int32_t* pixel, ConstColumns3 rgb, int n) {
    const FilmLayout& layout = tile.layout();
    for (int i = 0; i < n; ++i) {
        const Vec3 v = load(rgb, i);
        if (!is_finite(v)) continue;
        float* sums = tile.pixels() + size_t(pixel[i]) * size_t(layout.stride) + layout.aovs + aov * kAovFloats;
        add3(sums, v);
        sums[3] += float(writes);
    }
}

void add_data(TileFilm& tile, scene::PassKind kind, const int32_t* pixel, const float* const* columns, const float* weight, int n) {
    using scene::PassKind;
    const FilmLayout& layout = tile.layout();
    const int offset = layout.offset[int(kind)];
    if (offset < 0 || kind == PassKind::SampleCount) return;
    float* pixels = tile.pixels() + offset;
    const bool single = kind == PassKind::Depth || kind == PassKind::Position || kind == PassKind::ObjectIndex || kind == PassKind::MaterialIndex;
    const bool scalar = kind == PassKind::Depth || kind == PassKind::Mist || kind == PassKind::ObjectIndex || kind == PassKind::MaterialIndex;
    const float* x = columns[0];
    const float* y = columns[scalar ? 0 : 1];
    const float* z = columns[scalar ? 0 : 2];
    const float mist = kind == PassKind::Mist ? 1.0f : 0.0f;

    for (int i = 0; i < n; ++i) {
        const float w = weight[i];
        const Vec3 v{x[i], y[i], z[i]};
        if (!is_finite(v * w)) continue;
        float* sum = pixels + size_t(pixel[i]) * size_t(layout.stride);
        if (single) {
            sum[scalar ? 1 : 3] = w > 0.0f ? 1.0f : 0.0f;
            sum[0] = v.x;
            if (!scalar) {
                sum[1] = v.y;
                sum[2] = v.z;
            }
        } else if (scalar) {
            sum[0] += (mist > 0.0f ? 1.0f - v.x : v.x) * w;
        } else {
            add3(sum, v * w);
        }
    }
}

}  // namespace TALBOT_ISA
}  // namespace talbot::film
