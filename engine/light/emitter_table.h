/// The layout behind `EmitterTable`: plain columns that kernels read and vectors that own them.
///
/// Local emitters are one list; each entry has a kind, a bound of what it can send where (`Reach`) and an index into the table of its kind.
/// Choosing one of up to kScannedEmitters weighs every entry's `Reach` at the lane's position; longer lists have a light tree. The triangles of an emissive
/// mesh always have one, in the mesh's space, that its instances share. Only kernels/select_emitter.h knows how the choice is made.
///
/// World space, metres. Radiance and intensity are per channel in the working space.
#pragma once

#include <vector>

#include "light/emitters.h"

namespace talbot::light {

/// More local emitters than this are chosen by a tree.
inline constexpr int kScannedEmitters = 64;

enum class EmitterKind : int32_t {
    Point,       ///< delta: point or spot of radius 0
    FacingDisk,  ///< point or spot whose disk turns towards the point it lights (Blender's soft falloff)
    Sphere,      ///< point or spot that is a true sphere
    Rect,        ///< area lamp of any shape, or a mesh that is one rectangle
    Mesh,        ///< emissive triangles of one object
};
inline constexpr int kEmitterKinds = 5;

enum class ReachKind : int32_t {
    Isotropic,  ///< shines alike in all directions
    Lambert,    ///< cosine law about the axis
    Oriented,   ///< cosine law about normals that lie within a cone about the axis, or an area lamp's spread
    Spot,
};

/// Directions in the frame of a spot's cone, which opens along -Z: component = row . direction.
struct ConeFrame {
    Vec3 x{1, 0, 0}, y{0, 1, 0}, z{0, 0, 1};
};

/// Estimate of an emitter's irradiance at a point, from its bounding sphere: never 0 where the emitter lights the point.
struct Reach {
    ReachKind kind = ReachKind::Isotropic;
    Vec3 center;
    float radius = 0;
    float nearest = 1e18f;  ///< bound of 1 / distance^2: within the sphere nothing gets stronger
    Vec3 axis{0, 0, 1};     ///< unit; direction of emission
    float strength = 0;     ///< irradiance (luminance, mean of channels) at distance 1 along the axis
    float cos_normals = 1;  ///< half angle of the cone about the axis that holds all normals
    float sin_normals = 0;
    float two_sided = 0;  ///< 1: the axis counts in both directions
    float behind = -2;    ///< nothing where the cosine to the axis is at most this: 0 for one-sided planes
    float cos_limit = 0;  ///< spread or spot: no emission beyond this angle from a normal
    float inv_tan_limit = 0;
    float gain = 1;        ///< of the spread on its axis
    float inv_smooth = 0;  ///< spot: see Lamp
    ConeFrame cone;
};

/// Rectangle c + x axis_x + y axis_y, |x| <= half_x, |y| <= half_y; or the ellipse in it. The axes and the normal are orthonormal.
struct Rect {
    Vec3 center, axis_x, axis_y, normal;
    float half_x = 0, half_y = 0;
    float is_ellipse = 0;
    float ellipse_area = 0;  ///< of an ellipse with these half axes
    float two_sided = 0;
    float tan_limit = 1e18f;  ///< tangent of half the spread
};

/// A point, spot or area lamp.
struct Lamp {
    Vec3 center;
    float radius = 0;
    Rgb power;                ///< radiance; intensity for EmitterKind::Point. Already times a constant emission
    float inv_tan_limit = 0;  ///< area: the spread's profile is max(1 - tan(t) inv_tan_limit, 0) gain
    float gain = 1;
    float is_spot = 0;
    float axis_power = 0;  ///< 1: intensity times the cosine to the axis (3.4's spot)
    float cos_outer = -1;  ///< spot: smoothstep of (c - cos_outer) inv_smooth
    float inv_smooth = 0;
    float inv_tan_outer = 0;  ///< for texture coordinates
    ConeFrame cone;
    int32_t kind = 0;
    int32_t rect = -1;
    int32_t emitter = -1;         ///< in the list of local emitters; -1: not sampled (no power)
    int32_t program_shader = -1;  ///< shader whose emission program multiplies `power`; -1: constant
    int32_t visibility = 0;
    int32_t hit_visibility = 0;                ///< rays that may hit it (without MIS, and linked: camera rays only)
    int32_t linked_visibility = 0;             ///< linked: rays that may hit it and look for such lamps
    int32_t blockers = scene::kVisibleShadow;  ///< mask of its shadow rays; 0: nothing casts a shadow
    uint64_t receivers = scene::Linking{}.receivers;
    int32_t max_bounces = 1024;
    int32_t light_group = -1;
    int32_t handle = -1;
    Affine to_world, to_object;  ///< for its program
};

/// A node of a light tree: a bound of what all below it send where. Children lie side by side.
struct TreeNode {
    Vec3 center;
    float radius = 0;  ///< of the sphere around everything below
    Vec3 axis{0, 0, 1};
    float strength = 0;                             ///< irradiance at distance 1 where all shine along the axis
    float cos_normals = 1, sin_normals = 0;         ///< half angle of the cone about the axis that holds all normals; -1: all directions
    float cos_limit = 0;                            ///< no light beyond this angle from a normal
    float two_sided = 0;                            ///< 1: the axis counts in both directions
    uint64_t receivers = 0;                         ///< sets that any of them lights
    int32_t children = -1, parent = -1, item = -1;  ///< node of the first child, -1: a leaf, which has an item
};

/// What the space of a tree does to the angles and distances of the world.
enum class TreeSpace : int32_t {
    KeepsAngles,  ///< the world itself, or scaled alike in all directions
    Bent,         ///< normals mean nothing there
    Flat,         ///< nor does the point: the map cannot be undone
};

/// Emissive triangles of one (mesh, materials), object space; instances share it.
struct LightTriangle {
    Vec3 a, b, c;
    int32_t leaf = -1;  ///< its node
    int32_t primitive = 0;
    int32_t shader = 0;
    int32_t sides = 3;  ///< bit 0: light-sampled on the front, bit 1: on the back
};
struct MeshEmitter {
    Affine to_world;
    Affine to_object;
    TreeSpace space = TreeSpace::KeepsAngles;
    int32_t first = 0, count = 0;  ///< in light_triangles; leaf items count from the first
    int32_t root = -1;             ///< of its triangles' tree
    int32_t map = 0;               ///< in primitive_to_triangle: triangle of primitive k at map + k, -1: none
    int32_t object = -1;
    int32_t visibility = 0;
    int32_t blockers = scene::kVisibleShadow;
    float front_sign = 1;  ///< -1: the map mirrors, a triangle's world cross product points to the back
    bool moves = false;    ///< the maps and triangles here are of one moment only; others are in the scene
};

struct Emitter {
    int32_t kind = 0;
    int32_t lamp = -1, mesh = -1, rect = -1;
};

struct Sun {
    Vec3 direction;       ///< towards it, unit
    Vec3 axis_x, axis_y;  ///< orthonormal with direction; the lamp's local X and Y
    float cos_half = 1;
    float one_minus_cos = 0;       ///< 0: delta
    Rgb power;                     ///< radiance on the axis; irradiance when delta
    bool tangent_profile = false;  ///< radiance times 1/cos^3 (3.4)
    float probability = 0;
    int32_t program_shader = -1;
    int32_t visibility = 0;
    int32_t hit_visibility = 0, linked_visibility = 0;  ///< as of lamps
    int32_t blockers = scene::kVisibleShadow;
    uint64_t receivers = scene::Linking{}.receivers;
    int32_t max_bounces = 1024;
    int32_t light_group = -1;
    int32_t handle = -1;
    Affine to_world, to_object;  ///< for its program
};

/// Importance map of the world: latitude rows (0 = +Z) by longitude columns, piecewise constant in (u, v).
struct WorldMap {
    int width = 0, height = 0;
    const float* rows = nullptr;     ///< height + 1: running share of the rows
    const float* columns = nullptr;  ///< height * (width + 1): running share within each row
    const float* density = nullptr;  ///< height * width: density per unit (u, v)
    float probability = 0;           ///< of choosing the world in the distant stratum; 0: not sampled
    // A bright disc in the sky, finer than the map's cells.
    Vec3 sun, sun_x{1, 0, 0}, sun_y{0, 1, 0};  ///< towards its middle; orthonormal
    float sun_one_minus_cos = 1;
    float sun_share = 0;  ///< of the world's samples; 0: no disc
};

/// True when the mask of sets holds the receiver's, or nobody receives (-1).
TALBOT_INLINE bool is_lit(uint64_t receivers, int32_t receiver) {
    return receiver < 0 || ((receivers >> receiver) & 1) != 0;
}

/// What kernels read.
struct EmitterView {
    const Emitter* emitters = nullptr;
    const Reach* reach = nullptr;
    const TreeNode* nodes = nullptr;        ///< of all trees
    const int32_t* emitter_leaf = nullptr;  ///< by emitter: its node; null: the list is short and has no tree
    int32_t root = -1;                      ///< of the emitters' tree
    const uint64_t* receivers = nullptr;    ///< by emitter: sets it lights; null: each lights all
    const int32_t* light_groups = nullptr;  ///< by emitter; -1: none
    int emitter_count = 0;
    bool has_kind[kEmitterKinds] = {};
    const Lamp* lamps = nullptr;
    int lamp_count = 0;
    const int32_t *visible_lamps = nullptr, *linked_lamps = nullptr;  ///< those with hit_visibility, with linked_visibility
    int visible_lamp_count = 0, linked_lamp_count = 0;
    const Rect* rects = nullptr;
    const MeshEmitter* meshes = nullptr;
    const LightTriangle* triangles = nullptr;
    const int32_t* primitive_to_triangle = nullptr;
    const int32_t* object_emitter = nullptr;  ///< by object: index into emitters, -1: not sampled
    int object_count = 0;                     ///< 0 where no mesh emits
    const Sun* suns = nullptr;
    int sun_count = 0;
    bool has_lamp_programs = false;
    bool has_mesh_programs = false;
    bool hits_keep_normals = false;  ///< before 4.0, shaders of lamps that rays hit read their normal (and IES tables) without the lamp's turn
    WorldMap world;
    float distant_scale[scene::kReceiverSets];  ///< by receiver set: 1 / probability of all distant emitters that light it; 0: none does
    int world_shader = -1;
    int world_visibility = 0;
    int world_max_bounces = 1024;
    int32_t world_light_group = -1;
};

struct EmitterTable {
    EmitterView view;
    EmitterSummary summary;
    std::vector<Emitter> emitters;
    std::vector<Reach> reach;
    std::vector<TreeNode> nodes;
    std::vector<int32_t> emitter_leaf;
    std::vector<uint64_t> receivers;
    std::vector<int32_t> light_groups;
    std::vector<Lamp> lamps;
    std::vector<int32_t> visible_lamps, linked_lamps;
    std::vector<Rect> rects;
    std::vector<MeshEmitter> meshes;
    std::vector<LightTriangle> triangles;
    std::vector<int32_t> primitive_to_triangle;
    std::vector<int32_t> object_emitter;
    std::vector<Sun> suns;
    std::vector<float> world_rows, world_columns, world_density;
};

/// What a tree is made of. `strength`: irradiance at distance 1 along the axis, > 0.
struct TreeItem {
    Vec3 center;
    float radius = 0;
    Vec3 axis{0, 0, 1};
    float strength = 0;
    float cos_normals = -1;  ///< -1: all directions alike
    float cos_limit = 0;     ///< no light beyond this angle from a normal, which is at most a right one
    bool two_sided = false;
    uint64_t receivers = scene::Linking{}.receivers;
};

/// Appends the tree of these items (at least one) to table.nodes. Returns its root; leaves[i] is the node of item i.
int32_t add_tree(const std::vector<TreeItem>& items, EmitterTable& table, std::vector<int32_t>& leaves);

/// The three parts of `build_emitters`; each appends to the table's vectors. Views are set afterwards.
void add_lamps(const scene::Scene& scene, const shader::Programs& programs, Report& report, EmitterTable& table);
void add_meshes(const scene::Scene& scene, const scene::SceneTables& tables, const shader::Programs& programs, Report& report, const std::atomic<bool>* cancel,
                EmitterTable& table);
/// The map from luminance on a grid of 2 width x 2 height cell centres, row 0 at +Z. Returns the mean, 0 when the sky is black or (almost) uniform and
/// no map is made.
float make_world_map(const std::vector<float>& fine, int width, int height, EmitterTable& table);
/// Mean radiance of the world's map, 0 when the world is constant or not sampled.
float add_world(const scene::Scene& scene, const shader::Programs& programs, const shader::ShaderContext& context, WorkerPool& pool,
                const std::atomic<bool>* cancel, EmitterTable& table);

}  // namespace talbot::light
