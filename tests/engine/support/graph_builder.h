// Shader graphs written down in a few lines, as the add-on would send them.
//
//     GraphBuilder g;
//     const int noise = g.node("ShaderNodeTexNoise").set("Scale", 1.3f).text("noise_dimensions", "3D").id();
//     g.surface(g.emission(g.out(noise, "Fac", SocketKind::Float)));
#pragma once

#include <string>

#include "scene/scene.h"

namespace talbot::test {

using scene::SocketKind;

struct Socket {
    int node = -1;
    std::string identifier;
    SocketKind kind = SocketKind::Color;
};

class GraphBuilder;

class NodeBuilder {
public:
    NodeBuilder(GraphBuilder& graph, int index) : graph_(graph), index_(index) {}
    NodeBuilder& set(const std::string& identifier, float x) { return put(identifier, SocketKind::Float, x, 0, 0); }
    NodeBuilder& set(const std::string& identifier, Vec3 v) { return put(identifier, SocketKind::Vector, v.x, v.y, v.z); }
    NodeBuilder& color(const std::string& identifier, Rgb v) { return put(identifier, SocketKind::Color, v.x, v.y, v.z); }
    inline NodeBuilder& link(const std::string& identifier, SocketKind kind, const Socket& from);
    inline NodeBuilder& text(const std::string& property, const std::string& value);
    inline NodeBuilder& number(const std::string& property, double value);
    inline NodeBuilder& table(const std::string& property, std::vector<float> value);
    int id() const { return index_; }

private:
    inline NodeBuilder& put(const std::string& identifier, SocketKind kind, float x, float y, float z);
    GraphBuilder& graph_;
    int index_;
};

class GraphBuilder {
public:
    NodeBuilder node(const std::string& type) {
        scene::Node n;
        n.type = type;
        n.name = type.substr(type.find("Node") == std::string::npos ? 0 : type.find("Node") + 4) + " " + std::to_string(shader.graph.nodes.size());
        shader.graph.nodes.push_back(n);
        return {*this, int(shader.graph.nodes.size()) - 1};
    }
    Socket out(int node, const std::string& identifier, SocketKind kind) {
        auto& outputs = shader.graph.nodes[size_t(node)].outputs;
        for (const auto& o : outputs)
            if (o.identifier == identifier) return {node, identifier, o.kind};
        outputs.push_back({identifier, kind, {}});
        return {node, identifier, kind};
    }
    Socket value(float x) {
        const Socket s = out(node("ShaderNodeValue").id(), "Value", SocketKind::Float);
        shader.graph.nodes[size_t(s.node)].outputs[0].value[0] = x;
        return s;
    }
    Socket rgb(Rgb c) {
        const Socket s = out(node("ShaderNodeRGB").id(), "Color", SocketKind::Color);
        float* v = shader.graph.nodes[size_t(s.node)].outputs[0].value;
        v[0] = c.x;
        v[1] = c.y;
        v[2] = c.z;
        v[3] = 1;
        return s;
    }
    Socket xyz(Vec3 v) { return out(node("ShaderNodeCombineXYZ").set("X", v.x).set("Y", v.y).set("Z", v.z).id(), "Vector", SocketKind::Vector); }
    /// Coordinates that the compiler cannot fold: the shading point's position.
    Socket position() { return out(node("ShaderNodeNewGeometry").id(), "Position", SocketKind::Vector); }
    Socket emission(const Socket& color) {
        return out(node("ShaderNodeEmission").link("Color", SocketKind::Color, color).set("Strength", 1.0f).id(), "Emission", SocketKind::Shader);
    }
    Socket emission(Rgb color, float strength) {
        return out(node("ShaderNodeEmission").color("Color", color).set("Strength", strength).id(), "Emission", SocketKind::Shader);
    }
    Socket diffuse(Rgb color) { return out(node("ShaderNodeBsdfDiffuse").color("Color", color).id(), "BSDF", SocketKind::Shader); }
    Socket transparent(Rgb color) { return out(node("ShaderNodeBsdfTransparent").color("Color", color).id(), "BSDF", SocketKind::Shader); }
    Socket mix(float factor, const Socket& a, const Socket& b) {
        const int n = node("ShaderNodeMixShader").set("Fac", factor).link("Shader", SocketKind::Shader, a).link("Shader_001", SocketKind::Shader, b).id();
        return out(n, "Shader", SocketKind::Shader);
    }
    Socket add(const Socket& a, const Socket& b) {
        const int n = node("ShaderNodeAddShader").link("Shader", SocketKind::Shader, a).link("Shader_001", SocketKind::Shader, b).id();
        return out(n, "Shader", SocketKind::Shader);
    }
    GraphBuilder& surface(const Socket& from) {
        shader.graph.output_node = node("ShaderNodeOutputMaterial").link("Surface", SocketKind::Shader, from).id();
        return *this;
    }

    scene::Shader shader;
};

inline NodeBuilder& NodeBuilder::put(const std::string& identifier, SocketKind kind, float x, float y, float z) {
    graph_.shader.graph.nodes[size_t(index_)].inputs.push_back({identifier, kind, {x, y, z, 1}, false, -1, {}});
    return *this;
}
inline NodeBuilder& NodeBuilder::link(const std::string& identifier, SocketKind kind, const Socket& from) {
    graph_.shader.graph.nodes[size_t(index_)].inputs.push_back({identifier, kind, {}, false, from.node, from.identifier});
    return *this;
}
inline NodeBuilder& NodeBuilder::text(const std::string& property, const std::string& value) {
    graph_.shader.graph.nodes[size_t(index_)].properties[property] = value;
    return *this;
}
inline NodeBuilder& NodeBuilder::number(const std::string& property, double value) {
    graph_.shader.graph.nodes[size_t(index_)].properties[property] = value;
    return *this;
}
inline NodeBuilder& NodeBuilder::table(const std::string& property, std::vector<float> value) {
    graph_.shader.graph.nodes[size_t(index_)].properties[property] = std::move(value);
    return *this;
}

}  // namespace talbot::test
