/// The node catalogue: Blender's node types that are not shaders, and their compile functions by family. A function sets
/// every output it can; see node_context.h.
#pragma once

#include <string>

#include "shader/node_context.h"

namespace talbot::shader {

using ValueNode = void (*)(NodeContext& node);
struct CatalogueEntry {
    const char* type;  ///< Blender's bl_idname
    ValueNode compile;
};

/// Null for an unknown type.
ValueNode find_value_node(const std::string& type);

// The families, each in its file.
std::span<const CatalogueEntry> input_nodes();          ///< compile_inputs.cpp
std::span<const CatalogueEntry> math_nodes();           ///< compile_math.cpp
std::span<const CatalogueEntry> color_nodes();          ///< compile_color.cpp
std::span<const CatalogueEntry> vector_nodes();         ///< compile_vectors.cpp
std::span<const CatalogueEntry> texture_nodes();        ///< compile_textures.cpp
std::span<const CatalogueEntry> image_nodes();          ///< compile_images.cpp
std::span<const CatalogueEntry> sky_nodes();            ///< compile_sky.cpp
std::span<const CatalogueEntry> neighbourhood_nodes();  ///< compile_neighbourhood.cpp

}  // namespace talbot::shader
