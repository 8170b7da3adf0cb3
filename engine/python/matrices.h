/// Blender's matrices, many at once.
#pragma once

#include <pybind11/pybind11.h>

namespace talbot::python {

/// 16 floats each, column-major as Blender keeps them, of a list of 4x4 mathutils matrices that own their values (as
/// `copy()` gives them). TypeError for anything else. Without numpy's help: that takes a hundred times as long.
pybind11::bytes matrix_columns(const pybind11::list& matrices);

}  // namespace talbot::python
