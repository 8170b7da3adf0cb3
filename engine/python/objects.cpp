#include <algorithm>

#include "python/native_session.h"
#include "scene/mesh_build.h"

namespace talbot::python {
namespace {

using namespace talbot::scene;

/// Lengths of optional columns must be n, indices must lie in [-1, bound).
template <typename T>
void check_column(std::span<const T> column, size_t n, const char* name) {
    if (!column.empty() && column.size() != n) throw py::value_error("'" + std::string(name) + "' must have one row for each object");
}

void check_indices(std::span<const int32_t> column, size_t bound, const char* name) {
    for (const int32_t i : column) {
        if (i < -1 || i >= int64_t(bound)) throw Error("Objects: '" + std::string(name) + "' has an index out of bounds");
    }
}

struct ObjectColumns {
    std::span<const int32_t> mesh, name, material_set, pass_index, attribute_set, receiver_set, linking;
    std::span<const float> matrix, color, dupli_generated, dupli_uv, shading_offset, geometry_offset;
    std::span<const uint32_t> visibility, blocks, random, flags;
};

std::vector<std::string> read_names(ArrayDict& arrays) {
    std::vector<std::string> names;
    const py::object list = arrays.value("names");
    if (list.is_none()) return names;
    for (const py::handle item : list) names.push_back(py::cast<std::string>(item));
    return names;
}

std::vector<std::vector<Handle>> read_material_sets(ArrayDict& arrays, const NativeSession& native, size_t shaders) {
    std::vector<std::vector<Handle>> sets;
    const py::object list = arrays.value("material_sets");
    if (list.is_none()) return sets;
    for (const py::handle item : list) {
        std::vector<Handle> set;
        for (const py::handle slot : item) {
            const int handle = py::cast<int>(slot);
            if (handle != kNone) check_handle(native.shader_pool, handle, shaders, "shader");
            set.push_back(handle);
        }
        sets.push_back(std::move(set));
    }
    return sets;
}

std::vector<std::vector<Attribute>> read_attribute_sets(ArrayDict& arrays) {
    std::vector<std::vector<Attribute>> sets;
    const py::object list = arrays.value("attribute_sets");
    if (list.is_none()) return sets;
    for (const py::handle item : list) {
        std::vector<Attribute> set;
        for (const py::handle pair : item) {
            const py::tuple t = py::cast<py::tuple>(pair);
            if (t.size() != 2) throw py::value_error("An object's attribute must be (name, values)");
            Attribute a;
            a.name = py::cast<std::string>(t[0]);
            a.domain = Domain::Object;
            for (const py::handle number : t[1]) a.data.push_back(py::cast<float>(number));
            if (a.data.empty() || a.data.size() > 4) throw py::value_error("Attribute '" + a.name + "' must have 1 to 4 values");
            a.components = uint8_t(a.data.size());
            set.push_back(std::move(a));
        }
        sets.push_back(std::move(set));
    }
    return sets;
}

std::vector<Linking> read_linkings(ArrayDict& arrays) {
    std::vector<Linking> linkings;
    const py::object list = arrays.value("linkings");
    if (list.is_none()) return linkings;
    for (const py::handle item : list) linkings.push_back(read_linking(item));
    return linkings;
}

/// Places an object; one that cannot be seen keeps its slot, without a mesh.
bool place(Object& object, Handle mesh, const float* matrix) {
    object.to_world = affine_from_columns(matrix);
    const bool visible = repair_transform(object.to_world);
    object.mesh = visible ? mesh : kNone;
    if (!visible) object.to_world = {};
    return visible;
}

void warn_hidden(NativeSession& native, const Scene& scene, const Object& object) {
    const std::string name = object.name == kNone ? std::string() : "Object '" + scene.object_names[size_t(object.name)] + "'";
    native.session.report().warning("Its scale is zero or its matrix is not finite; it is not rendered", name);
}

std::vector<Object> make_objects(const ObjectColumns& c, size_t n) {
    std::vector<Object> objects(n);
    for (size_t i = 0; i < n; ++i) {
        Object& o = objects[i];
        if (!c.name.empty()) o.name = c.name[i];
        if (!c.material_set.empty()) o.material_set = c.material_set[i];
        if (!c.attribute_set.empty()) o.attribute_set = c.attribute_set[i];
        if (!c.visibility.empty()) o.visibility = c.visibility[i] & kVisibleAll;
        if (!c.receiver_set.empty()) o.receiver_set = uint8_t(c.receiver_set[i]);
        if (!c.blocks.empty()) o.blocks = c.blocks[2 * i] | uint64_t(c.blocks[2 * i + 1]) << 32;
        if (!c.linking.empty()) o.linking = c.linking[i];
        if (!c.random.empty()) o.random = c.random[i];
        if (!c.pass_index.empty()) o.pass_index = c.pass_index[i];
        if (!c.color.empty()) std::copy_n(&c.color[i * 4], 4, o.color);
        if (!c.dupli_generated.empty()) o.dupli_generated = {c.dupli_generated[i * 3], c.dupli_generated[i * 3 + 1], c.dupli_generated[i * 3 + 2]};
        if (!c.dupli_uv.empty()) o.dupli_uv = {c.dupli_uv[i * 2], c.dupli_uv[i * 2 + 1]};
        if (!c.shading_offset.empty()) o.shadow_terminator_shading_offset = c.shading_offset[i];
        if (!c.geometry_offset.empty()) o.shadow_terminator_geometry_offset = c.geometry_offset[i];
        const uint32_t flags = c.flags.empty() ? 0 : c.flags[i];
        o.is_instance = flags & 1;
        o.is_holdout = flags & 2;
        o.is_shadow_catcher = flags & 4;
    }
    return objects;
}

}  // namespace

void set_objects(NativeSession& native, const py::dict& values) {
    Scene& scene = native.edit();
    for (const char* required : {"mesh", "matrix"}) {
        if (!values.contains(required)) throw py::key_error("Objects need '" + std::string(required) + "'");
    }
    ArrayDict arrays(values);
    ObjectColumns c;
    c.mesh = arrays.get<int32_t>("mesh", 1);
    c.matrix = arrays.get<float>("matrix", 16);
    c.name = arrays.get<int32_t>("name", 1);
    c.material_set = arrays.get<int32_t>("material_set", 1);
    c.attribute_set = arrays.get<int32_t>("attribute_set", 1);
    c.receiver_set = arrays.get<int32_t>("receiver_set", 1);
    c.blocks = arrays.get<uint32_t>("blocks", 2);
    c.linking = arrays.get<int32_t>("linking", 1);
    c.visibility = arrays.get<uint32_t>("visibility", 1);
    c.random = arrays.get<uint32_t>("random", 1);
    c.pass_index = arrays.get<int32_t>("pass_index", 1);
    c.color = arrays.get<float>("color", 4);
    c.flags = arrays.get<uint32_t>("flags", 1);
    c.dupli_generated = arrays.get<float>("dupli_generated", 3);
    c.dupli_uv = arrays.get<float>("dupli_uv", 2);
    c.shading_offset = arrays.get<float>("shading_offset", 1);
    c.geometry_offset = arrays.get<float>("geometry_offset", 1);
    std::vector<std::string> names = read_names(arrays);
    std::vector<std::vector<Handle>> material_sets = read_material_sets(arrays, native, scene.shaders.size());
    std::vector<std::vector<Attribute>> attribute_sets = read_attribute_sets(arrays);
    std::vector<Linking> linkings = read_linkings(arrays);
    arrays.finish("The objects' dictionary");

    const size_t n = c.mesh.size();
    if (c.matrix.size() != n * 16) throw py::value_error("'matrix' must have one row for each object");
    check_column(c.name, n, "name");
    check_column(c.material_set, n, "material_set");
    check_column(c.attribute_set, n, "attribute_set");
    check_column(c.receiver_set, n, "receiver_set");
    check_column(c.blocks, n * 2, "blocks");
    check_column(c.linking, n, "linking");
    check_column(c.visibility, n, "visibility");
    check_column(c.random, n, "random");
    check_column(c.pass_index, n, "pass_index");
    check_column(c.color, n * 4, "color");
    check_column(c.flags, n, "flags");
    check_column(c.dupli_generated, n * 3, "dupli_generated");
    check_column(c.dupli_uv, n * 2, "dupli_uv");
    check_column(c.shading_offset, n, "shading_offset");
    check_column(c.geometry_offset, n, "geometry_offset");

    const py::gil_scoped_release released;
    check_indices(c.mesh, scene.meshes.size(), "mesh");
    check_indices(c.name, names.size(), "name");
    check_indices(c.material_set, material_sets.size(), "material_set");
    check_indices(c.attribute_set, attribute_sets.size(), "attribute_set");
    check_indices(c.linking, linkings.size(), "linking");
    for (const int32_t set : c.receiver_set)
        if (set < 0 || set >= kReceiverSets) throw Error("Objects: 'receiver_set' must be 0 to 63");
    std::vector<Object> objects = make_objects(c, n);
    scene.object_names = std::move(names);
    scene.material_sets = std::move(material_sets);
    scene.object_attribute_sets = std::move(attribute_sets);
    scene.linkings = std::move(linkings);
    native.object_meshes.assign(c.mesh.begin(), c.mesh.end());
    for (size_t i = 0; i < n; ++i) {
        if (c.mesh[i] != kNone && !place(objects[i], c.mesh[i], &c.matrix[i * 16])) warn_hidden(native, scene, objects[i]);
    }
    scene.objects = std::move(objects);
    scene.dirty |= kDirtyObjects;
}

void set_object_matrices(NativeSession& native, const py::object& matrix) {
    Scene& scene = native.edit();
    const ArrayBuffer buffer(matrix, "matrix", 'f');
    const size_t n = scene.objects.size();
    if (buffer.dimensions() != 2 || buffer.columns() != 16 || buffer.rows() != n) throw py::value_error("'matrix' must have the shape (objects, 16)");
    const float* data = static_cast<const float*>(buffer.data());
    const py::gil_scoped_release released;
    for (size_t i = 0; i < n; ++i) {
        const Handle mesh = native.object_meshes[i];
        if (mesh != kNone && !place(scene.objects[i], mesh, data + i * 16)) warn_hidden(native, scene, scene.objects[i]);
    }
    scene.dirty |= kDirtyObjects;
}

}  // namespace talbot::python
