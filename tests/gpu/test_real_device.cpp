// What only a real device is quick enough for: scenes that fill it.
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

class Large : public EachMethod {
  protected:
    void SetUp() override {
        if (const std::string missing = missing_device(); !missing.empty())
            GTEST_SKIP() << missing;
    }
    // The same frames from the CPU and, with and without a choice of the executor, from the GPU.
    void expect_same_frames(int balls, int edge) const {
        const cairn_params params = busy(GetParam());
        const auto seen = [&](const cairn_config& config) {
            const Solver solver(config);
            check(cairn_solver_set_params(solver.get(), &params));
            Heaps heaps(balls, edge);
            Seen all;
            for (int frame = 0; frame < 2; ++frame) {
                heaps.touch();
                all.step(solver, heaps);
            }
            all.cache = solver.save_cache();
            return all;
        };
        cairn_config config = config_of(CAIRN_BACKEND_CPU);
        config.threads = 0;
        const Seen cpu = seen(config);
        for (const std::uint32_t executor : {CAIRN_EXECUTOR_AUTO, CAIRN_EXECUTOR_BLOCK, CAIRN_EXECUTOR_GRID, CAIRN_EXECUTOR_GRAPH}) {
            SCOPED_TRACE(testing::Message() << "executor " << executor);
            expect_same(cpu, seen(config_of(CAIRN_BACKEND_CUDA, executor)));
        }
    }
};
CAIRN_EACH_METHOD(Large);

TEST_P(Large, ManyHeapsGiveTheSameBits) { expect_same_frames(10000, 3); }
TEST_P(Large, OneHeapGivesTheSameBits) { expect_same_frames(3000, 15); }

} // namespace
} // namespace cairn_test
