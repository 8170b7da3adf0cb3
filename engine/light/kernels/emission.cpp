#include "light/kernels/emission.h"

#include "geometry/surface.h"

namespace talbot::light {
inline namespace TALBOT_ISA {
namespace {

TALBOT_INLINE float finite_or_black(float x) {
    return lane_abs(x) <= 3e38f ? x : 0.0f;
}

template <class T>
TALBOT_INLINE T* take_column(float*& next) {
    T* column = reinterpret_cast<T*>(next);
    next += kSpan;
    return column;
}

template <class T>
TALBOT_INLINE void fill_column(T* column, int n, T value) {
    for (int i = 0; i < n; ++i) column[i] = value;
}

/// Bounces of the paths of lanes list[0..n) in the span. Light that is asked for or met is one bounce further than its path.
void gather_depths(const PathDepths& depths, const int32_t* list, int n, bool is_further, shader::ShadingSpan& s) {
    const auto take = [&](const int32_t* from, int32_t* to) {
        if (from) gather(from, list, n, to);
    };
    take(depths.bounces, s.depth);
    for (int i = 0; is_further && i < n; ++i) ++s.depth[i];
    take(depths.diffuse, s.diffuse_depth);
    take(depths.glossy, s.glossy_depth);
    take(depths.transparent, s.transparent_depth);
    take(depths.transmission, s.transmission_depth);
}

}  // namespace

void prepare_span(LightScratch& scratch, int n) {
    shader::ShadingSpan& s = scratch.span;
    float* next = scratch.columns;
    s = shader::ShadingSpan{};
    s.n = n;
    for (Columns3* c : {&s.p, &s.n_s, &s.n_g, &s.wo}) *c = {take_column<float>(next), take_column<float>(next), take_column<float>(next)};
    for (float** c : {&s.u, &s.v, &s.ray_length, &s.footprint}) {
        *c = take_column<float>(next);
        fill_column(*c, n, 0.0f);
    }
    for (int32_t** c : {&s.object, &s.primitive, &s.constants, &s.ray_flags, &s.backfacing, &s.depth, &s.diffuse_depth, &s.glossy_depth, &s.transparent_depth,
                        &s.transmission_depth}) {
        *c = take_column<int32_t>(next);
        fill_column(*c, n, 0);
    }
    fill_column(s.object, n, -1);
    fill_column(s.primitive, n, -1);
    for (uint32_t** c : {&s.key, &s.sample, &s.vertex}) {
        *c = take_column<uint32_t>(next);
        fill_column(*c, n, 0u);
    }
}

void evaluate_emission(const shader::Programs& programs, const shader::ShaderContext& context, LightScratch& scratch, int shader, Columns3 out) {
    const shader::CompiledShader& compiled = programs.shaders[size_t(shader)];
    shader::ShadingSpan& span = scratch.span;
    const int n = span.n;
    const shader::Program* program = compiled.emission >= 0 ? programs.programs[size_t(compiled.emission)].get() : nullptr;
    if (!program || program->emission == shader::kNoRegister) {
        const Rgb c = compiled.emission_is_constant ? compiled.constant_emission : Rgb{};
        for (int i = 0; i < n; ++i) store(out, i, c);
        return;
    }
    fill_column(span.constants, n, compiled.constants);
    span.uniform_constants = true;
    shader::run_program(*program, programs, span, context, scratch.registers);
    const float* __restrict r = scratch.registers + size_t(program->emission) * kSpan;
    Column x = out.x, y = out.y, z = out.z;
    TALBOT_VECTOR_LOOP
    for (int i = 0; i < n; ++i) {
        x[i] = finite_or_black(r[i]);
        y[i] = finite_or_black(r[kSpan + i]);
        z[i] = finite_or_black(r[2 * kSpan + i]);
    }
}

void evaluate_background(const shader::Programs& programs, const shader::ShaderContext& context, LightScratch& scratch, int shader, ConstColumns3 direction,
                         const PathDepths& depths, int n, Columns3 out) {
    prepare_span(scratch, n);
    shader::ShadingSpan& s = scratch.span;
    s.is_background = true;
    int32_t identity[kSpan];
    for (int i = 0; i < n; ++i) {
        identity[i] = i;
        const Vec3 d = load(direction, i);
        store(s.p, i, d);
        store(s.n_s, i, -d);
        store(s.n_g, i, -d);
        store(s.wo, i, -d);
        s.ray_length[i] = as_float(0x7f800000);
    }
    gather_depths(depths, identity, n, true, s);
    evaluate_emission(programs, context, scratch, shader, out);
}

void apply_lamp_programs(const EmitterView& table, const shader::Programs& programs, const shader::ShaderContext& context, LightScratch& scratch,
                         const int32_t* lamp, bool is_sun, const LampPoints& points, bool is_hit, const PathDepths& depths, int n, Columns3 radiance) {
    uint8_t waiting[kSpan];
    for (int i = 0; i < n; ++i) waiting[i] = lamp[i] >= 0 && (is_sun ? table.suns[lamp[i]].program_shader : table.lamps[lamp[i]].program_shader) >= 0;
    for (int first = 0; first < n; ++first) {
        if (!waiting[first]) continue;
        // One lamp at a time: its matrices are uniform over the span.
        int32_t list[kSpan];
        int count = 0;
        for (int i = first; i < n; ++i) {
            if (!waiting[i] || lamp[i] != lamp[first]) continue;
            waiting[i] = 0;
            list[count++] = i;
        }
        prepare_span(scratch, count);
        shader::ShadingSpan& s = scratch.span;
        s.is_lamp = true;
        s.lamp = is_sun ? table.suns[lamp[first]].handle : table.lamps[lamp[first]].handle;
        static constexpr Affine kUnturned{};
        const bool keeps = table.hits_keep_normals && is_hit && !is_sun;
        s.lamp_to_world = keeps ? &kUnturned : is_sun ? &table.suns[lamp[first]].to_world : &table.lamps[lamp[first]].to_world;
        s.lamp_to_object = is_sun ? &table.suns[lamp[first]].to_object : &table.lamps[lamp[first]].to_object;
        gather3(points.p, list, count, s.p);
        gather3(points.normal, list, count, s.n_s);
        gather3(points.normal, list, count, s.n_g);
        gather3(points.wo, list, count, s.wo);
        gather(points.u, list, count, s.u);
        gather(points.v, list, count, s.v);
        gather(points.distance, list, count, s.ray_length);
        gather_depths(depths, list, count, true, s);
        float r[3][kSpan];
        const Columns3 emission{r[0], r[1], r[2]};
        evaluate_emission(programs, context, scratch, is_sun ? table.suns[lamp[first]].program_shader : table.lamps[lamp[first]].program_shader, emission);
        for (int k = 0; k < count; ++k) store(radiance, list[k], load(radiance, list[k]) * load(emission, k));
    }
}

void apply_mesh_programs(const shader::Programs& programs, const shader::ShaderContext& context, LightScratch& scratch, const EmissiveHits& all,
                         Columns3 radiance) {
    const int n = all.n;
    uint8_t waiting[kSpan];
    for (int i = 0; i < n; ++i) waiting[i] = all.shader[i] >= 0 && !programs.shaders[size_t(all.shader[i])].emission_is_constant;
    for (int first = 0; first < n; ++first) {
        if (!waiting[first]) continue;
        int32_t list[kSpan], identity[kSpan], hit_object[kSpan], hit_primitive[kSpan];
        float hit_t[kSpan], hit_u[kSpan], hit_v[kSpan], hit_time[kSpan], error[kSpan], origin[3][kSpan];
        int count = 0;
        for (int i = first; i < n; ++i) {
            if (!waiting[i] || all.shader[i] != all.shader[first]) continue;
            waiting[i] = 0;
            identity[count] = count;
            list[count++] = i;
        }
        prepare_span(scratch, count);
        shader::ShadingSpan& s = scratch.span;
        gather3(all.direction, list, count, s.wo);
        gather(all.ray_length ? all.ray_length : all.distance, list, count, s.ray_length);
        if (all.time) {
            gather(all.time, list, count, hit_time);
            s.time = hit_time;
        }
        gather(all.distance, list, count, hit_t);
        gather(all.u, list, count, hit_u);
        gather(all.v, list, count, hit_v);
        gather(all.object, list, count, hit_object);
        gather(all.primitive, list, count, hit_primitive);
        gather_depths(all.depths, list, count, !all.ray_flags, s);
        if (all.ray_flags) gather(all.ray_flags, list, count, s.ray_flags);
        // Sampled points are on triangles, which do not ask where the ray came from.
        const bool rays = all.origin.x != nullptr;
        if (rays) gather3(all.origin, list, count, {origin[0], origin[1], origin[2]});
        const geometry::HitColumns hits{hit_t, hit_u, hit_v, hit_object, hit_primitive};
        geometry::shade_points(*context.scene, hits, rays ? ConstColumns3{origin[0], origin[1], origin[2]} : ConstColumns3{}, identity, count, s, error);
        s.error = error;
        float r[3][kSpan];
        const Columns3 emission{r[0], r[1], r[2]};
        evaluate_emission(programs, context, scratch, all.shader[first], emission);
        for (int k = 0; k < count; ++k) store(radiance, list[k], load(emission, k));
    }
}

void shade_emissive(const shader::Programs& programs, const shader::ShaderContext& context, LightScratch& scratch, const EmissiveHits& hits,
                    Columns3 radiance) {
    float wo[3][kSpan];
    for (int i = 0; i < hits.n; ++i) {
        const shader::CompiledShader& compiled = programs.shaders[size_t(hits.shader[i])];
        store({wo[0], wo[1], wo[2]}, i, -load(hits.direction, i));
        store(radiance, i, compiled.emission_is_constant ? compiled.constant_emission : Rgb{});
    }
    EmissiveHits points = hits;
    points.direction = {wo[0], wo[1], wo[2]};
    apply_mesh_programs(programs, context, scratch, points, radiance);
}

}  // namespace TALBOT_ISA
}  // namespace talbot::light
