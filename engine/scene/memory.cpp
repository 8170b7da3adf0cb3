#include "scene/memory.h"

#include <unordered_set>

namespace talbot::scene {
namespace {

template <class... T>
size_t bytes(const std::vector<T>&... lists) {
    return (size_t(0) + ... + (lists.capacity() * sizeof(T)));
}

}  // namespace

size_t memory_of(const Mesh& m) {
    const Subdivision& s = m.subdivision;
    size_t sum = sizeof m + bytes(m.positions, m.triangle_vertices, m.triangle_corners, m.triangle_faces, m.triangle_materials, m.triangle_smooth);
    sum += bytes(m.vertex_normals, m.corner_normals, m.attributes, m.radii, m.curve_starts, m.segment_keys, m.segment_curves);
    sum += bytes(m.motion_positions, m.motion_normals);
    sum += bytes(s.face_starts, s.corner_vertices, s.face_materials, s.face_smooth, s.crease_edges, s.crease_sharpness, s.crease_vertices, s.vertex_sharpness);
    for (const Attribute& attribute : m.attributes) sum += bytes(attribute.data);
    return sum;
}

size_t memory_of(const Scene& scene, const SceneTables& tables) {
    size_t sum = bytes(scene.objects, tables.to_object, scene.duplis, scene.motion.of_objects);
    sum += bytes(scene.lights, tables.lamps, tables.lamp_attributes);
    sum += bytes(scene.traits, tables.traits, scene.motion.objects, tables.motions, tables.meshes, tables.attributes);
    for (const std::vector<Affine>& maps : scene.motion.objects) sum += bytes(maps);
    std::unordered_set<const Mesh*> seen;
    for (const auto* meshes : {&scene.meshes, &tables.keep_alive})
        for (const std::shared_ptr<const Mesh>& mesh : *meshes)
            if (mesh && seen.insert(mesh.get()).second) sum += memory_of(*mesh);
    for (const auto& [mesh, mapped] : tables.mapped_normals) sum += bytes(mapped.normals, mapped.motion_normals);
    for (const std::vector<Attribute>& set : scene.object_attribute_sets)
        for (const Attribute& attribute : set) sum += sizeof attribute + bytes(attribute.data);
    return sum;
}

}  // namespace talbot::scene
