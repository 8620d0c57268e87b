// Scans and sorts against the standard library's.
#include "test_device.h"
#include <algorithm>
#include <cub/cub.cuh>
#include <numeric>
#include <random>

namespace {
using Cub = EmulatedTest;

template <class F> void with_temporary(F&& call) { // call(temporary, bytes)
    size_t bytes = 0;
    EXPECT_CUDA(call(nullptr, bytes));
    EXPECT_GT(bytes, 0u);
    const DeviceArray<char> temporary(bytes);
    size_t too_few = bytes - 1;
    EXPECT_EQ(call(temporary, too_few), cudaErrorInvalidValue);
    EXPECT_CUDA(call(temporary, bytes));
    EXPECT_CUDA(cudaDeviceSynchronize());
}

TEST_F(Cub, Scans) {
    for (const size_t n : {0u, 1u, 6u, 7u, 8u, 15u, 1000u}) {
        std::mt19937 random(1);
        std::vector<unsigned> values(std::max<size_t>(n, 1));
        for (unsigned& value : values)
            value = static_cast<unsigned>(random() % 1000);
        const DeviceArray<unsigned> in(values), out(values.size());
        std::vector<unsigned> expected(values.size(), ~0u);
        const int count = static_cast<int>(n);
        std::exclusive_scan(values.begin(), values.begin() + count, expected.begin(), 0u);
        with_temporary([&](void* t, size_t& bytes) {
            return cub::DeviceScan::ExclusiveSum(t, bytes, static_cast<unsigned*>(in), static_cast<unsigned*>(out), count);
        });
        EXPECT_EQ(out.read(), expected);
        std::inclusive_scan(values.begin(), values.begin() + count, expected.begin());
        with_temporary([&](void* t, size_t& bytes) {
            return cub::DeviceScan::InclusiveSum(t, bytes, static_cast<unsigned*>(in), static_cast<unsigned*>(out), count);
        });
        EXPECT_EQ(out.read(), expected);
        std::inclusive_scan(values.begin(), values.begin() + count, expected.begin(), [](auto a, auto b) { return std::max(a, b); });
        with_temporary([&](void* t, size_t& bytes) { // in place
            return cub::DeviceScan::InclusiveScan(t, bytes, static_cast<unsigned*>(in), static_cast<unsigned*>(in), cuda::maximum<>(),
                                                  count);
        });
        if (n > 0) {
            EXPECT_EQ(in.read(), expected);
        }
    }
}

template <class Key> void check_sort(int begin_bit, int end_bit, size_t n) {
    std::mt19937_64 random(2);
    std::vector<Key> keys(n);
    std::vector<unsigned> values(n), order(n);
    for (size_t i = 0; i < n; i++) {
        keys[i] = static_cast<Key>(random());
        values[i] = order[i] = static_cast<unsigned>(i);
    }
    const Key mask = end_bit - begin_bit == static_cast<int>(8 * sizeof(Key)) ? ~Key(0) : (Key(1) << (end_bit - begin_bit)) - 1;
    std::stable_sort(order.begin(), order.end(),
                     [&](unsigned a, unsigned b) { return ((keys[a] >> begin_bit) & mask) < ((keys[b] >> begin_bit) & mask); });
    std::vector<Key> sorted(n);
    for (size_t i = 0; i < n; i++)
        sorted[i] = keys[order[i]];
    const DeviceArray<Key> in(keys), out(n);
    const DeviceArray<unsigned> values_in(values), values_out(n);
    with_temporary([&](void* t, size_t& bytes) {
        return cub::DeviceRadixSort::SortPairs(t, bytes, static_cast<Key*>(in), static_cast<Key*>(out), static_cast<unsigned*>(values_in),
                                               static_cast<unsigned*>(values_out), n, begin_bit, end_bit);
    });
    EXPECT_EQ(out.read(), sorted);
    EXPECT_EQ(values_out.read(), order);
    const DeviceArray<Key> only_keys(n);
    with_temporary([&](void* t, size_t& bytes) {
        return cub::DeviceRadixSort::SortKeys(t, bytes, static_cast<Key*>(in), static_cast<Key*>(only_keys), n, begin_bit, end_bit);
    });
    EXPECT_EQ(only_keys.read(), sorted);
    size_t bytes = 0;
    EXPECT_CUDA(cub::DeviceRadixSort::SortKeys(nullptr, bytes, static_cast<Key*>(in), static_cast<Key*>(in), n));
    const DeviceArray<char> temporary(bytes);
    EXPECT_EQ(cub::DeviceRadixSort::SortKeys(temporary, bytes, static_cast<Key*>(in), static_cast<Key*>(in), n), cudaErrorInvalidValue);
}

TEST_F(Cub, Sorts) {
    check_sort<unsigned>(0, 32, 1000);
    check_sort<unsigned>(4, 7, 1000);
    check_sort<unsigned long long>(0, 64, 1000);
    check_sort<unsigned long long>(30, 40, 1000);
    check_sort<unsigned long long>(5, 5, 100);
}

TEST_F(Cub, ScansAreCaptured) {
    const Pinned p;
    const DeviceArray<unsigned> in(std::vector<unsigned>(10, 1)), out(10);
    size_t bytes = 0;
    unsigned *a = in, *b = out;
    EXPECT_CUDA(cub::DeviceScan::InclusiveSum(nullptr, bytes, a, b, 10, p.stream));
    const DeviceArray<char> temporary(bytes);
    cudaGraph_t graph = nullptr;
    cudaGraphExec_t exec = nullptr;
    EXPECT_CUDA(cudaStreamBeginCapture(p.stream, cudaStreamCaptureModeGlobal));
    EXPECT_CUDA(cub::DeviceScan::InclusiveSum(temporary, bytes, a, b, 10, p.stream));
    EXPECT_CUDA(cub::DeviceScan::InclusiveSum(temporary, bytes, b, b, 10, p.stream));
    EXPECT_CUDA(cudaStreamEndCapture(p.stream, &graph));
    EXPECT_CUDA(cudaGraphInstantiate(&exec, graph));
    EXPECT_EQ(out.read()[9], ~0u);
    EXPECT_CUDA(cudaGraphLaunch(exec, p.stream));
    EXPECT_EQ(out.read()[9], 55u);
    EXPECT_CUDA(cudaGraphExecDestroy(exec));
    EXPECT_CUDA(cudaGraphDestroy(graph));
}
} // namespace
