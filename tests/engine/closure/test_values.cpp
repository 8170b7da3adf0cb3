/// Closed forms and published figures: albedos, delta lobes, reciprocity, bump shadowing.
#include <gtest/gtest.h>

#include "bench.h"

namespace talbot::test {
namespace {

Vec3 at_cosine(double mu) {
    return {float(std::sqrt(1 - mu * mu)), 0, float(mu)};
}
float reflected(float alpha, double mu, uint8_t variant = 0, int version = 502, std::vector<float> fresnel = {}) {
    Bench bench({"", ClosureType::Microfacet, reflect(alpha, alpha, fresnel), variant, at_cosine(mu), version});
    return bench.scattered(400000).x;
}

// E(mu) of GGX with F = 1, height-correlated; alpha = 1, mu = 1 is 1 - ln 2.
TEST(Microfacet, AlbedoOfGgx) {
    EXPECT_NEAR(reflected(1.0f, 1.0), 1 - std::log(2.0), 2e-3);
    EXPECT_NEAR(reflected(0.5f, 1.0), 0.68784852, 2e-3);
    EXPECT_NEAR(reflected(0.25f, 1.0), 0.91581243, 2e-3);
    EXPECT_NEAR(reflected(0.05f, 1.0), 0.99729587, 1e-3);
    EXPECT_NEAR(reflected(0.5f, 0.6), 0.687836, 2e-3);
    EXPECT_NEAR(reflected(0.5f, 0.2), 0.789929, 2e-3);
    EXPECT_NEAR(reflected(1.0f, 0.2), 0.641648, 2e-3);
    EXPECT_NEAR(reflected(0.1f, 0.1), 0.883477, 2e-3);
}
TEST(Microfacet, AlbedoOfSeparableGgx) {
    EXPECT_NEAR(reflected(0.5f, 0.6, 0, 304), 0.680247, 2e-3);
    EXPECT_NEAR(reflected(0.5f, 0.2, 0, 304), 0.738978, 2e-3);
}
// The figures are for the exact shadowing; Walter's rational approximation is within 0.004.
TEST(Microfacet, AlbedoOfBeckmann) {
    EXPECT_NEAR(reflected(0.5f, 1.0, kBeckmann), 0.943008, 4e-3);
    EXPECT_NEAR(reflected(0.5f, 0.6, kBeckmann), 0.867542, 4e-3);
    EXPECT_NEAR(reflected(0.5f, 0.2, kBeckmann), 0.920963, 4e-3);
}
TEST(Microfacet, AlbedoWithFresnel) {
    const uint8_t dielectric = uint8_t(FresnelKind::Dielectric);
    EXPECT_NEAR(reflected(0.5f, 1.0, dielectric, 502, {1.5f}), 0.0281744, 2e-4);
    EXPECT_NEAR(reflected(0.5f, 0.6, dielectric, 502, {1.5f}), 0.0381715, 3e-4);
    EXPECT_NEAR(reflected(0.5f, 0.2, dielectric, 502, {1.5f}), 0.0778907, 6e-4);
}

// What the colour passes show: about the Fresnel reflectance over the lobe, as if no light were lost between the facets. (As in Cycles, facets
// count as they are seen, not as what they reflect gets out.)
TEST(Microfacet, ColourOfALobeIsTheMeanOfItsFresnel) {
    const uint8_t schlick = uint8_t(FresnelKind::Schlick);
    const std::vector<float> fresnel{1.5f, 0.04f, 0.04f, 0.04f};
    for (const float alpha : {0.04f, 0.25f, 0.64f}) {
        for (const double mu : {0.95, 0.5, 0.2}) {
            Bench bench({"", ClosureType::Microfacet, reflect(alpha, alpha, fresnel), schlick, at_cosine(mu), 502});
            const float expected = reflected(alpha, mu, schlick, 502, fresnel) / reflected(alpha, mu);
            EXPECT_NEAR(bench.albedo().x, expected, 0.07f * expected) << alpha << " " << mu;
        }
    }
}

// Reflectances of a smooth pane of index 1.5, and Brewster's and the critical angle.
// GGX as a mirror whose highlight is a twentieth of a degree wide: 1 minus a squared cosine would be noise.
TEST(Microfacet, SharpHighlightsAreNotRounded) {
    const double alpha = 9e-4;
    Bench bench({"", ClosureType::Microfacet, reflect(float(alpha), float(alpha)), 0, direction(45, 0)});
    std::vector<Vec3> directions;
    for (const double off : {0.0, 0.03, 0.08, 0.2}) {
        directions.push_back(direction(45 + off, 180));
        directions.push_back(direction(45 - off, 180 + off));
    }
    const auto values = bench.eval(directions);
    for (size_t i = 0; i < directions.size(); ++i) {
        const Vec3 a = bench.wo, b = directions[i];
        const double x = double(a.x) + b.x, y = double(a.y) + b.y, z = double(a.z) + b.z;
        const double tan2 = (x * x + y * y) / (z * z), cos2 = 1 / (1 + tan2), q = 1 + tan2 / (alpha * alpha);
        const double expected = 1 / (M_PI * alpha * alpha * cos2 * cos2 * q * q) / (4 * a.z);
        EXPECT_NEAR(values[i].f.x, expected, 2e-3 * expected);
    }
}

TEST(Fresnel, SharpGlass) {
    const double angle[] = {0, 30, 45, 60, 75, 85}, expected[] = {0.04, 0.0415226, 0.0502399, 0.0891867, 0.2530606, 0.6127997};
    for (int i = 0; i < 6; ++i) {
        Bench bench({"", ClosureType::MicrofacetGlass, glass(0, 1.5f), 0, direction(angle[i], 0)});
        double mirror = 0;
        constexpr int kSamples = 100000;
        const double chance = std::max(expected[i], 1.0 / 16);
        for (const Sample& s : bench.sample(kSamples)) {
            ASSERT_TRUE(s.flags & kSampledDelta);
            ASSERT_FALSE(s.flags & kSampledFailed);
            // Reflected or refracted, nothing is lost.
            ASSERT_NEAR(s.weight.x, (s.flags & kSampledTransmit) ? (1 - expected[i]) / (1 - chance) : expected[i] / chance, 1e-4);
            if (s.flags & kSampledTransmit) {
                // Snell
                ASSERT_NEAR(std::sqrt(1 - s.wi.z * s.wi.z), std::sin(angle[i] * M_PI / 180) / 1.5, 1e-4);
                ASSERT_NEAR(s.eta, 1.5f, 1e-6f);
            } else {
                ASSERT_NEAR(s.wi.z, std::cos(angle[i] * M_PI / 180), 1e-5);
                mirror += 1.0 / kSamples;
            }
        }
        EXPECT_NEAR(mirror, chance, 5 * std::sqrt(expected[i] / kSamples));
    }
    // Beyond the critical angle (41.81 degrees) everything is reflected.
    Bench inside({"", ClosureType::MicrofacetGlass, glass(0, 1 / 1.5f), 0, direction(41.9, 0)});
    for (const Sample& s : inside.sample(100)) ASSERT_FALSE(s.flags & (kSampledTransmit | kSampledFailed));
    Bench below({"", ClosureType::MicrofacetRefract, refract(0, 1 / 1.5f), 0, direction(41.7, 0)});
    for (const Sample& s : below.sample(100)) ASSERT_EQ(s.flags & (kSampledTransmit | kSampledFailed), kSampledTransmit);
    Bench beyond({"", ClosureType::MicrofacetRefract, refract(0, 1 / 1.5f), 0, direction(41.9, 0)});
    for (const Sample& s : beyond.sample(100)) ASSERT_TRUE(s.flags & kSampledFailed);
}

TEST(Fresnel, Conductor) {
    // Silver-like n = 0.05, k = 4: R(0) = ((n-1)^2 + k^2) / ((n+1)^2 + k^2).
    Bench bench({"", ClosureType::Microfacet, reflect(0, 0, {0.05f, 0.05f, 1.5f, 4, 4, 0}), uint8_t(FresnelKind::Conductor)});
    const Rgb r = bench.sample(1)[0].weight;
    EXPECT_NEAR(r.x, (0.95 * 0.95 + 16) / (1.05 * 1.05 + 16), 1e-5);
    EXPECT_NEAR(r.z, 0.04, 1e-5);  // without absorption: a dielectric
}

TEST(Diffuse, WhiteScattersEverything) {
    for (const double theta : {0.0, 35.0, 80.0}) {
        EXPECT_NEAR(Bench({"", ClosureType::Diffuse, {}, 0, direction(theta, 0)}).scattered(1000).x, 1, 1e-4);
        EXPECT_NEAR(Bench({"", ClosureType::Translucent, {}, 0, direction(theta, 0)}).scattered(1000).x, 1, 1e-4);
        // The multiple-scattering term gives back what the facets keep.
        EXPECT_NEAR(Bench({"", ClosureType::OrenNayar, {1, 1, 1, 1}, 0, direction(theta, 0)}).scattered(200000).x, 1, 3e-3);
    }
}
TEST(Diffuse, TransparentGoesOn) {
    Bench bench({"", ClosureType::Transparent, {}, 0, direction(40, 10)});
    bench.weight = {0.5f, 0.25f, 1};
    const Sample s = bench.sample(1)[0];
    EXPECT_EQ(s.flags, kSampledDelta | kSampledTransmit | kSampledTransparent);
    EXPECT_NEAR(dot(s.wi, bench.wo), -1, 1e-6);
    EXPECT_EQ(s.weight.y, 0.25f);
    EXPECT_EQ(bench.eval({s.wi})[0].f.x, 0.0f);
}
// Burley's diffuse at normal incidence, roughness 0, 1/2, 1.
TEST(Diffuse, Burley) {
    const double expected[] = {0.976190, 1.005952, 1.035714};
    for (int i = 0; i < 3; ++i) EXPECT_NEAR(Bench({"", ClosureType::PrincipledDiffuseV1, {0.5f * i}}).scattered(200000).x, expected[i], 1e-3);
}

// Facets inside a fibre are drawn at random. Hits side by side have draws of their own, or else all of a straight strand's under one sun are wrong together:
// their mean must not depend on the sun's last digits.
TEST(Hair, HitsDrawTheirOwnFacets) {
    const auto mean = [](Vec3 wi) {
        Bench bench({"", ClosureType::HairHuang, huang(0.5f, 1.0f, 0.05f), 0, direction(10, 0)});
        double sum = 0;
        constexpr int kHits = 40000;
        for (int i = 0; i < kHits; ++i) {
            bench.normal = direction(30 + 1.0 * i / kHits, 90);
            sum += bench.eval({wi})[0].f.x / kHits;
        }
        return sum;
    };
    const double a = mean(direction(150, 80)), b = mean(direction(150.001, 80)), c = mean(direction(150, 80.001));
    EXPECT_GT(a, 0.0);
    EXPECT_NEAR(a, b, 0.08 * a);
    EXPECT_NEAR(a, c, 0.08 * a);
}

TEST(Reciprocity, HoldsWhereItShould) {
    const Vec3 a = direction(25, 40), b = direction(62, 190);
    for (const Case& c : all_cases()) {
        switch (c.type) {
            case ClosureType::Diffuse:
            case ClosureType::OrenNayar:
            case ClosureType::OrenNayarFujii:
            case ClosureType::Microfacet:
            case ClosureType::AshikhminShirley:
            case ClosureType::AshikhminVelvet:
            case ClosureType::PrincipledDiffuseV1:
            case ClosureType::PrincipledSheenV1:
            case ClosureType::PrincipledClearcoatV1:
                break;
            default:
                continue;
        }
        Case forward = c, backward = c;
        forward.wo = a;
        backward.wo = b;
        const float f = Bench(forward).eval({b})[0].f.x / b.z, g = Bench(backward).eval({a})[0].f.x / a.z;
        EXPECT_NEAR(f, g, 2e-4f * std::max(f, g) + 1e-9f) << c.name;
    }
    // Diffuse light through a leaf, from either side.
    const Vec3 through = direction(150, 200);
    const float front = Bench({"", ClosureType::Translucent, {}, 0, a}).eval({through})[0].f.x / std::fabs(through.z);
    Bench behind({"", ClosureType::Translucent, {}, 0, through});
    behind.normal = behind.ng = behind.ns = {0, 0, -1};
    EXPECT_NEAR(front, behind.eval({a})[0].f.x / a.z, 1e-5f);
    // Radiance through glass, unscaled: f(a, b) |cos b| eta^2-free form obeys f / eta^2 symmetric across the interface.
    for (const float eta : {1.05f, 1.45f, 2.4f, 0.7f}) {
        for (const float alpha : {0.4f, 1.0f}) {
            for (const bool whole : {false, true}) {
                const ClosureType type = whole ? ClosureType::MicrofacetGlass : ClosureType::MicrofacetRefract;
                const Vec3 b_through = eta < 1.1f ? direction(156, 225) : through;
                const float down = Bench({"", type, whole ? glass(alpha, eta) : refract(alpha, eta), 0, a}).eval({b_through})[0].f.x / std::fabs(b_through.z);
                Bench up({"", type, whole ? glass(alpha, 1 / eta) : refract(alpha, 1 / eta), 0, b_through});
                up.normal = up.ng = up.ns = {0, 0, -1};
                const float back = up.eval({a})[0].f.x / a.z;
                EXPECT_GT(down, 1e-4f) << eta << " " << alpha << " " << whole;
                EXPECT_NEAR(down, back * eta * eta, 2e-3f * down) << eta << " " << alpha << " " << whole;
            }
        }
    }
    // Glass seen from one side: its mirror lobe.
    const std::vector<float> params = glass(0.5f, 1.45f);
    const float f = Bench({"", ClosureType::MicrofacetGlass, params, 0, a}).eval({b})[0].f.x / b.z;
    EXPECT_NEAR(f, Bench({"", ClosureType::MicrofacetGlass, params, 0, b}).eval({a})[0].f.x / a.z, 2e-4f * f);
}

TEST(Limits, TinyAlphaIsSharp) {
    const Vec3 wo = direction(30, 0), mirror = direction(30, 180);
    for (const auto& [alpha, version, sharp] : {std::tuple{1e-5f, 502, true}, {1e-4f, 502, false}, {1e-4f, 304, true}, {1e-3f, 304, false}}) {
        Bench bench({"", ClosureType::Microfacet, reflect(alpha, alpha), 0, wo, version});
        EXPECT_EQ((bench.sample(1)[0].flags & kSampledDelta) != 0, sharp) << alpha;
        EXPECT_EQ(bench.eval({mirror})[0].pdf == 0, sharp) << alpha;
    }
}
TEST(Limits, IndexOneLetsLightPassStraight) {
    for (const double view : {0.0, 50.0, 89.0}) {
        for (const float alpha : {0.0f, 0.5f, 1.0f}) {
            for (const bool whole : {true, false}) {
                const ClosureType type = whole ? ClosureType::MicrofacetGlass : ClosureType::MicrofacetRefract;
                Bench bench({"", type, whole ? glass(alpha, 1.0f) : refract(alpha, 1.0f), 0, direction(view, 30)});
                double sum = 0;
                for (const Sample& s : bench.sample(100)) {
                    if (s.flags & kSampledFailed) continue;
                    ASSERT_TRUE(s.flags & kSampledTransmit);
                    ASSERT_NEAR(dot(s.wi, bench.wo), -1, 1e-5);
                    sum += s.weight.x;
                }
                EXPECT_NEAR(sum, 100, 1e-3) << view << " " << alpha << " " << whole;
            }
            Bench mirror({"", ClosureType::Microfacet, reflect(alpha, alpha, {1.0f}), uint8_t(FresnelKind::Dielectric), direction(view, 30)});
            EXPECT_LT(mirror.scattered(100).x, 1e-6f) << view << " " << alpha;
        }
    }
}
// Roughness 0: what is glossy is a mirror or a pane, whatever the distribution, at any angle, and loses nothing.
TEST(Limits, NoRoughnessIsSharp) {
    const struct {
        const char* name;
        ClosureType type;
        std::vector<float> params;
        uint8_t variant = 0;
        int version = 502;
    } cases[] = {
        {"ggx", ClosureType::Microfacet, reflect(0, 0)},
        {"ggx separable", ClosureType::Microfacet, reflect(0, 0), 0, 304},
        {"ggx anisotropic", ClosureType::Microfacet, reflect(0, 1), kAniso},
        {"beckmann", ClosureType::Microfacet, reflect(0, 0), kBeckmann},
        {"ashikhmin-shirley", ClosureType::AshikhminShirley, reflect(0, 0)},
        {"pane", ClosureType::MicrofacetThin, reflect(0, 0)},
    };
    for (const auto& c : cases) {
        for (const double view : {0.0, 45.0, 89.0}) {
            const Vec3 wo = direction(view, 20), mirror = direction(view, 200);
            const Vec3 expected = c.type == ClosureType::MicrofacetThin ? -wo : mirror;
            Bench bench({c.name, c.type, c.params, c.variant, wo, c.version});
            for (const Sample& s : bench.sample(20)) {
                ASSERT_TRUE(s.flags & kSampledDelta) << c.name << " " << view;
                ASSERT_FALSE(s.flags & kSampledFailed) << c.name << " " << view;
                ASSERT_NEAR(length(s.wi - expected), 0, 1e-4) << c.name << " " << view;
                ASSERT_NEAR(s.weight.x, 1, 1e-4) << c.name << " " << view;
            }
            EXPECT_EQ(bench.eval({expected})[0].f.x, 0.0f) << c.name;
        }
    }
}
// Black: no light comes back, by sampling or by evaluating.
TEST(Limits, BlackScattersNothing) {
    std::vector<float> tints = glass(0.3f, 1.45f);
    std::fill(tints.begin() + kGlassReflectionTint, tints.end(), 0.0f);
    std::vector<Case> cases = all_cases();
    for (Case& c : cases) c.name = "no weight";
    cases.push_back({"black glass", ClosureType::MicrofacetGlass, tints, 0, direction(35, 20)});
    cases.push_back({"black huang", ClosureType::HairHuang, huang(0.3f, 1.0f, 1.0f), 0, direction(35, 20)});
    // Lobes R, TT, TRT.
    std::fill(cases.back().params.begin() + 13, cases.back().params.begin() + 16, 0.0f);
    for (const Case& c : cases) {
        Bench bench(c);
        if (c.name == std::string("no weight")) bench.weight = {0, 0, 0};
        EXPECT_EQ(max_component(bench.scattered(200)), 0.0f) << c.name << " " << int(c.type);
        for (const Evaluated& e : bench.eval({direction(20, 200), direction(150, 40), direction(89, 3)}))
            EXPECT_EQ(max_component(e.f), 0.0f) << c.name << " " << int(c.type);
    }
}
TEST(Limits, BlurRaisesAlphaOnly) {
    float ax[2] = {0.01f, 0.5f}, ay[2] = {0.2f, 0.5f}, tangent[2] = {0, 0};
    float* params[] = {ax, ay, tangent, tangent, tangent};
    const float least[2] = {0.1f, 0.1f};
    ClosureSlot slot;
    slot.type = ClosureType::Microfacet;
    closure_blur(slot, params, least, 2);
    EXPECT_EQ(ax[0], 0.1f);
    EXPECT_EQ(ay[0], 0.2f);
    EXPECT_EQ(ax[1], 0.5f);
    EXPECT_EQ(tangent[0], 0.0f);
    slot.type = ClosureType::SheenLtc;
    float rough[2] = {0, 0};
    float* sheen[] = {rough};
    closure_blur(slot, sheen, least, 2);
    EXPECT_EQ(rough[0], 0.0f);
}

// The closure's normal bent 60 degrees away from the smooth one: light from between the horizons is cut.
TEST(Bump, NoLightThroughTheSurface) {
    Bench bench({"", ClosureType::Diffuse, {}});
    bench.normal = direction(60, 0);
    const Vec3 below = direction(100, 0), beside = direction(70, 0), above = direction(5, 180);
    EXPECT_EQ(bench.eval({below})[0].f.x, 0.0f);
    EXPECT_GT(bench.eval({above})[0].f.x, 0.0f);
    const float plain = dot(bench.normal, beside) * kInvPi;
    // Softened before the terminator, by GGX shadowing of the angle to the smooth normal.
    const auto softened = [&] {
        const float alpha2 = std::min(1.0f, 0.125f * (1 / (bench.normal.z * bench.normal.z) - 1)), tan2 = 1 / (beside.z * beside.z) - 1;
        return 2 / (1 + std::sqrt(1 + alpha2 * tan2));
    };
    EXPECT_NEAR(bench.eval({beside})[0].f.x, plain * softened(), 1e-5f);
    bench.bump_correction = false;
    EXPECT_NEAR(bench.eval({beside})[0].f.x, plain, 1e-5f);
    EXPECT_EQ(bench.eval({below})[0].f.x, 0.0f);
    // Before 4.5: g + g^2 - g^3 with g = (ns.wi) / ((n.wi)(ns.n)), diffuse only, and nothing else.
    bench.bump_correction = true;
    bench.version = 304;
    const float g = beside.z / (dot(bench.normal, beside) * bench.normal.z);
    EXPECT_NEAR(bench.eval({beside})[0].f.x, plain * (g + g * g - g * g * g), 1e-5f);
    EXPECT_EQ(bench.eval({below})[0].f.x, 0.0f);
    bench.bump_correction = false;
    EXPECT_EQ(bench.eval({below})[0].f.x, 0.0f);
    // Glossy lobes are cut from 5.0 on.
    for (const auto& [version, cut] : {std::pair{502, true}, {405, false}, {304, false}}) {
        Bench glossy({"", ClosureType::Microfacet, reflect(0.5f, 0.5f, {}), 0, bench.normal, version});
        glossy.normal = bench.normal;
        EXPECT_EQ(glossy.eval({below})[0].f.x == 0.0f, cut) << version;
    }
    Bench flat({"", ClosureType::Diffuse, {}});
    EXPECT_NEAR(flat.eval({above})[0].f.x, above.z * kInvPi, 1e-6f);
}
TEST(Bump, SamplesBelowTheRealSurfaceAreLost) {
    Bench bench({"", ClosureType::Diffuse, {}});
    bench.normal = direction(60, 0);
    int lost = 0;
    for (const Sample& s : bench.sample(1000)) {
        lost += (s.flags & kSampledFailed) != 0;
        if (!(s.flags & kSampledFailed)) {
            ASSERT_GT(s.wi.z, 0.0f);
        }
    }
    EXPECT_GT(lost, 100);
}

}  // namespace
}  // namespace talbot::test
