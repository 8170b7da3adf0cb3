#include <gtest/gtest.h>
#include <stdlib.h>

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "base/sobol.h"
#include "session/old_dump.h"
#include "session/session.h"

using namespace talbot;
using namespace talbot::scene;

namespace {

struct Folder {
    std::filesystem::path path;
    Folder() {
        std::string pattern = (std::filesystem::temp_directory_path() / "talbot-test-XXXXXX").string();
        path = mkdtemp(pattern.data());
    }
    ~Folder() { std::filesystem::remove_all(path); }
    std::string file(const std::string& name) const { return (path / name).string(); }
};

std::vector<char> read(const std::string& path) {
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
}

void write(const std::string& path, const std::vector<char>& bytes) {
    std::ofstream(path, std::ios::binary).write(bytes.data(), std::streamsize(bytes.size()));
}

/// Something in every list, nothing at its default.
Scene make_scene() {
    Scene scene;
    Mesh mesh;
    mesh.name = "Würfel";
    mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    mesh.triangle_vertices = {0, 1, 2, 0, 2, 3};
    mesh.triangle_corners = {0, 1, 2, 3, 4, 5};
    mesh.triangle_faces = {0, 1};
    mesh.triangle_materials = {0, 1};
    mesh.triangle_smooth = {1, 0};
    mesh.vertex_normals.assign(4, {0, 0, 1});
    mesh.corner_normals.assign(6, {1, 0, 0});
    mesh.attributes = {{"UVMap", Domain::Corner, 2, false, std::vector<float>(12, 0.5f)},
                       {"Col", Domain::Face, 4, true, std::vector<float>(8, 0.25f)},
                       {"@generated", Domain::Vertex, 3, false, std::vector<float>(12, 0.75f)}};
    mesh.active_uv = "UVMap";
    mesh.active_color = "Col";
    mesh.generated_offset = {1, 2, 3};
    mesh.generated_scale = {4, 5, 6};
    mesh.motion_steps = 2;
    mesh.motion_positions.assign(8, {1, 2, 3});
    mesh.motion_normals.assign(12, {0, 1, 0});
    const auto shared = std::make_shared<const Mesh>(mesh);
    Mesh strands;
    strands.kind = GeometryKind::Curves;
    strands.positions.assign(3, {1, 1, 1});
    strands.radii = {1, 2, 3};
    strands.curve_shape = CurveShape::ThickLinear;
    strands.curve_subdivisions = 5;
    strands.curve_starts = {0, 3};
    strands.segment_keys = {0, 1};
    strands.segment_curves = {0, 0};
    scene.motion.objects = {{Affine{}, Affine{}}};
    scene.motion.camera.assign(3, Affine{});
    scene.motion.camera_views.assign(12, 0.5f);
    scene.motion.shutter = {0, 0.25f, 1};
    scene.motion.rolling = true;
    scene.motion.rolling_duration = 0.75f;
    Mesh cage;
    cage.positions.assign(3, {1, 2, 3});
    cage.subdivision = {SubdivisionScheme::Simple, UvSmoothing::Concave, true, false, 0.25f, 7, {0, 3}, {0, 1, 2}, {4}, {0}, {1, 2}, {5}, {0}, {6}};
    scene.meshes = {shared, nullptr, shared, std::make_shared<const Mesh>(strands), std::make_shared<const Mesh>(cage)};
    scene.dicing_camera.clip_end = 77;
    scene.settings.offscreen_dicing_scale = 5;

    ObjectTraits object;
    object.name = 0;
    object.mesh = 2;
    scene.motion.of_objects = {0, kNone};
    object.material_set = 0;
    object.attribute_set = 0;
    object.visibility = kVisibleCamera;
    object.pass_index = 3;
    object.color[2] = 0.5f;
    scene.duplis = {{{1, 2, 3}, {4, 5}}, {}};
    object.linking = 0;
    object.light_group = 1;
    object.receiver_set = 63;
    object.blocks = uint64_t(1) << 63;
    scene.linkings = {{5, 62}};
    object.is_instance = object.is_holdout = object.is_shadow_catcher = true;
    object.shadow_terminator_shading_offset = 0.3f;
    object.shadow_terminator_geometry_offset = 0.4f;
    scene.traits = {ObjectTraits{}, object};
    scene.objects.resize(2);
    scene.objects[0] = {{}, 1, 12345};
    scene.objects[0].to_world.m[1][3] = 7;
    scene.object_names = {"Cube"};
    scene.material_sets = {{0, kNone}, {}};
    scene.object_attribute_sets = {{{"prop", Domain::Object, 3, false, {1, 2, 3}}}};

    Light light;
    light.name = "Key";
    light.type = LightType::Area;
    light.color = {1, 2, 3};
    light.power = 500;
    light.normalize = light.soft_falloff = light.cast_shadow = light.use_mis = false;
    light.is_portal = true;
    light.radius = 2;
    light.shape = AreaShape::Ellipse;
    light.size_y = 3;
    light.spread = 1;
    light.shader = 0;
    light.max_bounces = 5;
    light.light_group = 2;
    light.random = 9;
    light.object_color[2] = 0.25f;
    light.pass_index = 4;
    light.attributes = {{"object:shade", Domain::Object, 1, false, {0.5f}}};
    light.linking = {6, 17};
    light.is_shadow_catcher = false;
    scene.lights = {light};

    Shader shader;
    shader.name = "Glass";
    shader.graph.name = "Material 'Glass'";
    shader.graph.output_node = 1;
    Node node;
    node.type = "ShaderNodeBsdfGlass";
    node.name = "Group > Glass";
    node.properties = {{"distribution", "GGX"}, {"factor", 0.25}, {"ramp", std::vector<float>{1, 2, 3}}};
    node.inputs = {{"Color", SocketKind::Color, {1, 0.5f, 0.25f, 1}, true, -1, ""}, {"Normal", SocketKind::Vector, {}, false, 1, "Normal"}};
    node.outputs = {{"BSDF", SocketKind::Shader, {}}};
    shader.graph.nodes = {node, node};
    shader.pass_index = 4;
    shader.sample_as_light = shader.emission_front = shader.emission_back = shader.use_transparent_shadow = shader.use_bump_map_correction = false;
    shader.displacement = DisplacementMethod::Both;
    scene.shaders = {shader};

    Image image;
    image.name = "Wall";
    image.bytes = {1, 2, 3};
    image.pixels = {1, 2, 3, 4};
    image.width = image.height = 1;
    image.pixels_are_float = true;
    image.colorspace = "Non-Color";
    image.alpha = AlphaMode::ChannelPacked;
    image.tiles = {1001, 1012};
    scene.images = {std::make_shared<const Image>(image), nullptr};

    scene.world.shader = 0;
    scene.world.use_importance_map = false;
    scene.world.light_group = 1;
    scene.world.map_resolution = 64;
    scene.camera.type = CameraType::Panoramic;
    scene.camera.panorama = PanoramaType::FisheyePolynomial;
    scene.camera.view[0] = -3;
    scene.camera.polynomial[3] = 0.1f;
    scene.camera.cylinder[4] = 2;
    scene.settings.version = 304;
    scene.settings.width = 33;
    scene.settings.seed = 77;
    scene.settings.filter = PixelFilter::Gaussian;
    scene.settings.ocio_config = "/somewhere/config.ocio";
    scene.settings.viewport = true;
    scene.passes = {PassKind::Combined, PassKind::Depth, PassKind::SampleCount};
    scene.aovs = {{"Mask", false}, {"Dirt", true}};
    scene.light_groups = {"Key", "Fill", "Rim"};
    return scene;
}

std::string message_of(const std::string& path) {
    try {
        load_scene(path);
    } catch (const Error& error) {
        return error.what();
    }
    return {};
}

}  // namespace

TEST(Dump, RoundTripKeepsEveryByte) {
    const Folder folder;
    const Scene scene = make_scene();
    dump_scene(scene, folder.file("a"));
    const Scene loaded = load_scene(folder.file("a"));
    dump_scene(loaded, folder.file("b"));
    EXPECT_EQ(read(folder.file("a")), read(folder.file("b")));
    EXPECT_EQ(loaded.dirty, uint32_t(kDirtyAll));
    ASSERT_EQ(loaded.meshes.size(), 5u);
    EXPECT_EQ(loaded.meshes[0]->motion_positions.size(), 8u);
    EXPECT_EQ(loaded.meshes[0]->motion_normals.size(), 12u);
    EXPECT_EQ(loaded.motion.objects[0].size(), 2u);
    EXPECT_EQ(loaded.motion.camera.size(), 3u);
    EXPECT_EQ(loaded.motion.camera_views, scene.motion.camera_views);
    EXPECT_EQ(loaded.motion.shutter, scene.motion.shutter);
    EXPECT_TRUE(loaded.motion.rolling);
    EXPECT_EQ(loaded.motion.rolling_duration, 0.75f);
    EXPECT_EQ(loaded.motion.of_objects, scene.motion.of_objects);
    EXPECT_EQ(loaded.meshes[3]->kind, GeometryKind::Curves);
    EXPECT_EQ(loaded.meshes[3]->curve_shape, CurveShape::ThickLinear);
    EXPECT_EQ(loaded.meshes[3]->curve_subdivisions, 5);
    EXPECT_EQ(loaded.meshes[3]->radii, scene.meshes[3]->radii);
    EXPECT_EQ(loaded.meshes[3]->segment_keys.size(), 2u);
    const Subdivision& cage = loaded.meshes[4]->subdivision;
    EXPECT_EQ(cage.scheme, SubdivisionScheme::Simple);
    EXPECT_EQ(cage.uv_smoothing, UvSmoothing::Concave);
    EXPECT_TRUE(cage.sharp_corners);
    EXPECT_FALSE(cage.in_pixels);
    EXPECT_EQ(cage.edge_length, 0.25f);
    EXPECT_EQ(cage.max_level, 7);
    EXPECT_EQ(cage.corner_vertices, scene.meshes[4]->subdivision.corner_vertices);
    EXPECT_EQ(cage.face_materials[0], 4);
    EXPECT_EQ(cage.crease_edges, scene.meshes[4]->subdivision.crease_edges);
    EXPECT_EQ(cage.vertex_sharpness[0], 6);
    EXPECT_EQ(loaded.dicing_camera.clip_end, 77);
    EXPECT_EQ(loaded.settings.offscreen_dicing_scale, 5);
    EXPECT_EQ(loaded.meshes[0], loaded.meshes[2]);  // still shared
    EXPECT_EQ(loaded.meshes[1], nullptr);
    EXPECT_EQ(loaded.meshes[0]->name, "Würfel");
    EXPECT_EQ(loaded.meshes[0]->attributes[1].data, scene.meshes[0]->attributes[1].data);
    EXPECT_TRUE(loaded.meshes[0]->attributes[1].is_color);
    EXPECT_EQ(loaded.meshes[0]->generated_scale.z, 6);
    EXPECT_EQ(loaded.objects[0].to_world.m[1][3], 7);
    EXPECT_EQ(loaded.objects[0].traits, 1);
    EXPECT_EQ(loaded.objects[0].random, 12345u);
    EXPECT_EQ(loaded.objects[1].traits, kNone);
    EXPECT_EQ(loaded.duplis[0].uv.y, 5);
    EXPECT_EQ(loaded.traits, scene.traits);
    EXPECT_TRUE(loaded.traits[1].is_shadow_catcher);
    EXPECT_EQ(loaded.traits[1].shadow_terminator_geometry_offset, 0.4f);
    EXPECT_EQ(loaded.lights[0].random, 9u);
    EXPECT_EQ(loaded.lights[0].linking.receivers, 6u);
    EXPECT_EQ(loaded.lights[0].linking.blockers, 17);
    EXPECT_FALSE(loaded.lights[0].is_shadow_catcher);
    EXPECT_EQ(loaded.lights[0].object_color[2], 0.25f);
    EXPECT_EQ(loaded.lights[0].pass_index, 4);
    EXPECT_EQ(loaded.lights[0].attributes.at(0).name, "object:shade");
    EXPECT_EQ(loaded.traits[1].linking, 0);
    EXPECT_EQ(loaded.traits[1].light_group, 1);
    EXPECT_EQ(loaded.lights[0].light_group, 2);
    EXPECT_EQ(loaded.world.light_group, 1);
    EXPECT_EQ(loaded.light_groups, scene.light_groups);
    EXPECT_EQ(loaded.traits[1].receiver_set, 63);
    EXPECT_EQ(loaded.traits[1].blocks, uint64_t(1) << 63);
    EXPECT_EQ(loaded.linkings[0].receivers, 5u);
    EXPECT_EQ(std::get<std::string>(loaded.shaders[0].graph.nodes[1].properties.at("distribution")), "GGX");
    EXPECT_EQ(std::get<std::vector<float>>(loaded.shaders[0].graph.nodes[1].properties.at("ramp")).size(), 3u);
    EXPECT_EQ(loaded.shaders[0].graph.nodes[0].inputs[1].from_output, "Normal");
    EXPECT_FALSE(loaded.shaders[0].use_bump_map_correction);
    EXPECT_EQ(loaded.shaders[0].displacement, DisplacementMethod::Both);
    EXPECT_EQ(loaded.images[0]->tiles, scene.images[0]->tiles);
    EXPECT_EQ(loaded.camera.cylinder[4], 2);
    EXPECT_EQ(loaded.settings.version, 304);
    EXPECT_EQ(loaded.settings.filter, PixelFilter::Gaussian);
    EXPECT_TRUE(loaded.settings.viewport);
    EXPECT_EQ(loaded.passes, scene.passes);
    EXPECT_EQ(loaded.aovs, scene.aovs);
}

#if defined(__x86_64__) && defined(__GLIBCXX__)
// A struct that grew has a field that dump.cpp does not know yet: add it there and to make_scene above, then correct the size here.
TEST(Dump, KnowsEveryField) {
    EXPECT_EQ(sizeof(Attribute), 64u);
    EXPECT_EQ(sizeof(Mesh), 712u);
    EXPECT_EQ(sizeof(Subdivision), 208u);
    EXPECT_EQ(sizeof(ObjectTraits), 72u);
    EXPECT_EQ(sizeof(Object), 56u);
    EXPECT_EQ(sizeof(Dupli), 20u);
    EXPECT_EQ(sizeof(Linking), 16u);
    EXPECT_EQ(sizeof(Motion), 128u);
    EXPECT_EQ(sizeof(NodeInput), 96u);
    EXPECT_EQ(sizeof(NodeOutput), 56u);
    EXPECT_EQ(sizeof(Node), 160u);
    EXPECT_EQ(sizeof(ShaderGraph), 64u);
    EXPECT_EQ(sizeof(Shader), 112u);
    EXPECT_EQ(sizeof(Light), 232u);
    EXPECT_EQ(sizeof(World), 28u);
    EXPECT_EQ(sizeof(Camera), 168u);
    EXPECT_EQ(sizeof(Image), 192u);
    EXPECT_EQ(sizeof(Settings), 272u);
    EXPECT_EQ(sizeof(Aov), 40u);
    EXPECT_EQ(sizeof(Scene), 1136u);
}
#endif

// Written by a Talbot whose objects were one record each (version 8): two alike and one that moves.
TEST(Dump, ObjectsBeforeVersion10) {
    const Scene scene = load_scene(TALBOT_SOURCE_DIR "/tests/engine/session/data/objects_8.talbot");
    ASSERT_EQ(scene.objects.size(), 3u);
    ASSERT_EQ(scene.traits.size(), 2u) << "those that are alike share";
    EXPECT_EQ(scene.object_names[size_t(scene.traits[0].name)], "Twin");
    EXPECT_TRUE(scene.traits[0].is_instance);
    EXPECT_FALSE(scene.traits[1].is_instance);
    EXPECT_EQ(scene.traits[1].pass_index, 4);
    for (size_t i = 0; i < 3; ++i) {
        EXPECT_EQ(scene.objects[i].traits, i < 2 ? 0 : 1);
        EXPECT_EQ(scene.objects[i].random, 7 + i);
        EXPECT_EQ(scene.objects[i].to_world.m[0][3], float(i));
    }
    ASSERT_EQ(scene.duplis.size(), 3u);
    EXPECT_EQ(scene.duplis[1].uv.x, 0.5f);
    EXPECT_EQ(scene.motion.of_objects, (std::vector<Handle>{kNone, kNone, 0}));
}

TEST(Dump, ImageFilesTravelAlong) {
    const Folder folder;
    write(folder.file("wall.png"), {'p', 'n', 'g'});
    Scene scene;
    Image image;
    image.path = folder.file("wall.png");
    Image absent;
    absent.path = folder.file("absent.png");
    scene.images = {std::make_shared<const Image>(image), std::make_shared<const Image>(absent)};
    dump_scene(scene, folder.file("a"));
    std::filesystem::remove(folder.file("wall.png"));
    const Scene loaded = load_scene(folder.file("a"));
    EXPECT_EQ(loaded.images[0]->bytes, (std::vector<uint8_t>{'p', 'n', 'g'}));
    EXPECT_EQ(loaded.images[0]->path, image.path);
    EXPECT_TRUE(loaded.images[1]->bytes.empty());
    EXPECT_EQ(loaded.images[1]->path, absent.path);
}

/// Until version 7 blocker groups were bits of masks and visibility; until 10 there were 64, and nothing was said of whom they are chosen among.
TEST(Dump, BlockersOfOlderFiles) {
    const Folder folder;
    const std::string digits = tests::kOldDump;
    std::vector<char> old;
    for (size_t i = 0; i < digits.size(); i += 2) old.push_back(char(std::stoi(digits.substr(i, 2), nullptr, 16)));
    const auto replace = [](std::vector<char>& file, uint64_t receivers, int32_t before, int32_t now) {
        char bytes[12];
        std::memcpy(bytes, &receivers, 8);
        std::memcpy(bytes + 8, &before, 4);
        const auto found = std::search(file.begin(), file.end(), bytes, bytes + 12);
        ASSERT_NE(found, file.end());
        std::memcpy(&*found + 8, &now, 4);
    };
    std::vector<char> eighth = old;
    replace(eighth, 3, 61, 63);
    write(folder.file("a"), eighth);
    const Scene scene = load_scene(folder.file("a"));
    ASSERT_EQ(scene.traits.size(), 1u);
    EXPECT_EQ(scene.traits[0].blocks, 0x0123456789abcde5u);
    EXPECT_EQ(scene.traits[0].visibility, 37u);
    EXPECT_EQ(scene.linkings[0].blockers, -1);
    EXPECT_EQ(scene.linkings[0].receivers, 3u);
    EXPECT_EQ(scene.linkings[1].blockers, 62);
    EXPECT_EQ(scene.lights[0].linking.blockers, 4);

    std::vector<char> seventh = old;
    seventh[8] = 7;
    const uint32_t visibility = 37u | 1u << (8 + 2) | 1u << (8 + 16);
    std::memcpy(&seventh[tests::kOldVisibility], &visibility, 4);
    seventh.erase(seventh.begin() + tests::kOldBlocks, seventh.begin() + tests::kOldBlocks + 8);
    replace(seventh, 3, 61, 1 << (8 + 16));
    replace(seventh, 1, 62, int32_t(kVisibleShadow));
    replace(seventh, 7, 4, 1 << (8 + 2));
    write(folder.file("a"), seventh);
    const Scene older = load_scene(folder.file("a"));
    EXPECT_EQ(older.traits[0].visibility, 37u);
    EXPECT_EQ(older.traits[0].blocks, uint64_t(1) << 2 | uint64_t(1) << 16);
    EXPECT_EQ(older.linkings[0].blockers, 16);
    EXPECT_EQ(older.linkings[1].blockers, -1);
    EXPECT_EQ(older.lights[0].linking.blockers, 2);
}

TEST(Dump, TruncatedIsAnError) {
    const Folder folder;
    dump_scene(make_scene(), folder.file("a"));
    const std::vector<char> whole = read(folder.file("a"));
    for (size_t size = 0; size < whole.size(); size += size < 400 ? 1 : 97) {
        write(folder.file("b"), {whole.begin(), whole.begin() + std::ptrdiff_t(size)});
        EXPECT_FALSE(message_of(folder.file("b")).empty()) << size;
    }
    std::vector<char> longer = whole;
    longer.push_back(0);
    write(folder.file("b"), longer);
    EXPECT_NE(message_of(folder.file("b")).find("more than a scene"), std::string::npos);
}

TEST(Dump, DamagedNeverCrashes) {
    const Folder folder;
    dump_scene(make_scene(), folder.file("a"));
    const std::vector<char> whole = read(folder.file("a"));
    int refused = 0;
    for (uint32_t i = 0; i < 600; ++i) {
        std::vector<char> damaged = whole;
        for (uint32_t k = 0; k < 1 + i % 3; ++k) damaged[hash_u32(i * 7 + k) % damaged.size()] ^= char(hash_u32(i + k * 99) | 1);
        write(folder.file("b"), damaged);
        refused += !message_of(folder.file("b")).empty();
    }
    EXPECT_GT(refused, 120);
}

TEST(Dump, OtherFilesAreRefusedInWords) {
    const Folder folder;
    EXPECT_NE(message_of(folder.file("nothing")).find("no such file"), std::string::npos);
    write(folder.file("b"), std::vector<char>(1000, 'x'));
    EXPECT_NE(message_of(folder.file("b")).find("not a scene"), std::string::npos);
    dump_scene({}, folder.file("a"));
    auto newer = read(folder.file("a"));
    newer[8] = 99;
    write(folder.file("b"), newer);
    EXPECT_NE(message_of(folder.file("b")).find("newer"), std::string::npos);
    EXPECT_THROW(dump_scene({}, folder.file("no/such/folder")), Error);
}

TEST(Dump, HandlesThatLeadNowhere) {
    const Folder folder;
    const auto refused = [&](auto change) {
        Scene scene = make_scene();
        change(scene);
        dump_scene(scene, folder.file("a"));
        return message_of(folder.file("a"));
    };
    EXPECT_EQ(refused([](Scene&) {}), "");
    EXPECT_NE(refused([](Scene& s) { s.traits[1].mesh = 5; }).find("Object 'Cube'"), std::string::npos);
    EXPECT_NE(refused([](Scene& s) { s.traits[1].material_set = -2; }), "");
    EXPECT_NE(refused([](Scene& s) { s.material_sets[0][0] = 1; }), "");
    EXPECT_NE(refused([](Scene& s) { s.lights[0].shader = 1; }), "");
    EXPECT_NE(refused([](Scene& s) { s.world.shader = 1; }), "");
    EXPECT_NE(refused([](Scene& s) { s.shaders[0].graph.nodes[0].inputs[0].from_node = 2; }), "");
    const auto with_mesh = [&](auto change) {
        return refused([&](Scene& s) {
            Mesh mesh = *s.meshes[0];
            change(mesh);
            s.meshes = {std::make_shared<const Mesh>(mesh), nullptr, std::make_shared<const Mesh>(mesh)};
        });
    };
    EXPECT_EQ(with_mesh([](Mesh&) {}), "");
    EXPECT_NE(with_mesh([](Mesh& m) { m.triangle_vertices[4] = 4; }).find("Würfel"), std::string::npos);
    EXPECT_NE(with_mesh([](Mesh& m) { m.triangle_vertices.pop_back(); }), "");
    EXPECT_NE(with_mesh([](Mesh& m) { m.triangle_corners[0] = 6; }), "");
    EXPECT_NE(with_mesh([](Mesh& m) { m.attributes[0].data.pop_back(); }), "");
    EXPECT_NE(with_mesh([](Mesh& m) { m.attributes[2].components = 0; }), "");
    EXPECT_NE(with_mesh([](Mesh& m) { m.triangle_smooth.pop_back(); }), "");
}
