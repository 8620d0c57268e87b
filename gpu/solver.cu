// A step on the device: send what changed, pack, run the schedule, finish, fetch. Everything is queued on one stream; the host
// waits once, at the end.
#include "solver.h"

#include "../core/method/counts.h"
#include "../core/scene/fields.h"
#include "../core/scene/pack.h"
#include "../core/scene/settings.h"
#include "cache.h"
#include "check.h"
#include "device.h"
#include "execute.h"
#include "finish.h"
#include "pack.h"
#include "tables.h"

#include <chrono>
#include <cstring>

namespace cairn::gpu {

namespace {

using Clock = std::chrono::steady_clock;

// Estimates, until they are measured: the largest set of tied bodies and lanes that one block should sweep, and the most
// bodies and lanes for which the barrier of a grid is cheaper than launching kernels.
constexpr u32 kMostForBlock = 1024, kMostForGrid = 60000;
constexpr u32 kOneTile = 0xffffffffu;

template <class T> T* pinned(Buffer<Pinned>& buffer, std::size_t count) {
    buffer.reserve(count * sizeof(T));
    return reinterpret_cast<T*>(buffer.data());
}

class CudaSolver final : public Solver {
  public:
    explicit CudaSolver(const Config& config)
        : forced_(static_cast<Executor>(config.executor)), device_(current_device()), stream_(config.stream) {
        params = preset(Method::tjsoft, Preset::best);
        int clusters = 0;
        check(cudaDeviceGetAttribute(&facts_.multiprocessors, cudaDevAttrMultiProcessorCount, device_), "asking the device");
        check(cudaDeviceGetAttribute(&facts_.shared_bytes, cudaDevAttrMaxSharedMemoryPerBlockOptin, device_), "asking the device");
        check(cudaDeviceGetAttribute(&clusters, cudaDevAttrClusterLaunch, device_), "asking the device");
        facts_.clusters = clusters != 0;
    }
    ~CudaSolver() override {
        try {
            const Current current(device_);
            cudaStreamSynchronize(stream_);
        } catch (...) { // a device that is lost has no work left
        }
    }

    void begin(const Input& input, const Output& output) override {
        const Current current(device_);
        start_ = Clock::now();
        try {
            queue(input, output);
        } catch (...) {
            cudaStreamSynchronize(stream_); // what was queued still reads the staging memory
            throw;
        }
        input_ = input;
    }
    void finish() override {
        const Current current(device_);
        check(cudaStreamSynchronize(stream_), "solving");
        const Report& report = *report_;
        if (report.bad_input != 0)
            throw RefusedOnDevice(refused(report.bad_input));
        if (report.not_finite > 0)
            throw NotFinite("body " + std::to_string(input_.bodies.count - report.not_finite) + " is no longer finite");
        fetch_trace(report);
        Statistics now = statistics_of(report);
        results_.deliver(input_);
        cache_.swap(next_cache_);
        split_.swap(next_split_);
        trace_.swap(next_trace_);
        component_ = report.component;
        largest_ = quota_ == kOneTile ? Largest{} : Largest{report.tile_rows, report.tile_lanes};
        bodies_ = static_cast<u32>(input_.bodies.count);
        split_known_ = false;
        now.time_total = std::chrono::duration<double>(Clock::now() - start_).count();
        statistics_ = now;
    }
    int device() const override { return device_; }

    const Statistics& statistics() const override { return statistics_; }
    std::span<const double> residual_trace() const override { return trace_; }
    std::span<const std::uint32_t> split_counts() const override {
        if (!split_known_) {
            const Current current(device_);
            split_counts_.resize(bodies_);
            if (bodies_ > 0)
                check(cudaMemcpy(split_counts_.data(), split_.data(), bodies_ * sizeof(u32), cudaMemcpyDeviceToHost),
                      "fetching split counts");
            split_known_ = true;
        }
        return split_counts_;
    }
    void reset() override { cache_.forget(); }
    std::vector<std::byte> save_cache() const override {
        const Current current(device_);
        WarmStartCache cache;
        cache_.download(cache, stream_);
        return cache.save();
    }
    void load_cache(std::span<const std::byte> bytes) override {
        WarmStartCache cache;
        cache.load(bytes);
        const Current current(device_);
        DeviceCache fresh;
        fresh.upload(cache, stream_);
        cache_.swap(fresh);
    }

  private:
    struct Largest { // tile
        u32 rows, lanes;
    };

    void queue(const Input& input, const Output& output) {
        const Counts counts{static_cast<u32>(input.bodies.count), static_cast<u32>(input.contacts.count),
                            static_cast<u32>(input.joints.count), static_cast<u32>(input.rows.count)};
        make_room(counts, input.contacts.special());
        executor_ = choose(counts);
        quota_ = executor_ == Executor::block ? kTileQuota : kOneTile;

        began_.record(stream_);
        Request& request = *pinned<Request>(request_, 1);
        request = Request{};
        tables_.send(input, request.input, stream_);
        results_.prepare(input, output, request.output);
        solve_.frame = Frame<float>{};
        set_parameters(solve_.frame, params, input.dt);
        request.friction_model = params.friction_model;
        request.substeps = params.substeps;
        request.quota = quota_;
        request.points_count = params.splitting == Splitting::point ? 1 : 0;
        request.h = solve_.frame.h;
        request.contact_share = params.contact_warm_start;
        request.joint_share = params.joint_warm_start;
        check(cudaMemcpyAsync(layout_.request, &request, sizeof request, cudaMemcpyHostToDevice, stream_), "sending the step");
        sent_.record(stream_);

        clear(layout_.report, 1, stream_);
        check_tables(layout_, request.input, stream_);
        next_cache_.prepare(layout_.capacity, stream_);
        pack(layout_, counts, cache_.view(), params.residual_trace, stream_);
        packed_.record(stream_);

        const u32 elements = counts.elements();
        // NaNs: sweeps in which an island rests leave theirs
        if (params.residual_trace)
            check(cudaMemsetAsync(layout_.trace, 0xff, sizeof(float) * params.iterations * std::size_t{counts.bodies}, stream_),
                  "clearing the trace");
        set_pointers();
        solve_.plan = plan_of(params, elements > 0, input.contacts.count > 0 && input.contacts.restitution.present());
        if (executor_ == Executor::block)
            execute_in_blocks(solve_, counts.tiles(), rows_expected(counts), lanes_expected(elements), facts_, stream_);
        else if (executor_ == Executor::grid)
            execute_in_grid(solve_, elements > counts.bodies ? elements : counts.bodies, facts_, stream_);
        else
            graph_.execute(solve_, facts_, stream_);
        solved_.record(stream_);

        next_cache_.remember(layout_, solve_.frame.h, stream_);
        next_split_.reserve(counts.bodies * sizeof(u32)); // of its own: a step that fails leaves the last one's
        if (counts.bodies > 0)
            check(cudaMemcpyAsync(next_split_.data(), layout_.split, counts.bodies * sizeof(u32), cudaMemcpyDeviceToDevice, stream_),
                  "keeping split counts");
        gpu::finish(layout_, counts, stream_);
        finished_.record(stream_);
        results_.fetch(layout_.body_kind, stream_);
        report_ = pinned<Report>(report_memory_, 1);
        energy_ = pinned<double>(energy_memory_, counts.bodies / kEnergyChunk + 1);
        chunks_ = (counts.bodies + kEnergyChunk - 1) / kEnergyChunk;
        check(cudaMemcpyAsync(report_, layout_.report, sizeof *report_, cudaMemcpyDeviceToHost, stream_), "fetching the report");
        if (chunks_ > 0)
            check(cudaMemcpyAsync(energy_, layout_.energy_chunk, chunks_ * sizeof(double), cudaMemcpyDeviceToHost, stream_),
                  "fetching energies");
        fetched_.record(stream_);
    }

    // Of tables with a bad element, what the host needs to say which: columns in host memory.
    Input refused(u32 bad) {
        Input input = input_;
        copies_.clear();
        const auto copy = [&](auto& table, const auto& fields, u32 bit) {
            table.on_device = (bad & bit) != 0;
            for (const auto& field : fields) {
                Column& column = table.*field.column;
                if (!table.on_device || !column.on_device || !column.present())
                    continue;
                const std::ptrdiff_t span = static_cast<std::ptrdiff_t>(table.count - 1) * column.stride;
                const std::ptrdiff_t low = span < 0 ? span : 0;
                const std::size_t size = static_cast<std::size_t>(span - 2 * low) + field.components * size_of(column.type);
                copies_.emplace_back(size);
                check(cudaMemcpy(copies_.back().data(), column.data + low, size, cudaMemcpyDeviceToHost), "fetching a bad element");
                column.data = copies_.back().data() - low;
                column.on_device = false;
            }
        };
        copy(input.bodies, kBodyTable, kBadBodies);
        copy(input.contacts, kContactTable, kBadContacts);
        copy(input.joints, kJointTable, kBadJoints);
        copy(input.rows, kRowTable, kBadRows);
        return input;
    }

    // Grows by half at a time; what just suffices, where more cannot be had.
    void make_room(const Counts& n, bool special) {
        const Capacity needed{n, params.residual_trace ? params.iterations : 0, special ? n.contacts : 0};
        if (layout_.capacity.holds(needed) && memory_.data())
            return;
        const auto grown = [](u32 has, u32 needs) { return needs <= has ? has : needs > has + has / 2 ? needs : has + has / 2; };
        const Capacity& has = layout_.capacity;
        const Capacity wished{{grown(has.bodies, needed.bodies), grown(has.contacts, needed.contacts), grown(has.joints, needed.joints),
                               grown(has.rows, needed.rows)},
                              std::max(has.traced, needed.traced),
                              grown(has.special, needed.special)};
        layout_.capacity = {}; // whatever was there is gone
        try {
            take(wished);
        } catch (const OutOfDeviceMemory&) {
            take(needed);
        }
    }
    void take(const Capacity& capacity) {
        Layout fresh{};
        const std::size_t scratch = pack_scratch(capacity);
        memory_.reserve(carve(capacity, scratch, nullptr, fresh));
        carve(capacity, scratch, memory_.data(), fresh);
        layout_ = fresh;
    }

    Executor choose(const Counts& n) const {
        if (forced_ != Executor::automatic)
            return forced_;
        const u32 all = n.bodies + n.elements();
        if ((component_ > 0 ? component_ : all) <= kMostForBlock)
            return Executor::block;
        return all <= kMostForGrid ? Executor::grid : Executor::graph;
    }
    u32 rows_expected(const Counts& n) const { return largest_.rows > 0 ? largest_.rows : std::min(n.bodies + 1, kTileQuota); }
    u32 lanes_expected(u32 elements) const { return largest_.rows > 0 ? largest_.lanes : std::min(elements, 2 * kTileQuota); }

    void set_pointers() {
        Frame<float>& f = solve_.frame;
        const Layout& d = layout_;
        solve_.d = d;
        f.velocity = d.velocity;
        f.iterate = d.iterate;
        f.displacement = d.displacement;
        f.mass = d.mass;
        f.mass_cross = d.mass_cross;
        f.body = d.constants;
        f.body_island = d.body_island;
        f.slot_begin = d.slot_begin;
        f.slots = d.slots;
        f.rotation_clamped = d.clamped;
        f.energy_change = d.energy_change;
        f.contact = d.contact;
        f.contact_cold = d.contact_cold;
        f.contact_extra = d.contact_extra;
        f.joint = d.joint;
        f.joint_cold = d.joint_cold;
        f.raw = d.raw;
        f.lane_a = d.lane_a;
        f.lane_b = d.lane_b;
        f.slot_a = d.slot_a;
        f.slot_b = d.slot_b;
        f.lane_partial = d.lane_partial;
        f.lane_island = d.lane_island;
        f.lane_static = d.lane_static;
        f.partial_restart = d.partial_restart;
        f.partial_residual = d.partial_residual;
        f.island_begin = d.island_begin;
        f.island_bounces = d.island_bounces;
        f.control = d.control;
        f.trace = params.residual_trace ? d.trace : nullptr;
    }

    Statistics statistics_of(const Report& report) const {
        Statistics now;
        now.bodies = report.movable;
        now.contacts = report.contacts;
        now.manifolds = report.manifolds;
        now.joints = report.joints;
        now.rows = report.rows;
        now.islands = report.islands;
        Plan plan = solve_.plan;
        plan.constrained = report.manifolds + report.joints + report.rows > 0;
        Control<float> busiest{};
        busiest.sweeps[0] = report.any_sweeps;
        count_sweeps(plan, solve_.frame.reduces, &busiest, plan.constrained ? 1 : 0, now);
        if (solve_.frame.reduces)
            now.relax_iterations = report.sweeps[1];
        now.restitution_iterations = report.sweeps[2];
        now.warm_started = report.warm_started;
        now.rotation_clamped = report.rotation_clamped;
        now.threads = 1; // of the host
        now.backend = Backend::cuda;
        now.executor = static_cast<u32>(executor_);
        for (u32 i = 0; i < chunks_; ++i)
            now.kinetic_energy_change += energy_[i];
        if (!next_trace_.empty())
            now.residual = next_trace_.back();
        now.time_upload = sent_.since(began_);
        now.time_pack = packed_.since(sent_);
        now.time_sweep = solved_.since(packed_);
        now.time_finish = finished_.since(solved_);
        now.time_download = fetched_.since(finished_);
        return now;
    }

    // A diagnosis: asked for, it costs a copy of its own.
    void fetch_trace(const Report& report) {
        next_trace_.clear();
        const std::size_t islands = report.islands, squares = std::size_t{solve_.plan.iterations} * islands;
        if (!solve_.frame.trace || squares == 0)
            return;
        std::vector<float> found(squares), ordered(squares);
        std::vector<u32> rank(islands);
        check(cudaMemcpyAsync(found.data(), layout_.trace, squares * sizeof(float), cudaMemcpyDeviceToHost, stream_), "fetching the trace");
        check(cudaMemcpyAsync(rank.data(), layout_.island_rank, islands * sizeof(u32), cudaMemcpyDeviceToHost, stream_),
              "fetching the trace");
        check(cudaStreamSynchronize(stream_), "fetching the trace");
        for (std::size_t sweep = 0; sweep < solve_.plan.iterations; ++sweep)
            for (std::size_t i = 0; i < islands; ++i)
                ordered[sweep * islands + rank[i]] = found[sweep * islands + i];
        trace_sweeps(solve_.plan, ordered.data(), islands, next_trace_);
    }

    static int current_device() {
        int device = 0;
        check(cudaGetDevice(&device), "asking for the device");
        return device;
    }

    Executor forced_, executor_ = Executor::automatic;
    int device_;
    DeviceFacts facts_{};
    Stream stream_;
    Event began_, sent_, packed_, solved_, finished_, fetched_;
    Buffer<OnDevice> memory_;
    Layout layout_{};
    DeviceTables tables_;
    DeviceResults results_;
    DeviceCache cache_, next_cache_;
    Buffer<OnDevice> split_, next_split_;
    GraphExecutor graph_;
    Solve solve_{};
    Clock::time_point start_;
    Input input_; // of the step in flight
    std::vector<std::vector<std::byte>> copies_;
    Buffer<Pinned> request_, report_memory_, energy_memory_;
    Report* report_ = nullptr;
    double* energy_ = nullptr;
    u32 chunks_ = 0, quota_ = kOneTile, component_ = 0, bodies_ = 0;
    Largest largest_{};
    Statistics statistics_;
    std::vector<double> trace_, next_trace_;
    mutable std::vector<u32> split_counts_;
    mutable bool split_known_ = true;
};

} // namespace

std::unique_ptr<Solver> create_solver(const Config& config) {
    if (!available())
        throw Unsupported(cuda_state());
    return std::make_unique<CudaSolver>(config);
}

} // namespace cairn::gpu
