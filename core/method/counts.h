// What a step's schedule has done, from the islands' control records: for the statistics.
#pragma once
#include "../solver.h"
#include "schedule.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace cairn {

// `counted`: the control records have counts, since the sweeps were reduced; else every island made every sweep.
template <class S> void count_sweeps(const Plan& plan, bool counted, const Control<S>* control, std::size_t islands, Statistics& to) {
    to.substeps = std::max(to.substeps, plan.substeps);
    if (!plan.constrained)
        return;
    to.position_iterations = plan.position_iterations * plan.substeps;
    for (std::size_t i = 0; i < islands; ++i) {
        const Control<S>& c = control[i];
        to.iterations = std::max(to.iterations, c.sweeps[0] + c.sweeps[1]);
        to.relax_iterations = std::max(to.relax_iterations, c.sweeps[1]);
        to.restitution_iterations = std::max(to.restitution_iterations, c.sweeps[2]);
    }
    if (counted)
        return;
    to.iterations = plan.iterations;
    for (std::uint32_t substep = 0; substep < plan.substeps; ++substep)
        to.relax_iterations += plan.relaxed(substep);
}

// |step of lambda| in the metric of D for every sweep that any island made. `squares` as in Frame::trace, or null.
template <class S> void trace_sweeps(const Plan& plan, const S* squares, std::size_t islands, std::vector<double>& trace) {
    trace.clear();
    if (!squares)
        return;
    std::vector<double> last(islands);
    std::uint32_t sweep = 0;
    const auto phase = [&](std::uint32_t sweeps) {
        std::fill(last.begin(), last.end(), 0.0);
        for (const std::uint32_t end = sweep + sweeps; sweep < end; ++sweep) {
            bool swept = false;
            double sum = 0;
            for (std::size_t i = 0; i < islands; ++i) {
                const double square = static_cast<double>(squares[sweep * islands + i]);
                if (square >= 0) {
                    swept = true;
                    last[i] = square;
                }
                sum += last[i];
            }
            if (swept)
                trace.push_back(std::sqrt(sum));
        }
    };
    for (std::uint32_t substep = 0; substep < plan.substeps && plan.constrained; ++substep) {
        phase(plan.sweeps(substep) - plan.relaxed(substep));
        phase(plan.relaxed(substep));
    }
}

} // namespace cairn
