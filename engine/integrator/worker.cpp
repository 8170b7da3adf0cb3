#include "integrator/state.h"

namespace talbot::integrator {

namespace {

constexpr int kMaxShaders = 1 << 16;

Columns3 take3(Arena& arena, size_t n) {
    return {arena.take<float>(n), arena.take<float>(n), arena.take<float>(n)};
}

shader::ShadingSpan take_span(Arena& arena) {
    shader::ShadingSpan s;
    s.p = take3(arena, kSpan);
    s.n_s = take3(arena, kSpan);
    s.n_g = take3(arena, kSpan);
    s.origin = take3(arena, kSpan);
    s.wo = take3(arena, kSpan);
    for (float** column : {&s.u, &s.v, &s.ray_length, &s.footprint}) *column = arena.take<float>(kSpan);
    for (int32_t** column : {&s.object, &s.primitive, &s.constants, &s.ray_flags, &s.backfacing, &s.depth, &s.diffuse_depth, &s.glossy_depth,
                             &s.transparent_depth, &s.transmission_depth})
        *column = arena.take<int32_t>(kSpan);
    for (uint32_t** column : {&s.key, &s.sample, &s.vertex}) *column = arena.take<uint32_t>(kSpan);
    return s;
}

size_t worker_bytes(int max_registers) {
    const size_t column = kSpan * 4 + 128;
    const size_t path_columns = 64 * (kBatch * 4 + 128);
    const size_t shadow_columns = 40 * (kShadowCapacity * 4 + 128);
    const size_t span_columns = (size_t(max_registers) * 2 + kMaxSlots + kCompactColumns + light::kLightScratchColumns + 220) * column;
    return path_columns + shadow_columns + span_columns + kMaxShaders * 4 + 4096;
}

}  // namespace

Worker::Worker(int max_registers) : arena_(worker_bytes(max_registers)) {
    PathColumns& p = paths;
    p.origin = take3(arena_, kBatch);
    p.direction = take3(arena_, kBatch);
    p.throughput = take3(arena_, kBatch);
    p.diffuse_share = take3(arena_, kBatch);
    p.glossy_share = take3(arena_, kBatch);
    for (float** c : {&p.t_max, &p.bsdf_pdf, &p.min_pdf, &p.mis_t, &p.cone_width, &p.cone_spread, &p.time, &p.hit.t, &p.hit.u, &p.hit.v})
        *c = arena_.take<float>(kBatch);
    for (int32_t** c : {&p.pixel, &p.flags, &p.bounces, &p.vertex, &p.hit.object, &p.hit.primitive, &active, &fresh, &missed, &hits, &sorted, &free_lanes,
                        &shader, &sorted_shader, &visibility})
        *c = arena_.take<int32_t>(kBatch);
    for (uint32_t** c : {&p.key, &p.sample}) *c = arena_.take<uint32_t>(kBatch);

    ShadowQueue& q = shadow;
    for (Columns3* c : {&q.origin, &q.direction, &q.rgb, &q.diffuse_share, &q.glossy_share}) *c = take3(arena_, kShadowCapacity);
    for (float** c : {&q.t_max, &q.time, &q.passed, &q.hit.t, &q.hit.u, &q.hit.v}) *c = arena_.take<float>(kShadowCapacity);
    for (int32_t** c :
         {&q.pixel, &q.indirect, &q.lane, &q.bounces, &q.visibility, &q.light_group, &q.hit.object, &q.hit.primitive, &q.list, &q.going, &q.shader, &q.crossed})
        *c = arena_.take<int32_t>(kShadowCapacity);
    q.blocked = arena_.take<uint8_t>(kShadowCapacity);

    SpanScratch& s = scratch;
    s.span = take_span(arena_);
    s.registers = arena_.take<float>(size_t(max_registers) * kSpan);
    for (Columns3* c :
         {&s.throughput, &s.light.wi, &s.light.radiance, &s.wi, &s.f, &s.slot_f, &s.f_diffuse, &s.f_glossy, &s.rgb, &s.share_a, &s.share_b, &s.tmp3})
        *c = take3(arena_, kSpan);
    for (float** c : {&s.error, &s.time, &s.terminator_frequency, &s.weight_sum, &s.light.distance, &s.light.pdf, &s.u0, &s.v0, &s.u1, &s.v1, &s.roulette_u,
                      &s.roulette_v, &s.pdf, &s.slot_pdf, &s.sampled_roughness, &s.sampled_eta, &s.tmp, &s.tmp2})
        *c = arena_.take<float>(kSpan);
    for (int32_t** c : {&s.lane, &s.path_flags, &s.bounces, &s.sampled_flags, &s.chosen, &s.list, &s.list2, &s.itmp, &s.matte, &s.receiver, &s.light.visibility,
                        &s.light.blockers, &s.light.light_group, &s.light_group, &s.film_group})
        *c = arena_.take<int32_t>(kSpan);
    for (uint8_t** c : {&s.mask, &s.light.is_delta}) *c = arena_.take<uint8_t>(kSpan);
    s.slot_weight = arena_.take<float>(size_t(kMaxSlots) * kSpan);
    s.compact = arena_.take<float>(size_t(kCompactColumns) * kSpan);
    s.emitter.registers = arena_.take<float>(size_t(max_registers) * kSpan);
    s.emitter.span = take_span(arena_);
    s.emitter.columns = arena_.take<float>(size_t(light::kLightScratchColumns) * kSpan);
    bucket_capacity = kMaxShaders;
    buckets = arena_.take<int32_t>(size_t(bucket_capacity));
}

}  // namespace talbot::integrator
