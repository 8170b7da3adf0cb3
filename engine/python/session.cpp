#include <algorithm>
#include <cstring>

#include "base/cpu.h"
#include "python/native_session.h"
#include "python/values.h"

namespace talbot::python {

using namespace talbot::scene;

Handle HandlePool::take(size_t size) {
    if (free_.empty()) return Handle(size);
    const Handle handle = free_.back();
    free_.pop_back();
    return handle;
}

bool HandlePool::is_free(Handle handle) const {
    return std::find(free_.begin(), free_.end(), handle) != free_.end();
}

void check_handle(const HandlePool& pool, Handle handle, size_t size, const char* kind) {
    if (handle < 0 || size_t(handle) >= size || pool.is_free(handle)) {
        throw py::value_error("There is no " + std::string(kind) + " with the handle " + std::to_string(handle));
    }
}

Scene& NativeSession::edit() {
    const py::gil_scoped_release released;
    return session.edit();
}

namespace {

/// float32 array of numpy, made by Python: this file does not depend on numpy's headers.
py::object make_array(const std::vector<float>& values, size_t rows) {
    const size_t columns = rows == 0 ? 1 : values.size() / rows;
    const py::object array = py::module_::import("numpy").attr("empty")(py::make_tuple(rows, columns), "float32");
    if (values.empty()) return array;
    Py_buffer view;
    if (PyObject_GetBuffer(array.ptr(), &view, PyBUF_WRITABLE | PyBUF_C_CONTIGUOUS) != 0) throw py::error_already_set();
    std::memcpy(view.buf, values.data(), values.size() * sizeof(float));
    PyBuffer_Release(&view);
    return array;
}

void check_shader_or_none(const NativeSession& native, const Scene& scene, Handle shader) {
    if (shader != kNone) check_handle(native.shader_pool, shader, scene.shaders.size(), "shader");
}

// -- shaders and images

Shader make_shader(const std::string& name, const py::dict& graph, const py::dict& values) {
    Shader shader = read_shader(values);
    shader.name = name;
    shader.graph = read_graph(name, graph);
    return shader;
}

Handle add_shader(NativeSession& native, const std::string& name, const py::dict& graph, const py::dict& values) {
    Shader shader = make_shader(name, graph, values);
    Scene& scene = native.edit();
    const Handle handle = native.shader_pool.take(scene.shaders.size());
    if (size_t(handle) == scene.shaders.size()) scene.shaders.emplace_back();
    scene.shaders[size_t(handle)] = std::move(shader);
    scene.dirty |= kDirtyShaders;
    return handle;
}

void set_shader(NativeSession& native, Handle handle, const std::string& name, const py::dict& graph, const py::dict& values) {
    Shader shader = make_shader(name, graph, values);
    Scene& scene = native.edit();
    check_handle(native.shader_pool, handle, scene.shaders.size(), "shader");
    scene.shaders[size_t(handle)] = std::move(shader);
    scene.dirty |= kDirtyShaders;
}

void remove_shader(NativeSession& native, Handle handle) {
    Scene& scene = native.edit();
    check_handle(native.shader_pool, handle, scene.shaders.size(), "shader");
    scene.shaders[size_t(handle)] = {};
    // Nothing may show what gets this handle next.
    for (auto& set : scene.material_sets) std::replace(set.begin(), set.end(), handle, kNone);
    for (Light& light : scene.lights) light.shader = light.shader == handle ? kNone : light.shader;
    if (scene.world.shader == handle) scene.world.shader = kNone;
    native.shader_pool.release(handle);
    scene.dirty |= kDirtyShaders | kDirtyObjects | kDirtyLights | kDirtyWorld;
}

Handle add_image(NativeSession& native, const py::dict& values) {
    auto image = std::make_shared<const Image>(read_image(values));
    Scene& scene = native.edit();
    const Handle handle = native.image_pool.take(scene.images.size());
    if (size_t(handle) == scene.images.size()) scene.images.emplace_back();
    scene.images[size_t(handle)] = std::move(image);
    scene.dirty |= kDirtyImages;
    return handle;
}

void set_image(NativeSession& native, Handle handle, const py::dict& values) {
    auto image = std::make_shared<const Image>(read_image(values));
    Scene& scene = native.edit();
    check_handle(native.image_pool, handle, scene.images.size(), "image");
    scene.images[size_t(handle)] = std::move(image);
    scene.dirty |= kDirtyImages;
}

void remove_image(NativeSession& native, Handle handle) {
    Scene& scene = native.edit();
    check_handle(native.image_pool, handle, scene.images.size(), "image");
    scene.images[size_t(handle)] = nullptr;
    native.image_pool.release(handle);
    scene.dirty |= kDirtyImages;
}

// -- what a session says

py::dict progress_dict(const NativeSession& native) {
    static constexpr const char* kStates[] = {"idle", "updating", "rendering", "paused", "done", "cancelled", "failed"};
    const Progress p = native.session.progress();
    py::dict out;
    out["state"] = kStates[int(p.state)];
    out["status"] = p.status;
    out["fraction"] = p.fraction;
    out["samples_done"] = p.samples_done;
    out["samples_total"] = p.samples_total;
    out["seconds"] = p.seconds;
    out["remaining"] = p.remaining;
    out["memory"] = p.memory;
    out["memory_peak"] = p.memory_peak;
    out["image_version"] = p.image_version;
    out["pixel_size"] = p.pixel_size;
    return out;
}

py::dict statistics_dict(const NativeSession& native) {
    const Statistics s = native.session.statistics();
    py::dict out;
    out["update_seconds"] = s.update_seconds;
    out["compile_seconds"] = s.compile_seconds;
    out["textures_seconds"] = s.textures_seconds;
    out["bvh_seconds"] = s.bvh_seconds;
    out["lights_seconds"] = s.lights_seconds;
    out["render_seconds"] = s.render_seconds;
    out["camera_rays"] = s.camera_rays;
    out["bounce_rays"] = s.bounce_rays;
    out["shadow_rays"] = s.shadow_rays;
    out["paths"] = s.paths;
    out["instruction_set"] = s.instruction_set;
    out["triangles"] = s.triangles;
    out["instanced_triangles"] = s.instanced_triangles;
    out["scene_bytes"] = s.scene_bytes;
    out["bvh_bytes"] = s.bvh_bytes;
    out["texture_bytes"] = s.texture_bytes;
    out["film_bytes"] = s.film_bytes;
    return out;
}

py::list report_list(NativeSession& native) {
    static constexpr const char* kLevels[] = {"info", "warning", "error"};
    py::list out;
    for (const ReportLine& line : native.session.report().lines()) out.append(py::make_tuple(kLevels[int(line.level)], line.text, line.where, line.count));
    return out;
}

size_t pixel_count(const NativeSession& native) {
    return size_t(std::max(native.session.width(), 0)) * size_t(std::max(native.session.height(), 0));
}

py::object read_pass(const NativeSession& native, const std::string& name) {
    const std::optional<Aov> aov = aov_of(name);
    const std::optional<std::string> group = light_group_of(name);
    const PassKind kind = aov || group ? PassKind::Combined : pass_kind(name);
    std::vector<float> pixels;
    size_t count = 0;
    bool available = false;
    {
        const py::gil_scoped_release released;
        available = aov     ? native.session.read_aov(*aov, pixels)
                    : group ? native.session.read_light_group(*group, pixels)
                            : native.session.read_pass(kind, pixels);
        count = pixel_count(native);
    }
    return available ? make_array(pixels, count) : py::object(py::none());
}

py::object read_denoised(const NativeSession& native) {
    std::vector<float> pixels;
    size_t count = 0;
    bool available = false;
    {
        const py::gil_scoped_release released;
        available = native.session.read_denoised(pixels);
        count = pixel_count(native);
    }
    return available ? make_array(pixels, count) : py::object(py::none());
}

std::vector<std::string> string_list(const py::object& items) {
    std::vector<std::string> out;
    for (const py::handle item : items) out.push_back(py::cast<std::string>(item));
    return out;
}

}  // namespace

void bind_session(py::module_& module) {
    using Native = NativeSession;
    const py::call_guard<py::gil_scoped_release> release;
    py::class_<Native>(module, "Session")
        .def(py::init<>())
        .def("set_settings",
             [](Native& n, const py::dict& values) {
                 Settings settings = read_settings(values);
                 Scene& scene = n.edit();
                 scene.settings = std::move(settings);
                 scene.dirty |= kDirtySettings;
             })
        .def("set_camera",
             [](Native& n, const py::dict& values) {
                 const Camera camera = read_camera(values);
                 Scene& scene = n.edit();
                 scene.camera = camera;
                 scene.dirty |= kDirtyCamera;
             })
        .def("set_dicing_camera",
             [](Native& n, const py::dict& values) {
                 const Camera camera = read_camera(values);
                 Scene& scene = n.edit();
                 scene.dicing_camera = camera;
                 scene.dirty |= kDirtyMeshes;
             })
        .def("set_world",
             [](Native& n, const py::dict& values) {
                 const World world = read_world(values);
                 Scene& scene = n.edit();
                 check_shader_or_none(n, scene, world.shader);
                 scene.world = world;
                 scene.dirty |= kDirtyWorld;
             })
        .def("set_passes",
             [](Native& n, const py::object& names) {
                 const std::vector<std::string> list = string_list(names);
                 std::vector<PassKind> passes = read_passes(list);
                 std::vector<Aov> aovs = read_aovs(list);
                 std::vector<std::string> groups = read_light_groups(list);
                 Scene& scene = n.edit();
                 scene.passes = std::move(passes);
                 scene.dirty |= aovs == scene.aovs ? kDirtyPasses : kDirtyPasses | kDirtyShaders;
                 scene.aovs = std::move(aovs);
                 // Emitters know their groups by number.
                 if (groups != scene.light_groups) scene.dirty |= kDirtyObjects | kDirtyLights | kDirtyWorld;
                 scene.light_groups = std::move(groups);
             })
        .def("set_lights",
             [](Native& n, const py::list& items) {
                 Scene& scene = n.edit();
                 std::vector<Light> lights;
                 for (const py::handle item : items) {
                     lights.push_back(read_light(py::cast<py::dict>(item)));
                     check_shader_or_none(n, scene, lights.back().shader);
                 }
                 scene.lights = std::move(lights);
                 scene.dirty |= kDirtyLights;
             })
        .def("add_mesh", &add_mesh)
        .def("set_mesh", &set_mesh)
        .def("remove_mesh", &remove_mesh)
        .def("set_objects", &set_objects)
        .def("set_object_matrices", &set_object_matrices)
        .def("set_motion", &set_motion)
        .def("set_mesh_motion", &set_mesh_motion)
        .def("add_shader", &add_shader)
        .def("set_shader", &set_shader)
        .def("remove_shader", &remove_shader)
        .def("add_image", &add_image)
        .def("set_image", &set_image)
        .def("remove_image", &remove_image)
        .def(
            "start", [](Native& n) { n.session.start(); }, release)
        .def(
            "wait", [](Native& n, int milliseconds) { return n.session.wait(milliseconds); }, release)
        .def(
            "cancel", [](Native& n) { n.session.cancel(); }, release)
        .def(
            "stop", [](Native& n) { n.session.stop(); }, release)
        .def(
            "pause", [](Native& n, bool paused) { n.session.pause(paused); }, release)
        .def("progress", &progress_dict)
        .def("statistics", &statistics_dict)
        .def("error", [](const Native& n) { return n.session.error(); })
        .def("report", &report_list)
        .def("size", [](const Native& n) { return py::make_tuple(n.session.width(), n.session.height()); })
        .def("read_pass", &read_pass)
        .def("set_denoiser",
             [](Native& n, const py::object& dirs) {
                 const std::vector<std::string> list = dirs.is_none() ? std::vector<std::string>() : string_list(dirs);
                 const py::gil_scoped_release released;
                 n.session.set_denoiser(dirs.is_none() ? nullptr : &list);
             })
        .def("read_denoised", &read_denoised)
        .def("dump", [](Native& n, const std::string& path) {
            const py::gil_scoped_release released;
            dump_scene(n.session.edit(), path);
        });
}

}  // namespace talbot::python
