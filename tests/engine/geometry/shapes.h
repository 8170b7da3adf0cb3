/// Small scenes for the geometry tests.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <memory>
#include <random>
#include <utility>
#include <vector>

#include "geometry/surface.h"
#include "scene/view.h"
#include "support/objects.h"

namespace talbot::geometry {

inline std::shared_ptr<scene::Mesh> make_mesh(std::vector<Vec3> positions, std::vector<uint32_t> triangles) {
    auto mesh = std::make_shared<scene::Mesh>();
    mesh->name = "Mesh";
    mesh->positions = std::move(positions);
    mesh->triangle_vertices = std::move(triangles);
    return mesh;
}

/// The box [-1, 1]^3 without the faces named in `open` (bit 2 axis + side), normals outwards.
inline std::shared_ptr<scene::Mesh> box(uint32_t open = 0) {
    std::vector<Vec3> p;
    for (int i = 0; i < 8; ++i) p.push_back({i & 1 ? 1.f : -1.f, i & 2 ? 1.f : -1.f, i & 4 ? 1.f : -1.f});
    const std::array<std::array<uint32_t, 4>, 6> faces{{{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}}};
    std::vector<uint32_t> t;
    for (uint32_t f = 0; f < 6; ++f) {
        if (open >> f & 1) continue;
        const auto& q = faces[f];
        t.insert(t.end(), {q[0], q[1], q[2], q[0], q[2], q[3]});
    }
    return make_mesh(std::move(p), std::move(t));
}

/// Unit sphere by subdividing an octahedron; vertex normals set.
inline std::shared_ptr<scene::Mesh> sphere(int levels) {
    std::vector<Vec3> p{{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}};
    std::vector<uint32_t> t{0, 2, 4, 2, 1, 4, 1, 3, 4, 3, 0, 4, 2, 0, 5, 1, 2, 5, 3, 1, 5, 0, 3, 5};
    for (int level = 0; level < levels; ++level) {
        std::map<std::pair<uint32_t, uint32_t>, uint32_t> middle;
        const auto mid = [&](uint32_t a, uint32_t b) {
            const auto key = std::minmax(a, b);
            const auto [at, fresh] = middle.try_emplace({key.first, key.second}, uint32_t(p.size()));
            if (fresh) p.push_back(normalize(p[a] + p[b]));
            return at->second;
        };
        std::vector<uint32_t> finer;
        for (size_t i = 0; i < t.size(); i += 3) {
            const uint32_t a = t[i], b = t[i + 1], c = t[i + 2], ab = mid(a, b), bc = mid(b, c), ca = mid(c, a);
            finer.insert(finer.end(), {a, ab, ca, ab, b, bc, ca, bc, c, ab, bc, ca});
        }
        t = std::move(finer);
    }
    auto mesh = make_mesh(p, std::move(t));
    mesh->vertex_normals = p;
    return mesh;
}

/// Rolling hills over [-1, 1]^2, 2 n^2 triangles.
inline std::shared_ptr<scene::Mesh> terrain(int n) {
    std::vector<Vec3> p;
    std::vector<uint32_t> t;
    for (int y = 0; y <= n; ++y) {
        for (int x = 0; x <= n; ++x) {
            const float u = 2.f * float(x) / float(n) - 1, v = 2.f * float(y) / float(n) - 1;
            float h = 0, a = 0.15f, f = 3;
            for (int octave = 0; octave < 7; ++octave, a *= 0.5f, f *= 2.03f)
                h += a * std::sin(f * u + 1.3f * float(octave)) * std::cos(f * v - 0.7f * float(octave));
            p.push_back({u, v, h});
        }
    }
    for (int y = 0; y < n; ++y) {
        for (int x = 0; x < n; ++x) {
            const uint32_t a = uint32_t(y * (n + 1) + x), b = a + 1, c = a + uint32_t(n) + 1, d = c + 1;
            t.insert(t.end(), {a, b, d, a, d, c});
        }
    }
    return make_mesh(std::move(p), std::move(t));
}

inline Affine translate_rotate_scale(Vec3 translation, Vec3 axis, float angle, Vec3 scale) {
    const Vec3 k = normalize(axis);
    const float c = std::cos(angle), s = std::sin(angle);
    const float r[3][3] = {{c + k.x * k.x * (1 - c), k.x * k.y * (1 - c) - k.z * s, k.x * k.z * (1 - c) + k.y * s},
                           {k.y * k.x * (1 - c) + k.z * s, c + k.y * k.y * (1 - c), k.y * k.z * (1 - c) - k.x * s},
                           {k.z * k.x * (1 - c) - k.y * s, k.z * k.y * (1 - c) + k.x * s, c + k.z * k.z * (1 - c)}};
    Affine a;
    for (int i = 0; i < 3; ++i) {
        a.m[i][0] = r[i][0] * scale.x;
        a.m[i][1] = r[i][1] * scale.y;
        a.m[i][2] = r[i][2] * scale.z;
    }
    a.m[0][3] = translation.x;
    a.m[1][3] = translation.y;
    a.m[2][3] = translation.z;
    return a;
}

/// A scene and its view, kept together.
struct World {
    scene::Scene scene;
    scene::SceneTables tables;

    int add(std::shared_ptr<const scene::Mesh> mesh, const Affine& to_world = {}, uint32_t visibility = scene::kVisibleAll) {
        scene::Handle handle = scene::kNone;
        for (size_t i = 0; i < scene.meshes.size(); ++i)
            if (scene.meshes[i] == mesh) handle = scene::Handle(i);
        if (handle == scene::kNone) {
            handle = scene::Handle(scene.meshes.size());
            scene.meshes.push_back(std::move(mesh));
        }
        scene::ObjectTraits traits;
        traits.mesh = handle;
        traits.visibility = visibility;
        return tests::place(scene, traits, to_world);
    }
    const scene::SceneTables& view() {
        scene::make_scene_view(scene, 0, tables);
        return tables;
    }
};

/// Rays with their hits, in columns.
struct Rays {
    std::vector<float> o[3], d[3], t_max, t, u, v;
    std::vector<int32_t> object, primitive, visibility;
    std::vector<uint8_t> occluded;

    int size() const { return int(t_max.size()); }
    void add(Vec3 origin, Vec3 direction, float far = 1e30f) {
        o[0].push_back(origin.x), o[1].push_back(origin.y), o[2].push_back(origin.z);
        d[0].push_back(direction.x), d[1].push_back(direction.y), d[2].push_back(direction.z);
        t_max.push_back(far);
        visibility.push_back(int32_t(scene::kVisibleAll));
    }
    RayColumns columns() { return {{o[0].data(), o[1].data(), o[2].data()}, {d[0].data(), d[1].data(), d[2].data()}, t_max.data()}; }
    HitColumns hits() { return {t.data(), u.data(), v.data(), object.data(), primitive.data()}; }
    void trace(const Accelerator& accelerator, TraceOptions options, const int32_t* index = nullptr, int n = -1) {
        const size_t all = t_max.size();
        t.assign(all, -1), u.assign(all, -1), v.assign(all, -1);
        object.assign(all, -2), primitive.assign(all, -2);
        intersect(accelerator, columns(), index, n < 0 ? int(all) : n, visibility.data(), hits(), options);
    }
    void trace_shadow(const Accelerator& accelerator, TraceOptions options) {
        occluded.assign(t_max.size(), 2);
        geometry::occluded(accelerator, columns(), nullptr, size(), visibility.data(), occluded.data(), options);
    }
};

/// A shading span with its columns.
struct Span {
    static constexpr int kColumns = 15;
    std::vector<float> floats;
    std::vector<int32_t> ints;
    std::vector<float> error;
    shader::ShadingSpan span;

    explicit Span(int n) : floats(size_t(n) * kColumns), ints(size_t(n) * 4), error(size_t(n)) {
        size_t next = 0;
        const auto take = [&] { return floats.data() + size_t(n) * next++; };
        for (Columns3* c : {&span.p, &span.n_s, &span.n_g, &span.wo}) *c = {take(), take(), take()};
        span.u = take();
        span.v = take();
        span.object = ints.data();
        span.primitive = span.object + n;
        span.backfacing = span.primitive + n;
        span.n = n;
    }
};

/// Shades all hits of the rays; `hit` receives their lanes.
inline Span shade(const World& world, Rays& rays, std::vector<int32_t>& hit) {
    hit.clear();
    for (int i = 0; i < rays.size(); ++i)
        if (rays.object[size_t(i)] >= 0) hit.push_back(i);
    Span s(int(hit.size()));
    for (int i = 0; i < s.span.n; ++i) {
        const size_t lane = size_t(hit[size_t(i)]);
        store(s.span.wo, i, -Vec3{rays.d[0][lane], rays.d[1][lane], rays.d[2][lane]});
    }
    shade_points(world.tables.view, rays.hits(), rays.columns().origin, hit.data(), s.span.n, s.span, s.error.data());
    return s;
}

inline Vec3 random_direction(std::mt19937& random) {
    std::uniform_real_distribution<float> uniform(0, 1);
    const float z = 2 * uniform(random) - 1, phi = 2 * kPi * uniform(random), r = std::sqrt(std::max(0.f, 1 - z * z));
    return normalize({r * std::cos(phi), r * std::sin(phi), z});
}

}  // namespace talbot::geometry
