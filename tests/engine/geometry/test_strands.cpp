// Curves and points: where they are hit, their normals, and that rays leave them.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "geometry/shapes.h"
#include "scene/curve.h"
#include "scene/strand_build.h"

namespace talbot::geometry {
namespace {

struct Strands {
    std::vector<float> positions, radii;
    std::vector<uint32_t> starts{0};

    void add(const std::vector<Vec3>& keys, float radius) {
        for (Vec3 p : keys) {
            positions.insert(positions.end(), {p.x, p.y, p.z});
            radii.push_back(radius);
        }
        starts.push_back(uint32_t(radii.size()));
    }
    scene::StrandInput input(scene::CurveShape shape) const {
        scene::StrandInput in;
        in.name = "Strands";
        in.positions = positions;
        in.radii = radii;
        in.curve_starts = starts;
        in.shape = shape;
        return in;
    }
    std::shared_ptr<const scene::Mesh> curves(scene::CurveShape shape) const {
        Report report;
        return std::make_shared<const scene::Mesh>(scene::build_strands(input(shape), report));
    }
    std::shared_ptr<const scene::Mesh> points() const {
        Report report;
        scene::StrandInput in = input(scene::CurveShape::Ribbon);
        in.curve_starts = {};
        return std::make_shared<const scene::Mesh>(scene::build_strands(in, report));
    }
};

constexpr scene::CurveShape kShapes[] = {scene::CurveShape::Ribbon, scene::CurveShape::Thick, scene::CurveShape::ThickLinear};

/// A bundle of curls whose segments bend by half a radian.
Strands curls() {
    Strands s;
    for (int k = 0; k < 40; ++k) {
        std::vector<Vec3> keys;
        const float x = 0.05f * float(k % 8), y = 0.05f * float(k / 8);
        for (int i = 0; i < 24; ++i) {
            const float a = 0.5f * float(i) + float(k);
            keys.push_back({x + 0.03f * std::cos(a), y + 0.03f * std::sin(a), 0.02f * float(i)});
        }
        s.add(keys, 0.0015f);
    }
    return s;
}

Rays rays_through_curls(int count, std::mt19937& random) {
    std::uniform_real_distribution<float> uniform(0, 1);
    Rays rays;
    for (int i = 0; i < count; ++i) {
        const Vec3 d = random_direction(random), at{0.4f * uniform(random), 0.25f * uniform(random), 0.45f * uniform(random)};
        rays.add(at - d * 2, d);
    }
    return rays;
}

TEST(Strands, StraightFibreIsRound) {
    Strands s;
    s.add({{0, 0, 0}, {0, 0, 1}, {0, 0, 2}}, 0.1f);
    for (const auto shape : kShapes) {
        World world;
        world.add(s.curves(shape), translate_rotate_scale({5, 0, 0}, {0, 0, 1}, 0, vec3(2)));
        Accelerator accelerator;
        accelerator.build(world.view(), {});
        Rays rays;
        for (float x : {-0.15f, -0.05f, 0.f, 0.1f, 0.19f, 0.21f}) rays.add({5 + x, 10, 1}, {0, -1, 0});
        rays.trace(accelerator, {8, false});
        std::vector<int32_t> hit;
        const Span out = shade(world, rays, hit);
        ASSERT_EQ(hit.size(), 5u) << int(shape);
        for (int i = 0; i < 5; ++i) {
            const float sine = (rays.o[0][size_t(i)] - 5) / 0.2f, cosine = std::sqrt(1 - sine * sine);
            const Vec3 n = load(out.span.n_s, i), p = load(out.span.p, i);
            EXPECT_NEAR(n.x, sine, 2e-3f) << int(shape) << " " << i;
            EXPECT_NEAR(n.y, cosine, 2e-3f);
            EXPECT_NEAR(n.z, 0, 1e-4f);
            EXPECT_NEAR(p.x, 5 + 0.2f * sine, 1e-3f);
            EXPECT_NEAR(p.y, 0.2f * cosine, 1e-3f);
            EXPECT_NEAR(p.z, 1, 1e-3f);
            EXPECT_NEAR(std::abs(out.span.v[i]), shape == scene::CurveShape::Ribbon ? std::abs(sine) : 0, 2e-3f);
            EXPECT_EQ(out.span.primitive[i], 0);
            EXPECT_NEAR(out.span.u[i], 0.5f, 0.08f);
        }
    }
}

TEST(Strands, RaysLeaveTheirFibre) {
    const Strands s = curls();
    for (const auto shape : kShapes) {
        World world;
        world.add(s.curves(shape));
        Accelerator accelerator;
        accelerator.build(world.view(), {});
        std::mt19937 random(3);
        Rays rays = rays_through_curls(4000, random);
        rays.trace(accelerator, {8, false});
        std::vector<int32_t> hit;
        Span out = shade(world, rays, hit);
        ASSERT_GT(hit.size(), 400u);
        // On, in any direction; the next hit is not the fibre just left.
        std::vector<float> columns[3], origin[3];
        for (int k = 0; k < 3; ++k) columns[k].resize(hit.size()), origin[k].resize(hit.size());
        const Columns3 direction{columns[0].data(), columns[1].data(), columns[2].data()}, from{origin[0].data(), origin[1].data(), origin[2].data()};
        for (int i = 0; i < out.span.n; ++i) store(direction, i, random_direction(random));
        offset_origin(out.span.p, out.span.n_g, direction, out.error.data(), out.span.n, from);
        Rays next;
        for (int i = 0; i < out.span.n; ++i) next.add(load(from, i), load(direction, i), 0.004f);
        next.trace(accelerator, {8, false});
        int again = 0;
        for (int i = 0; i < out.span.n; ++i) again += next.object[size_t(i)] >= 0 && std::abs(next.primitive[size_t(i)] - out.span.primitive[i]) < 2;
        EXPECT_LT(double(again) / double(hit.size()), 0.004) << int(shape);
    }
}

TEST(Strands, EveryWidthHitsTheSame) {
    const Strands s = curls();
    for (const auto shape : kShapes) {
        World world;
        world.add(s.curves(shape));
        Accelerator accelerator;
        accelerator.build(world.view(), {});
        std::mt19937 random(5);
        Rays rays = rays_through_curls(1000, random);
        rays.trace(accelerator, {8, false});
        const std::vector<int32_t> primitive = rays.primitive;
        rays.trace(accelerator, {8, false});
        EXPECT_EQ(rays.primitive, primitive);
        for (int width : {1, 16}) {
            rays.trace(accelerator, {width, false});
            int differ = 0;
            for (size_t i = 0; i < primitive.size(); ++i) differ += primitive[i] != rays.primitive[i];
            EXPECT_LE(differ, 3) << int(shape) << " " << width;  // a fibre's very edge
        }
    }
}

TEST(Strands, PointsAreSpheres) {
    Strands s;
    s.add({{0, 0, 0}, {3, 0, 0}}, 0.5f);
    World world;
    world.add(s.points(), translate_rotate_scale({0, 0, 7}, {0, 0, 1}, 0, vec3(2)));
    Accelerator accelerator;
    accelerator.build(world.view(), {});
    std::mt19937 random(1);
    Rays rays;
    for (int i = 0; i < 500; ++i) {
        const Vec3 d = random_direction(random), side = random_direction(random);
        rays.add(Vec3{6, 0, 7} - d * 20 + (side - d * dot(side, d)) * 0.9f, d);
    }
    rays.trace(accelerator, {8, false});
    std::vector<int32_t> hit;
    Span out = shade(world, rays, hit);
    ASSERT_GT(hit.size(), 490u);
    Rays next;
    for (int i = 0; i < out.span.n; ++i) {
        const Vec3 n = load(out.span.n_g, i), p = load(out.span.p, i), radial = p - Vec3{6, 0, 7};
        if (out.span.primitive[i] != 1) continue;
        EXPECT_NEAR(length(radial), 1, 1e-5f);
        EXPECT_NEAR(dot(n, radial), 1, 1e-5f);
        EXPECT_GE(dot(n, load(out.span.wo, i)), 0);
        EXPECT_EQ(out.span.backfacing[i], 0);
        Vec3 d = random_direction(random);
        if (dot(d, n) < 0) d = -d;
        next.add(p + n * out.error[size_t(i)], d, 1.0f);
    }
    next.trace(accelerator, {8, false});
    for (int i = 0; i < next.size(); ++i) EXPECT_LT(next.object[size_t(i)], 0);
}

TEST(Strands, BadInput) {
    Report report;
    const float nan = std::numeric_limits<float>::quiet_NaN();
    Strands s;
    s.add({{0, 0, 0}}, 0.1f);                                    // one key
    s.add({{1, 0, 0}, {1, 0, 0}, {1, 0, 0}}, 0.1f);              // no length
    s.add({{2, 0, 0}, {nan, 0, 1}, {2, 0, 2}}, 0.1f);            // broken
    s.add({{3, 0, 0}, {3, 0, 1}, {3, 0, 1}, {3, 0, 2}}, -0.1f);  // stands still in the middle, no thickness
    s.add({{4, 0, 0}, {4, 0, 1}}, 0.1f);
    for (const auto shape : kShapes) {
        const auto mesh = s.curves(shape);
        EXPECT_EQ(mesh->segment_keys.size(), 4u);
        World world;
        world.add(mesh);
        Accelerator accelerator;
        accelerator.build(world.view(), {});
        Rays rays;
        for (float x = 0; x < 5; x += 0.01f) rays.add({x, 5, 0.5f}, {0, -1, 0});
        for (float x = 0; x < 5; x += 0.01f) rays.add({x, 0, 5}, {0, 0, -1});  // along them
        rays.trace(accelerator, {8, false});
        std::vector<int32_t> hit;
        const Span out = shade(world, rays, hit);
        EXPECT_GT(hit.size(), 10u);
        for (int i = 0; i < out.span.n; ++i) {
            const Vec3 n = load(out.span.n_s, i), p = load(out.span.p, i);
            EXPECT_NEAR(dot(n, n), 1, 1e-4f);
            EXPECT_TRUE(std::isfinite(p.x + p.y + p.z));
        }
    }
    scene::StrandInput wrong = s.input(scene::CurveShape::Ribbon);
    wrong.radii = wrong.radii.first(3);
    EXPECT_THROW(scene::build_strands(wrong, report), Error);
    wrong = s.input(scene::CurveShape::Ribbon);
    const std::vector<uint32_t> beyond{0, 400};
    wrong.curve_starts = beyond;
    EXPECT_THROW(scene::build_strands(wrong, report), Error);
    wrong = s.input(scene::CurveShape::Ribbon);
    const std::vector<float> values(3);
    wrong.attributes.push_back({"short", scene::Domain::Vertex, 1, false, values, {}});
    EXPECT_THROW(scene::build_strands(wrong, report), Error);
    const auto points = s.points();
    EXPECT_EQ(points->positions.size(), points->radii.size());
    EXPECT_EQ(points->positions.size(), 12u);
}

}  // namespace
}  // namespace talbot::geometry
