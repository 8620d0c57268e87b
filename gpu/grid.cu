#include "execute.h"

#include <algorithm>

namespace cairn::gpu {

namespace {

constexpr u32 kClusterBlocks = 8; // as many as every device with clusters has

template <class Team> __global__ void __launch_bounds__(kThreads, 1) team_kernel(const __grid_constant__ Solve solve) {
    if (solve.d.report->bad_input != 0)
        return;
    for (u32 i = 0, tiles = solve.d.report->tiles; i < tiles; ++i) {
        const Tile tile = solve.d.tile[i];
        DeviceExecutor<Team> run{solve, solve.frame, tile, {}, solve.frame};
        run_schedule(run, solve.plan);
    }
}

template <class Team> void launch_team(const Solve& solve, u32 blocks, cudaLaunchAttribute attribute, cudaStream_t stream) {
    cudaLaunchConfig_t config = {};
    config.gridDim = dim3(blocks);
    config.blockDim = dim3(kThreads);
    config.stream = stream;
    config.attrs = &attribute;
    config.numAttrs = 1;
    check(cudaLaunchKernelEx(&config, team_kernel<Team>, solve), "launching the grid");
}

} // namespace

void execute_in_grid(const Solve& solve, u32 lanes, const DeviceFacts& device, cudaStream_t stream) {
    const u32 wanted = blocks_for(lanes);
    cudaLaunchAttribute attribute = {};
    if (device.clusters && wanted <= kClusterBlocks) {
        attribute.id = cudaLaunchAttributeClusterDimension;
        attribute.val.clusterDim.x = kClusterBlocks;
        attribute.val.clusterDim.y = attribute.val.clusterDim.z = 1;
        return launch_team<ClusterTeam>(solve, kClusterBlocks, attribute, stream);
    }
    int each = 0;
    check(cudaOccupancyMaxActiveBlocksPerMultiprocessor(&each, reinterpret_cast<const void*>(team_kernel<GridTeam>), kThreads, 0),
          "asking how many blocks fit");
    attribute.id = cudaLaunchAttributeCooperative;
    attribute.val.cooperative = 1;
    launch_team<GridTeam>(solve, std::min(wanted, static_cast<u32>(std::max(1, each) * device.multiprocessors)), attribute, stream);
}

} // namespace cairn::gpu
