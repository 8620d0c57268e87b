// What one thread can move.
#pragma once
#include <cstddef>

namespace cairn_bench {

// Bytes per second that one thread moves (two reads, one write) in a[i] = b[i] + s c[i] over three arrays of `bytes` together:
// the best of many passes, so that it is a bound.
double triadBandwidth(std::size_t bytes);

} // namespace cairn_bench
