/// One closure over lanes, for tests: constant parameters, any directions. N = +Z unless set.
#pragma once

#include <random>
#include <vector>

#include "closure/closure.h"
#include "closure/hair.h"
#include "closure/microfacet.h"

namespace talbot::test {

struct Case {
    const char* name;
    ClosureType type;
    std::vector<float> params;
    uint8_t variant = 0;
    Vec3 wo{0, 0, 1};
    int version = 502;
};

struct Evaluated {
    Rgb f;
    float pdf;
};
struct Sample {
    Vec3 wi;
    Rgb weight;
    float pdf, roughness, eta;
    int flags;
};

/// Direction by angle from +Z and azimuth, degrees.
inline Vec3 direction(double theta, double phi) {
    const double r = M_PI / 180.0;
    return {float(std::sin(theta * r) * std::cos(phi * r)), float(std::sin(theta * r) * std::sin(phi * r)), float(std::cos(theta * r))};
}

class Bench {
public:
    explicit Bench(const Case& c) : wo(c.wo) {
        slot.type = c.type;
        slot.variant = c.variant;
        slot.param_count = uint8_t(c.params.size());
        values = c.params;
        version = c.version;
    }

    std::vector<Evaluated> eval(const std::vector<Vec3>& wi) {
        const int n = int(wi.size());
        fill(n);
        std::vector<float> in[3], f[4];
        for (auto& c : in) c.resize(n);
        for (auto& c : f) c.resize(n);
        for (int i = 0; i < n; ++i) {
            in[0][i] = wi[i].x;
            in[1][i] = wi[i].y;
            in[2][i] = wi[i].z;
        }
        closure_eval(slot, columns(), geometry(), ConstColumns3(in[0].data(), in[1].data(), in[2].data()), n, {f[0].data(), f[1].data(), f[2].data()},
                     f[3].data());
        std::vector<Evaluated> out(n);
        for (int i = 0; i < n; ++i) out[i] = {{f[0][i], f[1][i], f[2][i]}, f[3][i]};
        return out;
    }

    std::vector<Sample> sample(int n, uint32_t seed = 1) {
        fill(n);
        std::mt19937 random(seed);
        std::uniform_real_distribution<float> uniform(0.0f, 0.9999999f);
        std::vector<float> u[3], o[9];
        for (auto& c : u) c.resize(n);
        for (auto& c : o) c.resize(n);
        std::vector<int32_t> flags(n);
        for (int i = 0; i < n; ++i)
            for (auto& c : u) c[i] = uniform(random);
        ClosureSamples s;
        s.wi = {o[0].data(), o[1].data(), o[2].data()};
        s.weight = {o[3].data(), o[4].data(), o[5].data()};
        s.pdf = o[6].data();
        s.roughness = o[7].data();
        s.eta = o[8].data();
        s.flags = flags.data();
        closure_sample(slot, columns(), geometry(), u[0].data(), u[1].data(), u[2].data(), n, s);
        std::vector<Sample> out(n);
        for (int i = 0; i < n; ++i) {
            out[i] = {{o[0][i], o[1][i], o[2][i]}, {o[3][i], o[4][i], o[5][i]}, o[6][i], o[7][i], o[8][i], flags[i]};
        }
        return out;
    }

    Rgb albedo() {
        fill(1);
        float r, g, b;
        closure_albedo(slot, columns(), geometry(), 1, {&r, &g, &b});
        return {r, g, b};
    }

    /// Mean weight: the share of light that is scattered towards wo.
    Rgb scattered(int n, uint32_t seed = 1) {
        double sum[3] = {};
        for (const Sample& s : sample(n, seed)) {
            sum[0] += s.weight.x;
            sum[1] += s.weight.y;
            sum[2] += s.weight.z;
        }
        return {float(sum[0] / n), float(sum[1] / n), float(sum[2] / n)};
    }

    ClosureSlot slot;
    Vec3 wo, normal{0, 0, 1}, ng{0, 0, 1}, ns{0, 0, 1};
    Rgb weight{1, 1, 1};
    std::vector<float> values;
    int version = 502;
    bool bump_correction = true;

private:
    void fill(int n) {
        const float vectors[5][3] = {
            {wo.x, wo.y, wo.z}, {normal.x, normal.y, normal.z}, {ng.x, ng.y, ng.z}, {ns.x, ns.y, ns.z}, {weight.x, weight.y, weight.z}};
        for (int k = 0; k < 5; ++k)
            for (int d = 0; d < 3; ++d) store_[k][d].assign(n, vectors[k][d]);
        params_.assign(values.size(), {});
        for (size_t k = 0; k < values.size(); ++k) params_[k].assign(n, values[k]);
    }
    ConstColumns3 vector(int k) const { return {store_[k][0].data(), store_[k][1].data(), store_[k][2].data()}; }
    ClosureColumns columns() const {
        ClosureColumns c;
        c.normal = vector(1);
        c.weight = vector(4);
        for (size_t k = 0; k < params_.size(); ++k) c.params[k] = params_[k].data();
        return c;
    }
    ClosureGeometry geometry() const {
        ClosureGeometry g;
        g.wo = vector(0);
        g.ng = vector(2);
        g.ns = vector(3);
        g.semantics = closure_semantics_of(version);
        g.bump_correction = bump_correction;
        return g;
    }
    std::vector<float> store_[5][3];
    std::vector<std::vector<float>> params_;
};

// Parameters of the microfacet closures; the tangent is +X.
inline std::vector<float> reflect(float ax, float ay, std::vector<float> fresnel = {}) {
    std::vector<float> p = {ax, ay, 1, 0, 0};
    p.insert(p.end(), fresnel.begin(), fresnel.end());
    return p;
}
inline std::vector<float> refract(float alpha, float ior) {
    return {alpha, alpha, 1, 0, 0, ior};
}
inline std::vector<float> glass(float alpha, float ior) {
    return {alpha, ior, 1, 1, 1, 1, 1, 1, 1, 1, 1};
}
inline std::vector<float> glass_film(float alpha, float ior, float nanometres, float film_ior) {
    return {alpha, ior, 1, 1, 1, 1, 1, 1, 1, 1, 1, nanometres, film_ior};
}
/// Brown fibres along +X.
inline std::vector<float> chiang(float variance, float scale, float primary) {
    return {1, 0, 0, 0.1f, 0.3f, 0.8f, variance, scale, primary, 0.05f, 1.55f};
}
inline std::vector<float> huang(float alpha, float ratio, float coverage) {
    return {1, 0, 0, 0, 0.6f, 0.8f, 0.1f, 0.3f, 0.8f, alpha, 0.05f, 1.55f, ratio, 1, 1, 1, coverage};
}
inline constexpr uint8_t kBeckmann = kVariantBeckmann, kAniso = kVariantAnisotropic;

/// Every closure that scatters, with its corners.
inline std::vector<Case> all_cases() {
    using T = ClosureType;
    const Vec3 front = direction(0, 0), tilted = direction(35, 20), grazing = direction(85, 130);
    const auto kind = [](FresnelKind k) { return uint8_t(k); };
    return {
        {"diffuse", T::Diffuse, {}, 0, tilted},
        {"diffuse grazing", T::Diffuse, {}, 0, grazing},
        {"oren-nayar black", T::OrenNayar, {0.5f, 0, 0, 0}, 0, tilted},
        {"oren-nayar", T::OrenNayar, {0.5f, 0.8f, 0.5f, 0.2f}, 0, tilted},
        {"oren-nayar 1 grazing", T::OrenNayar, {1.0f, 1.0f, 1.0f, 1.0f}, 0, grazing},
        {"fujii", T::OrenNayarFujii, {1.0f}, 0, tilted, 304},
        {"fujii grazing", T::OrenNayarFujii, {0.5f}, 0, grazing, 402},
        {"translucent", T::Translucent, {}, 0, tilted},
        {"translucent grazing", T::Translucent, {}, 0, grazing},
        {"ggx .04", T::Microfacet, reflect(0.04f, 0.04f), 0, tilted},
        {"ggx .25", T::Microfacet, reflect(0.25f, 0.25f), 0, tilted},
        {"ggx .25 front", T::Microfacet, reflect(0.25f, 0.25f), 0, front},
        {"ggx .25 separable", T::Microfacet, reflect(0.25f, 0.25f), 0, tilted, 304},
        {"ggx 1", T::Microfacet, reflect(1, 1), 0, tilted},
        {"ggx 1 grazing", T::Microfacet, reflect(1, 1), 0, grazing},
        {"ggx .09 grazing", T::Microfacet, reflect(0.09f, 0.09f), 0, grazing},
        {"ggx anisotropic", T::Microfacet, reflect(0.1f, 0.6f), kAniso, tilted},
        {"ggx anisotropy 1", T::Microfacet, reflect(0.01f, 1.0f), kAniso, direction(50, 70)},
        {"beckmann .25", T::Microfacet, reflect(0.25f, 0.25f), kBeckmann, tilted},
        {"beckmann 1 grazing", T::Microfacet, reflect(1, 1), kBeckmann, grazing},
        {"beckmann anisotropy 1", T::Microfacet, reflect(0.01f, 1.0f), kBeckmann | kAniso, direction(50, 70)},
        {"beckmann anisotropic", T::Microfacet, reflect(0.1f, 0.6f), kBeckmann | kAniso, tilted, 304},
        {"schlick black", T::Microfacet, reflect(0.3f, 0.3f, {1.5f, 0, 0, 0}), kind(FresnelKind::Schlick), grazing},
        {"schlick white", T::Microfacet, reflect(1, 1, {1.5f, 1, 1, 1}), kind(FresnelKind::Schlick), tilted},
        {"schlick film", T::Microfacet, reflect(0.3f, 0.3f, {1.5f, 0.04f, 0.04f, 0.04f, 400, 1.33f}), kind(FresnelKind::SchlickFilm), tilted},
        {"f82 film", T::Microfacet, reflect(0.5f, 0.5f, {0.9f, 0.6f, 0.3f, 0.1f, 0.5f, 1.0f, 700, 1.8f}), kind(FresnelKind::F82Film), grazing},
        {"conductor film", T::Microfacet, reflect(0.2f, 0.2f, {0.2f, 0.9f, 1.5f, 3.9f, 2.5f, 1.9f, 250, 1.4f}), kind(FresnelKind::ConductorFilm), tilted},
        {"dielectric index below 1", T::Microfacet, reflect(0.4f, 0.4f, {0.7f}), kind(FresnelKind::Dielectric), tilted},
        {"dielectric index below 1 grazing", T::Microfacet, reflect(1, 1, {0.4f}), kind(FresnelKind::Dielectric), grazing},
        {"schlick", T::Microfacet, reflect(0.3f, 0.3f, {1.5f, 0.04f, 0.1f, 0.2f}), kind(FresnelKind::Schlick), tilted},
        {"dielectric", T::Microfacet, reflect(0.3f, 0.3f, {1.5f}), kind(FresnelKind::Dielectric), tilted},
        {"f82 white", T::Microfacet, reflect(1, 1, {1, 1, 1, 1, 1, 1}), kind(FresnelKind::F82), grazing},
        {"f82", T::Microfacet, reflect(0.3f, 0.3f, {0.9f, 0.6f, 0.3f, 0.1f, 0.5f, 1.0f}), kind(FresnelKind::F82), tilted},
        {"conductor", T::Microfacet, reflect(0.3f, 0.3f, {0.2f, 0.9f, 1.5f, 3.9f, 2.5f, 1.9f}), kind(FresnelKind::Conductor), tilted},
        {"refract 1.45", T::MicrofacetRefract, refract(0.2f, 1.45f), 0, tilted},
        {"refract 1/1.45", T::MicrofacetRefract, refract(0.2f, 1 / 1.45f), 0, tilted},
        {"refract 1 grazing", T::MicrofacetRefract, refract(1.0f, 1.45f), 0, grazing},
        {"refract 1.01 grazing", T::MicrofacetRefract, refract(0.2f, 1.01f), 0, grazing},
        {"refract 1.1 grazing", T::MicrofacetRefract, refract(0.2f, 1.1f), 0, grazing},
        {"refract 1.1 rough grazing", T::MicrofacetRefract, refract(0.7f, 1.1f), 0, grazing},
        {"refract 1/1.01 grazing", T::MicrofacetRefract, refract(0.2f, 1 / 1.01f), 0, grazing},
        {"refract 1/1.1 grazing", T::MicrofacetRefract, refract(0.2f, 1 / 1.1f), 0, grazing},
        {"refract beckmann", T::MicrofacetRefract, refract(0.3f, 1.33f), kBeckmann, tilted, 304},
        {"pane grazing", T::MicrofacetThin, reflect(1, 1), 0, grazing},
        {"pane", T::MicrofacetThin, reflect(0.3f, 0.3f), 0, tilted},
        {"glass .09", T::MicrofacetGlass, glass(0.09f, 1.45f), 0, tilted},
        {"glass .5", T::MicrofacetGlass, glass(0.5f, 1.45f), 0, tilted},
        {"glass .5 inside", T::MicrofacetGlass, glass(0.5f, 1 / 1.45f), 0, direction(60, 10)},
        {"glass 1 grazing", T::MicrofacetGlass, glass(1.0f, 2.4f), 0, grazing},
        {"glass index below 1", T::MicrofacetGlass, glass(0.4f, 0.7f), 0, tilted},
        {"glass index below 1 grazing", T::MicrofacetGlass, glass(1.0f, 0.4f), 0, grazing},
        {"glass front", T::MicrofacetGlass, glass(0.5f, 1.45f), 0, front},
        {"glass film", T::MicrofacetGlass, glass_film(0.3f, 1.45f, 500, 1.33f), kind(FresnelKind::SchlickFilm), tilted},
        {"glass film inside", T::MicrofacetGlass, glass_film(0.5f, 1 / 1.45f, 500, 1.33f / 1.45f), kind(FresnelKind::SchlickFilm), direction(30, 10)},
        {"glass beckmann", T::MicrofacetGlass, glass(0.3f, 1.45f), kBeckmann, tilted},
        {"ashikhmin-shirley", T::AshikhminShirley, reflect(0.25f, 0.25f), 0, tilted},
        {"ashikhmin-shirley anisotropic", T::AshikhminShirley, reflect(0.15f, 0.5f), kAniso, tilted},
        {"ashikhmin-shirley anisotropy 1", T::AshikhminShirley, reflect(0.02f, 1.0f), kAniso, direction(50, 70)},
        {"ashikhmin-shirley grazing", T::AshikhminShirley, reflect(0.4f, 0.4f), 0, grazing},
        {"ashikhmin-shirley 1", T::AshikhminShirley, reflect(1, 1), 0, tilted},
        {"velvet", T::AshikhminVelvet, {0.5f}, 0, tilted},
        {"velvet 1 grazing", T::AshikhminVelvet, {1.0f}, 0, grazing},
        {"velvet .05", T::AshikhminVelvet, {0.05f}, 0, front},
        {"sheen .1 grazing", T::SheenLtc, {0.1f}, 0, direction(80, 10)},
        {"sheen .3", T::SheenLtc, {0.3f}, 0, direction(60, 40)},
        {"sheen 1", T::SheenLtc, {1.0f}, 0, tilted},
        {"toon diffuse", T::DiffuseToon, {0.35f, 0.15f}, 0, tilted},
        {"toon diffuse 1", T::DiffuseToon, {1.0f, 0.0f}, 0, tilted},
        {"toon diffuse grazing", T::DiffuseToon, {0.5f, 1.0f}, 0, grazing},
        {"toon glossy 1 grazing", T::GlossyToon, {1.0f, 1.0f}, 0, grazing},
        {"toon glossy", T::GlossyToon, {0.3f, 0.2f}, 0, tilted},
        {"v1 diffuse", T::PrincipledDiffuseV1, {0.5f}, 0, tilted, 304},
        {"v1 diffuse 0 grazing", T::PrincipledDiffuseV1, {0.0f}, 0, grazing, 304},
        {"v1 diffuse 1 grazing", T::PrincipledDiffuseV1, {1.0f}, 0, grazing, 304},
        {"v1 sheen grazing", T::PrincipledSheenV1, {}, 0, grazing, 304},
        {"v1 sheen", T::PrincipledSheenV1, {}, 0, tilted, 304},
        {"chiang", T::HairChiang, chiang(0.08f, 0.15f, 0.05f), 0, tilted},
        {"chiang smooth", T::HairChiang, chiang(0.02f, 0.1f, 0.02f), 0, direction(20, 80)},
        {"chiang rough grazing", T::HairChiang, chiang(1.5f, 2.0f, 1.5f), 0, grazing},
        {"chiang tilted light", T::HairChiang, chiang(0.08f, 0.15f, 0.05f), kVariantTiltsLight, tilted},
        {"huang", T::HairHuang, huang(0.3f, 1.0f, 1.0f), 0, tilted},
        {"huang 1 grazing", T::HairHuang, huang(1.0f, 1.0f, 1.0f), 0, grazing},
        {"huang near", T::HairHuang, huang(0.3f, 0.8f, 0.05f), 0, tilted},
        {"huang elliptic", T::HairHuang, huang(0.6f, 0.6f, 1.0f), 0, direction(50, 70)},
        {"huang smooth", T::HairHuang, huang(0.05f, 1.0f, 1.0f), 0, direction(20, 80)},
        {"hair reflection", T::HairReflection, {1, 0, 0, 0.3f, 0.6f, -0.1f}, 0, tilted},
        {"hair reflection smooth", T::HairReflection, {1, 0, 0, 0.05f, 0.1f, 0.1f}, 0, direction(20, 80)},
        {"hair reflection 1 grazing", T::HairReflection, {1, 0, 0, 1, 1, 0}, 0, grazing},
        // Tilted around the fibre it would have values where no samples go.
        {"hair transmission", T::HairTransmission, {1, 0, 0, 0.3f, 0.6f, -0.1f}, 0, direction(40, 0)},
        {"v1 clearcoat 1 grazing", T::PrincipledClearcoatV1, {1.0f}, 0, grazing, 304},
        {"v1 clearcoat", T::PrincipledClearcoatV1, {0.09f}, 0, tilted, 304},
    };
}

}  // namespace talbot::test
