// Nodes that read the shading point, the object, the path or stored values.
#include "base/hash.h"
#include "shader/catalogue.h"
#include "shader/graph_compiler.h"

namespace talbot::shader {
namespace {

using I = InputColumn;

void compile_value(NodeContext& n) {
    const scene::NodeOutput* output = n.output("Value");
    n.set("Value", n.e.constant(output ? output->value[0] : 0.0f));
}

void compile_rgb(NodeContext& n) {
    const scene::NodeOutput* output = n.output("Color");
    n.set_color("Color", output ? n.e.constant3(output->value[0], output->value[1], output->value[2]) : n.e.literal3(0, 0, 0));
}

/// What Blender's inliner (5.0 and newer) makes of a constant vector whose socket holds no value of its own.
void compile_input_vector(NodeContext& n) {
    const std::vector<float>* v = n.table("vector");
    n.set_vector("Vector", v && v->size() == 3 ? n.e.constant3((*v)[0], (*v)[1], (*v)[2]) : n.e.literal3(0, 0, 0));
}

/// The frame's time is stored on the outputs.
void compile_scene_time(NodeContext& n) {
    for (const char* name : {"Seconds", "Frame"})
        if (const scene::NodeOutput* output = n.output(name)) n.set(name, n.e.constant(output->value[0]));
}

/// Coordinates on a lamp are its own parameters; a background has none.
Value3 uv_coordinates(NodeContext& n, const std::string& name) {
    Expressions& e = n.e;
    const auto map = n.attribute(name);
    if (!n.semantics.lamps_have_uv) return {map[0], map[1], e.literal(0)};
    const Value u = n.barycentric_u(), v = n.barycentric_v();
    const Value on_lamp = e.input(I::IsLamp);
    return {e.select(on_lamp, e.sub(e.sub(e.literal(1), u), v), map[0]), e.select(on_lamp, u, map[1]), e.literal(0)};
}

void compile_texture_coordinate(NodeContext& n) {
    Expressions& e = n.e;
    const Value3 p = n.position(), normal = n.shading_normal(), wo = n.incoming();
    const bool from_instancer = n.flag("from_instancer");
    if (n.output_linked("Generated") || n.output_linked("UV")) {
        const Value dupli = e.emit(Op::Instancer, 0, std::span<const Value>{}, 5);
        n.set_vector("Generated", from_instancer ? e.triple(dupli) : n.generated());
        n.set_vector("UV", from_instancer ? Value3{e.after(dupli, 3), e.after(dupli, 4), e.literal(0)} : uv_coordinates(n, scene::kActiveUv));
    }
    n.set_vector("Normal", e.normalize(n.to_object(normal, TransformKind::NormalToObject)));
    const std::vector<float>* object = n.table("object_matrix");
    n.set_vector("Object", object && object->size() == 12 ? n.affine(*object, p, 0) : n.to_object(p, TransformKind::PointToObject));
    const uint8_t around_lamps = n.semantics.lamps_have_space ? 0 : kAroundLamps;
    n.set_vector("Camera", e.emit3(Op::CameraTransform, uint8_t(TransformKind::PointToObject) | kAroundBackground | around_lamps, {p.x, p.y, p.z}));
    if (n.output_linked("Window")) {
        const scene::Camera& camera = n.graph().scene.camera;
        const bool polynomial = camera.type == scene::CameraType::Panoramic && camera.panorama == scene::PanoramaType::FisheyePolynomial;
        if (polynomial && !n.semantics.polynomial_window) n.warn("Window coordinates of a fisheye lens polynomial are those of newer versions");
        const Value window = e.emit(Op::Window, uint8_t(n.semantics.fisheye_window_mirrored ? 1 : 0) | around_lamps, {p.x, p.y, p.z}, 2);
        n.set_vector("Window", {window, e.after(window, 1), e.literal(0)});
    }
    // Mirror direction of the viewer; in the background there is no surface to mirror, and lamps became objects late.
    Value3 mirrored = e.sub(e.mul(normal, e.mul(e.dot(normal, wo), 2.0f)), wo);
    if (!n.semantics.lamps_have_space) mirrored = e.select(e.input(I::IsLamp), wo, mirrored);
    n.set_vector("Reflection", e.select(e.input(I::IsBackground), wo, mirrored));
}

void compile_uv_map(NodeContext& n) {
    const std::string& name = n.text("uv_map");
    if (n.flag("from_instancer")) {
        const Value dupli = n.e.emit(Op::Instancer, 0, std::span<const Value>{}, 5);
        return n.set_vector("UV", {n.e.after(dupli, 3), n.e.after(dupli, 4), n.e.literal(0)});
    }
    n.set_vector("UV", uv_coordinates(n, name.empty() ? scene::kActiveUv : name));
}

void compile_geometry(NodeContext& n) {
    Expressions& e = n.e;
    n.set_vector("Position", n.position());
    n.set_vector("Normal", n.shading_normal());
    // Lamps and backgrounds have none.
    const Value on_surface = e.mul(e.one_minus(e.input(I::IsBackground)), e.one_minus(e.input(I::IsLamp)));
    n.set_vector("Tangent", e.mul(n.tangent(""), on_surface));
    // A ribbon is flat and faces the viewer.
    const Value is_ribbon = e.emit(Op::ObjectValue, uint8_t(ObjectField::IsRibbon), std::span<const Value>{});
    n.set_vector("True Normal", e.select(is_ribbon, n.incoming(), n.geometric_normal()));
    n.set_vector("Incoming", n.incoming());
    const Value u = n.barycentric_u(), v = n.barycentric_v();
    n.set_vector("Parametric", {e.sub(e.sub(e.literal(1), u), v), u, e.literal(0)});
    n.set("Backfacing", e.input(I::Backfacing));
    if (n.output_linked("Pointiness")) n.set("Pointiness", n.attribute("@pointiness")[0]);
    if (n.output_linked("Random Per Island")) n.set("Random Per Island", n.attribute("@island")[0]);
}

void compile_object_info(NodeContext& n) {
    Expressions& e = n.e;
    const uint32_t of_lamps = uint32_t(n.semantics.lamps_have_space ? OfLamps::All : OfLamps::Random);
    const auto field = [&](ObjectField f) { return e.emit(Op::ObjectValue, uint8_t(f), std::span<const Value>{}, 1, of_lamps); };
    n.set_vector("Location", {field(ObjectField::LocationX), field(ObjectField::LocationY), field(ObjectField::LocationZ)});
    n.set_color("Color", {field(ObjectField::ColorR), field(ObjectField::ColorG), field(ObjectField::ColorB)});
    n.set("Alpha", field(ObjectField::Alpha));
    n.set("Object Index", field(ObjectField::Index));
    n.set("Material Index", e.constant(float(n.graph().shader.pass_index)));
    n.set("Random", field(ObjectField::Random));
}

void set_attribute(NodeContext& n, const std::array<Value, 5>& a) {
    const Value3 rgb{a[0], a[1], a[2]};
    n.set_color("Color", rgb);
    n.set_vector("Vector", rgb);
    n.set("Fac", a[4]);
    n.set("Alpha", a[3]);
}

/// Of the view layer: the same everywhere, so the synchronisation stores the values themselves.
void compile_layer_attribute(NodeContext& n) {
    static const std::vector<float> missing(5, 0.0f);
    const std::vector<float>* found = n.table("layer_value");
    const std::vector<float>& v = found && found->size() == 5 ? *found : missing;
    set_attribute(n, {n.e.constant(v[0]), n.e.constant(v[1]), n.e.constant(v[2]), n.e.constant(v[3]), n.e.constant(v[4])});
}

void compile_attribute(NodeContext& n) {
    const int type = n.choice("attribute_type", {"GEOMETRY", "OBJECT", "INSTANCER", "VIEW_LAYER"});
    const std::string& name = n.text("attribute_name");
    if (type == 0) return set_attribute(n, n.attribute(name, AttributeSource::OpaqueGeometry));
    if (type == 3) return compile_layer_attribute(n);
    const AttributeSource source = n.semantics.lamps_have_space ? AttributeSource::PropertyOrLamp : AttributeSource::Property;
    std::array<Value, 5> a = n.attribute((type == 1 ? scene::kOfObject : scene::kOfInstancer) + name, source);
    if (!n.semantics.points_have_properties) {
        const Value is_point = n.e.emit(Op::ObjectValue, uint8_t(ObjectField::IsPoint), std::span<const Value>{});
        for (Value& v : a) v = n.e.select(is_point, n.e.literal(0), v);
    }
    set_attribute(n, a);
}

void compile_color_attribute(NodeContext& n) {
    const std::string& name = n.text("layer_name");
    set_attribute(n, n.attribute(name.empty() ? scene::kActiveColor : name));
}

void compile_light_path(NodeContext& n) {
    Expressions& e = n.e;
    static constexpr std::pair<const char*, I> outputs[] = {
        {"Is Camera Ray", I::IsCamera},
        {"Is Shadow Ray", I::IsShadow},
        {"Is Diffuse Ray", I::IsDiffuse},
        {"Is Glossy Ray", I::IsGlossy},
        {"Is Singular Ray", I::IsSingular},
        {"Is Reflection Ray", I::IsReflection},
        {"Is Transmission Ray", I::IsTransmission},
        {"Is Volume Scatter Ray", I::IsVolumeScatter},
        {"Ray Length", I::RayLength},
        {"Ray Depth", I::Depth},
        {"Diffuse Depth", I::DiffuseDepth},
        {"Glossy Depth", I::GlossyDepth},
        {"Transparent Depth", I::TransparentDepth},
        {"Transmission Depth", I::TransmissionDepth},
    };
    for (const auto& [name, column] : outputs) n.set(name, e.input(column));
    n.set("Portal Depth", e.literal(0));
}

void compile_camera_data(NodeContext& n) {
    Expressions& e = n.e;
    const Value3 p = n.position();
    const Value3 c = e.emit3(Op::CameraTransform, uint8_t(TransformKind::PointToObject), {p.x, p.y, p.z});
    n.set_vector("View Vector", e.normalize(c));
    n.set("View Z Depth", c.z);
    n.set("View Distance", e.length(c));
}

/// Between the viewer and the socket's normal, which is taken as it comes.
Value facing(NodeContext& n) {
    return n.e.dot(n.incoming(), n.linked("Normal") ? n.vector("Normal") : n.shading_normal());
}

void compile_fresnel(NodeContext& n) {
    Expressions& e = n.e;
    const Value eta = e.max(n.value("IOR", 1.5f), 1e-5f);
    const Value inside = e.select(e.input(I::Backfacing), e.div(e.literal(1), eta), eta);
    n.set("Fac", e.emit(Op::Fresnel, 0, {facing(n), inside}));
}

void compile_layer_weight(NodeContext& n) {
    Expressions& e = n.e;
    const Value cosine = facing(n), blend = n.value("Blend", 0.5f);
    const Value eta = e.max(e.one_minus(blend), 1e-5f);
    n.set("Fresnel", e.emit(Op::Fresnel, 0, {cosine, e.select(e.input(I::Backfacing), eta, e.div(e.literal(1), eta))}));
    const Value b = e.ternary(TernaryKind::Clamp, blend, e.literal(0), e.literal(1 - 1e-5f));
    const Value low = e.mul(b, 2.0f), high = e.div(e.literal(0.5f), e.one_minus(b));
    const Value exponent = e.select(e.binary(BinaryKind::LessThan, b, e.literal(0.5f)), low, high);
    n.set("Facing", e.one_minus(e.binary(BinaryKind::Power, e.unary(UnaryKind::Absolute, cosine), exponent)));
}

void compile_light_falloff(NodeContext& n) {
    // The lamp's own 1/d^2 is turned into 1/d or a constant. Nothing to turn for distant light.
    Expressions& e = n.e;
    const Value d = e.input(I::RayLength), d2 = e.mul(d, d), smooth = n.value("Smooth");
    const Value far = e.binary(BinaryKind::GreaterThan, d, e.literal(1e17f));
    const Value softened = e.select(e.binary(BinaryKind::GreaterThan, smooth, e.literal(0)), e.div(d2, e.add(smooth, d2)), e.literal(1));
    const Value strength = e.mul(n.value("Strength", 100), e.select(far, e.literal(1), softened));
    n.set("Quadratic", strength);
    n.set("Linear", e.mul(strength, e.select(far, e.literal(1), d)));
    n.set("Constant", e.mul(strength, e.select(far, e.literal(1), d2)));
}

/// What the synchronisation stores with each instance that a particle is shown as; elsewhere zero, and the random number of the first particle.
void compile_particle_info(NodeContext& n) {
    const auto stored = [&](const char* name) { return n.attribute(name, AttributeSource::Object); };
    const auto state = stored(scene::kParticleState);
    n.set("Index", state[0]);
    n.set("Age", state[1]);
    n.set("Lifetime", state[2]);
    n.set("Size", state[3]);
    const auto vector = [&](const char* output, const char* name) {
        const auto a = stored(name);
        n.set_vector(output, {a[0], a[1], a[2]});
        return a[3];
    };
    const Value random = vector("Location", scene::kParticleLocation);
    n.set("Random", n.e.select(random, random, n.e.literal(hash_to_unit(hash_words(0u, 0u)))));
    vector("Velocity", scene::kParticleVelocity);
    vector("Angular Velocity", scene::kParticleSpin);
}

/// Radii with the object's scale: by its mean, or where the object's map can be applied to the data.
Value world_radius(NodeContext& n, bool by_mean) {
    const ObjectField scale = by_mean ? ObjectField::MeanScale : ObjectField::AppliedScale;
    return n.e.mul(n.attribute(scene::kRadius)[0], n.e.emit(Op::ObjectValue, uint8_t(scale), std::span<const Value>{}));
}

void compile_hair_info(NodeContext& n) {
    Expressions& e = n.e;
    n.set("Is Strand", e.emit(Op::ObjectValue, uint8_t(ObjectField::IsCurve), std::span<const Value>{}));
    n.set("Intercept", n.attribute(scene::kIntercept)[0]);
    n.set("Length", n.attribute(scene::kLength)[0]);
    // Of a point a curve's questions have no answer.
    const Value is_curve = e.emit(Op::ObjectValue, uint8_t(ObjectField::IsCurve), std::span<const Value>{});
    n.set("Thickness", e.mul(is_curve, e.mul(world_radius(n, n.semantics.curves_scale_by_mean), 2.0f)));
    n.set("Random", e.mul(is_curve, n.attribute(scene::kRandom)[0]));
    const Value3 tangent = e.triple(e.emit(Op::CurveTangent, 0, std::span<const Value>{}, 3)), wo = n.incoming();
    n.set_vector("Tangent Normal", e.mul(e.normalize(e.sub(wo, e.mul(tangent, e.dot(tangent, wo)))), is_curve));
}

void compile_point_info(NodeContext& n) {
    Expressions& e = n.e;
    const auto center = n.attribute(scene::kCenter);
    const Value is_point = e.emit(Op::ObjectValue, uint8_t(ObjectField::IsPoint), std::span<const Value>{});
    n.set_vector("Position", e.mul(n.to_object({center[0], center[1], center[2]}, TransformKind::PointToWorld), is_point));
    n.set("Radius", e.mul(world_radius(n, n.semantics.points_scale_by_mean), is_point));
    n.set("Random", e.mul(n.attribute(scene::kRandom)[0], is_point));
}

/// Surfaces are no volumes: what these nodes say about them is zero, as in Cycles.
void compile_not_this_geometry(NodeContext& n) {
    const Value zero = n.e.literal(0);
    for (const char* name : {"Density", "Flame", "Temperature"}) n.set(name, zero);
    n.set_color("Color", n.e.spread(zero));
}

constexpr CatalogueEntry kEntries[] = {
    {"ShaderNodeValue", compile_value},
    {"ShaderNodeRGB", compile_rgb},
    {"FunctionNodeInputVector", compile_input_vector},
    {"GeometryNodeInputSceneTime", compile_scene_time},
    {"ShaderNodeTexCoord", compile_texture_coordinate},
    {"ShaderNodeUVMap", compile_uv_map},
    {"ShaderNodeNewGeometry", compile_geometry},
    {"ShaderNodeObjectInfo", compile_object_info},
    {"ShaderNodeAttribute", compile_attribute},
    {"ShaderNodeVertexColor", compile_color_attribute},
    {"ShaderNodeLightPath", compile_light_path},
    {"ShaderNodeCameraData", compile_camera_data},
    {"ShaderNodeFresnel", compile_fresnel},
    {"ShaderNodeLayerWeight", compile_layer_weight},
    {"ShaderNodeLightFalloff", compile_light_falloff},
    {"ShaderNodeParticleInfo", compile_particle_info},
    {"ShaderNodeHairInfo", compile_hair_info},
    {"ShaderNodePointInfo", compile_point_info},
    {"ShaderNodeVolumeInfo", compile_not_this_geometry},
};

}  // namespace

std::span<const CatalogueEntry> input_nodes() {
    return kEntries;
}

}  // namespace talbot::shader
