// Running one kernel: all of its threads, in the order that the test chose.
#pragma once
#include "state.h"

namespace cairn_emulated {
struct Launch {
    Kernel kernel;
    dim3 grid, block, cluster;
    size_t shared_bytes;
    bool cooperative;
};
std::string name_of(const Kernel& kernel); // for messages: slow
void run_kernel(const Launch& launch);
} // namespace cairn_emulated
