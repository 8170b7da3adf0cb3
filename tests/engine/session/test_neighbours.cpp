// What a pixel shows does not depend on which pixels share its batch, on any instruction set of the machine.
#include <gtest/gtest.h>

#include "base/cpu.h"
#include "session/state.h"
#include "support/scenes.h"

namespace talbot {
namespace {

/// Lamps of every shape, so that some spans of light samples go to one lamp and others to many.
scene::Scene lamps_of_every_shape() {
    scene::Scene scene = tests::box_with_lamp();
    scene.settings.samples = 1;  // the order of a pixel's samples plays no part
    for (const scene::AreaShape shape : {scene::AreaShape::Rectangle, scene::AreaShape::Ellipse, scene::AreaShape::Disk}) {
        scene::Light light;
        light.type = scene::LightType::Area;
        light.power = 15;
        light.shape = shape;
        light.size_x = 0.8f;
        light.size_y = 0.5f;
        light.spread = 2.0f;
        light.to_world.m[0][3] = 0.3f * float(scene.lights.size());
        light.to_world.m[2][3] = 1.5f;
        scene.lights.push_back(light);
    }
    return scene;
}

class Neighbours : public testing::TestWithParam<const char*> {};

TEST_P(Neighbours, DoNotChangeAPixel) {
    if (!machine_runs(GetParam())) GTEST_SKIP() << "not on this machine";
    Session::State s;
    s.scene = lamps_of_every_shape();
    s.scene.settings.instruction_set = GetParam();
    s.scene.dirty = scene::kDirtyAll;
    update_render_data(s);
    ASSERT_EQ(std::string(s.statistics.instruction_set), GetParam());
    const integrator::RenderContext context = make_context(s, s.film->layout());
    const integrator::KernelTable& kernels = integrator::kernels_for(s.statistics.instruction_set);
    const std::vector<film::PackedPixel> all = film::list_pixels(s.width, s.height, 16);
    const auto render_lists = [&](size_t size) {
        film::Film film(s.film->layout(), s.width, s.height, false);
        film::TileFilm tile;
        for (size_t first = 0; first < all.size(); first += size) {
            const std::span pixels = std::span(all).subspan(first, std::min(size, all.size() - first));
            tile.reset(film.layout(), int(pixels.size()));
            EXPECT_TRUE(kernels.render_unit(context, {pixels.data(), int(pixels.size()), 0, 1}, *s.data.workers[0], tile));
            film.merge(tile, pixels, 1);
        }
        std::vector<float> combined(size_t(s.width) * size_t(s.height) * 4);
        film.resolve(scene::PassKind::Combined, s.scene.settings, combined);
        return combined;
    };
    const std::vector<float> whole = render_lists(all.size());
    EXPECT_GT(whole[0], 0);
    for (const size_t size : {size_t(1), size_t(7), size_t(64)}) EXPECT_EQ(render_lists(size), whole) << "by " << size;
}

INSTANTIATE_TEST_SUITE_P(Isas, Neighbours, testing::ValuesIn(compiled_isas().begin(), compiled_isas().end()),
                         [](const auto& isa) { return std::string(isa.param); });

}  // namespace
}  // namespace talbot
