#include "triad.h"

#include <benchmark/benchmark.h>

#include <algorithm>
#include <chrono>
#include <vector>

namespace cairn_bench {
namespace {

// As wide as the processor goes, as Cairn's kernels are; without this the loop would be bound by SSE2's instructions.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__)
__attribute__((target_clones("default", "avx2", "arch=skylake-avx512"), noinline))
#endif
void triad(float* __restrict a, const float* __restrict b, const float* __restrict c, float s, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i)
        a[i] = b[i] + s * c[i];
}

} // namespace

double triadBandwidth(std::size_t bytes) {
    const std::size_t count = std::max<std::size_t>(bytes / (3 * sizeof(float)), 16);
    std::vector<float> a(count, 0), b(count, 1), c(count, 2);
    constexpr int kPasses = 200, kTrials = 50;
    double best = 0;
    for (int trial = 0; trial < kTrials; ++trial) {
        const auto start = std::chrono::steady_clock::now();
        for (int pass = 0; pass < kPasses; ++pass) {
            triad(a.data(), b.data(), c.data(), 0.5F, count);
            benchmark::ClobberMemory();
        }
        const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
        benchmark::DoNotOptimize(a.data());
        best = std::max(best, static_cast<double>(3 * sizeof(float) * count) * kPasses / seconds);
    }
    return best;
}

} // namespace cairn_bench
