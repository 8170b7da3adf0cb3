/// The microfiber sheen's linear map and albedo by viewing cosine and roughness, from the table that its authors publish: fits to a
/// volume of fibres with multiple scattering [Zeltner, Burley & Chiang 2022, "Practical Multiple-Scattering Sheen Using Linearly
/// Transformed Cosines"]. Cycles reads the same table.
#pragma once

#include "closure/albedo.h"

namespace talbot {

inline constexpr int kSheenNodes = 32;
extern const float kSheenTable[3 * kSheenNodes * kSheenNodes];  ///< [a, b, albedo][cosine][roughness], both axes over 0..1

/// The map to a plain cosine lobe is (a x + b z, a y, z): x along the viewer's direction laid onto the surface, z the normal.
struct SheenTerms {
    float a, b, albedo;
};

/// cosine: between normal and viewer.
TALBOT_INLINE SheenTerms sheen_terms(float cosine, float roughness) {
    const TableCell c = table_cell(cosine, kSheenNodes), r = table_cell(roughness, kSheenNodes);
    constexpr int kPlane = kSheenNodes * kSheenNodes;
    // The table holds zeros where nothing is scattered: no map, no light.
    return {maxf(table_2d(kSheenTable, 0, c, r, kSheenNodes), 1e-5f), table_2d(kSheenTable, kPlane, c, r, kSheenNodes),
            table_2d(kSheenTable, 2 * kPlane, c, r, kSheenNodes)};
}

}  // namespace talbot
