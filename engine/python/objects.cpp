#include <algorithm>
#include <utility>

#include "python/native_session.h"
#include "scene/mesh_build.h"

namespace talbot::python {
namespace {

using namespace talbot::scene;

/// Lengths of optional columns must be n, indices must lie in [-1, bound).
template <typename T>
void check_column(std::span<const T> column, size_t n, const char* name, const char* each) {
    if (!column.empty() && column.size() != n) throw py::value_error("'" + std::string(name) + "' must have one row for each " + each);
}

void check_indices(std::span<const int32_t> column, size_t bound, const char* name) {
    for (const int32_t i : column) {
        if (i < -1 || i >= int64_t(bound)) throw Error("Objects: '" + std::string(name) + "' has an index out of bounds");
    }
}

/// Rows of the first three lines are objects, those of the others traits.
struct ObjectColumns {
    std::span<const int32_t> traits;
    std::span<const uint32_t> random;
    std::span<const float> matrix, dupli_generated, dupli_uv;
    std::span<const int32_t> mesh, name, material_set, pass_index, attribute_set, receiver_set, linking, light_group;
    std::span<const float> color, shading_offset, geometry_offset;
    std::span<const uint32_t> visibility, blocks, flags;
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
    for (const py::handle item : list) sets.push_back(read_object_attributes(item));
    return sets;
}

std::vector<Linking> read_linkings(ArrayDict& arrays) {
    std::vector<Linking> linkings;
    const py::object list = arrays.value("linkings");
    if (list.is_none()) return linkings;
    for (const py::handle item : list) linkings.push_back(read_linking(item));
    return linkings;
}

/// Places an object; one that cannot be seen keeps its slot, without traits.
void place(NativeSession& native, const Scene& scene, size_t i, Handle traits, const float* matrix, Object& object) {
    object.to_world = affine_from_columns(matrix);
    object.traits = traits;
    if (traits == kNone || scene.traits[size_t(traits)].mesh == kNone || repair_transform(object.to_world)) return;
    object = {{}, kNone, object.random};
    native.hidden[i] = traits;
    const Handle name = scene.traits[size_t(traits)].name;
    native.session.report().warning("Its scale is zero or its matrix is not finite; it is not rendered",
                                    name == kNone ? std::string() : "Object '" + scene.object_names[size_t(name)] + "'");
}

std::vector<ObjectTraits> make_traits(const ObjectColumns& c, size_t n) {
    std::vector<ObjectTraits> all(n);
    for (size_t i = 0; i < n; ++i) {
        ObjectTraits& o = all[i];
        o.mesh = c.mesh[i];
        if (!c.name.empty()) o.name = c.name[i];
        if (!c.material_set.empty()) o.material_set = c.material_set[i];
        if (!c.attribute_set.empty()) o.attribute_set = c.attribute_set[i];
        if (!c.visibility.empty()) o.visibility = c.visibility[i] & kVisibleAll;
        if (!c.receiver_set.empty()) o.receiver_set = uint8_t(c.receiver_set[i]);
        if (!c.blocks.empty()) o.blocks = c.blocks[2 * i] | uint64_t(c.blocks[2 * i + 1]) << 32;
        if (!c.linking.empty()) o.linking = c.linking[i];
        if (!c.light_group.empty()) o.light_group = c.light_group[i];
        if (!c.pass_index.empty()) o.pass_index = c.pass_index[i];
        if (!c.color.empty()) std::copy_n(&c.color[i * 4], 4, o.color);
        if (!c.shading_offset.empty()) o.shadow_terminator_shading_offset = c.shading_offset[i];
        if (!c.geometry_offset.empty()) o.shadow_terminator_geometry_offset = c.geometry_offset[i];
        const uint32_t flags = c.flags.empty() ? 0 : c.flags[i];
        o.is_instance = flags & 1;
        o.is_holdout = flags & 2;
        o.is_shadow_catcher = flags & 4;
    }
    return all;
}

std::vector<Dupli> make_duplis(const ObjectColumns& c, size_t n) {
    std::vector<Dupli> duplis;
    if (c.dupli_generated.empty() && c.dupli_uv.empty()) return duplis;
    duplis.resize(n);
    for (size_t i = 0; i < n; ++i) {
        if (!c.dupli_generated.empty()) duplis[i].generated = {c.dupli_generated[i * 3], c.dupli_generated[i * 3 + 1], c.dupli_generated[i * 3 + 2]};
        if (!c.dupli_uv.empty()) duplis[i].uv = {c.dupli_uv[i * 2], c.dupli_uv[i * 2 + 1]};
    }
    return duplis;
}

}  // namespace

void set_objects(NativeSession& native, const py::dict& values) {
    Scene& scene = native.edit();
    for (const char* required : {"mesh", "matrix"}) {
        if (!values.contains(required)) throw py::key_error("Objects need '" + std::string(required) + "'");
    }
    ArrayDict arrays(values);
    ObjectColumns c;
    c.traits = arrays.get<int32_t>("traits", 1);
    c.mesh = arrays.get<int32_t>("mesh", 1);
    c.matrix = arrays.get<float>("matrix", 16);
    c.name = arrays.get<int32_t>("name", 1);
    c.material_set = arrays.get<int32_t>("material_set", 1);
    c.attribute_set = arrays.get<int32_t>("attribute_set", 1);
    c.receiver_set = arrays.get<int32_t>("receiver_set", 1);
    c.blocks = arrays.get<uint32_t>("blocks", 2);
    c.linking = arrays.get<int32_t>("linking", 1);
    c.light_group = arrays.get<int32_t>("light_group", 1);
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

    const size_t n = c.matrix.size() / 16, kinds = c.mesh.size();
    if (c.traits.empty() && n != kinds) throw py::value_error("'matrix' must have one row for each object");
    check_column(c.traits, n, "traits", "object");
    check_column(c.random, n, "random", "object");
    check_column(c.dupli_generated, n * 3, "dupli_generated", "object");
    check_column(c.dupli_uv, n * 2, "dupli_uv", "object");
    check_column(c.name, kinds, "name", "mesh");
    check_column(c.material_set, kinds, "material_set", "mesh");
    check_column(c.attribute_set, kinds, "attribute_set", "mesh");
    check_column(c.receiver_set, kinds, "receiver_set", "mesh");
    check_column(c.blocks, kinds * 2, "blocks", "mesh");
    check_column(c.linking, kinds, "linking", "mesh");
    check_column(c.light_group, kinds, "light_group", "mesh");
    check_column(c.visibility, kinds, "visibility", "mesh");
    check_column(c.pass_index, kinds, "pass_index", "mesh");
    check_column(c.color, kinds * 4, "color", "mesh");
    check_column(c.flags, kinds, "flags", "mesh");
    check_column(c.shading_offset, kinds, "shading_offset", "mesh");
    check_column(c.geometry_offset, kinds, "geometry_offset", "mesh");

    const py::gil_scoped_release released;
    check_indices(c.traits, kinds, "traits");
    check_indices(c.mesh, scene.meshes.size(), "mesh");
    check_indices(c.name, names.size(), "name");
    check_indices(c.material_set, material_sets.size(), "material_set");
    check_indices(c.attribute_set, attribute_sets.size(), "attribute_set");
    check_indices(c.linking, linkings.size(), "linking");
    for (const int32_t set : c.receiver_set)
        if (set < 0 || set >= kReceiverSets) throw Error("Objects: 'receiver_set' must be 0 to 63");
    scene.traits = make_traits(c, kinds);
    scene.duplis = make_duplis(c, n);
    scene.object_names = std::move(names);
    scene.material_sets = std::move(material_sets);
    scene.object_attribute_sets = std::move(attribute_sets);
    scene.linkings = std::move(linkings);
    scene.motion.of_objects.clear();
    native.hidden.clear();
    // Not kept from before: with as many objects again both would be there for a moment.
    scene.objects = {};
    scene.objects.resize(n);
    for (size_t i = 0; i < n; ++i) {
        if (!c.random.empty()) scene.objects[i].random = c.random[i];
        place(native, scene, i, c.traits.empty() ? Handle(i) : c.traits[i], &c.matrix[i * 16], scene.objects[i]);
    }
    scene.dirty |= kDirtyObjects;
}

void set_object_matrices(NativeSession& native, const py::object& matrix) {
    Scene& scene = native.edit();
    const ArrayBuffer buffer(matrix, "matrix", 'f');
    const size_t n = scene.objects.size();
    if (buffer.dimensions() != 2 || buffer.columns() != 16 || buffer.rows() != n) throw py::value_error("'matrix' must have the shape (objects, 16)");
    const float* data = static_cast<const float*>(buffer.data());
    const py::gil_scoped_release released;
    for (const auto& [i, traits] : std::exchange(native.hidden, {})) scene.objects[i].traits = traits;
    for (size_t i = 0; i < n; ++i) place(native, scene, i, scene.objects[i].traits, data + i * 16, scene.objects[i]);
    scene.dirty |= kDirtyObjects;
}

}  // namespace talbot::python
