/// The scene: plain data with defaults in place and integer handles (an index into the vector of its kind; -1 is none).
/// No behaviour; whoever edits it sets the dirty bit of what changed. Lengths in metres, angles in radians, light in
/// Blender's own units as named. Everything is linear in the file's working space.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "base/vec.h"
#include "scene/shader_graph.h"

namespace talbot::scene {

using Handle = int32_t;
inline constexpr Handle kNone = -1;

/// What kinds of ray see an object or lamp (bits). Blender's ray visibility.
enum Visibility : uint32_t {
    kVisibleCamera = 1,
    kVisibleDiffuse = 2,
    kVisibleGlossy = 4,
    kVisibleTransmission = 8,
    kVisibleVolume = 16,
    kVisibleShadow = 32,
    kVisibleTransparentShadow = 64,  ///< of casters that may let light through, instead of kVisibleShadow: set by the session once materials are compiled
    kVisibleRaycast = 128,           ///< met by the Raycast node's rays
    kVisibleAll = 63 | kVisibleRaycast,
};

/// Light linking. Every object is in one of 64 receiver sets, and every emitter has a mask of the sets it lights. An emitter whose shadows only some objects
/// cast has a blocker group g of its own: of the objects with kVisibleShadow its shadow rays see those with bit g in `ObjectTraits::blocks`. Such emitters are
/// linked.
struct Linking {
    uint64_t receivers = ~uint64_t(0);  ///< bit s: lights the objects of set s
    int32_t blockers = -1;              ///< group, 0 to 62; -1: all objects
};
inline constexpr int kReceiverSets = 64, kBlockerGroups = 63;
/// Bit of `ObjectTraits::blocks` beside the groups: some blockers are chosen with regard to this object. Scattered rays look for linked emitters beyond such
/// objects only, and beyond those that let light through, as in Cycles.
inline constexpr uint64_t kChosenOrNot = uint64_t(1) << kBlockerGroups;

/// Masks of shadow rays hold one more than the group beside Visibility's bits; 0: all objects block.
inline constexpr int kBlockerShift = 8;
inline constexpr uint32_t kBlockerBits = 127u << kBlockerShift;
constexpr uint32_t shadow_mask(const Linking& linking) {
    return kVisibleShadow | uint32_t(linking.blockers + 1) << kBlockerShift;
}
constexpr int32_t blocker_group(uint32_t mask) {
    return int32_t((mask & kBlockerBits) >> kBlockerShift) - 1;
}

/// Visibility bits, shifted this far to the left, of what shadow catchers stand for: the catchers themselves and the light that counts as real. Their rays
/// have only such bits.
inline constexpr int kCatcherShift = 25;
constexpr uint32_t with_catcher_bits(uint32_t visibility, bool is_shadow_catcher) {
    return visibility | (is_shadow_catcher ? (visibility & (kVisibleRaycast - 1)) << kCatcherShift : 0u);
}
static_assert((kBlockerBits & (kVisibleAll | kVisibleTransparentShadow)) == 0 && kBlockerBits < 1u << kCatcherShift);

enum class Domain : uint8_t { Vertex, Corner, Face, Triangle, Object };

/// A named value over a domain. Corner attributes are indexed by corner, face attributes by Blender's face. Of curves Vertex is a key and Face a
/// curve, of points Vertex is a point; they have no other domains but Object.
struct Attribute {
    std::string name;  ///< Blender's name; "UVMap" and the like, Generated is "@generated" (vertex), tangents "@tangent:UVMap" (corner, 4 components, w = sign)
    Domain domain = Domain::Vertex;
    uint8_t components = 1;  ///< 1, 2, 3 or 4 floats an element
    bool is_color = false;   ///< bytes already decoded to linear
    std::vector<float> data;
};

/// What a mesh is made of, that is: what a primitive is.
enum class GeometryKind : uint8_t { Triangles, Curves, Points };

/// How curves are traced: a ribbon that faces the ray and is shaded as if it were round, a swept circle, or cones between the keys.
enum class CurveShape : uint8_t { Ribbon, Thick, ThickLinear };

/// How a cage is subdivided.
enum class SubdivisionScheme : uint8_t { None, CatmullClark, Simple };

/// Where UV maps stay straight: everywhere, or at corners, or also at ends of seams, or also at concave corners, or along all borders, or nowhere.
enum class UvSmoothing : uint8_t { None, Corners, Junctions, Concave, Borders, All };

/// A mesh that is a cage: before it is traced it is diced into triangles of about `edge_length` (geometry/dice.h). The mesh's own triangles are those of the
/// cage; its positions, normals and attributes belong to the cage's vertices, corners and faces. Empty lists: none, or all 0, or all smooth.
struct Subdivision {
    SubdivisionScheme scheme = SubdivisionScheme::None;
    UvSmoothing uv_smoothing = UvSmoothing::Borders;  ///< of corner attributes with 2 components; other values are interpolated linearly
    bool sharp_corners = false;                       ///< corners of an open cage stay where they are
    bool in_pixels = true;                            ///< edge_length counts pixels of the dicing camera; else object space
    float edge_length = 1;
    int32_t max_level = 12;  ///< an edge of the cage is halved so many times at most; 1 to 16
    std::vector<uint32_t> face_starts, corner_vertices;
    std::vector<uint16_t> face_materials;
    std::vector<uint8_t> face_smooth;
    std::vector<uint32_t> crease_edges;  ///< two vertices each
    std::vector<float> crease_sharpness;
    std::vector<uint32_t> crease_vertices;
    std::vector<float> vertex_sharpness;
};

/// Triangles after modifiers, with Blender's own diagonals; or curves (Catmull-Rom through their keys), or points, which are spheres. What the latter two have
/// besides positions, attributes and generated coordinates is named below; the rest of them is empty.
struct Mesh {
    std::string name;
    GeometryKind kind = GeometryKind::Triangles;
    std::vector<Vec3> positions;               ///< object space, one a vertex, key or point
    std::vector<uint32_t> triangle_vertices;   ///< 3 a triangle
    std::vector<uint32_t> triangle_corners;    ///< 3 a triangle, index into corners; empty when nothing is stored a corner
    std::vector<uint32_t> triangle_faces;      ///< 1 a triangle; empty when triangles are faces
    std::vector<uint16_t> triangle_materials;  ///< slot of the triangle; empty: all 0
    std::vector<uint8_t> triangle_smooth;      ///< 1: interpolate normals; empty: all smooth
    std::vector<Vec3> vertex_normals;          ///< unit, object space; used where smooth and no corner normals
    std::vector<Vec3> corner_normals;          ///< unit; wins over vertex_normals; indexed by corner
    std::vector<Attribute> attributes;
    std::string active_uv;                            ///< name of the render UV map, "" when none
    std::string active_color;                         ///< name of the render colour attribute
    Vec3 generated_offset, generated_scale{1, 1, 1};  ///< generated = position * scale + offset, where there is no "@generated" attribute
    std::vector<float> radii;                         ///< curves and points: one a position, object space
    CurveShape curve_shape = CurveShape::Ribbon;
    int32_t curve_subdivisions = 2;        ///< ribbons: pieces a segment, less one
    std::vector<uint32_t> curve_starts;    ///< first key of each curve, at least two keys each; and the end of the last
    std::vector<uint32_t> segment_keys;    ///< first key of each segment; a segment is a primitive and joins two keys
    std::vector<uint32_t> segment_curves;  ///< its curve
    int32_t motion_steps = 1;              ///< moments spread evenly over the shutter at which the shape is known; 1: it keeps its shape
    std::vector<Vec3> motion_positions;    ///< `positions` of each step, one step after the other; straight lines in between
    Subdivision subdivision;               ///< triangles only
    std::vector<Vec3> motion_normals;      ///< corner_normals (where there are none vertex_normals) of each step; empty: they stay
    size_t triangle_count() const { return triangle_vertices.size() / 3; }
    size_t primitive_count() const {
        return kind == GeometryKind::Triangles ? triangle_count() : kind == GeometryKind::Curves ? segment_keys.size() : positions.size();
    }
};

/// What can be seen, wherever it is placed: all instances of a thing share one. Whatever an object has that is not its place is here, so that a million
/// instances stay small.
struct ObjectTraits {
    Handle name = kNone;           ///< into Scene::object_names
    Handle mesh = kNone;           ///< kNone: removed
    Handle material_set = kNone;   ///< into Scene::material_sets; missing materials are the default grey
    Handle attribute_set = kNone;  ///< into Scene::object_attribute_sets (custom properties)
    Handle linking = kNone;        ///< into Scene::linkings, of its emission; kNone: it lights everything
    Handle light_group = kNone;    ///< into Scene::light_groups, of its emission
    uint32_t visibility = kVisibleAll;
    int32_t pass_index = 0;
    float color[4] = {1, 1, 1, 1};  ///< Blender's viewport object colour (Object Info)
    bool is_instance = false;
    bool is_holdout = false;
    bool is_shadow_catcher = false;
    uint8_t receiver_set = 0;                        ///< which emitters light it
    uint64_t blocks = 0;                             ///< bit g: casts the shadows of emitters with blocker group g; see Linking, kChosenOrNot
    float shadow_terminator_shading_offset = 0;      ///< 0..1: moves the smooth shading's dark side towards the light
    float shadow_terminator_geometry_offset = 0.1f;  ///< cosine below which shadow rays begin on the smooth surface
    bool operator==(const ObjectTraits&) const = default;
};

/// One visible thing: a mesh placed in the world. Kernels read it as it is (see SceneView).
struct Object {
    Affine to_world;        ///< in the middle of the shutter
    Handle traits = kNone;  ///< into Scene::traits; kNone: removed
    uint32_t random = 0;    ///< Blender's random_id; Object Info gives random / (2^32 - 1)
};

/// What an instance knows of its instancer.
struct Dupli {
    Vec3 generated;
    Vec2 uv;
};

/// Versions whose answers differ are numbers like Blender's: 304, 402, 403, 405, 500, 502.
using BlenderVersion = int;

/// What a material's displacement does: bend normals, move the vertices, or move them and bend normals by what is finer than the mesh.
enum class DisplacementMethod : uint8_t { Bump, Displacement, Both };

/// A material's, world's or lamp's surface shader.
struct Shader {
    std::string name;
    ShaderGraph graph;
    int32_t pass_index = 0;
    bool sample_as_light = true;  ///< emission is light-sampled (3.4's sample_as_light; emission_sampling != NONE)
    bool emission_front = true;   ///< which sides are light-sampled
    bool emission_back = true;
    bool use_transparent_shadow = true;
    bool use_bump_map_correction = true;
    DisplacementMethod displacement = DisplacementMethod::Bump;
};

enum class LightType : uint8_t { Point, Spot, Sun, Area };
enum class AreaShape : uint8_t { Square, Rectangle, Disk, Ellipse };

/// A lamp. Shines along its local -Z. Its radiance or intensity follows from `power` as the version of the settings says.
struct Light {
    std::string name;
    LightType type = LightType::Point;
    Affine to_world;
    Rgb color{1, 1, 1};     ///< times temperature colour and 2^exposure where the version has them
    float power = 10;       ///< W for point, spot and area; W/m2 for sun
    bool normalize = true;  ///< power is spread over the area (4.x's switch)
    float radius = 0;       ///< point and spot; m
    bool soft_falloff = true;
    float spot_angle = 0.785398f;  ///< full angle
    float spot_blend = 0.15f;
    float sun_angle = 0;  ///< full angle of the disc
    AreaShape shape = AreaShape::Square;
    float size_x = 1, size_y = 1;  ///< area, m, before the object's scale
    float spread = kPi;
    Handle shader = kNone;  ///< node tree; kNone: emission of 1
    uint32_t visibility = kVisibleAll & ~kVisibleCamera;
    bool cast_shadow = true;
    bool use_mis = true;
    bool is_portal = false;
    int max_bounces = 1024;
    Handle light_group = kNone;  ///< into Scene::light_groups
    uint32_t random = 0;
    // What its nodes see of its object, besides its place and random number.
    float object_color[4] = {1, 1, 1, 1};
    int32_t pass_index = 0;
    std::vector<Attribute> attributes;  ///< Domain::Object
    Linking linking;
    bool is_shadow_catcher = true;  ///< its light belongs to what shadow catchers stand for
};

struct World {
    Handle shader = kNone;  ///< kNone: black
    uint32_t visibility = kVisibleAll;
    bool use_importance_map = true;  ///< sampling_method != NONE
    int map_resolution = 0;          ///< 0: automatic
    int max_bounces = 1024;
    bool sample_as_light = true;
    Handle light_group = kNone;  ///< into Scene::light_groups
};

enum class CameraType : uint8_t { Perspective, Orthographic, Panoramic };
enum class PanoramaType : uint8_t {
    Equirectangular,
    EquiangularCubemap,
    Mirrorball,
    FisheyeEquidistant,
    FisheyeEquisolid,
    FisheyePolynomial,
    CentralCylindrical
};

/// Looks along local -Z, +Y up. `view` is the film plane window in camera space at distance 1 (perspective) or in metres (orthographic):
/// left, right, bottom, top of the whole frame; shift, sensor fit, pixel aspect and stereo are already in it.
struct Camera {
    CameraType type = CameraType::Perspective;
    PanoramaType panorama = PanoramaType::Equirectangular;
    Affine to_world;
    float view[4] = {-0.5f, 0.5f, -0.28f, 0.28f};
    float clip_start = 0.1f, clip_end = 1000;
    float aperture_radius = 0;  ///< m; 0: pinhole
    float focus_distance = 10;
    int aperture_blades = 0;
    float aperture_rotation = 0;
    float aperture_ratio = 1;
    float fov = kPi;  ///< fisheye
    float lens_mm = 10.5f, sensor_width_mm = 36, sensor_height_mm = 24;
    float latitude_min = -kPi / 2, latitude_max = kPi / 2, longitude_min = -kPi, longitude_max = kPi;
    float polynomial[5] = {0, 0, 0, 0, 0};
    float cylinder[5] = {-kPi, kPi, -1, 1, 1};  ///< u min, u max, v min, v max, radius
};

/// What moves while the shutter is open. Maps are those of moments spread evenly over the shutter, at least two and at most 129; between two of them every
/// number changes linearly (so that a turn takes a map every few degrees). All empty: nothing moves.
struct Motion {
    std::vector<std::vector<Affine>> objects;
    std::vector<Handle> of_objects;   ///< by object: into `objects`, kNone: it stands still; empty: all do
    std::vector<Affine> camera;       ///< its to_world; empty: it stands still
    std::vector<float> camera_views;  ///< its `view`, 4 a moment, as many moments as `camera`; empty: it stays
    std::vector<float> shutter;       ///< moments (0 to 1) at which equal parts of the light have come in, first 0, last 1; empty: evenly
    bool rolling = false;             ///< rows of the picture are exposed one after the other, from the top
    float rolling_duration = 0.1f;    ///< how long a row is, as a part of the shutter
};

enum class AlphaMode : uint8_t { Straight, Premultiplied, ChannelPacked, None };

/// An image file, a packed file's bytes, or pixels. Loaded once by `asset`, whoever uses it.
struct Image {
    std::string name;
    std::string path;                 ///< file; with "<UDIM>" for tiles
    std::vector<uint8_t> bytes;       ///< packed file; wins over path
    std::vector<float> pixels;        ///< RGBA, bottom row first; wins over both (generated or painted)
    int width = 0, height = 0;        ///< of `pixels`
    bool pixels_are_float = false;    ///< generated: true = values are linear already; false = stored byte / 255 in `colorspace`
    std::string colorspace = "sRGB";  ///< Blender's name, in the file's OpenColorIO config
    AlphaMode alpha = AlphaMode::Straight;
    std::vector<int> tiles;  ///< UDIM numbers; empty: no tiles
};

enum class PixelFilter : uint8_t { Box, Gaussian, BlackmanHarris };

struct Settings {
    BlenderVersion version = 502;                                 ///< whose node and light semantics hold
    int width = 1920, height = 1080;                              ///< of the whole frame
    int crop_x = 0, crop_y = 0, crop_width = 0, crop_height = 0;  ///< the part to render, from the bottom left; 0 width: all
    int samples = 128;
    int first_sample = 0;  ///< sample offset
    uint32_t seed = 0;
    float time_limit = 0;  ///< s, 0: none
    bool adaptive = false;
    float adaptive_threshold = 0.01f;
    int adaptive_min_samples = 0;
    int max_bounces = 12, diffuse_bounces = 4, glossy_bounces = 4, transmission_bounces = 12, volume_bounces = 0, transparent_bounces = 8;
    int min_light_bounces = 0, min_transparent_bounces = 0;
    float clamp_direct = 0, clamp_indirect = 10;  ///< UI values; 0: off
    bool caustics_reflective = true, caustics_refractive = true;
    float filter_glossy = 1;
    float light_threshold = 0.01f;
    PixelFilter filter = PixelFilter::BlackmanHarris;
    float filter_width = 1.5f;  ///< pixels
    float film_exposure = 1;
    bool film_transparent = false, film_transparent_glass = false;
    float film_transparent_roughness = 0.1f;
    float mist_start = 5, mist_depth = 25;
    int mist_falloff = 0;               ///< 0 quadratic, 1 linear, 2 inverse quadratic
    float pass_alpha_threshold = 0.5f;  ///< data passes show the first surface that is at least so opaque
    bool use_emission_sampling = true;
    int threads = 0;                                           ///< 0: all
    std::string ocio_config;                                   ///< path of Blender's config.ocio; "" : built-in sRGB and linear only
    std::string working_space = "Linear";                      ///< the config's scene_linear space, by name
    float luminance_weights[3] = {0.2126f, 0.7152f, 0.0722f};  ///< Y of the working space's primaries
    std::string instruction_set;                               ///< "" : the best
    float offscreen_dicing_scale = 4;                          ///< how much coarser cages are diced outside the dicing camera's view
    bool viewport = false;                                     ///< interactive: instances instead of flattened geometry, coarse first passes
};

/// Passes that may be asked for; channels in brackets. Names are Blender's where it has one.
enum class PassKind : uint8_t {
    Combined,  ///< RGBA (4)
    Depth,     ///< (1) first opaque hit of the first sample; 1e10 where empty
    Normal,
    Position,
    Vector3Uv,  ///< (3)
    Mist,
    ObjectIndex,
    MaterialIndex,  ///< (1)
    DiffuseDirect,
    DiffuseIndirect,
    DiffuseColor,
    GlossyDirect,
    GlossyIndirect,
    GlossyColor,
    TransmissionDirect,
    TransmissionIndirect,
    TransmissionColor,
    Emission,
    Environment,  ///< (3)
    DenoisingAlbedo,
    DenoisingNormal,  ///< (3)
    SampleCount,      ///< (1)
    ShadowCatcher,    ///< (3) light on shadow catchers over what it would be without everything else
};

/// A pass of the scene's own (Blender's AOVs), which AOV Output nodes write by its name and kind.
struct Aov {
    std::string name;
    bool is_color = false;  ///< colour, or one value
    bool operator==(const Aov&) const = default;
};

enum Dirty : uint32_t {
    kDirtyMeshes = 1,
    kDirtyObjects = 2,
    kDirtyLights = 4,
    kDirtyWorld = 8,
    kDirtyShaders = 16,
    kDirtyImages = 32,
    kDirtyCamera = 64,
    kDirtySettings = 128,
    kDirtyPasses = 256,
    kDirtyAll = 511,
};

/// Slots of removed things stay, empty, so that handles remain valid.
struct Scene {
    Settings settings;
    Camera camera;
    Camera dicing_camera;  ///< whose pixels adaptive subdivision counts; a change is a change of meshes
    Motion motion;
    World world;
    std::vector<std::shared_ptr<const Mesh>> meshes;  ///< null: removed
    std::vector<Object> objects;
    std::vector<ObjectTraits> traits;
    std::vector<Dupli> duplis;  ///< by object; empty: nobody asks
    std::vector<std::string> object_names;
    std::vector<std::vector<Handle>> material_sets;             ///< shader of each material slot
    std::vector<std::vector<Attribute>> object_attribute_sets;  ///< Domain::Object, one element each
    std::vector<Linking> linkings;                              ///< of emissive objects
    std::vector<Light> lights;
    std::vector<Shader> shaders;
    std::vector<std::shared_ptr<const Image>> images;
    std::vector<PassKind> passes{PassKind::Combined};
    std::vector<Aov> aovs;                  ///< shaders are compiled for these: kDirtyShaders too
    std::vector<std::string> light_groups;  ///< each has a pass of its own: the light of its lamps, emissive objects and world
    uint32_t dirty = kDirtyAll;
    std::vector<Handle> dirty_meshes;  ///< which meshes changed, when kDirtyMeshes alone would say too much
};

}  // namespace talbot::scene
