// Stages over islands: the control record that decides momentum, restart and stop, an island at a time, so that solving two
// islands in one call or in two gives the same bits.
#pragma once
#include "../math/lane.h"
#include "../scene/frame.h"

namespace cairn {
inline namespace CAIRN_ISA {

// Sum in chunks of 32, then of the chunks' sums likewise: the order is the island's own.
CAIRN_HD inline Real tree_sum(const Real* values, std::uint32_t begin, std::uint32_t end) {
    Real total = 0;
    for (std::uint32_t block = begin; block < end; block += 1024) {
        Real middle = 0;
        for (std::uint32_t chunk = block; chunk < end && chunk < block + 1024; chunk += 32) {
            Real part = 0;
            for (std::uint32_t i = chunk; i < end && i < chunk + 32; ++i)
                part += values[i];
            middle += part;
        }
        total += middle;
    }
    return total;
}

// Sweeps begin: t = 1, no momentum. The restitution phase leaves alone the islands in which nothing bounces.
CAIRN_HD inline void begin_island(const Frame<Real>& f, std::uint32_t i) {
    f.control[i].t = 1;
    f.control[i].beta = 0;
    f.control[i].residual = 0;
    f.control[i].active = f.phase == Phase::restitution && !f.island_bounces[i] ? Real(0) : Real(1);
}

CAIRN_HD inline void mark_bouncing(const Frame<Real>& f, std::uint32_t i) {
    f.island_bounces[i] = tree_sum(f.partial_residual, f.island_begin[i], f.island_begin[i + 1]) > 0 ? 1 : 0;
}

// After a sweep. Nesterov's sequence t+ = (1 + sqrt(1 + 4 t^2)) / 2, beta = (t - 1) / t+; it starts anew when the step has
// turned against the momentum, (y - x+)^T D (x+ - x) > 0. D, because rows mix units.
CAIRN_HD inline void reduce_island(const Frame<Real>& f, std::uint32_t i) {
    Control<Real>& c = f.control[i];
    if (!(c.active > 0))
        return;
    c.residual = tree_sum(f.partial_residual, f.island_begin[i], f.island_begin[i + 1]);
    ++c.sweeps[static_cast<std::uint32_t>(f.phase)];
    if (f.trace && f.phase != Phase::restitution)
        f.trace[static_cast<std::size_t>(f.sweep) * f.island_count + i] = c.residual;
    if (f.momentum) {
        if (tree_sum(f.partial_restart, f.island_begin[i], f.island_begin[i + 1]) > 0) {
            c.t = 1;
            c.beta = 0;
        } else {
            const Real next = (Real(1) + root(Real(1) + Real(4) * c.t * c.t)) * Real(0.5);
            c.beta = (c.t - Real(1)) / next;
            c.t = next;
        }
    }
    if (c.residual < f.tolerance * f.tolerance) {
        c.active = 0;
        c.beta = 0;
    }
}

} // namespace CAIRN_ISA
} // namespace cairn
