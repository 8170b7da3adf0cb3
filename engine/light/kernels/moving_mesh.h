/// Triangles of emissive meshes where they are at a moment of the shutter.
#pragma once

#include "light/kernels/select_emitter.h"
#include "scene/motion.h"

namespace talbot::light {
inline namespace TALBOT_ISA {

struct WorldTriangle {
    Vec3 a, b, c;
};

TALBOT_INLINE Affine map_of(const MeshEmitter& mesh, const scene::SceneView& scene, float time) {
    const scene::MotionView motion = mesh.moves ? scene::motion_of(scene, mesh.object) : scene::MotionView{};
    return motion.steps > 0 ? scene::map_at(motion.maps, motion.steps, time) : mesh.to_world;
}

TALBOT_INLINE WorldTriangle triangle_at(const MeshEmitter& mesh, const LightTriangle& triangle, const Affine& to_world, const scene::SceneView& scene,
                                        float time) {
    Vec3 a = triangle.a, b = triangle.b, c = triangle.c;
    if (mesh.moves) {
        const scene::MeshView& shape = scene.meshes[scene::traits_of(scene, mesh.object).mesh];
        const uint32_t* vertices = shape.triangle_vertices + 3 * size_t(triangle.primitive);
        a = scene::position_at(shape, vertices[0], time);
        b = scene::position_at(shape, vertices[1], time);
        c = scene::position_at(shape, vertices[2], time);
    }
    return {transform_point(to_world, a), transform_point(to_world, b), transform_point(to_world, c)};
}

/// Where its triangles are asked for from a point of the world.
TALBOT_INLINE TreeQuery mesh_query(const MeshEmitter& mesh, const Affine& to_world, Vec3 p) {
    return {transform_point(mesh.moves ? inverse(to_world) : mesh.to_object, p), -1, mesh.space};
}

}  // namespace TALBOT_ISA
}  // namespace talbot::light
