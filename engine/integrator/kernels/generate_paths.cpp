/// Camera rays. Film positions are importance-sampled from the pixel filter (weight 1); lens points are uniform on the
/// aperture. Camera space looks along -z, +y up; panoramas use Blender's own space, x forward and z up.

#include "base/sobol.h"
#include "integrator/kernels/stages.h"
#include "scene/motion.h"

namespace talbot::integrator {
inline namespace TALBOT_ISA {

namespace {

struct FilmPoint {
    float x, y;  ///< 0..1 over the whole frame, from the bottom left
};

TALBOT_INLINE float filter_offset(const float* table, float u) {
    return table[int(u * 1024.0f)];
}

/// Uniform point on the unit disk or regular polygon.
TALBOT_INLINE Vec2 aperture_point(const scene::Camera& camera, float u, float v) {
    Vec2 p;
    if (camera.aperture_blades < 3) {
        const float r = std::sqrt(u), phi = 2.0f * kPi * v;
        p = {r * std::cos(phi), r * std::sin(phi)};
    } else {
        // A blade's triangle, then a point in it: corners at the centre and two neighbouring vertices.
        const float n = float(camera.aperture_blades);
        const float blade = minf(float(int(u * n)), n - 1.0f);
        const float s = std::sqrt(u * n - blade);
        const float step = 2.0f * kPi / n;
        const float a = step * blade + camera.aperture_rotation, b = a + step;
        const float wa = s * (1.0f - v), wb = s * v;
        p = {wa * std::cos(a) + wb * std::cos(b), wa * std::sin(a) + wb * std::sin(b)};
    }
    p.x /= camera.aperture_ratio > 0.0f ? camera.aperture_ratio : 1.0f;
    return {p.x * camera.aperture_radius, p.y * camera.aperture_radius};
}

/// Blender's fisheye frame: angle theta from the axis (+x), azimuth of (x, y) on the film.
TALBOT_INLINE Vec3 fisheye_direction(float x, float y, float theta) {
    const float r = std::sqrt(x * x + y * y);
    const float c = r > 0.0f ? x / r : 1.0f, s = r > 0.0f ? y / r : 0.0f;
    const float st = std::sin(theta);
    return {std::cos(theta), -c * st, s * st};
}

/// Direction in panorama space; zero where the film has no direction.
TALBOT_INLINE Vec3 panorama_direction(const scene::Camera& camera, FilmPoint film) {
    using scene::PanoramaType;
    const float u = film.x, v = film.y;
    switch (camera.panorama) {
        case PanoramaType::Equirectangular: {
            const float phi = (camera.longitude_min - camera.longitude_max) * u - camera.longitude_min;
            const float theta = (camera.latitude_min - camera.latitude_max) * v - camera.latitude_min + kPi / 2;
            return {std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta)};
        }
        case PanoramaType::EquiangularCubemap:
            return normalize({1.0f, std::tan((0.5f - u) * (kPi / 2)), std::tan((v - 0.5f) * (kPi / 2))});
        case PanoramaType::Mirrorball: {
            const float x = 2.0f * u - 1.0f, z = 2.0f * v - 1.0f;
            if (x * x + z * z > 1.0f) return {};
            const Vec3 n{x, -safe_sqrt(1.0f - x * x - z * z), z};
            const Vec3 i{0, -1, 0};
            const Vec3 d = 2.0f * dot(n, i) * n - i;
            // The mirror ball's own frame: camera (right, up, forward) = (x, z, -y), said in panorama axes.
            return {-d.y, -d.x, d.z};
        }
        case PanoramaType::FisheyeEquidistant: {
            const float x = 2.0f * (u - 0.5f), y = 2.0f * (v - 0.5f), r = std::sqrt(x * x + y * y);
            if (r > 1.0f) return {};
            return fisheye_direction(x, y, r * camera.fov * 0.5f);
        }
        case PanoramaType::FisheyeEquisolid: {
            const float x = (u - 0.5f) * camera.sensor_width_mm, y = (v - 0.5f) * camera.sensor_height_mm, r = std::sqrt(x * x + y * y);
            if (r > 2.0f * camera.lens_mm * std::sin(camera.fov * 0.25f)) return {};
            return fisheye_direction(x, y, 2.0f * std::asin(minf(r / (2.0f * camera.lens_mm), 1.0f)));
        }
        case PanoramaType::FisheyePolynomial: {
            const float x = (u - 0.5f) * camera.sensor_width_mm, y = (v - 0.5f) * camera.sensor_height_mm, r = std::sqrt(x * x + y * y);
            const float* k = camera.polynomial;
            const float theta = -(k[0] + r * (k[1] + r * (k[2] + r * (k[3] + r * k[4]))));
            if (std::fabs(theta) > 0.5f * camera.fov) return {};
            return fisheye_direction(x, y, theta);
        }
        case PanoramaType::CentralCylindrical: {
            const float t = lerp(-camera.cylinder[0], -camera.cylinder[1], u), z = lerp(camera.cylinder[2], camera.cylinder[3], v);
            return normalize({std::cos(t), std::sin(t), z});
        }
    }
    return {};
}

struct CameraRay {
    Vec3 origin, direction;   ///< camera space
    float near = 0, far = 0;  ///< along the ray
    bool exists = true;
};

TALBOT_INLINE CameraRay camera_ray(const scene::Camera& camera, FilmPoint film, float lens_u, float lens_v) {
    const Vec2 lens = camera.aperture_radius > 0.0f ? aperture_point(camera, lens_u, lens_v) : Vec2{};
    const float x = lerp(camera.view[0], camera.view[1], film.x), y = lerp(camera.view[2], camera.view[3], film.y);
    CameraRay ray;
    if (camera.type == scene::CameraType::Perspective) {
        ray.origin = {lens.x, lens.y, 0};
        ray.direction = normalize(Vec3{x, y, -1} * camera.focus_distance - ray.origin);
        const float along = -1.0f / ray.direction.z;
        ray.near = camera.clip_start * along;
        ray.far = camera.clip_end * along;
    } else if (camera.type == scene::CameraType::Orthographic) {
        ray.origin = {x + lens.x, y + lens.y, 0};
        ray.direction = normalize(Vec3{x, y, -camera.focus_distance} - ray.origin);
        ray.near = camera.clip_start;
        ray.far = camera.clip_end;
    } else {
        const Vec3 p = panorama_direction(camera, film);
        ray.exists = dot(p, p) > 0.0f;
        const Vec3 d{-p.y, p.z, -p.x};
        if (camera.aperture_radius > 0.0f) {
            Vec3 right, up;
            make_basis(d, right, up);
            ray.origin = right * lens.x + up * lens.y;
            ray.direction = normalize(d * camera.focus_distance - ray.origin);
        } else {
            ray.direction = d;
        }
        ray.near = camera.clip_start;
        ray.far = camera.clip_end;
    }
    return ray;
}

}  // namespace

namespace {

/// Where the new paths of one span begin, in span scratch: pixel positions, sampler keys, then rays in world space.
/// Loops that have to vectorise read `n` once: for all the compiler knows, a column is stored over it.
struct NewPaths {
    int n = 0;
    int32_t *lane, *pixel, *px, *py;
    uint32_t *key, *sample;
    float *film_x, *film_y, *lens_u, *lens_v;
    Columns3 origin, direction;
    float *near, *far, *time;
    /// Angle, in radians, by which neighbouring pixels' rays through the lens' centre turn away: the mean of the one to the right and the one above.
    float* spread;
    uint8_t* exists;
};

NewPaths new_paths(SpanScratch& s) {
    NewPaths p;
    p.lane = s.lane, p.pixel = s.list, p.px = s.list2, p.py = s.itmp;
    p.key = s.span.key, p.sample = s.span.sample;
    p.film_x = s.u0, p.film_y = s.v0, p.lens_u = s.u1, p.lens_v = s.v1;
    p.origin = s.f, p.direction = s.wi;
    p.near = s.tmp, p.far = s.tmp2, p.time = s.time;
    p.spread = s.pdf;
    p.exists = s.mask;
    return p;
}

/// The commonest camera, as a loop that vectorises.
void pinhole_rays(const scene::Camera& camera, const NewPaths& paths) {
    const int n = paths.n;
    const Column film_x = paths.film_x, film_y = paths.film_y, near = paths.near, far = paths.far;
    const Column ox = paths.origin.x, oy = paths.origin.y, oz = paths.origin.z, dx = paths.direction.x, dy = paths.direction.y, dz = paths.direction.z;
    const Affine m = camera.to_world;
    const float left = camera.view[0], width = camera.view[1] - camera.view[0], bottom = camera.view[2], height = camera.view[3] - camera.view[2];
    const float clip_start = camera.clip_start, clip_end = camera.clip_end;
    TALBOT_VECTOR_LOOP
    for (int i = 0; i < n; ++i) {
        const Vec3 film{left + width * film_x[i], bottom + height * film_y[i], -1.0f};
        const float along = std::sqrt(dot(film, film));
        const Vec3 d = normalize(transform_direction(m, film));
        const Vec3 o = transform_point(m, film * clip_start);
        ox[i] = o.x, oy[i] = o.y, oz[i] = o.z;
        dx[i] = d.x, dy[i] = d.y, dz[i] = d.z;
        near[i] = clip_start * along;
        far[i] = clip_end * along;
    }
}

TALBOT_INLINE void general_ray(const scene::Camera& camera, const NewPaths& paths, int i) {
    const CameraRay ray = camera_ray(camera, {paths.film_x[i], paths.film_y[i]}, paths.lens_u[i], paths.lens_v[i]);
    paths.exists[i] = ray.exists;
    store(paths.origin, i, transform_point(camera.to_world, ray.origin + ray.direction * ray.near));
    store(paths.direction, i, normalize(transform_direction(camera.to_world, ray.direction)));
    paths.near[i] = ray.near;
    paths.far[i] = ray.far;
}

/// Any other camera, and moving ones.
void general_rays(const scene::Camera& camera, const scene::Motion& motion, const NewPaths& paths) {
    if (!motion.camera.empty()) {
        const int steps = int(motion.camera.size());
        scene::Camera now = camera;
        for (int i = 0; i < paths.n; ++i) {
            now.to_world = scene::map_at(motion.camera.data(), steps, paths.time[i]);
            const scene::MotionStep m = scene::motion_step(steps, paths.time[i]);
            for (int side = 0; side < 4 && !motion.camera_views.empty(); ++side)
                now.view[side] = lerp(motion.camera_views[size_t(4 * m.step + side)], motion.camera_views[size_t(4 * m.step + 4 + side)], m.part);
            general_ray(now, paths, i);
        }
        return;
    }
    for (int i = 0; i < paths.n; ++i) general_ray(camera, paths, i);
}

/// NewPaths::spread of a perspective camera.
void perspective_spread(const scene::Camera& camera, Vec2 pixel, const NewPaths& paths) {
    const int n = paths.n;
    const Column film_x = paths.film_x, film_y = paths.film_y, spread = paths.spread;
    const float left = camera.view[0], width = camera.view[1] - camera.view[0], bottom = camera.view[2], height = camera.view[3] - camera.view[2];
    const float wide = 0.5f * std::fabs(width) * pixel.x, high = 0.5f * std::fabs(height) * pixel.y;
    TALBOT_VECTOR_LOOP
    for (int i = 0; i < n; ++i) {
        const float x = left + width * film_x[i], y = bottom + height * film_y[i], x2 = x * x, y2 = y * y;
        // The change of (x, y, -1) / length: shorter by the sine of the angle between it and the ray.
        spread[i] = (wide * std::sqrt(1.0f + y2) + high * std::sqrt(1.0f + x2)) / (1.0f + x2 + y2);
    }
}

/// NewPaths::spread of any camera; `pixel` is a pixel's size in film positions.
void cone_spread(const scene::Camera& camera, Vec2 pixel, const NewPaths& paths) {
    if (camera.type == scene::CameraType::Perspective) return perspective_spread(camera, pixel, paths);
    const bool panorama = camera.type == scene::CameraType::Panoramic;
    for (int i = 0; i < paths.n; ++i) {
        const float x = paths.film_x[i], y = paths.film_y[i];
        const Vec3 d = panorama ? panorama_direction(camera, {x, y}) : Vec3{};
        paths.spread[i] =
            panorama ? 0.5f * (length(panorama_direction(camera, {x + pixel.x, y}) - d) + length(panorama_direction(camera, {x, y + pixel.y}) - d)) : 0.0f;
    }
}

/// Film positions and lens numbers of the span's paths.
void sample_film(const RenderContext& context, const RenderUnit& unit, const NewPaths& paths, bool lens) {
    const int n = paths.n;
    const scene::Settings& settings = *context.settings;
    const float block = float(unit.pixel_size);
    const float inverse_width = 1.0f / float(settings.width), inverse_height = 1.0f / float(settings.height);
    const uint32_t seed = settings.seed, width = uint32_t(settings.width);
    const float* __restrict table = context.filter_table;
    const IntColumn px = paths.px, py = paths.py;
    uint32_t* __restrict key = paths.key;
    const uint32_t* __restrict sample = paths.sample;
    const Column film_x = paths.film_x, film_y = paths.film_y, lens_u = paths.lens_u, lens_v = paths.lens_v;
    TALBOT_VECTOR_LOOP
    for (int i = 0; i < n; ++i) {
        key[i] = pixel_key(seed, uint32_t(py[i]) * width + uint32_t(px[i]));
        const Vec2 u = sample_pair(key[i], sample[i], pair_dimension(0, Pair::PixelFilter));
        // The first sample is the pixel's centre, as in Cycles: passes of one sample show that.
        const float spread = sample[i] == 0 ? 0.0f : block;
        film_x[i] = (float(px[i]) + 0.5f * block + spread * filter_offset(table, u.x)) * inverse_width;
        film_y[i] = (float(py[i]) + 0.5f * block + spread * filter_offset(table, u.y)) * inverse_height;
    }
    if (!lens) return;
    TALBOT_VECTOR_LOOP
    for (int i = 0; i < n; ++i) {
        const Vec2 u = sample_pair(key[i], sample[i], pair_dimension(0, Pair::Lens));
        lens_u[i] = u.x;
        lens_v[i] = u.y;
    }
}

/// When the span's paths see the scene. A rolling shutter exposes a row for a part of the time only, from the top row to the bottom one.
void sample_time(const RenderContext& context, const NewPaths& paths) {
    const scene::Motion& motion = *context.scene->motion;
    const int last = int(motion.shutter.size()) - 1;
    const float inverse_height = 1.0f / float(context.settings->height);
    for (int i = 0; i < paths.n; ++i) {
        float time = sample_pair(paths.key[i], paths.sample[i], pair_dimension(0, Pair::Time)).x;
        if (last > 0) {
            const float x = time * float(last);
            const int at = int(x) < last ? int(x) : last - 1;
            time = lerp(motion.shutter[size_t(at)], motion.shutter[size_t(at) + 1], x - float(at));
        }
        if (motion.rolling) {
            const float row = 1.0f - float(paths.py[i]) * inverse_height, duration = motion.rolling_duration;
            time = duration > 0.0f ? (time - 0.5f) * duration + (row - 0.5f) * (1.0f - duration) + 0.5f : row;
        }
        paths.time[i] = time;
    }
}

/// Takes free lanes for the next paths of the unit.
int take_lanes(const RenderContext& context, const RenderUnit& unit, int64_t& cursor, Worker& worker, const NewPaths& paths) {
    const scene::Settings& settings = *context.settings;
    const int64_t pixels = unit.pixel_count;
    const int64_t left = pixels * (unit.sample_end - unit.sample_begin) - cursor;
    int n = worker.free_count < kSpan ? worker.free_count : kSpan;
    if (left < n) n = int(left);
    int32_t pixel = int32_t(cursor % pixels);
    uint32_t number = uint32_t(unit.sample_begin) + uint32_t(cursor / pixels);
    const auto plane_of = [&](uint32_t n) { return unit.halves && film::sample_half(n) ? unit.pixel_count : 0; };
    int32_t plane = plane_of(number);
    for (int i = 0; i < n; ++i) {
        const film::PackedPixel place = unit.pixels[pixel];
        paths.lane[i] = worker.free_lanes[--worker.free_count];
        paths.pixel[i] = plane + pixel;
        paths.sample[i] = uint32_t(settings.first_sample) + number;
        paths.px[i] = settings.crop_x + film::pixel_x(place) * unit.pixel_size;
        paths.py[i] = settings.crop_y + film::pixel_y(place) * unit.pixel_size;
        if (++pixel == unit.pixel_count) {
            pixel = 0;
            plane = plane_of(++number);
        }
    }
    cursor += n;
    return n;
}

}  // namespace

int generate_paths(const RenderContext& context, const RenderUnit& unit, int64_t& cursor, Worker& worker) {
    const scene::Settings& settings = *context.settings;
    const scene::Camera& camera = *context.camera;
    PathColumns& paths = worker.paths;
    const Vec2 pixel{float(unit.pixel_size) / float(settings.width), float(unit.pixel_size) / float(settings.height)};
    const bool orthographic = camera.type == scene::CameraType::Orthographic;
    // Wide at once: parallel rays, and in 3.4 those of panoramas, by a pixel of a picture one metre wide (bump takes its slope over that).
    const bool wide_panorama = camera.type == scene::CameraType::Panoramic && settings.version < 402;
    const Vec2 view = wide_panorama ? Vec2{1, 1} : Vec2{std::fabs(camera.view[1] - camera.view[0]), std::fabs(camera.view[3] - camera.view[2])};
    const float pixel_extent = orthographic || wide_panorama ? 0.5f * (view.x * pixel.x + view.y * pixel.y) : 0.0f;
    const bool lens = camera.aperture_radius > 0.0f;
    const bool moves = context.scene->has_motion;
    const scene::Motion& motion = *context.scene->motion;
    const bool pinhole = camera.type == scene::CameraType::Perspective && !lens && motion.camera.empty();

    int fresh = 0;
    NewPaths next = new_paths(worker.scratch);
    while ((next.n = take_lanes(context, unit, cursor, worker, next)) > 0) {
        const int n = next.n;
        worker.counters.paths += uint64_t(n);
        std::memset(next.exists, 1, size_t(n));
        sample_film(context, unit, next, lens);
        if (moves) sample_time(context, next);
        if (pinhole)
            pinhole_rays(camera, next);
        else
            general_rays(camera, motion, next);
        cone_spread(camera, pixel, next);

        for (int i = 0; i < n; ++i) {
            const int32_t lane = next.lane[i];
            if (!next.exists[i]) {
                // No light comes from nowhere: black and opaque, as in Cycles.
                worker.free_lanes[worker.free_count++] = lane;
                continue;
            }
            worker.fresh[fresh++] = lane;
            store(paths.origin, lane, load(next.origin, i));
            store(paths.direction, lane, load(next.direction, i));
            paths.t_max[lane] = maxf(next.far[i] - next.near[i], 0.0f);
            store(paths.throughput, lane, vec3(1.0f));
            paths.bsdf_pdf[lane] = 0.0f;
            paths.min_pdf[lane] = 3.0e38f;
            paths.mis_t[lane] = 0.0f;
            paths.cone_spread[lane] = next.spread[i];
            paths.cone_width[lane] = pixel_extent + next.spread[i] * next.near[i];
            paths.pixel[lane] = next.pixel[i];
            paths.key[lane] = next.key[i];
            if (moves) paths.time[lane] = next.time[i];
            paths.sample[lane] = next.sample[i];
            paths.flags[lane] = int32_t(shader::kRayCamera) | kPathDelta | kPathSeesBackground;
            paths.bounces[lane] = 0;
            paths.vertex[lane] = 1;
            if (context.layout->light_passes) {
                store(paths.diffuse_share, lane, Vec3{});
                store(paths.glossy_share, lane, Vec3{});
            }
        }
    }
    return fresh;
}

}  // namespace TALBOT_ISA
}  // namespace talbot::integrator
