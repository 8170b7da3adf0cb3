/// True displacement: materials' displacement programs run at the vertices before anything is traced.
///
/// A vertex moves once, by the program of the first triangle around it whose material displaces, at that triangle's corner (its UV, its face values), with the
/// vertex's smooth normal whatever the face's shading. The offset is in world space and is taken to object space by the map of the first object that shows
/// the mesh: other instances share the result. All moments of a moving shape move by the same offset. An offset that is not finite is none.
///
/// Then the normals around triangles of method Displacement are made anew, as the unweighted mean of the triangles' normals; corner normals (sharp
/// edges, custom normals) turn by what their vertex's normal changed. Method Both keeps the normals: the bump that it adds begins with them. Where generated
/// coordinates are asked for they stay those of the undisplaced shape, and so does "@undisplaced" (scene::kUndisplaced).
#pragma once

#include <atomic>
#include <memory>
#include <vector>

#include "base/error.h"
#include "base/pool.h"
#include "shader/program.h"

namespace talbot::geometry {

/// A mesh whose vertices were moved, for one choice of materials.
struct DisplacedMesh {
    scene::Handle handle = scene::kNone;
    std::vector<int32_t> shaders;  ///< by material slot: the shader that displaces, -1: none does
    std::shared_ptr<const scene::Mesh> source, mesh;
    std::vector<scene::AttributeView> attributes;  ///< the mesh's row
};

/// shader::run_program of the instruction set that renders.
using RunProgram = void (*)(const shader::Program& program, const shader::Programs& programs, const shader::ShadingSpan& span,
                            const shader::ShaderContext& context, float* registers);

/// Puts displaced meshes in the place of those in `tables` that displacing materials are on (objects with the same mesh but other displacing materials get
/// one of their own, at the end of the list). `known` holds what the last call made, and this one's afterwards: where nothing moved, the mesh stays the
/// same one, so that its acceleration structure may stay. Reports offsets that are not finite by material. Throws Cancelled.
void displace_meshes(scene::SceneTables& tables, const shader::Programs& programs, const shader::ShaderContext& context, RunProgram run, WorkerPool& pool,
                     std::vector<DisplacedMesh>& known, Report& report, const std::atomic<bool>* cancel);

}  // namespace talbot::geometry
