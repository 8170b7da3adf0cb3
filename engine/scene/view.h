/// The scene as kernels see it: raw pointers into the scene's vectors, fixed for one render. Built by
/// `make_scene_view` after every edit; owns only the small tables.
#pragma once

#include <cstdint>
#include <memory>
#include <unordered_map>
#include <vector>

#include "base/vec.h"
#include "scene/scene.h"

namespace talbot {
class WorkerPool;
}

namespace talbot::scene {

/// Index into SceneView::attribute_names. Interned over all meshes and shaders.
using AttributeId = int32_t;

/// Names that stand for each mesh's own choice: its active UV map, active colour attribute, tangents of the active UV map.
inline constexpr const char* kActiveUv = "@uv";
inline constexpr const char* kActiveColor = "@color";
inline constexpr const char* kActiveTangent = "@tangent";
/// Radius at the keys of curves and of points, object space.
inline constexpr const char* kRadius = "@radius";
/// Positions of keys and points, object space.
inline constexpr const char* kCenter = "@center";
/// Vertices as they were before true displacement moved them, object space.
inline constexpr const char* kUndisplaced = "@undisplaced";
/// What the synchronisation stores under these names: a curve's way from its root at each key (0 to 1), a curve's length (object space), a number of
/// 0 to 1 for each curve or point.
inline constexpr const char* kIntercept = "@intercept";
inline constexpr const char* kLength = "@length";
inline constexpr const char* kRandom = "@random";
/// Normals at the keys of curves, object space.
inline constexpr const char* kCurveNormal = "@curve_normal";

/// And with an instance that shows a particle: index, age, lifetime (frames) and size; location and a random number; velocity; angular velocity, all
/// as Blender has them.
inline constexpr const char* kParticleState = "@particle_state";
inline constexpr const char* kParticleLocation = "@particle_location";
inline constexpr const char* kParticleVelocity = "@particle_velocity";
inline constexpr const char* kParticleSpin = "@particle_spin";

/// What custom properties of an object and of its instancer begin with in the sets of objects: the two may say different things by one name.
inline constexpr const char* kOfObject = "object:";
inline constexpr const char* kOfInstancer = "instancer:";

/// How many straight pieces a ribbon's segment is traced as: 1 to 16.
int ribbon_pieces(const Mesh& mesh);

struct AttributeView {
    const float* data = nullptr;  ///< null: the mesh has no such attribute
    Domain domain = Domain::Vertex;
    uint8_t components = 0;
    bool is_color = false;
};

struct MeshView {
    const Vec3* positions = nullptr;
    const uint32_t* triangle_vertices = nullptr;
    const uint32_t* triangle_corners = nullptr;    ///< null: none
    const uint32_t* triangle_faces = nullptr;      ///< null: identity
    const uint16_t* triangle_materials = nullptr;  ///< null: 0
    const uint8_t* triangle_smooth = nullptr;      ///< null: all smooth
    const Vec3* vertex_normals = nullptr;
    const Vec3* corner_normals = nullptr;
    const AttributeView* attributes = nullptr;  ///< SceneView::attribute_count entries
    Vec3 generated_offset, generated_scale;
    uint32_t triangle_count = 0;
    uint32_t primitive_count = 0;
    int32_t motion_steps = 1;
    uint32_t position_count = 0, normal_count = 0;  ///< of a motion step
    const Vec3* motion_positions = nullptr;         ///< null: the shape stays
    const Vec3* motion_normals = nullptr;
    bool has_mapped_normals = false;  ///< normals are not unit: the map of the only object makes their lengths equal, see make_scene_view
    bool stands_alone = false;        ///< final renders: one object shows it, at one place
    GeometryKind kind = GeometryKind::Triangles;
    CurveShape curve_shape = CurveShape::Ribbon;
    int32_t ribbon_pieces = 1;  ///< straight pieces that the tracer makes of a ribbon's segment
    const float* radii = nullptr;
    const uint32_t* curve_starts = nullptr;
    const uint32_t* segment_keys = nullptr;
    const uint32_t* segment_curves = nullptr;
};

/// What kernels see of a scene's ObjectTraits.
struct TraitsView {
    int32_t mesh = -1;
    uint32_t visibility = 0;
    int32_t material_offset = 0;  ///< shader of slot s: SceneView::material_slots[material_offset + min(s, material_count - 1)]
    int32_t material_count = 0;
    float color[4] = {1, 1, 1, 1};
    int32_t pass_index = 0;
    bool is_holdout = false, is_shadow_catcher = false;
    float terminator_frequency = 1;  ///< 1 / (1 - half the shading offset)
    float geometry_offset = 0.1f;
    int32_t receiver_set = 0;
    uint64_t blocks = 0;
    Linking linking;                            ///< of its emission
    int32_t light_group = -1;                   ///< of its emission
    const AttributeView* attributes = nullptr;  ///< Object-domain values, attribute_count entries
};

/// What the nodes of a lamp see of its object.
struct LampView {
    Vec3 location;
    float color[4] = {1, 1, 1, 1};
    int32_t pass_index = 0;
    uint32_t random = 0;
    const AttributeView* attributes = nullptr;  ///< attribute_count entries
};

/// kNone for groups that the scene has not.
Handle known_light_group(const Scene& scene, Handle group);

/// to_world of each step of a moving object.
struct MotionView {
    const Affine* maps = nullptr;
    int32_t steps = 0;  ///< 0: it stands still
};

/// Objects are many, so what kernels ask of them lies in columns: their places, the inverse maps, and few traits that many share.
struct SceneView {
    const Object* objects = nullptr;
    const Affine* to_object = nullptr;  ///< by object
    int32_t object_count = 0;
    const TraitsView* traits = nullptr;  ///< traits[kNone] are those of removed objects: no mesh, not visible
    const MotionView* motions = nullptr;
    const Handle* motion_handles = nullptr;  ///< by object, into `motions`; null: all stand still
    const Dupli* duplis = nullptr;           ///< by object; null: all 0
    const MeshView* meshes = nullptr;
    const LampView* lamps = nullptr;          ///< by light of the scene
    const int32_t* material_slots = nullptr;  ///< shader handle; a missing material is the default shader (see SceneTables::default_shader)
    int32_t attribute_count = 0;
    bool has_strands = false;  ///< some mesh is made of curves or points
    bool has_motion = false;   ///< paths have a time
    bool has_holdouts = false;
    bool has_blockers = false;  ///< see has_blockers()
    const Motion* motion = nullptr;
    const Settings* settings = nullptr;
    const Camera* camera = nullptr;
};

inline namespace TALBOT_ISA {

TALBOT_INLINE const TraitsView& traits_of(const SceneView& scene, int32_t object) {
    return scene.traits[scene.objects[object].traits];
}
TALBOT_INLINE MotionView motion_of(const SceneView& scene, int32_t object) {
    const Handle motion = scene.motion_handles ? scene.motion_handles[object] : kNone;
    return motion >= 0 ? scene.motions[motion] : MotionView{};
}

}  // namespace TALBOT_ISA

/// Normals instead of a mesh's own; made anew where the mesh or the map changed.
struct MappedNormals {
    std::shared_ptr<const Mesh> source;
    Affine to_object;
    std::vector<Vec3> normals, motion_normals;  ///< the former of corners, where it has them, or of vertices
};

/// Owns what a SceneView points into, besides the scene's own vectors.
struct SceneTables {
    SceneView view;
    std::vector<TraitsView> traits;  ///< one before the scene's own: what removed objects have
    std::vector<Affine> to_object;
    std::vector<MotionView> motions;
    std::vector<MeshView> meshes;
    std::vector<AttributeView> attributes;
    std::vector<LampView> lamps;
    std::vector<AttributeView> lamp_attributes;
    std::vector<int32_t> material_slots;
    std::unordered_map<Handle, MappedNormals> mapped_normals;  ///< by mesh
    std::vector<std::string> attribute_names;                  ///< index = AttributeId; the compiler adds the names that shaders ask for
    std::vector<std::shared_ptr<const Mesh>> keep_alive;       ///< by mesh handle, like `meshes`; null where the mesh was removed
    AttributeId attribute_id(const std::string& name);         ///< interns
};

/// What kernels see of a mesh. `attributes`: a row of tables.attribute_names.size() entries, which this fills and the view points to.
MeshView view_mesh(const Mesh& mesh, const SceneTables& tables, AttributeView* attributes);

/// Some emitter has blockers of its own.
bool has_blockers(const Scene& scene);

/// `default_shader`: handle of the shader that stands for missing materials.
/// In final renders a mesh with one user that stands still has its normals interpolated after the map of the object, all others before, as in Cycles, which
/// takes such meshes to world space first.
/// `tables.attribute_names` must hold the names the shaders ask for (compile first); they stay. `pool` shares the work; null: nobody does.
void make_scene_view(const Scene& scene, Handle default_shader, SceneTables& tables, WorkerPool* pool = nullptr);
/// The part of it that says what the nodes of lamps see.
void make_lamp_views(const Scene& scene, SceneTables& tables);

}  // namespace talbot::scene
