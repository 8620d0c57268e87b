// The warm-start cache on the device: the impulses of the last substep by row of the table, and a hash table of rows by key.
#pragma once
#include "../core/scene/cache.h"
#include "layout.h"
#include "memory.h"

namespace cairn::gpu {

// Fibonacci hashing, as core/scene/cache.cpp
__device__ inline u32 hash_of(u64 key) { return static_cast<u32>((key * 0x9e3779b97f4a7c15u) >> 32); }
__device__ inline u32 home_of(u64 key, u32 table_size) { return hash_of(key) & (table_size - 1); }

class DeviceCache {
  public:
    // Room for that many rows of each table, nothing remembered.
    void prepare(const Capacity& capacity, cudaStream_t stream);
    // What the executors have kept, in the layout, under the caller's keys.
    void remember(const Layout& layout, float h, cudaStream_t stream);
    void forget() { used_ = false; }
    // For the kernels; empty where nothing is remembered.
    Memories view() const { return used_ ? memories_ : Memories{}; }

    // To and from the host's form. Both wait.
    void download(WarmStartCache& cache, cudaStream_t stream) const;
    void upload(const WarmStartCache& cache, cudaStream_t stream);
    void swap(DeviceCache& other);

  private:
    Buffer<OnDevice> buffer_;
    Memories memories_{};
    bool used_ = false;
};

} // namespace cairn::gpu
