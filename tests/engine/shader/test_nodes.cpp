// Every node against what Cycles answered for the same constant inputs, in five versions (data/nodes.txt).
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <map>
#include <sstream>

#include "shader/compiler.h"
#include "support/graph_builder.h"

namespace talbot {
namespace {

using test::GraphBuilder;
using test::NodeBuilder;
using test::Socket;
using test::SocketKind;
constexpr SocketKind F = SocketKind::Float, V = SocketKind::Vector, C = SocketKind::Color;

std::vector<std::string> split(const std::string& s, char c) {
    std::vector<std::string> parts;
    std::stringstream in(s);
    for (std::string part; std::getline(in, part, c);) parts.push_back(part);
    return parts;
}

Vec3 probe_vector(const std::string& name) {
    if (name == "a") return {0.37f, 0.61f, 0.23f};
    if (name == "b") return {-1.7f, 2.3f, 5.1f};
    return {13.9f, -8.4f, 0.05f};
}

/// The probe's graph; `version` decides where the recipe differed. Not valid: a probe of another test.
struct Probe {
    GraphBuilder g;
    std::vector<std::string> name;
    int version = 502;

    const std::string& part(size_t i) const { return name[i]; }
    NodeBuilder textured(const std::string& type, const std::string& vec) { return g.node(type).link("Vector", V, g.xyz(probe_vector(vec))); }
    Socket texture() {
        const std::string& kind = part(0);
        if (kind == "noise") {
            const std::string &d = part(1), &vec = part(2);
            const bool distorted = part(3) != "det2";
            NodeBuilder n = d == "1D" ? g.node("ShaderNodeTexNoise") : textured("ShaderNodeTexNoise", vec);
            n.text("noise_dimensions", d).set("Scale", 1.3f).set("Detail", distorted ? 3.5f : 2.0f).set("Roughness", distorted ? 0.7f : 0.5f);
            if (distorted) n.set("Distortion", 1.5f);
            if (d == "1D" || d == "4D") n.set("W", 0.77f);
            return g.out(n.id(), name.back() == "col" ? "Color" : "Fac", name.back() == "col" ? C : F);
        }
        if (kind == "musgrave") {
            const float h = 0.8f, l = 2.1f, octaves = 4.5f;
            if (version >= 402) {
                NodeBuilder n = textured("ShaderNodeTexNoise", part(2)).text("noise_type", part(1)).number("normalize", 0).set("Scale", 1.3f);
                n.set("Detail", octaves - 1).set("Roughness", std::pow(l, -h)).set("Lacunarity", l).set("Offset", 0.6f).set("Gain", 1.2f);
                return g.out(n.id(), "Fac", F);
            }
            NodeBuilder n = textured("ShaderNodeTexMusgrave", part(2)).text("musgrave_type", part(1)).set("Scale", 1.3f).set("Detail", octaves);
            n.set("Dimension", h).set("Lacunarity", l).set("Offset", 0.6f).set("Gain", 1.2f);
            return g.out(n.id(), "Fac", F);
        }
        if (kind == "voronoi") {
            if (part(1) == "frac") {
                NodeBuilder n = textured("ShaderNodeTexVoronoi", part(2)).set("Scale", 1.3f).set("Detail", 2.5f).set("Roughness", 0.6f).number("normalize", 1);
                return g.out(n.id(), "Distance", F);
            }
            const std::string &d = part(1), &f = part(2);
            const bool metric = f == "F1" && (part(3) == "MANHATTAN" || part(3) == "CHEBYCHEV" || part(3) == "MINKOWSKI");
            const std::string& vec = metric ? part(4) : part(3);
            NodeBuilder n = d == "1D" ? g.node("ShaderNodeTexVoronoi") : textured("ShaderNodeTexVoronoi", vec);
            n.text("voronoi_dimensions", d).text("feature", f).set("Scale", 1.3f);
            if (metric) n.text("distance", part(3));
            if (metric && part(3) == "MINKOWSKI") n.set("Exponent", 0.6f);
            if (d == "1D" || d == "4D") n.set("W", 0.77f);
            if (name.back() == "color") return g.out(n.id(), "Color", C);
            if (name.back() == "pos") return g.out(n.id(), "Position", V);
            return g.out(n.id(), f == "N_SPHERE_RADIUS" ? "Radius" : "Distance", F);
        }
        if (kind == "whitenoise") {
            const std::string& d = part(1);
            NodeBuilder n = d == "1D" ? g.node("ShaderNodeTexWhiteNoise") : textured("ShaderNodeTexWhiteNoise", part(3));
            n.text("noise_dimensions", d);
            if (d == "1D" || d == "4D") n.set("W", 0.77f);
            return g.out(n.id(), part(2), part(2) == "Value" ? F : C);
        }
        if (kind == "wave") {
            NodeBuilder n = textured("ShaderNodeTexWave", part(4)).set("Scale", 1.3f).set("Distortion", 0.7f).text("wave_type", part(1));
            n.text(part(1) == "BANDS" ? "bands_direction" : "rings_direction", part(2)).text("wave_profile", part(3));
            return g.out(n.id(), "Fac", F);
        }
        if (kind == "magic") {
            NodeBuilder n = textured("ShaderNodeTexMagic", part(2)).set("Scale", 1.3f).set("Distortion", 1.1f);
            return g.out(n.number("turbulence_depth", part(1) == "depth2" ? 2 : 5).id(), "Color", C);
        }
        if (kind == "brick") {
            NodeBuilder n = textured("ShaderNodeTexBrick", part(2)).set("Scale", 1.3f);
            if (part(1) == "color") return g.out(n.set("Bias", 0.2f).id(), "Color", C);
            return g.out(n.set("Mortar Size", 0.1f).id(), "Fac", F);
        }
        if (kind == "checker") return g.out(textured("ShaderNodeTexChecker", part(1)).set("Scale", 1.3f).id(), "Fac", F);
        return g.out(textured("ShaderNodeTexGradient", part(2)).text("gradient_type", part(1)).id(), "Fac", F);
    }
    Socket vector() {
        const std::string& kind = part(0);
        if (kind == "mapping") {
            NodeBuilder n = textured("ShaderNodeMapping", part(2)).text("vector_type", part(1));
            n.set("Location", Vec3{0.1f, 0.2f, 0.3f}).set("Rotation", Vec3{0.3f, 0.5f, 0.7f}).set("Scale", Vec3{1.1f, 0.9f, 2});
            return g.out(n.id(), "Vector", V);
        }
        if (kind == "vecrot") {
            NodeBuilder n = textured("ShaderNodeVectorRotate", part(2)).text("rotation_type", part(1)).set("Center", Vec3{0.1f, 0.2f, 0.3f});
            n.set("Rotation", Vec3{0.3f, 0.5f, 0.7f}).set("Angle", 0.8f).set("Axis", Vec3{1, 2, 3});
            return g.out(n.id(), "Vector", V);
        }
        NodeBuilder n = g.node("ShaderNodeVectorMath").text("operation", part(1)).link("Vector", V, g.xyz({0.6f, -1.7f, 2.3f}));
        n.link("Vector_001", V, g.xyz({0.35f, 2.5f, -0.4f})).link("Vector_002", V, g.xyz({0.2f, 0.5f, 1.1f})).set("Scale", 1.3f);
        const bool scalar = part(1) == "DOT_PRODUCT" || part(1) == "DISTANCE" || part(1) == "LENGTH";
        return g.out(n.id(), scalar ? "Value" : "Vector", scalar ? F : V);
    }
    Socket number() {
        const std::string& kind = part(0);
        if (kind == "math") {
            const bool second = part(2) == "1";
            NodeBuilder n = g.node("ShaderNodeMath").text("operation", part(1)).link("Value", F, g.value(second ? -1.7f : 0.6f));
            n.link("Value_001", F, g.value(second ? 2.5f : 0.35f)).link("Value_002", F, g.value(second ? 0.5f : 0.2f));
            return g.out(n.id(), "Value", F);
        }
        if (kind == "maprange") {
            NodeBuilder n = g.node("ShaderNodeMapRange").link("Value", F, g.value(0.37f)).set("From Min", 0.1f).set("From Max", 0.9f).set("To Min", -1.0f);
            n.set("To Max", 3.0f).set("Steps", 4.0f).text("interpolation_type", part(1)).number("clamp", 0);
            return g.out(n.id(), "Result", F);
        }
        const Vec3 tilted{0.5f, 0, std::sqrt(0.75f)};
        if (kind == "fresnel")
            return g.out(g.node("ShaderNodeFresnel").link("IOR", F, g.value(std::stof(part(1)))).link("Normal", V, g.xyz(tilted)).id(), "Fac", F);
        NodeBuilder n = g.node("ShaderNodeLayerWeight").link("Blend", F, g.value(std::stof(part(2)))).link("Normal", V, g.xyz(tilted));
        return g.out(n.id(), part(1) == "0" ? "Fresnel" : "Facing", F);
    }
    Socket color() {
        const std::string& kind = part(0);
        const Rgb bright{0.2f, 0.5f, 1.4f};
        if (kind == "mixrgb") {
            NodeBuilder n = g.node("ShaderNodeMixRGB").text("blend_type", part(1)).link("Fac", F, g.value(0.7f)).link("Color1", C, g.rgb(bright));
            return g.out(n.link("Color2", C, g.rgb({0.7f, 0.1f, 0.4f})).id(), "Color", C);
        }
        if (kind == "hsv") {
            NodeBuilder n = g.node("ShaderNodeHueSaturation").set("Hue", 0.6f).set("Saturation", 1.4f).set("Value", 0.8f).set("Fac", 0.9f);
            return g.out(n.link("Color", C, g.rgb({0.2f, 0.5f, 0.9f})).id(), "Color", C);
        }
        if (kind == "invert") return g.out(g.node("ShaderNodeInvert").set("Fac", 0.8f).link("Color", C, g.rgb(bright)).id(), "Color", C);
        if (kind == "gamma") return g.out(g.node("ShaderNodeGamma").set("Gamma", 2.2f).link("Color", C, g.rgb(bright)).id(), "Color", C);
        if (kind == "brightcontrast")
            return g.out(g.node("ShaderNodeBrightContrast").set("Bright", 0.1f).set("Contrast", 0.3f).link("Color", C, g.rgb(bright)).id(), "Color", C);
        if (kind == "rgbtobw") return g.out(g.node("ShaderNodeRGBToBW").link("Color", C, g.rgb(bright)).id(), "Val", F);
        if (kind == "combinecolor") {
            NodeBuilder n = g.node("ShaderNodeCombineColor").text("mode", part(1)).link("Red", F, g.value(0.3f)).link("Green", F, g.value(0.6f));
            return g.out(n.link("Blue", F, g.value(0.8f)).id(), "Color", C);
        }
        if (kind == "separatecolor") {
            const char* outputs[] = {"Red", "Green", "Blue"};
            return g.out(g.node("ShaderNodeSeparateColor").text("mode", part(1)).link("Color", C, g.rgb({0.2f, 0.7f, 0.4f})).id(), outputs[std::stoi(part(2))],
                         F);
        }
        if (kind == "blackbody") return g.out(g.node("ShaderNodeBlackbody").link("Temperature", F, g.value(std::stof(part(1)))).id(), "Color", C);
        if (kind == "wavelength") return g.out(g.node("ShaderNodeWavelength").link("Wavelength", F, g.value(std::stof(part(1)))).id(), "Color", C);
        return ramp();
    }
    Socket ramp() {
        // The tables Blender makes of these ramps.
        std::vector<float> table;
        const int count = version >= 402 ? 257 : 256;
        if (part(1) != "RGB") return {};
        for (int i = 0; i < count; ++i) {
            const float x = float(i) / float(count - 1);
            const bool constant = part(2) == "CONSTANT";
            const float up = constant ? (x >= 0.4f) : saturate((x - 0.1f) / 0.3f), down = constant ? (x >= 0.9f) : saturate((x - 0.4f) / 0.5f);
            table.insert(table.end(), {1 - up, up * (1 - down), down, 1 - 0.5f * down});
        }
        NodeBuilder n = g.node("ShaderNodeValToRGB").table("color_ramp", table).link("Fac", F, g.value(std::stof(part(3))));
        return g.out(n.number("color_ramp_constant", part(2) == "CONSTANT").id(), "Color", C);
    }
    Socket image() {
        if (part(0) == "env") {
            NodeBuilder n = g.node("ShaderNodeTexEnvironment").link("Vector", V, g.xyz({0.5f, -0.3f, 0.2f})).text("projection", part(1)).number("image", 0);
            return g.out(n.text("interpolation", "Closest").id(), "Color", C);
        }
        if (part(1) == "proj") {
            NodeBuilder n = g.node("ShaderNodeTexImage").link("Vector", V, g.xyz({0.8f, 0.35f, 0.62f})).text("projection", part(2)).number("image", 0);
            return g.out(n.text("interpolation", "Closest").id(), "Color", C);
        }
        static constexpr Vec3 uvs[] = {{0.3f, 0.55f, 0}, {1.13f, -0.21f, 0}, {0.02f, 0.98f, 0}};
        NodeBuilder n = g.node("ShaderNodeTexImage").link("Vector", V, g.xyz(uvs[std::stoi(part(3))])).text("interpolation", part(1)).number("image", 0);
        return g.out(n.text("extension", part(2)).id(), "Color", C);
    }
    Socket sky() {
        const Vec3 p = probe_vector(name.back());
        NodeBuilder n = g.node("ShaderNodeTexSky").text("sky_type", part(1));
        if (part(1) == "PREETHAM") {
            n.link("Vector", V, g.xyz(p)).number("turbidity", 3).table("sun_direction", {0.3f, 0.2f, 0.93f});
        } else {
            const float length = std::sqrt(dot(p, p)), z = part(2) == "below" ? -0.1f * p.z : p.z;
            n.link("Vector", V, g.xyz({p.x / length, p.y / length, z / length}));
            n.number("sun_disc", 0).number("sun_elevation", 0.2).number("sun_rotation", 1.3).number("altitude", 500);
        }
        return g.out(n.id(), "Color", C);
    }
    Socket build() {
        static const std::map<std::string, Socket (Probe::*)()> families{
            {"noise", &Probe::texture},        {"musgrave", &Probe::texture},   {"voronoi", &Probe::texture},
            {"whitenoise", &Probe::texture},   {"wave", &Probe::texture},       {"magic", &Probe::texture},
            {"brick", &Probe::texture},        {"checker", &Probe::texture},    {"gradient", &Probe::texture},
            {"mapping", &Probe::vector},       {"vecrot", &Probe::vector},      {"vecmath", &Probe::vector},
            {"math", &Probe::number},          {"maprange", &Probe::number},    {"fresnel", &Probe::number},
            {"layerweight", &Probe::number},   {"mixrgb", &Probe::color},       {"hsv", &Probe::color},
            {"invert", &Probe::color},         {"gamma", &Probe::color},        {"rgbtobw", &Probe::color},
            {"brightcontrast", &Probe::color}, {"combinecolor", &Probe::color}, {"separatecolor", &Probe::color},
            {"blackbody", &Probe::color},      {"wavelength", &Probe::color},   {"ramp", &Probe::color},
            {"image", &Probe::image},          {"env", &Probe::image},          {"sky", &Probe::sky}};
        const auto found = families.find(part(0));
        return found == families.end() ? Socket{} : (this->*found->second)();
    }
};

/// Emission of the graph on a plane seen from above, and what the compiler had to say.
Rgb evaluate(const GraphBuilder& g, int version, const asset::TextureTable* textures, std::string& complaints) {
    scene::Scene scene;
    scene.settings.version = version;
    scene.shaders.push_back(g.shader);
    scene::SceneTables tables;
    Report report;
    const shader::Programs programs = shader::compile_shaders(scene, tables, report);
    for (const ReportLine& line : report.lines()) complaints += line.where + ": " + line.text + "\n";
    const shader::CompiledShader& compiled = programs.shaders[0];
    if (compiled.emission < 0) return {};
    const shader::Program& program = *programs.programs[size_t(compiled.emission)];
    std::vector<float> registers(size_t(program.register_count) * kSpan);
    float zero[1] = {0}, one[1] = {1};
    int32_t constants[1] = {compiled.constants};
    shader::ShadingSpan span;
    span.n = 1;
    span.p = {zero, zero, zero};
    span.n_s = span.n_g = span.wo = {zero, zero, one};
    span.constants = constants;
    shader::ShaderContext context;
    context.textures = textures;
    run_program(program, programs, span, context, registers.data());
    const float* e = &registers[size_t(program.emission) * kSpan];
    const Rgb out{e[0], e[kSpan], e[2 * kSpan]};
    if (compiled.emission_is_constant) {
        EXPECT_EQ(out.x, compiled.constant_emission.x);
        EXPECT_EQ(out.y, compiled.constant_emission.y);
        EXPECT_EQ(out.z, compiled.constant_emission.z);
    }
    return out;
}

// Blender's inliner leaves such a node where a constant feeds a socket without a value of its own.
TEST(Nodes, ConstantVectorOfTheInliner) {
    GraphBuilder g;
    g.surface(g.emission(g.out(g.node("FunctionNodeInputVector").table("vector", {0.25f, 0.5f, 2}).id(), "Vector", V)));
    std::string complaints;
    const Rgb got = evaluate(g, 502, nullptr, complaints);
    EXPECT_EQ(complaints, "");
    EXPECT_EQ(got.x, 0.25f);
    EXPECT_EQ(got.y, 0.5f);
    EXPECT_EQ(got.z, 2.0f);
}

// A range without extent gives 0, then the clamp holds, whatever the interpolation.
TEST(Nodes, MapRangeWithoutExtent) {
    for (const char* kind : {"LINEAR", "STEPPED", "SMOOTHSTEP", "SMOOTHERSTEP"}) {
        for (const bool clamp : {false, true}) {
            GraphBuilder g;
            NodeBuilder n = g.node("ShaderNodeMapRange").text("interpolation_type", kind).number("clamp", clamp).set("Value", 0.8f);
            n.set("From Min", 0.5f).set("From Max", 0.5f).set("To Min", 2).set("To Max", 7);
            g.surface(g.emission(g.out(n.id(), "Result", F)));
            std::string complaints;
            EXPECT_EQ(evaluate(g, 502, nullptr, complaints).x, clamp ? 2.0f : 0.0f) << kind;
            EXPECT_EQ(complaints, "");
        }
    }
}

TEST(Nodes, AnswerLikeCycles) {
    // Four by three texels, linear.
    float pixels[48];
    for (int y = 0; y < 3; ++y) {
        for (int x = 0; x < 4; ++x) {
            const float texel[4] = {0.1f + 0.2f * float(x), 0.15f + 0.3f * float(y), 0.05f * float(x + 4 * y), 1};
            std::copy(texel, texel + 4, pixels + 4 * (4 * y + x));
        }
    }
    asset::Texture texture;
    texture.texels = pixels;
    texture.width = 4;
    texture.height = 3;
    asset::TextureTable textures;
    textures.textures = &texture;
    textures.count = 1;

    std::ifstream file(TALBOT_SOURCE_DIR "/tests/engine/shader/data/nodes.txt");
    ASSERT_TRUE(file.good());
    int checked = 0;
    std::map<std::string, int> bad;
    for (std::string line; std::getline(file, line);) {
        if (line.empty() || line[0] == '#') continue;
        std::stringstream in(line);
        std::string name;
        in >> name;
        std::map<int, std::vector<float>> values;
        int current = 0;
        for (std::string word; in >> word;) {
            const bool is_version = word == "304" || word == "402" || word == "405" || word == "500" || word == "502";
            if (is_version) {
                current = std::stoi(word);
                values[current].clear();
            } else if (word != "-") {
                values[current].push_back(std::stof(word));
            }
        }
        std::vector<float> expected;
        for (int version : {304, 402, 405, 500, 502}) {
            if (values.contains(version)) expected = values[version];
            if (expected.empty()) continue;
            Probe probe;
            probe.name = split(name, '/');
            probe.version = version;
            // Nishita's node became Single Scattering.
            if (version >= 500 && name.starts_with("sky/NISHITA")) continue;
            const Socket result = probe.build();
            ASSERT_GE(result.node, 0) << name;
            probe.g.surface(probe.g.emission(result));
            std::string complaints;
            const Rgb got = evaluate(probe.g, version, &textures, complaints);
            EXPECT_EQ(complaints, "") << name;
            const Rgb want = expected.size() == 3 ? Rgb{expected[0], expected[1], expected[2]} : vec3(expected[0]);
            const double error = std::max({std::fabs(got.x - want.x), std::fabs(got.y - want.y), std::fabs(got.z - want.z)});
            const double scale = std::max({1.0, double(std::fabs(want.x)), double(std::fabs(want.y)), double(std::fabs(want.z))});
            ++checked;
            if (!(error <= 1e-4 * scale)) {
                ++bad[probe.name[0]];
                ADD_FAILURE() << name << " in " << version << ": " << got.x << " " << got.y << " " << got.z << ", Cycles has " << want.x << " " << want.y << " "
                              << want.z;
            }
        }
    }
    EXPECT_GT(checked, 2000);
}

}  // namespace
}  // namespace talbot
