// What a shading point says without being looked up: span columns, constants, its object's values, random numbers. Gathers loop lane by lane over the
// span's own lanes.
#include "base/sobol.h"
#include "shader/kernels/lanes.h"

namespace talbot::shader {
inline namespace TALBOT_ISA {
namespace {

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

namespace {

float lamp_value(const scene::LampView& lamp, ObjectField field) {
    switch (field) {
        case ObjectField::LocationX:
            return lamp.location.x;
        case ObjectField::LocationY:
            return lamp.location.y;
        case ObjectField::LocationZ:
            return lamp.location.z;
        case ObjectField::ColorR:
        case ObjectField::ColorG:
        case ObjectField::ColorB:
        case ObjectField::Alpha:
            return lamp.color[int(field) - int(ObjectField::ColorR)];
        case ObjectField::Index:
            return float(lamp.pass_index);
        case ObjectField::Random:
            return float(lamp.random) * (1.0f / 4294967295.0f);
        default:
            return 0.0f;
    }
}

/// Root mean square of the scales along the axes.
float mean_scale(const Affine& t) {
    float sum = 0.0f;
    for (const auto& row : t.m) sum += row[0] * row[0] + row[1] * row[1] + row[2] * row[2];
    return std::sqrt(sum / 3.0f);
}

}  // namespace

void op_object_value(const Instruction& i, Registers r, int n, const OpScope& s) {
    const ObjectField field = ObjectField(i.variant);
    const OfLamps of_lamps = OfLamps(i.data);
    const scene::LampView* lamp = of_lamps == OfLamps::All || (of_lamps == OfLamps::Random && field == ObjectField::Random) ? lamp_of(s) : nullptr;
    if (lamp) return fill(r[0], n, lamp_value(*lamp, field));
    const bool asks_strands = field == ObjectField::IsCurve || field == ObjectField::IsRibbon || field == ObjectField::IsPoint;
    if (asks_strands && s.context.scene && !s.context.scene->has_strands) return fill(r[0], n, 0.0f);
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
                case ObjectField::MeanScale:
                    x = mean_scale(o.to_world);
                    break;
                case ObjectField::AppliedScale: {
                    const scene::MeshView* mesh = mesh_of(s, k);
                    const bool applied = mesh && mesh->stands_alone && (mesh->kind == scene::GeometryKind::Points || keeps_angles(o.to_world));
                    x = applied ? std::cbrt(std::fabs(determinant(o.to_world))) : 1.0f;
                    break;
                }
                case ObjectField::IsCurve:
                case ObjectField::IsRibbon:
                case ObjectField::IsPoint: {
                    const scene::MeshView* mesh = mesh_of(s, k);
                    const auto kind = field == ObjectField::IsPoint ? scene::GeometryKind::Points : scene::GeometryKind::Curves;
                    const bool other_shape = field == ObjectField::IsRibbon && mesh && mesh->curve_shape != scene::CurveShape::Ribbon;
                    x = mesh && mesh->kind == kind && !other_shape ? 1.0f : 0.0f;
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
