#include "light/kernels/sample_local.h"
#include "light/kernels/select_emitter.h"
#include "light/kernels/world_map.h"

namespace talbot::light {
inline namespace TALBOT_ISA {
namespace {

void clear(const LightQuery& query, const LightSamples& out) {
    for (int i = 0; i < query.n; ++i) {
        store(out.wi, i, load(query.n_s, i));
        store(out.radiance, i, {});
        out.distance[i] = 0.0f;
        out.pdf[i] = 0.0f;
        out.is_delta[i] = 0;
        out.blockers[i] = scene::kVisibleShadow;
        out.visibility[i] = 0;
    }
    if (out.light_group) std::fill_n(out.light_group, query.n, -1);
}

TALBOT_INLINE bool is_black(Rgb c) {
    return c.x == 0.0f && c.y == 0.0f && c.z == 0.0f;
}

void sample_local(const EmitterView& table, const LightQuery& query, const shader::Programs& programs, const shader::ShaderContext& context,
                  LightScratch& scratch, const LightSamples& out) {
    int32_t emitter[kSpan];
    float probability[kSpan];
    choose_emitters(table, query.p, query.receiver, query.pick_u, query.n, {emitter, probability});

    if (out.light_group) {
        for (int i = 0; i < query.n; ++i) out.light_group[i] = emitter[i] >= 0 ? table.light_groups[emitter[i]] : -1;
    }

    LocalGroup group;
    LocalSampled found;
    for (int k = 0; k < kEmitterKinds; ++k) {
        if (!table.has_kind[k]) continue;
        const EmitterKind kind = EmitterKind(k);
        int n = 0;
        for (int i = 0; i < query.n; ++i) {
            group.lane[n] = i;
            n += emitter[i] >= 0 && table.emitters[emitter[i]].kind == k;
        }
        if (n == 0) continue;
        group.n = n;
        // Mostly all lanes: then plain copies serve.
        const bool whole = n == query.n;
        const auto take = [&](const auto* from, auto* to) { whole ? void(std::memcpy(to, from, size_t(n) * 4)) : gather(from, group.lane, n, to); };
        take(emitter, group.emitter);
        take(query.p.x, group.px);
        take(query.p.y, group.py);
        take(query.p.z, group.pz);
        take(query.u, group.u);
        take(query.v, group.v);
        take(query.pick_v, group.part);
        if (table.has_lamp_programs || table.has_mesh_programs) group.depths = group.depth_columns.of(query.depths, group.lane, n);
        if (query.time)
            take(query.time, group.time);
        else
            std::fill_n(group.time, n, 0.5f);
        switch (kind) {
            case EmitterKind::Rect:
                sample_rects(table, programs, group, found);
                break;
            case EmitterKind::Mesh:
                sample_meshes(table, programs, context, scratch, group, found);
                break;
            default:
                sample_point_lamps(table, kind, group, found);
                break;
        }
        if (table.has_lamp_programs && kind != EmitterKind::Mesh) {
            float p[3][kSpan], wo[3][kSpan];
            for (int i = 0; i < n; ++i) {
                const Vec3 wi{found.x[i], found.y[i], found.z[i]};
                store({p[0], p[1], p[2]}, i, Vec3{group.px[i], group.py[i], group.pz[i]} + wi * found.distance[i]);
                store({wo[0], wo[1], wo[2]}, i, -wi);
            }
            const LampPoints points{{p[0], p[1], p[2]}, {found.nx, found.ny, found.nz}, {wo[0], wo[1], wo[2]}, found.coordinate_u, found.coordinate_v,
                                    found.distance};
            apply_lamp_programs(table, programs, context, scratch, found.lamp, false, points, false, group.depths, n, {found.r, found.g, found.b});
        }

        float chance[kSpan];
        int32_t shines[kSpan], bounces[kSpan];
        take(probability, chance);
        take(query.depths.bounces, bounces);
        TALBOT_VECTOR_LOOP
        for (int i = 0; i < n; ++i) {
            const float pdf = found.pdf[i] * chance[i];
            const bool dark = (found.r[i] == 0.0f) & (found.g[i] == 0.0f) & (found.b[i] == 0.0f);
            shines[i] = !dark & (pdf > 0.0f) & (pdf < 1e30f) & (bounces[i] <= found.max_bounces[i]);
            found.pdf[i] = pdf;
        }
        const auto put = [&](const auto* from, auto* to) {
            if (whole) {
                for (int i = 0; i < n; ++i) to[i] = shines[i] ? from[i] : to[i];
            } else {
                for (int i = 0; i < n; ++i)
                    if (shines[i]) to[group.lane[i]] = from[i];
            }
        };
        put(found.x, out.wi.x);
        put(found.y, out.wi.y);
        put(found.z, out.wi.z);
        put(found.r, out.radiance.x);
        put(found.g, out.radiance.y);
        put(found.b, out.radiance.z);
        put(found.distance, out.distance);
        put(found.pdf, out.pdf);
        put(found.visibility, out.visibility);
        put(found.blockers, out.blockers);
        for (int i = 0; i < n; ++i) out.is_delta[group.lane[i]] = uint8_t(found.only_sampled[i]);
    }
}

void sample_suns(const EmitterView& table, const LightQuery& query, const int32_t* sun, const float* probability, const shader::Programs& programs,
                 const shader::ShaderContext& context, LightScratch& scratch, const LightSamples& out) {
    const float infinite = as_float(0x7f800000);
    float wo[3][kSpan], u[kSpan], v[kSpan], distance[kSpan];
    for (int i = 0; i < query.n; ++i) {
        if (sun[i] < 0) continue;
        const Sun& s = table.suns[sun[i]];
        const float drop = query.u[i] * s.one_minus_cos;
        const float c = 1.0f - drop, radius = safe_sqrt(drop * (2.0f - drop));
        float sp, cp;
        lane_sincos(query.v[i] * kTwoPi, sp, cp);
        const Vec3 wi = s.direction * c + s.axis_x * (radius * cp) + s.axis_y * (radius * sp);
        const bool is_delta = s.one_minus_cos == 0.0f;
        const float profile = s.tangent_profile && !is_delta ? 1.0f / maxf(c * c * c, 1e-12f) : 1.0f;
        const float edge = maxf(safe_sqrt(s.one_minus_cos * (2.0f - s.one_minus_cos)), 1e-12f);
        store(out.wi, i, wi);
        store(out.radiance, i, s.power * profile);
        out.distance[i] = infinite;
        out.pdf[i] = query.depths.bounces[i] > s.max_bounces ? 0.0f : probability[i] * (is_delta ? 1.0f : 0.5f * kInvPi / s.one_minus_cos);
        out.is_delta[i] = is_delta || is_only_sampled(s.hit_visibility, s.linked_visibility);
        out.blockers[i] = s.blockers;
        out.visibility[i] = s.visibility;
        if (out.light_group) out.light_group[i] = s.light_group;
        store({wo[0], wo[1], wo[2]}, i, -wi);
        u[i] = 0.5f + 0.5f * radius * cp / edge;
        v[i] = 0.5f + 0.5f * radius * sp / edge;
        distance[i] = infinite;
    }
    if (!table.has_lamp_programs) return;
    const LampPoints points{out.wi, {wo[0], wo[1], wo[2]}, {wo[0], wo[1], wo[2]}, u, v, distance};
    apply_lamp_programs(table, programs, context, scratch, sun, true, points, false, query.depths, query.n, out.radiance);
}

void sample_distant(const EmitterView& table, const LightQuery& query, const shader::Programs& programs, const shader::ShaderContext& context,
                    LightScratch& scratch, const LightSamples& out) {
    const int n = query.n;
    int32_t sun[kSpan], world_lane[kSpan];
    float probability[kSpan];
    int worlds = 0;
    for (int i = 0; i < n; ++i) {
        const int32_t receiver = query.receiver ? query.receiver[i] : -1;
        const float scale = query.receiver ? table.distant_scale[receiver] : 1.0f;
        float u = query.pick_u[i];
        int last = -1;  // that lights the point
        sun[i] = -1;
        probability[i] = table.world.probability * scale;
        for (int s = 0; s < table.sun_count; ++s) {
            if (!is_lit(table.suns[s].receivers, receiver)) continue;
            const float p = table.suns[s].probability * scale;
            last = s;
            if (u < p) {
                sun[i] = s;
                probability[i] = p;
                break;
            }
            u -= p;
        }
        // Rounding may leave a crumb beyond the last one.
        if (sun[i] < 0 && table.world.probability == 0.0f && last >= 0) {
            sun[i] = last;
            probability[i] = table.suns[last].probability * scale;
        }
        world_lane[worlds] = i;
        worlds += sun[i] < 0;
    }
    if (table.sun_count > 0) sample_suns(table, query, sun, probability, programs, context, scratch, out);
    if (worlds == 0 || table.world.probability == 0.0f) return;

    float u[kSpan], v[kSpan], x[kSpan], y[kSpan], z[kSpan], pdf[kSpan], r[kSpan], g[kSpan], b[kSpan];
    DepthColumns depths;
    gather(query.u, world_lane, worlds, u);
    gather(query.v, world_lane, worlds, v);
    sample_world(table.world, u, v, worlds, {x, y, z}, pdf);
    evaluate_background(programs, context, scratch, table.world_shader, {x, y, z}, depths.of(query.depths, world_lane, worlds), worlds, {r, g, b});
    for (int i = 0; i < worlds; ++i) {
        const int lane = world_lane[i];
        const Rgb radiance{r[i], g[i], b[i]};
        if (is_black(radiance) || query.depths.bounces[lane] > table.world_max_bounces) continue;
        store(out.wi, lane, {x[i], y[i], z[i]});
        store(out.radiance, lane, radiance);
        out.distance[lane] = as_float(0x7f800000);
        out.pdf[lane] = pdf[i] * probability[lane];
        out.visibility[lane] = table.world_visibility;
        if (out.light_group) out.light_group[lane] = table.world_light_group;
    }
}

}  // namespace

void sample_emitters(const EmitterTable& table, Stratum stratum, const LightQuery& query, const shader::Programs& programs,
                     const shader::ShaderContext& context, LightScratch& scratch, const LightSamples& out) {
    clear(query, out);
    if (stratum == Stratum::Distant) {
        sample_distant(table.view, query, programs, context, scratch, out);
    } else if (table.view.emitter_count > 0) {
        sample_local(table.view, query, programs, context, scratch, out);
    }
}

}  // namespace TALBOT_ISA
}  // namespace talbot::light
