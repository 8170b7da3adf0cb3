/// Geometry that lies in the same place twice. Only the first copy is given to the tracer, so that what is hit never depends on how the
/// hierarchy was built or which rays travel together, and costs nothing while tracing.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "scene/view.h"

namespace talbot::geometry {

/// Triangles (indices, ascending) with the same three positions as an earlier one of the mesh, in any order of the corners.
/// `poll` is called now and then and may throw. Takes 50 to 100 ns a triangle (0.5 us where every triangle has vertices of its own).
/// Throws Error when a triangle names a vertex that does not exist.
std::vector<uint32_t> repeated_triangles(const scene::Mesh& mesh, const std::function<void()>& poll);

/// mask[i] = visibility of object i without the rays that already see an earlier object with equal triangles in the same place; 0 where it is not placed.
/// `mesh_of` is null then.
std::vector<uint32_t> unshadowed_visibility(const scene::SceneView& view, const std::function<const scene::Mesh*(int32_t object)>& mesh_of);

}  // namespace talbot::geometry
