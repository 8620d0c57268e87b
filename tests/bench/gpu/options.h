// The command line of cairn_gpu_bench.
#pragma once
#include <cairn/cairn.h>

#include <cstdint>
#include <string>
#include <vector>

namespace cairn_bench {

struct Options {
    std::string json; // file, "": none
    bool quick = false, help = false;
    int runs = 9;
    std::uint32_t threads = 0;      // of the CPU; 0: all
    std::uint32_t iterations = 300; // of the paper's scenes
    std::size_t mostBodies = 1000000, mostWorlds = 65536, mostCpu = 1000000, mostStock = 8000;
    double seconds = 0; // no further measurement is begun then; 0: no limit
    std::vector<std::uint32_t> executors = {CAIRN_EXECUTOR_AUTO};
    std::vector<std::string> only = {"scenes", "stack", "pile", "worlds"};
    std::string command; // as it was given
};

extern const char* const kHelp;

// Throws std::invalid_argument with what is wrong.
Options parsed(const std::vector<std::string>& arguments);

} // namespace cairn_bench
