// Hair: Principled Hair BSDF (both models) and Hair BSDF.
#include "closure/hair.h"
#include "shader/closure_helpers.h"

namespace talbot::shader {
namespace {

/// What Blender says of a fibre at its hit. On meshes the fibre runs along an edge of the triangle.
struct Strand : ClosureMaker {
    Value is_curve;

    explicit Strand(NodeContext& node) : ClosureMaker(node), is_curve(e.emit(Op::ObjectValue, uint8_t(ObjectField::IsCurve), std::span<const Value>{})) {}

    Value3 along(NoCurve edge) { return e.triple(e.emit(Op::CurveTangent, uint8_t(edge), std::span<const Value>{}, 3)); }

    /// 1 + 2 (random - 0.5) amount. The number is the curve's own unless something is linked.
    Value varied(Value amount) {
        const Value own = n.value("Random");
        const Value random = n.linked("Random") ? own : e.select(is_curve, n.attribute(scene::kRandom)[0], own);
        return e.add(e.mul(e.add(random, -0.5f), e.mul(amount, 2.0f)), 1.0f);
    }
    Value3 absorption(Value radial) {
        enum { Absorption, Melanin, Color };
        const auto from_color = [&](const char* socket) {
            const Value3 c = n.color(socket);
            return op3(ClosureOp::HairColor, {c.x, c.y, c.z, radial});
        };
        switch (n.choice("parametrization", {"ABSORPTION", "MELANIN", "COLOR"}, Color)) {
            case Absorption:
                return n.vector("Absorption Coefficient");
            case Melanin: {
                const Value melanin = e.mul(n.value("Melanin"), varied(factor("Random Color")));
                return e.add(op3(ClosureOp::HairPigment, {melanin, n.value("Melanin Redness")}), from_color("Tint"));
            }
            default:
                return from_color("Color");
        }
    }
};

void compile_chiang(Strand& s, Value3 weight) {
    NodeContext& n = s.n;
    Expressions& e = s.e;
    const Value vary = s.varied(n.value("Random Roughness"));
    const Value rough = e.mul(n.value("Roughness", 0.3f), vary), radial = e.mul(n.value("Radial Roughness", 0.3f), vary);
    const Value widths = s.op(ClosureOp::HairWidths, {rough, radial, n.value("Coat")}, 3);
    const Value3 sigma = s.absorption(radial), tangent = s.along(NoCurve::FirstEdge);
    n.closure(
        ClosureType::HairChiang, LobeKind::Transmission, weight, n.geometric_normal(),
        {tangent.x, tangent.y, tangent.z, sigma.x, sigma.y, sigma.z, widths, e.after(widths, 1), e.after(widths, 2), n.value("Offset"), n.value("IOR", 1.55f)},
        n.semantics.hair_tilts_light ? kVariantTiltsLight : uint8_t(0));
}

void compile_huang(Strand& s, Value3 weight) {
    NodeContext& n = s.n;
    Expressions& e = s.e;
    const Value rough = e.mul(n.value("Roughness", 0.3f), s.varied(n.value("Random Roughness")));
    const Value3 sigma = s.absorption(rough), tangent = s.along(NoCurve::FirstEdge), wo = n.incoming(), normal = n.geometric_normal();
    // Elliptic fibres only where there are curves.
    const Value ratio = e.select(s.is_curve, n.value("Aspect Ratio", 1), e.literal(1));
    Value3 major = normal;
    if (!e.is(n.value("Aspect Ratio", 1), 1)) {
        const auto own = n.attribute(scene::kCurveNormal);
        Value3 own_world = n.to_object({own[0], own[1], own[2]}, TransformKind::VectorToWorld);
        if (n.semantics.hair_section_faces_up) {
            const Value there = e.add(e.add(e.mul(own[0], own[0]), e.mul(own[1], own[1])), e.mul(own[2], own[2]));
            own_world.z = e.select(there, own_world.z, e.literal(1));
        }
        const Value section =
            s.op(ClosureOp::HairSection,
                 {tangent.x, tangent.y, tangent.z, wo.x, wo.y, wo.z, normal.x, normal.y, normal.z, own_world.x, own_world.y, own_world.z, ratio}, 4);
        major = e.triple(section);
        // The curve is as wide as the long axis: rays pass beside the rest.
        const Value beside = e.mul(e.after(section, 3), s.is_curve);
        n.transparent(e.mul(weight, beside));
        weight = e.mul(weight, e.one_minus(beside));
    }
    // From the camera a fibre that is wider than a pixel shows its parts.
    const Value scale = e.emit(Op::ObjectValue, uint8_t(ObjectField::MeanScale), std::span<const Value>{});
    const Value radius = e.mul(n.attribute(scene::kRadius)[0], scale);
    const Value half_pixel = e.div(e.mul(e.input(InputColumn::Footprint), 0.5f), radius);
    const Value near = e.mul(e.input(InputColumn::IsCamera), s.is_curve);
    const Value coverage = e.select(near, half_pixel, e.literal(1));
    n.closure(ClosureType::HairHuang, LobeKind::Transmission, weight, normal,
              {tangent.x, tangent.y, tangent.z, major.x, major.y, major.z, sigma.x, sigma.y, sigma.z, rough, n.value("Offset"), n.value("IOR", 1.55f), ratio,
               n.value("R lobe", 1), n.value("TT lobe", 1), n.value("TRT lobe", 1), coverage});
}

}  // namespace

void compile_principled_hair(NodeContext& n, Value3 weight) {
    Strand s(n);
    n.choice("model", {"CHIANG", "HUANG"}) == 1 ? compile_huang(s, weight) : compile_chiang(s, weight);
}

void compile_hair(NodeContext& n, Value3 weight) {
    Strand s(n);
    Expressions& e = n.e;
    const bool through = n.choice("component", {"Reflection", "Transmission"}) == 1;
    Value3 tangent = s.along(NoCurve::LastEdge);
    Value offset = e.negate(n.value("Offset"));
    if (n.linked("Tangent")) {
        tangent = n.vector("Tangent");
    } else {
        offset = e.mul(offset, s.is_curve);
    }
    n.closure(through ? ClosureType::HairTransmission : ClosureType::HairReflection, through ? LobeKind::Transmission : LobeKind::Glossy,
              e.mul(weight, s.color("Color")), n.geometric_normal(),
              {tangent.x, tangent.y, tangent.z, n.value("RoughnessU", 0.1f), n.value("RoughnessV", 1), offset});
}

}  // namespace talbot::shader
