/// Which instruction sets were compiled in and which one this machine runs; how much memory it has left.
#pragma once

#include <cstddef>
#include <span>
#include <string>

namespace talbot {

/// Compiled-in sets, lowest first ("v2", "v3", "v4" or "generic").
std::span<const char* const> compiled_isas();
/// True when the machine can run it.
bool machine_runs(const std::string& isa);
/// The best compiled-in set the machine runs; the environment variable TALBOT_ISA overrides.
/// Throws Error when the override is unknown, not compiled in, or beyond the machine.
std::string choose_isa();
/// Bytes that the system could still give without swapping; SIZE_MAX where it does not say.
size_t available_memory();

}  // namespace talbot
