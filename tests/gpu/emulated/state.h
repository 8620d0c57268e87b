// What every call begins and ends with: the lock, whether there is a device at all, and the thread's last error.
#pragma once
#include "include/emulated.h"
#include <mutex>

namespace cairn_emulated {
struct State {
    Properties properties;
    Presence presence = Presence::device;
    Order order = Order::forward;
    StreamOrder stream_order = StreamOrder::lazy;
    unsigned long long random = 1;
    Counters counters{};
    size_t memory_limit = 0;
    bool host_protection = true;
    unsigned fail_allocation = 0, fail_host_allocation = 0, fail_work = 0;
    cudaError_t fail_work_with = cudaSuccess;
    cudaError_t broken = cudaSuccess; // once set, every call returns it
};
extern State state;
std::recursive_mutex& api_mutex();
cudaError_t remember(cudaError_t error);
cudaError_t why_unavailable();

// The body of an entry of CUDA's interface.
template <class F> cudaError_t api_call(F&& body) {
    const std::lock_guard lock(api_mutex());
    const cudaError_t refused = why_unavailable();
    return remember(refused != cudaSuccess ? refused : body());
}

// Of an entry that releases something: it does even if there is no device any more, or it is broken.
template <class F> cudaError_t api_release(F&& body) {
    const std::lock_guard lock(api_mutex());
    const cudaError_t refused = why_unavailable();
    const cudaError_t error = body();
    return remember(refused != cudaSuccess ? refused : error);
}

// Below n, from the seed of set_order.
size_t random_below(size_t n);
// Counts *countdown down; whether it came to zero now.
bool counts_out(unsigned& countdown);
} // namespace cairn_emulated
