#include "state.h"
#include "fiber.h"

namespace cairn_emulated {
State state;
namespace {
thread_local cudaError_t last_error = cudaSuccess;
}

std::recursive_mutex& api_mutex() {
    static std::recursive_mutex mutex;
    return mutex;
}

cudaError_t remember(cudaError_t error) {
    if (error != cudaSuccess)
        last_error = error;
    return error;
}

cudaError_t why_unavailable() {
    switch (state.presence) {
    case Presence::no_device:
        return cudaErrorNoDevice;
    case Presence::no_driver:
        return cudaErrorInsufficientDriver;
    case Presence::device:
        break;
    }
    return state.broken;
}

size_t random_below(size_t n) { // splitmix64
    unsigned long long z = state.random += 0x9e3779b97f4a7c15ull;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ull;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebull;
    z ^= z >> 31;
    return static_cast<size_t>((static_cast<unsigned __int128>(z) * n) >> 64);
}

bool counts_out(unsigned& countdown) { return countdown != 0 && --countdown == 0; }

void reset() {
    const std::lock_guard lock(api_mutex());
    const size_t device_bytes = state.counters.device_bytes;
    state = State();
    state.counters.device_bytes = device_bytes;
    last_error = cudaSuccess;
}
void set_device(const Properties& properties) {
    const std::lock_guard lock(api_mutex());
    state.properties = properties;
}
void set_presence(Presence presence) {
    const std::lock_guard lock(api_mutex());
    state.presence = presence;
}
void set_order(Order order, unsigned long long seed) {
    const std::lock_guard lock(api_mutex());
    state.order = order;
    state.random = seed;
}
void set_stream_order(StreamOrder order) {
    const std::lock_guard lock(api_mutex());
    state.stream_order = order;
}
void set_memory_limit(size_t bytes) {
    const std::lock_guard lock(api_mutex());
    state.memory_limit = bytes;
}
void set_host_protection(bool on) {
    const std::lock_guard lock(api_mutex());
    state.host_protection = on;
}
void fail_allocation(unsigned n) {
    const std::lock_guard lock(api_mutex());
    state.fail_allocation = n;
}
void fail_host_allocation(unsigned n) {
    const std::lock_guard lock(api_mutex());
    state.fail_host_allocation = n;
}
void fail_work(unsigned n, cudaError_t error) {
    const std::lock_guard lock(api_mutex());
    state.fail_work = n;
    state.fail_work_with = error;
}
void set_stack_size(size_t bytes) {
    const std::lock_guard lock(api_mutex());
    use_stack_size(bytes);
}
Counters counters() {
    const std::lock_guard lock(api_mutex());
    return state.counters;
}
void reset_counters() {
    const std::lock_guard lock(api_mutex());
    const size_t device_bytes = state.counters.device_bytes;
    state.counters = Counters{};
    state.counters.device_bytes = device_bytes;
}
} // namespace cairn_emulated

using cairn_emulated::last_error;

cudaError_t cudaGetLastError() {
    const cudaError_t error = last_error;
    last_error = cudaSuccess;
    return error;
}
cudaError_t cudaPeekAtLastError() { return last_error; }
