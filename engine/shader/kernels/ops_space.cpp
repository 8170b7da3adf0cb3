// From space to space: the object's, the lamp's, the camera's, the window.
#include "scene/motion.h"
#include "shader/kernels/lanes.h"

namespace talbot::shader {
inline namespace TALBOT_ISA {
namespace {

TALBOT_INLINE Vec3 transform(const Affine& to_world, const Affine& to_object, TransformKind kind, Vec3 v) {
    switch (kind) {
        case TransformKind::PointToObject:
            return transform_point(to_object, v);
        case TransformKind::VectorToObject:
            return transform_direction(to_object, v);
        case TransformKind::NormalToObject:
            return transform_normal(to_world, v);
        case TransformKind::PointToWorld:
            return transform_point(to_world, v);
        case TransformKind::VectorToWorld:
            return transform_direction(to_world, v);
        case TransformKind::NormalToWorld:
            return transform_normal(to_object, v);
    }
    return v;
}

/// Distance from the middle of a fisheye's film to what it sees at `theta` from the axis: Newton's method.
float polynomial_radius(const float* k, float theta) {
    float r = k[1] != 0.0f ? -(theta + k[0]) / k[1] : 0.0f;
    for (int i = 0; i < 20; ++i) {
        const float value = theta + k[0] + r * (k[1] + r * (k[2] + r * (k[3] + r * k[4])));
        const float slope = k[1] + r * (2.0f * k[2] + r * (3.0f * k[3] + r * 4.0f * k[4]));
        if (slope == 0.0f || std::fabs(value) < 1e-7f) break;
        r -= value / slope;
    }
    return r;
}

/// Where a panoramic camera's film sees a unit direction of camera space: what its rays are made by, turned round.
Vec2 panorama_window(const scene::Camera& camera, Vec3 direction) {
    using scene::PanoramaType;
    const Vec3 p{-direction.z, -direction.x, direction.y};  // +X is the axis, +Z up
    const float across = std::atan2(p.y, p.x), side = std::sqrt(p.y * p.y + p.z * p.z), theta = std::acos(clampf(p.x, -1.0f, 1.0f));
    const Vec2 around = side > 0.0f ? Vec2{-p.y / side, p.z / side} : Vec2{1, 0};
    const auto share = [](float x, float from, float to) { return to != from ? (x - from) / (to - from) : 0.0f; };
    const auto on_sensor = [&](float r) { return Vec2{0.5f + r * around.x / camera.sensor_width_mm, 0.5f + r * around.y / camera.sensor_height_mm}; };
    switch (camera.panorama) {
        case PanoramaType::Equirectangular:
            return {share(across, -camera.longitude_min, -camera.longitude_max),
                    share(std::acos(clampf(p.z, -1.0f, 1.0f)), kPi / 2 - camera.latitude_min, kPi / 2 - camera.latitude_max)};
        case PanoramaType::EquiangularCubemap:
            return {0.5f - across * (2 / kPi), 0.5f + std::atan2(p.z, p.x) * (2 / kPi)};
        case PanoramaType::Mirrorball: {
            const Vec3 half{-p.y, -p.x - 1.0f, p.z};
            const float size = length(half), scale = size > 0.0f ? 0.5f / size : 0.0f;
            return {0.5f + half.x * scale, 0.5f + half.z * scale};
        }
        case PanoramaType::FisheyeEquidistant: {
            const float r = camera.fov != 0.0f ? theta / camera.fov : 0.0f;
            return {0.5f + r * around.x, 0.5f + r * around.y};
        }
        case PanoramaType::FisheyeEquisolid:
            return on_sensor(2.0f * camera.lens_mm * std::sin(theta * 0.5f));
        case PanoramaType::FisheyePolynomial:
            return on_sensor(polynomial_radius(camera.polynomial, theta));
        case PanoramaType::CentralCylindrical: {
            const float flat = std::sqrt(p.x * p.x + p.y * p.y);
            return {share(across, -camera.cylinder[0], -camera.cylinder[1]), share(flat > 0.0f ? p.z / flat : 0.0f, camera.cylinder[2], camera.cylinder[3])};
        }
    }
    return {};
}

}  // namespace

void op_object_transform(const Instruction& i, Registers r, int n, const OpScope& s) {
    const TransformKind kind = TransformKind(i.variant & (kNotOfLamps - 1));
    const bool of_lamps = !(i.variant & kNotOfLamps);
    for (int k = 0; k < s.span.n; ++k) {
        Vec3 v{r[3][k], r[4][k], r[5][k]};
        const int32_t object = object_of(s, k);
        if (object >= 0) {
            const scene::Placement placed = scene::placement_at(*s.context.scene, object, s.span.time ? s.span.time[k] : 0.5f);
            v = transform(placed.to_world, placed.to_object, kind, v);
        } else if (of_lamps && s.span.is_lamp && s.span.lamp_to_world) {
            v = transform(*s.span.lamp_to_world, *s.span.lamp_to_object, kind, v);
        }
        r[0][k] = v.x;
        r[1][k] = v.y;
        r[2][k] = v.z;
    }
    pad(r, 3, s.span.n, n);
}

void op_camera_transform(const Instruction& i, Registers r, int n, const OpScope& s) {
    Affine to_world;
    if (s.context.scene && s.context.scene->camera) to_world = s.context.scene->camera->to_world;
    // Camera space here has +Z forward; of a panorama's camera +X, with +Y to the left.
    const bool panoramic = s.context.scene && s.context.scene->camera && s.context.scene->camera->type == scene::CameraType::Panoramic;
    for (auto& row : to_world.m) {
        if (panoramic) {
            const float right = row[0], up = row[1];
            row[0] = -row[2];
            row[1] = -right;
            row[2] = up;
        } else {
            row[2] = -row[2];
        }
    }
    const Affine to_camera = inverse(to_world);
    TransformKind kind = TransformKind(i.variant & (kNotOfLamps - 1));
    const bool around = ((i.variant & kAroundBackground) && s.span.is_background) || ((i.variant & kAroundLamps) && s.span.is_lamp);
    if (around) kind = TransformKind::VectorToObject;
    for (int k = 0; k < n; ++k) {
        const Vec3 v = transform(to_world, to_camera, kind, Vec3{r[3][k], r[4][k], r[5][k]});
        r[0][k] = v.x;
        r[1][k] = v.y;
        r[2][k] = v.z;
    }
}

void op_window(const Instruction& i, Registers r, int n, const OpScope& s) {
    // World position -> place on the whole film, 0..1 from the bottom left.
    static constexpr scene::Camera kNoCamera{};
    const scene::Camera& camera = s.context.scene && s.context.scene->camera ? *s.context.scene->camera : kNoCamera;
    const Affine to_camera = inverse(camera.to_world);
    const bool directions = s.span.is_background || ((i.variant & kAroundLamps) && s.span.is_lamp);
    if (camera.type == scene::CameraType::Panoramic) {
        using scene::PanoramaType;
        const bool fisheye = camera.panorama == PanoramaType::FisheyeEquidistant || camera.panorama == PanoramaType::FisheyeEquisolid;
        const bool mirrored = (i.variant & 1) && fisheye;
        for (int k = 0; k < n; ++k) {
            const Vec3 p{r[2][k], r[3][k], r[4][k]};
            const Vec2 at = panorama_window(camera, normalize(directions ? transform_direction(to_camera, p) : transform_point(to_camera, p)));
            r[0][k] = mirrored ? 1.0f - at.x : at.x;
            r[1][k] = at.y;
        }
        return;
    }
    const float width = camera.view[1] - camera.view[0], height = camera.view[3] - camera.view[2];
    const bool flat = camera.type == scene::CameraType::Orthographic;
    // Parallel rays to the background differ by their place alone; of other rays the direction counts, as if it were a point.
    const bool has_places = flat && s.span.is_background && s.span.origin.x && s.span.ray_flags;
    for (int k = 0; k < n; ++k) {
        const int lane = std::min(k, s.span.n - 1);
        const bool place = has_places && (s.span.ray_flags[lane] & kRayCamera);
        const Vec3 p = place ? load(s.span.origin, lane) : Vec3{r[2][k], r[3][k], r[4][k]};
        const Vec3 c = directions && !flat ? transform_direction(to_camera, p) : transform_point(to_camera, p);
        const float depth = flat ? 1.0f : -c.z;
        const float scale = depth != 0.0f ? 1.0f / depth : 0.0f;
        r[0][k] = width != 0.0f ? (c.x * scale - camera.view[0]) / width : 0.0f;
        r[1][k] = height != 0.0f ? (c.y * scale - camera.view[2]) / height : 0.0f;
    }
}

}  // namespace TALBOT_ISA
}  // namespace talbot::shader
