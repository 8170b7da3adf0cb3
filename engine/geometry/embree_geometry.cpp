#include "geometry/embree_geometry.h"

#if __has_include(<embree4/rtcore.h>)
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

#include <algorithm>
#include <cstring>
#include <memory>

#include "scene/view.h"

namespace talbot::geometry {
namespace {

struct ReleaseGeometry {
    void operator()(RTCGeometry geometry) const { rtcReleaseGeometry(geometry); }
};
using GeometryPtr = std::unique_ptr<std::remove_pointer_t<RTCGeometry>, ReleaseGeometry>;

constexpr size_t kBlock = 1 << 18;

/// Positions of a motion step.
const Vec3* positions_at(const scene::Mesh& mesh, int step) {
    return mesh.motion_steps > 1 ? mesh.motion_positions.data() + size_t(step) * mesh.positions.size() : mesh.positions.data();
}

void fill_triangles(RTCGeometry geometry, const scene::Mesh& mesh, const std::vector<uint32_t>& repeated, const Affine* to_world,
                    const std::function<void()>& poll) {
    const size_t vertices = mesh.positions.size(), triangles = mesh.triangle_count();
    if (repeated.empty()) {
        rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, mesh.triangle_vertices.data(), 0, 3 * sizeof(uint32_t), triangles);
    } else {
        auto* indices = static_cast<uint32_t*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 3 * sizeof(uint32_t), triangles));
        if (!indices) return;
        std::memcpy(indices, mesh.triangle_vertices.data(), triangles * 3 * sizeof(uint32_t));
        for (uint32_t i : repeated) std::fill_n(indices + 3 * size_t(i), 3, indices[3 * size_t(i)]);  // no area: never hit
    }
    for (int step = 0; step < mesh.motion_steps; ++step) {
        // Embree's own buffers are padded for its 16-byte loads; the scene's vectors are not.
        auto* out =
            static_cast<float*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, unsigned(step), RTC_FORMAT_FLOAT3, 3 * sizeof(float), vertices));
        if (!out) return;
        const Vec3* positions = positions_at(mesh, step);
        for (size_t begin = 0; begin < vertices; begin += kBlock) {
            poll();
            const size_t end = std::min(vertices, begin + kBlock);
            if (!to_world) {
                std::memcpy(out + 3 * begin, positions + begin, (end - begin) * sizeof(Vec3));
                continue;
            }
            for (size_t i = begin; i < end; ++i) {
                const Vec3 p = positions[i];
                for (int row = 0; row < 3; ++row) {
                    const float* m = to_world->m[row];
                    out[3 * i + size_t(row)] = float(double(m[0]) * p.x + double(m[1]) * p.y + double(m[2]) * p.z + m[3]);
                }
            }
        }
    }
}

/// Spheres and round curves are seen from outside only, as in Cycles: what enters one does not meet it again.
void drop_backs(const RTCFilterFunctionNArguments* args) {
    for (unsigned i = 0; i < args->N; ++i) {
        if (args->valid[i] != -1) continue;
        const float cosine = RTCRayN_dir_x(args->ray, args->N, i) * RTCHitN_Ng_x(args->hit, args->N, i) +
                             RTCRayN_dir_y(args->ray, args->N, i) * RTCHitN_Ng_y(args->hit, args->N, i) +
                             RTCRayN_dir_z(args->ray, args->N, i) * RTCHitN_Ng_z(args->hit, args->N, i);
        if (cosine > 0) args->valid[i] = 0;
    }
}

void drop_backs_of(RTCGeometry geometry) {
    rtcSetGeometryIntersectFilterFunction(geometry, drop_backs);
    rtcSetGeometryOccludedFilterFunction(geometry, drop_backs);
}

/// Catmull-Rom segments take the keys around them: each curve's first and last key are there twice, so key k of curve c is at k + 2 c + 1.
void fill_curves(RTCGeometry geometry, const scene::Mesh& mesh, const std::function<void()>& poll) {
    const bool linear = mesh.curve_shape == scene::CurveShape::ThickLinear;
    const size_t curves = mesh.curve_starts.size() - 1, segments = mesh.segment_keys.size(), padding = linear ? 0 : 2;
    auto* indices = static_cast<uint32_t*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT, sizeof(uint32_t), segments));
    if (!indices) return;
    for (size_t i = 0; i < segments; ++i) indices[i] = mesh.segment_keys[i] + uint32_t(padding) * mesh.segment_curves[i];
    for (int step = 0; step < mesh.motion_steps; ++step) {
        auto* out = static_cast<float*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, unsigned(step), RTC_FORMAT_FLOAT4, 4 * sizeof(float),
                                                                mesh.positions.size() + padding * curves));
        if (!out) return;
        const Vec3* positions = positions_at(mesh, step);
        const auto put = [&](size_t key) {
            const Vec3 p = positions[key];
            *out++ = p.x, *out++ = p.y, *out++ = p.z, *out++ = mesh.radii[key];
        };
        for (size_t curve = 0; curve < curves; ++curve) {
            if (curve % kBlock == 0) poll();
            const size_t first = mesh.curve_starts[curve], end = mesh.curve_starts[curve + 1];
            if (!linear) put(first);
            for (size_t key = first; key < end; ++key) put(key);
            if (!linear) put(end - 1);
        }
    }
    if (linear) {
        auto* flags = static_cast<uint8_t*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_FLAGS, 0, RTC_FORMAT_UCHAR, 1, segments));
        if (!flags) return;
        for (size_t i = 0; i < segments; ++i) {
            const uint32_t key = mesh.segment_keys[i], curve = mesh.segment_curves[i];
            flags[i] = uint8_t((key > mesh.curve_starts[curve] ? RTC_CURVE_FLAG_NEIGHBOR_LEFT : 0) |
                               (key + 2 < mesh.curve_starts[curve + 1] ? RTC_CURVE_FLAG_NEIGHBOR_RIGHT : 0));
        }
    }
    if (mesh.curve_shape == scene::CurveShape::Ribbon) {
        rtcSetGeometryTessellationRate(geometry, float(scene::ribbon_pieces(mesh)));
    } else {
        drop_backs_of(geometry);
    }
}

void fill_points(RTCGeometry geometry, const scene::Mesh& mesh) {
    const size_t points = mesh.positions.size();
    drop_backs_of(geometry);
    for (int step = 0; step < mesh.motion_steps; ++step) {
        auto* out =
            static_cast<float*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, unsigned(step), RTC_FORMAT_FLOAT4, 4 * sizeof(float), points));
        if (!out) return;
        const Vec3* positions = positions_at(mesh, step);
        for (size_t i = 0; i < points; ++i) *out++ = positions[i].x, *out++ = positions[i].y, *out++ = positions[i].z, *out++ = mesh.radii[i];
    }
}

RTCGeometryType type_of(const scene::Mesh& mesh) {
    if (mesh.kind == scene::GeometryKind::Triangles) return RTC_GEOMETRY_TYPE_TRIANGLE;
    if (mesh.kind == scene::GeometryKind::Points) return RTC_GEOMETRY_TYPE_SPHERE_POINT;
    switch (mesh.curve_shape) {
        case scene::CurveShape::Ribbon:
            return RTC_GEOMETRY_TYPE_FLAT_CATMULL_ROM_CURVE;
        case scene::CurveShape::Thick:
            return RTC_GEOMETRY_TYPE_ROUND_CATMULL_ROM_CURVE;
        case scene::CurveShape::ThickLinear:
            return RTC_GEOMETRY_TYPE_ROUND_LINEAR_CURVE;
    }
    return RTC_GEOMETRY_TYPE_TRIANGLE;
}

}  // namespace

RTCGeometryTy* make_geometry(RTCDeviceTy* device, const scene::Mesh& mesh, const std::vector<uint32_t>& repeated, const Affine* to_world,
                             const std::function<void()>& poll) {
    GeometryPtr geometry(rtcNewGeometry(device, type_of(mesh)));
    if (!geometry) return nullptr;
    if (mesh.motion_steps > 1) rtcSetGeometryTimeStepCount(geometry.get(), unsigned(mesh.motion_steps));
    switch (mesh.kind) {
        case scene::GeometryKind::Triangles:
            fill_triangles(geometry.get(), mesh, repeated, to_world, poll);
            break;
        case scene::GeometryKind::Curves:
            fill_curves(geometry.get(), mesh, poll);
            break;
        case scene::GeometryKind::Points:
            fill_points(geometry.get(), mesh);
            break;
    }
    return geometry.release();
}

}  // namespace talbot::geometry
