#include "execute.h"

namespace cairn::gpu {

namespace {

constexpr u32 kRowFloats = 5 * 8, kLaneFloats = 2 * 8 + 2; // velocity, iterate, displacement, mass, cross; two slots, two sums

// Moves the arrays that every sweep touches into shared memory. Indices stay: the arrays begin as far before as the tile does.
__device__ void move_in(Frame<float>& f, const Tile& t, float* shared, u32 slots_begin, u32 lanes, u32 partial_begin) {
    const u32 rows = t.rows.size(), row = 8 * t.rows.begin;
    const auto copied = [&](float*& array) {
        for (u32 i = threadIdx.x; i < 8 * rows; i += blockDim.x)
            shared[i] = array[row + i];
        array = shared - row;
        shared += 8 * rows;
    };
    copied(f.velocity);
    copied(f.iterate);
    copied(f.displacement);
    copied(f.mass);
    copied(f.mass_cross);
    f.slots = shared - 8 * static_cast<std::size_t>(slots_begin);
    shared += 16 * static_cast<std::size_t>(lanes);
    f.partial_restart = shared - partial_begin;
    f.partial_residual = shared + lanes - partial_begin;
    __syncthreads();
}
__device__ void move_out(const Frame<float>& from, const Frame<float>& to, const Tile& t) {
    for (u32 i = 8 * t.rows.begin + threadIdx.x; i < 8 * t.rows.end; i += blockDim.x) {
        to.velocity[i] = from.velocity[i];
        to.displacement[i] = from.displacement[i];
    }
    __syncthreads(); // the next tile moves in
}

__global__ void __launch_bounds__(kThreads, 1) block_kernel(const __grid_constant__ Solve solve, u32 shared_floats) {
    if (solve.d.report->bad_input != 0)
        return;
    for (u32 i = blockIdx.x, tiles = solve.d.report->tiles; i < tiles; i += gridDim.x) {
        const Tile tile = solve.d.tile[i];
        const u32 lanes = tile.contacts.size() + tile.joints.size() + tile.raws.size();
        const bool fits = kRowFloats * tile.rows.size() + kLaneFloats * lanes <= shared_floats;
        Frame<float> f = solve.frame;
        if (fits)
            move_in(f, tile, shared_memory(), f.slot_begin[tile.rows.begin], lanes, f.island_begin[tile.islands.begin]);
        DeviceExecutor<BlockTeam> run{solve, f, tile, {}, solve.frame};
        run_schedule(run, solve.plan);
        if (fits)
            move_out(f, solve.frame, tile);
    }
}

} // namespace

void execute_in_blocks(const Solve& solve, u32 tiles, u32 rows, u32 lanes, const DeviceFacts& device, cudaStream_t stream) {
    const u32 busiest = lanes > rows ? lanes : rows;
    u32 threads = 32;
    while (threads < busiest && threads < kThreads)
        threads *= 2;
    const std::size_t wanted = sizeof(float) * (std::size_t{kRowFloats} * rows + std::size_t{kLaneFloats} * lanes);
    const std::size_t shared = wanted <= static_cast<std::size_t>(device.shared_bytes) ? wanted : 0;
    check(cudaFuncSetAttribute(reinterpret_cast<const void*>(block_kernel), cudaFuncAttributeMaxDynamicSharedMemorySize,
                               static_cast<int>(shared)),
          "asking for shared memory");
    launch(stream, tiles, threads, shared, block_kernel, solve, static_cast<u32>(shared / sizeof(float)));
}

} // namespace cairn::gpu
