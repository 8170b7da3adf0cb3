/// The first half of dicing (tessellate.h): which points and triangles each face of a cage becomes. Edges are cut first, once for all faces that share
/// them; then each face by itself, so that what two faces share fits.
#pragma once

#include <atomic>
#include <memory>
#include <optional>
#include <vector>

#include "base/error.h"
#include "base/pool.h"
#include "geometry/limit_surface.h"
#include "geometry/tessellate.h"

namespace talbot::geometry {

inline constexpr uint32_t kNoVertex = ~uint32_t(0);

/// A vertex as one face sees it.
struct FacePoint {
    uint32_t vertex = kNoVertex;  ///< none yet: inside the face
    bool owned = false;           ///< this face says where it is
    Place place;
};

/// Its points, and triangles between them.
struct FaceMesh {
    std::vector<FacePoint> points;
    std::vector<uint32_t> triangles;  ///< 3 points each
    uint32_t first_inside = 0, first_point = 0, first_triangle = 0;
};

/// What both halves work on: the cage's surface, and for each worker patches of it.
struct DicingWork {
    struct Patches {
        std::unique_ptr<SurfacePatch> shape, uv;
    };
    const scene::Mesh& cage;
    const DicingMeter& meter;
    WorkerPool& pool;
    const std::atomic<bool>* cancel;
    LimitSurface surface;
    std::vector<Patches> patches;

    DicingWork(const scene::Mesh& cage, const DicingMeter& meter, WorkerPool& pool, const std::atomic<bool>* cancel);

    /// job(face, worker) for every face, by all workers.
    template <class Job>
    void for_faces(const Job& job) {
        constexpr size_t grain = 16;
        pool.parallel_for(surface.face_count(), grain, [&](size_t begin, size_t end, int worker) {
            for (size_t face = begin; face < end; ++face) {
                if (cancel && cancel->load()) throw Cancelled{};
                job(face, worker);
            }
        });
    }
    uint32_t corner_vertex(size_t face, uint32_t corner) const { return surface.vertices[surface.starts[face] + corner % surface.face_size(face)]; }
    const float* positions() const { return cage.positions.empty() ? nullptr : &cage.positions.front().x; }
};

struct CutFaces {
    std::vector<FaceMesh> faces;
    uint32_t vertex_count = 0;  ///< the cage's and those on its edges; points inside faces have none yet
};

/// None when there would be more triangles than that.
std::optional<CutFaces> cut_faces(DicingWork& work, size_t max_triangles);

}  // namespace talbot::geometry
