// The fields of each table as data: what cairn.h's comments say about them.
#pragma once
#include "input.h"

#include <cairn/cairn.h>

#include <array>
#include <cstddef>
#include <limits>

namespace cairn {

enum class Kind { real, integer, key }; // F32 or F64; I32 or U32; U64

// What each element must obey by itself, whatever other fields say.
struct Rule {
    enum Of { none, finite, range, unit, bits } of = none;
    double low = 0, high = 0; // range: low <= value <= high, both finite
    std::uint32_t known = 0;  // bits: no others
    const char* must = "";    // range and bits in words

    // Values of one element; the host's own checks are faster, and name what is wrong.
    CAIRN_HD bool obeyed(const Column& column, std::size_t i, std::size_t components) const {
        double square = 0;
        for (std::size_t c = 0; c < components && of != none; ++c) {
            if (of == bits) {
                if ((static_cast<std::uint32_t>(column.integer(i, c)) & ~known) != 0)
                    return false;
                continue;
            }
            const double value = column.real(i, c);
            if (!(value - value == 0) || (of == range && !(value >= low && value <= high)))
                return false;
            square += value * value;
        }
        return of != unit || is_unit(square);
    }
    // Norm 1 to within 1e-3.
    CAIRN_HD static bool is_unit(double square) { return square >= (1 - 1e-3) * (1 - 1e-3) && square <= (1 + 1e-3) * (1 + 1e-3); }
};

inline constexpr Rule kAny{}, kFinite{Rule::finite}, kUnit{Rule::unit};
inline constexpr Rule kNotNegative{Rule::range, 0, std::numeric_limits<double>::max(), 0, ">= 0"};
inline constexpr Rule kShare{Rule::range, 0, 1, 0, "0 ... 1"};
constexpr Rule bits_of(std::uint32_t known, const char* names) { return {Rule::bits, 0, 0, known, names}; }

template <class Table, class Columns> struct Field {
    const char* name;
    cairn_view Table::*view;
    Column Columns::*column;
    Kind kind;
    std::size_t components;
    bool required;
    Rule rule;
};

inline constexpr std::array kBodyTable = {
    Field{"position", &cairn_bodies::position, &BodyColumns::position, Kind::real, 3, true, kFinite},
    Field{"orientation", &cairn_bodies::orientation, &BodyColumns::orientation, Kind::real, 4, true, kUnit},
    Field{"linear_velocity", &cairn_bodies::linear_velocity, &BodyColumns::linear_velocity, Kind::real, 3, true, kFinite},
    Field{"angular_velocity", &cairn_bodies::angular_velocity, &BodyColumns::angular_velocity, Kind::real, 3, true, kFinite},
    Field{"inverse_mass", &cairn_bodies::inverse_mass, &BodyColumns::inverse_mass, Kind::real, 1, true, kNotNegative},
    Field{"inverse_inertia", &cairn_bodies::inverse_inertia, &BodyColumns::inverse_inertia, Kind::real, 3, true, kNotNegative},
    Field{"force", &cairn_bodies::force, &BodyColumns::force, Kind::real, 3, false, kFinite},
    Field{"torque", &cairn_bodies::torque, &BodyColumns::torque, Kind::real, 3, false, kFinite},
    Field{"linear_factor", &cairn_bodies::linear_factor, &BodyColumns::linear_factor, Kind::real, 3, false, kFinite},
    Field{"angular_factor", &cairn_bodies::angular_factor, &BodyColumns::angular_factor, Kind::real, 3, false, kFinite},
    Field{"flags", &cairn_bodies::flags, &BodyColumns::flags, Kind::integer, 1, false,
          bits_of(CAIRN_BODY_NO_GYROSCOPIC | CAIRN_BODY_AT_END_POSE, "CAIRN_BODY_NO_GYROSCOPIC (1) and CAIRN_BODY_AT_END_POSE (2)")},
};

inline constexpr std::array kContactTable = {
    Field{"body_a", &cairn_contacts::body_a, &ContactColumns::body_a, Kind::integer, 1, true, kAny},
    Field{"body_b", &cairn_contacts::body_b, &ContactColumns::body_b, Kind::integer, 1, true, kAny},
    Field{"normal", &cairn_contacts::normal, &ContactColumns::normal, Kind::real, 3, true, kUnit},
    Field{"arm_a", &cairn_contacts::arm_a, &ContactColumns::arm_a, Kind::real, 3, true, kFinite},
    Field{"arm_b", &cairn_contacts::arm_b, &ContactColumns::arm_b, Kind::real, 3, true, kFinite},
    Field{"separation", &cairn_contacts::separation, &ContactColumns::separation, Kind::real, 1, true, kFinite},
    Field{"friction", &cairn_contacts::friction, &ContactColumns::friction, Kind::real, 1, false, kNotNegative},
    Field{"restitution", &cairn_contacts::restitution, &ContactColumns::restitution, Kind::real, 1, false, kShare},
    Field{"tangent", &cairn_contacts::tangent, &ContactColumns::tangent, Kind::real, 3, false, kFinite},
    Field{"key", &cairn_contacts::key, &ContactColumns::key, Kind::key, 1, false, kAny},
    Field{"flags", &cairn_contacts::flags, &ContactColumns::flags, Kind::integer, 1, false,
          bits_of(CAIRN_CONTACT_ROUND_A | CAIRN_CONTACT_ROUND_B, "CAIRN_CONTACT_ROUND_A (1) and ROUND_B (2)")},
    Field{"friction_scale", &cairn_contacts::friction_scale, &ContactColumns::friction_scale, Kind::real, 2, false, kNotNegative},
    Field{"surface_velocity", &cairn_contacts::surface_velocity, &ContactColumns::surface_velocity, Kind::real, 3, false, kFinite},
    Field{"rolling_friction", &cairn_contacts::rolling_friction, &ContactColumns::rolling_friction, Kind::real, 1, false, kNotNegative},
    Field{"spinning_friction", &cairn_contacts::spinning_friction, &ContactColumns::spinning_friction, Kind::real, 1, false, kNotNegative},
    Field{"stiffness", &cairn_contacts::stiffness, &ContactColumns::stiffness, Kind::real, 1, false, kNotNegative},
    Field{"damping", &cairn_contacts::damping, &ContactColumns::damping, Kind::real, 1, false, kNotNegative},
};

inline constexpr std::array kJointTable = {
    Field{"body_a", &cairn_joints::body_a, &JointColumns::body_a, Kind::integer, 1, true, kAny},
    Field{"body_b", &cairn_joints::body_b, &JointColumns::body_b, Kind::integer, 1, true, kAny},
    Field{"anchor_a", &cairn_joints::anchor_a, &JointColumns::anchor_a, Kind::real, 3, true, kFinite},
    Field{"anchor_b", &cairn_joints::anchor_b, &JointColumns::anchor_b, Kind::real, 3, true, kFinite},
    Field{"frame_a", &cairn_joints::frame_a, &JointColumns::frame_a, Kind::real, 4, false, kUnit},
    Field{"frame_b", &cairn_joints::frame_b, &JointColumns::frame_b, Kind::real, 4, false, kUnit},
    Field{"axes", &cairn_joints::axes, &JointColumns::axes, Kind::integer, 6, true,
          bits_of(CAIRN_AXIS_LOCKED | CAIRN_AXIS_LIMITED | CAIRN_AXIS_DRIVEN | CAIRN_AXIS_SPRING | CAIRN_AXIS_SERVO,
                  "CAIRN_AXIS_LOCKED (1), LIMITED (2), DRIVEN (4), SPRING (8) and SERVO (16)")},
    Field{"lower", &cairn_joints::lower, &JointColumns::lower, Kind::real, 6, false, kAny},
    Field{"upper", &cairn_joints::upper, &JointColumns::upper, Kind::real, 6, false, kAny},
    Field{"motor_speed", &cairn_joints::motor_speed, &JointColumns::motor_speed, Kind::real, 6, false, kAny},
    Field{"motor_force", &cairn_joints::motor_force, &JointColumns::motor_force, Kind::real, 6, false, kAny},
    Field{"key", &cairn_joints::key, &JointColumns::key, Kind::key, 1, false, kAny},
    Field{"rotation", &cairn_joints::rotation, &JointColumns::rotation, Kind::integer, 1, false, kAny},
    Field{"target", &cairn_joints::target, &JointColumns::target, Kind::real, 6, false, kAny},
    Field{"stiffness", &cairn_joints::stiffness, &JointColumns::stiffness, Kind::real, 6, false, kAny},
    Field{"damping", &cairn_joints::damping, &JointColumns::damping, Kind::real, 6, false, kAny},
    Field{"rate", &cairn_joints::rate, &JointColumns::rate, Kind::real, 6, false, kAny},
    Field{"max_force", &cairn_joints::max_force, &JointColumns::max_force, Kind::real, 1, false, kAny},
};

inline constexpr std::array kRowTable = {
    Field{"body_a", &cairn_rows::body_a, &RowColumns::body_a, Kind::integer, 1, true, kAny},
    Field{"body_b", &cairn_rows::body_b, &RowColumns::body_b, Kind::integer, 1, true, kAny},
    Field{"jacobian_a", &cairn_rows::jacobian_a, &RowColumns::jacobian_a, Kind::real, 6, true, kFinite},
    Field{"jacobian_b", &cairn_rows::jacobian_b, &RowColumns::jacobian_b, Kind::real, 6, true, kFinite},
    Field{"rhs", &cairn_rows::rhs, &RowColumns::rhs, Kind::real, 1, false, kFinite},
    Field{"lower", &cairn_rows::lower, &RowColumns::lower, Kind::real, 1, false, kAny},
    Field{"upper", &cairn_rows::upper, &RowColumns::upper, Kind::real, 1, false, kAny},
    Field{"compliance", &cairn_rows::compliance, &RowColumns::compliance, Kind::real, 1, false, kNotNegative},
    Field{"friction_index", &cairn_rows::friction_index, &RowColumns::friction_index, Kind::integer, 1, false, kAny},
    Field{"friction", &cairn_rows::friction, &RowColumns::friction, Kind::real, 1, false, kNotNegative},
    Field{"block", &cairn_rows::block, &RowColumns::block, Kind::integer, 1, false, kAny},
    Field{"key", &cairn_rows::key, &RowColumns::key, Kind::key, 1, false, kAny},
};

// A result: which table it has an element for, and which input it may be the same view as.
enum class Of { bodies, contacts, joints, rows };
struct ResultField {
    const char* name;
    cairn_view cairn_results::*view;
    MutableColumn Output::*column;
    Column Outcome::*outcome;
    Of of;
    std::size_t components;
    cairn_view cairn_bodies::*in_place;
};

inline constexpr std::array kResultTable = {
    ResultField{"position", &cairn_results::position, &Output::position, &Outcome::position, Of::bodies, 3, &cairn_bodies::position},
    ResultField{"orientation", &cairn_results::orientation, &Output::orientation, &Outcome::orientation, Of::bodies, 4,
                &cairn_bodies::orientation},
    ResultField{"linear_velocity", &cairn_results::linear_velocity, &Output::linear_velocity, &Outcome::linear_velocity, Of::bodies, 3,
                &cairn_bodies::linear_velocity},
    ResultField{"angular_velocity", &cairn_results::angular_velocity, &Output::angular_velocity, &Outcome::angular_velocity, Of::bodies, 3,
                &cairn_bodies::angular_velocity},
    ResultField{"contact_impulse", &cairn_results::contact_impulse, &Output::contact_impulse, &Outcome::contact_impulse, Of::contacts, 1,
                nullptr},
    ResultField{"friction_impulse", &cairn_results::friction_impulse, &Output::friction_impulse, &Outcome::friction_impulse, Of::contacts,
                3, nullptr},
    ResultField{"joint_impulse", &cairn_results::joint_impulse, &Output::joint_impulse, &Outcome::joint_impulse, Of::joints, 6, nullptr},
    ResultField{"row_impulse", &cairn_results::row_impulse, &Output::row_impulse, &Outcome::row_impulse, Of::rows, 1, nullptr},
    ResultField{"torsion_impulse", &cairn_results::torsion_impulse, &Output::torsion_impulse, &Outcome::torsion_impulse, Of::contacts, 3,
                nullptr},
    ResultField{"joint_linear", &cairn_results::joint_linear, &Output::joint_linear, &Outcome::joint_linear, Of::joints, 3, nullptr},
    ResultField{"joint_angular", &cairn_results::joint_angular, &Output::joint_angular, &Outcome::joint_angular, Of::joints, 3, nullptr},
};

} // namespace cairn
