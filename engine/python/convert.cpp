#include "python/convert.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <memory>

#include "base/error.h"

namespace talbot::python {
namespace {

/// The dtype's letter, with the synonyms that mean the same on this machine (long of 4 bytes and the like).
char canonical_format(const char* format, Py_ssize_t item_size) {
    if (!format || !format[0]) return 'B';
    char c = format[0];
    if (c == '=' || c == '@') c = format[1];
    if (item_size == 4 && c == 'l') return 'i';
    if (item_size == 4 && c == 'L') return 'I';
    return c;
}

const char* dtype_name(char format) {
    switch (format) {
        case 'f':
            return "float32";
        case 'I':
            return "uint32";
        case 'i':
            return "int32";
        default:
            return "uint8";
    }
}

}  // namespace

ArrayBuffer::ArrayBuffer(py::handle object, const std::string& name, char format) {
    const std::string wanted = "'" + name + "' must be a C-contiguous numpy array of " + dtype_name(format);
    if (!py::hasattr(object, "dtype") || PyObject_GetBuffer(object.ptr(), &view_, PyBUF_C_CONTIGUOUS | PyBUF_FORMAT) != 0) {
        PyErr_Clear();
        throw py::type_error(wanted);
    }
    held_ = true;
    if (canonical_format(view_.format, view_.itemsize) != format) {
        const std::string got = view_.format ? view_.format : "bytes";
        PyBuffer_Release(&view_);
        held_ = false;
        throw py::type_error(wanted + ", not '" + got + "'");
    }
}

ArrayBuffer::~ArrayBuffer() {
    if (held_) PyBuffer_Release(&view_);
}

ArrayBuffer& ArrayBuffer::operator=(ArrayBuffer&& other) noexcept {
    std::swap(view_, other.view_);
    std::swap(held_, other.held_);
    return *this;
}

py::object ArrayDict::value(const char* name) {
    known_.emplace_back(name);
    return values_.contains(name) ? py::object(values_[name]) : py::object(py::none());
}

const ArrayBuffer& ArrayDict::hold(py::handle object, const std::string& name, char format) {
    buffers_.push_back(std::make_unique<ArrayBuffer>(object, name, format));
    const ArrayBuffer& buffer = *buffers_.back();
    if (buffer.dimensions() < 1 || buffer.dimensions() > 2) throw py::value_error("'" + name + "' must have one or two dimensions");
    return buffer;
}

const ArrayBuffer* ArrayDict::find(const char* name, size_t columns, char format) {
    const py::object object = value(name);
    if (object.is_none()) return nullptr;
    const ArrayBuffer& buffer = hold(object, name, format);
    if (buffer.columns() != columns || buffer.dimensions() != (columns == 1 ? 1 : 2)) {
        const std::string shape = columns == 1 ? "(n,)" : "(n, " + std::to_string(columns) + ")";
        throw py::value_error("'" + std::string(name) + "' must have the shape " + shape);
    }
    return &buffer;
}

void ArrayDict::finish(const char* what) const {
    for (const auto& item : values_) {
        const std::string key = py::str(item.first);
        if (std::find(known_.begin(), known_.end(), key) == known_.end()) throw py::key_error(std::string(what) + " has no '" + key + "'");
    }
}

py::handle Fields::find(const char* name) {
    names_.push_back(name);
    if (!values_.contains(name)) return {};
    ++known_;
    return PyDict_GetItemString(values_.ptr(), name);
}

void Fields::wrong_type(const char* name, const char* wanted) const {
    throw py::type_error(std::string(what_) + ": '" + name + "' must be " + wanted);
}

void Fields::finish() const {
    if (known_ == values_.size()) return;
    for (const auto& item : values_) {
        const std::string key = py::str(item.first);
        const bool known = std::any_of(names_.begin(), names_.end(), [&](const char* n) { return key == n; });
        if (!known) throw py::key_error(std::string(what_) + " has no '" + key + "'");
    }
}

void Fields::operator()(const char* name, bool& out) {
    const py::handle value = find(name);
    if (!value) return;
    const int truth = PyObject_IsTrue(value.ptr());
    if (truth < 0) {
        PyErr_Clear();
        wrong_type(name, "true or false");
    }
    out = truth != 0;
}

void Fields::operator()(const char* name, int32_t& out) {
    const py::handle value = find(name);
    if (!value) return;
    const long long number = PyLong_Check(value.ptr()) || PyIndex_Check(value.ptr()) ? PyNumber_AsSsize_t(value.ptr(), nullptr) : INT64_MIN;
    if (PyErr_Occurred() || number == INT64_MIN) {
        PyErr_Clear();
        wrong_type(name, "a whole number");
    }
    if (number < INT32_MIN || number > INT32_MAX) throw Error(std::string(what_) + ": '" + name + "' is out of range");
    out = int32_t(number);
}

void Fields::operator()(const char* name, uint32_t& out) {
    const py::handle value = find(name);
    if (!value) return;
    const long long number = PyIndex_Check(value.ptr()) ? PyNumber_AsSsize_t(value.ptr(), nullptr) : INT64_MIN;
    if (PyErr_Occurred() || number == INT64_MIN) {
        PyErr_Clear();
        wrong_type(name, "a whole number");
    }
    if (number < 0 || number > UINT32_MAX) throw Error(std::string(what_) + ": '" + name + "' is out of range");
    out = uint32_t(number);
}

void Fields::operator()(const char* name, float& out) {
    const py::handle value = find(name);
    if (!value) return;
    const double number = PyFloat_AsDouble(value.ptr());
    if (PyErr_Occurred()) {
        PyErr_Clear();
        wrong_type(name, "a number");
    }
    if (!std::isfinite(float(number))) throw Error(std::string(what_) + ": '" + name + "' is not finite");
    out = float(number);
}

void Fields::operator()(const char* name, std::string& out) {
    const py::handle value = find(name);
    if (!value) return;
    if (!PyUnicode_Check(value.ptr())) wrong_type(name, "a string");
    out = py::cast<std::string>(value);
}

void Fields::operator()(const char* name, std::span<float> out) {
    const py::handle value = find(name);
    if (!value) return;
    if (!PySequence_Check(value.ptr()) || PyUnicode_Check(value.ptr())) wrong_type(name, "a sequence of numbers");
    const py::sequence sequence = py::reinterpret_borrow<py::sequence>(value);
    if (sequence.size() != out.size()) throw py::value_error(std::string(what_) + ": '" + name + "' must have " + std::to_string(out.size()) + " numbers");
    for (size_t i = 0; i < out.size(); ++i) {
        const double number = PyFloat_AsDouble(py::object(sequence[i]).ptr());
        if (PyErr_Occurred()) {
            PyErr_Clear();
            wrong_type(name, "a sequence of numbers");
        }
        if (!std::isfinite(float(number))) throw Error(std::string(what_) + ": '" + name + "' is not finite");
        out[i] = float(number);
    }
}

void Fields::operator()(const char* name, Vec3& out) {
    float values[3] = {out.x, out.y, out.z};
    (*this)(name, std::span<float>(values));
    out = {values[0], values[1], values[2]};
}

void Fields::operator()(const char* name, scene::Linking& out) {
    if (const py::handle value = find(name)) out = read_linking(value);
}

void Fields::operator()(const char* name, std::vector<scene::Attribute>& out) {
    if (const py::handle value = find(name)) out = read_object_attributes(value);
}

void Fields::operator()(const char* name, Affine& out) {
    if (!values_.contains(name)) {
        names_.push_back(name);
        return;
    }
    float values[16];
    (*this)(name, std::span<float>(values));
    out = affine_from_columns(values);
}

void Fields::operator()(const char* name, std::vector<int>& out) {
    const py::handle value = find(name);
    if (!value) return;
    try {
        std::vector<int> numbers;
        for (const py::handle item : value) numbers.push_back(py::cast<int>(item));
        out = std::move(numbers);
    } catch (const py::cast_error&) {
        wrong_type(name, "a sequence of whole numbers");
    } catch (const py::error_already_set&) {
        wrong_type(name, "a sequence of whole numbers");
    }
}

void Fields::operator()(const char* name, std::vector<uint8_t>& out) {
    const py::handle value = find(name);
    if (!value) return;
    char* data = nullptr;
    Py_ssize_t size = 0;
    if (!PyBytes_Check(value.ptr()) || PyBytes_AsStringAndSize(value.ptr(), &data, &size) != 0) wrong_type(name, "bytes");
    out.assign(data, data + size);
}

void Fields::operator()(const char* name, std::vector<float>& out) {
    const py::handle value = find(name);
    if (!value) return;
    const ArrayBuffer buffer(value, name, 'f');
    const float* data = static_cast<const float*>(buffer.data());
    out.assign(data, data + buffer.size());
}

void Fields::read_enum(const char* name, int& index, std::span<const char* const> names) {
    const py::handle value = find(name);
    if (!value) return;
    if (!PyUnicode_Check(value.ptr())) wrong_type(name, "a string");
    const std::string text = py::cast<std::string>(value);
    const auto found = std::find_if(names.begin(), names.end(), [&](const char* n) { return text == n; });
    if (found == names.end()) throw Error(std::string(what_) + ": '" + name + "' cannot be '" + text + "'");
    index = int(found - names.begin());
}

scene::Linking read_linking(py::handle pair) {
    const auto [receivers, blockers] = py::cast<std::pair<uint64_t, int32_t>>(pair);
    if (blockers < -1 || blockers >= scene::kBlockerGroups) throw Error("Light linking: there is no such blocker group");
    return {receivers, blockers};
}

std::vector<scene::Attribute> read_object_attributes(py::handle pairs) {
    std::vector<scene::Attribute> set;
    for (const py::handle pair : pairs) {
        const py::tuple t = py::cast<py::tuple>(pair);
        if (t.size() != 2) throw py::value_error("An object's attribute must be (name, values)");
        scene::Attribute a;
        a.name = py::cast<std::string>(t[0]);
        a.domain = scene::Domain::Object;
        for (const py::handle number : t[1]) a.data.push_back(py::cast<float>(number));
        if (a.data.empty() || a.data.size() > 4) throw py::value_error("Attribute '" + a.name + "' must have 1 to 4 values");
        a.components = uint8_t(a.data.size());
        set.push_back(std::move(a));
    }
    return set;
}

Affine affine_from_columns(const float* columns) {
    Affine out;
    for (int r = 0; r < 3; ++r) {
        for (int c = 0; c < 4; ++c) out.m[r][c] = columns[c * 4 + r];
    }
    return out;
}

}  // namespace talbot::python
