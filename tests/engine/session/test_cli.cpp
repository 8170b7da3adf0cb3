// The standalone program, run as a user does.
#include <gtest/gtest.h>
#include <stdlib.h>
#include <sys/wait.h>

#include <filesystem>
#include <fstream>
#include <sstream>

#include "session/session.h"

using namespace talbot;

namespace {

struct Outcome {
    int status = -1;
    std::string text;
};

class Cli : public testing::Test {
protected:
    void SetUp() override {
        program_ = std::filesystem::read_symlink("/proc/self/exe").parent_path() / "../../engine/talbot-cli";
        if (!std::filesystem::exists(program_)) GTEST_SKIP() << "talbot-cli is not built";
        std::string pattern = (std::filesystem::temp_directory_path() / "talbot-test-XXXXXX").string();
        folder_ = mkdtemp(pattern.data());
    }
    void TearDown() override {
        if (!folder_.empty()) std::filesystem::remove_all(folder_);
    }
    Outcome run(const std::string& arguments) const {
        const std::string log = (folder_ / "log").string();
        const int status = std::system(("cd '" + folder_.string() + "' && '" + program_.string() + "' " + arguments + " >'" + log + "' 2>&1").c_str());
        std::stringstream text;
        text << std::ifstream(log).rdbuf();
        return {WEXITSTATUS(status), text.str()};
    }
    std::filesystem::path program_, folder_;
};

/// Nothing but a world of one colour.
scene::Scene make_world(float r, float g, float b) {
    scene::Scene scene;
    scene.settings.width = 12;
    scene.settings.height = 8;
    scene.settings.samples = 4;
    scene.settings.film_exposure = 2;
    scene::Node background;
    background.type = "ShaderNodeBackground";
    background.name = "Background";
    background.inputs = {{"Color", scene::SocketKind::Color, {r, g, b, 1}, false, -1, ""}, {"Strength", scene::SocketKind::Float, {1}, false, -1, ""}};
    background.outputs = {{"Background", scene::SocketKind::Shader, {}}};
    scene::Node output;
    output.type = "ShaderNodeOutputWorld";
    output.name = "World Output";
    output.inputs = {{"Surface", scene::SocketKind::Shader, {}, false, 0, "Background"}};
    scene::Shader shader;
    shader.name = "World";
    shader.graph.name = "World";
    shader.graph.nodes = {background, output};
    shader.graph.output_node = 1;
    scene.shaders = {shader};
    scene.world.shader = 0;
    return scene;
}

}  // namespace

TEST_F(Cli, RendersADumpedScene) {
    dump_scene(make_world(0.25f, 0.5f, 0.75f), (folder_ / "world.talbot").string());
    const Outcome exr = run("world.talbot --stats --threads 1");
    EXPECT_EQ(exr.status, 0) << exr.text;
    EXPECT_TRUE(std::filesystem::exists(folder_ / "world.exr"));
    EXPECT_NE(exr.text.find("M/s"), std::string::npos) << exr.text;
    const Outcome pfm = run("world.talbot -o small.pfm --size 5x3 --samples 2 --seed 7 --quiet");
    EXPECT_EQ(pfm.status, 0) << pfm.text;
    EXPECT_EQ(pfm.text, "");
    std::ifstream file(folder_ / "small.pfm", std::ios::binary);
    std::string kind, scale;
    int width = 0, height = 0;
    file >> kind >> width >> height >> scale;
    file.get();
    EXPECT_EQ(kind, "PF");
    ASSERT_EQ(width, 5);
    ASSERT_EQ(height, 3);
    for (int i = 0; i < width * height; ++i) {
        float rgb[3] = {};
        file.read(reinterpret_cast<char*>(rgb), sizeof rgb);
        EXPECT_FLOAT_EQ(rgb[0], 0.5f);  // exposure 2
        EXPECT_FLOAT_EQ(rgb[1], 1.0f);
        EXPECT_FLOAT_EQ(rgb[2], 1.5f);
    }
    const Outcome quiet = run("world.talbot --samples 1000 --noise 0.1 --stats"), all = run("world.talbot --samples 1000 --noise off --stats");
    EXPECT_NE(quiet.text.find("paths            0.005 M"), std::string::npos) << quiet.text;
    EXPECT_NE(all.text.find("paths            0.096 M"), std::string::npos) << all.text;
    const Outcome png = run("world.talbot -o p.png");
    EXPECT_EQ(png.status, 0) << png.text;
    EXPECT_GT(std::filesystem::file_size(folder_ / "p.png"), 60u);
}

TEST_F(Cli, SaysWhatIsWrong) {
    EXPECT_EQ(run("").status, 2);
    EXPECT_EQ(run("a b").status, 2);
    EXPECT_EQ(run("a --samples none").status, 2);
    EXPECT_EQ(run("a --size 5").status, 2);
    EXPECT_EQ(run("a --colour red").status, 2);
    for (const char* noise : {"much", "-1", "nan"}) EXPECT_EQ(run(std::string("a --noise ") + noise).status, 2) << noise;
    EXPECT_EQ(run("--help").status, 0);
    const Outcome missing = run("nothing.talbot");
    EXPECT_EQ(missing.status, 1);
    EXPECT_NE(missing.text.find("nothing.talbot"), std::string::npos);
    EXPECT_EQ(missing.text.find("terminate"), std::string::npos);
    dump_scene(make_world(1, 1, 1), (folder_ / "world.talbot").string());
    const Outcome unwritable = run("world.talbot -o no/such/folder.exr --quiet");
    EXPECT_EQ(unwritable.status, 1);
    EXPECT_NE(unwritable.text.find("cannot be written"), std::string::npos) << unwritable.text;
    EXPECT_EQ(run("world.talbot --isa v9").status, 1);
}
