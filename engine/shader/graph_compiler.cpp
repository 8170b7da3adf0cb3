#include "shader/graph_compiler.h"

#include <algorithm>
#include <cmath>

#include "shader/catalogue.h"
#include "shader/closure_nodes.h"

namespace talbot::shader {
namespace {

constexpr int kMaxDepth = 600;  // of nested nodes; deeper trees are a mistake or an attack on the stack

bool is_mix(const scene::Node& node) {
    return node.type == "ShaderNodeMixShader";
}
bool is_add(const scene::Node& node) {
    return node.type == "ShaderNodeAddShader";
}

const scene::NodeInput* find_input(const scene::Node& node, const std::string& identifier) {
    for (const scene::NodeInput& input : node.inputs)
        if (input.identifier == identifier) return &input;
    return nullptr;
}

const scene::NodeOutput* find_output(const scene::Node& node, const std::string& identifier) {
    for (const scene::NodeOutput& output : node.outputs)
        if (output.identifier == identifier) return &output;
    return nullptr;
}

bool has_shader_output(const scene::Node& node) {
    return std::any_of(node.outputs.begin(), node.outputs.end(), [](const auto& o) { return o.kind == scene::SocketKind::Shader; });
}

}  // namespace

GraphCompiler::GraphCompiler(const scene::Shader& shader_, const scene::Scene& scene_, scene::SceneTables& tables_, Expressions& expressions, Report& report,
                             SkyCache& skies_)
    : shader(shader_), scene(scene_), tables(tables_), e(expressions), skies(skies_), semantics(semantics_of(scene_.settings.version)), report_(report) {
    shifts_.push_back({});
    for (const scene::Node& node : shader.graph.nodes)
        for (const scene::NodeInput& input : node.inputs)
            if (input.from_node >= 0) linked_outputs_.insert({input.from_node, input.from_output});
}

void GraphCompiler::warn(const scene::Node& node, const std::string& what) {
    const std::string& place = shader.graph.name.empty() ? shader.name : shader.graph.name;
    report_.warning(what, place + " > node '" + (node.name.empty() ? node.type : node.name) + "'");
}

int GraphCompiler::add_shift(const Shift& shift) {
    shifts_.push_back(shift);
    return int(shifts_.size()) - 1;
}

bool GraphCompiler::is_value_link(const scene::NodeInput& input) {
    if (input.from_node < 0 || size_t(input.from_node) >= shader.graph.nodes.size()) return false;
    const scene::Node& from = shader.graph.nodes[size_t(input.from_node)];
    const scene::NodeOutput* output = find_output(from, input.from_output);
    if (!output || output->kind == scene::SocketKind::Shader) return false;
    const bool known = find_value_node(from.type) != nullptr;
    if (!known && unknown_.insert(input.from_node).second) warn(from, "Node type '" + from.type + "' is not supported: its links count as unlinked");
    return known;
}

SocketValue GraphCompiler::output(int index, const std::string& identifier, int shift) {
    const scene::Node& node = shader.graph.nodes[size_t(index)];
    const auto zero = [this] {
        const Value z = e.literal(0);
        return SocketValue{scene::SocketKind::Color, {z, z, z}};
    };
    auto found = results_.find({index, shift});
    if (found == results_.end()) {
        if (active_.contains({index, shift})) {
            warn(node, "The node feeds itself (cyclic link): the link is ignored");
            return zero();
        }
        if (depth_ >= kMaxDepth) {
            warn(node, "Nodes are nested too deeply: this one reads as zero");
            return zero();
        }
        active_.insert({index, shift});
        ++depth_;
        results_[{index, shift}];
        run_node(index, shift);
        --depth_;
        active_.erase({index, shift});
        found = results_.find({index, shift});
    }
    const auto value = found->second.find(identifier);
    return value == found->second.end() ? zero() : value->second;
}

void GraphCompiler::run_node(int index, int shift) {
    NodeContext context(*this, index, shift);
    find_value_node(shader.graph.nodes[size_t(index)].type)(context);
}

int GraphCompiler::shader_source(const scene::NodeInput* input) const {
    if (!input || input->from_node < 0 || size_t(input->from_node) >= shader.graph.nodes.size()) return -1;
    const scene::NodeOutput* output = find_output(shader.graph.nodes[size_t(input->from_node)], input->from_output);
    return output && output->kind == scene::SocketKind::Shader ? input->from_node : -1;
}

void GraphCompiler::emit_value_link(const scene::Node& node, const scene::NodeInput& input, Value3 weight) {
    if (!is_value_link(input)) return;
    // Anything that is not a shader, linked to a shader socket, shines with that colour.
    NodeContext context(*this, int(&node - shader.graph.nodes.data()), 0);
    context.emission(e.mul(weight, context.color(input.identifier.c_str())));
}

void GraphCompiler::visit_shader(int index, std::set<int>& done, std::set<int>& active, std::vector<int>& order, int depth) {
    const scene::Node& node = shader.graph.nodes[size_t(index)];
    if (done.contains(index)) return;
    if (active.contains(index) || depth > kMaxDepth) {
        warn(node, active.contains(index) ? "The node feeds itself (cyclic link): the link is ignored" : "Nodes are nested too deeply");
        return;
    }
    active.insert(index);
    if (is_mix(node) || is_add(node)) {
        // Last first: the order is read backwards.
        for (const char* socket : {"Shader_001", "Shader"}) {
            const int child = shader_source(find_input(node, socket));
            if (child >= 0) visit_shader(child, done, active, order, depth + 1);
        }
    }
    active.erase(index);
    done.insert(index);
    order.push_back(index);
}

void GraphCompiler::add_weight(int node, Value3 weight) {
    const auto [it, is_new] = weights_.try_emplace(node, weight);
    if (!is_new) it->second = e.add(it->second, weight);
}

void GraphCompiler::mix_shaders(int root) {
    // Parents before children, so that a node reached along several links is compiled once, for the sum of its weights.
    std::set<int> done, active;
    std::vector<int> order;
    visit_shader(root, done, active, order, 0);
    add_weight(root, e.literal3(1, 1, 1));
    for (auto it = order.rbegin(); it != order.rend(); ++it) {
        const auto weight_of = weights_.find(*it);
        if (weight_of == weights_.end()) continue;  // only behind a factor of 0
        const Value3 weight = weight_of->second;
        const scene::Node& node = shader.graph.nodes[size_t(*it)];
        NodeContext context(*this, *it, 0);
        if (is_mix(node) || is_add(node)) {
            const Value factor = is_mix(node) ? e.saturate(context.value("Fac", 0.5f)) : Value{};
            const auto share = [&](const char* socket, bool second) {
                const scene::NodeInput* input = find_input(node, socket);
                if (!input) return;
                Value3 w = weight;
                if (is_mix(node)) {
                    if (e.is(factor, second ? 0.0f : 1.0f)) return;
                    if (!e.is(factor, second ? 1.0f : 0.0f)) w = e.mul(weight, second ? factor : e.one_minus(factor));
                }
                const int child = shader_source(input);
                if (child >= 0 && done.contains(child)) add_weight(child, w);
                if (child < 0) emit_value_link(node, *input, w);
            };
            share("Shader", false);
            share("Shader_001", true);
            continue;
        }
        if (const ClosureNode compile = find_closure_node(node.type)) {
            compile(context, weight);
            continue;
        }
        const bool has_color = context.has("Color") || context.has("Base Color");
        warn(node, "Shader node '" + node.type + "' is not supported: " + (has_color ? "drawn as a Diffuse BSDF of its colour" : "nothing is drawn for it"));
        if (has_color) {
            const Value3 color = context.color(context.has("Base Color") ? "Base Color" : "Color");
            context.closure(ClosureType::Diffuse, LobeKind::Diffuse, e.mul(weight, color), context.normal());
        }
    }
}

void GraphCompiler::displace(const scene::Node& output) {
    const scene::NodeInput* displacement = find_input(output, "Displacement");
    if (!displacement || !is_value_link(*displacement)) return;
    // Evaluated as a shift by nothing, so that nodes which are shared with the surface are not remembered with the plain normal.
    const Value zero = e.literal(0);
    const int here = add_shift({{zero, zero, zero}, e.input(InputColumn::BarycentricU), e.input(InputColumn::BarycentricV), {}});
    NodeContext context(*this, int(&output - shader.graph.nodes.data()), here);
    const Value width = e.literal(semantics.displacement_width);
    if (shader.displacement != scene::DisplacementMethod::Bump) {
        values.displacement = context.vector("Displacement");
        if (shader.displacement == scene::DisplacementMethod::Both) values.normal = bend_undisplaced_normal(context, width);
        return;
    }
    // The height along the normal bends the normal that all nodes then see.
    BumpRequest request;
    request.normal = context.shading_normal();
    request.height = [this, &request](NodeContext& at) { return e.dot(at.vector("Displacement"), request.normal); };
    request.strength = request.distance = e.literal(1);
    request.width = width;
    values.normal = bend_normal(context, request);
}

void GraphCompiler::write_aovs() {
    for (size_t aov = 0; aov < scene.aovs.size(); ++aov) {
        Value3 sum;
        int nodes = 0;
        for (size_t index = 0; index < shader.graph.nodes.size(); ++index) {
            NodeContext context(*this, int(index), 0);
            if (context.node.type != "ShaderNodeOutputAOV" || context.text("aov_name") != scene.aovs[aov].name) continue;
            const Value3 value = scene.aovs[aov].is_color ? context.color("Color") : e.spread(context.value("Value"));
            sum = nodes++ > 0 ? e.add(sum, value) : value;
        }
        if (nodes > 0) values.aovs.push_back({aov, sum, nodes});
    }
}

ShaderValues GraphCompiler::compile() {
    const scene::ShaderGraph& graph = shader.graph;
    if (graph.output_node < 0 || size_t(graph.output_node) >= graph.nodes.size()) return values;
    const scene::Node& output = graph.nodes[size_t(graph.output_node)];
    const scene::NodeInput* surface = find_input(output, "Surface");
    const scene::NodeInput* volume = find_input(output, "Volume");
    values.has_volume = volume && volume->from_node >= 0;
    if (values.has_volume) warn(output, "Volume shaders are not supported yet: the volume is left out");
    displace(output);
    if (surface && surface->from_node >= 0) {
        const int root = shader_source(surface);
        if (root >= 0) {
            mix_shaders(root);
        } else if (is_value_link(*surface)) {
            emit_value_link(output, *surface, e.literal3(1, 1, 1));
        } else if (size_t(surface->from_node) < graph.nodes.size() && has_shader_output(graph.nodes[size_t(surface->from_node)])) {
            mix_shaders(surface->from_node);
        } else {
            warn(output, "The link to Surface comes from a socket that does not exist: nothing is drawn");
        }
    } else if (values.has_volume && output.type == "ShaderNodeOutputMaterial") {
        // A volume without a surface is only seen through: with the volume left out nothing of it remains.
        NodeContext(*this, graph.output_node, 0).transparent(e.literal3(1, 1, 1));
    }
    write_aovs();
    return values;
}

}  // namespace talbot::shader
