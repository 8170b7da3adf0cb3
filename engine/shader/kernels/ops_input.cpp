// What the shading point is: span columns, constants, transforms, attributes. Gathers loop lane by lane over the span's own lanes; the
// padding repeats the last one, so that later operations see ordinary numbers there.
#include "base/sobol.h"
#include "scene/curve.h"
#include "shader/kernels/ops.h"

namespace talbot::shader {
inline namespace TALBOT_ISA {
namespace {

TALBOT_INLINE void pad(Registers r, int columns, int lanes, int n) {
    for (int k = 0; k < columns; ++k) {
        const float last = lanes > 0 ? r[k][lanes - 1] : 0.0f;
        for (int i = lanes; i < n; ++i) r[k][i] = last;
    }
}

TALBOT_INLINE void read_float(const float* from, Registers r, int lanes, int n) {
    if (from) {
        std::memcpy(r[0], from, size_t(lanes) * sizeof(float));
    } else {
        fill(r[0], lanes, 0.0f);
    }
    pad(r, 1, lanes, n);
}

TALBOT_INLINE void read_int(const int32_t* from, Registers r, int lanes, int n) {
    Column o = r[0];
    for (int i = 0; i < lanes; ++i) o[i] = from ? float(from[i]) : 0.0f;
    pad(r, 1, lanes, n);
}

TALBOT_INLINE void read_flag(const int32_t* flags, int32_t bit, Registers r, int lanes, int n) {
    Column o = r[0];
    for (int i = 0; i < lanes; ++i) o[i] = flags && (flags[i] & bit) ? 1.0f : 0.0f;
    pad(r, 1, lanes, n);
}

TALBOT_INLINE int32_t object_of(const OpScope& s, int lane) {
    const bool on_object = s.span.object && s.context.scene && !s.span.is_background && !s.span.is_lamp;
    const int32_t object = on_object ? s.span.object[lane] : -1;
    return s.context.scene && object < s.context.scene->object_count ? object : -1;
}

/// The lane's mesh, null for none.
TALBOT_INLINE const scene::MeshView* mesh_of(const OpScope& s, int lane) {
    const int32_t object = object_of(s, lane);
    if (object < 0) return nullptr;
    const int32_t mesh = scene::traits_of(*s.context.scene, object).mesh;
    if (mesh < 0 || !s.span.primitive || s.span.primitive[lane] < 0) return nullptr;
    return &s.context.scene->meshes[mesh];
}

struct Triangle {
    uint32_t a, b, c;
};
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

TALBOT_INLINE Triangle corners_of(const uint32_t* table, int32_t primitive) {
    if (!table) return {uint32_t(3 * primitive), uint32_t(3 * primitive + 1), uint32_t(3 * primitive + 2)};
    const uint32_t* t = table + 3 * size_t(primitive);
    return {t[0], t[1], t[2]};
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

TALBOT_INLINE Vec3 transform(const Affine& to_world, const Affine& to_object, TransformKind kind, Vec3 v) {
    switch (kind) {
        case TransformKind::PointToObject:
            return transform_point(to_object, v);
        case TransformKind::VectorToObject:
            return transform_direction(to_object, v);
        case TransformKind::NormalToObject:
            return transform_normal(to_world, v);
        case TransformKind::PointToWorld:
            return transform_point(to_world, v);
        case TransformKind::VectorToWorld:
            return transform_direction(to_world, v);
        case TransformKind::NormalToWorld:
            return transform_normal(to_object, v);
    }
    return v;
}

}  // namespace

void op_constant(const Instruction& i, Registers r, int n, const OpScope& s) {
    Column o = r[0];
    const float* constants = s.programs.constants.data() + i.data;
    if (s.span.uniform_constants && s.span.n > 0) {
        fill(o, n, constants[s.span.constants[0]]);
        return;
    }
    ConstIntColumn offset = s.span.constants;
    for (int k = 0; k < s.span.n; ++k) o[k] = constants[offset[k]];
    pad(r, 1, s.span.n, n);
}

void op_input(const Instruction& i, Registers r, int n, const OpScope& s) {
    const ShadingSpan& p = s.span;
    const int lanes = p.n;
    switch (InputColumn(i.variant)) {
        case InputColumn::PositionX:
            return read_float(p.p.x, r, lanes, n);
        case InputColumn::PositionY:
            return read_float(p.p.y, r, lanes, n);
        case InputColumn::PositionZ:
            return read_float(p.p.z, r, lanes, n);
        case InputColumn::NormalX:
            return read_float(p.n_s.x, r, lanes, n);
        case InputColumn::NormalY:
            return read_float(p.n_s.y, r, lanes, n);
        case InputColumn::NormalZ:
            return read_float(p.n_s.z, r, lanes, n);
        case InputColumn::GeometricX:
            return read_float(p.n_g.x, r, lanes, n);
        case InputColumn::GeometricY:
            return read_float(p.n_g.y, r, lanes, n);
        case InputColumn::GeometricZ:
            return read_float(p.n_g.z, r, lanes, n);
        case InputColumn::IncomingX:
            return read_float(p.wo.x, r, lanes, n);
        case InputColumn::IncomingY:
            return read_float(p.wo.y, r, lanes, n);
        case InputColumn::IncomingZ:
            return read_float(p.wo.z, r, lanes, n);
        case InputColumn::BarycentricU:
            return read_float(p.u, r, lanes, n);
        case InputColumn::BarycentricV:
            return read_float(p.v, r, lanes, n);
        case InputColumn::RayLength:
            return read_float(p.ray_length, r, lanes, n);
        case InputColumn::Footprint:
            return read_float(p.footprint, r, lanes, n);
        case InputColumn::Backfacing:
            return read_int(p.backfacing, r, lanes, n);
        case InputColumn::IsCamera:
            return read_flag(p.ray_flags, kRayCamera, r, lanes, n);
        case InputColumn::IsDiffuse:
            return read_flag(p.ray_flags, kRayDiffuse, r, lanes, n);
        case InputColumn::IsGlossy:
            return read_flag(p.ray_flags, kRayGlossy, r, lanes, n);
        case InputColumn::IsTransmission:
            return read_flag(p.ray_flags, kRayTransmission, r, lanes, n);
        case InputColumn::IsReflection:
            return read_flag(p.ray_flags, kRayReflection, r, lanes, n);
        case InputColumn::IsSingular:
            return read_flag(p.ray_flags, kRaySingular, r, lanes, n);
        case InputColumn::IsShadow:
            return read_flag(p.ray_flags, kRayShadow, r, lanes, n);
        case InputColumn::IsVolumeScatter:
            return read_flag(p.ray_flags, kRayVolumeScatter, r, lanes, n);
        case InputColumn::Depth:
            return read_int(p.depth, r, lanes, n);
        case InputColumn::DiffuseDepth:
            return read_int(p.diffuse_depth, r, lanes, n);
        case InputColumn::GlossyDepth:
            return read_int(p.glossy_depth, r, lanes, n);
        case InputColumn::TransparentDepth:
            return read_int(p.transparent_depth, r, lanes, n);
        case InputColumn::TransmissionDepth:
            return read_int(p.transmission_depth, r, lanes, n);
        case InputColumn::IsBackground:
            return fill(r[0], n, p.is_background ? 1.0f : 0.0f);
        case InputColumn::IsLamp:
            return fill(r[0], n, p.is_lamp ? 1.0f : 0.0f);
    }
}

void op_object_transform(const Instruction& i, Registers r, int n, const OpScope& s) {
    const TransformKind kind = TransformKind(i.variant & (kNotOfLamps - 1));
    const bool of_lamps = !(i.variant & kNotOfLamps);
    for (int k = 0; k < s.span.n; ++k) {
        Vec3 v{r[3][k], r[4][k], r[5][k]};
        const int32_t object = object_of(s, k);
        if (object >= 0) {
            const scene::Placement placed = scene::placement_at(*s.context.scene, object, s.span.time ? s.span.time[k] : 0.5f);
            v = transform(placed.to_world, placed.to_object, kind, v);
        } else if (of_lamps && s.span.is_lamp && s.span.lamp_to_world) {
            v = transform(*s.span.lamp_to_world, *s.span.lamp_to_object, kind, v);
        }
        r[0][k] = v.x;
        r[1][k] = v.y;
        r[2][k] = v.z;
    }
    pad(r, 3, s.span.n, n);
}

void op_camera_transform(const Instruction& i, Registers r, int n, const OpScope& s) {
    Affine to_world;
    if (s.context.scene && s.context.scene->camera) to_world = s.context.scene->camera->to_world;
    // Camera space here has +Z forward.
    for (auto& row : to_world.m) row[2] = -row[2];
    const Affine to_camera = inverse(to_world);
    TransformKind kind = TransformKind(i.variant);
    // A background's position is a direction: the camera stands in its middle.
    if (s.span.is_background && kind == TransformKind::PointToObject) kind = TransformKind::VectorToObject;
    for (int k = 0; k < n; ++k) {
        const Vec3 v = transform(to_world, to_camera, kind, Vec3{r[3][k], r[4][k], r[5][k]});
        r[0][k] = v.x;
        r[1][k] = v.y;
        r[2][k] = v.z;
    }
}

namespace {

/// Distance from the middle of a fisheye's film to what it sees at `theta` from the axis: Newton's method.
float polynomial_radius(const float* k, float theta) {
    float r = k[1] != 0.0f ? -(theta + k[0]) / k[1] : 0.0f;
    for (int i = 0; i < 20; ++i) {
        const float value = theta + k[0] + r * (k[1] + r * (k[2] + r * (k[3] + r * k[4])));
        const float slope = k[1] + r * (2.0f * k[2] + r * (3.0f * k[3] + r * 4.0f * k[4]));
        if (slope == 0.0f || std::fabs(value) < 1e-7f) break;
        r -= value / slope;
    }
    return r;
}

/// Where a panoramic camera's film sees a unit direction of camera space: what its rays are made by, turned round.
Vec2 panorama_window(const scene::Camera& camera, Vec3 direction) {
    using scene::PanoramaType;
    const Vec3 p{-direction.z, -direction.x, direction.y};  // +X is the axis, +Z up
    const float across = std::atan2(p.y, p.x), side = std::sqrt(p.y * p.y + p.z * p.z), theta = std::acos(clampf(p.x, -1.0f, 1.0f));
    const Vec2 around = side > 0.0f ? Vec2{-p.y / side, p.z / side} : Vec2{1, 0};
    const auto share = [](float x, float from, float to) { return to != from ? (x - from) / (to - from) : 0.0f; };
    const auto on_sensor = [&](float r) { return Vec2{0.5f + r * around.x / camera.sensor_width_mm, 0.5f + r * around.y / camera.sensor_height_mm}; };
    switch (camera.panorama) {
        case PanoramaType::Equirectangular:
            return {share(across, -camera.longitude_min, -camera.longitude_max),
                    share(std::acos(clampf(p.z, -1.0f, 1.0f)), kPi / 2 - camera.latitude_min, kPi / 2 - camera.latitude_max)};
        case PanoramaType::EquiangularCubemap:
            return {0.5f - across * (2 / kPi), 0.5f + std::atan2(p.z, p.x) * (2 / kPi)};
        case PanoramaType::Mirrorball: {
            const Vec3 half{-p.y, -p.x - 1.0f, p.z};
            const float size = length(half), scale = size > 0.0f ? 0.5f / size : 0.0f;
            return {0.5f + half.x * scale, 0.5f + half.z * scale};
        }
        case PanoramaType::FisheyeEquidistant: {
            const float r = camera.fov != 0.0f ? theta / camera.fov : 0.0f;
            return {0.5f + r * around.x, 0.5f + r * around.y};
        }
        case PanoramaType::FisheyeEquisolid:
            return on_sensor(2.0f * camera.lens_mm * std::sin(theta * 0.5f));
        case PanoramaType::FisheyePolynomial:
            return on_sensor(polynomial_radius(camera.polynomial, theta));
        case PanoramaType::CentralCylindrical: {
            const float flat = std::sqrt(p.x * p.x + p.y * p.y);
            return {share(across, -camera.cylinder[0], -camera.cylinder[1]), share(flat > 0.0f ? p.z / flat : 0.0f, camera.cylinder[2], camera.cylinder[3])};
        }
    }
    return {};
}

}  // namespace

void op_window(const Instruction& i, Registers r, int n, const OpScope& s) {
    // World position -> place on the whole film, 0..1 from the bottom left.
    static constexpr scene::Camera kNoCamera{};
    const scene::Camera& camera = s.context.scene && s.context.scene->camera ? *s.context.scene->camera : kNoCamera;
    const Affine to_camera = inverse(camera.to_world);
    if (camera.type == scene::CameraType::Panoramic) {
        using scene::PanoramaType;
        const bool fisheye = camera.panorama == PanoramaType::FisheyeEquidistant || camera.panorama == PanoramaType::FisheyeEquisolid;
        const bool mirrored = i.variant == 1 && fisheye;
        for (int k = 0; k < n; ++k) {
            const Vec3 p{r[2][k], r[3][k], r[4][k]};
            const Vec2 at = panorama_window(camera, normalize(s.span.is_background ? transform_direction(to_camera, p) : transform_point(to_camera, p)));
            r[0][k] = mirrored ? 1.0f - at.x : at.x;
            r[1][k] = at.y;
        }
        return;
    }
    const float width = camera.view[1] - camera.view[0], height = camera.view[3] - camera.view[2];
    const bool flat = camera.type == scene::CameraType::Orthographic;
    for (int k = 0; k < n; ++k) {
        const Vec3 p{r[2][k], r[3][k], r[4][k]};
        const Vec3 c = s.span.is_background ? transform_direction(to_camera, p) : transform_point(to_camera, p);
        const float depth = flat ? 1.0f : -c.z;
        const float scale = depth != 0.0f ? 1.0f / depth : 0.0f;
        r[0][k] = width != 0.0f ? (c.x * scale - camera.view[0]) / width : 0.0f;
        r[1][k] = height != 0.0f ? (c.y * scale - camera.view[2]) / height : 0.0f;
    }
}

void op_attribute(const Instruction& i, Registers r, int n, const OpScope& s) {
    const int32_t id = int32_t(i.data);
    const AttributeSource source = AttributeSource(i.variant);
    const float missing_alpha = source == AttributeSource::OpaqueGeometry ? 1.0f : 0.0f;
    for (int k = 0; k < s.span.n; ++k) {
        float value[5] = {0, 0, 0, missing_alpha, 0};
        const int32_t object = object_of(s, k);
        if (object >= 0 && id < s.context.scene->attribute_count) {
            const scene::MeshView* mesh = mesh_of(s, k);
            const scene::AttributeView* views = source == AttributeSource::Object ? scene::traits_of(*s.context.scene, object).attributes
                                                : mesh                            ? mesh->attributes
                                                                                  : nullptr;
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

/// As the mesh has it, unit.
TALBOT_INLINE Vec3 own_normal(const scene::MeshView& mesh, Vec3 n) {
    return mesh.has_mapped_normals ? normalize(n) : n;
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

void op_object_value(const Instruction& i, Registers r, int n, const OpScope& s) {
    const ObjectField field = ObjectField(i.variant);
    for (int k = 0; k < s.span.n; ++k) {
        const int32_t object = object_of(s, k);
        float x = 0.0f;
        if (object >= 0) {
            const scene::SceneView& scene = *s.context.scene;
            const scene::Object& o = scene.objects[object];
            switch (field) {
                case ObjectField::LocationX:
                case ObjectField::LocationY:
                case ObjectField::LocationZ:
                    x = o.to_world.m[int(field)][3];
                    break;
                case ObjectField::ColorR:
                case ObjectField::ColorG:
                case ObjectField::ColorB:
                case ObjectField::Alpha:
                    x = scene::traits_of(scene, object).color[int(field) - int(ObjectField::ColorR)];
                    break;
                case ObjectField::Index:
                    x = float(scene::traits_of(scene, object).pass_index);
                    break;
                case ObjectField::Random:
                    x = float(o.random) * (1.0f / 4294967295.0f);
                    break;
                case ObjectField::NegativeScale:
                    x = determinant(o.to_world) < 0.0f ? 1.0f : 0.0f;
                    break;
                case ObjectField::IsCurve:
                case ObjectField::IsPoint: {
                    const scene::MeshView* mesh = mesh_of(s, k);
                    const auto kind = field == ObjectField::IsCurve ? scene::GeometryKind::Curves : scene::GeometryKind::Points;
                    x = mesh && mesh->kind == kind ? 1.0f : 0.0f;
                    break;
                }
                case ObjectField::Smooth: {
                    const scene::MeshView* mesh = mesh_of(s, k);
                    x = mesh && (!mesh->triangle_smooth || mesh->triangle_smooth[s.span.primitive[k]]) ? 1.0f : 0.0f;
                    break;
                }
            }
        }
        r[0][k] = x;
    }
    pad(r, 1, s.span.n, n);
}

void op_instancer(Registers r, int n, const OpScope& s) {
    for (int k = 0; k < s.span.n; ++k) {
        const int32_t object = object_of(s, k);
        const scene::Dupli dupli = object >= 0 && s.context.scene->duplis ? s.context.scene->duplis[object] : scene::Dupli{};
        r[0][k] = dupli.generated.x;
        r[1][k] = dupli.generated.y;
        r[2][k] = dupli.generated.z;
        r[3][k] = dupli.uv.x;
        r[4][k] = dupli.uv.y;
    }
    pad(r, 5, s.span.n, n);
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
    for (int k = 0; k < s.span.n; ++k) {
        Vec3 tangent{};
        const scene::MeshView* mesh = mesh_of(s, k);
        if (mesh && mesh->kind == scene::GeometryKind::Curves) {
            const scene::CurveSegment curve = scene::curve_segment(*mesh, s.span.primitive[k], s.span.time ? s.span.time[k] : 0.5f);
            tangent = normalize(transform_direction(s.context.scene->objects[s.span.object[k]].to_world, curve_tangent(curve, s.span.u[k])));
        } else if (mesh && instruction.variant != 0 && mesh->kind == scene::GeometryKind::Triangles) {
            const Triangle t = corners_of(mesh->triangle_vertices, s.span.primitive[k]);
            const Vec3 edge = mesh->positions[instruction.variant == 1 ? t.b : t.c] - mesh->positions[t.a];
            tangent = normalize(transform_direction(s.context.scene->objects[s.span.object[k]].to_world, edge));
        }
        r[0][k] = tangent.x;
        r[1][k] = tangent.y;
        r[2][k] = tangent.z;
    }
    pad(r, 3, s.span.n, n);
}

void op_random(const Instruction& i, Registers r, int n, const OpScope& s) {
    for (int k = 0; k < s.span.n; ++k) {
        const uint32_t key = s.span.key ? s.span.key[k] : 0u, sample = s.span.sample ? s.span.sample[k] : 0u;
        const uint32_t vertex = s.span.vertex ? s.span.vertex[k] : 0u;
        const Vec2 uv = sample_pair(hash_combine(key, i.data), sample, pair_dimension(vertex, Pair::Shader));
        r[0][k] = uv.x;
        r[1][k] = uv.y;
    }
    pad(r, 2, s.span.n, n);
}

}  // namespace TALBOT_ISA
}  // namespace talbot::shader
