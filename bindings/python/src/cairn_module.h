// What the files of the Python module `cairn._cairn` share: errors, and NumPy arrays as the views of cairn.h.
#pragma once
#include <cairn/cairn.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <array>
#include <cstdint>
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

// The stream that the solver works on, to be ordered with whoever made an array on the device.
struct Ordering {
    std::uintptr_t given = 0; // cairn_config.stream
    // As DLPack and the CUDA array interface number it: 1 is the legacy default stream, with which the solver's own is ordered.
    std::uintptr_t stream() const { return given == 0 ? 1 : given; }
};

// A step over {field name: array} dicts, which it keeps alive. Nothing is copied. TypeError for an unknown field, a wrong element type
// or a layout that a view cannot express; ValueError for a wrong shape, a result that cannot be written, or an order that cannot be kept.
// `results_name`: what they are called in errors; `written`: they are to be written, not read.
struct BorrowedStep {
    BorrowedStep(double dt, const std::array<double, 3>& gravity, const py::dict& bodies, const py::dict& contacts, const py::dict& joints,
                 const py::dict& rows, const py::dict& out, const Ordering& ordering, const char* results_name = "out",
                 bool written = true);
    BorrowedStep(const BorrowedStep&) = delete; // it points into itself
    BorrowedStep& operator=(const BorrowedStep&) = delete;

    cairn_bodies bodies;
    cairn_contacts contacts;
    cairn_joints joints;
    cairn_rows rows;
    cairn_step step;
    cairn_results results;
    py::list keep;
};

} // namespace cairn_python
