// The caller's tables on the device, and the caller's results back: packed columns, sent through pinned memory.
#pragma once
#include "../core/scene/fields.h"
#include "layout.h"
#include "memory.h"

namespace cairn::gpu {

// One table's columns. Sent again only if its revision is not the last one's.
class DeviceTable {
  public:
    // A column of the caller's and the same one on the device.
    struct Part {
        const Column* from;
        Column* to;
        std::size_t components;
    };
    // Fills `to` with columns on the device: those that are there already, and copies of the others, which it queues; `staging` must
    // live until they are made.
    void send(const Part* parts, std::size_t part_count, std::size_t count, u64 revision, Buffer<Pinned>& staging, cudaStream_t stream);

  private:
    Buffer<OnDevice> buffer_;
    u64 revision_ = 0; // 0: what is there must not be used again
    u64 shape_ = 0;    // a hash of the columns' presence, types and count
    std::size_t size_ = 0;
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
    // `to`: columns on the device for those of `output` that are present, the caller's own where they are there.
    void prepare(const Input& input, const Output& output, Output& to);
    // `body_kind`: the device's, by body.
    void fetch(const u32* body_kind, cudaStream_t stream);
    // After the copies have happened, and while the caller's memory is still borrowed.
    void deliver(const Input& input) const;

  private:
    struct Part {
        MutableColumn to;
        MutableColumn* on_device;
        std::size_t offset, components, count;
        bool of_bodies;
    };
    Buffer<OnDevice> device_;
    Buffer<Pinned> host_;
    Part parts_[kResultTable.size()];
    std::size_t part_count_ = 0, size_ = 0, kinds_ = 0; // kinds_: of bodies, fetched since the host cannot see who is movable
};

} // namespace cairn::gpu
