#include "scene/strand_build.h"

#include <algorithm>
#include <cmath>

namespace talbot::scene {
namespace {

std::string owner_of(const StrandInput& input) {
    return "Hair '" + input.name + "'";
}

[[noreturn]] void fail(const StrandInput& input, const std::string& what) {
    throw Error(what, owner_of(input));
}

/// Segments of the curves that can be traced.
void join_keys(Mesh& mesh, const std::vector<uint8_t>& broken, size_t& broken_curves) {
    for (uint32_t curve = 0; curve + 1 < mesh.curve_starts.size(); ++curve) {
        const uint32_t first = mesh.curve_starts[curve], end = mesh.curve_starts[curve + 1];
        bool whole = true, moves = false;
        for (uint32_t k = first; k < end; ++k) {
            const Vec3 step = mesh.positions[k] - mesh.positions[first];
            whole &= !broken[k];
            moves |= step.x != 0 || step.y != 0 || step.z != 0;
        }
        broken_curves += !whole;
        if (!whole || !moves) continue;
        for (uint32_t k = first; k + 1 < end; ++k) {
            mesh.segment_keys.push_back(k);
            mesh.segment_curves.push_back(curve);
        }
    }
}

/// A point is a primitive: those that cannot be traced are taken out, with their values.
void drop_points(Mesh& mesh, const std::vector<uint8_t>& broken) {
    const auto compact = [&](auto& list, size_t components) {
        size_t to = 0;
        for (size_t i = 0; i < broken.size(); ++i) {
            if (broken[i]) continue;
            for (size_t c = 0; c < components; ++c) list[to * components + c] = list[i * components + c];
            ++to;
        }
        list.resize(to * components);
    };
    compact(mesh.positions, 1);
    compact(mesh.radii, 1);
    for (Attribute& attribute : mesh.attributes) compact(attribute.data, attribute.components);
}

}  // namespace

Mesh build_strands(const StrandInput& input, Report& report) {
    const size_t keys = input.positions.size() / 3, curves = input.curve_starts.empty() ? 0 : input.curve_starts.size() - 1;
    const bool points = input.curve_starts.empty();
    if (input.positions.size() != keys * 3) fail(input, "positions has a wrong length");
    if (input.radii.size() != keys) fail(input, "radii has " + std::to_string(input.radii.size()) + " elements instead of " + std::to_string(keys));
    if (!points && (input.curve_starts.front() != 0 || input.curve_starts.back() != keys)) fail(input, "curve_starts does not span all keys");
    for (size_t i = 0; i < curves; ++i)
        if (input.curve_starts[i] >= input.curve_starts[i + 1]) fail(input, "a curve has no keys");

    Mesh mesh;
    mesh.name = input.name;
    mesh.kind = points ? GeometryKind::Points : GeometryKind::Curves;
    mesh.curve_shape = input.shape;
    mesh.curve_subdivisions = input.subdivisions;
    mesh.curve_starts.assign(input.curve_starts.begin(), input.curve_starts.end());
    mesh.active_uv = input.active_uv;
    mesh.active_color = input.active_color;
    mesh.generated_offset = input.generated_offset;
    mesh.generated_scale = input.generated_scale;
    mesh.positions.resize(keys);
    mesh.radii.resize(keys);
    std::vector<uint8_t> broken(keys, 0);
    size_t broken_count = 0;
    for (size_t i = 0; i < keys; ++i) {
        const Vec3 p{input.positions[3 * i], input.positions[3 * i + 1], input.positions[3 * i + 2]};
        broken[i] = !is_finite(p) || !std::isfinite(input.radii[i]);
        mesh.positions[i] = broken[i] ? Vec3{} : p;
        mesh.radii[i] = broken[i] ? 0.0f : std::max(input.radii[i], 0.0f);
        broken_count += broken[i];
    }
    for (const MeshInputAttribute& a : input.attributes) {
        if (a.domain != Domain::Vertex && a.domain != Domain::Face) fail(input, "attribute '" + a.name + "' has a domain that only meshes have");
        mesh.attributes.push_back(copy_attribute(a, a.domain == Domain::Vertex ? keys : curves, owner_of(input)));
    }
    if (points) {
        if (broken_count > 0) drop_points(mesh, broken);
    } else {
        broken_count = 0;
        join_keys(mesh, broken, broken_count);
    }
    if (broken_count > 0)
        report.warning(std::to_string(broken_count) + (points ? " points" : " curves") + " have NaN or infinite numbers and are left out",
                       (points ? "Points '" : "Hair '") + input.name + "'");
    return mesh;
}

}  // namespace talbot::scene
