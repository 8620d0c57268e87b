// The caller's tables on the device, and the caller's results back: packed columns, sent through pinned memory.
#pragma once
#include "layout.h"
#include "memory.h"

namespace cairn::gpu {

// One table's columns. Sent again only if its revision is not the last one's.
class DeviceTable {
  public:
    // Where columns are copied from and to: the caller's, those of `Columns` that are present.
    struct Part {
        const Column* from;
        Column* to;
        std::size_t components;
    };
    // Fills `to` with columns on the device and queues the copy; `staging` must live until it has happened.
    void send(const Part* parts, std::size_t part_count, std::size_t count, u64 revision, Buffer<Pinned>& staging, cudaStream_t stream);

  private:
    Buffer<OnDevice> buffer_;
    u64 revision_ = 0; // 0: what is there must not be used again
    u64 shape_ = 0;    // a hash of the columns' presence, types and count
};

class DeviceTables {
  public:
    // `to`: the same input with columns on the device.
    void send(const Input& input, Input& to, cudaStream_t stream);

  private:
    DeviceTable bodies_, contacts_, joints_, rows_;
    Buffer<Pinned> staging_[4];
};

// Results: device arrays for what the caller wants, copied to pinned memory, and from there into the caller's views.
class DeviceResults {
  public:
    // `to`: columns on the device for those of `output` that are present.
    void prepare(const Input& input, const Output& output, Output& to);
    void fetch(cudaStream_t stream);
    // After the copies have happened. `written(i)`: whether body i's results were.
    template <class Written> void deliver(const Written& written) const;

  private:
    struct Part {
        MutableColumn to;
        std::size_t offset, components, count;
        bool of_bodies;
    };
    Buffer<OnDevice> device_;
    Buffer<Pinned> host_;
    Part parts_[8];
    std::size_t part_count_ = 0, size_ = 0;
};

template <class Written> void DeviceResults::deliver(const Written& written) const {
    for (std::size_t p = 0; p < part_count_; ++p) {
        const Part& part = parts_[p];
        const std::size_t bytes = part.components * size_of(part.to.type);
        for (std::size_t i = 0; i < part.count; ++i)
            if (!part.of_bodies || written(i))
                std::memcpy(part.to.data + static_cast<std::ptrdiff_t>(i) * part.to.stride, host_.data() + part.offset + i * bytes, bytes);
    }
}

} // namespace cairn::gpu
