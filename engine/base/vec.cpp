#include "base/vec.h"

namespace talbot {

Affine inverse(const Affine& t) {
    const auto& m = t.m;
    const double a = m[0][0], b = m[0][1], c = m[0][2], d = m[1][0], e = m[1][1], f = m[1][2], g = m[2][0], h = m[2][1], i = m[2][2];
    const double det = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g);
    const double s = det != 0.0 ? 1.0 / det : 0.0;
    const double r[3][3] = {{(e * i - f * h) * s, (c * h - b * i) * s, (b * f - c * e) * s},
                            {(f * g - d * i) * s, (a * i - c * g) * s, (c * d - a * f) * s},
                            {(d * h - e * g) * s, (b * g - a * h) * s, (a * e - b * d) * s}};
    Affine out;
    for (int row = 0; row < 3; ++row) {
        for (int col = 0; col < 3; ++col) out.m[row][col] = float(r[row][col]);
        out.m[row][3] = float(-(r[row][0] * m[0][3] + r[row][1] * m[1][3] + r[row][2] * m[2][3]));
    }
    return out;
}

Affine compose(const Affine& outer, const Affine& inner) {
    Affine out;
    for (int row = 0; row < 3; ++row) {
        for (int col = 0; col < 4; ++col) {
            out.m[row][col] =
                outer.m[row][0] * inner.m[0][col] + outer.m[row][1] * inner.m[1][col] + outer.m[row][2] * inner.m[2][col] + (col == 3 ? outer.m[row][3] : 0.0f);
        }
    }
    return out;
}

}  // namespace talbot
