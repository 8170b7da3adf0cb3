/// Running emission programs for light samples and for rays that hit lamps. Kernels of this layer; `build_world.cpp` uses the baseline ones.
#pragma once

#include "base/math.h"
#include "light/emitter_table.h"

namespace talbot::light {

/// The world map's parametrisation: u = longitude / 2 pi, v = angle from +Z / pi.
TALBOT_INLINE Vec3 map_direction(float u, float v) {
    float sp, cp, st, ct;
    lane_sincos((u - 0.5f) * kTwoPi, sp, cp);
    lane_sincos(v * kPi, st, ct);
    return {st * cp, st * sp, ct};
}

/// Points on lamps, n lanes.
struct LampPoints {
    ConstColumns3 p, normal, wo;  ///< wo: from the lamp to the point it lights
    const float *u = nullptr, *v = nullptr;
    const float* distance = nullptr;
};

inline namespace TALBOT_ISA {

/// The depths of some lanes, in columns of their own.
struct DepthColumns {
    int32_t columns[5][kSpan];
    TALBOT_MEMBER PathDepths of(const PathDepths& depths, const int32_t* list, int n) {
        const auto take = [&](const int32_t* from, int32_t* to) {
            if (from) gather(from, list, n, to);
            return from ? to : nullptr;
        };
        return {take(depths.bounces, columns[0]), take(depths.diffuse, columns[1]), take(depths.glossy, columns[2]), take(depths.transparent, columns[3]),
                take(depths.transmission, columns[4])};
    }
};

/// Points the span's columns into scratch.columns and neutral values into them (n lanes): no object, no flags, depth 0.
void prepare_span(LightScratch& scratch, int n);

/// Emission of `shader` for scratch.span; non-finite results count as black.
void evaluate_emission(const shader::Programs& programs, const shader::ShaderContext& context, LightScratch& scratch, int shader, Columns3 out);

/// Background radiance towards `direction`, for paths of so many bounces.
void evaluate_background(const shader::Programs& programs, const shader::ShaderContext& context, LightScratch& scratch, int shader, ConstColumns3 direction,
                         const PathDepths& depths, int n, Columns3 out);

/// Multiplies radiance by the lamps' own programs. `lamp[i]` indexes table.lamps, or table.suns when `is_sun`; lanes with -1 or with a constant lamp stay.
/// `is_hit`: rays found the points; else they were sampled.
void apply_lamp_programs(const EmitterView& table, const shader::Programs& programs, const shader::ShaderContext& context, LightScratch& scratch,
                         const int32_t* lamp, bool is_sun, const LampPoints& points, bool is_hit, const PathDepths& depths, int n, Columns3 radiance);

/// Radiance of emissive surfaces, for lanes whose shader has a program. Here `direction` points to whom they light.
void apply_mesh_programs(const shader::Programs& programs, const shader::ShaderContext& context, LightScratch& scratch, const EmissiveHits& hits,
                         Columns3 radiance);

}  // namespace TALBOT_ISA
}  // namespace talbot::light
