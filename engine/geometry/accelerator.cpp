#include "geometry/accelerator.h"

// Building is the same in Embree 3 and 4; tracing is not: kernels/trace.cpp bridges that.
#if __has_include(<embree4/rtcore.h>)
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

#include <algorithm>
#include <cmath>
#include <cstring>
#include <mutex>
#include <span>
#include <unordered_map>
#include <unordered_set>
#include <utility>
#include <vector>

#include "geometry/coincident.h"
#include "geometry/embree_geometry.h"

namespace talbot::geometry {
namespace {

struct ReleaseScene {
    void operator()(RTCScene scene) const { rtcReleaseScene(scene); }
};
struct ReleaseGeometry {
    void operator()(RTCGeometry geometry) const { rtcReleaseGeometry(geometry); }
};
struct ReleaseDevice {
    void operator()(RTCDevice device) const { rtcReleaseDevice(device); }
};
using ScenePtr = std::unique_ptr<std::remove_pointer_t<RTCScene>, ReleaseScene>;
using GeometryPtr = std::unique_ptr<std::remove_pointer_t<RTCGeometry>, ReleaseGeometry>;
using DevicePtr = std::unique_ptr<std::remove_pointer_t<RTCDevice>, ReleaseDevice>;

/// Embree reports by callback, perhaps from one of its threads; kept here until the call has returned.
struct DeviceState {
    std::mutex mutex;
    RTCError code = RTC_ERROR_NONE;
    std::string text;
    std::atomic<int64_t> bytes{0};
};

void keep_error(void* user, RTCError code, const char* text) {
    DeviceState& state = *static_cast<DeviceState*>(user);
    std::lock_guard lock(state.mutex);
    if (state.code != RTC_ERROR_NONE) return;
    state.code = code;
    state.text = text ? text : "";
}

bool count_bytes(void* user, ssize_t bytes, bool) {
    static_cast<DeviceState*>(user)->bytes.fetch_add(bytes, std::memory_order_relaxed);
    return true;
}

/// Throws what Embree complained about since the last call.
void check(DeviceState& state, const std::string& where) {
    std::lock_guard lock(state.mutex);
    const RTCError code = std::exchange(state.code, RTC_ERROR_NONE);
    const std::string text = std::exchange(state.text, {});
    if (code == RTC_ERROR_NONE) return;
    if (code == RTC_ERROR_CANCELLED) throw Cancelled{};
    if (code == RTC_ERROR_OUT_OF_MEMORY) throw Error("out of memory while building the ray tracing hierarchy", where);
    throw Error("Embree could not build the ray tracing hierarchy: " + text, where);
}

/// How far the whole build is, in triangles. Embree calls from several threads at once, so everything is behind the mutex: then the
/// end of the last call is known to come before what the builder does next, whatever Embree's scheduler does.
struct Progress {
    const std::function<bool(double)>* call = nullptr;
    double done = 0, current = 0, total = 1;
    double last = 0;
    bool cancelled = false;
    std::mutex mutex;

    bool report(double fraction_of_current) {
        std::lock_guard lock(mutex);
        if (!*call) return true;
        last = std::max(last, std::min(1.0, (done + current * std::clamp(fraction_of_current, 0.0, 1.0)) / total));
        if (!cancelled) cancelled = !(*call)(last);
        return !cancelled;
    }
    void begin(double triangles) {
        {
            std::lock_guard lock(mutex);
            current = triangles;
        }
        if (!report(0)) throw Cancelled{};
    }
    void end() {
        std::lock_guard lock(mutex);
        done += current;
        current = 0;
    }
};

bool monitor(void* user, double fraction) {
    return static_cast<Progress*>(user)->report(fraction);
}

bool is_finite(const Affine& a) {
    for (const auto& row : a.m)
        for (float x : row)
            if (!std::isfinite(x)) return false;
    return true;
}

bool same(const Affine& a, const Affine& b) {
    return std::memcmp(&a, &b, sizeof(Affine)) == 0;
}

/// 3: invertible; 2: flattens to a plane; less: nothing is left to see.
int rank(const Affine& a) {
    const auto& m = a.m;
    double cofactors = 0, scale = 0;
    for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j) {
            const int i1 = (i + 1) % 3, i2 = (i + 2) % 3, j1 = (j + 1) % 3, j2 = (j + 2) % 3;
            cofactors = std::max(cofactors, std::abs(double(m[i1][j1]) * m[i2][j2] - double(m[i1][j2]) * m[i2][j1]));
            scale = std::max(scale, std::abs(double(m[i][j])));
        }
    }
    const double det = double(m[0][0]) * (double(m[1][1]) * m[2][2] - double(m[1][2]) * m[2][1]) -
                       double(m[0][1]) * (double(m[1][0]) * m[2][2] - double(m[1][2]) * m[2][0]) +
                       double(m[0][2]) * (double(m[1][0]) * m[2][1] - double(m[1][1]) * m[2][0]);
    if (std::abs(det) > 1e-18 * scale * scale * scale) return 3;
    return cofactors > 0 ? 2 : 0;
}

#if RTC_VERSION_MAJOR >= 4
constexpr int kFilterFlag = RTC_SCENE_FLAG_FILTER_FUNCTION_IN_ARGUMENTS;
#else
constexpr int kFilterFlag = RTC_SCENE_FLAG_CONTEXT_FILTER_FUNCTION;
#endif

/// What Embree takes for a geometry and does not tell (measured: 288), and what a hash table takes for an entry beside it.
constexpr size_t kGeometryBytes = 288, kNodeBytes = 32;

enum class Placement : uint8_t { Absent, Flattened, Instanced };

/// What the top level has of an object. There may be millions: an instance's map is compared with Embree's own copy.
struct Placed {
    uint32_t visibility = 0;  ///< 0: absent
    uint32_t generation = 0;  ///< of the instanced hierarchy; 0: flattened
};
static_assert(sizeof(Placed) == 8);

/// An object in world space.
struct Flat {
    std::shared_ptr<const scene::Mesh> mesh;
    Affine to_world;
};

/// A mesh in use, and its hierarchy when it is instanced.
struct MeshEntry {
    std::shared_ptr<const scene::Mesh> mesh;
    std::vector<uint32_t> repeated;  ///< triangles left out, see coincident.h
    ScenePtr scene;
    bool instanced = false;
    size_t uses = 0;
    uint32_t generation = 0;  ///< of the hierarchy, never 0: an instance must be pointed at a rebuilt one
};

struct Builder {
    RTCDevice device;
    DeviceState& state;
    Progress& progress;
    const std::function<void(double)>& before_sort;
    bool filters = false;  ///< rays may bring a filter: costs all others a little

    /// Primitives in object space, or in world space when `to_world` is given. The mesh outlives the geometry.
    GeometryPtr make(const MeshEntry& entry, const Affine* to_world) {
        GeometryPtr geometry(make_geometry(device, *entry.mesh, entry.repeated, to_world, [&] {
            if (!progress.report(0)) throw Cancelled{};
        }));
        check(state, entry.mesh->name);
        return geometry;
    }

    ScenePtr new_scene(RTCBuildQuality quality) {
        ScenePtr scene(rtcNewScene(device));
        check(state, {});
        rtcSetSceneFlags(scene.get(), RTCSceneFlags(RTC_SCENE_FLAG_ROBUST | (filters ? kFilterFlag : 0)));
        rtcSetSceneBuildQuality(scene.get(), quality);
        return scene;
    }

    void commit(RTCScene scene, double triangles, const std::string& where) {
        progress.begin(triangles);
        if (before_sort) before_sort(triangles);
        rtcSetSceneProgressMonitorFunction(scene, monitor, &progress);
        rtcCommitScene(scene);
        rtcSetSceneProgressMonitorFunction(scene, nullptr, nullptr);
        progress.end();
        check(state, where);
    }
};

}  // namespace

struct Accelerator::State {
    DeviceState device_state;
    DevicePtr device;
    int threads = -1;
    std::unordered_map<const scene::Mesh*, MeshEntry> meshes;
    bool high_quality = false, filters = false;
    uint32_t generation = 0;
    ScenePtr top;
    std::vector<Placed> placed;                               ///< by object index
    std::unordered_map<int32_t, Flat> flat;                   ///< those that are flattened
    std::unordered_map<int32_t, std::vector<Affine>> motion;  ///< those that move: their maps
    size_t geometries = 0;                                    ///< of the top level

    void drop_top() {
        placed = {};
        flat.clear();
        motion.clear();
        geometries = 0;
        top.reset();
    }
    void open(int wanted);
    void detach(int32_t object);
    bool attach(Builder& builder, const scene::SceneView& view, int32_t object, uint32_t visibility, const MeshEntry& entry, bool instanced);
    void place(Builder& builder, const scene::SceneTables& tables, bool flatten);
};

Accelerator::Accelerator() : state_(std::make_unique<State>()) {}
Accelerator::~Accelerator() = default;

void Accelerator::State::open(int wanted) {
    if (device && threads == wanted) return;
    drop_top();
    meshes.clear();
    device.reset();
    // A number of threads limits TBB in the whole process for as long as the device lives: only where the user asked for one.
    const std::string config = "verbose=0,start_threads=0" + (wanted > 0 ? ",threads=" + std::to_string(wanted) : std::string());
    device.reset(rtcNewDevice(config.c_str()));
    if (!device) throw Error("Embree could not start (error " + std::to_string(int(rtcGetDeviceError(nullptr))) + ")");
    threads = wanted;
    rtcSetDeviceErrorFunction(device.get(), keep_error, &device_state);
    rtcSetDeviceMemoryMonitorFunction(device.get(), count_bytes, &device_state);
}

void Accelerator::State::detach(int32_t object) {
    Placed& was = placed[size_t(object)];
    if (was.visibility == 0) return;
    rtcDetachGeometry(top.get(), unsigned(object));
    --geometries;
    was = {};
    flat.erase(object);
    motion.erase(object);
}

/// Places an object; one that is there already and stayed the same is left alone. True when something changed.
bool Accelerator::State::attach(Builder& builder, const scene::SceneView& view, int32_t object, uint32_t visibility, const MeshEntry& entry, bool instanced) {
    const unsigned id = unsigned(object);
    const Affine& to_world = view.objects[object].to_world;
    const scene::MotionView moves = instanced ? scene::motion_of(view, object) : scene::MotionView{};
    Placed& now = placed[size_t(object)];
    bool moved = true, keeps = now.visibility != 0 && (now.generation != 0) == instanced;
    if (keeps && instanced) {
        Affine was;
        rtcGetGeometryTransform(rtcGetGeometry(top.get(), id), 0, RTC_FORMAT_FLOAT3X4_ROW_MAJOR, was.m);
        const auto found = motion.find(object);
        const std::span<const Affine> before = found == motion.end() ? std::span<const Affine>{} : found->second;
        moved =
            moves.steps > 0 || !before.empty() ? !std::equal(before.begin(), before.end(), moves.maps, moves.maps + moves.steps, same) : !same(was, to_world);
        keeps = now.generation == entry.generation;
    } else if (keeps) {
        const Flat& was = flat.at(object);
        moved = !same(was.to_world, to_world);
        keeps = was.mesh == entry.mesh && !moved;
    }
    if (keeps && !moved && now.visibility == visibility) return false;

    RTCGeometry geometry = keeps ? rtcGetGeometry(top.get(), id) : nullptr;
    if (!keeps) {
        detach(object);
        GeometryPtr made;
        if (instanced) {
            made.reset(rtcNewGeometry(builder.device, RTC_GEOMETRY_TYPE_INSTANCE));
            rtcSetGeometryInstancedScene(made.get(), entry.scene.get());
        } else {
            made = builder.make(entry, &to_world);
            flat[object] = {entry.mesh, to_world};
        }
        rtcAttachGeometryByID(top.get(), made.get(), id);  // which keeps it
        ++geometries;
        geometry = made.get();
    }
    if (instanced) {
        rtcSetGeometryTimeStepCount(geometry, unsigned(std::max(moves.steps, 1)));
        rtcSetGeometryTransform(geometry, 0, RTC_FORMAT_FLOAT3X4_ROW_MAJOR, to_world.m);
        for (int32_t step = 0; step < moves.steps; ++step) rtcSetGeometryTransform(geometry, unsigned(step), RTC_FORMAT_FLOAT3X4_ROW_MAJOR, moves.maps[step].m);
        if (moves.steps > 0)
            motion[object].assign(moves.maps, moves.maps + moves.steps);
        else
            motion.erase(object);
    }
    rtcSetGeometryMask(geometry, visibility);
    rtcCommitGeometry(geometry);
    now = {visibility, instanced ? entry.generation : 0};
    return true;
}

void Accelerator::State::place(Builder& builder, const scene::SceneTables& tables, bool flatten) {
    const scene::SceneView& view = tables.view;
    const int32_t objects = view.object_count;

    // Who is placed at all: by rank of the map, 0 for those that are not.
    std::vector<uint8_t> ranks(size_t(objects), 0);
    std::vector<bool> shown(tables.keep_alive.size(), false);
    std::unordered_set<const scene::Mesh*> used;
    for (int32_t i = 0; i < objects; ++i) {
        const scene::TraitsView& traits = scene::traits_of(view, i);
        if (traits.visibility == 0 || traits.mesh < 0 || size_t(traits.mesh) >= shown.size()) continue;
        const scene::Mesh* mesh = tables.keep_alive[size_t(traits.mesh)].get();
        const Affine& to_world = view.objects[i].to_world;
        const int of = mesh && mesh->primitive_count() > 0 && is_finite(to_world) ? rank(to_world) : 0;
        if (of < 2) continue;
        ranks[size_t(i)] = uint8_t(of);
        shown[size_t(traits.mesh)] = true;
    }
    for (size_t handle = 0; handle < shown.size(); ++handle)
        if (shown[handle]) used.insert(tables.keep_alive[handle].get());
    std::erase_if(meshes, [&](const auto& entry) { return !used.contains(entry.first); });
    std::vector<MeshEntry*> entries(shown.size(), nullptr);  // by handle
    for (size_t handle = 0; handle < shown.size(); ++handle) {
        if (!shown[handle]) continue;
        const std::shared_ptr<const scene::Mesh>& mesh = tables.keep_alive[handle];
        MeshEntry& entry = *(entries[handle] = &meshes[mesh.get()]);
        entry.uses = 0;
        entry.instanced = false;
        if (entry.mesh) continue;
        // What coincides now may part a moment later.
        if (mesh->kind == scene::GeometryKind::Triangles && mesh->motion_steps == 1) {
            entry.repeated = repeated_triangles(*mesh, [&] {
                if (!builder.progress.report(0)) throw Cancelled{};
            });
        }
        entry.mesh = mesh;
    }
    const auto entry_of = [&](int32_t i) -> MeshEntry& { return *entries[size_t(scene::traits_of(view, i).mesh)]; };
    const std::vector<uint32_t> masks = unshadowed_visibility(view, [&](int32_t i) { return ranks[size_t(i)] > 0 ? entry_of(i).mesh.get() : nullptr; });

    // How. A map that squashes the mesh flat has no inverse, so it cannot be an instance; round things stay round in their own space only.
    std::vector<Placement> how(size_t(objects), Placement::Absent);
    double top_triangles = 0;
    for (int32_t i = 0; i < objects; ++i) {
        if (masks[size_t(i)] == 0) continue;
        MeshEntry& entry = entry_of(i);
        const bool squashed = ranks[size_t(i)] == 2;
        if (squashed && entry.mesh->kind != scene::GeometryKind::Triangles) continue;
        how[size_t(i)] = squashed ? Placement::Flattened : Placement::Instanced;
        if (!squashed) ++entry.uses;
    }
    for (int32_t i = 0; i < objects; ++i) {
        if (how[size_t(i)] == Placement::Absent) continue;
        MeshEntry& entry = entry_of(i);
        const bool stays = entry.mesh->kind == scene::GeometryKind::Triangles && scene::motion_of(view, i).steps == 0;
        if (flatten && entry.uses == 1 && stays) how[size_t(i)] = Placement::Flattened;
        if (how[size_t(i)] == Placement::Instanced) entry.instanced = true;
        top_triangles += how[size_t(i)] == Placement::Flattened ? double(entry.mesh->primitive_count()) : 1;
    }

    // Hierarchies of meshes that are instanced.
    const RTCBuildQuality quality = flatten ? RTC_BUILD_QUALITY_HIGH : RTC_BUILD_QUALITY_MEDIUM;
    double triangles = 0;
    for (auto& [key, entry] : meshes) {
        if (!entry.instanced || (flatten && !high_quality) || filters != builder.filters) entry.scene.reset();
        if (entry.instanced && !entry.scene) triangles += double(key->primitive_count());
    }
    high_quality = flatten;
    builder.progress.total = triangles + top_triangles + 1;
    for (MeshEntry* entry : entries) {
        if (!entry || !entry->instanced || entry->scene) continue;
        ScenePtr scene = builder.new_scene(quality);
        const GeometryPtr geometry = builder.make(*entry, nullptr);
        rtcSetGeometryMask(geometry.get(), ~0u);
        rtcCommitGeometry(geometry.get());
        rtcAttachGeometryByID(scene.get(), geometry.get(), 0);
        builder.commit(scene.get(), double(entry->mesh->primitive_count()), "Mesh '" + entry->mesh->name + "'");
        entry->scene = std::move(scene);
        entry->generation = ++generation;
    }

    // Objects: what stayed the same is left alone.
    if (filters != builder.filters) drop_top();
    filters = builder.filters;
    bool changed = !top;
    if (!top) top = builder.new_scene(quality);
    rtcSetSceneBuildQuality(top.get(), quality);
    const size_t before = geometries;
    for (size_t i = size_t(objects); i < placed.size(); ++i) detach(int32_t(i));
    placed.resize(size_t(objects));
    for (int32_t i = 0; i < objects; ++i) {
        if (how[size_t(i)] == Placement::Absent)
            detach(i);
        else
            changed |= attach(builder, view, i, masks[size_t(i)], entry_of(i), how[size_t(i)] == Placement::Instanced);
    }
    check(builder.state, {});
    if (changed || geometries != before) builder.commit(top.get(), top_triangles, {});
}

void Accelerator::build(const scene::SceneTables& tables, const BuildOptions& options) {
    State& state = *state_;
    Progress progress;
    progress.call = &options.progress;
    try {
        state.open(options.threads);
        Builder builder{state.device.get(), state.device_state, progress, options.before_sort, tables.view.has_blockers};
        state.place(builder, tables, options.flatten);
    } catch (const std::bad_alloc&) {
        state.drop_top();
        throw Error("out of memory while building the ray tracing hierarchy");
    } catch (...) {
        state.drop_top();  // half built; finished hierarchies of shared meshes stay
        throw;
    }
}

size_t Accelerator::bytes() const {
    return size_t(std::max<int64_t>(0, state_->device_state.bytes.load())) + state_->geometries * kGeometryBytes;
}
size_t Accelerator::own_bytes() const {
    const State& s = *state_;
    size_t bytes = s.placed.capacity() * sizeof(Placed) + s.flat.size() * (sizeof(Flat) + kNodeBytes);
    for (const auto& [object, maps] : s.motion) bytes += kNodeBytes + sizeof maps + maps.capacity() * sizeof(Affine);
    for (const auto& [mesh, entry] : s.meshes) bytes += kNodeBytes + sizeof entry + entry.repeated.capacity() * sizeof(uint32_t);
    return bytes;
}
const void* Accelerator::handle() const {
    return state_->top.get();
}

size_t estimate_bytes(const scene::SceneTables& tables) {
    std::vector<bool> counted(tables.meshes.size(), false);
    size_t bytes = 0;
    for (int32_t i = 0; i < tables.view.object_count; ++i) {
        const scene::TraitsView& traits = scene::traits_of(tables.view, i);
        if (traits.mesh < 0 || traits.visibility == 0) continue;
        bytes += 440;
        if (counted[size_t(traits.mesh)]) continue;
        counted[size_t(traits.mesh)] = true;
        const scene::MeshView& mesh = tables.meshes[size_t(traits.mesh)];
        const size_t each = mesh.kind == scene::GeometryKind::Triangles ? 150 : mesh.kind == scene::GeometryKind::Curves ? 250 : 120;
        bytes += 3500 + each * size_t(mesh.primitive_count) * size_t(mesh.motion_steps);
    }
    return bytes;
}

std::string embree_version() {
    return RTC_VERSION_STRING;
}

void check_embree() {
    constexpr const char* refusal = "another Embree than the one Talbot was built for answers in this process; use Talbot's self-contained package";
    const DevicePtr device(rtcNewDevice("verbose=0,start_threads=0"));
    if (!device) throw Error("Embree could not start");
    if (rtcGetDeviceProperty(device.get(), RTC_DEVICE_PROPERTY_VERSION_MAJOR) != RTC_VERSION_MAJOR)
        throw Error(std::string(refusal) + " (built for " + RTC_VERSION_STRING + ", found " +
                    std::to_string(rtcGetDeviceProperty(device.get(), RTC_DEVICE_PROPERTY_VERSION)) + ")");
    if (!rtcGetDeviceProperty(device.get(), RTC_DEVICE_PROPERTY_RAY_MASK_SUPPORTED) ||
        !rtcGetDeviceProperty(device.get(), RTC_DEVICE_PROPERTY_FILTER_FUNCTION_SUPPORTED))
        throw Error("this Embree was built without ray masks or filter functions, which Talbot needs");

    // A ray along -z through (0.25, 0.5, 0), one metre below: t = 1, u = 0.25, v = 0.5.
    auto mesh = std::make_shared<scene::Mesh>();
    mesh->positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    mesh->triangle_vertices = {0, 1, 2};
    scene::Scene scene;
    scene.meshes = {mesh};
    scene.traits.resize(1);
    scene.traits[0].mesh = 0;
    scene.objects.resize(1);
    scene.objects[0].traits = 0;
    scene::SceneTables tables;
    scene::make_scene_view(scene, 0, tables);
    Accelerator accelerator;
    accelerator.build(tables, {});
    float o[3] = {0.25f, 0.5f, 1}, d[3] = {0, 0, -1}, t_max = 10, t = 0, u = 0, v = 0;
    int32_t object = -1, primitive = -1, visibility = int32_t(scene::kVisibleAll);
    const RayColumns ray{{&o[0], &o[1], &o[2]}, {&d[0], &d[1], &d[2]}, &t_max};
    for (int width : {1, 8, 16}) {
        object = -1;
        intersect(accelerator, ray, nullptr, 1, &visibility, {&t, &u, &v, &object, &primitive}, {width, false});
        if (object != 0 || primitive != 0 || t != 1 || u != 0.25f || v != 0.5f) throw Error(refusal);
    }
}

}  // namespace talbot::geometry
