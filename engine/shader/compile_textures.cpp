// Procedural textures.
#include "base/hash.h"
#include "shader/catalogue.h"

namespace talbot::shader {
namespace {

/// Four coordinates of which a texture of fewer dimensions reads the first (1D: w stands first).
struct Point {
    Value c[4];
};

Point point_of(NodeContext& n, int dimensions, Value scale) {
    Expressions& e = n.e;
    const Value zero = e.literal(0);
    Point p{{zero, zero, zero, zero}};
    if (dimensions != 1) {
        const Value3 v = e.mul(n.texture_vector(), scale);
        p = {{v.x, v.y, dimensions > 2 ? v.z : zero, zero}};
    }
    if (dimensions == 1) p.c[0] = e.mul(n.value("W"), scale);
    if (dimensions == 4) p.c[3] = e.mul(n.value("W"), scale);
    return p;
}

int dimensions_of(NodeContext& n, const char* property) {
    return n.choice(property, {"1D", "2D", "3D", "4D"}, 2) + 1;
}

/// Moves the lattice of another noise away from this one's: one number a component.
Point offset_by_seed(Expressions& e, Point p, int dimensions, float seed) {
    for (int i = 0; i < dimensions; ++i) {
        const float h = dimensions == 1 ? unit_hash(seed) : unit_hash(seed, float(i));
        p.c[i] = e.add(p.c[i], 100.0f + h * 100.0f);
    }
    return p;
}

struct Fractal {
    NoiseKind kind = NoiseKind::Fbm;
    bool normalize = true;
    Value detail, roughness, lacunarity, offset, gain;
};

Value noise(NodeContext& n, const Point& p, int dimensions, const Fractal& f) {
    const uint8_t variant = noise_variant(dimensions, f.kind, f.normalize, n.semantics.noise_wraps);
    return n.e.emit(Op::Noise, variant, {p.c[0], p.c[1], p.c[2], p.c[3], f.detail, f.roughness, f.lacunarity, f.offset, f.gain});
}

void compile_noise(NodeContext& n) {
    Expressions& e = n.e;
    const int dimensions = dimensions_of(n, "noise_dimensions");
    Point p = point_of(n, dimensions, n.value("Scale", 5));
    Fractal f;
    f.kind = NoiseKind(n.choice("noise_type", {"FBM", "MULTIFRACTAL", "RIDGED_MULTIFRACTAL", "HYBRID_MULTIFRACTAL", "HETERO_TERRAIN"}));
    f.normalize = n.flag("normalize", true) && f.kind == NoiseKind::Fbm;
    f.detail = n.value("Detail", 2);
    const Value roughness = n.value("Roughness", 0.5f);
    f.roughness = n.semantics.noise_roughness_clamped ? e.saturate(roughness) : e.max(roughness, 0.0f);
    f.lacunarity = n.value("Lacunarity", 2);
    f.offset = n.value("Offset", 0);
    f.gain = n.value("Gain", 1);

    const Value distortion = n.value("Distortion", 0);
    if (!e.is(distortion, 0)) {
        const uint8_t plain = noise_variant(dimensions, NoiseKind::Fbm, false, n.semantics.noise_wraps);
        const Point original = p;
        for (int i = 0; i < dimensions; ++i) {
            const Point q = offset_by_seed(e, original, dimensions, float(i));
            p.c[i] = e.add(p.c[i], e.mul(e.emit(Op::SignedNoise, plain, {q.c[0], q.c[1], q.c[2], q.c[3]}), distortion));
        }
    }
    const Value fac = noise(n, p, dimensions, f);
    n.set("Fac", fac);
    if (!n.output_linked("Color")) return;
    n.set_color("Color", {fac, noise(n, offset_by_seed(e, p, dimensions, float(dimensions)), dimensions, f),
                          noise(n, offset_by_seed(e, p, dimensions, float(dimensions + 1)), dimensions, f)});
}

void compile_musgrave(NodeContext& n) {
    // Noise in other words: one octave more, roughness = lacunarity^-dimension.
    Expressions& e = n.e;
    const int dimensions = dimensions_of(n, "musgrave_dimensions");
    const Point p = point_of(n, dimensions, n.value("Scale", 5));
    Fractal f;
    f.kind = NoiseKind(n.choice("musgrave_type", {"FBM", "MULTIFRACTAL", "RIDGED_MULTIFRACTAL", "HYBRID_MULTIFRACTAL", "HETERO_TERRAIN"}));
    f.normalize = false;
    const Value octaves = e.ternary(TernaryKind::Clamp, n.value("Detail", 2), e.literal(0), e.literal(15));
    f.detail = e.max(e.add(octaves, -1.0f), 0.0f);
    // Hetero terrain has a whole first octave always, and the fraction of the next one.
    if (f.kind == NoiseKind::HeteroTerrain) f.detail = e.select(e.binary(BinaryKind::LessThan, octaves, e.literal(1)), octaves, f.detail);
    f.lacunarity = e.max(n.value("Lacunarity", 2), 1e-5f);
    f.roughness = e.binary(BinaryKind::Power, f.lacunarity, e.negate(e.max(n.value("Dimension", 2), 1e-5f)));
    f.offset = n.value("Offset", 0);
    f.gain = n.value("Gain", 1);
    Value out = noise(n, p, dimensions, f);
    // Less than one octave fades the first one.
    const Value first = e.min(octaves, 1.0f);
    if (f.kind == NoiseKind::Fbm || f.kind == NoiseKind::HybridMultifractal) out = e.mul(out, first);
    if (f.kind == NoiseKind::Multifractal) out = e.add(e.mul(e.add(out, -1.0f), first), 1.0f);
    n.set("Fac", out);
}

void compile_white_noise(NodeContext& n) {
    Expressions& e = n.e;
    const int dimensions = dimensions_of(n, "noise_dimensions");
    const Value zero = e.literal(0);
    const Value3 v = dimensions == 1 ? e.spread(zero) : n.vector("Vector");
    const Value out = e.emit(Op::WhiteNoise, uint8_t(dimensions), {v.x, v.y, v.z, n.value("W")}, 4);
    n.set("Value", out);
    n.set_color("Color", e.triple(e.after(out, 1)));
}

/// Length of the vector (x, x, ...) by the metric.
Value metric_of_diagonal(Expressions& e, Value x, int dimensions, VoronoiMetric metric, Value exponent) {
    const float d = float(dimensions);
    if (dimensions == 1 || metric == VoronoiMetric::Chebychev) return x;
    if (metric == VoronoiMetric::Manhattan) return e.mul(x, d);
    if (metric == VoronoiMetric::Euclidean) return e.mul(x, std::sqrt(d));
    return e.mul(x, e.binary(BinaryKind::Power, e.literal(d), e.div(e.literal(1), exponent)));
}

void compile_voronoi(NodeContext& n) {
    Expressions& e = n.e;
    const int dimensions = dimensions_of(n, "voronoi_dimensions");
    const auto feature = VoronoiFeature(n.choice("feature", {"F1", "F2", "SMOOTH_F1", "DISTANCE_TO_EDGE", "N_SPHERE_RADIUS"}));
    const auto metric = VoronoiMetric(n.choice("distance", {"EUCLIDEAN", "MANHATTAN", "CHEBYCHEV", "MINKOWSKI"}));
    const Value scale = n.value("Scale", 5), smoothness = n.value("Smoothness", 1), exponent = n.value("Exponent", 0.5f);
    const Value randomness = e.saturate(n.value("Randomness", 1));
    Point p = point_of(n, dimensions, scale);
    // The line's coordinate is the fourth one here.
    if (dimensions == 1) std::swap(p.c[0], p.c[3]);
    const bool places = n.output_linked("Position") || n.output_linked("W");
    const uint32_t data =
        (n.semantics.voronoi_integer_hash ? kVoronoiIntegerHash : 0u) | (n.output_linked("Color") ? 0u : kVoronoiNoColor) | (places ? 0u : kVoronoiNoPosition);
    const auto octave = [&](Value frequency) {
        const auto at = [&](int i) { return e.mul(p.c[i], frequency); };
        return e.emit(Op::Voronoi, voronoi_variant(dimensions, feature, metric), {at(0), at(1), at(2), at(3), smoothness, exponent, randomness}, 8, data);
    };
    const Value one = e.literal(1), first = octave(one);
    Value distance = first;
    Value3 color = e.triple(e.after(first, 1));
    std::array<Value, 4> position{e.after(first, 4), e.after(first, 5), e.after(first, 6), e.after(first, 7)};

    const Value detail = e.ternary(TernaryKind::Clamp, n.value("Detail", 0), e.literal(0), e.literal(15)), roughness = e.saturate(n.value("Roughness", 0.5f));
    const Value lacunarity = n.value("Lacunarity", 2);
    const bool edges = feature == VoronoiFeature::DistanceToEdge;
    const bool fractal = feature != VoronoiFeature::NSphereRadius && !e.is(detail, 0) && !e.is(roughness, 0);
    const bool normalize = n.flag("normalize");
    const Value reach = e.add(e.mul(randomness, 0.5f), 0.5f);
    Value amplitude = one, total = edges ? reach : one;
    if (fractal) {
        // Sums octaves (edges: the running minimum), the last one by the fraction of detail.
        const int octaves = e.is_known(detail) ? int(std::ceil(e.known(detail))) + 1 : 16;
        Value frequency = one, max = edges ? reach : e.literal(0);
        Value sum = edges ? e.literal(8) : e.literal(0);
        const Value zero = e.literal(0);
        Value3 rgb = e.spread(zero);
        std::array<Value, 4> place{zero, zero, zero, zero};
        for (int o = 0; o < octaves; ++o) {
            const Value r = octave(frequency);
            const Value share = e.saturate(e.add(detail, 1.0f - float(o)));
            const auto blend = [&](Value before, Value after) { return e.lerp(before, after, share); };
            if (edges) {
                const Value here = e.div(r, frequency);
                max = blend(max, e.lerp(max, e.div(reach, frequency), amplitude));
                sum = blend(sum, e.lerp(sum, e.min(sum, here), amplitude));
            } else {
                max = blend(max, e.add(max, amplitude));
                sum = blend(sum, e.add(sum, e.mul(r, amplitude)));
                const Value3 c = e.triple(e.after(r, 1));
                rgb = e.lerp(rgb, e.add(rgb, e.mul(c, amplitude)), share);
                for (int i = 0; i < 4; ++i)
                    place[size_t(i)] = blend(place[size_t(i)], e.lerp(place[size_t(i)], e.div(e.after(r, 4 + i), frequency), amplitude));
            }
            frequency = e.mul(frequency, lacunarity);
            amplitude = e.mul(amplitude, roughness);
        }
        // Linked detail or roughness may be zero after all: then there is one octave, unsummed.
        const Value single = e.binary(BinaryKind::Multiply, detail, roughness);
        distance = e.select(single, sum, distance);
        total = e.select(single, max, total);
        if (!edges) {
            color = e.select(single, rgb, color);
            for (int i = 0; i < 4; ++i) position[size_t(i)] = e.select(single, place[size_t(i)], position[size_t(i)]);
        }
    }
    if (normalize && feature != VoronoiFeature::NSphereRadius) {
        if (edges) {
            distance = e.div(distance, total);
        } else {
            Value longest = metric_of_diagonal(e, reach, dimensions, metric, exponent);
            if (feature == VoronoiFeature::F2) longest = e.mul(longest, 2.0f);
            distance = e.div(distance, e.mul(total, longest));
            color = {e.div(color.x, total), e.div(color.y, total), e.div(color.z, total)};
        }
    }
    n.set("Distance", distance);
    n.set("Radius", distance);
    n.set_color("Color", color);
    n.set_vector("Position", {e.div(position[0], scale), e.div(position[1], scale), dimensions == 2 ? e.literal(0) : e.div(position[2], scale)});
    n.set("W", e.div(dimensions == 1 ? position[0] : position[3], scale));
}

void compile_wave(NodeContext& n) {
    Expressions& e = n.e;
    const bool rings = n.choice("wave_type", {"BANDS", "RINGS"}) == 1;
    const int axis = rings ? n.choice("rings_direction", {"X", "Y", "Z", "SPHERICAL"}) : n.choice("bands_direction", {"X", "Y", "Z", "DIAGONAL"});
    const auto profile = WaveProfile(n.choice("wave_profile", {"SIN", "SAW", "TRI"}));
    const Value3 p = e.mul(n.texture_vector(), n.value("Scale", 5));
    Value phase = n.value("Phase Offset");
    const Value distortion = n.value("Distortion");
    if (!e.is(distortion, 0)) {
        // The noise is read at the nudged coordinates, like the wave itself.
        const auto nudged = [&](Value x) { return e.mul(e.add(x, 1e-6f), 0.999999f); };
        const Value frequency = n.value("Detail Scale", 1);
        const Point q{{e.mul(nudged(p.x), frequency), e.mul(nudged(p.y), frequency), e.mul(nudged(p.z), frequency), e.literal(0)}};
        Fractal f;
        f.detail = n.value("Detail", 2);
        const Value roughness = n.value("Detail Roughness", 0.5f);  // later versions take it as it comes
        f.roughness = n.semantics.noise_roughness_clamped ? e.saturate(roughness) : roughness;
        f.lacunarity = e.literal(2);
        f.offset = e.literal(0);
        f.gain = e.literal(1);
        phase = e.add(phase, e.mul(distortion, e.add(e.mul(noise(n, q, 3, f), 2.0f), -1.0f)));
    }
    const Value fac = e.emit(Op::Wave, wave_variant(rings, axis, profile), {p.x, p.y, p.z, phase});
    n.set("Fac", fac);
    n.set_color("Color", e.spread(fac));
}

void compile_magic(NodeContext& n) {
    Expressions& e = n.e;
    const Value3 p = n.texture_vector();
    const int depth = int(clampf(float(n.number("turbulence_depth", 2)), 0, 10));
    const Value scale = n.value("Scale", 5), distortion = n.value("Distortion", 1);
    // The operation wraps what it gets, then scales.
    const Value3 c = n.semantics.magic_wraps_scaled
                         ? e.emit3(Op::Magic, uint8_t(depth), {e.mul(p.x, scale), e.mul(p.y, scale), e.mul(p.z, scale), e.literal(1), distortion})
                         : e.emit3(Op::Magic, uint8_t(depth), {p.x, p.y, p.z, scale, distortion});
    n.set_color("Color", c);
    n.set("Fac", e.mul(e.add(e.add(c.x, c.y), c.z), 1.0f / 3.0f));
}

void compile_brick(NodeContext& n) {
    Expressions& e = n.e;
    const Value3 p = n.texture_vector();
    const uint32_t offset_every = uint32_t(clampf(float(n.number("offset_frequency", 2)), 0, 99));
    const uint32_t squash_every = uint32_t(clampf(float(n.number("squash_frequency", 2)), 0, 99));
    const Value tint = e.emit(
        Op::Brick, n.semantics.brick_clamps ? 1 : 0,
        {p.x, p.y, p.z, n.value("Scale", 5), n.value("Mortar Size", 0.02f), n.value("Mortar Smooth", 0.1f), n.value("Bias"), n.value("Brick Width", 0.5f),
         n.value("Row Height", 0.25f), e.constant(float(n.number("offset", 0.5))), e.constant(float(n.number("squash", 1)))},
        2, offset_every | squash_every << 8);
    const Value mortar = e.after(tint, 1);
    const Value3 bricks = e.lerp(n.color("Color1", {0.8f, 0.8f, 0.8f}), n.color("Color2", {0.2f, 0.2f, 0.2f}), tint);
    n.set_color("Color", e.lerp(bricks, n.color("Mortar"), mortar));
    n.set("Fac", mortar);
}

void compile_checker(NodeContext& n) {
    Expressions& e = n.e;
    const Value3 p = e.mul(n.texture_vector(), n.value("Scale", 5));
    const Value fac = e.emit(Op::Checker, 0, {p.x, p.y, p.z});
    n.set("Fac", fac);
    n.set_color("Color", e.select(fac, n.color("Color1", {0.8f, 0.8f, 0.8f}), n.color("Color2", {0.2f, 0.2f, 0.2f})));
}

void compile_gradient(NodeContext& n) {
    const Value3 p = n.texture_vector();
    const int kind = n.choice("gradient_type", {"LINEAR", "QUADRATIC", "EASING", "DIAGONAL", "SPHERICAL", "QUADRATIC_SPHERE", "RADIAL"});
    const Value fac = n.e.emit(Op::Gradient, uint8_t(kind), {p.x, p.y, p.z});
    n.set("Fac", fac);
    n.set_color("Color", n.e.spread(fac));
}

void compile_gabor(NodeContext& n) {
    Expressions& e = n.e;
    const bool flat = n.choice("gabor_type", {"2D", "3D"}) == 0;
    const Value3 p = e.mul(n.texture_vector(), n.value("Scale", 5));
    const Value zero = e.literal(0);
    Value3 orientation{zero, zero, zero};
    if (flat)
        orientation.x = n.value("Orientation 2D", 0.25f * kPi);
    else
        orientation = e.normalize(n.vector("Orientation 3D", {1, 1, 0}));
    const Value z = flat ? zero : p.z;
    const Value out =
        e.emit(Op::Gabor, flat ? 2 : 3, {p.x, p.y, z, n.value("Frequency", 2), n.value("Anisotropy", 1), orientation.x, orientation.y, orientation.z}, 3);
    n.set("Value", out);
    n.set("Phase", e.after(out, 1));
    n.set("Intensity", e.after(out, 2));
}

void compile_radial_tiling(NodeContext& n) {
    Expressions& e = n.e;
    const Value3 p = n.vector("Vector");
    const Value out = e.emit(Op::RadialTiling, n.flag("normalize") ? 1 : 0, {p.x, p.y, n.value("Sides", 5), n.value("Roundness")}, 5);
    n.set_vector("Segment Coordinates", {out, e.after(out, 1), e.literal(0)});
    n.set("Segment ID", e.after(out, 2));
    n.set("Segment Width", e.after(out, 3));
    n.set("Segment Rotation", e.after(out, 4));
}

constexpr CatalogueEntry kEntries[] = {
    {"ShaderNodeTexNoise", compile_noise},
    {"ShaderNodeTexMusgrave", compile_musgrave},
    {"ShaderNodeTexWhiteNoise", compile_white_noise},
    {"ShaderNodeTexVoronoi", compile_voronoi},
    {"ShaderNodeTexWave", compile_wave},
    {"ShaderNodeTexMagic", compile_magic},
    {"ShaderNodeTexBrick", compile_brick},
    {"ShaderNodeTexChecker", compile_checker},
    {"ShaderNodeTexGradient", compile_gradient},
    {"ShaderNodeTexGabor", compile_gabor},
    {"ShaderNodeRadialTiling", compile_radial_tiling},
};

}  // namespace

std::span<const CatalogueEntry> texture_nodes() {
    return kEntries;
}

}  // namespace talbot::shader
