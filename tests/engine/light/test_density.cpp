/// Samplers against their densities: chi-squared on the sphere, and sample against what a ray in that direction meets.
#include <gtest/gtest.h>

#include <algorithm>

#include "fixture.h"
#include "light/kernels/world_map.h"

namespace talbot::light::test {
namespace {

using scene::AreaShape;
using scene::LightType;

/// Upper tail of the chi-squared distribution [Wilson & Hilferty 1931].
double chi2_tail(double chi2, int dof) {
    const double k = dof, z = (std::cbrt(chi2 / k) - (1 - 2 / (9 * k))) / std::sqrt(2 / (9 * k));
    return 0.5 * std::erfc(z / std::sqrt(2.0));
}

/// Directions about `axis` up to `cos_edge`, `rings` x `sectors` cells of equal solid angle.
struct Cells {
    Vec3 axis, x, y;
    double cos_edge;
    int rings = 12, sectors = 16;
    Cells(Vec3 a, double edge) : axis(normalize(a)), cos_edge(edge) { make_basis(axis, x, y); }
    int find(Vec3 d) const {
        const double c = std::min(double(dot(d, axis)), 1.0);
        const double ring = (1 - c) / (1 - cos_edge) * rings, sector = (std::atan2(double(dot(d, y)), double(dot(d, x))) / (2 * M_PI) + 0.5) * sectors;
        if (ring < 0 || ring >= rings) return -1;
        return int(ring) * sectors + std::min(int(sector), sectors - 1);
    }
    Vec3 direction(double ring, double sector) const {
        const double c = 1 - ring / rings * (1 - cos_edge), s = std::sqrt(std::max(1 - c * c, 0.0)), phi = (sector / sectors - 0.5) * 2 * M_PI;
        return axis * float(c) + x * float(s * std::cos(phi)) + y * float(s * std::sin(phi));
    }
};

/// The samples at p against the density that rays find there. Samples without radiance are not returned: the density is of those that shine.
void expect_density(Fixture& f, Vec3 p, Vec3 towards, double cos_edge, const std::string& name, int count = 200000) {
    const Cells cells(towards - p, cos_edge);
    const int cell_count = cells.rings * cells.sectors;
    std::vector<double> observed(size_t(cell_count), 0), expected(size_t(cell_count), 0);
    int outside = 0, shining = 0;
    sample_many(
        f, Stratum::Local, p, count,
        [&](const Samples& s, int n) {
            for (int i = 0; i < n; ++i) {
                if (s.pdf[i] <= 0) continue;
                ++shining;
                const int cell = cells.find(s.wi(i));
                if (cell < 0)
                    ++outside;
                else
                    observed[size_t(cell)] += 1;
            }
        },
        7, true);
    EXPECT_EQ(outside, 0) << name;
    EXPECT_GT(shining, 0) << name;

    constexpr int fine = 40;
    const double cell_angle = 2 * M_PI * (1 - cos_edge) / cell_count;
    double total = 0;
    for (int r = 0; r < cells.rings; ++r) {
        for (int s = 0; s < cells.sectors; ++s) {
            double sum = 0;
            for (int k = 0; k < fine * fine; ++k) {
                const Met met = meet(f, p, cells.direction(r + (k / fine + 0.5) / fine, s + (k % fine + 0.5) / fine));
                if (met.radiance > 0) sum += met.pdf;
            }
            expected[size_t(r * cells.sectors + s)] = sum / (fine * fine) * cell_angle * count;
            total += sum / (fine * fine) * cell_angle;
        }
    }
    EXPECT_NEAR(total, double(shining) / count, 0.01) << name << ": the density's integral";

    // Cells cut by the shape's edge carry the error of the quadrature: 1 % of a full cell.
    double chi2 = 0, pooled_observed = 0, pooled_expected = 0;
    int dof = -1;
    double largest = 0;
    for (double e : expected) largest = std::max(largest, e);
    for (int k = 0; k < cell_count; ++k) {
        const double o = observed[size_t(k)], e = expected[size_t(k)];
        if (e < 10) {
            pooled_observed += o;
            pooled_expected += e;
            continue;
        }
        const double edge = 0.01 * largest;
        chi2 += (o - e) * (o - e) / (e + edge * edge);
        ++dof;
    }
    if (pooled_expected > 10) {
        chi2 += (pooled_observed - pooled_expected) * (pooled_observed - pooled_expected) / (pooled_expected + square(float(0.01 * largest)));
        ++dof;
    }
    ASSERT_GT(dof, 3) << name;
    EXPECT_GT(chi2_tail(chi2, dof), 1e-4) << name << " chi2 " << chi2 << " of " << dof;
}

scene::Light& aimed(Fixture& f, LightType type, Vec3 at, Vec3 target) {
    scene::Light& l = f.add_light(type, 100, at);
    l.to_world = look_at(at, target);
    return l;
}

TEST(Density, AreaLamps) {
    struct Case {
        AreaShape shape;
        Vec3 at, target;
        float x, y, spread;
        double edge;
    };
    const Case cases[] = {
        {AreaShape::Rectangle, {0.3f, -0.2f, 1}, {0, 0, 0}, 2, 1, kPi, 0.0},        // by solid angle
        {AreaShape::Rectangle, {0.1f, 0, 0.05f}, {0.1f, 0, -1}, 1, 1, kPi, -1},     // nearly fills the hemisphere
        {AreaShape::Rectangle, {3, 4, 20}, {0, 0, 0}, 1, 2, kPi, 0.99},             // by area
        {AreaShape::Rectangle, {0.4f, 0.2f, 1}, {0.4f, 0.2f, 0}, 3, 3, 0.6f, 0.5},  // clipped by its spread
        {AreaShape::Rectangle, {2, 0, 0.3f}, {2, 0, -1}, 2, 2, kPi, -1},            // grazing
        {AreaShape::Disk, {0.2f, 0, 5}, {0, 0, 0}, 1, 1, kPi, 0.98},
        {AreaShape::Ellipse, {0.2f, 0.1f, 1}, {0, 0, 0}, 3, 2, kPi, 0.0},
        {AreaShape::Disk, {0, 0, 3}, {0, 0, 0}, 3, 3, 0.3f, 0.95},
    };
    int k = 0;
    for (const Case& c : cases) {
        Fixture f;
        scene::Light& l = aimed(f, LightType::Area, c.at, c.target);
        l.shape = c.shape;
        l.size_x = c.x;
        l.size_y = c.y;
        l.spread = c.spread;
        f.build();
        expect_density(f, {0, 0, 0}, c.at, c.edge, "area " + std::to_string(k++));
    }
}

TEST(Density, PointAndSpotLamps) {
    for (bool soft : {true, false}) {
        for (LightType type : {LightType::Point, LightType::Spot}) {
            Fixture f;
            scene::Light& l = aimed(f, type, {0, 1, 3}, {0, 0, 0});
            l.radius = 1;
            l.soft_falloff = soft;
            f.build();
            expect_density(f, {0, 0, 0}, {0, 1, 3}, 0.9, std::string(soft ? "disk " : "sphere ") + (type == LightType::Spot ? "spot" : "point"));
        }
    }
    Fixture inside;
    scene::Light& l = inside.add_light(LightType::Point, 100, {0.2f, 0, 0.3f});
    l.radius = 1;
    l.soft_falloff = false;
    inside.build();
    expect_density(inside, {0, 0, 0}, {0, 0, 1}, -1, "inside a sphere");
}

/// A die's twelve triangles, so that none is a rectangle with its neighbour.
void add_box(Fixture& f, Vec3 center, float half, int shader) {
    std::vector<Vec3> p;
    for (int k = 0; k < 8; ++k) p.push_back(center + Vec3{k & 1 ? half : -half, k & 2 ? half : -half, k & 4 ? half : -half});
    f.add_mesh(p, {0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4, 2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5}, shader);
}

TEST(Density, Triangles) {
    Fixture near;
    near.add_mesh({{-1, -1, 0.5f}, {2, -1, 1}, {0, 1.5f, 0.7f}}, {0, 1, 2}, near.emission({1, 1, 1}));
    near.build();
    expect_density(near, {0, 0, 0}, {0, 0, 1}, 0.0, "near triangle");
    Fixture far;
    far.add_mesh({{-1, -1, 20}, {2, -1, 21}, {0, 1.5f, 20}}, {0, 1, 2}, far.emission({1, 1, 1}));
    far.build();
    expect_density(far, {0, 0, 0}, {0, 0, 1}, 0.99, "far triangle");
    Fixture rect;
    rect.add_mesh({{-1, -1, 1}, {2, -1, 1}, {2, 1.5f, 1}, {-1, 1.5f, 1}}, {0, 1, 2, 2, 3, 0}, rect.emission({1, 1, 1}));
    rect.build();
    EXPECT_EQ(rect.table->rects.size(), 1u);
    expect_density(rect, {0, 0, 0}, {0, 0, 1}, 0.0, "rectangle of two triangles");
}

/// What is sampled is what a ray finds, whatever the choice among several emitters: same density, same radiance, same distance.
TEST(Density, SamplesAgreeWithRays) {
    for (int extra : {0, 80}) {
        Fixture f;
        const int shader = f.emission({2, 2, 2});
        f.add_mesh({{-1, -1, 4}, {1, -1, 4}, {0, 1, 4.5f}}, {0, 1, 2}, shader);
        add_box(f, {3, 0, 1}, 0.25f, shader);
        aimed(f, LightType::Area, {-2, 2, 1}, {0, 0, 0}).spread = 2;
        scene::Light& sphere = f.add_light(LightType::Point, 50, {0, -3, 2});
        sphere.radius = 0.3f;
        sphere.soft_falloff = false;
        f.add_light(LightType::Point, 50, {0, 3, -2}).radius = 0.2f;
        aimed(f, LightType::Spot, {-3, -1, 0.5f}, {0, 0, 0}).radius = 0.1f;
        for (int k = 0; k < extra; ++k) f.add_light(LightType::Point, 1, {float(k) * 0.1f - 4, 6, 3}).radius = 0.01f;
        f.build();
        EXPECT_EQ(f.table->view.emitter_leaf != nullptr, extra > 0);
        const Vec3 p{0.1f, 0.2f, 0};
        int compared = 0, hidden = 0, edges = 0;
        sample_many(f, Stratum::Local, p, 2048, [&](const Samples& s, int n) {
            for (int i = 0; i < n; ++i) {
                if (s.pdf[i] <= 0) continue;
                const Met met = meet(f, p, s.wi(i));
                if (std::abs(met.distance - double(s.distance[i])) > 1e-3 * met.distance) {
                    ++hidden;  // the far side of the box, or an edge missed by rounding
                    continue;
                }
                ++compared;
                // On an edge of the box rounding decides which of two triangles the ray meets.
                edges += std::abs(met.pdf - double(s.pdf[i])) > 2e-3 * met.pdf ? 1 : 0;
                EXPECT_NEAR(met.radiance, double(s.r[i]), 2e-3 * met.radiance + 1e-4);
            }
        });
        EXPECT_GT(compared, 1000);
        EXPECT_LT(hidden, 700);
        EXPECT_LE(edges, 2);
    }
}

/// Light samples alone, rays alone, and both weighted by the power heuristic have one mean.
TEST(Density, StrategiesAgree) {
    Fixture f;
    f.add_mesh({{-1, -1, 2}, {1, -1, 2}, {0, 1, 2.5f}}, {0, 1, 2}, f.emission({2, 2, 2}));
    scene::Light& area = aimed(f, LightType::Area, {-2, 1, 1}, {0, 0, 0});
    area.size_x = 2;
    area.spread = 2;
    scene::Light& soft = f.add_light(LightType::Point, 50, {0, -2, 2});
    soft.radius = 0.5f;
    f.build();
    const Vec3 p{}, up{0, 0, 1};
    const double light = irradiance(f, Stratum::Local, p, up, 1 << 16);
    double rays = 0, both = 0;
    constexpr int count = 1 << 16;
    for (int i = 0; i < count; ++i) {
        const Vec2 u = sample_pair(pixel_key(3, 0), uint32_t(i), 1);
        const float r = std::sqrt(u.x), phi = kTwoPi * u.y;
        const Vec3 d{r * std::cos(phi), r * std::sin(phi), std::sqrt(1 - u.x)};
        // Lamps let rays pass: what lies behind is not visible to `meet`, so the emitters do not overlap from p.
        const Met met = meet(f, p, d);
        const double own = double(d.z) / M_PI;
        rays += met.radiance * M_PI;
        both += met.radiance * M_PI * own * own / (own * own + met.pdf * met.pdf);
    }
    double weighted = 0;
    sample_many(f, Stratum::Local, p, count, [&](const Samples& s, int n) {
        for (int i = 0; i < n; ++i) {
            const double c = double(dot(s.wi(i), up)), pdf = double(s.pdf[i]);
            if (pdf <= 0 || c <= 0) continue;
            const double own = c / M_PI;
            weighted += double(s.r[i]) * c / pdf * pdf * pdf / (pdf * pdf + own * own);
        }
    });
    EXPECT_NEAR(rays / count, light, 0.01 * light);
    EXPECT_NEAR((both + weighted) / count, light, 0.005 * light);
}

TEST(Density, SunsSeenAndSampled) {
    for (int version : {304, 502}) {
        Fixture f(version);
        scene::Light& sun = aimed(f, LightType::Sun, {1, 2, 3}, {0, 0, 0});
        sun.power = 3;
        sun.sun_angle = 0.2f;
        f.add_light(LightType::Sun, 1, {}).sun_angle = 0;
        f.build();
        const Vec3 up{0, 0, 1};
        const double light = irradiance(f, Stratum::Distant, {}, up, 1 << 16);
        EXPECT_NEAR(light, 1 + 3 * 3 / std::sqrt(14.0), 0.02);
        // Rays over the cone of the disc, at the sampler's own density: the power heuristic gives exactly half.
        const Vec3 to = normalize(Vec3{1, 2, 3});
        Vec3 x, y;
        make_basis(to, x, y);
        double sum = 0, half = 0;
        const double one_minus_cos = 1 - std::cos(0.15), pdf = f.table->suns[0].probability / (2 * M_PI * double(f.table->suns[0].one_minus_cos));
        constexpr int count = 1 << 15;
        for (int i = 0; i < count; ++i) {
            const Vec2 u = sample_pair(pixel_key(3, 0), uint32_t(i), 1);
            const double c = 1 - double(u.x) * one_minus_cos, s = std::sqrt(1 - c * c), phi = 2 * M_PI * double(u.y);
            const Vec3 d = to * float(c) + x * float(s * std::cos(phi)) + y * float(s * std::sin(phi));
            float w[3] = {d.x, d.y, d.z}, rgb[3];
            const int32_t visible = scene::kVisibleCamera;
            for (const float own : {-1.0f, float(pdf)}) {
                shade_suns(*f.table, {w, w + 1, w + 2}, &visible, &own, 1, f.programs, f.context, f.scratch, {rgb, rgb + 1, rgb + 2});
                (own < 0 ? sum : half) += double(rgb[0]) * double(d.z) * 2 * M_PI * one_minus_cos;
            }
        }
        EXPECT_NEAR(sum / count + 1, light, 0.003 * light) << version;
        EXPECT_NEAR(half / sum, 0.5, 1e-3) << version;
    }
}

TEST(Density, RaysMeetLampsBehindLamps) {
    Fixture f;
    for (float z : {1.0f, 2.0f, 3.0f}) {
        scene::Light& l = f.add_light(LightType::Point, 10, {0, 0, z});
        l.radius = 0.2f;
        l.soft_falloff = z != 2.0f;
    }
    f.add_light(LightType::Point, 10, {0, 0, 2.5f}).radius = 0.1f;
    f.scene.lights.back().use_mis = false;
    f.add_light(LightType::Point, 10, {0, 0, 2.7f}).radius = 0.1f;
    f.scene.lights.back().visibility = scene::kVisibleCamera;
    f.build();
    float o[3] = {0, 0, 0}, d[3] = {0, 0, 1}, far = 10, t = 0, start = 0;
    int32_t lamp = -1;
    for (int32_t mask : {int32_t(scene::kVisibleDiffuse), int32_t(scene::kVisibleCamera)}) {
        std::vector<float> met;
        for (start = 0;; start = t) {
            intersect_lamps(*f.table, {o, o + 1, o + 2}, {d, d + 1, d + 2}, &far, &mask, 1, &lamp, &t, &start);
            if (lamp < 0) break;
            met.push_back(t);
        }
        const std::vector<float> expected =
            mask == int32_t(scene::kVisibleDiffuse) ? std::vector<float>{1, 1.8f, 3} : std::vector<float>{1, 1.8f, 2.5f, 2.7f, 3};
        ASSERT_EQ(met.size(), expected.size());
        for (size_t k = 0; k < met.size(); ++k) EXPECT_NEAR(met[k], expected[k], 1e-4);
    }
}

/// No sample is NaN, infinite or of density 0 with radiance, for whatever a file may hold.
TEST(Density, OddLampsGiveFiniteSamples) {
    const float sizes[] = {0, 1e-20f, 1e-6f, 1, 1e6f, 1e12f}, powers[] = {0, 1e-30f, 1, -5, 1e20f};
    const Vec3 places[] = {{0, 0, 0}, {0, 0, 1e-7f}, {0, 0, 1}, {1e5f, 0, 1e5f}};
    for (LightType type : {LightType::Point, LightType::Spot, LightType::Area}) {
        for (float size : sizes) {
            for (float power : powers) {
                for (bool odd : {false, true}) {
                    Fixture f(odd ? 304 : 502);
                    for (Vec3 at : places) {
                        scene::Light& l = f.add_light(type, power, at);
                        l.radius = l.size_x = l.size_y = size;
                        l.soft_falloff = odd;
                        l.shape = odd ? AreaShape::Ellipse : AreaShape::Rectangle;
                        l.spread = odd ? 0.0f : 1.0f;
                        l.spot_angle = odd ? 0.0f : kPi;
                        l.spot_blend = odd ? 1.0f : 0.0f;
                    }
                    f.add_mesh({{0, 0, 0}, {size, 0, 0}, {0, size, 0}, {0, 0, 0}}, {0, 1, 2, 0, 0, 1, 0, 2, 3}, f.emission(vec3(std::abs(power))));
                    f.build();
                    for (Vec3 p : {Vec3{0, 0, 0}, Vec3{0, 0, -1}, Vec3{0.1f, 0.1f, 1e-4f}, Vec3{1e4f, 1e4f, 1e4f}}) {
                        sample_many(f, Stratum::Local, p, 64, [&](const Samples& s, int n) {
                            for (int i = 0; i < n; ++i) {
                                const bool finite = std::isfinite(s.pdf[i]) && std::isfinite(s.r[i]) && std::isfinite(s.distance[i]) &&
                                                    std::isfinite(s.wx[i]) && std::isfinite(s.wy[i]) && std::isfinite(s.wz[i]);
                                EXPECT_TRUE(finite && s.pdf[i] >= 0) << int(type) << " " << size << " " << power;
                                if (s.pdf[i] > 0) {
                                    EXPECT_NEAR(length(s.wi(i)), 1, 1e-3) << int(type) << " " << size;
                                }
                            }
                        });
                        const Met met = meet(f, p, normalize(Vec3{0.1f, 0.2f, 1}));
                        EXPECT_TRUE(std::isfinite(met.pdf) && std::isfinite(met.radiance));
                    }
                }
            }
        }
    }
}

/// Sky with a soft gradient, a bright disc of a few cells and a black half: what is drawn follows the density, and the
/// density is that of the directions.
TEST(Density, WorldMap) {
    constexpr int width = 64, height = 32;
    std::vector<float> fine(size_t(4 * width * height));
    double mean_radiance = 0, solid = 0;
    for (int y = 0; y < 2 * height; ++y) {
        for (int x = 0; x < 2 * width; ++x) {
            const double theta = M_PI * (y + 0.5) / (2 * height);
            float l = theta < M_PI / 2 ? 0.5f + 0.5f * float(std::cos(theta)) : 0.0f;
            if (std::hypot(x - 30.5, y - 12.5) < 1.5) l = 500;
            fine[size_t(y * 2 * width + x)] = l;
            mean_radiance += double(l) * std::sin(theta);
            solid += std::sin(theta);
        }
    }
    EmitterTable table;
    const float average = make_world_map(fine, width, height, table);
    EXPECT_NEAR(average, mean_radiance / solid, 2e-3 * mean_radiance / solid);
    WorldMap map = table.view.world;
    map.rows = table.world_rows.data();
    map.columns = table.world_columns.data();
    map.density = table.world_density.data();

    constexpr int cells_u = 32, cells_v = 16, count = 1 << 20;
    std::vector<double> observed(cells_u * cells_v, 0), expected(cells_u * cells_v, 0);
    std::mt19937 engine(5);
    double sky = 0;
    for (int begin = 0; begin < count; begin += kSpan) {
        float u[kSpan], v[kSpan], x[kSpan], y[kSpan], z[kSpan], pdf[kSpan], again[kSpan];
        for (int i = 0; i < kSpan; ++i) {
            u[i] = unit_float(engine());
            v[i] = unit_float(engine());
        }
        sample_map(map, u, v, kSpan, {x, y, z}, pdf);
        pdf_map(map, {x, y, z}, kSpan, again);
        for (int i = 0; i < kSpan; ++i) {
            const double mu = std::atan2(double(y[i]), double(x[i])) / (2 * M_PI) + 0.5, mv = std::acos(std::clamp(double(z[i]), -1.0, 1.0)) / M_PI;
            observed[size_t(std::min(int(mv * cells_v), cells_v - 1) * cells_u + std::min(int(mu * cells_u), cells_u - 1))] += 1;
            // Directions on a cell's border may round to the neighbour; elsewhere sample and density agree.
            const double fu = mu * width - std::floor(mu * width), fv = mv * height - std::floor(mv * height);
            if (std::min(fu, 1 - fu) > 1e-3 && std::min(fv, 1 - fv) > 1e-3) {
                EXPECT_NEAR(pdf[i], again[i], 1e-3f * pdf[i]);
            }
            const int fx = std::min(int(mu * 2 * width), 2 * width - 1), fy = std::min(int(mv * 2 * height), 2 * height - 1);
            sky += double(fine[size_t(fy * 2 * width + fx)]) / double(pdf[i]);
        }
    }
    // The estimate of the sky's integral: 4 pi times its mean.
    EXPECT_NEAR(sky / count, 4 * M_PI * mean_radiance / solid, 0.01 * 4 * M_PI * mean_radiance / solid);

    constexpr int fine_cells = 64;
    for (int c = 0; c < cells_u * cells_v; ++c) {
        double sum = 0;
        for (int k = 0; k < fine_cells; ++k) {
            for (int j = 0; j < fine_cells; ++j) {
                const float u = (float(c % cells_u) + (float(j) + 0.5f) / fine_cells) / cells_u,
                            v = (float(c / cells_u) + (float(k) + 0.5f) / fine_cells) / cells_v;
                const Vec3 d = map_direction(u, v);
                float w[3] = {d.x, d.y, d.z}, pdf = 0;
                pdf_map(map, {w, w + 1, w + 2}, 1, &pdf);
                sum += double(pdf) * std::sin(M_PI * double(v));
            }
        }
        expected[size_t(c)] = sum / (fine_cells * fine_cells) * 2 * M_PI * M_PI / (cells_u * cells_v) * count;
    }
    double chi2 = 0, total = 0;
    int dof = -1;
    for (int c = 0; c < cells_u * cells_v; ++c) {
        total += expected[size_t(c)];
        if (expected[size_t(c)] < 5) continue;
        chi2 += (observed[size_t(c)] - expected[size_t(c)]) * (observed[size_t(c)] - expected[size_t(c)]) / expected[size_t(c)];
        ++dof;
    }
    EXPECT_NEAR(total, count, 1e-3 * count);
    EXPECT_GT(chi2_tail(chi2, dof), 1e-4) << chi2 << " of " << dof;
}

TEST(Density, UniformSkiesHaveNoMap) {
    EmitterTable table;
    std::vector<float> fine(size_t(4 * 16 * 8), 0.7f);
    EXPECT_EQ(make_world_map(fine, 16, 8, table), 0);
    EXPECT_TRUE(table.world_rows.empty());
    fine.assign(fine.size(), 0.0f);
    EXPECT_EQ(make_world_map(fine, 16, 8, table), 0);
}

}  // namespace
}  // namespace talbot::light::test
