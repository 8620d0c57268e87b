// The CPU's executor: stages over SIMD lanes and threads.
#include "../solver.h"

#include "../../gpu/solver.h"

#include "../method/counts.h"
#include "../method/schedule.h"
#include "../scene/scene.h"
#include "kernels.h"
#include "pool.h"

#include <chrono>
#include <numeric>

namespace cairn {

namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

template <class S> struct CpuExecutor {
    Frame<S>& frame;
    Pool& pool;
    RunStage<S> stage_entry;
    Statistics& statistics;

    void each(Stage stage) {
        const Clock::time_point start = Clock::now();
        const auto loop = [&](std::uint32_t begin, std::uint32_t end) { stage_entry(stage, frame, begin, end); };
        switch (domain_of(stage)) {
        case Domain::groups:
            pool.each(frame.contact_groups + frame.joint_groups + frame.raw_groups, 4, loop);
            break;
        case Domain::movable:
            pool.each(frame.movable_count, 64, loop);
            break;
        case Domain::moving:
            pool.each(frame.moving_count, 64, loop);
            break;
        case Domain::islands:
            pool.each(frame.island_count, 16, loop);
            break;
        }
        *clock_of(stage) += seconds_since(start);
    }
    double* clock_of(Stage stage) const {
        switch (stage) {
        case Stage::begin:
        case Stage::build:
        case Stage::apply_start:
            return frame.phase != Phase::restitution ? &statistics.time_build : &statistics.time_finish;
        case Stage::sweep:
        case Stage::reduce:
        case Stage::apply:
            return frame.phase != Phase::restitution ? &statistics.time_sweep : &statistics.time_finish;
        case Stage::position_sweep:
        case Stage::position_apply:
            return &statistics.time_position;
        case Stage::inertia:
        case Stage::forces:
        case Stage::energy_before:
        case Stage::energy_after:
        case Stage::integrate:
            return &statistics.time_integrate;
        default:
            return &statistics.time_finish;
        }
    }
    bool rests() const {
        for (std::uint32_t i = 0; i < frame.island_count; ++i)
            if (frame.control[i].active > 0)
                return false;
        return true;
    }
};

template <class S> class SolverOf final : public Solver {
  public:
    SolverOf(const Config& config, Isa isa, RunStage<S> stage_entry)
        : hooks_(config.hooks), isa_(isa), stage_entry_(stage_entry), pool_(config.threads, hooks_), scene_(hooks_) {
        params = preset(Method::tjsoft, Preset::best);
    }

    void begin(const Input& input, const Output& output) override { // to the end: there is nothing to wait for
        const Clock::time_point start = Clock::now();
        Statistics now;
        scene_.pack(input, params, cache_);
        Frame<S>& f = scene_.frame;
        now.time_pack = seconds_since(start);

        const bool constrained = f.contact_groups + f.joint_groups + f.raw_groups > 0;
        const Plan plan = plan_of(params, constrained, scene_.bounces);
        const bool counted = f.reduces; // by islands; else every one sweeps every time
        CpuExecutor<S> run{f, pool_, stage_entry_, now};
        run_schedule(run, plan);
        if (const std::string bad = scene_.not_finite(); !bad.empty())
            throw NotFinite(bad);

        const Clock::time_point finish = Clock::now();
        scene_.remember(input, next_cache_);
        trace_sweeps(plan, f.trace, f.island_count, next_trace_);
        scene_.write(input, output);
        std::swap(cache_, next_cache_);
        now.bodies = f.movable_count;
        now.contacts = scene_.contacts;
        now.manifolds = scene_.manifolds;
        now.joints = scene_.joints;
        now.rows = scene_.rows;
        now.islands = f.island_count;
        now.substeps = plan.substeps;
        count_sweeps(plan, counted, f.control, f.island_count, now);
        for (std::uint32_t chunk = 0; chunk < f.body_count; chunk += kEnergyChunk)
            now.kinetic_energy_change +=
                std::accumulate(f.energy_change + chunk, f.energy_change + std::min(chunk + kEnergyChunk, f.body_count), 0.0);
        now.warm_started = scene_.warm_started;
        for (std::uint32_t i = 0; i < f.body_count; ++i)
            now.rotation_clamped += f.rotation_clamped[i];
        now.threads = pool_.threads();
        now.isa = isa_;
        if (!next_trace_.empty())
            now.residual = next_trace_.back();
        now.time_finish += seconds_since(finish);
        now.time_total = seconds_since(start);
        statistics_ = now;
        trace_.swap(next_trace_);
        split_counts_.swap(scene_.split_counts); // no allocation once results are written
    }

    Pool* pool() override { return &pool_; }
    const Statistics& statistics() const override { return statistics_; }
    std::span<const double> residual_trace() const override { return trace_; }
    std::span<const std::uint32_t> split_counts() const override { return split_counts_; }
    void reset() override { cache_.clear(); }
    std::vector<std::byte> save_cache() const override { return cache_.save(); }
    void load_cache(std::span<const std::byte> bytes) override { cache_.load(bytes); }

  private:
    Hooks hooks_;
    Isa isa_;
    RunStage<S> stage_entry_;
    Pool pool_;
    Scene<S> scene_;
    WarmStartCache cache_, next_cache_;
    Statistics statistics_;
    std::vector<double> trace_, next_trace_;
    std::vector<std::uint32_t> split_counts_;
};

#if defined(__x86_64__)
bool has(Isa isa) {
    __builtin_cpu_init();
    switch (isa) {
    case Isa::avx2:
        return __builtin_cpu_supports("avx2");
    case Isa::avx512:
        return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512dq") &&
               __builtin_cpu_supports("avx512bw");
    default:
        return true;
    }
}
#else
bool has(Isa isa) { return isa == Isa::scalar || isa == Isa::sse2; } // "sse2" is four lanes of whatever there is
#endif

RunStage<float> entry_of(Isa isa) {
    switch (isa) {
#if defined(__x86_64__)
    case Isa::avx2:
        return kernels_avx2::run_stage;
    case Isa::avx512:
        return kernels_avx512::run_stage;
#endif
    case Isa::sse2:
        return kernels_sse2::run_stage;
    default:
        return kernels_scalar::run_stage;
    }
}

} // namespace

Isa Solver::widest() {
    for (const Isa isa : {Isa::avx512, Isa::avx2, Isa::sse2})
        if (has(isa))
            return isa;
    return Isa::scalar;
}

std::unique_ptr<Solver> Solver::create(const Config& config) {
#ifdef CAIRN_CUDA
    if (config.backend == Backend::cuda)
        return gpu::create_solver(config);
#endif
    if (config.double_precision)
        return std::make_unique<SolverOf<double>>(config, Isa::scalar, kernels_f64::run_stage);
    const Isa isa = config.isa == Isa::automatic ? widest() : config.isa;
    if (!has(isa))
        throw Unsupported("this processor lacks the instruction set that was asked for");
    return std::make_unique<SolverOf<float>>(config, isa, entry_of(isa));
}

} // namespace cairn
