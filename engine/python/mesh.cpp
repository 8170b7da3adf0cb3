#include <memory>

#include "python/native_session.h"
#include "scene/mesh_build.h"
#include "scene/strand_build.h"

namespace talbot::python {
namespace {

using namespace talbot::scene;

Domain read_domain(const std::string& text) {
    if (text == "VERTEX") return Domain::Vertex;
    if (text == "CORNER") return Domain::Corner;
    if (text == "FACE") return Domain::Face;
    throw Error("Unknown attribute domain '" + text + "'");
}

void read_attributes(ArrayDict& arrays, std::vector<MeshInputAttribute>& out) {
    const py::object list = arrays.value("attributes");
    if (list.is_none()) return;
    for (const py::handle item : list) {
        const py::tuple t = py::cast<py::tuple>(item);
        if (t.size() != 4) throw py::value_error("An attribute must be (name, domain, is_color, array)");
        MeshInputAttribute a;
        a.name = py::cast<std::string>(t[0]);
        a.domain = read_domain(py::cast<std::string>(t[1]));
        a.is_color = py::cast<bool>(t[2]);
        const py::object array = t[3];
        const bool bytes = a.is_color && py::hasattr(array, "dtype") && py::cast<std::string>(py::str(array.attr("dtype"))) == "uint8";
        const ArrayBuffer& buffer = arrays.hold(array, a.name, bytes ? 'B' : 'f');
        if (bytes) {
            if (buffer.columns() != 4 || buffer.dimensions() != 2) throw py::value_error("Byte colours '" + a.name + "' must have the shape (n, 4)");
            a.bytes = {static_cast<const uint8_t*>(buffer.data()), buffer.size()};
        } else {
            if (buffer.columns() < 1 || buffer.columns() > 4) throw py::value_error("Attribute '" + a.name + "' must have 1 to 4 columns");
            a.components = int(buffer.columns());
            a.floats = {static_cast<const float*>(buffer.data()), buffer.size()};
        }
        out.push_back(std::move(a));
    }
}

std::string optional_text(ArrayDict& arrays, const char* name) {
    const py::object value = arrays.value(name);
    return value.is_none() ? std::string() : py::cast<std::string>(value);
}

Vec3 optional_vector(ArrayDict& arrays, const char* name, Vec3 fallback) {
    const py::object value = arrays.value(name);
    if (value.is_none()) return fallback;
    const py::sequence items = py::cast<py::sequence>(value);
    if (items.size() != 3) throw py::value_error("'" + std::string(name) + "' must have 3 numbers");
    return {py::cast<float>(items[0]), py::cast<float>(items[1]), py::cast<float>(items[2])};
}

/// What a MeshInput and a StrandInput have alike.
void read_common(ArrayDict& arrays, auto& input) {
    read_attributes(arrays, input.attributes);
    input.active_uv = optional_text(arrays, "active_uv");
    input.active_color = optional_text(arrays, "active_color");
    input.generated_offset = optional_vector(arrays, "generated_offset", input.generated_offset);
    input.generated_scale = optional_vector(arrays, "generated_scale", input.generated_scale);
}

CurveShape read_shape(const std::string& text) {
    if (text == "ribbon") return CurveShape::Ribbon;
    if (text == "thick") return CurveShape::Thick;
    if (text == "thick_linear") return CurveShape::ThickLinear;
    throw Error("Unknown curve shape '" + text + "'");
}

std::shared_ptr<const Mesh> read_strands(NativeSession& native, const std::string& name, const py::dict& values) {
    ArrayDict arrays(values);
    if (!values.contains("positions")) throw py::key_error("Curves and points need 'positions'");
    StrandInput input;
    input.name = name;
    input.positions = arrays.get<float>("positions", 3);
    input.radii = arrays.get<float>("radii", 1);
    input.curve_starts = arrays.get<uint32_t>("curve_starts", 1);
    if (values.contains("curve_starts") && input.curve_starts.empty()) throw py::value_error("'curve_starts' must have at least one element");
    const std::string shape = optional_text(arrays, "curve_shape");
    if (!shape.empty()) input.shape = read_shape(shape);
    const py::object subdivisions = arrays.value("curve_subdivisions");
    if (!subdivisions.is_none()) input.subdivisions = py::cast<int>(subdivisions);
    read_common(arrays, input);
    arrays.finish("A mesh of curves or points");
    const py::gil_scoped_release released;
    return std::make_shared<const Mesh>(build_strands(input, native.session.report()));
}

template <class Value>
Value one_of(const std::string& text, std::initializer_list<std::pair<const char*, Value>> names, const char* what) {
    for (const auto& [name, value] : names)
        if (text == name) return value;
    throw Error("Unknown " + std::string(what) + " '" + text + "'");
}

void read_cage(ArrayDict& arrays, MeshInput& input) {
    const std::string scheme = optional_text(arrays, "subdivision"), uv = optional_text(arrays, "uv_smoothing");
    Subdivision& cage = input.subdivision;
    if (!scheme.empty())
        cage.scheme =
            one_of<SubdivisionScheme>(scheme, {{"catmull_clark", SubdivisionScheme::CatmullClark}, {"simple", SubdivisionScheme::Simple}}, "subdivision");
    if (!uv.empty())
        cage.uv_smoothing = one_of<UvSmoothing>(uv,
                                                {{"none", UvSmoothing::None},
                                                 {"corners", UvSmoothing::Corners},
                                                 {"junctions", UvSmoothing::Junctions},
                                                 {"concave", UvSmoothing::Concave},
                                                 {"borders", UvSmoothing::Borders},
                                                 {"all", UvSmoothing::All}},
                                                "smoothing of UV maps");
    const auto read = [&](const char* name, auto& to) {
        const py::object value = arrays.value(name);
        if (!value.is_none()) to = py::cast<std::remove_reference_t<decltype(to)>>(value);
    };
    read("sharp_corners", cage.sharp_corners);
    read("in_pixels", cage.in_pixels);
    read("edge_length", cage.edge_length);
    read("max_level", cage.max_level);
    input.face_starts = arrays.get<uint32_t>("face_starts", 1);
    const auto copy = [](auto span, auto& to) { to.assign(span.begin(), span.end()); };
    copy(arrays.get<uint32_t>("crease_edges", 2), cage.crease_edges);
    copy(arrays.get<float>("crease_sharpness", 1), cage.crease_sharpness);
    copy(arrays.get<uint32_t>("crease_vertices", 1), cage.crease_vertices);
    copy(arrays.get<float>("vertex_sharpness", 1), cage.vertex_sharpness);
}

std::shared_ptr<const Mesh> read_mesh(NativeSession& native, const std::string& name, const py::dict& values) {
    if (values.contains("radii")) return read_strands(native, name, values);
    ArrayDict arrays(values);
    for (const char* required : {"positions", "corner_vertices", "triangle_corners"}) {
        if (!values.contains(required)) throw py::key_error("A mesh needs '" + std::string(required) + "'");
    }
    MeshInput input;
    input.name = name;
    input.positions = arrays.get<float>("positions", 3);
    input.corner_vertices = arrays.get<uint32_t>("corner_vertices", 1);
    input.triangle_corners = arrays.get<uint32_t>("triangle_corners", 3);
    input.triangle_faces = arrays.get<uint32_t>("triangle_faces", 1);
    input.face_materials = arrays.get<int32_t>("face_materials", 1);
    input.face_smooth = arrays.get<uint8_t>("face_smooth", 1);
    input.vertex_normals = arrays.get<float>("vertex_normals", 3);
    input.corner_normals = arrays.get<float>("corner_normals", 3);
    read_common(arrays, input);
    read_cage(arrays, input);
    arrays.finish("A mesh");
    const py::gil_scoped_release released;
    return std::make_shared<const Mesh>(build_mesh(input, native.session.report()));
}

}  // namespace

Handle add_mesh(NativeSession& native, const std::string& name, const py::dict& arrays) {
    std::shared_ptr<const Mesh> mesh = read_mesh(native, name, arrays);
    Scene& scene = native.edit();
    const Handle handle = native.mesh_pool.take(scene.meshes.size());
    if (size_t(handle) == scene.meshes.size()) scene.meshes.emplace_back();
    scene.meshes[size_t(handle)] = std::move(mesh);
    scene.dirty |= kDirtyMeshes;
    scene.dirty_meshes.push_back(handle);
    return handle;
}

void set_mesh(NativeSession& native, Handle handle, const std::string& name, const py::dict& arrays) {
    Scene& scene = native.edit();
    check_handle(native.mesh_pool, handle, scene.meshes.size(), "mesh");
    scene.meshes[size_t(handle)] = read_mesh(native, name, arrays);
    scene.dirty |= kDirtyMeshes;
    scene.dirty_meshes.push_back(handle);
}

void remove_mesh(NativeSession& native, Handle handle) {
    Scene& scene = native.edit();
    check_handle(native.mesh_pool, handle, scene.meshes.size(), "mesh");
    scene.meshes[size_t(handle)] = nullptr;
    // Objects that are still there show nothing, and must not show what gets this handle next.
    for (ObjectTraits& traits : scene.traits)
        if (traits.mesh == handle) traits.mesh = kNone;
    native.mesh_pool.release(handle);
    scene.dirty |= kDirtyMeshes | kDirtyObjects;
    scene.dirty_meshes.push_back(handle);
}

}  // namespace talbot::python
