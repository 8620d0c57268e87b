// CUDA's runtime as the rest of gpu/ uses it: a call that fails throws, kernels are launched as functions.
#pragma once
#include <cuda_runtime.h>

#include <cstddef>
#include <cstdint>
#include <new>
#include <stdexcept>
#include <string>

namespace cairn::gpu {

using u32 = std::uint32_t;
using u64 = std::uint64_t;

inline void check(cudaError_t error, const char* what) {
    if (error == cudaSuccess)
        return;
    cudaGetLastError(); // or a later call would report it again
    if (error == cudaErrorMemoryAllocation)
        throw std::bad_alloc(); // of the driver's own: a stream, a graph
    throw std::runtime_error(std::string("CUDA: ") + what + ": " + cudaGetErrorString(error) + " (" + cudaGetErrorName(error) + ")");
}

// The block's dynamic shared memory.
__device__ inline float* shared_memory() {
#if defined(__CUDACC__)
    extern __shared__ float pool[];
    return pool;
#else
    return static_cast<float*>(cairn_emulated::dynamic_shared());
#endif
}

constexpr u32 kThreads = 256; // of a block, where nothing else is said
inline u32 blocks_for(u32 count) { return count == 0 ? 1 : (count - 1) / kThreads + 1; }

// A loop without order: body(i) for i in 0 ... count, unless something has stopped the step.
template <class Body> __global__ void __launch_bounds__(kThreads) loop_kernel(const __grid_constant__ Body body, u32 count) {
    if (body.stopped())
        return;
    for (u32 i = blockIdx.x * blockDim.x + threadIdx.x; i < count; i += gridDim.x * blockDim.x)
        body(i);
}

template <class... Parameters, class... Arguments>
void launch(cudaStream_t stream, u32 blocks, u32 threads, std::size_t shared, void (*kernel)(Parameters...), Arguments&&... arguments) {
    cudaLaunchConfig_t config = {};
    config.gridDim = dim3(blocks);
    config.blockDim = dim3(threads);
    config.dynamicSmemBytes = shared;
    config.stream = stream;
    check(cudaLaunchKernelEx(&config, kernel, static_cast<Arguments&&>(arguments)...), "launching a kernel");
}

template <class Body> void loop(cudaStream_t stream, u32 count, const Body& body) {
    constexpr u32 most = 4096; // blocks: enough to fill any device
    if (count == 0)
        return;
    const u32 wanted = blocks_for(count);
    launch(stream, wanted < most ? wanted : most, kThreads, 0, loop_kernel<Body>, body, count);
}

} // namespace cairn::gpu
