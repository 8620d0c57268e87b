// Stages over islands: the control record that decides momentum, restart and stop, an island at a time, so that solving two
// islands in one call or in two gives the same bits.
#pragma once
#include "../math/lane.h"
#include "../scene/frame.h"

namespace cairn {
inline namespace CAIRN_ISA {

// Sum by a fixed tree over the island's own order: 32 values, 32 such sums, 32 of those, and then one after the other. A GPU
// adds the nodes of a level side by side and gets the same bits.
constexpr std::uint32_t kBranches = 32;
template <int kLevel> CAIRN_HD Real tree_sum_of(const Real* values, std::uint32_t begin, std::uint32_t end) {
    if constexpr (kLevel == 0) {
        return values[begin];
    } else {
        constexpr std::uint32_t span = kLevel == 1 ? 1u : kLevel == 2 ? kBranches : kLevel == 3 ? kBranches * kBranches : 1u << 15;
        Real total = 0;
        for (std::uint32_t at = begin; at < end; at += span)
            total += tree_sum_of<kLevel - 1>(values, at, at + span < end ? at + span : end);
        return total;
    }
}
CAIRN_HD inline Real tree_sum(const Real* values, std::uint32_t begin, std::uint32_t end) { return tree_sum_of<4>(values, begin, end); }

// Sweeps begin: t = 1, no momentum. The restitution phase leaves alone the islands in which nothing bounces.
CAIRN_HD inline void begin_island(const Frame<Real>& f, std::uint32_t i) {
    f.control[i].t = 1;
    f.control[i].beta = 0;
    f.control[i].residual = 0;
    f.control[i].active = f.phase == Phase::restitution && !f.island_bounces[i] ? Real(0) : Real(1);
}

// `bounces`: the island's sum of what its contacts are to bounce with.
CAIRN_HD inline void mark_bouncing(const Frame<Real>& f, std::uint32_t i, Real bounces) { f.island_bounces[i] = bounces > 0 ? 1 : 0; }

// After a sweep; `restart` and `residual` are the island's sums. Nesterov's sequence t+ = (1 + sqrt(1 + 4 t^2)) / 2,
// beta = (t - 1) / t+; it starts anew when the step has turned against the momentum, (y - x+)^T D (x+ - x) > 0. D, because rows
// mix units.
CAIRN_HD inline void reduce_island(const Frame<Real>& f, std::uint32_t i, Real restart, Real residual) {
    Control<Real>& c = f.control[i];
    c.residual = residual;
    ++c.sweeps[static_cast<std::uint32_t>(f.phase)];
    if (f.trace && f.phase != Phase::restitution)
        f.trace[static_cast<std::size_t>(f.sweep) * f.island_count + i] = c.residual;
    if (f.momentum) {
        if (restart > 0) {
            c.t = 1;
            c.beta = 0;
        } else {
            const Real next = (Real(1) + root(Real(1) + Real(4) * c.t * c.t)) * Real(0.5);
            c.beta = (c.t - Real(1)) / next;
            c.t = next;
        }
    }
    const bool met = c.residual < (c.stop > 0 ? c.stop : f.tolerance * f.tolerance) && !f.too_few;
    const bool ends = met || (f.enough && c.residual < c.violent);
    if ((ends || f.last_sweep) && f.phase != Phase::restitution && c.residual > c.ended)
        c.ended = c.residual;
    if (ends) {
        c.active = 0;
        c.beta = 0;
    }
}

} // namespace CAIRN_ISA
} // namespace cairn
