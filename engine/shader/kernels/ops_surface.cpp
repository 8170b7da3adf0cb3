// What the geometry has at a shading point: attributes, generated coordinates, normals, tangents, and the barycentrics of points nearby.
#include "scene/curve.h"
#include "shader/kernels/lanes.h"

namespace talbot::shader {
inline namespace TALBOT_ISA {
namespace {

struct Triangle {
    uint32_t a, b, c;
};

TALBOT_INLINE Triangle corners_of(const uint32_t* table, int32_t primitive) {
    if (!table) return {uint32_t(3 * primitive), uint32_t(3 * primitive + 1), uint32_t(3 * primitive + 2)};
    const uint32_t* t = table + 3 * size_t(primitive);
    return {t[0], t[1], t[2]};
}

/// Values at curves' keys run from key to key; those of a curve or point stay.
TALBOT_INLINE void read_strand(const scene::AttributeView& a, const scene::MeshView& mesh, int32_t primitive, float u, float out[4]) {
    const size_t components = a.components;
    const bool curves = mesh.kind == scene::GeometryKind::Curves, keys = curves && a.domain == scene::Domain::Vertex;
    const size_t at = keys ? mesh.segment_keys[primitive] : curves ? mesh.segment_curves[primitive] : size_t(primitive);
    for (size_t k = 0; k < components && k < 4; ++k) {
        const float value = a.data[at * components + k];
        out[k] = keys ? lerp(value, a.data[(at + 1) * components + k], u) : value;
    }
}

TALBOT_INLINE void complete(size_t components, float out[5]) {
    if (components == 1) out[1] = out[2] = out[0];
    if (components < 4) out[3] = 1.0f;
    out[4] = components <= 2 ? out[0] : (out[0] + out[1] + out[2]) * (1.0f / 3.0f);
}

/// Attribute at barycentrics (u, v): four components, missing ones are 0, a missing fourth one is 1; and the number it stands for, of two components the
/// first, else the mean.
TALBOT_INLINE void read_attribute(const scene::AttributeView& a, const scene::MeshView* mesh, int32_t primitive, float u, float v, float out[5]) {
    out[0] = out[1] = out[2] = out[3] = out[4] = 0.0f;
    if (!a.data) return;
    size_t e[3] = {0, 0, 0};
    const size_t components = a.components;
    if (mesh && mesh->kind != scene::GeometryKind::Triangles && a.domain != scene::Domain::Object) {
        read_strand(a, *mesh, primitive, u, out);
        complete(components, out);
        return;
    }
    if (a.domain != scene::Domain::Object) {
        if (!mesh) return;
        if (a.domain == scene::Domain::Vertex || a.domain == scene::Domain::Corner) {
            const Triangle t = corners_of(a.domain == scene::Domain::Vertex ? mesh->triangle_vertices : mesh->triangle_corners, primitive);
            e[0] = t.a;
            e[1] = t.b;
            e[2] = t.c;
        } else {
            e[0] = e[1] = e[2] = a.domain == scene::Domain::Face && mesh->triangle_faces ? mesh->triangle_faces[primitive] : uint32_t(primitive);
        }
    }
    const float w = 1.0f - u - v;
    for (size_t k = 0; k < components && k < 4; ++k)
        out[k] = w * a.data[e[0] * components + k] + u * a.data[e[1] * components + k] + v * a.data[e[2] * components + k];
    complete(components, out);
}

/// As the mesh has it, unit.
TALBOT_INLINE Vec3 own_normal(const scene::MeshView& mesh, Vec3 n) {
    return mesh.has_mapped_normals ? normalize(n) : n;
}

}  // namespace

void op_attribute(const Instruction& i, Registers r, int n, const OpScope& s) {
    const int32_t id = int32_t(i.data);
    const AttributeSource source = AttributeSource(i.variant);
    const bool is_property = source == AttributeSource::Property || source == AttributeSource::PropertyOrLamp;
    const bool of_object = is_property || source == AttributeSource::Object;
    const scene::LampView* lamp = source == AttributeSource::PropertyOrLamp ? lamp_of(s) : nullptr;
    const bool opaque = source == AttributeSource::OpaqueGeometry || (is_property && !lamp && (s.span.is_lamp || s.span.is_background));
    for (int k = 0; k < s.span.n; ++k) {
        float value[5] = {0, 0, 0, opaque ? 1.0f : 0.0f, 0};
        const int32_t object = object_of(s, k);
        if (lamp && lamp->attributes && id < s.context.scene->attribute_count) {
            if (lamp->attributes[id].data) read_attribute(lamp->attributes[id], nullptr, 0, 0.0f, 0.0f, value);
        } else if (object >= 0 && id < s.context.scene->attribute_count) {
            const scene::MeshView* mesh = mesh_of(s, k);
            const scene::AttributeView* views = of_object ? scene::traits_of(*s.context.scene, object).attributes : mesh ? mesh->attributes : nullptr;
            if (views && views[id].data) read_attribute(views[id], mesh, mesh ? s.span.primitive[k] : 0, r[5][k], r[6][k], value);
        }
        for (int c = 0; c < 5; ++c) r[c][k] = value[c];
    }
    pad(r, 5, s.span.n, n);
}

void op_attribute_at(const Instruction& i, Registers r, int n, const OpScope& s) {
    const int32_t id = int32_t(i.data);
    const scene::SceneView* scene = s.context.scene;
    for (int k = 0; k < s.span.n; ++k) {
        float value[5] = {};
        const int32_t object = as_int(r[5][k]), primitive = as_int(r[6][k]);
        if (scene && object >= 0 && object < scene->object_count && id < scene->attribute_count && scene::traits_of(*scene, object).mesh >= 0) {
            const scene::MeshView& mesh = scene->meshes[scene::traits_of(*scene, object).mesh];
            if (mesh.attributes) read_attribute(mesh.attributes[id], &mesh, primitive, r[7][k], r[8][k], value);
        }
        for (int c = 0; c < 5; ++c) r[c][k] = value[c];
    }
    pad(r, 5, s.span.n, n);
}

void op_generated(const Instruction& i, Registers r, int n, const OpScope& s) {
    const int32_t id = int32_t(i.data);
    for (int k = 0; k < s.span.n; ++k) {
        Vec3 g{r[5][k], r[6][k], r[7][k]};
        if (const scene::MeshView* mesh = mesh_of(s, k)) {
            if (id < s.context.scene->attribute_count && mesh->attributes && mesh->attributes[id].data) {
                float value[5];
                read_attribute(mesh->attributes[id], mesh, s.span.primitive[k], r[3][k], r[4][k], value);
                g = {value[0], value[1], value[2]};
            } else if (i.variant == 1 && mesh->kind != scene::GeometryKind::Triangles) {
                g = transform_point(s.context.scene->objects[s.span.object[k]].to_world, g);
            } else {
                g = g * mesh->generated_scale + mesh->generated_offset;
            }
        }
        r[0][k] = g.x;
        r[1][k] = g.y;
        r[2][k] = g.z;
    }
    pad(r, 3, s.span.n, n);
}

void op_vertex_normal(Registers r, int n, const OpScope& s) {
    for (int k = 0; k < s.span.n; ++k) {
        Vec3 normal{0, 0, 1};
        const scene::MeshView* mesh = mesh_of(s, k);
        if (mesh && mesh->kind != scene::GeometryKind::Triangles) {
            normal = transform_normal(s.context.scene->objects[s.span.object[k]].to_world, load(s.span.n_g, k));
        } else if (mesh) {
            const int32_t primitive = s.span.primitive[k];
            const float u = r[3][k], v = r[4][k], w = 1.0f - u - v;
            const Triangle t = corners_of(mesh->triangle_vertices, primitive);
            const bool smooth = !mesh->triangle_smooth || mesh->triangle_smooth[primitive];
            if (smooth && mesh->corner_normals) {
                const Triangle c = corners_of(mesh->triangle_corners, primitive);
                normal = own_normal(*mesh, mesh->corner_normals[c.a]) * w + own_normal(*mesh, mesh->corner_normals[c.b]) * u +
                         own_normal(*mesh, mesh->corner_normals[c.c]) * v;
            } else if (smooth && mesh->vertex_normals) {
                normal = own_normal(*mesh, mesh->vertex_normals[t.a]) * w + own_normal(*mesh, mesh->vertex_normals[t.b]) * u +
                         own_normal(*mesh, mesh->vertex_normals[t.c]) * v;
            } else {
                const Vec3 a = mesh->positions[t.a];
                normal = normalize(cross(mesh->positions[t.b] - a, mesh->positions[t.c] - a));
            }
        }
        r[0][k] = normal.x;
        r[1][k] = normal.y;
        r[2][k] = normal.z;
    }
    pad(r, 3, s.span.n, n);
}

void op_shift_barycentrics(Registers r, int n, const OpScope& s) {
    // Least squares in the triangle's plane: offset = du (b - a) + dv (c - a).
    for (int k = 0; k < s.span.n; ++k) {
        float u = s.span.u ? s.span.u[k] : 0.0f, v = s.span.v ? s.span.v[k] : 0.0f;
        const scene::MeshView* mesh = mesh_of(s, k);
        if (mesh && mesh->kind == scene::GeometryKind::Curves) {
            const scene::CurveSegment curve = scene::curve_segment(*mesh, s.span.primitive[k], s.span.time ? s.span.time[k] : 0.5f);
            const Vec3 slope = curve_tangent(curve, u), d = transform_direction(s.context.scene->to_object[s.span.object[k]], Vec3{r[2][k], r[3][k], r[4][k]});
            u += dot(d, slope) / dot(slope, slope);
        } else if (mesh && mesh->kind == scene::GeometryKind::Triangles) {
            const Triangle t = corners_of(mesh->triangle_vertices, s.span.primitive[k]);
            const Vec3 a = mesh->positions[t.a], e1 = mesh->positions[t.b] - a, e2 = mesh->positions[t.c] - a;
            const Vec3 d = transform_direction(s.context.scene->to_object[s.span.object[k]], Vec3{r[2][k], r[3][k], r[4][k]});
            const float g11 = dot(e1, e1), g12 = dot(e1, e2), g22 = dot(e2, e2), d1 = dot(d, e1), d2 = dot(d, e2);
            const float det = g11 * g22 - g12 * g12;
            const float scale = det > 0.0f ? 1.0f / det : 0.0f;
            u += (g22 * d1 - g12 * d2) * scale;
            v += (g11 * d2 - g12 * d1) * scale;
        }
        r[0][k] = u;
        r[1][k] = v;
    }
    pad(r, 2, s.span.n, n);
}

void op_curve_tangent(const Instruction& instruction, Registers r, int n, const OpScope& s) {
    const NoCurve elsewhere = NoCurve(instruction.variant);
    const bool along_edge = elsewhere == NoCurve::FirstEdge || elsewhere == NoCurve::LastEdge;
    if (elsewhere == NoCurve::Given && s.context.scene && !s.context.scene->has_strands) {
        for (int c = 0; c < 3; ++c) std::memcpy(r[c], r[3 + c], size_t(n) * sizeof(float));
        return;
    }
    for (int k = 0; k < s.span.n; ++k) {
        const scene::MeshView* mesh = mesh_of(s, k);
        Vec3 tangent{};
        if (elsewhere == NoCurve::Given && !(mesh && mesh->kind == scene::GeometryKind::Points)) tangent = {r[3][k], r[4][k], r[5][k]};
        if (mesh && mesh->kind == scene::GeometryKind::Curves) {
            const scene::CurveSegment curve = scene::curve_segment(*mesh, s.span.primitive[k], s.span.time ? s.span.time[k] : 0.5f);
            tangent = normalize(transform_direction(s.context.scene->objects[s.span.object[k]].to_world, curve_tangent(curve, s.span.u[k])));
        } else if (mesh && along_edge && mesh->kind == scene::GeometryKind::Triangles) {
            const Triangle t = corners_of(mesh->triangle_vertices, s.span.primitive[k]);
            const Vec3 edge = mesh->positions[elsewhere == NoCurve::FirstEdge ? t.b : t.c] - mesh->positions[t.a];
            tangent = normalize(transform_direction(s.context.scene->objects[s.span.object[k]].to_world, edge));
        }
        r[0][k] = tangent.x;
        r[1][k] = tangent.y;
        r[2][k] = tangent.z;
    }
    pad(r, 3, s.span.n, n);
}

}  // namespace TALBOT_ISA
}  // namespace talbot::shader
