// The compiler's own duties: mixing, folding, sharing, splitting, and bad graphs.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "shader/compiler.h"
#include "support/graph_builder.h"

namespace talbot {
namespace {

using shader::CompiledShader;
using shader::Program;
using shader::Programs;
using test::GraphBuilder;
using test::Socket;
using test::SocketKind;

struct Compiled {
    scene::Scene scene;
    scene::SceneTables tables;
    Report report;
    Programs programs;
    explicit Compiled(std::vector<GraphBuilder> graphs, int version = 502, std::vector<scene::Aov> aovs = {}) {
        scene.aovs = std::move(aovs);
        scene.settings.version = version;
        for (GraphBuilder& g : graphs) scene.shaders.push_back(g.shader);
        programs = shader::compile_shaders(scene, tables, report);
    }
    const CompiledShader& shader(size_t i = 0) const { return programs.shaders[i]; }
    const Program& surface(size_t i = 0) const { return *programs.programs[size_t(shader(i).surface)]; }
    bool reports(const std::string& text) const {
        for (const ReportLine& line : report.lines())
            if ((line.where + ": " + line.text).find(text) != std::string::npos) return true;
        return false;
    }
    /// Three registers in a row of lane 0, after a run over one lane of shader i.
    Rgb run(const Program& program, uint16_t first, size_t i = 0) const {
        std::vector<float> registers(size_t(program.register_count) * kSpan);
        int32_t constants[kSpan];
        std::fill(constants, constants + kSpan, shader(i).constants);
        shader::ShadingSpan span;
        span.n = 1;
        span.constants = constants;
        run_program(program, programs, span, shader::ShaderContext{}, registers.data());
        return {registers[size_t(first) * kSpan], registers[size_t(first + 1) * kSpan], registers[size_t(first + 2) * kSpan]};
    }
};

Compiled compile(const GraphBuilder& g, int version = 502) {
    return Compiled({g}, version);
}

TEST(Compiler, DefaultGreyIsLast) {
    const Compiled c(std::vector<GraphBuilder>{}, 405);
    ASSERT_EQ(c.programs.shaders.size(), 1u);
    EXPECT_EQ(c.programs.default_shader, 0);
    ASSERT_EQ(c.surface().slots.size(), 1u);
    EXPECT_EQ(c.surface().slots[0].type, ClosureType::Diffuse);
    EXPECT_FLOAT_EQ(c.run(c.surface(), c.surface().slots[0].weight).x, 0.8f);
    EXPECT_EQ(Compiled(std::vector<GraphBuilder>{}, 500).surface().slots.size(), 2u) << "a new material: paint under a gloss";
}

TEST(Compiler, MixWeighsClosures) {
    GraphBuilder g;
    g.surface(g.mix(0.25f, g.diffuse({0.8f, 0.4f, 0.2f}), g.add(g.emission({1, 2, 3}, 2), g.transparent({1, 1, 0.5f}))));
    const Compiled c = compile(g);
    ASSERT_EQ(c.surface().slots.size(), 2u);
    EXPECT_EQ(c.surface().slots[0].type, ClosureType::Diffuse);
    EXPECT_EQ(c.surface().slots[1].type, ClosureType::Transparent);
    EXPECT_FLOAT_EQ(c.run(c.surface(), c.surface().slots[0].weight).y, 0.3f);
    EXPECT_FLOAT_EQ(c.run(c.surface(), c.surface().emission).z, 1.5f);
    const CompiledShader& s = c.shader();
    ASSERT_TRUE(s.emission_is_constant && s.transparency_is_constant);
    EXPECT_FLOAT_EQ(s.constant_emission.y, 1.0f);
    EXPECT_FLOAT_EQ(s.emission_estimate, 1.0f);
    EXPECT_FLOAT_EQ(s.constant_transparency.z, 0.125f);
    const Program& emission = *c.programs.programs[size_t(s.emission)];
    EXPECT_TRUE(emission.slots.empty());
    EXPECT_FLOAT_EQ(c.run(emission, emission.emission).z, 1.5f);
    const Program& transparency = *c.programs.programs[size_t(s.transparency)];
    EXPECT_FLOAT_EQ(c.run(transparency, transparency.transparency).x, 0.25f);
    EXPECT_FALSE(s.spatially_varying);
    EXPECT_TRUE(c.report.lines().empty());
}

TEST(Compiler, EstimateKnowsNarrowBeamsAndLampsForTheCamera) {
    const auto math = [](GraphBuilder& g, const char* operation, const Socket& a, float b) {
        const int node = g.node("ShaderNodeMath").text("operation", operation).link("Value", SocketKind::Float, a).set("Value_001", b).id();
        return g.out(node, "Value", SocketKind::Float);
    };
    const auto estimate = [](GraphBuilder& g, const Socket& emission) {
        g.surface(g.emission(emission));
        return compile(g).shader().emission_estimate;
    };
    const auto estimate_by_ray = [&](const char* kind) {
        GraphBuilder g;
        const Socket flag = g.out(g.node("ShaderNodeLightPath").id(), kind, SocketKind::Float);
        return estimate(g, math(g, "MULTIPLY", flag, 100));
    };
    // |y| of a direction is uniform: the beam takes a twentieth of all.
    GraphBuilder g;
    const Socket incoming = g.out(g.node("ShaderNodeNewGeometry").id(), "Incoming", SocketKind::Vector);
    const Socket y = g.out(g.node("ShaderNodeSeparateXYZ").link("Vector", SocketKind::Vector, incoming).id(), "Y", SocketKind::Float);
    EXPECT_NEAR(estimate(g, math(g, "MULTIPLY", math(g, "LESS_THAN", math(g, "ABSOLUTE", y, 0), 0.05f), 4000)), 200, 150);
    EXPECT_EQ(estimate_by_ray("Is Camera Ray"), 1e-3f);  // never nothing
    EXPECT_NEAR(estimate_by_ray("Is Diffuse Ray"), 50, 15);
}

TEST(Compiler, ConstantFactorDropsBranch) {
    GraphBuilder g;
    g.surface(g.mix(0.0f, g.diffuse({0.5f, 0.5f, 0.5f}), g.emission({1, 1, 1}, 5)));
    const Compiled c = compile(g);
    EXPECT_EQ(c.surface().slots.size(), 1u);
    EXPECT_EQ(c.shader().emission, -1);
    EXPECT_EQ(c.shader().transparency, -1);
    EXPECT_FLOAT_EQ(c.run(c.surface(), c.surface().slots[0].weight).x, 0.5f);
}

TEST(Compiler, SharedNodeIsCompiledOnce) {
    GraphBuilder g;
    const Socket diffuse = g.diffuse({0.6f, 0.6f, 0.6f});
    g.surface(g.add(diffuse, g.add(diffuse, diffuse)));
    const Compiled c = compile(g);
    ASSERT_EQ(c.surface().slots.size(), 1u);
    EXPECT_FLOAT_EQ(c.run(c.surface(), c.surface().slots[0].weight).x, 1.8f);
}

TEST(Compiler, AovsAreAProgramOfTheirOwnWhereTheSceneAsksForThem) {
    GraphBuilder g;
    g.node("ShaderNodeOutputAOV").text("aov_name", "Mask").set("Value", 0.25f).color("Color", {1, 2, 3});
    g.node("ShaderNodeOutputAOV").text("aov_name", "Mask").set("Value", 0.5f).color("Color", {4, 4, 4});
    g.node("ShaderNodeOutputAOV").text("aov_name", "Other").color("Color", {9, 9, 9});
    g.surface(g.diffuse({0.5f, 0.5f, 0.5f}));
    EXPECT_EQ(compile(g).shader().aov, -1);
    const Compiled c({g}, 502, {{"Nobody's", true}, {"Mask", true}, {"Mask", false}});
    EXPECT_EQ(c.shader(1).aov, -1) << "the default grey";
    EXPECT_TRUE(c.surface().aovs.empty());
    const Program& program = *c.programs.programs[size_t(c.shader().aov)];
    ASSERT_EQ(program.aovs.size(), 2u);
    EXPECT_EQ(program.aovs[0].aov, 1);
    EXPECT_EQ(program.aovs[0].nodes, 2);
    EXPECT_EQ(program.aovs[1].aov, 2);
    const Rgb color = c.run(program, program.aovs[0].first), value = c.run(program, program.aovs[1].first);
    EXPECT_EQ(color.x, 5);
    EXPECT_EQ(color.z, 7);
    EXPECT_EQ(value.x, 0.75f);
}

TEST(Compiler, MaterialsThatDifferInConstantsShareAProgram) {
    std::vector<GraphBuilder> graphs(3);
    graphs[0].surface(graphs[0].mix(0.3f, graphs[0].diffuse({0.8f, 0.8f, 0.8f}), graphs[0].emission({1, 0, 0.5f}, 2)));
    graphs[1].surface(graphs[1].mix(0.7f, graphs[1].diffuse({0.1f, 0.2f, 0.3f}), graphs[1].emission({0.5f, 0.5f, 0.5f}, 7)));
    graphs[2].surface(graphs[2].diffuse({0.1f, 0.2f, 0.3f}));
    const Compiled c(graphs, 405);
    EXPECT_EQ(c.shader(0).surface, c.shader(1).surface);
    EXPECT_NE(c.shader(0).surface, c.shader(2).surface);
    EXPECT_EQ(c.shader(2).surface, c.shader(3).surface) << "the default grey";
    EXPECT_FLOAT_EQ(c.run(c.surface(), c.surface().slots[0].weight, 0).z, 0.56f);
    EXPECT_FLOAT_EQ(c.run(c.surface(), c.surface().slots[0].weight, 1).z, 0.09f);
}

TEST(Compiler, LanesFetchTheirOwnConstants) {
    std::vector<GraphBuilder> graphs(2);
    graphs[0].surface(graphs[0].diffuse({0.25f, 0, 0}));
    graphs[1].surface(graphs[1].diffuse({0.75f, 0, 0}));
    const Compiled c(graphs);
    const Program& program = c.surface();
    std::vector<float> registers(size_t(program.register_count) * kSpan);
    int32_t constants[kSpan];
    for (int i = 0; i < kSpan; ++i) constants[i] = c.shader(size_t(i % 2)).constants;
    shader::ShadingSpan span;
    span.constants = constants;
    span.n = 100;
    run_program(program, c.programs, span, shader::ShaderContext{}, registers.data());
    for (int i = 0; i < span.n; ++i) EXPECT_EQ(registers[size_t(program.slots[0].weight) * kSpan + size_t(i)], i % 2 ? 0.75f : 0.25f);
}

TEST(Compiler, ValuesLinkedToShaderSocketsShine) {
    GraphBuilder g;
    g.surface(g.rgb({0.1f, 0.2f, 0.3f}));
    const Compiled c = compile(g);
    ASSERT_TRUE(c.shader().emission_is_constant);
    EXPECT_FLOAT_EQ(c.shader().constant_emission.y, 0.2f);

    GraphBuilder m;
    m.surface(m.mix(0.5f, m.value(4), m.diffuse({1, 1, 1})));
    EXPECT_FLOAT_EQ(compile(m).shader().constant_emission.x, 2.0f);
}

TEST(Compiler, ConvertsSockets) {
    GraphBuilder g;
    g.surface(g.out(g.node("ShaderNodeEmission").color("Color", {1, 1, 1}).link("Strength", SocketKind::Float, g.rgb({1, 2, 3})).id(), "Emission",
                    SocketKind::Shader));
    EXPECT_NEAR(compile(g).shader().constant_emission.x, 0.2126f + 2 * 0.7152f + 3 * 0.0722f, 1e-6);
}

TEST(Compiler, EmptyAndMissing) {
    GraphBuilder none;
    EXPECT_TRUE(compile(none).surface().slots.empty());
    GraphBuilder dangling;
    dangling.surface({7, "BSDF", SocketKind::Shader});
    const Compiled c = compile(dangling);
    EXPECT_TRUE(c.surface().slots.empty());
    EXPECT_TRUE(c.reports("does not exist"));
}

TEST(Compiler, UnknownNodes) {
    GraphBuilder g;
    const int strange = g.node("ShaderNodeFromTheFuture").id();
    g.surface(g.emission(g.out(strange, "Color", SocketKind::Color)));
    const Compiled c = compile(g);
    EXPECT_EQ(c.shader().emission, -1);  // zero
    EXPECT_TRUE(c.reports("ShaderNodeFromTheFuture"));
    // The socket's own value shows through.
    scene::NodeInput& color = g.shader.graph.nodes[1].inputs[0];
    ASSERT_EQ(color.identifier, "Color");
    color.value[1] = 0.25f;
    EXPECT_NEAR(compile(g).shader().constant_emission.y, 0.25f, 1e-6f);

    GraphBuilder s;
    s.surface(s.out(s.node("ShaderNodeBsdfFromTheFuture").color("Color", {0.2f, 0.3f, 0.4f}).id(), "BSDF", SocketKind::Shader));
    const Compiled d = compile(s);
    ASSERT_EQ(d.surface().slots.size(), 1u);
    EXPECT_EQ(d.surface().slots[0].type, ClosureType::Diffuse);
    EXPECT_FLOAT_EQ(d.run(d.surface(), d.surface().slots[0].weight).z, 0.4f);
    EXPECT_TRUE(d.reports("ShaderNodeBsdfFromTheFuture"));
}

TEST(Compiler, Cycles) {
    GraphBuilder g;
    const Socket a = g.out(g.node("ShaderNodeMixShader").set("Fac", 0.5f).id(), "Shader", SocketKind::Shader);
    const Socket b = g.add(a, g.diffuse({1, 1, 1}));
    g.shader.graph.nodes[size_t(a.node)].inputs.push_back({"Shader", SocketKind::Shader, {}, false, b.node, "Shader"});
    g.shader.graph.nodes[size_t(a.node)].inputs.push_back({"Shader_001", SocketKind::Shader, {}, false, a.node, "Shader"});
    g.surface(a);
    EXPECT_TRUE(compile(g).reports("cyclic"));
}

TEST(Compiler, AbsurdNumbers) {
    GraphBuilder g;
    g.surface(g.emission({std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(), 1e38f}, 1));
    const Compiled c = compile(g);
    EXPECT_TRUE(c.reports("no finite number"));
    EXPECT_TRUE(c.reports("a huge number"));
    EXPECT_EQ(c.shader().constant_emission.x, 0);
    EXPECT_TRUE(std::isfinite(c.shader().constant_emission.y) && std::isfinite(c.shader().constant_emission.z));
}

}  // namespace
}  // namespace talbot
