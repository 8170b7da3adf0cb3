/// Samplers draw what their pdf says (chi-squared), weights are f / pdf, nothing is NaN whatever the parameters.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "bench.h"

namespace talbot::test {
namespace {

constexpr int kRows = 24, kColumns = 48, kFine = 8;

/// Bins of the sphere around `axis`, finer near it: angle = pi (row / rows)^power.
struct Sphere {
    Vec3 x, y, z;
    double power;
    explicit Sphere(Vec3 axis, double p = 2) : z(normalize(axis)), power(p) { make_basis(z, x, y); }
    double angle(double row) const { return M_PI * std::pow(row, power); }
    int bin(Vec3 w) const {
        const double theta = std::atan2(double(length(cross(z, w))), double(dot(z, w)));
        double phi = std::atan2(double(dot(y, w)), double(dot(x, w)));
        if (phi < 0) phi += 2 * M_PI;
        const int row = std::min(int(std::pow(theta / M_PI, 1 / power) * kRows), kRows - 1), column = std::min(int(phi / (2 * M_PI) * kColumns), kColumns - 1);
        return row * kColumns + column;
    }
};

/// Whether a sample may go there. Rough interfaces have values, Cycles' values, on the far side too where no facet can bend light to.
bool is_reached(const Bench& bench, Vec3 wi) {
    const bool refracts = bench.slot.type == ClosureType::MicrofacetRefract, reflects = bench.slot.type == ClosureType::MicrofacetGlass;
    if (wi.z > 0 || !(refracts || reflects)) return true;
    const Vec3 sum = bench.wo + wi * (refracts ? bench.values[5] : bench.values[1]);
    const Vec3 h = sum.z < 0 ? -sum : sum;
    return dot(bench.wo, h) > 0 && dot(wi, h) < 0;
}

/// Integral over every bin (midpoints) of the pdf, where samples may go.
std::vector<double> expected_mass(Bench& bench, const Sphere& sphere) {
    std::vector<Vec3> directions;
    std::vector<double> area;
    for (int r = 0; r < kRows * kFine; ++r) {
        for (int c = 0; c < kColumns * kFine; ++c) {
            const double t0 = double(r) / (kRows * kFine), t1 = double(r + 1) / (kRows * kFine);
            const double a = sphere.angle(t0), b = sphere.angle(t1), middle = 0.5 * (a + b), phi = 2 * M_PI * (c + 0.5) / (kColumns * kFine);
            const double cosine = std::cos(middle), sine = std::sin(middle);
            directions.push_back(normalize(sphere.x * float(sine * std::cos(phi)) + sphere.y * float(sine * std::sin(phi)) + sphere.z * float(cosine)));
            area.push_back(2 * std::sin(middle) * std::sin(0.5 * (b - a)) * 2 * M_PI / (kColumns * kFine));
        }
    }
    const auto values = bench.eval(directions);
    std::vector<double> mass(kRows * kColumns);
    for (int r = 0; r < kRows * kFine; ++r)
        for (int c = 0; c < kColumns * kFine; ++c) {
            const size_t i = size_t(r) * kColumns * kFine + c;
            if (is_reached(bench, directions[i])) mass[r / kFine * kColumns + c / kFine] += values[i].pdf * area[i];
        }
    return mass;
}

/// Bins for a lobe that may be far narrower than its roughness, as where light hardly turns on its way through: around the mean of its samples.
Sphere around_samples(Bench& bench) {
    Vec3 sum{};
    std::vector<Vec3> kept;
    for (const Sample& s : bench.sample(2000, 5))
        if (!(s.flags & kSampledFailed)) kept.push_back(s.wi);
    for (const Vec3 w : kept) sum = sum + w;
    const Vec3 mean = normalize(sum);
    double spread = 0;
    for (const Vec3 w : kept) spread += double(length(w - mean)) / double(kept.size());
    return Sphere(mean, spread < 0.1 ? 5 : 2);
}

/// Standard normal deviate of a chi-squared value (Wilson-Hilferty).
double deviate(double chi2, int freedom) {
    const double k = 2.0 / (9.0 * freedom);
    return (std::cbrt(chi2 / freedom) - (1 - k)) / std::sqrt(k);
}

/// These have values in a part of the directions that they sample.
bool is_strand(ClosureType type) {
    return type == ClosureType::HairReflection || type == ClosureType::HairTransmission;
}

/// Their fibres run along +X.
bool is_hair(ClosureType type) {
    return type == ClosureType::HairChiang || type == ClosureType::HairHuang || is_strand(type);
}

std::vector<Vec3> directions_of(const std::vector<Sample>& samples) {
    std::vector<Vec3> directions;
    for (const Sample& s : samples) directions.push_back(s.wi);
    return directions;
}

/// The fewer the longer a value takes.
int sample_count(const Case& c) {
    return c.type == ClosureType::HairHuang ? 20000 : 200000;
}

class EveryClosure : public testing::TestWithParam<int> {
protected:
    Case current = all_cases()[size_t(GetParam())];
};
INSTANTIATE_TEST_SUITE_P(Cases, EveryClosure, testing::Range(0, int(all_cases().size())), [](const auto& info) {
    std::string name;
    for (const char* c = all_cases()[size_t(info.param)].name; *c; ++c) name += std::isalnum(*c) ? *c : '_';
    return name;
});

TEST_P(EveryClosure, SamplesFollowThePdf) {
    Bench bench(current);
    const Vec3 n{0, 0, 1};
    const bool glossy = bench.slot.type == ClosureType::Microfacet || bench.slot.type == ClosureType::AshikhminShirley ||
                        bench.slot.type == ClosureType::PrincipledClearcoatV1 || bench.slot.type == ClosureType::MicrofacetGlass;
    const Vec3 axis = glossy ? n * (2 * dot(n, current.wo)) - current.wo : bench.slot.type == ClosureType::MicrofacetThin ? -current.wo : n;
    const bool strand = is_strand(current.type);
    // Strands' values end at the horizon: even rows, so that no cell crosses it.
    const Sphere sphere = bench.slot.type == ClosureType::MicrofacetRefract ? around_samples(bench) : Sphere(axis, strand ? 1 : 2);
    const std::vector<double> mass = expected_mass(bench, sphere);
    const int kSamples = sample_count(current);
    std::vector<double> seen(mass.size());
    double failed = 0;
    const std::vector<Sample> samples = bench.sample(kSamples);
    const std::vector<Evaluated> values = strand ? bench.eval(directions_of(samples)) : std::vector<Evaluated>();
    for (size_t i = 0; i < samples.size(); ++i) {
        const bool lost = (samples[i].flags & kSampledFailed) || (strand && values[i].pdf == 0);
        (lost ? failed : seen[size_t(sphere.bin(samples[i].wi))]) += 1;
    }
    // The quadrature's own error, about 1 % of a cell, counts as variance; more where the pdf has an edge inside the sphere.
    const bool edged = bench.slot.type == ClosureType::DiffuseToon || bench.slot.type == ClosureType::GlossyToon || strand;
    const double quadrature = edged ? 0.08 : 0.01;
    double total = 0, chi2 = 0, pooled_expected = 0, pooled_seen = 0;
    int cells = 0;
    for (size_t i = 0; i < mass.size(); ++i) {
        total += mass[i];
        const double expected = mass[i] * kSamples;
        if (expected < 20) {
            pooled_expected += expected;
            pooled_seen += seen[i];
            continue;
        }
        chi2 += (seen[i] - expected) * (seen[i] - expected) / (expected + quadrature * quadrature * expected * expected);
        ++cells;
    }
    EXPECT_LT(total, edged ? 1.02 : 1.008);
    EXPECT_NEAR(failed / kSamples, 1 - total, edged ? 0.02 : 0.008);
    // So do the poles of a fibre, where its density grows without bound.
    EXPECT_NEAR(pooled_seen, pooled_expected, 6 * std::sqrt(pooled_expected + 1) + 0.02 * pooled_expected + (edged ? 0.001 * kSamples : 0));
    ASSERT_GT(cells, 20);
    EXPECT_LT(deviate(chi2, cells - 1), 4.0) << "chi2 " << chi2 << " of " << cells;
}

TEST_P(EveryClosure, WeightIsValueOverPdf) {
    Bench bench(current);
    const auto samples = bench.sample(4000, 7);
    const auto values = bench.eval(directions_of(samples));
    int compared = 0;
    for (size_t i = 0; i < samples.size(); ++i) {
        const Sample& s = samples[i];
        if ((s.flags & kSampledFailed) || (is_strand(current.type) && values[i].pdf == 0)) continue;
        // Directions within rounding of the horizon may fall on either side, and near a fibre's poles the angle around it is lost.
        if (std::fabs(s.wi.z) < 1e-4f || s.pdf < 1e-4f || (is_hair(current.type) && std::fabs(s.wi.x) > 0.99999f)) continue;
        const float scale = 0.01f * s.pdf;
        ASSERT_NEAR(values[i].pdf, s.pdf, scale) << "wi " << s.wi.x << " " << s.wi.y << " " << s.wi.z;
        ASSERT_NEAR(values[i].f.x, s.weight.x * s.pdf, 0.01f * s.weight.x * s.pdf + 1e-6f);
        ASSERT_NEAR(values[i].f.y, s.weight.y * s.pdf, 0.01f * s.weight.y * s.pdf + 1e-6f);
        ASSERT_NEAR(values[i].f.z, s.weight.z * s.pdf, 0.01f * s.weight.z * s.pdf + 1e-6f);
        ++compared;
    }
    EXPECT_GT(compared, 500);
}

TEST_P(EveryClosure, ScattersNoMoreThanItReceives) {
    Bench bench(current);
    // Burley's diffuse is known to create up to 4 % at the front and, where rough, 40 % at grazing angles.
    const float most = current.type != ClosureType::PrincipledDiffuseV1 ? 1.005f : current.wo.z < 0.2f ? 1.41f : 1.06f;
    const Rgb a = bench.scattered(sample_count(current));
    EXPECT_LT(max_component(a), most);
    EXPECT_GT(max_component(a), 0.0f);
}

TEST_P(EveryClosure, AbsurdParametersGiveNumbers) {
    const float inf = std::numeric_limits<float>::infinity(), nan = std::numeric_limits<float>::quiet_NaN();
    const Vec3 views[] = {{0, 0, 1}, {1, 0, 0}, {0.6f, 0, -0.8f}, {0, 0, 0}, direction(89.9999, 3)};
    for (const float bad : {nan, inf, -inf, -1.0f, 0.0f, 1e-20f, 1e20f, 3.0f}) {
        for (const Vec3 view : views) {
            Bench bench(current);
            bench.wo = view;
            for (float& p : bench.values) p = bad;
            const auto samples = bench.sample(64, 3);
            std::vector<Vec3> directions = {{0, 0, 1}, {0, 0, -1}, {1, 0, 0}, direction(30, 0), direction(150, 0), view, -view};
            for (const Sample& s : samples) {
                ASSERT_TRUE(std::isfinite(s.weight.x + s.weight.y + s.weight.z) && std::isfinite(s.pdf)) << bad;
                ASSERT_TRUE(std::isfinite(s.wi.x + s.wi.y + s.wi.z)) << bad;
                ASSERT_TRUE(s.weight.x >= 0 && s.pdf >= 0);
                if (!(s.flags & kSampledFailed)) directions.push_back(s.wi);
            }
            for (const Evaluated& e : bench.eval(directions)) {
                ASSERT_TRUE(std::isfinite(e.f.x + e.f.y + e.f.z) && std::isfinite(e.pdf)) << bad;
                ASSERT_TRUE(e.f.x >= 0 && e.pdf >= 0);
            }
            const Rgb a = bench.albedo();
            ASSERT_TRUE(std::isfinite(a.x + a.y + a.z));
        }
    }
}

}  // namespace
}  // namespace talbot::test
