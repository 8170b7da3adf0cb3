// Sky with multiple scattering, at 630, 560, 490 and 430 nm; those four stand for the spectrum [Garcia Linan 2024]. Kilometres.
#include <algorithm>
#include <array>
#include <cmath>

#include "shader/sky.h"

namespace talbot::shader {
namespace {

constexpr float kPiF = float(M_PI);
constexpr float kEarth = 6371, kThickness = 100, kTop = kEarth + kThickness;
constexpr float kGroundAlbedo = 0.3f;
constexpr float kAerosolG = 0.8f;
constexpr int kViewSteps = 64, kSunSteps = 64;

struct Four {
    float v[4] = {0, 0, 0, 0};
};
template <class F>
Four each(F f) {
    return {{f(0), f(1), f(2), f(3)}};
}

constexpr Four kSun{{1.679f, 1.828f, 1.986f, 1.307f}};                     // W / (m2 nm) above the air
constexpr Four kAirScatter{{6.605e-3f, 1.067e-2f, 1.842e-2f, 3.156e-2f}};  // at sea level, 1/km
constexpr Four kOzoneSection{{3.472e-25f, 3.914e-25f, 1.349e-25f, 11.03e-27f}};
constexpr Four kAerosolAbsorption{{2.8722e-24f, 4.6168e-24f, 7.9706e-24f, 1.3578e-23f}};
constexpr Four kAerosolScatter{{1.5908e-22f, 1.7711e-22f, 2.0942e-22f, 2.4033e-22f}};
constexpr float kOzoneDobson = 334.5f, kAerosolDensity = 1.3681e20f, kAerosolBackground = 2e6f, kAerosolHeight = 0.73f;
/// Light that was scattered more than once between the ground and space, of the sun's: fitted to path-traced skies.
constexpr Four kMultiple{{0.02f * 0.217f, 0.02f * 0.347f, 0.02f * 0.594f, 0.02f}};

Rgb color_of(const Four& l, Rec709 matrix) {
    static constexpr double kX[4] = {53.386917738564668, 43.904844466369358, 1.6137278251608962, 20.762668673810577};
    static constexpr double kY[4] = {22.981337506691025, 71.347795700053394, 18.422960591455485, 2.3614213523314368};
    static constexpr double kZ[4] = {0, 0.10250686796574131, 31.742921188390806, 110.48009643252140};
    double xyz[3] = {0, 0, 0};
    for (int i = 0; i < 4; ++i) {
        xyz[0] += kX[i] * double(l.v[i]);
        xyz[1] += kY[i] * double(l.v[i]);
        xyz[2] += kZ[i] * double(l.v[i]);
    }
    return xyz_to_rec709(xyz[0], xyz[1], xyz[2], matrix);
}

/// Coefficients at a height, 1/km.
struct Medium {
    Four air_scatter, aerosol_scatter, extinction;
};

Medium medium_at(const SkyAir& air, float height) {
    const float h = std::fmax(height, 0.0f);
    const float molecules = std::exp(-0.07771971f * std::pow(h, 1.16364243f)) * air.air;
    const float log_h = std::log(std::fmax(h, 1e-4f)), off = log_h - 3.22261f;
    const float ozone = kOzoneDobson * 3.78547397e20f * std::exp(-off * off * 5.55555555f - log_h) * air.ozone;
    const float aerosol = kAerosolDensity * (std::exp(-h / kAerosolHeight) + kAerosolBackground / kAerosolDensity) * air.aerosol;
    Medium m;
    m.air_scatter = each([&](int i) { return kAirScatter.v[i] * molecules; });
    m.aerosol_scatter = each([&](int i) { return kAerosolScatter.v[i] * aerosol; });
    m.extinction = each([&](int i) { return m.air_scatter.v[i] + m.aerosol_scatter.v[i] + kAerosolAbsorption.v[i] * aerosol + kOzoneSection.v[i] * ozone; });
    return m;
}

/// Distance to a sphere about the Earth's centre from radius r at this cosine to the zenith; negative: missed.
float distance_to(float sphere, float r, float cosine) {
    const float b = r * cosine, c = r * r - sphere * sphere;
    const float d = b * b - c;
    if ((c > 0 && b > 0) || d < 0) return -1;
    return c <= 0 ? -b + std::sqrt(d) : -b - std::sqrt(d);
}

Four transmittance_to_space(const SkyAir& air, float height, float cosine) {
    const float r = kEarth + height, step = distance_to(kTop, r, cosine) / float(kSunSteps);
    Four depth;
    for (int k = 0; k < kSunSteps; ++k) {
        const float t = (float(k) + 0.5f) * step;
        const Medium m = medium_at(air, std::sqrt(r * r + t * (t + 2 * r * cosine)) - kEarth);
        depth = each([&](int i) { return depth.v[i] + m.extinction.v[i] * step; });
    }
    return each([&](int i) { return std::exp(-depth.v[i]); });
}

/// Transmittance to space by height and cosine to the zenith, and its bilinear lookup.
class SunTable {
public:
    explicit SunTable(const SkyAir& air) : table_(size_t(kColumns * kRows)) {
        for (int y = 0; y < kRows; ++y)
            for (int x = 0; x < kColumns; ++x)
                table_[size_t(y * kColumns + x)] =
                    transmittance_to_space(air, kThickness * float(y) / float(kRows - 1), 2 * float(x) / float(kColumns - 1) - 1);
    }
    Four at(float cosine, float height) const {
        const float x = float(kColumns - 1) * std::fmin(std::fmax(0.5f * cosine + 0.5f, 0.0f), 1.0f);
        const float y = float(kRows - 1) * std::fmin(std::fmax(height / kThickness, 0.0f), 1.0f);
        const int x0 = int(x), y0 = int(y), x1 = std::min(x0 + 1, kColumns - 1), y1 = std::min(y0 + 1, kRows - 1);
        const float fx = x - float(x0), fy = y - float(y0);
        const auto cell = [&](int cx, int cy) -> const Four& { return table_[size_t(cy * kColumns + cx)]; };
        const Four &a = cell(x0, y0), &b = cell(x1, y0), &c = cell(x0, y1), &d = cell(x1, y1);
        return each([&](int i) { return (a.v[i] * (1 - fx) + b.v[i] * fx) * (1 - fy) + (c.v[i] * (1 - fx) + d.v[i] * fx) * fy; });
    }

private:
    static constexpr int kColumns = 256, kRows = 64;
    std::vector<Four> table_;
};

/// What one elevation of view shares over all azimuths.
struct RowStep {
    float x, z, radius;  ///< from the Earth's centre, along the azimuth of view and up
    Four passed;         ///< transmittance from the viewer
    Four air, aerosol;   ///< scattered in this step per unit of light
    Four from_ground;    ///< light from the sunlit ground, per transmittance of the sun to the ground and cosine
};

std::array<RowStep, kViewSteps> march(const SkyAir& air, const SunTable& sun, float altitude, float elevation) {
    std::array<RowStep, kViewSteps> steps;
    const float r0 = kEarth + altitude, c = std::cos(elevation), s = std::sin(elevation);
    const float ground = distance_to(kEarth, r0, s);
    const float step = (ground < 0 ? distance_to(kTop, r0, s) : ground) / float(kViewSteps);
    Four passed{{1, 1, 1, 1}};
    for (size_t k = 0; k < kViewSteps; ++k) {
        RowStep& p = steps[k];
        const float t = (float(k) + 0.5f) * step;
        p.x = t * c;
        p.z = r0 + t * s;
        p.radius = std::sqrt(p.x * p.x + p.z * p.z);
        const float height = std::fmax(p.radius - kEarth, 0.0f);
        const Medium m = medium_at(air, height);
        const Four kept = each([&](int i) { return std::exp(-step * m.extinction.v[i]); });
        // Integral over the step of what its constant medium scatters and keeps [Hillaire 2016].
        const Four gain = each([&](int i) { return passed.v[i] * kSun.v[i] * (1 - kept.v[i]) / std::fmax(m.extinction.v[i], 1e-7f); });
        p.air = each([&](int i) { return m.air_scatter.v[i] * gain.v[i]; });
        p.aerosol = each([&](int i) { return m.aerosol_scatter.v[i] * gain.v[i]; });
        const float ratio = kEarth / p.radius;
        const float solid_angle = 2 * kPiF * (1 - std::sqrt(std::fmax(1 - ratio * ratio, 0.0f)));
        const Four up = sun.at(1, 0), above = sun.at(1, height);
        p.from_ground = each([&](int i) { return solid_angle * kGroundAlbedo / (4 * kPiF * kPiF) * up.v[i] / above.v[i]; });
        p.passed = passed;
        passed = each([&](int i) { return passed.v[i] * kept.v[i]; });
    }
    return steps;
}

}  // namespace

std::vector<float> multiple_scattering_table(const SkyAir& air) {
    const float altitude = std::fmin(std::fmax(air.altitude, 1.0f), 99999.0f) / 1000;
    const SunTable sun(air);
    const float sun_up = std::sin(air.elevation), sun_flat = std::cos(air.elevation);
    std::vector<float> table(size_t(3 * kSkyWidth * kSkyHeight));
    for (int y = 0; y < kSkyHeight; ++y) {
        const float l = 2 * (float(y) + 0.5f) / float(kSkyHeight) - 1;
        const float elevation = std::copysign(l * l, l) * 0.5f * kPiF;
        const std::array<RowStep, kViewSteps> row = march(air, sun, altitude, elevation);
        for (int x = 0; x < kSkyWidth / 2; ++x) {
            // The sun stands at half the table's width.
            const float flat = -sun_flat * std::cos(2 * kPiF * (float(x) + 0.5f) / float(kSkyWidth));
            const float mu = -(std::cos(elevation) * flat + std::sin(elevation) * sun_up);
            const float g2 = kAerosolG * kAerosolG, base = 1 + g2 + 2 * kAerosolG * mu;
            const float air_phase = 3 / (16 * kPiF) * (1 + mu * mu), aerosol_phase = (1 - g2) / (4 * kPiF * base * std::sqrt(base));
            Four sum;
            for (const RowStep& p : row) {
                const float cosine = (p.x * flat + p.z * sun_up) / p.radius;
                const Four direct = sun.at(cosine, p.radius - kEarth), to_ground = sun.at(cosine, 0);
                const float bounced = 1 / (1 + 5 * std::exp(-17.92f * cosine));
                sum = each([&](int i) {
                    const float more = kMultiple.v[i] * bounced + p.from_ground.v[i] * to_ground.v[i] * cosine;
                    return sum.v[i] + p.air.v[i] * (air_phase * direct.v[i] + more) + p.aerosol.v[i] * (aerosol_phase * direct.v[i] + more);
                });
            }
            store_mirrored(table, x, y, color_of(sum, air.matrix));
        }
    }
    return table;
}

Rgb multiple_scattering_sun(const SkyAir& air, float elevation, float solid_angle) {
    const float altitude = std::fmin(std::fmax(air.altitude, 1.0f), 99999.0f) / 1000;
    const Four passed = transmittance_to_space(air, altitude, std::sin(elevation));
    return color_of(each([&](int i) { return kSun.v[i] * passed.v[i] / solid_angle; }), air.matrix);
}

}  // namespace talbot::shader
