/// Emitters with blockers of their own are met by camera rays alone. For scattered rays another ray looks for them, as in Cycles: it passes what some
/// blockers are chosen with regard to, and what lets light through, and ends at the first other surface. What it meets is weighted against light samples, and
/// a shadow ray, which only the emitter's blockers stop, says what arrives.

#include <algorithm>

#include "integrator/kernels/stages.h"

namespace talbot::integrator {
inline namespace TALBOT_ISA {

namespace {

constexpr float kInfinity = 3.0e38f;
constexpr int kSurfaces = 256, kLamps = 64;  // met by one ray at most

/// Rays of up to kSpan paths; columns of their own, because what is pushed may be traced at once with the worker's scratch.
struct LinkedRays {
    int n = 0;
    int32_t lane[kSpan], visibility[kSpan], receiver[kSpan], ray_flags[kSpan];
    int32_t bounces[kSpan], diffuse[kSpan], glossy[kSpan], transparent[kSpan], transmission[kSpan];
    float origin[3][kSpan], direction[3][kSpan], time[kSpan];
    float end[kSpan];  ///< how far they look
    Columns3 o() { return {origin[0], origin[1], origin[2]}; }
    Columns3 d() { return {direction[0], direction[1], direction[2]}; }
};

/// Bounces of some of the rays.
struct RayDepths {
    int32_t columns[5][kSpan];
    light::PathDepths of(const LinkedRays& rays, const int32_t* list, int n) {
        const int32_t* from[] = {rays.bounces, rays.diffuse, rays.glossy, rays.transparent, rays.transmission};
        for (int c = 0; c < 5; ++c) gather(from[c], list, n, columns[c]);
        return {columns[0], columns[1], columns[2], columns[3], columns[4]};
    }
};

/// What some of the rays met: radiance, the light samples' density there (0: none), the distance, the mask of the shadow ray, and the light group.
struct Found {
    int32_t ray[kSpan], blockers[kSpan], light_group[kSpan];
    float radiance[3][kSpan], pdf[kSpan], distance[kSpan];
    Columns3 rgb() { return {radiance[0], radiance[1], radiance[2]}; }
};

void gather_rays(const RenderContext& context, Worker& worker, const int32_t* lanes, int n, LinkedRays& rays) {
    const PathColumns& paths = worker.paths;
    rays.n = 0;
    for (int i = 0; i < n; ++i) {
        // What was crossed since has been passed already.
        rays.lane[rays.n] = lanes[i];
        rays.n += (paths.flags[lanes[i]] & (int32_t(shader::kRayCamera) | int32_t(kPathCrossed))) == 0;
    }
    gather3(paths.origin, rays.lane, rays.n, rays.o());
    gather3(paths.direction, rays.lane, rays.n, rays.d());
    if (context.scene->has_motion) gather(paths.time, rays.lane, rays.n, rays.time);
    path_receivers(paths, rays.lane, rays.n, rays.receiver);
    shader::ShadingSpan depths;
    depths.depth = rays.bounces;
    depths.diffuse_depth = rays.diffuse;
    depths.glossy_depth = rays.glossy;
    depths.transparent_depth = rays.transparent;
    depths.transmission_depth = rays.transmission;
    path_depths(paths, rays.lane, rays.n, depths);
    for (int i = 0; i < rays.n; ++i) {
        const int32_t flags = paths.flags[rays.lane[i]];
        rays.visibility[i] = ray_visibility(flags);
        rays.ray_flags[i] = flags & shader::kRayAny;
        rays.end[i] = kInfinity;
    }
}

/// Weighs the first n entries and queues their shadow rays.
void push_found(const RenderContext& context, Worker& worker, LinkedRays& rays, Found& found, int n, film::TileFilm& tile) {
    const PathColumns& paths = worker.paths;
    const scene::Settings& settings = *context.settings;
    ShadowQueue& queue = worker.shadow;
    if (queue.n + n > kShadowCapacity) trace_shadow(context, worker, tile);
    for (int j = 0; j < n; ++j) {
        const int i = found.ray[j], k = queue.n;
        const int32_t lane = rays.lane[i];
        const bool indirect = rays.bounces[i] > 1;
        const float weight = (paths.flags[lane] & kPathDelta) || found.pdf[j] <= 0.0f ? 1.0f : power_heuristic(paths.bsdf_pdf[lane], found.pdf[j]);
        const Rgb c = clamp_contribution(load(paths.throughput, lane) * load(found.rgb(), j) * weight,
                                         3.0f * (indirect ? settings.clamp_indirect : settings.clamp_direct));
        if (c.x == 0.0f && c.y == 0.0f && c.z == 0.0f) continue;
        ++queue.n;
        store(queue.rgb, k, c);
        store(queue.origin, k, load(rays.o(), i));
        store(queue.direction, k, load(rays.d(), i));
        // Just short of the light, as for light samples.
        queue.t_max[k] = found.blockers[j] == 0 ? -1.0f : found.distance[j] < 1e30f ? found.distance[j] * (1.0f - 2e-4f) : kInfinity;
        queue.time[k] = context.scene->has_motion ? rays.time[i] : 0.0f;
        store(queue.diffuse_share, k, load(paths.diffuse_share, lane));
        store(queue.glossy_share, k, load(paths.glossy_share, lane));
        queue.pixel[k] = paths.pixel[lane];
        queue.indirect[k] = indirect;
        queue.lane[k] = lane;
        queue.light_group[k] = found.light_group[j];
        // Of the path before it was scattered: the total is in the lowest bits.
        queue.bounces[k] = paths.bounces[lane] - 1;
        queue.crossed[k] = paths.vertex[lane] >> 16;
        queue.passed[k] = 0.0f;
        queue.visibility[k] = worker.catcher_pass ? int32_t(scene::kVisibleShadow << scene::kCatcherShift | (uint32_t(found.blockers[j]) & scene::kBlockerBits))
                                                  : found.blockers[j];
    }
}

/// Surfaces along the rays: pushes linked emitters among them, and says where each ray ends. The first ones are those that the paths have hit.
class SurfaceWalk {
public:
    TALBOT_MEMBER SurfaceWalk(const RenderContext& context, Worker& worker, LinkedRays& rays, film::TileFilm& tile)
        : context_(context), worker_(worker), rays_(rays), tile_(tile) {}

    TALBOT_MEMBER void run() {
        const PathColumns& paths = worker_.paths;
        const geometry::HitColumns& hit = paths.hit;
        gather3(paths.origin, rays_.lane, rays_.n, from());
        gather(hit.t, rays_.lane, rays_.n, t_);
        gather(hit.u, rays_.lane, rays_.n, u_);
        gather(hit.v, rays_.lane, rays_.n, v_);
        gather(hit.object, rays_.lane, rays_.n, object_);
        gather(hit.primitive, rays_.lane, rays_.n, primitive_);
        int32_t list[kSpan], shader[kSpan];
        int n = 0;
        for (int i = 0; i < rays_.n; ++i) {
            passed_[i] = 0.0f;
            crossed_[i] = rays_.transparent[i];
            list[n++] = i;
        }
        for (int turn = 0; turn < kSurfaces && n > 0; ++turn) {
            int hits = 0;
            for (int k = 0; k < n; ++k) {
                const int32_t i = list[k];
                list[hits] = i;
                hits += object_[i] >= 0;
            }
            geometry::hit_shaders(*context_.scene, columns(), list, hits, shader);
            push_emitters(list, shader, hits);
            n = pass_surfaces(list, shader, hits);
            const geometry::RayColumns next{from(), rays_.d(), left_, context_.scene->has_motion ? rays_.time : nullptr};
            geometry::intersect(*context_.accelerator, next, list, n, rays_.visibility, columns(), context_.bounce_trace);
            worker_.counters.bounce_rays += uint64_t(n);
        }
    }

private:
    TALBOT_MEMBER geometry::HitColumns columns() { return {t_, u_, v_, object_, primitive_}; }
    TALBOT_MEMBER Columns3 from() { return {from_[0], from_[1], from_[2]}; }

    TALBOT_MEMBER void push_emitters(const int32_t* list, const int32_t* shader, int n) {
        Found found;
        int32_t object[kSpan], primitive[kSpan], receiver[kSpan], chosen[kSpan], flags[kSpan], crossed[kSpan];
        float t[kSpan], u[kSpan], v[kSpan], time[kSpan], origin[3][kSpan], vertex[3][kSpan], direction[3][kSpan];
        int count = 0;
        for (int k = 0; k < n; ++k) {
            const int32_t i = list[k];
            const scene::TraitsView& traits = scene::traits_of(*context_.scene, object_[i]);
            const scene::Linking& linking = traits.linking;
            const shader::CompiledShader& compiled = context_.programs->shaders[size_t(shader[k])];
            const bool emits = compiled.emission >= 0 || compiled.emission_is_constant;
            if (!emits || linking.blockers < 0 || !((linking.receivers >> rays_.receiver[i]) & 1)) continue;
            chosen[count] = shader[k];
            found.ray[count] = i;
            found.distance[count] = passed_[i] + t_[i];
            found.light_group[count] = traits.light_group;
            found.blockers[count++] = int32_t(scene::shadow_mask(linking));
        }
        if (count == 0) return;
        gather(object_, found.ray, count, object);
        gather(primitive_, found.ray, count, primitive);
        gather(rays_.receiver, found.ray, count, receiver);
        gather(rays_.ray_flags, found.ray, count, flags);
        RayDepths columns;
        light::PathDepths depths = columns.of(rays_, found.ray, count);
        for (int k = 0; k < count; ++k) ++columns.columns[0][k];  // as where light is asked for, though the ray keeps its kind
        gather(crossed_, found.ray, count, crossed);
        depths.transparent = crossed;
        gather(t_, found.ray, count, t);
        gather(u_, found.ray, count, u);
        gather(v_, found.ray, count, v);
        gather3(from(), found.ray, count, {origin[0], origin[1], origin[2]});
        gather3(rays_.o(), found.ray, count, {vertex[0], vertex[1], vertex[2]});
        gather3(rays_.d(), found.ray, count, {direction[0], direction[1], direction[2]});
        const bool moves = context_.scene->has_motion;
        if (moves) gather(rays_.time, found.ray, count, time);
        const light::EmissiveHits hits{{origin[0], origin[1], origin[2]},
                                       {direction[0], direction[1], direction[2]},
                                       t,
                                       u,
                                       v,
                                       object,
                                       primitive,
                                       chosen,
                                       flags,
                                       depths,
                                       moves ? time : nullptr,
                                       count,
                                       found.distance};
        light::shade_emissive(*context_.programs, *context_.shading, worker_.scratch.emitter, hits, found.rgb());
        light::pdf_triangles(*context_.emitters, *context_.scene, {vertex[0], vertex[1], vertex[2]}, found.distance, object, primitive,
                             context_.emitter_summary.has_links ? receiver : nullptr, moves ? time : nullptr, count, found.pdf);
        push_found(context_, worker_, rays_, found, count, tile_);
    }

    /// Moves the rays behind what they hit, or ends them there. Those that go on stay in the list; returns their number.
    TALBOT_MEMBER int pass_surfaces(int32_t* list, const int32_t* shader, int n) {
        int going = 0;
        for (int k = 0; k < n; ++k) {
            const int32_t i = list[k];
            const shader::CompiledShader& compiled = context_.programs->shaders[size_t(shader[k])];
            const bool lets_through = compiled.transparency >= 0 || compiled.transparency_is_constant;
            const bool ends = lets_through ? ++crossed_[i] >= context_.settings->transparent_bounces
                                           : !(scene::traits_of(*context_.scene, object_[i]).blocks & scene::kChosenOrNot);
            if (ends) {
                rays_.end[i] = passed_[i] + t_[i];
                continue;
            }
            const Vec3 o = load(from(), i), d = load(rays_.d(), i);
            // A little further than rounding reaches, whatever the scale.
            const float step = t_[i] * 1.0001f + 1e-6f * (std::fabs(o.x) + std::fabs(o.y) + std::fabs(o.z));
            store(from(), i, o + d * step);
            passed_[i] += step;
            left_[i] = kInfinity;
            object_[i] = -1;
            list[going++] = i;
        }
        return going;
    }

    const RenderContext& context_;
    Worker& worker_;
    LinkedRays& rays_;
    film::TileFilm& tile_;
    float from_[3][kSpan], t_[kSpan], u_[kSpan], v_[kSpan], passed_[kSpan], left_[kSpan];
    int32_t object_[kSpan], primitive_[kSpan], crossed_[kSpan];
};

void push_lamps(const RenderContext& context, Worker& worker, LinkedRays& rays, film::TileFilm& tile) {
    float t_min[kSpan], t[kSpan], end[kSpan], origin[3][kSpan], direction[3][kSpan];
    int32_t list[kSpan], lamp[kSpan], visibility[kSpan], receiver[kSpan];
    const Columns3 o{origin[0], origin[1], origin[2]}, d{direction[0], direction[1], direction[2]};
    int n = rays.n;
    for (int i = 0; i < n; ++i) list[i] = i, t_min[i] = 0.0f;
    for (int turn = 0; turn < kLamps && n > 0; ++turn) {
        gather3(rays.o(), list, n, o);
        gather3(rays.d(), list, n, d);
        gather(rays.end, list, n, end);
        gather(rays.visibility, list, n, visibility);
        light::intersect_lamps(*context.emitters, o, d, end, visibility, n, lamp, t, t_min, light::Met::Linked);
        Found found;
        int count = 0;
        for (int k = 0; k < n; ++k) {
            if (lamp[k] < 0) continue;
            list[count] = found.ray[count] = list[k];
            lamp[count] = lamp[k];
            t_min[count] = found.distance[count] = t[k];
            found.light_group[count] = light::lamp_light_group(*context.emitters, lamp[k]);
            found.blockers[count] = light::lamp_blockers(*context.emitters, lamp[k]);
            ++count;
        }
        n = count;
        gather3(rays.o(), list, n, o);
        gather3(rays.d(), list, n, d);
        gather(rays.receiver, list, n, receiver);
        RayDepths depths;
        light::shade_lamps(*context.emitters, o, d, lamp, found.distance, n, *context.programs, *context.shading, worker.scratch.emitter, found.rgb(),
                           found.pdf, depths.of(rays, list, n), context.emitter_summary.has_links ? receiver : nullptr);
        push_found(context, worker, rays, found, n, tile);
    }
}

/// Where nothing ends the ray.
void push_suns(const RenderContext& context, Worker& worker, LinkedRays& rays, film::TileFilm& tile) {
    float own[kSpan], direction[3][kSpan];
    int32_t visibility[kSpan], receiver[kSpan];
    for (const int32_t sun : context.emitter_summary.linked_suns) {
        Found found;
        int n = 0;
        for (int i = 0; i < rays.n; ++i) {
            if (rays.end[i] < kInfinity) continue;
            const int32_t lane = rays.lane[i];
            found.ray[n] = i;
            own[n++] = worker.paths.flags[lane] & kPathDelta ? -1.0f : worker.paths.bsdf_pdf[lane];
        }
        gather3(rays.d(), found.ray, n, {direction[0], direction[1], direction[2]});
        gather(rays.visibility, found.ray, n, visibility);
        gather(rays.receiver, found.ray, n, receiver);
        RayDepths depths;
        // Weighted there.
        light::shade_suns(*context.emitters, {direction[0], direction[1], direction[2]}, visibility, own, n, *context.programs, *context.shading,
                          worker.scratch.emitter, found.rgb(), depths.of(rays, found.ray, n), context.emitter_summary.has_links ? receiver : nullptr,
                          light::Met::Linked, sun);
        fill(found.pdf, n, 0.0f);
        fill(found.distance, n, kInfinity);
        std::fill_n(found.blockers, n, light::sun_blockers(*context.emitters, sun));
        std::fill_n(found.light_group, n, light::sun_light_group(*context.emitters, sun));
        push_found(context, worker, rays, found, n, tile);
    }
}

}  // namespace

void find_linked_light(const RenderContext& context, Worker& worker, const int32_t* lanes, int n, film::TileFilm& tile) {
    for (int begin = 0; begin < n; begin += kSpan) {
        LinkedRays rays;
        gather_rays(context, worker, lanes + begin, std::min(n - begin, kSpan), rays);
        SurfaceWalk(context, worker, rays, tile).run();
        if (context.emitter_summary.has_linked_lamps) push_lamps(context, worker, rays, tile);
        push_suns(context, worker, rays, tile);
    }
    // The light samples of this turn fill the queue anew.
    trace_shadow(context, worker, tile);
}

}  // namespace TALBOT_ISA
}  // namespace talbot::integrator
