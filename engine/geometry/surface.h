/// From a hit to a shading point, and from a shading point to the next ray's origin.
#pragma once

#include "base/lanes.h"
#include "geometry/accelerator.h"
#include "shader/program.h"
#include "shader/shading.h"

namespace talbot::geometry {
inline namespace TALBOT_ISA {  // kernels

/// Fills p, n_s, n_g, backfacing, primitive, object, u, v of `out` for hits[index[i]], i < n, given wo (already in out.wo).
/// Positions come from the triangle's vertices, not from o + t d. `error[i]` bounds the distance between the computed and the exact position, m.
void shade_points(const scene::SceneView& scene, const HitColumns& hits, const int32_t* index, int n, shader::ShadingSpan& out, float* error);

/// shader handle of each hit (material slot resolved), -1 never.
void hit_shaders(const scene::SceneView& scene, const HitColumns& hits, const int32_t* index, int n, int32_t* shader);

/// Moves p off the surface to the side of `direction`, by the position's error bound: no acne and no leaks at any scale.
void offset_origin(ConstColumns3 p, ConstColumns3 n_g, ConstColumns3 direction, const float* error, int n, Columns3 origin);

}  // namespace TALBOT_ISA
}  // namespace talbot::geometry
