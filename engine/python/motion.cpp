#include <algorithm>
#include <cmath>

#include "python/native_session.h"

namespace talbot::python {
namespace {

using namespace talbot::scene;

constexpr size_t kMaxSteps = 129;  ///< as many as Embree takes

bool is_finite(std::span<const float> values) {
    for (float v : values)
        if (!std::isfinite(v)) return false;
    return true;
}

/// (steps, 16) matrices.
std::vector<Affine> read_maps(ArrayDict& arrays, py::handle object, const char* name) {
    const ArrayBuffer& buffer = arrays.hold(object, name, 'f');
    const std::span<const float> values{static_cast<const float*>(buffer.data()), buffer.size()};
    if (buffer.dimensions() != 2 || buffer.columns() != 16 || buffer.rows() < 2 || buffer.rows() > kMaxSteps)
        throw py::value_error("'" + std::string(name) + "' must have the shape (2 to 129, 16)");
    if (!is_finite(values)) throw Error("The motion has numbers that are not finite");
    std::vector<Affine> maps;
    for (size_t i = 0; i < buffer.rows(); ++i) maps.push_back(affine_from_columns(values.data() + 16 * i));
    return maps;
}

}  // namespace

void set_motion(NativeSession& native, const py::dict& values) {
    Scene& scene = native.edit();
    ArrayDict arrays(values);
    Motion motion;
    const py::object objects = arrays.value("objects"), camera = arrays.value("camera"), rolling = arrays.value("rolling_duration");
    if (!objects.is_none())
        for (const py::handle item : objects) motion.objects.push_back(read_maps(arrays, item, "objects"));
    if (!camera.is_none()) motion.camera = read_maps(arrays, camera, "camera");
    const std::span<const float> views = arrays.get<float>("camera_views", 4), shutter = arrays.get<float>("shutter", 1);
    const std::span<const int32_t> which = arrays.get<int32_t>("object_motion", 1);
    arrays.finish("The motion");
    if (!views.empty() && views.size() != 4 * motion.camera.size()) throw py::value_error("'camera_views' must have a row for each of 'camera'");
    if (shutter.size() == 1) throw py::value_error("'shutter' must have more than one moment");
    if (!is_finite(views) || !is_finite(shutter)) throw Error("The motion has numbers that are not finite");
    if (!which.empty() && which.size() != scene.objects.size()) throw py::value_error("'object_motion' must have one row for each object");
    motion.camera_views.assign(views.begin(), views.end());
    for (float moment : shutter) motion.shutter.push_back(saturate(moment));
    motion.rolling = !rolling.is_none();
    if (motion.rolling) motion.rolling_duration = saturate(py::cast<float>(rolling));
    for (const int32_t i : which)
        if (i < -1 || i >= int64_t(motion.objects.size())) throw Error("Objects: 'object_motion' has an index out of bounds");
    if (std::any_of(which.begin(), which.end(), [](int32_t i) { return i >= 0; })) motion.of_objects.assign(which.begin(), which.end());
    scene.motion = std::move(motion);
    scene.dirty |= kDirtyObjects | kDirtyCamera;
}

void set_mesh_motion(NativeSession& native, Handle handle, const py::dict& values) {
    Scene& scene = native.edit();
    check_handle(native.mesh_pool, handle, scene.meshes.size(), "mesh");
    ArrayDict arrays(values);
    const std::span<const float> positions = arrays.get<float>("positions", 3), normals = arrays.get<float>("normals", 3);
    arrays.finish("The motion of a mesh");
    Mesh mesh = *scene.meshes[size_t(handle)];
    const size_t vertices = mesh.positions.size() * 3, steps = vertices ? positions.size() / vertices : 0;
    const size_t wanted = (mesh.corner_normals.empty() ? mesh.vertex_normals : mesh.corner_normals).size() * 3 * steps;
    if (steps < 2 || steps > kMaxSteps || positions.size() != vertices * steps)
        throw py::value_error("'positions' must have 2 to 129 times as many rows as the mesh has positions");
    if (!normals.empty() && normals.size() != wanted) throw py::value_error("'normals' must have as many rows as 'positions' has steps of the mesh's normals");
    const py::gil_scoped_release released;
    const auto copy = [](std::span<const float> from, std::vector<Vec3>& to) {
        to.resize(from.size() / 3);
        // What is not finite stays at the origin, as in the mesh itself.
        for (size_t i = 0; i < to.size(); ++i) {
            const Vec3 v{from[3 * i], from[3 * i + 1], from[3 * i + 2]};
            to[i] = std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z) ? v : Vec3{};
        }
    };
    mesh.motion_steps = int32_t(steps);
    copy(positions, mesh.motion_positions);
    copy(normals, mesh.motion_normals);
    scene.meshes[size_t(handle)] = std::make_shared<const Mesh>(std::move(mesh));
    scene.dirty |= kDirtyMeshes;
    scene.dirty_meshes.push_back(handle);
}

}  // namespace talbot::python
