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

enum class Placement : uint8_t { Absent, Flattened, Instanced };

struct Placed {
    Placement how = Placement::Absent;
    GeometryPtr geometry;
    std::shared_ptr<const scene::Mesh> mesh;
    Affine to_world;
    std::vector<Affine> motion;
    uint32_t visibility = 0;
    uint64_t generation = 0;  ///< of the instanced hierarchy
};

/// A mesh in use, and its hierarchy when it is instanced.
struct MeshEntry {
    std::shared_ptr<const scene::Mesh> mesh;
    std::vector<uint32_t> repeated;  ///< triangles left out, see coincident.h
    ScenePtr scene;
    bool instanced = false;
    size_t uses = 0;
    uint64_t generation = 0;  ///< of the hierarchy: an instance must be pointed at a rebuilt one
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
    uint64_t generation = 0;
    ScenePtr top;
    std::vector<Placed> placed;  ///< by object index

    void drop_top() {
        placed.clear();
        top.reset();
    }
    void open(int wanted);
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

void Accelerator::State::place(Builder& builder, const scene::SceneTables& tables, bool flatten) {
    const size_t objects = size_t(tables.view.object_count);
    const auto mesh_of = [&](size_t i) -> const std::shared_ptr<const scene::Mesh>& {
        static const std::shared_ptr<const scene::Mesh> none;
        const int32_t mesh = tables.view.objects[i].mesh;
        return mesh >= 0 && size_t(mesh) < tables.keep_alive.size() ? tables.keep_alive[size_t(mesh)] : none;
    };

    // Who is placed at all, and which rays see it.
    std::vector<const scene::Mesh*> meshes_of(objects, nullptr);
    for (size_t i = 0; i < objects; ++i) {
        const scene::ObjectView& object = tables.view.objects[i];
        const auto& mesh = mesh_of(i);
        if (mesh && mesh->primitive_count() > 0 && object.visibility != 0 && is_finite(object.to_world) && rank(object.to_world) >= 2)
            meshes_of[i] = mesh.get();
    }
    const std::unordered_set<const scene::Mesh*> used(meshes_of.begin(), meshes_of.end());
    std::erase_if(meshes, [&](const auto& entry) { return !used.contains(entry.first); });
    for (size_t i = 0; i < objects; ++i) {
        if (!meshes_of[i]) continue;
        MeshEntry& entry = meshes[meshes_of[i]];
        entry.uses = 0;
        entry.instanced = false;
        if (entry.mesh) continue;
        // What coincides now may part a moment later.
        if (meshes_of[i]->kind == scene::GeometryKind::Triangles && meshes_of[i]->motion_steps == 1) {
            entry.repeated = repeated_triangles(*meshes_of[i], [&] {
                if (!builder.progress.report(0)) throw Cancelled{};
            });
        }
        entry.mesh = mesh_of(i);
    }
    const std::vector<uint32_t> masks = unshadowed_visibility(tables, meshes_of);

    // How. A map that squashes the mesh flat has no inverse, so it cannot be an instance; round things stay round in their own space only.
    std::vector<Placement> how(objects, Placement::Absent);
    double top_triangles = 0;
    for (size_t i = 0; i < objects; ++i) {
        if (masks[i] == 0) continue;
        const bool round = meshes_of[i]->kind != scene::GeometryKind::Triangles;
        if (round && rank(tables.view.objects[i].to_world) == 2) continue;
        how[i] = rank(tables.view.objects[i].to_world) == 2 ? Placement::Flattened : Placement::Instanced;
        if (how[i] == Placement::Instanced) ++meshes[meshes_of[i]].uses;
    }
    for (size_t i = 0; i < objects; ++i) {
        if (how[i] == Placement::Absent) continue;
        MeshEntry& entry = meshes[meshes_of[i]];
        const bool stays = entry.mesh->kind == scene::GeometryKind::Triangles && tables.view.objects[i].motion_steps == 0;
        if (flatten && entry.uses == 1 && stays) how[i] = Placement::Flattened;
        if (how[i] == Placement::Instanced) entry.instanced = true;
        top_triangles += how[i] == Placement::Flattened ? double(entry.mesh->primitive_count()) : 1;
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
    for (size_t i = 0; i < objects; ++i) {
        if (how[i] != Placement::Instanced) continue;
        MeshEntry& entry = meshes.at(mesh_of(i).get());
        if (entry.scene) continue;
        ScenePtr scene = builder.new_scene(quality);
        const GeometryPtr geometry = builder.make(entry, nullptr);
        rtcSetGeometryMask(geometry.get(), ~0u);
        rtcCommitGeometry(geometry.get());
        rtcAttachGeometryByID(scene.get(), geometry.get(), 0);
        builder.commit(scene.get(), double(entry.mesh->primitive_count()), "Mesh '" + entry.mesh->name + "'");
        entry.scene = std::move(scene);
        entry.generation = ++generation;
    }

    // Objects: what stayed the same is left alone.
    if (filters != builder.filters) drop_top();
    filters = builder.filters;
    bool changed = !top;
    if (!top) top = builder.new_scene(quality);
    rtcSetSceneBuildQuality(top.get(), quality);
    for (size_t i = objects; i < placed.size(); ++i) {
        if (placed[i].geometry) rtcDetachGeometry(top.get(), unsigned(i));
        changed |= placed[i].geometry != nullptr;
    }
    placed.resize(objects);
    for (size_t i = 0; i < objects; ++i) {
        const scene::ObjectView& object = tables.view.objects[i];
        Placed& was = placed[i];
        if (how[i] == Placement::Absent) {
            if (was.geometry) rtcDetachGeometry(top.get(), unsigned(i));
            changed |= was.geometry != nullptr;
            was = {};
            continue;
        }
        const MeshEntry& entry = meshes.at(mesh_of(i).get());
        const bool instanced = how[i] == Placement::Instanced;
        const size_t steps = instanced ? size_t(object.motion_steps) : 0;
        const bool moved = !same(was.to_world, object.to_world) || was.motion.size() != steps ||
                           (steps > 0 && std::memcmp(was.motion.data(), object.motion, steps * sizeof(Affine)) != 0);
        const bool keeps = was.how == how[i] && was.mesh == entry.mesh && (instanced ? was.generation == entry.generation : !moved);
        if (keeps && !moved && was.visibility == masks[i]) continue;
        changed = true;
        if (!keeps) {
            if (was.geometry) rtcDetachGeometry(top.get(), unsigned(i));
            was = {};
            if (instanced) {
                was.geometry.reset(rtcNewGeometry(builder.device, RTC_GEOMETRY_TYPE_INSTANCE));
                rtcSetGeometryInstancedScene(was.geometry.get(), entry.scene.get());
            } else {
                was.geometry = builder.make(entry, &object.to_world);
            }
            rtcAttachGeometryByID(top.get(), was.geometry.get(), unsigned(i));
        }
        if (instanced) {
            rtcSetGeometryTimeStepCount(was.geometry.get(), unsigned(std::max<size_t>(steps, 1)));
            rtcSetGeometryTransform(was.geometry.get(), 0, RTC_FORMAT_FLOAT3X4_ROW_MAJOR, object.to_world.m);
            for (size_t step = 0; step < steps; ++step)
                rtcSetGeometryTransform(was.geometry.get(), unsigned(step), RTC_FORMAT_FLOAT3X4_ROW_MAJOR, object.motion[step].m);
        }
        rtcSetGeometryMask(was.geometry.get(), masks[i]);
        rtcCommitGeometry(was.geometry.get());
        was.how = how[i];
        was.mesh = entry.mesh;
        was.to_world = object.to_world;
        was.motion.assign(object.motion, object.motion + steps);
        was.visibility = masks[i];
        was.generation = entry.generation;
    }
    check(builder.state, {});
    if (changed) builder.commit(top.get(), top_triangles, {});
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
    return size_t(std::max<int64_t>(0, state_->device_state.bytes.load()));
}
const void* Accelerator::handle() const {
    return state_->top.get();
}

size_t estimate_bytes(const scene::SceneTables& tables) {
    std::vector<bool> counted(tables.meshes.size(), false);
    size_t bytes = 0;
    for (int32_t i = 0; i < tables.view.object_count; ++i) {
        const scene::ObjectView& object = tables.view.objects[i];
        if (object.mesh < 0 || object.visibility == 0) continue;
        bytes += 400;
        if (counted[size_t(object.mesh)]) continue;
        counted[size_t(object.mesh)] = true;
        const scene::MeshView& mesh = tables.meshes[size_t(object.mesh)];
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
    scene.objects.resize(1);
    scene.objects[0].mesh = 0;
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
