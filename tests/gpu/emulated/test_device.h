// Small helps for tests on the emulated device.
#pragma once
#include <algorithm>
#include <cooperative_groups.h>
#include <cuda_runtime.h>
#include <emulated.h>
#include <gtest/gtest.h>
#include <vector>

#define EXPECT_CUDA(call) EXPECT_EQ(call, cudaSuccess) << cudaGetErrorName(cudaPeekAtLastError())
#define ASSERT_CUDA(call) ASSERT_EQ(call, cudaSuccess) << cudaGetErrorName(cudaPeekAtLastError())

// Device memory of n elements, freed at the end.
template <class T> class DeviceArray {
  public:
    explicit DeviceArray(size_t n) : n_(n) { EXPECT_CUDA(cudaMalloc(&data_, n * sizeof(T))); }
    explicit DeviceArray(const std::vector<T>& values) : DeviceArray(values.size()) {
        EXPECT_CUDA(cudaMemcpy(data_, values.data(), n_ * sizeof(T), cudaMemcpyHostToDevice));
    }
    ~DeviceArray() { cudaFree(data_); }
    DeviceArray(const DeviceArray&) = delete;
    DeviceArray& operator=(const DeviceArray&) = delete;

    operator T*() const { return data_; }
    std::vector<T> read() const { // after everything that was enqueued
        std::vector<T> values(n_);
        EXPECT_CUDA(cudaDeviceSynchronize());
        EXPECT_CUDA(cudaMemcpy(values.data(), data_, n_ * sizeof(T), cudaMemcpyDeviceToHost));
        return values;
    }

  private:
    T* data_ = nullptr;
    size_t n_;
};

// A stream and pinned memory of 64 ints.
class Pinned {
  public:
    explicit Pinned(unsigned flags = cudaStreamNonBlocking) {
        EXPECT_CUDA(cudaStreamCreateWithFlags(&stream, flags));
        EXPECT_CUDA(cudaMallocHost(&values, 64 * sizeof(int)));
        std::fill_n(values, 64, 1);
    }
    ~Pinned() {
        cudaFreeHost(values);
        cudaStreamDestroy(stream);
    }
    Pinned(const Pinned&) = delete;
    Pinned& operator=(const Pinned&) = delete;
    cudaStream_t stream = nullptr;
    int* values = nullptr;
};

struct Shape {
    unsigned blocks = 1, threads = 1;
    size_t shared = 0;
    cudaStream_t stream = nullptr;
    bool cooperative = false;
    unsigned cluster = 1;
};

template <class... Expected, class... Actual> cudaError_t launch(const Shape& shape, void (*kernel)(Expected...), Actual... args) {
    cudaLaunchAttribute attributes[2] = {};
    attributes[0].id = cudaLaunchAttributeCooperative;
    attributes[0].val.cooperative = shape.cooperative;
    attributes[1].id = cudaLaunchAttributeClusterDimension;
    attributes[1].val.clusterDim = {shape.cluster, 1, 1};
    cudaLaunchConfig_t config = {shape.blocks, shape.threads, shape.shared, shape.stream, attributes, shape.cluster > 1 ? 2u : 1u};
    return cudaLaunchKernelEx(&config, kernel, args...);
}

template <class T> T* shared_memory() { return static_cast<T*>(cairn_emulated::dynamic_shared()); }

inline const std::vector<std::pair<cairn_emulated::Order, unsigned long long>> every_order = {{cairn_emulated::Order::forward, 1},
                                                                                              {cairn_emulated::Order::reversed, 1},
                                                                                              {cairn_emulated::Order::shuffled, 1},
                                                                                              {cairn_emulated::Order::shuffled, 2},
                                                                                              {cairn_emulated::Order::shuffled, 3}};

class EmulatedTest : public testing::Test {
  protected:
    void SetUp() override { cairn_emulated::reset(); }
    void TearDown() override { cairn_emulated::reset(); }
};
