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
                op_window(i, r, n, scope);
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
            case Op::CurveTangent:
                op_curve_tangent(i, r, n, scope);
                break;
            case Op::ShiftBarycentrics:
                op_shift_barycentrics(r, n, scope);
                break;
            case Op::Blend:
                op_blend(i, r, n);
                break;
            case Op::ColorConvert:
                op_color_convert(i, r, n);
                break;
            case Op::HueSaturation:
                op_hue_saturation(i, r, n);
                break;
            case Op::Ramp:
                op_ramp(i, r, n, scope);
                break;
            case Op::Curve:
                op_curve(i, r, n, scope);
                break;
            case Op::Curves:
                op_curves(i, r, n, scope);
                break;
            case Op::Lookup:
                op_lookup(i, r, n, scope);
                break;
            case Op::Project:
                op_project(i, r, n);
                break;
            case Op::BoxWeights:
                op_box_weights(r, n);
                break;
            case Op::Image:
                op_image(i, r, n, scope);
                break;
            case Op::Noise:
                op_noise(i, r, n);
                break;
            case Op::SignedNoise:
                op_signed_noise(i, r, n);
                break;
            case Op::Voronoi:
                op_voronoi(i, r, n);
                break;
            case Op::Gabor:
                op_gabor(i, r, n);
                break;
            case Op::WhiteNoise:
                op_white_noise(i, r, n);
                break;
            case Op::Wave:
                op_wave(i, r, n);
                break;
            case Op::Magic:
                op_magic(i, r, n);
                break;
            case Op::Brick:
                op_brick(i, r, n);
                break;
            case Op::Checker:
                op_checker(r, n);
                break;
            case Op::RadialTiling:
                op_radial_tiling(i, r, n);
                break;
            case Op::Gradient:
                op_gradient(i, r, n);
                break;
            case Op::Ies:
                op_ies(i, r, n, scope);
                break;
            case Op::Grid:
                op_grid(i, r, n, scope);
                break;
            case Op::Fresnel:
                op_fresnel(r, n);
                break;
            case Op::Bump:
                op_bump(r, n);
                break;
            case Op::Wireframe:
                op_wireframe(i, r, n, scope);
                break;
            case Op::Occlusion:
                op_occlusion(i, r, n, scope);
                break;
            case Op::Bevel:
                op_bevel(i, r, n, scope);
                break;
            case Op::Raycast:
                op_raycast(i, r, n, scope);
                break;
            case Op::AttributeAt:
                op_attribute_at(i, r, n, scope);
                break;
            case Op::Random:
                op_random(i, r, n, scope);
                break;
            case Op::Closure:
                op_closure(i, r, n, scope);
                break;
        }
    }
}

}  // namespace TALBOT_ISA
}  // namespace talbot::shader
