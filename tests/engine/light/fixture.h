/// Scenes of lamps and emissive triangles without shaders, and the estimators that the tests share.
#pragma once

#include <cmath>
#include <functional>
#include <random>
#include <string>
#include <vector>

#include "base/sobol.h"
#include "light/emitter_table.h"
#include "support/objects.h"

namespace talbot::light::test {

struct Fixture {
    scene::Scene scene;
    scene::SceneTables tables;
    shader::Programs programs;
    shader::ShaderContext context;
    Report report;
    WorkerPool pool{1};
    EmitterTablePtr table;
    std::vector<float> registers, columns;
    LightScratch scratch;

    explicit Fixture(int version = 502) {
        scene.settings.version = version;
        programs.shaders.emplace_back();  // the default grey
    }
    /// Shader handle of a constant emission.
    int emission(Rgb radiance) {
        shader::CompiledShader shader;
        shader.emission_is_constant = true;
        shader.constant_emission = radiance;
        programs.shaders.insert(programs.shaders.end() - 1, shader);
        programs.default_shader = int(programs.shaders.size()) - 1;
        scene.shaders.emplace_back();
        return programs.default_shader - 1;
    }
    void add_mesh(const std::vector<Vec3>& positions, const std::vector<uint32_t>& triangles, int shader, const Affine& to_world = {}) {
        auto mesh = std::make_shared<scene::Mesh>();
        mesh->positions = positions;
        mesh->triangle_vertices = triangles;
        scene.meshes.push_back(mesh);
        add_instance(int(scene.meshes.size()) - 1, shader, to_world);
    }
    void add_instance(int mesh, int shader, const Affine& to_world) {
        scene.material_sets.push_back({shader});
        scene::ObjectTraits traits;
        traits.mesh = mesh;
        traits.material_set = int(scene.material_sets.size()) - 1;
        tests::place(scene, traits, to_world);
    }
    scene::Light& add_light(scene::LightType type, float power, Vec3 at) {
        scene::Light light;
        light.type = type;
        light.power = power;
        light.visibility = scene::kVisibleAll;
        light.to_world.m[0][3] = at.x;
        light.to_world.m[1][3] = at.y;
        light.to_world.m[2][3] = at.z;
        scene.lights.push_back(light);
        return scene.lights.back();
    }
    void build() {
        scene::make_scene_view(scene, programs.default_shader, tables);
        context.scene = &tables.view;
        table = build_emitters(scene, tables, programs, context, pool, report, nullptr);
        registers.assign(size_t(kSpan) * size_t(std::max(programs.max_registers, 3)), 0.0f);
        columns.assign(size_t(kSpan) * kLightScratchColumns, 0.0f);
        scratch.registers = registers.data();
        scratch.columns = columns.data();
    }
};

/// Turns local -Z towards `target` from `at` (the lamps' axis), rolled by nothing in particular.
inline Affine look_at(Vec3 at, Vec3 target) {
    const Vec3 z = normalize(at - target);
    Vec3 x, y;
    make_basis(z, x, y);
    Affine m;
    const Vec3 c[4] = {x, y, z, at};
    for (int k = 0; k < 4; ++k) {
        m.m[0][k] = c[k].x;
        m.m[1][k] = c[k].y;
        m.m[2][k] = c[k].z;
    }
    return m;
}

/// One span of samples at a point.
struct Samples {
    float wx[kSpan], wy[kSpan], wz[kSpan], distance[kSpan], r[kSpan], g[kSpan], b[kSpan], pdf[kSpan];
    uint8_t is_delta[kSpan];
    int32_t blockers[kSpan], visibility[kSpan];
    LightSamples out() { return {{wx, wy, wz}, distance, {r, g, b}, pdf, is_delta, blockers, visibility}; }
    Vec3 wi(int i) const { return {wx[i], wy[i], wz[i]}; }
    Rgb radiance(int i) const { return {r[i], g[i], b[i]}; }
};

/// Calls use(samples, n) for `count` samples at p; stratified pairs, or independent ones (`random`) for statistics.
inline void sample_many(Fixture& f, Stratum stratum, Vec3 p, int count, const std::function<void(const Samples&, int)>& use, uint32_t seed = 1,
                        bool random = false, int bounce = 0, int receiver = -1, float moment = 0) {
    std::mt19937 engine(seed);
    for (int begin = 0; begin < count; begin += kSpan) {
        const int n = std::min(kSpan, count - begin);
        float x[kSpan], y[kSpan], z[kSpan], a[kSpan], b[kSpan], u[kSpan], v[kSpan], time[kSpan];
        int32_t bounces[kSpan], receivers[kSpan];
        for (int i = 0; i < n; ++i) {
            x[i] = p.x;
            y[i] = p.y;
            z[i] = p.z;
            const Vec2 pick = sample_pair(pixel_key(seed, 0), uint32_t(begin + i), 2), place = sample_pair(pixel_key(seed, 0), uint32_t(begin + i), 3);
            a[i] = random ? unit_float(engine()) : pick.x;
            b[i] = random ? unit_float(engine()) : pick.y;
            u[i] = random ? unit_float(engine()) : place.x;
            v[i] = random ? unit_float(engine()) : place.y;
            bounces[i] = bounce;
            receivers[i] = receiver;
            time[i] = moment;
        }
        LightQuery query;
        query.p = {x, y, z};
        query.n_s = {x, y, z};
        query.pick_u = a;
        query.pick_v = b;
        query.u = u;
        query.v = v;
        query.depths.bounces = bounces;
        if (receiver >= 0) query.receiver = receivers;
        query.time = time;
        query.n = n;
        static thread_local Samples samples;
        sample_emitters(*f.table, stratum, query, f.programs, f.context, f.scratch, samples.out());
        use(samples, n);
    }
}

/// Irradiance at p on a surface with normal n, by light samples. Red channel.
inline double irradiance(Fixture& f, Stratum stratum, Vec3 p, Vec3 n, int count = 1 << 15, uint32_t seed = 1, int receiver = -1) {
    double sum = 0;
    sample_many(
        f, stratum, p, count,
        [&](const Samples& s, int m) {
            for (int i = 0; i < m; ++i) {
                if (s.pdf[i] > 0) sum += double(s.r[i]) * double(std::max(dot(s.wi(i), n), 0.0f)) / double(s.pdf[i]);
            }
        },
        seed, false, 0, receiver);
    return sum / count;
}

/// What a ray from p in direction d meets first: radiance (red) and density, lamps and emissive triangles by brute force.
struct Met {
    double radiance = 0, pdf = 0, distance = 0;
};
inline Met meet(Fixture& f, Vec3 p, Vec3 d) {
    Met met;
    const int32_t visible = scene::kVisibleDiffuse;
    const float far = 1e30f;
    int32_t lamp = -1;
    float t = far;
    float o[3] = {p.x, p.y, p.z}, w[3] = {d.x, d.y, d.z};
    const ConstColumns3 origin(o, o + 1, o + 2), direction(w, w + 1, w + 2);
    intersect_lamps(*f.table, origin, direction, &far, &visible, 1, &lamp, &t);
    float best = t;
    int32_t object = -1, primitive = -1;
    for (size_t k = 0; k < f.scene.objects.size(); ++k) {
        const scene::Mesh& mesh = *f.scene.meshes[size_t(f.scene.traits[k].mesh)];
        for (size_t q = 0; q < mesh.triangle_count(); ++q) {
            Vec3 v[3];
            for (size_t c = 0; c < 3; ++c) v[c] = transform_point(f.scene.objects[k].to_world, mesh.positions[mesh.triangle_vertices[3 * q + c]]);
            const Vec3 e1 = v[1] - v[0], e2 = v[2] - v[0], n = cross(e1, e2);
            const double below = double(dot(d, n));
            if (below == 0) continue;
            const double s = double(dot(v[0] - p, n)) / below;
            const Vec3 r = p + d * float(s) - v[0];
            const double n2 = double(dot(n, n)), b1 = double(dot(cross(r, e2), n)) / n2, b2 = double(dot(cross(e1, r), n)) / n2;
            if (s <= 0 || s >= double(best) || b1 < 0 || b2 < 0 || b1 + b2 > 1) continue;
            best = float(s);
            object = int32_t(k);
            primitive = int32_t(q);
        }
    }
    if (object >= 0) {
        const int32_t shader = f.scene.material_sets[size_t(f.scene.traits[size_t(object)].material_set)][0];
        met.radiance = double(f.programs.shaders[size_t(shader)].constant_emission.x);
        float pdf = 0;
        pdf_triangles(*f.table, f.tables.view, origin, &best, &object, &primitive, nullptr, nullptr, 1, &pdf);
        met.pdf = double(pdf);
        met.distance = double(best);
    } else if (lamp >= 0) {
        float rgb[3], pdf = 0;
        shade_lamps(*f.table, origin, direction, &lamp, &t, 1, f.programs, f.context, f.scratch, {rgb, rgb + 1, rgb + 2}, &pdf);
        met.radiance = double(rgb[0]);
        met.pdf = double(pdf);
        met.distance = double(t);
    }
    return met;
}

}  // namespace talbot::light::test
