// Sky Texture: Preetham's formula, Hosek and Wilkie's, and the tables of sky.h with the sun's disc.
#include <cmath>

#include "shader/catalogue.h"
#include "shader/graph_compiler.h"
#include "shader/hosek_sky.h"
#include "shader/sky.h"

namespace talbot::shader {
namespace {

/// CIE XYZ to linear Rec.709, not negative.
Value3 to_rgb(NodeContext& n, Value3 xyz) {
    Expressions& e = n.e;
    const Rec709 m = n.semantics.rec709;
    const Rgb x = xyz_to_rec709(1, 0, 0, m), y = xyz_to_rec709(0, 1, 0, m), z = xyz_to_rec709(0, 0, 1, m);
    const auto row = [&](float a, float b, float c) { return e.add(e.add(e.mul(xyz.x, a), e.mul(xyz.y, b)), e.mul(xyz.z, c)); };
    return e.max(Value3{row(x.x, y.x, z.x), row(x.y, y.y, z.y), row(x.z, y.z, z.z)}, 0.0f);
}

Vec3 sun_property(NodeContext& n) {
    const std::vector<float>* d = n.table("sun_direction");
    const Vec3 v = d && d->size() == 3 ? Vec3{(*d)[0], (*d)[1], (*d)[2]} : Vec3{0, 0, 1};
    const float length = std::sqrt(dot(v, v));
    return length > 0 ? v * (1 / length) : Vec3{0, 0, 1};
}

/// The direction looked up and its angle to the sun, as the daylight formulas want them.
struct Sight {
    Value cosine;  ///< of the angle to the zenith, held above the horizon
    Value gamma;   ///< angle to the sun
    Value gamma_cosine;
};

Sight sight(NodeContext& n, Value3 d, Vec3 sun) {
    Expressions& e = n.e;
    const Value z = e.ternary(TernaryKind::Clamp, d.z, e.literal(-1), e.literal(1));
    // Only the azimuth of the rest counts: the vector may have any length.
    const Value flat = e.sqrt(e.max(e.one_minus(e.mul(z, z)), 0.0f));
    const Value scale = e.div(flat, e.sqrt(e.add(e.mul(d.x, d.x), e.mul(d.y, d.y))));
    const Value c = e.add(e.mul(scale, e.add(e.mul(d.x, e.constant(sun.x)), e.mul(d.y, e.constant(sun.y)))), e.mul(z, e.constant(sun.z)));
    Sight s;
    s.gamma_cosine = e.ternary(TernaryKind::Clamp, c, e.literal(-1), e.literal(1));
    s.gamma = e.unary(UnaryKind::ArcCosine, s.gamma_cosine);
    s.cosine = e.max(z, std::sin(0.001f));
    return s;
}

/// [Preetham et al. 1999, "A practical analytic model for daylight"], appendix A.2; luminance in units of Blender's choice.
Value3 preetham(NodeContext& n, Value3 d) {
    Expressions& e = n.e;
    const Vec3 sun = sun_property(n);
    const double t = n.number("turbidity", 2.2), theta = std::acos(double(clampf(sun.z, -1, 1)));
    static constexpr double kPerez[3][5][2] = {
        {{0.1787, -1.4630}, {-0.3554, 0.4275}, {-0.0227, 5.3251}, {0.1206, -2.5771}, {-0.0670, 0.3703}},    // luminance
        {{-0.0193, -0.2592}, {-0.0665, 0.0008}, {-0.0004, 0.2125}, {-0.0641, -0.8989}, {-0.0033, 0.0452}},  // x
        {{-0.0167, -0.2608}, {-0.0950, 0.0092}, {-0.0079, 0.2102}, {-0.0441, -1.6537}, {-0.0109, 0.0529}},  // y
    };
    static constexpr double kZenith[2][3][4] = {
        // Powers of turbidity 2, 1, 0 by powers of the sun's angle 3, 2, 1, 0.
        {{0.00166, -0.00375, 0.00209, 0}, {-0.02903, 0.06377, -0.03202, 0.00394}, {0.11693, -0.21196, 0.06052, 0.25886}},
        {{0.00275, -0.00610, 0.00317, 0}, {-0.04214, 0.08970, -0.04153, 0.00516}, {0.15346, -0.26756, 0.06670, 0.26688}},
    };
    const double chi = (4.0 / 9 - t / 120) * (M_PI - 2 * theta);
    double zenith[3] = {((4.0453 * t - 4.9710) * std::tan(chi) - 0.2155 * t + 2.4192) * 0.06, 0, 0};
    for (int k = 0; k < 2; ++k)
        for (const auto& row : kZenith[k]) zenith[k + 1] = zenith[k + 1] * t + ((row[0] * theta + row[1]) * theta + row[2]) * theta + row[3];

    const Sight s = sight(n, d, sun);
    Value xyY[3];
    for (int k = 0; k < 3; ++k) {
        double c[5];
        for (int i = 0; i < 5; ++i) c[i] = kPerez[k][i][0] * t + kPerez[k][i][1];
        const double here = std::cos(theta);
        const double normal = (1 + c[0] * std::exp(c[1])) * (1 + c[2] * std::exp(c[3] * theta) + c[4] * here * here);
        const auto known = [&](double x) { return e.constant(float(x)); };
        const Value up = e.add(e.mul(known(c[0]), e.unary(UnaryKind::Exponent, e.div(known(c[1]), s.cosine))), 1.0f);
        const Value around = e.add(e.add(e.mul(known(c[2]), e.unary(UnaryKind::Exponent, e.mul(known(c[3]), s.gamma))), 1.0f),
                                   e.mul(known(c[4]), e.mul(s.gamma_cosine, s.gamma_cosine)));
        xyY[k] = e.mul(known(zenith[k] / normal), e.mul(up, around));
    }
    const Value scale = e.div(xyY[0], xyY[2]);
    return to_rgb(n, {e.mul(xyY[1], scale), xyY[0], e.mul(e.sub(e.one_minus(xyY[1]), xyY[2]), scale)});
}

/// Elevation within a quarter turn of the horizon, and the azimuth that goes with it.
std::pair<double, double> sun_angles(NodeContext& n) {
    double elevation = std::remainder(n.number("sun_elevation", 0.2618), 2 * M_PI), rotation = n.number("sun_rotation", 0);
    if (std::fabs(elevation) > M_PI_2) {
        elevation = std::copysign(M_PI, elevation) - elevation;
        rotation += M_PI;
    }
    return {elevation, std::remainder(rotation, 2 * M_PI)};
}

Value3 atmosphere(NodeContext& n, Value3 d, SkyModel model) {
    Expressions& e = n.e;
    const bool old = !n.semantics.sky_full_dome;
    const auto [elevation, rotation] = sun_angles(n);
    SkyAir air;
    air.model = model;
    air.full_dome = !old;
    air.matrix = n.semantics.rec709;
    air.elevation = float(elevation);
    air.altitude = float(n.number("altitude", 0));
    air.air = float(n.number("air_density", 1));
    air.aerosol = float(n.number(old ? "dust_density" : "aerosol_density", 1));
    air.ozone = float(n.number("ozone_density", 1));

    // The table's column: azimuth relative to the sun's.
    const Value z = e.ternary(TernaryKind::Clamp, d.z, e.literal(-1), e.literal(1)), height = e.unary(UnaryKind::ArcSine, z);
    const Value azimuth = e.binary(BinaryKind::ArcTangent2, d.y, d.x);
    const Value u = e.unary(UnaryKind::Fraction, e.add(e.mul(azimuth, float(0.5 / M_PI)), e.constant(float(0.25 + rotation / (2 * M_PI)))));
    const Value stretched = e.sqrt(e.mul(e.unary(UnaryKind::Absolute, height), float(2 / M_PI)));
    const Value down = e.binary(BinaryKind::LessThan, d.z, e.literal(0));
    Value v;
    if (old) {
        v = e.select(down, e.literal(0), stretched);
    } else {
        v = e.add(e.mul(e.select(down, e.negate(stretched), stretched), 0.5f), 0.5f);
    }
    const uint32_t size = uint32_t(kSkyWidth) << 16 | uint32_t(old ? kSkyHalfHeight : kSkyHeight);
    Value3 sky = e.triple(e.emit(Op::Grid, 0, {u, v, e.table(*n.graph().skies.table(air))}, 3, size));
    if (old) {
        // The ground fades to black.
        const Value fade = e.saturate(e.add(e.mul(d.z, 2.5f), 1.0f));
        sky = e.select(down, e.mul(sky, e.mul(e.mul(fade, fade), fade)), sky);
    }

    const float diameter = clampf(float(n.number("sun_size", 0.009512)), 0, float(M_PI_2)), half = 0.5f * diameter;
    if (!n.flag("sun_disc", true) || diameter <= 0) return e.max(sky, 0.0f);
    const Vec3 sun{float(std::cos(elevation) * std::sin(rotation)), float(std::cos(elevation) * std::cos(rotation)), float(std::sin(elevation))};
    const auto [low, high] = sun_radiance(air, diameter);
    const float intensity = float(n.number("sun_intensity", 1));
    const Value3 s = e.constant3(sun.x, sun.y, sun.z);
    const Value angle = e.mul(e.binary(BinaryKind::ArcTangent2, e.length(e.sub(d, s)), e.length(e.add(d, s))), 2.0f);
    const float horizon = old ? 0.0f : horizon_elevation(air.altitude);
    // From the lowest point of the disc to the highest; before 5.0 from the horizon when that cuts the disc.
    const bool cut = old && elevation - half <= 0;
    const float first = cut ? 0.0f : float(elevation) - half, span = cut ? float(elevation) + half : diameter;
    const Value t = e.mul(e.add(height, e.constant(-first)), e.constant(span > 0 ? 1 / span : 0));
    const Value edge = e.mul(angle, e.constant(1 / half));
    const Value limb = e.add(e.mul(e.sqrt(e.max(e.one_minus(e.mul(edge, edge)), 0.0f)), 0.6f), 0.4f);
    const Value3 low3 = e.constant3(low.x * intensity, low.y * intensity, low.z * intensity);
    const Value3 disc = e.mul(e.lerp(low3, e.constant3(high.x * intensity, high.y * intensity, high.z * intensity), t), limb);
    const Value inside = e.mul(e.binary(BinaryKind::LessThan, angle, e.constant(half)), e.binary(BinaryKind::GreaterThan, height, e.constant(horizon)));
    if (n.graph().values.sun.half_angle == 0) n.graph().values.sun = {sun, half};
    return e.max(e.select(inside, old ? disc : e.add(disc, sky), sky), 0.0f);
}

/// Units of Blender's choice: 2 pi over 683 lm/W. A sun below the horizon counts as on it.
Value3 hosek(NodeContext& n, Value3 d) {
    Expressions& e = n.e;
    const Vec3 sun = sun_property(n);
    const double elevation = std::max(std::asin(double(clampf(sun.z, -1, 1))), 0.0);
    const Vec3 held = elevation > 0 || sun.x * sun.x + sun.y * sun.y == 0 ? sun : normalize(Vec3{sun.x, sun.y, 0});
    const auto sky = hosek_sky(n.number("turbidity", 2.2), n.number("ground_albedo", 0.3), elevation);
    const Sight s = sight(n, d, held);
    const Value cosine2 = e.mul(s.gamma_cosine, s.gamma_cosine), root = e.sqrt(s.cosine), above = e.add(s.cosine, 0.01f);
    const auto known = [&](double x) { return e.constant(float(x)); };
    Value xyz[3];
    for (size_t k = 0; k < 3; ++k) {
        const auto& c = sky[k].shape;
        const Value up = e.add(e.mul(known(c[0]), e.unary(UnaryKind::Exponent, e.div(known(c[1]), above))), 1.0f);
        const Value around = e.mul(known(c[3]), e.unary(UnaryKind::Exponent, e.mul(known(c[4]), s.gamma)));
        const Value rayleigh = e.mul(known(c[5]), cosine2);
        const Value spread = e.sub(known(1 + c[8] * c[8]), e.mul(known(2 * c[8]), s.gamma_cosine));
        const Value mie = e.div(e.mul(known(c[6]), e.add(cosine2, 1.0f)), e.mul(spread, e.sqrt(spread)));
        const Value sum = e.add(e.add(e.add(known(c[2]), around), e.add(rayleigh, mie)), e.mul(known(c[7]), root));
        xyz[k] = e.mul(known(sky[k].radiance * 2 * M_PI / 683), e.mul(up, sum));
    }
    return to_rgb(n, {xyz[0], xyz[1], xyz[2]});
}

void compile_sky(NodeContext& n) {
    const Value3 d = n.texture_mapping(n.linked("Vector") ? n.vector("Vector") : n.generated());
    switch (n.choice("sky_type", {"PREETHAM", "HOSEK_WILKIE", "NISHITA", "SINGLE_SCATTERING", "MULTIPLE_SCATTERING"}, 4)) {
        case 0:
            return n.set_color("Color", preetham(n, d));
        case 1:
            return n.set_color("Color", hosek(n, d));
        case 4:
            return n.set_color("Color", atmosphere(n, d, SkyModel::Multiple));
        default:
            return n.set_color("Color", atmosphere(n, d, SkyModel::Single));
    }
}

constexpr CatalogueEntry kEntries[] = {{"ShaderNodeTexSky", compile_sky}};

}  // namespace

std::span<const CatalogueEntry> sky_nodes() {
    return kEntries;
}

}  // namespace talbot::shader
