/// Where things are at a moment of the shutter, 0 (it opens) to 1 (it closes). The tracer interpolates by the same rule.
#pragma once

#include "scene/view.h"

namespace talbot::scene {
inline namespace TALBOT_ISA {

/// Where a moment lies among the steps of a motion: step and step + 1, and the part of the second.
struct MotionStep {
    int step = 0;
    float part = 0;
};
TALBOT_INLINE MotionStep motion_step(int steps, float time) {
    const float x = clampf(time, 0.0f, 1.0f) * float(steps - 1);
    const int step = int(x) < steps - 2 ? int(x) : steps - 2;
    return {step, x - float(step)};
}

/// Position i of the mesh at a moment of the shutter, 0..1.
TALBOT_INLINE Vec3 position_at(const MeshView& mesh, size_t i, float time) {
    if (!mesh.motion_positions) return mesh.positions[i];
    const MotionStep m = motion_step(mesh.motion_steps, time);
    const Vec3* at = mesh.motion_positions + size_t(m.step) * mesh.position_count + i;
    return lerp(at[0], at[mesh.position_count], m.part);
}

TALBOT_INLINE Affine lerp(const Affine& a, const Affine& b, float t) {
    Affine r;
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 4; ++j) r.m[i][j] = a.m[i][j] + (b.m[i][j] - a.m[i][j]) * t;
    return r;
}
TALBOT_INLINE Affine map_at(const Affine* motion, int steps, float time) {
    const MotionStep m = motion_step(steps, time);
    return lerp(motion[m.step], motion[m.step + 1], m.part);
}

/// The maps of an object; the rest of it stays.
struct Placement {
    Affine to_world, to_object;
};
TALBOT_INLINE Placement placement_at(const SceneView& scene, int32_t object, float time) {
    const MotionView motion = motion_of(scene, object);
    if (motion.steps == 0) return {scene.objects[object].to_world, scene.to_object[object]};
    Placement p;
    p.to_world = map_at(motion.maps, motion.steps, time);
    p.to_object = inverse(p.to_world);
    return p;
}

}  // namespace TALBOT_ISA
}  // namespace talbot::scene
