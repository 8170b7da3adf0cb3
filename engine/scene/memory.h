/// What a scene takes in memory.
#pragma once

#include <cstddef>

#include "scene/view.h"

namespace talbot::scene {

/// Bytes of a mesh's lists.
size_t memory_of(const Mesh& mesh);

/// Bytes of meshes (also of those that dicing and displacement put in the place of the scene's own), objects and their tables: what grows with the scene.
/// Images and shaders are left out.
size_t memory_of(const Scene& scene, const SceneTables& tables);

}  // namespace talbot::scene
