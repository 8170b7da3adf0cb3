// Math, Vector Math, Mix, Clamp, Map Range and taking vectors apart.
#include "shader/catalogue.h"

namespace talbot::shader {
namespace {

using U = UnaryKind;
using B = BinaryKind;
using T = TernaryKind;

void compile_math(NodeContext& n) {
    Expressions& e = n.e;
    const Value a = n.value("Value", 0.5f), b = n.value("Value_001", 0.5f), c = n.value("Value_002", 0.5f);
    const std::string& operation = n.text("operation", "ADD");
    struct Kind {
        const char* name;
        int operands;
        uint8_t kind;
    };
    static constexpr Kind kinds[] = {
        {"ADD", 2, uint8_t(B::Add)},
        {"SUBTRACT", 2, uint8_t(B::Subtract)},
        {"MULTIPLY", 2, uint8_t(B::Multiply)},
        {"DIVIDE", 2, uint8_t(B::Divide)},
        {"MULTIPLY_ADD", 3, uint8_t(T::MultiplyAdd)},
        {"POWER", 2, uint8_t(B::Power)},
        {"LOGARITHM", 2, uint8_t(B::Logarithm)},
        {"SQRT", 1, uint8_t(U::SquareRoot)},
        {"INVERSE_SQRT", 1, uint8_t(U::InverseSquareRoot)},
        {"ABSOLUTE", 1, uint8_t(U::Absolute)},
        {"EXPONENT", 1, uint8_t(U::Exponent)},
        {"MINIMUM", 2, uint8_t(B::Minimum)},
        {"MAXIMUM", 2, uint8_t(B::Maximum)},
        {"LESS_THAN", 2, uint8_t(B::LessThan)},
        {"GREATER_THAN", 2, uint8_t(B::GreaterThan)},
        {"SIGN", 1, uint8_t(U::Sign)},
        {"COMPARE", 3, uint8_t(T::Compare)},
        {"SMOOTH_MIN", 3, uint8_t(T::SmoothMinimum)},
        {"SMOOTH_MAX", 3, uint8_t(T::SmoothMaximum)},
        {"ROUND", 1, uint8_t(U::Round)},
        {"FLOOR", 1, uint8_t(U::Floor)},
        {"CEIL", 1, uint8_t(U::Ceil)},
        {"TRUNC", 1, uint8_t(U::Truncate)},
        {"FRACT", 1, uint8_t(U::Fraction)},
        {"MODULO", 2, uint8_t(B::Modulo)},
        {"FLOORED_MODULO", 2, uint8_t(B::FlooredModulo)},
        {"WRAP", 3, uint8_t(T::Wrap)},
        {"SNAP", 2, uint8_t(B::Snap)},
        {"PINGPONG", 2, uint8_t(B::PingPong)},
        {"SINE", 1, uint8_t(U::Sine)},
        {"COSINE", 1, uint8_t(U::Cosine)},
        {"TANGENT", 1, uint8_t(U::Tangent)},
        {"ARCSINE", 1, uint8_t(U::ArcSine)},
        {"ARCCOSINE", 1, uint8_t(U::ArcCosine)},
        {"ARCTANGENT", 1, uint8_t(U::ArcTangent)},
        {"ARCTAN2", 2, uint8_t(B::ArcTangent2)},
        {"SINH", 1, uint8_t(U::HyperbolicSine)},
        {"COSH", 1, uint8_t(U::HyperbolicCosine)},
        {"TANH", 1, uint8_t(U::HyperbolicTangent)},
    };
    Value out;
    for (const Kind& k : kinds) {
        if (operation != k.name) continue;
        out = k.operands == 1 ? e.unary(U(k.kind), a) : (k.operands == 2 ? e.binary(B(k.kind), a, b) : e.ternary(T(k.kind), a, b, c));
    }
    if (operation == "RADIANS") out = e.mul(a, 0.017453292519943295f);
    if (operation == "DEGREES") out = e.mul(a, 57.29577951308232f);
    if (!out.valid()) {
        n.warn("Unknown operation '" + operation + "': the first value passes");
        out = a;
    }
    n.set("Value", n.flag("use_clamp") ? e.saturate(out) : out);
}

void compile_vector_math(NodeContext& n) {
    Expressions& e = n.e;
    const Value3 a = n.vector("Vector"), b = n.vector("Vector_001"), c = n.vector("Vector_002");
    const Value scale = n.value("Scale", 1);
    const std::string& operation = n.text("operation", "ADD");
    const auto each1 = [&](U k) { n.set_vector("Vector", {e.unary(k, a.x), e.unary(k, a.y), e.unary(k, a.z)}); };
    const auto each2 = [&](B k) { n.set_vector("Vector", {e.binary(k, a.x, b.x), e.binary(k, a.y, b.y), e.binary(k, a.z, b.z)}); };
    const auto each3 = [&](T k) { n.set_vector("Vector", {e.ternary(k, a.x, b.x, c.x), e.ternary(k, a.y, b.y, c.y), e.ternary(k, a.z, b.z, c.z)}); };
    const auto pair = [&](VectorKind k) { n.set_vector("Vector", e.emit3(Op::Vector, uint8_t(k), {a.x, a.y, a.z, b.x, b.y, b.z})); };
    if (operation == "ADD") return each2(B::Add);
    if (operation == "SUBTRACT") return each2(B::Subtract);
    if (operation == "MULTIPLY") return each2(B::Multiply);
    if (operation == "DIVIDE") return each2(B::Divide);
    if (operation == "MULTIPLY_ADD") return each3(T::MultiplyAdd);
    if (operation == "CROSS_PRODUCT") return pair(VectorKind::Cross);
    if (operation == "PROJECT") return pair(VectorKind::Project);
    if (operation == "REFLECT") return pair(VectorKind::Reflect);
    if (operation == "REFRACT") return n.set_vector("Vector", e.emit3(Op::Vector, uint8_t(VectorKind::Refract), {a.x, a.y, a.z, b.x, b.y, b.z, scale}));
    if (operation == "FACEFORWARD")
        return n.set_vector("Vector", e.emit3(Op::Vector, uint8_t(VectorKind::FaceForward), {a.x, a.y, a.z, b.x, b.y, b.z, c.x, c.y, c.z}));
    if (operation == "DOT_PRODUCT") return n.set("Value", e.dot(a, b));
    if (operation == "DISTANCE") return n.set("Value", e.length(e.sub(a, b)));
    if (operation == "LENGTH") return n.set("Value", e.length(a));
    if (operation == "SCALE") return n.set_vector("Vector", e.mul(a, scale));
    if (operation == "NORMALIZE") return n.set_vector("Vector", e.normalize(a));
    if (operation == "ABSOLUTE") return each1(U::Absolute);
    if (operation == "MINIMUM") return each2(B::Minimum);
    if (operation == "MAXIMUM") return each2(B::Maximum);
    if (operation == "FLOOR") return each1(U::Floor);
    if (operation == "CEIL") return each1(U::Ceil);
    if (operation == "FRACTION") return each1(U::Fraction);
    if (operation == "MODULO") return each2(B::Modulo);
    if (operation == "WRAP") return each3(T::Wrap);
    if (operation == "SNAP") return each2(B::Snap);
    if (operation == "SINE") return each1(U::Sine);
    if (operation == "COSINE") return each1(U::Cosine);
    if (operation == "TANGENT") return each1(U::Tangent);
    if (operation == "POWER") return each2(B::Power);
    if (operation == "ROUND") return each1(U::Round);
    if (operation == "SIGN") return each1(U::Sign);
    n.warn("Unknown operation '" + operation + "': the first vector passes");
    n.set_vector("Vector", a);
}

Value3 blend(NodeContext& n, const std::string& type, Value factor, Value3 a, Value3 b) {
    static constexpr const char* names[] = {"MIX",    "DARKEN",  "MULTIPLY",   "BURN",         "LIGHTEN",    "SCREEN",    "DODGE",
                                            "ADD",    "OVERLAY", "SOFT_LIGHT", "LINEAR_LIGHT", "DIFFERENCE", "EXCLUSION", "SUBTRACT",
                                            "DIVIDE", "HUE",     "SATURATION", "COLOR",        "VALUE"};
    int kind = -1;
    for (int i = 0; i < int(std::size(names)); ++i)
        if (type == names[i]) kind = i;
    if (kind < 0) n.warn("Unknown blend type '" + type + "': mixed");
    // Mixing simplifies where the factor is 0 or 1; other modes with factor 0 pass the first colour too, but for clamping ones.
    if (kind <= 0) return n.e.lerp(a, b, factor);
    return n.e.emit3(Op::Blend, uint8_t(kind), {factor, a.x, a.y, a.z, b.x, b.y, b.z});
}

void compile_mix(NodeContext& n) {
    Expressions& e = n.e;
    const bool clamp_factor = n.flag("clamp_factor", true);
    const std::string& type = n.text("data_type", "FLOAT");
    const Value raw = n.value("Factor_Float", 0.5f), factor = clamp_factor ? e.saturate(raw) : raw;
    if (type == "FLOAT") return n.set("Result_Float", e.lerp(n.value("A_Float"), n.value("B_Float"), factor));
    if (type == "VECTOR") {
        const Value3 a = n.vector("A_Vector"), b = n.vector("B_Vector");
        if (n.text("factor_mode", "UNIFORM") == "UNIFORM") return n.set_vector("Result_Vector", e.lerp(a, b, factor));
        Value3 f = n.vector("Factor_Vector", {0.5f, 0.5f, 0.5f});
        if (clamp_factor) f = e.saturate(f);
        return n.set_vector("Result_Vector", {e.lerp(a.x, b.x, f.x), e.lerp(a.y, b.y, f.y), e.lerp(a.z, b.z, f.z)});
    }
    if (type != "RGBA") n.warn("Mix of data type '" + type + "' is not supported: its colours are mixed");
    const Value3 out = blend(n, n.text("blend_type", "MIX"), factor, n.color("A_Color", {0.5f, 0.5f, 0.5f}), n.color("B_Color", {0.5f, 0.5f, 0.5f}));
    n.set_color("Result_Color", n.flag("clamp_result") ? e.saturate(out) : out);
}

void compile_mix_rgb(NodeContext& n) {
    const Value factor = n.e.saturate(n.value("Fac", 0.5f));
    const Value3 out = blend(n, n.text("blend_type", "MIX"), factor, n.color("Color1", {0.5f, 0.5f, 0.5f}), n.color("Color2", {0.5f, 0.5f, 0.5f}));
    n.set_color("Color", n.flag("use_clamp") ? n.e.saturate(out) : out);
}

void compile_clamp(NodeContext& n) {
    const bool range = n.choice("clamp_type", {"MINMAX", "RANGE"}) == 1;
    n.set("Result", n.e.ternary(range ? T::ClampRange : T::Clamp, n.value("Value", 1), n.value("Min", 0), n.value("Max", 1)));
}

enum Remap { kLinear, kStepped, kSmooth, kSmoother };

/// Share of the way from `low` to `high`; `flat` where both are the same.
Value remap(Expressions& e, Remap kind, Value x, Value low, Value high, Value steps) {
    const Value t = e.div(e.sub(x, low), e.sub(high, low));
    if (kind == kLinear) return t;
    if (kind == kStepped) {
        // Less than no steps: all of the way at its start.
        const Value count = e.max(steps, 0.0f);
        return e.div(e.unary(U::Floor, e.mul(t, e.add(count, 1))), count);
    }
    const Value s = e.saturate(t), s2 = e.mul(s, s);
    if (kind == kSmooth) return e.mul(s2, e.sub(e.literal(3), e.mul(s, 2)));
    const Value inner = e.add(e.mul(s, e.add(e.mul(s, 6), -15)), 10);
    return e.mul(e.mul(s2, s), inner);
}

void compile_map_range(NodeContext& n) {
    Expressions& e = n.e;
    const Remap kind = Remap(n.choice("interpolation_type", {"LINEAR", "STEPPED", "SMOOTHSTEP", "SMOOTHERSTEP"}));
    const bool clamp = n.flag("clamp", true);
    if (n.text("data_type", "FLOAT") == "FLOAT") {
        const Value low = n.value("From Min", 0), high = n.value("From Max", 1), to_low = n.value("To Min", 0), to_high = n.value("To Max", 1);
        const Value t = remap(e, kind, n.value("Value", 1), low, high, n.value("Steps", 4));
        Value out = e.add(to_low, e.mul(t, e.sub(to_high, to_low)));
        out = e.mul(out, e.sub(e.literal(1), e.ternary(T::Compare, low, high, e.literal(0))));
        return n.set("Result", clamp ? e.ternary(T::ClampRange, out, to_low, to_high) : out);
    }
    const Value3 x = n.vector("Vector"), low = n.vector("From_Min_FLOAT3"), high = n.vector("From_Max_FLOAT3", {1, 1, 1});
    const Value3 to_low = n.vector("To_Min_FLOAT3"), to_high = n.vector("To_Max_FLOAT3", {1, 1, 1}), steps = n.vector("Steps_FLOAT3", {4, 4, 4});
    const auto one = [&](Value v, Value l, Value h, Value tl, Value th, Value s) {
        const Value out = e.add(tl, e.mul(remap(e, kind, v, l, h, s), e.sub(th, tl)));
        return clamp ? e.ternary(T::ClampRange, out, tl, th) : out;
    };
    n.set_vector("Vector", {one(x.x, low.x, high.x, to_low.x, to_high.x, steps.x), one(x.y, low.y, high.y, to_low.y, to_high.y, steps.y),
                            one(x.z, low.z, high.z, to_low.z, to_high.z, steps.z)});
}

void compile_separate_xyz(NodeContext& n) {
    const Value3 v = n.vector("Vector");
    n.set("X", v.x);
    n.set("Y", v.y);
    n.set("Z", v.z);
}
void compile_combine_xyz(NodeContext& n) {
    n.set_vector("Vector", {n.value("X"), n.value("Y"), n.value("Z")});
}

constexpr CatalogueEntry kEntries[] = {
    {"ShaderNodeMath", compile_math},
    {"ShaderNodeVectorMath", compile_vector_math},
    {"ShaderNodeMix", compile_mix},
    {"ShaderNodeMixRGB", compile_mix_rgb},
    {"ShaderNodeClamp", compile_clamp},
    {"ShaderNodeMapRange", compile_map_range},
    {"ShaderNodeSeparateXYZ", compile_separate_xyz},
    {"ShaderNodeCombineXYZ", compile_combine_xyz},
};

}  // namespace

std::span<const CatalogueEntry> math_nodes() {
    return kEntries;
}

}  // namespace talbot::shader
