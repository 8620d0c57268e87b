// What the files of the Python module `cairn._cairn` share: errors, and NumPy arrays as the views of cairn.h.
#pragma once
#include <cairn/cairn.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <stdexcept>

namespace cairn_python {

namespace py = pybind11;

// A call of the C interface that failed; becomes cairn.Error with the library's text.
struct Error : std::runtime_error {
    Error(cairn_status failed, const char* text) : std::runtime_error(text), status(failed) {}
    cairn_status status;
};

inline void check(cairn_status status) {
    if (status != CAIRN_OK) {
        throw Error(status, cairn_last_error());
    }
}

// Each takes {field name: array} and points the table at the arrays, which the caller keeps alive. TypeError for an unknown field,
// a wrong element type or a layout that a view cannot express; ValueError for a wrong shape. Nothing is copied.
cairn_bodies bodies_from(const py::dict& arrays);
cairn_contacts contacts_from(const py::dict& arrays);
cairn_joints joints_from(const py::dict& arrays);
cairn_rows rows_from(const py::dict& arrays);
// The arrays must be writeable and have the lengths of the step's tables.
cairn_results results_from(const py::dict& arrays, const cairn_step& step);

} // namespace cairn_python
