#include <algorithm>
#include <cmath>

#include "light/emitter_table.h"

namespace talbot::light {

void EmitterTableDelete::operator()(EmitterTable* table) const {
    delete table;
}

std::vector<AliasEntry> make_alias(const std::vector<double>& weights) {
    const size_t n = weights.size();
    double total = 0;
    for (double w : weights) total += w;
    std::vector<AliasEntry> table(n);
    std::vector<double> scaled(n);
    std::vector<size_t> small, large;
    for (size_t i = 0; i < n; ++i) {
        const double p = total > 0 ? weights[i] / total : 1.0 / double(n);
        table[i] = {float(p), 1.0f, int32_t(i)};
        scaled[i] = p * double(n);
        (scaled[i] < 1 ? small : large).push_back(i);
    }
    while (!small.empty() && !large.empty()) {
        const size_t s = small.back(), l = large.back();
        small.pop_back();
        table[s].accept = float(scaled[s]);
        table[s].alias = int32_t(l);
        scaled[l] -= 1.0 - scaled[s];
        if (scaled[l] < 1) {
            large.pop_back();
            small.push_back(l);
        }
    }
    return table;
}

namespace {

/// Some emitter does not light everything: lamps, suns, and objects whether they are sampled or not.
bool has_links(const scene::Scene& scene) {
    const auto links = [](const scene::Linking& linking) { return linking.receivers != scene::Linking{}.receivers; };
    return std::any_of(scene.linkings.begin(), scene.linkings.end(), links) ||
           std::any_of(scene.lights.begin(), scene.lights.end(), [&](const scene::Light& light) { return links(light.linking); });
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

}  // namespace

EmitterTablePtr build_emitters(const scene::Scene& scene, const scene::SceneTables& tables, const shader::Programs& programs,
                               const shader::ShaderContext& context, WorkerPool& pool, Report& report, const std::atomic<bool>* cancel) {
    EmitterTablePtr table(new EmitterTable);
    EmitterSummary& summary = table->summary;

    add_lamps(scene, programs, report, *table);
    add_meshes(scene, tables, programs, report, cancel, *table);
    const float world_mean = add_world(scene, programs, context, pool, cancel, *table);
    set_distant_probabilities(world_mean, *table);

    for (Reach& reach : table->reach) {
        reach.nearest = 1.0f / std::max(reach.radius * reach.radius, 1e-18f);
        const bool plain = reach.kind == ReachKind::Oriented && reach.sin_normals == 0 && reach.cos_limit == 0;
        if (plain) reach.kind = ReachKind::Lambert;
    }

    EmitterView& view = table->view;
    if (table->emitters.size() > size_t(kScannedEmitters)) {
        std::vector<double> weights;
        for (const Reach& reach : table->reach) weights.push_back(double(reach.strength));
        table->alias = make_alias(weights);
        view.alias = table->alias.data();
    }
    for (const Emitter& emitter : table->emitters) view.has_kind[emitter.kind] = true;
    for (size_t i = 0; i < table->lamps.size(); ++i) {
        const Lamp& lamp = table->lamps[i];
        view.has_lamp_programs |= lamp.program_shader >= 0;
        const bool has_surface = lamp.kind != int32_t(EmitterKind::Point);
        if (has_surface && lamp.hit_visibility != 0) table->visible_lamps.push_back(int32_t(i));
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

    summary.has_local = !table->emitters.empty();
    summary.has_distant = view.world.probability > 0;
    for (const Sun& sun : table->suns) summary.has_distant |= sun.probability > 0;
    summary.has_visible_lamps = !table->visible_lamps.empty();
    for (const Sun& sun : table->suns) summary.has_visible_suns |= sun.hit_visibility != 0 && sun.one_minus_cos > 0;
    return table;
}

EmitterSummary summarize(const EmitterTable& table) {
    return table.summary;
}

}  // namespace talbot::light
