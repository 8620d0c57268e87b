// Bad elements: each refusal names the array, the index and the value.
#include "small_world.h"

using W = SmallWorld;

class RefusedData : public SmallWorldTest {
  protected:
    template <class Break> void bad(std::initializer_list<const char*> texts, Break break_it) {
        refused(CAIRN_ERROR_INVALID_DATA, texts, break_it);
    }
};

TEST_F(RefusedData, TheWorldItselfIsAccepted) {
    accepted("unbroken", [](W&) {});
    accepted("no results", [](W& w) { w.results = cairn_results{}, w.results.struct_size = sizeof w.results; });
}

TEST_F(RefusedData, Bodies) {
    bad({"bodies.position[2][0] is nan"}, [](W& w) { w.bodies[2].position[0] = kNan; });
    bad({"bodies.position[0][2] is inf"}, [](W& w) { w.bodies[0].position[2] = kInf; });
    bad({"bodies.linear_velocity[3][1] is nan"}, [](W& w) { w.bodies[3].linear_velocity[1] = -kNan; });
    bad({"bodies.angular_velocity[1][2] is -inf"}, [](W& w) { w.bodies[1].angular_velocity[2] = -kInf; });
    bad({"bodies.orientation[2] is (0, 0, 0, 1.002)", "norm 1.002"}, [](W& w) { w.bodies[2].orientation[3] = 1.002; });
    bad({"bodies.orientation[2] is (0, 0, 0, 0)"}, [](W& w) { w.bodies[2].orientation[3] = 0; });
    bad({"bodies.orientation[3] is (1e+200, 0, 0, 1)"}, [](W& w) { w.bodies[3].orientation[0] = 1e200; });
    bad({"bodies.orientation[1][2] is nan"}, [](W& w) { w.bodies[1].orientation[2] = kNan; });
    bad({"bodies.inverse_mass[3] is -1", ">= 0"}, [](W& w) { w.bodies[3].inverse_mass = -1; });
    bad({"bodies.inverse_mass[3] is inf"}, [](W& w) { w.bodies[3].inverse_mass = kInf; });
    bad({"bodies.inverse_inertia[2][1] is -0.25"}, [](W& w) { w.bodies[2].inverse_inertia[1] = -0.25; });
    bad({"bodies.inverse_inertia[2][2] is nan"}, [](W& w) { w.bodies[2].inverse_inertia[2] = kNan; });
    bad({"bodies.force[1][0] is inf"}, [](W& w) { w.bodies[1].force[0] = kInf; });
    bad({"bodies.torque[1][1] is nan"}, [](W& w) { w.bodies[1].torque[1] = kNan; });
    bad({"bodies.linear_factor[1][1] is nan"}, [](W& w) { w.bodies[1].linear_factor[1] = kNan; });
    bad({"bodies.angular_factor[1][1] is nan"}, [](W& w) { w.bodies[1].angular_factor[1] = kNan; });
    bad({"bodies.flags[1] is 4"}, [](W& w) { w.bodies[1].flags = 4; });
    bad({"bodies.flags[1] is 3", "CAIRN_BODY_AT_END_POSE", "inverse_mass[1]"}, [](W& w) { w.bodies[1].flags = 3; });
    accepted("a nearly unit quaternion", [](W& w) { w.bodies[2].orientation[3] = 1.0009; });
    accepted("a kinematic body at its end pose", [](W& w) { w.bodies[0].flags = CAIRN_BODY_AT_END_POSE; });
    accepted("a mass without inertia", [](W& w) { w.bodies[3].inverse_inertia[0] = 0; });
    accepted("a body pinned by its centre", [](W& w) { w.bodies[3].inverse_mass = 0; });
}

TEST_F(RefusedData, Contacts) {
    bad({"contacts.body_a[2] is 4", "number of bodies, 4"}, [](W& w) { w.contacts[2].body_a = 4; });
    bad({"contacts.body_a[4] is -2"}, [](W& w) { w.contacts[4].body_a = -2; });
    bad({"contacts.body_b[1] is 4"}, [](W& w) { w.contacts[1].body_b = 4; });
    bad({"contacts.body_b[5] is -2"}, [](W& w) { w.contacts[5].body_b = -2; });
    bad({"contacts.body_a[3] and contacts.body_b[3] are both 2"}, [](W& w) { w.contacts[3].body_a = 2; });
    bad({"contacts.body_a[0] and contacts.body_b[0] are both -1"}, [](W& w) { w.contacts[0].body_a = w.contacts[0].body_b = CAIRN_WORLD; });
    bad({"contacts.normal[1] is (0, 0.9, 0), of norm 0.9"}, [](W& w) { w.contacts[1].normal[1] = 0.9; });
    bad({"contacts.normal[1][0] is nan"}, [](W& w) { w.contacts[1].normal[0] = kNan; });
    bad({"contacts.arm_a[4][1] is inf"}, [](W& w) { w.contacts[4].arm_a[1] = kInf; });
    bad({"contacts.arm_b[4][2] is nan"}, [](W& w) { w.contacts[4].arm_b[2] = kNan; });
    bad({"contacts.separation[0] is nan"}, [](W& w) { w.contacts[0].separation = kNan; });
    bad({"contacts.friction[5] is -0.5"}, [](W& w) { w.contacts[5].friction = -0.5; });
    bad({"contacts.friction[5] is inf"}, [](W& w) { w.contacts[5].friction = kInf; });
    bad({"contacts.restitution[2] is 1.5", "0 ... 1"}, [](W& w) { w.contacts[2].restitution = 1.5; });
    bad({"contacts.restitution[2] is -0.5"}, [](W& w) { w.contacts[2].restitution = -0.5; });
    bad({"contacts.tangent[2][2] is -inf"}, [](W& w) { w.contacts[2].tangent[2] = -kInf; });
    bad({"contacts.flags[2] is 4294967295"}, [](W& w) { w.contacts[2].flags = 0xffffffffu; });
    bad({"contacts.friction_scale[3][1] is -1", ">= 0"}, [](W& w) { w.contacts[3].friction_scale[1] = -1; });
    bad({"contacts.friction_scale[3][0] is nan"}, [](W& w) { w.contacts[3].friction_scale[0] = kNan; });
    bad({"contacts.surface_velocity[1][2] is inf"}, [](W& w) { w.contacts[1].surface_velocity[2] = kInf; });
    bad({"contacts.rolling_friction[4] is -0.125"}, [](W& w) { w.contacts[4].rolling_friction = -0.125; });
    bad({"contacts.rolling_friction[4] is inf"}, [](W& w) { w.contacts[4].rolling_friction = kInf; });
    bad({"contacts.spinning_friction[0] is nan"}, [](W& w) { w.contacts[0].spinning_friction = kNan; });
    bad({"contacts.stiffness[5] is -3"}, [](W& w) { w.contacts[5].stiffness = -3; });
    bad({"contacts.damping[5] is nan"}, [](W& w) { w.contacts[5].damping = kNan; });
    bad({"contacts.key[4] is 99", "contacts.key[1]"}, [](W& w) { w.contacts[4].key = 99; });
    accepted("keys of 0 may repeat", [](W& w) { w.contacts[1].key = w.contacts[4].key = 0; });
    accepted("the world as a body", [](W& w) { w.contacts[0].body_a = CAIRN_WORLD; });
}

TEST_F(RefusedData, Joints) {
    bad({"joints.body_b[1] is 17"}, [](W& w) { w.joints[1].body_b = 17; });
    bad({"joints.body_a[1] and joints.body_b[1] are both 1"}, [](W& w) { w.joints[1].body_b = 1; });
    bad({"joints.anchor_a[2][0] is nan"}, [](W& w) { w.joints[2].anchor_a[0] = kNan; });
    bad({"joints.anchor_b[2][1] is inf"}, [](W& w) { w.joints[2].anchor_b[1] = kInf; });
    bad({"joints.frame_a[0] is (0, 0, 0, 2)", "norm 2"}, [](W& w) { w.joints[0].frame_a[3] = 2; });
    bad({"joints.frame_b[0][1] is nan"}, [](W& w) { w.joints[0].frame_b[1] = kNan; });
    bad({"joints.axes[1][3] is 32"}, [](W& w) { w.joints[1].axes[3] = 32; });
    bad({"joints.axes[1][3] is 9", "locked"}, [](W& w) { w.joints[1].axes[3] = CAIRN_AXIS_LOCKED | CAIRN_AXIS_SPRING; });
    bad({"joints.axes[1][3] is 16", "DRIVEN"}, [](W& w) { w.joints[1].axes[3] = CAIRN_AXIS_SERVO; });
    bad({"joints.axes[2][5] is 12", "a motor or a spring"}, [](W& w) { w.joints[2].axes[5] |= CAIRN_AXIS_SPRING; });
    bad({"joints.axes[1][3] is 3", "locked"}, [](W& w) { w.joints[1].axes[3] = CAIRN_AXIS_LOCKED | CAIRN_AXIS_LIMITED; });
    bad({"joints.axes[1][3] is 5", "locked"}, [](W& w) { w.joints[1].axes[3] = CAIRN_AXIS_LOCKED | CAIRN_AXIS_DRIVEN; });
    bad({"joints.lower[1][1] is 1.5", "joints.upper[1][1]", "is 1"}, [](W& w) { w.joints[1].lower[1] = 1.5; });
    bad({"joints.lower[1][1] is nan"}, [](W& w) { w.joints[1].lower[1] = kNan; });
    bad({"joints.upper[1][1] is -inf"}, [](W& w) { w.joints[1].upper[1] = -kInf; });
    bad({"joints.lower[1][1] is inf"}, [](W& w) { w.joints[1].lower[1] = kInf; });
    bad({"joints.motor_speed[2][5] is nan"}, [](W& w) { w.joints[2].motor_speed[5] = kNan; });
    bad({"joints.motor_force[2][5] is -1"}, [](W& w) { w.joints[2].motor_force[5] = -1; });
    bad({"joints.motor_force[2][5] is nan"}, [](W& w) { w.joints[2].motor_force[5] = kNan; });
    bad({"joints.axes[1][1] is limited, but joints.lower is absent"}, [](W& w) { w.joint_table.lower.data = nullptr; });
    bad({"joints.axes[1][1] is limited, but joints.upper is absent"}, [](W& w) { w.joint_table.upper.data = nullptr; });
    bad({"joints.axes[2][5] is driven, but joints.motor_force is absent"}, [](W& w) { w.joint_table.motor_force.data = nullptr; });
    const auto spring = [](W& w) {
        w.joints[0].axes[4] = CAIRN_AXIS_SPRING;
        w.joints[0].target[4] = w.joints[0].damping[4] = 0;
        w.joints[0].stiffness[4] = 1;
    };
    const auto servo = [](W& w) {
        w.joints[2].axes[5] |= CAIRN_AXIS_SERVO;
        w.joints[2].target[5] = 0.1;
        w.joints[2].stiffness[5] = w.joints[2].rate[5] = w.joints[2].motor_speed[5] = kInf;
    };
    const auto cone = [](W& w) {
        w.joints[1].rotation = CAIRN_ROTATION_CONE;
        w.joints[1].axes[4] = w.joints[1].axes[5] = CAIRN_AXIS_LIMITED;
        w.joints[1].upper[4] = 0.5;
        w.joints[1].upper[5] = kInf;
    };
    accepted("a spring", spring);
    accepted("a servo", servo);
    accepted("a cone, whose lower limits are not read", cone);
    accepted("a cone without lower limits", [cone](W& w) {
        cone(w);
        w.joints[1].axes[1] = CAIRN_AXIS_FREE;
        w.joint_table.lower.data = nullptr;
    });
    bad({"joints.stiffness[0][4] is inf"}, [spring](W& w) { spring(w), w.joints[0].stiffness[4] = kInf; });
    bad({"joints.stiffness[0][4] is -1"}, [spring](W& w) { spring(w), w.joints[0].stiffness[4] = -1; });
    bad({"joints.damping[0][4] is nan"}, [spring](W& w) { spring(w), w.joints[0].damping[4] = kNan; });
    bad({"joints.target[0][4] is inf"}, [spring](W& w) { spring(w), w.joints[0].target[4] = kInf; });
    bad({"joints.axes[0][4] is a spring's, but joints.stiffness is absent"},
        [spring](W& w) { spring(w), w.joint_table.stiffness.data = nullptr; });
    bad({"joints.stiffness[2][5] is nan"}, [servo](W& w) { servo(w), w.joints[2].stiffness[5] = kNan; });
    bad({"joints.rate[2][5] is -1"}, [servo](W& w) { servo(w), w.joints[2].rate[5] = -1; });
    bad({"joints.target[2][5] is nan"}, [servo](W& w) { servo(w), w.joints[2].target[5] = kNan; });
    bad({"joints.motor_speed[2][5] is -1"}, [servo](W& w) { servo(w), w.joints[2].motor_speed[5] = -1; });
    bad({"joints.rotation[1] is 3"}, [](W& w) { w.joints[1].rotation = 3; });
    bad({"joints.axes[1][5] is 0", "CONE"}, [cone](W& w) { cone(w), w.joints[1].axes[5] = CAIRN_AXIS_FREE; });
    bad({"joints.axes[1][4] is 1", "CONE"}, [cone](W& w) { cone(w), w.joints[1].axes[4] = CAIRN_AXIS_LOCKED; });
    bad({"joints.upper[1][4] is 0", "half-angle"}, [cone](W& w) { cone(w), w.joints[1].upper[4] = 0; });
    bad({"joints.max_force[1] is nan"}, [](W& w) { w.joints[1].max_force = kNan; });
    bad({"joints.key[2] is 7", "joints.key[0]"}, [](W& w) { w.joints[2].key = 7; });
    accepted("a motor without bound", [](W& w) { w.joints[2].motor_force[5] = kInf; });
    accepted("no limits where nothing is limited", [](W& w) {
        w.joints[1].axes[1] = CAIRN_AXIS_FREE;
        w.joint_table.lower.data = w.joint_table.upper.data = nullptr;
    });
}

// An infinite limit is one out of reach, in every method: on one side, and on both.
TEST_F(RefusedData, InfiniteLimitsOfJoints) {
    for (std::uint32_t method = 0; method < CAIRN_METHOD_AUTO; ++method) {
        cairn_params params = {};
        params.struct_size = sizeof params;
        ASSERT_EQ(cairn_params_preset(method, CAIRN_PRESET_DEFAULT, &params), CAIRN_OK);
        ASSERT_EQ(cairn_solver_set_params(solver, &params), CAIRN_OK) << cairn_last_error();
        for (const bool both : {false, true}) {
            W infinite, distant;
            for (W* w : {&infinite, &distant}) {
                w->joints[1].lower[1] = w == &infinite ? -kInf : -1e9;
                w->joints[1].upper[1] = !both ? -0.01 : w == &infinite ? kInf : 1e9;
                ASSERT_EQ(cairn_solver_reset(solver), CAIRN_OK);
                ASSERT_EQ(step_world(solver, *w), CAIRN_OK) << cairn_last_error();
            }
            EXPECT_EQ(std::memcmp(infinite.bodies, distant.bodies, sizeof infinite.bodies), 0) << cairn_method_name(method) << both;
        }
    }
    cairn_params params = {};
    params.struct_size = sizeof params;
    ASSERT_EQ(cairn_params_preset(CAIRN_METHOD_TJSOFT, CAIRN_PRESET_DEFAULT, &params), CAIRN_OK);
    ASSERT_EQ(cairn_solver_set_params(solver, &params), CAIRN_OK); // as TearDown's other solver
}

TEST_F(RefusedData, Rows) {
    bad({"rows.body_a[7] is -3"}, [](W& w) { w.rows[7].body_a = -3; });
    bad({"rows.body_a[7] and rows.body_b[7] are both 1"}, [](W& w) { w.rows[7].body_a = 1; });
    bad({"rows.jacobian_a[4][5] is nan"}, [](W& w) { w.rows[4].jacobian_a[5] = kNan; });
    bad({"rows.jacobian_b[4][0] is inf"}, [](W& w) { w.rows[4].jacobian_b[0] = kInf; });
    bad({"rows.rhs[4] is nan"}, [](W& w) { w.rows[4].rhs = kNan; });
    bad({"rows.lower[3] is 2", "rows.upper[3]", "is 1"}, [](W& w) {
        w.rows[3].lower = 2;
        w.rows[3].upper = 1;
    });
    bad({"rows.lower[3] is nan"}, [](W& w) { w.rows[3].lower = kNan; });
    bad({"rows.lower[3] is inf"}, [](W& w) { w.rows[3].lower = kInf; });
    bad({"rows.upper[3] is nan"}, [](W& w) { w.rows[3].upper = kNan; });
    bad({"rows.upper[3] is -inf"}, [](W& w) { w.rows[3].upper = -kInf; });
    bad({"rows.compliance[3] is -1"}, [](W& w) { w.rows[3].compliance = -1; });
    bad({"rows.friction[1] is -0.5"}, [](W& w) { w.rows[1].friction = -0.5; });
    bad({"rows.key[6] is 20", "rows.key[0]"}, [](W& w) { w.rows[6].key = 20; });
    accepted("bounds left out", [](W& w) {
        w.row_table.friction_index.data = nullptr;
        w.row_table.lower.data = w.row_table.upper.data = nullptr;
    });
}

TEST_F(RefusedData, RowsFrictionIndex) {
    bad({"rows.friction_index[1] is 1", "earlier row"}, [](W& w) { w.rows[1].friction_index = 1; });
    bad({"rows.friction_index[1] is 3", "earlier row"}, [](W& w) { w.rows[1].friction_index = 3; });
    bad({"rows.friction_index[1] is -2"}, [](W& w) { w.rows[1].friction_index = -2; });
    bad({"rows.friction_index[5] is 0", "begins at row 4"}, [](W& w) { w.rows[5].friction_index = 0; });
    bad({"rows.friction_index[2] is 1", "friction row itself"}, [](W& w) { w.rows[2].friction_index = 1; });
    bad({"rows.friction_index[1] is 0", "rows.lower[0] is -1"}, [](W& w) { w.rows[0].lower = -1; });
    bad({"rows.friction_index[3] is 0", "at most two"}, [](W& w) { w.rows[3].friction_index = 0; });
    bad({"rows.friction_index[3] is 0", "row 2 lies between"}, [](W& w) {
        w.rows[2].friction_index = -1;
        w.rows[3].friction_index = 0;
    });
    static std::uint32_t unsigned_index[8] = {0xffffffffu, 0, 0, 0xffffffffu, 0xffffffffu, 4, 4, 9};
    bad({"rows.friction_index[7] is 9"}, [](W& w) { w.row_table.friction_index = W::view(unsigned_index, 0); });
    unsigned_index[7] = 0xffffffffu;
    accepted("0xffffffff is -1", [](W& w) { w.row_table.friction_index = W::view(unsigned_index, 0); });
    bad({"rows.friction_index[2] is 0", "same two bodies"}, [](W& w) { // row 1, of other bodies, ends the block
        w.rows[1].body_b = 2;
        w.rows[1].friction_index = -1;
    });
}

TEST_F(RefusedData, RowsBlockOfSeven) {
    bad({"rows.block[6] is 0", "seventh", "from row 0 on", "another block"}, [](W& w) {
        for (W::Row& row : w.rows) {
            row.block = 0;
            row.friction_index = -1;
        }
    });
    bad({"rows.block[6] is 0 (absent)"}, [](W& w) {
        w.row_table.block.data = nullptr;
        w.row_table.friction_index.data = nullptr;
    });
    accepted("six and two", [](W& w) {
        for (int i = 0; i < 8; ++i) {
            w.rows[i].block = i / 6;
            w.rows[i].friction_index = -1;
        }
    });
}

TEST_F(RefusedData, StepsOwnFields) {
    const auto wrong = [&](std::initializer_list<const char*> texts, auto break_it) {
        refused(CAIRN_ERROR_INVALID_ARGUMENT, texts, break_it);
    };
    wrong({"step.dt is 0"}, [](W& w) { w.step.dt = 0; });
    wrong({"step.dt is -0.01"}, [](W& w) { w.step.dt = -0.01; });
    wrong({"step.dt is nan"}, [](W& w) { w.step.dt = kNan; });
    wrong({"step.dt is inf"}, [](W& w) { w.step.dt = kInf; });
    wrong({"step.gravity[2] is nan"}, [](W& w) { w.step.gravity[2] = kNan; });
    wrong({"step.reserved is 1"}, [](W& w) { w.step.reserved = 1; });
    wrong({"step.bodies is NULL"}, [](W& w) { w.step.bodies = nullptr; });
    wrong({"results.reserved is 9"}, [](W& w) { w.results.reserved = 9; });
    EXPECT_EQ(cairn_solver_step(solver, nullptr, nullptr), CAIRN_ERROR_INVALID_ARGUMENT);
    EXPECT_NE(std::string(cairn_last_error()).find("cairn_step"), std::string::npos);
    EXPECT_EQ(cairn_solver_step(nullptr, nullptr, nullptr), CAIRN_ERROR_INVALID_ARGUMENT);
}

// Values of 32 bits are shown as 32 bits, and negative strides count elements from the first.
TEST_F(RefusedData, OtherTypesAndStrides) {
    static float velocities[4][3];
    velocities[1][2] = std::numeric_limits<float>::infinity();
    refused(CAIRN_ERROR_INVALID_DATA, {"bodies.linear_velocity[2][2] is inf"}, [](W& w) {
        w.body_table.linear_velocity = W::view(velocities[3], sizeof velocities[0]);
        w.body_table.linear_velocity.stride *= -1;
        w.results.linear_velocity.data = nullptr;
    });
    static float friction[6] = {0, 0, 0, -0.1f, 0, 0};
    refused(CAIRN_ERROR_INVALID_DATA, {"contacts.friction[3] is -0.1:"}, [](W& w) { w.contact_table.friction = W::view(friction, 0); });
    static std::uint32_t index[6] = {0xffffffffu, 0, 1, 3000000000u, 2, 2};
    refused(CAIRN_ERROR_INVALID_DATA, {"contacts.body_a[3] is 3000000000"}, [](W& w) { w.contact_table.body_a = W::view(index, 0); });
    index[3] = 1;
    accepted("0xffffffff is the world", [](W& w) { w.contact_table.body_a = W::view(index, 0); });
}

// Keys in every order, in a table long enough to be gone through in parts.
TEST_F(RefusedData, KeysOfALongTable) {
    constexpr std::uint32_t count = 1000;
    struct Long {
        std::vector<std::int32_t> a = std::vector<std::int32_t>(count, CAIRN_WORLD), b = std::vector<std::int32_t>(count, 1);
        std::vector<double> normal = std::vector<double>(3 * count, 0), zero = std::vector<double>(3 * count, 0);
        std::vector<std::uint64_t> key = std::vector<std::uint64_t>(count);
        void put_into(W& w) {
            for (std::uint32_t i = 0; i < count; ++i)
                normal[3 * i] = 1;
            const cairn_view none = {};
            cairn_contacts& contacts = w.contact_table = {};
            contacts.struct_size = sizeof contacts;
            contacts.count = count;
            contacts.body_a = W::view(a.data(), 0);
            contacts.body_b = W::view(b.data(), 0);
            contacts.normal = W::view(normal.data(), 0);
            contacts.arm_a = contacts.arm_b = contacts.separation = W::view(zero.data(), 0);
            contacts.key = W::view(key.data(), 0);
            w.results.contact_impulse = w.results.friction_impulse = w.results.torsion_impulse = none;
        }
    } table;
    const auto put = [&](W& w) { table.put_into(w); };
    for (std::uint32_t i = 0; i < count; ++i)
        table.key[i] = i + 1;
    accepted("ascending", put);
    table.key[900] = 5;
    bad({"contacts.key[900] is 5,", "contacts.key[4]"}, put);
    table.key[900] = 900;
    bad({"contacts.key[900] is 900,", "contacts.key[899]"}, put);
    table.key[900] = 0;
    table.key[901] = 0;
    accepted("ascending but for zeros", put);
    for (std::uint32_t i = 0; i < count; ++i)
        table.key[i] = (std::uint64_t{i} * 7919 % count) << 40 | 1;
    accepted("in no order", put);
    table.key[999] = table.key[257];
    bad({"contacts.key[999] is ", "contacts.key[257]"}, put);
    table.key[999] = table.key[998];
    bad({"contacts.key[999] is ", "contacts.key[998]"}, put);
    table.key[999] = 0;
    table.zero[600] = kNan; // arms 200, separation 600
    bad({"contacts.arm_a[200][0] is nan"}, put);
    table.zero[600] = 0;
    bad({"contacts.body_a[998] is 9"}, [&](W& w) {
        table.put_into(w);
        table.a[998] = 9;
    });
}
