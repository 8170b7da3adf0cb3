#include "geometry/displace.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>
#include <utility>

#include "scene/motion.h"

namespace talbot::geometry {
namespace {

using scene::DisplacementMethod;

/// A vertex to be moved and the triangle's corner that says how.
struct Corner {
    uint32_t vertex = 0, triangle = 0;
    uint8_t corner = 0;
};

int32_t slot_of(const scene::Mesh& mesh, size_t triangle, size_t slots) {
    const size_t slot = mesh.triangle_materials.empty() ? 0 : size_t(mesh.triangle_materials[triangle]);
    return int32_t(std::min(slot, slots - 1));
}

/// Vertices by the shader that moves them.
std::map<int32_t, std::vector<Corner>> corners_by_shader(const scene::Mesh& mesh, const std::vector<int32_t>& shaders) {
    std::map<int32_t, std::vector<Corner>> out;
    std::vector<bool> done(mesh.positions.size());
    for (size_t t = 0; t < mesh.triangle_count(); ++t) {
        const int32_t shader = shaders[size_t(slot_of(mesh, t, shaders.size()))];
        if (shader < 0) continue;
        for (uint8_t k = 0; k < 3; ++k) {
            const uint32_t vertex = mesh.triangle_vertices[3 * t + k];
            if (done[vertex]) continue;
            done[vertex] = true;
            out[shader].push_back({vertex, uint32_t(t), k});
        }
    }
    return out;
}

/// Unit normal of a triangle, front side; 0 where it has none.
Vec3 face_normal(const scene::Mesh& mesh, const Vec3* positions, size_t triangle) {
    const uint32_t* v = &mesh.triangle_vertices[3 * triangle];
    const Vec3 a = positions[v[0]];
    const Vec3 n = cross(positions[v[1]] - a, positions[v[2]] - a);
    const float l = length(n);
    return l > 0 && l < 3e38f ? n / l : Vec3{};
}

Vec3 unit_or(Vec3 v, Vec3 fallback) {
    const float l = length(v);
    return l > 1e-20f && l < 3e38f ? v / l : fallback;
}

/// Normals of vertices where the mesh has none of its own: triangles weighted by their angles, as Blender weighs faces.
std::vector<Vec3> angle_weighted_normals(const scene::Mesh& mesh) {
    std::vector<Vec3> normals(mesh.positions.size());
    for (size_t t = 0; t < mesh.triangle_count(); ++t) {
        const uint32_t* v = &mesh.triangle_vertices[3 * t];
        const Vec3 n = face_normal(mesh, mesh.positions.data(), t);
        for (int k = 0; k < 3; ++k) {
            const Vec3 at = mesh.positions[v[k]];
            const Vec3 a = unit_or(mesh.positions[v[(k + 1) % 3]] - at, {}), b = unit_or(mesh.positions[v[(k + 2) % 3]] - at, {});
            normals[v[k]] = normals[v[k]] + n * std::acos(std::clamp(dot(a, b), -1.0f, 1.0f));
        }
    }
    for (Vec3& n : normals) n = unit_or(n, {0, 0, 1});
    return normals;
}

/// Scratch of one worker.
struct SpanMemory {
    std::vector<float> registers, columns = std::vector<float>(size_t(16 * kSpan));
    std::vector<int32_t> integers = std::vector<int32_t>(size_t(13 * kSpan));
    shader::ShadingSpan span;

    explicit SpanMemory(int register_count) : registers(size_t(std::max(register_count, 1)) * kSpan) {
        float* f = columns.data();
        int32_t* i = integers.data();
        const auto take = [&f] { return std::exchange(f, f + kSpan); };
        const auto take_integers = [&i] { return std::exchange(i, i + kSpan); };
        for (Columns3* c : {&span.p, &span.n_s, &span.n_g, &span.wo}) *c = {take(), take(), take()};
        for (float** c : {&span.u, &span.v, &span.ray_length, &span.footprint}) *c = take();
        for (int32_t** c : {&span.object, &span.primitive, &span.constants, &span.ray_flags, &span.backfacing, &span.depth, &span.diffuse_depth,
                            &span.glossy_depth, &span.transparent_depth, &span.transmission_depth})
            *c = take_integers();
        for (uint32_t** c : {&span.key, &span.sample, &span.vertex}) *c = reinterpret_cast<uint32_t*>(take_integers());
        span.uniform_constants = true;
    }
    SpanMemory(const SpanMemory&) = delete;
    SpanMemory& operator=(const SpanMemory&) = delete;
};

class Displacer {
public:
    Displacer(const scene::SceneTables& tables, const shader::Programs& programs, const shader::ShaderContext& context, RunProgram run, WorkerPool& pool,
              Report& report, const std::atomic<bool>* cancel)
        : tables_(tables), programs_(programs), context_(context), run_(run), pool_(pool), report_(report), cancel_(cancel) {
        // No rays: there is nothing to be hit yet. Nodes that trace say what they say of empty space.
        context_.trace = {};
        context_.scene = &tables.view;
        for (int i = 0; i < pool.size(); ++i) memory_.push_back(std::make_unique<SpanMemory>(programs.max_registers));
    }

    /// The mesh as `object` and its materials displace it.
    scene::Mesh displaced(const scene::Mesh& mesh, int32_t object, const std::vector<int32_t>& shaders) {
        std::vector<Vec3> offsets(mesh.positions.size());
        const std::vector<Vec3> own_normals = mesh.vertex_normals.empty() ? angle_weighted_normals(mesh) : std::vector<Vec3>{};
        const std::vector<Vec3>& normals = mesh.vertex_normals.empty() ? own_normals : mesh.vertex_normals;
        for (const auto& [shader, corners] : corners_by_shader(mesh, shaders)) evaluate(mesh, object, shader, corners, normals, offsets);
        scene::Mesh out = mesh;
        keep_undisplaced(mesh, out);
        for (size_t v = 0; v < out.positions.size(); ++v) out.positions[v] = out.positions[v] + offsets[v];
        for (size_t i = 0; i < out.motion_positions.size(); ++i) out.motion_positions[i] = out.motion_positions[i] + offsets[i % offsets.size()];
        renew_normals(mesh, shaders, out);
        return out;
    }

private:
    void check() const {
        if (cancel_ && cancel_->load()) throw Cancelled{};
    }

    void evaluate(const scene::Mesh& mesh, int32_t object, int32_t shader, const std::vector<Corner>& corners, const std::vector<Vec3>& normals,
                  std::vector<Vec3>& offsets) {
        const shader::CompiledShader& compiled = programs_.shaders[size_t(shader)];
        const shader::Program& program = *programs_.programs[size_t(compiled.displacement)];
        const scene::Placement placed{tables_.view.objects[object].to_world, tables_.view.to_object[object]};
        std::atomic<int64_t> broken{0};
        pool_.parallel_for(corners.size(), kSpan, [&](size_t begin, size_t end, int worker) {
            check();
            SpanMemory& memory = *memory_[size_t(worker)];
            shader::ShadingSpan& span = memory.span;
            span.n = int(end - begin);
            for (int i = 0; i < span.n; ++i) {
                const Corner& c = corners[begin + size_t(i)];
                const Vec3 n_s = unit_or(transform_normal(placed.to_object, normals[c.vertex]), {0, 0, 1});
                store(span.p, i, transform_point(placed.to_world, mesh.positions[c.vertex]));
                store(span.n_s, i, n_s);
                store(span.wo, i, compiled.displaced_from_front ? n_s : Vec3{});
                store(span.n_g, i, unit_or(transform_normal(placed.to_object, face_normal(mesh, mesh.positions.data(), c.triangle)), n_s));
                span.u[i] = c.corner == 1 ? 1.0f : 0.0f;
                span.v[i] = c.corner == 2 ? 1.0f : 0.0f;
                span.object[i] = object;
                span.primitive[i] = int32_t(c.triangle);
                span.constants[i] = compiled.constants;
            }
            run_(program, programs_, span, context_, memory.registers.data());
            const float* r = memory.registers.data() + size_t(program.displacement) * kSpan;
            for (int i = 0; i < span.n; ++i) {
                const Vec3 offset = transform_direction(placed.to_object, Vec3{r[i], r[kSpan + i], r[2 * kSpan + i]});
                const bool fine = is_finite(offset);
                broken += !fine;
                offsets[corners[begin + size_t(i)].vertex] = fine ? offset : Vec3{};
            }
        });
        if (broken > 0)
            report_.warning("The displacement of " + std::to_string(broken.load()) + " vertices is not finite: they stay where they are",
                            "Mesh '" + mesh.name + "', material '" + program.name + "'");
    }

    /// What shaders may ask about the shape as it was.
    void keep_undisplaced(const scene::Mesh& mesh, scene::Mesh& out) const {
        const auto asked = [&](const char* name) {
            return std::find(tables_.attribute_names.begin(), tables_.attribute_names.end(), name) != tables_.attribute_names.end();
        };
        const auto has = [&](const char* name) {
            return std::any_of(mesh.attributes.begin(), mesh.attributes.end(), [&](const scene::Attribute& a) { return a.name == name; });
        };
        const auto add = [&](const char* name, Vec3 scale, Vec3 offset) {
            scene::Attribute a;
            a.name = name;
            a.components = 3;
            for (Vec3 p : mesh.positions) {
                const Vec3 x = p * scale + offset;
                a.data.insert(a.data.end(), {x.x, x.y, x.z});
            }
            out.attributes.push_back(std::move(a));
        };
        if (asked(scene::kUndisplaced)) add(scene::kUndisplaced, {1, 1, 1}, {});
        if (asked("@generated") && !has("@generated")) add("@generated", mesh.generated_scale, mesh.generated_offset);
    }

    void renew_normals(const scene::Mesh& before, const std::vector<int32_t>& shaders, scene::Mesh& out) const {
        std::vector<uint32_t> triangles;
        for (size_t t = 0; t < before.triangle_count(); ++t) {
            const int32_t shader = shaders[size_t(slot_of(before, t, shaders.size()))];
            if (shader >= 0 && programs_.shaders[size_t(shader)].displacement_method == DisplacementMethod::Displacement) triangles.push_back(uint32_t(t));
        }
        const bool by_corner = !out.corner_normals.empty();
        if (triangles.empty() || (!by_corner && out.vertex_normals.empty())) return;
        const size_t vertices = before.positions.size(), count = by_corner ? out.corner_normals.size() : out.vertex_normals.size();
        const auto renew = [&](const Vec3* from, const Vec3* to, Vec3* normals) {
            check();
            const std::vector<Vec3> sums = sum_normals(out, triangles, to);
            if (by_corner)
                turn_corners(out, triangles, sum_normals(out, triangles, from), sums, normals);
            else
                for (uint32_t t : triangles)
                    for (int k = 0; k < 3; ++k) {
                        const uint32_t v = out.triangle_vertices[3 * t + size_t(k)];
                        normals[v] = unit_or(sums[v], normals[v]);
                    }
        };
        renew(before.positions.data(), out.positions.data(), by_corner ? out.corner_normals.data() : out.vertex_normals.data());
        for (size_t step = 0; (step + 1) * count <= out.motion_normals.size(); ++step)
            renew(before.motion_positions.data() + step * vertices, out.motion_positions.data() + step * vertices, out.motion_normals.data() + step * count);
    }

    static std::vector<Vec3> sum_normals(const scene::Mesh& mesh, const std::vector<uint32_t>& triangles, const Vec3* positions) {
        std::vector<Vec3> sums(mesh.positions.size());
        for (uint32_t t : triangles) {
            const Vec3 n = face_normal(mesh, positions, t);
            for (int k = 0; k < 3; ++k) {
                Vec3& sum = sums[mesh.triangle_vertices[3 * t + size_t(k)]];
                sum = sum + n;
            }
        }
        return sums;
    }

    static void turn_corners(const scene::Mesh& mesh, const std::vector<uint32_t>& triangles, const std::vector<Vec3>& before, const std::vector<Vec3>& after,
                             Vec3* normals) {
        // Two triangles may share a corner's number: it turns once.
        std::vector<bool> done(mesh.corner_normals.size());
        for (uint32_t t : triangles) {
            for (size_t k = 0; k < 3; ++k) {
                const uint32_t corner = mesh.triangle_corners[3 * t + k], v = mesh.triangle_vertices[3 * t + k];
                if (done[corner]) continue;
                done[corner] = true;
                normals[corner] = unit_or(normals[corner] + unit_or(after[v], {}) - unit_or(before[v], {}), normals[corner]);
            }
        }
    }

    const scene::SceneTables& tables_;
    const shader::Programs& programs_;
    shader::ShaderContext context_;
    RunProgram run_;
    WorkerPool& pool_;
    Report& report_;
    const std::atomic<bool>* cancel_;
    std::vector<std::unique_ptr<SpanMemory>> memory_;
};

/// The displacing shaders by slot; empty when none displaces.
std::vector<int32_t> displacing_shaders(const scene::SceneTables& tables, const shader::Programs& programs, const scene::TraitsView& traits) {
    std::vector<int32_t> out;
    bool any = false;
    for (int slot = 0; slot < traits.material_count; ++slot) {
        const int32_t shader = tables.material_slots[size_t(traits.material_offset + slot)];
        out.push_back(programs.shaders[size_t(shader)].displacement >= 0 ? shader : -1);
        any |= out.back() >= 0;
    }
    if (!any) out.clear();
    return out;
}

template <class T>
bool same_bits(const std::vector<T>& a, const std::vector<T>& b) {
    return a.size() == b.size() && (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0);
}

bool same_shape(const scene::Mesh& a, const scene::Mesh& b) {
    return same_bits(a.positions, b.positions) && same_bits(a.motion_positions, b.motion_positions) && same_bits(a.vertex_normals, b.vertex_normals) &&
           same_bits(a.corner_normals, b.corner_normals) && same_bits(a.motion_normals, b.motion_normals) && a.attributes.size() == b.attributes.size();
}

}  // namespace

void displace_meshes(scene::SceneTables& tables, const shader::Programs& programs, const shader::ShaderContext& context, RunProgram run, WorkerPool& pool,
                     std::vector<DisplacedMesh>& known, Report& report, const std::atomic<bool>* cancel) {
    const std::vector<DisplacedMesh> before = std::move(known);
    known.clear();
    if (std::none_of(programs.shaders.begin(), programs.shaders.end(), [](const shader::CompiledShader& s) { return s.displacement >= 0; })) return;
    // What is displaced, in the order of the objects; and the choice of all objects with the same traits.
    constexpr int32_t plain = -1, unseen = -2;
    std::vector<int32_t> first_objects, choice(tables.traits.size() - 1, unseen);
    for (int32_t i = 0; i < tables.view.object_count; ++i) {
        const scene::Handle handle = tables.view.objects[i].traits;
        if (handle < 0 || choice[size_t(handle)] != unseen) continue;
        const scene::TraitsView& traits = tables.view.traits[handle];
        choice[size_t(handle)] = plain;
        if (traits.mesh < 0 || tables.meshes[size_t(traits.mesh)].kind != scene::GeometryKind::Triangles) continue;
        std::vector<int32_t> shaders = displacing_shaders(tables, programs, traits);
        if (shaders.empty()) continue;
        const auto found = std::find_if(known.begin(), known.end(), [&](const DisplacedMesh& d) { return d.handle == traits.mesh && d.shaders == shaders; });
        choice[size_t(handle)] = int32_t(found - known.begin());
        if (found != known.end()) continue;
        known.push_back({traits.mesh, std::move(shaders), tables.keep_alive[size_t(traits.mesh)], nullptr, {}});
        first_objects.push_back(i);
    }
    if (known.empty()) return;

    {
        Displacer displacer(tables, programs, context, run, pool, report, cancel);
        for (size_t k = 0; k < known.size(); ++k) {
            DisplacedMesh& d = known[k];
            auto mesh = std::make_shared<const scene::Mesh>(displacer.displaced(*d.source, first_objects[k], d.shaders));
            const auto old = std::find_if(before.begin(), before.end(), [&](const DisplacedMesh& b) {
                return b.handle == d.handle && b.source == d.source && b.mesh && b.shaders == d.shaders && same_shape(*b.mesh, *mesh);
            });
            d.mesh = old != before.end() ? old->mesh : std::move(mesh);
        }
    }

    // The first choice of a mesh takes its place where every object that shows it displaces it alike; others go to the end.
    std::vector<int32_t> places(known.size(), -1);
    for (size_t k = 0; k < known.size(); ++k) {
        DisplacedMesh& d = known[k];
        bool alone = true;
        for (size_t i = 0; i < choice.size() && alone; ++i) alone = choice[i] == unseen || tables.view.traits[i].mesh != d.handle || choice[i] == int32_t(k);
        places[k] = alone ? d.handle : int32_t(tables.meshes.size());
        if (!alone) {
            tables.meshes.emplace_back();
            tables.keep_alive.emplace_back();
        }
        d.attributes.assign(tables.attribute_names.size(), {});
        tables.meshes[size_t(places[k])] = scene::view_mesh(*d.mesh, tables, d.attributes.data());
        tables.keep_alive[size_t(places[k])] = d.mesh;
    }
    for (size_t i = 0; i < choice.size(); ++i)
        if (choice[i] >= 0) tables.traits[1 + i].mesh = places[size_t(choice[i])];
    tables.view.meshes = tables.meshes.data();
}

}  // namespace talbot::geometry
