#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>

#include "asset/texture.h"
#include "asset/write_image.h"
#include "support/png.h"

using namespace talbot;
using namespace talbot::asset;
using scene::AlphaMode;

namespace {

/// A folder of its own, removed at the end.
struct Folder {
    std::filesystem::path path;
    Folder() {
        std::string pattern = (std::filesystem::temp_directory_path() / "talbot-test-XXXXXX").string();
        path = mkdtemp(pattern.data());
    }
    ~Folder() { std::filesystem::remove_all(path); }
    std::string write(const std::string& name, const std::vector<uint8_t>& bytes) const {
        std::ofstream(path / name, std::ios::binary).write(reinterpret_cast<const char*>(bytes.data()), std::streamsize(bytes.size()));
        return (path / name).string();
    }
};

std::shared_ptr<scene::Image> file_image(const std::string& path, const std::string& colorspace = "sRGB", AlphaMode alpha = AlphaMode::Straight) {
    auto image = std::make_shared<scene::Image>();
    image->name = "Wall";
    image->path = path;
    image->colorspace = colorspace;
    image->alpha = alpha;
    return image;
}

struct Rgba {
    float r, g, b, a;
};

struct Loaded {
    TextureStore store;
    Report report;
    scene::Scene scene;
    explicit Loaded(std::vector<std::shared_ptr<scene::Image>> images, const std::string& config = {}) {
        for (auto& image : images) scene.images.push_back(image);
        scene.settings.ocio_config = config;
        store.update(scene, report, nullptr);
    }
    Rgba at(float u, float v, Interpolation interpolation = Interpolation::Closest, bool unassociate = false, int32_t handle = 0) const {
        Rgba out{};
        lookup_texture(store.table(), &handle, &u, &v, 1, interpolation, Extension::Repeat, {&out.r, &out.g, &out.b}, &out.a, unassociate);
        return out;
    }
    std::string first_warning() const { return report.lines().empty() ? "" : report.lines()[0].where + ": " + report.lines()[0].text; }
};

void expect_rgb(Rgba got, float r, float g, float b, const char* what = "") {
    EXPECT_NEAR(got.r, r, 1e-4) << what;
    EXPECT_NEAR(got.g, g, 1e-4) << what;
    EXPECT_NEAR(got.b, b, 1e-4) << what;
}

const char* kBlenderConfig = "/usr/share/blender/datafiles/colormanagement/config.ocio";

std::vector<uint8_t> half_transparent() {
    return test::make_png(2, 1, 4, 8, {255, 255, 255, 128, 128, 64, 0, 255});
}

}  // namespace

// The numbers of these tests were rendered by Blender 3.4.1 and 5.0.1 (an image node into an emission), file and packed alike.
TEST(Textures, EncodedBytesAreFilteredEncoded) {
    const Folder folder;
    const std::string path = folder.write("b.png", test::make_png(2, 1, 3, 8, {0, 0, 0, 255, 255, 255}));
    const Loaded loaded({file_image(path)});
    expect_rgb(loaded.at(0.5f, 0.5f, Interpolation::Linear), 0.21404f, 0.21404f, 0.21404f);
    expect_rgb(loaded.at(0.375f, 0.5f, Interpolation::Linear), 0.05088f, 0.05088f, 0.05088f);
    expect_rgb(loaded.at(0.75f, 0.5f), 1, 1, 1);
    EXPECT_EQ(loaded.at(0.5f, 0.5f).a, 1);
    EXPECT_TRUE(loaded.report.lines().empty()) << loaded.first_warning();
}

TEST(Textures, SixteenBits) {
    const std::vector<uint8_t> png = test::make_png(2, 1, 3, 16, {0, 0, 0, 65535, 65535, 65535});
    const Folder folder;
    auto packed = file_image("");
    packed->bytes = png;
    const Loaded loaded({file_image(folder.write("w.png", png)), packed, file_image(folder.write("w2.png", png), "Non-Color")});
    expect_rgb(loaded.at(0.5f, 0.5f, Interpolation::Linear, false, 0), 0.21404f, 0.21404f, 0.21404f);
    expect_rgb(loaded.at(0.5f, 0.5f, Interpolation::Linear, false, 1), 0.5f, 0.5f, 0.5f);  // Blender decodes packed ones first
    expect_rgb(loaded.at(0.375f, 0.5f, Interpolation::Linear, false, 2), 0.25f, 0.25f, 0.25f);
}

TEST(Textures, AlphaModes) {
    const Folder folder;
    const std::string path = folder.write("a.png", half_transparent());
    for (int packed = 0; packed < 2; ++packed) {
        for (AlphaMode mode : {AlphaMode::Straight, AlphaMode::Premultiplied}) {
            auto image = file_image(path, "sRGB", mode);
            if (packed) image->bytes = half_transparent();
            const Loaded loaded({image});
            expect_rgb(loaded.at(0.25f, 0.5f), 0.21586f, 0.21586f, 0.21586f, "multiplied while encoded");
            expect_rgb(loaded.at(0.75f, 0.5f), 0.21586f, 0.05127f, 0);
            expect_rgb(loaded.at(0.5f, 0.5f, Interpolation::Linear), 0.21586f, 0.11697f, 0.05127f);
            expect_rgb(loaded.at(0.25f, 0.5f, Interpolation::Closest, true), 1, 1, 1);
            expect_rgb(loaded.at(0.5f, 0.5f, Interpolation::Linear, true), 0.40431f, 0.21525f, 0.09133f);
            expect_rgb(loaded.at(0.375f, 0.5f, Interpolation::Linear, true), 0.60595f, 0.44955f, 0.31964f);
            EXPECT_NEAR(loaded.at(0.5f, 0.5f, Interpolation::Linear).a, 0.75098f, 1e-5);
        }
    }
    const Loaded channels({file_image(path, "sRGB", AlphaMode::ChannelPacked)});
    for (bool unassociate : {false, true}) {
        expect_rgb(channels.at(0.25f, 0.5f, Interpolation::Closest, unassociate), 1, 1, 1);
        expect_rgb(channels.at(0.5f, 0.5f, Interpolation::Linear, unassociate), 0.52405f, 0.34911f, 0.21404f);
    }
    EXPECT_NEAR(channels.at(0.5f, 0.5f, Interpolation::Linear).a, 0.75098f, 1e-5);
    const Loaded none({file_image(path, "sRGB", AlphaMode::None)});
    expect_rgb(none.at(0.375f, 0.5f, Interpolation::Linear), 0.73978f, 0.62566f, 0.52252f);
    EXPECT_EQ(none.at(0.25f, 0.5f).a, 1);
    const Loaded data({file_image(path, "Non-Color")});
    expect_rgb(data.at(0.25f, 0.5f, Interpolation::Closest, true), 1, 1, 1);
    expect_rgb(data.at(0.5f, 0.5f, Interpolation::Linear, true), 0.75098f, 0.62549f, 0.5f);
    const Loaded linear({file_image(path, "Linear")});
    expect_rgb(linear.at(0.25f, 0.5f), 0.50196f, 0.50196f, 0.50196f);
    expect_rgb(linear.at(0.5f, 0.5f, Interpolation::Linear, true), 0.66841f, 0.50131f, 0.3342f);
}

TEST(Textures, BlendersConfiguration) {
    if (!std::filesystem::exists(kBlenderConfig)) GTEST_SKIP() << "no Blender in /usr/share/blender";
    const Folder folder;
    const std::string path = folder.write("a.png", half_transparent());
    const Loaded loaded({file_image(path, "Filmic Log"), file_image(path, "sRGB"), file_image(path, "Linear"), file_image(path, "Non-Color"),
                         file_image(path, "Raw"), file_image(path, "Nonsense")},
                        kBlenderConfig);
    expect_rgb(loaded.at(0.75f, 0.5f), 0.05472f, 0.0031f, 0.00018f, "converted, then filtered");
    EXPECT_NEAR(loaded.at(0.25f, 0.5f).r, 8.17188f, 0.01f);
    EXPECT_NEAR(loaded.at(0.5f, 0.5f, Interpolation::Linear).g, 4.08749f, 0.005f);
    EXPECT_NEAR(loaded.at(0.5f, 0.5f, Interpolation::Linear, true).r, 5.47726f, 0.01f);
    expect_rgb(loaded.at(0.5f, 0.5f, Interpolation::Linear, false, 1), 0.21586f, 0.11697f, 0.05127f);
    expect_rgb(loaded.at(0.25f, 0.5f, Interpolation::Closest, false, 2), 0.50196f, 0.50196f, 0.50196f);
    expect_rgb(loaded.at(0.25f, 0.5f, Interpolation::Closest, false, 3), 1, 1, 1);
    expect_rgb(loaded.at(0.25f, 0.5f, Interpolation::Closest, false, 4), 1, 1, 1);
    expect_rgb(loaded.at(0.5f, 0.5f, Interpolation::Linear, false, 5), 0.21586f, 0.11697f, 0.05127f, "unknown: as sRGB");
    ASSERT_EQ(loaded.report.lines().size(), 1u);
    EXPECT_EQ(loaded.report.lines()[0].where, "Image 'Wall'");
    EXPECT_NE(loaded.report.lines()[0].text.find("'Nonsense'"), std::string::npos);
}

TEST(Textures, UnreadableConfigurationIsOneWarning) {
    const Folder folder;
    const std::string path = folder.write("b.png", test::make_png(2, 1, 3, 8, {0, 0, 0, 255, 255, 255}));
    const Loaded loaded({file_image(path), file_image(path, "Linear")}, folder.write("config.ocio", {'n', 'o'}));
    expect_rgb(loaded.at(0.5f, 0.5f, Interpolation::Linear), 0.21404f, 0.21404f, 0.21404f);
    expect_rgb(loaded.at(0.5f, 0.5f, Interpolation::Linear, false, 1), 0.5f, 0.5f, 0.5f);
    EXPECT_EQ(loaded.report.lines().size(), 1u);
}

TEST(Textures, NewerConfigurationIsReadWithoutWhatItsDisplaysNeed) {
    const std::string text = R"(ocio_profile_version: 2.99

roles:
  default: Lin
  scene_linear: Lin
displays:
  Screen:
    - !<View> {name: Plain, colorspace: Lin}
    - !<View> {name: Fancy, colorspace: Fancy}
colorspaces:
  - !<ColorSpace>
    name: Lin

  - !<ColorSpace>
    name: Fancy
    from_scene_reference: !<BuiltinTransform> {style: "FUTURE - OUTPUT"}

  - !<ColorSpace>
    name: Quarter
    to_scene_reference: !<MatrixTransform> {matrix: [0.25, 0, 0, 0, 0, 0.25, 0, 0, 0, 0, 0.25, 0, 0, 0, 0, 1]}
)";
    const Folder folder;
    const std::string path = folder.write("w.png", test::make_png(1, 1, 3, 8, {255, 255, 255}));
    const Loaded loaded({file_image(path, "Quarter"), file_image(path, "Fancy")}, folder.write("config.ocio", {text.begin(), text.end()}));
    expect_rgb(loaded.at(0.5f, 0.5f), 0.25f, 0.25f, 0.25f);
    ASSERT_EQ(loaded.report.lines().size(), 1u) << loaded.first_warning();
    EXPECT_NE(loaded.first_warning().find("'Fancy'"), std::string::npos) << loaded.first_warning();
}

TEST(Textures, RowsAndChannels) {
    const Folder folder;
    // Top row 10, 20; bottom row 30, 40.
    const Loaded loaded({file_image(folder.write("g.png", test::make_png(2, 2, 1, 8, {10, 20, 30, 40})), "Non-Color"),
                         file_image(folder.write("ga.png", test::make_png(1, 1, 2, 8, {100, 200})), "Non-Color"),
                         file_image(folder.write("rgb.png", test::make_png(1, 1, 3, 8, {1, 2, 3})), "Non-Color"),
                         file_image(folder.write("g16.png", test::make_png(1, 1, 1, 16, {12345})), "Non-Color")});
    EXPECT_FLOAT_EQ(loaded.at(0.25f, 0.25f).r, 30 / 255.0f);
    EXPECT_FLOAT_EQ(loaded.at(0.75f, 0.75f).b, 20 / 255.0f);
    EXPECT_EQ(loaded.at(0.75f, 0.75f).a, 1);
    EXPECT_EQ(loaded.store.table().textures[0].format, TexelFormat::Byte1);
    const Rgba grey_alpha = loaded.at(0.5f, 0.5f, Interpolation::Closest, false, 1);
    EXPECT_FLOAT_EQ(grey_alpha.g, 100 / 255.0f);
    EXPECT_FLOAT_EQ(grey_alpha.b, 100 / 255.0f);
    EXPECT_FLOAT_EQ(grey_alpha.a, 200 / 255.0f);
    const Rgba rgb = loaded.at(0.5f, 0.5f, Interpolation::Closest, false, 2);
    EXPECT_FLOAT_EQ(rgb.b, 3 / 255.0f);
    EXPECT_EQ(rgb.a, 1);
    EXPECT_FLOAT_EQ(loaded.at(0.5f, 0.5f, Interpolation::Closest, false, 3).g, 12345 / 65535.0f);
    EXPECT_GE(loaded.store.bytes(), 4u + 4u + 4u + 2u);
}

TEST(Textures, FloatsKeepTheirPrecision) {
    const Folder folder;
    const std::string exact = (folder.path / "exact.exr").string(), fine = (folder.path / "fine.exr").string();
    write_image(exact, 2, 1, 4, std::vector<float>{0.25f, 100, 0, 0.5f, -1, 2, 3, 1}, {});
    write_image(fine, 2, 1, 3, std::vector<float>{0.1234567f, 1e6f, 0, std::nanf(""), 2, 3}, {});
    const Loaded loaded({file_image(exact, "Linear"), file_image(fine, "Linear")});
    EXPECT_EQ(loaded.store.table().textures[0].format, TexelFormat::Half4);
    EXPECT_EQ(loaded.store.table().textures[1].format, TexelFormat::Float4);
    const Rgba first = loaded.at(0.25f, 0.5f);
    EXPECT_EQ(first.g, 100);
    EXPECT_EQ(first.a, 0.5f);
    EXPECT_EQ(loaded.at(0.25f, 0.5f, Interpolation::Closest, true).g, 200);  // EXR is multiplied already
    EXPECT_EQ(loaded.at(0.25f, 0.5f, Interpolation::Closest, false, 1).r, 0.1234567f);
    EXPECT_EQ(loaded.at(0.25f, 0.5f, Interpolation::Closest, false, 1).g, 1e6f);
    EXPECT_EQ(loaded.at(0.75f, 0.5f, Interpolation::Closest, false, 1).r, 0);  // NaN
}

TEST(Textures, Pixels) {
    auto bytes = std::make_shared<scene::Image>();
    bytes->width = bytes->height = 1;
    bytes->pixels = {128 / 255.0f, 1, 0, 1};
    auto floats = std::make_shared<scene::Image>(*bytes);
    floats->pixels = {0.3f, 7, -1, 0.5f};
    floats->pixels_are_float = true;
    auto empty = std::make_shared<scene::Image>(*bytes);
    empty->pixels.resize(3);
    const Loaded loaded({bytes, floats, empty});
    expect_rgb(loaded.at(0.5f, 0.5f), 0.21586f, 1, 0);
    expect_rgb(loaded.at(0.5f, 0.5f, Interpolation::Closest, false, 1), 0.3f, 7, -1);
    EXPECT_EQ(loaded.at(0.5f, 0.5f, Interpolation::Closest, false, 2).g, 0);
    EXPECT_EQ(loaded.report.lines().size(), 1u);
}

TEST(Textures, MissingIsMagentaAndOneWarning) {
    const Folder folder;
    auto corrupt = half_transparent();
    corrupt.resize(60);
    auto packed = file_image("");
    packed->bytes = {1, 2, 3};
    const Loaded loaded({file_image("/nowhere/brick.png"), file_image(folder.write("c.png", corrupt)), file_image(""), packed, nullptr});
    for (int handle = -1; handle < 6; ++handle) {
        const Rgba got = loaded.at(0.5f, 0.5f, Interpolation::Linear, false, handle);
        expect_rgb(got, 1, 0, 1);
        EXPECT_EQ(got.a, 1);
    }
    EXPECT_EQ(loaded.report.lines().size(), 4u);
    for (const auto& line : loaded.report.lines()) EXPECT_EQ(line.where, "Image 'Wall'");
    EXPECT_NE(loaded.report.lines()[0].text.find("magenta"), std::string::npos);
}

TEST(Textures, Tiles) {
    const Folder folder;
    folder.write("t.1001.png", test::make_png(1, 1, 3, 8, {255, 0, 0}));
    folder.write("t.1012.png", test::make_png(1, 1, 3, 8, {0, 255, 0}));
    auto image = file_image((folder.path / "t.<UDIM>.png").string());
    image->tiles = {1001, 1012, 1003, 99, 1012};
    auto found = file_image((folder.path / "t.<UDIM>.png").string());  // tiles not said
    const Loaded loaded({image, found});
    for (int handle = 0; handle < 2; ++handle) {
        expect_rgb(loaded.at(0.5f, 0.5f, Interpolation::Closest, false, handle), 1, 0, 0);
        expect_rgb(loaded.at(1.5f, 1.5f, Interpolation::Closest, false, handle), 0, 1, 0);
        expect_rgb(loaded.at(2.5f, 0.5f, Interpolation::Closest, false, handle), 1, 0, 1, "absent tile");
    }
    EXPECT_EQ(loaded.report.lines().size(), 1u);
}

TEST(Textures, UpdateKeepsWhatIsLoadedAndDropsTheRest) {
    const Folder folder;
    const auto a = file_image(folder.write("a.png", half_transparent())), b = file_image(folder.write("b.png", half_transparent()));
    Loaded loaded({a, b});
    const void* texels = loaded.store.table().textures[1].texels;
    const size_t bytes = loaded.store.bytes();
    std::filesystem::remove(folder.path / "b.png");
    loaded.scene.images = {b, b};
    loaded.store.update(loaded.scene, loaded.report, nullptr);
    EXPECT_EQ(loaded.store.table().textures[0].texels, texels);
    EXPECT_EQ(loaded.store.table().textures[1].texels, texels);
    EXPECT_EQ(loaded.store.bytes(), bytes / 2);
    EXPECT_TRUE(loaded.report.lines().empty());
    loaded.scene.images.clear();
    loaded.store.update(loaded.scene, loaded.report, nullptr);
    EXPECT_EQ(loaded.store.bytes(), 0u);
    EXPECT_EQ(loaded.store.table().count, 0);
}

TEST(Textures, Cancel) {
    const Folder folder;
    scene::Scene scene;
    scene.images = {file_image(folder.write("a.png", half_transparent()))};
    TextureStore store;
    Report report;
    std::atomic<bool> cancel = true;
    EXPECT_THROW(store.update(scene, report, &cancel), Cancelled);
    cancel = false;
    store.update(scene, report, &cancel);  // the next update loads what that one left
    EXPECT_FALSE(store.table().textures[0].is_missing);
}

TEST(Textures, DamagedFilesNeverCrash) {
    const auto png = test::make_png(8, 8, 4, 8, std::vector<int>(256, 77));
    for (size_t cut = 0; cut < png.size(); cut += 7) {
        auto image = file_image("");
        image->bytes.assign(png.begin(), png.begin() + std::ptrdiff_t(cut));
        auto flipped = file_image("");
        flipped->bytes = png;
        flipped->bytes[cut] ^= 0xff;
        const Loaded loaded({image, flipped});
        EXPECT_EQ(loaded.store.table().count, 2);
    }
}
