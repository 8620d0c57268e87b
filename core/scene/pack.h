// From one element of the caller's tables to the solver's layout (frame.h). In double, whatever the solver's precision: gaps and
// arms are differences of positions that may be far from the origin.
#pragma once
#include "../math/vec.h"
#include "../method/params.h"
#include "../rows/soft.h"
#include "frame.h"
#include "input.h"

#include <algorithm>
#include <cmath>

namespace cairn {
inline namespace CAIRN_ISA {

using DVec = Vec3<double>;
using DQuat = Quat<double>;
constexpr double kHuge = 1e30; // stands for infinity: 0 * infinity would be NaN

CAIRN_HD inline DVec real3(const Column& column, std::size_t i, const DVec& absent = {0, 0, 0}) {
    if (!column.present())
        return absent;
    return {column.real(i, 0), column.real(i, 1), column.real(i, 2)};
}
CAIRN_HD inline DQuat quaternion(const Column& column, std::size_t i) {
    if (!column.present())
        return {0, 0, 0, 1};
    return normalized(DQuat{column.real(i, 0), column.real(i, 1), column.real(i, 2), column.real(i, 3)});
}
CAIRN_HD inline double real_or(const Column& column, std::size_t i, double absent) { return column.present() ? column.real(i) : absent; }
CAIRN_HD inline std::uint64_t key_of(const Column& column, std::size_t i) { return column.present() ? column.key(i) : 0; }
CAIRN_HD inline std::uint32_t flags_of(const Column& column, std::size_t i) {
    return column.present() ? static_cast<std::uint32_t>(column.integer(i)) : 0;
}

template <class S> CAIRN_HD void put3(S* to, std::size_t stride, const DVec& a) {
    to[0] = static_cast<S>(a.x);
    to[stride] = static_cast<S>(a.y);
    to[2 * stride] = static_cast<S>(a.z);
}
template <class S> CAIRN_HD DVec get3(const S* from, std::size_t stride) {
    return {static_cast<double>(from[0]), static_cast<double>(from[stride]), static_cast<double>(from[2 * stride])};
}

// Duff et al. 2017, "Building an orthonormal basis, revisited"
CAIRN_HD inline DVec perpendicular(const DVec& n) {
    const double sign = std::copysign(1.0, n.z), a = -1.0 / (sign + n.z), b = n.x * n.y * a;
    return {1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x};
}

// ---- Bodies ----

// A row of eight numbers each for velocity, displacement and mass; all zero before.
template <class S> struct BodyRows {
    BodyConstants<S>* body;
    S *velocity, *displacement, *mass;
};
template <class S> CAIRN_HD bool is_still(const S* v) { return v[0] == 0 && v[1] == 0 && v[2] == 0 && v[4] == 0 && v[5] == 0 && v[6] == 0; }
CAIRN_HD inline DVec factored_mass(const BodyColumns& in, std::size_t i) {
    const DVec linear = real3(in.linear_factor, i, {1, 1, 1});
    return times(linear, linear) * in.inverse_mass.real(i);
}
CAIRN_HD inline bool is_movable(const BodyColumns& in, std::size_t i) {
    const DVec m = factored_mass(in, i), inertia = real3(in.inverse_inertia, i), angular = real3(in.angular_factor, i, {1, 1, 1});
    const bool turns = (inertia.x > 0 || inertia.y > 0 || inertia.z > 0) && (angular.x != 0 || angular.y != 0 || angular.z != 0);
    return m.x > 0 || m.y > 0 || m.z > 0 || turns;
}

template <class S>
CAIRN_HD void pack_body(const BodyColumns& in, std::size_t i, double dt, const double* gravity, std::uint32_t substeps,
                        const BodyRows<S>& to) {
    BodyConstants<S>& body = *to.body;
    const DQuat q = quaternion(in.orientation, i);
    const double inverse_mass = in.inverse_mass.real(i);
    const DVec inertia = real3(in.inverse_inertia, i), linear = real3(in.linear_factor, i, {1, 1, 1}),
               angular = real3(in.angular_factor, i, {1, 1, 1});
    const DVec factored = factored_mass(in, i);
    const std::uint32_t flags = flags_of(in.flags, i);
    body.orientation[0] = static_cast<S>(q.x);
    body.orientation[1] = static_cast<S>(q.y);
    body.orientation[2] = static_cast<S>(q.z);
    body.orientation[3] = static_cast<S>(q.w);
    put3(body.inverse_inertia, 1, inertia);
    put3(body.inverse_mass, 1, factored);
    put3(body.angular_factor, 1, angular);
    const DVec weight = inverse_mass > 0 ? times(times(linear, linear), DVec{gravity[0], gravity[1], gravity[2]}) : DVec{0, 0, 0};
    put3(body.acceleration, 1, weight + times(factored, real3(in.force, i)));
    put3(body.torque, 1, real3(in.torque, i));
    body.mass = static_cast<S>(inverse_mass > 0 ? 1 / inverse_mass : 0);
    body.movable = is_movable(in, i);
    const bool full_turn = angular.x == 1 && angular.y == 1 && angular.z == 1;
    const bool even = inertia.x == inertia.y && inertia.y == inertia.z;
    body.gyroscopic = body.movable && full_turn && !even && inertia.x > 0 && inertia.y > 0 && inertia.z > 0 && !(flags & 1u);

    const DVec v = real3(in.linear_velocity, i), w = real3(in.angular_velocity, i);
    put3(to.velocity, 1, v);
    put3(to.velocity + 4, 1, w);
    if (body.movable)
        put3(to.mass, 1, factored);
    to.displacement[7] = 1;
    if (!body.movable && (flags & 2u) && !is_still(to.velocity)) { // it stands where the step ends: at the start it was not there yet
        put3(to.displacement, 1, v * -dt);
        constexpr double quarter_turn = 0.78539816339744831; // of a substep, at most
        const double speed = root(dot(w, w)), most = substeps * quarter_turn;
        const double angle = speed * dt < most ? speed * dt : most; // as far as it will turn
        const DQuat turn = exp_any(w * (speed > 0 ? -angle / speed : 0));
        put3(to.displacement + 4, 1, vec(turn));
        to.displacement[7] = static_cast<S>(turn.w);
    }
}

// ---- Contacts ---- `hot` and `cold`: the point's first fields, fields kGroup apart. `last`: impulses of the last substep / h, or null.

template <class S> CAIRN_HD S* field_at(S* base, std::size_t field) { return base + field * kGroup; }

// The larger coefficient of the two tangents.
CAIRN_HD inline double contact_friction(const ContactColumns& in, std::size_t i, Friction model) {
    if (model == Friction::none || !in.friction.present())
        return 0;
    const double scale = in.friction_scale.present() ? maximum(in.friction_scale.real(i, 0), in.friction_scale.real(i, 1)) : 1;
    return minimum(in.friction.real(i) * scale, kHuge);
}
CAIRN_HD inline bool contact_is_spring(const ContactColumns& in, std::size_t i) {
    return real_or(in.stiffness, i, 0) > 0 || real_or(in.damping, i, 0) > 0;
}
CAIRN_HD inline bool contact_bounces(const ContactColumns& in, std::size_t i) {
    return real_or(in.restitution, i, 0) > 0 && !contact_is_spring(in, i);
}
CAIRN_HD inline ContactKind contact_kind(const ContactColumns& in, std::size_t i, Friction model) {
    const bool rubs = contact_friction(in, i, model) > 0;
    if (in.special()) {
        if (model != Friction::none && (real_or(in.rolling_friction, i, 0) > 0 || real_or(in.spinning_friction, i, 0) > 0))
            return ContactKind::torsional;
        const DVec belt = real3(in.surface_velocity, i);
        if (contact_is_spring(in, i) || (rubs && (belt.x != 0 || belt.y != 0 || belt.z != 0)))
            return ContactKind::special;
    }
    return rubs ? ContactKind::frictional : ContactKind::smooth;
}

// extra: of points in special groups, else null
template <class S>
CAIRN_HD void pack_contact(const ContactColumns& in, std::size_t i, Friction model, double h, const double* last, S* hot, S* cold,
                           S* extra) {
    const DVec n = normalized(real3(in.normal, i)), arm_a = real3(in.arm_a, i), arm_b = real3(in.arm_b, i);
    const double separation = in.separation.real(i), friction = contact_friction(in, i, model);
    const DVec wish = real3(in.tangent, i), flat = wish - n * dot(wish, n);
    const bool chosen = dot(flat, flat) > 1e-12 * dot(wish, wish) && dot(wish, wish) > 0;
    DVec t1 = chosen ? normalized(flat) : perpendicular(n), t2 = cross(n, t1);
    double per_t1 = 1, per_t2 = 1;                     // 1/|t|^2
    if (friction > 0 && in.friction_scale.present()) { // the cone's ellipse is a disc of radius `friction` in shorter tangents
        const double s1 = in.friction_scale.real(i, 0), s2 = in.friction_scale.real(i, 1), most = maximum(s1, s2);
        t1 = t1 * (s1 / most);
        t2 = t2 * (s2 / most);
        per_t1 = inverse_or_zero(dot(t1, t1));
        per_t2 = inverse_or_zero(dot(t2, t2));
    }
    put3(field_at(hot, kNormal), kGroup, n);
    put3(field_at(hot, kTangent1), kGroup, t1);
    put3(field_at(hot, kTangent2), kGroup, t2);
    // the common point, half way between the surfaces
    put3(field_at(hot, kArmA), kGroup, arm_a + n * (0.5 * separation));
    put3(field_at(hot, kArmB), kGroup, arm_b - n * (0.5 * separation));
    *field_at(hot, kFriction) = static_cast<S>(friction);
    *field_at(cold, kSeparation) = static_cast<S>(separation);
    put3(field_at(cold, kAnchorA), kGroup, arm_a);
    put3(field_at(cold, kAnchorB), kGroup, arm_b);
    const std::uint32_t flags = flags_of(in.flags, i);
    *field_at(cold, kTurnsA) = flags & 1u ? S(0) : S(1);
    *field_at(cold, kTurnsB) = flags & 2u ? S(0) : S(1);
    *field_at(cold, kRestitution) = static_cast<S>(contact_bounces(in, i) ? in.restitution.real(i) : 0);
    if (last) {
        const DVec tangential{last[1], last[2], last[3]};
        put3(field_at(hot, kLambda), kGroup, DVec{last[0] * h, dot(tangential, t1) * per_t1 * h, dot(tangential, t2) * per_t2 * h});
    }
    if (!extra)
        return;
    const DVec belt = real3(in.surface_velocity, i);
    *field_at(extra, kSlipTarget) = static_cast<S>(dot(belt, t1));
    *field_at(extra, kSlipTarget + 1) = static_cast<S>(dot(belt, t2));
    if (contact_is_spring(in, i)) {
        const double k = minimum(real_or(in.stiffness, i, 0), kHuge), c = minimum(real_or(in.damping, i, 0), kHuge);
        *field_at(extra, kSpringRate) = static_cast<S>(minimum(spring_rate(k, c, h), 1 / h));
        *field_at(extra, kSpringGamma) = static_cast<S>(clamp(spring_compliance(k, c, h), 1 / kHuge, kHuge));
    }
    const double none = 0;
    *field_at(extra, kRollingBound) = static_cast<S>(model == Friction::none ? none : minimum(real_or(in.rolling_friction, i, 0), kHuge));
    *field_at(extra, kSpinningBound) = static_cast<S>(model == Friction::none ? none : minimum(real_or(in.spinning_friction, i, 0), kHuge));
}

// ---- Joints ----

// A cone is one limit over two axes, the first of which has its row.
CAIRN_HD inline bool joint_has_cone(const JointColumns& in, std::size_t i) {
    return flags_of(in.rotation, i) == 2u && (in.axes.integer(i, 4) & 2);
}
// cairn_joints.axes of one axis; a limit without room is a lock.
CAIRN_HD inline std::uint32_t axis_flags(const JointColumns& in, std::size_t i, std::size_t axis) {
    const std::uint32_t flags = static_cast<std::uint32_t>(in.axes.integer(i, axis));
    if (axis >= 4 && joint_has_cone(in, i))
        return axis == 4 ? flags : 0;
    const bool pinned = (flags & 2u) && in.lower.real(i, axis) == in.upper.real(i, axis);
    return pinned ? 1u : flags;
}
CAIRN_HD inline std::uint32_t joint_rows(const JointColumns& in, std::size_t i) {
    std::uint32_t rows = 0;
    for (std::size_t axis = 0; axis < 6; ++axis) {
        const std::uint32_t flags = axis_flags(in, i, axis);
        rows += (flags & 3u ? 1u : 0u) + (flags & (4u | 8u) ? 1u : 0u);
    }
    return rows;
}
// By the axes as they were given: one whose limits leave no room is locked, but at an angle that its own coordinate measures.
CAIRN_HD inline Rotation joint_rotation(const JointColumns& in, std::size_t i) {
    int locked = 0, loose = 0;
    bool used = false;
    for (int axis = 0; axis < 3; ++axis) {
        const std::int64_t flags = in.axes.integer(i, static_cast<std::size_t>(3 + axis));
        used = used || flags != 0;
        if (flags == 1)
            ++locked;
        else
            loose = axis;
    }
    if (!used)
        return Rotation::none;
    if (const std::uint32_t wanted = flags_of(in.rotation, i); wanted != 0)
        return wanted == 1 ? Rotation::vector : Rotation::cone;
    if (locked == 3)
        return Rotation::locked;
    if (locked == 2)
        return loose == 0 ? Rotation::about_x : loose == 1 ? Rotation::about_y : Rotation::about_z;
    return Rotation::cardan;
}
CAIRN_HD inline bool joint_bounded(const JointColumns& in, std::size_t i) {
    for (std::size_t axis = 0; axis < 6; ++axis)
        if (axis_flags(in, i, axis) > 1u)
            return true;
    return real_or(in.max_force, i, kHuge) < kHuge;
}

template <class S>
CAIRN_HD void pack_joint(const BodyColumns& bodies, const JointColumns& in, std::size_t i, double h, const double* last, S* hot, S* cold) {
    struct Side {
        DVec position, arm;
        DQuat frame;
    };
    const auto side = [&](const Column& body, const Column& anchor, const Column& frame_column) {
        const std::int64_t b = body.integer(i);
        const DVec local = real3(anchor, i);
        const DQuat frame_q = quaternion(frame_column, i);
        if (b < 0)
            return Side{{0, 0, 0}, local, frame_q};
        const DQuat q = quaternion(bodies.orientation, static_cast<std::size_t>(b));
        return Side{real3(bodies.position, static_cast<std::size_t>(b)), rotate(q, local), normalized(q * frame_q)};
    };
    const Side a = side(in.body_a, in.anchor_a, in.frame_a), b = side(in.body_b, in.anchor_b, in.frame_b);
    const DVec gap = (b.position - a.position) + (b.arm - a.arm); // in double: small also far from the origin
    // The world's arm only serves to turn, which the world does not: zero keeps float exact far out.
    put3(field_at(cold, kStartArmA), kGroup, in.body_a.integer(i) < 0 ? DVec{0, 0, 0} : a.arm);
    put3(field_at(cold, kStartArmB), kGroup, in.body_b.integer(i) < 0 ? DVec{0, 0, 0} : b.arm);
    put3(field_at(cold, kStartGap), kGroup, gap);
    const auto put4 = [&](std::size_t f, const DQuat& q) {
        put3(field_at(cold, f), kGroup, vec(q));
        *field_at(cold, f + 3) = static_cast<S>(q.w);
    };
    put4(kStartFrameA, a.frame);
    put4(kStartFrameB, b.frame);
    const bool cone = joint_has_cone(in, i);
    for (std::size_t axis = 0; axis < 6; ++axis) {
        const std::uint32_t given = static_cast<std::uint32_t>(in.axes.integer(i, axis)), flags = axis_flags(in, i, axis);
        const bool has_range = (given & 2u) && !(cone && axis >= 4);
        const double low = has_range ? maximum(in.lower.real(i, axis), -kHuge) : 0;
        const double high = has_range ? minimum(in.upper.real(i, axis), kHuge) : 0;
        *field_at(cold, kIsLocked + axis) = flags & 1u ? S(1) : S(0);
        *field_at(cold, kIsLimited + axis) = flags & 2u ? S(1) : S(0);
        *field_at(cold, kIsDriven + axis) = flags & (4u | 8u) ? S(1) : S(0);
        *field_at(cold, kLowerLimit + axis) = static_cast<S>(low);
        *field_at(cold, kUpperLimit + axis) = static_cast<S>(high);
        *field_at(cold, kSpeed + axis) = static_cast<S>(flags & 4u ? clamp(in.motor_speed.real(i, axis), -kHuge, kHuge) : 0);
        *field_at(cold, kForce + axis) = static_cast<S>(flags & 4u ? minimum(in.motor_force.real(i, axis), kHuge) : 0);
        if (flags & (8u | 16u))
            *field_at(cold, kTarget + axis) = static_cast<S>(in.target.present() ? in.target.real(i, axis) : 0);
        if (flags & 16u) {
            const double yield = in.stiffness.present() ? in.stiffness.real(i, axis) : kHuge;
            const double rate = in.rate.present() ? in.rate.real(i, axis) : kHuge;
            *field_at(cold, kYield + axis) = static_cast<S>(minimum(yield, kHuge));
            *field_at(cold, kRate + axis) = static_cast<S>(clamp(rate, 1 / kHuge, kHuge));
        }
        if (flags & 8u) {
            *field_at(cold, kSpeed + axis) = static_cast<S>(in.damping.present() ? minimum(in.damping.real(i, axis), kHuge) : 0);
            *field_at(cold, kForce + axis) = static_cast<S>(minimum(in.stiffness.real(i, axis), kHuge));
            *field_at(cold, kRate + axis) = S(-1);
        }
    }
    *field_at(cold, kMostForce) = static_cast<S>(minimum(real_or(in.max_force, i, kHuge), kHuge));
    if (cone) { // one coordinate, >= 0 inside; the second axis' limits hold the half-angles' inverses
        *field_at(cold, kUpperLimit + 4) = static_cast<S>(kHuge);
        *field_at(cold, kLowerLimit + 5) = static_cast<S>(1 / minimum(in.upper.real(i, 4), kHuge));
        *field_at(cold, kUpperLimit + 5) = static_cast<S>(1 / minimum(in.upper.real(i, 5), kHuge));
    }
    if (last)
        for (std::size_t k = 0; k < 12; ++k)
            *field_at(hot, kJointLambda + k) = static_cast<S>(last[k] * h);
}

// ---- Raw rows ---- row r of a block that begins at row `first` of the table and has `count`.

template <class S>
CAIRN_HD void pack_row(const RowColumns& in, std::size_t first, std::uint32_t count, std::uint32_t r, double h, const double* last,
                       S* hot) {
    const std::size_t i = first + r;
    for (std::uint32_t c = 0; c < 6; ++c) {
        *field_at(hot, kJacobianA + c) = static_cast<S>(in.jacobian_a.real(i, c));
        *field_at(hot, kJacobianB + c) = static_cast<S>(in.jacobian_b.real(i, c));
    }
    *field_at(hot, kRhs) = static_cast<S>(real_or(in.rhs, i, 0));
    *field_at(hot, kRawLow) = static_cast<S>(maximum(real_or(in.lower, i, -kHuge), -kHuge));
    *field_at(hot, kRawHigh) = static_cast<S>(minimum(real_or(in.upper, i, kHuge), kHuge));
    *field_at(hot, kRawGamma) = static_cast<S>(real_or(in.compliance, i, 0));
    *field_at(hot, kRawFriction) = static_cast<S>(minimum(real_or(in.friction, i, 0), kHuge));
    const auto source_of = [&](std::size_t row) -> std::int64_t {
        return in.friction_index.present() ? in.friction_index.integer(row) : -1;
    };
    const std::int64_t source = source_of(i);
    *field_at(hot, kFrictionSource) = static_cast<S>(source < 0 ? -1 : source - static_cast<std::int64_t>(first));
    // two adjacent rows with one source share a disc
    const auto pairs_with_next = [&](std::size_t row, std::uint32_t place) {
        return source_of(row) >= 0 && place + 1 < count && source_of(row + 1) == source_of(row);
    };
    bool opens = false, closes = false;
    for (std::uint32_t p = 0; p <= r; ++p) {
        closes = opens;
        opens = !closes && pairs_with_next(first + p, p);
    }
    *field_at(hot, kPairFirst) = opens ? S(1) : S(0);
    *field_at(hot, kPairSecond) = closes ? S(1) : S(0);
    if (last)
        *field_at(hot, kRawLambda) = static_cast<S>(*last * h);
}

} // namespace CAIRN_ISA
} // namespace cairn
