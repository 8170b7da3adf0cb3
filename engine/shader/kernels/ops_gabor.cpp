// Gabor noise in 2 and 3 dimensions: a sum of wave packets of random sign at random places [Lagae, Lefebvre, Drettakis & Dutré 2009, "Procedural
// Noise using Sparse Gabor Convolution"], eight to a cell, windowed, normalised [Tavernier, Neyret, Vergne & Thollot 2019, "Making Gabor Noise Fast and
// Normalized"], and complex, for phase and intensity [Tricard, Efremov, Zanni, Neyret, Martínez & Lefebvre 2019, "Procedural Phasor Noise"].
//
// A packet reaches no farther than 1, a third (2D) or a sixth (3D) of those in the 3^D cells around a point: one loop over the lanes finds who is
// reached by a packet, another, over the list of these pairs, evaluates them. The pairs of a lane stay in order, so its sum does not
// depend on the other lanes.
#include "base/hash.h"
#include "shader/kernels/ops.h"

namespace talbot::shader {
inline namespace TALBOT_ISA {
namespace {

constexpr int kPacketsPerCell = 8;
constexpr int kPairs = 4 * kSpan;

struct Lanes {
    int n = 0;
    float cell[3][kSpan], local[3][kSpan];
    float frequency[kSpan], isotropy[kSpan];
    float wave[3][kSpan];                      ///< frequency times the direction of waves without isotropy
    float inclination[kSpan], azimuth[kSpan];  ///< that direction in angles (2D: azimuth only)
    float re[kSpan], im[kSpan];                ///< the sum so far
    bool isotropic = false;                    ///< of any lane
};

struct Pairs {
    int count = 0;
    int32_t lane[kPairs];
    float cell[3][kPairs];
    float packet[kPairs];     ///< three times its number in the cell: the first of its hash seeds
    float offset[3][kPairs];  ///< from the packet's centre to the point
    float wave[3][kPairs];
    float re[kPairs], im[kPairs];
};

/// A packet's random number; each packet owns three seeds.
template <int D>
TALBOT_INLINE float packet_hash(float x, float y, float z, float seed) {
    if constexpr (D == 2) return unit_hash(x, y, seed);
    return unit_hash(x, y, z, seed);
}

/// Another one of the same seed, and (3D) a third.
template <int D>
TALBOT_INLINE float packet_hash_2(float x, float y, float z, float seed) {
    if constexpr (D == 2) return unit_hash(seed, x, y);
    return unit_hash(z, x, seed, y);
}
TALBOT_INLINE float packet_hash_3(float x, float y, float z, float seed) {
    return unit_hash(seed, z, y, x);
}

/// Places of the points relative to the centre of one packet of the cells `step` away, and who is within its reach.
template <int D>
void find_reached(const Lanes& s, const float* step, float packet, float (*offset)[kSpan], uint8_t* __restrict reached) {
    ConstColumn cx = s.cell[0], cy = s.cell[1], cz = s.cell[2], px = s.local[0], py = s.local[1], pz = s.local[2];
    Column ox = offset[0], oy = offset[1], oz = offset[2];
    const float sx = step[0], sy = step[1], sz = step[2], seed = packet + 1.0f;
    alignas(64) float distance_column[kSpan];
    Column distance = distance_column;
    TALBOT_VECTOR_LOOP
    for (int k = 0; k < s.n; ++k) {
        const float x = cx[k] + sx, y = cy[k] + sy, z = cz[k] + sz;
        const float dx = px[k] - sx - packet_hash<D>(x, y, z, seed), dy = py[k] - sy - packet_hash_2<D>(x, y, z, seed);
        ox[k] = dx;
        oy[k] = dy;
        float d2 = dx * dx + dy * dy;
        if constexpr (D == 3) {
            const float dz = pz[k] - sz - packet_hash_3(x, y, z, seed);
            oz[k] = dz;
            d2 += dz * dz;
        }
        distance[k] = d2;
    }
    for (int k = 0; k < s.n; ++k) reached[k] = distance[k] < 1.0f;
}

/// Turns each packet's waves by random angles, as far as the lane is isotropic. Half a turn is enough: waves have no front.
template <int D>
void turn_waves(const Lanes& s, Pairs& p, int n) {
    alignas(64) float column[4][kPairs];
    gather(s.isotropy, p.lane, n, column[0]);
    gather(s.frequency, p.lane, n, column[1]);
    gather(s.azimuth, p.lane, n, column[2]);
    if constexpr (D == 3) gather(s.inclination, p.lane, n, column[3]);
    ConstColumn isotropy = column[0], frequency = column[1], azimuth = column[2], inclination = column[3];
    ConstColumn cx = p.cell[0], cy = p.cell[1], cz = p.cell[2], seed = p.packet;
    Column wx = p.wave[0], wy = p.wave[1], wz = p.wave[2];
    TALBOT_VECTOR_LOOP
    for (int k = 0; k < n; ++k) {
        const float first = packet_hash<D>(cx[k], cy[k], cz[k], seed[k]);
        const bool turned = isotropy[k] != 0.0f;
        const float t = kPi * isotropy[k], f = frequency[k];
        float s_azimuth, c_azimuth;
        if constexpr (D == 2) {
            lane_sincos(azimuth[k] + (first - 0.5f) * t, s_azimuth, c_azimuth);
            const float x = c_azimuth * f, y = s_azimuth * f;
            wx[k] = turned ? x : wx[k];
            wy[k] = turned ? y : wy[k];
        } else {
            const float second = packet_hash_2<3>(cx[k], cy[k], cz[k], seed[k]);
            float s_inclination, c_inclination;
            lane_sincos(inclination[k] + first * t, s_inclination, c_inclination);
            lane_sincos(azimuth[k] + second * t, s_azimuth, c_azimuth);
            const float x = s_inclination * c_azimuth * f, y = s_inclination * s_azimuth * f, z = c_inclination * f;
            wx[k] = turned ? x : wx[k];
            wy[k] = turned ? y : wy[k];
            wz[k] = turned ? z : wz[k];
        }
    }
}

/// Gaussian, made to end at 1 by Hann's window, times the complex wave [Lagae et al. 2009, eq. 6; Tricard et al. 2019, section 3.1.1].
template <int D>
void eval_packets(Pairs& p, int n) {
    ConstColumn cx = p.cell[0], cy = p.cell[1], cz = p.cell[2], packet = p.packet;
    ConstColumn x = p.offset[0], y = p.offset[1], z = p.offset[2], wx = p.wave[0], wy = p.wave[1], wz = p.wave[2];
    Column re = p.re, im = p.im;
    TALBOT_VECTOR_LOOP
    for (int k = 0; k < n; ++k) {
        float d2 = x[k] * x[k] + y[k] * y[k], turns = x[k] * wx[k] + y[k] * wy[k];
        if constexpr (D == 3) {
            d2 += z[k] * z[k];
            turns += z[k] * wz[k];
        }
        const float sign = packet_hash<D>(cx[k], cy[k], cz[k], packet[k] + 2.0f) < 0.5f ? -1.0f : 1.0f;
        const float envelope = sign * lane_exp(-kPi * d2) * (0.5f + 0.5f * lane_cos(kPi * d2));
        float sine, cosine;
        lane_sincos(kTwoPi * turns, sine, cosine);
        re[k] = envelope * cosine;
        im[k] = envelope * sine;
    }
}

/// Adds the listed packets to their lanes and empties the list.
template <int D>
void flush(Lanes& s, Pairs& p) {
    // Up to a whole number of vectors, by copies of the last pair.
    const int n = (p.count + 15) & ~15;
    for (int k = p.count; k < n; ++k) {
        p.lane[k] = p.lane[k - 1];
        p.packet[k] = p.packet[k - 1];
        for (int c = 0; c < D; ++c) {
            p.cell[c][k] = p.cell[c][k - 1];
            p.offset[c][k] = p.offset[c][k - 1];
        }
    }
    for (int c = 0; c < D; ++c) gather(s.wave[c], p.lane, n, p.wave[c]);
    if (s.isotropic) turn_waves<D>(s, p, n);
    eval_packets<D>(p, n);
    for (int k = 0; k < p.count; ++k) {
        s.re[p.lane[k]] += p.re[k];
        s.im[p.lane[k]] += p.im[k];
    }
    p.count = 0;
}

template <int D>
void sum_packets(Lanes& s) {
    Pairs pairs;
    alignas(64) float offset[3][kSpan];
    uint8_t reached[kSpan];
    int32_t index[kSpan];
    fill(s.re, s.n, 0.0f);
    fill(s.im, s.n, 0.0f);
    for (int cell = 0; cell < (D == 2 ? 9 : 27); ++cell) {
        const float step[3] = {float(cell % 3 - 1), float(cell / 3 % 3 - 1), D == 2 ? 0.0f : float(cell / 9 - 1)};
        for (int i = 0; i < kPacketsPerCell; ++i) {
            const float packet = float(3 * i);
            find_reached<D>(s, step, packet, offset, reached);
            const int found = compress(reached, s.n, index);
            if (pairs.count + found > kPairs - 16) flush<D>(s, pairs);
            for (int k = 0; k < found; ++k) {
                const int lane = index[k], at = pairs.count + k;
                pairs.lane[at] = lane;
                pairs.packet[at] = packet;
                for (int c = 0; c < D; ++c) {
                    pairs.cell[c][at] = s.cell[c][lane] + step[c];
                    pairs.offset[c][at] = offset[c][lane];
                }
            }
            pairs.count += found;
        }
    }
    if (pairs.count > 0) flush<D>(s, pairs);
}

}  // namespace

void op_gabor(const Instruction& i, Registers r, int n) {
    Lanes s;
    s.n = n;
    const int dimensions = i.variant;
    for (int c = 0; c < 3; ++c) {
        ConstColumn in = r[3 + c];
        for (int k = 0; k < n; ++k) {
            const float x = c < dimensions && lane_abs(in[k]) < 1e30f ? in[k] : 0.0f;
            const float cell = lane_floor(x);
            s.cell[c][k] = cell;
            s.local[c][k] = x - cell;
        }
    }

    // Frequency vector: the direction is an angle in 2D, a unit vector in 3D.
    ConstColumn frequency = r[6], anisotropy = r[7], ox = r[8], oy = r[9], oz = r[10];
    for (int k = 0; k < n; ++k) {
        const float f = maxf(frequency[k], 0.001f), isotropy = 1.0f - saturate(anisotropy[k]);
        s.frequency[k] = f;
        s.isotropy[k] = isotropy;
        s.isotropic |= isotropy != 0.0f;
        float x = ox[k], y = oy[k], z = oz[k];
        s.inclination[k] = lane_acos(z);
        s.azimuth[k] = dimensions == 2 ? x : lane_atan2(y, x);
        if (dimensions == 2) lane_sincos(ox[k], y, x);
        s.wave[0][k] = f * x;
        s.wave[1][k] = f * y;
        s.wave[2][k] = f * z;
    }
    if (dimensions == 2)
        sum_packets<2>(s);
    else
        sum_packets<3>(s);

    // Six standard deviations [Lagae et al. 2009, eq. 9, at high frequencies; signs count half] make the range 1.
    const float variance = kPacketsPerCell * 0.5f * (dimensions == 2 ? 0.25f : 0.25f / kSqrt2);
    const float scale = 1.0f / (6.0f * std::sqrt(variance));
    Column value = r[0], phase = r[1], intensity = r[2];
    ConstColumn re = s.re, im = s.im;
    TALBOT_VECTOR_LOOP
    for (int k = 0; k < n; ++k) {
        value[k] = 0.5f + 0.5f * scale * im[k];
        phase[k] = (lane_atan2(im[k], re[k]) + kPi) * (0.5f * kInvPi);
        intensity[k] = scale * std::sqrt(re[k] * re[k] + im[k] * im[k]);
    }
}

}  // namespace TALBOT_ISA
}  // namespace talbot::shader
