/// Meshes, curves and points as Embree's geometries. For the accelerator only; Embree's handles are opaque here.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "scene/scene.h"

struct RTCDeviceTy;
struct RTCGeometryTy;

namespace talbot::geometry {

/// A geometry of the mesh's primitives, numbered as they are, with a vertex buffer a motion step; not committed. The caller releases it; what Embree
/// complains about goes to the device. Triangles may be taken to world space by `to_world`; curves and points cannot (null). `repeated` triangles are left
/// out. Indices of triangles are lent: the mesh outlives the geometry. `poll` is called now and then and may throw.
RTCGeometryTy* make_geometry(RTCDeviceTy* device, const scene::Mesh& mesh, const std::vector<uint32_t>& repeated, const Affine* to_world,
                             const std::function<void()>& poll);

}  // namespace talbot::geometry
