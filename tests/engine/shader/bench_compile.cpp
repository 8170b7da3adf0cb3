/// How long a production-size material takes to compile; disabled as a test, like every timing:
///     build/tests/engine/test_shader --gtest_also_run_disabled_tests --gtest_filter='BenchCompile*'
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cstdio>

#include "shader/compiler.h"
#include "support/graph_builder.h"

namespace talbot {
namespace {

using test::GraphBuilder;
using test::Socket;
using test::SocketKind;

TEST(BenchCompile, DISABLED_MaterialOf200Nodes) {
    GraphBuilder g;
    Socket color = g.rgb({0.2f, 0.3f, 0.4f}), at = g.position();
    for (int layer = 0; layer < 40; ++layer) {
        at = g.out(g.node("ShaderNodeMapping").link("Vector", SocketKind::Vector, at).set("Scale", Vec3{1.1f, 1, 0.9f}).text("vector_type", "POINT").id(),
                   "Vector", SocketKind::Vector);
        const Socket noise =
            g.out(g.node("ShaderNodeTexNoise").link("Vector", SocketKind::Vector, at).set("Scale", 2.0f + float(layer)).id(), "Fac", SocketKind::Float);
        const Socket cells =
            g.out(g.node("ShaderNodeTexVoronoi").link("Vector", SocketKind::Vector, at).text("feature", "F1").id(), "Distance", SocketKind::Float);
        const Socket patch = g.out(
            g.node("ShaderNodeMath").text("operation", "MULTIPLY").link("Value", SocketKind::Float, noise).link("Value_001", SocketKind::Float, cells).id(),
            "Value", SocketKind::Float);
        color = g.out(g.node("ShaderNodeMixRGB")
                          .text("blend_type", "OVERLAY")
                          .link("Fac", SocketKind::Float, patch)
                          .link("Color1", SocketKind::Color, color)
                          .color("Color2", {0.5f, 0.1f, 0.7f})
                          .id(),
                      "Color", SocketKind::Color);
    }
    g.surface(g.emission(color));
    ASSERT_GT(g.shader.graph.nodes.size(), 200u);
    scene::Scene scene;
    scene.shaders.push_back(g.shader);
    double best = 1e9;
    for (int i = 0; i < 50; ++i) {
        const auto begin = std::chrono::steady_clock::now();
        scene::SceneTables tables;
        Report report;
        const shader::Programs programs = shader::compile_shaders(scene, tables, report);
        best = std::min(best, std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count());
        ASSERT_GT(programs.programs[size_t(programs.shaders[0].surface)]->code.size(), 200u);
    }
    std::printf("%zu nodes: %.2f ms\n", g.shader.graph.nodes.size(), 1e3 * best);
}

}  // namespace
}  // namespace talbot
