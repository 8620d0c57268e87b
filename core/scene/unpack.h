// From the solver's layout back to one element of the caller's results and of the warm-start cache.
#pragma once
#include "pack.h"

namespace cairn {
inline namespace CAIRN_ISA {

template <class S> CAIRN_HD bool is_finite(const S* velocity, const S* displacement) {
    S sum = 0; // of differences: 0 unless one is infinite or not a number
    for (int c = 0; c < 8; ++c)
        sum += (velocity[c] - velocity[c]) + (displacement[c] - displacement[c]);
    return sum == 0;
}

CAIRN_HD inline void put_result(const MutableColumn& column, std::size_t i, const DVec& a, std::size_t at = 0) {
    column.set(i, at, a.x);
    column.set(i, at + 1, a.y);
    column.set(i, at + 2, a.z);
}

template <class S>
CAIRN_HD void write_body(const BodyColumns& in, const Output& output, std::size_t i, const S* velocity, const S* displacement) {
    if (output.linear_velocity.present())
        put_result(output.linear_velocity, i, get3(velocity, 1));
    if (output.angular_velocity.present())
        put_result(output.angular_velocity, i, get3(velocity + 4, 1));
    if (output.position.present())
        put_result(output.position, i, real3(in.position, i) + get3(displacement, 1));
    if (output.orientation.present()) {
        const DVec turn = get3(displacement + 4, 1);
        const DQuat q = normalized(DQuat{turn.x, turn.y, turn.z, static_cast<double>(displacement[7])} * quaternion(in.orientation, i));
        put_result(output.orientation, i, vec(q));
        output.orientation.set(i, 3, q.w);
    }
}

// Impulses lambda (three, kGroup apart) of a contact point along its tangents, as a world vector.
template <class S> CAIRN_HD DVec friction_vector(const S* hot, const S* lambda) {
    const DVec l = get3(lambda, kGroup);
    return get3(field_at(hot, kTangent1), kGroup) * l.y + get3(field_at(hot, kTangent2), kGroup) * l.z;
}
// extra: of points in special groups, else null
template <class S> CAIRN_HD void write_contact(const Output& output, std::size_t i, const S* hot, const S* cold, const S* extra) {
    const S* total = field_at(cold, kTotal);
    if (output.contact_impulse.present())
        output.contact_impulse.set(i, 0, static_cast<double>(*total));
    if (output.friction_impulse.present())
        put_result(output.friction_impulse, i, friction_vector(hot, total));
    if (output.torsion_impulse.present() && extra)
        put_result(output.torsion_impulse, i, get3(field_at(extra, kTorqueTotal), kGroup));
}
// Impulses along three directions (of `hot`), as a world vector.
template <class S> CAIRN_HD DVec impulse_along(const S* hot, std::uint32_t directions, const S* total) {
    DVec sum{0, 0, 0};
    for (std::uint32_t k = 0; k < 3; ++k)
        sum = sum + get3(field_at(hot, directions + 3 * k), kGroup) *
                        (static_cast<double>(total[k * kGroup]) + static_cast<double>(total[(k + 6) * kGroup]));
    return sum;
}
template <class S> CAIRN_HD void write_joint(const Output& output, std::size_t i, const S* hot, const S* cold) {
    const S* total = field_at(cold, kJointTotal);
    if (output.joint_impulse.present())
        for (std::size_t c = 0; c < 6; ++c)
            output.joint_impulse.set(i, c, static_cast<double>(total[c * kGroup]) + static_cast<double>(total[(c + 6) * kGroup]));
    if (output.joint_linear.present())
        put_result(output.joint_linear, i, impulse_along(hot, kLinear, total));
    if (output.joint_angular.present())
        put_result(output.joint_angular, i, impulse_along(hot, kAngular, total + 3 * kGroup));
}
template <class S> CAIRN_HD void write_row(const Output& output, std::size_t i, const S* hot) {
    if (output.row_impulse.present())
        output.row_impulse.set(i, 0, static_cast<double>(*field_at(hot, kRawTotal)));
}
// An element without effect gets zeros.
CAIRN_HD inline void clear_contact(const Output& output, std::size_t i) {
    if (output.contact_impulse.present())
        output.contact_impulse.set(i, 0, 0);
    if (output.friction_impulse.present())
        put_result(output.friction_impulse, i, {0, 0, 0});
    if (output.torsion_impulse.present())
        put_result(output.torsion_impulse, i, {0, 0, 0});
}
CAIRN_HD inline void clear_joint(const Output& output, std::size_t i) {
    if (output.joint_impulse.present())
        for (std::size_t c = 0; c < 6; ++c)
            output.joint_impulse.set(i, c, 0);
    if (output.joint_linear.present())
        put_result(output.joint_linear, i, {0, 0, 0});
    if (output.joint_angular.present())
        put_result(output.joint_angular, i, {0, 0, 0});
}
CAIRN_HD inline void clear_row(const Output& output, std::size_t i) {
    if (output.row_impulse.present())
        output.row_impulse.set(i, 0, 0);
}

// Impulses of the last substep / h, as the cache keeps them.
constexpr std::uint32_t kContactMemory = 4, kJointMemory = 12, kRowMemory = 1;
template <class S> CAIRN_HD void remember_contact(const S* hot, const S* cold, double per_h, double* values) {
    const S* kept = field_at(cold, kKept);
    const DVec friction = friction_vector(hot, kept);
    values[0] = static_cast<double>(*kept) * per_h;
    values[1] = friction.x * per_h;
    values[2] = friction.y * per_h;
    values[3] = friction.z * per_h;
}
template <class S> CAIRN_HD void remember_joint(const S* cold, double per_h, double* values) {
    for (std::size_t c = 0; c < kJointMemory; ++c)
        values[c] = static_cast<double>(*field_at(cold, kJointKept + c)) * per_h;
}
template <class S> CAIRN_HD void remember_row(const S* hot, double per_h, double* values) {
    *values = static_cast<double>(*field_at(hot, kRawKept)) * per_h;
}

} // namespace CAIRN_ISA
} // namespace cairn
