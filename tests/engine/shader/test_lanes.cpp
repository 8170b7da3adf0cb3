// Programs over spans: a lane's result does not depend on its neighbours, its place, or the instruction set; and what nodes read from the
// surface: attributes, transforms, normal maps, bump.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "base/cpu.h"
#include "scene/motion.h"
#include "shader/compiler.h"
#include "support/graph_builder.h"
#include "support/objects.h"

namespace talbot {
// The kernels of every instruction set that was compiled in. Inline like the lowest one's in the header, so they are called by their whole names.
#define TALBOT_DECLARE(isa)                                                                                                                      \
    namespace shader::inline isa {                                                                                                               \
    void run_program(const Program& program, const Programs& programs, const ShadingSpan& span, const ShaderContext& context, float* registers); \
    }
#ifdef TALBOT_HAS_v2
TALBOT_DECLARE(v2)
#endif
#ifdef TALBOT_HAS_v3
TALBOT_DECLARE(v3)
#endif
#ifdef TALBOT_HAS_v4
TALBOT_DECLARE(v4)
#endif

namespace {

using test::GraphBuilder;
using test::NodeBuilder;
using test::Socket;
using test::SocketKind;
constexpr SocketKind F = SocketKind::Float, V = SocketKind::Vector, C = SocketKind::Color;
using Run = void (*)(const shader::Program&, const shader::Programs&, const shader::ShadingSpan&, const shader::ShaderContext&, float*);

std::vector<std::pair<std::string, Run>> all_runs() {
    std::vector<std::pair<std::string, Run>> runs;
#ifdef TALBOT_HAS_v2
    if (machine_runs("v2")) runs.push_back({"v2", shader::v2::run_program});
#endif
#ifdef TALBOT_HAS_v3
    if (machine_runs("v3")) runs.push_back({"v3", shader::v3::run_program});
#endif
#ifdef TALBOT_HAS_v4
    if (machine_runs("v4")) runs.push_back({"v4", shader::v4::run_program});
#endif
#ifdef TALBOT_HAS_generic
    runs.push_back({"generic", shader::generic::run_program});
#endif
    return runs;
}

/// One triangle in the plane z = 0 of its object, with a UV map and tangents, and a span of points on it.
struct Stage {
    scene::Scene scene;
    scene::SceneTables tables;
    Report report;
    shader::Programs programs;
    std::vector<float> columns = std::vector<float>(16 * kSpan);
    std::vector<int32_t> ints = std::vector<int32_t>(4 * kSpan);
    shader::ShadingSpan span;
    shader::ShaderContext context;

    explicit Stage(const GraphBuilder& g, Affine to_world = {}, int version = 502) {
        auto mesh = std::make_shared<scene::Mesh>();
        mesh->positions = {{0, 0, 0}, {2, 0, 0}, {0, 2, 0}};
        mesh->triangle_vertices = {0, 1, 2};
        mesh->triangle_corners = {0, 1, 2};
        mesh->vertex_normals = {{0, 0, 1}, {0, 0, 1}, {0, 0, 1}};
        mesh->active_uv = "UVMap";
        mesh->generated_scale = {0.5f, 0.5f, 0.5f};
        mesh->generated_offset = {0, 0, 0.5f};
        mesh->attributes.push_back({"UVMap", scene::Domain::Corner, 2, false, {0, 0, 1, 0, 0, 1}});
        mesh->attributes.push_back({"@tangent:UVMap", scene::Domain::Corner, 4, false, {1, 0, 0, 1, 1, 0, 0, 1, 1, 0, 0, 1}});
        mesh->attributes.push_back({"heat", scene::Domain::Vertex, 1, false, {0, 1, 2}});
        mesh->attributes.push_back({"paint", scene::Domain::Face, 4, true, {0.1f, 0.2f, 0.3f, 0.4f}});
        scene.meshes.push_back(mesh);
        scene::ObjectTraits traits;
        traits.mesh = 0;
        traits.pass_index = 7;
        traits.color[1] = 0.25f;
        tests::place(scene, traits, to_world);
        scene.objects[0].random = 0x80000000u;
        scene.settings.version = version;
        scene.shaders.push_back(g.shader);
        programs = shader::compile_shaders(scene, tables, report);
        scene::make_scene_view(scene, scene::Handle(programs.default_shader), tables);
        context.scene = &tables.view;
    }
    const shader::CompiledShader& compiled() const { return programs.shaders[0]; }

    /// Points at barycentrics (u, v), seen from straight above in object space.
    void place(const std::vector<Vec2>& uv) {
        span.n = int(uv.size());
        const scene::Placement object{tables.view.objects[0].to_world, tables.view.to_object[0]};
        float* c = columns.data();
        const auto column = [&c] {
            float* p = c;
            c += kSpan;
            return p;
        };
        const auto three = [&column] {
            Columns3 v;
            v.x = column();
            v.y = column();
            v.z = column();
            return v;
        };
        span.p = three();
        span.n_s = three();
        span.n_g = span.n_s;
        span.wo = span.n_s;
        span.u = column();
        span.v = column();
        span.footprint = column();
        span.object = ints.data();
        span.primitive = span.object + kSpan;
        span.constants = span.primitive + kSpan;
        span.ray_flags = span.constants + kSpan;
        for (int i = 0; i < span.n; ++i) {
            const Vec2 b = uv[size_t(i)];
            store(span.p, i, transform_point(object.to_world, {2 * b.x, 2 * b.y, 0}));
            store(span.n_s, i, normalize(transform_normal(object.to_object, {0, 0, 1})));
            span.u[i] = b.x;
            span.v[i] = b.y;
            span.footprint[i] = 1e-3f;
            span.object[i] = span.primitive[i] = 0;
            span.constants[i] = compiled().constants;
            span.ray_flags[i] = shader::kRayCamera;
        }
    }
    std::vector<Rgb> run(Run f) const {
        const shader::Program& program = *programs.programs[size_t(compiled().emission)];
        std::vector<float> registers(size_t(program.register_count) * kSpan);
        f(program, programs, span, context, registers.data());
        std::vector<Rgb> out;
        const float* e = &registers[size_t(program.emission) * kSpan];
        for (int i = 0; i < span.n; ++i) out.push_back({e[i], e[kSpan + i], e[2 * kSpan + i]});
        return out;
    }
    Rgb at(float u, float v) {
        place({{u, v}});
        return run(all_runs().front().second).front();
    }
};

std::vector<Vec2> random_points(int n) {
    std::mt19937 random(7);
    std::uniform_real_distribution<float> uniform(0, 0.5f);
    std::vector<Vec2> uv;
    for (int i = 0; i < n; ++i) uv.push_back({uniform(random), uniform(random)});
    return uv;
}

/// Graphs that together run every texture and most operations over varying lanes.
std::vector<GraphBuilder> varying_graphs() {
    std::vector<GraphBuilder> graphs;
    const auto add = [&](const auto& build) {
        GraphBuilder g;
        const Socket s = build(g);
        g.surface(g.emission(s));
        graphs.push_back(g);
    };
    const auto scaled = [](GraphBuilder& g) {
        const int n = g.node("ShaderNodeMapping").link("Vector", V, g.position()).set("Scale", Vec3{7, 5, 3}).set("Rotation", Vec3{0.3f, 0.2f, 0.9f}).id();
        return g.out(n, "Vector", V);
    };
    for (const char* d : {"1D", "2D", "3D", "4D"}) {
        add([&](GraphBuilder& g) {
            NodeBuilder n = g.node("ShaderNodeTexNoise").link("Vector", V, scaled(g)).text("noise_dimensions", d).set("Detail", 3.3f).set("Distortion", 0.4f);
            return g.out(n.link("W", F, scaled(g)).id(), "Color", C);
        });
        add([&](GraphBuilder& g) {
            // What all lanes have in common and what differs from lane to lane have loops of their own.
            NodeBuilder n = g.node("ShaderNodeTexNoise").link("Vector", V, scaled(g)).text("noise_dimensions", d).link("Detail", F, scaled(g));
            return g.out(n.link("W", F, scaled(g)).link("Roughness", F, g.position()).id(), "Color", C);
        });
        for (const char* f : {"F1", "F2", "SMOOTH_F1", "DISTANCE_TO_EDGE", "N_SPHERE_RADIUS"}) {
            add([&](GraphBuilder& g) {
                NodeBuilder n = g.node("ShaderNodeTexVoronoi").link("Vector", V, scaled(g)).text("voronoi_dimensions", d).text("feature", f);
                return g.out(n.link("W", F, scaled(g)).id(), "Distance", F);
            });
        }
        add([&](GraphBuilder& g) {
            // Of unscaled coordinates: it would turn a last digit into another number.
            NodeBuilder n = g.node("ShaderNodeTexWhiteNoise").link("Vector", V, g.position()).text("noise_dimensions", d);
            return g.out(n.link("W", F, g.position()).id(), "Color", C);
        });
    }
    for (const char* d : {"2D", "3D"}) {
        for (const float anisotropy : {1.0f, 0.3f}) {
            add([&](GraphBuilder& g) {
                NodeBuilder n = g.node("ShaderNodeTexGabor").link("Vector", V, scaled(g)).text("gabor_type", d).set("Scale", 0.4f);
                return g.out(n.set("Anisotropy", anisotropy).id(), "Value", F);
            });
        }
    }
    for (const char* type : {"ShaderNodeTexWave", "ShaderNodeTexMagic", "ShaderNodeTexBrick", "ShaderNodeTexChecker", "ShaderNodeTexGradient"})
        add([&](GraphBuilder& g) { return g.out(g.node(type).link("Vector", V, scaled(g)).set("Scale", 0.3f).set("Distortion", 0.7f).id(), "Color", C); });
    for (const char* op : {"POWER", "LOGARITHM", "SINE", "ARCTAN2", "WRAP", "PINGPONG", "SMOOTH_MIN", "TANH", "MODULO"}) {
        add([&](GraphBuilder& g) {
            return g.out(g.node("ShaderNodeMath").text("operation", op).link("Value", F, scaled(g)).set("Value_001", 1.7f).set("Value_002", 0.4f).id(), "Value",
                         F);
        });
    }
    for (const char* blend : {"OVERLAY", "SATURATION", "HUE", "SOFT_LIGHT"}) {
        add([&](GraphBuilder& g) {
            NodeBuilder n = g.node("ShaderNodeMixRGB").text("blend_type", blend).set("Fac", 0.6f).link("Color1", C, scaled(g));
            return g.out(n.color("Color2", {0.3f, 0.8f, 0.1f}).id(), "Color", C);
        });
    }
    return graphs;
}

TEST(Lanes, DoNotDependOnTheirNeighbours) {
    const std::vector<Vec2> points = random_points(203);
    int graph = 0;
    for (const GraphBuilder& g : varying_graphs()) {
        Stage stage(g);
        for (const auto& [isa, run] : all_runs()) {
            stage.place(points);
            const std::vector<Rgb> together = stage.run(run);
            std::vector<Vec2> reversed(points.rbegin(), points.rend());
            stage.place(reversed);
            const std::vector<Rgb> backwards = stage.run(run);
            for (size_t i = 0; i < points.size(); ++i) {
                const Rgb a = together[i], b = backwards[points.size() - 1 - i];
                ASSERT_TRUE(a.x == b.x && a.y == b.y && a.z == b.z) << isa << " graph " << graph << " lane " << i;
            }
            for (size_t i = 0; i < points.size(); i += 37) {
                for (const size_t copies : {1, 16}) {  // 16: nothing else beside them, so that what one lane has all have
                    stage.place(std::vector<Vec2>(copies, points[i]));
                    const Rgb alone = stage.run(run).front();
                    ASSERT_TRUE(alone.x == together[i].x && alone.y == together[i].y && alone.z == together[i].z) << isa << " graph " << graph << " lane " << i;
                }
            }
        }
        ++graph;
    }
}

TEST(Lanes, AgreeBetweenInstructionSets) {
    const auto runs = all_runs();
    const std::vector<Vec2> points = random_points(256);
    int graph = 0;
    for (const GraphBuilder& g : varying_graphs()) {
        Stage stage(g);
        stage.place(points);
        const std::vector<Rgb> first = stage.run(runs.front().second);
        for (const auto& [isa, run] : runs) {
            const std::vector<Rgb> other = stage.run(run);
            for (size_t i = 0; i < points.size(); ++i)
                ASSERT_TRUE(first[i].x == other[i].x && first[i].y == other[i].y && first[i].z == other[i].z) << isa << " graph " << graph << " lane " << i;
        }
        ++graph;
    }
}

TEST(Surface, Attributes) {
    const auto value = [](const char* node, const char* output, SocketKind kind, const char* property, const char* name) {
        GraphBuilder g;
        g.surface(g.emission(g.out(g.node(node).text(property, name).id(), output, kind)));
        return Stage(g).at(0.25f, 0.5f);
    };
    EXPECT_NEAR(value("ShaderNodeUVMap", "UV", V, "uv_map", "").x, 0.25, 1e-6);
    EXPECT_NEAR(value("ShaderNodeUVMap", "UV", V, "uv_map", "UVMap").y, 0.5, 1e-6);
    EXPECT_NEAR(value("ShaderNodeAttribute", "Fac", F, "attribute_name", "heat").x, 0.25 + 1.0, 1e-6);
    EXPECT_NEAR(value("ShaderNodeAttribute", "Color", C, "attribute_name", "paint").y, 0.2, 1e-6);
    EXPECT_NEAR(value("ShaderNodeVertexColor", "Alpha", F, "layer_name", "paint").x, 0.4, 1e-6);
    EXPECT_EQ(value("ShaderNodeAttribute", "Color", C, "attribute_name", "absent").x, 0);
    EXPECT_NEAR(value("ShaderNodeObjectInfo", "Random", F, "", "").x, 0.5, 1e-6);
    EXPECT_NEAR(value("ShaderNodeObjectInfo", "Object Index", F, "", "").x, 7, 1e-6);
    EXPECT_NEAR(value("ShaderNodeObjectInfo", "Color", C, "", "").y, 0.25, 1e-6);
    EXPECT_NEAR(value("ShaderNodeLightPath", "Is Camera Ray", F, "", "").x, 1, 0);
    EXPECT_NEAR(value("ShaderNodeLightPath", "Is Shadow Ray", F, "", "").x, 0, 0);
}

TEST(Surface, TextureCoordinates) {
    // Turned by 90 degrees about Z, scaled by 2 and moved.
    Affine to_world;
    const float m[3][4] = {{0, -2, 0, 10}, {2, 0, 0, 20}, {0, 0, 2, 30}};
    std::copy(&m[0][0], &m[0][0] + 12, &to_world.m[0][0]);
    const auto coordinate = [&](const char* output) {
        GraphBuilder g;
        g.surface(g.emission(g.out(g.node("ShaderNodeTexCoord").id(), output, V)));
        Stage stage(g, to_world);
        stage.scene.camera.to_world.m[2][3] = 40;
        return stage.at(0.25f, 0.5f);
    };
    const Vec3 object = coordinate("Object"), generated = coordinate("Generated"), camera = coordinate("Camera"), normal = coordinate("Normal");
    EXPECT_NEAR(object.x, 0.5, 1e-5);
    EXPECT_NEAR(object.y, 1.0, 1e-5);
    EXPECT_NEAR(generated.x, 0.25, 1e-5);
    EXPECT_NEAR(generated.z, 0.5, 1e-5);
    EXPECT_NEAR(camera.x, 8, 1e-4);
    EXPECT_NEAR(camera.y, 21, 1e-4);
    EXPECT_NEAR(camera.z, 10, 1e-4);
    EXPECT_NEAR(normal.z, 1, 1e-5);
    EXPECT_NEAR(coordinate("Reflection").z, 1, 1e-5);
}

TEST(Surface, NormalMap) {
    const auto mapped = [](Rgb color, float strength, const char* space, Affine to_world) {
        GraphBuilder g;
        const int n = g.node("ShaderNodeNormalMap").color("Color", color).set("Strength", strength).text("space", space).id();
        g.surface(g.emission(g.out(n, "Normal", V)));
        return Stage(g, to_world).at(0.2f, 0.3f);
    };
    Affine turned;
    const float m[3][4] = {{0, -1, 0, 0}, {1, 0, 0, 0}, {0, 0, 1, 0}};
    std::copy(&m[0][0], &m[0][0] + 12, &turned.m[0][0]);
    EXPECT_NEAR(mapped({0.5f, 0.5f, 1}, 1, "TANGENT", {}).z, 1, 1e-6);
    const Vec3 tilted = mapped({0.8f, 0.5f, 0.9f}, 1, "TANGENT", {});
    EXPECT_NEAR(tilted.x, 0.6, 1e-5);
    EXPECT_NEAR(tilted.z, 0.8, 1e-5);
    EXPECT_NEAR(mapped({0.8f, 0.5f, 0.9f}, 1, "TANGENT", turned).y, 0.6, 1e-5);
    EXPECT_NEAR(mapped({0.8f, 0.5f, 0.9f}, 0, "TANGENT", turned).z, 1, 1e-5);
    EXPECT_NEAR(mapped({0.8f, 0.5f, 0.9f}, 1, "OBJECT", turned).y, 0.6, 1e-5);
    EXPECT_NEAR(mapped({0.8f, 0.5f, 0.9f}, 1, "WORLD", turned).x, 0.6, 1e-5);
}

TEST(Surface, BumpFollowsTheSlope) {
    // Height = slope * x in world space, and along the UV map: both must bend the normal by the same known angle.
    for (const bool by_uv : {false, true}) {
        for (const bool invert : {false, true}) {
            GraphBuilder g;
            const Socket from = by_uv ? g.out(g.node("ShaderNodeUVMap").id(), "UV", V) : g.position();
            const Socket x = g.out(g.node("ShaderNodeSeparateXYZ").link("Vector", V, from).id(), "X", F);
            const float slope = by_uv ? 1.0f : 0.5f;  // u runs half as fast as x
            const int h = g.node("ShaderNodeMath").text("operation", "MULTIPLY").link("Value", F, x).set("Value_001", slope).id();
            NodeBuilder n = g.node("ShaderNodeBump").link("Height", F, g.out(h, "Value", F)).set("Distance", 1.0f).set("Strength", 1.0f);
            g.surface(g.emission(g.out(n.number("invert", invert).id(), "Normal", V)));
            Stage stage(g);
            const Vec3 normal = stage.at(0.2f, 0.3f);
            const float sign = invert ? 1.0f : -1.0f;
            EXPECT_NEAR(normal.x, sign * 0.5f / std::sqrt(1.25f), 1e-3) << by_uv << invert;
            EXPECT_NEAR(normal.y, 0, 1e-3);
            EXPECT_NEAR(normal.z, 1 / std::sqrt(1.25f), 1e-3);
            EXPECT_TRUE(stage.compiled().has_bump);
        }
    }
}

TEST(Surface, DisplacementBendsEveryNormal) {
    // Height 0.5 x: the Geometry node in the surface sees the bent normal, the shared one in the displacement does not disturb it.
    GraphBuilder g;
    const int geometry = g.node("ShaderNodeNewGeometry").id();
    const Socket x = g.out(g.node("ShaderNodeSeparateXYZ").link("Vector", V, g.out(geometry, "Position", V)).id(), "X", F);
    NodeBuilder d = g.node("ShaderNodeDisplacement").link("Height", F, x).set("Midlevel", 0.0f).set("Scale", 0.5f);
    g.surface(g.emission(g.out(geometry, "Normal", V)));
    const Socket from = g.out(d.id(), "Displacement", V);
    g.shader.graph.nodes[size_t(g.shader.graph.output_node)].inputs.push_back({"Displacement", V, {}, true, from.node, from.identifier});
    Stage stage(g);
    const Vec3 normal = stage.at(0.2f, 0.3f);
    EXPECT_NEAR(normal.x, -0.5f / std::sqrt(1.25f), 1e-3);
    EXPECT_NEAR(normal.z, 1 / std::sqrt(1.25f), 1e-3);
    EXPECT_TRUE(stage.compiled().has_bump);
}

TEST(Surface, BumpWithoutHeightIsPlain) {
    GraphBuilder g;
    g.surface(g.emission(g.out(g.node("ShaderNodeBump").set("Height", 1.0f).id(), "Normal", V)));
    Stage stage(g);
    EXPECT_EQ(stage.at(0.2f, 0.3f).z, 1);
    EXPECT_FALSE(stage.compiled().has_bump);
}

}  // namespace
}  // namespace talbot
