// What only a real device is quick enough for: a scene that fills it.
#include "device.h"
#include "methods.h"
#include "same_bits.h"

#include <cuda_runtime.h>

namespace cairn_test {

std::string missing_device() {
    cairn_info info{};
    info.struct_size = sizeof info;
    check(cairn_get_info(&info));
    const std::string state = info.cuda;
    return state.rfind("present", 0) == 0 ? "" : state;
}

bool is_quick() { return true; }
void set_order(int) {}

namespace {
std::vector<void*> taken; // of the device's memory
}

NoDeviceMemory::NoDeviceMemory() {
    for (std::size_t size = std::size_t{1} << 38; size >= 4096; size /= 2) // a solver's first allocation is larger than the last of these
        for (void* memory = nullptr; cudaMalloc(&memory, size) == cudaSuccess;)
            taken.push_back(memory);
    cudaGetLastError();
}
NoDeviceMemory::~NoDeviceMemory() {
    for (void* const memory : taken)
        cudaFree(memory);
    taken.clear();
}

namespace {

class ManyHeaps : public EachMethod {
  protected:
    void SetUp() override {
        if (const std::string missing = missing_device(); !missing.empty())
            GTEST_SKIP() << missing;
    }
};
CAIRN_EACH_METHOD(ManyHeaps);

TEST_P(ManyHeaps, GiveTheSameBits) { expect_same_frames(busy(GetParam()), 10000, 3); }

} // namespace
} // namespace cairn_test
