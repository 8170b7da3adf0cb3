#include "geometry/limit_surface.h"

#include <opensubdiv/bfr/refinerSurfaceFactory.h>
#include <opensubdiv/bfr/surface.h>
#include <opensubdiv/far/topologyDescriptor.h>
#include <opensubdiv/far/topologyRefinerFactory.h>

#include <cmath>

#include "base/error.h"

namespace talbot::geometry {

namespace Bfr = OpenSubdiv::Bfr;
namespace Far = OpenSubdiv::Far;
namespace Sdc = OpenSubdiv::Sdc;

using scene::SubdivisionScheme;
using scene::UvSmoothing;

struct LimitSurface::Topology {
    std::unique_ptr<Far::TopologyRefiner> refiner;
};

namespace {

constexpr float kSameUv = 1e-5f;

bool has_area(const scene::Mesh& cage, const uint32_t* vertices, size_t n) {
    size_t different = 0;
    for (size_t i = 0; i < n; ++i) {
        if (!is_finite(cage.positions[vertices[i]])) return false;
        size_t k = 0;
        while (k < i && vertices[k] != vertices[i]) ++k;
        different += k == i;
    }
    // A vertex that a face visits twice would be two corners of one face: nothing OpenSubdiv knows.
    return n >= 3 && different == n;
}

LimitSurface::UvMap weld(const LimitSurface& surface, const scene::Attribute& attribute, size_t vertices) {
    LimitSurface::UvMap map;
    map.attribute = &attribute;
    std::vector<int> first(vertices, -1), next;
    for (size_t c = 0; c < surface.vertices.size(); ++c) {
        const float* uv = &attribute.data[2 * size_t(surface.cage_corners[c])];
        int& head = first[surface.vertices[c]];
        int found = head;
        while (found >= 0 && (std::abs(map.values[2 * size_t(found)] - uv[0]) > kSameUv || std::abs(map.values[2 * size_t(found) + 1] - uv[1]) > kSameUv))
            found = next[size_t(found)];
        if (found < 0) {
            found = int(next.size());
            next.push_back(head);
            head = found;
            map.values.insert(map.values.end(), uv, uv + 2);
        }
        map.indices.push_back(found);
    }
    return map;
}

Sdc::Options::FVarLinearInterpolation linear_uv(UvSmoothing smoothing) {
    switch (smoothing) {
        case UvSmoothing::None:
            return Sdc::Options::FVAR_LINEAR_ALL;
        case UvSmoothing::Corners:
            return Sdc::Options::FVAR_LINEAR_CORNERS_ONLY;
        case UvSmoothing::Junctions:
            return Sdc::Options::FVAR_LINEAR_CORNERS_PLUS1;
        case UvSmoothing::Concave:
            return Sdc::Options::FVAR_LINEAR_CORNERS_PLUS2;
        case UvSmoothing::Borders:
            return Sdc::Options::FVAR_LINEAR_BOUNDARIES;
        case UvSmoothing::All:
            return Sdc::Options::FVAR_LINEAR_NONE;
    }
    return Sdc::Options::FVAR_LINEAR_ALL;
}

std::vector<int> as_int(const std::vector<uint32_t>& values) {
    return {values.begin(), values.end()};
}

}  // namespace

LimitSurface::LimitSurface(const scene::Mesh& cage) : topology_(std::make_unique<Topology>()) {
    const scene::Subdivision& subdivision = cage.subdivision;
    starts.push_back(0);
    for (size_t f = 0; f + 1 < subdivision.face_starts.size(); ++f) {
        const uint32_t begin = subdivision.face_starts[f], end = subdivision.face_starts[f + 1];
        if (end - begin > uint32_t(Far::VALENCE_LIMIT) || !has_area(cage, subdivision.corner_vertices.data() + begin, end - begin)) continue;
        for (uint32_t c = begin; c < end; ++c) {
            vertices.push_back(subdivision.corner_vertices[c]);
            cage_corners.push_back(c);
        }
        starts.push_back(uint32_t(vertices.size()));
        cage_faces.push_back(uint32_t(f));
    }
    for (const scene::Attribute& attribute : cage.attributes)
        if (attribute.domain == scene::Domain::Corner && attribute.components == 2) uv_maps.push_back(weld(*this, attribute, cage.positions.size()));
    if (cage_faces.empty()) return;

    std::vector<int> sizes;
    for (size_t f = 0; f < face_count(); ++f) sizes.push_back(int(face_size(f)));
    const std::vector<int> corner_vertices = as_int(vertices), crease_edges = as_int(subdivision.crease_edges),
                           crease_vertices = as_int(subdivision.crease_vertices);
    std::vector<Far::TopologyDescriptor::FVarChannel> channels(uv_maps.size());
    for (size_t i = 0; i < channels.size(); ++i) {
        channels[i].numValues = int(uv_maps[i].values.size() / 2);
        channels[i].valueIndices = uv_maps[i].indices.data();
    }
    Far::TopologyDescriptor description;
    description.numVertices = int(cage.positions.size());
    description.numFaces = int(face_count());
    description.numVertsPerFace = sizes.data();
    description.vertIndicesPerFace = corner_vertices.data();
    description.numCreases = int(subdivision.crease_sharpness.size());
    description.creaseVertexIndexPairs = crease_edges.data();
    description.creaseWeights = subdivision.crease_sharpness.data();
    description.numCorners = int(crease_vertices.size());
    description.cornerVertexIndices = crease_vertices.data();
    description.cornerWeights = subdivision.vertex_sharpness.data();
    description.numFVarChannels = int(channels.size());
    description.fvarChannels = channels.data();
    Sdc::Options options;
    options.SetVtxBoundaryInterpolation(subdivision.sharp_corners ? Sdc::Options::VTX_BOUNDARY_EDGE_AND_CORNER : Sdc::Options::VTX_BOUNDARY_EDGE_ONLY);
    options.SetFVarLinearInterpolation(linear_uv(subdivision.uv_smoothing));
    using Factory = Far::TopologyRefinerFactory<Far::TopologyDescriptor>;
    const Sdc::SchemeType scheme = subdivision.scheme == SubdivisionScheme::Simple ? Sdc::SCHEME_BILINEAR : Sdc::SCHEME_CATMARK;
    topology_->refiner.reset(Factory::Create(description, Factory::Options(scheme, options)));
    if (!topology_->refiner) throw Error("OpenSubdiv cannot subdivide it", "Mesh '" + cage.name + "'");
}

LimitSurface::~LimitSurface() = default;

struct SurfacePatch::Parts {
    explicit Parts(const LimitSurface& s) : surface(s), factory(*s.topology().refiner) {}

    const LimitSurface& surface;
    Bfr::RefinerSurfaceFactory<> factory;  ///< with a cache: a worker's own
    Bfr::Surface<float> patch;
    std::vector<float> points;
    int width = 0;
    uint32_t size = 0;
    bool smooth = false;  ///< else `points` are the values at the corners, in the rare place that OpenSubdiv has no surface for

    void bind(size_t face, const float* values, int n, const int* indices, int channel) {
        width = n;
        size = surface.face_size(face);
        smooth = channel < 0 ? factory.InitVertexSurface(int(face), &patch) : factory.InitFaceVaryingSurface(int(face), &patch, channel);
        const Bfr::Surface<float>::PointDescriptor layout(n);
        if (smooth) {
            points.resize(size_t(patch.GetNumPatchPoints()) * size_t(n));
            patch.PreparePatchPoints(values, layout, points.data(), layout);
            return;
        }
        points.clear();
        for (uint32_t c = surface.starts[face]; c < surface.starts[face + 1]; ++c) {
            const float* from = values + size_t(n) * size_t(indices ? indices[c] : int(surface.vertices[c]));
            points.insert(points.end(), from, from + n);
        }
    }

    void coordinates(Place place, float* uv) const {
        if (size == 4) {
            // The quad's directions turn by a right angle from corner to corner.
            static constexpr float kCorner[4][2] = {{0, 0}, {1, 0}, {1, 1}, {0, 1}}, kAlong[4][2] = {{1, 0}, {0, 1}, {-1, 0}, {0, -1}};
            const float* along = kAlong[place.quad];
            const float s = 0.5f * place.s, t = 0.5f * place.t;
            uv[0] = kCorner[place.quad][0] + along[0] * s - along[1] * t;
            uv[1] = kCorner[place.quad][1] + along[1] * s + along[0] * t;
        } else {
            const float quad[2] = {place.s, place.t};
            patch.GetParameterization().ConvertNormalizedSubFaceToCoord(int(place.quad), quad, uv);
        }
    }

    void linear(Place place, float* value, float* du, float* dv) const {
        const uint32_t i = place.quad, next = (i + 1) % size, before = (i + size - 1) % size;
        for (int k = 0; k < width; ++k) {
            const auto at = [&](uint32_t corner) { return points[size_t(corner) * size_t(width) + size_t(k)]; };
            float centre = 0;
            for (uint32_t c = 0; c < size; ++c) centre += at(c) / float(size);
            const float p00 = at(i), p10 = 0.5f * (at(i) + at(next)), p01 = 0.5f * (at(i) + at(before));
            value[k] = lerp(lerp(p00, p10, place.s), lerp(p01, centre, place.s), place.t);
            if (du) du[k] = lerp(p10 - p00, centre - p01, place.t);
            if (dv) dv[k] = lerp(p01 - p00, centre - p10, place.s);
        }
    }
};

SurfacePatch::SurfacePatch(const LimitSurface& surface) : parts_(std::make_unique<Parts>(surface)) {}
SurfacePatch::~SurfacePatch() = default;

void SurfacePatch::bind(size_t face, const float* values, int width) {
    parts_->bind(face, values, width, nullptr, -1);
}

void SurfacePatch::bind_uv(size_t face, const LimitSurface::UvMap& map) {
    parts_->bind(face, map.values.data(), 2, map.indices.data(), int(&map - parts_->surface.uv_maps.data()));
}

void SurfacePatch::evaluate(Place place, float* value) const {
    if (!parts_->smooth) return parts_->linear(place, value, nullptr, nullptr);
    float uv[2];
    parts_->coordinates(place, uv);
    parts_->patch.Evaluate(uv, parts_->points.data(), Bfr::Surface<float>::PointDescriptor(parts_->width), value);
}

void SurfacePatch::evaluate(Place place, float* value, float* du, float* dv) const {
    if (!parts_->smooth) return parts_->linear(place, value, du, dv);
    float uv[2];
    parts_->coordinates(place, uv);
    parts_->patch.Evaluate(uv, parts_->points.data(), Bfr::Surface<float>::PointDescriptor(parts_->width), value, du, dv);
}

}  // namespace talbot::geometry
