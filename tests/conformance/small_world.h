// A small world that every check accepts, as arrays of structs whose fields interleave. A test breaks one thing in it and
// expects a refusal that changes not one bit.
#pragma once
#include <cairn/cairn.h>

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <initializer_list>
#include <limits>
#include <string>
#include <type_traits>
#include <vector>

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInf = std::numeric_limits<double>::infinity();

struct SmallWorld {
    struct Body {
        double position[3], orientation[4], linear_velocity[3], angular_velocity[3], inverse_mass, inverse_inertia[3], force[3], torque[3],
            linear_factor[3], angular_factor[3];
        std::uint32_t flags, padding;
    };
    struct Contact {
        std::int32_t body_a, body_b;
        double normal[3], arm_a[3], arm_b[3], separation, friction, restitution, tangent[3];
        std::uint64_t key;
        double impulse, friction_impulse[3];
        std::uint32_t flags, padding;
        double friction_scale[2], surface_velocity[3], rolling_friction, spinning_friction, stiffness, damping, torsion_impulse[3];
    };
    struct Joint {
        std::int32_t body_a, body_b;
        double anchor_a[3], anchor_b[3], frame_a[4], frame_b[4], lower[6], upper[6], motor_speed[6], motor_force[6], target[6],
            stiffness[6], damping[6], rate[6], max_force, impulse[6], linear[3], angular[3];
        std::uint64_t key;
        std::uint32_t axes[6], rotation, padding;
    };
    struct Row {
        std::int32_t body_a, body_b, friction_index, block;
        double jacobian_a[6], jacobian_b[6], rhs, lower, upper, compliance, friction, impulse;
        std::uint64_t key;
    };

    // Body 0 is the ground; 1, 2 and 3 stand in a tower on it.
    Body bodies[4];
    Contact contacts[6];
    Joint joints[3];
    Row rows[8];

    cairn_bodies body_table;
    cairn_contacts contact_table;
    cairn_joints joint_table;
    cairn_rows row_table;
    cairn_step step;
    cairn_results results;

    SmallWorld();
    SmallWorld(const SmallWorld&) = delete; // the views point into it
    SmallWorld& operator=(const SmallWorld&) = delete;

    std::string bytes() const { return std::string(reinterpret_cast<const char*>(this), sizeof *this); }

    template <class T> static cairn_view view(T* first, std::size_t stride) {
        using Value = std::remove_all_extents_t<T>;
        std::uint32_t type = CAIRN_F64;
        if (std::is_same_v<Value, float>)
            type = CAIRN_F32;
        if (std::is_same_v<Value, std::int32_t>)
            type = CAIRN_I32;
        if (std::is_same_v<Value, std::uint32_t>)
            type = CAIRN_U32;
        if (std::is_same_v<Value, std::uint64_t>)
            type = CAIRN_U64;
        return {first, static_cast<std::int64_t>(stride), type, CAIRN_HOST};
    }
};

inline SmallWorld::SmallWorld() {
    std::memset(static_cast<void*>(this), 0, sizeof *this);
    for (std::uint32_t i = 0; i < 4; ++i) {
        Body& body = bodies[i];
        body.position[1] = i;
        body.orientation[3] = 1;
        if (i > 0)
            body.inverse_mass = 1;
        for (int c = 0; c < 3; ++c) {
            if (i > 0)
                body.inverse_inertia[c] = 6;
            body.linear_factor[c] = body.angular_factor[c] = 1;
        }
    }
    for (std::int32_t i = 0; i < 6; ++i) {
        Contact& contact = contacts[i];
        contact.body_a = i / 2;
        contact.body_b = i / 2 + 1;
        contact.normal[1] = 1;
        contact.arm_a[0] = contact.arm_b[0] = i % 2 == 0 ? -0.5 : 0.5;
        contact.arm_a[1] = 0.5;
        contact.arm_b[1] = -0.5;
        contact.friction = 0.5;
        contact.friction_scale[0] = contact.friction_scale[1] = 1;
        contact.key = static_cast<std::uint64_t>(100 - i);
    }
    for (std::int32_t i = 0; i < 3; ++i) {
        Joint& joint = joints[i];
        joint.body_a = i == 0 ? CAIRN_WORLD : i;
        joint.body_b = i + 1;
        joint.anchor_a[1] = 0.5;
        joint.anchor_b[1] = -0.5;
        joint.frame_a[3] = joint.frame_b[3] = 1;
        for (int c = 0; c < 6; ++c) {
            joint.axes[c] = CAIRN_AXIS_FREE;
            joint.lower[c] = joint.motor_speed[c] = joint.motor_force[c] = kNan; // not read but where an axis says so
            joint.upper[c] = joint.target[c] = joint.stiffness[c] = joint.damping[c] = joint.rate[c] = kNan;
        }
        joint.max_force = kInf;
        joint.key = static_cast<std::uint64_t>(7 - i);
    }
    joints[1].axes[1] = CAIRN_AXIS_LIMITED;
    joints[1].lower[1] = -1;
    joints[1].upper[1] = 1;
    joints[2].axes[5] = CAIRN_AXIS_DRIVEN;
    joints[2].motor_speed[5] = 0;
    joints[2].motor_force[5] = 1;
    for (std::int32_t i = 0; i < 8; ++i) { // two blocks of four: a normal, two friction rows, another normal
        Row& row = rows[i];
        row.body_a = 0;
        row.body_b = 1;
        row.block = i / 4;
        row.jacobian_b[i % 3] = 1;
        row.upper = kInf;
        row.rhs = -1;
        row.friction = 0.5;
        row.friction_index = i % 4 == 1 || i % 4 == 2 ? i / 4 * 4 : -1;
        row.key = static_cast<std::uint64_t>(20 - i);
    }

    constexpr std::size_t body = sizeof(Body), contact = sizeof(Contact), joint = sizeof(Joint), row = sizeof(Row);
    body_table = {sizeof body_table,
                  4,
                  0,
                  view(bodies[0].position, body),
                  view(bodies[0].orientation, body),
                  view(bodies[0].linear_velocity, body),
                  view(bodies[0].angular_velocity, body),
                  view(&bodies[0].inverse_mass, body),
                  view(bodies[0].inverse_inertia, body),
                  view(bodies[0].force, body),
                  view(bodies[0].torque, body),
                  view(bodies[0].linear_factor, body),
                  view(bodies[0].angular_factor, body),
                  view(&bodies[0].flags, body)};
    contact_table = {sizeof contact_table,
                     6,
                     0,
                     view(&contacts[0].body_a, contact),
                     view(&contacts[0].body_b, contact),
                     view(contacts[0].normal, contact),
                     view(contacts[0].arm_a, contact),
                     view(contacts[0].arm_b, contact),
                     view(&contacts[0].separation, contact),
                     view(&contacts[0].friction, contact),
                     view(&contacts[0].restitution, contact),
                     view(contacts[0].tangent, contact),
                     view(&contacts[0].key, contact),
                     view(&contacts[0].flags, contact),
                     view(contacts[0].friction_scale, contact),
                     view(contacts[0].surface_velocity, contact),
                     view(&contacts[0].rolling_friction, contact),
                     view(&contacts[0].spinning_friction, contact),
                     view(&contacts[0].stiffness, contact),
                     view(&contacts[0].damping, contact)};
    joint_table = {sizeof joint_table,
                   3,
                   0,
                   view(&joints[0].body_a, joint),
                   view(&joints[0].body_b, joint),
                   view(joints[0].anchor_a, joint),
                   view(joints[0].anchor_b, joint),
                   view(joints[0].frame_a, joint),
                   view(joints[0].frame_b, joint),
                   view(joints[0].axes, joint),
                   view(joints[0].lower, joint),
                   view(joints[0].upper, joint),
                   view(joints[0].motor_speed, joint),
                   view(joints[0].motor_force, joint),
                   view(&joints[0].key, joint),
                   view(&joints[0].rotation, joint),
                   view(joints[0].target, joint),
                   view(joints[0].stiffness, joint),
                   view(joints[0].damping, joint),
                   view(joints[0].rate, joint),
                   view(&joints[0].max_force, joint)};
    row_table = {sizeof row_table,
                 8,
                 0,
                 view(&rows[0].body_a, row),
                 view(&rows[0].body_b, row),
                 view(rows[0].jacobian_a, row),
                 view(rows[0].jacobian_b, row),
                 view(&rows[0].rhs, row),
                 view(&rows[0].lower, row),
                 view(&rows[0].upper, row),
                 view(&rows[0].compliance, row),
                 view(&rows[0].friction_index, row),
                 view(&rows[0].friction, row),
                 view(&rows[0].block, row),
                 view(&rows[0].key, row)};
    step = {sizeof step, 0, 0.01, {0, -10, 0}, &body_table, &contact_table, &joint_table, &row_table};
    results = {sizeof results,
               0,
               body_table.position,
               body_table.orientation,
               body_table.linear_velocity,
               body_table.angular_velocity,
               view(&contacts[0].impulse, contact),
               view(contacts[0].friction_impulse, contact),
               view(joints[0].impulse, joint),
               view(&rows[0].impulse, row),
               view(contacts[0].torsion_impulse, contact),
               view(joints[0].linear, joint),
               view(joints[0].angular, joint)};
}

// A step of that world. One program's is step_on_host.cpp's; another's keeps the arrays in device memory (tests/gpu).
cairn_status step_world(cairn_solver* solver, SmallWorld& world);

// One solver for a whole test, so that what a refusal leaves behind would show.
class SmallWorldTest : public ::testing::Test {
  protected:
    void SetUp() override { ASSERT_EQ(cairn_solver_create(nullptr, &solver), CAIRN_OK) << cairn_last_error(); }
    void TearDown() override {
        // Whatever was refused before, the solver gives the bits of one that never saw it.
        SmallWorld used, fresh;
        cairn_solver* other = nullptr;
        ASSERT_EQ(cairn_solver_create(nullptr, &other), CAIRN_OK);
        ASSERT_EQ(cairn_solver_reset(solver), CAIRN_OK);
        EXPECT_EQ(step_world(solver, used), CAIRN_OK) << cairn_last_error();
        EXPECT_EQ(step_world(other, fresh), CAIRN_OK);
        EXPECT_EQ(std::memcmp(used.bodies, fresh.bodies, sizeof used.bodies), 0);
        cairn_solver_destroy(other);
        cairn_solver_destroy(solver);
    }

    // Breaks a fresh world and steps it: the status, every piece of text, and no bit changed.
    template <class Break> void refused(cairn_status status, std::initializer_list<const char*> texts, Break break_it) {
        SmallWorld world;
        break_it(world);
        const std::string before = world.bytes();
        SCOPED_TRACE(*texts.begin());
        EXPECT_EQ(step_world(solver, world), status);
        for (const char* text : texts)
            EXPECT_NE(std::string(cairn_last_error()).find(text), std::string::npos) << cairn_last_error();
        EXPECT_TRUE(world.bytes() == before) << "the caller's data changed";
    }
    template <class Change> void accepted(const char* what, Change change) {
        SmallWorld world;
        change(world);
        EXPECT_EQ(step_world(solver, world), CAIRN_OK) << what << ": " << cairn_last_error();
    }

    cairn_solver* solver = nullptr;
};
