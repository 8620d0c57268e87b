// The two bodies of a block, gathered from their rows into lanes.
#pragma once
#include "../math/rows8.h"
#include "../math/vec.h"
#include "../scene/frame.h"

namespace cairn {
inline namespace CAIRN_ISA {

template <class F> struct Motion {
    Vec3<F> linear, angular;
    F beta, active;
};
CAIRN_HD inline Motion<Lane> gather_motion(const Real* rows, const std::int32_t* index) {
    Lane c[8];
    gather_rows(rows, index, c);
    return {{c[0], c[1], c[2]}, {c[4], c[5], c[6]}, c[3], c[7]};
}

template <class F> struct Pose {
    Vec3<F> shift;
    Quat<F> turn;
};
CAIRN_HD inline Pose<Lane> gather_pose(const Real* rows, const std::int32_t* index) {
    Lane c[8];
    gather_rows(rows, index, c);
    return {{c[0], c[1], c[2]}, {c[4], c[5], c[6], c[7]}};
}

// M^-1 of one body, and the number of blocks that share it
template <class F> struct Mass {
    Vec3<F> linear;
    Sym3<F> angular;
    F n;
    // u . M^-1 w for rows (u, ru) and (w, rw)
    CAIRN_HD F between(const Vec3<F>& u, const Vec3<F>& ru, const Vec3<F>& w, const Vec3<F>& rw) const {
        return dot(u, times(linear, w)) + dot(ru, angular * rw);
    }
};
CAIRN_HD inline Mass<Lane> gather_mass(const Frame<Real>& f, const std::int32_t* index) {
    Lane c[8], x[8];
    gather_rows(f.mass, index, c);
    gather_rows(f.mass_cross, index, x);
    return {{c[0], c[1], c[2]}, {c[4], c[5], c[6], x[0], x[1], x[2]}, c[3]};
}

// n M^-1, the mass that a block works with on its own
CAIRN_HD inline Mass<Lane> split_mass(const Mass<Lane>& m) {
    const Sym3<Lane>& i = m.angular;
    return {m.linear * m.n, {i.xx * m.n, i.yy * m.n, i.zz * m.n, i.xy * m.n, i.xz * m.n, i.yz * m.n}, m.n};
}

// Impulse of a block on its two sides, into their slots: (linear, angular) on a and on b
CAIRN_HD inline void scatter_impulse(const Frame<Real>& f, std::size_t lane, const Vec3<Lane>& pa, const Vec3<Lane>& ta,
                                     const Vec3<Lane>& pb, const Vec3<Lane>& tb) {
    const Lane zero = Lane(Real(0));
    const Lane side_a[8] = {pa.x, pa.y, pa.z, zero, ta.x, ta.y, ta.z, zero};
    const Lane side_b[8] = {pb.x, pb.y, pb.z, zero, tb.x, tb.y, tb.z, zero};
    scatter_rows(side_a, f.slots, f.slot_a + lane);
    scatter_rows(side_b, f.slots, f.slot_b + lane);
}

// A lane's share of its island's sums: (y - x+)^T D (x+ - x), which restarts the momentum, and |x+ - y|_D^2, the residual
CAIRN_HD inline void store_partials(const Frame<Real>& f, std::size_t lane, const Lane& restart, const Lane& residual) {
    if constexpr (kLanes == 1) {
        store(restart, f.partial_restart + f.lane_partial[lane]);
        store(residual, f.partial_residual + f.lane_partial[lane]);
    } else {
        alignas(64) Real r[kLanes], s[kLanes];
        store(restart, r);
        store(residual, s);
        for (std::uint32_t i = 0; i < kLanes; ++i) {
            f.partial_restart[f.lane_partial[lane + i]] = r[i];
            f.partial_residual[f.lane_partial[lane + i]] = s[i];
        }
    }
}

// 1 where the lane's island takes part in the restitution phase, else 0.
CAIRN_HD inline Lane island_bounces(const Frame<Real>& f, std::size_t lane) {
    if constexpr (kLanes == 1) {
        return Lane(Real(f.island_bounces[f.lane_island[lane]]));
    } else {
        alignas(64) Real bounces[kLanes];
        for (std::uint32_t i = 0; i < kLanes; ++i)
            bounces[i] = Real(f.island_bounces[f.lane_island[lane + i]]);
        return load_as<Lane>(bounces);
    }
}
// total + change, in the restitution phase only where something bounces: elsewhere the bits stay.
CAIRN_HD inline Lane add_to_total(const Frame<Real>& f, const Lane& takes_part, const Lane& total, const Lane& change) {
    return f.phase == Phase::restitution ? select(takes_part > Lane(Real(0)), total + change, total) : total + change;
}

CAIRN_HD inline Vec3<Lane> load3(const Real* field) {
    return {load_as<Lane>(field), load_as<Lane>(field + kGroup), load_as<Lane>(field + 2 * kGroup)};
}
CAIRN_HD inline void store3(const Vec3<Lane>& a, Real* field) {
    store(a.x, field);
    store(a.y, field + kGroup);
    store(a.z, field + 2 * kGroup);
}
CAIRN_HD inline Quat<Lane> load4(const Real* field) {
    return {load_as<Lane>(field), load_as<Lane>(field + kGroup), load_as<Lane>(field + 2 * kGroup), load_as<Lane>(field + 3 * kGroup)};
}

} // namespace CAIRN_ISA
} // namespace cairn
