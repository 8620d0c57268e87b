#include "tables.h"

#include <array>

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
        shape = shape * 16 + 1 + (from.present() ? 1 + static_cast<u64>(from.type) : 0); // at most 13 columns: a hash, not a proof ...
        shape ^= shape >> 29;
        if (from.present())
            size += padded(count * parts[p].components * size_of(from.type));
    }
    const bool known =
        revision != 0 && revision == revision_ && shape == shape_ && size <= buffer_.capacity(); // ... but sizes must agree, too
    revision_ = 0;
    if (!known) {
        buffer_.reserve(size);
        staging.reserve(size);
    }
    std::size_t at = 0;
    for (std::size_t p = 0; p < part_count; ++p) {
        const Column& from = *parts[p].from;
        Column& to = *parts[p].to;
        to = Column{};
        if (!from.present())
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
        to = {buffer_.data() + at, static_cast<std::ptrdiff_t>(bytes), from.type};
        at += padded(count * bytes);
    }
    if (!known && size > 0)
        check(cudaMemcpyAsync(buffer_.data(), staging.data(), size, cudaMemcpyHostToDevice, stream), "sending a table");
    revision_ = revision;
    shape_ = shape;
}

void DeviceTables::send(const Input& in, Input& to, cudaStream_t stream) {
    to = in;
    const auto send = [stream](DeviceTable& table, const auto& parts, const auto& columns, Buffer<Pinned>& staging) {
        table.send(parts.data(), parts.size(), columns.count, columns.revision, staging, stream);
    };
    using Part = DeviceTable::Part;
    const BodyColumns& b = in.bodies;
    BodyColumns& bt = to.bodies;
    send(bodies_,
         std::array{Part{&b.position, &bt.position, 3}, Part{&b.orientation, &bt.orientation, 4},
                    Part{&b.linear_velocity, &bt.linear_velocity, 3}, Part{&b.angular_velocity, &bt.angular_velocity, 3},
                    Part{&b.inverse_mass, &bt.inverse_mass, 1}, Part{&b.inverse_inertia, &bt.inverse_inertia, 3},
                    Part{&b.force, &bt.force, 3}, Part{&b.torque, &bt.torque, 3}, Part{&b.linear_factor, &bt.linear_factor, 3},
                    Part{&b.angular_factor, &bt.angular_factor, 3}, Part{&b.flags, &bt.flags, 1}},
         b, staging_[0]);
    const ContactColumns& c = in.contacts;
    ContactColumns& ct = to.contacts;
    send(contacts_,
         std::array{Part{&c.body_a, &ct.body_a, 1}, Part{&c.body_b, &ct.body_b, 1}, Part{&c.normal, &ct.normal, 3},
                    Part{&c.arm_a, &ct.arm_a, 3}, Part{&c.arm_b, &ct.arm_b, 3}, Part{&c.separation, &ct.separation, 1},
                    Part{&c.friction, &ct.friction, 1}, Part{&c.restitution, &ct.restitution, 1}, Part{&c.tangent, &ct.tangent, 3},
                    Part{&c.key, &ct.key, 1}, Part{&c.flags, &ct.flags, 1}},
         c, staging_[1]);
    const JointColumns& j = in.joints;
    JointColumns& jt = to.joints;
    send(joints_,
         std::array{Part{&j.body_a, &jt.body_a, 1}, Part{&j.body_b, &jt.body_b, 1}, Part{&j.anchor_a, &jt.anchor_a, 3},
                    Part{&j.anchor_b, &jt.anchor_b, 3}, Part{&j.frame_a, &jt.frame_a, 4}, Part{&j.frame_b, &jt.frame_b, 4},
                    Part{&j.axes, &jt.axes, 6}, Part{&j.lower, &jt.lower, 6}, Part{&j.upper, &jt.upper, 6},
                    Part{&j.motor_speed, &jt.motor_speed, 6}, Part{&j.motor_force, &jt.motor_force, 6}, Part{&j.key, &jt.key, 1}},
         j, staging_[2]);
    const RowColumns& r = in.rows;
    RowColumns& rt = to.rows;
    send(rows_,
         std::array{Part{&r.body_a, &rt.body_a, 1}, Part{&r.body_b, &rt.body_b, 1}, Part{&r.jacobian_a, &rt.jacobian_a, 6},
                    Part{&r.jacobian_b, &rt.jacobian_b, 6}, Part{&r.rhs, &rt.rhs, 1}, Part{&r.lower, &rt.lower, 1},
                    Part{&r.upper, &rt.upper, 1}, Part{&r.compliance, &rt.compliance, 1}, Part{&r.friction_index, &rt.friction_index, 1},
                    Part{&r.friction, &rt.friction, 1}, Part{&r.block, &rt.block, 1}, Part{&r.key, &rt.key, 1}},
         r, staging_[3]);
}

void DeviceResults::prepare(const Input& input, const Output& output, Output& to) {
    to = Output{};
    part_count_ = size_ = 0;
    const struct {
        MutableColumn Output::*column;
        std::size_t components, count;
        bool of_bodies;
    } fields[] = {
        {&Output::position, 3, input.bodies.count, true},           {&Output::orientation, 4, input.bodies.count, true},
        {&Output::linear_velocity, 3, input.bodies.count, true},    {&Output::angular_velocity, 3, input.bodies.count, true},
        {&Output::contact_impulse, 1, input.contacts.count, false}, {&Output::friction_impulse, 3, input.contacts.count, false},
        {&Output::joint_impulse, 6, input.joints.count, false},     {&Output::row_impulse, 1, input.rows.count, false},
    };
    for (const auto& field : fields) {
        const MutableColumn& wanted = output.*field.column;
        if (!wanted.present() || field.count == 0)
            continue;
        parts_[part_count_++] = {wanted, size_, field.components, field.count, field.of_bodies};
        size_ += padded(field.count * field.components * size_of(wanted.type));
    }
    device_.reserve(size_);
    host_.reserve(size_);
    std::size_t part = 0;
    for (const auto& field : fields) {
        const MutableColumn& wanted = output.*field.column;
        if (!wanted.present() || field.count == 0)
            continue;
        to.*field.column = {device_.data() + parts_[part++].offset, static_cast<std::ptrdiff_t>(field.components * size_of(wanted.type)),
                            wanted.type};
    }
}

void DeviceResults::fetch(cudaStream_t stream) {
    if (size_ > 0)
        check(cudaMemcpyAsync(host_.data(), device_.data(), size_, cudaMemcpyDeviceToHost, stream), "fetching results");
}

} // namespace cairn::gpu
