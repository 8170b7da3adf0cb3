#include "closure/closure.h"

#include "closure/kernels/lobe.h"
#include "closure/microfacet.h"

namespace talbot {
inline namespace TALBOT_ISA {
namespace {

/// Types that do not scatter have nothing to evaluate.
bool scatters(ClosureType type) {
    return type != ClosureType::Emission && type != ClosureType::Holdout;
}

/// The only switch over types.
void dispatch(const ClosureSlot& slot, const LobeCall& call) {
    switch (slot.type) {
        case ClosureType::Diffuse:
        case ClosureType::OrenNayar:
        case ClosureType::OrenNayarFujii:
        case ClosureType::Translucent:
        case ClosureType::Transparent:
            return run_diffuse(slot.type, call);
        case ClosureType::MicrofacetRefract:
        case ClosureType::MicrofacetGlass:
            return run_interface(slot.type, slot.variant, call);
        case ClosureType::Microfacet:
        case ClosureType::MicrofacetThin:
        case ClosureType::AshikhminShirley:
            return run_microfacet(slot.type, slot.variant, call);
        case ClosureType::AshikhminVelvet:
        case ClosureType::SheenLtc:
            return run_sheen(slot.type, call);
        case ClosureType::DiffuseToon:
        case ClosureType::GlossyToon:
            return run_toon(slot.type, call);
        case ClosureType::PrincipledDiffuseV1:
        case ClosureType::PrincipledSheenV1:
        case ClosureType::PrincipledClearcoatV1:
            return run_principled_v1(slot.type, call);
        case ClosureType::HairChiang:
        case ClosureType::HairReflection:
        case ClosureType::HairTransmission:
            return run_hair(slot.type, slot.variant, call);
        case ClosureType::HairHuang:
            return run_hair_huang(call);
        case ClosureType::Emission:
        case ClosureType::Holdout:
            return;
    }
}

LobeCall make_call(LobeCall::Kind kind, const ClosureSlot& slot, const ClosureColumns& c, const ClosureGeometry& g, int n) {
    LobeCall call;
    call.kind = kind;
    call.columns = &c;
    call.geometry = &g;
    call.uniform = make_uniform(g, (slot.variant & kVariantAnisotropic) != 0, (slot.variant & kVariantCorrelated) != 0);
    call.n = n;
    return call;
}

}  // namespace

void closure_sampling_weight(const ClosureSlot& slot, const ClosureColumns& c, const ClosureGeometry& g, int n, float* out) {
    if (!scatters(slot.type)) return fill(out, n, 0.0f);
    LobeCall call = make_call(LobeCall::Weight, slot, c, g, n);
    call.scalar = out;
    dispatch(slot, call);
}

void closure_eval(const ClosureSlot& slot, const ClosureColumns& c, const ClosureGeometry& g, ConstColumns3 wi, int n, Columns3 f, float* pdf) {
    if (!scatters(slot.type)) {
        for (float* column : {f.x, f.y, f.z, pdf}) fill(column, n, 0.0f);
        return;
    }
    LobeCall call = make_call(LobeCall::Eval, slot, c, g, n);
    call.wi = wi;
    call.rgb = f;
    call.scalar = pdf;
    dispatch(slot, call);
}

void closure_sample(const ClosureSlot& slot, const ClosureColumns& c, const ClosureGeometry& g, const float* u, const float* v, const float* w, int n,
                    const ClosureSamples& out) {
    if (!scatters(slot.type)) {
        for (int i = 0; i < n; ++i) {
            store(out.wi, i, load(c.normal, i));
            store(out.weight, i, {});
            out.pdf[i] = 0.0f;
            out.flags[i] = kSampledFailed;
            out.roughness[i] = 1.0f;
            out.eta[i] = 1.0f;
        }
        return;
    }
    LobeCall call = make_call(LobeCall::Sample, slot, c, g, n);
    call.u = u;
    call.v = v;
    call.w = w;
    call.samples = &out;
    dispatch(slot, call);
}

void closure_albedo(const ClosureSlot& slot, const ClosureColumns& c, const ClosureGeometry& g, int n, Columns3 out) {
    if (!scatters(slot.type)) {
        for (float* column : {out.x, out.y, out.z}) fill(column, n, 0.0f);
        return;
    }
    LobeCall call = make_call(LobeCall::Albedo, slot, c, g, n);
    call.rgb = out;
    dispatch(slot, call);
}

void closure_blur(const ClosureSlot& slot, float* const* params, const float* min_alpha, int n) {
    const AlphaRange alphas = closure_alphas(slot.type);
    for (int k = alphas.first; k < alphas.first + alphas.count; ++k) {
        Column alpha = params[k];
        ConstColumn lowest = min_alpha;
        for (int i = 0; i < n; ++i) alpha[i] = maxf(alpha[i], lowest[i]);
    }
}

}  // namespace TALBOT_ISA
}  // namespace talbot
