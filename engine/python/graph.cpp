#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "python/values.h"

namespace talbot::python {
namespace {

using namespace talbot::scene;

SocketKind socket_kind(const py::handle& value) {
    static constexpr const char* kNames[] = {"FLOAT", "INT", "BOOL", "VECTOR", "COLOR", "SHADER"};
    const std::string text = py::cast<std::string>(value);
    for (int i = 0; i < int(std::size(kNames)); ++i) {
        if (text == kNames[i]) return SocketKind(i);
    }
    throw Error("Unknown kind of socket '" + text + "'");
}

/// A number or up to four of them. What is not finite becomes 0: a socket may hold it, a path may not.
void read_value(const py::handle& value, float (&out)[4]) {
    const auto number = [](const py::handle& item) {
        const double d = py::cast<double>(item);
        return std::isfinite(float(d)) ? float(d) : 0.0f;
    };
    if (value.is_none()) return;
    if (!PySequence_Check(value.ptr())) {
        out[0] = number(value);
        return;
    }
    const py::sequence items = py::reinterpret_borrow<py::sequence>(value);
    if (items.size() > 4) throw py::value_error("A socket's value has at most 4 numbers");
    for (size_t i = 0; i < items.size(); ++i) out[i] = number(py::object(items[i]));
}

Property read_property(const std::string& name, const py::handle& value) {
    if (PyUnicode_Check(value.ptr())) return py::cast<std::string>(value);
    if (py::hasattr(value, "dtype") && py::hasattr(value, "shape") && py::len(value.attr("shape")) > 0) {
        const ArrayBuffer buffer(value, name, 'f');
        const float* data = static_cast<const float*>(buffer.data());
        return std::vector<float>(data, data + buffer.size());
    }
    const double number = PyFloat_AsDouble(value.ptr());
    if (PyErr_Occurred()) {
        PyErr_Clear();
        throw py::type_error("Property '" + name + "' must be a number, a string or a float32 array");
    }
    return number;
}

py::tuple socket_tuple(const py::handle& item, size_t length) {
    if (!PyTuple_Check(item.ptr()) || py::len(item) != length) throw py::value_error("A socket must be a tuple of " + std::to_string(length) + " values");
    return py::reinterpret_borrow<py::tuple>(item);
}

Node read_node(const py::dict& values, int node_count) {
    Node node;
    for (const auto& item : values) {
        const std::string key = py::cast<std::string>(item.first);
        if (key == "type") {
            node.type = py::cast<std::string>(item.second);
        } else if (key == "name") {
            node.name = py::cast<std::string>(item.second);
        } else if (key == "properties") {
            for (const auto& property : py::cast<py::dict>(item.second)) {
                const std::string name = py::cast<std::string>(property.first);
                node.properties[name] = read_property(name, property.second);
            }
        } else if (key == "inputs") {
            for (const py::handle socket : item.second) {
                const py::tuple t = socket_tuple(socket, 6);
                NodeInput input;
                input.identifier = py::cast<std::string>(t[0]);
                input.kind = socket_kind(t[1]);
                read_value(t[2], input.value);
                input.hidden_value = py::cast<bool>(t[3]);
                input.from_node = py::cast<int>(t[4]);
                input.from_output = py::cast<std::string>(t[5]);
                if (input.from_node < -1 || input.from_node >= node_count) throw Error("A link comes from a node that is not there", node.name);
                node.inputs.push_back(std::move(input));
            }
        } else if (key == "outputs") {
            for (const py::handle socket : item.second) {
                const py::tuple t = socket_tuple(socket, 3);
                NodeOutput output;
                output.identifier = py::cast<std::string>(t[0]);
                output.kind = socket_kind(t[1]);
                read_value(t[2], output.value);
                node.outputs.push_back(std::move(output));
            }
        } else {
            throw py::key_error("A node has no '" + key + "'");
        }
    }
    return node;
}

}  // namespace

ShaderGraph read_graph(const std::string& name, const py::dict& values) {
    ShaderGraph graph;
    graph.name = name;
    for (const auto& item : values) {
        const std::string key = py::cast<std::string>(item.first);
        if (key != "nodes" && key != "output_node") throw py::key_error("A graph has no '" + key + "'");
    }
    if (values.contains("nodes")) {
        const py::list nodes = py::cast<py::list>(values["nodes"]);
        for (const py::handle node : nodes) graph.nodes.push_back(read_node(py::cast<py::dict>(node), int(nodes.size())));
    }
    if (values.contains("output_node")) graph.output_node = py::cast<int>(values["output_node"]);
    if (graph.output_node < -1 || graph.output_node >= int(graph.nodes.size())) throw Error("The graph's output node is not there", name);
    return graph;
}

}  // namespace talbot::python
