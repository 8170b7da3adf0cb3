#include "geometry/tessellate.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <unordered_map>

#include "base/error.h"
#include "geometry/limit_surface.h"

namespace talbot::geometry {
namespace {

constexpr float kLongest = 1.41421356f;  ///< of a piece, as a multiple of what is allowed
constexpr size_t kFaceGrain = 16;
constexpr uint32_t kNoVertex = std::numeric_limits<uint32_t>::max();

/// A cut of a cage's edge. `k` counts from 0 at the vertex of lower number to 2^levels at the other.
struct EdgeCut {
    uint32_t k = 0;
    uint32_t vertex = kNoVertex;
};

struct Edge {
    uint32_t low = 0, face = 0, side = 0;  ///< its lower vertex; the first face that has it, and from which corner: who owns it
    std::vector<EdgeCut> cuts;             ///< ascending, without the ends
};

/// A vertex as one face sees it.
struct FacePoint {
    uint32_t vertex = kNoVertex;  ///< none yet: inside the face
    bool owned = false;           ///< this face says where it is
    Place place;
};

/// One end of a piece: where on its line, and which of the face's points.
struct Stop {
    uint32_t k = 0;
    uint32_t point = 0;
};
using Line = std::vector<Stop>;

struct FaceMesh {
    std::vector<FacePoint> points;
    std::vector<uint32_t> triangles;  ///< 3 points each
    uint32_t first_inside = 0, first_point = 0, first_triangle = 0;
};

Vec3 unit_or_zero(Vec3 v) {
    const float l = length(v);
    return l > 1e-30f && l < 3e38f ? v / l : Vec3{};
}

class Tessellator {
public:
    Tessellator(const scene::Mesh& cage, const DicingMeter& meter, size_t max_triangles, WorkerPool& pool, const std::atomic<bool>* cancel)
        : cage_(cage), meter_(meter), max_triangles_(max_triangles), pool_(pool), cancel_(cancel), surface_(cage), faces_(surface_.face_count()) {
        levels_ = std::clamp(cage.subdivision.max_level, 1, 16);
        half_ = 1u << (levels_ - 1);
        if (faces_.empty()) return;
        for (int i = 0; i < pool.size(); ++i) patches_.push_back({std::make_unique<SurfacePatch>(surface_), std::make_unique<SurfacePatch>(surface_)});
    }

    std::optional<scene::Mesh> run() {
        find_edges();
        for_faces([&](size_t face, int worker) { cut_edges(face, *patches_[size_t(worker)].shape); });
        vertex_count_ = uint32_t(cage_.positions.size());
        for (Edge& edge : edges_)
            for (EdgeCut& cut : edge.cuts) cut.vertex = vertex_count_++;
        for_faces([&](size_t face, int worker) {
            if (triangles_ > max_triangles_) return;
            FaceDicer(*this, face, *patches_[size_t(worker)].shape).run();
            triangles_ += faces_[face].triangles.size() / 3;
        });
        if (triangles_ > max_triangles_) return std::nullopt;
        return assemble();
    }

private:
    struct WorkerPatches {
        std::unique_ptr<SurfacePatch> shape, uv;
    };

    template <class Job>
    void for_faces(const Job& job) {
        pool_.parallel_for(faces_.size(), kFaceGrain, [&](size_t begin, size_t end, int worker) {
            for (size_t face = begin; face < end; ++face) {
                if (cancel_ && cancel_->load()) throw Cancelled{};
                job(face, worker);
            }
        });
    }

    uint32_t corner_vertex(size_t face, uint32_t corner) const { return surface_.vertices[surface_.starts[face] + corner % surface_.face_size(face)]; }

    void find_edges() {
        std::unordered_map<uint64_t, uint32_t> known;
        known.reserve(surface_.vertices.size());
        owners_.assign(cage_.positions.size(), kNoVertex);
        for (size_t face = 0; face < faces_.size(); ++face) {
            for (uint32_t i = 0; i < surface_.face_size(face); ++i) {
                const uint32_t a = corner_vertex(face, i), b = corner_vertex(face, i + 1);
                if (owners_[a] == kNoVertex) owners_[a] = uint32_t(face);
                const auto [found, is_new] = known.try_emplace(uint64_t(std::min(a, b)) << 32 | std::max(a, b), uint32_t(edges_.size()));
                if (is_new) edges_.push_back({std::min(a, b), uint32_t(face), i, {}});
                edge_of_.push_back(found->second);
            }
        }
    }

    const float* positions() const { return cage_.positions.empty() ? nullptr : &cage_.positions.front().x; }

    /// Where `k` of 2^levels steps from corner `side` to the next are.
    Place on_side(size_t face, uint32_t side, uint32_t k) const {
        if (k <= half_) return {side, float(k) / float(half_), 0};
        return {(side + 1) % surface_.face_size(face), 0, float(2 * half_ - k) / float(half_)};
    }

    static Vec3 position(const SurfacePatch& patch, Place place) {
        Vec3 p;
        patch.evaluate(place, &p.x);
        return p;
    }

    /// Calls made(k) for every cut strictly between k0 and k1, in their order. `at(k)`: position.
    template <class At, class Made>
    void cut_line(uint32_t k0, Vec3 p0, uint32_t k1, Vec3 p1, const At& at, const Made& made) const {
        if (k1 - k0 < 2 || meter_.edges(p0, p1) <= kLongest) return;
        const uint32_t middle = (k0 + k1) / 2;
        const Vec3 p = at(middle);
        cut_line(k0, p0, middle, p, at, made);
        made(middle);
        cut_line(middle, p, k1, p1, at, made);
    }

    void cut_edges(size_t face, SurfacePatch& patch) {
        bool bound = false;
        for (uint32_t side = 0; side < surface_.face_size(face); ++side) {
            Edge& edge = edges_[edge_of_[surface_.starts[face] + side]];
            if (edge.face != face || edge.side != side) continue;
            if (!bound) patch.bind(face, positions(), 3);
            bound = true;
            const bool forward = corner_vertex(face, side) == edge.low;
            const auto at = [&](uint32_t k) { return position(patch, on_side(face, side, forward ? k : 2 * half_ - k)); };
            const auto made = [&](uint32_t k) { edge.cuts.push_back({k, kNoVertex}); };
            const Vec3 begin = at(0), middle = at(half_), end = at(2 * half_);
            cut_line(0, begin, half_, middle, at, made);
            made(half_);
            cut_line(half_, middle, 2 * half_, end, at, made);
        }
    }

    /// Splits one face.
    struct FaceDicer {
        FaceDicer(Tessellator& t, size_t f, SurfacePatch& p) : all(t), face(f), patch(p), out(t.faces_[f]), n(t.surface_.face_size(f)) {}
        Tessellator& all;
        size_t face;
        SurfacePatch& patch;
        FaceMesh& out;
        uint32_t n;

        uint32_t add(uint32_t vertex, bool owned, Place place) {
            out.points.push_back({vertex, owned, place});
            return uint32_t(out.points.size() - 1);
        }

        void run() {
            patch.bind(face, all.positions(), 3);
            std::vector<uint32_t> corners, middles;
            for (uint32_t i = 0; i < n; ++i) {
                const uint32_t vertex = all.corner_vertex(face, i);
                corners.push_back(add(vertex, all.owners_[vertex] == face, {i, 0, 0}));
            }
            // The halves of the sides: from a corner on, and towards the next.
            std::vector<Line> leaving(n), arriving(n), spokes(n);
            for (uint32_t i = 0; i < n; ++i) {
                const Edge& edge = all.edges_[all.edge_of_[all.surface_.starts[face] + i]];
                const bool forward = all.corner_vertex(face, i) == edge.low, owned = edge.face == face && edge.side == i;
                leaving[i].push_back({0, corners[i]});
                arriving[i].push_back({0, corners[(i + 1) % n]});
                const size_t count = edge.cuts.size();
                for (size_t j = 0; j < count; ++j) {
                    const EdgeCut& cut = edge.cuts[forward ? j : count - 1 - j];
                    const uint32_t k = forward ? cut.k : 2 * all.half_ - cut.k;
                    const uint32_t point = add(cut.vertex, owned, all.on_side(face, i, k));
                    if (k <= all.half_) leaving[i].push_back({k, point});
                    if (k >= all.half_) arriving[i].push_back({2 * all.half_ - k, point});
                    if (k == all.half_) middles.push_back(point);
                }
                std::sort(arriving[i].begin(), arriving[i].end(), [](Stop a, Stop b) { return a.k < b.k; });
            }
            const uint32_t centre = add(kNoVertex, true, {0, 1, 1});
            for (uint32_t i = 0; i < n; ++i) spokes[i] = line({0, middles[i]}, {all.half_, centre}, [&](uint32_t k) { return place(i, all.half_, k); });
            for (uint32_t i = 0; i < n; ++i) {
                const uint32_t before = (i + n - 1) % n;
                split(i, {0, all.half_}, {0, all.half_}, leaving[i], spokes[i], spokes[before], arriving[before]);
            }
        }

        Place place(uint32_t quad, uint32_t s, uint32_t t) const { return {quad, float(s) / float(all.half_), float(t) / float(all.half_)}; }

        template <class Where>
        Line line(Stop from, Stop to, const Where& where) {
            Line cuts{from};
            const auto at = [&](uint32_t k) { return position(patch, where(k)); };
            all.cut_line(from.k, at(from.k), to.k, at(to.k), at, [&](uint32_t k) { cuts.push_back({k, add(kNoVertex, true, where(k))}); });
            cuts.push_back(to);
            return cuts;
        }

        struct Range {
            uint32_t begin = 0, end = 0;
        };

        static std::pair<Line, Line> halves(const Line& whole, uint32_t k) {
            const auto middle = std::lower_bound(whole.begin(), whole.end(), k, [](Stop stop, uint32_t value) { return stop.k < value; });
            return {Line(whole.begin(), middle + 1), Line(middle, whole.end())};
        }

        /// A rectangle of quad `quad`; its sides go with s (bottom, top) and t (left, right).
        void split(uint32_t quad, Range s, Range t, const Line& bottom, const Line& right, const Line& top, const Line& left) {
            const bool across = bottom.size() > 2 && top.size() > 2, up = left.size() > 2 && right.size() > 2;
            if (!across && !up) return fan(bottom, right, top, left);
            if (across && (!up || bottom.size() + top.size() >= left.size() + right.size())) {
                const uint32_t k = (s.begin + s.end) / 2;
                const auto [bottom_left, bottom_right] = halves(bottom, k);
                const auto [top_left, top_right] = halves(top, k);
                const Line middle =
                    line({t.begin, bottom_right.front().point}, {t.end, top_right.front().point}, [&](uint32_t v) { return place(quad, k, v); });
                split(quad, {s.begin, k}, t, bottom_left, middle, top_left, left);
                split(quad, {k, s.end}, t, bottom_right, right, top_right, middle);
            } else {
                const uint32_t k = (t.begin + t.end) / 2;
                const auto [left_low, left_high] = halves(left, k);
                const auto [right_low, right_high] = halves(right, k);
                const Line middle = line({s.begin, left_high.front().point}, {s.end, right_high.front().point}, [&](uint32_t v) { return place(quad, v, k); });
                split(quad, s, {t.begin, k}, bottom, right_low, middle, left_low);
                split(quad, s, {k, t.end}, middle, right_high, top, left_high);
            }
        }

        /// One of two opposite sides is one piece, of both pairs: triangles around the corner where such sides meet.
        void fan(const Line& bottom, const Line& right, const Line& top, const Line& left) {
            std::vector<uint32_t> around;
            for (size_t i = 0; i + 1 < bottom.size(); ++i) around.push_back(bottom[i].point);
            const size_t low_right = around.size();
            for (size_t i = 0; i + 1 < right.size(); ++i) around.push_back(right[i].point);
            const size_t high_right = around.size();
            for (size_t i = top.size(); i-- > 1;) around.push_back(top[i].point);
            const size_t high_left = around.size();
            for (size_t i = left.size(); i-- > 1;) around.push_back(left[i].point);
            const bool at_bottom = bottom.size() == 2, at_left = left.size() == 2;
            const size_t apex = at_bottom ? (at_left ? 0 : low_right) : (at_left ? high_left : high_right), count = around.size();
            for (size_t i = 1; i + 1 < count; ++i)
                for (const size_t k : {apex, apex + i, apex + i + 1}) out.triangles.push_back(around[k % count]);
        }
    };

    // ---- the mesh

    scene::Mesh assemble() {
        uint32_t points = 0, triangles = 0;
        for (FaceMesh& face : faces_) {
            face.first_point = points;
            face.first_triangle = triangles;
            face.first_inside = vertex_count_;
            for (FacePoint& point : face.points)
                if (point.vertex == kNoVertex) point.vertex = vertex_count_++;
            points += uint32_t(face.points.size());
            triangles += uint32_t(face.triangles.size() / 3);
        }
        scene::Mesh out;
        out.name = cage_.name;
        out.active_uv = cage_.active_uv;
        out.active_color = cage_.active_color;
        out.generated_offset = cage_.generated_offset;
        out.generated_scale = cage_.generated_scale;
        out.motion_steps = cage_.motion_steps;
        bool by_corner = false, by_face = false;
        for (const scene::Attribute& attribute : cage_.attributes) {
            by_corner |= attribute.domain == scene::Domain::Corner;
            by_face |= attribute.domain == scene::Domain::Face;
        }
        fill_triangles(out, triangles, by_corner, by_face);
        evaluate_shape(positions(), out, out.positions, out.vertex_normals);
        const bool keeps_normals = cage_.subdivision.scheme == scene::SubdivisionScheme::Simple && !cage_.vertex_normals.empty();
        if (keeps_normals) interpolate_normals(out.vertex_normals);
        for (int step = 0; size_t(step) * cage_.positions.size() < cage_.motion_positions.size(); ++step) {
            std::vector<Vec3> shape, normals;
            evaluate_shape(&cage_.motion_positions[size_t(step) * cage_.positions.size()].x, out, shape, normals);
            out.motion_positions.insert(out.motion_positions.end(), shape.begin(), shape.end());
            if (!keeps_normals) out.motion_normals.insert(out.motion_normals.end(), normals.begin(), normals.end());
        }
        for (const scene::Attribute& attribute : cage_.attributes) out.attributes.push_back(diced(attribute, points));
        return out;
    }

    void fill_triangles(scene::Mesh& out, size_t count, bool by_corner, bool by_face) {
        const scene::Subdivision& cage = cage_.subdivision;
        const bool materials = std::any_of(cage.face_materials.begin(), cage.face_materials.end(), [](uint16_t slot) { return slot != 0; });
        const bool flat = std::any_of(cage.face_smooth.begin(), cage.face_smooth.end(), [](uint8_t smooth) { return smooth == 0; });
        out.triangle_vertices.resize(3 * count);
        if (by_corner) out.triangle_corners.resize(3 * count);
        if (by_face) out.triangle_faces.resize(count);
        if (materials) out.triangle_materials.resize(count);
        if (flat) out.triangle_smooth.resize(count);
        for_faces([&](size_t face, int) {
            const FaceMesh& from = faces_[face];
            const uint32_t number = surface_.cage_faces[face];
            for (size_t i = 0; i < from.triangles.size(); ++i) {
                out.triangle_vertices[3 * size_t(from.first_triangle) + i] = from.points[from.triangles[i]].vertex;
                if (by_corner) out.triangle_corners[3 * size_t(from.first_triangle) + i] = from.first_point + from.triangles[i];
            }
            for (size_t t = from.first_triangle; t < from.first_triangle + from.triangles.size() / 3; ++t) {
                if (by_face) out.triangle_faces[t] = number;
                if (materials) out.triangle_materials[t] = cage.face_materials[number];
                if (flat) out.triangle_smooth[t] = cage.face_smooth[number];
            }
        });
    }

    void evaluate_shape(const float* cage_positions, const scene::Mesh& mesh, std::vector<Vec3>& shape, std::vector<Vec3>& normals) {
        shape.assign(vertex_count_, {});
        normals.assign(vertex_count_, {});
        std::vector<std::vector<Vec3>> shared(faces_.size());  // normals of points that other faces may have too
        for_faces([&](size_t face, int worker) {
            SurfacePatch& patch = *patches_[size_t(worker)].shape;
            patch.bind(face, cage_positions, 3);
            for (const FacePoint& point : faces_[face].points) {
                Vec3 p, du, dv;
                patch.evaluate(point.place, &p.x, &du.x, &dv.x);
                const Vec3 n = unit_or_zero(cross(du, dv));
                if (point.owned) shape[point.vertex] = p;
                if (point.vertex >= faces_[face].first_inside)
                    normals[point.vertex] = n;
                else
                    shared[face].push_back(n);
            }
        });
        for (size_t face = 0; face < faces_.size(); ++face) {
            size_t next = 0;
            for (const FacePoint& point : faces_[face].points)
                if (point.vertex < faces_[face].first_inside) normals[point.vertex] = normals[point.vertex] + shared[face][next++];
        }
        repair_normals(mesh, shape, normals);
    }

    /// Flat pieces are as smooth as the cage was shaded.
    void interpolate_normals(std::vector<Vec3>& normals) {
        for_faces([&](size_t face, int) {
            for (const FacePoint& point : faces_[face].points) {
                if (!point.owned) continue;
                Vec3 n;
                interpolate(face, point.place, 3, &n.x, [&](uint32_t i) { return &cage_.vertex_normals[corner_vertex(face, i)].x; });
                n = unit_or_zero(n);
                if (dot(n, n) > 0) normals[point.vertex] = n;
            }
        });
    }

    /// Where a surface has no normal of its own (a pole of coinciding vertices, opposite faces) it is that of the triangles.
    static void repair_normals(const scene::Mesh& mesh, const std::vector<Vec3>& shape, std::vector<Vec3>& normals) {
        bool all_fine = true;
        for (Vec3& n : normals) {
            n = unit_or_zero(n);
            all_fine = all_fine && dot(n, n) > 0;
        }
        if (all_fine) return;
        std::vector<Vec3> sums(shape.size());
        for (size_t i = 0; i < mesh.triangle_vertices.size(); i += 3) {
            const uint32_t* v = &mesh.triangle_vertices[i];
            const Vec3 n = unit_or_zero(cross(shape[v[1]] - shape[v[0]], shape[v[2]] - shape[v[0]]));
            for (int k = 0; k < 3; ++k) sums[v[k]] = sums[v[k]] + n;
        }
        for (size_t i = 0; i < normals.size(); ++i) {
            if (dot(normals[i], normals[i]) > 0) continue;
            const Vec3 n = unit_or_zero(sums[i]);
            normals[i] = dot(n, n) > 0 ? n : Vec3{0, 0, 1};
        }
    }

    // ---- attributes

    scene::Attribute diced(const scene::Attribute& from, size_t points) {
        scene::Attribute out;
        out.name = from.name;
        out.domain = from.domain;
        out.components = from.components;
        out.is_color = from.is_color;
        const size_t width = from.components;
        if (from.domain == scene::Domain::Face || from.domain == scene::Domain::Object) {
            out.data = from.data;
        } else if (from.domain == scene::Domain::Corner) {
            out.data.resize(points * width);
            for_faces([&](size_t face, int worker) { fill_corners(face, patches_[size_t(worker)], from, &out.data[faces_[face].first_point * width]); });
        } else {
            out.data.resize(size_t(vertex_count_) * width);
            const bool smooth = from.name == "@generated";
            for_faces([&](size_t face, int worker) {
                SurfacePatch& patch = *patches_[size_t(worker)].shape;
                if (smooth) patch.bind(face, from.data.data(), int(width));
                for (const FacePoint& point : faces_[face].points) {
                    if (!point.owned) continue;
                    float* to = &out.data[point.vertex * width];
                    if (smooth)
                        patch.evaluate(point.place, to);
                    else
                        interpolate(face, point.place, width, to, [&](uint32_t i) { return &from.data[corner_vertex(face, i) * width]; });
                }
            });
        }
        return out;
    }

    void fill_corners(size_t face, WorkerPatches& patches, const scene::Attribute& from, float* to) {
        const auto map_of = [&](const auto& fits) {
            return std::find_if(surface_.uv_maps.begin(), surface_.uv_maps.end(), [&](const LimitSurface::UvMap& map) { return fits(*map.attribute); });
        };
        const auto itself = map_of([&](const scene::Attribute& a) { return &a == &from; });
        const auto below = map_of([&](const scene::Attribute& a) { return from.name == "@tangent:" + a.name; });
        const std::vector<FacePoint>& points = faces_[face].points;
        if (itself != surface_.uv_maps.end()) {
            patches.uv->bind_uv(face, *itself);
            for (const FacePoint& point : points) patches.uv->evaluate(point.place, to), to += 2;
        } else if (below != surface_.uv_maps.end() && from.components == 4) {
            patches.shape->bind(face, positions(), 3);
            patches.uv->bind_uv(face, *below);
            for (const FacePoint& point : points) tangent(patches, point.place, to), to += 4;
        } else {
            const size_t width = from.components;
            const uint32_t n = surface_.face_size(face);
            const auto corner = [&](uint32_t i) { return &from.data[surface_.cage_corners[surface_.starts[face] + i % n] * width]; };
            for (const FacePoint& point : points) interpolate(face, point.place, width, to, corner), to += width;
        }
    }

    /// The direction in which the map's first number grows and its second stays, and whether the map is mirrored.
    static void tangent(const WorkerPatches& patches, Place place, float* out) {
        Vec3 p, p_u, p_v;
        float uv[2], uv_u[2], uv_v[2];
        patches.shape->evaluate(place, &p.x, &p_u.x, &p_v.x);
        patches.uv->evaluate(place, uv, uv_u, uv_v);
        const float turn = uv_u[0] * uv_v[1] - uv_u[1] * uv_v[0], sign = turn < 0 ? -1.0f : 1.0f;
        const Vec3 t = unit_or_zero((p_u * uv_v[1] - p_v * uv_u[1]) * sign);
        out[0] = t.x, out[1] = t.y, out[2] = t.z, out[3] = sign;
    }

    /// Linear in the quad, whose corners are means of the face's.
    template <class Corner>
    void interpolate(size_t face, Place place, size_t width, float* out, const Corner& corner) const {
        const uint32_t n = surface_.face_size(face), i = place.quad, next = (i + 1) % n, before = (i + n - 1) % n;
        for (size_t k = 0; k < width; ++k) {
            float centre = 0;
            for (uint32_t c = 0; c < n; ++c) centre += corner(c)[k];
            centre /= float(n);
            const float here = corner(i)[k], ahead = 0.5f * (here + corner(next)[k]), behind = 0.5f * (here + corner(before)[k]);
            out[k] = lerp(lerp(here, ahead, place.s), lerp(behind, centre, place.s), place.t);
        }
    }

    const scene::Mesh& cage_;
    const DicingMeter& meter_;
    size_t max_triangles_;
    WorkerPool& pool_;
    const std::atomic<bool>* cancel_;
    LimitSurface surface_;
    std::vector<FaceMesh> faces_;
    std::vector<WorkerPatches> patches_;
    std::vector<Edge> edges_;
    std::vector<uint32_t> edge_of_;  ///< by corner, the edge to the next one
    std::vector<uint32_t> owners_;   ///< by vertex of the cage, the first face around it
    std::atomic<size_t> triangles_{0};
    uint32_t vertex_count_ = 0, half_ = 1;
    int levels_ = 1;
};

}  // namespace

float DicingMeter::allowed(Vec3 world) const {
    if (!camera) return edge_length;
    const Vec3 p = transform_point(to_camera, world);
    const float* view = camera->view;
    const bool perspective = camera->type == scene::CameraType::Perspective;
    float distance = 1;
    bool inside = true;
    if (perspective || camera->type == scene::CameraType::Orthographic) {
        const float depth = perspective ? std::max(-p.z, camera->clip_start) : 1;
        inside = -p.z > camera->clip_start && p.x >= view[0] * depth && p.x <= view[1] * depth && p.y >= view[2] * depth && p.y <= view[3] * depth;
        // Beside and behind the camera what counts is how far it is.
        if (perspective) distance = inside ? depth : std::max(length(p), camera->clip_start);
    } else {
        distance = std::max(length(p), camera->clip_start);
    }
    return std::max(distance * pixel * edge_length * (inside ? 1.0f : offscreen), 1e-12f);
}

float DicingMeter::edges(Vec3 a, Vec3 b) const {
    if (!camera) return length(b - a) / edge_length;
    const Vec3 from = transform_point(to_world, a), to = transform_point(to_world, b);
    return length(to - from) / std::min(allowed(from), allowed(to));
}

std::optional<scene::Mesh> tessellate(const scene::Mesh& cage, const DicingMeter& meter, size_t max_triangles, WorkerPool& pool,
                                      const std::atomic<bool>* cancel) {
    return Tessellator(cage, meter, max_triangles, pool, cancel).run();
}

}  // namespace talbot::geometry
