/// From Blender's arrays to a `Mesh` of curves or points: bounds are checked, what cannot be traced is kept out.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "base/error.h"
#include "scene/mesh_build.h"
#include "scene/scene.h"

namespace talbot::scene {

/// Borrowed arrays; K keys (or points), C curves.
struct StrandInput {
    std::string name;
    std::span<const float> positions;        ///< [3 K]
    std::span<const float> radii;            ///< [K]
    std::span<const uint32_t> curve_starts;  ///< [C + 1], from 0 to K; empty: points
    CurveShape shape = CurveShape::Ribbon;
    int subdivisions = 2;
    std::vector<MeshInputAttribute> attributes;  ///< Vertex: a key or point; Face: a curve
    std::string active_uv, active_color;
    Vec3 generated_offset, generated_scale{1, 1, 1};
};

/// Throws Error (an array of a wrong length), naming the object. Curves and points with numbers that are not finite are left out with a warning; curves of
/// one key or without length silently. Negative radii are none.
Mesh build_strands(const StrandInput& input, Report& report);

}  // namespace talbot::scene
