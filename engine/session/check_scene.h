/// Handles, indices and array lengths of a scene that comes from a file.
#pragma once

#include "base/error.h"
#include "scene/scene.h"

namespace talbot {

/// Throws Error at the first handle or index that leads outside, or array that is shorter than what indexes it.
void check_scene(const scene::Scene& scene);

}  // namespace talbot
