#include "include/cub/cub.cuh"
#include "memory.h"
#include "streams.h"

namespace cairn_emulated {
bool in_device_memory(const void* pointer, size_t bytes) {
    const std::lock_guard lock(api_mutex());
    return bytes == 0 || locate(pointer, bytes) == Where::device;
}

cudaError_t enqueue_cub(void* temporary, size_t bytes, size_t needed, cudaStream_t stream, std::function<void()> work) {
    return api_call([&] {
        if (bytes < needed || !in_device_memory(temporary, needed))
            return cudaErrorInvalidValue;
        state.counters.launches++;
        return enqueue(stream, [temporary, needed, work = std::move(work)] {
            std::memset(temporary, 0xFD, needed);
            state.counters.kernels_run++;
            work();
            std::memset(temporary, 0xFD, needed);
        });
    });
}
} // namespace cairn_emulated
