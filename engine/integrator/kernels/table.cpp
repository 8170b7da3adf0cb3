#include "integrator/kernels/stages.h"

namespace talbot::integrator {
inline namespace TALBOT_ISA {

void trace_for_nodes(void* user, shader::TraceRequest& request);
bool render_unit(const RenderContext& context, const RenderUnit& unit, Worker& worker, film::TileFilm& tile);

const KernelTable& kernel_table() {
    static constexpr KernelTable table{TALBOT_ISA_NAME, &render_unit, &trace_for_nodes, &shader::run_program};
    return table;
}

}  // namespace TALBOT_ISA
}  // namespace talbot::integrator
