// Glossy, glass, refraction and metal.
#include "shader/closure_helpers.h"

namespace talbot::shader {

void compile_glossy(NodeContext& n, Value3 weight) {
    ClosureMaker m(n);
    enum { MultiGgx, Ggx, Beckmann, Ashikhmin, Sharp };
    const int distribution = n.choice("distribution", {"MULTI_GGX", "GGX", "BECKMANN", "ASHIKHMIN_SHIRLEY", "SHARP"}, Ggx);
    const Value3 color = m.color("Color");
    const Value3 normal = m.glossy_normal(n.normal());
    const Value roughness = distribution == Sharp ? n.e.literal(0) : n.value("Roughness", 0.5f);
    const auto width = m.anisotropic(ClosureOp::GlossyAlpha, roughness, n.value("Anisotropy"), "Rotation", normal);
    const Value3 w = n.e.mul(weight, color);
    if (distribution == Ashikhmin) {
        n.closure(ClosureType::AshikhminShirley, LobeKind::Glossy, w, normal, {width.ax, width.ay, width.tangent.x, width.tangent.y, width.tangent.z},
                  microfacet_variant(FresnelKind::None, false, width.anisotropic));
        return;
    }
    const Value3 gain = distribution == MultiGgx ? m.reflect_energy(normal, width, color) : m.white();
    m.reflection(n.e.mul(w, gain), normal, width, FresnelKind::None, {}, distribution == Beckmann, distribution == MultiGgx);
}

void compile_glass(NodeContext& n, Value3 weight) {
    ClosureMaker m(n);
    enum { MultiGgx, Ggx, Beckmann, Sharp };
    const int distribution = n.choice("distribution", {"MULTI_GGX", "GGX", "BECKMANN", "SHARP"}, Ggx);
    const Value3 color = m.color("Color");
    const Value3 normal = m.glossy_normal(n.normal());
    const auto width = m.isotropic(distribution == Sharp ? n.e.literal(0) : n.value("Roughness"), normal);
    const Value ior = m.relative_index(n.value("IOR", 1.45f));
    const bool beckmann = distribution == Beckmann;
    if (n.semantics.glass_as_two_lobes && distribution != MultiGgx) {
        // Two lobes, divided by the reflectance of the whole surface.
        const Value f = m.fresnel_at(normal, ior);
        const Value3 w = n.e.mul(weight, color);
        m.reflection(n.e.mul(w, f), normal, width, FresnelKind::None, {}, beckmann);
        m.refraction(n.e.mul(w, n.e.one_minus(f)), normal, width, ior, beckmann);
        return;
    }
    const Value3 gain = distribution == MultiGgx ? m.glass_energy(normal, width.ax, ior, color) : m.white();
    const auto film = m.relative(m.thin_film(), n.value("IOR", 1.45f));
    m.glass(n.e.mul(weight, gain), normal, width.ax, ior, m.white(), color, color, beckmann, distribution == MultiGgx, film);
}

void compile_refraction(NodeContext& n, Value3 weight) {
    ClosureMaker m(n);
    enum { Ggx, Beckmann, Sharp };
    const int distribution = n.choice("distribution", {"GGX", "BECKMANN", "SHARP"}, Ggx);
    const Value3 normal = m.glossy_normal(n.normal());
    const auto width = m.isotropic(distribution == Sharp ? n.e.literal(0) : n.value("Roughness"), normal);
    m.refraction(n.e.mul(weight, m.color("Color")), normal, width, m.relative_index(n.value("IOR", 1.45f)), distribution == Beckmann);
}

void compile_metallic(NodeContext& n, Value3 weight) {
    ClosureMaker m(n);
    Expressions& e = n.e;
    enum { MultiGgx, Ggx, Beckmann };
    const int distribution = n.choice("distribution", {"MULTI_GGX", "GGX", "BECKMANN"}, Ggx);
    const bool conductor = n.choice("fresnel_type", {"F82", "PHYSICAL_CONDUCTOR"}) == 1;
    const auto film = m.thin_film();
    const Value3 normal = m.glossy_normal(n.normal());
    const auto width = m.anisotropic(ClosureOp::PrincipledAlpha, n.value("Roughness", 0.5f), m.factor("Anisotropy"), "Rotation", normal);
    const bool multi = distribution == MultiGgx, beckmann = distribution == Beckmann;
    if (conductor) {
        const Value3 eta = e.max(n.vector("IOR"), 0.0f), k = e.max(n.vector("Extinction"), 0.0f);
        const Value3 mean =
            m.op3(ClosureOp::ConductorMean, {eta.x, eta.y, eta.z, k.x, k.y, k.z, e.literal(n.semantics.closures.conductor_approximate ? 1.0f : 0.0f)});
        const Value3 gain = multi ? m.reflect_energy(normal, width, mean) : m.white();
        m.reflection(e.mul(weight, gain), normal, width, FresnelKind::Conductor, {eta.x, eta.y, eta.z, k.x, k.y, k.z}, beckmann, false, film);
        return;
    }
    const Value3 f0 = m.color01("Base Color"), tint = m.color01("Edge Tint");
    const Value f82 = m.op(ClosureOp::F82, {f0.x, f0.y, f0.z, tint.x, tint.y, tint.z}, 6);
    const Value3 b = e.triple(f82), mean = e.triple(e.after(f82, 3));
    const Value3 gain = multi ? m.reflect_energy(normal, width, mean) : m.white();
    m.reflection(e.mul(weight, gain), normal, width, FresnelKind::F82, {f0.x, f0.y, f0.z, b.x, b.y, b.z}, beckmann, false, film);
}

}  // namespace talbot::shader
