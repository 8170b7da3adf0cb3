/// From Blender's arrays to `Mesh`: bounds are checked, triangles that cannot be traced are kept out, bytes become linear colours,
/// and what is stored a face is spread over its triangles. V vertices, C corners, F faces, T triangles.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "base/error.h"
#include "scene/scene.h"

namespace talbot::scene {

/// A borrowed attribute. Exactly one of `floats` and `bytes` is used; bytes are 4 a element, sRGB-encoded with linear alpha.
struct MeshInputAttribute {
    std::string name;
    Domain domain = Domain::Vertex;
    int components = 1;
    bool is_color = false;
    std::span<const float> floats;
    std::span<const uint8_t> bytes;
};

/// Borrowed arrays; empty spans are absent. Lengths in brackets.
struct MeshInput {
    std::string name;
    std::span<const float> positions;            ///< [3 V]
    std::span<const uint32_t> corner_vertices;   ///< [C]
    std::span<const uint32_t> triangle_corners;  ///< [3 T]
    std::span<const uint32_t> triangle_faces;    ///< [T]
    std::span<const int32_t> face_materials;     ///< [F]
    std::span<const uint8_t> face_smooth;        ///< [F]
    std::span<const float> vertex_normals;       ///< [3 V]
    std::span<const float> corner_normals;       ///< [3 C]
    std::vector<MeshInputAttribute> attributes;
    Subdivision subdivision;                ///< of a cage: all but its faces, which are those above
    std::span<const uint32_t> face_starts;  ///< [F + 1], of a cage only
    std::string active_uv, active_color;
    Vec3 generated_offset, generated_scale{1, 1, 1};
};

/// sRGB byte -> linear.
float linear_of_srgb_byte(uint8_t byte);

/// Owned and linear; what is not finite becomes 0, it would spread through whole paths. Throws Error about `owner` when there are not as many elements.
Attribute copy_attribute(const MeshInputAttribute& from, size_t elements, const std::string& owner);

/// Throws Error (an index out of bounds, an array of a wrong length), naming the mesh. Triangles with NaN or infinite vertices are
/// dropped with a warning, triangles without area silently: they would trace as nothing.
Mesh build_mesh(const MeshInput& input, Report& report);

/// Makes a map of rank 2 (an object flattened by a zero scale) invertible by giving the lost direction a millionth of the
/// largest scale, so that normals stay defined. False when the map is not finite or keeps less than a plane: nothing to see.
bool repair_transform(Affine& map);

}  // namespace talbot::scene
