// What a kernel may use: its place in the grid, barriers, and atomics. Threads take turns on one host thread and change only at a
// barrier, so an atomic is a plain read and write, and a fence is nothing.
#pragma once
#include "vector_types.h"

namespace cairn_emulated {
struct Place {
    uint3 thread, block;
    dim3 block_dim, grid_dim;
};
extern Place place; // of the thread that runs now

enum class Barrier : unsigned char { none, block, block_or, block_and, block_count, cluster, grid };
// Waits until all threads have come; the number of them whose vote was true.
unsigned wait_at(Barrier barrier, bool vote = false);
// The block's dynamic shared memory: exactly the bytes of the launch, 16-byte aligned, 0xFF to begin with.
void* dynamic_shared();
} // namespace cairn_emulated

inline const uint3& threadIdx = cairn_emulated::place.thread;
inline const uint3& blockIdx = cairn_emulated::place.block;
inline const dim3& blockDim = cairn_emulated::place.block_dim;
inline const dim3& gridDim = cairn_emulated::place.grid_dim;

inline void __syncthreads() { cairn_emulated::wait_at(cairn_emulated::Barrier::block); }
inline int __syncthreads_or(int predicate) { return cairn_emulated::wait_at(cairn_emulated::Barrier::block_or, predicate != 0) != 0; }
inline int __syncthreads_and(int predicate) {
    return cairn_emulated::wait_at(cairn_emulated::Barrier::block_and, predicate != 0) == blockDim.x * blockDim.y * blockDim.z;
}
inline int __syncthreads_count(int predicate) {
    return static_cast<int>(cairn_emulated::wait_at(cairn_emulated::Barrier::block_count, predicate != 0));
}
inline void __threadfence() {}
inline void __threadfence_block() {}
template <class T> T __ldg(const T* address) { return *address; }

namespace cairn_emulated {
template <class T, class F> T exchange_by(T* address, F&& next) {
    const T old = *address;
    *address = next(old);
    return old;
}
} // namespace cairn_emulated
#define CAIRN_EMULATED_ATOMICS(T)                                                                                                          \
    inline T atomicAdd(T* address, T value) {                                                                                              \
        return cairn_emulated::exchange_by(address, [=](T old) {                                                                           \
            return static_cast<T>(static_cast<unsigned long long>(old) + static_cast<unsigned long long>(value));                          \
        });                                                                                                                                \
    }                                                                                                                                      \
    inline T atomicMin(T* address, T value) {                                                                                              \
        return cairn_emulated::exchange_by(address, [=](T old) { return value < old ? value : old; });                                     \
    }                                                                                                                                      \
    inline T atomicMax(T* address, T value) {                                                                                              \
        return cairn_emulated::exchange_by(address, [=](T old) { return old < value ? value : old; });                                     \
    }                                                                                                                                      \
    inline T atomicOr(T* address, T value) {                                                                                               \
        return cairn_emulated::exchange_by(address, [=](T old) { return old | value; });                                                   \
    }                                                                                                                                      \
    inline T atomicAnd(T* address, T value) {                                                                                              \
        return cairn_emulated::exchange_by(address, [=](T old) { return old & value; });                                                   \
    }                                                                                                                                      \
    inline T atomicExch(T* address, T value) {                                                                                             \
        return cairn_emulated::exchange_by(address, [=](T) { return value; });                                                             \
    }                                                                                                                                      \
    inline T atomicCAS(T* address, T compare, T value) {                                                                                   \
        return cairn_emulated::exchange_by(address, [=](T old) { return old == compare ? value : old; });                                  \
    }
CAIRN_EMULATED_ATOMICS(int)
CAIRN_EMULATED_ATOMICS(unsigned int)
CAIRN_EMULATED_ATOMICS(unsigned long long)
#undef CAIRN_EMULATED_ATOMICS
