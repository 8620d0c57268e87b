// The executors of architecture's "one schedule, four executors" that run on a device.
#pragma once
#include "executor.h"
#include "memory.h"

#include <vector>

namespace cairn::gpu {

enum class Executor : u32 { automatic, block, grid, graph }; // the values of CAIRN_EXECUTOR_...

struct DeviceFacts {
    int multiprocessors, shared_bytes; // of a block, at most
    bool clusters;
};

// One CUDA block a tile, all tiles at once: the whole schedule in one launch. `rows` and `lanes` of the largest tile, as far as known,
// decide how many threads a block gets and whether its bodies live in shared memory; a tile beyond that still works.
void execute_in_blocks(const Solve& solve, u32 tiles, u32 rows, u32 lanes, const DeviceFacts& device, cudaStream_t stream);

// One launch for everything, with a barrier of the whole grid, or of one cluster, between stages.
void execute_in_grid(const Solve& solve, u32 lanes, const DeviceFacts& device, cudaStream_t stream);

// A kernel a stage, captured once as a graph and replayed as long as nothing about it changes.
class GraphExecutor {
  public:
    GraphExecutor() = default;
    ~GraphExecutor() { forget(); }
    GraphExecutor(const GraphExecutor&) = delete;
    GraphExecutor& operator=(const GraphExecutor&) = delete;
    void execute(const Solve& solve, const DeviceFacts& device, cudaStream_t stream);

  private:
    void forget();
    Stream capture_;                  // the solver's may be the legacy one, which cannot be captured
    std::vector<std::byte> captured_; // the Solve that the graph was made of
    cudaGraphExec_t graph_ = nullptr;
};

} // namespace cairn::gpu
