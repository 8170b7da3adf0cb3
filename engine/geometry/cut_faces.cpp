#include "geometry/cut_faces.h"

#include <algorithm>
#include <unordered_map>

namespace talbot::geometry {
namespace {

constexpr float kLongest = 1.41421356f;  ///< of a piece, as a multiple of what is allowed

/// A cut of a cage's edge. `k` counts from 0 at the vertex of lower number to 2^levels at the other.
struct EdgeCut {
    uint32_t k = 0;
    uint32_t vertex = kNoVertex;
};

struct Edge {
    uint32_t low = 0, face = 0, side = 0;  ///< its lower vertex; the first face that has it, and from which corner: who owns it
    std::vector<EdgeCut> cuts;             ///< ascending, without the ends
};

/// One end of a piece: where on its line, and which of the face's points.
struct Stop {
    uint32_t k = 0;
    uint32_t point = 0;
};
using Line = std::vector<Stop>;

class FaceCutter {
public:
    explicit FaceCutter(DicingWork& work) : work_(work), faces_(work.surface.face_count()) {
        half_ = 1u << (std::clamp(work.cage.subdivision.max_level, 1, 16) - 1);
    }

    std::optional<CutFaces> run(size_t max_triangles) {
        find_edges();
        work_.for_faces([&](size_t face, int worker) { cut_edges(face, *work_.patches[size_t(worker)].shape); });
        uint32_t vertices = uint32_t(work_.cage.positions.size());
        for (Edge& edge : edges_)
            for (EdgeCut& cut : edge.cuts) cut.vertex = vertices++;
        std::atomic<size_t> triangles{0};
        work_.for_faces([&](size_t face, int worker) {
            if (triangles > max_triangles) return;
            FaceDicer(*this, face, *work_.patches[size_t(worker)].shape).run();
            triangles += faces_[face].triangles.size() / 3;
        });
        if (triangles > max_triangles) return std::nullopt;
        return CutFaces{std::move(faces_), vertices};
    }

private:
    void find_edges() {
        std::unordered_map<uint64_t, uint32_t> known;
        known.reserve(work_.surface.vertices.size());
        owners_.assign(work_.cage.positions.size(), kNoVertex);
        for (size_t face = 0; face < faces_.size(); ++face) {
            for (uint32_t i = 0; i < work_.surface.face_size(face); ++i) {
                const uint32_t a = work_.corner_vertex(face, i), b = work_.corner_vertex(face, i + 1);
                if (owners_[a] == kNoVertex) owners_[a] = uint32_t(face);
                const auto [found, is_new] = known.try_emplace(uint64_t(std::min(a, b)) << 32 | std::max(a, b), uint32_t(edges_.size()));
                if (is_new) edges_.push_back({std::min(a, b), uint32_t(face), i, {}});
                edge_of_.push_back(found->second);
            }
        }
    }

    /// Where `k` of 2^levels steps from corner `side` to the next are.
    Place on_side(size_t face, uint32_t side, uint32_t k) const {
        if (k <= half_) return {side, float(k) / float(half_), 0};
        return {(side + 1) % work_.surface.face_size(face), 0, float(2 * half_ - k) / float(half_)};
    }

    static Vec3 position(const SurfacePatch& patch, Place place) {
        Vec3 p;
        patch.evaluate(place, &p.x);
        return p;
    }

    /// Calls made(k) for every cut strictly between k0 and k1, in their order. `at(k)`: position.
    template <class At, class Made>
    void cut_line(uint32_t k0, Vec3 p0, uint32_t k1, Vec3 p1, const At& at, const Made& made) const {
        if (k1 - k0 < 2 || work_.meter.edges(p0, p1) <= kLongest) return;
        const uint32_t middle = (k0 + k1) / 2;
        const Vec3 p = at(middle);
        cut_line(k0, p0, middle, p, at, made);
        made(middle);
        cut_line(middle, p, k1, p1, at, made);
    }

    void cut_edges(size_t face, SurfacePatch& patch) {
        bool bound = false;
        for (uint32_t side = 0; side < work_.surface.face_size(face); ++side) {
            Edge& edge = edges_[edge_of_[work_.surface.starts[face] + side]];
            if (edge.face != face || edge.side != side) continue;
            if (!bound) patch.bind(face, work_.positions(), 3);
            bound = true;
            const bool forward = work_.corner_vertex(face, side) == edge.low;
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
        FaceDicer(FaceCutter& t, size_t f, SurfacePatch& p) : all(t), face(f), patch(p), out(t.faces_[f]), n(t.work_.surface.face_size(f)) {}
        FaceCutter& all;
        size_t face;
        SurfacePatch& patch;
        FaceMesh& out;
        uint32_t n;

        uint32_t add(uint32_t vertex, bool owned, Place place) {
            out.points.push_back({vertex, owned, place});
            return uint32_t(out.points.size() - 1);
        }

        void run() {
            patch.bind(face, all.work_.positions(), 3);
            std::vector<uint32_t> corners, middles;
            for (uint32_t i = 0; i < n; ++i) {
                const uint32_t vertex = all.work_.corner_vertex(face, i);
                corners.push_back(add(vertex, all.owners_[vertex] == face, {i, 0, 0}));
            }
            // The halves of the sides: from a corner on, and towards the next.
            std::vector<Line> leaving(n), arriving(n), spokes(n);
            for (uint32_t i = 0; i < n; ++i) {
                const Edge& edge = all.edges_[all.edge_of_[all.work_.surface.starts[face] + i]];
                const bool forward = all.work_.corner_vertex(face, i) == edge.low, owned = edge.face == face && edge.side == i;
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

    DicingWork& work_;
    std::vector<FaceMesh> faces_;
    std::vector<Edge> edges_;
    std::vector<uint32_t> edge_of_;  ///< by corner, the edge to the next one
    std::vector<uint32_t> owners_;   ///< by vertex of the cage, the first face around it
    uint32_t half_ = 1;              ///< steps of half an edge, at the finest
};

}  // namespace

DicingWork::DicingWork(const scene::Mesh& of, const DicingMeter& by, WorkerPool& workers, const std::atomic<bool>* stop)
    : cage(of), meter(by), pool(workers), cancel(stop), surface(of) {
    if (surface.face_count() == 0) return;
    for (int i = 0; i < pool.size(); ++i) patches.push_back({std::make_unique<SurfacePatch>(surface), std::make_unique<SurfacePatch>(surface)});
}

std::optional<CutFaces> cut_faces(DicingWork& work, size_t max_triangles) {
    return FaceCutter(work).run(max_triangles);
}

}  // namespace talbot::geometry
