/// Small scenes built in C++ for tests of the whole engine.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "support/objects.h"

namespace talbot::tests {

/// A node with one colour input and one shader output, wired into an output node.
inline scene::ShaderGraph one_node(const std::string& type, Rgb color, float strength = 1.0f) {
    using namespace scene;
    ShaderGraph graph;
    graph.name = type;
    Node node;
    node.type = node.name = "ShaderNode" + type;
    NodeInput in;
    in.identifier = "Color";
    in.kind = SocketKind::Color;
    in.value[0] = color.x, in.value[1] = color.y, in.value[2] = color.z, in.value[3] = 1;
    node.inputs.push_back(in);
    if (type == "Emission" || type == "Background") {
        NodeInput s;
        s.identifier = "Strength";
        s.value[0] = strength;
        node.inputs.push_back(s);
    } else {
        NodeInput roughness, normal;
        roughness.identifier = "Roughness";
        normal.identifier = "Normal";
        normal.kind = SocketKind::Vector;
        normal.hidden_value = true;
        node.inputs.push_back(roughness);
        node.inputs.push_back(normal);
    }
    const std::string out = type == "Emission" ? "Emission" : type == "Background" ? "Background" : "BSDF";
    node.outputs.push_back({out, SocketKind::Shader, {}});
    Node output;
    output.type = output.name = type == "Background" ? "ShaderNodeOutputWorld" : "ShaderNodeOutputMaterial";
    NodeInput surface;
    surface.identifier = "Surface";
    surface.kind = SocketKind::Shader;
    surface.from_node = 0;
    surface.from_output = out;
    output.inputs.push_back(surface);
    graph.nodes = {node, output};
    graph.output_node = 1;
    return graph;
}

/// Diffuse and emission added: albedo rho, radiance e.
inline scene::ShaderGraph glowing_diffuse(float rho, float e) {
    using namespace scene;
    ShaderGraph diffuse = one_node("BsdfDiffuse", {rho, rho, rho}), emission = one_node("Emission", {e, e, e});
    ShaderGraph graph;
    graph.name = "Glowing";
    Node add;
    add.type = add.name = "ShaderNodeAddShader";
    for (int i = 0; i < 2; ++i) {
        NodeInput in;
        in.identifier = i == 0 ? "Shader" : "Shader_001";
        in.kind = SocketKind::Shader;
        in.from_node = i;
        in.from_output = i == 0 ? "BSDF" : "Emission";
        add.inputs.push_back(in);
    }
    add.outputs.push_back({"Shader", SocketKind::Shader, {}});
    Node output = diffuse.nodes[1];
    output.inputs[0].from_node = 2;
    output.inputs[0].from_output = "Shader";
    graph.nodes = {diffuse.nodes[0], emission.nodes[0], add, output};
    graph.output_node = 3;
    return graph;
}

inline scene::Handle add_shader(scene::Scene& scene, const scene::ShaderGraph& graph) {
    scene::Shader shader;
    shader.name = graph.name;
    shader.graph = graph;
    scene.shaders.push_back(shader);
    return scene::Handle(scene.shaders.size() - 1);
}

/// A mesh of quads (four corners each), flat.
inline scene::Handle add_quads(scene::Scene& scene, const std::vector<Vec3>& corners) {
    auto mesh = std::make_shared<scene::Mesh>();
    mesh->name = "Quads";
    mesh->positions = corners;
    for (uint32_t q = 0; q < corners.size() / 4; ++q) {
        for (uint32_t k : {0u, 1u, 2u, 0u, 2u, 3u}) mesh->triangle_vertices.push_back(4 * q + k);
    }
    mesh->triangle_smooth.assign(mesh->triangle_count(), 0);
    scene.meshes.push_back(mesh);
    return scene::Handle(scene.meshes.size() - 1);
}

inline void add_object(scene::Scene& scene, scene::Handle mesh, scene::Handle shader) {
    scene::ObjectTraits traits;
    traits.mesh = mesh;
    scene.object_names.push_back("Object");
    traits.name = scene::Handle(scene.object_names.size() - 1);
    scene.material_sets.push_back({shader});
    traits.material_set = scene::Handle(scene.material_sets.size() - 1);
    place(scene, traits);
}

/// Six faces of the cube [-r, r]^3, seen from both sides.
inline std::vector<Vec3> cube(float r) {
    return {{-r, -r, -r}, {r, -r, -r}, {r, r, -r}, {-r, r, -r}, {-r, -r, r}, {-r, r, r}, {r, r, r}, {r, -r, r},
            {-r, -r, -r}, {-r, -r, r}, {r, -r, r}, {r, -r, -r}, {-r, r, -r}, {r, r, -r}, {r, r, r}, {-r, r, r},
            {-r, -r, -r}, {-r, r, -r}, {-r, r, r}, {-r, -r, r}, {r, -r, -r}, {r, -r, r}, {r, r, r}, {r, r, -r}};
}

inline void plain_settings(scene::Scene& scene, int width, int height, int samples) {
    scene.settings.width = width;
    scene.settings.height = height;
    scene.settings.samples = samples;
    scene.settings.clamp_indirect = 0;
    scene.settings.light_threshold = 0;
    scene.settings.filter = scene::PixelFilter::Box;
    scene.camera.view[0] = -0.5f, scene.camera.view[1] = 0.5f;
    scene.camera.view[2] = -0.5f * float(height) / float(width), scene.camera.view[3] = 0.5f * float(height) / float(width);
    scene.camera.clip_start = 0.001f;
}

/// The camera sits inside a box that glows and reflects.
inline scene::Scene furnace_box(float albedo, float emission) {
    scene::Scene scene;
    plain_settings(scene, 16, 16, 256);
    const scene::Handle shader = add_shader(scene, glowing_diffuse(albedo, emission));
    add_object(scene, add_quads(scene, cube(1.0f)), shader);
    return scene;
}

/// A grey box with an area lamp and a point lamp, seen from inside; every stage of the loop has something to do.
inline scene::Scene box_with_lamp() {
    scene::Scene scene;
    plain_settings(scene, 48, 40, 16);
    const scene::Handle grey = add_shader(scene, one_node("BsdfDiffuse", {0.6f, 0.5f, 0.4f}));
    const scene::Handle glow = add_shader(scene, one_node("Emission", {1, 2, 3}));
    add_object(scene, add_quads(scene, cube(2.0f)), grey);
    add_object(scene, add_quads(scene, {{-1, -1.5f, -1.5f}, {-0.6f, -1.5f, -1.5f}, {-0.6f, -1.1f, -1.5f}, {-1, -1.1f, -1.5f}}), glow);
    scene::Light area;
    area.type = scene::LightType::Area;
    area.power = 20;
    area.to_world.m[2][3] = 1.9f;
    scene::Light point;
    point.type = scene::LightType::Point;
    point.power = 10;
    point.radius = 0.1f;
    point.to_world.m[0][3] = 1.2f;
    scene.lights = {area, point};
    return scene;
}

}  // namespace talbot::tests
