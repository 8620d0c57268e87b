// The schedule on the device: a team of threads, one block or many, goes through it together. Each stage is a loop of the
// team over the tile's lanes, rows or islands and a barrier; a team's kind only says what its barrier is.
#pragma once
#include "../core/method/schedule.h"
#include "../core/stages/run.h"
#include "layout.h"

#include <cooperative_groups.h>

namespace cairn::gpu {

// Frame<float>'s part that no stage changes, from the layout and the step's parameters.
struct Solve {
    Layout d;
    Frame<float> frame;
    Plan plan;
};

struct BlockTeam {
    __device__ u32 rank() const { return threadIdx.x; }
    __device__ u32 size() const { return blockDim.x; }
    __device__ void sync() const { __syncthreads(); }
    __device__ u32 block() const { return 0; }
    __device__ u32 blocks() const { return 1; }
};
struct GridTeam {
    __device__ u32 rank() const { return blockIdx.x * blockDim.x + threadIdx.x; }
    __device__ u32 size() const { return gridDim.x * blockDim.x; }
    __device__ void sync() const { cooperative_groups::this_grid().sync(); }
    __device__ u32 block() const { return blockIdx.x; }
    __device__ u32 blocks() const { return gridDim.x; }
};
// All blocks of one cluster (compute 9.0 and later): a grid whose barrier is hardware's.
struct ClusterTeam : GridTeam {
    __device__ void sync() const {
#if !defined(__CUDA_ARCH__) || __CUDA_ARCH__ >= 900 // never launched on an older device
        cooperative_groups::this_cluster().sync();
#endif
    }
};

// Lane `index` of a tile, over the kinds one after the other. kOnly: the kind is known to be contacts (0), joints (1) or raws (2).
template <int kOnly = -1> __device__ void run_lane(Stage stage, const Frame<float>& f, const Layout& d, const Tile& t, u32 index) {
    const u32 contacts = t.contacts.size(), joints = t.joints.size();
    const auto group_at = [&](Group g, u32 lane) {
        g.first = d.lane_first[lane];
        g.stride = d.lane_stride[lane];
        return g;
    };
    if (kOnly == 0 || (kOnly < 0 && index < contacts)) {
        const u32 lane = t.contacts.begin + index;
        run_contacts(stage, f, group_at(contact_group_of(d.lane_shape[lane]), lane), lane, 0);
    } else if (kOnly == 1 || (kOnly < 0 && index < contacts + joints)) {
        const u32 lane = d.joint_base() + t.joints.begin + (index - contacts);
        run_joints(stage, f, group_at(joint_group_of(d.lane_shape[lane]), lane), lane, 0);
    } else {
        const u32 lane = d.raw_base() + t.raws.begin + (index - contacts - joints);
        run_raw(stage, f, group_at(raw_group_of(d.lane_shape[lane]), lane), lane, 0);
    }
}

// One copy for all stages of a kernel that runs the whole schedule, whatever the compiler's measure of its size says.
__device__ __noinline__ inline void run_any_lane(Stage stage, const Frame<float>& f, const Layout& d, const Tile& t, u32 index) {
    run_lane(stage, f, d, t, index);
}

// The tree of core/stages/islands.h, each level's nodes side by side, by the threads of a block. `level`: two arrays as long as the
// values, for the sums on their way up. Every thread gets the result.
__device__ inline float block_tree_sum(const float* values, float* level_a, float* level_b, u32 begin, u32 end) {
    u32 count = end - begin;
    const float* from = values + begin;
    float* to = level_a + begin;
    for (int level = 0; level < 3 && count > 1; ++level) {
        const u32 nodes = (count + kBranches - 1) / kBranches;
        for (u32 node = threadIdx.x; node < nodes; node += blockDim.x) {
            float sum = 0;
            for (u32 i = node * kBranches; i < count && i < (node + 1) * kBranches; ++i)
                sum += from[i];
            to[node] = sum;
        }
        __syncthreads();
        count = nodes;
        from = to;
        to = level % 2 == 0 ? level_b + begin : level_a + begin;
    }
    float total = 0;
    for (u32 i = 0; i < count; ++i)
        total += from[i];
    return total;
}
// Islands with many blocks by a CUDA block each, the others by a thread each.
template <class Team> __device__ void run_islands(Stage stage, const Frame<float>& f, const Layout& d, const Tile& t, const Team& team) {
    const u32 elements = d.capacity.elements();
    for (u32 i = t.large.begin + team.block(); i < t.large.end; i += team.blocks()) {
        const u32 begin = f.island_begin[i], end = f.island_begin[i + 1];
        float restart = 0, residual = 0;
        if (stage == Stage::bouncing || (stage == Stage::reduce && f.control[i].active > 0)) {
            residual = block_tree_sum(f.partial_residual, d.partial_level, d.partial_level + elements, begin, end);
            if (stage == Stage::reduce && f.momentum)
                restart = block_tree_sum(f.partial_restart, d.partial_level + 2 * elements, d.partial_level + 3 * elements, begin, end);
        }
        __syncthreads(); // all have seen `active`, and the levels are free again
        if (threadIdx.x == 0)
            run_island(stage, f, i, [&](const float* values) { return values == f.partial_restart ? restart : residual; });
    }
    for (u32 i = t.large.end + team.rank(); i < t.islands.end; i += team.size())
        run_island(stage, f, i, [&](const float* values) { return tree_sum(values, f.island_begin[i], f.island_begin[i + 1]); });
}

template <class Team> struct DeviceExecutor {
    const Solve& solve;
    const Frame<float>& view; // solve.frame, or one whose arrays lie elsewhere
    const Tile& tile;
    Team team;
    Progress frame; // what the schedule moves along

    __device__ __forceinline__ void each(Stage stage) {
        Frame<float> f = view;
        static_cast<Progress&>(f) = frame;
        f.island_count = solve.d.report->islands;
        switch (domain_of(stage)) {
        case Domain::groups:
            for (u32 i = team.rank(), count = tile.contacts.size() + tile.joints.size() + tile.raws.size(); i < count; i += team.size())
                run_any_lane(stage, f, solve.d, tile, i);
            break;
        case Domain::movable:
            for (u32 row = tile.movable.begin + team.rank(); row < tile.movable.end; row += team.size())
                run_body(stage, f, row);
            break;
        case Domain::moving:
            for (u32 row = tile.moving.begin + team.rank(); row < tile.moving.end; row += team.size())
                run_body(stage, f, row);
            break;
        case Domain::islands:
            run_islands(stage, f, solve.d, tile, team);
            break;
        }
        team.sync();
    }
    // Every thread looks at all of the tile's islands: worth it where they are few.
    __device__ bool rests() const {
        constexpr u32 few = 64;
        if (tile.islands.size() > few)
            return false;
        for (u32 i = tile.islands.begin; i < tile.islands.end; ++i)
            if (view.control[i].active > 0)
                return false;
        return true;
    }
};

} // namespace cairn::gpu
