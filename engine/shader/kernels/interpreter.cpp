#include "shader/kernels/ops.h"

namespace talbot::shader {
inline namespace TALBOT_ISA {

void run_program(const Program& program, const Programs& programs, const ShadingSpan& span, const ShaderContext& context, float* registers) {
    const OpScope scope{program, programs, span, context};
    const int n = (span.n + 15) & ~15;
    const uint16_t* operands = program.operands.data();
    float* r[kMaxOperands];
    for (const Instruction& i : program.code) {
        const uint16_t* numbers = operands + i.operands;
        for (int k = 0; k < i.outs + i.ins; ++k) r[k] = registers + size_t(numbers[k]) * kSpan;
        switch (i.op) {
            case Op::Literal:
                fill(r[0], n, as_float(i.data));
                break;
            case Op::Constant:
                op_constant(i, r, n, scope);
                break;
            case Op::Copy:
                std::memcpy(r[0], r[1], size_t(n) * sizeof(float));
                break;
            case Op::Unary:
                op_unary(i, r, n);
                break;
            case Op::Binary:
                op_binary(i, r, n);
                break;
            case Op::Ternary:
                op_ternary(i, r, n);
                break;
            case Op::Vector:
                op_vector(i, r, n);
                break;
            case Op::Input:
                op_input(i, r, n, scope);
                break;
            case Op::ObjectTransform:
                op_object_transform(i, r, n, scope);
                break;
            case Op::CameraTransform:
                op_camera_transform(i, r, n, scope);
                break;
            case Op::Affine:
                op_affine(i, r, n);
                break;
            case Op::Window:
                op_window(r, n, scope);
                break;
            case Op::Attribute:
                op_attribute(i, r, n, scope);
                break;
            case Op::Generated:
                op_generated(i, r, n, scope);
                break;
            case Op::VertexNormal:
                op_vertex_normal(r, n, scope);
                break;
            case Op::ObjectValue:
                op_object_value(i, r, n, scope);
                break;
            case Op::Instancer:
                op_instancer(r, n, scope);
                break;
            case Op::ShiftBarycentrics:
                op_shift_barycentrics(r, n, scope);
                break;
            case Op::Random:
                op_random(i, r, n, scope);
                break;
            case Op::Closure:
                op_closure(i, r, n, scope);
                break;
            default:
                break;
        }
    }
}

}  // namespace TALBOT_ISA
}  // namespace talbot::shader
