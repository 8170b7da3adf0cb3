/// Instruction sets. Hot code ("kernels") is compiled once per instruction set from the same source, into the
/// inline namespace `v2`, `v3` or `v4` of their layer (x86-64 levels; `generic` elsewhere; written `inline namespace TALBOT_ISA`); host code is compiled for
/// the first one only, so in host code a kernel's plain name means the baseline kernel. The set that runs is chosen once, at start (`base/cpu.h`), through the
/// tables of function pointers in `integrator/kernels.h`.
///
/// Everything a kernel calls must either be inlined or live in the kernel namespace: an ordinary inline function
/// shared by two instruction sets would be merged by the linker, and the survivor may use instructions the machine
/// lacks. Hence `TALBOT_INLINE` (internal linkage, always inlined) on every helper, no standard containers inside
/// kernels, and a test that reads the symbol tables.
#pragma once

#ifndef TALBOT_ISA
#define TALBOT_ISA TALBOT_BASE_ISA
#endif

#define TALBOT_INLINE [[gnu::always_inline]] static inline
#define TALBOT_MEMBER [[gnu::always_inline]] inline

#define TALBOT_STRINGIFY_(x) #x
#define TALBOT_STRINGIFY(x) TALBOT_STRINGIFY_(x)
/// "v2", "v3", "v4" or "generic": the instruction set this translation unit is compiled for.
#define TALBOT_ISA_NAME TALBOT_STRINGIFY(TALBOT_ISA)

/// Put before a loop whose columns cannot alias, so that the compiler vectorises it.
#if defined(__clang__)
#define TALBOT_VECTOR_LOOP _Pragma("clang loop vectorize(assume_safety)")
#else
#define TALBOT_VECTOR_LOOP _Pragma("GCC ivdep")
#endif
