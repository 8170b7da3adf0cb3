/// One sample of each kind of local emitter, lanes of one kind at a time. Internal to sample_emitters.
#pragma once

#include "light/kernels/emission.h"
#include "light/kernels/shapes.h"

namespace talbot::light {
inline namespace TALBOT_ISA {

/// Lanes that chose emitters of the same kind, gathered.
struct LocalGroup {
    int n = 0;
    int32_t lane[kSpan];
    int32_t emitter[kSpan];
    float px[kSpan], py[kSpan], pz[kSpan];
    float u[kSpan], v[kSpan];  ///< place on the emitter
    float part[kSpan];         ///< which triangle
    PathDepths depths;         ///< where lamps or meshes have programs
    DepthColumns depth_columns;
    float time[kSpan];  ///< of the shutter, where something moves
};

/// What they found: pdf without the choice's probability; for delta emitters 1.
struct LocalSampled {
    float x[kSpan], y[kSpan], z[kSpan];
    float distance[kSpan], pdf[kSpan];
    float r[kSpan], g[kSpan], b[kSpan];
    int32_t visibility[kSpan], object[kSpan], max_bounces[kSpan];
    int32_t blockers[kSpan];
    int32_t lamp[kSpan];                    ///< -1: mesh
    int32_t only_sampled[kSpan];            ///< 1: light of it that scattering finds does not count
    float nx[kSpan], ny[kSpan], nz[kSpan];  ///< lamp programs only
    float coordinate_u[kSpan], coordinate_v[kSpan];
};

void sample_point_lamps(const EmitterView& table, EmitterKind kind, const LocalGroup& in, LocalSampled& out);
void sample_rects(const EmitterView& table, const shader::Programs& programs, const LocalGroup& in, LocalSampled& out);
void sample_meshes(const EmitterView& table, const shader::Programs& programs, const shader::ShaderContext& context, LightScratch& scratch,
                   const LocalGroup& in, LocalSampled& out);

/// Scattered rays never hit such a lamp or sun (its MIS is switched off): its light samples bring all of its light.
TALBOT_INLINE bool is_only_sampled(int32_t hit_visibility, int32_t linked_visibility) {
    return ((hit_visibility | linked_visibility) & int32_t(scene::kVisibleAll) & ~int32_t(scene::kVisibleCamera)) == 0;
}

/// Where a picture's (x, y) lie as shaders get it: they read 1 - u - v and u, as on triangles.
TALBOT_INLINE void picture_coordinates(float x, float y, float& u, float& v) {
    u = y;
    v = 1.0f - x - y;
}
/// Texture coordinates of point and spot lamps by direction; of area lamps, 0..1 over the rectangle.
TALBOT_INLINE void lamp_coordinates(const Lamp& lamp, Vec3 away, float& u, float& v) {
    const Vec3 d = normalize(Vec3{dot(lamp.cone.x, away), dot(lamp.cone.y, away), dot(lamp.cone.z, away)});
    const float inv_z = 1.0f / maxf(-d.z, 1e-6f);
    const bool spot = lamp.is_spot != 0.0f;
    const float x = spot ? 0.5f + 0.5f * lamp.inv_tan_outer * d.x * inv_z : 0.5f - lane_atan2(d.x, d.y) * (0.5f * kInvPi);
    const float y = spot ? 0.5f + 0.5f * lamp.inv_tan_outer * d.y * inv_z : 1.0f - lane_acos(d.z) * kInvPi;
    picture_coordinates(x, y, u, v);
}
TALBOT_INLINE void rect_coordinates(const Rect& rect, float a, float b, float& u, float& v) {
    picture_coordinates(0.5f + 0.5f * a / maxf(rect.half_x, 1e-30f), 0.5f + 0.5f * b / maxf(rect.half_y, 1e-30f), u, v);
}

}  // namespace TALBOT_ISA
}  // namespace talbot::light
