/// Directional albedos of GGX lobes, for energy compensation and for layering. Made by make_albedo_tables.py (deterministic
/// integration of single scattering, height-correlated shadowing) and compiled in, because making them takes seconds and every Principled BSDF needs them.
///
/// Axes: roughness r = sqrt(alpha), cosine c, x = sqrt(|n - 1| / (n + 1)) for the index, all over 0..1: the
/// nodes that Cycles' tables have, so that what lies between them is off in the same way. Cosine fastest.
#pragma once

#include "base/vec.h"

namespace talbot {

inline constexpr int kAlbedoFine = 32, kAlbedoCoarse = 16;

extern const float kGgxAlbedo[kAlbedoFine * kAlbedoFine];                            ///< [r][c]: reflection with F = 1
extern const float kGgxAverage[kAlbedoFine];                                         ///< [r]: 2 integral E mu dmu
extern const float kFresnelPosition[kAlbedoCoarse * kAlbedoCoarse * kAlbedoCoarse];  ///< [x][r][c]: mean_fresnel_position()
extern const float kGlassAlbedo[2 * kAlbedoCoarse * kAlbedoCoarse * kAlbedoCoarse];  ///< [inside][x][r][c]: reflection and refraction together
extern const float kGlassAverage[2 * kAlbedoCoarse * kAlbedoCoarse];                 ///< [inside][x][r]

struct TableCell {
    int32_t index;
    float fraction;
};
TALBOT_INLINE TableCell table_cell(float x, int nodes) {
    const float at = saturate(x) * float(nodes - 1);
    const int32_t i = int32_t(minf(at, float(nodes) - 1.001f));
    return {i, at - float(i)};
}

/// Bilinear; `first` is the table's offset. Plain indices, so that loops over lanes can gather.
TALBOT_INLINE float table_2d(const float* table, int32_t first, TableCell a, TableCell b, int nodes) {
    const int32_t i = first + a.index * nodes + b.index, j = i + nodes;
    return lerp(lerp(table[i], table[i + 1], b.fraction), lerp(table[j], table[j + 1], b.fraction), a.fraction);
}
/// Trilinear in a table of kAlbedoCoarse cubed.
TALBOT_INLINE float table_3d(const float* table, int32_t first, TableCell x, TableCell r, TableCell t) {
    constexpr int kPlane = kAlbedoCoarse * kAlbedoCoarse;
    const int32_t plane = first + x.index * kPlane;
    return lerp(table_2d(table, plane, r, t, kAlbedoCoarse), table_2d(table, plane + kPlane, r, t, kAlbedoCoarse), x.fraction);
}

/// Albedo of GGX reflection without Fresnel, and its cosine-weighted average.
TALBOT_INLINE float ggx_albedo(float rough, float cosine) {
    return table_2d(kGgxAlbedo, 0, table_cell(rough, kAlbedoFine), table_cell(cosine, kAlbedoFine), kAlbedoFine);
}
TALBOT_INLINE float ggx_average(float rough) {
    const TableCell c = table_cell(rough, kAlbedoFine);
    return lerp(kGgxAverage[c.index], kGgxAverage[c.index + 1], c.fraction);
}

TALBOT_INLINE float index_coordinate(float eta) {
    return safe_sqrt(std::fabs(eta - 1.0f) / (eta + 1.0f));
}
/// Mean over the visible facets of (F - F0) / (1 - F0), the position on the dielectric Fresnel curve, counted as 0 where the facet
/// reflects below the horizon: what is reflected at all has the colour lerp(F0, 1, position). Indices below 1 count as their reciprocals.
TALBOT_INLINE float mean_fresnel_position(float rough, float cosine, float eta) {
    const TableCell x = table_cell(index_coordinate(eta), kAlbedoCoarse), r = table_cell(rough, kAlbedoCoarse), c = table_cell(cosine, kAlbedoCoarse);
    return table_3d(kFresnelPosition, 0, x, r, c);
}

/// Albedo of rough glass seen from the side of index 1 to eta, and its average. Facets near the critical angle bend light back to the side it came from,
/// where it is lost; it counts here as in Cycles, so that rough glass seen from inside at a grazing angle does lose some.
TALBOT_INLINE float glass_albedo(float rough, float cosine, float eta) {
    const TableCell x = table_cell(index_coordinate(eta), kAlbedoCoarse), r = table_cell(rough, kAlbedoCoarse), c = table_cell(cosine, kAlbedoCoarse);
    const int32_t side = eta < 1.0f ? kAlbedoCoarse * kAlbedoCoarse * kAlbedoCoarse : 0;
    return table_3d(kGlassAlbedo, side, x, r, c);
}
TALBOT_INLINE float glass_average(float rough, float eta) {
    const int32_t side = eta < 1.0f ? kAlbedoCoarse * kAlbedoCoarse : 0;
    return table_2d(kGlassAverage, side, table_cell(index_coordinate(eta), kAlbedoCoarse), table_cell(rough, kAlbedoCoarse), kAlbedoCoarse);
}

/// What several bounces between the facets add: the single-scattering lobe times 1 + Fms (1 - E) / E, Fms = Fss A / (1 - Fss (1 - A))
/// [Kulla & Conty 2017, "Revisiting Physically Based Shading at Imageworks"; Turquin 2019, "Practical multiple scattering compensation for
/// microfacet models"]. fss: average reflectance of one bounce; A: chance that a later bounce escapes, the average albedo.
TALBOT_INLINE float multiple_scattering(float fss, float albedo, float escape) {
    const float e = clampf(albedo, 0.02f, 1.0f);
    const float fms = fss * escape / maxf(1.0f - fss * (1.0f - escape), 1e-4f);
    return 1.0f + fms * (1.0f - e) / e;
}

}  // namespace talbot
