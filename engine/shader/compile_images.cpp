// Image and Environment Texture.
#include <cmath>

#include "shader/catalogue.h"
#include "shader/graph_compiler.h"

namespace talbot::shader {
namespace {

struct Sample {
    Value3 rgb;
    Value alpha;
};

Sample lookup(NodeContext& n, Value u, Value v, int extension) {
    Expressions& e = n.e;
    const int interpolation = n.choice("interpolation", {"Linear", "Closest", "Cubic", "Smart"});
    const Value handle = e.constant_bits(uint32_t(int32_t(n.number("image", -1))));
    const Value out = e.emit(Op::Image, uint8_t(interpolation * 4 + extension), {u, v, handle}, 4);
    return {e.triple(out), e.after(out, 3)};
}

Sample box(NodeContext& n, Value3 p, int extension) {
    // Three planes, weighed by the object-space normal.
    Expressions& e = n.e;
    const Value3 normal = e.normalize(n.to_object(n.shading_normal(), TransformKind::NormalToObject));
    const Value3 w = e.emit3(Op::BoxWeights, 0, {normal.x, normal.y, normal.z, e.constant(float(n.number("projection_blend")))});
    const Value zero = e.literal(0);
    const auto flipped = [&](Value positive, Value x) { return e.select(positive, e.one_minus(x), x); };
    const Value back_x = e.binary(BinaryKind::LessThan, normal.x, zero), front_y = e.binary(BinaryKind::GreaterThan, normal.y, zero);
    const Value front_z = e.binary(BinaryKind::GreaterThan, normal.z, zero);
    const Sample x = lookup(n, flipped(back_x, p.y), p.z, extension), y = lookup(n, flipped(front_y, p.x), p.z, extension);
    const Sample z = lookup(n, flipped(front_z, p.y), p.x, extension);
    const auto sum = [&](Value a, Value b, Value c) { return e.add(e.add(e.mul(a, w.x), e.mul(b, w.y)), e.mul(c, w.z)); };
    return {{sum(x.rgb.x, y.rgb.x, z.rgb.x), sum(x.rgb.y, y.rgb.y, z.rgb.y), sum(x.rgb.z, y.rgb.z, z.rgb.z)}, sum(x.alpha, y.alpha, z.alpha)};
}

/// True where the node's alpha is a separate thing: the colour is divided by it when both are used.
bool unassociates(NodeContext& n) {
    const int handle = int(n.number("image", -1));
    const auto& images = n.graph().scene.images;
    if (!n.output_linked("Alpha") || handle < 0 || size_t(handle) >= images.size() || !images[size_t(handle)]) return false;
    const scene::Image& image = *images[size_t(handle)];
    const bool is_data = image.colorspace == "Non-Color" || image.colorspace == "Raw" || image.colorspace == "Generic Data";
    return !is_data && image.alpha != scene::AlphaMode::ChannelPacked && image.alpha != scene::AlphaMode::None;
}

void compile_image(NodeContext& n) {
    Expressions& e = n.e;
    if (int(n.number("image", -1)) < 0) n.warn("Image Texture without an image: magenta");
    // Unlinked coordinates are the active UV map.
    Value3 p;
    if (n.linked("Vector")) {
        p = n.vector("Vector");
    } else {
        const auto map = n.attribute(scene::kActiveUv);
        const Value on_lamp = n.semantics.lamps_have_uv ? e.input(InputColumn::IsLamp) : e.literal(0), u = n.barycentric_u(), v = n.barycentric_v();
        p = {e.select(on_lamp, e.sub(e.sub(e.literal(1), u), v), map[0]), e.select(on_lamp, u, map[1]), e.literal(0)};
    }
    p = n.texture_mapping(p);
    const int extension = n.choice("extension", {"REPEAT", "EXTEND", "CLIP", "MIRROR"});
    const int projection = n.choice("projection", {"FLAT", "BOX", "SPHERE", "TUBE"});
    Sample s;
    if (projection == 1) {
        s = box(n, p, extension);
    } else {
        Value u = p.x, v = p.y;
        if (projection >= 2) {
            // Around the middle of the unit cube.
            const auto centred = [&](Value x) { return e.add(e.mul(x, 2.0f), -1.0f); };
            const ProjectKind kind = projection == 2 ? ProjectKind::Sphere : ProjectKind::Tube;
            u = e.emit(Op::Project, uint8_t(kind), {centred(p.x), centred(p.y), centred(p.z)}, 2);
            v = e.after(u, 1);
        }
        s = lookup(n, u, v, extension);
    }
    if (unassociates(n)) {
        const Value scale = e.select(s.alpha, e.div(e.literal(1), s.alpha), e.literal(1));
        s.rgb = e.mul(s.rgb, scale);
    }
    n.set_color("Color", s.rgb);
    n.set("Alpha", s.alpha);
}

void compile_environment(NodeContext& n) {
    Expressions& e = n.e;
    if (int(n.number("image", -1)) < 0) n.warn("Environment Texture without an image: magenta");
    const Value3 d = n.texture_mapping(n.linked("Vector") ? n.vector("Vector") : n.position());
    const int projection = n.choice("projection", {"EQUIRECTANGULAR", "MIRROR_BALL"});
    const ProjectKind kind = projection == 0 ? ProjectKind::Equirectangular : ProjectKind::MirrorBall;
    const Value u = e.emit(Op::Project, uint8_t(kind), {d.x, d.y, d.z}, 2);
    n.set_color("Color", lookup(n, u, e.after(u, 1), 0).rgb);
}

void compile_ies(NodeContext& n) {
    Expressions& e = n.e;
    const Value strength = n.value("Strength", 1);
    const std::vector<float>* table = n.table("ies_table");
    const size_t rows = table && table->size() > 2 ? size_t((*table)[0]) : 0, columns = rows ? size_t((*table)[1]) : 0;
    bool usable = rows >= 2 && columns >= 2 && table->size() == 2 + rows + columns + rows * columns;
    if (usable && n.semantics.ies_from_pole && (*table)[2 + rows] > 0) {
        n.warn("This Blender's Cycles wants vertical angles from 0: the IES file is not used");
        usable = false;
    }
    // Without a file Cycles has 100 everywhere.
    if (!usable) return n.set("Fac", e.mul(strength, 100.0f));
    // Unlinked: where the light goes, as the lamp has it. Of an uneven scale Cycles takes this for a normal.
    const auto leaving = [&] { return n.to_object(n.semantics.ies_by_normal ? n.shading_normal() : n.incoming(), TransformKind::NormalToObject); };
    const Value3 d = e.normalize(n.linked("Vector") ? n.vector("Vector") : leaving());
    const Value down = e.ternary(TernaryKind::Clamp, e.negate(d.z), e.literal(-1), e.literal(1));
    const Value around = e.add(e.binary(BinaryKind::ArcTangent2, d.x, d.y), float(M_PI));
    n.set("Fac", e.mul(strength, e.emit(Op::Ies, uint8_t(n.semantics.ies_ends), {around, e.unary(UnaryKind::ArcCosine, down), e.table(*table)})));
}

constexpr CatalogueEntry kEntries[] = {
    {"ShaderNodeTexImage", compile_image},
    {"ShaderNodeTexEnvironment", compile_environment},
    {"ShaderNodeTexIES", compile_ies},
};

}  // namespace

std::span<const CatalogueEntry> image_nodes() {
    return kEntries;
}

}  // namespace talbot::shader
