// Raw rows: J v + gamma lambda = rhs with bounds, or Coulomb friction bounded by an earlier row of the same block. The Jacobian
// is the caller's and stays as it was at the step's start. A block is one inner Gauss-Seidel sweep over its rows, on local
// velocities that move with the split mass; two friction rows of one source are projected on a disc together.
#pragma once
#include "bodies.h"

namespace cairn {
inline namespace CAIRN_ISA {

struct RawRow {
    Vec3<Lane> linear_a, angular_a, linear_b, angular_b;
    CAIRN_HD Lane speed(const Motion<Lane>& a, const Motion<Lane>& b) const {
        return (dot(linear_a, a.linear) + dot(angular_a, a.angular)) + (dot(linear_b, b.linear) + dot(angular_b, b.angular));
    }
};
CAIRN_HD inline RawRow load_raw(const Real* hot) {
    return {load3(hot + kJacobianA * kGroup), load3(hot + (kJacobianA + 3) * kGroup), load3(hot + kJacobianB * kGroup),
            load3(hot + (kJacobianB + 3) * kGroup)};
}

// Impulses of a block's rows, collected on both bodies
struct RawWrench {
    Vec3<Lane> push_a, turn_a, push_b, turn_b;
    CAIRN_HD void add(const RawRow& r, const Lane& p) {
        push_a = push_a + r.linear_a * p;
        turn_a = turn_a + r.angular_a * p;
        push_b = push_b + r.linear_b * p;
        turn_b = turn_b + r.angular_b * p;
    }
};
CAIRN_HD inline RawWrench no_wrench() {
    const Lane zero = Lane(Real(0));
    const Vec3<Lane> none{zero, zero, zero};
    return {none, none, none, none};
}
CAIRN_HD inline void scatter_raw(const Frame<Real>& f, std::size_t lane, const RawWrench& w) {
    scatter_impulse(f, lane, w.push_a, w.turn_a, w.push_b, w.turn_b);
}

CAIRN_HD inline void build_raw(const Frame<Real>& f, const Group& g, std::size_t lane, std::uint32_t sub) {
    const Mass<Lane> ma = gather_mass(f, f.lane_a + lane), mb = gather_mass(f, f.lane_b + lane);
    const Lane zero = Lane(Real(0));
    const Lane takes_part = f.phase == Phase::restitution ? island_bounces(f, lane) : zero;
    RawWrench wrench = no_wrench();
    Lane diagonal[kRawRows];
    for (std::uint32_t r = 0; r < g.count; ++r) {
        Real* hot = fields_of(f.raw, kRawFields, g, r, sub);
        const RawRow row = load_raw(hot);
        diagonal[r] = ma.n * ma.between(row.linear_a, row.angular_a, row.linear_a, row.angular_a) +
                      mb.n * mb.between(row.linear_b, row.angular_b, row.linear_b, row.angular_b);
    }
    for (std::uint32_t r = 0; r < g.count; ++r) {
        Real* hot = fields_of(f.raw, kRawFields, g, r, sub);
        const RawRow row = load_raw(hot);
        Lane d = diagonal[r], gamma = load_as<Lane>(hot + kRawGamma * kGroup);
        // rows that share a disc share sigma, the larger eigenvalue of their 2x2 block
        for (std::uint32_t partner = r > 0 ? r - 1 : 1; partner < g.count && partner <= r + 1; partner += 2) {
            const bool first = partner > r;
            const RawRow other = load_raw(fields_of(f.raw, kRawFields, g, partner, sub));
            const Lane cross = ma.n * ma.between(row.linear_a, row.angular_a, other.linear_a, other.angular_a) +
                               mb.n * mb.between(row.linear_b, row.angular_b, other.linear_b, other.angular_b);
            const Lane half = (diagonal[r] - diagonal[partner]) * Lane(Real(0.5));
            const Lane sigma = (diagonal[r] + diagonal[partner]) * Lane(Real(0.5)) + root(half * half + cross * cross);
            const auto paired = load_as<Lane>(hot + (first ? kPairFirst : kPairSecond) * kGroup) > zero;
            const Lane other_gamma = load_as<Lane>(fields_of(f.raw, kRawFields, g, partner, sub) + kRawGamma * kGroup);
            d = select(paired, sigma, d);
            gamma = select(paired, maximum(gamma, other_gamma), gamma); // one metric, or the disc's fixed point would be wrong
        }
        d = d + gamma;
        store(d, hot + kRawD * kGroup);
        store(inverse_or_zero(d), hot + kRawInverse * kGroup);
        Lane start = load_as<Lane>(hot + (kRawLambda + f.current) * kGroup);
        if (f.phase == Phase::substep)
            start = start * Lane(f.warm ? f.joint_warm : Real(0));
        if (f.phase == Phase::restitution)
            store(add_to_total(f, takes_part, load_as<Lane>(hot + kRawTotal * kGroup), -start), hot + kRawTotal * kGroup);
        store(start, hot + kRawLambda * kGroup);
        store(start, hot + (kRawLambda + 1) * kGroup);
        wrench.add(row, start);
    }
    if (f.warm && f.phase == Phase::substep)
        scatter_raw(f, lane, wrench);
}

template <bool kReduces> CAIRN_HD void sweep_raw_of(const Frame<Real>& f, const Group& g, std::size_t lane, std::uint32_t sub) {
    const Lane zero = Lane(Real(0)), one = Lane(Real(1));
    Motion<Lane> va = gather_motion(f.velocity, f.lane_a + lane), vb = gather_motion(f.velocity, f.lane_b + lane);
    const Mass<Lane> ma = gather_mass(f, f.lane_a + lane), mb = gather_mass(f, f.lane_b + lane);
    const Lane beta = maximum(va.beta, vb.beta);
    const auto active = maximum(va.active, vb.active) > zero;
    const Lane share = Lane(f.h / f.dt); // bounds are of the whole step
    const std::uint32_t now = kRawLambda + f.current, before = kRawLambda + (1 - f.current);
    RawWrench wrench = no_wrench();
    Lane restart = zero, residual = zero, second = zero, lambda[kRawRows];
    for (std::uint32_t r = 0; r < g.count; ++r) {
        Real* hot = fields_of(f.raw, kRawFields, g, r, sub);
        const RawRow row = load_raw(hot);
        const auto residual_of = [&](const Real* at, const RawRow& of, const Lane& y) {
            return of.speed(va, vb) - load_as<Lane>(at + kRhs * kGroup) + load_as<Lane>(at + kRawGamma * kGroup) * y;
        };
        const auto start_of = [&](const Real* at, Lane& x) {
            load(x, at + now * kGroup);
            return kReduces ? x + beta * (x - load_as<Lane>(at + before * kGroup)) : x;
        };
        Lane x;
        const Lane y = start_of(hot, x), inverse = load_as<Lane>(hot + kRawInverse * kGroup);
        Lane next = y - residual_of(hot, row, y) * inverse;

        Lane source = zero;
        const Lane index = load_as<Lane>(hot + kFrictionSource * kGroup);
        for (std::uint32_t s = 0; s < r; ++s)
            source = select(index == Lane(Real(s)), lambda[s], source);
        const Lane bound = load_as<Lane>(hot + kRawFriction * kGroup) * absolute(source);
        const auto rubs = index >= zero;
        const auto pair_first = load_as<Lane>(hot + kPairFirst * kGroup) > zero,
                   pair_second = load_as<Lane>(hot + kPairSecond * kGroup) > zero;
        const Lane low = select(rubs, -bound, load_as<Lane>(hot + kRawLow * kGroup) * share);
        const Lane high = select(rubs, bound, load_as<Lane>(hot + kRawHigh * kGroup) * share);
        Lane scale = one, partner = zero;
        if (r + 1 < g.count) {
            const Real* other = fields_of(f.raw, kRawFields, g, r + 1, sub);
            Lane x2;
            const Lane y2 = start_of(other, x2);
            partner = y2 - residual_of(other, load_raw(other), y2) * load_as<Lane>(other + kRawInverse * kGroup);
            const Lane size = next * next + partner * partner;
            const auto outside = size > bound * bound;
            scale = select(outside, bound / root(select(outside, size, one)), one);
        }
        next = select(pair_first, next * scale, select(pair_second, second, clamp(next, low, high)));
        second = partner * scale;
        if constexpr (kReduces)
            next = select(active, next, x);
        const Lane change = next - y;
        store(next, hot + before * kGroup);
        lambda[r] = next;
        if constexpr (kReduces) {
            const Lane d = load_as<Lane>(hot + kRawD * kGroup) * change;
            restart = restart - d * (next - x);
            residual = residual + d * change;
        }
        wrench.add(row, next - x); // the bodies get the change from x, the block's own rows see that from y
        va.linear = va.linear + times(ma.linear, row.linear_a * change) * ma.n;
        va.angular = va.angular + ma.angular * (row.angular_a * change) * ma.n;
        vb.linear = vb.linear + times(mb.linear, row.linear_b * change) * mb.n;
        vb.angular = vb.angular + mb.angular * (row.angular_b * change) * mb.n;
    }
    scatter_raw(f, lane, wrench);
    if constexpr (kReduces)
        store_partials(f, lane, restart, residual);
}
CAIRN_HD inline void sweep_raw(const Frame<Real>& f, const Group& g, std::size_t lane, std::uint32_t sub) {
    f.reduces ? sweep_raw_of<true>(f, g, lane, sub) : sweep_raw_of<false>(f, g, lane, sub);
}

CAIRN_HD inline void accumulate_raw(const Frame<Real>& f, const Group& g, std::size_t lane, std::uint32_t sub) {
    const Lane takes_part = f.phase == Phase::restitution ? island_bounces(f, lane) : Lane(Real(0));
    for (std::uint32_t r = 0; r < g.count; ++r) {
        Real* hot = fields_of(f.raw, kRawFields, g, r, sub);
        const Lane lambda = load_as<Lane>(hot + (kRawLambda + f.current) * kGroup);
        store(add_to_total(f, takes_part, load_as<Lane>(hot + kRawTotal * kGroup), lambda), hot + kRawTotal * kGroup);
    }
}

CAIRN_HD inline void keep_raw(const Frame<Real>& f, const Group& g, std::uint32_t sub) {
    for (std::uint32_t r = 0; r < g.count; ++r) {
        Real* hot = fields_of(f.raw, kRawFields, g, r, sub);
        store(load_as<Lane>(hot + (kRawLambda + f.current) * kGroup), hot + kRawKept * kGroup);
    }
}

} // namespace CAIRN_ISA
} // namespace cairn
