/// Everything that emits, in one table: lamps, emissive triangles, the world. Sampling picks an emitter by its estimated
/// contribution at the shading point, then a point on it; `pdf` answers for the BSDF-sampled rays that hit it.
///
/// Two strata, each with its own sample and shadow ray at every vertex (no random choice where none is needed):
///   Local    point, spot, area lamps and emissive meshes
///   Distant  suns and the world's importance map (a constant world is not sampled: it comes with the BSDF ray)
#pragma once

#include <memory>
#include <vector>

#include "base/error.h"
#include "base/lanes.h"
#include "base/pool.h"
#include "geometry/accelerator.h"
#include "shader/program.h"

namespace talbot::light {

enum class Stratum : uint8_t { Local, Distant };

/// Emitters of a render, read-only while rendering. Built by `build_emitters`; layout in emitter_table.h.
struct EmitterTable;
struct EmitterTableDelete {
    void operator()(EmitterTable*) const;
};
using EmitterTablePtr = std::unique_ptr<EmitterTable, EmitterTableDelete>;

/// Flattens lamps, emissive triangles and the world (its importance map is made by running the background program).
EmitterTablePtr build_emitters(const scene::Scene& scene, const scene::SceneTables& tables, const shader::Programs& programs,
                               const shader::ShaderContext& context, WorkerPool& pool, Report& report, const std::atomic<bool>* cancel);

/// For the integrator: what exists at all.
struct EmitterSummary {
    bool has_local = false;
    bool has_distant = false;           ///< suns or a world map
    bool has_visible_lamps = false;     ///< lamps that rays may hit (intersect_lamps is needed)
    bool has_lamp_programs = false;     ///< lamps or suns with nodes
    bool has_links = false;             ///< some emitter does not light everything: receivers are asked for
    bool has_linked_lamps = false;      ///< lamps with blockers of their own that scattered rays may hit
    std::vector<int32_t> linked_suns;   ///< such suns, with a disc
    std::vector<int32_t> visible_suns;  ///< with a disc that paths may meet (shade_suns is needed)
    bool world_is_black = false;
    bool world_is_constant = false;
    Rgb constant_world;
    int world_shader = -1;  ///< compiled shader index of the world, -1: black
    uint32_t world_visibility = scene::kVisibleAll;
    int32_t world_light_group = -1;
};
EmitterSummary summarize(const EmitterTable& table);

/// Bounces so far of the paths that ask for light or find it, in all and by kind, for Light Path; null: none.
struct PathDepths {
    const int32_t *bounces = nullptr, *diffuse = nullptr, *glossy = nullptr, *transparent = nullptr, *transmission = nullptr;
};

/// Shading points that want light (n lanes).
struct LightQuery {
    ConstColumns3 p, n_s;
    const float *pick_u = nullptr, *pick_v = nullptr, *u = nullptr, *v = nullptr;  ///< random pairs in [0,1)
    PathDepths depths;                                                             ///< of the shading point; `bounces` (for lamps' limits) is not null
    const int32_t* receiver = nullptr;                                             ///< its object's receiver set; null: everything is lit
    const float* time = nullptr;                                                   ///< of the shutter, 0..1; null: nothing moves
    int n = 0;
};

/// One light sample a lane.
struct LightSamples {
    Columns3 wi;                     ///< unit, towards the light
    float* distance = nullptr;       ///< infinity for distant emitters
    Columns3 radiance;               ///< emitted towards the point, divided by nothing
    float* pdf = nullptr;            ///< per solid angle, selection included; 0: no sample. For delta emitters: selection probability alone, and radiance is
                                     ///< intensity/d^2 or irradiance
    uint8_t* is_delta = nullptr;     ///< no MIS: BSDF rays cannot find it, or do not count
    int32_t* blockers = nullptr;     ///< mask of its shadow ray; 0: nothing casts a shadow
    int32_t* visibility = nullptr;   ///< scene::Visibility bits of the lamp: which kinds of lobe it lights; and catcher bits
    int32_t* light_group = nullptr;  ///< of the emitter, -1: none; null: nobody asks
};

inline namespace TALBOT_ISA {  // kernels

/// Scratch a worker lends to lookups that run programs: textured lamps, meshes, world.
struct LightScratch {
    float* registers = nullptr;  ///< max_registers * kSpan
    float* columns = nullptr;    ///< kLightScratchColumns * kSpan floats
    shader::ShadingSpan span;    ///< used by the callee, which points it into `columns`
};
inline constexpr int kLightScratchColumns = 64;

/// One light sample a lane from one stratum. n <= kSpan.
void sample_emitters(const EmitterTable& table, Stratum stratum, const LightQuery& query, const shader::Programs& programs,
                     const shader::ShaderContext& context, LightScratch& scratch, const LightSamples& out);

/// Density (per solid angle, selection included) with which `sample_emitters` at `origin` would have chosen the surface point a BSDF ray hit:
/// emissive triangle (object, primitive) at distance t. 0 when it is not sampled. `receiver`, `time`: see LightQuery; the objects are lit by what the rays hit.
void pdf_triangles(const EmitterTable& table, const scene::SceneView& scene, ConstColumns3 origin, const float* t, const int32_t* object,
                   const int32_t* primitive, const int32_t* receiver, const float* time, int n, float* pdf);

/// Emissive surfaces that rays hit, n lanes; time: null where nothing moves. `origin` and `distance` are those of the rays.
struct EmissiveHits {
    ConstColumns3 origin, direction;
    const float *distance = nullptr, *u = nullptr, *v = nullptr;
    const int32_t *object = nullptr, *primitive = nullptr, *shader = nullptr, *ray_flags = nullptr;
    PathDepths depths;
    const float* time = nullptr;
    int n = 0;
    const float* ray_length = nullptr;  ///< where it is more than the distance: something transparent was passed before the origin
};
/// Their radiance towards the rays' origins. n <= kSpan.
void shade_emissive(const shader::Programs& programs, const shader::ShaderContext& context, LightScratch& scratch, const EmissiveHits& hits, Columns3 radiance);

/// The same for the world in `direction` (0 when the world is not sampled).
void pdf_background(const EmitterTable& table, ConstColumns3 direction, const int32_t* receiver, int n, float* pdf);

/// Which emitters are met: those that paths may meet themselves (linked ones from the camera only), or the linked ones, for rays that look for them.
enum class Met : uint8_t { ByPaths, Linked };

/// Lamps are not in the acceleration structure. Nearest visible lamp (area, sphere of point and spot) before t_max on each ray:
/// emitter[i] = lamp index or -1, t[i] its distance. `visibility[i]` = mask of the ray's kind. Lamps do not block rays: to collect those behind the
/// first, call again with `t_min` = the distances found (null: 0) until none is found.
void intersect_lamps(const EmitterTable& table, ConstColumns3 origin, ConstColumns3 direction, const float* t_max, const int32_t* visibility, int n,
                     int32_t* emitter, float* t, const float* t_min = nullptr, Met met = Met::ByPaths);
/// Radiance of that lamp towards the ray's origin and its sampling density there. Origin is the vertex that scattered the ray (soft point lamps turn towards
/// it). `depths` are those of the rays, for lamps whose nodes ask. A lamp's max_bounces is for light samples only, as in Cycles. `receiver` is the set of
/// the object there, -1: the camera, which sees everything (null: everything is lit).
void shade_lamps(const EmitterTable& table, ConstColumns3 origin, ConstColumns3 direction, const int32_t* emitter, const float* t, int n,
                 const shader::Programs& programs, const shader::ShaderContext& context, LightScratch& scratch, Columns3 radiance, float* pdf,
                 const PathDepths& depths = {}, const int32_t* receiver = nullptr);
/// Suns with a disc seen by rays that leave the scene: sum of their radiance (times the MIS weight against bsdf_pdf by the power heuristic; bsdf_pdf < 0:
/// weight 1). n <= kSpan. `sun`: one of the summary's alone; -1: all.
void shade_suns(const EmitterTable& table, ConstColumns3 direction, const int32_t* visibility, const float* bsdf_pdf, int n, const shader::Programs& programs,
                const shader::ShaderContext& context, LightScratch& scratch, Columns3 radiance, const PathDepths& depths = {},
                const int32_t* receiver = nullptr, Met met = Met::ByPaths, int sun = -1);
/// Mask of the shadow rays to a lamp, or a sun; 0: nothing casts a shadow.
int32_t lamp_blockers(const EmitterTable& table, int32_t lamp);
int32_t sun_blockers(const EmitterTable& table, int32_t sun);
/// Their light groups; -1: none.
int32_t lamp_light_group(const EmitterTable& table, int32_t lamp);
int32_t sun_light_group(const EmitterTable& table, int32_t sun);

}  // namespace TALBOT_ISA
}  // namespace talbot::light
