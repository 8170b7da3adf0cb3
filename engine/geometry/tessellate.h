/// From a cage to triangles: OpenSubdiv gives the limit surface, this decides where its vertices are.
///
/// Every face of n corners is n quads (corner, middle of the next edge, centre, middle of the edge before). A line on the surface (a cage's edge, or one drawn
/// inside a face) is halved in its parameter until no piece is longer than sqrt(2) times what the meter allows: pieces end up between 0.7 and 1.4 of that.
/// Where a line is cut depends on the line alone, so both sides of an edge agree and the surface stays closed [the idea of Fisher et al. 2009, "DiagSplit"].
/// A quad is split between the middles of opposite sides as long as both are cut; what is left is a fan.
///
/// Vertices: first those of the cage, then those of its edges, then those inside faces. Normals are the limit surface's, their mean
/// where faces meet; of scheme Simple the cage's own, interpolated, where it has any.
/// UV maps (corner attributes of 2 components) are face-varying, tangents "@tangent:MAP" are those of the limit surface and the map, "@generated" follows the
/// surface; all else is interpolated linearly in the faces. Moving cages are evaluated at each moment, cut as they are cut in the middle of the shutter.
#pragma once

#include <atomic>
#include <optional>

#include "base/pool.h"
#include "scene/scene.h"

namespace talbot::geometry {

/// How long edges may be, by place.
struct DicingMeter {
    Affine to_world;                        ///< of the object by which the cage is diced
    Affine to_camera;                       ///< from the world
    const scene::Camera* camera = nullptr;  ///< null: edge_length is in object space
    float pixel = 1;                        ///< a pixel's width at distance 1 (orthographic: anywhere), in metres
    float edge_length = 1;                  ///< pixels or metres
    float offscreen = 1;                    ///< times the length outside the camera's view

    /// From a to b (object space), as a multiple of the length that is allowed there.
    float edges(Vec3 a, Vec3 b) const;

private:
    float allowed(Vec3 world) const;
};

/// None when there would be more than `max_triangles`. Throws Cancelled, and Error where OpenSubdiv refuses the cage. The same for any number of workers.
std::optional<scene::Mesh> tessellate(const scene::Mesh& cage, const DicingMeter& meter, size_t max_triangles, WorkerPool& pool,
                                      const std::atomic<bool>* cancel);

}  // namespace talbot::geometry
