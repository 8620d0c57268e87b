// The solver on a CUDA device. A plain header: core includes it.
#pragma once
#include "../core/solver.h"

#include <memory>

namespace cairn::gpu {

// Throws Unsupported where there is no device, OutOfDeviceMemory.
std::unique_ptr<Solver> create_solver(const Config& config);

} // namespace cairn::gpu
