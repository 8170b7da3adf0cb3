/// Toon: a flat cap around the normal (diffuse) or the mirror direction (glossy), with a linear rim. Not multiplied by the cosine.
#include "base/math.h"
#include "closure/kernels/lobe.h"
#include "closure/kernels/warp.h"

namespace talbot {
inline namespace TALBOT_ISA {
namespace {

template <bool glossy>
struct ToonLobe {
    static constexpr bool kDiffuse = !glossy, kTransmits = false;
    float flat, rim, one_minus_cos;  ///< angles of the flat part and the rim's width; of the whole cap
    float least, edge;               ///< cosines: those below `least` count as it; only those above `edge` are lit
    TALBOT_MEMBER static ToonLobe load(const float* const* p, int i, const LobeUniform& u) {
        const float flat = clampf(p[0][i], 1e-3f, 1.0f) * 0.5f * kPi, rim = saturate(p[1][i]) * 0.5f * kPi;
        const float half_sin = lane_sin(0.5f * minf(flat + rim, 0.5f * kPi));
        const float cap = 2.0f * half_sin * half_sin;
        // In old versions what is more than 90 degrees from the mirror direction is worth what is just 90 degrees from it.
        const float wide = glossy ? u.toon_wide : 0.0f;
        return {flat, rim, cap, wide - 1.0f, flat + rim > 0.5f * kPi ? minf(1.0f - cap, 1.0f - 2.0f * wide) : 1.0f - cap};
    }
    TALBOT_MEMBER float density() const { return 1.0f / (2.0f * kPi * one_minus_cos); }
    TALBOT_MEMBER float shape(float cosine) const {
        const float angle = lane_acos(cosine);
        return angle < flat ? 1.0f : saturate(1.0f - (angle - flat) / maxf(rim, 1e-6f));
    }
    TALBOT_MEMBER static Vec3 axis(const LobeLane& lane) {
        const Vec3 mirror = lane.n * (2.0f * dot(lane.n, lane.wo)) - lane.wo;
        return glossy ? mirror : lane.n;
    }
    TALBOT_MEMBER static bool faces(const LobeLane& lane) { return !glossy || dot(lane.n, lane.wo) > 0.0f; }
    TALBOT_MEMBER LobeEval eval(const LobeLane& lane, Vec3 wi) const {
        const float cosine = maxf(dot(axis(lane), wi), least);
        const bool inside = (cosine > edge) & (dot(lane.n, wi) >= 0.0f) & faces(lane);
        const float d = inside ? density() : 0.0f;
        return {vec3(d * shape(cosine)), d};
    }
    TALBOT_MEMBER LobeSample sample(const LobeLane& lane, float u, float v, float) const {
        float cosine;
        const Vec3 wi = cone_direction(axis(lane), one_minus_cos, u, v, cosine);
        return {wi, vec3(shape(cosine)), density(), 1.0f, (dot(lane.n, wi) > 0.0f) & faces(lane) ? 0 : int32_t(kSampledFailed)};
    }
    TALBOT_MEMBER Rgb albedo(const LobeLane&) const { return vec3(1.0f); }
    TALBOT_MEMBER float roughness() const { return 1.0f; }
};

}  // namespace

void run_toon(ClosureType type, const LobeCall& call) {
    type == ClosureType::GlossyToon ? run_lobe<ToonLobe<true>>(call) : run_lobe<ToonLobe<false>>(call);
}

}  // namespace TALBOT_ISA
}  // namespace talbot
