/// Emissive triangles, a table per (mesh, materials) that instances share, and one emitter an object.
#include <algorithm>
#include <cmath>
#include <map>

#include "light/emitter_table.h"

namespace talbot::light {
namespace {

/// Bounds over every triangle of an instance are exact up to this many; larger ones are bounded by their box.
constexpr int kExactTriangles = 4096;

/// A range of light triangles that instances share.
struct TriangleSet {
    int32_t first = 0, count = 0, map = 0, root = -1;
    double weight = 0;  ///< area (object space) times mean emission
    Vec3 low, high;     ///< box, object space
    int32_t sides = 0;  ///< of all triangles together
};

struct EmissiveShader {
    float estimate = 0;  ///< 0: does not emit or is not light-sampled
    int32_t sides = 0;
};

EmissiveShader emissive_shader(const shader::CompiledShader& compiled) {
    EmissiveShader out;
    out.sides = (compiled.emission_front ? 1 : 0) | (compiled.emission_back ? 2 : 0);
    if (!compiled.sample_as_light || out.sides == 0) return out;
    if (compiled.emission_is_constant) {
        out.estimate = std::abs(mean(compiled.constant_emission));
    } else if (compiled.emission >= 0) {
        out.estimate = std::max(compiled.emission_estimate, 1e-3f);
    }
    if (!std::isfinite(out.estimate)) out.estimate = 0;
    return out;
}

Vec3 min3(Vec3 a, Vec3 b) {
    return {minf(a.x, b.x), minf(a.y, b.y), minf(a.z, b.z)};
}
Vec3 max3(Vec3 a, Vec3 b) {
    return {maxf(a.x, b.x), maxf(a.y, b.y), maxf(a.z, b.z)};
}

/// In the mesh's space, where the front is the side of the cross product.
TreeItem tree_item(const LightTriangle& t, double area, const EmissiveShader& shader) {
    TreeItem item;
    const Vec3 low = min3(min3(t.a, t.b), t.c), high = max3(max3(t.a, t.b), t.c);
    item.center = (low + high) * 0.5f;
    for (Vec3 p : {t.a, t.b, t.c}) item.radius = std::max(item.radius, length(p - item.center));
    item.axis = normalize(cross(t.b - t.a, t.c - t.a)) * (t.sides == 2 ? -1.0f : 1.0f);
    item.strength = float(std::clamp(area * double(shader.estimate), 1e-30, 1e28));
    item.cos_normals = 1;
    item.two_sided = t.sides == 3;
    return item;
}

TriangleSet add_triangles(const scene::MeshView& mesh, const int32_t* slots, int slot_count, const std::vector<EmissiveShader>& emissive, EmitterTable& table) {
    TriangleSet set;
    set.first = int32_t(table.triangles.size());
    set.low = vec3(1e30f);
    set.high = vec3(-1e30f);
    std::vector<TreeItem> items;
    std::vector<int32_t> leaves, map(mesh.triangle_count, -1);
    for (uint32_t k = 0; k < mesh.triangle_count; ++k) {
        const int slot = mesh.triangle_materials ? std::min(int(mesh.triangle_materials[k]), slot_count - 1) : 0;
        const int32_t shader = slots[slot];
        const EmissiveShader& own = emissive[size_t(shader)];
        if (own.estimate <= 0) continue;
        LightTriangle triangle;
        triangle.a = mesh.positions[mesh.triangle_vertices[3 * k]];
        triangle.b = mesh.positions[mesh.triangle_vertices[3 * k + 1]];
        triangle.c = mesh.positions[mesh.triangle_vertices[3 * k + 2]];
        triangle.primitive = int32_t(k);
        triangle.shader = shader;
        triangle.sides = own.sides;
        const double area = 0.5 * double(length(cross(triangle.b - triangle.a, triangle.c - triangle.a)));
        if (!(area > 0) || !std::isfinite(area)) continue;
        map[k] = int32_t(items.size());
        items.push_back(tree_item(triangle, area, own));
        set.weight += area * double(own.estimate);
        set.sides |= own.sides;
        for (Vec3 p : {triangle.a, triangle.b, triangle.c}) {
            set.low = min3(set.low, p);
            set.high = max3(set.high, p);
        }
        table.triangles.push_back(triangle);
    }
    set.count = int32_t(items.size());
    if (set.count == 0) return set;
    set.map = int32_t(table.primitive_to_triangle.size());
    for (int32_t k : map) table.primitive_to_triangle.push_back(k < 0 ? -1 : set.first + k);
    set.root = add_tree(items, table, leaves);
    for (int32_t k = 0; k < set.count; ++k) table.triangles[size_t(set.first + k)].leaf = leaves[size_t(k)];
    return set;
}

/// Unit normal of the front side and world area.
Vec3 front_normal(const LightTriangle& t, const Affine& to_world, float sign, double& area) {
    const Vec3 e1 = transform_direction(to_world, t.b - t.a), e2 = transform_direction(to_world, t.c - t.a);
    const Vec3 n = cross(e1, e2);
    area = 0.5 * double(length(n));
    return normalize(n) * sign;
}

TreeSpace tree_space(const Affine& m) {
    const auto column = [&](int c) { return Vec3{m.m[0][c], m.m[1][c], m.m[2][c]}; };
    const Vec3 x = column(0), y = column(1), z = column(2);
    const float s = max_component({length(x), length(y), length(z)}), skew = std::abs(dot(x, y)) + std::abs(dot(y, z)) + std::abs(dot(z, x));
    if (!(std::abs(double(determinant(m))) > 1e-9 * double(s) * double(s) * double(s))) return TreeSpace::Flat;
    const bool even = std::min({length(x), length(y), length(z)}) > 0.999f * s && skew < 1e-3f * s * s;
    return even ? TreeSpace::KeepsAngles : TreeSpace::Bent;
}

void bound(const TriangleSet& set, const MeshEmitter& emitter, const std::vector<EmissiveShader>& emissive, const EmitterTable& table, Reach& reach) {
    const Affine& m = emitter.to_world;
    reach.center = transform_point(m, (set.low + set.high) * 0.5f);
    for (int corner = 0; corner < 8; ++corner) {
        const Vec3 p{corner & 1 ? set.high.x : set.low.x, corner & 2 ? set.high.y : set.low.y, corner & 4 ? set.high.z : set.low.z};
        reach.radius = std::max(reach.radius, length(transform_point(m, p) - reach.center));
    }
    // A convex body shows a quarter of its area on average.
    reach.kind = ReachKind::Isotropic;
    if (set.count > kExactTriangles) {
        reach.strength = float(0.25 * set.weight * std::pow(std::abs(double(determinant(m))), 2.0 / 3.0));
        return;
    }

    const bool two_sided = set.sides == 3;
    reach.two_sided = two_sided ? 1.0f : 0.0f;
    Vec3 sum;
    double weight = 0;
    for (int32_t k = 0; k < set.count; ++k) {
        const LightTriangle& t = table.triangles[size_t(set.first + k)];
        double area = 0;
        Vec3 n = front_normal(t, m, emitter.front_sign, area);
        if (set.sides == 2 || (two_sided && dot(n, sum) < 0)) n = -n;
        sum = sum + n * float(area);
        weight += area * double(emissive[size_t(t.shader)].estimate);
    }
    reach.strength = float(0.25 * weight);
    reach.axis = normalize(sum);
    float cos_normals = 1;
    for (int32_t k = 0; k < set.count; ++k) {
        double area = 0;
        const float c = dot(front_normal(table.triangles[size_t(set.first + k)], m, emitter.front_sign, area), reach.axis);
        if (area > 0) cos_normals = std::min(cos_normals, two_sided ? std::abs(c) : set.sides == 2 ? -c : c);
    }
    if (cos_normals < 0.5f) return;
    reach.kind = ReachKind::Oriented;
    reach.strength = float(weight);
    if (cos_normals > 1 - 1e-6f && !two_sided) reach.behind = 0;
    // A little wider than computed: rounding must not cut off what grazes.
    reach.cos_normals = cos_normals > 1 - 1e-6f ? 1.0f : std::max(cos_normals - 1e-4f, 0.0f);
    reach.sin_normals = std::sqrt(1 - reach.cos_normals * reach.cos_normals);
}

/// What moves: one ball for the whole shutter, and nothing said of directions.
void bound_moving(const TriangleSet& set, const Affine& to_world, scene::MotionView motion, const scene::MeshView& mesh, Reach& reach) {
    Vec3 low = set.low, high = set.high;
    for (size_t i = 0; mesh.motion_positions && i < size_t(mesh.motion_steps) * mesh.position_count; ++i) {
        low = min3(low, mesh.motion_positions[i]);
        high = max3(high, mesh.motion_positions[i]);
    }
    Vec3 world_low = vec3(1e30f), world_high = vec3(-1e30f);
    for (int step = 0; step < std::max(motion.steps, 1); ++step) {
        const Affine& m = motion.steps > 0 ? motion.maps[step] : to_world;
        for (int corner = 0; corner < 8; ++corner) {
            const Vec3 p = transform_point(m, {corner & 1 ? high.x : low.x, corner & 2 ? high.y : low.y, corner & 4 ? high.z : low.z});
            world_low = min3(world_low, p);
            world_high = max3(world_high, p);
        }
    }
    reach.center = (world_low + world_high) * 0.5f;
    reach.radius = length(world_high - reach.center);
    reach.kind = ReachKind::Isotropic;
    reach.strength = float(0.25 * set.weight * std::pow(std::abs(double(determinant(to_world))), 2.0 / 3.0));
}

/// Two triangles that make a rectangle with one constant emission are sampled as a whole.
bool as_rect(const TriangleSet& set, const MeshEmitter& emitter, const shader::Programs& programs, const EmitterTable& table, Rect& rect) {
    if (set.count != 2) return false;
    const LightTriangle &s = table.triangles[size_t(set.first)], &t = table.triangles[size_t(set.first + 1)];
    if (s.shader != t.shader || !programs.shaders[size_t(s.shader)].emission_is_constant) return false;
    const Vec3 p[3] = {s.a, s.b, s.c}, q[3] = {t.a, t.b, t.c};
    const float size = length(set.high - set.low);
    const auto same = [&](Vec3 a, Vec3 b) { return length(a - b) < 1e-6f * size; };
    int p_alone = -1, q_alone = -1, shared = 0;
    for (int i = 0; i < 3; ++i) {
        const bool in_q = same(p[i], q[0]) || same(p[i], q[1]) || same(p[i], q[2]);
        const bool in_p = same(q[i], p[0]) || same(q[i], p[1]) || same(q[i], p[2]);
        shared += in_q;
        if (!in_q) p_alone = i;
        if (!in_p) q_alone = i;
    }
    if (shared != 2 || p_alone < 0 || q_alone < 0) return false;

    const Affine& m = emitter.to_world;
    const Vec3 corner = transform_point(m, p[p_alone]), opposite = transform_point(m, q[q_alone]);
    const Vec3 x = transform_direction(m, p[(p_alone + 1) % 3] - p[p_alone]), y = transform_direction(m, p[(p_alone + 2) % 3] - p[p_alone]);
    const float lx = length(x), ly = length(y);
    if (!(lx > 0) || !(ly > 0) || length(corner + x + y - opposite) > 1e-4f * std::min(lx, ly) || std::abs(dot(x, y)) > 1e-4f * lx * ly) return false;
    double area = 0;
    const Vec3 n = front_normal(s, m, emitter.front_sign, area);
    if (dot(n, front_normal(t, m, emitter.front_sign, area)) < 0.9999f) return false;
    rect.center = (corner + opposite) * 0.5f;
    rect.axis_x = x / lx;
    rect.axis_y = normalize(y - rect.axis_x * dot(rect.axis_x, y));
    rect.normal = set.sides == 2 ? -n : n;
    rect.half_x = 0.5f * lx;
    rect.half_y = 0.5f * ly;
    rect.ellipse_area = kPi * rect.half_x * rect.half_y;
    rect.two_sided = set.sides == 3 ? 1.0f : 0.0f;
    return true;
}

}  // namespace

void add_meshes(const scene::Scene& scene, const scene::SceneTables& tables, const shader::Programs& programs, Report& report, const std::atomic<bool>* cancel,
                EmitterTable& table) {
    const scene::SceneView& view = tables.view;
    if (!scene.settings.use_emission_sampling) return;
    std::vector<EmissiveShader> emissive;
    bool any = false;
    for (const shader::CompiledShader& compiled : programs.shaders) {
        emissive.push_back(emissive_shader(compiled));
        any |= emissive.back().estimate > 0;
    }
    if (!any) return;
    table.object_emitter.assign(size_t(view.object_count), -1);

    std::map<std::pair<int32_t, int32_t>, TriangleSet> sets;
    for (int32_t i = 0; i < view.object_count; ++i) {
        if (cancel && cancel->load()) throw Cancelled{};
        const scene::TraitsView& traits = scene::traits_of(view, i);
        if (traits.mesh < 0 || traits.visibility == 0) continue;
        const int32_t* slots = view.material_slots + traits.material_offset;
        const bool emits = std::any_of(slots, slots + traits.material_count, [&](int32_t s) { return emissive[size_t(s)].estimate > 0; });
        if (!emits) continue;
        const auto [entry, is_new] = sets.try_emplace({traits.mesh, traits.material_offset});
        TriangleSet& set = entry->second;
        if (is_new) set = add_triangles(view.meshes[traits.mesh], slots, traits.material_count, emissive, table);
        if (set.count == 0) continue;

        MeshEmitter emitter;
        const Affine& to_world = view.objects[i].to_world;
        const scene::MotionView motion = scene::motion_of(view, i);
        emitter.to_world = to_world;
        emitter.first = set.first;
        emitter.count = set.count;
        emitter.root = set.root;
        emitter.to_object = view.to_object[i];
        const scene::MeshView& mesh = view.meshes[traits.mesh];
        emitter.moves = motion.steps > 0 || mesh.motion_positions;
        // The tree knows the normals of one shape only.
        emitter.space = mesh.motion_positions ? TreeSpace::Bent : tree_space(to_world);
        emitter.map = set.map;
        emitter.object = i;
        emitter.visibility = int32_t(scene::with_catcher_bits(traits.visibility, traits.is_shadow_catcher));
        emitter.blockers = int32_t(shadow_mask(traits.linking));
        emitter.front_sign = determinant(to_world) < 0 ? -1.0f : 1.0f;
        Reach reach;
        if (emitter.moves)
            bound_moving(set, to_world, motion, mesh, reach);
        else
            bound(set, emitter, emissive, table, reach);
        if (!(reach.strength > 0)) continue;
        if (!std::isfinite(reach.strength) || !std::isfinite(reach.radius)) {
            report.warning("An emissive object with infinite size is not light-sampled");
            continue;
        }
        Emitter out;
        out.kind = int32_t(EmitterKind::Mesh);
        out.mesh = int32_t(table.meshes.size());
        Rect rect;
        if (!emitter.moves && as_rect(set, emitter, programs, table, rect)) {
            out.kind = int32_t(EmitterKind::Rect);
            out.rect = int32_t(table.rects.size());
            table.rects.push_back(rect);
        }
        table.object_emitter[size_t(i)] = int32_t(table.emitters.size());
        table.emitters.push_back(out);
        table.reach.push_back(reach);
        table.receivers.push_back(traits.linking.receivers);
        table.meshes.push_back(emitter);
    }
}

}  // namespace talbot::light
