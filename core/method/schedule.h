// The methods as one schedule over shared stages (paper section 3.6, Figure 2). An executor says how a stage is run: over SIMD
// lanes and threads, in one CUDA block, in a cooperative grid or as a graph of kernels. It has
//   frame          what the stages see; the schedule moves its phase, sweep and buffer along
//   each(stage)    runs the stage for every index, then a barrier
//   rests()        true if it is certain that no island has anything left to do; may always be false: islands that rest keep
//                  every bit, so that stopping early saves time and changes nothing
#pragma once
#include "../portable.h"
#include "../scene/frame.h"
#include "params.h"

namespace cairn {

struct Plan {
    std::uint32_t substeps, iterations, position_iterations, restitution_iterations;
    double relax_share;
    bool bounces;                // some contact has restitution
    bool constrained;            // there is anything to sweep
    bool stops;                  // islands may come to rest before the last sweep
    std::uint32_t least, enough; // sweeps of a substep, as in Frame::too_few and enough; without bias half as many

    // Sweeps of a substep: the iterations shared out evenly, the earlier ones taking what is left over.
    CAIRN_HD std::uint32_t sweeps(std::uint32_t substep) const { return iterations / substeps + (substep < iterations % substeps ? 1 : 0); }
    // How many of them go without bias, after the integration; at least one does not. (1e-9: a third of 30 is 10.)
    CAIRN_HD std::uint32_t relaxed(std::uint32_t substep) const {
        const std::uint32_t all = sweeps(substep), share = static_cast<std::uint32_t>(all * relax_share + 1e-9);
        return share < all ? share : all - 1;
    }
};

inline Plan plan_of(const Params& params, bool constrained, bool bounces) {
    Plan plan{};
    plan.substeps = params.substeps;
    plan.iterations = params.iterations;
    plan.position_iterations = row_of(params.method).position_sweeps ? params.position_iterations : 0;
    plan.restitution_iterations =
        params.restitution_iterations == kSameAsSweeps ? params.iterations / params.substeps : params.restitution_iterations;
    plan.relax_share = params.relax_share;
    plan.constrained = constrained;
    plan.bounces = constrained && bounces;
    plan.stops = params.residual_tolerance > 0;
    plan.enough = ~0u;
    return plan;
}

CAIRN_HD_OF_ITS_ARGUMENT
template <class Executor>
CAIRN_HD void solve_velocities(Executor& run, Phase phase, std::uint32_t sweeps, bool stops, std::uint32_t least = 0,
                               std::uint32_t enough = ~0u) {
    auto& f = run.frame;
    f.phase = phase;
    run.each(Stage::begin);
    if (stops && run.rests())
        return;
    run.each(Stage::build);
    run.each(Stage::apply_start);
    for (std::uint32_t i = 0; i < sweeps; ++i) {
        f.last_sweep = i + 1 == sweeps;
        f.too_few = i + 1 < least;
        f.enough = i + 1 >= enough;
        run.each(Stage::sweep);
        if (f.reduces)
            run.each(Stage::reduce);
        run.each(Stage::apply);
        f.current ^= 1u;
        ++f.sweep;
        if (stops && run.rests()) {
            f.sweep += sweeps - (i + 1);
            return;
        }
    }
}

CAIRN_HD_OF_ITS_ARGUMENT
template <class Executor> CAIRN_HD void solve_positions(Executor& run, std::uint32_t sweeps) {
    for (std::uint32_t i = 0; i < sweeps; ++i) {
        run.each(Stage::position_sweep);
        run.each(Stage::position_apply);
    }
}

CAIRN_HD_OF_ITS_ARGUMENT
template <class Executor> CAIRN_HD void run_schedule(Executor& run, const Plan& plan) {
    run.each(Stage::inertia);
    if (plan.bounces) {
        run.each(Stage::approach);
        run.each(Stage::bouncing);
    }
    for (std::uint32_t substep = 0; substep < plan.substeps; ++substep) {
        const std::uint32_t relaxed = plan.relaxed(substep);
        run.each(Stage::forces);
        if (plan.constrained) {
            run.each(Stage::energy_before);
            solve_velocities(run, Phase::substep, plan.sweeps(substep) - relaxed, plan.stops, plan.least, plan.enough);
            run.each(Stage::energy_after);
        }
        run.each(Stage::integrate);
        if (!plan.constrained)
            continue;
        solve_positions(run, plan.position_iterations);
        if (relaxed > 0)
            solve_velocities(run, Phase::relax, relaxed, plan.stops, plan.least / 2, plan.enough / 2);
        run.each(Stage::accumulate);
    }
    if (plan.constrained)
        run.each(Stage::keep);
    if (plan.bounces) {
        run.frame.reduces = true; // islands in which nothing bounces rest
        solve_velocities(run, Phase::restitution, plan.restitution_iterations, true);
        run.each(Stage::accumulate);
    }
}

} // namespace cairn
