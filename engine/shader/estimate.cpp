/// How bright a shader is, roughly: the mean over random points of a scene that nobody has seen yet. What depends on the scene
/// is drawn at random, lane by lane: directions from the sphere, flags from {0, 1}, textures and attributes from [0, 1). So a
/// lamp that emits into a narrow fan counts for the fan, and one that only the camera sees for nothing. Emitters are chosen by it; it need not be right.
#include <array>
#include <cmath>
#include <cstring>

#include "base/sobol.h"
#include "shader/expressions.h"

namespace talbot::shader {
namespace {

constexpr float kPi = 3.14159265f;

/// A well-spread pair of numbers in [0, 1) for each of the lanes.
Vec2 random_pair(uint32_t what, uint32_t lane) {
    return sample_pair(0, lane, what);
}

/// Component of a direction that is uniform on the sphere.
float random_direction(uint32_t which, int component, uint32_t lane) {
    const Vec2 u = random_pair(which, lane);
    const float z = 2 * u.x - 1;
    if (component == 2) return z;
    const float phi = 2 * kPi * u.y, r = std::sqrt(1 - z * z);
    return r * (component == 0 ? std::cos(phi) : std::sin(phi));
}

float random_number(uint32_t value, uint32_t lane) {
    return random_pair(value + 3, lane).x;
}

float random_input(InputColumn column, uint32_t value, uint32_t lane) {
    // Light is asked for by rays of light samples, never by the camera's.
    if (column == InputColumn::IsCamera) return 0;
    if (column >= InputColumn::NormalX && column <= InputColumn::IncomingZ) {
        const int place = int(column) - int(InputColumn::NormalX);
        return random_direction(uint32_t(place / 3), place % 3, lane);
    }
    const float u = random_number(value, lane);
    const bool is_flag = column >= InputColumn::Backfacing && column <= InputColumn::IsVolumeScatter;
    return is_flag ? std::round(u) : u;
}

}  // namespace

float Expressions::estimate(const Value3& v) {
    // Expressions only read earlier ones, so one pass over what came before is enough.
    const std::array<Value, 3> wanted = {v.x, v.y, v.z};
    std::vector<bool> needed(expressions_.size(), false);
    for (Value x : wanted) needed[size_t(owner(x))] = true;
    for (size_t i = expressions_.size(); i-- > 0;) {
        if (!needed[i]) continue;
        for (int32_t in : expressions_[i].inputs) needed[size_t(owner_[size_t(in)])] = true;
    }
    std::vector<std::vector<float>> columns(owner_.size());
    for (size_t i = 0; i < expressions_.size(); ++i) {
        if (!needed[i]) continue;
        const Expression& e = expressions_[i];
        const bool known = e.op == Op::Literal || e.op == Op::Constant;
        if (!known && is_foldable(e.op)) {
            scratch_.resize((size_t(e.outs) + e.inputs.size()) * kSpan);
            float* in = &scratch_[size_t(e.outs) * kSpan];
            for (int32_t id : e.inputs) {
                std::memcpy(in, columns[size_t(id)].data(), kSpan * sizeof(float));
                in += kSpan;
            }
            run_alone(e, kSpan);
        }
        for (uint32_t out = 0; out < e.outs; ++out) {
            const uint32_t id = uint32_t(e.first) + out;
            std::vector<float>& column = columns[id];
            column.resize(kSpan);
            for (uint32_t lane = 0; lane < kSpan; ++lane) {
                column[lane] = known               ? __builtin_bit_cast(float, e.data)
                               : is_foldable(e.op) ? scratch_[out * kSpan + lane]
                               : e.op == Op::Input ? random_input(InputColumn(e.variant), id, lane)
                                                   : random_number(id, lane);
            }
        }
    }
    double sum = 0;
    for (Value x : wanted) {
        for (float value : columns[size_t(x.id)]) sum += std::isfinite(value) ? std::fabs(double(value)) : 0;
    }
    return float(sum / (3 * kSpan));
}

}  // namespace talbot::shader
