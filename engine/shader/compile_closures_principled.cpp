// The Principled BSDF since 4.0: layers from the top down, each hiding what its albedo reflects from those below.
#include "shader/closure_helpers.h"

namespace talbot::shader {
namespace {

struct Layers : ClosureMaker {
    Value3 weight;  ///< what reaches the next layer
    Value3 base;
    Value3 normal, glossy, coat;
    Value roughness, ior;
    bool multi;
    bool thin = false;  ///< a sheet without an inside
    Film film;

    Layers(NodeContext& node, Value3 w) : ClosureMaker(node), weight(w) {
        base = color("Base Color");
        normal = n.normal();
        glossy = glossy_normal(normal);
        coat = n.has("Coat Normal") ? n.normal("Coat Normal") : normal;
        roughness = n.value("Roughness", 0.5f);
        ior = n.value("IOR", 1.5f);
        multi = n.choice("distribution", {"MULTI_GGX", "GGX"}) == 0;
        film = thin_film();
        if (!n.has("Thin Wall")) return;
        const Value wall = n.value("Thin Wall");
        thin = e.is_known(wall) && e.known(wall) != 0;
        if (!e.is_known(wall)) n.warn("Thin Wall is linked: rendered as a solid");
    }

    void transparency() {
        const Value alpha = factor("Alpha", 1);
        if (e.is(alpha, 1)) return;
        n.transparent(e.mul(weight, e.one_minus(alpha)));
        weight = e.mul(weight, alpha);
    }

    void sheen() {
        const Value amount = factor("Sheen Weight");
        if (is_zero(amount)) return;
        const Value rough = n.value("Sheen Roughness", 0.5f);
        const Value3 bent = e.normalize(e.lerp(normal, coat, factor("Coat Weight"))), wo = n.incoming();
        const Value albedo = op(ClosureOp::SheenAlbedo, {bent.x, bent.y, bent.z, wo.x, wo.y, wo.z, rough});
        const Value3 tint = e.mul(color("Sheen Tint"), amount);
        n.closure(ClosureType::SheenLtc, LobeKind::Diffuse, e.mul(weight, tint), bent, {rough});
        weight = below(weight, e.mul(tint, albedo));
    }

    void clear_coat() {
        const Value amount = e.max(n.value("Coat Weight"), 0.0f);
        if (is_zero(amount)) return;
        const Value3 bent = glossy_normal(coat), wo = n.incoming();
        const auto width = isotropic(n.value("Coat Roughness", 0.03f), bent);
        const Value index = e.max(n.value("Coat IOR", 1.5f), 1.0f);
        const Value layer =
            op(ClosureOp::Coat, {bent.x, bent.y, bent.z, wo.x, wo.y, wo.z, width.ax, index, e.literal(n.semantics.coat_as_mirror ? 1.0f : 0.0f)}, 3);
        reflection(e.mul(weight, e.mul(amount, e.after(layer, 2))), bent, width, FresnelKind::Dielectric, {index});
        weight = below(weight, e.spread(e.mul(layer, amount)));
        const Value3 tint = color("Coat Tint");
        if (e.is(tint.x, 1) && e.is(tint.y, 1) && e.is(tint.z, 1)) return;
        // Light crosses the coat along the refracted direction.
        const Value path = e.after(layer, 1);
        const auto absorbed = [&](Value t) { return e.binary(BinaryKind::Power, t, path); };
        const Value3 colored{absorbed(tint.x), absorbed(tint.y), absorbed(tint.z)};
        weight = e.mul(weight, e.lerp(white(), colored, e.saturate(amount)));
    }

    void emission() {
        const Value strength = n.value("Emission Strength");
        if (!is_zero(strength)) n.emission(e.mul(weight, e.mul(n.color("Emission Color"), strength)));
    }

    void metal(const Width& width) {
        const Value metallic = factor("Metallic");
        if (is_zero(metallic)) return;
        const Value3 f0 = e.saturate(base), tint = color01("Specular Tint");
        const Value f82 = op(ClosureOp::F82, {f0.x, f0.y, f0.z, tint.x, tint.y, tint.z}, 6);
        const Value3 b = e.triple(f82), mean = e.triple(e.after(f82, 3));
        const Value3 gain = multi ? reflect_energy(glossy, width, mean) : white();
        reflection(e.mul(e.mul(weight, metallic), gain), glossy, width, FresnelKind::F82, {f0.x, f0.y, f0.z, b.x, b.y, b.z}, false, false,
                   n.semantics.metal_has_film ? film : Film{});
        weight = e.mul(weight, e.one_minus(metallic));
    }

    void transmission() {
        const Value amount = factor("Transmission Weight");
        if (is_zero(amount)) return;
        const Value3 clamped = e.saturate(base);
        if (thin) return pane(amount, clamped);
        const Value3 pass{e.sqrt(clamped.x), e.sqrt(clamped.y), e.sqrt(clamped.z)};
        const Value alpha = op(ClosureOp::AlphaFromRoughness, {roughness}), index = relative_index(ior);
        const Value3 gain = multi ? glass_energy(glossy, alpha, index, pass) : white();
        glass(e.mul(e.mul(weight, amount), gain), glossy, alpha, index, color("Specular Tint"), white(), pass, false, false, relative(film, ior));
        weight = e.mul(weight, e.one_minus(amount));
    }

    /// Both sides of a sheet, with all reflections between them.
    void pane(Value amount, Value3 color) {
        if (film.exists) n.warn("Thin film on a transparent thin wall is not supported: rendered without it");
        const Value3 wo = n.incoming(), tint = this->color("Specular Tint");
        const Width width = isotropic(roughness, glossy);
        const Value shares =
            op(ClosureOp::ThinPane, {glossy.x, glossy.y, glossy.z, wo.x, wo.y, wo.z, width.ax, ior, color.x, color.y, color.z, tint.x, tint.y, tint.z}, 7);
        const Value alpha = e.after(shares, 6);
        const Value3 all = e.mul(weight, amount);
        reflection(e.mul(all, e.triple(shares)), glossy, width, FresnelKind::None, {});
        n.closure(ClosureType::MicrofacetThin, LobeKind::Transmission, e.mul(all, e.triple(e.after(shares, 3))), glossy,
                  {alpha, alpha, glossy.x, glossy.y, glossy.z});
        weight = e.mul(weight, e.one_minus(amount));
    }

    void specular(const Width& width) {
        const Value3 tint = color("Specular Tint"), wo = n.incoming();
        const Value s =
            op(ClosureOp::Specular,
               {glossy.x, glossy.y, glossy.z, wo.x, wo.y, wo.z, width.ax, width.ay, ior, n.value("Specular IOR Level", 0.5f), tint.x, tint.y, tint.z}, 10);
        const Value3 f0 = e.triple(e.after(s, 1));
        Value3 albedo = e.triple(e.after(s, 4));
        if (film.exists) {
            const Value3 colored = op3(ClosureOp::FilmAlbedo, {glossy.x, glossy.y, glossy.z, wo.x, wo.y, wo.z, s, f0.x, f0.y, f0.z, film.thickness, film.ior,
                                                               e.literal(n.semantics.closures.film_fitted ? 1.0f : 0.0f)});
            albedo = e.select(e.binary(BinaryKind::GreaterThan, film.thickness, e.literal(kThinnestFilm)), colored, albedo);
        }
        Value3 gain = white(), layer = albedo;
        if (multi) {
            gain = reflect_energy(glossy, width, e.triple(e.after(s, 7)));
            layer = e.mul(albedo, specular_energy(width, e.triple(e.after(s, 7))));
        }
        reflection(e.mul(weight, gain), glossy, width, FresnelKind::Schlick, {s, f0.x, f0.y, f0.z}, false, false, film);
        weight = below(weight, layer);
    }
    /// Share of the compensated lobe that the estimate above, which loses nothing between the facets, has to be reduced to.
    Value3 specular_energy(const Width& width, Value3 mean) {
        const Value3 wo = n.incoming();
        return op3(ClosureOp::EnergyShare, {glossy.x, glossy.y, glossy.z, wo.x, wo.y, wo.z, width.ax, width.ay, mean.x, mean.y, mean.z, e.literal(0)});
    }

    void body() {
        const bool scatters = n.has("Subsurface Weight") && !is_zero(n.value("Subsurface Weight"));
        if (scatters && thin) {
            // Scattered inside a sheet, half of the light leaves on either side.
            const Value share = factor("Subsurface Weight");
            const Value3 half = e.mul(e.mul(weight, base), e.mul(share, 0.5f));
            diffuse(half, normal);
            n.closure(ClosureType::Translucent, LobeKind::Diffuse, half, normal);
            weight = e.mul(weight, e.one_minus(share));
        } else if (scatters) {
            n.warn("Subsurface scattering is not supported yet: rendered as diffuse of the same colour");
        }
        const Value rough = n.value("Diffuse Roughness");
        if (is_zero(rough)) return diffuse(e.mul(weight, base), normal);
        n.closure(ClosureType::OrenNayar, LobeKind::Diffuse, e.mul(weight, base), normal, {rough, base.x, base.y, base.z});
    }
};

}  // namespace

void compile_principled(NodeContext& n, Value3 weight) {
    if (n.semantics.principled_v1) return compile_principled_v1(n, weight);
    Layers layers(n, weight);
    layers.transparency();
    layers.sheen();
    layers.clear_coat();
    layers.emission();
    const auto width = layers.anisotropic(ClosureOp::PrincipledAlpha, layers.roughness, layers.factor("Anisotropic"), "Anisotropic Rotation", layers.glossy);
    layers.metal(width);
    // Nothing lies below full metal or full glass.
    if (n.e.is(layers.factor("Metallic"), 1)) return;
    layers.transmission();
    if (n.e.is(layers.factor("Transmission Weight"), 1)) return;
    layers.specular(width);
    layers.body();
}

}  // namespace talbot::shader
