#include "geometry/tessellate.h"

#include <algorithm>
#include <cmath>

#include "geometry/cut_faces.h"

namespace talbot::geometry {
namespace {

Vec3 unit_or_zero(Vec3 v) {
    const float l = length(v);
    return l > 1e-30f && l < 3e38f ? v / l : Vec3{};
}

/// Makes the mesh of the cut faces: triangles, shape, normals, attributes.
class Assembler {
public:
    Assembler(DicingWork& work, CutFaces cuts) : work_(work), faces_(std::move(cuts.faces)), vertex_count_(cuts.vertex_count) {}

    scene::Mesh run() {
        uint32_t points = 0, triangles = 0;
        for (FaceMesh& face : faces_) {
            face.first_point = points;
            face.first_triangle = triangles;
            face.first_inside = vertex_count_;
            for (FacePoint& point : face.points)
                if (point.vertex == kNoVertex) point.vertex = vertex_count_++;
            points += uint32_t(face.points.size());
            triangles += uint32_t(face.triangles.size() / 3);
        }
        scene::Mesh out;
        out.name = work_.cage.name;
        out.active_uv = work_.cage.active_uv;
        out.active_color = work_.cage.active_color;
        out.generated_offset = work_.cage.generated_offset;
        out.generated_scale = work_.cage.generated_scale;
        out.motion_steps = work_.cage.motion_steps;
        bool by_corner = false, by_face = false;
        for (const scene::Attribute& attribute : work_.cage.attributes) {
            by_corner |= attribute.domain == scene::Domain::Corner;
            by_face |= attribute.domain == scene::Domain::Face;
        }
        fill_triangles(out, triangles, by_corner, by_face);
        evaluate_shape(work_.positions(), out, out.positions, out.vertex_normals);
        const bool keeps_normals = work_.cage.subdivision.scheme == scene::SubdivisionScheme::Simple && !work_.cage.vertex_normals.empty();
        if (keeps_normals) interpolate_normals(out.vertex_normals);
        for (int step = 0; size_t(step) * work_.cage.positions.size() < work_.cage.motion_positions.size(); ++step) {
            std::vector<Vec3> shape, normals;
            evaluate_shape(&work_.cage.motion_positions[size_t(step) * work_.cage.positions.size()].x, out, shape, normals);
            out.motion_positions.insert(out.motion_positions.end(), shape.begin(), shape.end());
            if (!keeps_normals) out.motion_normals.insert(out.motion_normals.end(), normals.begin(), normals.end());
        }
        for (const scene::Attribute& attribute : work_.cage.attributes) out.attributes.push_back(diced(attribute, points));
        return out;
    }

private:
    void fill_triangles(scene::Mesh& out, size_t count, bool by_corner, bool by_face) {
        const scene::Subdivision& cage = work_.cage.subdivision;
        const bool materials = std::any_of(cage.face_materials.begin(), cage.face_materials.end(), [](uint16_t slot) { return slot != 0; });
        const bool flat = std::any_of(cage.face_smooth.begin(), cage.face_smooth.end(), [](uint8_t smooth) { return smooth == 0; });
        out.triangle_vertices.resize(3 * count);
        if (by_corner) out.triangle_corners.resize(3 * count);
        if (by_face) out.triangle_faces.resize(count);
        if (materials) out.triangle_materials.resize(count);
        if (flat) out.triangle_smooth.resize(count);
        work_.for_faces([&](size_t face, int) {
            const FaceMesh& from = faces_[face];
            const uint32_t number = work_.surface.cage_faces[face];
            for (size_t i = 0; i < from.triangles.size(); ++i) {
                out.triangle_vertices[3 * size_t(from.first_triangle) + i] = from.points[from.triangles[i]].vertex;
                if (by_corner) out.triangle_corners[3 * size_t(from.first_triangle) + i] = from.first_point + from.triangles[i];
            }
            for (size_t t = from.first_triangle; t < from.first_triangle + from.triangles.size() / 3; ++t) {
                if (by_face) out.triangle_faces[t] = number;
                if (materials) out.triangle_materials[t] = cage.face_materials[number];
                if (flat) out.triangle_smooth[t] = cage.face_smooth[number];
            }
        });
    }

    void evaluate_shape(const float* cage_positions, const scene::Mesh& mesh, std::vector<Vec3>& shape, std::vector<Vec3>& normals) {
        shape.assign(vertex_count_, {});
        normals.assign(vertex_count_, {});
        std::vector<std::vector<Vec3>> shared(faces_.size());  // normals of points that other faces may have too
        work_.for_faces([&](size_t face, int worker) {
            SurfacePatch& patch = *work_.patches[size_t(worker)].shape;
            patch.bind(face, cage_positions, 3);
            for (const FacePoint& point : faces_[face].points) {
                Vec3 p, du, dv;
                patch.evaluate(point.place, &p.x, &du.x, &dv.x);
                const Vec3 n = unit_or_zero(cross(du, dv));
                if (point.owned) shape[point.vertex] = p;
                if (point.vertex >= faces_[face].first_inside)
                    normals[point.vertex] = n;
                else
                    shared[face].push_back(n);
            }
        });
        for (size_t face = 0; face < faces_.size(); ++face) {
            size_t next = 0;
            for (const FacePoint& point : faces_[face].points)
                if (point.vertex < faces_[face].first_inside) normals[point.vertex] = normals[point.vertex] + shared[face][next++];
        }
        repair_normals(mesh, shape, normals);
    }

    /// Flat pieces are as smooth as the cage was shaded.
    void interpolate_normals(std::vector<Vec3>& normals) {
        work_.for_faces([&](size_t face, int) {
            for (const FacePoint& point : faces_[face].points) {
                if (!point.owned) continue;
                Vec3 n;
                interpolate(face, point.place, 3, &n.x, [&](uint32_t i) { return &work_.cage.vertex_normals[work_.corner_vertex(face, i)].x; });
                n = unit_or_zero(n);
                if (dot(n, n) > 0) normals[point.vertex] = n;
            }
        });
    }

    /// Where a surface has no normal of its own (a pole of coinciding vertices, opposite faces) it is that of the triangles.
    static void repair_normals(const scene::Mesh& mesh, const std::vector<Vec3>& shape, std::vector<Vec3>& normals) {
        bool all_fine = true;
        for (Vec3& n : normals) {
            n = unit_or_zero(n);
            all_fine = all_fine && dot(n, n) > 0;
        }
        if (all_fine) return;
        std::vector<Vec3> sums(shape.size());
        for (size_t i = 0; i < mesh.triangle_vertices.size(); i += 3) {
            const uint32_t* v = &mesh.triangle_vertices[i];
            const Vec3 n = unit_or_zero(cross(shape[v[1]] - shape[v[0]], shape[v[2]] - shape[v[0]]));
            for (int k = 0; k < 3; ++k) sums[v[k]] = sums[v[k]] + n;
        }
        for (size_t i = 0; i < normals.size(); ++i) {
            if (dot(normals[i], normals[i]) > 0) continue;
            const Vec3 n = unit_or_zero(sums[i]);
            normals[i] = dot(n, n) > 0 ? n : Vec3{0, 0, 1};
        }
    }

    // ---- attributes

    scene::Attribute diced(const scene::Attribute& from, size_t points) {
        scene::Attribute out;
        out.name = from.name;
        out.domain = from.domain;
        out.components = from.components;
        out.is_color = from.is_color;
        const size_t width = from.components;
        if (from.domain == scene::Domain::Face || from.domain == scene::Domain::Object) {
            out.data = from.data;
        } else if (from.domain == scene::Domain::Corner) {
            out.data.resize(points * width);
            work_.for_faces(
                [&](size_t face, int worker) { fill_corners(face, work_.patches[size_t(worker)], from, &out.data[faces_[face].first_point * width]); });
        } else {
            out.data.resize(size_t(vertex_count_) * width);
            const bool smooth = from.name == "@generated";
            work_.for_faces([&](size_t face, int worker) {
                SurfacePatch& patch = *work_.patches[size_t(worker)].shape;
                if (smooth) patch.bind(face, from.data.data(), int(width));
                for (const FacePoint& point : faces_[face].points) {
                    if (!point.owned) continue;
                    float* to = &out.data[point.vertex * width];
                    if (smooth)
                        patch.evaluate(point.place, to);
                    else
                        interpolate(face, point.place, width, to, [&](uint32_t i) { return &from.data[work_.corner_vertex(face, i) * width]; });
                }
            });
        }
        return out;
    }

    void fill_corners(size_t face, DicingWork::Patches& patches, const scene::Attribute& from, float* to) {
        const auto map_of = [&](const auto& fits) {
            return std::find_if(work_.surface.uv_maps.begin(), work_.surface.uv_maps.end(),
                                [&](const LimitSurface::UvMap& map) { return fits(*map.attribute); });
        };
        const auto itself = map_of([&](const scene::Attribute& a) { return &a == &from; });
        const auto below = map_of([&](const scene::Attribute& a) { return from.name == "@tangent:" + a.name; });
        const std::vector<FacePoint>& points = faces_[face].points;
        if (itself != work_.surface.uv_maps.end()) {
            patches.uv->bind_uv(face, *itself);
            for (const FacePoint& point : points) patches.uv->evaluate(point.place, to), to += 2;
        } else if (below != work_.surface.uv_maps.end() && from.components == 4) {
            patches.shape->bind(face, work_.positions(), 3);
            patches.uv->bind_uv(face, *below);
            for (const FacePoint& point : points) tangent(patches, point.place, to), to += 4;
        } else {
            const size_t width = from.components;
            const uint32_t n = work_.surface.face_size(face);
            const auto corner = [&](uint32_t i) { return &from.data[work_.surface.cage_corners[work_.surface.starts[face] + i % n] * width]; };
            for (const FacePoint& point : points) interpolate(face, point.place, width, to, corner), to += width;
        }
    }

    /// The direction in which the map's first number grows and its second stays, and whether the map is mirrored.
    static void tangent(const DicingWork::Patches& patches, Place place, float* out) {
        Vec3 p, p_u, p_v;
        float uv[2], uv_u[2], uv_v[2];
        patches.shape->evaluate(place, &p.x, &p_u.x, &p_v.x);
        patches.uv->evaluate(place, uv, uv_u, uv_v);
        const float turn = uv_u[0] * uv_v[1] - uv_u[1] * uv_v[0], sign = turn < 0 ? -1.0f : 1.0f;
        const Vec3 t = unit_or_zero((p_u * uv_v[1] - p_v * uv_u[1]) * sign);
        out[0] = t.x, out[1] = t.y, out[2] = t.z, out[3] = sign;
    }

    /// Linear in the quad, whose corners are means of the face's.
    template <class Corner>
    void interpolate(size_t face, Place place, size_t width, float* out, const Corner& corner) const {
        const uint32_t n = work_.surface.face_size(face), i = place.quad, next = (i + 1) % n, before = (i + n - 1) % n;
        for (size_t k = 0; k < width; ++k) {
            float centre = 0;
            for (uint32_t c = 0; c < n; ++c) centre += corner(c)[k];
            centre /= float(n);
            const float here = corner(i)[k], ahead = 0.5f * (here + corner(next)[k]), behind = 0.5f * (here + corner(before)[k]);
            out[k] = lerp(lerp(here, ahead, place.s), lerp(behind, centre, place.s), place.t);
        }
    }

    DicingWork& work_;
    std::vector<FaceMesh> faces_;
    uint32_t vertex_count_;
};

}  // namespace

float DicingMeter::allowed(Vec3 world) const {
    if (!camera) return edge_length;
    const Vec3 p = transform_point(to_camera, world);
    const float* view = camera->view;
    const bool perspective = camera->type == scene::CameraType::Perspective;
    float distance = 1;
    bool inside = true;
    if (perspective || camera->type == scene::CameraType::Orthographic) {
        const float depth = perspective ? std::max(-p.z, camera->clip_start) : 1;
        inside = -p.z > camera->clip_start && p.x >= view[0] * depth && p.x <= view[1] * depth && p.y >= view[2] * depth && p.y <= view[3] * depth;
        // Beside and behind the camera what counts is how far it is.
        if (perspective) distance = inside ? depth : std::max(length(p), camera->clip_start);
    } else {
        distance = std::max(length(p), camera->clip_start);
    }
    return std::max(distance * pixel * edge_length * (inside ? 1.0f : offscreen), 1e-12f);
}

float DicingMeter::edges(Vec3 a, Vec3 b) const {
    if (!camera) return length(b - a) / edge_length;
    const Vec3 from = transform_point(to_world, a), to = transform_point(to_world, b);
    return length(to - from) / std::min(allowed(from), allowed(to));
}

std::optional<scene::Mesh> tessellate(const scene::Mesh& cage, const DicingMeter& meter, size_t max_triangles, WorkerPool& pool,
                                      const std::atomic<bool>* cancel) {
    DicingWork work(cage, meter, pool, cancel);
    std::optional<CutFaces> cuts = cut_faces(work, max_triangles);
    if (!cuts) return std::nullopt;
    return Assembler(work, std::move(*cuts)).run();
}

}  // namespace talbot::geometry
