// Single scattering of sunlight by air and aerosols, with absorption by ozone, at 21 wavelengths [Nishita et al. 1993].
#include <array>
#include <cmath>

#include "shader/sky.h"

namespace talbot::shader {
namespace {

constexpr int kWaves = 21;  // 380 to 780 nm in steps of 20 nm
constexpr float kEarth = 6360e3f, kTop = 6420e3f;
constexpr float kRayleighHeight = 8e3f, kMieHeight = 1.2e3f;  // in which the density falls to 1/e
constexpr float kMieScatter = 2e-5f, kMieExtinct = 1.11f * kMieScatter, kMieG = 0.76f;
constexpr int kSteps = 32;

/// Absorption by ozone at its densest, 1/m.
constexpr float kOzone[kWaves] = {3.25127e-9f,    5.85395e-9f,   1.977191e-8f,   7.309569e-8f,   2.0084562e-7f, 4.0383958e-7f,  6.3551335e-7f,
                                  9.6707041e-7f,  1.547974e-6f,  2.09038647e-6f, 2.46128056e-6f, 2.735513e-6f,  2.15125863e-6f, 1.59051841e-6f,
                                  1.12356198e-6f, 7.3527551e-7f, 4.645013e-7f,   3.309608e-7f,   2.2512612e-7f, 1.487913e-7f,   1.6828623e-7f};

/// Gauss-Laguerre nodes and weights (n = 8), the interval cut at 25 and scaled to 1, exp(x) multiplied into the weights: air thins out
/// exponentially along a ray that leaves it.
constexpr int kNodes = 8;
constexpr float kNode[kNodes] = {0.006811185f, 0.03614807f, 0.09004346f, 0.1706680f, 0.2818362f, 0.4303406f, 0.6296271f, 0.9145253f};
constexpr float kWeight[kNodes] = {0.01750894f, 0.04135477f, 0.06678839f, 0.09507699f, 0.1283416f, 0.1707430f, 0.2327233f, 0.3562490f};

/// Amounts of air, aerosol and ozone, in metres at full density.
struct Depth {
    float air = 0, aerosol = 0, ozone = 0;
};

Depth density_at(float height) {
    return {std::exp(-height / kRayleighHeight), std::exp(-height / kMieHeight), std::fmax(0.0f, 1.0f - std::fabs(height - 25000.0f) / 15000.0f)};
}

/// Wavelength-dependent constants, made once a table.
struct Spectrum {
    std::array<float, kWaves> sun, rayleigh;
    std::array<Rgb, kWaves> color;  ///< of one unit of spectral radiance over the wavelength's band
    explicit Spectrum(Rec709 matrix) {
        for (int i = 0; i < kWaves; ++i) {
            const double nm = 380 + 20 * i, metres = nm * 1e-9;
            // The sun as a black body of 5778 K seen under its solid angle, W / (m2 nm); Rayleigh's law.
            constexpr double h = 6.62607e-34, c = 2.99792458e8, k = 1.380649e-23;
            const double radiance = 2 * h * c * c / (std::pow(metres, 5) * std::expm1(h * c / (metres * k * kSunKelvin)));
            sun[size_t(i)] = float(radiance * kSunSolidAngle * 1e-9);
            rayleigh[size_t(i)] = float(kRayleigh380 * std::pow(380.0 / nm, 4));
            color[size_t(i)] = observer_color(int(nm), matrix) * 20.0f;
        }
    }
    static constexpr double kSunKelvin = 5778, kSunSolidAngle = 6.790164e-5, kRayleigh380 = 5.424820088e-5;
};

/// Amounts along the ray to the sun from a point at `radius` from the Earth's centre, `cosine` of the angle between zenith and sun.
Depth depth_to_space(float radius, float cosine) {
    const float b = radius * cosine;
    const float length = -b + std::sqrt(b * b + kTop * kTop - radius * radius);
    Depth sum;
    for (int i = 0; i < kNodes; ++i) {
        const float t = kNode[i] * length;
        const Depth d = density_at(std::sqrt(radius * radius + t * (t + 2 * b)) - kEarth);
        sum.air += d.air * kWeight[i];
        sum.aerosol += d.aerosol * kWeight[i];
        sum.ozone += d.ozone * kWeight[i];
    }
    return {sum.air * length, sum.aerosol * length, sum.ozone * length};
}

float viewer_altitude(const SkyAir& air) {
    return std::fmin(std::fmax(air.altitude, 1.0f), 59999.0f);
}

/// What one elevation of view shares over all azimuths.
struct Row {
    std::array<float, kSteps> x, z;  ///< the point, from the Earth's centre, along the azimuth of view and up
    std::array<Depth, kSteps> density, passed;
    float step = 0;
};

Row march(const SkyAir& air, float elevation) {
    Row row;
    const float c = std::cos(elevation), s = std::sin(elevation), r0 = kEarth + viewer_altitude(air);
    const float b = r0 * s;
    row.step = (-b + std::sqrt(b * b + kTop * kTop - r0 * r0)) / float(kSteps);
    Depth passed;
    for (size_t i = 0; i < kSteps; ++i) {
        const float t = (float(i) + 0.5f) * row.step;
        row.x[i] = t * c;
        row.z[i] = r0 + t * s;
        Depth d = density_at(std::sqrt(row.x[i] * row.x[i] + row.z[i] * row.z[i]) - kEarth);
        d = {d.air * air.air, d.aerosol * air.aerosol, d.ozone * air.ozone};
        passed = {passed.air + d.air * row.step, passed.aerosol + d.aerosol * row.step, passed.ozone + d.ozone * row.step};
        row.density[i] = d;
        row.passed[i] = passed;
    }
    return row;
}

Rgb radiance_along(const SkyAir& air, const Spectrum& spectrum, const Row& row, Vec3 view, Vec3 sun, float horizontal) {
    const float mu = dot(view, sun), g2 = kMieG * kMieG;
    const float rayleigh_phase = float(3 / (16 * M_PI)) * (1 + mu * mu);
    const float mie_phase = 3 * (1 - g2) * (1 + mu * mu) / (float(8 * M_PI) * (2 + g2) * std::pow(1 + g2 - 2 * kMieG * mu, 1.5f));
    std::array<float, kWaves> sum{};
    for (size_t i = 0; i < kSteps; ++i) {
        const float radius = std::sqrt(row.x[i] * row.x[i] + row.z[i] * row.z[i]);
        const float toward = row.x[i] * horizontal + row.z[i] * sun.z;  // P . sun
        // In the Earth's shadow nothing is scattered.
        if (sun.z < 0 && toward * toward >= radius * radius - kEarth * kEarth) continue;
        const Depth light = depth_to_space(radius, toward / radius);
        const float a = row.passed[i].air + light.air * air.air;
        const float m = (row.passed[i].aerosol + light.aerosol * air.aerosol) * kMieExtinct;
        const float o = row.passed[i].ozone + light.ozone * air.ozone;
        const float scatter_air = rayleigh_phase * row.density[i].air, scatter_mie = mie_phase * row.density[i].aerosol * kMieScatter;
        for (size_t w = 0; w < kWaves; ++w)
            sum[w] += std::exp(-(a * spectrum.rayleigh[w] + m + o * kOzone[w])) * (scatter_air * spectrum.rayleigh[w] + scatter_mie);
    }
    Rgb out;
    for (size_t w = 0; w < kWaves; ++w) out = out + spectrum.color[w] * (sum[w] * spectrum.sun[w] * row.step);
    return out;
}

}  // namespace

std::vector<float> single_scattering_table(const SkyAir& air) {
    const int height = air.full_dome ? kSkyHeight : kSkyHalfHeight;
    const Spectrum spectrum(air.matrix);
    const Vec3 sun{std::cos(air.elevation), 0, std::sin(air.elevation)};
    std::vector<float> table(size_t(3 * kSkyWidth) * size_t(height));
    for (int y = 0; y < height; ++y) {
        const float v = air.full_dome ? float(y) / float(kSkyHalfHeight) - 1 : float(y) / float(kSkyHalfHeight);
        const float quarter = float(M_PI_2) * (air.full_dome ? 1.0f : 1.0f + 0.5f / float(kSkyHalfHeight));
        // The ground has the horizon's colour, fading to black.
        const float elevation = v < 0 ? 0 : quarter * v * v;
        const float fade = v < 0 ? std::fmax(1 - 2.5f * std::sin(quarter * v * v), 0.0f) : 1;
        const Row row = march(air, elevation);
        for (int x = 0; x < kSkyWidth / 2; ++x) {
            const float azimuth = float(2 * M_PI) * float(x) / float(kSkyWidth) - float(M_PI);
            const Vec3 view{std::cos(elevation) * std::cos(azimuth), std::cos(elevation) * std::sin(azimuth), std::sin(elevation)};
            const Rgb c = radiance_along(air, spectrum, row, view, sun, std::cos(azimuth) * sun.x) * (fade * fade * fade);
            store_mirrored(table, x, y, c);
        }
    }
    return table;
}

Rgb single_scattering_sun(const SkyAir& air, float elevation, float solid_angle) {
    const Spectrum spectrum(air.matrix);
    const Depth depth = depth_to_space(kEarth + viewer_altitude(air), std::sin(elevation));
    Rgb out;
    for (size_t w = 0; w < kWaves; ++w) {
        // Cycles leaves ozone out of the sun's disc.
        const float passed = std::exp(-(spectrum.rayleigh[w] * depth.air * air.air + kMieExtinct * depth.aerosol * air.aerosol));
        out = out + spectrum.color[w] * (spectrum.sun[w] * passed / solid_angle);
    }
    return out;
}

}  // namespace talbot::shader
