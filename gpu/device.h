// The GPU that there is. No CUDA type is in here, so that any C++ file can include it; without CAIRN_CUDA it says so itself.
#pragma once
#include <string>

namespace cairn::gpu {

#ifdef CAIRN_CUDA

// Whether the CUDA backend can run here. Looks once; that starts the driver.
bool available();

// cairn_info.cuda: "present: NVIDIA H200, compute 9.0, ...", or what is missing and what to do.
std::string cuda_state();

#else

inline bool available() { return false; }
inline std::string cuda_state() { return "built without CUDA: install nvcc or run ./dev setup --cuda, then build again"; }

#endif

} // namespace cairn::gpu
