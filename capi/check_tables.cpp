#include "check_tables.h"

#include "scene/fields.h"

#include <cmath>
#include <limits>

namespace cairn::capi {

namespace {

constexpr double kLargest = std::numeric_limits<double>::max();
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr std::size_t kAxes = 6;

void check_combinations(const Array& axes) {
    for (std::size_t i = axes.first; i < axes.end; ++i)
        for (std::size_t c = 0; c < kAxes; ++c) {
            const auto bits = static_cast<std::uint32_t>(axes.column.integer(i, c));
            if ((bits & CAIRN_AXIS_LOCKED) != 0 && bits != CAIRN_AXIS_LOCKED)
                refuse(CAIRN_ERROR_INVALID_DATA,
                       "joints.axes[%zu][%zu] is %u: a locked axis can be neither limited nor driven, and has no spring", i, c, bits);
            if ((bits & CAIRN_AXIS_SERVO) != 0 && (bits & CAIRN_AXIS_DRIVEN) == 0)
                refuse(CAIRN_ERROR_INVALID_DATA, "joints.axes[%zu][%zu] is %u: CAIRN_AXIS_SERVO goes with CAIRN_AXIS_DRIVEN", i, c, bits);
            if ((bits & CAIRN_AXIS_SPRING) != 0 && (bits & CAIRN_AXIS_DRIVEN) != 0)
                refuse(CAIRN_ERROR_INVALID_DATA,
                       "joints.axes[%zu][%zu] is %u: an axis has a motor or a spring; a second joint may have the "
                       "other",
                       i, c, bits);
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

void check_motor(const Array& speed, const Array& force, bool servo, std::size_t i, std::size_t c) {
    if (servo && !(axis_value(speed, "driven", i, c) >= 0))
        refuse(CAIRN_ERROR_INVALID_DATA, "joints.motor_speed[%zu][%zu] is %s: must be >= 0 (infinity allowed) on a servo's axis", i, c,
               value_of(speed, i, c).text);
    if (!servo && !std::isfinite(axis_value(speed, "driven", i, c)))
        refuse(CAIRN_ERROR_INVALID_DATA, "joints.motor_speed[%zu][%zu] is %s: must be finite on a driven axis", i, c,
               value_of(speed, i, c).text);
    if (!(axis_value(force, "driven", i, c) >= 0))
        refuse(CAIRN_ERROR_INVALID_DATA, "joints.motor_force[%zu][%zu] is %s: must be >= 0 (infinity allowed)", i, c,
               value_of(force, i, c).text);
}

// A value that is optional.
void check_axis_value(const Array& array, double most, const char* must, std::size_t i, std::size_t c) {
    if (array.present() && !(array.column.real(i, c) >= 0 && array.column.real(i, c) <= most))
        refuse(CAIRN_ERROR_INVALID_DATA, "joints.%s[%zu][%zu] is %s: must be %s", array.field, i, c, value_of(array, i, c).text, must);
}

void check_target(const Array& target, std::size_t i, std::size_t c) {
    if (target.present() && !std::isfinite(target.column.real(i, c)))
        refuse(CAIRN_ERROR_INVALID_DATA, "joints.target[%zu][%zu] is %s: must be finite", i, c, value_of(target, i, c).text);
}

// Of CAIRN_ROTATION_CONE: ry and rz go together.
void check_cone(const Array& axes, const Array& upper, std::size_t i) {
    const auto bits = [&](std::size_t c) { return static_cast<std::uint32_t>(axes.column.integer(i, c)); };
    for (std::size_t c : {std::size_t{4}, std::size_t{5}}) {
        if (bits(c) != bits(4) || (bits(c) != CAIRN_AXIS_FREE && bits(c) != CAIRN_AXIS_LIMITED))
            refuse(CAIRN_ERROR_INVALID_DATA,
                   "joints.axes[%zu][%zu] is %u, with CAIRN_ROTATION_CONE: ry and rz must both be free or limited", i, c, bits(c));
        if (bits(c) == CAIRN_AXIS_LIMITED && !(axis_value(upper, "limited", i, c) > 0))
            refuse(CAIRN_ERROR_INVALID_DATA, "joints.upper[%zu][%zu] is %s: a cone's half-angle must be > 0 (infinity allowed)", i, c,
                   value_of(upper, i, c).text);
    }
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
    const Array rotation = array(columns.rotation, "rotation"), force_bound = array(columns.max_force, "max_force");
    const Array target = array(columns.target, "target", kAxes), stiffness = array(columns.stiffness, "stiffness", kAxes);
    const Array damping = array(columns.damping, "damping", kAxes), rate = array(columns.rate, "rate", kAxes);
    check_pairs(array(columns.body_a, "body_a"), array(columns.body_b, "body_b"), bodies);
    check_rules(columns, "joints", kJointTable, first, end);
    check_combinations(axes);
    for (std::size_t i = first; i < end; ++i) {
        const std::int64_t kind = rotation.present() ? rotation.column.integer(i) : CAIRN_ROTATION_BY_AXES;
        if (kind < 0 || kind > CAIRN_ROTATION_CONE)
            refuse(CAIRN_ERROR_INVALID_DATA, "joints.rotation[%zu] is %s: must be CAIRN_ROTATION_BY_AXES (0), VECTOR (1) or CONE (2)", i,
                   value_of(rotation, i).text);
        if (kind == CAIRN_ROTATION_CONE)
            check_cone(axes, upper, i);
        if (force_bound.present() && !(force_bound.column.real(i) >= 0))
            refuse(CAIRN_ERROR_INVALID_DATA, "joints.max_force[%zu] is %s: must be >= 0 (infinity allowed)", i,
                   value_of(force_bound, i).text);
        for (std::size_t c = 0; c < kAxes; ++c) {
            const auto bits = static_cast<std::uint32_t>(axes.column.integer(i, c));
            if ((bits & CAIRN_AXIS_LIMITED) != 0 && (kind != CAIRN_ROTATION_CONE || c < 4))
                check_limit(lower, upper, i, c);
            if ((bits & CAIRN_AXIS_DRIVEN) != 0)
                check_motor(speed, force, (bits & CAIRN_AXIS_SERVO) != 0, i, c);
            if ((bits & (CAIRN_AXIS_SPRING | CAIRN_AXIS_SERVO)) != 0)
                check_target(target, i, c);
            if ((bits & CAIRN_AXIS_SERVO) != 0) {
                check_axis_value(stiffness, kInfinity, ">= 0 (infinity allowed)", i, c);
                check_axis_value(rate, kInfinity, ">= 0 (infinity allowed)", i, c);
            }
            if ((bits & CAIRN_AXIS_SPRING) != 0) {
                axis_value(stiffness, "a spring's", i, c);
                check_axis_value(stiffness, kLargest, ">= 0 and finite on a spring's axis", i, c);
                check_axis_value(damping, kLargest, ">= 0 and finite", i, c);
            }
        }
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
