#include "session/check_scene.h"

#include <algorithm>
#include <bit>

namespace talbot {

namespace {

using namespace scene;

void demand(bool holds, const std::string& what, const std::string& where) {
    if (!holds) throw Error(what, where);
}

void check_handle(Handle handle, size_t count, const char* kind, const std::string& where) {
    demand(handle >= kNone && (handle == kNone || size_t(handle) < count), std::string("a ") + kind + " that does not exist", where);
}

/// One more than the largest; 0 for none.
size_t bound_of(const std::vector<uint32_t>& indices) {
    return indices.empty() ? 0 : size_t(*std::max_element(indices.begin(), indices.end())) + 1;
}

template <class T>
void check_length(const std::vector<T>& list, size_t n, const char* name, const std::string& where) {
    demand(list.empty() || list.size() == n, std::string("the wrong number of ") + name, where);
}

void check_attribute(const Attribute& attribute, size_t elements, const std::string& where) {
    const std::string attribute_where = where + " > attribute '" + attribute.name + "'";
    demand(attribute.components >= 1 && attribute.components <= 4, "not 1 to 4 components", attribute_where);
    demand(attribute.data.size() / attribute.components >= elements, "too few values", attribute_where);
}

/// Curves and points: what the build makes sure of, for scenes that come from elsewhere.
void check_strands(const Mesh& mesh, const std::string& where) {
    const bool curves = mesh.kind == GeometryKind::Curves;
    const size_t count = curves && !mesh.curve_starts.empty() ? mesh.curve_starts.size() - 1 : 0;
    demand(mesh.triangle_vertices.empty() && mesh.triangle_materials.empty() && mesh.triangle_smooth.empty() && mesh.vertex_normals.empty() &&
               mesh.corner_normals.empty(),
           "triangles beside curves or points", where);
    demand(mesh.radii.size() == mesh.positions.size(), "the wrong number of radii", where);
    demand(mesh.segment_keys.size() == mesh.segment_curves.size(), "the wrong number of segments", where);
    for (size_t i = 0; i < count; ++i)
        demand(mesh.curve_starts[i] < mesh.curve_starts[i + 1] && mesh.curve_starts[i + 1] <= mesh.positions.size(), "a curve without keys", where);
    for (size_t i = 0; i < mesh.segment_keys.size(); ++i) {
        const size_t curve = mesh.segment_curves[i];
        demand(curve < count && mesh.segment_keys[i] >= mesh.curve_starts[curve] && mesh.segment_keys[i] + 1 < mesh.curve_starts[curve + 1],
               "a segment outside its curve", where);
    }
    for (const Attribute& attribute : mesh.attributes) {
        demand(attribute.domain == Domain::Vertex || (curves && attribute.domain == Domain::Face) || attribute.domain == Domain::Object,
               "a domain that curves and points do not have", where + " > attribute '" + attribute.name + "'");
        check_attribute(attribute, attribute.domain == Domain::Vertex ? mesh.positions.size() : attribute.domain == Domain::Face ? count : 1, where);
    }
}

void check_cage(const Mesh& mesh, const std::string& where) {
    const Subdivision& cage = mesh.subdivision;
    const size_t faces = cage.face_starts.empty() ? 0 : cage.face_starts.size() - 1, corners = cage.corner_vertices.size();
    demand(bound_of(cage.corner_vertices) <= mesh.positions.size() && bound_of(cage.crease_edges) <= mesh.positions.size() &&
               bound_of(cage.crease_vertices) <= mesh.positions.size(),
           "a vertex of the cage that does not exist", where);
    demand(cage.face_starts.empty() ? corners == 0 : cage.face_starts.front() == 0 && cage.face_starts.back() == corners, "faces beside the corners", where);
    demand(std::is_sorted(cage.face_starts.begin(), cage.face_starts.end()), "faces that go backwards", where);
    check_length(cage.face_materials, faces, "material slots of the cage", where);
    check_length(cage.face_smooth, faces, "smooth flags of the cage", where);
    demand(cage.crease_edges.size() == 2 * cage.crease_sharpness.size() && cage.crease_vertices.size() == cage.vertex_sharpness.size(),
           "the wrong number of creases", where);
    demand(cage.max_level >= 1 && cage.max_level <= 16 && cage.edge_length > 0, "an impossible dicing", where);
    for (const Attribute& attribute : mesh.attributes) {
        const size_t elements = attribute.domain == Domain::Corner ? corners : attribute.domain == Domain::Face ? faces : 1;
        demand(attribute.domain != Domain::Triangle, "values of a cage's triangles", where + " > attribute '" + attribute.name + "'");
        check_attribute(attribute, elements, where);
    }
}

void check_mesh(const Mesh& mesh) {
    const std::string where = "Mesh '" + mesh.name + "'";
    // As many as Embree takes.
    demand(mesh.motion_steps >= 1 && mesh.motion_steps <= 129, "an impossible number of motion steps", where);
    const size_t steps = mesh.motion_steps > 1 ? size_t(mesh.motion_steps) : 0,
                 normals = (mesh.corner_normals.empty() ? mesh.vertex_normals : mesh.corner_normals).size();
    demand(mesh.motion_positions.size() == mesh.positions.size() * steps, "the wrong number of positions in motion", where);
    check_length(mesh.motion_normals, normals * steps, "normals in motion", where);
    if (mesh.kind != GeometryKind::Triangles) return check_strands(mesh, where);
    if (mesh.subdivision.scheme != SubdivisionScheme::None) check_cage(mesh, where);
    const size_t triangles = mesh.triangle_count();
    demand(mesh.triangle_vertices.size() % 3 == 0, "half a triangle", where);
    demand(bound_of(mesh.triangle_vertices) <= mesh.positions.size(), "a vertex that does not exist", where);
    check_length(mesh.triangle_corners, triangles * 3, "corners", where);
    check_length(mesh.triangle_faces, triangles, "faces", where);
    check_length(mesh.triangle_materials, triangles, "material slots", where);
    check_length(mesh.triangle_smooth, triangles, "smooth flags", where);
    check_length(mesh.vertex_normals, mesh.positions.size(), "vertex normals", where);
    const size_t corners = bound_of(mesh.triangle_corners), faces = mesh.triangle_faces.empty() ? triangles : bound_of(mesh.triangle_faces);
    const bool has_corners = !mesh.triangle_corners.empty() || triangles == 0;
    demand(mesh.corner_normals.empty() || (has_corners && mesh.corner_normals.size() >= corners), "too few corner normals", where);
    for (const Attribute& attribute : mesh.attributes) {
        demand(attribute.domain != Domain::Corner || has_corners, "corner values on a mesh without corners", where + " > attribute '" + attribute.name + "'");
        const size_t elements = attribute.domain == Domain::Vertex     ? mesh.positions.size()
                                : attribute.domain == Domain::Corner   ? corners
                                : attribute.domain == Domain::Face     ? faces
                                : attribute.domain == Domain::Triangle ? triangles
                                                                       : 1;
        check_attribute(attribute, elements, where);
    }
}

void check_graph(const ShaderGraph& graph) {
    const int nodes = int(graph.nodes.size());
    demand(graph.output_node >= -1 && graph.output_node < nodes, "an output node that does not exist", graph.name);
    for (const Node& node : graph.nodes)
        for (const NodeInput& input : node.inputs)
            demand(input.from_node >= -1 && input.from_node < nodes, "a link from a node that does not exist", graph.name + " > node '" + node.name + "'");
}

void check_motion(const Motion& motion) {
    const std::string where = "the motion";
    const auto steps = [&](size_t n) { demand(n >= 2 && n <= 129, "an impossible number of steps", where); };
    for (const auto& maps : motion.objects) steps(maps.size());
    if (!motion.camera.empty()) steps(motion.camera.size());
    demand(motion.camera_views.empty() || motion.camera_views.size() == 4 * motion.camera.size(), "the wrong number of views", where);
    demand(motion.shutter.size() != 1, "a shutter of one moment", where);
    for (float moment : motion.shutter) demand(moment >= 0 && moment <= 1, "a moment outside the shutter", where);
}

void check_linking(const Linking& linking, const std::string& where) {
    demand(linking.blockers >= -1 && linking.blockers < kBlockerGroups, "a blocker group that does not exist", where);
}

void check_object_attributes(const std::vector<Attribute>& set) {
    for (const Attribute& attribute : set)
        demand(attribute.components >= 1 && attribute.components <= 4 && attribute.data.size() >= attribute.components, "too few values",
               "attribute '" + attribute.name + "'");
}

}  // namespace

void check_scene(const Scene& scene) {
    for (const auto& mesh : scene.meshes)
        if (mesh) check_mesh(*mesh);
    for (const Shader& shader : scene.shaders) check_graph(shader.graph);
    check_motion(scene.motion);
    for (const auto& set : scene.material_sets)
        for (Handle shader : set) check_handle(shader, scene.shaders.size(), "material", "a material set");
    for (const auto& set : scene.object_attribute_sets) check_object_attributes(set);
    for (const ObjectTraits& object : scene.traits) {
        check_handle(object.name, scene.object_names.size(), "name", "an object");
        const std::string where = object.name == kNone ? "an object" : "Object '" + scene.object_names[size_t(object.name)] + "'";
        check_handle(object.mesh, scene.meshes.size(), "mesh", where);
        check_handle(object.linking, scene.linkings.size(), "light linking", where);
        demand(object.receiver_set < kReceiverSets, "a receiver set that does not exist", where);
        check_handle(object.material_set, scene.material_sets.size(), "material set", where);
        check_handle(object.attribute_set, scene.object_attribute_sets.size(), "set of attributes", where);
    }
    for (const Object& object : scene.objects) check_handle(object.traits, scene.traits.size(), "object's traits", "an object");
    demand(scene.duplis.empty() || scene.duplis.size() == scene.objects.size(), "the wrong number of instancers", "the objects");
    const std::vector<Handle>& moving = scene.motion.of_objects;
    demand(moving.empty() || moving.size() == scene.objects.size(), "the wrong number of moving objects", "the motion");
    for (Handle motion : moving) check_handle(motion, scene.motion.objects.size(), "motion", "an object");
    for (const Linking& linking : scene.linkings) check_linking(linking, "an object");
    for (const Light& light : scene.lights) {
        check_handle(light.shader, scene.shaders.size(), "node tree", "Light '" + light.name + "'");
        check_linking(light.linking, "Light '" + light.name + "'");
        check_object_attributes(light.attributes);
    }
    check_handle(scene.world.shader, scene.shaders.size(), "node tree", "the world");
    for (const auto& image : scene.images) {
        if (!image || image->pixels.empty()) continue;
        const std::string where = "Image '" + image->name + "'";
        demand(image->width >= 0 && image->height >= 0 && image->pixels.size() / 4 >= size_t(image->width) * size_t(image->height), "too few pixels", where);
    }
}

}  // namespace talbot
