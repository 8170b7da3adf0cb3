#include "shader/catalogue.h"

#include <unordered_map>

namespace talbot::shader {

ValueNode find_value_node(const std::string& type) {
    static const std::unordered_map<std::string, ValueNode> nodes = [] {
        std::unordered_map<std::string, ValueNode> all;
        for (const auto family :
             {input_nodes(), math_nodes(), color_nodes(), vector_nodes(), texture_nodes(), image_nodes(), sky_nodes(), neighbourhood_nodes()})
            for (const CatalogueEntry& entry : family) all.emplace(entry.type, entry.compile);
        return all;
    }();
    const auto found = nodes.find(type);
    return found == nodes.end() ? nullptr : found->second;
}

}  // namespace talbot::shader
