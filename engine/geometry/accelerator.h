/// Ray casting. The only room that knows Embree (3 or 4; accelerator.cpp builds, kernels/trace.cpp traces and bridges the two).
///
/// An object's index is Embree's geometry id (flattened) or instance id (instanced): `hit_object` is the scene's object
/// index either way. A mesh used by one object is flattened into the top level in world space; shared meshes are instanced, one BVH each.
/// Left out: objects no ray sees, maps that are not finite or collapse the mesh to a line or point, triangles with a
/// vertex that is not finite. A map that squashes the mesh flat is flattened always: it has no inverse.
///
/// Determinism. For a given ray, t, u, v, object and primitive have the same bits for any number of threads, whatever rays
/// share its packet, and for every packet width: Embree sorts primitives before it makes leaves, and its robust triangle test is the same
/// formula in every width. Of triangles repeated in one mesh, and of equal objects in the same place, only the first is there (coincident.h); a filter that
/// chose at every hit would cost 3 to 30 %, measured. Other faces that overlap in one plane, at bitwise equal distance, fall to either,
/// depending on the direction and on whether packets are coherent, but always the same one.
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
    Columns3 origin, direction;   ///< direction is unit
    float* t_max = nullptr;       ///< in: far end; the near end is 0 (origins are offset already)
    const float* time = nullptr;  ///< in the shutter, 0 to 1; null: its middle
};
struct HitColumns {
    float* t = nullptr;  ///< untouched lanes without a hit get object = -1
    float *u = nullptr, *v = nullptr;
    int32_t* object = nullptr;
    int32_t* primitive = nullptr;
};

struct BuildOptions {
    int threads = 0;                                ///< of the build; 0: all. Anything else limits TBB in this process while the accelerator lives
    bool flatten = true;                            ///< false: every object is an instance (interactive edits move it without a rebuild)
    std::function<bool(double fraction)> progress;  ///< false: stop building (throws Cancelled). Called from any thread, one at a time
    /// Told before every call of Embree that sorts `primitives`, during whose first part nobody asks `progress`: 0.12 s a million on two cores.
    std::function<void(double primitives)> before_sort;
};

/// Opaque to everybody else.
class Accelerator {
public:
    Accelerator();
    ~Accelerator();
    /// Builds what changed since the last call (meshes compared by address, transforms by value): the hierarchies of unchanged instanced meshes stay,
    /// a moved instance costs a new top level only. Throws Error (out of memory) or Cancelled; then nothing is hit until the next build.
    /// `tables` and the meshes it keeps alive may go afterwards. Not while rays are traced.
    void build(const scene::SceneTables& tables, const BuildOptions& options);
    size_t bytes() const;        ///< Embree's memory
    size_t own_bytes() const;    ///< what is kept beside it, to know what changed: 8 an instance
    const void* handle() const;  ///< the RTCScene, for kernels in this layer; null before the first build

private:
    struct State;
    std::unique_ptr<State> state_;
};

/// What a build will take at its peak, bytes: 150 a triangle (measured: 115 to 130 at the peak, 72 stay), however often its mesh is placed; 440 an object and
/// 3,500 a mesh (measured: 415 of Embree, which keeps 385, and some 20).
size_t estimate_bytes(const scene::SceneTables& tables);

/// Traces a known triangle; throws Error when another Embree than the one compiled against answers (called once at load).
void check_embree();
/// "3.13.5"
std::string embree_version();

/// How wide to trace: 1, 8 or 16 lanes at once. Measured (Mrays/s, one thread; Cornell-like box, terrain of 1.6 M triangles):
/// bounce rays 1 / 8 / 16 wide 9.2 / 11.2 / 11.4, 2.2 / 2.0 / 2.3; shadow rays 12.5 / 27 / 26, 2.5 / 2.4 / 2.5;
/// camera rays, coherent: 12.5 / 29 / 39, 5.6 / 7.2 / 5.8.
struct TraceOptions {
    int width = 8;
    bool coherent = false;
    /// Only where SceneView::has_blockers: the scene, for rays with a group in their mask (scene::blocker_group) meet none but its blockers.
    const scene::SceneView* blockers = nullptr;
};

inline namespace TALBOT_ISA {  // kernels

/// Closest hits of the rays index[0..n) (index null: lanes 0..n). `visibility[lane]` is the ray's mask: the scene::Visibility bits of
/// the objects it may see. A ray that is not finite hits nothing.
void intersect(const Accelerator& accelerator, const RayColumns& rays, const int32_t* index, int n, const int32_t* visibility, const HitColumns& hits,
               const TraceOptions& options);

/// occluded[lane] = 1 when anything lies before t_max.
void occluded(const Accelerator& accelerator, const RayColumns& rays, const int32_t* index, int n, const int32_t* visibility, uint8_t* occluded,
              const TraceOptions& options);

}  // namespace TALBOT_ISA
}  // namespace talbot::geometry
