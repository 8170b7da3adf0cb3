/// What a node program may read: the shading points of a span in columns, the scene, images, and a span-wide trace function.
///
/// Filled by `geometry` (surface hits), by `light` (emitters) and by the integrator (background: p = direction, everything else neutral).
#pragma once

#include "asset/texture.h"
#include "base/lanes.h"
#include "scene/view.h"

namespace talbot::shader {

/// Path flags, as the Light Path node and the visibility rules know them (column `ray_flags`).
enum RayFlags : int32_t {
    kRayCamera = 1,
    kRayDiffuse = 2,
    kRayGlossy = 4,
    kRayTransmission = 8,
    kRayReflection = 16,
    kRaySingular = 32,
    kRayShadow = 64,
    kRayVolumeScatter = 128,
    kRayAny = 255,
};

/// Columns of n <= kSpan shading points. World space unless named.
struct ShadingSpan {
    int n = 0;
    Columns3 p;          ///< position; for a background the direction
    Columns3 n_s;        ///< shading normal (interpolated), unit, towards the viewer
    Columns3 n_g;        ///< geometric normal, unit, towards the viewer
    Columns3 origin;     ///< of a background: where the rays that see it come from; null: unknown
    Columns3 wo;         ///< towards the viewer ("Incoming"); for a background minus the direction
    float* u = nullptr;  ///< barycentrics: hit = (1-u-v) a + u b + v c, with a b c the triangle's vertices in order; of curves: along the segment, 0..1
    float* v = nullptr;  ///< of ribbons: across, -1..1 (the sine of the angle between normal and viewer, seen along the curve); of thick curves 0
    float* ray_length = nullptr;    ///< since the last scattering: transparent surfaces are passed
    float* error = nullptr;         ///< how far p may be off the surface along n_g, m; null: unknown
    float* footprint = nullptr;     ///< radius of the ray's cone at the hit, m: dPdx and dPdy have this length
    int32_t* object = nullptr;      ///< -1: background or lamp
    int32_t* primitive = nullptr;   ///< triangle, curve segment or point
    float* time = nullptr;          ///< in the shutter, 0..1; null: nothing moves
    int32_t* constants = nullptr;   ///< offset of the lane's material in Programs::constants
    int32_t* ray_flags = nullptr;   ///< RayFlags of the ray that arrived
    int32_t* backfacing = nullptr;  ///< 1: the viewer sees the back (n_s and n_g were flipped)
    int32_t* depth = nullptr;       ///< bounces so far (Light Path > Ray Depth)
    int32_t* diffuse_depth = nullptr;
    int32_t* glossy_depth = nullptr;
    int32_t* transparent_depth = nullptr;
    int32_t* transmission_depth = nullptr;
    uint32_t* key = nullptr;  ///< sampler key, sample number and vertex, for nodes that ask for random numbers
    uint32_t* sample = nullptr;
    uint32_t* vertex = nullptr;
    bool uniform_constants = false;  ///< every lane has the same material
    bool is_background = false;
    bool is_lamp = false;                                              ///< u, v are the lamp's own parametric coordinates
    int32_t lamp = -1;                                                 ///< its place among the lights of the scene
    const Affine *lamp_to_world = nullptr, *lamp_to_object = nullptr;  ///< the lamp's (Texture Coordinate > Object, Normal; IES)
};

/// Rays a node asks for (AO, bevel, raycast). Handed in by the integrator; the shader layer knows the type only.
struct TraceRequest {
    int n = 0;
    ConstColumns3 origin, direction;
    ConstColumns3 n_g;                     ///< with `error`: origins are on a surface with this normal and are moved off it
    const float* error = nullptr;          ///< as ShadingSpan::error; null: origins are taken as they are
    const float* t_max = nullptr;          ///< 0: no ray
    uint32_t visibility = ~0u;             ///< scene::Visibility bits of the objects to be met
    const int32_t* object_only = nullptr;  ///< >= 0: hits of this object only
    int32_t* hit_object = nullptr;         ///< out, -1: none
    int32_t* hit_primitive = nullptr;
    float* hit_t = nullptr;
    float *hit_u = nullptr, *hit_v = nullptr;
};
struct TraceFunction {
    void (*call)(void* user, TraceRequest& request) = nullptr;
    void* user = nullptr;
};

/// Everything else a program sees, the same for all spans of a render.
struct ShaderContext {
    const scene::SceneView* scene = nullptr;
    const asset::TextureTable* textures = nullptr;
    TraceFunction trace;
    float film_width = 1, film_height = 1;
};

}  // namespace talbot::shader
