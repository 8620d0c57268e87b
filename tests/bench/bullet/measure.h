// The two measurements: what a step costs, and how well it does in the time that stock takes.
#pragma once
#include "options.h"
#include "subject.h"

#include <array>
#include <functional>
#include <string>
#include <vector>

namespace cairn_bench::bullet {

// Medians over the timed steps.
struct Speed {
    std::string scene;
    std::size_t bodies = 0;
    std::string solver; // stock, cairn
    std::uint32_t threads = 1;
    std::size_t points = 0;
    StepTimes times, least; // of the parts one by one
    std::uint64_t hash = 0; // of the bodies at the end
};
// Told of every step, for a progress bar; `what` names the work.
using Told = std::function<void(const std::string& what)>;

// Stock, Cairn on one thread and on options.threads, in turn. Throws std::runtime_error if a step failed or the threads changed a bit.
std::vector<Speed> measureSpeed(const std::string& scene, std::size_t bodies, const Options& options, const Told& told);

struct Quality {
    std::string scene;
    std::size_t bodies = 0;
    std::string solver;
    std::uint32_t iterations = 0, substeps = 1;
    double solver_ms = 0;  // median where the times were matched
    double worstDepth = 0; // m, over the second half of the run
    double meanDepth = 0;  // m, likewise, of all points
    double drift = 0;      // m, of the body that is farthest at the end: from the start in the wall, in the pile since half of the run
    double speed = 0;      // m/s, root of the mean square over bodies and the second half
};
// Stock with that many iterations, and Cairn in its time: first the times, then the runs, which take longer but need no quiet machine.
using Pair = std::array<Quality, 2>;
Pair matchTimes(const std::string& scene, std::size_t bodies, std::uint32_t iterations, const Options& options, const Told& told);
void measureQuality(Pair& pair, const Options& options, const Told& told);

} // namespace cairn_bench::bullet
