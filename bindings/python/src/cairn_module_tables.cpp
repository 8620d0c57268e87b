// NumPy arrays as the views of cairn.h: element type, shape and strides are read off, nothing is copied.
#include "cairn_module.h"

#include <cstddef>
#include <string>

namespace cairn_python {
namespace {

enum class Kind { real, index, key };

template <class Table> struct Field {
    const char* name;
    cairn_view Table::*view;
    py::ssize_t components;
    Kind kind;
};

constexpr Field<cairn_bodies> kBodies[] = {
    {"position", &cairn_bodies::position, 3, Kind::real},
    {"orientation", &cairn_bodies::orientation, 4, Kind::real},
    {"linear_velocity", &cairn_bodies::linear_velocity, 3, Kind::real},
    {"angular_velocity", &cairn_bodies::angular_velocity, 3, Kind::real},
    {"inverse_mass", &cairn_bodies::inverse_mass, 1, Kind::real},
    {"inverse_inertia", &cairn_bodies::inverse_inertia, 3, Kind::real},
    {"force", &cairn_bodies::force, 3, Kind::real},
    {"torque", &cairn_bodies::torque, 3, Kind::real},
    {"linear_factor", &cairn_bodies::linear_factor, 3, Kind::real},
    {"angular_factor", &cairn_bodies::angular_factor, 3, Kind::real},
    {"flags", &cairn_bodies::flags, 1, Kind::index},
};
constexpr Field<cairn_contacts> kContacts[] = {
    {"body_a", &cairn_contacts::body_a, 1, Kind::index},    {"body_b", &cairn_contacts::body_b, 1, Kind::index},
    {"normal", &cairn_contacts::normal, 3, Kind::real},     {"arm_a", &cairn_contacts::arm_a, 3, Kind::real},
    {"arm_b", &cairn_contacts::arm_b, 3, Kind::real},       {"separation", &cairn_contacts::separation, 1, Kind::real},
    {"friction", &cairn_contacts::friction, 1, Kind::real}, {"restitution", &cairn_contacts::restitution, 1, Kind::real},
    {"tangent", &cairn_contacts::tangent, 3, Kind::real},   {"key", &cairn_contacts::key, 1, Kind::key},
    {"flags", &cairn_contacts::flags, 1, Kind::index},
};
constexpr Field<cairn_joints> kJoints[] = {
    {"body_a", &cairn_joints::body_a, 1, Kind::index},
    {"body_b", &cairn_joints::body_b, 1, Kind::index},
    {"anchor_a", &cairn_joints::anchor_a, 3, Kind::real},
    {"anchor_b", &cairn_joints::anchor_b, 3, Kind::real},
    {"frame_a", &cairn_joints::frame_a, 4, Kind::real},
    {"frame_b", &cairn_joints::frame_b, 4, Kind::real},
    {"axes", &cairn_joints::axes, 6, Kind::index},
    {"lower", &cairn_joints::lower, 6, Kind::real},
    {"upper", &cairn_joints::upper, 6, Kind::real},
    {"motor_speed", &cairn_joints::motor_speed, 6, Kind::real},
    {"motor_force", &cairn_joints::motor_force, 6, Kind::real},
    {"key", &cairn_joints::key, 1, Kind::key},
};
constexpr Field<cairn_rows> kRows[] = {
    {"body_a", &cairn_rows::body_a, 1, Kind::index},
    {"body_b", &cairn_rows::body_b, 1, Kind::index},
    {"jacobian_a", &cairn_rows::jacobian_a, 6, Kind::real},
    {"jacobian_b", &cairn_rows::jacobian_b, 6, Kind::real},
    {"rhs", &cairn_rows::rhs, 1, Kind::real},
    {"lower", &cairn_rows::lower, 1, Kind::real},
    {"upper", &cairn_rows::upper, 1, Kind::real},
    {"compliance", &cairn_rows::compliance, 1, Kind::real},
    {"friction_index", &cairn_rows::friction_index, 1, Kind::index},
    {"friction", &cairn_rows::friction, 1, Kind::real},
    {"block", &cairn_rows::block, 1, Kind::index},
    {"key", &cairn_rows::key, 1, Kind::key},
};
constexpr Field<cairn_results> kBodyResults[] = {
    {"position", &cairn_results::position, 3, Kind::real},
    {"orientation", &cairn_results::orientation, 4, Kind::real},
    {"linear_velocity", &cairn_results::linear_velocity, 3, Kind::real},
    {"angular_velocity", &cairn_results::angular_velocity, 3, Kind::real},
};
constexpr Field<cairn_results> kContactResults[] = {
    {"contact_impulse", &cairn_results::contact_impulse, 1, Kind::real},
    {"friction_impulse", &cairn_results::friction_impulse, 3, Kind::real},
};
constexpr Field<cairn_results> kJointResults[] = {{"joint_impulse", &cairn_results::joint_impulse, 6, Kind::real}};
constexpr Field<cairn_results> kRowResults[] = {{"row_impulse", &cairn_results::row_impulse, 1, Kind::real}};

std::string text_of(const py::handle& object) { return py::str(object).cast<std::string>(); }

std::uint32_t element_type(const std::string& name, const py::array& array, Kind kind) {
    const auto dtype = array.dtype();
    const char form = dtype.kind();
    const auto size = dtype.itemsize();
    const bool native = dtype.byteorder() == '=' || dtype.byteorder() == '|';
    if (native && kind == Kind::real && form == 'f' && (size == 4 || size == 8)) {
        return size == 4 ? CAIRN_F32 : CAIRN_F64;
    }
    if (native && kind == Kind::index && (form == 'i' || form == 'u') && size == 4) {
        return form == 'i' ? CAIRN_I32 : CAIRN_U32;
    }
    if (native && kind == Kind::key && form == 'u' && size == 8) {
        return CAIRN_U64;
    }
    const char* wanted = kind == Kind::real ? "float32 or float64" : kind == Kind::index ? "int32 or uint32" : "uint64";
    throw py::type_error(name + " has elements of type " + text_of(dtype) + "; pass " + wanted + " of this machine's byte order");
}

std::string shape_text(py::ssize_t components) { return components == 1 ? "(n,)" : "(n, " + std::to_string(components) + ")"; }

// The view of an array of n elements of some components; sets or checks n (-1: not known yet).
cairn_view view_of(const std::string& name, const py::handle& object, py::ssize_t components, Kind kind, py::ssize_t& count) {
    if (!py::isinstance<py::array>(object)) {
        throw py::type_error(name + " is " + text_of(py::type::of(object)) + "; pass a NumPy array");
    }
    const auto array = py::reinterpret_borrow<py::array>(object);
    cairn_view view = {};
    view.type = element_type(name, array, kind);
    const bool flat = components == 1 && array.ndim() == 1;
    if (!flat && !(array.ndim() == 2 && array.shape(1) == components)) {
        throw py::value_error(name + " has shape " + text_of(array.attr("shape")) + "; pass " + shape_text(components));
    }
    if (count >= 0 && array.shape(0) != count) {
        throw py::value_error(name + " has " + std::to_string(array.shape(0)) + " elements; its table has " + std::to_string(count));
    }
    count = array.shape(0);
    view.data = const_cast<void*>(array.data()); // inputs are not written; results are checked to be writeable
    if (count == 0) {
        return view; // strides of an empty array mean nothing
    }
    if (components > 1 && array.strides(1) != array.itemsize()) {
        throw py::type_error(name + " has a last axis that is not contiguous; pass numpy.ascontiguousarray of it");
    }
    if (count > 1) {
        if (array.strides(0) == 0) { // to the library a stride of 0 means packed
            throw py::type_error(name + " repeats one element (stride 0); pass a copy of it");
        }
        view.stride = array.strides(0);
    }
    return view;
}

template <class Table, std::size_t N> std::string names_of(const Field<Table> (&fields)[N]) {
    std::string names;
    for (const auto& field : fields) {
        names += (names.empty() ? "" : ", ") + std::string(field.name);
    }
    return names;
}

template <class Table, std::size_t N> Table table_from(const char* table_name, const py::dict& arrays, const Field<Table> (&fields)[N]) {
    Table table = {};
    table.struct_size = sizeof table;
    py::ssize_t count = -1;
    for (const auto& item : arrays) {
        const auto name = text_of(item.first);
        const Field<Table>* found = nullptr;
        for (const auto& field : fields) {
            found = name == field.name ? &field : found;
        }
        if (!found) {
            throw py::type_error(std::string(table_name) + " has no field '" + name + "'; it has " + names_of(fields));
        }
        table.*(found->view) = view_of(std::string(table_name) + "." + name, item.second, found->components, found->kind, count);
    }
    if (count > INT32_MAX - 1) {
        throw py::value_error(std::string(table_name) + " has " + std::to_string(count) + " elements; at most 2^31 - 2 fit");
    }
    table.count = count < 0 ? 0 : static_cast<std::uint32_t>(count);
    return table;
}

template <std::size_t N>
void add_results(cairn_results& results, const py::dict& arrays, const Field<cairn_results> (&fields)[N], std::uint32_t count) {
    for (const auto& field : fields) {
        if (!arrays.contains(field.name)) {
            continue;
        }
        const auto name = "out." + std::string(field.name);
        const py::object object = arrays[field.name];
        py::ssize_t length = static_cast<py::ssize_t>(count);
        results.*(field.view) = view_of(name, object, field.components, field.kind, length);
        if (!py::reinterpret_borrow<py::array>(object).writeable()) {
            throw py::value_error(name + " is read-only; pass an array that may be written");
        }
    }
}

} // namespace

cairn_bodies bodies_from(const py::dict& arrays) { return table_from("bodies", arrays, kBodies); }
cairn_contacts contacts_from(const py::dict& arrays) { return table_from("contacts", arrays, kContacts); }
cairn_joints joints_from(const py::dict& arrays) { return table_from("joints", arrays, kJoints); }
cairn_rows rows_from(const py::dict& arrays) { return table_from("rows", arrays, kRows); }

cairn_results results_from(const py::dict& arrays, const cairn_step& step) {
    cairn_results results = {};
    results.struct_size = sizeof results;
    add_results(results, arrays, kBodyResults, step.bodies->count);
    add_results(results, arrays, kContactResults, step.contacts->count);
    add_results(results, arrays, kJointResults, step.joints->count);
    add_results(results, arrays, kRowResults, step.rows->count);
    return results;
}

} // namespace cairn_python
