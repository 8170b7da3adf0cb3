#include "shader/ops_closure.h"

#include "shader/kernels/ops.h"

namespace talbot::shader {
inline namespace TALBOT_ISA {

void op_closure(const Instruction& i, Registers r, int n, const OpScope&) {
    switch (ClosureOp(i.variant)) {
        case ClosureOp::AlphaFromRoughness:
            map1(r, n, [](float a) { return square(saturate(a)); });
            break;
    }
}

}  // namespace TALBOT_ISA
}  // namespace talbot::shader
