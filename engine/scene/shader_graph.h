/// A shader node tree as data: what the add-on sends and the shader compiler reads. Groups, reroutes, frames and muted
/// nodes are already resolved by the sender; links name node index and output identifier.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <variant>
#include <vector>

#include "base/vec.h"

namespace talbot::scene {

/// Kinds of socket, by Blender's meaning. Implicit conversions between them are the compiler's.
enum class SocketKind : uint8_t { Float, Int, Bool, Vector, Color, Shader };

struct NodeInput {
    std::string identifier;  ///< Blender's socket.identifier ("Base Color", "Value_001"), unique within the node
    SocketKind kind = SocketKind::Float;
    float value[4] = {0, 0, 0, 0};  ///< used when unlinked; float, int and bool in value[0]
    bool hidden_value = false;      ///< unlinked means "the default of the situation" (normal, tangent, texture vector), not value
    int from_node = -1;             ///< index into ShaderGraph::nodes, -1: unlinked
    std::string from_output;        ///< identifier of that node's output
};

struct NodeOutput {
    std::string identifier;
    SocketKind kind = SocketKind::Float;
    float value[4] = {0, 0, 0, 0};  ///< the stored value, for nodes that have it there (Value, RGB, Normal)
};

/// A node's property: number, string (also enum items, by Blender's identifier), or a table of floats (curves, ramps, matrices).
using Property = std::variant<double, std::string, std::vector<float>>;

struct Node {
    std::string type;  ///< bl_idname, "ShaderNodeBsdfPrincipled"
    std::string name;  ///< for messages; includes group names ("Group > Noise Texture")
    std::map<std::string, Property> properties;
    std::vector<NodeInput> inputs;
    std::vector<NodeOutput> outputs;
};

/// Attached objects are sent as properties by fixed names:
///   color_ramp        table: n*4 floats RGBA sampled over 0..1 (n = 256 in 3.4, 257 later); color_ramp_constant = 1 for CONSTANT interpolation
///   mapping           table: n*4 floats (combined-applied R, G, B curves; Float Curve: n*1), mapping_min, mapping_max, mapping_extend
///   ("HORIZONTAL"/"EXTRAPOLATED") texture_mapping   table: 12 floats, the row-major 3x4 map of the node's texture_mapping; absent when identity image number:
///   handle into Scene::images, -1 when the node has none (a missing file is a valid handle whose Image reads as magenta) object_matrix     table: 12 floats,
///   world-to-object of the node's object (Texture Coordinate, Vector nodes)
struct ShaderGraph {
    std::string name;  ///< "Material 'Glass'", for messages
    std::vector<Node> nodes;
    int output_node = -1;  ///< the Material/World/Light Output that counts; -1: none (black)
};

}  // namespace talbot::scene
