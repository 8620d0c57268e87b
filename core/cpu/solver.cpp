// The CPU's executor: stages over SIMD lanes and threads.
#include "../solver.h"

#include "../../gpu/solver.h"

#include "../method/counts.h"
#include "../method/schedule.h"
#include "../scene/scene.h"
#include "kernels.h"
#include "pool.h"

#include <array>
#include <chrono>
#include <cmath>
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

// What is solved with one set of parameters: the whole step, or under `auto` the islands that go by one schedule.
template <class S> struct Part {
    explicit Part(const Hooks& hooks) : scene(hooks) {}

    void solve(const Input& input, const WarmStartCache& cache, const Selection* selection, Pool& pool, RunStage<S> stage_entry,
               Statistics& now) {
        const Clock::time_point start = Clock::now();
        scene.pack(input, params, cache, selection);
        Frame<S>& f = scene.frame;
        now.time_pack += seconds_since(start);
        plan = plan_of(params, f.contact_groups + f.joint_groups + f.raw_groups > 0, scene.bounces);
        if (selection) {
            Control<S>* control = f.control;
            for (const Survey::Island& island : selection->survey->islands)
                if (island.reason == selection->reason) {
                    control->stop = static_cast<S>(params.tolerance * params.tolerance * island_scale(island.features));
                    control->violent = params.tolerance > 0 ? static_cast<S>(kViolent * kViolent * violent_scale(island.features)) : S(0);
                    ++control;
                }
            const Schedule& schedule = schedule_of(selection->reason);
            plan.least = schedule.least;
            plan.enough = schedule.enough;
            f.reduces = plan.stops = true;
        }
        counted = f.reduces;
        CpuExecutor<S> run{f, pool, stage_entry, now};
        run_schedule(run, plan);
        if (const std::string bad = scene.not_finite(); !bad.empty())
            throw NotFinite(bad);
    }
    void count(Statistics& to) const {
        const Frame<S>& f = scene.frame;
        to.bodies += f.movable_count;
        to.contacts += scene.contacts;
        to.manifolds += scene.manifolds;
        to.joints += scene.joints;
        to.rows += scene.rows;
        to.islands += f.island_count;
        count_sweeps(plan, counted, f.control, f.island_count, to);
        for (std::uint32_t chunk = 0; chunk < f.body_count; chunk += kEnergyChunk)
            to.kinetic_energy_change +=
                std::accumulate(f.energy_change + chunk, f.energy_change + std::min(chunk + kEnergyChunk, f.body_count), 0.0);
        to.warm_started += scene.warm_started;
        for (std::uint32_t i = 0; i < f.body_count; ++i)
            to.rotation_clamped += f.rotation_clamped[i];
    }

    Scene<S> scene;
    Params params{};
    Plan plan{};
    bool counted = false; // sweeps, by islands; else every one sweeps every time
};

template <class S> class SolverOf final : public Solver {
  public:
    SolverOf(const Config& config, Isa isa, RunStage<S> stage_entry)
        : hooks_(config.hooks), isa_(isa), stage_entry_(stage_entry), pool_(config.threads, hooks_) {
        params = preset(Method::tjsoft, Preset::best);
    }

    void begin(const Input& input, const Output& output) override { // to the end: there is nothing to wait for
        const Clock::time_point start = Clock::now();
        Statistics now;
        if (params.method == Method::automatic)
            solve_by_kind(input, now);
        else
            solve_alike(input, now);

        const Clock::time_point finish = Clock::now();
        next_cache_.clear();
        next_trace_.clear();
        next_split_counts_.assign(input.bodies.count, 0);
        double square = 0; // of the last sweeps' residuals
        for (const std::uint32_t p : used_) {
            Part<S>& part = *parts_[p];
            part.scene.remember(input, next_cache_);
            trace_sweeps(part.plan, part.scene.frame.trace, part.scene.frame.island_count, part_trace_);
            next_trace_.insert(next_trace_.end(), part_trace_.begin(), part_trace_.end());
            if (!part_trace_.empty())
                square += part_trace_.back() * part_trace_.back();
            part.count(now);
            for (std::size_t i = 0; i < next_split_counts_.size(); ++i)
                next_split_counts_[i] += part.scene.split_counts[i];
        }
        next_cache_.index();
        now.residual = used_.size() == 1 && !part_trace_.empty() ? part_trace_.back() : std::sqrt(square);
        now.threads = pool_.threads();
        now.isa = isa_;

        Scene<S>::clear(input, output); // no allocation from here on
        for (const std::uint32_t p : used_)
            parts_[p]->scene.write(input, output);
        std::swap(cache_, next_cache_);
        now.time_finish += seconds_since(finish);
        now.time_total = seconds_since(start);
        statistics_ = now;
        trace_.swap(next_trace_);
        split_counts_.swap(next_split_counts_);
        choices_.swap(next_choices_);
    }

    Pool* pool() override { return &pool_; }
    const Statistics& statistics() const override { return statistics_; }
    std::span<const double> residual_trace() const override { return trace_; }
    std::span<const std::uint32_t> split_counts() const override { return split_counts_; }
    bool chooses() const override { return true; }
    std::span<const Choice> choices() const override { return choices_; }
    void reset() override { cache_.clear(); }
    std::vector<std::byte> save_cache() const override { return cache_.save(); }
    void load_cache(std::span<const std::byte> bytes) override { cache_.load(bytes); }

  private:
    void solve_alike(const Input& input, Statistics& now) {
        used_.clear();
        next_choices_.clear();
        solve_part(0, params, input, nullptr, now);
    }

    // Islands are independent: those of one kind after those of another, each kind packed alone.
    void solve_by_kind(const Input& input, Statistics& now) {
        const Clock::time_point start = Clock::now();
        survey_.look(input);
        std::array<bool, kReasonCount> found{};
        for (const Survey::Island& island : survey_.islands)
            found[static_cast<std::size_t>(island.reason)] = true;
        now.time_pack += seconds_since(start);
        used_.clear();
        for (std::uint32_t kind = 0; kind < kReasonCount; ++kind)
            if (found[kind]) {
                const Selection selection{&survey_, static_cast<Reason>(kind)};
                solve_part(kind, params_of(selection.reason, params), input, &selection, now);
            }
        next_choices_.clear();
        std::array<std::uint32_t, kReasonCount> next{}; // island of a part
        for (const Survey::Island& island : survey_.islands) {
            const auto kind = static_cast<std::size_t>(island.reason);
            const Part<S>& part = *parts_[kind];
            const std::uint32_t i = next[kind]++;
            const Control<S>& control = part.scene.frame.control[i];
            const bool swept = island.reason != Reason::alone;
            next_choices_.push_back({island.first_body, island.features.bodies, island.reason, part.params.method, part.params.substeps,
                                     swept ? part.params.iterations : 0, swept ? control.sweeps[0] + control.sweeps[1] : 0,
                                     !swept || control.ended < control.stop,
                                     std::sqrt(static_cast<double>(control.ended) / island_scale(island.features))});
        }
    }

    void solve_part(std::uint32_t p, const Params& with, const Input& input, const Selection* selection, Statistics& now) {
        while (parts_.size() <= p)
            parts_.push_back(std::make_unique<Part<S>>(hooks_));
        parts_[p]->params = with;
        used_.push_back(p);
        parts_[p]->solve(input, cache_, selection, pool_, stage_entry_, now);
    }

    Hooks hooks_;
    Isa isa_;
    RunStage<S> stage_entry_;
    Pool pool_;
    Survey survey_;
    std::vector<std::unique_ptr<Part<S>>> parts_; // by kind; without `auto` the first alone
    std::vector<std::uint32_t> used_;             // parts of the step
    WarmStartCache cache_, next_cache_;
    Statistics statistics_;
    std::vector<double> trace_, next_trace_, part_trace_;
    std::vector<std::uint32_t> split_counts_, next_split_counts_;
    std::vector<Choice> choices_, next_choices_;
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
