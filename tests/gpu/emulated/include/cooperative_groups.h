// Cooperative groups: the grid, the cluster and the block, with their barriers.
#pragma once
#include "cuda_runtime.h"

namespace cairn_emulated {
unsigned thread_rank_in_block();
unsigned threads_of_block();
unsigned long long block_rank_in_grid();
unsigned block_rank_in_cluster();
unsigned blocks_of_cluster();
bool launch_is_cooperative();
void* map_shared(void* address, int rank); // the same place in the shared memory of the cluster's block of this rank
} // namespace cairn_emulated

namespace cooperative_groups {
struct thread_block {
    static void sync() { __syncthreads(); }
    static unsigned int thread_rank() { return cairn_emulated::thread_rank_in_block(); }
    static unsigned int size() { return cairn_emulated::threads_of_block(); }
    static unsigned int num_threads() { return size(); }
    static dim3 group_index() { return blockIdx; }
    static dim3 thread_index() { return threadIdx; }
};

struct cluster_group {
    static void sync() { cairn_emulated::wait_at(cairn_emulated::Barrier::cluster); }
    static unsigned int block_rank() { return cairn_emulated::block_rank_in_cluster(); }
    static unsigned int num_blocks() { return cairn_emulated::blocks_of_cluster(); }
    static unsigned int thread_rank() { return block_rank() * cairn_emulated::threads_of_block() + cairn_emulated::thread_rank_in_block(); }
    static unsigned int size() { return num_blocks() * cairn_emulated::threads_of_block(); }
    static unsigned int num_threads() { return size(); }
    template <class T> static T* map_shared_rank(T* address, int rank) {
        return static_cast<T*>(cairn_emulated::map_shared(address, rank));
    }
};

struct grid_group {
    bool is_valid() const { return cairn_emulated::launch_is_cooperative(); }
    void sync() const { cairn_emulated::wait_at(cairn_emulated::Barrier::grid); }
    static unsigned long long block_rank() { return cairn_emulated::block_rank_in_grid(); }
    static unsigned long long num_blocks() { return 1ull * gridDim.x * gridDim.y * gridDim.z; }
    static unsigned long long thread_rank() {
        return block_rank() * cairn_emulated::threads_of_block() + cairn_emulated::thread_rank_in_block();
    }
    static unsigned long long size() { return num_blocks() * cairn_emulated::threads_of_block(); }
    static unsigned long long num_threads() { return size(); }
};

inline thread_block this_thread_block() { return {}; }
inline cluster_group this_cluster() { return {}; }
inline grid_group this_grid() { return {}; }
} // namespace cooperative_groups
