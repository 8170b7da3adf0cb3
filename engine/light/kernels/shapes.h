/// Directions towards shapes that emit, seen from a point: samplers and their densities per solid angle.
///
/// Rectangles by solid angle [Urena et al. 2013, "An Area-Preserving Parametrization for Spherical Rectangles"], triangles likewise [Arvo 1995,
/// "Stratified Sampling of Spherical Triangles"; Van Oosterom & Strackee 1983 for the solid angle], spheres by the cone that holds them. Shapes that look
/// small are sampled by area: there single precision does not resolve the angles, and the cosine hardly varies. Which way is taken depends on the point and
/// the shape alone, so the density of a ray that hits the shape is known.
#pragma once

#include "base/math.h"
#include "light/emitter_table.h"

namespace talbot::light {

inline constexpr float kRectBySolidAngle = 0.01f;    ///< sr: rectangles above are sampled by solid angle
inline constexpr float kEllipseBySolidAngle = 0.5f;  ///< sr of the bounding rectangle; samples outside the ellipse are lost
inline constexpr float kTriangleBySolidAngle = 0.02f;

/// A point on a shape. pdf 0: no sample.
struct ShapeSample {
    Vec3 wi;             ///< unit
    float distance = 0;  ///< m
    float pdf = 0;       ///< per solid angle
    float a = 0, b = 0;  ///< where on the shape: barycentrics, or metres from a rectangle's centre
};

/// A rectangle from a point: its frame's coordinates relative to the point's foot, clipped to what the spread lets the point see.
struct RectView {
    float x = 0, y = 0;  ///< centre
    float x0 = 0, x1 = 0, y0 = 0, y1 = 0;
    float z = 0;           ///< height of the point above the emitting side
    float side = 1;        ///< -1: the point is behind a two-sided rectangle
    float n0 = 0, n2 = 0;  ///< z of the edge planes' normals, [Urena et al. 2013, 4]
    float k = 0;
    float solid_angle = 0;
    float inv_area = 0;  ///< 1 / area that area sampling covers
    // Conditions are the signs of floats: loops with conditions made of several comparisons do not vectorise (g++ 12).
    float visible = 0;     ///< > 0: there is something to see
    float by_angle = 0;    ///< > 0: sampled by solid angle
    float by_ellipse = 0;  ///< > 0: (else) the whole ellipse is sampled by area
};

TALBOT_INLINE float sum_abs(Vec3 v) {
    return lane_abs(v.x) + lane_abs(v.y) + lane_abs(v.z);
}

/// The sum, 0 to 2 pi, of two angles of 0 to pi with cosines a and sines b: of the product of a0 + i b0 and a1 + i b1.
TALBOT_INLINE float sum_of_angles(float a0, float b0, float a1, float b1) {
    const float angle = lane_atan2(a0 * b1 + b0 * a1, a0 * a1 - b0 * b1);
    return angle < 0.0f ? angle + kTwoPi : angle;
}

TALBOT_INLINE RectView view_rect(const Rect& r, Vec3 o) {
    RectView v;
    const Vec3 d = r.center - o;
    const float h = -dot(d, r.normal);
    v.side = h * r.two_sided < 0.0f ? -1.0f : 1.0f;
    v.z = h * v.side;
    v.x = dot(d, r.axis_x);
    v.y = dot(d, r.axis_y);
    const float reach = minf(v.z * r.tan_limit, 1e18f);
    v.x0 = maxf(v.x - r.half_x, -reach);
    v.x1 = minf(v.x + r.half_x, reach);
    v.y0 = maxf(v.y - r.half_y, -reach);
    v.y1 = minf(v.y + r.half_y, reach);
    // A point on the rectangle itself is above or below it by rounding only, and would see half a world of it.
    const float rounding = 1e-6f * (sum_abs(o) + sum_abs(r.center) + r.half_x + r.half_y);
    v.visible = minf(v.z - rounding, minf(v.x1 - v.x0, v.y1 - v.y0));
    const float clipped = (v.x1 - v.x0) * (v.y1 - v.y0);

    // Angles at the corners of the spherical rectangle. cos = -n_i n_j; the sine from 1 - n^2 = z^2 / (z^2 + e^2), which does not cancel.
    const float z2 = maxf(v.z * v.z, 1e-36f);
    const float q0 = 1.0f / (z2 + v.y0 * v.y0), q1 = 1.0f / (z2 + v.x1 * v.x1), q2 = 1.0f / (z2 + v.y1 * v.y1), q3 = 1.0f / (z2 + v.x0 * v.x0);
    const float n0 = -v.y0 * std::sqrt(q0), n1 = v.x1 * std::sqrt(q1), n2 = v.y1 * std::sqrt(q2), n3 = -v.x0 * std::sqrt(q3);
    const float c0 = z2 * q0, c1 = z2 * q1, c2 = z2 * q2, c3 = z2 * q3;
    const float b0 = std::sqrt(maxf(c0 + c1 - c0 * c1, 0.0f)), b1 = std::sqrt(maxf(c1 + c2 - c1 * c2, 0.0f)), b2 = std::sqrt(maxf(c2 + c3 - c2 * c3, 0.0f)),
                b3 = std::sqrt(maxf(c3 + c0 - c3 * c0, 0.0f));
    v.n0 = n0;
    v.n2 = n2;
    v.k = kTwoPi - sum_of_angles(-n2 * n3, b2, -n3 * n0, b3);
    v.solid_angle = sum_of_angles(-n0 * n1, b0, -n1 * n2, b1) - v.k;
    v.by_angle = v.solid_angle - (r.is_ellipse > 0.0f ? kEllipseBySolidAngle : kRectBySolidAngle);
    v.by_ellipse = r.is_ellipse > 0.0f ? clipped - r.ellipse_area : 0.0f;
    v.inv_area = 1.0f / maxf(v.by_ellipse > 0.0f ? r.ellipse_area : clipped, 1e-37f);
    return v;
}

/// >= 0 inside the ellipse (always for rectangles).
TALBOT_INLINE float ellipse_margin(const Rect& r, float a, float b) {
    const float ex = a / maxf(r.half_x, 1e-30f), ey = b / maxf(r.half_y, 1e-30f);
    return 1.0f - (ex * ex + ey * ey) * r.is_ellipse;
}

TALBOT_INLINE float pdf_rect(const RectView& v, float distance) {
    const float by_area = distance * distance * distance * v.inv_area / maxf(v.z, 1e-30f);
    const float pdf = v.by_angle > 0.0f ? 1.0f / v.solid_angle : by_area;
    return v.visible > 0.0f ? pdf : 0.0f;
}

TALBOT_INLINE ShapeSample sample_rect(const Rect& r, const RectView& v, float u0, float u1) {
    // By solid angle: the column of the sphere whose share is u0, then the height within it (section 4.2 of the paper, with our z > 0).
    const float au = u0 * v.solid_angle + v.k;
    float sine, cosine;
    lane_sincos(au, sine, cosine);
    const float fu = (cosine * v.n0 - v.n2) / lane_copysign(maxf(lane_abs(sine), 1e-12f), sine);
    const float w2 = maxf(fu * fu + v.n0 * v.n0, 1.0f);
    const float xu = lane_copysign(v.z, fu) / std::sqrt(maxf(w2 - 1.0f, 1e-12f));
    const float xs = clampf(xu, v.x0, v.x1);
    const float d2 = xs * xs + v.z * v.z;
    const float d = std::sqrt(d2);
    const float h0 = v.y0 / std::sqrt(maxf(d2 + v.y0 * v.y0, 1e-37f)), h1 = v.y1 / std::sqrt(maxf(d2 + v.y1 * v.y1, 1e-37f));
    const float hv = h0 + u1 * (h1 - h0);
    const float ys = clampf(hv * d / std::sqrt(maxf(1.0f - hv * hv, 1e-12f)), v.y0, v.y1);
    // By area: the clipped rectangle, or the whole ellipse.
    const float xr = lerp(v.x0, v.x1, u0), yr = lerp(v.y0, v.y1, u1);
    float sp, cp;
    lane_sincos(u1 * kTwoPi, sp, cp);
    const float radius = std::sqrt(u0);
    const float xe = v.x + r.half_x * radius * cp, ye = v.y + r.half_y * radius * sp;

    const float xa = v.by_ellipse > 0.0f ? xe : xr, ya = v.by_ellipse > 0.0f ? ye : yr;
    const float x = v.by_angle > 0.0f ? xs : xa, y = v.by_angle > 0.0f ? ys : ya;
    const float t2 = x * x + y * y + v.z * v.z;
    ShapeSample s;
    s.distance = std::sqrt(t2);
    const float inv = 1.0f / maxf(s.distance, 1e-30f);
    s.wi = (r.axis_x * x + r.axis_y * y - r.normal * (v.z * v.side)) * inv;
    s.a = x - v.x;
    s.b = y - v.y;
    s.pdf = pdf_rect(v, s.distance);
    return s;
}

/// Radiance of an area lamp relative to its power, by the spread's profile.
TALBOT_INLINE float spread_profile(float inv_tan_limit, float gain, float x, float y, float z) {
    return maxf(1.0f - std::sqrt(x * x + y * y) / maxf(z, 1e-30f) * inv_tan_limit, 0.0f) * gain;
}

/// Disk through `center` that faces the origin.
TALBOT_INLINE float pdf_facing_disk(float d, float radius, float distance) {
    return distance * distance * distance / maxf(d * kPi * radius * radius, 1e-37f);
}
TALBOT_INLINE ShapeSample sample_facing_disk(Vec3 center, float radius, Vec3 o, float u0, float u1) {
    const Vec3 to = center - o;
    const float d = length(to);
    const Vec3 axis = to * (1.0f / maxf(d, 1e-30f));
    Vec3 x, y;
    make_basis(axis, x, y);
    float sp, cp;
    lane_sincos(u1 * kTwoPi, sp, cp);
    const float rho = radius * std::sqrt(u0);
    ShapeSample s;
    s.distance = std::sqrt(d * d + rho * rho);
    s.wi = (axis * d + x * (rho * cp) + y * (rho * sp)) * (1.0f / maxf(s.distance, 1e-30f));
    s.pdf = d > 0.0f ? pdf_facing_disk(d, radius, s.distance) : 0.0f;
    return s;
}

/// Sphere: uniform in the cone that holds it; from inside, uniform over all directions.
TALBOT_INLINE float pdf_sphere(float d2, float radius) {
    const float sin2 = minf(radius * radius / maxf(d2, 1e-30f), 1.0f);
    const float one_minus_cos = sin2 / (1.0f + safe_sqrt(1.0f - sin2));
    return d2 <= radius * radius ? 0.25f * kInvPi : 0.5f * kInvPi / one_minus_cos;
}
TALBOT_INLINE ShapeSample sample_sphere(Vec3 center, float radius, Vec3 o, float u0, float u1) {
    const Vec3 to = center - o;
    const float d2 = dot(to, to), d = std::sqrt(d2);
    const bool inside = d2 <= radius * radius;
    const float sin2 = minf(radius * radius / maxf(d2, 1e-30f), 1.0f);
    const float drop = u0 * (inside ? 2.0f : sin2 / (1.0f + safe_sqrt(1.0f - sin2)));  // 1 - cos
    const float c = 1.0f - drop, s2 = maxf(drop * (2.0f - drop), 0.0f);
    Vec3 axis = to * (1.0f / maxf(d, 1e-30f));
    axis = d > 0.0f ? axis : Vec3{0.0f, 0.0f, 1.0f};
    Vec3 x, y;
    make_basis(axis, x, y);
    float sp, cp;
    lane_sincos(u1 * kTwoPi, sp, cp);
    const float sn = std::sqrt(s2);
    ShapeSample s;
    s.wi = axis * c + x * (sn * cp) + y * (sn * sp);
    const float half_chord = safe_sqrt(radius * radius - d2 * s2);
    s.distance = maxf(inside ? d * c + half_chord : d * c - half_chord, 0.0f);
    s.pdf = pdf_sphere(d2, radius);
    return s;
}

/// A triangle from a point: vertices relative to it.
struct TriangleView {
    Vec3 a, b, c;
    Vec3 n;            ///< cross(b - a, c - a): twice the area
    float height = 0;  ///< a . n: 6 volumes; the sign tells the side
    float inv_lengths = 0;
    float solid_angle = 0;
    float by_angle = 0;  ///< > 0: sampled by solid angle
};
TALBOT_INLINE TriangleView view_triangle(Vec3 a, Vec3 b, Vec3 c, Vec3 o) {
    TriangleView t;
    t.n = cross(b - a, c - a);
    t.a = a - o;
    t.b = b - o;
    t.c = c - o;
    t.height = dot(t.a, t.n);
    const float la = length(t.a), lb = length(t.b), lc = length(t.c);
    const float denominator = la * lb * lc + dot(t.a, t.b) * lc + dot(t.a, t.c) * lb + dot(t.b, t.c) * la;
    t.solid_angle = 2.0f * lane_atan2(lane_abs(t.height), denominator);
    t.inv_lengths = 1.0f / maxf(la * lb * lc, 1e-37f);
    // Thin slivers and points almost in the plane are left to area sampling.
    t.by_angle = minf(t.solid_angle - kTriangleBySolidAngle, lane_abs(t.height) * t.inv_lengths - 1e-4f);
    return t;
}
TALBOT_INLINE float pdf_triangle(const TriangleView& t, float distance) {
    const float h = lane_abs(t.height);
    const float by_area = 2.0f * distance * distance * distance / maxf(h, 1e-37f);
    const float pdf = t.by_angle > 0.0f ? 1.0f / t.solid_angle : by_area;
    return h > 0.0f ? pdf : 0.0f;
}
TALBOT_INLINE ShapeSample sample_triangle(const TriangleView& t, float u0, float u1) {
    const Vec3 e1 = t.b - t.a, e2 = t.c - t.a;
    const float su = std::sqrt(u0);
    const float area_b = 1.0f - su, area_c = u1 * su;
    const Vec3 by_area = t.a + e1 * area_b + e2 * area_c;

    // [Arvo 1995]: the sub-triangle with share u0 fixes the point c' on the arc from a to c, u1 the place between b and c'.
    const Vec3 a = normalize(t.a), b = normalize(t.b), c = normalize(t.c);
    const float ab = dot(a, b), ac = dot(a, c), bc = dot(b, c);
    const float volume = lane_abs(t.height) * t.inv_lengths;
    const float along = bc - ab * ac;
    const float inv_alpha = 1.0f / maxf(std::sqrt(volume * volume + along * along), 1e-30f);
    const float sin_alpha = volume * inv_alpha, cos_alpha = along * inv_alpha;
    float s0, c0;
    lane_sincos(u0 * t.solid_angle, s0, c0);
    const float s = s0 * cos_alpha - c0 * sin_alpha, k = c0 * cos_alpha + s0 * sin_alpha;  // sin, cos (share - alpha)
    const float uu = k - cos_alpha, vv = s + sin_alpha * ab;
    const float below = (vv * s + uu * k) * sin_alpha;
    const float q = clampf(((vv * k - uu * s) * cos_alpha - vv) / (lane_abs(below) < 1e-30f ? 1e-30f : below), -1.0f, 1.0f);
    const Vec3 cc = a * q + normalize(c - a * ac) * safe_sqrt(1.0f - q * q);
    const float z = 1.0f - u1 * (1.0f - dot(cc, b));
    const Vec3 direction = b * z + normalize(cc - b * dot(cc, b)) * safe_sqrt(1.0f - z * z);
    const float facing = dot(direction, t.n);
    const Vec3 by_angle = direction * (t.height / (lane_abs(facing) < 1e-30f ? 1e-30f : facing));

    const Vec3 p = t.by_angle > 0.0f ? by_angle : by_area;
    const float inv_n2 = 1.0f / maxf(dot(t.n, t.n), 1e-37f);
    const Vec3 r = p - t.a;
    ShapeSample out;
    out.distance = length(p);
    out.wi = p * (1.0f / maxf(out.distance, 1e-30f));
    out.a = t.by_angle > 0.0f ? saturate(dot(cross(r, e2), t.n) * inv_n2) : area_b;
    out.b = t.by_angle > 0.0f ? saturate(dot(cross(e1, r), t.n) * inv_n2) : area_c;
    out.pdf = pdf_triangle(t, out.distance);
    return out;
}

/// Intensity of a spot towards `away` (unit, from the lamp) relative to a point lamp's.
TALBOT_INLINE float spot_profile(const Lamp& lamp, Vec3 away) {
    const float x = dot(lamp.cone.x, away), y = dot(lamp.cone.y, away), z = dot(lamp.cone.z, away);
    const float c = -z / maxf(std::sqrt(x * x + y * y + z * z), 1e-30f);
    const float t = saturate((c - lamp.cos_outer) * lamp.inv_smooth);
    const float cone = t * t * (3.0f - 2.0f * t) * lerp(1.0f, maxf(c, 0.0f), lamp.axis_power);
    return lerp(1.0f, cone, lamp.is_spot);
}

}  // namespace talbot::light
