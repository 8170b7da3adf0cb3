/// The native module `_talbot`; addon/_talbot.pyi is its contract.
#include "base/cpu.h"
#include "base/error.h"
#include "film/film.h"
#include "geometry/accelerator.h"
#include "python/convert.h"
#include "python/matrices.h"
#include "python/native_session.h"
#include "scene/islands.h"

namespace talbot::python {
namespace {

/// "Material 'Glass': what is wrong"
std::string error_text(const Error& error) {
    const std::string what = error.what();
    return error.where().empty() || what.find(error.where()) != std::string::npos ? what : error.where() + ": " + what;
}

std::vector<std::string> compiled_sets() {
    const std::span<const char* const> sets = compiled_isas();
    return {sets.begin(), sets.end()};
}

py::list string_list(const std::vector<std::string>& items) {
    py::list out;
    for (const std::string& item : items) out.append(item);
    return out;
}

}  // namespace
}  // namespace talbot::python

PYBIND11_MODULE(_talbot, module) {
    namespace py = pybind11;
    using namespace talbot;
    module.doc() = "Talbot's engine";
    module.attr("__version__") = TALBOT_VERSION;
    module.attr("embree_version") = geometry::embree_version();
    module.attr("python_abi") = "cp" + std::to_string(PY_MAJOR_VERSION) + std::to_string(PY_MINOR_VERSION);

    static PyObject* error_type = PyErr_NewException("_talbot.Error", PyExc_RuntimeError, nullptr);
    module.attr("Error") = py::handle(error_type);
    py::register_exception_translator([](std::exception_ptr pointer) {
        try {
            if (pointer) std::rethrow_exception(pointer);
        } catch (const Error& error) {
            PyErr_SetString(error_type, python::error_text(error).c_str());
        } catch (const std::bad_alloc&) {
            PyErr_SetString(error_type, "Out of memory");
        }
    });

    module.def("available_memory", [] { return available_memory(); });
    module.def("compiled_instruction_sets", [] { return python::string_list(python::compiled_sets()); });
    module.def("chosen_instruction_set", [] { return choose_isa(); });
    module.def(
        "check", [] { geometry::check_embree(); }, py::call_guard<py::gil_scoped_release>());
    module.def("denoiser_version", [](const py::list& library_dirs) {
        std::vector<std::string> dirs;
        for (const py::handle item : library_dirs) dirs.push_back(py::cast<std::string>(item));
        const py::gil_scoped_release released;
        return film::denoiser_version(dirs);
    });
    module.def("random_per_island", [](size_t vertices, const py::handle& edges) {
        const python::ArrayBuffer buffer(edges, "edges", 'I');
        const std::vector<float> values = scene::random_per_island(vertices, {static_cast<const uint32_t*>(buffer.data()), buffer.size()});
        return py::bytes(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(float));
    });
    module.def("matrix_columns", &python::matrix_columns);
    python::bind_session(module);
}
