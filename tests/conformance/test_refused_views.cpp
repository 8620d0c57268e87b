// Views: what each may be, and which memory may be shared. Interleaved fields pass, elements that truly overlap do not.
#include "small_world.h"

#include <algorithm>
#include <random>

using W = SmallWorld;

class RefusedViews : public SmallWorldTest {
  protected:
    template <class Break> void wrong(std::initializer_list<const char*> texts, Break break_it) {
        refused(CAIRN_ERROR_INVALID_ARGUMENT, texts, break_it);
    }
};

TEST_F(RefusedViews, TypeDeviceAlignmentStride) {
    wrong({"bodies.position: type is 2", "CAIRN_F32 or CAIRN_F64"}, [](W& w) { w.body_table.position.type = CAIRN_I32; });
    wrong({"contacts.body_a: type is 1", "CAIRN_I32 or CAIRN_U32"}, [](W& w) { w.contact_table.body_a.type = CAIRN_F64; });
    wrong({"contacts.key: type is 3", "CAIRN_U64"}, [](W& w) { w.contact_table.key.type = CAIRN_U32; });
    wrong({"results.position: type is 77"}, [](W& w) { w.results.position.type = 77; });
    refused(CAIRN_ERROR_UNSUPPORTED, {"joints.frame_b: device is CAIRN_DEVICE, but this solver runs on the CPU", "CAIRN_BACKEND_CUDA"},
            [](W& w) { w.joint_table.frame_b.device = CAIRN_DEVICE; });
    wrong({"rows.rhs: device is 2"}, [](W& w) { w.row_table.rhs.device = 2; });
    wrong({"bodies.force: data is 0x", "aligned", "8 bytes"},
          [](W& w) { w.body_table.force.data = reinterpret_cast<char*>(&w.bodies[0].force) + 4; });
    wrong({"bodies.force: stride is 252 bytes", "multiple"}, [](W& w) { w.body_table.force.stride = 252; });
    wrong({"bodies.force: stride is 16 bytes", "has 24", "overlap"}, [](W& w) { w.body_table.force.stride = 16; });
    wrong({"bodies.force: stride is -16 bytes"}, [](W& w) { w.body_table.force.stride = -16; });
    wrong({"bodies.force", "address space"}, [](W& w) { w.body_table.force.stride = std::numeric_limits<std::int64_t>::min(); });
    wrong({"bodies.force", "address space"}, [](W& w) { w.body_table.force.stride = std::numeric_limits<std::int64_t>::max() - 7; });
}

TEST_F(RefusedViews, RequiredOnes) {
    wrong({"bodies.position is absent", "4 elements"}, [](W& w) { w.body_table.position.data = nullptr; });
    wrong({"bodies.inverse_inertia is absent"}, [](W& w) { w.body_table.inverse_inertia.data = nullptr; });
    wrong({"contacts.separation is absent"}, [](W& w) { w.contact_table.separation.data = nullptr; });
    wrong({"joints.axes is absent"}, [](W& w) { w.joint_table.axes.data = nullptr; });
    wrong({"rows.jacobian_b is absent"}, [](W& w) { w.row_table.jacobian_b.data = nullptr; });
    wrong({"contacts.count is 2147483647", "2147483646"}, [](W& w) { w.contact_table.count = 0x7fffffffu; });
    accepted("the optional ones left out", [](W& w) {
        for (cairn_view* view :
             {&w.body_table.force,      &w.body_table.torque,      &w.body_table.linear_factor,  &w.body_table.angular_factor,
              &w.body_table.flags,      &w.contact_table.friction, &w.contact_table.restitution, &w.contact_table.tangent,
              &w.contact_table.key,     &w.contact_table.flags,    &w.joint_table.frame_a,       &w.joint_table.frame_b,
              &w.joint_table.key,       &w.joint_table.rotation,   &w.joint_table.target,        &w.joint_table.stiffness,
              &w.joint_table.damping,   &w.joint_table.rate,       &w.joint_table.max_force,     &w.results.joint_linear,
              &w.results.joint_angular, &w.row_table.rhs,          &w.row_table.compliance,      &w.row_table.friction,
              &w.row_table.key,         &w.results.joint_impulse})
            view->data = nullptr;
        cairn_contacts& c = w.contact_table;
        for (cairn_view* view : {&c.friction_scale, &c.surface_velocity, &c.rolling_friction, &c.spinning_friction, &c.stiffness,
                                 &c.damping, &w.results.torsion_impulse})
            view->data = nullptr;
    });
    accepted("an empty table needs no views", [](W& w) {
        w.row_table = cairn_rows{};
        w.row_table.struct_size = sizeof w.row_table;
    });
    accepted("absent tables", [](W& w) {
        w.step.contacts = nullptr;
        w.step.joints = nullptr;
        w.step.rows = nullptr;
    });
}

TEST_F(RefusedViews, Overlap) {
    wrong({"results.position overlaps bodies.position", "in place"},
          [](W& w) { w.results.position.data = reinterpret_cast<char*>(&w.bodies[0].position) + 8; });
    wrong({"results.position overlaps bodies.force"}, [](W& w) { w.results.position = w.body_table.force; });
    wrong({"results.linear_velocity overlaps bodies.angular_velocity"},
          [](W& w) { w.results.linear_velocity = w.body_table.angular_velocity; });
    wrong({"results.contact_impulse overlaps contacts.separation"}, [](W& w) { w.results.contact_impulse = w.contact_table.separation; });
    wrong({"results.row_impulse overlaps rows.friction"}, [](W& w) { w.results.row_impulse = w.row_table.friction; });
    wrong({"results.linear_velocity overlaps results.position"}, [](W& w) {
        static double memory[12];
        w.results.position = w.results.linear_velocity = W::view(memory, 0);
    });
    wrong({"results.position overlaps bodies.position"}, [](W& w) { // the same memory backwards is not the same view
        w.results.position.data = w.bodies[3].position;
        w.results.position.stride = -w.results.position.stride;
    });
    accepted("two inputs share memory", [](W& w) { w.contact_table.friction = w.contact_table.restitution; });
    accepted("backwards in place", [](W& w) {
        w.body_table.position.data = w.bodies[3].position;
        w.body_table.position.stride = -w.body_table.position.stride;
        w.results.position = w.body_table.position;
    });
}

// Against the definition: no two elements share a byte, bar those of one identical view.
TEST_F(RefusedViews, OverlapOfRandomViewsIsDecidedExactly) {
    std::mt19937 random(1);
    const auto pick = [&](int low, int high) { return std::uniform_int_distribution<int>(low, high)(random); };
    static float memory[512];
    int refusals = 0, passes = 0;
    for (int trial = 0; trial < 4000; ++trial) {
        const std::uint32_t bodies = static_cast<std::uint32_t>(pick(1, 4)), contacts = static_cast<std::uint32_t>(pick(1, 5));
        struct Placed {
            int begin, stride, length, count;
            cairn_view view() const { return {memory + begin, stride * 4, CAIRN_F32, CAIRN_HOST}; }
            bool meets(const Placed& other) const {
                for (int i = 0; i < count; ++i)
                    for (int j = 0; j < other.count; ++j) {
                        const int a = begin + i * stride, b = other.begin + j * other.stride;
                        if (a < b + other.length && b < a + length)
                            return true;
                    }
                return false;
            }
        };
        const auto place = [&](int length, std::uint32_t count) {
            const int stride = (length + pick(0, 3)) * (pick(0, 1) == 0 ? 1 : -1);
            return Placed{256 + pick(-25, 25), stride, length, static_cast<int>(count)};
        };
        // Two results, and one input that neither may touch.
        const Placed velocity = place(3, bodies), impulse = place(1, contacts), friction = place(1, contacts);
        std::fill_n(memory, 512, 0.0f);

        W world;
        world.body_table.count = bodies;
        world.step.joints = nullptr;
        world.step.rows = nullptr;
        world.contact_table.count = contacts;
        for (W::Contact& contact : world.contacts) {
            contact.body_a = CAIRN_WORLD;
            contact.body_b = 0;
        }
        world.contact_table.friction = friction.view();
        const cairn_view none = {};
        world.results.joint_impulse = world.results.row_impulse = none;
        world.results.linear_velocity = velocity.view();
        world.results.contact_impulse = impulse.view();
        const bool expected = velocity.meets(impulse) || velocity.meets(friction) || impulse.meets(friction);
        const cairn_status status = cairn_solver_step(solver, &world.step, &world.results);
        ASSERT_EQ(status, expected ? CAIRN_ERROR_INVALID_ARGUMENT : CAIRN_OK) << "trial " << trial << ": " << cairn_last_error();
        ++(expected ? refusals : passes);
    }
    EXPECT_GT(refusals, 500);
    EXPECT_GT(passes, 500);
}

TEST_F(RefusedViews, StructSize) {
    const auto size = [&](std::initializer_list<const char*> texts, auto break_it) { refused(CAIRN_ERROR_STRUCT_SIZE, texts, break_it); };
    size({"cairn_step", "struct_size is 0", "sizeof(cairn_step)"}, [](W& w) { w.step.struct_size = 0; });
    size({"cairn_step", "struct_size is 7"}, [](W& w) { w.step.struct_size = 7; });
    size({"cairn_bodies", "struct_size is 2"}, [](W& w) { w.body_table.struct_size = 2; });
    size({"cairn_bodies", "struct_size is 32"}, [](W& w) { w.body_table.struct_size = 32; }); // the middle of a view
    size({"cairn_contacts", "struct_size is 4294967295, which is impossible"}, [](W& w) { w.contact_table.struct_size = 0xffffffffu; });
    size({"cairn_joints", "struct_size is 1000000, which is impossible"}, [](W& w) { w.joint_table.struct_size = 1000000; });
    size({"cairn_rows", "struct_size is 17"}, [](W& w) { w.row_table.struct_size = 17; });
    size({"cairn_results", "struct_size is 12"}, [](W& w) { w.results.struct_size = 12; });
}

TEST_F(RefusedViews, ShorterStructGetsDefaults) {
    accepted("an older caller's tables", [](W& w) {
        w.body_table.struct_size = offsetof(cairn_bodies, force);
        w.body_table.force = {reinterpret_cast<void*>(1), 1, 99, 99}; // beyond what this caller says it has
        w.contact_table.struct_size = offsetof(cairn_contacts, friction);
        w.contact_table.flags.type = 99;
        w.results.struct_size = offsetof(cairn_results, contact_impulse);
        w.results.row_impulse.type = 99;
    });
    accepted("no tables but bodies", [](W& w) {
        w.step.struct_size = offsetof(cairn_step, contacts);
        w.step.contacts = reinterpret_cast<const cairn_contacts*>(1);
    });
}

TEST_F(RefusedViews, LongerStructMustBeZeroInItsTail) {
    struct Newer {
        cairn_bodies bodies;
        double unknown[2];
    };
    static Newer newer;
    accepted("a tail of zeros", [](W& w) {
        newer = {w.body_table, {0, 0}};
        newer.bodies.struct_size = sizeof newer;
        w.step.bodies = &newer.bodies;
    });
    refused(CAIRN_ERROR_STRUCT_SIZE, {"cairn_bodies", "is set"}, [](W& w) {
        newer = {w.body_table, {0, 1}};
        newer.bodies.struct_size = sizeof newer;
        w.step.bodies = &newer.bodies;
    });
}
