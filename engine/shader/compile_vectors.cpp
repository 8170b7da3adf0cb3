// Mapping, rotations, transforms, tangents, normal maps and bump.
#include "shader/catalogue.h"
#include "shader/closure_helpers.h"
#include "shader/graph_compiler.h"

namespace talbot::shader {
namespace {

/// Affine map of v by a 3x3 of values (row-major) and a translation; variant 2 turns the matrix round.
Value3 apply(Expressions& e, const std::array<Value, 9>& m, Value3 t, Value3 v, int variant) {
    return e.triple(
        e.emit(Op::Affine, uint8_t(variant), std::vector<Value>{m[0], m[1], m[2], t.x, m[3], m[4], m[5], t.y, m[6], m[7], m[8], t.z, v.x, v.y, v.z}, 3));
}

std::array<Value, 9> euler(Expressions& e, Value3 angles) {
    const Value zero = e.literal(0);
    const Value first = e.emit(Op::Vector, uint8_t(VectorKind::EulerMatrix), {angles.x, angles.y, angles.z}, 9);
    std::array<Value, 9> m;
    m.fill(zero);
    for (int i = 0; i < 9; ++i) m[size_t(i)] = e.after(first, i);
    return m;
}

/// R v, or the inverse; a rotation known to be none is left out of the program.
Value3 rotated(Expressions& e, Value3 angles, Value3 v, bool inverse) {
    if (e.is_zero(angles)) return v;
    return apply(e, euler(e, angles), e.literal3(0, 0, 0), v, inverse ? 2 : 1);
}

Value3 divide(Expressions& e, Value3 a, Value3 b) {
    return {e.div(a.x, b.x), e.div(a.y, b.y), e.div(a.z, b.z)};
}

void compile_mapping(NodeContext& n) {
    Expressions& e = n.e;
    const Value3 v = n.vector("Vector"), rotation = n.vector("Rotation"), scale = n.vector("Scale", {1, 1, 1});
    switch (n.choice("vector_type", {"POINT", "TEXTURE", "VECTOR", "NORMAL"})) {
        case 0:
            return n.set_vector("Vector", e.add(rotated(e, rotation, e.mul(v, scale), false), n.vector("Location")));
        case 1:
            return n.set_vector("Vector", divide(e, rotated(e, rotation, e.sub(v, n.vector("Location")), true), scale));
        case 2:
            return n.set_vector("Vector", rotated(e, rotation, e.mul(v, scale), false));
        default:
            return n.set_vector("Vector", e.normalize(rotated(e, rotation, divide(e, v, scale), false)));
    }
}

void compile_vector_rotate(NodeContext& n) {
    Expressions& e = n.e;
    const Value3 center = n.vector("Center"), v = e.sub(n.vector("Vector"), center);
    const int type = n.choice("rotation_type", {"AXIS_ANGLE", "X_AXIS", "Y_AXIS", "Z_AXIS", "EULER_XYZ"});
    const bool invert = n.flag("invert");
    if (type == 4) return n.set_vector("Vector", e.add(apply(e, euler(e, n.vector("Rotation")), e.literal3(0, 0, 0), v, invert ? 2 : 1), center));
    const Value angle = invert ? e.negate(n.value("Angle")) : n.value("Angle");
    const Value3 axis = type == 0 ? n.vector("Axis", {0, 0, 1}) : e.literal3(type == 1, type == 2, type == 3);
    n.set_vector("Vector", e.add(e.emit3(Op::Vector, uint8_t(VectorKind::RotateAxis), {v.x, v.y, v.z, axis.x, axis.y, axis.z, angle}), center));
}

void compile_vector_transform(NodeContext& n) {
    Expressions& e = n.e;
    Value3 v = n.vector("Vector", {0.5f, 0.5f, 0.5f});
    const int kind = n.choice("vector_type", {"POINT", "VECTOR", "NORMAL"}, 1);
    const int from = n.choice("convert_from", {"WORLD", "OBJECT", "CAMERA"}), to = n.choice("convert_to", {"WORLD", "OBJECT", "CAMERA"}, 1);
    static constexpr TransformKind inwards[] = {TransformKind::PointToObject, TransformKind::VectorToObject, TransformKind::NormalToObject};
    static constexpr TransformKind outwards[] = {TransformKind::PointToWorld, TransformKind::VectorToWorld, TransformKind::NormalToWorld};
    const int as = kind == 2 && n.semantics.normals_as_directions ? 1 : kind;
    const auto transform = [&](int space, TransformKind k) {
        if (space == 1) v = n.to_object(v, k);
        if (space == 2) v = e.emit3(Op::CameraTransform, uint8_t(k), {v.x, v.y, v.z});
    };
    if (from == to) return n.set_vector("Vector", kind == 2 && n.semantics.normals_as_directions ? e.normalize(v) : v);
    transform(from, outwards[as]);
    transform(to, inwards[as]);
    n.set_vector("Vector", kind == 2 ? e.normalize(v) : v);
}

void compile_normal(NodeContext& n) {
    Expressions& e = n.e;
    const scene::NodeOutput* stored = n.output("Normal");
    const Value3 direction = e.normalize(stored ? e.constant3(stored->value[0], stored->value[1], stored->value[2]) : e.literal3(0, 0, 1));
    n.set_vector("Normal", direction);
    n.set("Dot", e.dot(direction, e.normalize(n.vector("Normal", {0, 0, 1}))));
}

std::string tangent_name(NodeContext& n) {
    const std::string& map = n.text("uv_map");
    return map.empty() ? scene::kActiveTangent : "@tangent:" + map;
}

void compile_tangent(NodeContext& n) {
    Expressions& e = n.e;
    Value3 t;
    if (n.text("direction_type", "RADIAL") == "UV_MAP") {
        const auto a = n.attribute(tangent_name(n));
        t = {a[0], a[1], a[2]};
    } else {
        const Value3 g = n.generated(true);
        const Value x = e.add(g.x, -0.5f), y = e.add(g.y, -0.5f), z = e.add(g.z, -0.5f), zero = e.literal(0);
        const int axis = n.choice("axis", {"X", "Y", "Z"}, 2);
        t = axis == 0 ? Value3{zero, e.negate(z), y} : (axis == 1 ? Value3{e.negate(z), zero, x} : Value3{e.negate(y), x, zero});
    }
    const Value3 normal = n.shading_normal();
    n.set_vector("Tangent", e.cross(normal, e.normalize(e.cross(n.to_object(t, TransformKind::NormalToWorld), normal))));
}

void compile_normal_map(NodeContext& n) {
    Expressions& e = n.e;
    const int space = n.choice("space", {"TANGENT", "OBJECT", "WORLD", "BLENDER_OBJECT", "BLENDER_WORLD"});
    // In tangent space the strength scales the slope (and turns it round where it is negative), elsewhere it mixes normals.
    const bool scales_slope = space == 0 && n.semantics.normal_map_scales_slope;
    const Value strength = scales_slope ? n.value("Strength", 1) : e.max(n.value("Strength", 1), 0.0f);
    Value3 c = n.color("Color", {0.5f, 0.5f, 1});
    c = {e.add(e.mul(c.x, 2.0f), -1.0f), e.add(e.mul(c.y, 2.0f), -1.0f), e.add(e.mul(c.z, 2.0f), -1.0f)};
    if (n.text("convention", "OPENGL") == "DIRECTX") c.y = e.negate(c.y);
    const Value backfacing = e.input(InputColumn::Backfacing);
    const Value3 shading = n.shading_normal();
    const auto safe = [&](Value3 v) { return e.emit3(Op::Vector, uint8_t(VectorKind::SafeNormal), {v.x, v.y, v.z, shading.x, shading.y, shading.z}); };
    const auto towards_viewer = [&](Value3 v) { return e.select(backfacing, e.negate(v), v); };
    if (space == 0) {
        // In object space, on the unnormalised interpolated frame, as the map was baked [Mikkelsen 2008, "Simulation of Wrinkled Surfaces Revisited"].
        const auto a = n.attribute(tangent_name(n));
        const Value3 t{a[0], a[1], a[2]};
        const Value3 normal = e.emit3(Op::VertexNormal, 0, {n.barycentric_u(), n.barycentric_v()});
        const Value3 b = e.mul(e.cross(normal, t), a[3]);
        if (scales_slope) c = {e.mul(c.x, strength), e.mul(c.y, strength), e.lerp(e.literal(1), c.z, e.saturate(strength))};
        const Value3 object = e.normalize(e.add(e.add(e.mul(t, c.x), e.mul(b, c.y)), e.mul(normal, c.z)));
        Value3 world = towards_viewer(safe(n.to_object(object, TransformKind::NormalToWorld)));
        if (!scales_slope) world = safe(e.add(shading, e.mul(e.sub(world, shading), strength)));
        // Without tangents there is no frame: the surface's own normal stays.
        return n.set_vector("Normal", e.select(e.dot(t, t), world, shading));
    }
    if (space >= 3) c = {c.x, e.negate(c.y), e.negate(c.z)};
    const bool object = space == 1 || space == 3;
    const Value3 mapped = towards_viewer(e.normalize(object ? n.to_object(c, TransformKind::NormalToWorld) : c));
    n.set_vector("Normal", safe(e.add(shading, e.mul(e.sub(mapped, shading), strength))));
}

void compile_bump(NodeContext& n) {
    Expressions& e = n.e;
    const Value3 normal = n.normal();
    // Heights at shifted points see this node's plain normal, and without height nothing bends.
    if (n.shift != 0 || !n.linked("Height")) return n.set_vector("Normal", normal);
    const Value distance = n.value("Distance", 1);
    BumpRequest request;
    request.height = [](NodeContext& at) { return at.value("Height"); };
    request.normal = normal;
    request.strength = n.value("Strength", 1);
    request.distance = n.flag("invert") ? e.negate(distance) : distance;
    request.width = n.has("Filter Width") ? e.max(n.value("Filter Width", 1), 1e-3f) : e.literal(1);
    n.set_vector("Normal", bend_normal(n, request));
}

void compile_displacement(NodeContext& n) {
    // World-space offset along the normal; an object-space one is scaled with the object.
    Expressions& e = n.e;
    const Value amount = e.mul(e.sub(n.value("Height"), n.value("Midlevel", 0.5f)), n.value("Scale", 1));
    const Value3 normal = n.normal();
    if (n.text("space", "OBJECT") == "WORLD") return n.set_vector("Displacement", e.mul(normal, amount));
    const Value3 inside = e.mul(e.normalize(n.to_object(normal, TransformKind::NormalToObject)), amount);
    n.set_vector("Displacement", n.to_object(inside, TransformKind::VectorToWorld));
}

void compile_vector_displacement(NodeContext& n) {
    Expressions& e = n.e;
    const Value middle = n.value("Midlevel"), scale = n.value("Scale", 1);
    Value3 v = n.color("Vector");
    v = e.mul(e.sub(v, e.spread(middle)), scale);
    const int space = n.choice("space", {"TANGENT", "OBJECT", "WORLD"});
    if (space == 2) return n.set_vector("Displacement", v);
    if (space == 0) {
        // x along the tangent, y along the normal, z along the bitangent.
        const auto a = n.attribute(tangent_name(n));
        // Without tangents: along the triangle's edge.
        const Value has_tangent = e.dot({a[0], a[1], a[2]}, {a[0], a[1], a[2]});
        const Value3 edge =
            n.to_object(e.triple(e.emit(Op::CurveTangent, uint8_t(NoCurve::FirstEdge), std::span<const Value>{}, 3)), TransformKind::VectorToObject);
        const Value3 normal = e.normalize(n.to_object(n.shading_normal(), TransformKind::NormalToObject));
        const Value3 t = e.normalize(e.select(has_tangent, {a[0], a[1], a[2]}, edge));
        const Value3 b = e.mul(e.normalize(e.cross(normal, t)), e.select(has_tangent, a[3], e.literal(1)));
        v = e.add(e.add(e.mul(t, v.x), e.mul(normal, v.y)), e.mul(b, v.z));
    }
    n.set_vector("Displacement", n.to_object(v, TransformKind::VectorToWorld));
}

constexpr CatalogueEntry kEntries[] = {
    {"ShaderNodeMapping", compile_mapping},
    {"ShaderNodeVectorRotate", compile_vector_rotate},
    {"ShaderNodeVectorTransform", compile_vector_transform},
    {"ShaderNodeNormal", compile_normal},
    {"ShaderNodeTangent", compile_tangent},
    {"ShaderNodeNormalMap", compile_normal_map},
    {"ShaderNodeBump", compile_bump},
    {"ShaderNodeDisplacement", compile_displacement},
    {"ShaderNodeVectorDisplacement", compile_vector_displacement},
};

}  // namespace

namespace {

Value3 finished_bump(NodeContext& n, Value3 bent) {
    return n.semantics.bump_suits_reflections ? ClosureMaker(n).glossy_normal(bent) : bent;
}

}  // namespace

Value3 bend_normal(NodeContext& n, const BumpRequest& request) {
    Expressions& e = n.e;
    n.graph().values.has_bump = true;
    const Value3 p = e.input3(InputColumn::PositionX), g = n.geometric_normal();
    // The footprint, but not so small that rounding of the position shows.
    const Value floor = e.add(e.mul(e.length(p), 1e-5f), 1e-7f);
    const Value footprint = e.max(e.input(InputColumn::Footprint), e.div(floor, request.width));
    const Value basis = e.emit(Op::Vector, uint8_t(VectorKind::Basis), {g.x, g.y, g.z}, 6);
    const Value3 dx = e.mul(e.triple(basis), footprint), dy = e.mul(e.triple(e.after(basis, 3)), footprint);
    const auto height_at = [&](Value3 offset) {
        const Value uv = e.emit(Op::ShiftBarycentrics, 0, {offset.x, offset.y, offset.z}, 2);
        NodeContext shifted(n.graph(), n.index, n.graph().add_shift({offset, uv, e.after(uv, 1), {}}));
        return request.height(shifted);
    };
    const Value h = request.height(n), hx = height_at(e.mul(dx, request.width)), hy = height_at(e.mul(dy, request.width));
    const Value3& normal = request.normal;
    return finished_bump(n, e.triple(e.emit(Op::Bump, 0,
                                            std::vector<Value>{normal.x, normal.y, normal.z, dx.x, dx.y, dx.z, dy.x, dy.y, dy.z, h, hx, hy, request.strength,
                                                               request.distance, request.width},
                                            3)));
}

Value3 bend_undisplaced_normal(NodeContext& n, Value width) {
    // All in object space, where displacement left the undisplaced positions and normals.
    Expressions& e = n.e;
    n.graph().values.has_bump = true;
    const Value3 p = e.input3(InputColumn::PositionX), g = n.geometric_normal();
    const Value distance = e.length(p);
    const Value footprint = e.max(e.input(InputColumn::Footprint), e.div(e.add(e.mul(distance, 1e-5f), 1e-7f), width));
    const Value basis = e.emit(Op::Vector, uint8_t(VectorKind::Basis), {g.x, g.y, g.z}, 6);
    const Value3 x = e.triple(basis), y = e.triple(e.after(basis, 3));
    const auto barycentrics = [&](Value3 offset) { return e.emit(Op::ShiftBarycentrics, 0, {offset.x, offset.y, offset.z}, 2); };
    const auto undisplaced = [&](Value u, Value v) {
        return e.triple(e.emit(Op::Attribute, uint8_t(AttributeSource::Geometry), {u, v}, 5, uint32_t(n.graph().tables.attribute_id(scene::kUndisplaced))));
    };
    // How the undisplaced point follows the displaced one is the same all over the triangle's plane: taken over a way so long that rounding is small.
    const Value3 here = undisplaced(e.input(InputColumn::BarycentricU), e.input(InputColumn::BarycentricV));
    const Value reach = e.add(distance, footprint);
    const auto follow = [&](Value3 direction) {
        const Value uv = barycentrics(e.mul(direction, reach));
        const Value3 way = e.sub(undisplaced(uv, e.after(uv, 1)), here);
        return e.mul(way, e.div(footprint, reach));
    };
    const Value3 dx = follow(x), dy = follow(y);

    const auto field = [&](ObjectField f) { return e.emit(Op::ObjectValue, uint8_t(f), std::span<const Value>{}); };
    const Value3 face = e.normalize(e.cross(dx, dy));
    const Value3 flat = e.select(field(ObjectField::NegativeScale), e.negate(face), face);
    const Value3 smooth = e.normalize(n.to_object(e.input3(InputColumn::NormalX), TransformKind::NormalToObject));
    const Value3 normal = e.select(field(ObjectField::Smooth), smooth, flat);
    const Value3 world_normal = e.normalize(n.to_object(normal, TransformKind::NormalToWorld));
    const auto height_at = [&](Value3 offset) {
        const Value uv = barycentrics(offset);
        NodeContext shifted(n.graph(), n.index, n.graph().add_shift({offset, uv, e.after(uv, 1), world_normal}));
        return e.dot(n.to_object(shifted.vector("Displacement"), TransformKind::VectorToObject), normal);
    };
    const Value way = e.mul(footprint, width), zero = e.literal(0), one = e.literal(1);
    const Value h = height_at({zero, zero, zero}), hx = height_at(e.mul(x, way)), hy = height_at(e.mul(y, way));
    const Value3 bent =
        e.triple(e.emit(Op::Bump, 0, std::vector<Value>{normal.x, normal.y, normal.z, dx.x, dx.y, dx.z, dy.x, dy.y, dy.z, h, hx, hy, one, one, width}, 3));
    return finished_bump(n, e.normalize(n.to_object(bent, TransformKind::NormalToWorld)));
}

std::span<const CatalogueEntry> vector_nodes() {
    return kEntries;
}

}  // namespace talbot::shader
