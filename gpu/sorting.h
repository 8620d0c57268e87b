// Stable sorts and scans of a layout's arrays, by CUB.
#pragma once
#include "cuda.h"

#include <cub/cub.cuh>

#include <algorithm>

namespace cairn::gpu {

struct Larger {
    __host__ __device__ u32 operator()(u32 a, u32 b) const { return a < b ? b : a; }
};

inline std::size_t sorting_scratch(u32 most) {
    std::size_t sort = 0, sum = 0, maximum = 0;
    u32 stand_in = 0; // nothing is read while sizes are asked for, but whether there are values counts
    u32* const none = &stand_in;
    check(cub::DeviceRadixSort::SortPairs(nullptr, sort, none, none, none, none, static_cast<int>(most)), "sizing a sort");
    check(cub::DeviceScan::ExclusiveSum(nullptr, sum, none, none, static_cast<int>(most)), "sizing a scan");
    check(cub::DeviceScan::InclusiveScan(nullptr, maximum, none, none, Larger{}, static_cast<int>(most)), "sizing a scan");
    return std::max({sort, sum, maximum});
}

struct Sorter {
    u32 *keys, *sorted_keys, *values, *sorted;
    void* scratch;
    std::size_t scratch_size;
    cudaStream_t stream;

    // `values` by `keys`, into `sorted` and `sorted_keys`; equal keys stay in their order.
    void sort(u32 count) const {
        std::size_t size = scratch_size;
        if (count > 0)
            check(cub::DeviceRadixSort::SortPairs(scratch, size, keys, sorted_keys, values, sorted, static_cast<int>(count), 0, 32, stream),
                  "sorting");
    }
    void sums_before(const u32* from, u32* to, u32 count) const {
        std::size_t size = scratch_size;
        if (count > 0)
            check(cub::DeviceScan::ExclusiveSum(scratch, size, from, to, static_cast<int>(count), stream), "summing");
    }
    void running_maximum(const u32* from, u32* to, u32 count) const {
        std::size_t size = scratch_size;
        if (count > 0)
            check(cub::DeviceScan::InclusiveScan(scratch, size, from, to, Larger{}, static_cast<int>(count), stream), "scanning");
    }
};

} // namespace cairn::gpu
