/// The limit surface of a cage, by OpenSubdiv.
///
/// A face of n corners is n quads: quad i has its corner (0, 0) at corner i of the face, (1, 0) in the middle of the edge to corner i + 1, (1, 1) in the face's
/// centre and (0, 1) in the middle of the edge from corner i - 1. Seen from the front, s to t turns counter-clockwise.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "scene/scene.h"

namespace talbot::geometry {

/// A point of a face.
struct Place {
    uint32_t quad = 0;
    float s = 0, t = 0;
};

class LimitSurface {
public:
    /// Faces without three different corners or with vertices that are not finite are left out. Throws Error when OpenSubdiv refuses the cage.
    explicit LimitSurface(const scene::Mesh& cage);
    ~LimitSurface();
    LimitSurface(const LimitSurface&) = delete;
    LimitSurface& operator=(const LimitSurface&) = delete;

    /// The faces that have a surface: first corner of each, and the end of the last; by corner its vertex and which corner of the cage it is; by face which
    /// face of the cage.
    std::vector<uint32_t> starts, vertices, cage_corners, cage_faces;
    size_t face_count() const { return cage_faces.size(); }
    uint32_t face_size(size_t face) const { return starts[face + 1] - starts[face]; }

    /// A UV map: corners that meet at a vertex share a value where they agree.
    struct UvMap {
        const scene::Attribute* attribute = nullptr;
        std::vector<int> indices;   ///< by corner
        std::vector<float> values;  ///< 2 each
    };
    std::vector<UvMap> uv_maps;

    struct Topology;
    const Topology& topology() const { return *topology_; }

private:
    std::unique_ptr<Topology> topology_;
};

/// Some values on one face of a surface after the other: a worker's own.
class SurfacePatch {
public:
    explicit SurfacePatch(const LimitSurface& surface);
    ~SurfacePatch();
    SurfacePatch(const SurfacePatch&) = delete;
    SurfacePatch& operator=(const SurfacePatch&) = delete;

    /// `values`: `width` (1 to 4) floats for each of the cage's vertices, which the surface smooths.
    void bind(size_t face, const float* values, int width);
    void bind_uv(size_t face, const LimitSurface::UvMap& map);

    /// Derivatives are those by the face's own parameters, which are the same for all values.
    void evaluate(Place place, float* value) const;
    void evaluate(Place place, float* value, float* du, float* dv) const;

private:
    struct Parts;
    std::unique_ptr<Parts> parts_;
};

}  // namespace talbot::geometry
