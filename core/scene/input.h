// What a step gets and gives: columns over the caller's arrays, already checked by capi (but for
// elements of tables on the device, which the solver checks).
#pragma once
#include "../portable.h"

#include <cstddef>
#include <cstdint>
#include <cstring>

namespace cairn {

enum class Type : std::uint32_t { f32, f64, i32, u32, u64 }; // the values of CAIRN_F32 ...

CAIRN_HD constexpr std::size_t size_of(Type type) { return type == Type::f64 || type == Type::u64 ? 8 : 4; }

// A field of a table: `real(i, c)` is component c of element i.
struct Column {
    const std::byte* data = nullptr;
    std::ptrdiff_t stride = 0; // bytes, never 0 where data is set
    Type type = Type::f64;
    bool on_device = false; // CUDA memory: not for the host to read

    CAIRN_HD bool present() const { return data != nullptr; }
    CAIRN_HD double real(std::size_t i, std::size_t c = 0) const {
        return type == Type::f32 ? static_cast<double>(load<float>(i, c)) : load<double>(i, c);
    }
    // U32 is read as the same 32 bits, so that 0xffffffff is -1: no body, no row.
    CAIRN_HD std::int64_t integer(std::size_t i, std::size_t c = 0) const { return load<std::int32_t>(i, c); }
    CAIRN_HD std::uint64_t key(std::size_t i) const { return load<std::uint64_t>(i, 0); }

  private:
    template <class T> CAIRN_HD T load(std::size_t i, std::size_t c) const {
        const std::byte* at = data + static_cast<std::ptrdiff_t>(i) * stride + static_cast<std::ptrdiff_t>(c * sizeof(T));
#if defined(__CUDA_ARCH__) // a copy of unknown alignment would be made byte by byte
        return *reinterpret_cast<const T*>(at);
#else
        T value;
        std::memcpy(&value, at, sizeof value);
        return value;
#endif
    }
};

struct MutableColumn {
    std::byte* data = nullptr;
    std::ptrdiff_t stride = 0;
    Type type = Type::f64;
    bool on_device = false;

    CAIRN_HD bool present() const { return data != nullptr; }
    CAIRN_HD void set(std::size_t i, std::size_t c, double value) const {
        std::byte* at = data + static_cast<std::ptrdiff_t>(i) * stride + static_cast<std::ptrdiff_t>(c * size_of(type));
        if (type == Type::f32)
            put(at, static_cast<float>(value));
        else
            put(at, value);
    }

  private:
    template <class T> CAIRN_HD static void put(std::byte* at, T value) {
#if defined(__CUDA_ARCH__)
        *reinterpret_cast<T*>(at) = value;
#else
        std::memcpy(at, &value, sizeof value);
#endif
    }
};

struct BodyColumns {
    std::size_t count = 0;
    std::uint64_t revision = 0;
    bool on_device = false; // a column of it is: capi has not checked the elements
    Column position, orientation, linear_velocity, angular_velocity, inverse_mass, inverse_inertia;
    Column force, torque, linear_factor, angular_factor, flags;
};

struct ContactColumns {
    std::size_t count = 0;
    std::uint64_t revision = 0;
    bool on_device = false; // a column of it is: capi has not checked the elements
    Column body_a, body_b, normal, arm_a, arm_b, separation, friction, restitution, tangent, key, flags;
    Column friction_scale, surface_velocity, rolling_friction, spinning_friction, stiffness, damping;

    // May a contact have what only special groups do?
    CAIRN_HD bool special() const {
        return surface_velocity.present() || rolling_friction.present() || spinning_friction.present() || stiffness.present() ||
               damping.present();
    }
};

struct JointColumns {
    std::size_t count = 0;
    std::uint64_t revision = 0;
    bool on_device = false; // a column of it is: capi has not checked the elements
    Column body_a, body_b, anchor_a, anchor_b, frame_a, frame_b, axes, lower, upper, motor_speed, motor_force, key;
    Column rotation, target, stiffness, damping, rate, max_force;
};

struct RowColumns {
    std::size_t count = 0;
    std::uint64_t revision = 0;
    bool on_device = false; // a column of it is: capi has not checked the elements
    Column body_a, body_b, jacobian_a, jacobian_b, rhs, lower, upper, compliance, friction_index, friction, block, key;
};

struct Input {
    double dt = 0;
    double gravity[3] = {0, 0, 0};
    BodyColumns bodies;
    ContactColumns contacts;
    JointColumns joints;
    RowColumns rows;
};

struct Output {
    MutableColumn position, orientation, linear_velocity, angular_velocity;
    MutableColumn contact_impulse, friction_impulse, joint_impulse, row_impulse, torsion_impulse;
    MutableColumn joint_linear, joint_angular;
};

// The same of a step that is over, to be read.
struct Outcome {
    Column position, orientation, linear_velocity, angular_velocity;
    Column contact_impulse, friction_impulse, joint_impulse, row_impulse, torsion_impulse;
    Column joint_linear, joint_angular;
};

} // namespace cairn
