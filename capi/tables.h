// The fields of each table: what the header's comments say in brackets, as data.
#pragma once
#include "elements.h"
#include "views.h"

#include <cairn/cairn.h>

#include <array>
#include <cstddef>

namespace cairn::capi {

template <class Table, class Columns> struct Field {
    const char* name;
    cairn_view Table::*view;
    Column Columns::*column;
    Kind kind;
    std::size_t components;
    bool required;
};

constexpr std::array kBodyFields = {
    Field{"position", &cairn_bodies::position, &BodyColumns::position, Kind::real, 3, true},
    Field{"orientation", &cairn_bodies::orientation, &BodyColumns::orientation, Kind::real, 4, true},
    Field{"linear_velocity", &cairn_bodies::linear_velocity, &BodyColumns::linear_velocity, Kind::real, 3, true},
    Field{"angular_velocity", &cairn_bodies::angular_velocity, &BodyColumns::angular_velocity, Kind::real, 3, true},
    Field{"inverse_mass", &cairn_bodies::inverse_mass, &BodyColumns::inverse_mass, Kind::real, 1, true},
    Field{"inverse_inertia", &cairn_bodies::inverse_inertia, &BodyColumns::inverse_inertia, Kind::real, 3, true},
    Field{"force", &cairn_bodies::force, &BodyColumns::force, Kind::real, 3, false},
    Field{"torque", &cairn_bodies::torque, &BodyColumns::torque, Kind::real, 3, false},
    Field{"linear_factor", &cairn_bodies::linear_factor, &BodyColumns::linear_factor, Kind::real, 3, false},
    Field{"angular_factor", &cairn_bodies::angular_factor, &BodyColumns::angular_factor, Kind::real, 3, false},
    Field{"flags", &cairn_bodies::flags, &BodyColumns::flags, Kind::integer, 1, false},
};

constexpr std::array kContactFields = {
    Field{"body_a", &cairn_contacts::body_a, &ContactColumns::body_a, Kind::integer, 1, true},
    Field{"body_b", &cairn_contacts::body_b, &ContactColumns::body_b, Kind::integer, 1, true},
    Field{"normal", &cairn_contacts::normal, &ContactColumns::normal, Kind::real, 3, true},
    Field{"arm_a", &cairn_contacts::arm_a, &ContactColumns::arm_a, Kind::real, 3, true},
    Field{"arm_b", &cairn_contacts::arm_b, &ContactColumns::arm_b, Kind::real, 3, true},
    Field{"separation", &cairn_contacts::separation, &ContactColumns::separation, Kind::real, 1, true},
    Field{"friction", &cairn_contacts::friction, &ContactColumns::friction, Kind::real, 1, false},
    Field{"restitution", &cairn_contacts::restitution, &ContactColumns::restitution, Kind::real, 1, false},
    Field{"tangent", &cairn_contacts::tangent, &ContactColumns::tangent, Kind::real, 3, false},
    Field{"key", &cairn_contacts::key, &ContactColumns::key, Kind::key, 1, false},
    Field{"flags", &cairn_contacts::flags, &ContactColumns::flags, Kind::integer, 1, false},
};

constexpr std::array kJointFields = {
    Field{"body_a", &cairn_joints::body_a, &JointColumns::body_a, Kind::integer, 1, true},
    Field{"body_b", &cairn_joints::body_b, &JointColumns::body_b, Kind::integer, 1, true},
    Field{"anchor_a", &cairn_joints::anchor_a, &JointColumns::anchor_a, Kind::real, 3, true},
    Field{"anchor_b", &cairn_joints::anchor_b, &JointColumns::anchor_b, Kind::real, 3, true},
    Field{"frame_a", &cairn_joints::frame_a, &JointColumns::frame_a, Kind::real, 4, false},
    Field{"frame_b", &cairn_joints::frame_b, &JointColumns::frame_b, Kind::real, 4, false},
    Field{"axes", &cairn_joints::axes, &JointColumns::axes, Kind::integer, 6, true},
    Field{"lower", &cairn_joints::lower, &JointColumns::lower, Kind::real, 6, false},
    Field{"upper", &cairn_joints::upper, &JointColumns::upper, Kind::real, 6, false},
    Field{"motor_speed", &cairn_joints::motor_speed, &JointColumns::motor_speed, Kind::real, 6, false},
    Field{"motor_force", &cairn_joints::motor_force, &JointColumns::motor_force, Kind::real, 6, false},
    Field{"key", &cairn_joints::key, &JointColumns::key, Kind::key, 1, false},
};

constexpr std::array kRowFields = {
    Field{"body_a", &cairn_rows::body_a, &RowColumns::body_a, Kind::integer, 1, true},
    Field{"body_b", &cairn_rows::body_b, &RowColumns::body_b, Kind::integer, 1, true},
    Field{"jacobian_a", &cairn_rows::jacobian_a, &RowColumns::jacobian_a, Kind::real, 6, true},
    Field{"jacobian_b", &cairn_rows::jacobian_b, &RowColumns::jacobian_b, Kind::real, 6, true},
    Field{"rhs", &cairn_rows::rhs, &RowColumns::rhs, Kind::real, 1, false},
    Field{"lower", &cairn_rows::lower, &RowColumns::lower, Kind::real, 1, false},
    Field{"upper", &cairn_rows::upper, &RowColumns::upper, Kind::real, 1, false},
    Field{"compliance", &cairn_rows::compliance, &RowColumns::compliance, Kind::real, 1, false},
    Field{"friction_index", &cairn_rows::friction_index, &RowColumns::friction_index, Kind::integer, 1, false},
    Field{"friction", &cairn_rows::friction, &RowColumns::friction, Kind::real, 1, false},
    Field{"block", &cairn_rows::block, &RowColumns::block, Kind::integer, 1, false},
    Field{"key", &cairn_rows::key, &RowColumns::key, Kind::key, 1, false},
};

// A result: which table it has an element for, and which input it may be the same view as.
enum class Of { bodies, contacts, joints, rows };
struct ResultField {
    const char* name;
    cairn_view cairn_results::*view;
    MutableColumn Output::*column;
    Of of;
    std::size_t components;
    cairn_view cairn_bodies::*in_place;
};

constexpr std::array kResultFields = {
    ResultField{"position", &cairn_results::position, &Output::position, Of::bodies, 3, &cairn_bodies::position},
    ResultField{"orientation", &cairn_results::orientation, &Output::orientation, Of::bodies, 4, &cairn_bodies::orientation},
    ResultField{"linear_velocity", &cairn_results::linear_velocity, &Output::linear_velocity, Of::bodies, 3,
                &cairn_bodies::linear_velocity},
    ResultField{"angular_velocity", &cairn_results::angular_velocity, &Output::angular_velocity, Of::bodies, 3,
                &cairn_bodies::angular_velocity},
    ResultField{"contact_impulse", &cairn_results::contact_impulse, &Output::contact_impulse, Of::contacts, 1, nullptr},
    ResultField{"friction_impulse", &cairn_results::friction_impulse, &Output::friction_impulse, Of::contacts, 3, nullptr},
    ResultField{"joint_impulse", &cairn_results::joint_impulse, &Output::joint_impulse, Of::joints, 6, nullptr},
    ResultField{"row_impulse", &cairn_results::row_impulse, &Output::row_impulse, Of::rows, 1, nullptr},
};

} // namespace cairn::capi
