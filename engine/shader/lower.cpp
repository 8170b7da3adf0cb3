#include "shader/lower.h"

#include <algorithm>
#include <array>
#include <map>
#include <tuple>

namespace talbot::shader {
namespace {

constexpr int kUnused = -1;

class Lowering {
public:
    Lowering(const Expressions& expressions, ConstantTable& constants)
        : e_(expressions), constants_(constants), last_use_(expressions.size(), kUnused), emitted_(expressions.size(), false) {}

    Program run(const ProgramOutputs& outputs) {
        mark(outputs);
        pin(outputs);
        order();
        allocate();
        finish(outputs);
        return std::move(program_);
    }

private:
    using Triple = std::array<int32_t, 3>;
    static Triple ids(const Value3& v) { return {v.x.id, v.y.id, v.z.id}; }

    void need(Value v) {
        if (v.valid()) needed_[size_t(e_.owner(v))] = true;
    }
    void need(const Value3& v) {
        need(v.x);
        need(v.y);
        need(v.z);
    }

    // Expressions read earlier ones only, so one backward pass finds what the outputs need.
    void mark(const ProgramOutputs& outputs) {
        needed_.assign(e_.size(), false);
        if (outputs.slots) {
            for (const SlotValues& slot : *outputs.slots) {
                need(slot.weight);
                need(slot.normal);
                for (Value v : slot.params) need(v);
            }
        }
        need(outputs.emission);
        need(outputs.transparency);
        need(outputs.normal);
        need(outputs.displacement);
        if (outputs.aovs)
            for (const AovExpression& aov : *outputs.aovs) need(aov.value);
        for (size_t i = e_.size(); i-- > 0;) {
            if (!needed_[i]) continue;
            for (int32_t in : e_.expression(i).inputs) needed_[size_t(e_.owner(Value{in}))] = true;
        }
    }

    // Outputs that must stand in three registers in a row get registers of their own, before all others. A value that is already
    // elsewhere (or twice in the triple) is copied at the end.
    void pin(const ProgramOutputs& outputs) {
        const auto pin_triple = [this](const Value3& v) {
            if (!v.valid() || triples_.contains(ids(v))) return;
            const uint16_t first = uint16_t(registers_);
            registers_ += 3;
            triples_[ids(v)] = first;
            for (size_t k = 0; k < 3; ++k) {
                const int32_t id = ids(v)[k];
                if (fixed_.contains(id)) {
                    copies_.push_back({id, uint16_t(first + k)});
                } else {
                    fixed_[id] = uint16_t(first + k);
                }
            }
        };
        if (outputs.slots) {
            for (const SlotValues& slot : *outputs.slots) {
                pin_triple(slot.weight);
                pin_triple(slot.normal);
            }
        }
        pin_triple(outputs.emission);
        pin_triple(outputs.transparency);
        pin_triple(outputs.normal);
        pin_triple(outputs.displacement);
        if (outputs.aovs)
            for (const AovExpression& aov : *outputs.aovs) pin_triple(aov.value);
        // Parameters are edited in place (filter glossy), so one register serves only one kind of parameter.
        if (!outputs.slots) return;
        std::map<int32_t, std::pair<int, size_t>> owner;
        for (const SlotValues& slot : *outputs.slots) {
            for (size_t k = 0; k < slot.params.size(); ++k) {
                const int32_t id = slot.params[k].id;
                const std::pair<int, size_t> role{int(slot.type), k};
                const auto key = std::tuple(id, role.first, role.second);
                if (params_.contains(key)) continue;
                const uint16_t target = uint16_t(registers_++);
                params_[key] = target;
                if (fixed_.contains(id)) {
                    copies_.push_back({id, target});
                } else {
                    fixed_[id] = target;
                }
            }
        }
    }

    void place(size_t index) {
        if (emitted_[index]) return;
        emitted_[index] = true;
        order_.push_back(int32_t(index));
    }
    // Numbers are fetched just before their first use, to keep registers few.
    void order() {
        const auto is_number = [this](size_t i) { return e_.expression(i).op == Op::Literal || e_.expression(i).op == Op::Constant; };
        for (size_t i = 0; i < e_.size(); ++i) {
            if (!needed_[i] || is_number(i)) continue;
            for (int32_t in : e_.expression(i).inputs) {
                const size_t owner = size_t(e_.owner(Value{in}));
                if (is_number(owner)) place(owner);
            }
            place(i);
        }
        for (size_t i = 0; i < e_.size(); ++i)
            if (needed_[i]) place(i);
        for (size_t at = 0; at < order_.size(); ++at)
            for (int32_t in : e_.expression(size_t(order_[at])).inputs) last_use_[size_t(e_.owner(Value{in}))] = int(at);
    }

    uint16_t take() {
        if (free_.empty()) return uint16_t(registers_++);
        const uint16_t r = free_.back();
        free_.pop_back();
        return r;
    }

    void allocate() {
        std::vector<std::vector<int32_t>> ends(order_.size() + 1);
        for (int32_t index : order_)
            if (last_use_[size_t(index)] != kUnused) ends[size_t(last_use_[size_t(index)])].push_back(index);
        for (size_t at = 0; at < order_.size(); ++at) {
            const Expression& x = e_.expression(size_t(order_[at]));
            Instruction instruction;
            instruction.op = x.op;
            instruction.variant = x.variant;
            instruction.outs = x.outs;
            instruction.ins = uint8_t(x.inputs.size());
            instruction.operands = uint32_t(program_.operands.size());
            instruction.data = x.op == Op::Constant ? constant_index(order_[at], x.data) : x.data;
            for (int k = 0; k < x.outs; ++k) {
                const int32_t id = x.first + k;
                const auto fixed = fixed_.find(id);
                location_[id] = fixed != fixed_.end() ? fixed->second : take();
                program_.operands.push_back(location_[id]);
            }
            for (int32_t in : x.inputs) program_.operands.push_back(location_.at(in));
            program_.code.push_back(instruction);
            for (int32_t index : ends[at]) release(e_.expression(size_t(index)));
            if (last_use_[size_t(order_[at])] == kUnused) release(x);
        }
    }
    void release(const Expression& x) {
        for (int k = 0; k < x.outs; ++k) {
            const int32_t id = x.first + k;
            if (!fixed_.contains(id)) free_.push_back(location_.at(id));
        }
    }
    uint32_t constant_index(int32_t expression, uint32_t bits) {
        const auto [it, is_new] = constants_.index.try_emplace(expression, uint32_t(constants_.bits.size()));
        if (is_new) constants_.bits.push_back(bits);
        return it->second;
    }

    void finish(const ProgramOutputs& outputs) {
        for (const auto& [id, target] : copies_) {
            Instruction copy;
            copy.op = Op::Copy;
            copy.outs = copy.ins = 1;
            copy.operands = uint32_t(program_.operands.size());
            program_.operands.push_back(target);
            program_.operands.push_back(location_.at(id));
            program_.code.push_back(copy);
        }
        if (outputs.slots) {
            for (const SlotValues& from : *outputs.slots) {
                ClosureSlot slot;
                slot.type = from.type;
                slot.lobe = from.lobe;
                slot.variant = from.variant;
                slot.weight = triples_.at(ids(from.weight));
                slot.normal = triples_.at(ids(from.normal));
                slot.param_count = uint8_t(from.params.size());
                for (size_t k = 0; k < from.params.size(); ++k) slot.params[k] = params_.at({from.params[k].id, int(from.type), k});
                program_.slots.push_back(slot);
            }
        }
        if (outputs.emission.valid()) program_.emission = triples_.at(ids(outputs.emission));
        if (outputs.transparency.valid()) program_.transparency = triples_.at(ids(outputs.transparency));
        if (outputs.normal.valid()) program_.normal = triples_.at(ids(outputs.normal));
        if (outputs.displacement.valid()) program_.displacement = triples_.at(ids(outputs.displacement));
        if (outputs.aovs)
            for (const AovExpression& aov : *outputs.aovs) program_.aovs.push_back({uint16_t(aov.aov), triples_.at(ids(aov.value)), uint16_t(aov.nodes)});
        program_.register_count = registers_;
    }

    const Expressions& e_;
    ConstantTable& constants_;
    Program program_;
    std::vector<bool> needed_;
    std::vector<int> last_use_;
    std::vector<bool> emitted_;
    std::vector<int32_t> order_;
    std::map<Triple, uint16_t> triples_;
    std::map<std::tuple<int32_t, int, size_t>, uint16_t> params_;
    std::unordered_map<int32_t, uint16_t> fixed_, location_;
    std::vector<std::pair<int32_t, uint16_t>> copies_;
    std::vector<uint16_t> free_;
    int registers_ = 0;
};

}  // namespace

Program lower(const Expressions& expressions, const ProgramOutputs& outputs, ConstantTable& constants) {
    return Lowering(expressions, constants).run(outputs);
}

std::string fingerprint(const Program& program) {
    std::string bytes;
    const auto put = [&bytes](uint32_t x) { bytes.append(reinterpret_cast<const char*>(&x), sizeof x); };
    for (const Instruction& i : program.code) {
        put(uint32_t(i.op) | uint32_t(i.variant) << 16);
        put(uint32_t(i.outs) | uint32_t(i.ins) << 8);
        put(i.data);
    }
    put(0xffffffffu);
    for (uint16_t r : program.operands) put(r);
    put(0xffffffffu);
    for (const ClosureSlot& s : program.slots) {
        put(uint32_t(s.type) | uint32_t(s.lobe) << 8 | uint32_t(s.variant) << 16 | uint32_t(s.param_count) << 24);
        put(uint32_t(s.weight) | uint32_t(s.normal) << 16);
        for (int k = 0; k < s.param_count; ++k) put(s.params[k]);
    }
    put(uint32_t(program.emission) | uint32_t(program.transparency) << 16);
    put(uint32_t(program.normal) | uint32_t(program.register_count) << 16);
    put(program.displacement);
    for (const AovValue& aov : program.aovs) {
        put(uint32_t(aov.aov) | uint32_t(aov.first) << 16);
        put(aov.nodes);
    }
    return bytes;
}

}  // namespace talbot::shader
