// Colour nodes: models, ramps, curves and spectra.
#include <algorithm>
#include <cmath>

#include "shader/catalogue.h"
#include "shader/spectra.h"

namespace talbot::shader {
namespace {

Value3 convert(Expressions& e, ConvertKind kind, Value3 v) {
    return e.emit3(Op::ColorConvert, uint8_t(kind), {v.x, v.y, v.z});
}

void separate(NodeContext& n, Value3 v, const char* a, const char* b, const char* c) {
    n.set(a, v.x);
    n.set(b, v.y);
    n.set(c, v.z);
}

void compile_separate_color(NodeContext& n) {
    const int mode = n.choice("mode", {"RGB", "HSV", "HSL"});
    const Value3 c = n.color("Color", {0.8f, 0.8f, 0.8f});
    separate(n, mode == 0 ? c : convert(n.e, mode == 1 ? ConvertKind::RgbToHsv : ConvertKind::RgbToHsl, c), "Red", "Green", "Blue");
}
void compile_combine_color(NodeContext& n) {
    const int mode = n.choice("mode", {"RGB", "HSV", "HSL"});
    const Value3 c{n.value("Red"), n.value("Green"), n.value("Blue")};
    n.set_color("Color", mode == 0 ? c : convert(n.e, mode == 1 ? ConvertKind::HsvToRgb : ConvertKind::HslToRgb, c));
}
void compile_separate_rgb(NodeContext& n) {
    separate(n, n.color("Image", {0.8f, 0.8f, 0.8f}), "R", "G", "B");
}
void compile_combine_rgb(NodeContext& n) {
    n.set_color("Image", {n.value("R"), n.value("G"), n.value("B")});
}
void compile_separate_hsv(NodeContext& n) {
    separate(n, convert(n.e, ConvertKind::RgbToHsv, n.color("Color", {0.8f, 0.8f, 0.8f})), "H", "S", "V");
}
void compile_combine_hsv(NodeContext& n) {
    n.set_color("Color", convert(n.e, ConvertKind::HsvToRgb, {n.value("H"), n.value("S"), n.value("V")}));
}

void compile_hue_saturation(NodeContext& n) {
    const Value3 c = n.color("Color", {0.8f, 0.8f, 0.8f});
    n.set_color("Color", n.e.emit3(Op::HueSaturation, n.semantics.hue_truncates ? 1 : 0,
                                   {n.value("Hue", 0.5f), n.value("Saturation", 1), n.value("Value", 1), n.value("Fac", 1), c.x, c.y, c.z}));
}

void compile_bright_contrast(NodeContext& n) {
    Expressions& e = n.e;
    const Value bright = n.value("Bright"), contrast = n.value("Contrast");
    const Value scale = e.add(contrast, 1.0f), offset = e.sub(bright, e.mul(contrast, 0.5f));
    const Value3 c = n.color("Color", {1, 1, 1});
    n.set_color("Color", e.max(Value3{e.ternary(TernaryKind::MultiplyAdd, c.x, scale, offset), e.ternary(TernaryKind::MultiplyAdd, c.y, scale, offset),
                                      e.ternary(TernaryKind::MultiplyAdd, c.z, scale, offset)},
                               0.0f));
}

void compile_gamma(NodeContext& n) {
    const Value gamma = n.value("Gamma", 1);
    const Value3 c = n.color("Color", {1, 1, 1});
    const auto power = [&](Value v) { return n.e.binary(BinaryKind::GammaPower, v, gamma); };
    n.set_color("Color", {power(c.x), power(c.y), power(c.z)});
}

void compile_invert(NodeContext& n) {
    Expressions& e = n.e;
    const Value factor = n.value("Fac", 1);
    const Value3 c = n.color("Color");
    n.set_color("Color", {e.lerp(c.x, e.one_minus(c.x), factor), e.lerp(c.y, e.one_minus(c.y), factor), e.lerp(c.z, e.one_minus(c.z), factor)});
}

void compile_rgb_to_bw(NodeContext& n) {
    n.set("Val", n.luminance(n.color("Color", {0.5f, 0.5f, 0.5f})));
}

void compile_color_ramp(NodeContext& n) {
    const std::vector<float>* table = n.table("color_ramp");
    const Value factor = n.value("Fac", 0.5f);
    if (!table || table->size() < 4) {
        n.warn("The colour ramp is empty: the factor passes");
        n.set_color("Color", n.e.spread(factor));
        return n.set("Alpha", n.e.literal(1));
    }
    const bool constant = n.flag("color_ramp_constant");
    const Value count = n.e.constant_bits(uint32_t(table->size() / 4));
    const Value out = n.e.emit(Op::Ramp, constant ? 1 : 0, {factor, n.e.table(*table), count}, 4);
    n.set_color("Color", n.e.triple(out));
    n.set("Alpha", n.e.after(out, 3));
}

/// The node's curve mapping.
struct CurveMapping {
    Value offset, count, low, scale;
    uint8_t variant = 0;
    bool exists = false;
};
CurveMapping curve_mapping(NodeContext& n, size_t channels) {
    const std::vector<float>* table = n.table("mapping");
    if (!table || table->size() < 2 * channels) return {};
    const size_t steps = table->size() / channels, kept = channels > 1 ? 3 : 1;
    const double low = n.number("mapping_min", 0), high = n.number("mapping_max", 1);
    const bool extrapolate = n.text("mapping_extend", "EXTRAPOLATED") == "EXTRAPOLATED";
    const Value count = n.e.constant_bits(uint32_t(steps)), scale = n.e.constant(high > low ? float(1.0 / (high - low)) : 0.0f);
    // Curve after curve: what is read of one stands side by side. The fourth is the others' common one, which they hold already.
    std::vector<float> curves;
    for (size_t c = 0; c < kept; ++c)
        for (size_t i = 0; i < steps; ++i) curves.push_back((*table)[i * channels + c]);
    return {n.e.table(curves), count, n.e.constant(float(low)), scale, uint8_t(extrapolate ? 1 : 0), true};
}

Value3 curves(NodeContext& n, Value3 v) {
    const CurveMapping m = curve_mapping(n, 4);
    if (!m.exists) return v;
    return n.e.lerp(v, n.e.emit3(Op::Curves, m.variant, {v.x, v.y, v.z, m.offset, m.count, m.low, m.scale}), n.value("Fac", 1));
}
void compile_rgb_curves(NodeContext& n) {
    n.set_color("Color", curves(n, n.color("Color", {1, 1, 1})));
}
void compile_vector_curves(NodeContext& n) {
    n.set_vector("Vector", curves(n, n.vector("Vector")));
}
void compile_float_curve(NodeContext& n) {
    const Value x = n.value("Value", 1);
    const CurveMapping m = curve_mapping(n, 1);
    n.set("Value", m.exists ? n.e.lerp(x, n.e.emit(Op::Curve, m.variant, {x, m.offset, m.count, m.low, m.scale}), n.value("Factor", 1)) : x);
}

/// Table over equal steps of `x` between low and high; clamped beyond.
Value3 lookup(Expressions& e, const std::vector<Rgb>& table, Value x, float low, float high) {
    std::vector<float> rows;
    for (const Rgb& c : table) rows.insert(rows.end(), {c.x, c.y, c.z, 0.0f});
    const uint32_t steps = uint32_t(table.size() - 1);
    return e.emit3(Op::Lookup, 0, {x, e.table(rows), e.literal(low), e.literal(float(steps) / (high - low))}, steps);
}

void compile_blackbody(NodeContext& n) {
    // Even steps in 1/T follow the curve's bend at low temperatures.
    Expressions& e = n.e;
    const Value inverse = e.div(e.literal(1), e.max(n.value("Temperature", 6500), 1.0f));
    n.set_color("Color", lookup(e, blackbody_table(n.semantics.blackbody), inverse, 1.0f / kBlackbodyHot, 1.0f / kBlackbodyCold));
}

void compile_wavelength(NodeContext& n) {
    const Value x = n.value("Wavelength", 500);
    n.set_color("Color", lookup(n.e, wavelength_table(n.semantics.rec709), x, 375.0f, 785.0f));
}

constexpr CatalogueEntry kEntries[] = {
    {"ShaderNodeSeparateColor", compile_separate_color},
    {"ShaderNodeCombineColor", compile_combine_color},
    {"ShaderNodeSeparateRGB", compile_separate_rgb},
    {"ShaderNodeCombineRGB", compile_combine_rgb},
    {"ShaderNodeSeparateHSV", compile_separate_hsv},
    {"ShaderNodeCombineHSV", compile_combine_hsv},
    {"ShaderNodeHueSaturation", compile_hue_saturation},
    {"ShaderNodeBrightContrast", compile_bright_contrast},
    {"ShaderNodeGamma", compile_gamma},
    {"ShaderNodeInvert", compile_invert},
    {"ShaderNodeRGBToBW", compile_rgb_to_bw},
    {"ShaderNodeValToRGB", compile_color_ramp},
    {"ShaderNodeRGBCurve", compile_rgb_curves},
    {"ShaderNodeVectorCurve", compile_vector_curves},
    {"ShaderNodeFloatCurve", compile_float_curve},
    {"ShaderNodeBlackbody", compile_blackbody},
    {"ShaderNodeWavelength", compile_wavelength},
};

}  // namespace

std::span<const CatalogueEntry> color_nodes() {
    return kEntries;
}

}  // namespace talbot::shader
