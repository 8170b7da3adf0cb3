/// What a worker keeps for every path in flight, in columns, and the scratch its stages share.
///
/// Path columns are addressed by lane number; lanes never move. Stages work on lists of lane numbers and gather what
/// they need into span scratch. At most 256 bytes a path, asserted below.
#pragma once

#include <cstddef>
#include <cstdint>

#include "base/arena.h"
#include "base/lanes.h"
#include "geometry/accelerator.h"
#include "light/emitters.h"
#include "shader/program.h"

namespace talbot::integrator {

/// State of a path besides the RayFlags (column `path_flags`).
enum PathFlags : int32_t {
    kPathEndAtSurface = 1 << 16,    ///< a bounce limit is reached: crosses transparent surfaces, collects emission, then ends
    kPathDelta = 1 << 17,           ///< the last scattering was a delta lobe or the camera: light found counts fully
    kPathSeesBackground = 1 << 18,  ///< a transparent film sees the world through here
    kPathDataDone = 1 << 19,        ///< first-hit passes are written
    kPathCrossed = 1 << 20,         ///< the last surface was crossed straight on
    kPathTerminate = 1 << 21,       ///< lost the roulette on arrival, or at the limit of transparent surfaces: collects the surface's emission, then ends
    kPathCatcherHit = 1 << 22,      ///< the camera saw a shadow catcher first: the path is no part of the matte
    kPathCatcherPass = 1 << 23,     ///< and it sees catchers only
};

/// Where some light is linked, the path's flags hold the receiver set of the object that scattered it last, in the bits from here on.
inline constexpr int kPathReceiverShift = 24;
static_assert(scene::kReceiverSets <= 1 << 6);

struct PathColumns {
    Columns3 origin, direction;
    float* t_max = nullptr;
    Columns3 throughput;
    float* bsdf_pdf = nullptr;     ///< density of the last scattering, per solid angle
    float* min_pdf = nullptr;      ///< smallest density so far (filter glossy)
    float* mis_t = nullptr;        ///< length since the last scattering: transparent surfaces do not reset it
    float* cone_width = nullptr;   ///< radius of the ray's cone at its origin, m
    float* cone_spread = nullptr;  ///< growth of that radius a metre
    float* time = nullptr;         ///< in the shutter, 0 to 1; meaningless where nothing moves
    int32_t* pixel = nullptr;      ///< in the tile
    uint32_t* key = nullptr;       ///< sampler key of the pixel
    uint32_t* sample = nullptr;
    int32_t* flags = nullptr;    ///< RayFlags and PathFlags
    int32_t* bounces = nullptr;  ///< packed: total, diffuse, glossy, transmission, 8 bits each
    int32_t* vertex = nullptr;   ///< packed: transparent crossings (high 16), surfaces met (low 16)
    geometry::HitColumns hit;
    Columns3 diffuse_share, glossy_share;  ///< of the first scattering, for the light passes
};
inline constexpr size_t kPathBytes = (3 + 3 + 1 + 3 + 6 + 3 + 3 + 5 + 6) * 4;
static_assert(kPathBytes <= 256, "a path's state must stay small: batches live in L2");

TALBOT_INLINE int total_bounces(int32_t b) {
    return b & 255;
}
TALBOT_INLINE int diffuse_bounces(int32_t b) {
    return (b >> 8) & 255;
}
TALBOT_INLINE int glossy_bounces(int32_t b) {
    return (b >> 16) & 255;
}
TALBOT_INLINE int transmission_bounces(int32_t b) {
    return (b >> 24) & 255;
}

/// Shadow rays of one turn of the loop: at most one a stratum a lane.
inline constexpr int kShadowCapacity = 2 * kBatch;
struct ShadowQueue {
    int n = 0;
    Columns3 origin, direction;
    float* t_max = nullptr;
    float* time = nullptr;
    Columns3 rgb;  ///< what arrives when nothing is in the way
    Columns3 diffuse_share, glossy_share;
    int32_t* pixel = nullptr;
    int32_t* indirect = nullptr;     ///< 1: more than one scattering
    int32_t* lane = nullptr;         ///< of the path, for its sampler
    int32_t* bounces = nullptr;      ///< of the path before this vertex scattered it, packed
    int32_t* visibility = nullptr;   ///< ray mask
    int32_t* light_group = nullptr;  ///< of the light, where there are such passes
    geometry::HitColumns hit;        ///< for rays that look for transparent surfaces
    int32_t *list = nullptr, *going = nullptr, *shader = nullptr;
    int32_t* crossed = nullptr;  ///< transparent surfaces met
    float* passed = nullptr;     ///< length of the way to the last of them
    uint8_t* blocked = nullptr;
};

/// Columns of kSpan that the stages of one span share, and the registers of its program.
struct SpanScratch {
    shader::ShadingSpan span;
    float* registers = nullptr;
    float* error = nullptr;                 ///< position error of each shading point, m
    float* terminator_frequency = nullptr;  ///< of the object (see scene::TraitsView)
    bool shifts_terminator = false;         ///< some of them are not 1
    float* time = nullptr;                  ///< the span's, where something moves
    int32_t* lane = nullptr;                ///< path lane of each span lane
    int32_t* path_flags = nullptr;
    int32_t* bounces = nullptr;
    Columns3 throughput;
    float* slot_weight = nullptr;  ///< kMaxSlots columns: sampling weight of each slot
    float* weight_sum = nullptr;
    light::LightSamples light;
    float *u0 = nullptr, *v0 = nullptr, *u1 = nullptr, *v1 = nullptr;
    float *roulette_u = nullptr, *roulette_v = nullptr;  ///< of the vertex: for the path that leaves it, for its shadow rays
    Columns3 wi, f, slot_f, f_diffuse, f_glossy;
    float *pdf = nullptr, *slot_pdf = nullptr;
    float* sampled_roughness = nullptr;
    float* sampled_eta = nullptr;
    int32_t *sampled_flags = nullptr, *chosen = nullptr;
    int32_t* receiver = nullptr;  ///< receiver set of the span's objects or of those that sent its rays, where some light is linked
    int32_t *list = nullptr, *list2 = nullptr;
    uint8_t* mask = nullptr;
    Columns3 rgb, share_a, share_b, tmp3;
    float *tmp = nullptr, *tmp2 = nullptr;
    int32_t* itmp = nullptr;
    int32_t* matte = nullptr;                               ///< with shadow catchers: what belongs to the matte
    int32_t *light_group = nullptr, *film_group = nullptr;  ///< with light groups: of the light that lanes found; and of what the film takes
    float* compact = nullptr;                               ///< kCompactColumns columns for lanes gathered by chosen slot
    light::LightScratch emitter;                            ///< lent to the light layer
};
inline constexpr int kCompactColumns = 64;

/// Parts of the loop that are timed apart (RenderContext::time_stages). Surface is the node program, shading points and emission.
enum class Stage : uint8_t { Generate, Intersect, Background, Sort, Surface, Light, Scatter, Shadow, Count };
inline constexpr int kStageCount = int(Stage::Count);

struct Counters {
    uint64_t camera_rays = 0, bounce_rays = 0, shadow_rays = 0, paths = 0, vertices = 0;
    uint64_t stage_ns[kStageCount] = {};
};

/// A worker: memory for one batch and its scratch. Built on the host, used by one thread.
class Worker {
public:
    explicit Worker(int max_registers);
    PathColumns paths;
    ShadowQueue shadow;
    SpanScratch scratch;
    int32_t *active = nullptr, *fresh = nullptr, *missed = nullptr, *hits = nullptr, *sorted = nullptr, *free_lanes = nullptr;  ///< lists of lanes
    int32_t *shader = nullptr, *sorted_shader = nullptr;  ///< of the lanes in `hits` and `sorted`
    int32_t* visibility = nullptr;                        ///< ray mask of each lane
    int32_t* buckets = nullptr;                           ///< counting sort; room for bucket_capacity
    int bucket_capacity = 0;
    int free_count = 0;
    bool catcher_pass = false;  ///< the unit's paths are followed again, those that meet shadow catchers, without all other objects
    Counters counters;

private:
    Arena arena_;
};

}  // namespace talbot::integrator
