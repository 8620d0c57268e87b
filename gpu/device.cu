#include "gpu/device.h"

#include <cuda_runtime.h>

#include <algorithm>
#include <cmath>

namespace cairn::gpu {

namespace {

struct State {
    bool available;
    std::string text;
};

constexpr int kArchitectures[] = {__CUDA_ARCH_LIST__}; // 750, 800, ...: what this file is compiled for

// 13020 is "13.2".
std::string version(int number) { return std::to_string(number / 1000) + "." + std::to_string(number % 1000 / 10); }

State look() {
    const auto missing = [](const std::string& what) { return State{false, "built with CUDA " + version(CUDART_VERSION) + "; " + what}; };
    const auto failed = [&](const char* call, cudaError_t error) {
        cudaGetLastError(); // or a later call would report it
        return missing(std::string(call) + " failed: " + cudaGetErrorString(error) + " (" + cudaGetErrorName(error) +
                       "); nvidia-smi may say more");
    };
    int driver = 0, count = 0;
    if (const cudaError_t error = cudaDriverGetVersion(&driver); error != cudaSuccess)
        return failed("cudaDriverGetVersion", error);
    if (driver == 0)
        return missing("no NVIDIA driver found (libcuda.so.1): install one");
    if (driver / 1000 < CUDART_VERSION / 1000)
        return missing("the NVIDIA driver is older, for CUDA " + version(driver) + ": update it, or build with that CUDA");
    if (const cudaError_t error = cudaGetDeviceCount(&count); error == cudaErrorNoDevice || (error == cudaSuccess && count == 0)) {
        cudaGetLastError();
        return missing("the NVIDIA driver offers no GPU: see nvidia-smi and CUDA_VISIBLE_DEVICES");
    } else if (error != cudaSuccess)
        return failed("cudaGetDeviceCount", error);
    cudaDeviceProp device = {};
    if (const cudaError_t error = cudaGetDeviceProperties(&device, 0); error != cudaSuccess)
        return failed("cudaGetDeviceProperties", error);
    const std::string name = std::string(device.name) + ", compute " + std::to_string(device.major) + "." + std::to_string(device.minor);
    const int oldest = *std::min_element(std::begin(kArchitectures), std::end(kArchitectures));
    if (device.major * 100 + device.minor * 10 < oldest)
        return missing("the GPU is too old: " + name + ", at least " + std::to_string(oldest / 100) + "." +
                       std::to_string(oldest % 100 / 10) + " is needed");
    const auto gibibytes = std::lround(std::ldexp(static_cast<double>(device.totalGlobalMem), -30));
    return {true, "present: " + name + ", " + std::to_string(device.multiProcessorCount) + " SMs, " + std::to_string(gibibytes) +
                      " GiB, driver for CUDA " + version(driver) + ", runtime " + version(CUDART_VERSION) +
                      (count > 1 ? "; the first of " + std::to_string(count) : "")};
}

const State& state() {
    static const State found = look();
    return found;
}

} // namespace

bool available() { return state().available; }

std::string cuda_state() { return state().text; }

std::string not_on_device(const void* memory, int device) {
    cudaPointerAttributes found{};
    if (cudaPointerGetAttributes(&found, memory) != cudaSuccess) {
        cudaGetLastError();
        return "are memory that CUDA does not know";
    }
    if (found.type == cudaMemoryTypeManaged || (found.type == cudaMemoryTypeDevice && found.device == device))
        return "";
    if (found.type == cudaMemoryTypeDevice)
        return "are on device " + std::to_string(found.device) + ", and the solver on device " + std::to_string(device);
    return "are host memory";
}

} // namespace cairn::gpu
