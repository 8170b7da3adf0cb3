// Goniometric tables: intensity by two angles, lane by lane (the tables are small, the angles not evenly spaced).
#include "shader/kernels/ops.h"

namespace talbot::shader {
inline namespace TALBOT_ISA {
namespace {

/// Catmull-Rom between b and c.
TALBOT_INLINE float cubic(float a, float b, float c, float d, float t) {
    return 0.5f * (((d + 3.0f * (b - c) - a) * t + (2.0f * a - 5.0f * b + 4.0f * c - d)) * t + (c - a)) * t + b;
}

/// Interval of `angles` that holds x, and the place in it; -1 when x lies outside.
TALBOT_INLINE int find_angle(const float* angles, int count, float x, float& t) {
    if (!(x >= angles[0]) || !(x < angles[count - 1])) return -1;
    int i = 0;
    while (i + 2 < count && angles[i + 1] <= x) ++i;
    t = (x - angles[i]) / (angles[i + 1] - angles[i]);
    return i;
}

}  // namespace

void op_ies(const Instruction& i, Registers r, int n, const OpScope& s) {
    const float* tables = s.programs.tables.data();
    const auto ends = IesEnds(i.variant);
    for (int k = 0; k < n; ++k) {
        r[0][k] = 0.0f;
        const float* table = tables + as_int(r[3][k]);
        const int rows = int(table[0]), columns = int(table[1]);
        const float *horizontal = table + 2, *vertical = horizontal + rows, *values = vertical + columns;
        float h = 0, v = 0;
        const int row = find_angle(horizontal, rows, r[1][k], h), column = find_angle(vertical, columns, r[2][k], v);
        if (row < 0 || column < 0) continue;
        // Below the pole the table goes on as in a mirror.
        const bool from_pole = vertical[0] <= 0.0f;
        const float stays = ends == IesEnds::Zero ? 0.0f : 1.0f;
        const auto along = [&](int at) {
            const float* line = values + size_t(at) * size_t(columns);
            const float a = column > 0 ? line[column - 1] : from_pole ? line[1] : stays * line[0];
            const float d = column + 2 < columns ? line[column + 2] : stays * line[columns - 1];
            return cubic(a, line[column], line[column + 1], d, v);
        };
        const float b = along(row), c = along(row + 1);
        const float a = row > 0 ? along(row - 1) : ends == IesEnds::Wrap ? along(rows - 2) : stays * b;
        const float d = row + 2 < rows ? along(row + 2) : ends == IesEnds::Wrap ? along(1) : stays * b;
        r[0][k] = maxf(cubic(a, b, c, d, h), 0.0f);
    }
}

}  // namespace TALBOT_ISA
}  // namespace talbot::shader
