#include "scene/view.h"

#include <algorithm>
#include <cstring>

#include "base/pool.h"

namespace talbot::scene {
namespace {

void view_attributes(const std::vector<Attribute>& from, const std::vector<std::string>& names, const Mesh* mesh, AttributeView* out) {
    for (size_t id = 0; id < names.size(); ++id) {
        const std::string& asked = names[id];
        if (mesh && asked == kRadius) {
            if (!mesh->radii.empty()) out[id] = {mesh->radii.data(), Domain::Vertex, 1, false};
            continue;
        }
        if (mesh && asked == kCenter) {
            if (!mesh->positions.empty()) out[id] = {&mesh->positions.front().x, Domain::Vertex, 3, false};
            continue;
        }
        std::string name = asked;
        if (mesh && asked == kActiveUv) name = mesh->active_uv;
        if (mesh && asked == kActiveColor) name = mesh->active_color;
        if (mesh && asked == kActiveTangent) name = "@tangent:" + mesh->active_uv;
        const auto found = std::find_if(from.begin(), from.end(), [&](const Attribute& a) { return a.name == name; });
        if (found == from.end() || found->data.empty()) {
            // What was not displaced is where it was.
            if (mesh && asked == kUndisplaced && !mesh->positions.empty()) out[id] = {&mesh->positions.front().x, Domain::Vertex, 3, false};
            continue;
        }
        out[id] = {found->data.data(), found->domain, found->components, found->is_color};
    }
}

template <typename T>
const T* data_or_null(const std::vector<T>& v) {
    return v.empty() ? nullptr : v.data();
}

}  // namespace

int ribbon_pieces(const Mesh& mesh) {
    return std::clamp(mesh.curve_subdivisions, 0, 15) + 1;
}

AttributeId SceneTables::attribute_id(const std::string& name) {
    const auto found = std::find(attribute_names.begin(), attribute_names.end(), name);
    if (found != attribute_names.end()) return AttributeId(found - attribute_names.begin());
    attribute_names.push_back(name);
    return AttributeId(attribute_names.size() - 1);
}

MeshView view_mesh(const Mesh& mesh, const SceneTables& tables, AttributeView* attributes) {
    view_attributes(mesh.attributes, tables.attribute_names, &mesh, attributes);
    MeshView out;
    out.positions = data_or_null(mesh.positions);
    out.triangle_vertices = data_or_null(mesh.triangle_vertices);
    out.triangle_corners = data_or_null(mesh.triangle_corners);
    out.triangle_faces = data_or_null(mesh.triangle_faces);
    out.triangle_materials = data_or_null(mesh.triangle_materials);
    out.triangle_smooth = data_or_null(mesh.triangle_smooth);
    out.vertex_normals = data_or_null(mesh.vertex_normals);
    out.corner_normals = data_or_null(mesh.corner_normals);
    out.attributes = attributes;
    out.generated_offset = mesh.generated_offset;
    out.generated_scale = mesh.generated_scale;
    out.triangle_count = uint32_t(mesh.triangle_count());
    out.primitive_count = uint32_t(mesh.primitive_count());
    out.motion_steps = mesh.motion_steps;
    out.motion_positions = data_or_null(mesh.motion_positions);
    out.motion_normals = data_or_null(mesh.motion_normals);
    out.position_count = uint32_t(mesh.positions.size());
    out.normal_count = uint32_t(mesh.corner_normals.empty() ? mesh.vertex_normals.size() : mesh.corner_normals.size());
    out.kind = mesh.kind;
    out.curve_shape = mesh.curve_shape;
    out.ribbon_pieces = ribbon_pieces(mesh);
    out.radii = data_or_null(mesh.radii);
    out.curve_starts = data_or_null(mesh.curve_starts);
    out.segment_keys = data_or_null(mesh.segment_keys);
    out.segment_curves = data_or_null(mesh.segment_curves);
    return out;
}

namespace {

/// job(begin, end) for parts of 0 to n.
template <class Job>
void share(size_t n, WorkerPool* pool, Job&& job) {
    constexpr size_t part = 1 << 14;
    if (pool && n > part)
        pool->parallel_for(n, part, [&](size_t begin, size_t end, int) { job(begin, end); });
    else
        job(size_t(0), n);
}

/// The normals with lengths that the map of normals makes equal: sums of them then are sums of unit normals beyond the map.
void map_lengths(const std::vector<Vec3>& normals, const Affine& to_object, WorkerPool* pool, std::vector<Vec3>& out) {
    out.resize(normals.size());
    share(normals.size(), pool, [&](size_t begin, size_t end) {
        for (size_t i = begin; i < end; ++i) {
            const Vec3 mapped = transform_normal(to_object, normals[i]);
            const float length2 = dot(mapped, mapped);
            out[i] = length2 > 0 ? normals[i] * (1.0f / std::sqrt(length2)) : normals[i];
        }
    });
}

void map_normals(const Scene& scene, SceneTables& tables, WorkerPool* pool) {
    std::unordered_map<Handle, MappedNormals> before = std::move(tables.mapped_normals);
    tables.mapped_normals.clear();
    if (scene.settings.viewport) return;
    std::vector<int> users(tables.meshes.size(), 0);
    const SceneView& scene_view = tables.view;
    for (int32_t i = 0; i < scene_view.object_count; ++i) {
        const TraitsView& traits = traits_of(scene_view, i);
        if (traits.mesh >= 0 && traits.visibility != 0) ++users[size_t(traits.mesh)];
    }
    for (int32_t i = 0; i < scene_view.object_count; ++i) {
        const TraitsView& traits = traits_of(scene_view, i);
        if (traits.mesh < 0 || traits.visibility == 0 || users[size_t(traits.mesh)] != 1) continue;
        if (motion_of(scene_view, i).steps > 0) continue;
        MeshView& view = tables.meshes[size_t(traits.mesh)];
        view.stands_alone = true;
        // Normals may be interpolated before or after a scale that is alike in all directions.
        if (keeps_angles(scene_view.objects[i].to_world, 1e-4f)) continue;
        const Affine& to_object = scene_view.to_object[i];
        const Mesh& mesh = *scene.meshes[size_t(traits.mesh)];
        if (mesh.kind != GeometryKind::Triangles || (!view.corner_normals && !view.vertex_normals)) continue;
        MappedNormals& mapped = tables.mapped_normals[traits.mesh];
        if (const auto known = before.find(traits.mesh); known != before.end()) mapped = std::move(known->second);
        const std::shared_ptr<const Mesh>& source = scene.meshes[size_t(traits.mesh)];
        if (mapped.source != source || std::memcmp(&mapped.to_object, &to_object, sizeof(Affine)) != 0) {
            mapped.source = source;
            mapped.to_object = to_object;
            map_lengths(view.corner_normals ? mesh.corner_normals : mesh.vertex_normals, to_object, pool, mapped.normals);
            map_lengths(mesh.motion_normals, to_object, pool, mapped.motion_normals);
        }
        view.has_mapped_normals = true;
        (view.corner_normals ? view.corner_normals : view.vertex_normals) = mapped.normals.data();
        view.motion_normals = data_or_null(mapped.motion_normals);
    }
}

}  // namespace

bool has_blockers(const Scene& scene) {
    return std::any_of(scene.linkings.begin(), scene.linkings.end(), [](const Linking& linking) { return linking.blockers >= 0; }) ||
           std::any_of(scene.lights.begin(), scene.lights.end(), [](const Light& light) { return light.linking.blockers >= 0; });
}

Handle known_light_group(const Scene& scene, Handle group) {
    return group >= 0 && size_t(group) < scene.light_groups.size() ? group : kNone;
}

void make_scene_view(const Scene& scene, Handle default_shader, SceneTables& tables, WorkerPool* pool) {
    const size_t names = tables.attribute_names.size(), meshes = scene.meshes.size(), sets = scene.object_attribute_sets.size();
    tables.keep_alive = scene.meshes;

    // One row of attribute views a mesh, then one an attribute set of objects.
    tables.attributes.assign((meshes + sets) * names, {});
    const auto row = [&](size_t i) { return names == 0 ? nullptr : tables.attributes.data() + i * names; };
    tables.meshes.assign(meshes, {});
    tables.view.has_strands = false;
    tables.view.has_holdouts = false;
    tables.view.has_motion = !scene.motion.camera.empty();
    tables.view.has_blockers = has_blockers(scene);
    tables.view.motion = &scene.motion;
    for (size_t i = 0; i < meshes; ++i) {
        if (!scene.meshes[i]) continue;
        const Mesh& mesh = *scene.meshes[i];
        tables.meshes[i] = view_mesh(mesh, tables, row(i));
        tables.view.has_strands |= mesh.kind != GeometryKind::Triangles;
        tables.view.has_motion |= mesh.motion_steps > 1;
    }
    for (size_t i = 0; i < sets; ++i) view_attributes(scene.object_attribute_sets[i], tables.attribute_names, nullptr, row(meshes + i));

    // Slots of all material sets in a row; the first one stands for objects without a set.
    tables.material_slots.assign(1, default_shader);
    std::vector<std::pair<int32_t, int32_t>> ranges;
    for (const std::vector<Handle>& set : scene.material_sets) {
        const int32_t offset = int32_t(tables.material_slots.size());
        for (Handle shader : set) tables.material_slots.push_back(shader >= 0 && size_t(shader) < scene.shaders.size() ? shader : default_shader);
        ranges.emplace_back(set.empty() ? 0 : offset, std::max(int32_t(set.size()), 1));
    }

    tables.traits.assign(1 + scene.traits.size(), {});
    for (size_t i = 0; i < scene.traits.size(); ++i) {
        const ObjectTraits& traits = scene.traits[i];
        TraitsView& out = tables.traits[1 + i];
        const bool exists = traits.mesh >= 0 && size_t(traits.mesh) < meshes && scene.meshes[size_t(traits.mesh)];
        out.mesh = exists ? traits.mesh : kNone;
        out.visibility = exists ? traits.visibility : 0;
        const bool has_set = traits.material_set >= 0 && size_t(traits.material_set) < ranges.size();
        out.material_offset = has_set ? ranges[size_t(traits.material_set)].first : 0;
        out.material_count = has_set ? ranges[size_t(traits.material_set)].second : 1;
        std::copy(traits.color, traits.color + 4, out.color);
        out.pass_index = traits.pass_index;
        out.is_holdout = traits.is_holdout;
        tables.view.has_holdouts |= traits.is_holdout;
        out.is_shadow_catcher = traits.is_shadow_catcher;
        out.receiver_set = traits.receiver_set;
        out.blocks = traits.blocks;
        if (traits.linking >= 0 && size_t(traits.linking) < scene.linkings.size()) out.linking = scene.linkings[size_t(traits.linking)];
        out.light_group = known_light_group(scene, traits.light_group);
        out.terminator_frequency = 1.0f / (1.0f - 0.5f * saturate(traits.shadow_terminator_shading_offset));
        out.geometry_offset = traits.shadow_terminator_geometry_offset;
        if (traits.attribute_set >= 0 && size_t(traits.attribute_set) < sets) out.attributes = row(meshes + size_t(traits.attribute_set));
    }
    tables.view.traits = tables.traits.data() + 1;

    tables.to_object.resize(scene.objects.size());
    share(scene.objects.size(), pool, [&](size_t begin, size_t end) {
        for (size_t i = begin; i < end; ++i) tables.to_object[i] = inverse(scene.objects[i].to_world);
    });
    tables.view.objects = data_or_null(scene.objects);
    tables.view.to_object = data_or_null(tables.to_object);
    tables.view.object_count = int32_t(scene.objects.size());
    tables.view.duplis = data_or_null(scene.duplis);
    tables.motions.clear();
    for (const std::vector<Affine>& maps : scene.motion.objects) tables.motions.push_back({maps.data(), int32_t(maps.size())});
    tables.view.motions = data_or_null(tables.motions);
    tables.view.motion_handles = data_or_null(scene.motion.of_objects);
    tables.view.has_motion |= std::any_of(scene.motion.of_objects.begin(), scene.motion.of_objects.end(), [](Handle motion) { return motion >= 0; });

    map_normals(scene, tables, pool);
    tables.view.meshes = data_or_null(tables.meshes);
    tables.view.material_slots = tables.material_slots.data();
    tables.view.attribute_count = int32_t(names);
    tables.view.settings = &scene.settings;
    tables.view.camera = &scene.camera;
}

void make_lamp_views(const Scene& scene, SceneTables& tables) {
    const size_t names = tables.attribute_names.size();
    tables.lamps.assign(scene.lights.size(), {});
    const auto reads = [&](const Light& light) { return names > 0 && !light.attributes.empty(); };
    tables.lamp_attributes.assign(size_t(std::count_if(scene.lights.begin(), scene.lights.end(), reads)) * names, {});
    AttributeView* row = tables.lamp_attributes.data();
    for (size_t i = 0; i < scene.lights.size(); ++i) {
        const Light& light = scene.lights[i];
        LampView& out = tables.lamps[i];
        out.location = {light.to_world.m[0][3], light.to_world.m[1][3], light.to_world.m[2][3]};
        std::copy(light.object_color, light.object_color + 4, out.color);
        out.pass_index = light.pass_index;
        out.random = light.random;
        if (!reads(light)) continue;
        view_attributes(light.attributes, tables.attribute_names, nullptr, row);
        out.attributes = row;
        row += names;
    }
    tables.view.lamps = data_or_null(tables.lamps);
}

}  // namespace talbot::scene
