// What a contact-iteration costs, beside stock Bullet: one contact point in one velocity sweep, with all that a step needs
// around the sweeps shared out over them.
//   ./dev bench                                                the table
//   ./dev bench -- --benchmark_out=bench.json                  and every repetition as JSON
//   ./dev bench -- --benchmark_filter="PJ, paper, AVX2"      some of it (stock Bullet always runs alongside)
// Every iteration of a benchmark steps a stock world, then the world measured, so that both see the same machine; the
// repetitions of all benchmarks are shuffled for the same reason.
#include "gpu/traffic.h"
#include "machine.h"
#include "stack_world.h"
#include "triad.h"

#include <benchmark/benchmark.h>

#include <algorithm>
#include <cstdio>
#include <map>
#include <string>
#include <thread>

namespace cairn_bench {
namespace {

constexpr int kSettlingSteps = 60, kSteps = 20, kRepetitions = 7;
constexpr double kMovableBodies = 125;

class Subject {
  public:
    virtual ~Subject() = default;
    virtual Cost step() = 0;
    double drift() const { return m_world->worstDrift(); }

  protected:
    void settle() {
        for (int i = 0; i < kSettlingSteps; ++i)
            step();
    }
    std::unique_ptr<StackWorld> m_world;
};

class Stock final : public Subject {
  public:
    explicit Stock(bool twoFrictionDirections) {
        auto solver = std::make_unique<StockSolver>();
        m_solver = solver.get();
        m_world = std::make_unique<StackWorld>(std::move(solver), twoFrictionDirections);
        settle();
    }
    Cost step() override {
        m_world->step();
        return m_solver->cost;
    }

  private:
    StockSolver* m_solver;
};

struct Variant {
    const char* name;
    uint32_t method, preset, threads, instructions;
};

cairn_config configOf(const Variant& variant) {
    cairn_config config = {};
    config.struct_size = sizeof config;
    config.threads = variant.threads;
    config.instructions = variant.instructions;
    return config;
}

class Cairn final : public Subject {
  public:
    explicit Cairn(const Variant& variant) {
        const cairn_config config = configOf(variant);
        auto solver = std::make_unique<Timed<cairn::bullet::ConstraintSolver>>(variant.method, variant.preset, &config);
        m_solver = solver.get();
        m_world = std::make_unique<StackWorld>(std::move(solver));
        settle();
    }
    Cost step() override {
        m_world->step();
        if (m_solver->lastStatus() != CAIRN_OK)
            throw std::runtime_error(m_solver->lastError());
        Cost cost = m_solver->cost;
        const cairn_statistics statistics = m_solver->statistics();
        cost.sweep = statistics.time_sweep;
        cost.points = statistics.contacts;
        cost.rows = statistics.rows;
        cost.manifolds = statistics.manifolds;
        cost.iterations = statistics.iterations;
        return cost;
    }

  private:
    Timed<cairn::bullet::ConstraintSolver>* m_solver;
};

Stock& reference() {
    static Stock stock(false);
    return stock;
}

double nanoseconds(double seconds, const Cost& cost) { return 1e9 * seconds / (cost.iterations * cost.points); }
void add(Cost& sum, const Cost& cost) {
    sum.seconds += cost.seconds / kSteps;
    sum.cpu += cost.cpu / kSteps;
    sum.sweep += cost.sweep / kSteps;
    sum.points += cost.points / kSteps;
    sum.rows += cost.rows / kSteps;
    sum.manifolds += cost.manifolds / kSteps;
    sum.iterations += cost.iterations / kSteps;
}

void measure(benchmark::State& state, Subject& subject) {
    Cost stock, cost; // of a mean step
    for ([[maybe_unused]] auto _ : state) {
        add(stock, reference().step());
        const Cost step = subject.step();
        state.SetIterationTime(step.seconds);
        add(cost, step);
    }
    state.counters["points"] = cost.points;
    state.counters["rows"] = cost.rows;
    state.counters["manifolds"] = cost.manifolds;
    state.counters["iterations"] = cost.iterations;
    state.counters["ns"] = nanoseconds(cost.seconds, cost);
    state.counters["cpu_ns"] = nanoseconds(cost.cpu, cost);
    state.counters["sweep_ns"] = nanoseconds(cost.sweep, cost);
    state.counters["stock_ns"] = nanoseconds(stock.seconds, stock);
    state.counters["ratio"] = nanoseconds(cost.seconds, cost) / nanoseconds(stock.seconds, stock);
    state.counters["time_ratio"] = cost.seconds / stock.seconds;
    state.counters["drift_mm"] = 1e3 * subject.drift();
}

template <class Make> void add(const char* name, Make make) {
    auto subject = std::make_shared<std::unique_ptr<Subject>>(); // made when first needed, kept over the repetitions
    benchmark::RegisterBenchmark(name,
                                 [subject, make](benchmark::State& state) {
                                     if (!*subject)
                                         *subject = make();
                                     measure(state, **subject);
                                 })
        ->UseManualTime()
        ->Iterations(kSteps)
        ->Repetitions(kRepetitions)
        ->Unit(benchmark::kMillisecond);
}

bool available(const Variant& variant) {
    const cairn_config config = configOf(variant);
    cairn_solver* solver = nullptr;
    const bool made = cairn_solver_create(&config, &solver) == CAIRN_OK;
    cairn_solver_destroy(solver);
    return made;
}

const Variant kVariants[] = {
    {"PJ, paper", CAIRN_METHOD_PJ, CAIRN_PRESET_PAPER, 1, CAIRN_ISA_AUTO},
    {"PJ", CAIRN_METHOD_PJ, CAIRN_PRESET_DEFAULT, 1, CAIRN_ISA_AUTO},
    {"PJSoft", CAIRN_METHOD_PJSOFT, CAIRN_PRESET_DEFAULT, 1, CAIRN_ISA_AUTO},
    {"TJ", CAIRN_METHOD_TJ, CAIRN_PRESET_DEFAULT, 1, CAIRN_ISA_AUTO},
    {"TJSoft", CAIRN_METHOD_TJSOFT, CAIRN_PRESET_DEFAULT, 1, CAIRN_ISA_AUTO},
    {"PJ, paper, all threads", CAIRN_METHOD_PJ, CAIRN_PRESET_PAPER, 0, CAIRN_ISA_AUTO},
    {"TJSoft, all threads", CAIRN_METHOD_TJSOFT, CAIRN_PRESET_DEFAULT, 0, CAIRN_ISA_AUTO},
    {"PJ, paper, scalar", CAIRN_METHOD_PJ, CAIRN_PRESET_PAPER, 1, CAIRN_ISA_SCALAR},
    {"PJ, paper, SSE2", CAIRN_METHOD_PJ, CAIRN_PRESET_PAPER, 1, CAIRN_ISA_SSE2},
    {"PJ, paper, AVX2", CAIRN_METHOD_PJ, CAIRN_PRESET_PAPER, 1, CAIRN_ISA_AVX2},
    {"PJ, paper, AVX-512", CAIRN_METHOD_PJ, CAIRN_PRESET_PAPER, 1, CAIRN_ISA_AVX512},
};

// The table, from the medians, at the end. --benchmark_out keeps every repetition.
class Table final : public benchmark::BenchmarkReporter {
  public:
    bool ReportContext(const Context&) override { return true; }
    void ReportRuns(const std::vector<Run>& runs) override {
        for (const Run& run : runs)
            if (run.aggregate_name == "median")
                m_medians[run.run_name.function_name] = run;
    }
    void Finalize() override {
        std::printf("%-24s %7s %6s %6s %9s %9s %9s %8s %8s %9s %9s\n", "", "points", "rows", "sweeps", "ms/step", "ns", "sweep ns",
                    "cpu ns", "ratio", "of time", "drift mm");
        for (const char* name : {"stock Bullet", "stock, 2 directions"})
            row(name);
        for (const Variant& variant : kVariants)
            row(variant.name);
        floor();
    }

  private:
    void row(const char* name) const {
        const auto found = m_medians.find(name);
        if (found == m_medians.end())
            return;
        const auto value = [&](const char* counter) { return found->second.counters.at(counter).value; };
        std::printf("%-24s %7.0f %6.0f %6.0f %9.3f %9.2f %9.2f %8.2f %8.2f %9.2f %9.2f\n", name, value("points"), value("rows"),
                    value("iterations"), found->second.GetAdjustedRealTime(), value("ns"), value("sweep_ns"), value("cpu_ns"),
                    value("ratio"), value("time_ratio"), value("drift_mm"));
    }

    // What the sweeps must move, as gpu/traffic.h counts it, beside what the processor can.
    void floor() const {
        const auto found = m_medians.find("PJ, paper");
        if (found == m_medians.end())
            return;
        const auto value = [&](const char* counter) { return found->second.counters.at(counter).value; };
        Load load;
        load.points = value("points");
        load.manifolds = value("manifolds");
        load.movableSides = 2 * load.manifolds; // few stand on the plane
        load.bodies = kMovableBodies;
        cairn_params params = {};
        params.struct_size = sizeof params;
        if (cairn_params_preset(CAIRN_METHOD_PJ, CAIRN_PRESET_PAPER, &params) != CAIRN_OK)
            return;
        const double points = load.points, bytes = sweepBytes(load, params, false) / points;
        const double bandwidth = triadBandwidth(static_cast<std::size_t>(bytes * points));
        const double fastest = 1e9 * bytes / bandwidth;
        std::printf("\nFloor of PJ, paper: a sweep moves %.0f bytes a point (%.0f its own, the rest its share of manifolds and bodies), "
                    "%.0f KiB in all.\nA triad of that size moves %.1f GB/s on one thread: at least %.2f ns. Measured: %.2f ns in the "
                    "sweeps, %.1f GB/s, %.1f times the floor;\n%.2f ns with all else, %.1f times.\n",
                    bytes, pointBytes(params), bytes * points / 1024, bandwidth / 1e9, fastest, value("sweep_ns"),
                    bytes / value("sweep_ns"), value("sweep_ns") / fastest, value("ns"), value("ns") / fastest);
    }

    std::map<std::string, Run> m_medians;
};

void printHeader(const std::string& cores, const char* build) {
    std::printf("%s, %s; %s; Bullet %s\n", processor().c_str(), cores.c_str(), build, bulletDescription().c_str());
    std::printf("stack-1m behind Bullet: 125 boxes, dt 16 ms, %d iterations a step, one thread unless it says all; settled %d steps, then\n"
                "medians of %d repetitions of %d steps, stock Bullet stepping in turn with each.\n",
                kIterations, kSettlingSteps, kRepetitions, kSteps);
    std::printf("ns: the solver's wall-clock time for a contact point and iteration, set-up and copies included; sweep ns: the iterations\n"
                "alone; cpu ns: processor time; ratio: ns against stock Bullet's in the same steps; of time: the step's solver time\n"
                "likewise; drift: of the worst box, all steps.\n\n");
    std::fflush(stdout);
}

} // namespace
} // namespace cairn_bench

int main(int argc, char** argv) {
    using namespace cairn_bench;
    std::vector<char*> arguments(argv, argv + argc);
    std::string shuffle = "--benchmark_enable_random_interleaving=true";
    arguments.insert(arguments.begin() + 1, shuffle.data()); // before the user's, which may undo it
    arguments.push_back(nullptr);
    int count = argc + 1;
    benchmark::Initialize(&count, arguments.data());
    if (benchmark::ReportUnrecognizedArguments(count, arguments.data()))
        return 1;

    cairn_info info = {};
    info.struct_size = sizeof info;
    if (cairn_get_info(&info) != CAIRN_OK) {
        std::fprintf(stderr, "cairn_bench: %s\n", cairn_last_error());
        return 1;
    }
    const std::string cores = std::to_string(std::thread::hardware_concurrency()) + " cores";
    benchmark::AddCustomContext("cairn_build", info.build);
    benchmark::AddCustomContext("cpu", processor());
    printHeader(cores, info.build);

    add("stock Bullet", [] { return std::make_unique<Stock>(false); });
    add("stock, 2 directions", [] { return std::make_unique<Stock>(true); });
    for (const Variant& variant : kVariants) {
        if (available(variant))
            add(variant.name, [&variant] { return std::make_unique<Cairn>(variant); });
        else
            std::printf("%s: this processor has no such instructions\n", variant.name);
    }
    Table table;
    std::size_t run = 0;
    try {
        run = benchmark::RunSpecifiedBenchmarks(&table);
    } catch (const std::exception& error) { // libcairn refused a step
        std::fprintf(stderr, "cairn_bench: %s\n", error.what());
    }
    benchmark::Shutdown();
    return run > 0 ? 0 : 1;
}
