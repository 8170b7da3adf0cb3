/// A shader under compilation: a graph of scalar expressions, shared where equal and folded where constant.
///
/// Two kinds of known number: a *literal* belongs to the program (equal ones are one; 0 and 1 simplify arithmetic); a *constant*
/// belongs to the material: every socket value is one of its own, even when equal to another, so that materials which differ in socket values only
/// compile to the same program. Folding runs the very operation on one lane; what depends on a constant stays a constant.
#pragma once

#include <array>
#include <initializer_list>
#include <span>
#include <string>
#include <unordered_map>
#include <vector>

#include "shader/op.h"
#include "shader/program.h"

namespace talbot::shader {

/// One scalar result.
struct Value {
    int32_t id = -1;
    bool valid() const { return id >= 0; }
    bool operator==(const Value&) const = default;
};
struct Value3 {
    Value x, y, z;
    bool valid() const { return x.valid(); }
    bool operator==(const Value3&) const = default;
};

struct Expression {
    Op op = Op::Literal;
    uint8_t variant = 0;
    uint8_t outs = 1;
    uint32_t data = 0;            ///< literals and constants: the bits
    int32_t first = 0;            ///< id of the first result; the others follow
    std::vector<int32_t> inputs;  ///< value ids
};

/// Where each table of Programs::tables lies, by hash of its contents: equal tables are stored once.
using TableIndex = std::unordered_multimap<size_t, std::pair<size_t, size_t>>;

class Expressions {
public:
    /// `programs.tables` (ramps, curves, albedo tables) is read by folding and may grow meanwhile.
    Expressions(Programs& programs, TableIndex& tables) : programs_(programs), tables_(tables) {}

    Value literal(float x) { return literal_bits(__builtin_bit_cast(uint32_t, x)); }
    Value literal_bits(uint32_t bits);
    /// A number of the material's own.
    Value constant(float x) { return constant_bits(__builtin_bit_cast(uint32_t, x)); }
    Value constant_bits(uint32_t bits);
    Value3 literal3(float x, float y, float z) { return {literal(x), literal(y), literal(z)}; }
    Value3 constant3(float x, float y, float z) { return {constant(x), constant(y), constant(z)}; }
    /// Appends the operation (or finds the same one, or folds it); returns its first result, the others follow by id.
    Value emit(Op op, uint8_t variant, std::span<const Value> inputs, int outs = 1, uint32_t data = 0);
    Value emit(Op op, uint8_t variant, std::initializer_list<Value> inputs, int outs = 1, uint32_t data = 0) {
        return emit(op, variant, std::span<const Value>(inputs.begin(), inputs.size()), outs, data);
    }
    Value3 emit3(Op op, uint8_t variant, std::initializer_list<Value> inputs, uint32_t data = 0) { return triple(emit(op, variant, inputs, 3, data)); }
    /// Result `offset` places after v (for operations with several results).
    Value after(Value v, int offset) const;
    Value3 triple(Value v) const { return {v, after(v, 1), after(v, 2)}; }

    bool is_literal(Value v) const { return at(v).op == Op::Literal; }
    /// Literal or constant.
    bool is_known(Value v) const { return at(v).op == Op::Literal || at(v).op == Op::Constant; }
    bool is_known(const Value3& v) const { return is_known(v.x) && is_known(v.y) && is_known(v.z); }
    float known(Value v) const { return __builtin_bit_cast(float, at(v).data); }
    /// Known to be exactly x.
    bool is(Value v, float x) const { return is_known(v) && known(v) == x; }
    bool is_zero(const Value3& v) const { return is(v.x, 0) && is(v.y, 0) && is(v.z, 0); }

    // Arithmetic.
    Value unary(UnaryKind k, Value a) { return emit(Op::Unary, uint8_t(k), {a}); }
    Value binary(BinaryKind k, Value a, Value b) { return emit(Op::Binary, uint8_t(k), {a, b}); }
    Value ternary(TernaryKind k, Value a, Value b, Value c) { return emit(Op::Ternary, uint8_t(k), {a, b, c}); }
    Value add(Value a, Value b);
    Value sub(Value a, Value b);
    Value mul(Value a, Value b);
    Value mul(Value a, float b) { return mul(a, literal(b)); }
    Value add(Value a, float b) { return add(a, literal(b)); }
    Value div(Value a, Value b) { return binary(BinaryKind::Divide, a, b); }  ///< by 0: 0
    Value min(Value a, Value b) { return binary(BinaryKind::Minimum, a, b); }
    Value max(Value a, Value b) { return binary(BinaryKind::Maximum, a, b); }
    Value max(Value a, float b) { return max(a, literal(b)); }
    Value min(Value a, float b) { return min(a, literal(b)); }
    Value negate(Value a) { return unary(UnaryKind::Negate, a); }
    Value saturate(Value a) { return unary(UnaryKind::Saturate, a); }
    Value one_minus(Value a) { return unary(UnaryKind::OneMinus, a); }
    Value sqrt(Value a) { return unary(UnaryKind::SquareRoot, a); }
    Value lerp(Value a, Value b, Value t);
    Value select(Value condition, Value a, Value b) { return ternary(TernaryKind::Select, condition, a, b); }
    Value3 add(Value3 a, Value3 b) { return {add(a.x, b.x), add(a.y, b.y), add(a.z, b.z)}; }
    Value3 sub(Value3 a, Value3 b) { return {sub(a.x, b.x), sub(a.y, b.y), sub(a.z, b.z)}; }
    Value3 mul(Value3 a, Value3 b) { return {mul(a.x, b.x), mul(a.y, b.y), mul(a.z, b.z)}; }
    Value3 mul(Value3 a, Value b) { return {mul(a.x, b), mul(a.y, b), mul(a.z, b)}; }
    Value3 mul(Value3 a, float b) { return mul(a, literal(b)); }
    Value3 max(Value3 a, float b) { return {max(a.x, b), max(a.y, b), max(a.z, b)}; }
    Value3 saturate(Value3 a) { return {saturate(a.x), saturate(a.y), saturate(a.z)}; }
    Value3 negate(Value3 a) { return {negate(a.x), negate(a.y), negate(a.z)}; }
    Value3 lerp(Value3 a, Value3 b, Value t) { return {lerp(a.x, b.x, t), lerp(a.y, b.y, t), lerp(a.z, b.z, t)}; }
    Value3 select(Value condition, Value3 a, Value3 b) { return {select(condition, a.x, b.x), select(condition, a.y, b.y), select(condition, a.z, b.z)}; }
    Value3 spread(Value a) const { return {a, a, a}; }
    Value dot(Value3 a, Value3 b) { return emit(Op::Vector, uint8_t(VectorKind::Dot), {a.x, a.y, a.z, b.x, b.y, b.z}); }
    Value3 cross(Value3 a, Value3 b) { return emit3(Op::Vector, uint8_t(VectorKind::Cross), {a.x, a.y, a.z, b.x, b.y, b.z}); }
    Value length(Value3 a) { return emit(Op::Vector, uint8_t(VectorKind::Length), {a.x, a.y, a.z}); }
    Value3 normalize(Value3 a) { return emit3(Op::Vector, uint8_t(VectorKind::Normalize), {a.x, a.y, a.z}); }
    Value max_component(Value3 a) { return max(a.x, max(a.y, a.z)); }
    Value input(InputColumn column) { return emit(Op::Input, uint8_t(column), std::span<const Value>{}); }
    Value3 input3(InputColumn first);

    /// Appends a table (equal ones are shared); returns its offset as a constant in bits.
    Value table(const std::vector<float>& data);

    /// A rough guess of the mean of |v| over a scene, for light selection (estimate.cpp).
    float estimate(const Value3& v);

    const Expression& at(Value v) const { return expressions_[size_t(owner_[size_t(v.id)])]; }
    const Expression& expression(size_t index) const { return expressions_[index]; }
    int32_t owner(Value v) const { return owner_[size_t(v.id)]; }
    size_t size() const { return expressions_.size(); }

private:
    Value append(Expression e);
    /// A program of this one operation: results come first in `scratch_`, then the inputs, kSpan floats each.
    void run_alone(const Expression& e, int lanes);
    void run_one_lane(const Expression& e, std::span<const uint32_t> in, std::span<uint32_t> out);

    Programs& programs_;
    TableIndex& tables_;
    std::vector<Expression> expressions_;
    std::vector<int32_t> owner_;                   ///< by value id: expression
    std::unordered_map<std::string, Value> memo_;  ///< by op, variant, data and inputs
    std::vector<float> scratch_;
};

}  // namespace talbot::shader
