/// A scene with one known answer, looked at through a few pixels, and the statistics of that answer. Each case is rendered in sixteen independently
/// scrambled batches and passes when two one-sided t-tests bound its error by the tolerance (equivalence, so that too few samples fail) and a two-sided
/// test does not find a bias.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "session/session.h"
#include "support/graph_builder.h"
#include "support/objects.h"

namespace talbot::test {

using scene::AreaShape;
using scene::Light;
using scene::LightType;

inline constexpr int kBatches = 16;
inline constexpr double kEquivalence = 3.733;  ///< one-sided 0.1 % point of Student's t with 15 degrees of freedom
inline constexpr double kBias = 6.2;           ///< two-sided point of a family of 50 tests at 0.1 % together
inline constexpr double kRounding = 2e-4;      ///< single precision, and facets of what should be round
inline constexpr float kDegree = kPi / 180;

/// A scene that is looked at through a few pixels.
struct Stage {
    scene::Scene scene;

    explicit Stage(int samples = 256, int version = 502) {
        scene::Settings& s = scene.settings;
        s.version = version;
        s.width = s.height = 4;
        s.samples = samples;
        s.filter = scene::PixelFilter::Box;
        s.clamp_direct = s.clamp_indirect = s.light_threshold = s.filter_glossy = 0;
        s.max_bounces = s.diffuse_bounces = s.glossy_bounces = s.transmission_bounces = 0;
        s.threads = 2;
    }
    int shader(GraphBuilder&& graph) {
        scene.shaders.push_back(graph.shader);
        return int(scene.shaders.size()) - 1;
    }
    int diffuse(float albedo) {
        GraphBuilder g;
        g.surface(g.diffuse({albedo, albedo, albedo}));
        return shader(std::move(g));
    }
    int emitter(float radiance) {
        GraphBuilder g;
        g.surface(g.emission({1, 1, 1}, radiance));
        return shader(std::move(g));
    }
    int glowing(float albedo, float radiance) {
        GraphBuilder g;
        g.surface(g.add(g.diffuse({albedo, albedo, albedo}), g.emission({1, 1, 1}, radiance)));
        return shader(std::move(g));
    }
    void world(float radiance) {
        GraphBuilder g;
        g.surface(g.out(g.node("ShaderNodeBackground").color("Color", {1, 1, 1}).set("Strength", radiance).id(), "Background", scene::SocketKind::Shader));
        scene.world.shader = shader(std::move(g));
    }
    void mesh(const std::vector<Vec3>& positions, const std::vector<uint32_t>& triangles, int material, Vec3 at = {}, float scale = 1) {
        auto mesh = std::make_shared<scene::Mesh>();
        mesh->positions = positions;
        mesh->triangle_vertices = triangles;
        mesh->triangle_smooth.assign(triangles.size() / 3, 0);
        scene.meshes.push_back(mesh);
        scene.material_sets.push_back({material});
        scene::ObjectTraits traits;
        traits.mesh = int(scene.meshes.size()) - 1;
        traits.material_set = int(scene.material_sets.size()) - 1;
        Affine to_world;
        const float t[3] = {at.x, at.y, at.z};
        for (int r = 0; r < 3; ++r) {
            to_world.m[r][r] = scale;
            to_world.m[r][3] = t[r];
        }
        tests::place(scene, traits, to_world);
    }
    void quad(Vec3 center, Vec3 x, Vec3 y, int material) {
        mesh({center - x - y, center + x - y, center + x + y, center - x + y}, {0, 1, 2, 0, 2, 3}, material);
    }
    void floor(float albedo = 1) { quad({}, {50, 0, 0}, {0, 50, 0}, diffuse(albedo)); }
    Light& light(LightType type, float power, Vec3 at) {
        Light l;
        l.type = type;
        l.power = power;
        l.to_world.m[0][3] = at.x;
        l.to_world.m[1][3] = at.y;
        l.to_world.m[2][3] = at.z;
        scene.lights.push_back(l);
        return scene.lights.back();
    }
    /// Parallel rays along `direction` that meet `target` after `distance`, in a square of `size`.
    void look(Vec3 target, Vec3 direction, float distance = 0.01f, float size = 1e-3f) {
        const Vec3 z = -normalize(direction);
        Vec3 x, y;
        make_basis(z, x, y);
        const Vec3 c[4] = {x, y, z, target + z * distance};
        scene::Camera& camera = scene.camera;
        camera.type = scene::CameraType::Orthographic;
        camera.clip_start = 1e-4f;
        for (int k = 0; k < 4; ++k) {
            camera.to_world.m[0][k] = c[k].x;
            camera.to_world.m[1][k] = c[k].y;
            camera.to_world.m[2][k] = c[k].z;
        }
        camera.view[0] = camera.view[2] = -size / 2;
        camera.view[1] = camera.view[3] = size / 2;
    }
    void bounces(int n) {
        scene::Settings& s = scene.settings;
        s.max_bounces = s.diffuse_bounces = s.glossy_bounces = s.transmission_bounces = n;
    }
};

/// Mean and standard error over the batches, of one channel.
struct Estimate {
    double mean = 0, error = 0;
};
inline Estimate render(const Stage& stage, int channel = 0) {
    Session session;
    session.edit() = stage.scene;
    double sum = 0, squares = 0;
    for (int b = 0; b < kBatches; ++b) {
        session.edit().settings.seed = uint32_t(1000 + b);
        session.edit().dirty |= scene::kDirtySettings;
        session.start();
        while (!session.wait(1000)) {
        }
        EXPECT_EQ(session.progress().state, SessionState::Done) << session.error();
        std::vector<float> pixels;
        EXPECT_TRUE(session.read_pass(scene::PassKind::Combined, pixels));
        double mean = 0;
        for (size_t i = size_t(channel); i < pixels.size(); i += 4) {
            EXPECT_TRUE(std::isfinite(pixels[i]));
            mean += double(pixels[i]);
        }
        mean /= double(pixels.size()) / 4;
        sum += mean;
        squares += mean * mean;
    }
    const double m = sum / kBatches;
    return {m, std::sqrt(std::max(squares / kBatches - m * m, 0.0) / (kBatches - 1))};
}

/// `tolerance` relative to `expected`.
inline void expect_render(const Stage& stage, double expected, const std::string& name, double tolerance = 0.005, int channel = 0) {
    const Estimate e = render(stage, channel);
    const double off = std::abs(e.mean - expected);
    EXPECT_LT(off + kEquivalence * e.error, tolerance * std::abs(expected)) << name << ": " << e.mean << " +- " << e.error << ", not " << expected;
    EXPECT_LT(off, kBias * e.error + kRounding * std::abs(expected)) << name << ": biased, " << e.mean << " +- " << e.error << ", not " << expected;
}

inline std::vector<Vec3> cube_corners() {
    std::vector<Vec3> p;
    for (int k = 0; k < 8; ++k) p.push_back({k & 1 ? 1.0f : -1.0f, k & 2 ? 1.0f : -1.0f, k & 4 ? 1.0f : -1.0f});
    return p;
}
inline const std::vector<uint32_t> kCube{0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4, 2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5};

/// Octahedron, each face split `levels` times, on the unit sphere.
inline void make_sphere(int levels, std::vector<Vec3>& positions, std::vector<uint32_t>& triangles) {
    positions = {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}};
    triangles = {0, 2, 4, 2, 1, 4, 1, 3, 4, 3, 0, 4, 2, 0, 5, 1, 2, 5, 3, 1, 5, 0, 3, 5};
    for (int level = 0; level < levels; ++level) {
        std::map<std::pair<uint32_t, uint32_t>, uint32_t> middles;
        const auto middle = [&](uint32_t a, uint32_t b) {
            const auto [entry, is_new] = middles.try_emplace({std::min(a, b), std::max(a, b)}, uint32_t(positions.size()));
            if (is_new) positions.push_back(normalize(positions[a] + positions[b]));
            return entry->second;
        };
        std::vector<uint32_t> finer;
        for (size_t k = 0; k < triangles.size(); k += 3) {
            const uint32_t a = triangles[k], b = triangles[k + 1], c = triangles[k + 2], ab = middle(a, b), bc = middle(b, c), ca = middle(c, a);
            for (uint32_t v : {a, ab, ca, ab, b, bc, ca, bc, c, ab, bc, ca}) finer.push_back(v);
        }
        triangles = finer;
    }
}

}  // namespace talbot::test
