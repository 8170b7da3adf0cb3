/// From a hit to a shading point, and from a shading point to the next ray's origin.
///
/// Barycentrics weigh the triangle's vertices as hit = (1 - u - v) a + u b + v c. Directions and normals are in world space; normals go by the inverse
/// transpose, so the side that is "out" in object space stays out under mirroring maps (Cycles' rule too).
///
/// Error bounds. With eps = 2^-24 (half a unit in the last place of 1) and |.| taken by component, everything that is rounded on the way from the vertices to
/// the traced triangle and to p is at most
///     box = eps (14 W + 10 |M| (|M^-1| W + |t'|)),   W = |M| max(|a|, |b|, |c|) + |t|
/// where M, t is the object's map and t' the translation of its inverse: interpolation 7, map 4, the tracer's own rounded vertices 1, two more for the
/// origin's last additions; the second term is an instance's ray, which the tracer takes to object space by a rounded inverse (it is
/// there for flattened objects as well: nobody here knows which is which). Only the part along the normal, box . |n_g|, makes a ray meet the surface it leaves,
/// so that a floor at z = 0 keeps next to none however wide it is; 1/512 of the box's components stands for what n_g itself is off, and a sliver adds
/// what the tracer's own normal loses.
///
/// Curves and points. Ribbons face the ray but are shaded as round: p is the point of the round fibre in front, n_s = n_g its normal, v where the ray
/// crosses it from side to side (-1 to 1; of thick curves 0), backfacing 0. A fibre is one surface, met once: light that a closure sends through it
/// starts behind it. For this `error` is negative, minus the fibre's radius, and offset_origin knows what to do. Points are spheres, seen from outside only.
///
/// p is kept a few boxes away from the edges of its triangle, within the surface: where two faces meet in a corner, a rounded p might else lie behind the other
/// face, and its rays would leak out.
#pragma once

#include <cmath>

#include "base/lanes.h"
#include "geometry/accelerator.h"
#include "shader/program.h"
#include "shader/shading.h"

namespace talbot::geometry {
inline namespace TALBOT_ISA {  // kernels

/// Fills p, n_s, n_g, backfacing, primitive, object, u, v of `out` for hits[index[i]], i < n, given wo (already in out.wo).
/// Positions come from the triangle's vertices, not from o + t d. `error[i]`, m, bounds how far p is from the traced triangle along n_g (see above).
/// n_s falls back to n_g where the triangle is flat or the interpolated normal vanishes. Every lane must be a hit. `origin` is where the rays came from, by
/// lane like `hits`; only hits of thick curves and points need it.
void shade_points(const scene::SceneView& scene, const HitColumns& hits, ConstColumns3 origin, const int32_t* index, int n, shader::ShadingSpan& out,
                  float* error);

/// Shader handle of each hit (material slot resolved), never -1. Every lane must be a hit.
void hit_shaders(const scene::SceneView& scene, const HitColumns& hits, const int32_t* index, int n, int32_t* shader);

/// How far along n_g a ray begins whose direction has the cosine `side` with it.
TALBOT_INLINE float way_off_surface(float error, float side) {
    // A curve of radius -error: a little off its front, or its diameter and a little more.
    const float fibre = side < 0.0f ? 2.05f * error : -0.05f * error;
    return error < 0.0f ? fibre : std::copysign(error, side);
}

/// Moves p off the surface to the side of `direction`, by the position's error bound: no acne and no leaks at any scale; through curves (negative errors) to
/// the other side. `origin` may be p itself.
void offset_origin(ConstColumns3 p, ConstColumns3 n_g, ConstColumns3 direction, const float* error, int n, Columns3 origin);

/// Where the listed lanes' shadow rays in `direction` begin; other lanes get something harmless. Off the surface by the error bound, and where smooth normals
/// see a grazing light that the flat triangle does not (or hardly) see, on the curved surface that the normals mean: else its shadow on itself would show the
/// triangles. With w the barycentrics, V and N the vertices and normals on the light's side, all in world space, that surface is about half of
///     h = sum over edges ij of w_i w_j (N_j - N_i) . (V_j - V_i)
/// above the triangle, and no lower than the nearest of the three planes that pass over the triangle at right angles to N_i. The object's geometry offset g
/// says what is grazing: all of the height below it, none from 2 g on (from g on for the flat triangle), as in Cycles.
/// `normal` says what is towards the light: the smooth normal, bent by displacement where that is shown as bump.
void shadow_origins(const scene::SceneView& scene, const shader::ShadingSpan& span, ConstColumns3 normal, ConstColumns3 direction, const float* error,
                    const int32_t* list, int count, Columns3 origin);

}  // namespace TALBOT_ISA
}  // namespace talbot::geometry
