// Memory of the device and pinned memory of the host: owned, grown geometrically.
#pragma once
#include "../core/solver.h"
#include "cuda.h"

#include <algorithm>
#include <utility>

#if defined(__SANITIZE_ADDRESS__)
#include <sanitizer/asan_interface.h>
#endif

namespace cairn::gpu {

template <class T> void clear(T* array, std::size_t count, cudaStream_t stream) {
    if (count > 0)
        check(cudaMemsetAsync(array, 0, count * sizeof(T), stream), "clearing device memory");
}

struct OnDevice {
    static cudaError_t allocate(void** memory, std::size_t bytes) { return cudaMalloc(memory, bytes); }
    static cudaError_t release(void* memory) { return cudaFree(memory); }
    static constexpr const char* name = "GPU";
};
struct Pinned {
    static cudaError_t allocate(void** memory, std::size_t bytes) { return cudaMallocHost(memory, bytes); }
    static cudaError_t release(void* memory) { return cudaFreeHost(memory); }
    static constexpr const char* name = "pinned host";
};

// Bytes. Growing loses the contents; nothing queued may still use them.
template <class Kind> class Buffer {
  public:
    Buffer() = default;
    Buffer(const Buffer&) = delete;
    Buffer& operator=(const Buffer&) = delete;
    ~Buffer() { release(); }

    // Room for `bytes`; true if it had to grow. Throws OutOfDeviceMemory; then it holds nothing.
    bool reserve(std::size_t bytes) {
        if (bytes <= capacity_)
            return false;
        const std::size_t wished = std::max(bytes, capacity_ + capacity_ / 2);
        release(); // first, so that both need not fit
        for (const std::size_t size : {wished, bytes}) {
            void* memory = nullptr;
            const cudaError_t error = Kind::allocate(&memory, size);
            if (error == cudaSuccess) {
                data_ = static_cast<std::byte*>(memory);
                capacity_ = size;
                return true;
            }
            cudaGetLastError();
            if (error != cudaErrorMemoryAllocation)
                check(error, "allocating memory");
        }
        throw OutOfDeviceMemory(Kind::name, bytes);
    }
    void release() {
        if (data_)
            Kind::release(data_); // errors of work that failed before show here, too: they were reported then
        data_ = nullptr;
        capacity_ = 0;
    }
    std::byte* data() const { return data_; }
    std::size_t capacity() const { return capacity_; }
    void swap(Buffer& other) {
        std::swap(data_, other.data_);
        std::swap(capacity_, other.capacity_);
    }

  private:
    std::byte* data_ = nullptr;
    std::size_t capacity_ = 0;
};

// Arrays one after the other, each on a line of the memory's own; the gaps are poisoned where a sanitizer looks.
class Carver {
  public:
    explicit Carver(std::byte* base) : base_(base) {}

    template <class T> void add(T*& array, std::size_t count) {
        array = base_ ? reinterpret_cast<T*>(base_ + used_) : nullptr;
        const std::size_t size = count * sizeof(T), padded = (size + kLine) / kLine * kLine; // at least a byte of gap
#if defined(__SANITIZE_ADDRESS__)
        if (base_) {
            ASAN_UNPOISON_MEMORY_REGION(base_ + used_, size);
            ASAN_POISON_MEMORY_REGION(base_ + used_ + size, padded - size);
        }
#endif
        used_ += padded;
    }
    std::size_t used() const { return used_; }

  private:
    static constexpr std::size_t kLine = 256;
    std::byte* base_;
    std::size_t used_ = 0;
};

class Stream {
  public:
    // One of its own, after what the legacy default stream holds; or somebody else's.
    explicit Stream(void* theirs = nullptr) : stream_(static_cast<cudaStream_t>(theirs)), own_(!theirs) {
        if (own_)
            check(cudaStreamCreateWithFlags(&stream_, cudaStreamDefault), "creating a stream");
    }
    ~Stream() {
        if (own_)
            cudaStreamDestroy(stream_);
    }
    Stream(const Stream&) = delete;
    Stream& operator=(const Stream&) = delete;
    operator cudaStream_t() const { return stream_; }

  private:
    cudaStream_t stream_;
    bool own_;
};

// Makes a device the thread's current one for a while: a thread of the caller's may have another.
class Current {
  public:
    explicit Current(int device) {
        check(cudaGetDevice(&before_), "asking for the device");
        if (before_ != device)
            check(cudaSetDevice(device), "choosing the device");
        else
            before_ = -1;
    }
    ~Current() {
        if (before_ >= 0)
            cudaSetDevice(before_);
    }
    Current(const Current&) = delete;
    Current& operator=(const Current&) = delete;

  private:
    int before_ = -1;
};

class Event {
  public:
    Event() { check(cudaEventCreateWithFlags(&event_, cudaEventDefault), "creating an event"); }
    ~Event() { cudaEventDestroy(event_); }
    Event(const Event&) = delete;
    Event& operator=(const Event&) = delete;
    void record(cudaStream_t stream) { check(cudaEventRecord(event_, stream), "recording an event"); }
    // Seconds since an earlier one; both must have happened.
    double since(const Event& earlier) const {
        float milliseconds = 0;
        check(cudaEventElapsedTime(&milliseconds, earlier.event_, event_), "timing");
        return 1e-3 * static_cast<double>(milliseconds);
    }

  private:
    cudaEvent_t event_ = nullptr;
};

} // namespace cairn::gpu
