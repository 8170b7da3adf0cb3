#include "geometry/dice.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/cpu.h"
#include "geometry/tessellate.h"

namespace talbot::geometry {
namespace {

/// Positions, normals, indices and a UV map, what dicing needs on the way, and Embree's share.
constexpr size_t kTriangleBytes = 320;
constexpr size_t kMostTriangles = size_t(1) << 30;

/// A pixel's width at distance 1; of panoramas, the angle it covers.
float pixel_width(const scene::Camera& camera, int width) {
    const auto across = [&]() -> float {
        if (camera.type != scene::CameraType::Panoramic) return camera.view[1] - camera.view[0];
        switch (camera.panorama) {
            case scene::PanoramaType::Equirectangular:
                return camera.longitude_max - camera.longitude_min;
            case scene::PanoramaType::CentralCylindrical:
                return camera.cylinder[1] - camera.cylinder[0];
            case scene::PanoramaType::FisheyeEquidistant:
            case scene::PanoramaType::FisheyeEquisolid:
            case scene::PanoramaType::FisheyePolynomial:
                return camera.fov;
            case scene::PanoramaType::EquiangularCubemap:
            case scene::PanoramaType::Mirrorball:
                break;
        }
        return 2 * std::numbers::pi_v<float>;
    };
    return std::max(std::abs(across()), 1e-6f) / float(width);
}

/// How finely this object would be diced where it is nearest to the camera.
float fineness(const DicingMeter& meter, const Affine& to_object, const Vec3 (&box)[2]) {
    const scene::Camera& camera = *meter.camera;
    const Vec3 eye = transform_point(to_object, {camera.to_world.m[0][3], camera.to_world.m[1][3], camera.to_world.m[2][3]});
    const Vec3 nearest{std::clamp(eye.x, box[0].x, box[1].x), std::clamp(eye.y, box[0].y, box[1].y), std::clamp(eye.z, box[0].z, box[1].z)};
    const float step = 1e-3f * std::max(length(box[1] - box[0]), 1e-20f);
    float sum = 0;
    for (const Vec3 axis : {Vec3{step, 0, 0}, Vec3{0, step, 0}, Vec3{0, 0, step}}) sum += meter.edges(nearest, nearest + axis);
    return sum / step;
}

/// By which of the objects that show the mesh it is diced.
DicingMeter meter_of(const scene::SceneTables& tables, const scene::Scene& scene, size_t handle, const scene::Mesh& cage) {
    DicingMeter meter;
    meter.edge_length = cage.subdivision.edge_length;
    if (!cage.subdivision.in_pixels) return meter;
    meter.camera = &scene.dicing_camera;
    meter.to_camera = inverse(scene.dicing_camera.to_world);
    meter.pixel = pixel_width(scene.dicing_camera, scene.settings.width);
    meter.offscreen = std::max(scene.settings.offscreen_dicing_scale, 1.0f);
    Vec3 box[2] = {vec3(1e30f), vec3(-1e30f)};
    for (const Vec3& p : cage.positions) {
        box[0] = {std::min(box[0].x, p.x), std::min(box[0].y, p.y), std::min(box[0].z, p.z)};
        box[1] = {std::max(box[1].x, p.x), std::max(box[1].y, p.y), std::max(box[1].z, p.z)};
    }
    float finest = -1;
    for (int32_t i = 0; i < tables.view.object_count; ++i) {
        if (scene::traits_of(tables.view, i).mesh != int32_t(handle)) continue;
        DicingMeter here = meter;
        here.to_world = tables.view.objects[i].to_world;
        const float fine = fineness(here, tables.view.to_object[i], box);
        if (fine > finest) {
            finest = fine;
            meter = here;
        }
    }
    return meter;
}

std::vector<float> measures_of(const DicingMeter& meter, const scene::Settings& settings) {
    std::vector<float> out{meter.edge_length, meter.pixel, meter.offscreen};
    if (!meter.camera) return out;
    const auto add = [&](const Affine& map) { out.insert(out.end(), &map.m[0][0], &map.m[0][0] + 12); };
    const scene::Camera& camera = *meter.camera;
    if (!settings.viewport) add(meter.to_world);
    add(meter.to_camera);
    out.insert(out.end(), camera.view, camera.view + 4);
    out.insert(out.end(), {float(camera.type), camera.clip_start});
    return out;
}

std::shared_ptr<const scene::Mesh> diced(const scene::Mesh& cage, DicingMeter meter, size_t budget, WorkerPool& pool, Report& report,
                                         const std::atomic<bool>* cancel) {
    int coarser = 1;
    while (true) {
        std::optional<scene::Mesh> mesh = tessellate(cage, meter, budget, pool, cancel);
        if (mesh) {
            if (coarser > 1)
                report.warning("Adaptive subdivision would not fit into memory: it is " + std::to_string(coarser) + " times coarser than asked for",
                               "Mesh '" + cage.name + "'");
            return std::make_shared<const scene::Mesh>(std::move(*mesh));
        }
        // Even the least dicing is too much: the cage as it is.
        if (coarser >= 1 << 20) {
            report.warning("Adaptive subdivision does not fit into memory: it is left out", "Mesh '" + cage.name + "'");
            return nullptr;
        }
        coarser *= 2;
        meter.edge_length *= 2;
    }
}

}  // namespace

size_t dicing_budget() {
    return std::min(available_memory() / 2 / kTriangleBytes, kMostTriangles);
}

void dice_meshes(scene::SceneTables& tables, const scene::Scene& scene, size_t budget, WorkerPool& pool, std::vector<DicedMesh>& known, Report& report,
                 const std::atomic<bool>* cancel) {
    const std::vector<DicedMesh> before = std::move(known);
    known.clear();
    std::vector<bool> shown(tables.meshes.size());
    for (int32_t i = 0; i < tables.view.object_count; ++i) {
        const int32_t mesh = scene::traits_of(tables.view, i).mesh;
        if (mesh >= 0) shown[size_t(mesh)] = true;
    }
    for (size_t handle = 0; handle < tables.meshes.size(); ++handle) {
        const std::shared_ptr<const scene::Mesh> cage = tables.keep_alive[handle];
        if (!shown[handle] || !cage || cage->subdivision.scheme == scene::SubdivisionScheme::None) continue;
        const DicingMeter meter = meter_of(tables, scene, handle, *cage);
        DicedMesh made{scene::Handle(handle), measures_of(meter, scene.settings), cage, nullptr, {}};
        const auto same = [&](const DicedMesh& b) { return b.handle == made.handle && b.source == cage && b.measures == made.measures; };
        const auto old = std::find_if(before.begin(), before.end(), same);
        made.mesh = old != before.end() ? old->mesh : diced(*cage, meter, budget, pool, report, cancel);
        if (!made.mesh) continue;
        budget -= std::min(budget, made.mesh->triangle_count());
        known.push_back(std::move(made));
    }
    for (DicedMesh& d : known) {
        d.attributes.assign(tables.attribute_names.size(), {});
        tables.meshes[size_t(d.handle)] = scene::view_mesh(*d.mesh, tables, d.attributes.data());
        tables.keep_alive[size_t(d.handle)] = d.mesh;
    }
}

}  // namespace talbot::geometry
