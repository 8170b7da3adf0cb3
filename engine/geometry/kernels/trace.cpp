#include "geometry/accelerator.h"

#if __has_include(<embree4/rtcore.h>)
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

namespace talbot::geometry {
inline namespace TALBOT_ISA {
namespace {

/// W rays in columns: one layout for every width (a single ray is a packet of one). Padded to what Embree wants.
template <int W>
struct alignas(64) Packet {
    RTCRayHitNt<W> rays;
};
static_assert(sizeof(RTCRayHitNt<8>) == sizeof(RTCRayHit8) && sizeof(RTCRayHitNt<16>) == sizeof(RTCRayHit16));

/// Embree hands the context of a query to its filter: what follows it there is ours.
template <class EmbreeContext>
struct Context {
    EmbreeContext embree;
    const scene::SceneView* scene;
};

/// Refuses hits of objects that do not block for the ray's emitter.
template <class EmbreeContext>
void keep_blockers(const RTCFilterFunctionNArguments* args) {
    const scene::SceneView& scene = *reinterpret_cast<const Context<EmbreeContext>*>(args->context)->scene;
    for (unsigned k = 0; k < args->N; ++k) {
        if (args->valid[k] == 0) continue;
        const int32_t group = scene::blocker_group(RTCRayN_mask(args->ray, args->N, k));
        const unsigned instance = RTCHitN_instID(args->hit, args->N, k, 0);
        const unsigned object = instance != RTC_INVALID_GEOMETRY_ID ? instance : RTCHitN_geomID(args->hit, args->N, k);
        if (group >= 0 && !(scene::traits_of(scene, int32_t(object)).blocks >> group & 1)) args->valid[k] = 0;
    }
}

// The bridge: Embree 3 takes a context, Embree 4 arguments that point to one.
#if RTC_VERSION_MAJOR >= 4
struct Query {
    Context<RTCRayQueryContext> context;
    RTCIntersectArguments intersect;
    RTCOccludedArguments occluded;
};
TALBOT_INLINE void prepare(Query& query, const TraceOptions& options) {
    rtcInitRayQueryContext(&query.context.embree);
    query.context.scene = options.blockers;
    const int coherent = options.coherent ? RTC_RAY_QUERY_FLAG_COHERENT : RTC_RAY_QUERY_FLAG_INCOHERENT;
    const auto flags = RTCRayQueryFlags(options.blockers ? coherent | RTC_RAY_QUERY_FLAG_INVOKE_ARGUMENT_FILTER : coherent);
    const RTCFilterFunctionN filter = options.blockers ? keep_blockers<RTCRayQueryContext> : nullptr;
    rtcInitIntersectArguments(&query.intersect);
    query.intersect.flags = flags;
    query.intersect.filter = filter;
    query.intersect.context = &query.context.embree;
    rtcInitOccludedArguments(&query.occluded);
    query.occluded.flags = flags;
    query.occluded.filter = filter;
    query.occluded.context = &query.context.embree;
}
TALBOT_INLINE void call_intersect(RTCScene scene, Query& query, const int*, Packet<1>& p) {
    rtcIntersect1(scene, reinterpret_cast<RTCRayHit*>(&p), &query.intersect);
}
TALBOT_INLINE void call_intersect(RTCScene scene, Query& query, const int* valid, Packet<8>& p) {
    rtcIntersect8(valid, scene, reinterpret_cast<RTCRayHit8*>(&p), &query.intersect);
}
TALBOT_INLINE void call_intersect(RTCScene scene, Query& query, const int* valid, Packet<16>& p) {
    rtcIntersect16(valid, scene, reinterpret_cast<RTCRayHit16*>(&p), &query.intersect);
}
TALBOT_INLINE void call_occluded(RTCScene scene, Query& query, const int*, Packet<1>& p) {
    rtcOccluded1(scene, reinterpret_cast<RTCRay*>(&p), &query.occluded);
}
TALBOT_INLINE void call_occluded(RTCScene scene, Query& query, const int* valid, Packet<8>& p) {
    rtcOccluded8(valid, scene, reinterpret_cast<RTCRay8*>(&p), &query.occluded);
}
TALBOT_INLINE void call_occluded(RTCScene scene, Query& query, const int* valid, Packet<16>& p) {
    rtcOccluded16(valid, scene, reinterpret_cast<RTCRay16*>(&p), &query.occluded);
}
#else
struct Query {
    Context<RTCIntersectContext> context;
};
TALBOT_INLINE void prepare(Query& query, const TraceOptions& options) {
    rtcInitIntersectContext(&query.context.embree);
    query.context.scene = options.blockers;
    query.context.embree.flags = options.coherent ? RTC_INTERSECT_CONTEXT_FLAG_COHERENT : RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT;
    query.context.embree.filter = options.blockers ? keep_blockers<RTCIntersectContext> : nullptr;
}
TALBOT_INLINE void call_intersect(RTCScene scene, Query& query, const int*, Packet<1>& p) {
    rtcIntersect1(scene, &query.context.embree, reinterpret_cast<RTCRayHit*>(&p));
}
TALBOT_INLINE void call_intersect(RTCScene scene, Query& query, const int* valid, Packet<8>& p) {
    rtcIntersect8(valid, scene, &query.context.embree, reinterpret_cast<RTCRayHit8*>(&p));
}
TALBOT_INLINE void call_intersect(RTCScene scene, Query& query, const int* valid, Packet<16>& p) {
    rtcIntersect16(valid, scene, &query.context.embree, reinterpret_cast<RTCRayHit16*>(&p));
}
TALBOT_INLINE void call_occluded(RTCScene scene, Query& query, const int*, Packet<1>& p) {
    rtcOccluded1(scene, &query.context.embree, reinterpret_cast<RTCRay*>(&p));
}
TALBOT_INLINE void call_occluded(RTCScene scene, Query& query, const int* valid, Packet<8>& p) {
    rtcOccluded8(valid, scene, &query.context.embree, reinterpret_cast<RTCRay8*>(&p));
}
TALBOT_INLINE void call_occluded(RTCScene scene, Query& query, const int* valid, Packet<16>& p) {
    rtcOccluded16(valid, scene, &query.context.embree, reinterpret_cast<RTCRay16*>(&p));
}
#endif

/// Lanes first..first + W of the list into the packet; lanes past the end and rays that are not finite are switched off.
template <int W>
TALBOT_INLINE void load_packet(const RayColumns& rays, const int32_t* index, int first, int n, const int32_t* visibility, Packet<W>& p, int* valid,
                               int32_t* lanes) {
    ConstColumn ox = rays.origin.x, oy = rays.origin.y, oz = rays.origin.z, dx = rays.direction.x, dy = rays.direction.y, dz = rays.direction.z;
    ConstColumn t_max = rays.t_max;
    for (int k = 0; k < W; ++k) {
        const int at = first + k < n ? first + k : n - 1;
        lanes[k] = index ? index[at] : at;
    }
    for (int k = 0; k < W; ++k) p.rays.ray.time[k] = rays.time ? rays.time[lanes[k]] : 0.5f;
    TALBOT_VECTOR_LOOP
    for (int k = 0; k < W; ++k) {
        const int32_t lane = lanes[k];
        p.rays.ray.org_x[k] = ox[lane];
        p.rays.ray.org_y[k] = oy[lane];
        p.rays.ray.org_z[k] = oz[lane];
        p.rays.ray.tnear[k] = 0;
        p.rays.ray.dir_x[k] = dx[lane];
        p.rays.ray.dir_y[k] = dy[lane];
        p.rays.ray.dir_z[k] = dz[lane];
        p.rays.ray.tfar[k] = t_max[lane];
        p.rays.ray.mask[k] = uint32_t(visibility[lane]);
        p.rays.ray.id[k] = uint32_t(k);
        p.rays.ray.flags[k] = 0;
        const float sum = (ox[lane] + oy[lane] + oz[lane]) + (dx[lane] + dy[lane] + dz[lane]);
        const bool finite = sum - sum == 0.0f;  // NaN and infinity give NaN
        valid[k] = first + k < n && finite ? -1 : 0;
    }
}

template <int W>
TALBOT_INLINE void intersect_packets(RTCScene scene, Query& query, const RayColumns& rays, const int32_t* index, int n, const int32_t* visibility,
                                     const HitColumns& hits) {
    Packet<W> p;
    alignas(64) int valid[W];
    alignas(64) int32_t lanes[W];
    for (int first = 0; first < n; first += W) {
        load_packet<W>(rays, index, first, n, visibility, p, valid, lanes);
        for (int k = 0; k < W; ++k) {
            p.rays.hit.geomID[k] = RTC_INVALID_GEOMETRY_ID;
            p.rays.hit.instID[0][k] = RTC_INVALID_GEOMETRY_ID;
        }
        if (W > 1 || valid[0]) call_intersect(scene, query, valid, p);
        const int count = n - first < W ? n - first : W;
        for (int k = 0; k < count; ++k) {
            const int32_t lane = lanes[k];
            const uint32_t geometry = p.rays.hit.geomID[k], instance = p.rays.hit.instID[0][k];
            if (geometry == RTC_INVALID_GEOMETRY_ID) {
                hits.object[lane] = -1;
                continue;
            }
            hits.t[lane] = p.rays.ray.tfar[k];
            hits.u[lane] = p.rays.hit.u[k];
            hits.v[lane] = p.rays.hit.v[k];
            hits.object[lane] = int32_t(instance != RTC_INVALID_GEOMETRY_ID ? instance : geometry);
            hits.primitive[lane] = int32_t(p.rays.hit.primID[k]);
        }
    }
}

template <int W>
TALBOT_INLINE void occluded_packets(RTCScene scene, Query& query, const RayColumns& rays, const int32_t* index, int n, const int32_t* visibility,
                                    uint8_t* occluded) {
    Packet<W> p;
    alignas(64) int valid[W];
    alignas(64) int32_t lanes[W];
    for (int first = 0; first < n; first += W) {
        load_packet<W>(rays, index, first, n, visibility, p, valid, lanes);
        if (W > 1 || valid[0]) call_occluded(scene, query, valid, p);
        const int count = n - first < W ? n - first : W;
        // Embree marks an occluded ray by tfar = -infinity.
        for (int k = 0; k < count; ++k) occluded[lanes[k]] = valid[k] && p.rays.ray.tfar[k] == -__builtin_inff();
    }
}

}  // namespace

void intersect(const Accelerator& accelerator, const RayColumns& rays, const int32_t* index, int n, const int32_t* visibility, const HitColumns& hits,
               const TraceOptions& options) {
    const RTCScene scene = static_cast<RTCScene>(const_cast<void*>(accelerator.handle()));
    if (!scene) {
        for (int i = 0; i < n; ++i) hits.object[index ? index[i] : i] = -1;
        return;
    }
    Query query;
    prepare(query, options);
    if (options.width >= 16)
        intersect_packets<16>(scene, query, rays, index, n, visibility, hits);
    else if (options.width >= 8)
        intersect_packets<8>(scene, query, rays, index, n, visibility, hits);
    else
        intersect_packets<1>(scene, query, rays, index, n, visibility, hits);
}

void occluded(const Accelerator& accelerator, const RayColumns& rays, const int32_t* index, int n, const int32_t* visibility, uint8_t* occluded,
              const TraceOptions& options) {
    const RTCScene scene = static_cast<RTCScene>(const_cast<void*>(accelerator.handle()));
    if (!scene) {
        for (int i = 0; i < n; ++i) occluded[index ? index[i] : i] = 0;
        return;
    }
    Query query;
    prepare(query, options);
    if (options.width >= 16)
        occluded_packets<16>(scene, query, rays, index, n, visibility, occluded);
    else if (options.width >= 8)
        occluded_packets<8>(scene, query, rays, index, n, visibility, occluded);
    else
        occluded_packets<1>(scene, query, rays, index, n, visibility, occluded);
}

}  // namespace TALBOT_ISA
}  // namespace talbot::geometry
