// One measurement: several solvers step the same world in turn, and what each took.
#pragma once
#include "options.h"
#include "subject.h"

#include <functional>

namespace cairn_bench {

struct Case {
    std::string group; // scenes, stack, pile, worlds
    std::string name;  // of the world
    std::size_t bodies = 0, worlds = 1;
    std::function<World()> make;
    std::uint32_t method = CAIRN_METHOD_PJ, iterations = 30;
    bool stock = true; // false: another method's case has it
};

// All that is wished for, in the order in which it is measured: the paper's scenes, then from small to large.
std::vector<Case> casesOf(const Options& options);
// The paper's preset, with that many iterations; PJNJ with as many position iterations.
cairn_params paramsOf(const Case& measured);

struct Spread {
    double median = 0, least = 0, most = 0; // s
};
enum class Who { cpu, gpu, stock };

// One solver's share. Where `notMeasured` says why, there is nothing else.
struct Cell {
    Who who = Who::cpu;
    std::uint32_t forced = CAIRN_EXECUTOR_AUTO;
    std::string notMeasured;
    bool failed = false;
    int runs = 0;
    Spread total;
    std::optional<double> upload, build, iterations, finish, download; // medians, s
    Done done;
    double fastest = 0;              // m/s
    std::optional<bool> sameBits;    // as the CPU's
    std::optional<double> bytes;     // of an iteration, counted
    std::optional<double> bytesRate; // bytes/s through the iterations; not where position iterations are among them
};

struct Measured {
    Case what;
    std::size_t bodies = 0, points = 0, joints = 0;
    std::vector<Cell> cells;
};

struct Machine {
    std::optional<std::string> gpuMissing; // see gpuIsMissing()
    bool bullet = false;
};

Measured measure(const Case& what, const Options& options, const Machine& machine);
// One that time did not suffice for.
Measured leftOut(const Case& what, const Options& options, const std::string& why);

Spread spreadOf(const std::vector<double>& values);

} // namespace cairn_bench
