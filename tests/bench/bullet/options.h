// The command line of ./dev bench --bullet.
#pragma once
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace cairn_bench::bullet {

extern const char* const kHelp;

struct Options {
    bool help = false, quality = false, quick = false;
    std::vector<std::string> scenes = {"wall", "pile"};
    std::vector<std::size_t> sizes = {1000, 8000};
    std::vector<std::uint32_t> iterations = {10, 50, 300}; // of stock, for --quality
    std::uint32_t threads = 0;                             // of Cairn; 0: all
    int steps = 0, settle = -1;                            // 0, -1: the mode's
    std::string json, markdown;
    std::string command; // as given
};

// Throws std::invalid_argument.
Options parsed(const std::vector<std::string>& arguments);

} // namespace cairn_bench::bullet
