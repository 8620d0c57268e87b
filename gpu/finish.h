// After the schedule: is everything finite, and the caller's results.
#pragma once
#include "pack.h"

namespace cairn::gpu {

// Queues it. Whatever the report says is wrong, the host must not use the results then.
void finish(const Layout& layout, const Counts& counts, cudaStream_t stream);

} // namespace cairn::gpu
