/// Operations that prepare closure parameters (Op::Closure); loops in kernels/ops_closure.cpp.
#pragma once

#include <cstdint>

namespace talbot::shader {

enum class ClosureOp : uint8_t {
    AlphaFromRoughness,  ///< roughness -> clamped, squared
};

}  // namespace talbot::shader
