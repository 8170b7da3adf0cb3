// Voronoi cells in 1 to 4 dimensions [Worley 1996, "A Cellular Texture Basis Function"; Quilez, "Voronoi borders"].
//
// The neighbouring cells are the outer loop, the lanes the inner one: every pass measures one neighbour of each lane's own cell. What depends on one
// coordinate only is worked out beforehand. A neighbour that is too far away for all of the lanes that are looked at together is not hashed. The nearest
// point is looked for in each lane's own order: first in the cells on its side of the cell's middle, so that the others are mostly too far.
#include <array>

#include "base/hash.h"
#include "shader/kernels/ops.h"

namespace talbot::shader {
inline namespace TALBOT_ISA {
namespace {

/// Lanes that are looked at together: few, so that a neighbour is often too far for all of them. All loops below are over so many.
constexpr int kLanes = 16;
/// g++ would unroll loops of so few rounds first, and then vectorise nothing.
#define TALBOT_SHORT_LOOP _Pragma("GCC unroll 1") TALBOT_VECTOR_LOOP
using Lane = float[kLanes];

/// Four coordinates; those beyond the dimension are not set.
struct Points {
    Lane c[4];
};

/// Of the cells beside each lane's own, what depends on one coordinate only: by coordinate and step. What a step means is up to the search.
struct Steps {
    static constexpr int kCount = 5;
    Lane offset[4][kCount];            ///< in cells
    uint32_t word[4][kCount][kLanes];  ///< what is hashed
    Lane apart[4][kCount];             ///< bound of the distance from the lane's place: what all coordinates' add up to (Chebychev's: the largest)
                                       ///< is never above the metric's, or its square where that is Euclid's
};
/// A step for each coordinate: a neighbour.
using Neighbour = std::array<uint8_t, 4>;

/// Metric that distances are compared by: Euclid's also without the root.
enum class Measured : uint8_t { Square, Euclidean, Manhattan, Chebychev, Minkowski };

struct Search {
    Points cell;   ///< the lane's own
    Points place;  ///< in it, 0..1
    Lane randomness;
    const float* exponent = nullptr;
    VoronoiMetric metric = VoronoiMetric::Euclidean;
    bool integer_hash = true;
    bool color = true, position = true;  ///< whether somebody asks for them
    /// Feature point of a neighbour, relative to the lane's own cell, and its distance from the lane's place.
    void (*measure)(const Search& s, const Steps& steps, const Neighbour& at, Points& point, float* distance) = nullptr;
    void (*colors)(const Steps& steps, const Neighbour& at, Points& rgb) = nullptr;
};

/// The feature point of a cell, in 0..1 of it.
template <int D, bool Integer>
TALBOT_INLINE Hash4 point_of(uint32_t x, uint32_t y, uint32_t z, uint32_t w) {
    const uint32_t one = as_uint(1.0f), two = as_uint(2.0f);
    if constexpr (D == 1) return {hash_to_unit(hash_words(x)), 0, 0, 0};
    if constexpr (Integer) {
        if constexpr (D == 2) return pcg_2d(x, y);
        if constexpr (D == 3) return pcg_3d(x, y, z);
        return pcg_4d(x, y, z, w);
    } else {
        if constexpr (D == 2) return {hash_to_unit(hash_words(x, y)), hash_to_unit(hash_words(x, y, one)), 0, 0};
        if constexpr (D == 3) return {hash_to_unit(hash_words(x, y, z)), hash_to_unit(hash_words(x, y, z, one)), hash_to_unit(hash_words(x, y, z, two)), 0};
        return {hash_to_unit(hash_words(x, y, z, w)), hash_to_unit(hash_words(w, x, y, z)), hash_to_unit(hash_words(z, w, x, y)),
                hash_to_unit(hash_words(y, z, w, x))};
    }
}
template <int D, bool Integer>
TALBOT_INLINE Hash4 color_of(uint32_t x, uint32_t y, uint32_t z, uint32_t w) {
    const uint32_t one = as_uint(1.0f), two = as_uint(2.0f);
    if constexpr (D == 1) return {hash_to_unit(hash_words(x)), hash_to_unit(hash_words(x, one)), hash_to_unit(hash_words(x, two)), 0};
    if constexpr (Integer && D == 2) return pcg_3d(x, y, pcg_start(0));
    if constexpr (!Integer && D == 2) return {hash_to_unit(hash_words(x, y)), hash_to_unit(hash_words(x, y, one)), hash_to_unit(hash_words(x, y, two)), 0};
    if constexpr (!Integer && D == 4)
        return {hash_to_unit(hash_words(x, y, z, w)), hash_to_unit(hash_words(z, x, w, y)), hash_to_unit(hash_words(w, z, y, x)), 0};
    return point_of<D, Integer>(x, y, z, w);
}

template <int D, bool Integer>
void colors(const Steps& steps, const Neighbour& at, Points& rgb) {
    const uint32_t* __restrict wx = steps.word[0][at[0]], * __restrict wy = steps.word[1][at[1]];
    const uint32_t* __restrict wz = steps.word[2][at[2]], * __restrict ww = steps.word[3][at[3]];
    Column red = rgb.c[0], green = rgb.c[1], blue = rgb.c[2];
    TALBOT_SHORT_LOOP
    for (int k = 0; k < kLanes; ++k) {
        const Hash4 h = color_of<D, Integer>(wx[k], wy[k], wz[k], ww[k]);
        red[k] = h.x;
        green[k] = h.y;
        blue[k] = h.z;
    }
}

template <Measured M>
TALBOT_INLINE float length_of(float x, float y, float z, float w, float exponent) {
    if constexpr (M == Measured::Square) return square(x) + square(y) + square(z) + square(w);
    if constexpr (M == Measured::Euclidean) return std::sqrt(square(x) + square(y) + square(z) + square(w));
    if constexpr (M == Measured::Manhattan) return lane_abs(x) + lane_abs(y) + lane_abs(z) + lane_abs(w);
    if constexpr (M == Measured::Chebychev) return maxf(maxf(lane_abs(x), lane_abs(y)), maxf(lane_abs(z), lane_abs(w)));
    const auto power = [exponent](float a) { return a > 0.0f ? lane_pow(a, exponent) : 0.0f; };
    const float sum = power(lane_abs(x)) + power(lane_abs(y)) + power(lane_abs(z)) + power(lane_abs(w));
    return sum > 0.0f ? lane_pow(sum, exponent != 0.0f ? 1.0f / exponent : 0.0f) : 0.0f;
}

template <int D, bool Integer, Measured M>
void measure(const Search& s, const Steps& steps, const Neighbour& at, Points& point, float* distance_column) {
    const uint32_t* __restrict wx = steps.word[0][at[0]], * __restrict wy = steps.word[1][at[1]];
    const uint32_t* __restrict wz = steps.word[2][at[2]], * __restrict ww = steps.word[3][at[3]];
    ConstColumn ox = steps.offset[0][at[0]], oy = steps.offset[1][at[1]], oz = steps.offset[2][at[2]], ow = steps.offset[3][at[3]];
    ConstColumn px = s.place.c[0], py = s.place.c[1], pz = s.place.c[2], pw = s.place.c[3], randomness = s.randomness, exponent = s.exponent;
    Column x = point.c[0], y = point.c[1], z = point.c[2], w = point.c[3], distance = distance_column;
    TALBOT_SHORT_LOOP
    for (int k = 0; k < kLanes; ++k) {
        const Hash4 h = point_of<D, Integer>(wx[k], wy[k], wz[k], ww[k]);
        float a = 0.0f, b = 0.0f, c = 0.0f, d = 0.0f;
        x[k] = a = h.x * randomness[k] + ox[k];
        if constexpr (D > 1) y[k] = b = h.y * randomness[k] + oy[k];
        if constexpr (D > 2) z[k] = c = h.z * randomness[k] + oz[k];
        if constexpr (D > 3) w[k] = d = h.w * randomness[k] + ow[k];
        distance[k] = length_of<M>(a - px[k], D > 1 ? b - py[k] : 0.0f, D > 2 ? c - pz[k] : 0.0f, D > 3 ? d - pw[k] : 0.0f,
                                   M == Measured::Minkowski ? exponent[k] : 0.0f);
    }
}

/// What to compare by: `roots`: distances themselves, not their squares.
Measured measured_by(int dimensions, VoronoiMetric metric, bool roots) {
    if (dimensions == 1) return Measured::Manhattan;
    if (metric == VoronoiMetric::Euclidean) return roots ? Measured::Euclidean : Measured::Square;
    return Measured(int(metric) + 1);
}
template <int D, bool Integer>
void choose_loops(Search& s, Measured measured) {
    s.colors = colors<D, Integer>;
    if constexpr (D == 1) {
        s.measure = measure<D, Integer, Measured::Manhattan>;
    } else {
        constexpr decltype(Search::measure) kMeasures[] = {measure<D, Integer, Measured::Square>, measure<D, Integer, Measured::Euclidean>,
                                                           measure<D, Integer, Measured::Manhattan>, measure<D, Integer, Measured::Chebychev>,
                                                           measure<D, Integer, Measured::Minkowski>};
        s.measure = kMeasures[int(measured)];
    }
}

/// Makes the cells at `offset` from the lanes' own a step of coordinate c.
template <int D>
void set_step(const Search& s, int c, int step, const float* offset_column, Steps& steps) {
    ConstColumn cell = s.cell.c[c], place = s.place.c[c], from = offset_column;
    Column offset = steps.offset[c][step], apart = steps.apart[c][step];
    uint32_t* __restrict word = steps.word[c][step];
    if (D > 1 && s.integer_hash) {
        TALBOT_SHORT_LOOP
        for (int k = 0; k < kLanes; ++k)
            word[k] = pcg_start(int32_t(lane_abs(cell[k]) < 2147483520.0f ? cell[k] : 0.0f)) + uint32_t(int32_t(from[k])) * kPcgStep;
    } else {
        TALBOT_SHORT_LOOP
        for (int k = 0; k < kLanes; ++k) word[k] = as_uint(cell[k] + from[k]);
    }
    const bool squares = D > 1 && s.metric == VoronoiMetric::Euclidean;
    const float share = D > 1 && s.metric == VoronoiMetric::Minkowski ? 0.0f : 1.0f;
    TALBOT_SHORT_LOOP
    for (int k = 0; k < kLanes; ++k) {
        const float o = from[k], p = place[k];
        const float bound = maxf(maxf(o - p, p - o - 1.0f), 0.0f);
        offset[k] = o;
        apart[k] = bound * (squares ? bound : share);
    }
}
/// Neighbours at the same offsets for all lanes: steps 0, 1, 2 ... are -reach, -reach + 1 ...
template <int D>
void set_even_steps(const Search& s, int reach, Steps& steps) {
    Lane offset;
    for (int step = 0; step < 2 * reach + 1; ++step) {
        fill(offset, kLanes, float(step - reach));
        for (int c = 0; c < D; ++c) set_step<D>(s, c, step, offset, steps);
    }
}
/// Neighbours in the lanes' own signs: step 0 is the own cell, 1 the nearer side, 2 the other. Step kWinner is for the search's result.
constexpr int kWinner = 3;
template <int D>
void set_sided_steps(const Search& s, Steps& steps) {
    Lane zero, near, far;
    for (int c = 0; c < D; ++c) {
        ConstColumn place = s.place.c[c];
        TALBOT_SHORT_LOOP
        for (int k = 0; k < kLanes; ++k) {
            zero[k] = 0.0f;
            near[k] = place[k] < 0.5f ? -1.0f : 1.0f;
            far[k] = -near[k];
        }
        set_step<D>(s, c, 0, zero, steps);
        set_step<D>(s, c, 1, near, steps);
        set_step<D>(s, c, 2, far, steps);
    }
}
template <int D>
Neighbour set_winner(const Search& s, const Points& offset, Steps& steps) {
    for (int c = 0; c < D; ++c) set_step<D>(s, c, kWinner, offset.c[c], steps);
    return {kWinner, kWinner, kWinner, kWinner};
}

constexpr int power(int base, int exponent) {
    return exponent > 0 ? base * power(base, exponent - 1) : 1;
}
/// With so many steps for each coordinate.
template <int D, int Count = 3>
using Neighbours = std::array<Neighbour, size_t(power(Count, D))>;
/// x fastest.
template <int D, int Count = 3>
constexpr Neighbours<D, Count> in_rows() {
    Neighbours<D, Count> out{};
    for (size_t i = 0; i < out.size(); ++i)
        for (size_t c = 0, rest = i; c < D; ++c, rest /= Count) out[i][c] = uint8_t(rest % Count);
    return out;
}
/// The fewer steps to the farther sides (2) the earlier.
template <int D>
constexpr Neighbours<D> by_sides() {
    Neighbours<D> out{};
    size_t count = 0;
    for (int others = 0; others <= D; ++others) {
        for (const Neighbour& n : in_rows<D>()) {
            int turned = 0;
            for (const uint8_t step : n) turned += step == 2;
            if (turned == others) out[count++] = n;
        }
    }
    return out;
}
template <int D>
constexpr Neighbours<D> kRows = in_rows<D>();
template <int D>
constexpr Neighbours<D, 5> kFiveRows = in_rows<D, 5>();
template <int D>
constexpr Neighbours<D> kSides = by_sides<D>();

/// Bound of Steps::apart within which a neighbour may matter that matters at this distance. Rounding is allowed for.
TALBOT_INLINE float limit_of(float measured) {
    return measured * 1.0001f + 1e-6f;
}

/// Whether a point of the neighbour may be within the limit for any lane.
template <int D, bool Largest>
bool reaches(const Steps& steps, const Neighbour& at, const float* limit_column) {
    ConstColumn a = steps.apart[0][at[0]], b = steps.apart[1][at[1]], c = steps.apart[2][at[2]], d = steps.apart[3][at[3]], limit = limit_column;
    uint32_t any = 0;
    TALBOT_SHORT_LOOP
    for (int k = 0; k < kLanes; ++k) {
        float apart = a[k];
        if constexpr (D > 1) apart = Largest ? maxf(apart, b[k]) : apart + b[k];
        if constexpr (D > 2) apart = Largest ? maxf(apart, c[k]) : apart + c[k];
        if constexpr (D > 3) apart = Largest ? maxf(apart, d[k]) : apart + d[k];
        any |= apart <= limit[k] ? 1u : 0u;
    }
    return any != 0;
}
template <int D>
TALBOT_INLINE bool may_matter(const Search& s, const Steps& steps, const Neighbour& at, const float* limit) {
    return D > 1 && s.metric == VoronoiMetric::Chebychev ? reaches<D, true>(steps, at, limit) : reaches<D, false>(steps, at, limit);
}

struct Winner {
    Lane distance;  ///< as measured
    Points offset;
};

/// The nearest feature points and the cells that they are in.
template <int D>
void find_nearest(const Search& s, const Steps& steps, Winner& best) {
    Lane limit, d, rank;  // rank of the cell, x fastest, 0 the lane's own: of equally far points the first is nearest
    Points point;
    fill(best.distance, kLanes, 1e30f);
    fill(limit, kLanes, 1e30f);
    fill(rank, kLanes, 0.0f);
    for (const Neighbour& at : kSides<D>) {
        if (!may_matter<D>(s, steps, at, limit)) continue;
        s.measure(s, steps, at, point, d);
        Column distance = best.distance;
        ConstColumn x = steps.offset[0][at[0]], y = steps.offset[1][at[1]], z = steps.offset[2][at[2]], w = steps.offset[3][at[3]];
        TALBOT_SHORT_LOOP
        for (int k = 0; k < kLanes; ++k) {
            float here = x[k];
            if constexpr (D > 1) here += 3.0f * y[k];
            if constexpr (D > 2) here += 9.0f * z[k];
            if constexpr (D > 3) here += 27.0f * w[k];
            const bool nearer = (d[k] < distance[k]) | ((d[k] == distance[k]) & (here < rank[k]));
            distance[k] = nearer ? d[k] : distance[k];
            rank[k] = nearer ? here : rank[k];
            limit[k] = limit_of(distance[k]);
        }
    }
    for (int c = 0; c < D; ++c) {
        Column offset = best.offset.c[c];
        TALBOT_SHORT_LOOP
        for (int k = 0; k < kLanes; ++k) {
            const float next = lane_floor((rank[k] + 1.5f) * (1.0f / 3.0f));
            offset[k] = rank[k] - 3.0f * next;
            rank[k] = next;
        }
    }
}

/// Distances of what was measured for comparisons.
template <int D>
void take_roots(const Search& s, float* distance) {
    if (D == 1 || s.metric != VoronoiMetric::Euclidean) return;
    TALBOT_SHORT_LOOP
    for (int k = 0; k < kLanes; ++k) distance[k] = std::sqrt(distance[k]);
}

/// distance, rgb, position xyzw of op.h, of the cells at `offset`.
template <int D>
void write_winner(const Search& s, Steps& steps, float* distance, const Points& offset, Registers r) {
    Points point;
    Lane d;
    take_roots<D>(s, distance);
    std::memcpy(r[0], distance, sizeof(Lane));
    for (int c = 1; c < 8; ++c) fill(r[c], kLanes, 0.0f);
    if (!s.color && !s.position) return;
    const Neighbour winner = set_winner<D>(s, offset, steps);
    if (s.color) {
        s.colors(steps, winner, point);
        for (int c = 0; c < 3; ++c) std::memcpy(r[1 + c], point.c[c], sizeof(Lane));
    }
    if (!s.position) return;
    s.measure(s, steps, winner, point, d);
    for (int c = 0; c < D; ++c) TALBOT_SHORT_LOOP
    for (int k = 0; k < kLanes; ++k) r[4 + c][k] = point.c[c][k] + s.cell.c[c][k];
}

template <int D>
void nearest(const Search& s, Registers r) {
    Steps steps;
    Winner best;
    set_sided_steps<D>(s, steps);
    find_nearest<D>(s, steps, best);
    write_winner<D>(s, steps, best.distance, best.offset, r);
}

template <int D>
void second_nearest(const Search& s, Registers r) {
    Steps steps;
    Lane first, second, limit, d;
    Points point, first_offset, second_offset;
    set_even_steps<D>(s, 1, steps);
    fill(first, kLanes, 1e30f);
    fill(second, kLanes, 1e30f);
    fill(limit, kLanes, 1e30f);
    for (int c = 0; c < D; ++c) {
        fill(first_offset.c[c], kLanes, 0.0f);
        fill(second_offset.c[c], kLanes, 0.0f);
    }
    for (const Neighbour& at : kRows<D>) {
        if (!may_matter<D>(s, steps, at, limit)) continue;
        s.measure(s, steps, at, point, d);
        for (int c = 0; c < D; ++c) {
            const float here = float(at[size_t(c)]) - 1.0f;
            Column nearest = first_offset.c[c], next = second_offset.c[c];
            TALBOT_SHORT_LOOP
            for (int k = 0; k < kLanes; ++k) {
                // What the winner loses falls to the second place. It is second whatever was: of equally far points the last to be thrown out, as in
                // Cycles.
                const bool wins = d[k] < first[k];
                const float before = nearest[k];
                next[k] = wins ? before : (d[k] < second[k] ? here : next[k]);
                nearest[k] = wins ? here : before;
            }
        }
        TALBOT_SHORT_LOOP
        for (int k = 0; k < kLanes; ++k) {
            second[k] = minf(maxf(d[k], first[k]), second[k]);
            first[k] = minf(d[k], first[k]);
            limit[k] = limit_of(second[k]);
        }
    }
    write_winner<D>(s, steps, second, second_offset, r);
}

/// The polynomial smooth minimum of sum and distance: the sum, and for other columns the share of the new cell and what is taken off. `squares`: 1 where
/// the limit is one of squares, else 0.
void blend_distance(float squares, const float* smoothness_column, const float* distance, float* sum_column, float* share_column, float* less_column,
                    float* limit_column) {
    ConstColumn smoothness = smoothness_column, d = distance;
    Column sum = sum_column, share = share_column, less = less_column, limit = limit_column;
    TALBOT_SHORT_LOOP
    for (int k = 0; k < kLanes; ++k) {
        const float w = clampf(smoothness[k] * 0.5f, 1e-6f, 0.5f);
        const float t = saturate(0.5f + 0.5f * (sum[k] - d[k]) / w);
        const float h = t * t * (3.0f - 2.0f * t);
        const float correction = w * h * (1.0f - h);
        const float blended = lerp(sum[k], d[k], h) - correction, within = maxf(blended + w, 0.0f);
        sum[k] = blended;
        share[k] = h;
        less[k] = correction / (1.0f + 3.0f * w);
        limit[k] = limit_of(within * (within * squares + (1.0f - squares)));
    }
}
void blend_column(const float* share_column, const float* less_column, const float* cell, float* column) {
    ConstColumn share = share_column, less = less_column, c = cell;
    Column out = column;
    TALBOT_SHORT_LOOP
    for (int k = 0; k < kLanes; ++k) out[k] = lerp(out[k], c[k], share[k]) - less[k];
}

template <int D>
void smooth(const Search& s, const float* smoothness, Registers r) {
    Steps steps;
    Points point, color, position, rgb;
    Lane sum, limit, d, share, less;
    set_even_steps<D>(s, 2, steps);
    fill(sum, kLanes, 8.0f);
    fill(limit, kLanes, 1e30f);
    for (int c = 0; c < 4; ++c) {
        fill(position.c[c], kLanes, 0.0f);
        fill(rgb.c[c], kLanes, 0.0f);
    }
    const float squares = D > 1 && s.metric == VoronoiMetric::Euclidean ? 1.0f : 0.0f;
    for (const Neighbour& at : kFiveRows<D>) {
        if (!may_matter<D>(s, steps, at, limit)) continue;
        s.measure(s, steps, at, point, d);
        blend_distance(squares, smoothness, d, sum, share, less, limit);
        if (s.color) {
            s.colors(steps, at, color);
            for (int c = 0; c < 3; ++c) blend_column(share, less, color.c[c], rgb.c[c]);
        }
        for (int c = 0; c < D && s.position; ++c) blend_column(share, less, point.c[c], position.c[c]);
    }
    std::memcpy(r[0], sum, sizeof(Lane));
    for (int c = 0; c < 3; ++c) std::memcpy(r[1 + c], rgb.c[c], sizeof(Lane));
    for (int c = D; c < 4; ++c) fill(r[4 + c], kLanes, 0.0f);
    for (int c = 0; c < D; ++c) TALBOT_SHORT_LOOP
    for (int k = 0; k < kLanes; ++k) r[4 + c][k] = position.c[c][k] + s.cell.c[c][k];
}

template <int D>
void distance_to_edge(const Search& s, Registers r) {
    Steps steps;
    Winner best;
    Points nearest, point;
    Lane limit, d, out;
    set_sided_steps<D>(s, steps);
    find_nearest<D>(s, steps, best);
    s.measure(s, steps, set_winner<D>(s, best.offset, steps), nearest, d);
    take_roots<D>(s, best.distance);
    fill(out, kLanes, 8.0f);
    fill(limit, kLanes, 1e30f);
    for (const Neighbour& at : kSides<D>) {
        if (D > 1 && !may_matter<D>(s, steps, at, limit)) continue;
        s.measure(s, steps, at, point, d);
        TALBOT_SHORT_LOOP
        for (int k = 0; k < kLanes; ++k) {
            // Perpendicular bisector between the nearest point and this one.
            float across = 0.0f, length2 = 0.0f;
            for (int c = 0; c < D; ++c) {
                const float a = nearest.c[c][k] - s.place.c[c][k], b = point.c[c][k] - s.place.c[c][k];
                across += 0.5f * (a + b) * (b - a);
                length2 += square(b - a);
            }
            const float e = across / std::sqrt(maxf(length2, 1e-12f));
            out[k] = length2 > 0.0001f ? minf(out[k], D == 1 ? lane_abs(e) : e) : out[k];
            // The bisector with a point at distance b is at least (b - nearest) / 2 away.
            limit[k] = limit_of(square(best.distance[k] + 2.0f * maxf(out[k], 0.0f)));
        }
    }
    std::memcpy(r[0], out, sizeof(Lane));
    for (int c = 1; c < 8; ++c) fill(r[c], kLanes, 0.0f);
}

template <int D>
void sphere_radius(const Search& s, Registers r) {
    Steps steps;
    Winner best;
    Points nearest, point;
    Lane d, offset, least;
    set_sided_steps<D>(s, steps);
    find_nearest<D>(s, steps, best);
    s.measure(s, steps, set_winner<D>(s, best.offset, steps), nearest, d);
    for (int c = 0; c < D; ++c) {
        for (int step = 0; step < 3; ++step) {
            TALBOT_SHORT_LOOP
            for (int k = 0; k < kLanes; ++k) offset[k] = best.offset.c[c][k] + float(step - 1);
            set_step<D>(s, c, step, offset, steps);
        }
    }
    fill(least, kLanes, 1e30f);
    for (size_t i = 0; i < kRows<D>.size(); ++i) {
        if (i == kRows<D>.size() / 2) continue;  // itself
        s.measure(s, steps, kRows<D>[i], point, d);
        TALBOT_SHORT_LOOP
        for (int k = 0; k < kLanes; ++k) {
            float length2 = 0.0f;
            for (int c = 0; c < D; ++c) length2 += square(point.c[c][k] - nearest.c[c][k]);
            least[k] = minf(least[k], length2);
        }
    }
    TALBOT_SHORT_LOOP
    for (int k = 0; k < kLanes; ++k) r[0][k] = 0.5f * std::sqrt(least[k]);
    for (int c = 1; c < 8; ++c) fill(r[c], kLanes, 0.0f);
}

template <int D>
void search(const Instruction& i, Registers r) {
    Search s;
    const auto feature = VoronoiFeature((i.variant >> 2) & 7);
    const bool by_metric = feature == VoronoiFeature::F1 || feature == VoronoiFeature::F2 || feature == VoronoiFeature::SmoothF1;
    s.metric = by_metric ? VoronoiMetric((i.variant >> 5) & 3) : VoronoiMetric::Euclidean;
    s.integer_hash = (i.data & kVoronoiIntegerHash) != 0;
    s.color = (i.data & kVoronoiNoColor) == 0;
    s.position = (i.data & kVoronoiNoPosition) == 0;
    s.exponent = r[13];
    TALBOT_SHORT_LOOP
    for (int k = 0; k < kLanes; ++k) s.randomness[k] = saturate(r[14][k]);
    for (int c = 0; c < D; ++c) {
        ConstColumn in = r[8 + (D == 1 ? 3 : c)];  // the line uses its fourth coordinate
        Column cell = s.cell.c[c], place = s.place.c[c];
        TALBOT_SHORT_LOOP
        for (int k = 0; k < kLanes; ++k) {
            const float x = lane_abs(in[k]) < 1e30f ? in[k] : 0.0f;
            cell[k] = lane_floor(x);
            place[k] = x - cell[k];
        }
    }
    const Measured measured = measured_by(D, s.metric, feature == VoronoiFeature::SmoothF1);
    if (s.integer_hash)
        choose_loops<D, true>(s, measured);
    else
        choose_loops<D, false>(s, measured);
    switch (feature) {
        case VoronoiFeature::F1:
            return nearest<D>(s, r);
        case VoronoiFeature::F2:
            return second_nearest<D>(s, r);
        case VoronoiFeature::SmoothF1:
            return smooth<D>(s, r[12], r);
        case VoronoiFeature::DistanceToEdge:
            return distance_to_edge<D>(s, r);
        case VoronoiFeature::NSphereRadius:
            return sphere_radius<D>(s, r);
    }
}

}  // namespace

void op_voronoi(const Instruction& i, Registers r, int n) {
    constexpr void (*kSearches[])(const Instruction&, Registers) = {search<1>, search<2>, search<3>, search<4>};
    for (int first = 0; first < n; first += kLanes) {
        float* chunk[15];
        for (int c = 0; c < 15; ++c) chunk[c] = r[c] + first;
        kSearches[i.variant & 3](i, chunk);
    }
}

}  // namespace TALBOT_ISA
}  // namespace talbot::shader
