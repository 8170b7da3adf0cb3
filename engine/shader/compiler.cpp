#include "shader/compiler.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "shader/graph_compiler.h"
#include "shader/lower.h"

namespace talbot::shader {
namespace {

/// Blender's look of a slot without material: its new material's from 5.0 on, grey paint before.
scene::Shader default_surface(const Semantics& semantics) {
    using scene::SocketKind;
    scene::Shader shader;
    shader.name = "Default";
    scene::Node bsdf;
    bsdf.name = "Default BSDF";
    if (semantics.default_is_principled) {
        bsdf.type = "ShaderNodeBsdfPrincipled";
        bsdf.inputs.push_back({"Base Color", SocketKind::Color, {0.8f, 0.8f, 0.8f, 1}, false, -1, {}});
        bsdf.inputs.push_back({"Specular Tint", SocketKind::Color, {1, 1, 1, 1}, false, -1, {}});
        const std::pair<const char*, float> numbers[] = {{"Roughness", 0.5f}, {"IOR", 1.5f}, {"Alpha", 1}, {"Specular IOR Level", 0.5f}};
        for (auto [name, x] : numbers) bsdf.inputs.push_back({name, SocketKind::Float, {x, 0, 0, 0}, false, -1, {}});
    } else {
        bsdf.type = "ShaderNodeBsdfDiffuse";
        bsdf.inputs.push_back({"Color", SocketKind::Color, {0.8f, 0.8f, 0.8f, 1}, false, -1, {}});
    }
    bsdf.outputs.push_back({"BSDF", SocketKind::Shader, {}});
    scene::Node output;
    output.type = "ShaderNodeOutputMaterial";
    output.name = "Material Output";
    output.inputs.push_back({"Surface", SocketKind::Shader, {}, false, 0, "BSDF"});
    shader.graph.nodes = {bsdf, output};
    shader.graph.output_node = 1;
    return shader;
}

bool depends_on_ray(const Program& program) {
    return std::any_of(program.code.begin(), program.code.end(), [](const Instruction& i) {
        return i.op == Op::Input && (i.variant == uint8_t(InputColumn::RayLength) ||
                                     (i.variant >= uint8_t(InputColumn::IsCamera) && i.variant <= uint8_t(InputColumn::TransmissionDepth)));
    });
}

bool varies(const Program& program) {
    return std::any_of(program.code.begin(), program.code.end(), [](const Instruction& i) { return i.op != Op::Constant && !is_foldable(i.op); });
}

/// Normals come from the span in every program: only what else varies counts.
bool reads_only_normals(const Program& program) {
    return std::all_of(program.code.begin(), program.code.end(), [](const Instruction& i) {
        return i.op == Op::Constant || is_foldable(i.op) ||
               (i.op == Op::Input && i.variant >= uint8_t(InputColumn::NormalX) && i.variant <= uint8_t(InputColumn::NormalZ));
    });
}

bool reads_camera(const Program& program) {
    return std::any_of(program.code.begin(), program.code.end(), [](const Instruction& i) { return i.op == Op::CameraTransform || i.op == Op::Window; });
}

class SceneCompiler {
public:
    SceneCompiler(const scene::Scene& scene, scene::SceneTables& tables, Report& report, SkyCache& skies)
        : scene_(scene), tables_(tables), report_(report), skies_(skies) {}

    Programs run() {
        for (const scene::Shader& shader : scene_.shaders) compile(shader);
        programs_.default_shader = int(programs_.shaders.size());
        compile(default_surface(semantics_of(scene_.settings.version)));
        for (const auto& program : programs_.programs) {
            programs_.max_registers = std::max(programs_.max_registers, program->register_count);
            programs_.max_slots = std::max(programs_.max_slots, int(program->slots.size()));
        }
        return std::move(programs_);
    }

private:
    void compile(const scene::Shader& shader) {
        Expressions expressions(programs_, table_index_);
        const ShaderValues values = GraphCompiler(shader, scene_, tables_, expressions, report_, skies_).compile();
        CompiledShader out;
        out.pass_index = shader.pass_index;
        out.sample_as_light = shader.sample_as_light;
        out.emission_front = shader.emission_front;
        out.emission_back = shader.emission_back;
        out.bump_correction = shader.use_bump_map_correction;
        out.has_bump = values.has_bump;
        out.sun = values.sun;
        out.constants = int32_t(programs_.constants.size());

        ConstantTable constants;
        out.surface = add(lower(expressions, {&values.slots, values.emission, {}, values.normal, {}, nullptr}, constants), shader.name);
        if (values.emission.valid()) {
            out.emission = add(lower(expressions, {nullptr, values.emission, {}, {}, {}, nullptr}, constants), shader.name);
            out.emission_is_constant = expressions.is_known(values.emission);
            if (out.emission_is_constant)
                out.constant_emission = {expressions.known(values.emission.x), expressions.known(values.emission.y), expressions.known(values.emission.z)};
            const float mean = expressions.estimate(values.emission);
            // What varies may be brighter elsewhere than at the guess: never nothing.
            out.emission_estimate = out.emission_is_constant ? mean : std::max(mean, 1e-3f);
        }
        if (values.transparency.valid() && (shader.use_transparent_shadow || values.has_volume)) {
            out.transparency = add(lower(expressions, {nullptr, {}, values.transparency, {}, {}, nullptr}, constants), shader.name);
            out.transparency_is_constant = expressions.is_known(values.transparency);
            if (out.transparency_is_constant)
                out.constant_transparency = {expressions.known(values.transparency.x), expressions.known(values.transparency.y),
                                             expressions.known(values.transparency.z)};
        }
        if (!values.aovs.empty()) out.aov = add(lower(expressions, {nullptr, {}, {}, {}, {}, &values.aovs}, constants), shader.name);
        if (values.displacement.valid()) {
            out.displacement_method = shader.displacement;
            out.displaced_from_front = semantics_of(scene_.settings.version).displaced_from_front;
            out.displacement = add(lower(expressions, {nullptr, {}, {}, {}, values.displacement, nullptr}, constants), shader.name);
            out.displacement_reads_camera = reads_camera(*programs_.programs[size_t(out.displacement)]);
        }
        for (int index : {out.surface, out.emission, out.transparency}) {
            if (index < 0) continue;
            const Program& program = *programs_.programs[size_t(index)];
            out.depends_on_ray_flags = out.depends_on_ray_flags || depends_on_ray(program);
            out.spatially_varying = out.spatially_varying || (varies(program) && !reads_only_normals(program));
        }
        for (uint32_t bits : constants.bits) programs_.constants.push_back(__builtin_bit_cast(float, bits));
        // Even a shader without constants has a place in the table that may be read.
        if (constants.bits.empty()) programs_.constants.push_back(0.0f);
        programs_.shaders.push_back(out);
    }

    int add(Program program, const std::string& name) {
        const std::string key = fingerprint(program);
        const auto found = index_.find(key);
        if (found != index_.end()) return found->second;
        program.name = name;
        programs_.programs.push_back(std::make_unique<const Program>(std::move(program)));
        return index_[key] = int(programs_.programs.size()) - 1;
    }

    const scene::Scene& scene_;
    scene::SceneTables& tables_;
    Report& report_;
    SkyCache& skies_;
    Programs programs_;
    TableIndex table_index_;
    std::map<std::string, int> index_;
};

}  // namespace

Programs compile_shaders(const scene::Scene& scene, scene::SceneTables& tables, Report& report, SkyCache* skies) {
    SkyCache own;
    return SceneCompiler(scene, tables, report, skies ? *skies : own).run();
}

}  // namespace talbot::shader
