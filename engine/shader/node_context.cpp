#include "shader/node_context.h"

#include <array>
#include <cmath>

#include "shader/graph_compiler.h"

namespace talbot::shader {
namespace {

constexpr float kHuge = 1e18f;  // its square is still a number

bool is_scalar(scene::SocketKind kind) {
    return kind == scene::SocketKind::Float || kind == scene::SocketKind::Int || kind == scene::SocketKind::Bool;
}

}  // namespace

NodeContext::NodeContext(GraphCompiler& graph, int index_, int shift_)
    : e(graph.e), node(graph.shader.graph.nodes[size_t(index_)]), semantics(graph.semantics), index(index_), shift(shift_), graph_(graph) {}

const scene::NodeInput* NodeContext::find(const char* identifier) const {
    for (const scene::NodeInput& input : node.inputs)
        if (input.identifier == identifier) return &input;
    return nullptr;
}

bool NodeContext::linked(const char* identifier) const {
    const scene::NodeInput* input = find(identifier);
    return input && graph_.is_value_link(*input);
}

bool NodeContext::output_linked(const char* identifier) const {
    return graph_.is_linked_output(index, identifier);
}

void NodeContext::warn(const std::string& what) {
    graph_.warn(node, what);
}

Value NodeContext::luminance(Value3 color) {
    const float* w = graph_.scene.settings.luminance_weights;
    return e.add(e.add(e.mul(color.x, w[0]), e.mul(color.y, w[1])), e.mul(color.z, w[2]));
}

Value NodeContext::value(const char* identifier, float fallback) {
    const scene::NodeInput* input = find(identifier);
    if (!input) return e.literal(fallback);
    if (!graph_.is_value_link(*input)) {
        // Colour and vector sockets keep their first component here: only scalar sockets are asked for as a value.
        float x = input->value[0];
        if (!(std::fabs(x) <= kHuge)) {
            warn(std::string("Socket '") + identifier + "' holds " + (std::isfinite(x) ? "a huge number" : "no finite number") + ": limited");
            x = std::isnan(x) ? 0.0f : std::copysign(kHuge, x);
        }
        return e.constant(x);
    }
    const SocketValue from = graph_.output(input->from_node, input->from_output, shift);
    Value x = from.v.x;
    if (from.kind == scene::SocketKind::Color) x = luminance(from.v);
    if (from.kind == scene::SocketKind::Vector) x = e.mul(e.add(e.add(from.v.x, from.v.y), from.v.z), 1.0f / 3.0f);
    if (input->kind == scene::SocketKind::Int) x = e.unary(UnaryKind::Truncate, x);
    if (input->kind == scene::SocketKind::Bool) x = e.select(x, e.literal(1), e.literal(0));
    return x;
}

Value3 NodeContext::vector(const char* identifier, Vec3 fallback) {
    const scene::NodeInput* input = find(identifier);
    if (!input) return e.literal3(fallback.x, fallback.y, fallback.z);
    if (graph_.is_value_link(*input)) {
        const SocketValue from = graph_.output(input->from_node, input->from_output, shift);
        return is_scalar(from.kind) ? e.spread(from.v.x) : from.v;
    }
    if (is_scalar(input->kind)) return e.spread(value(identifier));
    std::array<float, 3> x;
    for (size_t i = 0; i < 3; ++i) {
        x[i] = input->value[i];
        if (std::fabs(x[i]) <= kHuge) continue;
        warn(std::string("Socket '") + identifier + "' holds " + (std::isfinite(x[i]) ? "a huge number" : "no finite number") + ": limited");
        x[i] = std::isnan(x[i]) ? 0.0f : std::copysign(kHuge, x[i]);
    }
    return e.constant3(x[0], x[1], x[2]);
}

Value3 NodeContext::color(const char* identifier, Rgb fallback) {
    return vector(identifier, fallback);
}

Value3 NodeContext::normal(const char* identifier) {
    if (!linked(identifier)) return shading_normal();
    const Value3 v = vector(identifier), n = shading_normal();
    return e.emit3(Op::Vector, uint8_t(VectorKind::SafeNormal), {v.x, v.y, v.z, n.x, n.y, n.z});
}

Value3 NodeContext::tangent(const char* identifier) {
    if (linked(identifier)) return vector(identifier);
    // Along curves, else radial around Z of the generated coordinates: the tangent of a lathe.
    const Value3 g = generated();
    const Value3 t{e.negate(e.add(g.y, -0.5f)), e.add(g.x, -0.5f), e.literal(0)};
    const Value3 n = shading_normal();
    const Value3 world = to_object(t, TransformKind::NormalToWorld);
    const Value3 radial = e.cross(n, e.normalize(e.cross(world, n)));
    return e.emit3(Op::CurveTangent, uint8_t(NoCurve::Given), {radial.x, radial.y, radial.z});
}

Value3 NodeContext::texture_mapping(Value3 v) {
    const std::vector<float>* matrix = table("texture_mapping");
    return matrix && matrix->size() == 12 ? affine(*matrix, v, 0) : v;
}

Value3 NodeContext::texture_vector() {
    const bool has_link = linked("Vector");
    return texture_mapping(has_link ? vector("Vector") : generated());
}

std::string NodeContext::text(const char* property, const std::string& fallback) const {
    const auto found = node.properties.find(property);
    if (found == node.properties.end()) return fallback;
    const std::string* s = std::get_if<std::string>(&found->second);
    return s ? *s : fallback;
}

double NodeContext::number(const char* property, double fallback) const {
    const auto found = node.properties.find(property);
    if (found == node.properties.end()) return fallback;
    const double* x = std::get_if<double>(&found->second);
    return x && std::isfinite(*x) ? *x : fallback;
}

const std::vector<float>* NodeContext::table(const char* property) const {
    const auto found = node.properties.find(property);
    return found == node.properties.end() ? nullptr : std::get_if<std::vector<float>>(&found->second);
}

int NodeContext::choice(const char* property, std::initializer_list<const char*> identifiers, int fallback) {
    const auto found = node.properties.find(property);
    if (found == node.properties.end()) return fallback;
    const std::string& s = text(property);
    int i = 0;
    for (const char* identifier : identifiers) {
        if (s == identifier) return i;
        ++i;
    }
    warn(std::string("Unknown choice '") + s + "' of " + property + ": '" + identifiers.begin()[fallback] + "' is used");
    return fallback;
}

void NodeContext::set(const char* identifier, Value v) {
    graph_.set(index, shift, identifier, {scene::SocketKind::Float, {v, v, v}});
}
void NodeContext::set_color(const char* identifier, Value3 v) {
    graph_.set(index, shift, identifier, {scene::SocketKind::Color, v});
}
void NodeContext::set_vector(const char* identifier, Value3 v) {
    graph_.set(index, shift, identifier, {scene::SocketKind::Vector, v});
}

const scene::NodeOutput* NodeContext::output(const char* identifier) const {
    for (const scene::NodeOutput& output : node.outputs)
        if (output.identifier == identifier) return &output;
    return nullptr;
}

void NodeContext::closure(ClosureType type, LobeKind lobe, Value3 weight, Value3 normal, std::vector<Value> params, uint8_t variant) {
    if (e.is_zero(weight)) return;
    if (params.size() > size_t(kMaxClosureParams) || graph_.values.slots.size() >= size_t(kMaxSlots)) {
        warn("Too many closures in one shader: some are dropped");
        return;
    }
    graph_.values.slots.push_back({type, lobe, variant, weight, normal, std::move(params)});
}

void NodeContext::emission(Value3 radiance) {
    if (e.is_zero(radiance)) return;
    Value3& sum = graph_.values.emission;
    sum = sum.valid() ? e.add(sum, radiance) : radiance;
}

void NodeContext::transparent(Value3 weight) {
    if (e.is_zero(weight)) return;
    closure(ClosureType::Transparent, LobeKind::Transparent, weight, shading_normal());
    Value3& sum = graph_.values.transparency;
    sum = sum.valid() ? e.add(sum, weight) : weight;
}

void NodeContext::holdout(Value3 weight) {
    closure(ClosureType::Holdout, LobeKind::None, weight, shading_normal());
}

Value3 NodeContext::position() {
    const Shift& at = graph_.shift(shift);
    if (at.normal.valid()) {
        const auto p = attribute(scene::kUndisplaced);
        return to_object({p[0], p[1], p[2]}, TransformKind::PointToWorld);
    }
    const Value3 p = e.input3(InputColumn::PositionX);
    return shift == 0 ? p : e.add(p, at.offset);
}

Value NodeContext::barycentric_u() {
    return shift == 0 ? e.input(InputColumn::BarycentricU) : graph_.shift(shift).u;
}
Value NodeContext::barycentric_v() {
    return shift == 0 ? e.input(InputColumn::BarycentricV) : graph_.shift(shift).v;
}

Value3 NodeContext::shading_normal() {
    const Shift& at = graph_.shift(shift);
    if (at.normal.valid()) return at.normal;
    const bool bent = shift == 0 && graph_.values.normal.valid();
    return bent ? graph_.values.normal : e.input3(InputColumn::NormalX);
}

Value3 NodeContext::generated(bool or_world) {
    const Value3 p = to_object(position(), TransformKind::PointToObject);
    const uint32_t id = uint32_t(graph_.tables.attribute_id("@generated"));
    return e.emit3(Op::Generated, or_world ? 1 : 0, {barycentric_u(), barycentric_v(), p.x, p.y, p.z}, id);
}

std::array<Value, 5> NodeContext::attribute(const std::string& name, AttributeSource source) {
    const uint32_t id = uint32_t(graph_.tables.attribute_id(name));
    const Value v = e.emit(Op::Attribute, uint8_t(source), {barycentric_u(), barycentric_v()}, 5, id);
    return {v, e.after(v, 1), e.after(v, 2), e.after(v, 3), e.after(v, 4)};
}

Value3 NodeContext::to_object(Value3 v, TransformKind kind) {
    const bool of_lamps = semantics.lamps_have_space || kind == TransformKind::NormalToObject || kind == TransformKind::NormalToWorld;
    return e.emit3(Op::ObjectTransform, uint8_t(kind) | (of_lamps ? 0 : kNotOfLamps), {v.x, v.y, v.z});
}

Value3 NodeContext::affine(const std::vector<float>& matrix, Value3 v, int variant) {
    std::vector<Value> in;
    for (size_t i = 0; i < 12; ++i) in.push_back(e.constant(i < matrix.size() ? matrix[i] : 0.0f));
    in.insert(in.end(), {v.x, v.y, v.z});
    return e.triple(e.emit(Op::Affine, uint8_t(variant), in, 3));
}

}  // namespace talbot::shader
