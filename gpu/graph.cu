#include "execute.h"

#include <cstring>

namespace cairn::gpu {

namespace {

constexpr std::size_t kMostNodes = 20000; // beyond, a graph takes longer to make than to run: then kernels are launched one by one

enum class Lanes { contacts, joints, raws };

template <Stage stage, Lanes kind> __global__ void __launch_bounds__(kThreads) lanes_kernel(const __grid_constant__ Solve solve) {
    const Layout& d = solve.d;
    if (d.report->bad_input != 0)
        return;
    const Tile tile = d.tile[0];
    const u32 joints = tile.contacts.size(), raws = joints + tile.joints.size();
    const u32 begin = kind == Lanes::contacts ? 0 : kind == Lanes::joints ? joints : raws;
    const u32 end = kind == Lanes::contacts ? joints : kind == Lanes::joints ? raws : raws + tile.raws.size();
    for (u32 i = begin + blockIdx.x * blockDim.x + threadIdx.x; i < end; i += gridDim.x * blockDim.x)
        run_lane<static_cast<int>(kind)>(stage, solve.frame, d, tile, i);
}

template <Stage stage> __global__ void __launch_bounds__(kThreads) rows_kernel(const __grid_constant__ Solve solve) {
    if (solve.d.report->bad_input != 0)
        return;
    const Range rows = domain_of(stage) == Domain::moving ? solve.d.tile[0].moving : solve.d.tile[0].movable;
    for (u32 row = rows.begin + blockIdx.x * blockDim.x + threadIdx.x; row < rows.end; row += gridDim.x * blockDim.x)
        run_body(stage, solve.frame, row);
}

template <Stage stage> __global__ void __launch_bounds__(kThreads) islands_kernel(const __grid_constant__ Solve solve) {
    if (solve.d.report->bad_input != 0)
        return;
    Frame<float> f = solve.frame;
    f.island_count = solve.d.report->islands;
    run_islands(stage, f, solve.d, solve.d.tile[0], GridTeam{});
}

// The schedule's stages as launches.
struct Launches {
    Solve solve;
    cudaStream_t stream;
    u32 most_blocks;
    Frame<float>& frame = solve.frame;

    void run(void (*kernel)(Solve), u32 count) const {
        const u32 wanted = blocks_for(count);
        launch(stream, wanted < most_blocks ? wanted : most_blocks, kThreads, 0, kernel, solve);
    }
    template <Stage stage> void lanes() const {
        const Capacity& c = solve.d.capacity;
        if (c.contacts > 0)
            run(lanes_kernel<stage, Lanes::contacts>, c.contacts);
        if (c.joints > 0)
            run(lanes_kernel<stage, Lanes::joints>, c.joints);
        if (c.rows > 0)
            run(lanes_kernel<stage, Lanes::raws>, c.rows);
    }
    template <Stage stage> void rows() const { run(rows_kernel<stage>, solve.d.capacity.bodies); }
    template <Stage stage> void islands() const { run(islands_kernel<stage>, solve.d.capacity.bodies); }

    void each(Stage stage) const {
        switch (stage) {
        case Stage::approach:
            return lanes<Stage::approach>();
        case Stage::bouncing:
            return islands<Stage::bouncing>();
        case Stage::inertia:
            return rows<Stage::inertia>();
        case Stage::forces:
            return rows<Stage::forces>();
        case Stage::energy_before:
            return rows<Stage::energy_before>();
        case Stage::energy_after:
            return rows<Stage::energy_after>();
        case Stage::build:
            return lanes<Stage::build>();
        case Stage::begin:
            return islands<Stage::begin>();
        case Stage::apply_start:
            return rows<Stage::apply_start>();
        case Stage::sweep:
            return lanes<Stage::sweep>();
        case Stage::reduce:
            return islands<Stage::reduce>();
        case Stage::apply:
            return rows<Stage::apply>();
        case Stage::integrate:
            return rows<Stage::integrate>();
        case Stage::position_sweep:
            return lanes<Stage::position_sweep>();
        case Stage::position_apply:
            return rows<Stage::position_apply>();
        case Stage::accumulate:
            return lanes<Stage::accumulate>();
        case Stage::keep:
            return lanes<Stage::keep>();
        }
    }
    bool rests() const { return false; } // the host does not know
};

} // namespace

void GraphExecutor::execute(const Solve& solve, const DeviceFacts& device, cudaStream_t stream) {
    constexpr u32 blocks_each = 8; // of an SM; more only wait
    Launches run{solve, stream, blocks_each * static_cast<u32>(device.multiprocessors)};
    const Plan& plan = solve.plan;
    const std::size_t nodes =
        5 * (std::size_t{plan.iterations} + std::size_t{plan.substeps} * (plan.position_iterations + 4) + plan.restitution_iterations);
    if (nodes > kMostNodes)
        return run_schedule(run, plan);
    const auto* const bytes = reinterpret_cast<const std::byte*>(&solve);
    if (!graph_ || std::memcmp(captured_.data(), bytes, sizeof solve) != 0) {
        forget();
        check(cudaStreamBeginCapture(capture_, cudaStreamCaptureModeThreadLocal), "beginning a graph");
        cudaGraph_t graph = nullptr;
        run.stream = capture_;
        try {
            run_schedule(run, plan);
        } catch (...) {
            cudaStreamEndCapture(capture_, &graph);
            if (graph)
                cudaGraphDestroy(graph);
            throw;
        }
        check(cudaStreamEndCapture(capture_, &graph), "ending a graph");
        const cudaError_t made = cudaGraphInstantiate(&graph_, graph, 0);
        cudaGraphDestroy(graph);
        check(made, "making a graph");
        captured_.assign(bytes, bytes + sizeof solve);
    }
    check(cudaGraphLaunch(graph_, stream), "launching a graph");
}

void GraphExecutor::forget() {
    if (graph_)
        cudaGraphExecDestroy(graph_);
    graph_ = nullptr;
}

} // namespace cairn::gpu
