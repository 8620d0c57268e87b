// Copies and fills: what kind each is by where its ends lie, and when it reads and writes.
#include "memory.h"
#include "streams.h"
#include <cstdio>
#include <cstdlib>
#include <cstring>

namespace cairn_emulated {
namespace {
struct Copy {
    char* dst;
    size_t dpitch;
    const char* src;
    size_t spitch, width, height;

    void run() const {
        for (size_t row = 0; row < height; row++)
            std::memcpy(dst + row * dpitch, src + row * spitch, width);
    }
};

size_t extent(size_t pitch, size_t width, size_t height) { return pitch * (height - 1) + width; }

struct Ends {
    Where dst, src;
    bool to_device() const { return dst == Where::device; }
    bool from_device() const { return src == Where::device; }
};

bool kind_fits(const Ends& ends, cudaMemcpyKind kind) {
    switch (kind) {
    case cudaMemcpyHostToHost:
        return !ends.to_device() && !ends.from_device();
    case cudaMemcpyHostToDevice:
        return ends.to_device() && !ends.from_device();
    case cudaMemcpyDeviceToHost:
        return !ends.to_device() && ends.from_device();
    case cudaMemcpyDeviceToDevice:
        return ends.to_device() && ends.from_device();
    case cudaMemcpyDefault:
        return true;
    }
    return false;
}

void count(const Ends& ends, size_t bytes) {
    if (ends.to_device() && ends.from_device())
        state.counters.bytes_on_device += bytes;
    else if (ends.to_device())
        state.counters.bytes_to_device += bytes;
    else if (ends.from_device())
        state.counters.bytes_to_host += bytes;
}

cudaError_t copy(Copy c, cudaMemcpyKind kind, cudaStream_t stream, bool blocking) {
    if (kind < cudaMemcpyHostToHost || kind > cudaMemcpyDefault)
        return cudaErrorInvalidMemcpyDirection;
    if (!find_stream(stream))
        return cudaErrorInvalidResourceHandle;
    if (blocking && capture_forbids_waiting())
        return cudaErrorStreamCaptureUnsupported;
    if (c.width == 0 || c.height == 0)
        return cudaSuccess;
    const size_t dst_bytes = extent(c.dpitch, c.width, c.height), src_bytes = extent(c.spitch, c.width, c.height);
    if (c.width > c.dpitch || c.width > c.spitch || (c.dst < c.src + src_bytes && c.src < c.dst + dst_bytes))
        return cudaErrorInvalidValue;
    const Ends ends{locate(c.dst, dst_bytes), locate(c.src, src_bytes)};
    if (ends.dst == Where::nowhere || ends.src == Where::nowhere || !kind_fits(ends, kind))
        return cudaErrorInvalidValue;
    const bool pageable = ends.dst == Where::pageable || ends.src == Where::pageable;
    if (pageable && is_capturing(stream))
        return cudaErrorStreamCaptureUnsupported;
    std::shared_ptr<char[]> staged;
    if (ends.to_device() && ends.src == Where::pageable) { // CUDA has read it when the call returns
        staged = std::make_shared<char[]>(c.width * c.height);
        Copy{staged.get(), c.width, c.src, c.spitch, c.width, c.height}.run();
        c.src = staged.get();
        c.spitch = c.width;
    }
    const cudaError_t error = enqueue(stream, [=] {
        if (locate(c.dst, dst_bytes) != ends.dst || (!staged && locate(c.src, src_bytes) != ends.src)) { // a graph outlived them
            std::fprintf(stderr, "cairn_emulated: a copy of %zu bytes runs whose memory has been freed\n", c.width * c.height);
            std::abort();
        }
        c.run();
        count(ends, c.width * c.height);
    });
    // CUDA returns from a copy to pageable memory when it is done, asynchronous or not.
    const bool waits = (blocking && !(ends.to_device() && ends.from_device())) || ends.dst == Where::pageable;
    return error == cudaSuccess && waits ? finish(stream) : error;
}

cudaError_t fill(void* pointer, int value, size_t count, cudaStream_t stream) {
    if (!find_stream(stream))
        return cudaErrorInvalidResourceHandle;
    if (count == 0)
        return cudaSuccess;
    if (locate(pointer, count) != Where::device)
        return cudaErrorInvalidValue;
    return enqueue(stream, [=] {
        if (locate(pointer, count) != Where::device) {
            std::fprintf(stderr, "cairn_emulated: a fill of %zu bytes runs whose memory has been freed\n", count);
            std::abort();
        }
        std::memset(pointer, value, count);
    });
}
} // namespace
} // namespace cairn_emulated

using namespace cairn_emulated;

cudaError_t cudaMemcpy(void* dst, const void* src, size_t count, cudaMemcpyKind kind) {
    return api_call([&] {
        return copy({static_cast<char*>(dst), count, static_cast<const char*>(src), count, count, 1}, kind, nullptr, true);
    });
}
cudaError_t cudaMemcpyAsync(void* dst, const void* src, size_t count, cudaMemcpyKind kind, cudaStream_t stream) {
    return api_call([&] {
        return copy({static_cast<char*>(dst), count, static_cast<const char*>(src), count, count, 1}, kind, stream, false);
    });
}
cudaError_t cudaMemcpy2DAsync(void* dst, size_t dpitch, const void* src, size_t spitch, size_t width, size_t height, cudaMemcpyKind kind,
                              cudaStream_t stream) {
    return api_call([&] {
        return copy({static_cast<char*>(dst), dpitch, static_cast<const char*>(src), spitch, width, height}, kind, stream, false);
    });
}
cudaError_t cudaMemset(void* pointer, int value, size_t count) {
    return api_call([&] { return fill(pointer, value, count, nullptr); });
}
cudaError_t cudaMemsetAsync(void* pointer, int value, size_t count, cudaStream_t stream) {
    return api_call([&] { return fill(pointer, value, count, stream); });
}
