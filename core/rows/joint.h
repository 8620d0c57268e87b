// Joints: six axes, three of translation and three of rotation, each free, locked, limited, driven or sprung (paper eq. 10-17).
//
//   gap = x_b + r_b - x_a - r_a, in the axes d_i of a's frame:  C_i = d_i . gap,
//   J_i = [-d_i, -(a x d_i), d_i, b x d_i] with b = r_b and a = r_a + gap: both bodies get +-P at b's anchor, and J is exact,
//   turning axes included. Rotation by kind:
//   all locked: C = 2 vec(q_a^-1 q_b) with w >= 0, J_i = [0, -d_i, 0, d_i]
//   free about k (hinge): paper eq. 14: k_a . j_b for the two other axes j, and the angle 2 atan2(q_k, q_w) about k
//   Cardan angles of R = Rz Ry Rx: about b's x, the line of nodes and a's z
//   vector: C = theta u, the rotation vector, along d_i: exact along u
//   cone: q = swing twist; twist about x, J = (x_a + x_b) / (1 + x_a . x_b), and one limit for the swing vector s = theta u,
//   u in a's y-z plane: C = (1 - |(s_y / y, s_z / z)|) / |grad|, the distance to the ellipse to first order. Below.
//
// Motors: v = speed, |lambda| <= h force. Servos: speed = rate e within their speed, e = target - C at the substep's start, and
// force <= yield |e|. Springs, implicitly in h: v - k e / (c + h k) + lambda / (h (c + h k)) = 0, so that lambda / h = k e+ - c v+
// with e+ = e - h v+, the error that the substep ends with.
//
// Locked axes are one block: D dlambda = -(w + bias + gamma lambda) by LDL^T, gamma = diag(K_ii) / (h omega (2 zeta + h omega))
// with the unsplit K (paper eq. 22). Limited and driven axes follow one by one, their residuals brought up to date with D:
// each step lowers the same majoriser. max_force clips what the block gives, too, which is then no longer its minimum.
#pragma once
#include "bodies.h"
#include "soft.h"

namespace cairn {
inline namespace CAIRN_ISA {

struct JointGeometry {
    Vec3<Lane> linear[3], angular[3], a, b;
    Lane error[6]; // coordinates of the six axes, m and rad
};

CAIRN_HD inline Lane component(const Quat<Lane>& q, int k) { return k == 0 ? q.x : k == 1 ? q.y : q.z; }

// The swing vector's rate for a relative spin w is s' = (u . w) u - theta / sin(theta) ((u x d) . w) p, d = x_b and p = x_a x u:
// twisting about d leaves s alone, so the limit has no torque about d.
CAIRN_HD inline void measure_cone(const Quat<Lane>& q, const Axes<Lane>& a, const Vec3<Lane>& x_b, const Real* cold, JointGeometry& j) {
    const Lane zero = Lane(Real(0)), one = Lane(Real(1)), two = Lane(Real(2)), small = Lane(Real(1e-6));
    const Lane sign = select(q.w < zero, -one, one);
    const Lane half_sine = root(q.y * q.y + q.z * q.z), half_cosine = root(q.x * q.x + q.w * q.w); // of theta / 2
    j.error[3] = two * atan2_lane(q.x * sign, q.w * sign);
    j.angular[0] = (a.x + x_b) * (one / maximum(one + dot(a.x, x_b), small));

    // the swing's axis; where there is none any will do
    const auto swings = half_sine * half_cosine > zero;
    const Lane per = one / select(swings, half_sine * half_cosine, one);
    const Lane u_y = select(swings, (q.w * q.y - q.x * q.z) * per, one), u_z = select(swings, (q.w * q.z + q.x * q.y) * per, zero);
    const Lane theta = two * atan2_lane(half_sine, half_cosine);
    const Lane stretch = maximum(one, theta / maximum(two * half_sine * half_cosine, small)); // theta / sin(theta)
    const Lane y = load_as<Lane>(cold + (kLowerLimit + 5) * kGroup), z = load_as<Lane>(cold + (kUpperLimit + 5) * kGroup);
    const Lane along = root(u_y * u_y * y * y + u_z * u_z * z * z); // of the gradient
    const Lane across = u_y * u_z * (z * z - y * y) * inverse_or_zero(along);
    const Lane per_gradient = inverse_or_zero(root(along * along + across * across));
    const Vec3<Lane> u = a.y * u_y + a.z * u_z;
    j.error[4] = (one - theta * along) * per_gradient;
    j.angular[1] = (cross(u, x_b) * (across * stretch) - u * along) * per_gradient;
    j.angular[2] = x_b;
}

CAIRN_HD inline JointGeometry measure_joint(const Frame<Real>& f, const Group& g, std::size_t lane, const Real* cold) {
    const Pose<Lane> pa = gather_pose(f.displacement, f.lane_a + lane), pb = gather_pose(f.displacement, f.lane_b + lane);
    const Vec3<Lane> start_a = load3(cold + kStartArmA * kGroup), start_b = load3(cold + kStartArmB * kGroup);
    const Vec3<Lane> moved_a = turned_by(pa.turn, start_a), moved_b = turned_by(pb.turn, start_b);
    const Vec3<Lane> gap = load3(cold + kStartGap * kGroup) + ((pb.shift - pa.shift) + (moved_b - moved_a));
    const Quat<Lane> qa = pa.turn * load4(cold + kStartFrameA * kGroup), qb = pb.turn * load4(cold + kStartFrameB * kGroup);
    const Axes<Lane> axes_a = axes_of(qa);
    JointGeometry j;
    j.b = start_b + moved_b;
    j.a = start_a + moved_a + gap;
    j.linear[0] = axes_a.x;
    j.linear[1] = axes_a.y;
    j.linear[2] = axes_a.z;
    for (int i = 0; i < 3; ++i)
        j.error[i] = dot(j.linear[i], gap);

    const Lane zero = Lane(Real(0));
    for (int i = 0; i < 3; ++i) {
        j.angular[i] = j.linear[i];
        j.error[3 + i] = zero;
    }
    if (g.rotation == Rotation::none)
        return j;
    const Quat<Lane> q = conjugate(qa) * qb;
    if (g.rotation == Rotation::locked) {
        const Lane two = select(q.w < zero, Lane(Real(-2)), Lane(Real(2)));
        j.error[3] = q.x * two;
        j.error[4] = q.y * two;
        j.error[5] = q.z * two;
        return j;
    }
    if (g.rotation == Rotation::vector) {
        const Lane sign = select(q.w < zero, Lane(Real(-1)), Lane(Real(1))), sine = root(dot(vec(q), vec(q)));
        const Lane scale =
            select(sine > Lane(Real(1e-6)), Lane(Real(2)) * atan2_lane(sine, q.w * sign) * inverse_or_zero(sine), Lane(Real(2))) * sign;
        j.error[3] = q.x * scale;
        j.error[4] = q.y * scale;
        j.error[5] = q.z * scale;
        return j;
    }
    const Axes<Lane> axes_b = axes_of(qb);
    if (g.rotation == Rotation::cone) {
        measure_cone(q, axes_a, axes_b.x, cold, j);
        return j;
    }
    const Vec3<Lane> of_b[3] = {axes_b.x, axes_b.y, axes_b.z};
    if (g.rotation == Rotation::cardan) {
        const Vec3<Lane> x = axes_b.x, z = axes_a.z;
        const Vec3<Lane> nodes = normalized(cross(z, x));
        j.angular[0] = normalized(cross(nodes, z));
        j.angular[1] = nodes;
        j.angular[2] = normalized(cross(x, nodes));
        // R_ij = a_i . b_j; R20 = -sin y, R21 = cos y sin x, R22 = cos y cos x, R10 = cos y sin z, R00 = cos y cos z
        const Lane r00 = dot(axes_a.x, axes_b.x), r10 = dot(axes_a.y, axes_b.x), r20 = dot(axes_a.z, axes_b.x);
        j.error[3] = atan2_lane(dot(axes_a.z, axes_b.y), dot(axes_a.z, axes_b.z));
        j.error[4] = atan2_lane(-r20, root(r00 * r00 + r10 * r10));
        j.error[5] = atan2_lane(r10, r00);
        return j;
    }
    const int k = g.rotation == Rotation::about_x ? 0 : g.rotation == Rotation::about_y ? 1 : 2, j1 = (k + 1) % 3, j2 = (k + 2) % 3;
    const Vec3<Lane> axis = j.linear[k];
    j.error[3 + j1] = dot(axis, of_b[j2]);
    j.angular[j1] = cross(of_b[j2], axis);
    j.error[3 + j2] = -dot(axis, of_b[j1]);
    j.angular[j2] = cross(axis, of_b[j1]);
    const Lane sign = select(q.w < zero, Lane(Real(-1)), Lane(Real(1)));
    j.error[3 + k] = Lane(Real(2)) * atan2_lane(component(q, k) * sign, q.w * sign);
    return j;
}

// The six rows' arms: what turns a and b.
struct JointRows {
    Vec3<Lane> linear[6], turn_a[6], turn_b[6];
};
CAIRN_HD inline JointRows rows_of(const JointGeometry& j) {
    JointRows r;
    const Lane zero = Lane(Real(0));
    for (int i = 0; i < 3; ++i) {
        r.linear[i] = j.linear[i];
        r.turn_a[i] = cross(j.a, j.linear[i]);
        r.turn_b[i] = cross(j.b, j.linear[i]);
        r.linear[3 + i] = {zero, zero, zero};
        r.turn_a[3 + i] = r.turn_b[3 + i] = j.angular[i];
    }
    return r;
}

constexpr int triangle(int i, int j) { return i * (i + 1) / 2 + j; } // j <= i
constexpr int below(int i, int j) { return i * (i - 1) / 2 + j; }    // j < i

// D (lower triangle), diagonal of K and LDL^T of D's locked part; `added` goes onto the locked diagonal.
struct JointBlock {
    Lane d[21], k[6], factor[15], pivot[6];
};
CAIRN_HD inline JointBlock block_of(const Frame<Real>& f, std::size_t lane, const JointRows& r, const Lane (&locked)[6], Real compliance) {
    const Mass<Lane> ma = gather_mass(f, f.lane_a + lane), mb = gather_mass(f, f.lane_b + lane);
    JointBlock block;
    for (int j = 0; j < 6; ++j) {
        const Vec3<Lane> la = times(ma.linear, r.linear[j]), lb = times(mb.linear, r.linear[j]);
        const Vec3<Lane> ta = ma.angular * r.turn_a[j], tb = mb.angular * r.turn_b[j];
        for (int i = j; i < 6; ++i) {
            const Lane on_a = dot(r.linear[i], la) + dot(r.turn_a[i], ta), on_b = dot(r.linear[i], lb) + dot(r.turn_b[i], tb);
            block.d[triangle(i, j)] = ma.n * on_a + mb.n * on_b;
            if (i == j)
                block.k[i] = on_a + on_b;
        }
    }
    const Lane zero = Lane(Real(0));
    for (int i = 0; i < 6; ++i) {
        Lane scaled[6]; // L_ij d_j
        Lane pivot = block.d[triangle(i, i)] + block.k[i] * Lane(compliance);
        const Lane whole = pivot;
        for (int j = 0; j < i; ++j) {
            Lane sum = block.d[triangle(i, j)] * locked[i] * locked[j];
            for (int k = 0; k < j; ++k)
                sum = sum - scaled[k] * block.factor[below(j, k)];
            scaled[j] = sum;
            block.factor[below(i, j)] = sum * block.pivot[j];
            pivot = pivot - scaled[j] * block.factor[below(i, j)];
        }
        // a row that the others already hold, or that cannot move, takes no part
        const auto usable = (pivot > whole * Lane(Real(1e-6))) && (locked[i] > zero);
        block.pivot[i] = select(usable, Lane(Real(1)) / select(usable, pivot, Lane(Real(1))), zero);
    }
    return block;
}
// x = -D_LL^-1 w
CAIRN_HD inline void solve_block(const Lane* factor, const Lane* pivot, const Lane (&w)[6], Lane (&x)[6]) {
    for (int i = 0; i < 6; ++i) {
        x[i] = -w[i];
        for (int j = 0; j < i; ++j)
            x[i] = x[i] - factor[below(i, j)] * x[j];
    }
    for (int i = 0; i < 6; ++i)
        x[i] = x[i] * pivot[i];
    for (int i = 5; i >= 0; --i)
        for (int j = i + 1; j < 6; ++j)
            x[i] = x[i] - factor[below(j, i)] * x[j];
}

CAIRN_HD inline void load_six(const Real* field, Lane (&six)[6]) {
    for (std::uint32_t i = 0; i < 6; ++i)
        load(six[i], field + i * kGroup);
}

// Wrench of six impulses into the slots.
CAIRN_HD inline void scatter_joint(const Frame<Real>& f, std::size_t lane, const JointRows& r, const Lane (&p)[6]) {
    const Vec3<Lane> push = r.linear[0] * p[0] + r.linear[1] * p[1] + r.linear[2] * p[2];
    const Lane zero = Lane(Real(0));
    Vec3<Lane> turn_a{zero, zero, zero}, turn_b = turn_a;
    for (int i = 0; i < 6; ++i) {
        turn_a = turn_a + r.turn_a[i] * p[i];
        turn_b = turn_b + r.turn_b[i] * p[i];
    }
    scatter_impulse(f, lane, -push, -turn_a, push, turn_b);
}

// The motor, servo or spring of axis i at coordinate c. Later phases go on with the substep's: what it is to reach has not changed.
CAIRN_HD inline void build_drive(const Frame<Real>& f, const Real* cold, std::uint32_t i, const Lane& c, const Lane& most, Real* hot) {
    if (f.phase != Phase::substep)
        return;
    const Lane zero = Lane(Real(0)), one = Lane(Real(1)), h = Lane(f.h);
    const Lane speed = load_as<Lane>(cold + (kSpeed + i) * kGroup), force = load_as<Lane>(cold + (kForce + i) * kGroup);
    const Lane rate = load_as<Lane>(cold + (kRate + i) * kGroup), error = load_as<Lane>(cold + (kTarget + i) * kGroup) - c;
    const auto spring = rate<zero, servo = rate> zero;
    // a servo turns the shorter way
    const Lane pi = of<Lane>(3.14159265358979323846), turn = i < 3 ? zero : pi + pi;
    const Lane nearest = i < 3 ? error : select(error > pi, error - turn, select(error < -pi, error + turn, error));
    const Lane wanted = clamp(minimum(rate, one / h) * nearest, -speed, speed);
    const Lane yield = load_as<Lane>(cold + (kYield + i) * kGroup), huge = Lane(Real(1e30));
    const Lane most_force = select(servo && yield < huge, minimum(force, yield * absolute(nearest)), force);
    const Lane share = inverse_or_zero(speed + h * force, of<Lane>(1e-30)); // 1 / (c + h k)
    const Lane none = select(share > zero, zero, huge);                     // a spring without stiffness or damping
    store(select(spring, force * share * error, select(servo, wanted, speed)), hot + (kMotorSpeed + i) * kGroup);
    store(minimum(select(spring, most, most_force * h), most), hot + (kMotorBound + i) * kGroup);
    store(select(spring, share / h + none, zero), hot + (kMotorGamma + i) * kGroup);
}

CAIRN_HD inline void build_joints(const Frame<Real>& f, const Group& g, std::size_t lane, std::uint32_t sub) {
    Real* hot = fields_of(f.joint, kJointFields, g, 0, sub);
    Real* cold = fields_of(f.joint_cold, kJointColdFields, g, 0, sub);
    const JointGeometry j = measure_joint(f, g, lane, cold);
    const JointRows rows = rows_of(j);
    const Lane zero = Lane(Real(0)), h = Lane(f.h);
    Lane locked[6], limited[6], driven[6];
    load_six(cold + kIsLocked * kGroup, locked);
    load_six(cold + kIsLimited * kGroup, limited);
    load_six(cold + kIsDriven * kGroup, driven);
    const bool soft = f.soft && f.phase == Phase::substep, biased = f.phase == Phase::substep && !f.unbiased;
    const Real compliance = soft ? soft_compliance(f.joint_omega, f.joint_zeta, f.h) : Real(0);
    const Lane rate = Lane(!biased  ? Real(0)
                           : f.soft ? soft_rate(f.joint_omega, f.joint_zeta, f.h)
                                    : baumgarte_rate(f.joint_baumgarte, f.h));
    const JointBlock block = block_of(f, lane, rows, locked, compliance);
    const Lane most = load_as<Lane>(cold + kMostForce * kGroup) * h;

    for (int i = 0; i < 3; ++i) {
        store3(j.linear[i], hot + (kLinear + 3 * i) * kGroup);
        store3(j.angular[i], hot + (kAngular + 3 * i) * kGroup);
    }
    store3(j.a, hot + kJointArmA * kGroup);
    store3(j.b, hot + kJointArmB * kGroup);
    for (std::uint32_t i = 0; i < 15; ++i)
        store(block.factor[i], hot + (kFactor + i) * kGroup);
    for (std::uint32_t i = 0; i < 6; ++i) {
        const Lane low = load_as<Lane>(cold + (kLowerLimit + i) * kGroup), high = load_as<Lane>(cold + (kUpperLimit + i) * kGroup);
        // the nearer limit is the one that may act; a locked axis has low = high = the value it is locked at
        const Lane past_low = j.error[i] - low, past_high = j.error[i] - high;
        // later phases go on with the limit that has acted
        const auto nearer = past_low < -past_high;
        const Lane held = load_as<Lane>(hot + (kJointLambda + 12 * f.current + i) * kGroup);
        const auto lower = f.phase == Phase::substep ? nearer : held > zero || (nearer && !(held < zero));
        const Lane c = select(lower, past_low, past_high);
        const auto apart = (limited[i] > zero) && select(lower, c, -c) > zero;
        store(select(apart, c / h, c * rate), hot + (kJointBias + i) * kGroup);
        const Lane gamma = select(apart, zero, block.k[i] * Lane(compliance));
        store(gamma, hot + (kJointGamma + i) * kGroup);
        store(block.pivot[i], hot + (kPivot + i) * kGroup);
        if (!g.bounded)
            continue;
        const Lane d = block.d[triangle(static_cast<int>(i), static_cast<int>(i))], huge = Lane(Real(1e30));
        store(inverse_or_zero(d + gamma) * limited[i], hot + (kInverseD + i) * kGroup);
        Lane low_bound = select(lower && !(locked[i] > zero), zero, -most), high_bound = select(lower || locked[i] > zero, most, zero);
        // what is clipped is a force, and remains it when later phases take the bias out
        const auto clipped = !(absolute(held) < (f.phase == Phase::substep ? Lane(Real(1e30)) : most));
        low_bound = select(clipped, held, low_bound);
        high_bound = select(clipped, held, high_bound);
        store(low_bound, hot + (kLow + i) * kGroup);
        store(high_bound, hot + (kHigh + i) * kGroup);
        build_drive(f, cold, i, j.error[i], most, hot);
        const Lane stiff = load_as<Lane>(hot + (kMotorGamma + i) * kGroup);
        store(select(stiff < huge, inverse_or_zero(d + stiff), zero) * driven[i], hot + (kMotorInverse + i) * kGroup);
    }
    if (g.bounded)
        for (std::uint32_t i = 0; i < 21; ++i)
            store(block.d[i], hot + (kBlock + i) * kGroup);

    const Lane takes_part = f.phase == Phase::restitution ? island_bounces(f, lane) : zero;
    Lane impulse[6] = {zero, zero, zero, zero, zero, zero};
    for (std::uint32_t i = 0; i < 12; ++i) {
        const std::uint32_t axis = i % 6;
        Lane start = load_as<Lane>(hot + (kJointLambda + 12 * f.current + i) * kGroup);
        if (f.phase == Phase::substep) {
            start = start * Lane(f.warm ? f.joint_warm : Real(0));
            if (g.bounded) {
                const Lane low = i < 6 ? load_as<Lane>(hot + (kLow + axis) * kGroup) : -load_as<Lane>(hot + (kMotorBound + axis) * kGroup);
                const Lane high = i < 6 ? load_as<Lane>(hot + (kHigh + axis) * kGroup) : load_as<Lane>(hot + (kMotorBound + axis) * kGroup);
                const Lane on = i < 6 ? limited[axis] : driven[axis];
                start = select(on > zero, clamp(start, low, high), i < 6 ? clamp(start * locked[axis], -most, most) : zero);
            } else { // what an axis that is now free, or a motor that is gone, did last time ends
                start = i < 6 ? start * locked[axis] : zero;
            }
        }
        store(start, hot + (kJointLambda + i) * kGroup);
        store(start, hot + (kJointLambda + 12 + i) * kGroup);
        if (f.phase == Phase::restitution) {
            Real* total = cold + (kJointTotal + i) * kGroup;
            store(add_to_total(f, takes_part, load_as<Lane>(total), -start), total);
        }
        impulse[axis] = impulse[axis] + start;
    }
    if (f.warm && f.phase == Phase::substep)
        scatter_joint(f, lane, rows, impulse);
}

template <bool kBounded, bool kReduces>
CAIRN_HD void sweep_joints_of(const Frame<Real>& f, const Group& g, std::size_t lane, std::uint32_t sub) {
    const Lane zero = Lane(Real(0));
    Real* hot = fields_of(f.joint, kJointFields, g, 0, sub);
    const Motion<Lane> va = gather_motion(f.velocity, f.lane_a + lane), vb = gather_motion(f.velocity, f.lane_b + lane);
    const Lane beta = maximum(va.beta, vb.beta);
    const auto active = maximum(va.active, vb.active) > zero;
    JointGeometry j;
    for (std::uint32_t i = 0; i < 3; ++i) {
        j.linear[i] = load3(hot + (kLinear + 3 * i) * kGroup);
        j.angular[i] = load3(hot + (kAngular + 3 * i) * kGroup);
    }
    j.a = load3(hot + kJointArmA * kGroup);
    j.b = load3(hot + kJointArmB * kGroup);
    const JointRows rows = rows_of(j);
    const Vec3<Lane> slide = (vb.linear + cross(vb.angular, j.b)) - (va.linear + cross(va.angular, j.a)), spin = vb.angular - va.angular;
    const std::uint32_t now = kJointLambda + 12 * f.current, before = kJointLambda + 12 * (1 - f.current);

    Lane x[12], y[12], speed[6], w[6], step[6], factor[15], pivot[6];
    for (std::uint32_t i = 0; i < (kBounded ? 12u : 6u); ++i) {
        load(x[i], hot + (now + i) * kGroup);
        y[i] = kReduces ? x[i] + beta * (x[i] - load_as<Lane>(hot + (before + i) * kGroup)) : x[i];
    }
    for (std::uint32_t i = 0; i < 6; ++i) {
        speed[i] = i < 3 ? dot(j.linear[i], slide) : dot(j.angular[i - 3], spin);
        w[i] = speed[i] + load_as<Lane>(hot + (kJointBias + i) * kGroup) + load_as<Lane>(hot + (kJointGamma + i) * kGroup) * y[i];
    }
    for (std::uint32_t i = 0; i < 15; ++i)
        load(factor[i], hot + (kFactor + i) * kGroup);
    load_six(hot + kPivot * kGroup, pivot);
    solve_block(factor, pivot, w, step);

    // step: change from y, which the residuals follow; gain: from x, which the bodies get
    Lane restart = zero, residual = zero, gain[6];
    for (std::uint32_t i = 0; i < 6; ++i) {
        Lane next = y[i] + step[i];
        if constexpr (kBounded) {
            const Lane clipped = clamp(next, load_as<Lane>(hot + (kLow + i) * kGroup), load_as<Lane>(hot + (kHigh + i) * kGroup));
            const auto beyond = (pivot[i] > zero) && !(clipped == next);
            next = select(beyond, clipped, next);
            step[i] = select(beyond, next - y[i], step[i]);
        }
        if constexpr (kReduces) {
            next = select(active, next, x[i]);
            step[i] = next - y[i];
            // D (x+ - y) = -w on the locked block
            const auto locked = pivot[i] > zero;
            restart = restart + select(locked, w[i] * (next - x[i]), zero);
            residual = residual - select(locked, w[i] * step[i], zero);
        }
        gain[i] = next - x[i];
        store(next, hot + (before + i) * kGroup);
    }
    residual = maximum(zero, residual); // rounding can take a small one below
    if constexpr (kBounded) {
        Lane d[21];
        for (std::uint32_t i = 0; i < 21; ++i)
            load(d[i], hot + (kBlock + i) * kGroup);
        // limits, then motors; `step` holds the change of each axis so far
        for (std::uint32_t m = 0; m < 12; ++m) {
            const std::uint32_t i = m % 6;
            const bool motor = m >= 6;
            Lane change = speed[i];
            for (std::uint32_t k = 0; k < 6; ++k)
                change = change + d[triangle(static_cast<int>(k > i ? k : i), static_cast<int>(k > i ? i : k))] * step[k];
            const Lane bound = load_as<Lane>(hot + (kMotorBound + i) * kGroup);
            const Lane low = motor ? -bound : load_as<Lane>(hot + (kLow + i) * kGroup),
                       high = motor ? bound : load_as<Lane>(hot + (kHigh + i) * kGroup);
            const Lane inverse = load_as<Lane>(hot + ((motor ? kMotorInverse : kInverseD) + i) * kGroup);
            const Lane target =
                motor ? load_as<Lane>(hot + (kMotorGamma + i) * kGroup) * y[m] - load_as<Lane>(hot + (kMotorSpeed + i) * kGroup)
                      : load_as<Lane>(hot + (kJointBias + i) * kGroup) + load_as<Lane>(hot + (kJointGamma + i) * kGroup) * y[i];
            const auto on = inverse > zero;
            Lane next = select(on, clamp(y[m] - (change + target) * inverse, low, high), motor ? zero : y[i] + step[i]);
            if constexpr (kReduces)
                next = select(active, next, x[m]);
            const Lane change_of_axis = select(on, next - y[m], zero);
            step[i] = step[i] + change_of_axis;
            gain[i] = motor ? gain[i] + (next - x[m]) : next - x[m];
            store(next, hot + (before + m) * kGroup);
            if constexpr (kReduces) {
                const Lane diagonal = change_of_axis / select(on, inverse, Lane(Real(1)));
                restart = restart - diagonal * (next - x[m]);
                residual = residual + diagonal * change_of_axis;
            }
        }
    }
    scatter_joint(f, lane, rows, gain);
    if constexpr (kReduces)
        store_partials(f, lane, restart, residual);
}
CAIRN_HD inline void sweep_joints(const Frame<Real>& f, const Group& g, std::size_t lane, std::uint32_t sub) {
    if (g.bounded)
        return f.reduces ? sweep_joints_of<true, true>(f, g, lane, sub) : sweep_joints_of<true, false>(f, g, lane, sub);
    f.reduces ? sweep_joints_of<false, true>(f, g, lane, sub) : sweep_joints_of<false, false>(f, g, lane, sub);
}

// Nonlinear Jacobi on the locked axes and on limits that are passed.
CAIRN_HD inline void position_joints(const Frame<Real>& f, const Group& g, std::size_t lane, std::uint32_t sub) {
    const Real* cold = fields_of(f.joint_cold, kJointColdFields, g, 0, sub);
    const JointGeometry j = measure_joint(f, g, lane, cold);
    const JointRows rows = rows_of(j);
    const Lane zero = Lane(Real(0));
    Lane locked[6], limited[6], error[6], step[6];
    load_six(cold + kIsLocked * kGroup, locked);
    load_six(cold + kIsLimited * kGroup, limited);
    const JointBlock block = block_of(f, lane, rows, locked, Real(0));
    for (std::uint32_t i = 0; i < 6; ++i)
        error[i] = j.error[i] - load_as<Lane>(cold + (kLowerLimit + i) * kGroup);
    solve_block(block.factor, block.pivot, error, step);
    if (g.bounded) {
        for (std::uint32_t i = 0; i < 6; ++i) {
            const Lane low = error[i], high = j.error[i] - load_as<Lane>(cold + (kUpperLimit + i) * kGroup);
            Lane moved = zero;
            for (std::uint32_t k = 0; k < 6; ++k)
                moved = moved + block.d[triangle(static_cast<int>(k > i ? k : i), static_cast<int>(k > i ? i : k))] * step[k];
            const Lane passed = minimum(low + moved, zero) + maximum(high + moved, zero);
            step[i] =
                select(limited[i] > zero, -passed * inverse_or_zero(block.d[triangle(static_cast<int>(i), static_cast<int>(i))]), step[i]);
        }
    }
    scatter_joint(f, lane, rows, step);
}

CAIRN_HD inline void accumulate_joints(const Frame<Real>& f, const Group& g, std::size_t lane, std::uint32_t sub) {
    const Lane takes_part = f.phase == Phase::restitution ? island_bounces(f, lane) : Lane(Real(0));
    const Real* lambda = fields_of(f.joint, kJointFields, g, 0, sub) + (kJointLambda + 12 * f.current) * kGroup;
    Real* total = fields_of(f.joint_cold, kJointColdFields, g, 0, sub) + kJointTotal * kGroup;
    for (std::uint32_t i = 0; i < 12; ++i)
        store(add_to_total(f, takes_part, load_as<Lane>(total + i * kGroup), load_as<Lane>(lambda + i * kGroup)), total + i * kGroup);
}

CAIRN_HD inline void keep_joints(const Frame<Real>& f, const Group& g, std::uint32_t sub) {
    const Real* lambda = fields_of(f.joint, kJointFields, g, 0, sub) + (kJointLambda + 12 * f.current) * kGroup;
    Real* kept = fields_of(f.joint_cold, kJointColdFields, g, 0, sub) + kJointKept * kGroup;
    for (std::uint32_t i = 0; i < 12; ++i)
        store(load_as<Lane>(lambda + i * kGroup), kept + i * kGroup);
}

} // namespace CAIRN_ISA
} // namespace cairn
