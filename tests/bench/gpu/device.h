// What the GPU's memory can do. The only file here that talks to CUDA; where it is built without, it has no answer.
#pragma once
#include <cstddef>
#include <optional>
#include <string>

namespace cairn_bench {

struct CopyRate {
    double bytesPerSecond; // read and written together
    std::size_t bytes;     // of the array that was copied
};

// A copy from device memory to device memory, the best of several: far more than the caches hold, at most a quarter of what is free
// and 1 GiB. None without CUDA or a device; `why` then says what failed, if something did.
std::optional<CopyRate> deviceCopyRate(std::string& why);

} // namespace cairn_bench
