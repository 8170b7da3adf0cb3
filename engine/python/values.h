/// Dictionaries into the scene's structs. Keys are the field names of engine/scene/scene.h, enums their names in lower case.
#pragma once

#include <optional>

#include "python/convert.h"
#include "scene/scene.h"

namespace talbot::python {

/// Missing keys keep the struct's defaults. They return values, so that a wrong one leaves the scene as it was.
scene::Settings read_settings(const py::dict& values);
scene::Camera read_camera(const py::dict& values);
scene::World read_world(const py::dict& values);
scene::Light read_light(const py::dict& values);
scene::Image read_image(const py::dict& values);
/// The fields beside name and graph.
scene::Shader read_shader(const py::dict& values);
/// The graph of _talbot.pyi's add_shader.
scene::ShaderGraph read_graph(const std::string& name, const py::dict& graph);

std::vector<scene::PassKind> read_passes(const std::vector<std::string>& names);
std::vector<scene::Aov> read_aovs(const std::vector<std::string>& names);
std::optional<scene::Aov> aov_of(const std::string& name);  ///< "aov_color:NAME" or "aov_value:NAME"; none: the name of another pass
std::vector<std::string> read_light_groups(const std::vector<std::string>& names);
std::optional<std::string> light_group_of(const std::string& name);  ///< NAME of "light_group:NAME"; none: the name of another pass
scene::PassKind pass_kind(const std::string& name);                  ///< throws Error for an unknown name

}  // namespace talbot::python
