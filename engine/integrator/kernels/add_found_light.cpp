#include "integrator/kernels/stages.h"

namespace talbot::integrator {
inline namespace TALBOT_ISA {

void add_found_light(const RenderContext& context, Worker& worker, const int32_t* lanes, int n, Columns3 rgb, film::Category seen, film::TileFilm& tile) {
    const scene::Settings& settings = *context.settings;
    PathColumns& paths = worker.paths;
    SpanScratch& s = worker.scratch;
    const float limit_direct = 3.0f * settings.clamp_direct, limit_indirect = 3.0f * settings.clamp_indirect;
    for (int i = 0; i < n; ++i) {
        const int32_t lane = lanes[i];
        const int bounces = total_bounces(paths.bounces[lane]);
        store(rgb, i, clamp_contribution(load(paths.throughput, lane) * load(rgb, i), bounces > 1 ? limit_indirect : limit_direct));
    }
    for (int category = 0; category < 3; ++category) {
        int count = 0;
        for (int i = 0; i < n; ++i) {
            const int32_t lane = lanes[i];
            const int bounces = total_bounces(paths.bounces[lane]);
            if ((bounces > 2 ? 2 : bounces) != category) continue;
            const Rgb c = load(rgb, i);
            if (!counts(worker, paths.flags[lane])) continue;
            if (c.x == 0.0f && c.y == 0.0f && c.z == 0.0f) continue;
            s.itmp[count] = paths.pixel[lane];
            if (context.has_catchers) mark_matte(paths, lanes + i, 1, s.matte + count);
            if (context.layout->light_groups >= 0) s.film_group[count] = s.light_group[i];
            store(s.tmp3, count, c);
            if (context.layout->light_passes) {
                store(s.share_a, count, load(paths.diffuse_share, lane));
                store(s.share_b, count, load(paths.glossy_share, lane));
            }
            ++count;
        }
        if (count == 0) continue;
        film::Contributions c;
        c.pixel = s.itmp;
        c.rgb = s.tmp3;
        c.n = count;
        if (context.has_catchers) c.matte = s.matte;
        if (context.layout->light_groups >= 0) c.light_group = s.film_group;
        if (context.layout->light_passes) {
            c.diffuse = s.share_a;
            c.glossy = s.share_b;
        }
        film::add(tile,
                  worker.catcher_pass ? film::Category::Catcher
                  : category == 0     ? seen
                  : category == 1     ? film::Category::Direct
                                      : film::Category::Indirect,
                  c);
    }
}

}  // namespace TALBOT_ISA
}  // namespace talbot::integrator
