// Contact points: non-penetration and Coulomb friction (paper eq. 6-9).
//
//   C = n . (x_b + r_b - x_a - r_a) >= 0,   J_n = [-n, -(a x n), n, b x n],   J_t likewise with t1, t2
//
// a and b are the arms to one common point, half way between the two surfaces: both bodies get +-P there, so that angular
// momentum is conserved. n and the arms stay those of the step's start; C follows the bodies' displacements.
//
// A point is solved as a block with its split mass matrix D (paper eq. 19), never as a 3x3 solve that is clamped afterwards:
//   lambda_n+ = max(0, lambda_n - (w_n + bias + gamma lambda_n) / (D_nn + gamma))
//   lambda_t+ = disc of radius mu lambda_n+ around 0 of (lambda_t - (w_t + D_tn dlambda_n) / sigma),  sigma = lambda_max(D_tt)
// Each line lowers the majoriser of the energy, so a sweep cannot overshoot.
//
// A point may have coefficients s1, s2 <= 1 that scale its friction along the two tangents: |(lambda_1/s1, lambda_2/s2)| <= mu
// lambda_n. Then t1 and t2 are stored s1 and s2 long, which makes the ellipse a disc again.
//
// Points of special groups may have, too: a target u* for the slip (w_t = t . (u - u*)); a spring and damper of their own in place
// of the method's bias (soft.h); and friction of rotation, with w = w_b - w_a and the angular impulse tau on b:
//   spinning  |n . tau| <= mu_s lambda_n,   rolling  |tau - n (n . tau)| <= mu_r lambda_n,   each opposing w on its own
// after the point's other rows, by the same rule with K = n_a I_a^-1 + n_b I_b^-1 as the split mass matrix.
#pragma once
#include "bodies.h"
#include "soft.h"

namespace cairn {
inline namespace CAIRN_ISA {

// Separation of a point at the bodies' present poses.
CAIRN_HD inline Lane separation_of(const Real* cold, const Vec3<Lane>& n, const Pose<Lane>& pa, const Pose<Lane>& pb) {
    const Vec3<Lane> anchor_a = turned_by(pa.turn, load3(cold + kAnchorA * kGroup)) * load_as<Lane>(cold + kTurnsA * kGroup);
    const Vec3<Lane> anchor_b = turned_by(pb.turn, load3(cold + kAnchorB * kGroup)) * load_as<Lane>(cold + kTurnsB * kGroup);
    return load_as<Lane>(cold + kSeparation * kGroup) + dot(n, (pb.shift - pa.shift) + (anchor_b - anchor_a));
}

struct PointGeometry {
    Vec3<Lane> n, t1, t2, a, b;
};
CAIRN_HD inline PointGeometry load_point(const Real* hot) {
    return {load3(hot + kNormal * kGroup), load3(hot + kTangent1 * kGroup), load3(hot + kTangent2 * kGroup), load3(hot + kArmA * kGroup),
            load3(hot + kArmB * kGroup)};
}
CAIRN_HD inline Vec3<Lane> slip(const PointGeometry& p, const Motion<Lane>& a, const Motion<Lane>& b) {
    return (b.linear + cross(b.angular, p.b)) - (a.linear + cross(a.angular, p.a));
}

// Approach speeds before external forces, where the point is to bounce: e (n . u), negative; else 0.
CAIRN_HD inline void approach_contacts(const Frame<Real>& f, const Group& g, std::size_t lane, std::uint32_t sub) {
    const Motion<Lane> va = gather_motion(f.velocity, f.lane_a + lane), vb = gather_motion(f.velocity, f.lane_b + lane);
    Lane bounces = Lane(Real(0));
    for (std::uint32_t p = 0; p < g.count; ++p) {
        const Real* hot = fields_of(f.contact, kContactFields, g, p, sub);
        Real* cold = fields_of(f.contact_cold, kContactColdFields, g, p, sub);
        const PointGeometry point = load_point(hot);
        const Lane speed = dot(point.n, slip(point, va, vb));
        const Lane target =
            select(speed < Lane(-f.restitution_threshold), load_as<Lane>(cold + kRestitution * kGroup) * speed, Lane(Real(0)));
        store(target, cold + kApproach * kGroup);
        bounces = bounces - target;
    }
    store_partials(f, lane, Lane(Real(0)), bounces);
}

CAIRN_HD inline void add_to_totals(const Frame<Real>& f, const Lane& takes_part, const Vec3<Lane>& change, Real* total) {
    const Vec3<Lane> t = load3(total);
    store3({add_to_total(f, takes_part, t.x, change.x), add_to_total(f, takes_part, t.y, change.y),
            add_to_total(f, takes_part, t.z, change.z)},
           total);
}

// Rows of rolling and spinning friction; returns the angular impulse that the sweeps start from.
CAIRN_HD inline Vec3<Lane> build_torsion(const Frame<Real>& f, const Vec3<Lane>& n, const Mass<Lane>& ma, const Mass<Lane>& mb,
                                         const Lane& takes_part, Real* extra) {
    const Sym3<Lane> k = split_mass(ma).angular + split_mass(mb).angular;
    const Lane spin = dot(n, k * n), roll = largest_across(k, n);
    store(spin, extra + kDSpin * kGroup);
    store(roll, extra + kDRoll * kGroup);
    store(inverse_or_zero(spin), extra + kInverseSpin * kGroup);
    store(inverse_or_zero(roll), extra + kInverseRoll * kGroup);
    Vec3<Lane> start = load3(extra + (kTorque + 3 * f.current) * kGroup);
    if (f.phase == Phase::substep)
        start = start * Lane(f.warm ? f.contact_warm : Real(0));
    store3(start, extra + kTorque * kGroup);
    store3(start, extra + (kTorque + 3) * kGroup);
    if (f.phase == Phase::restitution)
        add_to_totals(f, takes_part, -start, extra + kTorqueTotal * kGroup);
    return start;
}

// Rows of the substep: D, bias, gamma; and the impulse that the sweeps start from.
CAIRN_HD inline void build_contacts(const Frame<Real>& f, const Group& g, std::size_t lane, std::uint32_t sub) {
    const Lane zero = Lane(Real(0)), h = Lane(f.h);
    const Pose<Lane> pa = gather_pose(f.displacement, f.lane_a + lane), pb = gather_pose(f.displacement, f.lane_b + lane);
    const Mass<Lane> ma = gather_mass(f, f.lane_a + lane), mb = gather_mass(f, f.lane_b + lane);
    const Lane omega = select(load_as<Lane>(f.lane_static + lane) > zero, Lane(f.contact_omega_static), Lane(f.contact_omega));
    const Lane zeta = Lane(f.contact_zeta);
    const Lane rate = f.soft ? soft_rate(omega, zeta, h) : baumgarte_rate(Lane(f.contact_baumgarte), h);
    const Lane compliance = soft_compliance(omega, zeta, h);
    const bool rigid = !f.soft || f.phase != Phase::substep;
    const Lane takes_part = f.phase == Phase::restitution ? island_bounces(f, lane) : zero;
    Vec3<Lane> push{zero, zero, zero}, turn_a = push, turn_b = push;
    for (std::uint32_t p = 0; p < g.count; ++p) {
        Real* hot = fields_of(f.contact, kContactFields, g, p, sub);
        Real* cold = fields_of(f.contact_cold, kContactColdFields, g, p, sub);
        Real* extra = g.special() ? fields_of(f.contact_extra, kContactExtraFields, g, p, sub) : nullptr;
        const PointGeometry q = load_point(hot);
        const Vec3<Lane> an = cross(q.a, q.n), bn = cross(q.b, q.n);
        const Lane ka = ma.between(q.n, an, q.n, an), kb = mb.between(q.n, bn, q.n, bn);
        Lane dnn = ma.n * ka + mb.n * kb;

        const Lane c = separation_of(cold, q.n, pa, pb);
        const auto apart = c > zero;
        Lane bias = zero, gamma = zero;
        if (f.phase == Phase::substep) {
            if (!f.unbiased)
                bias = maximum(c * rate, Lane(-f.push_speed));
            if (!rigid)
                gamma = select(apart, zero, (ka + kb) * compliance);
        }
        bias = select(apart, c / h, bias);
        if (f.phase == Phase::restitution) {
            const Lane target = load_as<Lane>(cold + kApproach * kGroup), total = load_as<Lane>(cold + kTotal * kGroup);
            const auto bounces = (target < zero) && (total > zero);
            bias = select(bounces, target, bias);
            // Bodies that have not met yet keep their speed for the next step: braked now, they would never bounce.
            bias = select(apart && (total <= zero), Lane(Real(1e18)), bias);
        }
        if (g.special()) {
            const Lane softness = load_as<Lane>(extra + kSpringGamma * kGroup);
            const auto springs = softness > zero;
            if (f.phase == Phase::substep) {
                bias = select(springs && !apart, c * load_as<Lane>(extra + kSpringRate * kGroup), bias);
                gamma = select(springs, softness, gamma);
            } else { // what a spring pushes is settled by its deformation: only friction goes on
                bias = select(springs, zero, bias);
                gamma = select(springs, zero, gamma);
                dnn = select(springs, zero, dnn);
            }
        }
        store(bias, hot + kBias * kGroup);
        store(gamma, hot + kGamma * kGroup);
        store(dnn + gamma, hot + kDnn * kGroup);
        store(inverse_or_zero(dnn + gamma), hot + kInverseN * kGroup);
        if (g.contact != ContactKind::smooth) {
            const Vec3<Lane> a1 = cross(q.a, q.t1), a2 = cross(q.a, q.t2), b1 = cross(q.b, q.t1), b2 = cross(q.b, q.t2);
            const Lane d11 = ma.n * ma.between(q.t1, a1, q.t1, a1) + mb.n * mb.between(q.t1, b1, q.t1, b1);
            const Lane d22 = ma.n * ma.between(q.t2, a2, q.t2, a2) + mb.n * mb.between(q.t2, b2, q.t2, b2);
            const Lane d12 = ma.n * ma.between(q.t1, a1, q.t2, a2) + mb.n * mb.between(q.t1, b1, q.t2, b2);
            store(ma.n * ma.between(q.t1, a1, q.n, an) + mb.n * mb.between(q.t1, b1, q.n, bn), hot + kDn1 * kGroup);
            store(ma.n * ma.between(q.t2, a2, q.n, an) + mb.n * mb.between(q.t2, b2, q.n, bn), hot + kDn2 * kGroup);
            const Lane half = (d11 - d22) * Lane(Real(0.5));
            const Lane sigma = (d11 + d22) * Lane(Real(0.5)) + root(half * half + d12 * d12);
            const Lane dt1 = f.pyramid ? d11 : sigma, dt2 = f.pyramid ? d22 : sigma;
            store(dt1, hot + kDt1 * kGroup);
            store(dt2, hot + kDt2 * kGroup);
            store(inverse_or_zero(dt1), hot + kInverseT1 * kGroup);
            store(inverse_or_zero(dt2), hot + kInverseT2 * kGroup);
            store(d12, hot + kDt12 * kGroup);
        }

        // both buffers of lambda hold the start; in later phases the sweeps go on from where they were
        Vec3<Lane> start = load3(hot + (kLambda + 3 * f.current) * kGroup);
        if (f.phase == Phase::substep)
            start = start * Lane(f.warm ? f.contact_warm : Real(0));
        if (f.phase == Phase::substep && f.warm) { // also where friction has just ceased: its impulse then ends
            const Lane bound = load_as<Lane>(hot + kFriction * kGroup) * start.x, size = root(start.y * start.y + start.z * start.z);
            const Lane scale = select(size > bound, bound * inverse_or_zero(size), Lane(Real(1)));
            start.y = start.y * scale;
            start.z = start.z * scale;
        }
        store3(start, hot + kLambda * kGroup);
        store3(start, hot + (kLambda + 3) * kGroup);
        if (f.phase == Phase::restitution)
            add_to_totals(f, takes_part, -start, cold + kTotal * kGroup);
        const Vec3<Lane> impulse = q.n * start.x + q.t1 * start.y + q.t2 * start.z;
        push = push + impulse;
        turn_a = turn_a + cross(q.a, impulse);
        turn_b = turn_b + cross(q.b, impulse);
        if (g.contact == ContactKind::torsional) {
            const Vec3<Lane> torque = build_torsion(f, q.n, ma, mb, takes_part, extra);
            turn_a = turn_a + torque;
            turn_b = turn_b + torque;
        }
    }
    if (f.warm && f.phase == Phase::substep)
        scatter_impulse(f, lane, -push, -turn_a, push, turn_b);
}

// New friction impulse from the old one y and its residual w. The pyramid takes the second row after the first.
CAIRN_HD inline void step_pyramid(const Real* hot, const Lane& bound, const Lane& y1, const Lane& y2, const Lane& w1, const Lane& w2,
                                  Lane& l1, Lane& l2) {
    l1 = clamp(y1 - w1 * load_as<Lane>(hot + kInverseT1 * kGroup), -bound, bound);
    const Lane w = w2 + load_as<Lane>(hot + kDt12 * kGroup) * (l1 - y1);
    l2 = clamp(y2 - w * load_as<Lane>(hot + kInverseT2 * kGroup), -bound, bound);
}
CAIRN_HD inline void step_cone(const Real* hot, const Lane& bound, const Lane& y1, const Lane& y2, const Lane& w1, const Lane& w2, Lane& l1,
                               Lane& l2) {
    l1 = y1 - w1 * load_as<Lane>(hot + kInverseT1 * kGroup);
    l2 = y2 - w2 * load_as<Lane>(hot + kInverseT2 * kGroup);
    const Lane size = l1 * l1 + l2 * l2;
    const auto outside = size > bound * bound;
    const Lane scale = select(outside, bound / root(select(outside, size, Lane(Real(1)))), Lane(Real(1)));
    l1 = l1 * scale;
    l2 = l2 * scale;
}

// New angular impulse of rolling and spinning friction from the old one y, where `speed` is the bodies' relative angular velocity and
// `k` the split mass matrix. Rolling goes after spinning.
CAIRN_HD inline Vec3<Lane> step_torsion(const Real* extra, const Vec3<Lane>& n, const Lane& ln, const Vec3<Lane>& y,
                                        const Vec3<Lane>& speed, const Sym3<Lane>& k) {
    const Lane yn = dot(n, y), spinning = load_as<Lane>(extra + kSpinningBound * kGroup) * ln;
    const Lane spin = clamp(yn - dot(n, speed) * load_as<Lane>(extra + kInverseSpin * kGroup), -spinning, spinning);
    const Vec3<Lane> later = speed + k * (n * (spin - yn));
    const Vec3<Lane> rate = later - n * dot(n, later);
    const Vec3<Lane> roll = (y - n * yn) - rate * load_as<Lane>(extra + kInverseRoll * kGroup);
    const Lane bound = load_as<Lane>(extra + kRollingBound * kGroup) * ln, size = dot(roll, roll), one = Lane(Real(1));
    const auto outside = size > bound * bound;
    return n * spin + roll * select(outside, bound / root(select(outside, size, one)), one);
}

// One sweep over the manifolds of a group. Point blocks all see the velocities of the sweep's start; a manifold block is one
// inner Gauss-Seidel sweep on local velocities that move with the split mass n M^-1 (with the whole mass it would oscillate);
// D_tn carries the normal's change to the tangents in both. Of special groups there is one instance for all: they are rare, and
// on a GPU each would lie in every kernel that sweeps.
template <bool kManifold, ContactKind kKind, bool kPyramid, bool kReduces>
CAIRN_HD void sweep_contacts(const Frame<Real>& f, const Group& g, std::size_t lane, std::uint32_t sub) {
    constexpr bool kFrictional = kKind != ContactKind::smooth, kSpecial = kKind == ContactKind::special;
    const Lane zero = Lane(Real(0));
    Motion<Lane> va = gather_motion(f.velocity, f.lane_a + lane), vb = gather_motion(f.velocity, f.lane_b + lane);
    const Lane beta = maximum(va.beta, vb.beta);
    const auto active = maximum(va.active, vb.active) > zero;
    Mass<Lane> ma, mb;
    if constexpr (kManifold || kSpecial) {
        ma = split_mass(gather_mass(f, f.lane_a + lane));
        mb = split_mass(gather_mass(f, f.lane_b + lane));
    }
    Vec3<Lane> push{zero, zero, zero}, turn_a = push, turn_b = push;
    Lane restart = zero, residual = zero;
    const std::uint32_t now = kLambda + 3 * f.current, before = kLambda + 3 * (1 - f.current);
    for (std::uint32_t p = 0; p < g.count; ++p) {
        Real* hot = fields_of(f.contact, kContactFields, g, p, sub);
        Real* extra = nullptr;
        if constexpr (kSpecial)
            extra = fields_of(f.contact_extra, kContactExtraFields, g, p, sub);
        const PointGeometry q = load_point(hot);
        const Vec3<Lane> u = slip(q, va, vb);

        const Lane xn = load_as<Lane>(hot + now * kGroup);
        const Lane yn = kReduces ? xn + beta * (xn - load_as<Lane>(hot + before * kGroup)) : xn;
        const Lane wn = dot(q.n, u) + load_as<Lane>(hot + kBias * kGroup) + load_as<Lane>(hot + kGamma * kGroup) * yn;
        Lane ln = maximum(zero, yn - wn * load_as<Lane>(hot + kInverseN * kGroup));
        if constexpr (kReduces)
            ln = select(active, ln, xn);
        const Lane dn = ln - yn;
        store(ln, hot + before * kGroup);
        if constexpr (kReduces) {
            const Lane d = load_as<Lane>(hot + kDnn * kGroup) * dn;
            restart = restart - d * (ln - xn);
            residual = residual + d * dn;
        }
        // what the bodies get counts from x; what the block's next points see counts from y
        Vec3<Lane> impulse = q.n * dn, gain = q.n * (ln - xn);

        if constexpr (kFrictional) {
            const Lane x1 = load_as<Lane>(hot + (now + 1) * kGroup), x2 = load_as<Lane>(hot + (now + 2) * kGroup);
            const Lane y1 = kReduces ? x1 + beta * (x1 - load_as<Lane>(hot + (before + 1) * kGroup)) : x1;
            const Lane y2 = kReduces ? x2 + beta * (x2 - load_as<Lane>(hot + (before + 2) * kGroup)) : x2;
            Lane w1 = dot(q.t1, u) + load_as<Lane>(hot + kDn1 * kGroup) * dn;
            Lane w2 = dot(q.t2, u) + load_as<Lane>(hot + kDn2 * kGroup) * dn;
            if constexpr (kSpecial) {
                w1 = w1 - load_as<Lane>(extra + kSlipTarget * kGroup);
                w2 = w2 - load_as<Lane>(extra + (kSlipTarget + 1) * kGroup);
            }
            Lane l1, l2;
            const Lane bound = load_as<Lane>(hot + kFriction * kGroup) * ln;
            kPyramid || (kSpecial && f.pyramid) ? step_pyramid(hot, bound, y1, y2, w1, w2, l1, l2)
                                                : step_cone(hot, bound, y1, y2, w1, w2, l1, l2);
            if constexpr (kReduces) {
                l1 = select(active, l1, x1);
                l2 = select(active, l2, x2);
            }
            const Lane d1 = l1 - y1, d2 = l2 - y2;
            store(l1, hot + (before + 1) * kGroup);
            store(l2, hot + (before + 2) * kGroup);
            if constexpr (kReduces) {
                const Lane e1 = load_as<Lane>(hot + kDt1 * kGroup) * d1, e2 = load_as<Lane>(hot + kDt2 * kGroup) * d2;
                restart = restart - (e1 * (l1 - x1) + e2 * (l2 - x2));
                residual = residual + (e1 * d1 + e2 * d2);
            }
            impulse = impulse + (q.t1 * d1 + q.t2 * d2);
            gain = gain + (q.t1 * (l1 - x1) + q.t2 * (l2 - x2));
        }
        if constexpr (kSpecial) {
            if (g.contact == ContactKind::torsional) {
                const Vec3<Lane> on_a = cross(q.a, impulse), on_b = cross(q.b, impulse);
                const Vec3<Lane> x = load3(extra + (kTorque + 3 * f.current) * kGroup);
                const Vec3<Lane> y = kReduces ? x + (x - load3(extra + (kTorque + 3 * (1 - f.current)) * kGroup)) * beta : x;
                const Vec3<Lane> speed = (vb.angular + mb.angular * on_b) - (va.angular - ma.angular * on_a);
                Vec3<Lane> torque = step_torsion(extra, q.n, ln, y, speed, ma.angular + mb.angular);
                if constexpr (kReduces)
                    torque = select(active, torque, x);
                store3(torque, extra + (kTorque + 3 * (1 - f.current)) * kGroup);
                const Vec3<Lane> d = torque - y;
                if constexpr (kReduces) {
                    const Lane dspin = dot(q.n, d), roll = load_as<Lane>(extra + kDRoll * kGroup);
                    const Vec3<Lane> e = d * roll + q.n * (dspin * (load_as<Lane>(extra + kDSpin * kGroup) - roll));
                    restart = restart - dot(e, torque - x);
                    residual = residual + dot(e, d);
                }
                if constexpr (kManifold) {
                    va.angular = va.angular - ma.angular * d;
                    vb.angular = vb.angular + mb.angular * d;
                }
                turn_a = turn_a + (torque - x);
                turn_b = turn_b + (torque - x);
            }
        }
        if (kManifold && p + 1 < g.count) {
            va.linear = va.linear - times(ma.linear, impulse);
            va.angular = va.angular - ma.angular * cross(q.a, impulse);
            vb.linear = vb.linear + times(mb.linear, impulse);
            vb.angular = vb.angular + mb.angular * cross(q.b, impulse);
        }
        push = push + gain;
        turn_a = turn_a + cross(q.a, gain);
        turn_b = turn_b + cross(q.b, gain);
    }
    scatter_impulse(f, lane, -push, -turn_a, push, turn_b);
    if constexpr (kReduces)
        store_partials(f, lane, restart, residual);
}

template <bool kManifold, bool kReduces>
CAIRN_HD void sweep_contacts_of(const Frame<Real>& f, const Group& g, std::size_t lane, std::uint32_t sub) {
    if (g.special())
        return sweep_contacts<kManifold, ContactKind::special, false, kReduces>(f, g, lane, sub);
    if (g.contact == ContactKind::smooth)
        return sweep_contacts<kManifold, ContactKind::smooth, false, kReduces>(f, g, lane, sub);
    if (f.pyramid)
        return sweep_contacts<kManifold, ContactKind::frictional, true, kReduces>(f, g, lane, sub);
    sweep_contacts<kManifold, ContactKind::frictional, false, kReduces>(f, g, lane, sub);
}
CAIRN_HD inline void sweep_contacts(const Frame<Real>& f, const Group& g, std::size_t lane, std::uint32_t sub) {
    if (f.manifold_blocks)
        return f.reduces ? sweep_contacts_of<true, true>(f, g, lane, sub) : sweep_contacts_of<true, false>(f, g, lane, sub);
    f.reduces ? sweep_contacts_of<false, true>(f, g, lane, sub) : sweep_contacts_of<false, false>(f, g, lane, sub);
}

// Nonlinear Jacobi (paper eq. 23, 24): where C < 0, a displacement M^-1 J^T dlambda with dlambda = -C / D_nn.
CAIRN_HD inline void position_contacts(const Frame<Real>& f, const Group& g, std::size_t lane, std::uint32_t sub) {
    const Lane zero = Lane(Real(0));
    Pose<Lane> pa = gather_pose(f.displacement, f.lane_a + lane), pb = gather_pose(f.displacement, f.lane_b + lane);
    const Mass<Lane> ma = gather_mass(f, f.lane_a + lane), mb = gather_mass(f, f.lane_b + lane);
    Vec3<Lane> push{zero, zero, zero}, turn_a = push, turn_b = push;
    // how far the points before it in the same manifold block move this one, with the split mass
    Vec3<Lane> shift_a = push, shift_b = push, spin_a = push, spin_b = push;
    for (std::uint32_t p = 0; p < g.count; ++p) {
        const Real* hot = fields_of(f.contact, kContactFields, g, p, sub);
        const Real* cold = fields_of(f.contact_cold, kContactColdFields, g, p, sub);
        const PointGeometry q = load_point(hot);
        const Vec3<Lane> an = cross(q.a, q.n), bn = cross(q.b, q.n);
        const Lane d = ma.n * ma.between(q.n, an, q.n, an) + mb.n * mb.between(q.n, bn, q.n, bn);
        Lane c = separation_of(cold, q.n, pa, pb);
        if (f.manifold_blocks)
            c = c + (dot(q.n, shift_b - shift_a) + (dot(bn, spin_b) - dot(an, spin_a)));
        if (g.special()) // a spring is as long as its load makes it
            c = select(load_as<Lane>(fields_of(f.contact_extra, kContactExtraFields, g, p, sub) + kSpringGamma * kGroup) > zero, zero, c);
        const Vec3<Lane> impulse = q.n * select(c < zero, -c * inverse_or_zero(d), zero);
        const Vec3<Lane> on_a = cross(q.a, impulse), on_b = cross(q.b, impulse);
        if (f.manifold_blocks) {
            shift_a = shift_a - times(ma.linear, impulse) * ma.n;
            spin_a = spin_a - ma.angular * on_a * ma.n;
            shift_b = shift_b + times(mb.linear, impulse) * mb.n;
            spin_b = spin_b + mb.angular * on_b * mb.n;
        }
        push = push + impulse;
        turn_a = turn_a + on_a;
        turn_b = turn_b + on_b;
    }
    scatter_impulse(f, lane, -push, -turn_a, push, turn_b);
}

// Impulses of the step: + lambda after a substep. The restitution phase goes on from the last substep's lambda, which
// build_contacts then takes out again.
CAIRN_HD inline void accumulate_contacts(const Frame<Real>& f, const Group& g, std::size_t lane, std::uint32_t sub) {
    const Lane takes_part = f.phase == Phase::restitution ? island_bounces(f, lane) : Lane(Real(0));
    for (std::uint32_t p = 0; p < g.count; ++p) {
        const Real* hot = fields_of(f.contact, kContactFields, g, p, sub);
        Real* total = fields_of(f.contact_cold, kContactColdFields, g, p, sub) + kTotal * kGroup;
        add_to_totals(f, takes_part, load3(hot + (kLambda + 3 * f.current) * kGroup), total);
        if (g.contact == ContactKind::torsional) {
            Real* extra = fields_of(f.contact_extra, kContactExtraFields, g, p, sub);
            add_to_totals(f, takes_part, load3(extra + (kTorque + 3 * f.current) * kGroup), extra + kTorqueTotal * kGroup);
        }
    }
}

// The last substep's impulses, for the next step's warm start.
CAIRN_HD inline void keep_contacts(const Frame<Real>& f, const Group& g, std::uint32_t sub) {
    for (std::uint32_t p = 0; p < g.count; ++p) {
        const Real* hot = fields_of(f.contact, kContactFields, g, p, sub);
        Real* cold = fields_of(f.contact_cold, kContactColdFields, g, p, sub);
        store3(load3(hot + (kLambda + 3 * f.current) * kGroup), cold + kKept * kGroup);
    }
}

} // namespace CAIRN_ISA
} // namespace cairn
