#include "light/kernels/sample_local.h"
#include "light/kernels/select_emitter.h"

namespace talbot::light {
inline namespace TALBOT_ISA {
namespace {

/// Distance along the ray to one lamp, or -1.
template <EmitterKind kind>
TALBOT_INLINE float hit_lamp(const Lamp& lamp, const Rect& rect, Vec3 o, Vec3 d) {
    if constexpr (kind == EmitterKind::Rect) {
        const Vec3 to = rect.center - o;
        const float along = dot(d, rect.normal);
        const float t = dot(to, rect.normal) / (lane_abs(along) < 1e-30f ? -1e-30f : along);
        const Vec3 q = d * t - to;
        const float a = dot(q, rect.axis_x), b = dot(q, rect.axis_y);
        const float inside = minf(minf(rect.half_x - lane_abs(a), rect.half_y - lane_abs(b)), ellipse_margin(rect, a, b));
        const float front = inside >= 0.0f ? along : 0.0f;
        return front < 0.0f ? t : -1.0f;
    } else if constexpr (kind == EmitterKind::FacingDisk) {
        const Vec3 to = lamp.center - o;
        const float d2 = dot(to, to), along = dot(d, to);
        const float t = d2 / maxf(along, 1e-30f);
        const Vec3 q = d * t - to;
        return along > 0.0f && dot(q, q) <= lamp.radius * lamp.radius ? t : -1.0f;
    } else {
        // The nearest point first: the squared distance of the centre from the ray does not cancel.
        const Vec3 to = lamp.center - o;
        const float along = dot(to, d);
        const Vec3 off = to - d * along;
        const float rest = lamp.radius * lamp.radius - dot(off, off);
        const float half = safe_sqrt(rest);
        const bool inside = dot(to, to) <= lamp.radius * lamp.radius;
        const float t = inside ? along + half : along - half;
        return rest >= 0.0f ? t : -1.0f;
    }
}

template <EmitterKind kind>
TALBOT_INLINE void intersect_lamp(const EmitterView& table, int32_t index, Met met, ConstColumns3 origin, ConstColumns3 direction,
                                  const float* __restrict t_min, const int32_t* __restrict visibility, int n, int32_t* __restrict emitter,
                                  float* __restrict t) {
    const Lamp lamp = table.lamps[index];
    const int32_t seen_by = met == Met::Linked ? lamp.linked_visibility : lamp.hit_visibility;
    const Rect rect = lamp.rect >= 0 ? table.rects[lamp.rect] : Rect{};
    ConstColumn ox = origin.x, oy = origin.y, oz = origin.z, dx = direction.x, dy = direction.y, dz = direction.z;
    TALBOT_VECTOR_LOOP
    for (int i = 0; i < n; ++i) {
        const float hit = hit_lamp<kind>(lamp, rect, {ox[i], oy[i], oz[i]}, {dx[i], dy[i], dz[i]});
        const float between = minf(hit - t_min[i], t[i] - hit);
        const float nearer = (visibility[i] & seen_by) != 0 ? between : 0.0f;
        t[i] = nearer > 0.0f ? hit : t[i];
        emitter[i] = nearer > 0.0f ? index : emitter[i];
    }
}

}  // namespace

void intersect_lamps(const EmitterTable& table_, ConstColumns3 origin, ConstColumns3 direction, const float* t_max, const int32_t* visibility, int n,
                     int32_t* emitter, float* t, const float* t_min, Met met) {
    const EmitterView& table = table_.view;
    const bool linked = met == Met::Linked;
    const int32_t* lamps = linked ? table.linked_lamps : table.visible_lamps;
    const int count = linked ? table.linked_lamp_count : table.visible_lamp_count;
    for (int begin = 0; begin < n; begin += kSpan) {
        const int m = n - begin < kSpan ? n - begin : kSpan;
        const ConstColumns3 o(origin.x + begin, origin.y + begin, origin.z + begin), d(direction.x + begin, direction.y + begin, direction.z + begin);
        float nearest[kSpan], start[kSpan];
        int32_t found[kSpan];
        for (int i = 0; i < m; ++i) {
            nearest[i] = t_max[begin + i];
            start[i] = t_min ? t_min[begin + i] : 0.0f;
            found[i] = -1;
        }
        for (int k = 0; k < count; ++k) {
            const int32_t index = lamps[k];
            switch (EmitterKind(table.lamps[index].kind)) {
                case EmitterKind::Rect:
                    intersect_lamp<EmitterKind::Rect>(table, index, met, o, d, start, visibility + begin, m, found, nearest);
                    break;
                case EmitterKind::FacingDisk:
                    intersect_lamp<EmitterKind::FacingDisk>(table, index, met, o, d, start, visibility + begin, m, found, nearest);
                    break;
                default:
                    intersect_lamp<EmitterKind::Sphere>(table, index, met, o, d, start, visibility + begin, m, found, nearest);
                    break;
            }
        }
        for (int i = 0; i < m; ++i) {
            emitter[begin + i] = found[i];
            t[begin + i] = nearest[i];
        }
    }
}

void shade_lamps(const EmitterTable& table_, ConstColumns3 origin, ConstColumns3 direction, const int32_t* lamp_index, const float* t, int n,
                 const shader::Programs& programs, const shader::ShaderContext& context, LightScratch& scratch, Columns3 radiance, float* pdf,
                 const PathDepths& depths, const int32_t* receiver) {
    const EmitterView& table = table_.view;
    for (int i = 0; i < n; ++i) {
        store(radiance, i, {});
        pdf[i] = 0.0f;
    }
    for (int begin = 0; begin < n; begin += kSpan) {
        const int end = n < begin + kSpan ? n : begin + kSpan;
        int32_t lane[kSpan], chosen[kSpan], emitter[kSpan], set[kSpan];
        float o[3][kSpan], probability[kSpan], r[3][kSpan], p[3][kSpan], wo[3][kSpan], normal[3][kSpan], u[kSpan], v[kSpan], distance[kSpan];
        int count = 0;
        for (int i = begin; i < end; ++i) {
            if (lamp_index[i] < 0 || (receiver && !is_lit(table.lamps[lamp_index[i]].receivers, receiver[i]))) continue;
            set[count] = receiver && receiver[i] >= 0 ? receiver[i] : 0;
            lane[count] = i;
            chosen[count] = lamp_index[i];
            emitter[count++] = table.lamps[lamp_index[i]].emitter;
        }
        if (count == 0) continue;
        gather3(origin, lane, count, {o[0], o[1], o[2]});
        gather(t, lane, count, distance);
        choice_probability(table, {o[0], o[1], o[2]}, receiver ? set : nullptr, emitter, count, probability);
        for (int j = 0; j < count; ++j) {
            const Lamp& lamp = table.lamps[chosen[j]];
            const Vec3 from{o[0][j], o[1][j], o[2][j]};
            const Vec3 d = load(direction, lane[j]);
            const Vec3 hit = from + d * distance[j];
            float gain = 1.0f, shape = 0.0f;
            Vec3 facing = -d;
            if (lamp.kind == int32_t(EmitterKind::Rect)) {
                const Rect& rect = table.rects[lamp.rect];
                const RectView view = view_rect(rect, from);
                const float a = dot(hit - rect.center, rect.axis_x), b = dot(hit - rect.center, rect.axis_y);
                gain = spread_profile(lamp.inv_tan_limit, lamp.gain, a + view.x, b + view.y, view.z);
                shape = pdf_rect(view, distance[j]);
                facing = rect.normal;
                rect_coordinates(rect, a, b, u[j], v[j]);
            } else {
                const float d2 = dot(lamp.center - from, lamp.center - from);
                const bool sphere = lamp.kind == int32_t(EmitterKind::Sphere);
                gain = spot_profile(lamp, -d);
                shape = sphere ? pdf_sphere(d2, lamp.radius) : pdf_facing_disk(std::sqrt(d2), lamp.radius, distance[j]);
                facing = sphere ? normalize(hit - lamp.center) : -d;
                lamp_coordinates(lamp, facing, u[j], v[j]);
            }
            store({r[0], r[1], r[2]}, j, lamp.power * gain);
            store({p[0], p[1], p[2]}, j, hit);
            store({wo[0], wo[1], wo[2]}, j, -d);
            store({normal[0], normal[1], normal[2]}, j, facing);
            const float value = shape * probability[j];
            pdf[lane[j]] = value < 1e30f ? value : 0.0f;
        }
        if (table.has_lamp_programs) {
            const LampPoints points{{p[0], p[1], p[2]}, {normal[0], normal[1], normal[2]}, {wo[0], wo[1], wo[2]}, u, v, distance};
            DepthColumns own;
            apply_lamp_programs(table, programs, context, scratch, chosen, false, points, true, own.of(depths, lane, count), count, {r[0], r[1], r[2]});
        }
        for (int j = 0; j < count; ++j) store(radiance, lane[j], {r[0][j], r[1][j], r[2][j]});
    }
}

namespace {

/// Multiplies the radiance of rays in `direction` by what the nodes of a sun make of its disc.
void apply_sun_program(const EmitterView& table, int32_t index, ConstColumns3 direction, const shader::Programs& programs, const shader::ShaderContext& context,
                       LightScratch& scratch, const PathDepths& depths, int n, Columns3 radiance) {
    const Sun& sun = table.suns[index];
    const float edge = safe_sqrt(sun.one_minus_cos * (2.0f - sun.one_minus_cos));
    int32_t chosen[kSpan];
    float wo[3][kSpan], u[kSpan], v[kSpan], distance[kSpan];
    for (int i = 0; i < n; ++i) {
        const Vec3 d = load(direction, i);
        const bool dark = radiance.x[i] == 0.0f && radiance.y[i] == 0.0f && radiance.z[i] == 0.0f;
        chosen[i] = dark ? -1 : index;
        store({wo[0], wo[1], wo[2]}, i, -d);
        u[i] = 0.5f + 0.5f * dot(d, sun.axis_x) / edge;
        v[i] = 0.5f + 0.5f * dot(d, sun.axis_y) / edge;
        distance[i] = as_float(0x7f800000);
    }
    const LampPoints points{direction, {wo[0], wo[1], wo[2]}, {wo[0], wo[1], wo[2]}, u, v, distance};
    apply_lamp_programs(table, programs, context, scratch, chosen, true, points, true, depths, n, radiance);
}

}  // namespace

void shade_suns(const EmitterTable& table_, ConstColumns3 direction, const int32_t* visibility, const float* bsdf_pdf, int n, const shader::Programs& programs,
                const shader::ShaderContext& context, LightScratch& scratch, Columns3 radiance, const PathDepths& depths, const int32_t* receiver, Met met,
                int only) {
    const EmitterView& table = table_.view;
    for (int i = 0; i < n; ++i) store(radiance, i, {});
    for (int k = only < 0 ? 0 : only, end = only < 0 ? table.sun_count : only + 1; k < end; ++k) {
        const Sun sun = table.suns[k];
        const int32_t seen_by = met == Met::Linked ? sun.linked_visibility : sun.hit_visibility;
        if (seen_by == 0 || sun.one_minus_cos == 0.0f) continue;
        const float pdf = sun.probability * 0.5f * kInvPi / sun.one_minus_cos;
        const float tangent = sun.tangent_profile ? 1.0f : 0.0f;
        float scale[kSpan];  // of the density; negative where the sun does not shine on the receiver
        fill(scale, n, 1.0f);
        for (int i = 0; receiver && i < n; ++i)
            scale[i] = !is_lit(sun.receivers, receiver[i]) ? -1.0f : receiver[i] < 0 ? 1.0f : table.distant_scale[receiver[i]];
        ConstColumn dx = direction.x, dy = direction.y, dz = direction.z;
        float own_radiance[3][kSpan];
        Column r = own_radiance[0], g = own_radiance[1], b = own_radiance[2];
        TALBOT_VECTOR_LOOP
        for (int i = 0; i < n; ++i) {
            // 1 - cos from the difference of the directions: exact for small discs.
            const Vec3 apart{dx[i] - sun.direction.x, dy[i] - sun.direction.y, dz[i] - sun.direction.z};
            const float drop = 0.5f * dot(apart, apart);
            const float facing = (visibility[i] & seen_by) != 0 ? sun.one_minus_cos - drop : -1.0f;
            const float seen = minf(facing, scale[i]);
            const float own = bsdf_pdf[i], ratio = pdf * scale[i] / maxf(own, 1e-20f);
            const float weight = own < 0.0f ? 1.0f : 1.0f / (1.0f + ratio * ratio);
            const float c = maxf(1.0f - drop, 1e-4f);
            const float f = seen >= 0.0f ? weight * lerp(1.0f, 1.0f / (c * c * c), tangent) : 0.0f;
            r[i] = sun.power.x * f;
            g[i] = sun.power.y * f;
            b[i] = sun.power.z * f;
        }
        if (sun.program_shader >= 0) apply_sun_program(table, k, direction, programs, context, scratch, depths, n, {r, g, b});
        Column x = radiance.x, y = radiance.y, z = radiance.z;
        TALBOT_VECTOR_LOOP
        for (int i = 0; i < n; ++i) {
            x[i] += r[i];
            y[i] += g[i];
            z[i] += b[i];
        }
    }
}

int32_t lamp_blockers(const EmitterTable& table, int32_t lamp) {
    return table.view.lamps[lamp].blockers;
}

int32_t sun_blockers(const EmitterTable& table, int32_t sun) {
    return table.view.suns[sun].blockers;
}

int32_t lamp_light_group(const EmitterTable& table, int32_t lamp) {
    return table.view.lamps[lamp].light_group;
}

int32_t sun_light_group(const EmitterTable& table, int32_t sun) {
    return table.view.suns[sun].light_group;
}

}  // namespace TALBOT_ISA
}  // namespace talbot::light
