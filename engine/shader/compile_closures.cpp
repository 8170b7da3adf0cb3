#include <unordered_map>

#include "shader/closure_nodes.h"

namespace talbot::shader {
namespace {

void compile_diffuse(NodeContext& n, Value3 weight) {
    n.closure(ClosureType::Diffuse, LobeKind::Diffuse, n.e.mul(weight, n.color("Color")), n.normal());
}
void compile_emission(NodeContext& n, Value3 weight) {
    n.emission(n.e.mul(weight, n.e.mul(n.color("Color"), n.value("Strength", 1))));
}
void compile_transparent(NodeContext& n, Value3 weight) {
    n.transparent(n.e.mul(weight, n.color("Color")));
}
void compile_holdout(NodeContext& n, Value3 weight) {
    n.holdout(weight);
}

}  // namespace

ClosureNode find_closure_node(const std::string& type) {
    static const std::unordered_map<std::string, ClosureNode> nodes{
        {"ShaderNodeBsdfDiffuse", compile_diffuse},         {"ShaderNodeEmission", compile_emission}, {"ShaderNodeBackground", compile_emission},
        {"ShaderNodeBsdfTransparent", compile_transparent}, {"ShaderNodeHoldout", compile_holdout},
    };
    const auto found = nodes.find(type);
    return found == nodes.end() ? nullptr : found->second;
}

}  // namespace talbot::shader
