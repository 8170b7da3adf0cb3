/// The operations of node programs: one enumerator a loop. Operands are listed as in -> out; "3" marks a vector (three
/// registers). Families live in ops_*.cpp; the only switch is in interpreter.cpp.
#pragma once

#include <cstdint>

namespace talbot::shader {

enum class Op : uint16_t {
    Constant,  ///< -> x. data: index of the constant
};

}  // namespace talbot::shader
