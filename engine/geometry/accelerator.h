/// Ray casting. The only room that knows Embree (3 or 4; the .cpp bridges them).
///
/// An object's index is Embree's geometry id (flattened) or instance id (instanced): `hit_object` is the scene's object
/// index either way. A mesh used by one object is flattened into the top level in world space; shared meshes are instanced, one BVH each.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "base/error.h"
#include "base/lanes.h"
#include "scene/view.h"

namespace talbot::geometry {

/// n rays in columns, addressed through `index` (lane numbers) when it is not null.
struct RayColumns {
    Columns3 origin, direction;  ///< direction is unit
    float* t_max = nullptr;      ///< in: far end; the near end is 0 (origins are offset already)
};
struct HitColumns {
    float* t = nullptr;  ///< untouched lanes without a hit get object = -1
    float *u = nullptr, *v = nullptr;
    int32_t* object = nullptr;
    int32_t* primitive = nullptr;
};

struct BuildOptions {
    int threads = 0;
    bool flatten = true;                            ///< false: every object is an instance (interactive edits move it without a rebuild)
    std::function<bool(double fraction)> progress;  ///< false: stop building (throws Cancelled)
};

/// Opaque to everybody else.
class Accelerator {
public:
    Accelerator();
    ~Accelerator();
    /// Builds or refits what changed since the last call (meshes compared by address, transforms by value). Throws Error (out of memory) or Cancelled.
    void build(const scene::SceneTables& tables, const BuildOptions& options);
    size_t bytes() const;  ///< Embree's memory
    /// Lower bound of every stored coordinate's magnitude scale, for ray offsets.
    float scene_radius() const;
    Vec3 scene_center() const;
    const void* handle() const;  ///< the RTCScene, for kernels in this layer

private:
    struct State;
    std::unique_ptr<State> state_;
};

/// Traces a known triangle; throws Error when another Embree than the one compiled against answers (called once at load).
void check_embree();
/// "3.13.5"
std::string embree_version();

/// Rays whose visibility matters: the mask of objects the ray may see (scene::Visibility bits).
/// How wide to trace: 1, 8 or 16 lanes at once.
struct TraceOptions {
    int width = 8;
    bool coherent = false;
};

inline namespace TALBOT_ISA {  // kernels

/// Closest hits of the rays index[0..n) (index null: lanes 0..n). `visibility[lane]` is the ray's mask.
void intersect(const Accelerator& accelerator, const RayColumns& rays, const int32_t* index, int n, const int32_t* visibility, const HitColumns& hits,
               const TraceOptions& options);

/// occluded[lane] = 1 when anything lies before t_max.
void occluded(const Accelerator& accelerator, const RayColumns& rays, const int32_t* index, int n, const int32_t* visibility, uint8_t* occluded,
              const TraceOptions& options);

}  // namespace TALBOT_ISA
}  // namespace talbot::geometry
