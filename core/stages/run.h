// A stage at one index: a batch of lanes of one kind of constraint, a body, or an island. Executors loop over it.
#pragma once
#include "../rows/contact.h"
#include "../rows/joint.h"
#include "../rows/raw.h"
#include "bodies.h"
#include "islands.h"

namespace cairn {
inline namespace CAIRN_ISA {

// `lane` counts over all kinds; `sub` is its place in the group.
CAIRN_HD inline void run_contacts(Stage stage, const Frame<Real>& f, const Group& g, std::size_t lane, std::uint32_t sub) {
    switch (stage) {
    case Stage::approach:
        return approach_contacts(f, g, lane, sub);
    case Stage::build:
        return build_contacts(f, g, lane, sub);
    case Stage::sweep:
        return sweep_contacts(f, g, lane, sub);
    case Stage::position_sweep:
        return position_contacts(f, g, lane, sub);
    case Stage::accumulate:
        return accumulate_contacts(f, g, lane, sub);
    default:
        return keep_contacts(f, g, sub);
    }
}
CAIRN_HD inline void run_joints(Stage stage, const Frame<Real>& f, const Group& g, std::size_t lane, std::uint32_t sub) {
    switch (stage) {
    case Stage::approach:
        return store_partials(f, lane, Lane(Real(0)), Lane(Real(0)));
    case Stage::build:
        return build_joints(f, g, lane, sub);
    case Stage::sweep:
        return sweep_joints(f, g, lane, sub);
    case Stage::position_sweep:
        return position_joints(f, g, lane, sub);
    case Stage::accumulate:
        return accumulate_joints(f, g, lane, sub);
    default:
        return keep_joints(f, g, sub);
    }
}
CAIRN_HD inline void run_raw(Stage stage, const Frame<Real>& f, const Group& g, std::size_t lane, std::uint32_t sub) {
    switch (stage) {
    case Stage::approach:
        return store_partials(f, lane, Lane(Real(0)), Lane(Real(0)));
    case Stage::build:
        return build_raw(f, g, lane, sub);
    case Stage::sweep:
        return sweep_raw(f, g, lane, sub);
    case Stage::position_sweep:
        return scatter_raw(f, lane, no_wrench()); // they have no position to correct
    case Stage::accumulate:
        return accumulate_raw(f, g, lane, sub);
    default:
        return keep_raw(f, g, sub);
    }
}
CAIRN_HD inline void run_body(Stage stage, const Frame<Real>& f, std::uint32_t b) {
    switch (stage) {
    case Stage::inertia:
        return refresh_inertia(f, b);
    case Stage::forces:
        return apply_forces(f, b);
    case Stage::energy_before:
        f.energy_change[b] -= kinetic_energy(f, b);
        return;
    case Stage::energy_after:
        f.energy_change[b] += kinetic_energy(f, b);
        return;
    case Stage::apply_start:
        return apply_start(f, b);
    case Stage::apply:
        return apply_sweep(f, b);
    case Stage::integrate:
        return integrate_pose(f, b);
    default:
        return apply_position(f, b);
    }
}
// `sum(values)` adds up the island's part of an array of partial sums, by the tree of islands.h.
template <class Sum> CAIRN_HD void run_island(Stage stage, const Frame<Real>& f, std::uint32_t i, const Sum& sum) {
    switch (stage) {
    case Stage::begin:
        return begin_island(f, i);
    case Stage::bouncing:
        return mark_bouncing(f, i, sum(f.partial_residual));
    default:
        if (f.control[i].active > 0) {
            const Real restart = f.momentum ? sum(f.partial_restart) : Real(0);
            reduce_island(f, i, restart, sum(f.partial_residual));
        }
        return;
    }
}

} // namespace CAIRN_ISA
} // namespace cairn
