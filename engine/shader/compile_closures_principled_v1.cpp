// The Principled BSDF of Blender before 4.0: a weighted sum, nothing hides anything.
#include "shader/closure_helpers.h"

namespace talbot::shader {
namespace {

/// Below this roughness light does not bounce between facets worth speaking of.
constexpr float kLeastMultiRoughness = 0.075f;

struct Sum : ClosureMaker {
    Value3 weight, base, normal;
    Value roughness, metallic, transmission;
    bool multi;

    Sum(NodeContext& node, Value3 w) : ClosureMaker(node), weight(w) {
        base = color("Base Color");
        normal = glossy_normal(n.normal());
        roughness = factor("Roughness", 0.5f);
        metallic = factor("Metallic");
        transmission = factor("Transmission");
        multi = n.choice("distribution", {"MULTI_GGX", "GGX"}, 1) == 0;
    }

    void transparency() {
        const Value alpha = factor("Alpha", 1);
        if (e.is(alpha, 1)) return;
        n.transparent(e.mul(weight, e.one_minus(alpha)));
        weight = e.mul(weight, alpha);
    }

    void emission() {
        const Value strength = n.value("Emission Strength", 1);
        if (!is_zero(strength)) n.emission(e.mul(weight, e.mul(n.color("Emission"), strength)));
    }

    void diffuse_and_sheen() {
        const Value share = e.mul(e.one_minus(metallic), e.one_minus(transmission));
        if (e.is(metallic, 1) || e.is(transmission, 1)) return;
        Value3 albedo = base;
        const Value subsurface = factor("Subsurface");
        if (!is_zero(subsurface)) {
            n.warn("Subsurface scattering is not supported yet: rendered as diffuse of the same colour");
            albedo = e.lerp(base, color("Subsurface Color"), subsurface);
        }
        const Value3 w = e.mul(weight, share);
        n.closure(ClosureType::PrincipledDiffuseV1, LobeKind::Diffuse, e.mul(w, albedo), normal, {roughness});
        const Value sheen = e.max(n.value("Sheen"), 0.0f);
        if (is_zero(sheen)) return;
        const Value3 tint = op3(ClosureOp::SheenTintV1, {base.x, base.y, base.z, n.value("Sheen Tint", 0.5f)});
        n.closure(ClosureType::PrincipledSheenV1, LobeKind::Diffuse, e.mul(e.mul(w, sheen), e.max(tint, 0.0f)), normal);
    }

    void specular(Value glass_share) {
        const Value amount = e.max(n.value("Specular", 0.5f), 0.0f);
        if (is_zero(amount) && is_zero(metallic)) return;
        const auto width = anisotropic(ClosureOp::PrincipledAlpha, roughness, factor("Anisotropic"), "Anisotropic Rotation", normal);
        const Value s = op(ClosureOp::SpecularV1, {base.x, base.y, base.z, amount, n.value("Specular Tint"), metallic}, 7);
        const Value3 f0 = e.triple(e.after(s, 1)), mean = e.triple(e.after(s, 4));
        Value3 gain = white();
        if (multi) {
            const Value rough = e.binary(BinaryKind::GreaterThan, roughness, e.literal(kLeastMultiRoughness));
            gain = e.select(rough, reflect_energy(normal, width, mean), white());
        }
        reflection(e.mul(e.mul(weight, e.one_minus(glass_share)), gain), normal, width, FresnelKind::Schlick, {s, f0.x, f0.y, f0.z}, false, multi);
    }

    void glass_part(Value share) {
        if (is_zero(transmission) || e.is(metallic, 1)) return;
        const Value index = relative_index(n.value("IOR", 1.45f));
        const Value3 w = e.mul(weight, share);
        const Value3 cspec0 = e.lerp(white(), base, n.value("Specular Tint"));
        const auto width = isotropic(roughness, normal);
        const bool rough = !(e.is_known(roughness) && e.known(roughness) <= 0.05f);
        if (multi && rough) {
            glass(e.mul(w, glass_energy(normal, width.ax, index, e.saturate(base))), normal, width.ax, index, white(), cspec0, base, false, true);
            return;
        }
        const Value f = fresnel_at(normal, index);
        reflection(e.mul(w, f), normal, width, FresnelKind::Schlick, {index, cspec0.x, cspec0.y, cspec0.z});
        const Value through = e.one_minus(e.mul(e.one_minus(roughness), e.one_minus(factor("Transmission Roughness"))));
        refraction(e.mul(e.mul(w, base), e.one_minus(f)), normal, isotropic(through, normal), index);
    }

    void clearcoat() {
        const Value amount = e.max(n.value("Clearcoat"), 0.0f);
        if (is_zero(amount)) return;
        const Value3 bent = n.has("Clearcoat Normal") ? glossy_normal(n.normal("Clearcoat Normal")) : normal;
        const Value alpha = op(ClosureOp::AlphaFromRoughness, {n.value("Clearcoat Roughness", 0.03f)});
        n.closure(ClosureType::PrincipledClearcoatV1, LobeKind::Glossy, e.mul(e.mul(weight, amount), 0.25f), bent, {alpha});
    }
};

}  // namespace

void compile_principled_v1(NodeContext& n, Value3 weight) {
    Sum sum(n, weight);
    sum.transparency();
    sum.emission();
    sum.diffuse_and_sheen();
    const Value glass_share = n.e.mul(sum.transmission, n.e.one_minus(sum.metallic));
    if (!(n.e.is(sum.transmission, 1) && n.e.is(sum.metallic, 0))) sum.specular(glass_share);
    sum.glass_part(glass_share);
    sum.clearcoat();
}

}  // namespace talbot::shader
