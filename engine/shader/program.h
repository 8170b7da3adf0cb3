/// Node programs: a shader graph compiled to a list of operations over columns.
///
/// A register is a column of kSpan floats in the worker's scratch; a vector is three registers in a row. Registers hold raw 32-bit values: handles
/// travel as integers in float columns. Materials that differ in constants only share a program: constants sit in one table and
/// an operation fetches lane i's value at constants[span.constants[i] + k].
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "closure/closure.h"
#include "shader/op.h"
#include "shader/shading.h"

namespace talbot::shader {

inline constexpr int kMaxOperands = 64;

/// One operation over a span. Its operands are register numbers in Program::operands: `outs` results first, then `ins`
/// inputs; meaning by op, see the op's line in op.h. No result is also an input.
struct Instruction {
    Op op = Op::Literal;
    uint8_t variant = 0;  ///< enum of the op where it has one (math operation, blend mode ...): picks the loop
    uint8_t outs = 0, ins = 0;
    uint32_t operands = 0;  ///< offset into Program::operands
    uint32_t data = 0;      ///< immediate of the op
};

/// What `nodes` AOV Output nodes together give one of Scene::aovs: 3 registers in a row; of a value all three are the same.
struct AovValue {
    uint16_t aov = 0, first = 0, nodes = 1;
};

struct Program {
    std::vector<Instruction> code;
    std::vector<uint16_t> operands;
    std::vector<ClosureSlot> slots;  ///< surface programs
    uint16_t emission = 0xffff;      ///< first of 3 registers: radiance towards the viewer; kNoRegister when there is none
    uint16_t transparency = 0xffff;  ///< first of 3 registers: sum of the transparent closures' weights, in transparency programs (shadow rays); kNoRegister:
                                     ///< opaque, or another kind of program
    uint16_t normal = 0xffff;        ///< first of 3 registers: the surface's normal where displacement bends it; kNoRegister: the span's
    uint16_t displacement = 0xffff;  ///< first of 3 registers: world-space offset, in displacement programs
    std::vector<AovValue> aovs;      ///< in AOV programs
    int register_count = 0;
    std::string name;  ///< of the first material that uses it, for reports
};
inline constexpr uint16_t kNoRegister = 0xffff;

/// A small bright disc in what a background shader emits: it deserves light samples of its own.
struct SunDisc {
    Vec3 direction{0, 0, 1};
    float half_angle = 0;  ///< radians; 0: none
};

/// What a shader becomes: up to five programs that share nothing but constants, each holding only what its outputs need.
struct CompiledShader {
    int surface = -1;       ///< index into Programs::programs: all closures
    int emission = -1;      ///< emission only; also the background's and the lamp's program; -1: none
    int transparency = -1;  ///< transparency only (shadow rays); -1: opaque
    int displacement = -1;  ///< how far vertices move (run at each of them before rendering); -1: they stay
    int aov = -1;           ///< AOV outputs; -1: none that the scene asks for
    int32_t constants = 0;  ///< offset of this shader's constants
    bool emission_is_constant = false;
    Rgb constant_emission;        ///< when constant (already times strength)
    float emission_estimate = 0;  ///< rough mean radiance, for light selection and for whether to sample at all
    bool transparency_is_constant = false;
    Rgb constant_transparency;
    bool depends_on_ray_flags = false;  ///< Light Path, Is Camera Ray ...: shadow and light evaluation differ from camera rays
    bool spatially_varying = false;
    bool has_bump = false;
    bool displacement_reads_camera = false;
    bool displaced_from_front = true;  ///< displacement sees a viewer in the direction of the normal, or none
    scene::DisplacementMethod displacement_method = scene::DisplacementMethod::Bump;
    SunDisc sun;
    int32_t pass_index = 0;
    bool sample_as_light = true, emission_front = true, emission_back = true;
    bool bump_correction = true;
};

/// All programs of a scene, read-only while rendering.
struct Programs {
    std::vector<std::unique_ptr<const Program>> programs;
    std::vector<CompiledShader> shaders;  ///< by shader handle; one more at the end: the default grey
    std::vector<float> constants;         ///< raw 32-bit values
    std::vector<float> tables;            ///< colour ramps, curves, albedo tables
    int default_shader = 0;
    int max_registers = 0;
    int max_slots = 0;
};

inline namespace TALBOT_ISA {  // kernels

/// Runs the program over the span. `registers` = register_count columns of kSpan floats, one after another.
void run_program(const Program& program, const Programs& programs, const ShadingSpan& span, const ShaderContext& context, float* registers);

}  // namespace TALBOT_ISA
}  // namespace talbot::shader
