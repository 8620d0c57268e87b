// Arrays of NumPy, and of whoever holds CUDA memory, as the views of cairn.h: element type, shape and strides are read off, nothing is
// copied.
#include "cairn_module.h"

#include <scene/fields.h> // core's: the fields' names and sizes, once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace cairn_python {
namespace {

using cairn::Kind;

std::string text_of(const py::handle& object) { return py::str(object).cast<std::string>(); }

// An array as its owner describes it, wherever it is; strides in bytes.
struct Array {
    void* data = nullptr;
    char form = '?'; // NumPy's: f, i, u
    py::ssize_t itemsize = 0;
    bool native = true, writeable = true, on_device = false;
    std::vector<py::ssize_t> shape, strides;
    std::string type; // for texts
};

Array from_numpy(const py::array& array) {
    const auto dtype = array.dtype();
    Array found;
    found.data = const_cast<void*>(array.data()); // inputs are not written; results are checked to be writeable
    found.form = dtype.kind();
    found.itemsize = dtype.itemsize();
    found.native = dtype.byteorder() == '=' || dtype.byteorder() == '|';
    found.writeable = array.writeable();
    found.shape.assign(array.shape(), array.shape() + array.ndim());
    found.strides.assign(array.strides(), array.strides() + array.ndim());
    found.type = text_of(dtype);
    return found;
}

void pack_strides(Array& array) {
    array.strides.resize(array.shape.size());
    py::ssize_t stride = array.itemsize;
    for (std::size_t axis = array.shape.size(); axis-- > 0; stride *= array.shape[axis]) {
        array.strides[axis] = stride;
    }
}

// https://numba.readthedocs.io/en/stable/cuda/cuda_array_interface.html, version 3 and before
Array from_cuda_array_interface(const std::string& name, const py::dict& interface, const Ordering& ordering) {
    const py::dtype dtype = py::dtype::from_args(interface["typestr"]);
    Array found;
    const auto data = interface["data"].cast<py::tuple>();
    found.data = reinterpret_cast<void*>(data[0].cast<std::uintptr_t>());
    found.form = dtype.kind();
    found.itemsize = dtype.itemsize();
    found.native = dtype.byteorder() == '=' || dtype.byteorder() == '|';
    found.writeable = !data[1].cast<bool>();
    found.on_device = true;
    found.shape = interface["shape"].cast<std::vector<py::ssize_t>>();
    found.type = text_of(dtype);
    if (interface.contains("strides") && !interface["strides"].is_none()) {
        found.strides = interface["strides"].cast<std::vector<py::ssize_t>>();
    } else {
        pack_strides(found);
    }
    const py::object stream = interface.contains("stream") ? py::object(interface["stream"]) : py::none();
    if (!stream.is_none() && stream.cast<std::uintptr_t>() != ordering.stream()) {
        throw py::value_error(name + " is ready in the order of stream " + text_of(stream) +
                              ", which is not the solver's; synchronise it, or pass " + "stream=" + text_of(stream) + " to the Solver");
    }
    return found;
}

// https://dmlc.github.io/dlpack/latest/c_api.html: what an unversioned capsule "dltensor" holds.
namespace dlpack {
constexpr std::int32_t kCuda = 2, kCudaManaged = 13;
struct Tensor {
    void* data;
    std::int32_t device_type, device_id, dimensions;
    std::uint8_t code, bits; // code: 0 int, 1 uint, 2 float
    std::uint16_t lanes;
    std::int64_t *shape, *strides; // strides in elements, or null: packed
    std::uint64_t byte_offset;
};
struct Managed {
    Tensor tensor;
    void* context;
    void (*deleter)(Managed*);
};
} // namespace dlpack

Array from_dlpack(const py::object& object, const Ordering& ordering, py::list& keep) {
    const py::capsule capsule = object.attr("__dlpack__")(py::arg("stream") = ordering.stream());
    auto* const managed = static_cast<dlpack::Managed*>(PyCapsule_GetPointer(capsule.ptr(), "dltensor"));
    if (!managed) {
        throw py::error_already_set();
    }
    PyCapsule_SetName(capsule.ptr(), "used_dltensor"); // ours to delete
    keep.append(py::capsule(managed, [](void* owned) {
        auto* const tensor = static_cast<dlpack::Managed*>(owned);
        if (tensor->deleter) {
            tensor->deleter(tensor);
        }
    }));
    const dlpack::Tensor& tensor = managed->tensor;
    Array found;
    found.data = static_cast<char*>(tensor.data) + tensor.byte_offset;
    found.form = tensor.lanes != 1 || tensor.code > 2 ? '?' : "iuf"[tensor.code];
    found.itemsize = tensor.bits / 8;
    found.on_device = true;
    found.shape.assign(tensor.shape, tensor.shape + tensor.dimensions);
    found.type = std::string(found.form == 'f'   ? "float"
                             : found.form == 'i' ? "int"
                             : found.form == 'u' ? "uint"
                                                 : "code ") +
                 (found.form == '?' ? std::to_string(tensor.code) + " of " : "") + std::to_string(tensor.bits) +
                 (found.form == '?' ? " bits" : "");
    if (tensor.strides) {
        for (std::int32_t axis = 0; axis < tensor.dimensions; ++axis) {
            found.strides.push_back(static_cast<py::ssize_t>(tensor.strides[axis]) * found.itemsize);
        }
    } else {
        pack_strides(found);
    }
    return found;
}

Array described(const std::string& name, const py::object& object, const Ordering& ordering, py::list& keep) {
    if (py::isinstance<py::array>(object)) {
        return from_numpy(py::reinterpret_borrow<py::array>(object));
    }
    if (py::hasattr(object, "__cuda_array_interface__")) {
        return from_cuda_array_interface(name, object.attr("__cuda_array_interface__"), ordering);
    }
    if (py::hasattr(object, "__dlpack_device__")) {
        const auto device = object.attr("__dlpack_device__")().cast<py::tuple>();
        const auto kind = py::int_(device[0]).cast<std::int32_t>();
        if (kind == dlpack::kCuda || kind == dlpack::kCudaManaged) {
            return from_dlpack(object, ordering, keep);
        }
        throw py::type_error(name + " is " + text_of(py::type::of(object)) + " on a device of DLPack's kind " + std::to_string(kind) +
                             "; pass a NumPy array, or one in CUDA memory");
    }
    throw py::type_error(name + " is " + text_of(py::type::of(object)) +
                         "; pass a NumPy array, or one in CUDA memory with __cuda_array_interface__ or __dlpack__");
}

std::uint32_t element_type(const std::string& name, const Array& array, Kind kind) {
    const char form = array.form;
    const auto size = array.itemsize;
    if (array.native && kind == Kind::real && form == 'f' && (size == 4 || size == 8)) {
        return size == 4 ? CAIRN_F32 : CAIRN_F64;
    }
    if (array.native && kind == Kind::integer && (form == 'i' || form == 'u') && size == 4) {
        return form == 'i' ? CAIRN_I32 : CAIRN_U32;
    }
    // A framework without unsigned integers (torch) has keys in int64: the same 64 bits.
    if (array.native && kind == Kind::key && size == 8 && (form == 'u' || (form == 'i' && array.on_device))) {
        return CAIRN_U64;
    }
    const char* wanted = kind == Kind::real ? "float32 or float64" : kind == Kind::integer ? "int32 or uint32" : "uint64";
    throw py::type_error(name + " has elements of type " + array.type + "; pass " + wanted + " of this machine's byte order");
}

std::string shape_text(const std::vector<py::ssize_t>& shape) { return text_of(py::tuple(py::cast(shape))); }
std::string shape_text(py::ssize_t components) { return components == 1 ? "(n,)" : "(n, " + std::to_string(components) + ")"; }

// The view of an array of n elements of some components; sets or checks n (-1: not known yet).
cairn_view view_of(const std::string& name, const py::object& object, py::ssize_t components, Kind kind, bool written,
                   const Ordering& ordering, py::list& keep, py::ssize_t& count) {
    const Array array = described(name, object, ordering, keep);
    cairn_view view = {};
    view.type = element_type(name, array, kind);
    const bool flat = components == 1 && array.shape.size() == 1;
    if (!flat && !(array.shape.size() == 2 && array.shape[1] == components)) {
        throw py::value_error(name + " has shape " + shape_text(array.shape) + "; pass " + shape_text(components));
    }
    if (count >= 0 && array.shape[0] != count) {
        throw py::value_error(name + " has " + std::to_string(array.shape[0]) + " elements; its table has " + std::to_string(count));
    }
    if (written && !array.writeable) {
        throw py::value_error(name + " is read-only; pass an array that may be written");
    }
    count = array.shape[0];
    view.data = array.data;
    view.device = array.on_device ? CAIRN_DEVICE : CAIRN_HOST;
    if (count == 0) {
        return view; // strides of an empty array mean nothing
    }
    if (components > 1 && array.strides[1] != array.itemsize) {
        throw py::type_error(name + " has a last axis that is not contiguous; pass a contiguous copy of it (numpy.ascontiguousarray)");
    }
    if (count > 1) {
        if (array.strides[0] == 0) { // to the library a stride of 0 means packed
            throw py::type_error(name + " repeats one element (stride 0); pass a copy of it");
        }
        view.stride = array.strides[0];
    }
    return view;
}

template <class Fields> std::string names_of(const Fields& fields) {
    std::string names;
    for (const auto& field : fields) {
        names += (names.empty() ? "" : ", ") + std::string(field.name);
    }
    return names;
}

template <class Table, class Columns, std::size_t N>
Table table_from(const char* table_name, const py::dict& arrays, const std::array<cairn::Field<Table, Columns>, N>& fields,
                 const Ordering& ordering, py::list& keep) {
    Table table = {};
    table.struct_size = sizeof table;
    py::ssize_t count = -1;
    for (const auto& item : arrays) {
        const auto name = text_of(item.first);
        const auto found = std::find_if(fields.begin(), fields.end(), [&](const auto& field) { return name == field.name; });
        if (found == fields.end()) {
            throw py::type_error(std::string(table_name) + " has no field '" + name + "'; it has " + names_of(fields));
        }
        table.*(found->view) = view_of(std::string(table_name) + "." + name, py::reinterpret_borrow<py::object>(item.second),
                                       static_cast<py::ssize_t>(found->components), found->kind, false, ordering, keep, count);
    }
    if (count > INT32_MAX - 1) {
        throw py::value_error(std::string(table_name) + " has " + std::to_string(count) + " elements; at most 2^31 - 2 fit");
    }
    table.count = count < 0 ? 0 : static_cast<std::uint32_t>(count);
    return table;
}

} // namespace

BorrowedStep::BorrowedStep(double dt, const std::array<double, 3>& gravity, const py::dict& body_arrays, const py::dict& contact_arrays,
                           const py::dict& joint_arrays, const py::dict& row_arrays, const py::dict& out, const Ordering& ordering,
                           const char* results_name, bool written) {
    for (const py::dict& arrays : {body_arrays, contact_arrays, joint_arrays, row_arrays, out}) {
        keep.append(arrays);
    }
    bodies = table_from("bodies", body_arrays, cairn::kBodyTable, ordering, keep);
    contacts = table_from("contacts", contact_arrays, cairn::kContactTable, ordering, keep);
    joints = table_from("joints", joint_arrays, cairn::kJointTable, ordering, keep);
    rows = table_from("rows", row_arrays, cairn::kRowTable, ordering, keep);
    results = {};
    results.struct_size = sizeof results;
    const std::uint32_t counts[] = {bodies.count, contacts.count, joints.count, rows.count};
    for (const cairn::ResultField& field : cairn::kResultTable) {
        if (!out.contains(field.name) || py::object(out[field.name]).is_none()) {
            continue;
        }
        py::ssize_t length = static_cast<py::ssize_t>(counts[static_cast<std::size_t>(field.of)]);
        results.*(field.view) = view_of(std::string(results_name) + "." + field.name, out[field.name],
                                        static_cast<py::ssize_t>(field.components), Kind::real, written, ordering, keep, length);
    }
    step = {};
    step.struct_size = sizeof step;
    step.dt = dt;
    for (std::size_t i = 0; i < 3; ++i) {
        step.gravity[i] = gravity[i];
    }
    step.bodies = &bodies;
    step.contacts = &contacts;
    step.joints = &joints;
    step.rows = &rows;
}

} // namespace cairn_python
