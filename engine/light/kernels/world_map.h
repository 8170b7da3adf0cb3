/// Sampling the world's importance map: the row by the marginal distribution, the column within it, both by bisection in lockstep
/// over the lanes; stratified random numbers stay stratified.
#pragma once

#include "light/kernels/emission.h"

namespace talbot::light {

/// Index of the interval of `running` (count + 1 entries) that holds u, by lane; `base` is each lane's first entry.
TALBOT_INLINE void find_interval(const float* __restrict running, const int32_t* __restrict base, int count, const float* __restrict u, int n,
                                 int32_t* __restrict found) {
    for (int i = 0; i < n; ++i) found[i] = 0;
    int step = 1;
    while (2 * step < count) step *= 2;
    for (; step > 0; step /= 2) {
        TALBOT_VECTOR_LOOP
        for (int i = 0; i < n; ++i) {
            const int32_t here = found[i], probe = here + step < count ? here + step : here;
            found[i] = running[base[i] + probe] <= u[i] ? probe : here;
        }
    }
}

/// Density per solid angle of the map alone (not times its probability).
TALBOT_INLINE float map_pdf(float density, float sine) {
    return density / maxf(2.0f * kPi * kPi * sine, 1e-12f);
}

TALBOT_INLINE void sample_map(const WorldMap& map, const float* u, const float* v, int n, Columns3 direction, float* pdf) {
    int32_t row[kSpan], column[kSpan], base[kSpan];
    for (int i = 0; i < n; ++i) base[i] = 0;
    find_interval(map.rows, base, map.height, v, n, row);
    for (int i = 0; i < n; ++i) base[i] = row[i] * (map.width + 1);
    find_interval(map.columns, base, map.width, u, n, column);
    const float* __restrict rows = map.rows, * __restrict columns = map.columns, * __restrict density = map.density;
    const int width = map.width;
    const float inv_width = 1.0f / float(map.width), inv_height = 1.0f / float(map.height);
    Column x = direction.x, y = direction.y, z = direction.z, out = pdf;
    TALBOT_VECTOR_LOOP
    for (int i = 0; i < n; ++i) {
        const float r0 = rows[row[i]], r1 = rows[row[i] + 1];
        const float c0 = columns[base[i] + column[i]], c1 = columns[base[i] + column[i] + 1];
        const float fv = clampf((v[i] - r0) / maxf(r1 - r0, 1e-20f), 0.0f, 0.9999999f), fu = clampf((u[i] - c0) / maxf(c1 - c0, 1e-20f), 0.0f, 0.9999999f);
        const float mu = (float(column[i]) + fu) * inv_width, mv = (float(row[i]) + fv) * inv_height;
        float sp, cp, st, ct;
        lane_sincos((mu - 0.5f) * kTwoPi, sp, cp);
        lane_sincos(mv * kPi, st, ct);
        x[i] = st * cp;
        y[i] = st * sp;
        z[i] = ct;
        out[i] = map_pdf(density[row[i] * width + column[i]], st);
    }
}

TALBOT_INLINE void pdf_map(const WorldMap& map, ConstColumns3 direction, int n, float* pdf) {
    const float* __restrict density = map.density;
    const int width = map.width, height = map.height;
    ConstColumn x = direction.x, y = direction.y, z = direction.z;
    Column out = pdf;
    TALBOT_VECTOR_LOOP
    for (int i = 0; i < n; ++i) {
        const float u = lane_atan2(y[i], x[i]) * (0.5f * kInvPi) + 0.5f;
        const float sine = std::sqrt(x[i] * x[i] + y[i] * y[i]);
        const float v = lane_atan2(sine, z[i]) * kInvPi;
        const int32_t cu = int32_t(clampf(u * float(width), 0.0f, float(width - 1))), cv = int32_t(clampf(v * float(height), 0.0f, float(height - 1)));
        out[i] = map_pdf(density[cv * width + cu], sine);
    }
}

/// Density of the disc alone, at `direction`.
TALBOT_INLINE float sun_pdf(const WorldMap& map, Vec3 direction) {
    // By the chord: the cosine of so small an angle has no digits left.
    const Vec3 chord = direction - map.sun;
    return dot(chord, chord) <= 2.0f * map.sun_one_minus_cos ? 0.5f * kInvPi / map.sun_one_minus_cos : 0.0f;
}

/// Sends the lanes whose `u` falls into the disc's share there, and makes `pdf` that of the map and the disc together.
TALBOT_INLINE void sample_sun(const WorldMap& map, const float* u, const float* v, int n, Columns3 direction, float* pdf) {
    for (int i = 0; i < n; ++i) {
        Vec3 d = load(direction, i);
        float whole = pdf[i];
        if (u[i] < map.sun_share) {
            const float drop = u[i] / map.sun_share * map.sun_one_minus_cos, radius = safe_sqrt(drop * (2.0f - drop));
            float sp, cp;
            lane_sincos(v[i] * kTwoPi, sp, cp);
            d = map.sun * (1.0f - drop) + map.sun_x * (radius * cp) + map.sun_y * (radius * sp);
            store(direction, i, d);
            pdf_map(map, {direction.x + i, direction.y + i, direction.z + i}, 1, &whole);
        }
        pdf[i] = (1.0f - map.sun_share) * whole + map.sun_share * sun_pdf(map, d);
    }
}

/// The world as a whole: what light samples draw from, and their density per solid angle.
TALBOT_INLINE void sample_world(const WorldMap& map, const float* u, const float* v, int n, Columns3 direction, float* pdf) {
    if (map.sun_share == 0.0f) return sample_map(map, u, v, n, direction, pdf);
    float rest[kSpan];
    for (int i = 0; i < n; ++i) rest[i] = clampf((u[i] - map.sun_share) / (1.0f - map.sun_share), 0.0f, 0.9999999f);
    sample_map(map, rest, v, n, direction, pdf);
    sample_sun(map, u, v, n, direction, pdf);
}

TALBOT_INLINE void pdf_world(const WorldMap& map, ConstColumns3 direction, int n, float* pdf) {
    pdf_map(map, direction, n, pdf);
    if (map.sun_share == 0.0f) return;
    for (int i = 0; i < n; ++i) pdf[i] = (1.0f - map.sun_share) * pdf[i] + map.sun_share * sun_pdf(map, load(direction, i));
}

}  // namespace talbot::light
