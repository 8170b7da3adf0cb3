/// Closure nodes compiled: what they become, what they report, and normals bent for reflections.
#include <gtest/gtest.h>

#include <algorithm>

#include "bench.h"
#include "closure/albedo.h"
#include "shader/compiler.h"
#include "support/graph_builder.h"

namespace talbot::test {
namespace {

struct Compiled {
    scene::Scene scene;
    scene::SceneTables tables;
    Report report;
    shader::Programs programs;
    explicit Compiled(const GraphBuilder& g, int version = 502) {
        scene.settings.version = version;
        scene.shaders.push_back(g.shader);
        programs = shader::compile_shaders(scene, tables, report);
    }
    const shader::Program& surface() const { return *programs.programs[size_t(programs.shaders[0].surface)]; }
    std::vector<ClosureType> types() const {
        std::vector<ClosureType> all;
        for (const ClosureSlot& slot : surface().slots) all.push_back(slot.type);
        return all;
    }
    bool reports(const std::string& text) const {
        for (const ReportLine& line : report.lines())
            if (line.text.find(text) != std::string::npos) return true;
        return false;
    }
    /// Runs the surface program at one point and reads three registers.
    Rgb run(uint16_t first, Vec3 n, Vec3 ng, Vec3 wo) const {
        int32_t constants[kSpan], zero[kSpan] = {};
        std::fill(constants, constants + kSpan, programs.shaders[0].constants);
        const float values[9] = {n.x, n.y, n.z, ng.x, ng.y, ng.z, wo.x, wo.y, wo.z};
        float columns[9][kSpan];
        for (int k = 0; k < 9; ++k) std::fill(columns[k], columns[k] + kSpan, values[k]);
        shader::ShadingSpan span;
        span.n = 1;
        span.constants = constants;
        span.n_s = {columns[0], columns[1], columns[2]};
        span.n_g = {columns[3], columns[4], columns[5]};
        span.wo = {columns[6], columns[7], columns[8]};
        span.backfacing = zero;
        std::vector<float> r(size_t(surface().register_count) * kSpan);
        run_program(surface(), programs, span, shader::ShaderContext{}, r.data());
        return {r[size_t(first) * kSpan], r[size_t(first + 1) * kSpan], r[size_t(first + 2) * kSpan]};
    }
};

GraphBuilder single(const char* type, std::initializer_list<std::pair<const char*, float>> sockets = {}, const char* output = "BSDF") {
    GraphBuilder g;
    NodeBuilder node = g.node(type).color("Color", {0.8f, 0.5f, 0.2f}).color("Base Color", {0.8f, 0.5f, 0.2f});
    for (const auto& [name, value] : sockets) node.set(name, value);
    return g.surface(g.out(node.id(), output, SocketKind::Shader));
}

using T = ClosureType;

TEST(Nodes, PrincipledTakesOnlyTheLayersItNeeds) {
    EXPECT_EQ(Compiled(single("ShaderNodeBsdfPrincipled")).types(), (std::vector{T::Microfacet, T::Diffuse}));
    EXPECT_EQ(Compiled(single("ShaderNodeBsdfPrincipled", {{"Metallic", 1}})).types(), (std::vector{T::Microfacet}));
    EXPECT_EQ(Compiled(single("ShaderNodeBsdfPrincipled", {{"Transmission Weight", 1}})).types(), (std::vector{T::MicrofacetGlass}));
    EXPECT_EQ(
        Compiled(single("ShaderNodeBsdfPrincipled", {{"Alpha", 0.5f}, {"Sheen Weight", 0.3f}, {"Coat Weight", 0.5f}, {"Diffuse Roughness", 0.5f}})).types(),
        (std::vector{T::Transparent, T::SheenLtc, T::Microfacet, T::Microfacet, T::OrenNayar}));
    EXPECT_EQ(Compiled(single("ShaderNodeBsdfPrincipled", {{"Clearcoat", 1}}), 304).types(),
              (std::vector{T::PrincipledDiffuseV1, T::Microfacet, T::PrincipledClearcoatV1}));
}
TEST(Nodes, GlassIsOneLobeSince40) {
    EXPECT_EQ(Compiled(single("ShaderNodeBsdfGlass", {{"IOR", 1.5f}}), 304).types(), (std::vector{T::Microfacet, T::MicrofacetRefract}));
    EXPECT_EQ(Compiled(single("ShaderNodeBsdfGlass", {{"IOR", 1.5f}}), 402).types(), (std::vector{T::MicrofacetGlass}));
}
TEST(Nodes, RoughDiffuseByVersion) {
    EXPECT_EQ(Compiled(single("ShaderNodeBsdfDiffuse", {{"Roughness", 0.0f}})).types(), (std::vector{T::Diffuse}));
    EXPECT_EQ(Compiled(single("ShaderNodeBsdfDiffuse", {{"Roughness", 0.5f}}), 402).types(), (std::vector{T::OrenNayarFujii}));
    EXPECT_EQ(Compiled(single("ShaderNodeBsdfDiffuse", {{"Roughness", 0.5f}}), 405).types(), (std::vector{T::OrenNayar}));
}

TEST(Nodes, WhatIsMissingIsNamed) {
    const struct {
        const char* type;
        std::pair<const char*, float> socket;
        const char* message;
    } cases[] = {
        {"ShaderNodeSubsurfaceScattering", {"Scale", 1}, "Subsurface"},
        {"ShaderNodeBsdfPrincipled", {"Subsurface Weight", 0.5f}, "Subsurface"},
        {"ShaderNodeBsdfRayPortal", {"Offset", 0}, "portals"},
    };
    for (const auto& c : cases) {
        const Compiled compiled(single(c.type, {c.socket}));
        EXPECT_TRUE(compiled.reports(c.message)) << c.type;
        EXPECT_FALSE(compiled.types().empty()) << c.type;
    }
    EXPECT_TRUE(Compiled(single("ShaderNodeEeveeSpecular")).reports("EEVEE"));
    EXPECT_TRUE(Compiled(single("ShaderNodeVolumeScatter", {}, "Volume")).reports("olume"));
    EXPECT_FALSE(Compiled(single("ShaderNodeBsdfPrincipled")).reports("not supported"));
}

// A normal whose mirror direction would point into the surface is turned back until it just does not.
TEST(Nodes, NormalsAreBentForReflections) {
    const Compiled compiled(single("ShaderNodeBsdfGlossy", {{"Roughness", 0.2f}}), 304);
    const Vec3 ng{0, 0, 1};
    int bent = 0;
    for (const double view : {5.0, 40.0, 70.0, 85.0, 89.5}) {
        for (const double tilt : {0.0, 10.0, 45.0, 80.0}) {
            for (const double turn : {0.0, 60.0, 180.0}) {
                const Vec3 wo = direction(view, 0), n = direction(tilt, turn);
                const Vec3 result = compiled.run(compiled.surface().slots[0].normal, n, ng, wo);
                const float least = std::min(0.9f * wo.z, 0.01f);
                const auto height = [&](Vec3 normal) { return (normal * (2 * dot(normal, wo)) - wo).z; };
                EXPECT_NEAR(length(result), 1, 1e-4);
                EXPECT_GT(height(result), least - 1e-4) << view << " " << tilt << " " << turn;
                if (height(n) >= least) {
                    EXPECT_NEAR(length(result - n), 0, 1e-5);
                } else {
                    ++bent;
                    EXPECT_NEAR(height(result), least, 1e-4);
                    EXPECT_NEAR(dot(cross(ng, n), result), 0, 1e-4);  // stays in the plane of both
                }
            }
        }
    }
    EXPECT_GT(bent, 5);
}

// The compiled-in tables against published integrals of the same lobes.
TEST(Tables, AlbedoOfGgx) {
    const double expected[][3] = {{0.5, 1, 0.68784852}, {0.5, 0.6, 0.687836}, {0.5, 0.2, 0.789929},
                                  {1, 0.8, 0.351255},   {1, 0.1, 0.760213},   {0.1, 0.4, 0.956912}};
    for (const auto& [alpha, mu, albedo] : expected) EXPECT_NEAR(ggx_albedo(float(std::sqrt(alpha)), float(mu)), albedo, 2e-3) << alpha << " " << mu;
    EXPECT_NEAR(ggx_average(std::sqrt(0.5f)), 0.700241, 2e-3);
    EXPECT_NEAR(ggx_average(1.0f), 0.409137, 2e-3);
    EXPECT_NEAR(ggx_average(std::sqrt(0.1f)), 0.972045, 2e-3);
}

}  // namespace
}  // namespace talbot::test
