#include "shader/expressions.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <string>
#include <string_view>

namespace talbot::shader {
namespace {

std::string key_of(Op op, uint8_t variant, int outs, uint32_t data, std::span<const Value> inputs) {
    std::string key;
    const auto put = [&key](uint32_t x) { key.append(reinterpret_cast<const char*>(&x), sizeof x); };
    put(uint32_t(op) | uint32_t(variant) << 16 | uint32_t(outs) << 24);
    put(data);
    for (Value v : inputs) put(uint32_t(v.id));
    return key;
}

}  // namespace

Value Expressions::append(Expression e) {
    e.first = int32_t(owner_.size());
    for (int i = 0; i < e.outs; ++i) owner_.push_back(int32_t(expressions_.size()));
    const Value first{e.first};
    expressions_.push_back(std::move(e));
    return first;
}

Value Expressions::literal_bits(uint32_t bits) {
    const std::string key = key_of(Op::Literal, 0, 1, bits, {});
    const auto found = memo_.find(key);
    if (found != memo_.end()) return found->second;
    Expression e;
    e.data = bits;
    return memo_[key] = append(std::move(e));
}

Value Expressions::constant_bits(uint32_t bits) {
    Expression e;
    e.op = Op::Constant;
    e.data = bits;
    return append(std::move(e));
}

Value Expressions::after(Value v, int offset) const {
    return Value{v.id + offset};
}

Value Expressions::emit(Op op, uint8_t variant, std::span<const Value> inputs, int outs, uint32_t data) {
    const std::string key = key_of(op, variant, outs, data, inputs);
    const auto found = memo_.find(key);
    if (found != memo_.end()) return found->second;

    Expression e;
    e.op = op;
    e.variant = variant;
    e.outs = uint8_t(outs);
    e.data = data;
    bool known = is_foldable(op), literal = true;
    for (Value v : inputs) {
        e.inputs.push_back(v.id);
        known = known && is_known(v);
        literal = literal && is_literal(v);
    }
    if (!known) return memo_[key] = append(std::move(e));

    std::vector<uint32_t> in, out(static_cast<size_t>(outs));
    for (Value v : inputs) in.push_back(at(v).data);
    run_one_lane(e, in, out);
    // Results stand side by side, as those of a real operation: fresh constants, or literals (copied where they exist elsewhere).
    Value first;
    if (literal && outs == 1) {
        first = literal_bits(out[0]);
    } else {
        for (int i = 0; i < outs; ++i) {
            Expression r;
            r.op = literal ? Op::Literal : Op::Constant;
            r.data = out[size_t(i)];
            const Value v = append(std::move(r));
            if (i == 0) first = v;
        }
    }
    return memo_[key] = first;
}

void Expressions::run_alone(const Expression& e, int lanes) {
    Program program;
    Instruction instruction;
    instruction.op = e.op;
    instruction.variant = e.variant;
    instruction.outs = e.outs;
    instruction.ins = uint8_t(e.inputs.size());
    instruction.data = e.data;
    program.code.push_back(instruction);
    for (size_t i = 0; i < size_t(e.outs) + e.inputs.size(); ++i) program.operands.push_back(uint16_t(i));
    ShadingSpan span;
    span.n = lanes;
    run_program(program, programs_, span, ShaderContext{}, scratch_.data());
}

void Expressions::run_one_lane(const Expression& e, std::span<const uint32_t> in, std::span<uint32_t> out) {
    scratch_.assign((in.size() + out.size()) * kSpan, 0.0f);
    for (size_t i = 0; i < in.size(); ++i) {
        float* column = &scratch_[(out.size() + i) * kSpan];
        std::fill(column, column + 16, __builtin_bit_cast(float, in[i]));
    }
    run_alone(e, 1);
    for (size_t i = 0; i < out.size(); ++i) std::memcpy(&out[i], &scratch_[i * kSpan], sizeof(float));
}

Value Expressions::add(Value a, Value b) {
    if (is_literal(a) && is(a, 0)) return b;
    if (is_literal(b) && is(b, 0)) return a;
    return binary(BinaryKind::Add, a, b);
}

Value Expressions::sub(Value a, Value b) {
    if (is_literal(b) && is(b, 0)) return a;
    return binary(BinaryKind::Subtract, a, b);
}

Value Expressions::mul(Value a, Value b) {
    if (is_literal(a) && is(a, 1)) return b;
    if (is_literal(b) && is(b, 1)) return a;
    if ((is_literal(a) && is(a, 0)) || (is_literal(b) && is(b, 0))) return literal(0);
    return binary(BinaryKind::Multiply, a, b);
}

Value Expressions::lerp(Value a, Value b, Value t) {
    if (a == b || is(t, 0)) return a;
    if (is(t, 1)) return b;
    return ternary(TernaryKind::Lerp, a, b, t);
}

Value3 Expressions::input3(InputColumn first) {
    return {input(first), input(InputColumn(int(first) + 1)), input(InputColumn(int(first) + 2))};
}

Value Expressions::table(const std::vector<float>& data) {
    const std::string_view bytes(reinterpret_cast<const char*>(data.data()), data.size() * sizeof(float));
    const size_t hash = std::hash<std::string_view>{}(bytes);
    std::vector<float>& all = programs_.tables;
    for (auto [it, end] = tables_.equal_range(hash); it != end; ++it) {
        const auto [offset, size] = it->second;
        if (size == data.size() && std::memcmp(&all[offset], data.data(), bytes.size()) == 0) return constant_bits(uint32_t(offset));
    }
    const size_t offset = all.size();
    all.insert(all.end(), data.begin(), data.end());
    tables_.emplace(hash, std::pair(offset, data.size()));
    return constant_bits(uint32_t(offset));
}

}  // namespace talbot::shader
