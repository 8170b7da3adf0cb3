#include <algorithm>
#include <cmath>

#include "light/emitter_table.h"

namespace talbot::light {

void EmitterTableDelete::operator()(EmitterTable* table) const {
    delete table;
}

namespace {

/// Some emitter does not light everything: lamps, suns, and objects whether they are sampled or not.
bool has_links(const scene::Scene& scene) {
    const auto links = [](const scene::Linking& linking) { return linking.receivers != scene::Linking{}.receivers; };
    return std::any_of(scene.linkings.begin(), scene.linkings.end(), links) ||
           std::any_of(scene.lights.begin(), scene.lights.end(), [&](const scene::Light& light) { return links(light.linking); });
}

TreeItem tree_item(const Reach& reach, uint64_t receivers) {
    TreeItem item;
    item.center = reach.center;
    item.radius = reach.radius;
    item.strength = std::min(reach.strength * reach.gain, 1e28f);
    item.receivers = receivers;
    if (reach.kind == ReachKind::Isotropic) return item;
    item.axis = reach.axis;
    item.two_sided = reach.two_sided > 0;
    item.cos_normals = reach.cos_normals;
    item.cos_limit = std::max(reach.cos_limit, 0.0f);
    if (reach.kind != ReachKind::Spot) return item;
    // The cone's frame need not be orthonormal: a squeezed spot shines anywhere, as far as the tree knows.
    const ConeFrame& cone = reach.cone;
    const float x = length(cone.x), y = length(cone.y), z = length(cone.z),
                skew = std::abs(dot(cone.x, cone.y)) + std::abs(dot(cone.y, cone.z)) + std::abs(dot(cone.z, cone.x));
    const bool even = std::abs(x - z) < 1e-3f * z && std::abs(y - z) < 1e-3f * z && skew < 1e-3f * z * z;
    item.axis = cone.z * (-1 / std::max(z, 1e-30f));
    item.cos_normals = even ? 1.0f : -1.0f;
    return item;
}

/// The distant stratum holds at most a few suns and the world: each is chosen by its irradiance on a surface that faces it.
void set_distant_probabilities(float world_mean, EmitterTable& table) {
    std::vector<double> weights;
    for (const Sun& sun : table.suns) {
        const double solid_angle = sun.one_minus_cos > 0 ? 2 * double(kPi) * double(sun.one_minus_cos) : 1.0;
        weights.push_back(std::abs(double(mean(sun.power))) * solid_angle);
    }
    const double world = double(world_mean) * double(kPi);
    double total = world;
    for (double w : weights) total += w;
    for (size_t i = 0; i < weights.size(); ++i) table.suns[i].probability = total > 0 ? float(weights[i] / total) : 0.0f;
    table.view.world.probability = total > 0 ? float(world / total) : 0.0f;
    for (int set = 0; set < scene::kReceiverSets; ++set) {
        float lit = table.view.world.probability;
        for (const Sun& sun : table.suns) lit += is_lit(sun.receivers, set) ? sun.probability : 0.0f;
        table.view.distant_scale[set] = lit > 0 ? 1.0f / lit : 0.0f;
    }
}

void set_light_groups(const scene::Scene& scene, const scene::SceneTables& tables, EmitterTable& table) {
    table.light_groups.assign(table.emitters.size(), -1);
    for (size_t i = 0; i < table.emitters.size(); ++i) {
        if (table.emitters[i].lamp >= 0) table.light_groups[i] = table.lamps[size_t(table.emitters[i].lamp)].light_group;
    }
    for (size_t i = 0; i < table.object_emitter.size(); ++i) {
        if (table.object_emitter[i] >= 0) table.light_groups[size_t(table.object_emitter[i])] = scene::traits_of(tables.view, int32_t(i)).light_group;
    }
    table.view.light_groups = table.light_groups.data();
    table.view.world_light_group = table.summary.world_light_group = scene::known_light_group(scene, scene.world.light_group);
}

}  // namespace

EmitterTablePtr build_emitters(const scene::Scene& scene, const scene::SceneTables& tables, const shader::Programs& programs,
                               const shader::ShaderContext& context, WorkerPool& pool, Report& report, const std::atomic<bool>* cancel) {
    EmitterTablePtr table(new EmitterTable);
    EmitterSummary& summary = table->summary;

    add_lamps(scene, programs, report, *table);
    add_meshes(scene, tables, programs, report, cancel, *table);
    const float world_mean = add_world(scene, programs, context, pool, cancel, *table);
    set_distant_probabilities(world_mean, *table);
    set_light_groups(scene, tables, *table);

    for (Reach& reach : table->reach) {
        reach.nearest = 1.0f / std::max(reach.radius * reach.radius, 1e-18f);
        const bool plain = reach.kind == ReachKind::Oriented && reach.sin_normals == 0 && reach.cos_limit == 0;
        if (plain) reach.kind = ReachKind::Lambert;
    }

    EmitterView& view = table->view;
    if (table->emitters.size() > size_t(kScannedEmitters)) {
        std::vector<TreeItem> items;
        for (size_t i = 0; i < table->reach.size(); ++i) items.push_back(tree_item(table->reach[i], table->receivers[i]));
        view.root = add_tree(items, *table, table->emitter_leaf);
        view.emitter_leaf = table->emitter_leaf.data();
    }
    view.nodes = table->nodes.data();
    view.hits_keep_normals = scene.settings.version < 400;
    for (const Emitter& emitter : table->emitters) view.has_kind[emitter.kind] = true;
    for (size_t i = 0; i < table->lamps.size(); ++i) {
        const Lamp& lamp = table->lamps[i];
        view.has_lamp_programs |= lamp.program_shader >= 0;
        const bool has_surface = lamp.kind != int32_t(EmitterKind::Point);
        if (has_surface && lamp.hit_visibility != 0) table->visible_lamps.push_back(int32_t(i));
        if (has_surface && lamp.linked_visibility != 0) table->linked_lamps.push_back(int32_t(i));
    }
    for (const Sun& sun : table->suns) view.has_lamp_programs |= sun.program_shader >= 0;
    for (const LightTriangle& triangle : table->triangles) {
        view.has_mesh_programs |= !programs.shaders[size_t(triangle.shader)].emission_is_constant;
    }
    summary.has_links = has_links(scene);
    if (summary.has_links) view.receivers = table->receivers.data();
    view.emitters = table->emitters.data();
    view.reach = table->reach.data();
    view.emitter_count = int(table->emitters.size());
    view.lamps = table->lamps.data();
    view.lamp_count = int(table->lamps.size());
    view.visible_lamps = table->visible_lamps.data();
    view.visible_lamp_count = int(table->visible_lamps.size());
    view.linked_lamps = table->linked_lamps.data();
    view.linked_lamp_count = int(table->linked_lamps.size());
    view.rects = table->rects.data();
    view.meshes = table->meshes.data();
    view.triangles = table->triangles.data();
    view.primitive_to_triangle = table->primitive_to_triangle.data();
    view.object_emitter = table->object_emitter.data();
    view.object_count = int(table->object_emitter.size());
    view.suns = table->suns.data();
    view.sun_count = int(table->suns.size());
    view.world.rows = table->world_rows.data();
    view.world.columns = table->world_columns.data();
    view.world.density = table->world_density.data();

    summary.has_lamp_programs = view.has_lamp_programs;
    summary.has_local = !table->emitters.empty();
    summary.has_distant = view.world.probability > 0;
    for (const Sun& sun : table->suns) summary.has_distant |= sun.probability > 0;
    summary.has_visible_lamps = !table->visible_lamps.empty();
    summary.has_linked_lamps = !table->linked_lamps.empty();
    for (size_t i = 0; i < table->suns.size(); ++i) {
        const Sun& sun = table->suns[i];
        if (sun.one_minus_cos == 0) continue;
        if (sun.hit_visibility != 0) summary.visible_suns.push_back(int32_t(i));
        if (sun.linked_visibility != 0) summary.linked_suns.push_back(int32_t(i));
    }
    return table;
}

EmitterSummary summarize(const EmitterTable& table) {
    return table.summary;
}

}  // namespace talbot::light
