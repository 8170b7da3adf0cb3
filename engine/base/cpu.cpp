#include "base/cpu.h"

#include <array>
#include <cstdint>
#include <cstdlib>
#include <fstream>

#include "base/error.h"

namespace talbot {

namespace {
constexpr auto kCompiled = std::to_array<const char*>({TALBOT_ISA_LIST});
}

std::span<const char* const> compiled_isas() {
    return kCompiled;
}

bool machine_runs(const std::string& isa) {
#if defined(__x86_64__)
    __builtin_cpu_init();
    const bool v2 = __builtin_cpu_supports("sse4.2") && __builtin_cpu_supports("popcnt");
    const bool v3 = v2 && __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") && __builtin_cpu_supports("bmi") && __builtin_cpu_supports("bmi2");
    const bool v4 = v3 && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512bw") &&
                    __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512cd");
    return (isa == "v2" && v2) || (isa == "v3" && v3) || (isa == "v4" && v4);
#else
    return isa == "generic";
#endif
}

std::string choose_isa() {
    if (const char* wanted = std::getenv("TALBOT_ISA"); wanted && *wanted) {
        for (const char* isa : kCompiled) {
            if (std::string(wanted) != isa) continue;
            if (!machine_runs(isa)) throw Error("TALBOT_ISA=" + std::string(isa) + ": this machine cannot run it");
            return isa;
        }
        throw Error("TALBOT_ISA=" + std::string(wanted) + ": not compiled in");
    }
    std::string best;
    for (const char* isa : kCompiled)
        if (machine_runs(isa)) best = isa;
    if (best.empty()) throw Error("this machine runs none of the compiled instruction sets");
    return best;
}

size_t available_memory() {
    std::ifstream file("/proc/meminfo");
    for (std::string name, unit; file >> name;) {
        size_t kibibytes = 0;
        if (name == "MemAvailable:" && file >> kibibytes) return kibibytes << 10;
        std::getline(file, unit);
    }
    return SIZE_MAX;
}

}  // namespace talbot
