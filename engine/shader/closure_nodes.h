/// Shader nodes (those with a closure socket) and their compile functions. `weight` is the node's share of the surface: the product of the
/// Mix and Add Shader factors above it, per channel. A function reads its sockets and adds slots, emission or transparency through
/// `NodeContext`, each multiplied by the weight:
///
///     void compile_diffuse(NodeContext& n, Value3 weight) {
///         n.closure(ClosureType::Diffuse, LobeKind::Diffuse, n.e.mul(weight, n.color("Color")), n.normal());
///     }
///
/// Mixing itself (Mix Shader, Add Shader) is the graph compiler's, not a function here.
#pragma once

#include <string>

#include "shader/node_context.h"

namespace talbot::shader {

using ClosureNode = void (*)(NodeContext& node, Value3 weight);

/// Null for a type that is not (yet) known as a shader node.
ClosureNode find_closure_node(const std::string& type);

}  // namespace talbot::shader
