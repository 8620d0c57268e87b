// The emulator's runtime: streams that run when the host waits, captures, memory, failures.
#include "test_device.h"
#include <algorithm>
#include <chrono>
#include <thread>

using namespace cairn_emulated;

namespace {
using Runtime = EmulatedTest;
using RuntimeDeathTest = EmulatedTest;

__global__ void add(int* values, int n, int more) {
    const int i = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
    if (i < n)
        values[i] += more;
}

TEST_F(Runtime, StreamsRunWhenTheHostWaits) {
    const DeviceArray<int> data(64);
    const Pinned p, back;
    EXPECT_CUDA(cudaMemcpyAsync(data, p.values, 256, cudaMemcpyHostToDevice, p.stream));
    p.values[7] = 50; // too early
    EXPECT_CUDA(launch({1, 64, 0, p.stream}, add, static_cast<int*>(data), 64, 5));
    EXPECT_CUDA(cudaMemcpyAsync(back.values, data, 256, cudaMemcpyDeviceToHost, p.stream));
    EXPECT_EQ(back.values[0], 1); // stale
    EXPECT_TRUE(work_is_pending());
    EXPECT_CUDA(cudaStreamSynchronize(p.stream));
    EXPECT_EQ(back.values[0], 6);
    EXPECT_EQ(back.values[7], 55);
    EXPECT_EQ(counters().launches, 1u);
    EXPECT_EQ(counters().bytes_to_device, 256u);
    EXPECT_EQ(counters().bytes_to_host, 256u);
}

TEST_F(Runtime, PageableMemoryIsReadAtTheCall) {
    const DeviceArray<int> data(2);
    const Pinned p;
    std::vector<int> values{1, 2};
    EXPECT_CUDA(cudaMemcpyAsync(data, values.data(), 8, cudaMemcpyHostToDevice, p.stream));
    values = {3, 4};
    EXPECT_EQ(data.read(), (std::vector<int>{1, 2}));
}

TEST_F(Runtime, BlockingCopiesDoNotWaitForNonBlockingStreams) {
    for (const unsigned flags : {cudaStreamNonBlocking, cudaStreamDefault}) {
        const DeviceArray<int> data(std::vector<int>(64, 1));
        const Pinned p(flags);
        EXPECT_CUDA(launch({1, 64, 0, p.stream}, add, static_cast<int*>(data), 64, 1));
        int first = 0;
        EXPECT_CUDA(cudaMemcpy(&first, data, 4, cudaMemcpyDeviceToHost));
        EXPECT_EQ(first, flags == cudaStreamNonBlocking ? 1 : 2);
        EXPECT_CUDA(cudaDeviceSynchronize());
    }
}

TEST_F(Runtime, EventsOrderStreams) {
    for (const StreamOrder order : {StreamOrder::lazy, StreamOrder::eager, StreamOrder::others_first}) {
        set_stream_order(order);
        const DeviceArray<int> data(std::vector<int>(64, 1));
        const Pinned a, b;
        cudaEvent_t event = nullptr, unused = nullptr;
        EXPECT_CUDA(cudaEventCreateWithFlags(&event, cudaEventDisableTiming));
        EXPECT_CUDA(cudaEventCreate(&unused));
        EXPECT_CUDA(launch({1, 64, 0, a.stream}, add, static_cast<int*>(data), 64, 1));
        EXPECT_CUDA(cudaEventRecord(event, a.stream));
        EXPECT_CUDA(launch({1, 64, 0, a.stream}, add, static_cast<int*>(data), 64, 100));
        EXPECT_CUDA(cudaStreamWaitEvent(b.stream, event));
        EXPECT_CUDA(cudaMemcpyAsync(b.values, data, 256, cudaMemcpyDeviceToHost, b.stream));
        EXPECT_EQ(cudaEventQuery(event), order == StreamOrder::eager ? cudaSuccess : cudaErrorNotReady);
        EXPECT_CUDA(cudaStreamSynchronize(b.stream));
        EXPECT_EQ(b.values[0], order == StreamOrder::lazy ? 2 : 102); // the second kernel races with the copy
        EXPECT_CUDA(cudaEventQuery(event));
        EXPECT_EQ(cudaStreamQuery(a.stream), order == StreamOrder::lazy ? cudaErrorNotReady : cudaSuccess);
        EXPECT_CUDA(cudaStreamQuery(a.stream));
        EXPECT_EQ(cudaEventQuery(unused), cudaSuccess);
        float ms = 0;
        EXPECT_EQ(cudaEventElapsedTime(&ms, event, event), cudaErrorInvalidResourceHandle);
        EXPECT_CUDA(cudaEventDestroy(event));
        EXPECT_CUDA(cudaEventDestroy(unused));
    }
}

TEST_F(Runtime, CapturesReplay) {
    const DeviceArray<int> data(64);
    const Pinned p, back;
    cudaGraph_t graph = nullptr;
    cudaGraphExec_t exec = nullptr;
    int more = 5;
    EXPECT_CUDA(cudaStreamBeginCapture(p.stream, cudaStreamCaptureModeThreadLocal));
    EXPECT_CUDA(cudaMemcpyAsync(data, p.values, 256, cudaMemcpyHostToDevice, p.stream));
    EXPECT_CUDA(launch({1, 64, 0, p.stream}, add, static_cast<int*>(data), 64, more));
    more = 1000;
    EXPECT_CUDA(cudaMemcpyAsync(back.values, data, 256, cudaMemcpyDeviceToHost, p.stream));
    cudaStreamCaptureStatus status{};
    EXPECT_CUDA(cudaStreamIsCapturing(p.stream, &status));
    EXPECT_EQ(status, cudaStreamCaptureStatusActive);
    EXPECT_CUDA(cudaStreamEndCapture(p.stream, &graph));
    EXPECT_CUDA(cudaGraphInstantiate(&exec, graph, 0));
    EXPECT_CUDA(cudaGraphDestroy(graph));
    EXPECT_CUDA(cudaGraphUpload(exec, p.stream));
    EXPECT_CUDA(cudaStreamSynchronize(p.stream));
    EXPECT_EQ(back.values[0], 1); // nothing has run
    for (int i = 0; i < 3; i++) {
        p.values[0] = i;
        EXPECT_CUDA(cudaGraphLaunch(exec, p.stream));
        EXPECT_CUDA(cudaStreamSynchronize(p.stream));
        EXPECT_EQ(back.values[0], i + 5);
    }
    EXPECT_CUDA(cudaGraphExecDestroy(exec));
    EXPECT_EQ(cudaGraphLaunch(exec, p.stream), cudaErrorInvalidValue);
}

TEST_F(Runtime, CapturesForbidWaiting) {
    const Pinned p;
    cudaGraph_t graph = nullptr;
    void* memory = nullptr;
    for (int what = 0; what < 4; what++) {
        EXPECT_CUDA(cudaStreamBeginCapture(p.stream, what == 3 ? cudaStreamCaptureModeRelaxed : cudaStreamCaptureModeGlobal));
        EXPECT_EQ(what == 0   ? cudaMalloc(&memory, 100)
                  : what == 1 ? cudaStreamSynchronize(p.stream)
                  : what == 2 ? cudaDeviceSynchronize()
                              : cudaMalloc(&memory, 100),
                  what == 3 ? cudaSuccess : cudaErrorStreamCaptureUnsupported);
        EXPECT_EQ(cudaStreamEndCapture(p.stream, &graph), what == 3 ? cudaSuccess : cudaErrorStreamCaptureInvalidated);
    }
    EXPECT_CUDA(cudaGraphDestroy(graph));
    EXPECT_CUDA(cudaFree(memory));
}

// a: fork, b adds to the first half while a adds to the second, join. Without the join the capture is refused.
TEST_F(Runtime, CapturesForkAndJoin) {
    const DeviceArray<int> data(std::vector<int>(64, 1));
    const Pinned a, b;
    cudaEvent_t forked = nullptr, done = nullptr;
    EXPECT_CUDA(cudaEventCreate(&forked));
    EXPECT_CUDA(cudaEventCreate(&done));
    for (const bool join : {false, true}) {
        cudaGraph_t graph = nullptr;
        EXPECT_CUDA(cudaStreamBeginCapture(a.stream, cudaStreamCaptureModeGlobal));
        EXPECT_CUDA(launch({1, 64, 0, a.stream}, add, static_cast<int*>(data), 64, 1));
        EXPECT_CUDA(cudaEventRecord(forked, a.stream));
        EXPECT_CUDA(cudaStreamWaitEvent(b.stream, forked));
        EXPECT_CUDA(launch({1, 32, 0, b.stream}, add, static_cast<int*>(data), 32, 10));
        EXPECT_CUDA(launch({1, 32, 0, a.stream}, add, data + 32, 32, 20));
        EXPECT_CUDA(cudaEventRecord(done, b.stream));
        if (join) {
            EXPECT_CUDA(cudaStreamWaitEvent(a.stream, done));
        }
        EXPECT_EQ(cudaStreamEndCapture(a.stream, &graph), join ? cudaSuccess : cudaErrorStreamCaptureUnjoined);
        if (!join)
            continue;
        cudaGraphExec_t exec = nullptr;
        EXPECT_CUDA(cudaGraphInstantiate(&exec, graph));
        for (const auto& [order, seed] : every_order) {
            set_order(order, seed);
            EXPECT_CUDA(cudaGraphLaunch(exec, a.stream));
            EXPECT_CUDA(cudaStreamSynchronize(a.stream));
        }
        EXPECT_EQ(data.read()[0], 1 + 5 * 11);
        EXPECT_EQ(data.read()[63], 1 + 5 * 21);
        EXPECT_CUDA(cudaGraphExecDestroy(exec));
        EXPECT_CUDA(cudaGraphDestroy(graph));
    }
    EXPECT_CUDA(cudaEventDestroy(forked));
    EXPECT_CUDA(cudaEventDestroy(done));
}

TEST_F(Runtime, MemoryIsChecked) {
    const DeviceArray<int> data(10);
    EXPECT_EQ(data.read(), std::vector<int>(10, -1)); // fresh
    int values[20] = {};
    EXPECT_EQ(cudaMemcpy(data, values, 44, cudaMemcpyHostToDevice), cudaErrorInvalidValue);
    EXPECT_EQ(cudaMemcpy(data + 9, values, 8, cudaMemcpyHostToDevice), cudaErrorInvalidValue);
    EXPECT_EQ(cudaMemcpy(data, values, 40, cudaMemcpyDeviceToHost), cudaErrorInvalidValue);
    EXPECT_EQ(cudaMemcpy(values, data, 40, cudaMemcpyHostToDevice), cudaErrorInvalidValue);
    EXPECT_EQ(cudaMemset(values, 0, 4), cudaErrorInvalidValue);
    EXPECT_EQ(cudaFree(values), cudaErrorInvalidValue);
    EXPECT_EQ(cudaFree(data + 1), cudaErrorInvalidValue);
    EXPECT_EQ(cudaFreeHost(values), cudaErrorInvalidValue);
    void* twice = nullptr;
    EXPECT_CUDA(cudaMalloc(&twice, 10));
    EXPECT_CUDA(cudaFree(twice));
    EXPECT_EQ(cudaFree(twice), cudaErrorInvalidValue);
    EXPECT_EQ(cudaGetLastError(), cudaErrorInvalidValue);
    EXPECT_EQ(cudaGetLastError(), cudaSuccess);
    cudaPointerAttributes attributes{};
    EXPECT_CUDA(cudaPointerGetAttributes(&attributes, data + 3));
    EXPECT_EQ(attributes.type, cudaMemoryTypeDevice);
    EXPECT_CUDA(cudaPointerGetAttributes(&attributes, values));
    EXPECT_EQ(attributes.type, cudaMemoryTypeUnregistered);
    EXPECT_CUDA(cudaMemset(data, 0, 40));
    EXPECT_CUDA(cudaMemcpy2DAsync(data + 1, 8, std::vector<int>{1, 2, 3}.data(), 4, 4, 3, cudaMemcpyHostToDevice));
    EXPECT_EQ(data.read(), (std::vector<int>{0, 1, 0, 2, 0, 3, 0, 0, 0, 0}));
}

TEST_F(RuntimeDeathTest, TheHostCannotTouchDeviceMemory) {
#if defined(__SANITIZE_ADDRESS__)
    GTEST_SKIP() << "with AddressSanitizer device memory is ordinary memory";
#endif
    const DeviceArray<int> data(std::vector<int>{1});
    const volatile int* pointer = data;
    EXPECT_DEATH((void)*pointer, "host code touched device memory|Sanitizer");
}

TEST_F(Runtime, MemoryRunsOut) {
    void *a = nullptr, *b = nullptr;
    set_memory_limit(1000 + counters().device_bytes);
    EXPECT_CUDA(cudaMalloc(&a, 900));
    EXPECT_EQ(cudaMalloc(&b, 101), cudaErrorMemoryAllocation);
    EXPECT_EQ(b, nullptr);
    EXPECT_CUDA(cudaMalloc(&b, 100));
    EXPECT_CUDA(cudaFree(b));
    fail_allocation(2);
    EXPECT_CUDA(cudaMalloc(&b, 10));
    EXPECT_CUDA(cudaFree(b));
    EXPECT_EQ(cudaMalloc(&b, 10), cudaErrorMemoryAllocation);
    EXPECT_CUDA(cudaMalloc(&b, 10));
    EXPECT_CUDA(cudaFree(a));
    EXPECT_CUDA(cudaFree(b));
    EXPECT_EQ(counters().allocations, 4u);
    EXPECT_EQ(counters().frees, 4u);
}

TEST_F(Runtime, ADeviceMayBreakOrBeMissing) {
    const DeviceArray<int> data(std::vector<int>(64, 1));
    fail_work(2, cudaErrorIllegalAddress);
    EXPECT_CUDA(launch({1, 64}, add, static_cast<int*>(data), 64, 1));
    EXPECT_CUDA(launch({1, 64}, add, static_cast<int*>(data), 64, 1));
    EXPECT_EQ(cudaDeviceSynchronize(), cudaErrorIllegalAddress);
    EXPECT_EQ(launch({1, 64}, add, static_cast<int*>(data), 64, 1), cudaErrorIllegalAddress);
    void* memory = nullptr;
    reset();
    EXPECT_CUDA(cudaMalloc(&memory, 8));
    const size_t before = counters().device_bytes;
    fail_work(1, cudaErrorIllegalAddress);
    EXPECT_CUDA(cudaMemset(memory, 0, 8));
    EXPECT_EQ(cudaFree(memory), cudaErrorIllegalAddress); // it is freed all the same
    EXPECT_EQ(counters().device_bytes, before - 8);
    reset();
    int count = -1;
    set_presence(Presence::no_device);
    EXPECT_EQ(cudaGetDeviceCount(&count), cudaErrorNoDevice);
    EXPECT_EQ(count, 0);
    set_presence(Presence::no_driver);
    EXPECT_EQ(cudaGetDeviceCount(&count), cudaErrorInsufficientDriver);
    EXPECT_CUDA(cudaDriverGetVersion(&count));
    EXPECT_EQ(count, 0);
    set_presence(Presence::device);
    Properties properties;
    properties.multiprocessors = 7;
    properties.cluster_launch = false;
    set_device(properties);
    cudaDeviceProp prop{};
    EXPECT_CUDA(cudaGetDeviceProperties(&prop, 0));
    EXPECT_EQ(prop.multiProcessorCount, 7);
    EXPECT_CUDA(cudaDeviceGetAttribute(&count, cudaDevAttrClusterLaunch, 0));
    EXPECT_EQ(count, 0);
    EXPECT_EQ(cudaSetDevice(1), cudaErrorInvalidDevice);
}

TEST_F(Runtime, ServesSeveralHostThreads) {
    std::vector<std::thread> threads;
    for (int t = 0; t < 4; t++)
        threads.emplace_back([] {
            const Pinned p;
            const DeviceArray<int> data(64);
            for (int i = 0; i < 50; i++) {
                EXPECT_CUDA(cudaMemcpyAsync(data, p.values, 256, cudaMemcpyHostToDevice, p.stream));
                EXPECT_CUDA(launch({1, 64, 0, p.stream}, add, static_cast<int*>(data), 64, 1));
                EXPECT_CUDA(cudaMemcpyAsync(p.values, data, 256, cudaMemcpyDeviceToHost, p.stream));
                EXPECT_CUDA(cudaStreamSynchronize(p.stream));
            }
            EXPECT_EQ(p.values[63], 51);
        });
    for (std::thread& thread : threads)
        thread.join();
}

TEST_F(Runtime, WaitingCostsLittle) {
    std::vector<void*> memory(100);
    for (void*& p : memory)
        EXPECT_CUDA(cudaMalloc(&p, 100000));
    const auto start = std::chrono::steady_clock::now();
    for (int i = 0; i < 100; i++) {
        EXPECT_CUDA(cudaMemsetAsync(memory[0], 0, 4));
        EXPECT_CUDA(cudaDeviceSynchronize());
    }
    std::printf("%.0f us a wait with 100 allocations\n",
                std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now() - start).count() / 100);
    set_host_protection(false);
    EXPECT_CUDA(cudaMemset(memory[0], 0, 100000));
    EXPECT_CUDA(cudaDeviceSynchronize());
    EXPECT_EQ(*static_cast<const volatile int*>(memory[0]), 0);
    for (void* p : memory)
        EXPECT_CUDA(cudaFree(p));
}
} // namespace
