#include "check.h"

#include "../core/scene/fields.h"
#include "../core/scene/pack.h"
#include "cache.h"
#include "memory.h"

#include <limits>

namespace cairn::gpu {

namespace {

constexpr double kInfinite = std::numeric_limits<double>::infinity();

// Says, for each element, whether it is good; a bad one marks its table.
template <class Good> struct Check {
    Good good;
    Report* report;
    u32 bit;
    __device__ bool stopped() const { return false; }
    __device__ void operator()(u32 i) const {
        if (!good(i))
            atomicOr(&report->bad_input, bit);
    }
};

// The rules of the fields, each by itself.
struct Rules {
    static constexpr u32 kMost = 24;
    struct One {
        Column column;
        u32 components;
        Rule rule;
    } each[kMost];
    u32 count = 0;

    template <class Columns, class Fields> Rules(const Columns& columns, const Fields& fields) {
        static_assert(std::tuple_size_v<Fields> <= kMost);
        for (const auto& field : fields)
            if ((columns.*field.column).present() && field.rule.of != Rule::none)
                each[count++] = {columns.*field.column, static_cast<u32>(field.components), field.rule};
    }
    __device__ bool operator()(u32 i) const {
        for (u32 f = 0; f < count; ++f)
            if (!each[f].rule.obeyed(each[f].column, i, each[f].components))
                return false;
        return true;
    }
};

struct EndPoseOfKinematic {
    BodyColumns in;
    __device__ bool operator()(u32 i) const {
        return (flags_of(in.flags, i) & CAIRN_BODY_AT_END_POSE) == 0 ||
               (in.inverse_mass.real(i) == 0 && in.inverse_inertia.real(i, 0) == 0 && in.inverse_inertia.real(i, 1) == 0 &&
                in.inverse_inertia.real(i, 2) == 0);
    }
};

struct Pair {
    Column body_a, body_b;
    std::int64_t bodies;
    __device__ bool operator()(u32 i) const {
        const std::int64_t a = body_a.integer(i), b = body_b.integer(i);
        return a != b && a >= CAIRN_WORLD && a < bodies && b >= CAIRN_WORLD && b < bodies;
    }
};

__device__ bool ordered(double low, double high) { return low < kInfinite && high > -kInfinite && low <= high; }

__device__ bool not_negative(double value) { return value >= 0; } // or infinite

struct Axes {
    JointColumns in;
    __device__ u32 bits(u32 i, u32 c) const { return static_cast<u32>(in.axes.integer(i, c)); }
    __device__ bool operator()(u32 i) const {
        const std::int64_t kind = in.rotation.present() ? in.rotation.integer(i) : CAIRN_ROTATION_BY_AXES;
        if (kind < 0 || kind > CAIRN_ROTATION_CONE || !not_negative(real_or(in.max_force, i, 0)))
            return false;
        for (u32 c = 0; c < 6; ++c) {
            const bool cone = kind == CAIRN_ROTATION_CONE && c >= 4;
            if (!combination(bits(i, c)) || (cone && !half_angle(i, c)) || !values(i, c, bits(i, c), cone))
                return false;
        }
        return true;
    }

  private:
    __device__ static bool combination(u32 bits) {
        return ((bits & CAIRN_AXIS_LOCKED) == 0 || bits == CAIRN_AXIS_LOCKED) &&
               ((bits & CAIRN_AXIS_SERVO) == 0 || (bits & CAIRN_AXIS_DRIVEN) != 0) &&
               ((bits & CAIRN_AXIS_SPRING) == 0 || (bits & CAIRN_AXIS_DRIVEN) == 0);
    }
    __device__ bool half_angle(u32 i, u32 c) const {
        if (bits(i, c) != bits(i, 4) || (bits(i, c) != CAIRN_AXIS_FREE && bits(i, c) != CAIRN_AXIS_LIMITED))
            return false;
        return bits(i, c) == CAIRN_AXIS_FREE || (in.upper.present() && in.upper.real(i, c) > 0);
    }
    __device__ bool values(u32 i, u32 c, u32 bits, bool cone) const {
        const auto value = [&](const Column& column) { return column.present() ? column.real(i, c) : 0.0; };
        const bool servo = (bits & CAIRN_AXIS_SERVO) != 0;
        if ((bits & CAIRN_AXIS_LIMITED) != 0 && !cone &&
            !(in.lower.present() && in.upper.present() && ordered(in.lower.real(i, c), in.upper.real(i, c))))
            return false;
        if ((bits & CAIRN_AXIS_DRIVEN) != 0) {
            if (!in.motor_speed.present() || !in.motor_force.present() || !not_negative(in.motor_force.real(i, c)))
                return false;
            const double speed = in.motor_speed.real(i, c);
            if (servo ? !not_negative(speed) : !(speed - speed == 0))
                return false;
        }
        if ((bits & (CAIRN_AXIS_SPRING | CAIRN_AXIS_SERVO)) != 0 && !(value(in.target) - value(in.target) == 0))
            return false;
        if (servo && !(not_negative(value(in.stiffness)) && not_negative(value(in.rate))))
            return false;
        return (bits & CAIRN_AXIS_SPRING) == 0 ||
               (in.stiffness.present() && finite_not_negative(value(in.stiffness)) && finite_not_negative(value(in.damping)));
    }
    __device__ static bool finite_not_negative(double value) { return value >= 0 && value < kInfinite; }
};

struct RowBounds {
    RowColumns in;
    __device__ bool operator()(u32 i) const { return ordered(real_or(in.lower, i, -kInfinite), real_or(in.upper, i, kInfinite)); }
};

// The block that row i belongs to, as far as row i: its length, and what i's friction index names in it.
struct RowBlocks {
    RowColumns in;
    __device__ bool same(u32 i, u32 j) const {
        return in.body_a.integer(i) == in.body_a.integer(j) && in.body_b.integer(i) == in.body_b.integer(j) &&
               (!in.block.present() || in.block.integer(i) == in.block.integer(j));
    }
    __device__ bool operator()(u32 i) const {
        u32 start = i;
        while (start > 0 && same(start - 1, i)) {
            if (i - --start >= kRawRows)
                return false;
        }
        if (!in.friction_index.present())
            return true;
        const std::int64_t normal = in.friction_index.integer(i);
        if (normal == -1)
            return true;
        if (normal < start || normal >= i || in.friction_index.integer(static_cast<u32>(normal)) != -1)
            return false;
        if (!in.lower.present() || in.lower.real(static_cast<u32>(normal)) < 0)
            return false;
        u32 bounded = 0; // by that row, before this one
        for (u32 j = start; j < i; ++j)
            bounded += in.friction_index.integer(j) == normal ? 1 : 0;
        return bounded == 0 || (bounded == 1 && in.friction_index.integer(i - 1) == normal);
    }
};

// Keys other than 0 are unique. The table, of places + 1 and half full at most, must be clear.
struct UniqueKey {
    Column key;
    u32* table;
    u32 table_size;
    __device__ bool operator()(u32 i) const {
        const u64 mine = key.key(i);
        if (mine == 0)
            return true;
        u32 at = static_cast<u32>((u64{hash_of(mine)} * table_size) >> 32);
        for (;;) {
            const u32 other = atomicCAS(&table[at], 0u, i + 1);
            if (other == 0)
                return true;
            if (key.key(other - 1) == mine)
                return false;
            at = at + 1 < table_size ? at + 1 : 0;
        }
    }
};

} // namespace

void check_tables(const Layout& d, const Input& in, cudaStream_t stream) {
    const auto each = [&](std::size_t count, u32 bit, const auto& good) {
        loop(stream, static_cast<u32>(count), Check<std::remove_cvref_t<decltype(good)>>{good, d.report, bit});
    };
    const auto unique = [&](const auto& table, u32 bit) {
        if (!table.key.present())
            return;
        const auto size = static_cast<u32>(2 * table.count); // d.keys serves the sorts later
        clear(d.keys, size, stream);
        each(table.count, bit, UniqueKey{table.key, d.keys, size});
    };
    const auto bodies = static_cast<std::int64_t>(in.bodies.count);
    if (in.bodies.on_device) {
        each(in.bodies.count, kBadBodies, Rules(in.bodies, kBodyTable));
        if (in.bodies.flags.present())
            each(in.bodies.count, kBadBodies, EndPoseOfKinematic{in.bodies});
    }
    if (in.contacts.on_device) {
        each(in.contacts.count, kBadContacts, Pair{in.contacts.body_a, in.contacts.body_b, bodies});
        each(in.contacts.count, kBadContacts, Rules(in.contacts, kContactTable));
        unique(in.contacts, kBadContacts);
    }
    if (in.joints.on_device) {
        each(in.joints.count, kBadJoints, Pair{in.joints.body_a, in.joints.body_b, bodies});
        each(in.joints.count, kBadJoints, Rules(in.joints, kJointTable));
        each(in.joints.count, kBadJoints, Axes{in.joints});
        unique(in.joints, kBadJoints);
    }
    if (in.rows.on_device) {
        each(in.rows.count, kBadRows, Pair{in.rows.body_a, in.rows.body_b, bodies});
        each(in.rows.count, kBadRows, Rules(in.rows, kRowTable));
        each(in.rows.count, kBadRows, RowBounds{in.rows});
        each(in.rows.count, kBadRows, RowBlocks{in.rows});
        unique(in.rows, kBadRows);
    }
}

} // namespace cairn::gpu
