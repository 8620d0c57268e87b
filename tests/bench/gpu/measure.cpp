#include "measure.h"

#include "../program.h"

#include "traffic.h"

#include <algorithm>
#include <chrono>
#include <thread>

namespace cairn_bench {
namespace {

constexpr int kWarmUps = 2; // the GPU chooses its executor by what it found in the step before
constexpr int kLeastRuns = 3;
constexpr double kEnoughSeconds = 3; // of one solver's runs in a case
// Before each step: until then the last solver's threads spin, and a busy machine's scheduler owes time to others.
constexpr std::chrono::milliseconds kPause(3);
constexpr std::uint32_t kMethods[] = {CAIRN_METHOD_PJ, CAIRN_METHOD_PJNJ, CAIRN_METHOD_PJSOFT, CAIRN_METHOD_TJ, CAIRN_METHOD_TJSOFT};

bool wanted(const Options& options, const char* group) {
    return std::find(options.only.begin(), options.only.end(), group) != options.only.end();
}

// 10, 30, 100, ... or 10, 100, ...; and the largest that is wished for.
std::vector<std::size_t> sizes(std::size_t most, bool quick) {
    std::vector<std::size_t> found;
    for (std::size_t decade = 10; decade <= most; decade *= 10) {
        found.push_back(decade);
        if (!quick && 3 * decade <= most)
            found.push_back(3 * decade);
    }
    if (found.empty() || found.back() != most)
        found.push_back(most);
    return found;
}

Load loadOf(const World& world, const Done& done) {
    Load load;
    load.points = done.points;
    load.manifolds = done.manifolds;
    load.joints = done.joints;
    load.bodies = done.bodies;
    const auto sides = [](std::int32_t a, std::int32_t b) { return (a >= 0 ? 1 : 0) + (b >= 0 ? 1 : 0); };
    for (const Manifold& manifold : manifoldsOf(world))
        load.movableSides += sides(world.bodyA[manifold.first], world.bodyB[manifold.first]);
    for (std::size_t i = 0; i < world.joints(); ++i)
        load.movableSides += sides(world.jointA[i], world.jointB[i]);
    return load;
}

// A solver at work on a case.
struct Runner {
    Cell cell;
    std::unique_ptr<Subject> subject;
    std::vector<Spent> runs;
    double spent = 0;

    template <class Work> void guarded(const Work& work) {
        try {
            work();
        } catch (const Failure& failure) {
            cell.notMeasured = failure.what();
            cell.failed = !failure.outOfMemory;
            subject.reset();
        }
    }
    bool done(int wished) const {
        const int made = static_cast<int>(runs.size());
        return !subject || made >= wished || (made >= kLeastRuns && spent > kEnoughSeconds);
    }
    void finish(const World& world, const cairn_params& params) {
        if (!subject)
            return;
        cell.done = subject->done();
        cell.fastest = subject->fastest();
        cell.runs = static_cast<int>(runs.size());
        const auto all = [&](auto part) {
            std::vector<double> values;
            for (const Spent& run : runs)
                values.push_back(part(run));
            return spreadOf(values);
        };
        cell.total = all([](const Spent& s) { return s.total; });
        for (const auto& [from, to] : {std::pair{&Spent::upload, &Cell::upload},
                                       {&Spent::build, &Cell::build},
                                       {&Spent::iterations, &Cell::iterations},
                                       {&Spent::finish, &Cell::finish},
                                       {&Spent::download, &Cell::download}})
            if (runs.front().*from)
                cell.*to = all([part = from](const Spent& s) { return *(s.*part); }).median;
        if (cell.who == Who::stock)
            return;
        cell.bytes = sweepBytes(loadOf(world, cell.done), params, cell.who == Who::gpu);
        if (cell.done.positionIterations == 0 && *cell.iterations > 0)
            cell.bytesRate = *cell.bytes * cell.done.iterations / *cell.iterations;
    }
};

std::vector<Cell> cellsOf(const Case& what, const Options& options) {
    std::vector<Cell> cells(1);
    for (const std::uint32_t executor : options.executors) {
        Cell& cell = cells.emplace_back();
        cell.who = Who::gpu;
        cell.forced = executor;
    }
    if (what.stock)
        cells.emplace_back().who = Who::stock;
    return cells;
}

std::string whyNot(const Cell& cell, const Case& what, const Options& options, const Machine& machine) {
    const auto more = [&](std::size_t most, const char* option) {
        return what.bodies > most ? "more than " + std::to_string(most) + " bodies (" + option + ")" : std::string();
    };
    if (cell.who == Who::cpu)
        return more(options.mostCpu, "--most-cpu");
    if (cell.who == Who::gpu)
        return machine.gpuMissing.value_or("");
    return machine.bullet ? more(options.mostStock, "--most-stock") : "built without Bullet";
}

} // namespace

Spread spreadOf(const std::vector<double>& values) {
    const auto [least, most] = std::minmax_element(values.begin(), values.end());
    return {median(values), *least, *most};
}

std::vector<Case> casesOf(const Options& options) {
    std::vector<Case> cases;
    const auto scene = [&](const char* name, std::size_t bodies, World (*make)()) {
        for (const std::uint32_t method : kMethods)
            cases.push_back({"scenes", name, bodies, 1, make, method, options.iterations, method == kMethods[0]});
    };
    if (wanted(options, "scenes")) {
        scene("chain", 51, chain);
        scene("stack", 125, stack);
        scene("overlap", 10, overlap);
    }
    std::vector<Case> growing;
    for (const std::size_t bodies : sizes(options.mostBodies, options.quick)) {
        if (wanted(options, "stack"))
            growing.push_back({"stack", "stack", bodies, 1, [bodies] { return bond(bodies); }});
        if (wanted(options, "pile"))
            growing.push_back({"pile", "pile", bodies, 1, [bodies] { return pile(bodies); }});
    }
    if (wanted(options, "worlds"))
        for (std::size_t count = 1; count <= options.mostWorlds; count *= options.quick ? 16 : 4)
            growing.push_back({"worlds", "worlds", count * kBodiesOfAWorld, count, [count] { return worlds(count); }});
    std::stable_sort(growing.begin(), growing.end(), [](const Case& a, const Case& b) { return a.bodies < b.bodies; });
    cases.insert(cases.end(), growing.begin(), growing.end());
    return cases;
}

cairn_params paramsOf(const Case& measured) {
    cairn_params params{};
    params.struct_size = sizeof params;
    if (const cairn_status status = cairn_params_preset(measured.method, CAIRN_PRESET_PAPER, &params); status != CAIRN_OK)
        throw Failure(status, cairn_last_error());
    params.iterations = measured.iterations;
    if (params.position_iterations > 0)
        params.position_iterations = measured.iterations;
    return params;
}

Measured measure(const Case& what, const Options& options, const Machine& machine) {
    const World world = what.make();
    const cairn_params params = paramsOf(what);
    std::vector<Runner> runners;
    for (const Cell& cell : cellsOf(what, options)) {
        Runner& runner = runners.emplace_back();
        runner.cell = cell;
        runner.cell.notMeasured = whyNot(cell, what, options, machine);
        if (!runner.cell.notMeasured.empty())
            continue;
        const std::uint32_t backend = cell.who == Who::gpu ? CAIRN_BACKEND_CUDA : CAIRN_BACKEND_CPU;
        runner.guarded([&] {
            runner.subject = cell.who == Who::stock ? stockSubject(world, static_cast<int>(what.iterations))
                                                    : cairnSubject(world, params, backend, cell.forced, options.threads);
        });
    }
    // In turn, so that all see the same machine.
    for (int round = -kWarmUps; round < options.runs; ++round)
        for (Runner& runner : runners)
            if (!runner.done(options.runs))
                runner.guarded([&] {
                    std::this_thread::sleep_for(kPause);
                    const Spent spent = runner.subject->step();
                    if (round < 0)
                        return;
                    runner.runs.push_back(spent);
                    runner.spent += spent.total;
                });
    Measured measured{what, world.bodies(), world.points(), world.joints(), {}};
    const bool compared = runners.front().subject != nullptr; // the CPU
    const std::uint64_t reference = compared ? runners.front().subject->hash() : 0;
    for (Runner& runner : runners) {
        runner.finish(world, params);
        if (compared && runner.subject && runner.cell.who == Who::gpu) {
            runner.cell.sameBits = runner.subject->hash() == reference;
            runner.cell.failed = !*runner.cell.sameBits;
        }
        measured.cells.push_back(runner.cell);
    }
    return measured;
}

Measured leftOut(const Case& what, const Options& options, const std::string& why) {
    Measured measured{what, what.bodies, 0, 0, cellsOf(what, options)};
    for (Cell& cell : measured.cells)
        cell.notMeasured = why;
    return measured;
}

} // namespace cairn_bench
