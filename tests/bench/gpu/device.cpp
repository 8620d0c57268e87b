#include "device.h"

#ifdef CAIRN_BENCH_CUDA

#include <cuda_runtime.h>

#include <algorithm>
#include <stdexcept>

namespace cairn_bench {
namespace {

void check(cudaError_t error, const char* what) {
    if (error == cudaSuccess)
        return;
    cudaGetLastError(); // or a later call would report it again
    throw std::runtime_error(std::string(what) + ": " + cudaGetErrorString(error));
}

struct Array {
    explicit Array(std::size_t bytes) { check(cudaMalloc(&data, bytes), "allocating device memory"); }
    ~Array() { cudaFree(data); }
    Array(const Array&) = delete;
    Array& operator=(const Array&) = delete;
    void* data = nullptr;
};
struct Event {
    Event() { check(cudaEventCreate(&event), "creating an event"); }
    ~Event() { cudaEventDestroy(event); }
    Event(const Event&) = delete;
    Event& operator=(const Event&) = delete;
    cudaEvent_t event = nullptr;
};

} // namespace

std::optional<CopyRate> deviceCopyRate(std::string& why) {
    constexpr int copies = 10, trials = 5;
    constexpr std::size_t most = std::size_t{1} << 30, page = 4096;
    try {
        std::size_t free = 0, total = 0;
        check(cudaMemGetInfo(&free, &total), "asking for the device's memory");
        const std::size_t bytes = std::max(std::min(most, free / 4) / page * page, page);
        const Array from(bytes), to(bytes);
        const Event begin, end;
        check(cudaMemset(from.data, 0, bytes), "clearing device memory");
        double best = 0;
        for (int trial = 0; trial < trials; ++trial) {
            check(cudaEventRecord(begin.event), "timing a copy");
            for (int copy = 0; copy < copies; ++copy)
                check(cudaMemcpyAsync(to.data, from.data, bytes, cudaMemcpyDeviceToDevice), "copying");
            check(cudaEventRecord(end.event), "timing a copy");
            check(cudaEventSynchronize(end.event), "copying");
            float milliseconds = 0;
            check(cudaEventElapsedTime(&milliseconds, begin.event, end.event), "timing a copy");
            if (milliseconds > 0)
                best = std::max(best, 2.0 * copies * static_cast<double>(bytes) / (1e-3 * static_cast<double>(milliseconds)));
        }
        if (best > 0)
            return CopyRate{best, bytes};
        why = "the copies took no time";
    } catch (const std::exception& error) {
        why = error.what();
    }
    return std::nullopt;
}

} // namespace cairn_bench

#else

std::optional<cairn_bench::CopyRate> cairn_bench::deviceCopyRate(std::string& why) {
    why = "built without CUDA";
    return std::nullopt;
}

#endif
