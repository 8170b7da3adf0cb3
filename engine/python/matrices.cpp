#include "python/matrices.h"

#include <array>
#include <cstring>
#include <string_view>

namespace talbot::python {
namespace {

namespace py = pybind11;

using Columns = std::array<float, 16>;

/// What a mathutils.Matrix begins with in every Blender from 2.8 until 5.0 gave it the buffer protocol.
struct PlainMatrix {
    PyObject_VAR_HEAD;
    const float* columns;
    PyObject* owner;
    unsigned char owner_type, owner_subtype, flags;
    unsigned short column_count, row_count;
};

bool read_buffer(PyObject* matrix, char* out) {
    Py_buffer view;
    if (PyObject_GetBuffer(matrix, &view, PyBUF_FULL_RO) != 0) throw py::error_already_set();
    const std::string_view format = view.format != nullptr ? view.format : "B";
    const bool fits = view.ndim == 2 && view.len == Py_ssize_t(sizeof(Columns)) && format == "f";
    if (fits) PyBuffer_ToContiguous(out, &view, view.len, 'F');
    PyBuffer_Release(&view);
    return fits;
}

bool read_plain(PyObject* matrix, char* out) {
    const PyTypeObject& type = *Py_TYPE(matrix);
    if (std::string_view(type.tp_name) != "Matrix" || type.tp_basicsize != Py_ssize_t(sizeof(PlainMatrix))) return false;
    const auto& plain = *reinterpret_cast<const PlainMatrix*>(matrix);
    if (plain.column_count != 4 || plain.row_count != 4 || plain.owner != nullptr) return false;
    std::memcpy(out, plain.columns, sizeof(Columns));
    return true;
}

}  // namespace

py::bytes matrix_columns(const py::list& matrices) {
    const size_t count = matrices.size();
    const auto out = py::reinterpret_steal<py::bytes>(PyBytes_FromStringAndSize(nullptr, Py_ssize_t(count * sizeof(Columns))));
    if (!out) throw py::error_already_set();
    char* row = PyBytes_AS_STRING(out.ptr());
    for (size_t i = 0; i < count; ++i, row += sizeof(Columns)) {
        PyObject* const matrix = PyList_GET_ITEM(matrices.ptr(), Py_ssize_t(i));
        if (!(PyObject_CheckBuffer(matrix) ? read_buffer(matrix, row) : read_plain(matrix, row)))
            throw py::type_error("4x4 matrices that own their values are wanted");
    }
    return out;
}

}  // namespace talbot::python
