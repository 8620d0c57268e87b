// From the tables to the layout, on the device: who is movable, blocks, islands, tiles, lanes, slots, and each element's numbers.
#pragma once
#include "layout.h"

namespace cairn::gpu {

// Bytes that the sorts and scans of a layout of this capacity need beside their arrays.
std::size_t pack_scratch(const Capacity& capacity);

// Queues the whole of it; layout.request must have been sent, layout.report cleared. What it finds is in layout.report.
void pack(const Layout& layout, const Counts& counts, const Memories& last, bool trace, cudaStream_t stream);

} // namespace cairn::gpu
