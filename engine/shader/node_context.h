/// What a node's compile function sees: its sockets as expressions, its properties, and where results go.
///
/// A node that is not a shader sets its outputs (`set`, `set_color`, `set_vector`); it may set more than anybody reads: unread expressions are
/// dropped. A shader node adds closures for the weight it is given (throughput of the Mix and Add Shader nodes above it).
/// Colours and vectors are three values; angles in radians. `shift` tells which of a Bump node's three coordinate points this evaluation is for.
#pragma once

#include <string>
#include <vector>

#include "scene/shader_graph.h"
#include "shader/expressions.h"
#include "shader/versions.h"

namespace talbot::shader {

class GraphCompiler;

/// A socket's value during compilation; scalars use v.x.
struct SocketValue {
    scene::SocketKind kind = scene::SocketKind::Float;
    Value3 v;
};

class NodeContext {
public:
    NodeContext(GraphCompiler& graph, int index, int shift);

    Expressions& e;  ///< where expressions are made
    const scene::Node& node;
    const Semantics& semantics;  ///< what the file's Blender version means
    int index, shift;

    // Inputs, by Blender's socket identifier. Converted to the kind asked for; a missing socket gives the fallback.
    Value value(const char* identifier, float fallback = 0);
    Value3 color(const char* identifier, Rgb fallback = {});
    Value3 vector(const char* identifier, Vec3 fallback = {});
    bool has(const char* identifier) const { return find(identifier) != nullptr; }
    bool linked(const char* identifier) const;
    bool output_linked(const char* identifier) const;
    /// Unlinked: the shading normal, towards the viewer. Linked: as it comes, not normalised. World space.
    Value3 normal(const char* identifier = "Normal");
    /// Unlinked: the default tangent, along curves or radial around the generated Z axis; none on points. World space.
    Value3 tangent(const char* identifier = "Tangent");
    /// Input "Vector" of a texture node; unlinked: generated coordinates. The node's texture mapping is applied.
    Value3 texture_vector();
    Value3 texture_mapping(Value3 v);

    // Properties, by Blender's name.
    std::string text(const char* property, const std::string& fallback = {}) const;
    double number(const char* property, double fallback = 0) const;
    bool flag(const char* property, bool fallback = false) const { return number(property, fallback) != 0; }
    const std::vector<float>* table(const char* property) const;
    /// Place of the property's text in a list of enum identifiers; an unknown one is reported and gives `fallback`.
    int choice(const char* property, std::initializer_list<const char*> identifiers, int fallback = 0);

    // Results of ordinary nodes, by output identifier.
    void set(const char* identifier, Value v);
    void set_color(const char* identifier, Value3 v);
    void set_vector(const char* identifier, Value3 v);
    const scene::NodeOutput* output(const char* identifier) const;

    // Results of shader nodes. Normals are unit vectors in world space.
    /// Adds a slot. Parameters in the order closure.h documents for the type.
    void closure(ClosureType type, LobeKind lobe, Value3 weight, Value3 normal, std::vector<Value> params = {}, uint8_t variant = 0);
    /// Adds radiance towards the viewer, W/(m2 sr).
    void emission(Value3 radiance);
    /// Light goes straight on with this weight.
    void transparent(Value3 weight);
    void holdout(Value3 weight);

    // The shading point, shifted where a Bump node asks for it.
    Value3 position();  ///< world; background: the direction
    /// `or_world`: curves and points that have none say their position in world space instead of object space.
    Value3 generated(bool or_world = false);
    Value barycentric_u();
    Value barycentric_v();
    Value3 shading_normal();  ///< bent by displacement
    Value3 geometric_normal() { return e.input3(InputColumn::GeometricX); }
    Value3 incoming() { return e.input3(InputColumn::IncomingX); }
    /// Four components of a mesh (or object) attribute, and what a number reads of them.
    std::array<Value, 5> attribute(const std::string& name, AttributeSource source = AttributeSource::Geometry);
    Value3 to_object(Value3 v, TransformKind kind);
    Value3 affine(const std::vector<float>& matrix, Value3 v, int variant);
    Value luminance(Value3 color);

    /// One line in the report, with this node's name.
    void warn(const std::string& what);
    GraphCompiler& graph() { return graph_; }

private:
    const scene::NodeInput* find(const char* identifier) const;
    GraphCompiler& graph_;
};

}  // namespace talbot::shader
