// Voronoi cells in 1 to 4 dimensions [Worley 1996, "A Cellular Texture Basis Function"; Quilez, "Voronoi borders"].
//
// The neighbouring cells are the outer loop, the lanes the inner one: every pass hashes one neighbour of each lane's own cell. A neighbour that is too
// far away for every lane of a chunk is not hashed. The nearest point is looked for in each lane's own order: first in the cells on its side of the
// cell's middle, so that the others are mostly too far.
#include <algorithm>

#include "base/hash.h"
#include "shader/kernels/ops.h"

namespace talbot::shader {
inline namespace TALBOT_ISA {
namespace {

/// Lanes that are looked at together: few, so that a neighbour is often too far for all of them, and their columns stay in the first cache.
constexpr int kChunk = 32;

/// Columns of the four coordinates; those beyond the dimension stay 0.
struct Columns4 {
    float c[4][kChunk];
};

struct Lanes {
    int n = 0, dimensions = 3;
    bool integer_hash = true;
    bool color = true, position = true;  ///< whether somebody asks for them
    Columns4 cell;                       ///< the lane's own cell
    Columns4 local;                      ///< place in it, 0..1
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

/// Cell offset common to all lanes, times a sign and plus an offset of each lane's own (null: neither).
struct Offset {
    float c[4];
    const Columns4* lane = nullptr;
    const Columns4* sign = nullptr;
};
constexpr Columns4 filled(float value) {
    Columns4 out{};
    for (auto& column : out.c)
        for (float& x : column) x = value;
    return out;
}
constexpr Columns4 kZeros = filled(0.0f), kOnes = filled(1.0f);

template <int D, bool Integer, bool Color>
TALBOT_INLINE void hash_loop(const Lanes& s, const Offset& o, Columns4& out) {
    ConstColumn cx = s.cell.c[0], cy = s.cell.c[1], cz = s.cell.c[2], cw = s.cell.c[3];
    const Columns4 &own = o.lane ? *o.lane : kZeros, &sign = o.sign ? *o.sign : kOnes;
    ConstColumn ox = own.c[0], oy = own.c[1], oz = own.c[2], ow = own.c[3];
    ConstColumn sx = sign.c[0], sy = sign.c[1], sz = sign.c[2], sw = sign.c[3];
    ConstColumn randomness = s.randomness;
    Column x = out.c[0], y = out.c[1], z = out.c[2], w = out.c[3];
    TALBOT_VECTOR_LOOP
    for (int k = 0; k < s.n; ++k) {
        const float i = o.c[0] * sx[k] + ox[k], j = o.c[1] * sy[k] + oy[k], l = o.c[2] * sz[k] + oz[k], m = o.c[3] * sw[k] + ow[k];
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

/// Distances from each lane's place to the cells beside its own, by axis: [0] on the side where it is, [1] on the other.
struct Sides {
    Columns4 sign;  ///< towards the nearer side
    Columns4 apart[2];
    explicit Sides(const Lanes& s) {
        for (int c = 0; c < 4; ++c) {
            ConstColumn place = s.local.c[c];
            Column to = sign.c[c], near = apart[0].c[c], far = apart[1].c[c];
            TALBOT_VECTOR_LOOP
            for (int k = 0; k < s.n; ++k) {
                const float x = place[k];
                to[k] = x < 0.5f ? -1.0f : 1.0f;
                near[k] = minf(x, 1.0f - x);
                far[k] = maxf(x, 1.0f - x);
            }
        }
    }
};

/// Square of what Euclid's distance is multiplied by to be never above the metric's.
float least_share(const Lanes& s, VoronoiMetric metric) {
    if (s.dimensions == 1) return 1.0f;
    return metric == VoronoiMetric::Minkowski ? 0.0f : metric == VoronoiMetric::Chebychev ? 1.0f / float(s.dimensions) : 1.0f;
}
/// Whether for any lane the square of a distance is within that of another. Rounding is allowed for.
bool any_within(int n, const float* square_column, const float* within_column) {
    ConstColumn square = square_column, within = within_column;
    uint32_t any = 0;
    TALBOT_VECTOR_LOOP
    for (int k = 0; k < n; ++k) any |= square[k] <= within[k] * within[k] * 1.0001f + 1e-6f ? 1u : 0u;
    return any != 0;
}

/// Whether a point of the cell at `o` (times the lane's signs) may be as near as `within`, for any lane.
bool reaches(const Lanes& s, const Sides& sides, const Offset& o, VoronoiMetric metric, const float* within) {
    const float share = least_share(s, metric);
    const float* column[4];
    for (int c = 0; c < 4; ++c) column[c] = o.c[c] == 0.0f ? kZeros.c[c] : sides.apart[o.c[c] < 0.0f ? 1 : 0].c[c];
    ConstColumn a = column[0], b = column[1], c = column[2], d = column[3];
    float square[kChunk];
    Column out = square;
    if (metric == VoronoiMetric::Manhattan) {
        TALBOT_VECTOR_LOOP
        for (int k = 0; k < s.n; ++k) out[k] = talbot::square(a[k] + b[k] + c[k] + d[k]);
    } else {
        TALBOT_VECTOR_LOOP
        for (int k = 0; k < s.n; ++k) out[k] = (a[k] * a[k] + b[k] * b[k] + c[k] * c[k] + d[k] * d[k]) * share;
    }
    return any_within(s.n, square, within);
}

/// The neighbours in the lanes' own signs: 1 is the nearer side, -1 the other. Those of the nearer sides first.
template <class F>
TALBOT_INLINE void for_sides(int dimensions, F visit) {
    int count = 1;
    for (int c = 0; c < dimensions; ++c) count *= 3;
    for (int others = 0; others <= dimensions; ++others) {
        for (int code = 0; code < count; ++code) {
            Offset o{{0, 0, 0, 0}, nullptr, nullptr};
            int turned = 0;
            for (int c = 0, rest = code; c < dimensions; ++c, rest /= 3) {
                o.c[c] = rest % 3 == 2 ? -1.0f : float(rest % 3);
                turned += rest % 3 == 2 ? 1 : 0;
            }
            if (turned == others) visit(o);
        }
    }
}

struct Winner {
    float distance[kChunk];
    float rank[kChunk];  ///< of the cell, x fastest, 0 the lane's own: of equally far points the first is nearest
    Columns4 offset, point;
};

/// The nearest feature points, and the cells that they are in.
void find_nearest(const Lanes& s, const Sides& sides, VoronoiMetric metric, const float* exponent, Winner& best) {
    fill(best.distance, s.n, 1e30f);
    fill(best.rank, s.n, 0.0f);
    float d[kChunk];
    for_sides(s.dimensions, [&](Offset o) {
        if (!reaches(s, sides, o, metric, best.distance)) return;
        o.sign = &sides.sign;
        hash_cells<false>(s, o, best.point);
        distances(s, best.point, metric, exponent, d);
        Column distance = best.distance, rank = best.rank;
        ConstColumn sx = sides.sign.c[0], sy = sides.sign.c[1], sz = sides.sign.c[2], sw = sides.sign.c[3];
        TALBOT_VECTOR_LOOP
        for (int k = 0; k < s.n; ++k) {
            const float here = o.c[0] * sx[k] + 3.0f * o.c[1] * sy[k] + 9.0f * o.c[2] * sz[k] + 27.0f * o.c[3] * sw[k];
            const bool nearer = (d[k] < distance[k]) | ((d[k] == distance[k]) & (here < rank[k]));
            distance[k] = nearer ? d[k] : distance[k];
            rank[k] = nearer ? here : rank[k];
        }
    });
    for (int c = 0; c < 4; ++c) {
        Column offset = best.offset.c[c], rest = best.rank;
        TALBOT_VECTOR_LOOP
        for (int k = 0; k < s.n; ++k) {
            const float next = lane_floor((rest[k] + 1.5f) * (1.0f / 3.0f));
            offset[k] = rest[k] - 3.0f * next;
            rest[k] = next;
        }
    }
    hash_cells<false>(s, Offset{{0, 0, 0, 0}, &best.offset, nullptr}, best.point);
}

/// distance, rgb, position xyzw of op.h.
void write_winner(const Lanes& s, const float* distance, const Columns4& offset, const Columns4& point, Registers r) {
    std::memcpy(r[0], distance, size_t(s.n) * sizeof(float));
    Columns4 color = kZeros;
    if (s.color) hash_cells<true>(s, Offset{{0, 0, 0, 0}, &offset, nullptr}, color);
    for (int c = 0; c < 3; ++c) std::memcpy(r[1 + c], color.c[c], size_t(s.n) * sizeof(float));
    for (int c = 0; c < 4; ++c) {
        Column o = r[4 + c];
        ConstColumn p = point.c[c], cell = s.cell.c[c];
        TALBOT_VECTOR_LOOP
        for (int k = 0; k < s.n; ++k) o[k] = p[k] + cell[k];
    }
}

void nearest(const Lanes& s, const Sides& sides, VoronoiMetric metric, const float* exponent, Registers r) {
    Winner best;
    best.point = kZeros;
    find_nearest(s, sides, metric, exponent, best);
    write_winner(s, best.distance, best.offset, best.point, r);
}

void second_nearest(const Lanes& s, VoronoiMetric metric, const float* exponent, Registers r) {
    float first[kChunk], second[kChunk], d[kChunk];
    Columns4 point = kZeros, first_offset = kZeros, offset = kZeros;
    fill(first, s.n, 1e30f);
    fill(second, s.n, 1e30f);
    for_neighbours(s.dimensions, 1, [&](const Offset& o) {
        hash_cells<false>(s, o, point);
        distances(s, point, metric, exponent, d);
        for (int c = 0; c < 4; ++c) {
            const float here = o.c[c];
            TALBOT_VECTOR_LOOP
            for (int k = 0; k < s.n; ++k) {
                // What the winner loses falls to the second place. It is second whatever was: of equally far points the last to be thrown out, as in
                // Cycles.
                const bool wins = d[k] < first[k];
                const float before = first_offset.c[c][k];
                offset.c[c][k] = wins ? before : (d[k] < second[k] ? here : offset.c[c][k]);
                first_offset.c[c][k] = wins ? here : before;
            }
        }
        TALBOT_VECTOR_LOOP
        for (int k = 0; k < s.n; ++k) {
            second[k] = minf(maxf(d[k], first[k]), second[k]);
            first[k] = minf(d[k], first[k]);
        }
    });
    hash_cells<false>(s, Offset{{0, 0, 0, 0}, &offset, nullptr}, point);
    write_winner(s, second, offset, point, r);
}

/// Whether a point of the cell at `o` may be near enough to be blended in, for any lane.
bool blends(const Lanes& s, const Offset& o, VoronoiMetric metric, const float* smoothness_column, const float* sum_column) {
    const float share = least_share(s, metric);
    float square[kChunk], within[kChunk];
    Column out = square, reach = within;
    ConstColumn sum = sum_column, smoothness = smoothness_column;
    fill(square, s.n, 0.0f);
    for (int c = 0; c < s.dimensions; ++c) {
        ConstColumn place = s.local.c[c];
        const float cell = o.c[c];
        TALBOT_VECTOR_LOOP
        for (int k = 0; k < s.n; ++k) out[k] += share * talbot::square(maxf(maxf(cell - place[k], place[k] - cell - 1.0f), 0.0f));
    }
    TALBOT_VECTOR_LOOP
    for (int k = 0; k < s.n; ++k) reach[k] = maxf(sum[k] + clampf(smoothness[k] * 0.5f, 1e-6f, 0.5f), 0.0f);
    return any_within(s.n, square, within);
}

/// The polynomial smooth minimum of sum and distance: the sum, and for other columns the share of the new cell and what is taken off.
void blend_distance(int n, const float* smoothness_column, const float* distance, float* sum_column, float* share_column, float* less_column) {
    ConstColumn smoothness = smoothness_column, d = distance;
    Column sum = sum_column, share = share_column, less = less_column;
    TALBOT_VECTOR_LOOP
    for (int k = 0; k < n; ++k) {
        const float w = clampf(smoothness[k] * 0.5f, 1e-6f, 0.5f);
        const float t = saturate(0.5f + 0.5f * (sum[k] - d[k]) / w);
        const float h = t * t * (3.0f - 2.0f * t);
        const float correction = w * h * (1.0f - h);
        sum[k] = lerp(sum[k], d[k], h) - correction;
        share[k] = h;
        less[k] = correction / (1.0f + 3.0f * w);
    }
}
void blend_column(int n, const float* share_column, const float* less_column, const float* cell, float* column) {
    ConstColumn share = share_column, less = less_column, c = cell;
    Column out = column;
    TALBOT_VECTOR_LOOP
    for (int k = 0; k < n; ++k) out[k] = lerp(out[k], c[k], share[k]) - less[k];
}

void smooth(const Lanes& s, VoronoiMetric metric, const float* exponent, const float* smoothness, Registers r) {
    Columns4 point = kZeros, color = kZeros, position = kZeros, rgb = kZeros;
    float sum[kChunk], d[kChunk], share[kChunk], less[kChunk];
    fill(sum, s.n, 8.0f);
    for_neighbours(s.dimensions, 2, [&](const Offset& o) {
        if (!blends(s, o, metric, smoothness, sum)) return;
        hash_cells<false>(s, o, point);
        distances(s, point, metric, exponent, d);
        blend_distance(s.n, smoothness, d, sum, share, less);
        if (s.color) {
            hash_cells<true>(s, o, color);
            for (int c = 0; c < 3; ++c) blend_column(s.n, share, less, color.c[c], rgb.c[c]);
        }
        for (int c = 0; c < 4 && s.position; ++c) blend_column(s.n, share, less, point.c[c], position.c[c]);
    });
    std::memcpy(r[0], sum, size_t(s.n) * sizeof(float));
    for (int c = 0; c < 3; ++c) std::memcpy(r[1 + c], rgb.c[c], size_t(s.n) * sizeof(float));
    for (int c = 0; c < 4; ++c)
        for (int k = 0; k < s.n; ++k) r[4 + c][k] = position.c[c][k] + s.cell.c[c][k];
}

void distance_to_edge(const Lanes& s, const Sides& sides, Registers r) {
    Column out = r[0];
    Winner best;
    best.point = kZeros;
    find_nearest(s, sides, VoronoiMetric::Euclidean, nullptr, best);
    Columns4 point = kZeros;
    float within[kChunk];
    fill(out, s.n, 8.0f);
    const bool line = s.dimensions == 1;
    for_sides(s.dimensions, [&](Offset o) {
        // The bisector with a point at distance b is at least (b - nearest) / 2 away.
        for (int k = 0; k < s.n; ++k) within[k] = best.distance[k] + 2.0f * maxf(out[k], 0.0f);
        if (!line && !reaches(s, sides, o, VoronoiMetric::Euclidean, within)) return;
        o.sign = &sides.sign;
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

void sphere_radius(const Lanes& s, const Sides& sides, Registers r) {
    Winner best;
    best.point = kZeros;
    find_nearest(s, sides, VoronoiMetric::Euclidean, nullptr, best);
    Columns4 point = kZeros;
    float near[kChunk];
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

void voronoi_chunk(const Instruction& i, Registers r, int n) {
    Lanes s;
    s.n = n;
    s.dimensions = (i.variant & 3) + 1;
    s.integer_hash = i.data & 1;
    s.color = (i.data & 2) == 0;
    s.position = (i.data & 4) == 0;
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
    const Sides sides(s);
    const VoronoiMetric metric = VoronoiMetric((i.variant >> 5) & 3);
    switch (VoronoiFeature((i.variant >> 2) & 7)) {
        case VoronoiFeature::F1:
            return nearest(s, sides, metric, r[13], r);
        case VoronoiFeature::F2:
            return second_nearest(s, metric, r[13], r);
        case VoronoiFeature::SmoothF1:
            return smooth(s, metric, r[13], r[12], r);
        case VoronoiFeature::DistanceToEdge:
            return distance_to_edge(s, sides, r);
        case VoronoiFeature::NSphereRadius:
            return sphere_radius(s, sides, r);
    }
}

}  // namespace

void op_voronoi(const Instruction& i, Registers r, int n) {
    for (int first = 0; first < n; first += kChunk) {
        float* chunk[15];
        for (int c = 0; c < 15; ++c) chunk[c] = r[c] + first;
        voronoi_chunk(i, chunk, std::min(kChunk, n - first));
    }
}

}  // namespace TALBOT_ISA
}  // namespace talbot::shader
