#include "integrator/kernels/stages.h"

namespace talbot::integrator {
inline namespace TALBOT_ISA {

void eval_closures(SpanScratch& s, const shader::Program& program, const ClosureGeometry& geometry, const int32_t* lamp_visibility, bool shares, Columns3 f,
                   float* pdf) {
    const int n = s.span.n;
    for (Columns3 c : {f, s.f_diffuse, s.f_glossy}) fill(c.x, n, 0.0f), fill(c.y, n, 0.0f), fill(c.z, n, 0.0f);
    fill(pdf, n, 0.0f);
    const Columns3 slot_f = s.slot_f;
    const Column fx = f.x, fy = f.y, fz = f.z, sx = slot_f.x, sy = slot_f.y, sz = slot_f.z, sum = pdf, slot_pdf = s.slot_pdf;
    for (size_t k = 0; k < program.slots.size(); ++k) {
        const ClosureSlot& slot = program.slots[k];
        if (slot.lobe == LobeKind::None || slot.lobe == LobeKind::Transparent) continue;
        closure_eval(slot, slot_columns(slot, s.registers), geometry, s.wi, n, slot_f, s.slot_pdf);
        if (s.shifts_terminator) {
            const ConstColumns3 normal = slot_columns(slot, s.registers).normal;
            for (int i = 0; i < n; ++i) store(slot_f, i, load(slot_f, i) * terminator_factor(s.terminator_frequency[i], dot(load(normal, i), load(s.wi, i))));
        }
        if (lamp_visibility) {
            const int32_t needed = slot.lobe == LobeKind::Diffuse  ? scene::kVisibleDiffuse
                                   : slot.lobe == LobeKind::Glossy ? scene::kVisibleGlossy
                                                                   : scene::kVisibleTransmission;
            TALBOT_VECTOR_LOOP
            for (int i = 0; i < n; ++i) {
                const float lit = (lamp_visibility[i] & needed) ? 1.0f : 0.0f;
                sx[i] *= lit, sy[i] *= lit, sz[i] *= lit;
            }
        }
        const ConstColumn weight = s.slot_weight + k * kSpan;
        TALBOT_VECTOR_LOOP
        for (int i = 0; i < n; ++i) {
            fx[i] += sx[i];
            fy[i] += sy[i];
            fz[i] += sz[i];
            sum[i] += slot_pdf[i] * weight[i];
        }
        if (shares) add_shares(s, slot, geometry);
    }
    for (int i = 0; i < n; ++i) pdf[i] = s.weight_sum[i] > 0.0f ? pdf[i] / s.weight_sum[i] : 0.0f;
    if (!shares) return;
    auto ratio = [](Vec3 part, Vec3 whole) {
        return Vec3{whole.x != 0.0f ? part.x / whole.x : 0.0f, whole.y != 0.0f ? part.y / whole.y : 0.0f, whole.z != 0.0f ? part.z / whole.z : 0.0f};
    };
    for (int i = 0; i < n; ++i) {
        const Vec3 whole = load(f, i);
        store(s.f_diffuse, i, ratio(load(s.f_diffuse, i), whole));
        store(s.f_glossy, i, ratio(load(s.f_glossy, i), whole));
    }
}

}  // namespace TALBOT_ISA
}  // namespace talbot::integrator
