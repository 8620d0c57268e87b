// The GPU that there is. No CUDA type is in here, so that any C++ file can include it; without CAIRN_CUDA it says so itself.
#pragma once
#include <string>

namespace cairn::gpu {

#ifdef CAIRN_CUDA

// Whether the CUDA backend can run here. Looks once; that starts the driver.
bool available();

// cairn_info.cuda: "present: NVIDIA H200, compute 9.0, ...", or what is missing and what to do.
std::string cuda_state();

// "" if that address is in a device's memory; else what it is, to go on "its elements at ...": "are host memory".
std::string not_on_device(const void* memory, int device);

#else

inline bool available() { return false; }
inline std::string cuda_state() { return "built without CUDA: install nvcc or run ./dev setup --cuda, then build again"; }
inline std::string not_on_device(const void*, int) { return "are host memory"; }

#endif

} // namespace cairn::gpu
