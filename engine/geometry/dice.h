/// Adaptive subdivision: before anything is displaced or traced, cages become triangles about as large as their subdivision asks.
///
/// Instances share the triangles: the one that is largest on the film decides, measured where its bounding box is nearest to the dicing camera.
/// What would not fit into memory is diced twice as coarsely, as often as it takes, and the report says so.
#pragma once

#include <atomic>
#include <memory>
#include <vector>

#include "base/error.h"
#include "base/pool.h"
#include "scene/view.h"

namespace talbot::geometry {

/// A cage and its triangles.
struct DicedMesh {
    scene::Handle handle = scene::kNone;
    std::vector<float> measures;  ///< all that decided how it was diced, besides itself
    std::shared_ptr<const scene::Mesh> source, mesh;
    std::vector<scene::AttributeView> attributes;  ///< the mesh's row
};

/// How many triangles the memory that is left has room for, with their acceleration structure.
size_t dicing_budget();

/// Puts triangles in the place of those meshes in `tables` that are cages. `known` holds what the last call made, and this one's afterwards: what would be
/// diced alike stays the same mesh. In the viewport an object that moves is not diced again. Throws Cancelled.
void dice_meshes(scene::SceneTables& tables, const scene::Scene& scene, size_t budget, WorkerPool& pool, std::vector<DicedMesh>& known, Report& report,
                 const std::atomic<bool>* cancel);

}  // namespace talbot::geometry
