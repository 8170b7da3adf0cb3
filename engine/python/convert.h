/// Python values into plain data, checked: borrowed arrays and dictionaries of fields. Everything here needs the GIL.
///
/// Arrays come through the buffer protocol, not numpy's C interface: one build serves numpy 1 and 2.
#pragma once

#include <pybind11/pybind11.h>

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "base/vec.h"
#include "scene/scene.h"

namespace talbot::python {

namespace py = pybind11;

/// A borrowed C-contiguous numpy array of exactly one dtype, held while this lives. Destroy it with the GIL.
class ArrayBuffer {
public:
    ArrayBuffer() = default;
    /// Throws TypeError for another dtype or layout. `format`: one of "f", "I", "i", "B".
    ArrayBuffer(py::handle object, const std::string& name, char format);
    ~ArrayBuffer();
    ArrayBuffer(ArrayBuffer&& other) noexcept : view_(other.view_), held_(other.held_) { other.held_ = false; }
    ArrayBuffer& operator=(ArrayBuffer&& other) noexcept;
    ArrayBuffer(const ArrayBuffer&) = delete;

    const void* data() const { return held_ ? view_.buf : nullptr; }
    size_t size() const { return held_ ? size_t(view_.len / view_.itemsize) : 0; }
    size_t rows() const { return held_ && view_.ndim > 0 ? size_t(view_.shape[0]) : 0; }
    /// 1 for one-dimensional arrays.
    size_t columns() const { return held_ && view_.ndim > 1 ? size_t(view_.shape[1]) : 1; }
    int dimensions() const { return held_ ? view_.ndim : 0; }

private:
    Py_buffer view_{};
    bool held_ = false;
};

template <typename T>
constexpr char array_format();
template <>
constexpr char array_format<float>() {
    return 'f';
}
template <>
constexpr char array_format<uint32_t>() {
    return 'I';
}
template <>
constexpr char array_format<int32_t>() {
    return 'i';
}
template <>
constexpr char array_format<uint8_t>() {
    return 'B';
}

/// The arrays of one dictionary, held together while C++ reads them without the GIL.
class ArrayDict {
public:
    explicit ArrayDict(const py::dict& values) : values_(values) {}

    /// Array `name` of `columns` columns (1: one-dimensional); empty when it is absent. ValueError for another shape.
    template <typename T>
    std::span<const T> get(const char* name, size_t columns) {
        const ArrayBuffer* buffer = find(name, columns, array_format<T>());
        return buffer ? std::span<const T>(static_cast<const T*>(buffer->data()), buffer->size()) : std::span<const T>();
    }
    /// The same of any object that is not a value of the dictionary; one or two dimensions, any columns.
    const ArrayBuffer& hold(py::handle object, const std::string& name, char format);
    /// The value, or none; marks it as known.
    py::object value(const char* name);
    /// KeyError for a key nobody asked for.
    void finish(const char* what) const;

private:
    const ArrayBuffer* find(const char* name, size_t columns, char format);
    const py::dict& values_;
    std::vector<std::string> known_;
    std::vector<std::unique_ptr<ArrayBuffer>> buffers_;
};

/// Reads the fields of a struct from a dictionary: missing keys keep what is there, unknown ones raise KeyError.
class Fields {
public:
    Fields(const py::dict& values, const char* what) : values_(values), what_(what) {}

    void operator()(const char* name, bool& out);
    void operator()(const char* name, int32_t& out);
    void operator()(const char* name, uint32_t& out);
    void operator()(const char* name, float& out);  ///< finite only
    void operator()(const char* name, std::string& out);
    void operator()(const char* name, Vec3& out);
    void operator()(const char* name, scene::Linking& out);
    void operator()(const char* name, std::vector<scene::Attribute>& out);  ///< of an object
    void operator()(const char* name, Affine& out);                         ///< 16 floats, column-major
    void operator()(const char* name, std::span<float> out);
    void operator()(const char* name, std::vector<int>& out);
    void operator()(const char* name, std::vector<uint8_t>& out);  ///< bytes
    void operator()(const char* name, std::vector<float>& out);    ///< f32 array
    template <typename Enum>
    void operator()(const char* name, Enum& out, std::span<const char* const> names) {
        int index = int(out);
        read_enum(name, index, names);
        out = Enum(index);
    }
    void finish() const;  ///< KeyError for a key nobody asked for

private:
    py::handle find(const char* name);
    void read_enum(const char* name, int& index, std::span<const char* const> names);
    [[noreturn]] void wrong_type(const char* name, const char* wanted) const;
    const py::dict& values_;
    const char* what_;
    size_t known_ = 0;
    std::vector<const char*> names_;
};

/// (receivers, blockers) of light linking.
scene::Linking read_linking(py::handle pair);

/// Pairs (name, 1 to 4 values): custom properties of an object.
std::vector<scene::Attribute> read_object_attributes(py::handle pairs);

/// 16 floats, column-major as Blender's foreach_get gives matrices.
Affine affine_from_columns(const float* columns);

}  // namespace talbot::python
