// The shader nodes by name, and the simple ones: diffuse, translucent, transparent, sheen, toon, emission, and the named fallbacks.
#include <unordered_map>

#include "shader/closure_helpers.h"

namespace talbot::shader {
namespace {

void compile_diffuse(NodeContext& n, Value3 weight) {
    ClosureMaker m(n);
    const Value3 color = m.color("Color"), normal = m.diffuse_normal(n.normal());
    const Value rough = n.value("Roughness");
    if (m.is_zero(rough)) return m.diffuse(n.e.mul(weight, color), normal);
    if (n.semantics.diffuse_bounces_once) {
        n.closure(ClosureType::OrenNayarFujii, LobeKind::Diffuse, n.e.mul(weight, color), normal, {rough});
    } else {
        n.closure(ClosureType::OrenNayar, LobeKind::Diffuse, n.e.mul(weight, color), normal, {rough, color.x, color.y, color.z});
    }
}
void compile_translucent(NodeContext& n, Value3 weight) {
    ClosureMaker m(n);
    n.closure(ClosureType::Translucent, LobeKind::Diffuse, n.e.mul(weight, m.color("Color")), m.diffuse_normal(n.normal()));
}
void compile_emission(NodeContext& n, Value3 weight) {
    n.emission(n.e.mul(weight, n.e.mul(n.color("Color"), n.value("Strength", 1))));
}
void compile_transparent(NodeContext& n, Value3 weight) {
    ClosureMaker m(n);
    n.transparent(n.e.mul(weight, m.color("Color")));
}
void compile_holdout(NodeContext& n, Value3 weight) {
    n.holdout(weight);
}

void compile_velvet(NodeContext& n, Value3 weight) {
    ClosureMaker m(n);
    n.closure(ClosureType::AshikhminVelvet, LobeKind::Glossy, n.e.mul(weight, m.color("Color")), m.diffuse_normal(n.normal()), {m.factor("Sigma", 1)});
}
void compile_sheen(NodeContext& n, Value3 weight) {
    ClosureMaker m(n);
    const bool microfiber = n.choice("distribution", {"MICROFIBER", "ASHIKHMIN"}) == 0;
    n.closure(microfiber ? ClosureType::SheenLtc : ClosureType::AshikhminVelvet, microfiber ? LobeKind::Diffuse : LobeKind::Glossy,
              n.e.mul(weight, m.color("Color")), n.normal(), {m.factor("Roughness", 0.5f)});
}
void compile_toon(NodeContext& n, Value3 weight) {
    ClosureMaker m(n);
    const bool glossy = n.choice("component", {"DIFFUSE", "GLOSSY"}) == 1;
    n.closure(glossy ? ClosureType::GlossyToon : ClosureType::DiffuseToon, glossy ? LobeKind::Glossy : LobeKind::Diffuse, n.e.mul(weight, m.color("Color")),
              m.diffuse_normal(n.normal()), {m.factor("Size", 0.5f), m.factor("Smooth")});
}

// What is not supported yet looks as close as the closures that exist allow, and says so.
void compile_subsurface(NodeContext& n, Value3 weight) {
    ClosureMaker m(n);
    if (!m.is_zero(n.value("Scale", 1))) n.warn("Subsurface scattering is not supported yet: rendered as diffuse of the same colour");
    m.diffuse(n.e.mul(weight, m.color("Color")), m.diffuse_normal(n.normal()));
}
void compile_portal(NodeContext& n, Value3 weight) {
    n.warn("Ray portals are not supported yet: rendered as transparent");
    compile_transparent(n, weight);
}
void compile_eevee_specular(NodeContext& n, Value3) {
    n.warn("Specular BSDF is for EEVEE only: black, as in Cycles");
}
void compile_volume(NodeContext& n, Value3) {
    n.warn("Volumes are not supported yet, and a volume does nothing on a surface: left out");
}

}  // namespace

ClosureNode find_closure_node(const std::string& type) {
    static const std::unordered_map<std::string, ClosureNode> nodes{
        {"ShaderNodeBackground", compile_emission},
        {"ShaderNodeBsdfAnisotropic", compile_glossy},
        {"ShaderNodeBsdfDiffuse", compile_diffuse},
        {"ShaderNodeBsdfGlass", compile_glass},
        {"ShaderNodeBsdfGlossy", compile_glossy},
        {"ShaderNodeBsdfHair", compile_hair},
        {"ShaderNodeBsdfHairPrincipled", compile_principled_hair},
        {"ShaderNodeBsdfMetallic", compile_metallic},
        {"ShaderNodeBsdfPrincipled", compile_principled},
        {"ShaderNodeBsdfRayPortal", compile_portal},
        {"ShaderNodeBsdfRefraction", compile_refraction},
        {"ShaderNodeBsdfSheen", compile_sheen},
        {"ShaderNodeBsdfToon", compile_toon},
        {"ShaderNodeBsdfTranslucent", compile_translucent},
        {"ShaderNodeBsdfTransparent", compile_transparent},
        {"ShaderNodeBsdfVelvet", compile_velvet},
        {"ShaderNodeEeveeSpecular", compile_eevee_specular},
        {"ShaderNodeEmission", compile_emission},
        {"ShaderNodeHoldout", compile_holdout},
        {"ShaderNodeSubsurfaceScattering", compile_subsurface},
        {"ShaderNodeVolumeAbsorption", compile_volume},
        {"ShaderNodeVolumeCoefficients", compile_volume},
        {"ShaderNodeVolumePrincipled", compile_volume},
        {"ShaderNodeVolumeScatter", compile_volume},
    };
    const auto found = nodes.find(type);
    return found == nodes.end() ? nullptr : found->second;
}

}  // namespace talbot::shader
