/// Shader graph -> node program: checks links, converts sockets, folds constants (by running the very operations on one
/// lane), removes dead branches, shares equal sub-graphs, allocates registers, and splits the result into surface, emission and transparency programs.
#pragma once

#include "base/error.h"
#include "scene/scene.h"
#include "shader/program.h"
#include "shader/sky.h"

namespace talbot::shader {

/// Compiles every shader of the scene (and the default grey). Never throws for a bad graph: unknown nodes and impossible
/// links fall back and are reported with material and node names. Interns attribute names into `tables`. `skies` keeps sky tables from one
/// call to the next.
Programs compile_shaders(const scene::Scene& scene, scene::SceneTables& tables, Report& report, SkyCache* skies = nullptr);

}  // namespace talbot::shader
