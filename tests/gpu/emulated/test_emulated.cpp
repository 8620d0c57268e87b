// The emulator's threads: kernels without races give the same results in every order, kernels with races do not, and those that
// break the rules of barriers abort.
#include "test_device.h"
#include <chrono>
#include <set>

using namespace cairn_emulated;
namespace cg = cooperative_groups;

namespace {
using Kernels = EmulatedTest;

struct Sum {
    const int* in;
    int* out;
    int n;
    bool with_barriers;
};
// The block's sum by halving.
__global__ void __launch_bounds__(256) sum_kernel(const __grid_constant__ Sum a) {
    int* s = shared_memory<int>();
    const unsigned t = threadIdx.x;
    const unsigned i = blockIdx.x * blockDim.x + t;
    s[t] = static_cast<int>(i) < a.n ? a.in[i] : 0;
    if (a.with_barriers)
        __syncthreads();
    for (unsigned half = blockDim.x / 2; half > 0; half /= 2) {
        if (t < half)
            s[t] += s[t + half];
        if (a.with_barriers)
            __syncthreads();
    }
    if (t == 0)
        a.out[blockIdx.x] = s[0];
}

std::vector<int> block_sums(bool with_barriers, Order order, unsigned long long seed) {
    std::vector<int> values(1000);
    for (size_t i = 0; i < values.size(); i++)
        values[i] = static_cast<int>(i * i % 97);
    const DeviceArray<int> in(values), out(4);
    set_order(order, seed);
    EXPECT_CUDA(launch({4, 256, 256 * sizeof(int)}, sum_kernel, Sum{in, out, 1000, with_barriers}));
    return out.read();
}

TEST_F(Kernels, WithBarriersGiveTheSameInEveryOrder) {
    std::vector<int> expected(4);
    for (size_t i = 0; i < 1000; i++)
        expected[i / 256] += static_cast<int>(i * i % 97);
    for (const auto& [order, seed] : every_order)
        EXPECT_EQ(block_sums(true, order, seed), expected);
}

TEST_F(Kernels, WithoutABarrierDifferBetweenOrders) {
    std::set<std::vector<int>> results;
    for (const auto& [order, seed] : every_order)
        results.insert(block_sums(false, order, seed));
    EXPECT_GE(results.size(), 4u);
}

__global__ void last_writer(int* out) { *out = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x); }

TEST_F(Kernels, RacesDifferBetweenOrders) {
    std::vector<int> results;
    for (const auto& [order, seed] : every_order) {
        const DeviceArray<int> out(1);
        set_order(order, seed);
        EXPECT_CUDA(launch({8, 64}, last_writer, static_cast<int*>(out)));
        results.push_back(out.read()[0]);
    }
    EXPECT_EQ(results[0], 511);
    EXPECT_EQ(results[1], 0);
    EXPECT_GE(std::set<int>(results.begin(), results.end()).size(), 4u);
}

__global__ void votes(int* out) {
    const int t = static_cast<int>(threadIdx.x);
    const int any = __syncthreads_or(t == 5), none = __syncthreads_or(0), all = __syncthreads_and(1), not_all = __syncthreads_and(t != 5);
    const int count = __syncthreads_count(t % 3 == 0);
    atomicAdd(out, any && !none && all && !not_all && count == 11 ? 1 : 0);
}

TEST_F(Kernels, VotesReachEveryThread) {
    for (const auto& [order, seed] : every_order) {
        set_order(order, seed);
        const DeviceArray<int> out(std::vector<int>{0});
        EXPECT_CUDA(launch({1, 32}, votes, static_cast<int*>(out)));
        EXPECT_EQ(out.read()[0], 32);
    }
}

__global__ void atomics(unsigned int* u, int* i, unsigned long long* l) {
    const unsigned t = threadIdx.x + blockIdx.x * blockDim.x;
    atomicAdd(&u[0], 1u);
    atomicMin(&u[1], t);
    atomicMax(&u[2], t);
    atomicOr(&u[3], 1u << (t % 32));
    atomicAnd(&u[4], ~(1u << (t % 32)));
    atomicAdd(&i[0], -1);
    atomicMax(&i[1], -static_cast<int>(t));
    if (atomicCAS(&u[5], 0u, t + 1) == 0)
        atomicAdd(&u[6], 1u);
    atomicAdd(&l[0], 1ull << 32);
    atomicExch(&l[1], 7ull);
}

TEST_F(Kernels, HaveAtomics) {
    for (const auto& [order, seed] : every_order) {
        set_order(order, seed);
        const DeviceArray<unsigned> u(std::vector<unsigned>{0, ~0u, 0, 0, ~0u, 0, 0});
        const DeviceArray<int> i(std::vector<int>{0, -1000});
        const DeviceArray<unsigned long long> l(std::vector<unsigned long long>{0, 0});
        EXPECT_CUDA(launch({2, 32}, atomics, static_cast<unsigned*>(u), static_cast<int*>(i), static_cast<unsigned long long*>(l)));
        auto unsigneds = u.read();
        EXPECT_NE(unsigneds[5], 0u);
        unsigneds[5] = 0;
        EXPECT_EQ(unsigneds, (std::vector<unsigned>{64, 0, 63, ~0u, 0, 0, 1}));
        EXPECT_EQ(i.read(), (std::vector<int>{-64, 0}));
        EXPECT_EQ(l.read(), (std::vector<unsigned long long>{64ull << 32, 7}));
    }
}

__global__ void places(unsigned* out) {
    const unsigned rank = cg::this_thread_block().thread_rank();
    const auto grid_rank = static_cast<unsigned>(cg::this_grid().thread_rank());
    out[grid_rank] =
        threadIdx.x + 100 * threadIdx.y + 10000 * (blockIdx.x + 2 * blockIdx.y) + 1000000 * (rank == threadIdx.x + 3 * threadIdx.y);
}

TEST_F(Kernels, KnowTheirPlace) {
    const DeviceArray<unsigned> out(24);
    cudaLaunchConfig_t config{};
    config.gridDim = dim3(2, 2);
    config.blockDim = dim3(3, 2);
    EXPECT_CUDA(cudaLaunchKernelEx(&config, places, static_cast<unsigned*>(out)));
    const auto values = out.read();
    for (unsigned i = 0; i < 24; i++)
        EXPECT_EQ(values[i], i % 3 + 100 * (i / 3 % 2) + 10000 * (i / 6) + 1000000);
}

// Each thread takes the value of the next one in the grid, n times.
__global__ void __launch_bounds__(256) rotate(int* a, int* b, int times) {
    const auto grid = cg::this_grid();
    const auto i = grid.thread_rank(), n = grid.size();
    for (int k = 0; k < times; k++) {
        b[i] = a[(i + 1) % n];
        grid.sync();
        int* swap = a;
        a = b;
        b = swap;
    }
}

TEST_F(Kernels, MeetAtTheGridsBarrier) {
    std::vector<int> values(512);
    for (size_t i = 0; i < values.size(); i++)
        values[i] = static_cast<int>(i);
    for (const auto& [order, seed] : every_order) {
        set_order(order, seed);
        const DeviceArray<int> a(values), b(512);
        EXPECT_CUDA(launch({.blocks = 8, .threads = 64, .cooperative = true}, rotate, static_cast<int*>(a), static_cast<int*>(b), 6));
        const auto rotated = a.read();
        for (size_t i = 0; i < values.size(); i++)
            ASSERT_EQ(rotated[i], values[(i + 6) % 512]);
    }
}

TEST_F(Kernels, MustFitTheDeviceToBeCooperative) {
    int blocks = 0;
    EXPECT_CUDA(cudaOccupancyMaxActiveBlocksPerMultiprocessor(&blocks, rotate, 256, 0));
    EXPECT_EQ(blocks, 4); // 64 registers a thread
    int* none = nullptr;
    EXPECT_EQ(launch({.blocks = 17, .threads = 256, .cooperative = true}, rotate, none, none, 0), cudaErrorCooperativeLaunchTooLarge);
    EXPECT_CUDA(launch({.blocks = 16, .threads = 256, .cooperative = true}, rotate, none, none, 0));
    EXPECT_CUDA(cudaDeviceSynchronize());
    EXPECT_EQ(launch({1, 2048}, rotate, none, none, 0), cudaErrorInvalidConfiguration);
    EXPECT_EQ(launch({1, 32, 100000}, rotate, none, none, 0), cudaErrorInvalidValue);
    EXPECT_CUDA(cudaFuncSetAttribute(rotate, cudaFuncAttributeMaxDynamicSharedMemorySize, 100000));
    EXPECT_CUDA(launch({1, 32, 100000}, rotate, none, none, 0));
    EXPECT_EQ(cudaFuncSetAttribute(rotate, cudaFuncAttributeMaxDynamicSharedMemorySize, 300000), cudaErrorInvalidValue);
    EXPECT_CUDA(cudaDeviceSynchronize());
}

// Sums over the cluster: each block reads the first word of every block's shared memory.
__global__ void cluster_sum(unsigned* out, bool wait_at_the_end) {
    const auto cluster = cg::this_cluster();
    unsigned* s = shared_memory<unsigned>();
    if (threadIdx.x == 0)
        s[0] = 1 + blockIdx.x;
    cluster.sync();
    unsigned sum = 0;
    for (unsigned rank = 0; rank < cluster.num_blocks(); rank++)
        sum += *cluster.map_shared_rank(s, static_cast<int>(rank));
    out[blockIdx.x * blockDim.x + threadIdx.x] = sum;
    if (wait_at_the_end)
        cluster.sync();
}

TEST_F(Kernels, ReadSharedMemoryOfTheirCluster) {
    for (const bool cooperative : {false, true})
        for (const auto& [order, seed] : every_order) {
            set_order(order, seed);
            const DeviceArray<unsigned> out(64);
            EXPECT_CUDA(launch({8, 8, 64, nullptr, cooperative, 4}, cluster_sum, static_cast<unsigned*>(out), true));
            const auto sums = out.read();
            for (unsigned i = 0; i < 64; i++)
                EXPECT_EQ(sums[i], i < 32 ? 10u : 26u);
        }
    int clusters = 0;
    cudaLaunchAttribute attribute{};
    attribute.id = cudaLaunchAttributeClusterDimension;
    attribute.val.clusterDim = {4, 1, 1};
    const cudaLaunchConfig_t config = {8, 256, 0, nullptr, &attribute, 1};
    EXPECT_CUDA(cudaOccupancyMaxActiveClusters(&clusters, cluster_sum, &config));
    EXPECT_EQ(clusters, 4);
}

__global__ void fresh_shared(unsigned* out) {
    unsigned* s = shared_memory<unsigned>();
    out[blockIdx.x] = s[0] & s[4];
    s[0] = s[4] = 0;
}

TEST_F(Kernels, FindSharedMemoryFresh) {
    const DeviceArray<unsigned> out(8);
    EXPECT_CUDA(launch({8, 1, 20}, fresh_shared, static_cast<unsigned*>(out)));
    EXPECT_EQ(out.read(), std::vector<unsigned>(8, ~0u));
}

// --- what aborts ---
using KernelDeathTest = EmulatedTest;

__global__ void some_return_early(int n) {
    if (static_cast<int>(threadIdx.x) >= n)
        return;
    __syncthreads();
}
__global__ void mixed_barriers() {
    if (threadIdx.x == 3)
        __syncthreads_or(1);
    else
        __syncthreads();
}
__global__ void one_block_returns() {
    if (blockIdx.x != 2)
        cg::this_grid().sync();
}
__global__ void shared_overrun(int i) { shared_memory<char>()[i] = 1; }
__global__ void device_overrun(int* p, int i) { p[i] = 1; }
__noinline__ int deeper(volatile int* p, int depth) {
    volatile int frame[256] = {};
    frame[depth % 256] = *p;
    return depth == 0 ? frame[0] : deeper(p, depth - 1) + frame[depth % 256];
}
__global__ void deep(int* p, int depth) { *p = deeper(p, depth); }

template <class... Parameters, class... Args> void run(const Shape& shape, void (*kernel)(Parameters...), Args... args) {
    (void)launch(shape, kernel, args...);
    cudaDeviceSynchronize();
}

TEST_F(KernelDeathTest, BarrierRulesAreKept) {
    int* none = nullptr;
    for (const auto& [order, seed] : every_order) {
        set_order(order, seed);
        EXPECT_DEATH(run({2, 32}, some_return_early, 20), "kernel .*some_return_early.*block .*thread .*returned");
        EXPECT_DEATH(run({1, 32}, mixed_barriers), "waits at __syncthreads.*waits at __syncthreads");
        EXPECT_DEATH(run({.blocks = 4, .threads = 8, .cooperative = true}, one_block_returns),
                     "grid's barrier, to which other blocks never");
        EXPECT_DEATH(run({4, 8}, rotate, none, none, 0); run({4, 8}, one_block_returns), "not cooperative");
    }
    EXPECT_CUDA(launch({2, 32}, some_return_early, 32));
    EXPECT_CUDA(cudaDeviceSynchronize());
}

TEST_F(KernelDeathTest, BoundsAreKept) {
    EXPECT_DEATH(run({1, 1, 20}, shared_overrun, 20), "shared memory|Sanitizer");
    EXPECT_DEATH(run({1, 1, 20}, shared_overrun, 32), "shared memory|Sanitizer");
    EXPECT_DEATH(run({1, 1, 20}, shared_overrun, -1), "shared memory|Sanitizer");
    const DeviceArray<int> p(3);
    EXPECT_DEATH(run({1, 1}, device_overrun, static_cast<int*>(p), 3), "past the end of the allocation of 12 bytes|Sanitizer");
    EXPECT_DEATH(run({1, 1}, device_overrun, static_cast<int*>(p), 64), "out of the bounds of device memory|Sanitizer");
    EXPECT_DEATH(run({1, 1}, deep, static_cast<int*>(p), 1000), "stack overflow|Sanitizer");
    EXPECT_DEATH(run({4, 8, 64, nullptr, false, 4}, cluster_sum, static_cast<unsigned*>(nullptr), false), "");
}

TEST_F(KernelDeathTest, SharedMemoryEndsWithItsBlock) {
    const DeviceArray<unsigned> out(32);
    EXPECT_DEATH(run({4, 8, 64, nullptr, false, 4}, cluster_sum, static_cast<unsigned*>(out), false), "bad access|Sanitizer");
}

TEST_F(KernelDeathTest, StacksGrowWhereAsked) {
    const DeviceArray<int> p(std::vector<int>{0});
    set_stack_size(8 << 20);
    EXPECT_CUDA(launch({1, 1}, deep, static_cast<int*>(p), 1000));
    EXPECT_CUDA(cudaDeviceSynchronize());
    set_stack_size(256 * 1024);
}

// --- cost ---
__global__ void many_barriers(int n) {
    for (int i = 0; i < n; i++)
        __syncthreads();
}
__global__ void many_grid_barriers(int n) {
    for (int i = 0; i < n; i++)
        cg::this_grid().sync();
}
__global__ void no_barrier(unsigned* out) { out[blockIdx.x * blockDim.x + threadIdx.x] = threadIdx.x; }

#if defined(__SANITIZE_THREAD__)
constexpr int repeats = 20;
#else
constexpr int repeats = 1000;
#endif

TEST_F(Kernels, CostLittle) {
    const auto nanoseconds = [](double operations, auto&& work) {
        const auto start = std::chrono::steady_clock::now();
        work();
        EXPECT_CUDA(cudaDeviceSynchronize());
        return std::chrono::duration<double, std::nano>(std::chrono::steady_clock::now() - start).count() / operations;
    };
    const DeviceArray<unsigned> out(1 << 20);
    for (const Order order : {Order::forward, Order::shuffled}) {
        set_order(order);
        const double block = nanoseconds(256 * 4 * repeats, [] { EXPECT_CUDA(launch({4, 256}, many_barriers, repeats)); });
        const double grid = nanoseconds(256 * 4 * repeats, [] {
            EXPECT_CUDA(launch({.blocks = 4, .threads = 256, .cooperative = true}, many_grid_barriers, repeats));
        });
        const double plain = nanoseconds(1 << 20, [&] { EXPECT_CUDA(launch({4096, 256}, no_barrier, static_cast<unsigned*>(out))); });
        std::printf("%s: %.1f ns a thread and barrier of a block, %.1f of a grid, %.1f a thread without barriers\n",
                    order == Order::forward ? "forward" : "shuffled", block, grid, plain);
    }
}
} // namespace
