/// One shader's node graph -> expressions: follows links, converts sockets, mixes shader nodes, and keeps what comes out.
#pragma once

#include <functional>
#include <map>
#include <set>
#include <string>
#include <unordered_map>
#include <vector>

#include "base/error.h"
#include "scene/scene.h"
#include "scene/view.h"
#include "shader/node_context.h"
#include "shader/sky.h"

namespace talbot::shader {

/// A closure before registers are known.
struct SlotValues {
    ClosureType type = ClosureType::Diffuse;
    LobeKind lobe = LobeKind::Diffuse;
    uint8_t variant = 0;
    Value3 weight, normal;
    std::vector<Value> params;
};

/// One of Scene::aovs, and what the shader gives it: the sum of its `nodes` AOV Output nodes of that name.
struct AovExpression {
    size_t aov = 0;
    Value3 value;
    int nodes = 0;
};

/// Everything the graph's outputs ask for.
struct ShaderValues {
    std::vector<SlotValues> slots;
    Value3 emission;      ///< not valid: none
    Value3 transparency;  ///< not valid: opaque
    Value3 normal;        ///< bent by displacement; not valid: the span's own
    Value3 displacement;  ///< world-space offset of vertices; not valid: they stay
    std::vector<AovExpression> aovs;
    bool has_bump = false;
    bool has_volume = false;  ///< linked, though left out: shadows see through such a surface whatever the material says
    SunDisc sun;
};

/// Coordinates of one shifted evaluation (Bump): world offset and the barycentrics there. With a `normal` (world space) the point is the one that true
/// displacement has moved away, and that is its normal.
struct Shift {
    Value3 offset;
    Value u, v;
    Value3 normal;
};

/// The normal bent by a height over the surface, as the Bump node does it.
struct BumpRequest {
    std::function<Value(NodeContext& at)> height;  ///< called for the point itself and for two shifted ones
    Value3 normal;
    Value strength, distance, width;  ///< width: of the finite difference, in footprints
};
Value3 bend_normal(NodeContext& node, const BumpRequest& request);  ///< compile_vectors.cpp
/// The undisplaced surface's normal bent by the displacement (the output node's), whose vertices it moves as well: what the mesh is too coarse for.
Value3 bend_undisplaced_normal(NodeContext& output, Value width);

class GraphCompiler {
public:
    GraphCompiler(const scene::Shader& shader, const scene::Scene& scene, scene::SceneTables& tables, Expressions& expressions, Report& report,
                  SkyCache& skies);
    /// Compiles from the output node. Never throws for a bad graph.
    ShaderValues compile();

    // For NodeContext.
    SocketValue output(int node, const std::string& identifier, int shift);
    void set(int node, int shift, const char* identifier, SocketValue v) { results_[{node, shift}][identifier] = v; }
    bool is_linked_output(int node, const std::string& identifier) const { return linked_outputs_.contains({node, identifier}); }
    /// A link that counts: its source exists, is no shader, and its node is known. (Cycles leaves nodes out that it does not know: what they are linked to
    /// keeps its own value.)
    bool is_value_link(const scene::NodeInput& input);
    int add_shift(const Shift& shift);
    const Shift& shift(int index) const { return shifts_[size_t(index)]; }
    void warn(const scene::Node& node, const std::string& what);

    const scene::Shader& shader;
    const scene::Scene& scene;
    scene::SceneTables& tables;
    Expressions& e;
    SkyCache& skies;
    Semantics semantics;
    ShaderValues values;

private:
    void run_node(int node, int shift);
    void displace(const scene::Node& output);
    void write_aovs();
    void mix_shaders(int root);
    void visit_shader(int node, std::set<int>& done, std::set<int>& active, std::vector<int>& order, int depth);
    void add_weight(int node, Value3 weight);
    /// The input's shader node, -1 for none; a link to a value socket is compiled as emission of `weight`.
    int shader_source(const scene::NodeInput* input) const;
    void emit_value_link(const scene::Node& node, const scene::NodeInput& input, Value3 weight);

    Report& report_;
    std::map<std::pair<int, int>, std::map<std::string, SocketValue>> results_;  ///< by (node, shift)
    std::set<std::pair<int, int>> active_;                                       ///< being compiled, for cycles
    std::set<std::pair<int, std::string>> linked_outputs_;
    std::set<int> unknown_;  ///< nodes that were warned about
    std::unordered_map<int, Value3> weights_;
    std::vector<Shift> shifts_;
    int depth_ = 0;
};

}  // namespace talbot::shader
