// What the measurements ran on.
#pragma once
#include <cstddef>
#include <string>

namespace cairn_bench {

// "AMD EPYC 9354" from /proc/cpuinfo where there is one, else "unknown CPU".
std::string processor();

// Bytes per second that one thread moves (two reads, one write) in a[i] = b[i] + s c[i] over three arrays of `bytes` together:
// the best of many passes, so that it is a bound.
double triadBandwidth(std::size_t bytes);

} // namespace cairn_bench
