// The methods as one schedule over shared stages (paper section 3.6, Figure 2). An executor says how a stage is run: over SIMD
// lanes and threads, in one CUDA block, in a cooperative grid or as a graph of kernels. It has `frame`, each(stage);
// traced(), called after every reduction: true if no island has anything left to do; idle(), the same at any time; and before_sweeps(),
// after_sweeps() and substeps_done() to look on: energies, the warm-start cache.
#pragma once
#include "../scene/frame.h"
#include "params.h"

namespace cairn {

struct Plan {
    std::uint32_t substeps, iterations, position_iterations, restitution_iterations;
    double relax_share;
    bool bounces;     // some contact has restitution
    bool constrained; // there is anything to sweep

    // Sweeps of a substep: the iterations shared out evenly, the earlier ones taking what is left over.
    std::uint32_t sweeps(std::uint32_t substep) const { return iterations / substeps + (substep < iterations % substeps ? 1 : 0); }
    // How many of them go without bias, after the integration; at least one does not. (1e-9: a third of 30 is 10.)
    std::uint32_t relaxed(std::uint32_t substep) const {
        const std::uint32_t all = sweeps(substep), share = static_cast<std::uint32_t>(all * relax_share + 1e-9);
        return share < all ? share : all - 1;
    }
};

// Returns how many sweeps were made.
template <class Executor> std::uint32_t solve_velocities(Executor& run, Phase phase, std::uint32_t sweeps) {
    auto& f = run.frame;
    f.phase = phase;
    if (phase == Phase::restitution)
        f.reduces = true; // islands in which nothing bounces rest
    run.each(Stage::begin);
    if (phase == Phase::restitution && run.idle())
        return 0;
    run.each(Stage::build);
    run.each(Stage::apply_start);
    for (std::uint32_t i = 0; i < sweeps; ++i) {
        f.last_sweep = i + 1 == sweeps;
        run.each(Stage::sweep);
        if (f.reduces)
            run.each(Stage::reduce);
        run.each(Stage::apply);
        f.current ^= 1u;
        if (f.reduces && run.traced())
            return i + 1;
    }
    return sweeps;
}

template <class Executor> void solve_positions(Executor& run, std::uint32_t sweeps) {
    for (std::uint32_t i = 0; i < sweeps; ++i) {
        run.each(Stage::position_sweep);
        run.each(Stage::position_apply);
    }
}

// Sweeps that were made beside the biased ones.
struct Done {
    std::uint32_t relax = 0, restitution = 0;
};

template <class Executor> Done run_schedule(Executor& run, const Plan& plan) {
    Done done;
    run.each(Stage::inertia);
    if (plan.bounces) {
        run.each(Stage::approach);
        run.each(Stage::bouncing);
    }
    for (std::uint32_t substep = 0; substep < plan.substeps; ++substep) {
        run.each(Stage::forces);
        run.before_sweeps();
        if (plan.constrained)
            solve_velocities(run, Phase::substep, plan.sweeps(substep) - plan.relaxed(substep));
        run.after_sweeps();
        run.each(Stage::integrate);
        if (!plan.constrained)
            continue;
        solve_positions(run, plan.position_iterations);
        if (plan.relaxed(substep) > 0)
            done.relax += solve_velocities(run, Phase::relax, plan.relaxed(substep));
        run.each(Stage::accumulate);
    }
    run.substeps_done();
    if (plan.bounces) {
        done.restitution = solve_velocities(run, Phase::restitution, plan.restitution_iterations);
        if (done.restitution > 0)
            run.each(Stage::accumulate);
    }
    return done;
}

} // namespace cairn
