// Voronoi cells in 1 to 4 dimensions [Worley 1996, "A Cellular Texture Basis Function"; Quilez, "Voronoi borders"].
//
// The neighbouring cells are the outer loop, the lanes the inner one: every pass hashes one neighbour of each lane's own cell.
#include "base/hash.h"
#include "shader/kernels/ops.h"

namespace talbot::shader {
inline namespace TALBOT_ISA {
namespace {

/// Columns of the four coordinates; those beyond the dimension stay 0.
struct Columns4 {
    float c[4][kSpan];
};

struct Lanes {
    int n = 0, dimensions = 3;
    bool integer_hash = true;
    Columns4 cell;   ///< the lane's own cell
    Columns4 local;  ///< place in it, 0..1
    const float* randomness = nullptr;
};

/// The feature point of cell `base` + (i, j, k, l), in 0..1 of its cell.
template <int D, bool Integer>
TALBOT_INLINE Hash4 point_of(float x, float y, float z, float w) {
    if constexpr (D == 1) return {unit_hash(x), 0, 0, 0};
    if constexpr (Integer) {
        const auto whole = [](float c) { return int32_t(minf(maxf(c, -2147483648.0f), 2147483520.0f)); };
        if constexpr (D == 2) return pcg_2d(whole(x), whole(y));
        if constexpr (D == 3) return pcg_3d(whole(x), whole(y), whole(z));
        return pcg_4d(whole(x), whole(y), whole(z), whole(w));
    } else {
        if constexpr (D == 2) return {unit_hash(x, y), unit_hash(x, y, 1.0f), 0, 0};
        if constexpr (D == 3) return {unit_hash(x, y, z), unit_hash(x, y, z, 1.0f), unit_hash(x, y, z, 2.0f), 0};
        return {unit_hash(x, y, z, w), unit_hash(w, x, y, z), unit_hash(z, w, x, y), unit_hash(y, z, w, x)};
    }
}

template <int D, bool Integer>
TALBOT_INLINE Hash4 color_of(float x, float y, float z, float w) {
    if constexpr (D == 1) return {unit_hash(x), unit_hash(x, 1.0f), unit_hash(x, 2.0f), 0};
    if constexpr (Integer) {
        if constexpr (D == 2) return point_of<3, true>(x, y, 0.0f, 0.0f);
        return point_of<D, true>(x, y, z, w);
    } else {
        if constexpr (D == 2) return {unit_hash(x, y), unit_hash(x, y, 1.0f), unit_hash(x, y, 2.0f), 0};
        if constexpr (D == 3) return point_of<3, false>(x, y, z, w);
        return {unit_hash(x, y, z, w), unit_hash(z, x, w, y), unit_hash(w, z, y, x), 0};
    }
}

/// Cell offset common to all lanes plus one of each lane's own (null: none).
struct Offset {
    float c[4];
    const Columns4* lane = nullptr;
};

template <int D, bool Integer, bool Color>
TALBOT_INLINE void hash_loop(const Lanes& s, const Offset& o, Columns4& out) {
    static constexpr float kZeros[kSpan] = {};
    ConstColumn cx = s.cell.c[0], cy = s.cell.c[1], cz = s.cell.c[2], cw = s.cell.c[3];
    ConstColumn ox = o.lane ? o.lane->c[0] : kZeros, oy = o.lane ? o.lane->c[1] : kZeros;
    ConstColumn oz = o.lane ? o.lane->c[2] : kZeros, ow = o.lane ? o.lane->c[3] : kZeros;
    ConstColumn randomness = s.randomness;
    Column x = out.c[0], y = out.c[1], z = out.c[2], w = out.c[3];
    TALBOT_VECTOR_LOOP
    for (int k = 0; k < s.n; ++k) {
        const float i = o.c[0] + ox[k], j = o.c[1] + oy[k], l = o.c[2] + oz[k], m = o.c[3] + ow[k];
        if constexpr (Color) {
            const Hash4 h = color_of<D, Integer>(cx[k] + i, cy[k] + j, cz[k] + l, cw[k] + m);
            x[k] = h.x;
            y[k] = h.y;
            z[k] = h.z;
        } else {
            const Hash4 h = point_of<D, Integer>(cx[k] + i, cy[k] + j, cz[k] + l, cw[k] + m);
            const float r = saturate(randomness[k]);
            x[k] = h.x * r + i;
            if constexpr (D > 1) y[k] = h.y * r + j;
            if constexpr (D > 2) z[k] = h.z * r + l;
            if constexpr (D > 3) w[k] = h.w * r + m;
        }
    }
}

/// Feature points relative to the lanes' own cells, or the cells' colours.
template <bool Color>
void hash_cells(const Lanes& s, const Offset& o, Columns4& out) {
    switch (s.dimensions * 2 + (s.integer_hash ? 1 : 0)) {
        case 2:
        case 3:
            return hash_loop<1, true, Color>(s, o, out);
        case 4:
            return hash_loop<2, false, Color>(s, o, out);
        case 5:
            return hash_loop<2, true, Color>(s, o, out);
        case 6:
            return hash_loop<3, false, Color>(s, o, out);
        case 7:
            return hash_loop<3, true, Color>(s, o, out);
        case 8:
            return hash_loop<4, false, Color>(s, o, out);
        default:
            return hash_loop<4, true, Color>(s, o, out);
    }
}

void distances(const Lanes& s, const Columns4& a, VoronoiMetric metric, const float* exponent_column, float* distance) {
    Column d = distance;
    ConstColumn px = a.c[0], py = a.c[1], pz = a.c[2], pw = a.c[3], exponent = exponent_column;
    ConstColumn qx = s.local.c[0], qy = s.local.c[1], qz = s.local.c[2], qw = s.local.c[3];
    switch (s.dimensions == 1 ? VoronoiMetric::Manhattan : metric) {
        case VoronoiMetric::Euclidean:
            TALBOT_VECTOR_LOOP
            for (int k = 0; k < s.n; ++k) d[k] = std::sqrt(square(px[k] - qx[k]) + square(py[k] - qy[k]) + square(pz[k] - qz[k]) + square(pw[k] - qw[k]));
            return;
        case VoronoiMetric::Manhattan:
            TALBOT_VECTOR_LOOP
            for (int k = 0; k < s.n; ++k) d[k] = lane_abs(px[k] - qx[k]) + lane_abs(py[k] - qy[k]) + lane_abs(pz[k] - qz[k]) + lane_abs(pw[k] - qw[k]);
            return;
        case VoronoiMetric::Chebychev:
            TALBOT_VECTOR_LOOP
            for (int k = 0; k < s.n; ++k)
                d[k] = maxf(maxf(lane_abs(px[k] - qx[k]), lane_abs(py[k] - qy[k])), maxf(lane_abs(pz[k] - qz[k]), lane_abs(pw[k] - qw[k])));
            return;
        case VoronoiMetric::Minkowski:
            TALBOT_VECTOR_LOOP
            for (int k = 0; k < s.n; ++k) {
                const float e = exponent[k];
                const auto power = [e](float x) { return x > 0.0f ? lane_pow(x, e) : 0.0f; };
                const float sum =
                    power(lane_abs(px[k] - qx[k])) + power(lane_abs(py[k] - qy[k])) + power(lane_abs(pz[k] - qz[k])) + power(lane_abs(pw[k] - qw[k]));
                d[k] = sum > 0.0f ? lane_pow(sum, e != 0.0f ? 1.0f / e : 0.0f) : 0.0f;
            }
            return;
    }
}

/// visit(offset) for all neighbours within `reach`, x fastest.
template <class F>
TALBOT_INLINE void for_neighbours(int dimensions, int reach, F visit) {
    const int r1 = dimensions > 1 ? reach : 0, r2 = dimensions > 2 ? reach : 0, r3 = dimensions > 3 ? reach : 0;
    for (int l = -r3; l <= r3; ++l)
        for (int k = -r2; k <= r2; ++k)
            for (int j = -r1; j <= r1; ++j)
                for (int i = -reach; i <= reach; ++i) visit(Offset{{float(i), float(j), float(k), float(l)}, nullptr});
}

struct Winner {
    float distance[kSpan];
    Columns4 offset, point;
    void reset(int n) {
        fill(distance, n, 1e30f);
        for (int c = 0; c < 4; ++c) {
            fill(offset.c[c], n, 0.0f);
            fill(point.c[c], n, 0.0f);
        }
    }
};

TALBOT_INLINE void keep_nearest(int n, const Offset& o, const Columns4& point, const float* distance, Winner& best) {
    Column b = best.distance;
    ConstColumn d = distance;
    for (int c = 0; c < 4; ++c) {
        Column offset = best.offset.c[c], target = best.point.c[c];
        ConstColumn p = point.c[c];
        const float oc = o.c[c];
        TALBOT_VECTOR_LOOP
        for (int k = 0; k < n; ++k) {
            const bool nearer = d[k] < b[k];
            offset[k] = nearer ? oc : offset[k];
            target[k] = nearer ? p[k] : target[k];
        }
    }
    TALBOT_VECTOR_LOOP
    for (int k = 0; k < n; ++k) b[k] = minf(d[k], b[k]);
}

/// distance, rgb, position xyzw of op.h.
void write_winner(const Lanes& s, const Winner& w, Registers r, Columns4& scratch) {
    std::memcpy(r[0], w.distance, size_t(s.n) * sizeof(float));
    const Offset own{{0, 0, 0, 0}, &w.offset};
    hash_cells<true>(s, own, scratch);
    for (int c = 0; c < 3; ++c) std::memcpy(r[1 + c], scratch.c[c], size_t(s.n) * sizeof(float));
    for (int c = 0; c < 4; ++c) {
        Column o = r[4 + c];
        ConstColumn p = w.point.c[c], cell = s.cell.c[c];
        TALBOT_VECTOR_LOOP
        for (int k = 0; k < s.n; ++k) o[k] = p[k] + cell[k];
    }
}

void nearest(const Lanes& s, VoronoiMetric metric, const float* exponent, bool second, Registers r) {
    Winner best, next;
    Columns4 point{};
    float d[kSpan];
    best.reset(s.n);
    next.reset(s.n);
    for_neighbours(s.dimensions, 1, [&](const Offset& o) {
        hash_cells<false>(s, o, point);
        distances(s, point, metric, exponent, d);
        if (second) {
            // What the winner loses falls to the second place: the larger of (new, winner) competes there.
            float loser[kSpan];
            Columns4 loser_offset, loser_point;
            for (int c = 0; c < 4; ++c) {
                const float oc = o.c[c];
                TALBOT_VECTOR_LOOP
                for (int k = 0; k < s.n; ++k) {
                    const bool nearer = d[k] < best.distance[k];
                    loser_offset.c[c][k] = nearer ? best.offset.c[c][k] : oc;
                    loser_point.c[c][k] = nearer ? best.point.c[c][k] : point.c[c][k];
                }
            }
            TALBOT_VECTOR_LOOP
            for (int k = 0; k < s.n; ++k) loser[k] = maxf(d[k], best.distance[k]);
            for (int c = 0; c < 4; ++c) {
                TALBOT_VECTOR_LOOP
                for (int k = 0; k < s.n; ++k) {
                    // The old winner is second whatever was: of equally far points the last to be thrown out, as in Cycles.
                    const bool nearer = (loser[k] < next.distance[k]) | (d[k] < best.distance[k]);
                    next.offset.c[c][k] = nearer ? loser_offset.c[c][k] : next.offset.c[c][k];
                    next.point.c[c][k] = nearer ? loser_point.c[c][k] : next.point.c[c][k];
                }
            }
            TALBOT_VECTOR_LOOP
            for (int k = 0; k < s.n; ++k) next.distance[k] = minf(loser[k], next.distance[k]);
        }
        keep_nearest(s.n, o, point, d, best);
    });
    write_winner(s, second ? next : best, r, point);
}

void smooth(const Lanes& s, VoronoiMetric metric, const float* exponent, const float* smoothness, Registers r) {
    Columns4 point{}, color{}, position{};
    float sum[kSpan], d[kSpan], rgb[3][kSpan];
    fill(sum, s.n, 8.0f);
    for (auto& c : rgb) fill(c, s.n, 0.0f);
    for_neighbours(s.dimensions, 2, [&](const Offset& o) {
        hash_cells<false>(s, o, point);
        distances(s, point, metric, exponent, d);
        hash_cells<true>(s, o, color);
        TALBOT_VECTOR_LOOP
        for (int k = 0; k < s.n; ++k) {
            const float w = clampf(smoothness[k] * 0.5f, 1e-6f, 0.5f);
            const float t = saturate(0.5f + 0.5f * (sum[k] - d[k]) / w);
            const float h = t * t * (3.0f - 2.0f * t);
            const float correction = w * h * (1.0f - h), small = correction / (1.0f + 3.0f * w);
            sum[k] = lerp(sum[k], d[k], h) - correction;
            for (int c = 0; c < 3; ++c) rgb[c][k] = lerp(rgb[c][k], color.c[c][k], h) - small;
            for (int c = 0; c < 4; ++c) position.c[c][k] = lerp(position.c[c][k], point.c[c][k], h) - small;
        }
    });
    std::memcpy(r[0], sum, size_t(s.n) * sizeof(float));
    for (int c = 0; c < 3; ++c) std::memcpy(r[1 + c], rgb[c], size_t(s.n) * sizeof(float));
    for (int c = 0; c < 4; ++c)
        for (int k = 0; k < s.n; ++k) r[4 + c][k] = position.c[c][k] + s.cell.c[c][k];
}

void distance_to_edge(const Lanes& s, Registers r) {
    Column out = r[0];
    Columns4 point{};
    Winner best;
    best.reset(s.n);
    float d[kSpan];
    for_neighbours(s.dimensions, 1, [&](const Offset& o) {
        hash_cells<false>(s, o, point);
        distances(s, point, VoronoiMetric::Euclidean, nullptr, d);
        keep_nearest(s.n, o, point, d, best);
    });
    fill(out, s.n, 8.0f);
    const bool line = s.dimensions == 1;
    for_neighbours(s.dimensions, 1, [&](const Offset& o) {
        hash_cells<false>(s, o, point);
        TALBOT_VECTOR_LOOP
        for (int k = 0; k < s.n; ++k) {
            // Perpendicular bisector between the nearest point and this one.
            float across = 0.0f, length2 = 0.0f;
            for (int c = 0; c < 4; ++c) {
                const float a = best.point.c[c][k] - s.local.c[c][k], b = point.c[c][k] - s.local.c[c][k];
                across += 0.5f * (a + b) * (b - a);
                length2 += square(b - a);
            }
            const float e = across / std::sqrt(maxf(length2, 1e-12f));
            out[k] = length2 > 0.0001f ? minf(out[k], line ? lane_abs(e) : e) : out[k];
        }
    });
    for (int c = 1; c < 8; ++c) fill(r[c], s.n, 0.0f);
}

void sphere_radius(const Lanes& s, Registers r) {
    Columns4 point{};
    Winner best;
    best.reset(s.n);
    float d[kSpan], near[kSpan];
    for_neighbours(s.dimensions, 1, [&](const Offset& o) {
        hash_cells<false>(s, o, point);
        distances(s, point, VoronoiMetric::Euclidean, nullptr, d);
        keep_nearest(s.n, o, point, d, best);
    });
    fill(near, s.n, 1e30f);
    for_neighbours(s.dimensions, 1, [&](Offset o) {
        if (o.c[0] == 0 && o.c[1] == 0 && o.c[2] == 0 && o.c[3] == 0) return;
        o.lane = &best.offset;
        hash_cells<false>(s, o, point);
        TALBOT_VECTOR_LOOP
        for (int k = 0; k < s.n; ++k) {
            float length2 = 0.0f;
            for (int c = 0; c < 4; ++c) length2 += square(point.c[c][k] - best.point.c[c][k]);
            near[k] = minf(near[k], length2);
        }
    });
    for (int k = 0; k < s.n; ++k) r[0][k] = 0.5f * std::sqrt(near[k]);
    for (int c = 1; c < 8; ++c) fill(r[c], s.n, 0.0f);
}

}  // namespace

void op_voronoi(const Instruction& i, Registers r, int n) {
    Lanes s;
    s.n = n;
    s.dimensions = (i.variant & 3) + 1;
    s.integer_hash = i.data & 1;
    s.randomness = r[14];
    for (int c = 0; c < 4; ++c) {
        // The line uses its fourth coordinate.
        const float* in = r[8 + (s.dimensions == 1 && c == 0 ? 3 : c)];
        for (int k = 0; k < n; ++k) {
            const float x = c < s.dimensions && lane_abs(in[k]) < 1e30f ? in[k] : 0.0f;
            const float cell = lane_floor(x);
            s.cell.c[c][k] = cell;
            s.local.c[c][k] = x - cell;
        }
    }
    const VoronoiMetric metric = VoronoiMetric((i.variant >> 5) & 3);
    switch (VoronoiFeature((i.variant >> 2) & 7)) {
        case VoronoiFeature::F1:
            return nearest(s, metric, r[13], false, r);
        case VoronoiFeature::F2:
            return nearest(s, metric, r[13], true, r);
        case VoronoiFeature::SmoothF1:
            return smooth(s, metric, r[13], r[12], r);
        case VoronoiFeature::DistanceToEdge:
            return distance_to_edge(s, r);
        case VoronoiFeature::NSphereRadius:
            return sphere_radius(s, r);
    }
}

}  // namespace TALBOT_ISA
}  // namespace talbot::shader
