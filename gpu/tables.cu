#include "tables.h"

#include "../core/scene/pack.h"

#include <cstring>
#include <type_traits>

namespace cairn::gpu {

namespace {

constexpr std::size_t kLine = 256;
std::size_t padded(std::size_t bytes) { return (bytes + kLine - 1) / kLine * kLine; }

} // namespace

void DeviceTable::send(const Part* parts, std::size_t part_count, std::size_t count, u64 revision, Buffer<Pinned>& staging,
                       cudaStream_t stream) {
    std::size_t size = 0;
    u64 shape = count;
    for (std::size_t p = 0; p < part_count; ++p) {
        const Column& from = *parts[p].from;
        const bool sent = from.present() && !from.on_device;
        shape = shape * 16 + 1 + (sent ? 1 + static_cast<u64>(from.type) : 0); // a hash, not a proof ...
        shape ^= shape >> 29;
        if (sent)
            size += padded(count * parts[p].components * size_of(from.type));
    }
    const bool known = revision != 0 && revision == revision_ && shape == shape_ && size == size_; // ... but sizes must agree, too
    revision_ = 0;
    if (!known) {
        buffer_.reserve(size);
        staging.reserve(size);
    }
    std::size_t at = 0;
    for (std::size_t p = 0; p < part_count; ++p) {
        const Column& from = *parts[p].from;
        Column& to = *parts[p].to;
        to = from;
        if (!from.present() || from.on_device)
            continue;
        const std::size_t bytes = parts[p].components * size_of(from.type);
        if (!known) {
            std::byte* const packed = staging.data() + at;
            if (from.stride == static_cast<std::ptrdiff_t>(bytes))
                std::memcpy(packed, from.data, count * bytes);
            else
                for (std::size_t i = 0; i < count; ++i)
                    std::memcpy(packed + i * bytes, from.data + static_cast<std::ptrdiff_t>(i) * from.stride, bytes);
        }
        to = {buffer_.data() + at, static_cast<std::ptrdiff_t>(bytes), from.type, true};
        at += padded(count * bytes);
    }
    if (!known && size > 0)
        check(cudaMemcpyAsync(buffer_.data(), staging.data(), size, cudaMemcpyHostToDevice, stream), "sending a table");
    revision_ = revision;
    shape_ = shape;
    size_ = size;
}

void DeviceTables::send(const Input& in, Input& to, cudaStream_t stream) {
    to = in;
    const auto send = [stream](DeviceTable& table, const auto& columns, auto& sent, const auto& fields, Buffer<Pinned>& staging) {
        DeviceTable::Part parts[std::tuple_size_v<std::remove_cvref_t<decltype(fields)>>];
        std::size_t count = 0;
        for (const auto& field : fields)
            parts[count++] = {&(columns.*field.column), &(sent.*field.column), field.components};
        table.send(parts, count, columns.count, columns.revision, staging, stream);
    };
    send(bodies_, in.bodies, to.bodies, kBodyTable, staging_[0]);
    send(contacts_, in.contacts, to.contacts, kContactTable, staging_[1]);
    send(joints_, in.joints, to.joints, kJointTable, staging_[2]);
    send(rows_, in.rows, to.rows, kRowTable, staging_[3]);
}

void DeviceResults::prepare(const Input& input, const Output& output, Output& to) {
    to = Output{};
    part_count_ = size_ = kinds_ = 0;
    const std::size_t counts[] = {input.bodies.count, input.contacts.count, input.joints.count, input.rows.count};
    for (const ResultField& field : kResultTable) {
        const MutableColumn& wanted = output.*field.column;
        const std::size_t count = counts[static_cast<std::size_t>(field.of)];
        if (!wanted.present() || count == 0)
            continue;
        MutableColumn& on_device = to.*field.column;
        on_device = wanted;
        if (wanted.on_device)
            continue;
        const bool of_bodies = field.of == Of::bodies;
        if (of_bodies && input.bodies.on_device)
            kinds_ = count;
        // a place for now: the memory may still move
        on_device = {nullptr, static_cast<std::ptrdiff_t>(field.components * size_of(wanted.type)), wanted.type, true};
        parts_[part_count_++] = {wanted, &on_device, size_, field.components, count, of_bodies};
        size_ += padded(count * field.components * size_of(wanted.type));
    }
    device_.reserve(size_);
    host_.reserve(size_ + kinds_ * sizeof(u32));
    for (std::size_t p = 0; p < part_count_; ++p)
        parts_[p].on_device->data = device_.data() + parts_[p].offset;
}

void DeviceResults::fetch(const u32* body_kind, cudaStream_t stream) {
    if (size_ > 0)
        check(cudaMemcpyAsync(host_.data(), device_.data(), size_, cudaMemcpyDeviceToHost, stream), "fetching results");
    if (kinds_ > 0)
        check(cudaMemcpyAsync(host_.data() + size_, body_kind, kinds_ * sizeof(u32), cudaMemcpyDeviceToHost, stream), "fetching results");
}

void DeviceResults::deliver(const Input& input) const {
    const auto* const kinds = reinterpret_cast<const u32*>(host_.data() + size_);
    for (std::size_t p = 0; p < part_count_; ++p) {
        const Part& part = parts_[p];
        const std::size_t bytes = part.components * size_of(part.to.type);
        for (std::size_t i = 0; i < part.count; ++i)
            if (!part.of_bodies || (kinds_ > 0 ? kinds[i] == kMovableBody : is_movable(input.bodies, i)))
                std::memcpy(part.to.data + static_cast<std::ptrdiff_t>(i) * part.to.stride, host_.data() + part.offset + i * bytes, bytes);
    }
}

} // namespace cairn::gpu
