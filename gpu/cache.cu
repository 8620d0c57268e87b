#include "cache.h"

#include "../core/scene/unpack.h"

#include <bit>
#include <vector>

namespace cairn::gpu {

namespace {

__device__ void insert(const Memory& memory, u32 i, u64 key) {
    memory.key[i] = key;
    if (key == 0)
        return;
    u32 at = home_of(key, memory.table_size);
    while (atomicCAS(&memory.table[at], 0u, i + 1) != 0)
        at = (at + 1) & (memory.table_size - 1);
}

// A lane's impulses under its elements' keys. Rows of no effect keep the key 0 that they were cleared to.
struct RememberLane {
    Layout d;
    Memories to;
    double per_h;
    __device__ bool stopped() const { return d.report->bad_input != 0; }
    __device__ void operator()(u32 lane) const {
        const u32 head = d.lane_head[lane];
        if (head == kNone)
            return;
        const Input& input = d.request->input;
        for (u32 p = 0; p < d.lane_count[lane]; ++p) {
            const u32 place = d.lane_first[lane] + p * d.lane_stride[lane];
            if (head < d.joint_base()) {
                const u32 i = head + p;
                remember_contact(fields_at(d.contact, kContactFields, place), fields_at(d.contact_cold, kContactColdFields, place), per_h,
                                 to.contacts.values + static_cast<std::size_t>(i) * kContactMemory);
                insert(to.contacts, i, key_of(input.contacts.key, i));
            } else if (head < d.raw_base()) {
                const u32 i = head - d.joint_base();
                remember_joint(fields_at(d.joint_cold, kJointColdFields, place), per_h,
                               to.joints.values + static_cast<std::size_t>(i) * kJointMemory);
                insert(to.joints, i, key_of(input.joints.key, i));
            } else {
                const u32 i = head - d.raw_base() + p;
                remember_row(fields_at(d.raw, kRawFields, place), per_h, to.rows.values + i);
                insert(to.rows, i, key_of(input.rows.key, i));
            }
        }
    }
};

struct IndexKeys {
    Memory memory;
    __device__ bool stopped() const { return false; }
    __device__ void operator()(u32 i) const { insert(memory, i, memory.key[i]); }
};

struct Kind {
    Memory Memories::*memory;
    u32 width;
};
constexpr Kind kKinds[] = {{&Memories::contacts, kContactMemory}, {&Memories::joints, kJointMemory}, {&Memories::rows, kRowMemory}};

} // namespace

void DeviceCache::prepare(const Capacity& capacity, cudaStream_t stream) {
    used_ = false;
    const u32 rows[] = {capacity.contacts, capacity.joints, capacity.rows};
    const auto lay_out = [&](std::byte* base) {
        Carver to(base);
        for (u32 k = 0; k < 3; ++k) {
            Memory& memory = memories_.*kKinds[k].memory;
            memory.capacity = rows[k];
            memory.table_size = rows[k] > 0 ? std::bit_ceil(2 * rows[k]) : 0;
            to.add(memory.key, rows[k]);
            to.add(memory.values, std::size_t{rows[k]} * kKinds[k].width);
            to.add(memory.table, memory.table_size);
        }
        return to.used();
    };
    buffer_.reserve(lay_out(nullptr));
    lay_out(buffer_.data());
    for (const Kind& kind : kKinds) {
        const Memory& memory = memories_.*kind.memory;
        clear(memory.key, memory.capacity, stream);
        clear(memory.table, memory.table_size, stream);
    }
}

void DeviceCache::remember(const Layout& layout, float h, cudaStream_t stream) {
    loop(stream, layout.capacity.elements(), RememberLane{layout, memories_, 1 / static_cast<double>(h)});
    used_ = true;
}

void DeviceCache::download(WarmStartCache& cache, cudaStream_t stream) const {
    cache.clear();
    KeyedValues* const to[] = {&cache.contacts, &cache.joints, &cache.rows};
    for (u32 k = 0; used_ && k < 3; ++k) {
        const Memory& memory = memories_.*kKinds[k].memory;
        std::vector<u64> keys(memory.capacity);
        std::vector<double> values(std::size_t{memory.capacity} * kKinds[k].width);
        check(cudaMemcpyAsync(keys.data(), memory.key, keys.size() * sizeof(u64), cudaMemcpyDeviceToHost, stream), "saving the cache");
        check(cudaMemcpyAsync(values.data(), memory.values, values.size() * sizeof(double), cudaMemcpyDeviceToHost, stream),
              "saving the cache");
        check(cudaStreamSynchronize(stream), "saving the cache");
        for (std::size_t i = 0; i < keys.size(); ++i)
            to[k]->insert(keys[i], values.data() + i * kKinds[k].width);
    }
    cache.contacts.index();
    cache.joints.index();
    cache.rows.index();
}

void DeviceCache::upload(const WarmStartCache& cache, cudaStream_t stream) {
    const KeyedValues* const from[] = {&cache.contacts, &cache.joints, &cache.rows};
    Capacity capacity;
    capacity.contacts = static_cast<u32>(cache.contacts.size());
    capacity.joints = static_cast<u32>(cache.joints.size());
    capacity.rows = static_cast<u32>(cache.rows.size());
    prepare(capacity, stream);
    for (u32 k = 0; k < 3; ++k) {
        const Memory& memory = memories_.*kKinds[k].memory;
        if (memory.capacity == 0)
            continue;
        check(cudaMemcpyAsync(memory.key, from[k]->keys().data(), from[k]->keys().size_bytes(), cudaMemcpyHostToDevice, stream),
              "loading the cache");
        check(cudaMemcpyAsync(memory.values, from[k]->values().data(), from[k]->values().size_bytes(), cudaMemcpyHostToDevice, stream),
              "loading the cache");
        loop(stream, memory.capacity, IndexKeys{memory});
    }
    check(cudaStreamSynchronize(stream), "loading the cache");
    used_ = true;
}

void DeviceCache::swap(DeviceCache& other) {
    buffer_.swap(other.buffer_);
    std::swap(memories_, other.memories_);
    std::swap(used_, other.used_);
}

} // namespace cairn::gpu
