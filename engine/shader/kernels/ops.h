/// Loops of the operations. `r` holds the operands' columns, results first, in the order of op.h; `n` is rounded up to a multiple of 16, so that
/// no lane ever runs in another loop (vector body or remainder) than its neighbours: its bits do not depend on its place.
/// Columns never alias: no result is also an input.
#pragma once

#include "base/math.h"
#include "shader/program.h"

namespace talbot::shader {

/// What an operation may see besides its operands.
struct OpScope {
    const Program& program;
    const Programs& programs;
    const ShadingSpan& span;
    const ShaderContext& context;
};
using Registers = float* const*;

inline namespace TALBOT_ISA {

void op_unary(const Instruction& i, Registers r, int n);
void op_binary(const Instruction& i, Registers r, int n);
void op_ternary(const Instruction& i, Registers r, int n);
void op_vector(const Instruction& i, Registers r, int n);
void op_affine(const Instruction& i, Registers r, int n);

void op_input(const Instruction& i, Registers r, int n, const OpScope& scope);
void op_constant(const Instruction& i, Registers r, int n, const OpScope& scope);
void op_object_transform(const Instruction& i, Registers r, int n, const OpScope& scope);
void op_camera_transform(const Instruction& i, Registers r, int n, const OpScope& scope);
void op_window(const Instruction& i, Registers r, int n, const OpScope& scope);
void op_attribute(const Instruction& i, Registers r, int n, const OpScope& scope);
void op_attribute_at(const Instruction& i, Registers r, int n, const OpScope& scope);
void op_generated(const Instruction& i, Registers r, int n, const OpScope& scope);
void op_vertex_normal(Registers r, int n, const OpScope& scope);
void op_object_value(const Instruction& i, Registers r, int n, const OpScope& scope);
void op_instancer(Registers r, int n, const OpScope& scope);
void op_shift_barycentrics(Registers r, int n, const OpScope& scope);
void op_curve_tangent(const Instruction& instruction, Registers r, int n, const OpScope& scope);

void op_blend(const Instruction& i, Registers r, int n);
void op_color_convert(const Instruction& i, Registers r, int n);
void op_hue_saturation(const Instruction& i, Registers r, int n);
void op_ramp(const Instruction& i, Registers r, int n, const OpScope& scope);
void op_curve(const Instruction& i, Registers r, int n, const OpScope& scope);
void op_curves(const Instruction& i, Registers r, int n, const OpScope& scope);
void op_lookup(const Instruction& i, Registers r, int n, const OpScope& scope);

void op_project(const Instruction& i, Registers r, int n);
void op_box_weights(Registers r, int n);
void op_image(const Instruction& i, Registers r, int n, const OpScope& scope);
void op_noise(const Instruction& i, Registers r, int n);
void op_signed_noise(const Instruction& i, Registers r, int n);
void op_voronoi(const Instruction& i, Registers r, int n);
void op_gabor(const Instruction& i, Registers r, int n);
void op_white_noise(const Instruction& i, Registers r, int n);
void op_wave(const Instruction& i, Registers r, int n);
void op_magic(const Instruction& i, Registers r, int n);
void op_brick(const Instruction& i, Registers r, int n);
void op_checker(Registers r, int n);
void op_radial_tiling(const Instruction& i, Registers r, int n);
void op_gradient(const Instruction& i, Registers r, int n);
void op_ies(const Instruction& i, Registers r, int n, const OpScope& scope);
void op_grid(const Instruction& i, Registers r, int n, const OpScope& scope);

void op_fresnel(Registers r, int n);
void op_bump(Registers r, int n);
void op_wireframe(const Instruction& i, Registers r, int n, const OpScope& scope);
void op_occlusion(const Instruction& i, Registers r, int n, const OpScope& scope);
void op_bevel(const Instruction& i, Registers r, int n, const OpScope& scope);
void op_raycast(const Instruction& i, Registers r, int n, const OpScope& scope);
void op_random(const Instruction& i, Registers r, int n, const OpScope& scope);

/// Closure parameters, by Instruction::variant; see ops_closure.cpp.
void op_closure(const Instruction& i, Registers r, int n, const OpScope& scope);

/// One result, one to three inputs, `f` lane by lane.
template <class F>
TALBOT_INLINE void map1(Registers r, int n, F f) {
    Column o = r[0];
    ConstColumn a = r[1];
    TALBOT_VECTOR_LOOP
    for (int i = 0; i < n; ++i) o[i] = f(a[i]);
}
template <class F>
TALBOT_INLINE void map2(Registers r, int n, F f) {
    Column o = r[0];
    ConstColumn a = r[1], b = r[2];
    TALBOT_VECTOR_LOOP
    for (int i = 0; i < n; ++i) o[i] = f(a[i], b[i]);
}
template <class F>
TALBOT_INLINE void map3(Registers r, int n, F f) {
    Column o = r[0];
    ConstColumn a = r[1], b = r[2], c = r[3];
    TALBOT_VECTOR_LOOP
    for (int i = 0; i < n; ++i) o[i] = f(a[i], b[i], c[i]);
}

}  // namespace TALBOT_ISA
}  // namespace talbot::shader
