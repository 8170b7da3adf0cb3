#include "scene/mesh_build.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>

namespace talbot::scene {
namespace {

std::string owner_of(const MeshInput& input) {
    return "Mesh '" + input.name + "'";
}

Error mesh_error(const MeshInput& input, const std::string& what) {
    return Error(what, owner_of(input));
}

/// [IEC 61966-2-1]
std::array<float, 256> make_srgb_table() {
    std::array<float, 256> table{};
    for (int i = 0; i < 256; ++i) {
        const double c = i / 255.0;
        table[size_t(i)] = float(c <= 0.04045 ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4));
    }
    return table;
}

void check_length(const std::string& owner, size_t have, size_t want, const std::string& what) {
    if (have != 0 && have != want) throw Error(what + " has " + std::to_string(have) + " elements instead of " + std::to_string(want), owner);
}

void check_length(const MeshInput& input, size_t have, size_t want, const char* what) {
    check_length(owner_of(input), have, want, what);
}

void check_below(const MeshInput& input, std::span<const uint32_t> indices, size_t bound, const char* what) {
    const auto largest = std::max_element(indices.begin(), indices.end());
    if (largest != indices.end() && *largest >= bound) {
        throw mesh_error(input, std::string(what) + " has an index " + std::to_string(*largest) + " beyond " + std::to_string(bound));
    }
}

/// Twice the area's vector in double precision: neither tiny nor huge faces under- or overflow.
std::array<double, 3> area_vector(Vec3 a, Vec3 b, Vec3 c) {
    const double e[3] = {double(b.x) - a.x, double(b.y) - a.y, double(b.z) - a.z};
    const double f[3] = {double(c.x) - a.x, double(c.y) - a.y, double(c.z) - a.z};
    return {e[1] * f[2] - e[2] * f[1], e[2] * f[0] - e[0] * f[2], e[0] * f[1] - e[1] * f[0]};
}

Vec3 unit_normal(Vec3 a, Vec3 b, Vec3 c) {
    const auto n = area_vector(a, b, c);
    const double l = std::sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    return l > 0 ? Vec3{float(n[0] / l), float(n[1] / l), float(n[2] / l)} : Vec3{0, 0, 1};
}

std::vector<Vec3> copy_vectors(std::span<const float> floats) {
    std::vector<Vec3> out(floats.size() / 3);
    if (!out.empty()) std::memcpy(static_cast<void*>(out.data()), floats.data(), out.size() * sizeof(Vec3));
    return out;
}

/// A normal that is missing or not finite becomes the geometric one of a triangle that uses it.
void repair_normals(const Mesh& mesh, const std::vector<uint32_t>& triangle_elements, std::vector<Vec3>& normals) {
    for (size_t i = 0; i < triangle_elements.size(); ++i) {
        Vec3& n = normals[triangle_elements[i]];
        if (is_finite(n) && dot(n, n) > 0.25f) continue;
        const uint32_t* v = &mesh.triangle_vertices[i / 3 * 3];
        n = unit_normal(mesh.positions[v[0]], mesh.positions[v[1]], mesh.positions[v[2]]);
    }
}

uint16_t slot_of(int32_t material) {
    return uint16_t(std::clamp(material, 0, int32_t(std::numeric_limits<uint16_t>::max())));
}

/// Creases that name vertices that do not exist are an error like any other index; sharpness that is not finite is none.
Subdivision build_cage(const MeshInput& input, size_t vertices, size_t faces) {
    Subdivision cage = input.subdivision;
    const size_t corners = input.corner_vertices.size();
    check_length(input, input.face_starts.size(), faces + 1, "face_starts");
    const auto starts = input.face_starts;
    if (starts.empty() || starts.front() != 0 || starts.back() != corners || !std::is_sorted(starts.begin(), starts.end()))
        throw mesh_error(input, "face_starts does not count the corners");
    check_below(input, cage.crease_edges, vertices, "crease_edges");
    check_below(input, cage.crease_vertices, vertices, "crease_vertices");
    check_length(input, cage.crease_edges.size(), 2 * cage.crease_sharpness.size(), "crease_edges");
    check_length(input, cage.crease_vertices.size(), cage.vertex_sharpness.size(), "crease_vertices");
    if (cage.max_level < 1 || cage.max_level > 16) throw mesh_error(input, "max_level is not 1 to 16");
    if (!(cage.edge_length > 0) || !std::isfinite(cage.edge_length)) throw mesh_error(input, "edge_length is not a length");
    for (std::vector<float>* sharpness : {&cage.crease_sharpness, &cage.vertex_sharpness})
        for (float& s : *sharpness) s = std::isfinite(s) ? std::max(s, 0.0f) : 0.0f;
    cage.face_starts.assign(starts.begin(), starts.end());
    cage.corner_vertices.assign(input.corner_vertices.begin(), input.corner_vertices.end());
    cage.face_smooth.assign(input.face_smooth.begin(), input.face_smooth.end());
    for (int32_t slot : input.face_materials) cage.face_materials.push_back(slot_of(slot));
    // A face that cannot be seen has one vertex only: nothing is diced of it.
    for (size_t f = 0; f < faces; ++f) {
        const auto begin = cage.corner_vertices.begin() + starts[f], end = cage.corner_vertices.begin() + starts[f + 1];
        const bool fine = std::all_of(begin, end, [&](uint32_t v) {
            const float* p = &input.positions[3 * size_t(v)];
            return is_finite({p[0], p[1], p[2]});
        });
        if (!fine) std::fill(begin, end, *begin);
    }
    return cage;
}

}  // namespace

float linear_of_srgb_byte(uint8_t byte) {
    static const std::array<float, 256> table = make_srgb_table();
    return table[byte];
}

Attribute copy_attribute(const MeshInputAttribute& from, size_t elements, const std::string& owner) {
    Attribute out;
    out.name = from.name;
    out.domain = from.domain;
    out.is_color = from.is_color;
    if (!from.bytes.empty()) {
        check_length(owner, from.bytes.size() / 4, elements, from.name);
        out.components = 4;
        out.data.resize(from.bytes.size());
        for (size_t i = 0; i < from.bytes.size(); ++i) out.data[i] = i % 4 == 3 ? float(from.bytes[i]) / 255.0f : linear_of_srgb_byte(from.bytes[i]);
        return out;
    }
    if (from.components < 1 || from.components > 4) throw Error("attribute '" + from.name + "' has an impossible number of components", owner);
    out.components = uint8_t(from.components);
    if (from.floats.size() != elements * size_t(from.components)) {
        throw Error("attribute '" + from.name + "' has " + std::to_string(from.floats.size() / size_t(from.components)) + " elements instead of " +
                        std::to_string(elements),
                    owner);
    }
    out.data.assign(from.floats.begin(), from.floats.end());
    // A value that is not finite would spread through whole paths.
    for (float& v : out.data) v = std::isfinite(v) ? v : 0.0f;
    return out;
}

Mesh build_mesh(const MeshInput& input, Report& report) {
    const size_t vertices = input.positions.size() / 3, corners = input.corner_vertices.size(), triangles = input.triangle_corners.size() / 3;
    size_t faces = std::max(input.face_materials.size(), input.face_smooth.size());
    check_length(input, input.positions.size(), vertices * 3, "positions");
    check_length(input, input.triangle_corners.size(), triangles * 3, "triangle_corners");
    check_length(input, input.triangle_faces.size(), triangles, "triangle_faces");
    check_length(input, input.face_materials.size(), faces, "face_materials");
    check_length(input, input.face_smooth.size(), faces, "face_smooth");
    check_length(input, input.vertex_normals.size(), vertices * 3, "vertex_normals");
    check_length(input, input.corner_normals.size(), corners * 3, "corner_normals");
    check_below(input, input.corner_vertices, vertices, "corner_vertices");
    check_below(input, input.triangle_corners, corners, "triangle_corners");
    const bool identity_faces = input.triangle_faces.empty();
    for (const MeshInputAttribute& a : input.attributes) {
        if (a.domain == Domain::Face && faces == 0) faces = a.bytes.empty() ? a.floats.size() / size_t(std::max(a.components, 1)) : a.bytes.size() / 4;
    }
    if (faces != 0) {
        if (identity_faces && triangles > faces) throw mesh_error(input, "triangle_faces is missing");
        check_below(input, input.triangle_faces, faces, "triangle_faces");
    }

    Mesh mesh;
    if (input.subdivision.scheme != SubdivisionScheme::None) {
        faces = std::max(faces, input.face_starts.empty() ? 0 : input.face_starts.size() - 1);
        mesh.subdivision = build_cage(input, vertices, faces);
    }
    mesh.name = input.name;
    mesh.positions = copy_vectors(input.positions);
    mesh.active_uv = input.active_uv;
    mesh.active_color = input.active_color;
    mesh.generated_offset = input.generated_offset;
    mesh.generated_scale = input.generated_scale;

    // Attributes first: they decide which indices are worth keeping.
    bool has_corners = !input.corner_normals.empty(), has_faces = false;
    for (const MeshInputAttribute& a : input.attributes) {
        const size_t elements = a.domain == Domain::Vertex ? vertices : a.domain == Domain::Corner ? corners : faces;
        mesh.attributes.push_back(copy_attribute(a, elements, owner_of(input)));
        has_corners |= a.domain == Domain::Corner;
        has_faces |= a.domain == Domain::Face;
    }

    // Keep the triangles that can be seen.
    size_t broken = 0;
    bool any_flat = false, any_material = false;
    mesh.triangle_vertices.reserve(triangles * 3);
    if (has_corners) mesh.triangle_corners.reserve(triangles * 3);
    if (has_faces) mesh.triangle_faces.reserve(triangles);
    if (!input.face_materials.empty()) mesh.triangle_materials.reserve(triangles);
    if (!input.face_smooth.empty()) mesh.triangle_smooth.reserve(triangles);
    for (size_t t = 0; t < triangles; ++t) {
        const uint32_t* c = &input.triangle_corners[t * 3];
        const uint32_t v[3] = {input.corner_vertices[c[0]], input.corner_vertices[c[1]], input.corner_vertices[c[2]]};
        const Vec3 p[3] = {mesh.positions[v[0]], mesh.positions[v[1]], mesh.positions[v[2]]};
        if (!is_finite(p[0]) || !is_finite(p[1]) || !is_finite(p[2])) {
            ++broken;
            continue;
        }
        const auto area = area_vector(p[0], p[1], p[2]);
        if (area[0] == 0 && area[1] == 0 && area[2] == 0) continue;
        mesh.triangle_vertices.insert(mesh.triangle_vertices.end(), v, v + 3);
        if (has_corners) mesh.triangle_corners.insert(mesh.triangle_corners.end(), c, c + 3);
        const uint32_t face = identity_faces ? uint32_t(t) : input.triangle_faces[t];
        if (has_faces) mesh.triangle_faces.push_back(face);
        if (!input.face_materials.empty()) {
            const uint16_t slot = slot_of(input.face_materials[face]);
            mesh.triangle_materials.push_back(slot);
            any_material |= slot != 0;
        }
        if (!input.face_smooth.empty()) {
            mesh.triangle_smooth.push_back(input.face_smooth[face] ? 1 : 0);
            any_flat |= !input.face_smooth[face];
        }
    }
    if (!any_material) mesh.triangle_materials = {};
    if (!any_flat) mesh.triangle_smooth = {};
    if (broken > 0) {
        report.warning(std::to_string(broken) + " triangles have NaN or infinite vertices and are left out", "Mesh '" + input.name + "'");
        for (Vec3& p : mesh.positions) p = is_finite(p) ? p : Vec3{};
    }

    mesh.vertex_normals = copy_vectors(input.vertex_normals);
    mesh.corner_normals = copy_vectors(input.corner_normals);
    if (!mesh.corner_normals.empty()) repair_normals(mesh, mesh.triangle_corners, mesh.corner_normals);
    if (!mesh.vertex_normals.empty()) repair_normals(mesh, mesh.triangle_vertices, mesh.vertex_normals);
    return mesh;
}

bool repair_transform(Affine& map) {
    double column_length[3], largest = 0;
    for (int c = 0; c < 3; ++c) {
        double l2 = 0;
        for (int r = 0; r < 3; ++r) {
            if (!std::isfinite(map.m[r][c]) || !std::isfinite(map.m[r][3])) return false;
            l2 += double(map.m[r][c]) * map.m[r][c];
        }
        column_length[c] = std::sqrt(l2);
        largest = std::max(largest, column_length[c]);
    }
    if (largest == 0) return false;
    const auto column = [&](int c) { return std::array<double, 3>{map.m[0][c] / largest, map.m[1][c] / largest, map.m[2][c] / largest}; };
    const auto cross_of = [](const std::array<double, 3>& a, const std::array<double, 3>& b) {
        return std::array<double, 3>{a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
    };
    const auto dot_of = [](const std::array<double, 3>& a, const std::array<double, 3>& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; };
    const std::array<double, 3> a = column(0), b = column(1), c = column(2);
    // Cofactors: their rows are the cross products of the columns.
    const std::array<double, 3> cofactors[3] = {cross_of(b, c), cross_of(c, a), cross_of(a, b)};
    constexpr double kThin = 1e-6;
    double area = 0;
    int best = 0;
    for (int i = 0; i < 3; ++i) {
        const double l = std::sqrt(dot_of(cofactors[i], cofactors[i]));
        if (l > area) area = l, best = i;
    }
    if (area < kThin * kThin) return false;
    if (std::abs(dot_of(a, cofactors[0])) > kThin * kThin * area) return true;
    // Rank 2: m spans what the image lost, n (the null vector) what the object lost; adding m n^T restores an inverse.
    const std::array<double, 3>& m = cofactors[best];
    std::array<double, 3> n{};
    for (int i = 0; i < 3; ++i) n[size_t(i)] = dot_of(cofactors[i], m);
    const double n_length = std::sqrt(dot_of(n, n));
    for (int r = 0; r < 3; ++r) {
        for (int col = 0; col < 3; ++col) map.m[r][col] += float(kThin * largest * (m[size_t(r)] / area) * (n[size_t(col)] / n_length));
    }
    return true;
}

}  // namespace talbot::scene
