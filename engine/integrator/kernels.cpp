#include "integrator/kernels.h"

#include "base/error.h"

namespace talbot::integrator {

#define TALBOT_DECLARE_TABLE(isa)      \
    namespace isa {                    \
    const KernelTable& kernel_table(); \
    }
#ifdef TALBOT_HAS_v2
inline TALBOT_DECLARE_TABLE(v2)
#endif
#ifdef TALBOT_HAS_v3
    inline TALBOT_DECLARE_TABLE(v3)
#endif
#ifdef TALBOT_HAS_v4
        inline TALBOT_DECLARE_TABLE(v4)
#endif
#ifdef TALBOT_HAS_generic
            inline TALBOT_DECLARE_TABLE(generic)
#endif

                const KernelTable& kernels_for(const std::string& instruction_set) {
#ifdef TALBOT_HAS_v2
    if (instruction_set == "v2") return v2::kernel_table();
#endif
#ifdef TALBOT_HAS_v3
    if (instruction_set == "v3") return v3::kernel_table();
#endif
#ifdef TALBOT_HAS_v4
    if (instruction_set == "v4") return v4::kernel_table();
#endif
#ifdef TALBOT_HAS_generic
    if (instruction_set == "generic") return generic::kernel_table();
#endif
    throw Error("instruction set '" + instruction_set + "' is not compiled in");
}

}  // namespace talbot::integrator
