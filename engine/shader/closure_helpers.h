/// What the closure nodes' compile functions (compile_closures*.cpp) share: emitting closure operations, normals, widths, energy.
#pragma once

#include "closure/microfacet.h"
#include "closure/thin_film.h"
#include "shader/closure_nodes.h"
#include "shader/graph_compiler.h"
#include "shader/ops_closure.h"

namespace talbot::shader {

/// A thin film's sockets.
struct Film {
    Value thickness, ior;
    bool exists = false;
};

/// Shorthand around a node while its closures are made.
struct ClosureMaker {
    NodeContext& n;
    Expressions& e;

    explicit ClosureMaker(NodeContext& node) : n(node), e(node.e) {}

    Value op(ClosureOp kind, std::initializer_list<Value> in, int outs = 1) { return e.emit(Op::Closure, uint8_t(kind), in, outs); }
    Value3 op3(ClosureOp kind, std::initializer_list<Value> in) { return e.triple(op(kind, in, 3)); }
    bool is_zero(Value v) { return e.is(v, 0); }
    Value3 white() { return e.literal3(1, 1, 1); }
    Value3 color(const char* socket) { return e.max(n.color(socket, {1, 1, 1}), 0.0f); }
    Value3 color01(const char* socket) { return e.saturate(n.color(socket, {1, 1, 1})); }
    Value factor(const char* socket, float fallback = 0) { return e.saturate(n.value(socket, fallback)); }

    /// The socket's normal, for diffuse closures.
    Value3 diffuse_normal(Value3 normal) { return n.semantics.diffuse_normals_bend ? glossy_normal(normal) : normal; }
    Value3 glossy_normal(Value3 normal) {
        const Value3 g = n.geometric_normal(), wo = n.incoming();
        return op3(ClosureOp::ValidReflection, {normal.x, normal.y, normal.z, g.x, g.y, g.z, wo.x, wo.y, wo.z});
    }

    /// Widths and tangent of a distribution; isotropic where the anisotropy is known to be none.
    struct Width {
        Value ax, ay;
        Value3 tangent;
        bool anisotropic = false;
    };
    Width isotropic(Value roughness, Value3 normal) {
        const Value alpha = op(ClosureOp::AlphaFromRoughness, {roughness});
        return {alpha, alpha, normal, false};
    }
    Width anisotropic(ClosureOp rule, Value roughness, Value anisotropy, const char* rotation, Value3 normal) {
        if (is_zero(anisotropy)) return isotropic(roughness, normal);
        const Value alphas = op(rule, {roughness, anisotropy}, 2);
        Value3 tangent = n.tangent();
        const Value turns = n.value(rotation);
        if (!is_zero(turns)) {
            tangent = op3(ClosureOp::RotateTangent, {normal.x, normal.y, normal.z, tangent.x, tangent.y, tangent.z, turns});
        }
        return {alphas, e.after(alphas, 1), tangent, true};
    }

    /// Compensation for light that bounces several times between the facets.
    Value3 reflect_energy(Value3 normal, const Width& w, Value3 mean) {
        const Value3 wo = n.incoming();
        const Value escape = e.literal(n.semantics.energy_by_root ? 1.0f : 0.0f);
        return op3(ClosureOp::EnergyReflect, {normal.x, normal.y, normal.z, wo.x, wo.y, wo.z, w.ax, w.ay, mean.x, mean.y, mean.z, escape});
    }
    Value3 glass_energy(Value3 normal, Value alpha, Value ior, Value3 mean) {
        const Value3 wo = n.incoming();
        const Value escape = e.literal(n.semantics.energy_by_root ? 1.0f : 0.0f);
        return op3(ClosureOp::EnergyGlass, {normal.x, normal.y, normal.z, wo.x, wo.y, wo.z, alpha, ior, mean.x, mean.y, mean.z, escape});
    }
    Value fresnel_at(Value3 normal, Value ior) {
        const Value3 wo = n.incoming();
        return op(ClosureOp::FresnelAt, {normal.x, normal.y, normal.z, wo.x, wo.y, wo.z, ior});
    }
    /// Relative index beyond the surface: the reciprocal from behind.
    Value relative_index(Value ior) { return op(ClosureOp::GlassIndex, {ior, e.input(InputColumn::Backfacing)}); }

    /// The node's thin film; none where the node has no such sockets or its thickness is known to be nothing.
    Film thin_film() {
        if (!n.has("Thin Film Thickness")) return {};
        const Value thickness = n.value("Thin Film Thickness");
        if (e.is_known(thickness) && !(e.known(thickness) > kThinnestFilm)) return {};
        const std::string& space = n.graph().scene.settings.working_space;
        if (space != "Linear" && space != "Linear Rec.709") n.warn("Thin films have the colours of Linear Rec.709 in the working space '" + space + "' too");
        return {thickness, n.value("Thin Film IOR", 1.33f), true};
    }
    /// The index of the film's medium from the viewer's side, as relative_index.
    Film relative(Film film, Value ior) {
        if (film.exists) film.ior = e.select(e.input(InputColumn::Backfacing), e.div(film.ior, e.max(ior, 1e-3f)), film.ior);
        return film;
    }

    void reflection(Value3 weight, Value3 normal, const Width& w, FresnelKind kind, std::initializer_list<Value> fresnel, bool beckmann = false,
                    bool compensated = false, const Film& film = {}) {
        std::vector<Value> params{w.ax, w.ay, w.tangent.x, w.tangent.y, w.tangent.z};
        params.insert(params.end(), fresnel);
        if (film.exists) {
            params.insert(params.end(), {film.thickness, film.ior});
            kind = kind == FresnelKind::Schlick ? FresnelKind::SchlickFilm : kind == FresnelKind::F82 ? FresnelKind::F82Film : FresnelKind::ConductorFilm;
        }
        n.closure(ClosureType::Microfacet, LobeKind::Glossy, weight, normal, std::move(params), microfacet_variant(kind, beckmann, w.anisotropic, compensated));
    }
    void refraction(Value3 weight, Value3 normal, const Width& w, Value ior, bool beckmann = false) {
        n.closure(ClosureType::MicrofacetRefract, LobeKind::Transmission, weight, normal, {w.ax, w.ay, w.tangent.x, w.tangent.y, w.tangent.z, ior},
                  microfacet_variant(FresnelKind::None, beckmann));
    }
    /// f0: factor of the reflectance at normal incidence.
    void glass(Value3 weight, Value3 normal, Value alpha, Value ior, Value3 f0, Value3 reflect, Value3 transmit, bool beckmann = false,
               bool compensated = false, const Film& film = {}) {
        std::vector<Value> params{alpha, ior, f0.x, f0.y, f0.z, reflect.x, reflect.y, reflect.z, transmit.x, transmit.y, transmit.z};
        if (film.exists) params.insert(params.end(), {film.thickness, film.ior});
        n.closure(ClosureType::MicrofacetGlass, LobeKind::Transmission, weight, normal, std::move(params),
                  microfacet_variant(film.exists ? FresnelKind::SchlickFilm : FresnelKind::None, beckmann, false, compensated));
    }
    void diffuse(Value3 weight, Value3 normal) { n.closure(ClosureType::Diffuse, LobeKind::Diffuse, weight, normal); }
    /// What lies below a layer of this albedo: weight times 1 - max(albedo).
    Value3 below(Value3 weight, Value3 albedo) { return e.mul(weight, e.saturate(e.one_minus(e.max_component(albedo)))); }
};

// The nodes that are not in compile_closures.cpp.
void compile_glossy(NodeContext& n, Value3 weight);
void compile_glass(NodeContext& n, Value3 weight);
void compile_refraction(NodeContext& n, Value3 weight);
void compile_metallic(NodeContext& n, Value3 weight);
void compile_hair(NodeContext& n, Value3 weight);
void compile_principled_hair(NodeContext& n, Value3 weight);
void compile_principled(NodeContext& n, Value3 weight);     ///< chooses the generation by version
void compile_principled_v1(NodeContext& n, Value3 weight);  ///< before 4.0

}  // namespace talbot::shader
