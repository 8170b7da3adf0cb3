// Nodes that look around: at the triangle they are on (Wireframe), or along rays (Ambient Occlusion, Bevel, Raycast). Samples run one after the other,
// each for all lanes of the span at once.
#include "base/sobol.h"
#include "shader/kernels/ops.h"

namespace talbot::shader {
inline namespace TALBOT_ISA {
namespace {

constexpr int kBevelHits = 4;  // surfaces met along one ray; what lies deeper counts no more

TALBOT_INLINE void fill_rest(Registers r, int columns, int lanes, int n) {
    for (int k = 0; k < columns; ++k) {
        const float last = lanes > 0 ? r[k][lanes - 1] : 0.0f;
        for (int i = lanes; i < n; ++i) r[k][i] = last;
    }
}

TALBOT_INLINE const scene::MeshView* mesh_at(const OpScope& s, int32_t object, int32_t primitive) {
    const scene::SceneView* scene = s.context.scene;
    if (!scene || object < 0 || object >= scene->object_count || primitive < 0) return nullptr;
    const int32_t mesh = scene::traits_of(*scene, object).mesh;
    return mesh >= 0 && scene->meshes[mesh].triangle_vertices ? &scene->meshes[mesh] : nullptr;
}

TALBOT_INLINE int32_t object_at(const OpScope& s, int lane) {
    return s.span.object && !s.span.is_background && !s.span.is_lamp ? s.span.object[lane] : -1;
}

TALBOT_INLINE Vec2 random_pair(const OpScope& s, int lane, uint32_t salt, uint32_t sample, uint32_t samples) {
    const uint32_t key = s.span.key ? s.span.key[lane] : 0u, first = s.span.sample ? s.span.sample[lane] : 0u;
    const uint32_t vertex = s.span.vertex ? s.span.vertex[lane] : 0u;
    return sample_pair(hash_combine(key, salt), first * samples + sample, pair_dimension(vertex, Pair::Shader));
}

/// Rays of a span and what they met.
struct RayBuffer {
    float origin[3][kSpan], direction[3][kSpan], t_max[kSpan], t[kSpan], u[kSpan], v[kSpan];
    int32_t object_only[kSpan], object[kSpan], primitive[kSpan];

    TraceRequest request(int n, uint32_t visibility) {
        TraceRequest r;
        r.n = n;
        r.origin = {origin[0], origin[1], origin[2]};
        r.direction = {direction[0], direction[1], direction[2]};
        r.t_max = t_max;
        r.visibility = visibility;
        r.hit_object = object;
        r.hit_primitive = primitive;
        r.hit_t = t;
        r.hit_u = u;
        r.hit_v = v;
        return r;
    }
};

/// World-space normals of a hit, out of the mesh: geometric, and interpolated where the face is smooth.
struct HitNormals {
    Vec3 geometric, shading;
};
TALBOT_INLINE HitNormals normals_at(const OpScope& s, int32_t object, int32_t primitive, float u, float v) {
    const scene::MeshView* mesh = mesh_at(s, object, primitive);
    if (!mesh) return {};
    const Affine& to_object = s.context.scene->to_object[object];
    const uint32_t* t = mesh->triangle_vertices + 3 * size_t(primitive);
    const Vec3 a = mesh->positions[t[0]], flat = cross(mesh->positions[t[1]] - a, mesh->positions[t[2]] - a);
    Vec3 normal = flat;
    const float w = 1.0f - u - v;
    if (!mesh->triangle_smooth || mesh->triangle_smooth[primitive]) {
        if (mesh->corner_normals) {
            const uint32_t first = uint32_t(3 * primitive);
            const uint32_t corners[3] = {first, first + 1, first + 2};
            const uint32_t* c = mesh->triangle_corners ? mesh->triangle_corners + 3 * size_t(primitive) : corners;
            normal = mesh->corner_normals[c[0]] * w + mesh->corner_normals[c[1]] * u + mesh->corner_normals[c[2]] * v;
        } else if (mesh->vertex_normals) {
            normal = mesh->vertex_normals[t[0]] * w + mesh->vertex_normals[t[1]] * u + mesh->vertex_normals[t[2]] * v;
        }
    }
    return {normalize(transform_normal(to_object, flat)), normalize(transform_normal(to_object, normal))};
}

/// Size of a pixel on the surface as the viewer sees it: the mean over two directions in it.
TALBOT_INLINE float pixel_size(const OpScope& s, int lane) {
    const Vec3 n = load(s.span.n_g, lane), wo = load(s.span.wo, lane);
    const Vec3 across = cross(Vec3{1, 1, 1}, n);
    const float length = std::sqrt(dot(across, across));
    const Vec3 x = length > 1e-6f ? across * (1.0f / length) : Vec3{0, 0, 1}, y = cross(n, x);
    const float a = dot(x, wo), b = dot(y, wo);
    return s.span.footprint[lane] * 0.5f * (safe_sqrt(1.0f - a * a) + safe_sqrt(1.0f - b * b));
}

/// How the weight of a neighbour falls off with its distance: (1 - x)^3 over a disk. Density of x = r / radius per area of the unit disk, and its sample.
TALBOT_INLINE float falloff_density(float x) {
    const float left = 1.0f - x;
    return x < 1.0f ? (10.0f * kInvPi) * left * left * left : 0.0f;
}
TALBOT_INLINE float falloff_sample(float share) {
    // Newton's method on the share within x: 10 x^2 - 20 x^3 + 15 x^4 - 4 x^5.
    float x = share <= 0.25f ? std::sqrt(0.1f * share) * 1.2f : share;
    for (int step = 0; step < 10; ++step) {
        const float left = 1.0f - x, x2 = x * x;
        const float slope = 20.0f * x * left * left * left;
        if (slope == 0.0f) break;
        x = clampf(x - (x2 * (10.0f + x * (-20.0f + x * (15.0f - 4.0f * x))) - share) / slope, 1e-6f, 1.0f);
    }
    return x;
}

}  // namespace

void op_wireframe(const Instruction& i, Registers r, int n, const OpScope& s) {
    const bool pixels = i.variant & 1;
    for (int k = 0; k < s.span.n; ++k) {
        r[0][k] = 0.0f;
        const int32_t object = object_at(s, k), primitive = s.span.primitive ? s.span.primitive[k] : -1;
        const scene::MeshView* mesh = mesh_at(s, object, primitive);
        if (!mesh) continue;
        const uint32_t* t = mesh->triangle_vertices + 3 * size_t(primitive);
        const Affine& map = s.context.scene->objects[object].to_world;
        const Vec3 p{r[2][k], r[3][k], r[4][k]};
        // Half the line on either side of the edge.
        const float width = 0.5f * r[1][k] * (pixels ? pixel_size(s, k) : 1.0f);
        for (int c = 0; c < 3; ++c) {
            const Vec3 a = transform_point(map, mesh->positions[t[c]]), edge = transform_point(map, mesh->positions[t[(c + 1) % 3]]) - a;
            const Vec3 away = cross(edge, p - a);
            if (dot(away, away) < dot(edge, edge) * width * width) r[0][k] = 1.0f;
        }
    }
    fill_rest(r, 1, s.span.n, n);
}

void op_occlusion(const Instruction& i, Registers r, int n, const OpScope& s) {
    const uint32_t samples = i.data & 0xffu, salt = i.data >> 8;
    const bool inside = i.variant & 1, only_local = i.variant & 2;
    const int lanes = s.span.n;
    for (int k = 0; k < lanes; ++k) r[0][k] = 0.0f;
    RayBuffer rays;
    if (s.context.trace.call && samples > 0) {
        for (uint32_t sample = 0; sample < samples; ++sample) {
            for (int k = 0; k < lanes; ++k) {
                Vec3 normal = normalize(Vec3{r[1][k], r[2][k], r[3][k]}), x, y;
                if (inside) normal = -normal;
                make_basis(normal, x, y);
                const Vec2 uv = random_pair(s, k, salt, sample, samples);
                float sine, cosine;
                lane_sincos(uv.y * kTwoPi, sine, cosine);
                const float radius = std::sqrt(uv.x), up = safe_sqrt(1.0f - uv.x);
                store({rays.direction[0], rays.direction[1], rays.direction[2]}, k, x * (radius * cosine) + y * (radius * sine) + normal * up);
                store({rays.origin[0], rays.origin[1], rays.origin[2]}, k, load(s.span.p, k));
                rays.t_max[k] = object_at(s, k) >= 0 ? r[4][k] : 0.0f;
                rays.object_only[k] = object_at(s, k);
            }
            TraceRequest request = rays.request(lanes, scene::kVisibleShadow);
            request.n_g = s.span.n_g;
            request.error = s.span.error;
            if (only_local) request.object_only = rays.object_only;
            s.context.trace.call(s.context.trace.user, request);
            for (int k = 0; k < lanes; ++k) r[0][k] += rays.object[k] >= 0 ? 1.0f : 0.0f;
        }
    }
    const float share = samples > 0 ? 1.0f / float(samples) : 0.0f;
    for (int k = 0; k < lanes; ++k) r[0][k] = 1.0f - r[0][k] * share;
    fill_rest(r, 1, lanes, n);
}

/// The mean normal of the surface around the point: rays through a ball around it, along the normal (half of them) or along a tangent, at a
/// distance that falls off with the profile; the three ways of finding a neighbour are weighted against each other [King et al. 2013,
/// "BSSRDF importance sampling"].
void op_bevel(const Instruction& i, Registers r, int n, const OpScope& s) {
    const uint32_t samples = i.data & 0xffu, salt = i.data >> 8;
    const int lanes = s.span.n;
    float sum[3][kSpan] = {}, weight[kSpan];
    RayBuffer rays;
    const Columns3 direction{rays.direction[0], rays.direction[1], rays.direction[2]}, origin{rays.origin[0], rays.origin[1], rays.origin[2]};
    const Columns3 total{sum[0], sum[1], sum[2]};
    if (s.context.trace.call) {
        for (uint32_t sample = 0; sample < samples; ++sample) {
            for (int k = 0; k < lanes; ++k) {
                const Vec3 p = load(s.span.p, k), normal = load(s.span.n_g, k);
                const float radius = r[3][k];
                Vec3 x, y;
                make_basis(normal, x, y);
                const Vec2 uv = random_pair(s, k, salt, sample, samples);
                // One number chooses the axis and, rescaled, the angle about it.
                Vec3 axis = normal, a = x, b = y;
                float turn = uv.x * 2.0f;
                if (uv.x >= 0.5f) {
                    const bool second = uv.x >= 0.75f;
                    turn = uv.x * 4.0f - (second ? 3.0f : 2.0f);
                    axis = second ? y : x;
                    a = second ? x : y;
                    b = normal;
                }
                float sine, cosine;
                lane_sincos(turn * kTwoPi, sine, cosine);
                const float share = falloff_sample(uv.y), distance = share * radius, half = radius * safe_sqrt(1.0f - share * share);
                weight[k] = 1.0f / maxf(falloff_density(share), 1e-12f);
                store(origin, k, p + a * (distance * cosine) + b * (distance * sine) + axis * half);
                store(direction, k, -axis);
                rays.object_only[k] = object_at(s, k);
                rays.t_max[k] = rays.object_only[k] >= 0 && radius > 0.0f ? 2.0f * half : 0.0f;
            }
            for (int hit = 0; hit < kBevelHits; ++hit) {
                TraceRequest request = rays.request(lanes, ~0u);
                request.object_only = rays.object_only;
                s.context.trace.call(s.context.trace.user, request);
                bool any = false;
                for (int k = 0; k < lanes; ++k) {
                    if (rays.object[k] < 0) {
                        rays.t_max[k] = 0.0f;
                        continue;
                    }
                    any = true;
                    const Vec3 p = load(s.span.p, k), axis = load(s.span.n_g, k), along = load(direction, k);
                    const Vec3 at = load(origin, k) + along * rays.t[k];
                    const HitNormals found = normals_at(s, rays.object[k], rays.primitive[k], rays.u[k], rays.v[k]);
                    Vec3 x, y;
                    make_basis(axis, x, y);
                    // Densities of this neighbour by each axis; the power heuristic over the axis' own.
                    const auto density = [&](Vec3 d, float chosen) { return chosen * std::fabs(dot(d, found.geometric)); };
                    const float dn = density(axis, 0.5f), dx = density(x, 0.25f), dy = density(y, 0.25f);
                    const float own = density(along, std::fabs(dot(along, axis)) > 0.5f ? 0.5f : 0.25f);
                    const float squares = dn * dn + dx * dx + dy * dy;
                    const Vec3 gap = at - p;
                    const float profile = r[3][k] > 0.0f ? falloff_density(std::sqrt(dot(gap, gap)) / r[3][k]) : 0.0f;
                    const float w = squares > 0.0f ? weight[k] * profile * own / squares : 0.0f;
                    store(total, k, load(total, k) + found.shading * w);
                    // On from just behind it.
                    const float step = rays.t[k] + 1e-4f * r[3][k];
                    store(origin, k, load(origin, k) + along * step);
                    rays.t_max[k] = maxf(rays.t_max[k] - step, 0.0f);
                }
                if (!any) break;
            }
        }
    }
    for (int k = 0; k < lanes; ++k) {
        const Vec3 mean = load(total, k);
        const float length = std::sqrt(dot(mean, mean));
        Vec3 normal = load(s.span.n_s, k);
        if (length > 1e-12f) {
            const float side = s.span.backfacing && s.span.backfacing[k] ? -1.0f : 1.0f;
            normal = mean * (side / length);
        }
        r[0][k] = normal.x;
        r[1][k] = normal.y;
        r[2][k] = normal.z;
    }
    fill_rest(r, 3, lanes, n);
}

/// One ray from anywhere. From the shaded point itself it starts off the surface, so that it does not meet it again.
void op_raycast(const Instruction& i, Registers r, int n, const OpScope& s) {
    const bool only_local = i.variant & 1;
    const int lanes = s.span.n;
    RayBuffer rays;
    const Columns3 origin{rays.origin[0], rays.origin[1], rays.origin[2]}, direction{rays.direction[0], rays.direction[1], rays.direction[2]};
    float error[kSpan];
    for (int k = 0; k < lanes; ++k) {
        const Vec3 p{r[13][k], r[14][k], r[15][k]}, d{r[16][k], r[17][k], r[18][k]}, here = load(s.span.p, k);
        const float length = r[19][k], squares = dot(d, d);
        store(origin, k, p);
        store(direction, k, d);
        const bool at_surface = p.x == here.x && p.y == here.y && p.z == here.z;
        error[k] = at_surface && s.span.error ? s.span.error[k] : 0.0f;
        rays.object_only[k] = rays.object[k] = object_at(s, k);
        const bool valid = rays.object[k] >= 0 && length > 0.0f && squares > 0.0f && squares < 1e30f && dot(p, p) < 1e36f;
        rays.t_max[k] = valid ? length : 0.0f;
        rays.object[k] = -1;
    }
    if (s.context.trace.call) {
        TraceRequest request = rays.request(lanes, scene::kVisibleRaycast);
        request.n_g = s.span.n_g;
        request.error = error;
        if (only_local) request.object_only = rays.object_only;
        s.context.trace.call(s.context.trace.user, request);
    }
    for (int k = 0; k < lanes; ++k) {
        const bool hit = rays.object[k] >= 0;
        const Vec3 d = load(direction, k);
        // Strands and points are met face to face.
        Vec3 at{0, 0, 0}, normal{0, 0, 0};
        if (hit) {
            at = load(origin, k) + d * rays.t[k];
            normal =
                mesh_at(s, rays.object[k], rays.primitive[k]) ? normals_at(s, rays.object[k], rays.primitive[k], rays.u[k], rays.v[k]).shading : normalize(-d);
        }
        r[0][k] = hit ? 1.0f : 0.0f;
        r[1][k] = hit && rays.object[k] == object_at(s, k) ? 1.0f : 0.0f;
        r[2][k] = hit ? rays.t[k] : r[19][k];
        store({r[3], r[4], r[5]}, k, at);
        store({r[6], r[7], r[8]}, k, normal);
        r[9][k] = as_float(hit ? rays.object[k] : -1);
        r[10][k] = as_float(hit ? rays.primitive[k] : -1);
        r[11][k] = hit ? rays.u[k] : 0.0f;
        r[12][k] = hit ? rays.v[k] : 0.0f;
    }
    fill_rest(r, 13, lanes, n);
}

}  // namespace TALBOT_ISA
}  // namespace talbot::shader
