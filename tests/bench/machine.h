// What the measurements ran on.
#pragma once
#include <string>

namespace cairn_bench {

// "AMD EPYC 9354" from /proc/cpuinfo where there is one, else "unknown CPU".
std::string processor();
// The first line of /proc/driver/nvidia/version, "" without one.
std::string nvidiaDriver();
// "2026-01-31 12:00 UTC"
std::string now();

} // namespace cairn_bench
