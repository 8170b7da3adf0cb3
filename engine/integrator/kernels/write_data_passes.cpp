/// Passes of what camera paths meet: geometry of the hit, colours of its closures, guides for the denoiser. They go on behind transparent
/// surfaces, and behind clear glass where a transparent film shows through it.

#include "closure/microfacet.h"
#include "integrator/kernels/stages.h"

namespace talbot::integrator {
inline namespace TALBOT_ISA {

void write_data_passes(const RenderContext& context, Worker& worker, const shader::Program& program, const ClosureGeometry& geometry, film::TileFilm& tile) {
    using scene::PassKind;
    PathColumns& paths = worker.paths;
    SpanScratch& s = worker.scratch;
    const shader::ShadingSpan& span = s.span;
    const film::FilmLayout& layout = *context.layout;
    const scene::Camera& camera = *context.camera;

    // Lanes that write, and the transparency of what they meet.
    const uint32_t first_sample = uint32_t(context.settings->first_sample);
    int n = 0;
    for (int i = 0; i < span.n; ++i) {
        s.list[n] = i;
        n += ((s.path_flags[i] & kPathSeesBackground) != 0) & (layout.data_sums | (span.sample[i] == first_sample));
    }
    if (n == 0) return;
    fill(s.tmp, span.n, 0.0f);
    for (const ClosureSlot& slot : program.slots) {
        if (slot.type != ClosureType::Transparent) continue;
        const ClosureColumns c = slot_columns(slot, s.registers);
        for (int i = 0; i < span.n; ++i) s.tmp[i] += mean(load(c.weight, i));
    }

    const Vec3 eye{camera.to_world.m[0][3], camera.to_world.m[1][3], camera.to_world.m[2][3]};
    const Vec3 axis = normalize(Vec3{-camera.to_world.m[0][2], -camera.to_world.m[1][2], -camera.to_world.m[2][2]});
    const bool planar = camera.type != scene::CameraType::Panoramic;
    auto write = [&](PassKind kind, const float* const* columns) {
        for (int k = 0; k < n; ++k) s.itmp[k] = paths.pixel[s.lane[s.list[k]]];
        film::add_data(tile, kind, s.itmp, columns, s.tmp2, n);
    };
    auto scalar = [&](PassKind kind, auto&& value) {
        if (!layout.has(kind)) return;
        for (int k = 0; k < n; ++k) s.tmp3.x[k] = value(s.list[k]);
        const float* columns[] = {s.tmp3.x};
        write(kind, columns);
    };
    auto vector = [&](PassKind kind, auto&& value) {
        if (!layout.has(kind)) return;
        for (int k = 0; k < n; ++k) store(s.tmp3, k, value(s.list[k]));
        const float* columns[] = {s.tmp3.x, s.tmp3.y, s.tmp3.z};
        write(kind, columns);
    };
    auto weigh = [&](auto&& weight) {
        for (int k = 0; k < n; ++k) s.tmp2[k] = weight(s.list[k]);
    };
    auto keep = [&](auto&& condition) {
        int left = 0;
        for (int k = 0; k < n; ++k) {
            const int i = s.list[k];
            s.list[left] = i;
            left += condition(i);
        }
        n = left;
    };
    auto share = [&](int i) { return saturate(1.0f - s.tmp[i]) * mean(load(s.throughput, i)); };
    const bool parallel = camera.type == scene::CameraType::Orthographic;
    auto distance = [&](int i) {
        const Vec3 d = load(span.p, i) - eye;
        return parallel ? std::fabs(dot(d, axis)) : length(d);
    };

    // Sums over everything on the way.
    weigh(share);
    scalar(PassKind::Mist, [&](int i) { return film::mist_amount(*context.settings, distance(i)); });
    const bool colors = layout.has(PassKind::DiffuseColor) || layout.has(PassKind::GlossyColor) || layout.has(PassKind::TransmissionColor) ||
                        layout.has(PassKind::DenoisingAlbedo);
    Columns3 sums[3] = {s.f_diffuse, s.f_glossy, s.slot_f};
    if (colors) {
        for (Columns3 sum : sums) fill(sum.x, span.n, 0.0f), fill(sum.y, span.n, 0.0f), fill(sum.z, span.n, 0.0f);
        for (const ClosureSlot& slot : program.slots) {
            if (slot.lobe == LobeKind::None || slot.lobe == LobeKind::Transparent) continue;
            const ClosureColumns columns = slot_columns(slot, s.registers);
            const Columns3 sum = sums[slot.lobe == LobeKind::Diffuse ? 0 : slot.lobe == LobeKind::Glossy ? 1 : 2];
            // Before 4.0 the glossy colour is the closure's weight: Fresnel is part of the light.
            const bool weight_only = slot.lobe == LobeKind::Glossy && context.settings->version < 400;
            const ConstColumns3 color = weight_only ? columns.weight : ConstColumns3{s.rgb.x, s.rgb.y, s.rgb.z};
            if (!weight_only) closure_albedo(slot, columns, geometry, span.n, s.rgb);
            if (slot.type == ClosureType::MicrofacetGlass) {
                // What it reflects is glossy: its albedo without the transmission tint.
                ClosureColumns reflecting = columns;
                fill(s.tmp2, span.n, 0.0f);
                for (int k = 0; k < 3; ++k) reflecting.params[kGlassTransmissionTint + k] = s.tmp2;
                closure_albedo(slot, reflecting, geometry, span.n, s.tmp3);
                for (int i = 0; i < span.n; ++i) {
                    store(sums[1], i, load(sums[1], i) + load(s.tmp3, i));
                    store(s.rgb, i, load(s.rgb, i) - load(s.tmp3, i));
                }
            }
            for (int i = 0; i < span.n; ++i) store(sum, i, load(sum, i) + load(color, i));
        }
        auto throughput = [&](int i) { return load(s.throughput, i); };
        weigh([](int) { return 1.0f; });  // colours carry their own weights
        vector(PassKind::DiffuseColor, [&](int i) { return load(sums[0], i) * throughput(i); });
        vector(PassKind::GlossyColor, [&](int i) { return load(sums[1], i) * throughput(i); });
        vector(PassKind::TransmissionColor, [&](int i) { return load(sums[2], i) * throughput(i); });
    }

    // The rest shows the first surface that is opaque enough. The denoiser's guides take what is before it too.
    keep([&](int i) { return !(s.path_flags[i] & kPathDataDone); });
    weigh([](int) { return 1.0f; });
    if (colors) vector(PassKind::DenoisingAlbedo, [&](int i) { return (load(sums[0], i) + load(sums[1], i) + load(sums[2], i)) * load(s.throughput, i); });
    // The mean of the closures' normals (bump included), the geometry's where nothing scatters.
    fill(s.share_a.x, span.n, 0.0f), fill(s.share_a.y, span.n, 0.0f), fill(s.share_a.z, span.n, 0.0f);
    if (layout.has(PassKind::Normal) || layout.has(PassKind::DenoisingNormal)) {
        for (const ClosureSlot& slot : program.slots) {
            if (slot.lobe == LobeKind::None || slot.lobe == LobeKind::Transparent) continue;
            const ClosureColumns c = slot_columns(slot, s.registers);
            for (int i = 0; i < span.n; ++i) store(s.share_a, i, load(s.share_a, i) + load(c.normal, i) * mean(load(c.weight, i)));
        }
    }
    auto normal = [&](int i) {
        const Vec3 sum = load(s.share_a, i);
        return dot(sum, sum) > 0.0f ? normalize(sum) : load(span.n_s, i);
    };
    weigh(share);
    vector(PassKind::DenoisingNormal, normal);
    const float least = context.settings->pass_alpha_threshold;
    auto decides = [&](int i) { return 1.0f - s.tmp[i] >= least; };
    weigh([&](int i) { return decides(i) ? 1.0f : 0.0f; });
    vector(PassKind::Normal, normal);
    if (layout.has(PassKind::Vector3Uv)) {
        // The active UV map at the hit, interpolated from the corners.
        vector(PassKind::Vector3Uv, [&](int i) {
            const scene::MeshView& mesh = context.scene->meshes[scene::traits_of(*context.scene, span.object[i]).mesh];
            if (context.uv_attribute < 0 || !mesh.attributes) return Vec3{};
            const scene::AttributeView& uv = mesh.attributes[context.uv_attribute];
            if (uv.data && uv.domain == scene::Domain::Face && mesh.kind == scene::GeometryKind::Curves && uv.components >= 2) {
                const float* value = uv.data + size_t(uv.components) * mesh.segment_curves[span.primitive[i]];
                return Vec3{value[0], value[1], 1.0f};
            }
            if (!mesh.triangle_corners) return Vec3{};
            if (!uv.data || uv.domain != scene::Domain::Corner || uv.components < 2) return Vec3{};
            const int stride = uv.components;
            const uint32_t* corner = mesh.triangle_corners + 3 * size_t(span.primitive[i]);
            const float u = span.u[i], v = span.v[i], w = 1.0f - u - v;
            const float *a = uv.data + stride * size_t(corner[0]), *b = uv.data + stride * size_t(corner[1]), *c = uv.data + stride * size_t(corner[2]);
            return Vec3{w * a[0] + u * b[0] + v * c[0], w * a[1] + u * b[1] + v * c[1], 1.0f};
        });
    }

    for (int k = 0; k < n; ++k) {
        if (decides(s.list[k])) paths.flags[s.lane[s.list[k]]] |= kPathDataDone;
    }

    // One sample's values, each overwritten by what follows on the way to that surface.
    keep([&](int i) { return span.sample[i] == first_sample; });
    weigh([](int) { return 1.0f; });
    scalar(PassKind::Depth, [&](int i) { return planar ? dot(load(span.p, i) - eye, axis) : distance(i); });
    scalar(PassKind::ObjectIndex, [&](int i) { return float(scene::traits_of(*context.scene, span.object[i]).pass_index); });
    vector(PassKind::Position, [&](int i) { return load(span.p, i); });
    if (layout.has(PassKind::MaterialIndex)) {
        for (int k = 0; k < n; ++k) s.list2[k] = s.lane[s.list[k]];
        geometry::hit_shaders(*context.scene, paths.hit, s.list2, n, s.chosen);
        for (int k = 0; k < n; ++k) s.tmp3.x[k] = float(context.programs->shaders[size_t(s.chosen[k])].pass_index);
        const float* columns[] = {s.tmp3.x};
        write(PassKind::MaterialIndex, columns);
    }
}

void write_aovs(const RenderContext& context, Worker& worker, int index, const int32_t* lanes, film::TileFilm& tile) {
    const PathColumns& paths = worker.paths;
    SpanScratch& s = worker.scratch;
    int n = 0;
    for (int i = 0; i < s.span.n; ++i) {
        s.list[n] = i;
        n += (paths.flags[lanes[i]] & (kPathSeesBackground | kPathDataDone)) == kPathSeesBackground;
    }
    if (n == 0) return;
    const shader::Program& program = *context.programs->programs[size_t(index)];
    shader::run_program(program, *context.programs, s.span, *context.shading, s.registers);
    for (int k = 0; k < n; ++k) s.itmp[k] = paths.pixel[lanes[s.list[k]]];
    for (const shader::AovValue& aov : program.aovs) {
        const ConstColumns3 value = triple_columns(aov.first, s.registers);
        for (int k = 0; k < n; ++k) store(s.tmp3, k, load(value, s.list[k]));
        film::add_aov(tile, aov.aov, aov.nodes, s.itmp, s.tmp3, n);
    }
}

}  // namespace TALBOT_ISA
}  // namespace talbot::integrator
