// Nodes that read the shading point, the object, the path or stored values.
#include "shader/catalogue.h"
#include "shader/graph_compiler.h"

namespace talbot::shader {
namespace {

void compile_value(NodeContext& n) {
    const scene::NodeOutput* output = n.output("Value");
    n.set("Value", n.e.constant(output ? output->value[0] : 0.0f));
}

void compile_rgb(NodeContext& n) {
    const scene::NodeOutput* output = n.output("Color");
    n.set_color("Color", output ? n.e.constant3(output->value[0], output->value[1], output->value[2]) : n.e.literal3(0, 0, 0));
}

constexpr CatalogueEntry kEntries[] = {
    {"ShaderNodeValue", compile_value},
    {"ShaderNodeRGB", compile_rgb},
};

}  // namespace

std::span<const CatalogueEntry> input_nodes() {
    return kEntries;
}

}  // namespace talbot::shader
