#include "check_tables.h"

#include "scene/fields.h"

#include <cmath>
#include <limits>

namespace cairn::capi {

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr std::size_t kAxes = 6;

void check_locked_alone(const Array& axes) {
    for (std::size_t i = axes.first; i < axes.end; ++i)
        for (std::size_t c = 0; c < kAxes; ++c) {
            const auto bits = static_cast<std::uint32_t>(axes.column.integer(i, c));
            if ((bits & CAIRN_AXIS_LOCKED) != 0 && bits != CAIRN_AXIS_LOCKED)
                refuse(CAIRN_ERROR_INVALID_DATA, "joints.axes[%zu][%zu] is %u: a locked axis can be neither limited nor driven", i, c,
                       bits);
        }
}

// A value of an axis that reads it.
double axis_value(const Array& array, const char* state, std::size_t i, std::size_t c) {
    if (!array.present())
        refuse(CAIRN_ERROR_INVALID_DATA, "joints.axes[%zu][%zu] is %s, but joints.%s is absent: pass it", i, c, state, array.field);
    return array.column.real(i, c);
}

void check_limit(const Array& lower, const Array& upper, std::size_t i, std::size_t c) {
    const double low = axis_value(lower, "limited", i, c), high = axis_value(upper, "limited", i, c);
    if (!(low < kInfinity))
        refuse(CAIRN_ERROR_INVALID_DATA, "joints.lower[%zu][%zu] is %s: must be finite or -infinity on a limited axis", i, c,
               value_of(lower, i, c).text);
    if (!(high > -kInfinity))
        refuse(CAIRN_ERROR_INVALID_DATA, "joints.upper[%zu][%zu] is %s: must be finite or infinity on a limited axis", i, c,
               value_of(upper, i, c).text);
    if (low > high)
        refuse(CAIRN_ERROR_INVALID_DATA, "joints.lower[%zu][%zu] is %s, above joints.upper[%zu][%zu], which is %s", i, c,
               value_of(lower, i, c).text, i, c, value_of(upper, i, c).text);
}

void check_motor(const Array& speed, const Array& force, std::size_t i, std::size_t c) {
    if (!std::isfinite(axis_value(speed, "driven", i, c)))
        refuse(CAIRN_ERROR_INVALID_DATA, "joints.motor_speed[%zu][%zu] is %s: must be finite on a driven axis", i, c,
               value_of(speed, i, c).text);
    if (!(axis_value(force, "driven", i, c) >= 0))
        refuse(CAIRN_ERROR_INVALID_DATA, "joints.motor_force[%zu][%zu] is %s: must be >= 0 (infinity allowed)", i, c,
               value_of(force, i, c).text);
}

void check_body_part(const BodyColumns& columns, std::size_t first, std::size_t end) {
    const auto array = [&](const Column& column, const char* field, std::size_t components = 1) {
        return Array{column, "bodies", field, first, end, components};
    };
    const Array inverse_mass = array(columns.inverse_mass, "inverse_mass");
    const Array inverse_inertia = array(columns.inverse_inertia, "inverse_inertia", 3);
    const Array flags = array(columns.flags, "flags");
    check_rules(columns, "bodies", kBodyTable, first, end);
    if (!flags.present())
        return;
    for (std::size_t i = flags.first; i < flags.end; ++i) {
        if ((flags.column.integer(i) & CAIRN_BODY_AT_END_POSE) == 0)
            continue;
        if (inverse_mass.column.real(i) == 0 && inverse_inertia.column.real(i, 0) == 0 && inverse_inertia.column.real(i, 1) == 0 &&
            inverse_inertia.column.real(i, 2) == 0)
            continue;
        refuse(CAIRN_ERROR_INVALID_DATA,
               "bodies.flags[%zu] is %s, with CAIRN_BODY_AT_END_POSE: that is for kinematic bodies, and inverse_mass[%zu] or "
               "inverse_inertia[%zu] "
               "is not 0",
               i, value_of(flags, i).text, i, i);
    }
}

void check_contact_part(const ContactColumns& columns, std::size_t bodies, KeySet& keys, std::size_t first, std::size_t end) {
    const auto array = [&](const Column& column, const char* field, std::size_t components = 1) {
        return Array{column, "contacts", field, first, end, components};
    };
    check_pairs(array(columns.body_a, "body_a"), array(columns.body_b, "body_b"), bodies);
    check_rules(columns, "contacts", kContactTable, first, end);
    keys.add(array(columns.key, "key"));
}

void check_joint_part(const JointColumns& columns, std::size_t bodies, KeySet& keys, std::size_t first, std::size_t end) {
    const auto array = [&](const Column& column, const char* field, std::size_t components = 1) {
        return Array{column, "joints", field, first, end, components};
    };
    const Array axes = array(columns.axes, "axes", kAxes);
    const Array lower = array(columns.lower, "lower", kAxes), upper = array(columns.upper, "upper", kAxes);
    const Array speed = array(columns.motor_speed, "motor_speed", kAxes), force = array(columns.motor_force, "motor_force", kAxes);
    check_pairs(array(columns.body_a, "body_a"), array(columns.body_b, "body_b"), bodies);
    check_rules(columns, "joints", kJointTable, first, end);
    check_locked_alone(axes);
    for (std::size_t i = first; i < end; ++i)
        for (std::size_t c = 0; c < kAxes; ++c) {
            const auto bits = static_cast<std::uint32_t>(axes.column.integer(i, c));
            if ((bits & CAIRN_AXIS_LIMITED) != 0)
                check_limit(lower, upper, i, c);
            if ((bits & CAIRN_AXIS_DRIVEN) != 0)
                check_motor(speed, force, i, c);
        }
    keys.add(array(columns.key, "key"));
}

} // namespace

void check_bodies(const BodyColumns& columns) {
    in_parts(columns.count, [&](std::size_t first, std::size_t end) { check_body_part(columns, first, end); });
}

void check_contacts(const ContactColumns& columns, std::size_t bodies, KeySet& keys) {
    keys.start(columns.count);
    in_parts(columns.count, [&](std::size_t first, std::size_t end) { check_contact_part(columns, bodies, keys, first, end); });
}

void check_joints(const JointColumns& columns, std::size_t bodies, KeySet& keys) {
    keys.start(columns.count);
    in_parts(columns.count, [&](std::size_t first, std::size_t end) { check_joint_part(columns, bodies, keys, first, end); });
}

} // namespace cairn::capi
