/// Closures: every way a surface scatters light. The contract of the whole layer:
///
/// * All directions are unit vectors in world space and point away from the surface: wo to the viewer, wi to the light.
/// * `f` is the BSDF times |cos(wi, N)| with N the closure's own normal (RGB, weight included); `pdf` is per solid angle
///   of wi. Delta lobes have f = 0 and pdf = 0 in `eval`; only `sample` returns them, with weight = f/pdf and
///   `kSampledDelta` set.
/// * The shading normal N given to a closure faces the viewer (N . wo >= 0) unless bump bends it; Ng faces the viewer always.
/// * A closure's weight (RGB columns) multiplies everything; a lane whose weight is 0 is absent.
/// * A lobe that depends on more than its table of parameters does not exist: parameters are columns in the fixed
///   order given with each type below, so a span evaluates one type at a time.
///
/// A shader compiles to a fixed list of `ClosureSlot`s (type + register numbers); the list is the same for every lane of
/// a span. The integrator picks a slot with probability proportional to its sampling weight and combines all
/// slots' pdfs.
#pragma once

#include "base/lanes.h"
#include "closure/versions.h"

namespace talbot {

enum class ClosureType : uint8_t {
    Diffuse,                ///< Lambert. no parameters
    OrenNayar,              ///< roughness (0..1), albedo r g b of the multiple-scattering term (Cycles 4.3 and later)
    OrenNayarFujii,         ///< roughness; qualitative model without multiple scattering (Cycles until 4.2)
    Translucent,            ///< Lambert on the other side. no parameters
    Transparent,            ///< passes straight on. no parameters
    Microfacet,             ///< reflection. alpha_x, alpha_y, tangent xyz, Fresnel data (see microfacet.h, also for the variants)
    MicrofacetRefract,      ///< refraction only (Walter); alpha_x, alpha_y, tangent, ior
    MicrofacetGlass,        ///< reflection and refraction by Fresnel: alpha, ior, F0 scale rgb, reflection tint rgb, transmission tint rgb
    MicrofacetThin,         ///< transmission of a thin pane: Microfacet without Fresnel, mirrored in the surface; alpha_x, alpha_y, tangent
    AshikhminShirley,       ///< alpha_x, alpha_y, tangent
    AshikhminVelvet,        ///< sigma (0.01 and more)
    SheenLtc,               ///< roughness (0.001 .. 1); microfiber
    DiffuseToon,            ///< size, smooth (0..1)
    GlossyToon,             ///< size, smooth (0..1)
    PrincipledDiffuseV1,    ///< roughness
    PrincipledSheenV1,      ///< no parameters
    PrincipledClearcoatV1,  ///< alpha (GTR1); the model's factor 1/4 belongs into the weight
    HairChiang,             ///< parameters of this and the following: hair.h
    HairHuang,
    HairReflection,
    HairTransmission,
    Emission,  ///< not a scattering lobe: radiance = weight
    Holdout,   ///< absorbs and removes alpha
};

/// Lobes as Blender's passes and bounce limits group them.
enum class LobeKind : uint8_t { Diffuse, Glossy, Transmission, Transparent, None };

inline constexpr int kMaxClosureParams = 24;
inline constexpr int kMaxSlots = 64;

/// One closure of a compiled shader: which registers hold its columns.
struct ClosureSlot {
    ClosureType type = ClosureType::Diffuse;
    LobeKind lobe = LobeKind::Diffuse;
    uint16_t weight = 0;  ///< first of 3 registers
    uint16_t normal = 0;  ///< first of 3 registers
    uint16_t params[kMaxClosureParams] = {};
    uint8_t param_count = 0;
    uint8_t variant = 0;  ///< distribution and Fresnel kind where the type has several (enums in its header)
};

/// The columns of one slot over n lanes.
struct ClosureColumns {
    ConstColumns3 weight, normal;
    const float* params[kMaxClosureParams] = {};
};

/// Geometry of the lanes, shared by all slots.
struct ClosureGeometry {
    ConstColumns3 wo;
    ConstColumns3 ng;
    ConstColumns3 ns;  ///< the normal that closures' normals are compared with for bump shadowing: interpolated, bent by displacement only
    ClosureSemantics semantics;
    bool bump_correction = true;
};

enum SampledFlags : int32_t {
    kSampledDelta = 1,
    kSampledTransmit = 2,     ///< crossed the surface (refraction, translucency)
    kSampledTransparent = 4,  ///< straight on, no bounce
    kSampledFailed = 8,       ///< absorbed: end the path
};

/// What `closure_sample` writes.
struct ClosureSamples {
    Columns3 wi;
    Columns3 weight;       ///< f / pdf, closure weight included (of this slot alone)
    float* pdf = nullptr;  ///< per solid angle; 1e8 stands for a delta
    int32_t* flags = nullptr;
    float* roughness = nullptr;  ///< sqrt(alpha) of the sampled lobe, 1 for diffuse; for filter glossy and transparent glass
    float* eta = nullptr;        ///< relative index where transmitted, else 1
};

inline namespace TALBOT_ISA {  // kernels

/// out[i] = sampling weight of the slot (mean of weight times an albedo estimate).
void closure_sampling_weight(const ClosureSlot& slot, const ClosureColumns& c, const ClosureGeometry& g, int n, float* out);

/// f (not accumulated: written) and pdf for given wi; lanes of zero weight give zero.
void closure_eval(const ClosureSlot& slot, const ClosureColumns& c, const ClosureGeometry& g, ConstColumns3 wi, int n, Columns3 f, float* pdf);

/// u, v: the direction pair; w: one more number for lobes within the closure (reflect or refract).
void closure_sample(const ClosureSlot& slot, const ClosureColumns& c, const ClosureGeometry& g, const float* u, const float* v, const float* w, int n,
                    const ClosureSamples& out);

/// Which parameters are roughnesses (alpha).
struct AlphaRange {
    int first = 0, count = 0;
};
TALBOT_INLINE AlphaRange closure_alphas(ClosureType type) {
    switch (type) {
        case ClosureType::Microfacet:
        case ClosureType::MicrofacetThin:
        case ClosureType::MicrofacetRefract:
        case ClosureType::AshikhminShirley:
            return {0, 2};
        case ClosureType::MicrofacetGlass:
        case ClosureType::PrincipledClearcoatV1:
            return {0, 1};
        case ClosureType::HairChiang:
            return {6, 3};
        case ClosureType::HairHuang:
            return {9, 1};
        default:
            return {};
    }
}

/// Raises alpha to at least `min_alpha` (filter glossy); edits the parameter columns in place where the type has alpha.
void closure_blur(const ClosureSlot& slot, float* const* params, const float* min_alpha, int n);

/// Directional albedo estimate r g b of the slot, weight included, for the colour passes and the denoiser.
void closure_albedo(const ClosureSlot& slot, const ClosureColumns& c, const ClosureGeometry& g, int n, Columns3 out);

}  // namespace TALBOT_ISA
}  // namespace talbot
