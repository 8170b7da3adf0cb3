// Where shadow rays begin: on the curved surface that smooth normals mean, where the light grazes it.
#include <gtest/gtest.h>

#include <cmath>

#include "geometry/shapes.h"

namespace talbot::geometry {
namespace {

/// Of one lane: every lane of the span goes into `direction`.
Vec3 origin_of(const scene::SceneView& scene, const shader::ShadingSpan& span, int i, Vec3 direction, const float* error) {
    std::vector<float> d[3], o[3];
    for (int k = 0; k < 3; ++k) {
        d[k].assign(size_t(span.n), k == 0 ? direction.x : k == 1 ? direction.y : direction.z);
        o[k].resize(size_t(span.n));
    }
    const Columns3 origin{o[0].data(), o[1].data(), o[2].data()};
    shadow_origins(scene, span, span.n_s, Columns3{d[0].data(), d[1].data(), d[2].data()}, error, &i, 1, origin);
    return load(origin, i);
}

/// Hits of rays from all around on a coarse sphere of radius 2, and directions with these cosines to the smooth normals.
struct Ball {
    World world;
    Accelerator accelerator;
    std::unique_ptr<Span> span;
    std::vector<Vec3> direction;

    Ball(float offset, float least, float most, bool smooth = true) {
        auto mesh = sphere(2);
        mesh->triangle_smooth.assign(mesh->triangle_count(), smooth);
        world.add(mesh, translate_rotate_scale({1, -2, 3}, {1, 2, 3}, 0.8f, vec3(2)));
        world.scene.traits[0].shadow_terminator_geometry_offset = offset;
        accelerator.build(world.view(), {});
        std::mt19937 random(4);
        Rays rays;
        for (int i = 0; i < kSpan; ++i) {
            const Vec3 d = random_direction(random);
            rays.add(center() + d * 6.0f, -d);
        }
        rays.trace(accelerator, {8, false});
        std::vector<int32_t> all;
        for (int i = 0; i < rays.size(); ++i) all.push_back(i);
        span = std::make_unique<Span>(rays.size());
        for (int i = 0; i < rays.size(); ++i) store(span->span.wo, i, -Vec3{rays.d[0][size_t(i)], rays.d[1][size_t(i)], rays.d[2][size_t(i)]});
        shade_points(world.tables.view, rays.hits(), rays.columns().origin, all.data(), rays.size(), span->span, span->error.data());
        std::uniform_real_distribution<float> cosine(least, most);
        for (int i = 0; i < rays.size(); ++i) {
            const Vec3 n = load(span->span.n_s, i), any = random_direction(random);
            const Vec3 across = normalize(any - n * dot(any, n));
            const float c = cosine(random);
            direction.push_back(n * c + across * std::sqrt(1 - c * c));
        }
    }
    static Vec3 center() { return {1, -2, 3}; }
    int size() const { return int(direction.size()); }
    Vec3 origin(int i) const { return origin_of(world.tables.view, span->span, i, direction[size_t(i)], span->error.data()); }
    /// Share of the directions that the ball blocks.
    float shadowed() {
        Rays rays;
        for (int i = 0; i < size(); ++i) rays.add(origin(i), direction[size_t(i)]);
        rays.trace_shadow(accelerator, {8, false});
        int blocked = 0;
        for (uint8_t b : rays.occluded) blocked += b;
        return float(blocked) / float(size());
    }
};

TEST(ShadowOrigin, GrazingLightReachesWhereSmoothNormalsSeeIt) {
    const float before = Ball(0, 0.01f, 0.05f).shadowed(), after = Ball(0.1f, 0.01f, 0.05f).shadowed();
    EXPECT_GT(before, 0.2f);
    EXPECT_LT(after, 0.1f * before);
    EXPECT_EQ(Ball(0.1f, -0.9f, -0.3f).shadowed(), 1);  // the far side stays dark
}

TEST(ShadowOrigin, BeginsBetweenTheTriangleAndALittleOverTheSphere) {
    Ball ball(0.1f, 0.01f, 0.05f);
    int moved = 0;
    for (int i = 0; i < ball.size(); ++i) {
        const float p = length(load(ball.span->span.p, i) - Ball::center()), o = length(ball.origin(i) - Ball::center());
        EXPECT_GE(o, p - 1e-5f);
        EXPECT_LE(o, 2.0f * 1.05f);
        moved += o > p + 1e-3f;
    }
    EXPECT_GT(moved, ball.size() / 2);
}

TEST(ShadowOrigin, SteepLightFlatFacesAndAnOffsetOfZeroStayOnTheTriangle) {
    for (const auto& [offset, least, most, smooth] :
         {std::tuple(0.1f, 0.45f, 1.0f, true), std::tuple(0.1f, 0.01f, 0.05f, false), std::tuple(0.0f, 0.01f, 0.05f, true)}) {
        Ball ball(offset, least, most, smooth);
        const int n = ball.size();
        std::vector<float> d[3], o[3];
        for (int k = 0; k < 3; ++k) {
            d[k].resize(size_t(n));
            o[k].resize(size_t(n));
        }
        const Columns3 direction{d[0].data(), d[1].data(), d[2].data()}, origin{o[0].data(), o[1].data(), o[2].data()};
        for (int i = 0; i < n; ++i) store(direction, i, ball.direction[size_t(i)]);
        offset_origin(ball.span->span.p, ball.span->span.n_g, direction, ball.span->error.data(), n, origin);
        for (int i = 0; i < n; ++i) EXPECT_LT(length(ball.origin(i) - load(origin, i)), 1e-6f) << offset << smooth;
    }
}

TEST(ShadowOrigin, BrokenNormalsMoveNothing) {
    auto mesh = make_mesh({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {0, 1, 2});
    mesh->vertex_normals = {{0, 0, 0}, {NAN, 0, 1}, {0, 0, INFINITY}};
    World world;
    world.add(mesh);
    world.view();
    Span s(1);
    store(s.span.p, 0, {0.3f, 0.3f, 0});
    store(s.span.n_g, 0, {0, 0, 1});
    store(s.span.n_s, 0, {0, 0, 1});
    s.span.u[0] = s.span.v[0] = 0.3f;
    s.span.object[0] = s.span.primitive[0] = 0;
    const float error = 1e-4f;
    const Vec3 origin = origin_of(world.tables.view, s.span, 0, normalize({1, 0, 0.01f}), &error);
    EXPECT_LT(length(origin - Vec3{0.3f, 0.3f, 1e-4f}), 1e-6f);
}

}  // namespace
}  // namespace talbot::geometry
