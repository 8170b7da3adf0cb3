// Nodes that look around the shading point: Ambient Occlusion, Bevel, Raycast, Wireframe.
#include "shader/catalogue.h"
#include "shader/graph_compiler.h"

namespace talbot::shader {
namespace {

/// Number of samples, and a number that tells the node's random numbers from those of others.
uint32_t sampling(NodeContext& n, double fallback) {
    const uint32_t samples = uint32_t(clampf(float(n.number("samples", fallback)), 1, 128));
    return samples | uint32_t(n.index & 0xffff) << 8;
}

void compile_ambient_occlusion(NodeContext& n) {
    Expressions& e = n.e;
    const Value3 normal = n.normal();
    Value distance = n.value("Distance", 1);
    if (!n.linked("Distance") && e.is(distance, 0)) {
        n.warn("Ambient Occlusion with distance 0 asks for the world's own distance, which is not known here: 10 m are used");
        distance = e.literal(10);
    }
    const uint8_t variant = uint8_t((n.flag("inside") ? 1 : 0) | (n.flag("only_local") ? 2 : 0));
    const Value open = e.emit(Op::Occlusion, variant, {normal.x, normal.y, normal.z, distance}, 1, sampling(n, 16));
    n.set("AO", open);
    n.set_color("Color", e.mul(n.color("Color", {1, 1, 1}), open));
}

void compile_bevel(NodeContext& n) {
    Expressions& e = n.e;
    Value3 normal = e.emit3(Op::Bevel, 0, {n.value("Radius", 0.05f)}, sampling(n, 4));
    // A bent normal keeps its bend.
    if (n.linked("Normal")) normal = e.normalize(e.add(n.normal(), e.sub(normal, e.input3(InputColumn::NormalX))));
    n.set_vector("Normal", normal);
}

void compile_raycast(NodeContext& n) {
    Expressions& e = n.e;
    const Value3 p = n.linked("Position") ? n.vector("Position") : n.position();
    const Value3 d = n.linked("Direction") ? n.vector("Direction") : e.input3(InputColumn::NormalX);
    const Value hit = e.emit(Op::Raycast, n.flag("only_local") ? 1 : 0, {p.x, p.y, p.z, d.x, d.y, d.z, n.value("Length", 1)}, 13);
    n.set("Is Hit", hit);
    n.set("Self Hit", e.after(hit, 1));
    n.set("Hit Distance", e.after(hit, 2));
    n.set_vector("Hit Position", e.triple(e.after(hit, 3)));
    n.set_vector("Hit Normal", e.triple(e.after(hit, 6)));
    // Attributes of what was hit: socket "Attribute_3" shows the one whose name is the property "attribute_3".
    for (const scene::NodeOutput& output : n.node.outputs) {
        static constexpr std::string_view prefix = "Attribute_";
        if (!output.identifier.starts_with(prefix)) continue;
        const std::string name = n.text(("attribute_" + output.identifier.substr(prefix.size())).c_str());
        const uint32_t id = uint32_t(n.graph().tables.attribute_id(name));
        const Value a = e.emit(Op::AttributeAt, 0, {e.after(hit, 9), e.after(hit, 10), e.after(hit, 11), e.after(hit, 12)}, 5, id);
        if (output.kind == scene::SocketKind::Float) {
            n.set(output.identifier.c_str(), e.after(a, 4));
        } else if (output.kind == scene::SocketKind::Vector) {
            n.set_vector(output.identifier.c_str(), e.triple(a));
        } else {
            n.set_color(output.identifier.c_str(), e.triple(a));
        }
    }
}

void compile_wireframe(NodeContext& n) {
    const Value3 p = n.position();
    n.set("Fac", n.e.emit(Op::Wireframe, n.flag("use_pixel_size") ? 1 : 0, {n.value("Size", 0.01f), p.x, p.y, p.z}));
}

constexpr CatalogueEntry kEntries[] = {
    {"ShaderNodeAmbientOcclusion", compile_ambient_occlusion},
    {"ShaderNodeBevel", compile_bevel},
    {"ShaderNodeRaycast", compile_raycast},
    {"ShaderNodeWireframe", compile_wireframe},
};

}  // namespace

std::span<const CatalogueEntry> neighbourhood_nodes() {
    return kEntries;
}

}  // namespace talbot::shader
