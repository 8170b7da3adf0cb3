/// Expressions -> programs: keeps what an output needs, orders it, gives registers, and makes constants a table of the material.
#pragma once

#include "shader/expressions.h"
#include "shader/graph_compiler.h"

namespace talbot::shader {

/// Which outputs a program is for.
struct ProgramOutputs {
    const std::vector<SlotValues>* slots = nullptr;
    Value3 emission, transparency, normal, displacement;
    const std::vector<AovExpression>* aovs = nullptr;
};

/// The constants of one shader, in the order in which its programs first use them.
struct ConstantTable {
    std::vector<uint32_t> bits;
    std::unordered_map<int32_t, uint32_t> index;  ///< by expression
};

Program lower(const Expressions& expressions, const ProgramOutputs& outputs, ConstantTable& constants);

/// Everything that makes two programs the same, as bytes (the name does not).
std::string fingerprint(const Program& program);

}  // namespace talbot::shader
