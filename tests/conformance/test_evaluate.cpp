// cairn_evaluate: what it wants, what it refuses, and numbers that can be worked out by hand. tests/python checks every formula.
#include "small_world.h"

#include <algorithm>
#include <cfenv>

namespace {

// A step of the small world: what went in, and what came out in arrays of its own.
struct Judged {
    SmallWorld before, after;
    cairn_evaluation whole = {}, islands[4] = {};
    std::int32_t body_island[4] = {-7, -7, -7, -7};
    std::size_t count = 77;

    Judged() {
        whole.struct_size = islands[0].struct_size = sizeof whole;
        for (SmallWorld::Joint& joint : before.joints)
            joint.max_force = 5;
    }
    cairn_status evaluate(std::size_t capacity = 4) {
        return cairn_evaluate(&before.step, &after.results, &whole, islands, capacity, &count, body_island);
    }
    std::string outputs() const {
        return std::string(reinterpret_cast<const char*>(&whole), sizeof whole) +
               std::string(reinterpret_cast<const char*>(islands), sizeof islands) +
               std::string(reinterpret_cast<const char*>(body_island), sizeof body_island);
    }
};

bool says(const char* text) { return std::string(cairn_last_error()).find(text) != std::string::npos; }

// Body 1 touches the ground with contacts 0 and 1; nothing else ties anything to anything.
void only_contacts_of_body_1(Judged& j) {
    j.before.contact_table.count = 2;
    j.before.joint_table.count = j.before.row_table.count = 0;
}

// Nothing moves: body 1 is held by its two contacts, 2 and 3 by forces.
void at_rest(Judged& j) {
    only_contacts_of_body_1(j);
    j.before.bodies[2].force[1] = j.before.bodies[3].force[1] = 10;
    j.after.contacts[0].impulse = j.after.contacts[1].impulse = 0.05; // half of m g h
}

TEST(Evaluate, AStepIsJudgedIslandByIsland) {
    cairn_solver* solver = nullptr;
    ASSERT_EQ(cairn_solver_create(nullptr, &solver), CAIRN_OK);
    Judged j;
    j.before.contact_table.count = 2; // body 1 on the ground, 2 and 3 apart from it but joined
    j.before.joints[1].body_a = CAIRN_WORLD;
    ASSERT_EQ(cairn_solver_step(solver, &j.before.step, &j.after.results), CAIRN_OK) << cairn_last_error();
    cairn_statistics statistics = {};
    statistics.struct_size = sizeof statistics;
    ASSERT_EQ(cairn_solver_get_statistics(solver, &statistics), CAIRN_OK);
    cairn_solver_destroy(solver);

    const std::string in = j.before.bytes(), out = j.after.bytes();
    ASSERT_EQ(j.evaluate(), CAIRN_OK) << cairn_last_error();
    EXPECT_TRUE(j.before.bytes() == in && j.after.bytes() == out) << "it is to read alone";
    EXPECT_EQ(j.count, statistics.islands);
    EXPECT_EQ(j.count, 2u);
    EXPECT_EQ(j.body_island[0], -1);
    EXPECT_EQ(j.body_island[1], 0);
    EXPECT_EQ(j.body_island[2], 1);
    EXPECT_EQ(j.body_island[3], 1);
    EXPECT_EQ(j.whole.bodies, statistics.bodies);
    EXPECT_EQ(j.whole.contacts, 2u);
    EXPECT_EQ(j.islands[0].contacts, 2u);
    EXPECT_EQ(j.islands[0].joints, 1u);
    EXPECT_EQ(j.islands[0].rows, 8u);
    EXPECT_EQ(j.islands[1].bodies, 2u);
    EXPECT_EQ(j.islands[1].joints, 2u);
    EXPECT_EQ(j.islands[1].struct_size, sizeof j.whole);
    EXPECT_EQ(j.whole.joints, 3u);
    EXPECT_NEAR(j.whole.kinetic_energy, j.islands[0].kinetic_energy + j.islands[1].kinetic_energy, 1e-12);
    EXPECT_DOUBLE_EQ(j.whole.momentum, std::max(j.islands[0].momentum, j.islands[1].momentum));
    EXPECT_EQ(j.islands[2].struct_size, 0u) << "beyond the last island";

    const std::string first = j.outputs();
    std::fesetround(FE_UPWARD);
    const cairn_status status = j.evaluate();
    EXPECT_EQ(std::fegetround(), FE_UPWARD);
    std::fesetround(FE_TONEAREST);
    EXPECT_EQ(status, CAIRN_OK);
    EXPECT_TRUE(j.outputs() == first) << "the caller's rounding changed the bits";
}

TEST(Evaluate, RestAndFreeFlightAreExact) {
    Judged j;
    at_rest(j);
    ASSERT_EQ(j.evaluate(), CAIRN_OK) << cairn_last_error();
    ASSERT_EQ(j.count, 3u);
    for (const cairn_evaluation* e : {&j.whole, &j.islands[0], &j.islands[1], &j.islands[2]}) {
        EXPECT_EQ(e->contact_residual, 0);
        EXPECT_EQ(e->relative_residual, 0);
        EXPECT_EQ(e->complementarity, 0);
        EXPECT_EQ(e->coulomb_excess, 0);
        EXPECT_EQ(e->penetration, 0);
        EXPECT_NEAR(e->momentum, 0, 1e-15);
        EXPECT_NEAR(e->angular_momentum, 0, 1e-15);
        EXPECT_NEAR(e->kinetic_energy, 0, 1e-15);
        EXPECT_EQ(e->residual_contact, -1);
        EXPECT_EQ(e->penetration_contact, -1);
        EXPECT_EQ(e->gap_joint, -1);
        EXPECT_EQ(e->residual_row, -1);
    }
    // Body 3 falls: explicit or implicit, the same velocity
    j.before.bodies[3].force[1] = 0;
    j.after.bodies[3].linear_velocity[1] = -0.1;
    j.after.bodies[3].position[1] -= 0.001;
    ASSERT_EQ(j.evaluate(), CAIRN_OK);
    EXPECT_NEAR(j.islands[2].momentum, 0, 1e-15);
    EXPECT_NEAR(j.islands[2].kinetic_energy, 0, 1e-15);
}

TEST(Evaluate, WhatIsWrongIsSeenWhereItIs) {
    Judged j;
    at_rest(j);
    j.after.contacts[1].impulse = 0.08; // 0.03 N s from nowhere, 0.5 m from the centre
    ASSERT_EQ(j.evaluate(), CAIRN_OK) << cairn_last_error();
    EXPECT_NEAR(j.islands[0].momentum, 0.03, 1e-15);
    EXPECT_NEAR(j.islands[0].angular_momentum, 0.015, 1e-15);
    EXPECT_EQ(j.islands[0].momentum_body, 1);
    EXPECT_EQ(j.islands[0].contact_residual, 0) << "touching bodies may push";
    EXPECT_NEAR(j.islands[1].momentum, 0, 1e-15);
    EXPECT_NEAR(j.whole.momentum, 0.03, 1e-15);

    at_rest(j); // body 1 sinks by 1 mm: 0.1 m/s into both of its contacts
    j.after.bodies[1].position[1] -= 0.001;
    ASSERT_EQ(j.evaluate(), CAIRN_OK);
    EXPECT_NEAR(j.islands[0].penetration, 0.001, 1e-15);
    EXPECT_NEAR(j.islands[0].penetration_mean, 0.001, 1e-15);
    EXPECT_EQ(j.islands[0].penetration_contact, 0);
    EXPECT_NEAR(j.islands[0].contact_residual, 0.1, 1e-12);
    EXPECT_EQ(j.islands[0].residual_contact, 0);
    EXPECT_NEAR(j.islands[0].complementarity, 0.005, 1e-13);
    EXPECT_EQ(j.islands[1].contact_residual, 0);
    EXPECT_EQ(j.whole.penetration_contact, 0);
    EXPECT_GT(j.whole.relative_residual, 0);
    EXPECT_LT(j.whole.relative_residual, 1);

    at_rest(j); // friction of 0.03 N s where 0.5 * 0.05 is to be had
    j.after.bodies[1].position[1] += 0.001;
    j.after.contacts[1].friction_impulse[2] = 0.03;
    ASSERT_EQ(j.evaluate(), CAIRN_OK);
    EXPECT_NEAR(j.islands[0].coulomb_excess, 0.005, 1e-15);
    EXPECT_NEAR(j.islands[0].momentum, 0.03, 1e-15);
    EXPECT_EQ(j.islands[0].residual_contact, 1);

    at_rest(j); // body 3 gains speed by itself
    j.after.contacts[1].friction_impulse[2] = 0;
    j.after.bodies[3].linear_velocity[0] = 2;
    ASSERT_EQ(j.evaluate(), CAIRN_OK);
    EXPECT_NEAR(j.islands[2].momentum, 2, 1e-15);
    EXPECT_NEAR(j.islands[2].momentum_total, 2, 1e-15);
    EXPECT_EQ(j.islands[2].momentum_body, 3);
    EXPECT_NEAR(j.islands[2].kinetic_energy, 2, 1e-15);
    EXPECT_NEAR(j.islands[0].momentum, 0, 1e-15);
}

TEST(Evaluate, EveryOutputIsOptionalAndNothingIsWrittenInVain) {
    Judged j;
    at_rest(j);
    EXPECT_EQ(cairn_evaluate(&j.before.step, &j.after.results, nullptr, nullptr, 0, nullptr, nullptr), CAIRN_OK) << cairn_last_error();
    EXPECT_EQ(cairn_evaluate(&j.before.step, &j.after.results, nullptr, nullptr, 0, &j.count, nullptr), CAIRN_OK);
    EXPECT_EQ(j.count, 3u);

    const std::string before = j.outputs();
    j.count = 0;
    EXPECT_EQ(j.evaluate(2), CAIRN_ERROR_BUFFER_TOO_SMALL);
    EXPECT_TRUE(says("capacity is 2, but there are 3 islands")) << cairn_last_error();
    EXPECT_EQ(j.count, 3u);
    EXPECT_TRUE(j.outputs() == before);

    // an older caller, whose structs are shorter and lie closer together
    struct Older {
        std::uint32_t struct_size, bodies, contacts, joints, rows;
    } older[3] = {{sizeof(Older), 9, 9, 9, 9}, {}, {}};
    EXPECT_EQ(cairn_evaluate(&j.before.step, &j.after.results, nullptr, reinterpret_cast<cairn_evaluation*>(older), 3, &j.count, nullptr),
              CAIRN_OK);
    for (const Older& island : older) {
        EXPECT_EQ(island.struct_size, sizeof(Older));
        EXPECT_EQ(island.bodies, 1u);
    }
    EXPECT_EQ(older[0].contacts, 2u);
    // a newer one
    struct Newer {
        cairn_evaluation known;
        double unknown;
    } newer[3] = {};
    newer[0].known.struct_size = sizeof(Newer);
    newer[2].unknown = 5;
    EXPECT_EQ(cairn_evaluate(&j.before.step, &j.after.results, nullptr, &newer[0].known, 3, &j.count, nullptr), CAIRN_OK);
    EXPECT_EQ(newer[2].known.bodies, 1u);
    EXPECT_EQ(newer[2].unknown, 0);
    newer[0].unknown = 5;
    EXPECT_EQ(cairn_evaluate(&j.before.step, &j.after.results, nullptr, &newer[0].known, 3, &j.count, nullptr), CAIRN_ERROR_STRUCT_SIZE);

    j.before.body_table.count = 0;
    j.before.contact_table.count = 0;
    EXPECT_EQ(j.evaluate(0), CAIRN_OK) << cairn_last_error();
    EXPECT_EQ(j.count, 0u);
    EXPECT_EQ(j.whole.bodies, 0u);
    EXPECT_EQ(j.whole.momentum_body, -1);
}

TEST(Evaluate, Refusals) {
    const auto refused = [](cairn_status status, const char* text, auto break_it) {
        Judged j;
        break_it(j);
        const std::string outputs = j.outputs(), in = j.before.bytes(), out = j.after.bytes();
        EXPECT_EQ(j.evaluate(), status) << text;
        EXPECT_TRUE(says(text)) << cairn_last_error();
        EXPECT_TRUE(j.outputs() == outputs && j.count == 77) << text;
        EXPECT_TRUE(j.before.bytes() == in && j.after.bytes() == out) << text;
    };
    constexpr cairn_status argument = CAIRN_ERROR_INVALID_ARGUMENT, data = CAIRN_ERROR_INVALID_DATA;
    // what a step refuses, in its words
    refused(argument, "step.dt is 0 s", [](Judged& j) { j.before.step.dt = 0; });
    refused(argument, "step.bodies is NULL", [](Judged& j) { j.before.step.bodies = nullptr; });
    refused(data, "bodies.position[2][0] is nan", [](Judged& j) { j.before.bodies[2].position[0] = kNan; });
    refused(data, "contacts.body_a[2] is 4", [](Judged& j) { j.before.contacts[2].body_a = 4; });
    refused(data, "joints.axes[1][3] is 32", [](Judged& j) { j.before.joints[1].axes[3] = 32; });
    refused(data, "rows.lower[3] is nan", [](Judged& j) { j.before.rows[3].lower = kNan; });
    refused(CAIRN_ERROR_STRUCT_SIZE, "cairn_step: struct_size is 3", [](Judged& j) { j.before.step.struct_size = 3; });
    // of the results
    refused(argument, "results.position is in place of bodies.position",
            [](Judged& j) { j.after.results.position = j.before.body_table.position; });
    refused(argument, "results.angular_velocity is in place of bodies.angular_velocity",
            [](Judged& j) { j.after.results.angular_velocity = j.before.body_table.angular_velocity; });
    refused(argument, "results.orientation is absent", [](Judged& j) { j.after.results.orientation.data = nullptr; });
    refused(argument, "results.contact_impulse is absent (data is NULL), but it is required for 6 elements",
            [](Judged& j) { j.after.results.contact_impulse.data = nullptr; });
    refused(argument, "results.friction_impulse is absent", [](Judged& j) { j.after.results.friction_impulse.data = nullptr; });
    refused(argument, "results.torsion_impulse is absent", [](Judged& j) { j.after.results.torsion_impulse.data = nullptr; });
    refused(argument, "results.joint_linear is absent", [](Judged& j) { j.after.results.joint_linear.data = nullptr; });
    refused(argument, "results.row_impulse is absent", [](Judged& j) { j.after.results.row_impulse.data = nullptr; });
    refused(argument, "results.position: type is 2", [](Judged& j) { j.after.results.position.type = CAIRN_I32; });
    refused(argument, "results.reserved is 1", [](Judged& j) { j.after.results.reserved = 1; });
    refused(CAIRN_ERROR_UNSUPPORTED, "results.position: device is CAIRN_DEVICE, but cairn_evaluate reads host memory",
            [](Judged& j) { j.after.results.position.device = CAIRN_DEVICE; });
    refused(CAIRN_ERROR_UNSUPPORTED, "bodies.position: device is CAIRN_DEVICE, but cairn_evaluate reads host memory",
            [](Judged& j) { j.before.body_table.position.device = CAIRN_DEVICE; });
    refused(data, "results.position[2][1] is nan", [](Judged& j) { j.after.bodies[2].position[1] = kNan; });
    refused(data, "results.orientation[3] is (0, 0, 0, 2)", [](Judged& j) { j.after.bodies[3].orientation[3] = 2; });
    refused(data, "results.contact_impulse[5] is inf", [](Judged& j) { j.after.contacts[5].impulse = kInf; });
    refused(data, "results.joint_impulse[1][4] is nan", [](Judged& j) { j.after.joints[1].impulse[4] = kNan; });
    refused(data, "results.row_impulse[7] is nan", [](Judged& j) { j.after.rows[7].impulse = kNan; });
    // of the outputs
    refused(CAIRN_ERROR_STRUCT_SIZE, "cairn_evaluation: struct_size is 0", [](Judged& j) { j.whole.struct_size = 0; });
    refused(CAIRN_ERROR_STRUCT_SIZE, "cairn_evaluation: struct_size is 60", [](Judged& j) { j.islands[0].struct_size = 60; });
    refused(CAIRN_ERROR_NOT_FINITE, "left the range of numbers", [](Judged& j) { j.after.bodies[1].linear_velocity[0] = 1e300; });

    Judged j;
    EXPECT_EQ(cairn_evaluate(nullptr, &j.after.results, nullptr, nullptr, 0, nullptr, nullptr), argument);
    EXPECT_TRUE(says("cairn_step: the pointer is NULL")) << cairn_last_error();
    EXPECT_EQ(cairn_evaluate(&j.before.step, nullptr, nullptr, nullptr, 0, nullptr, nullptr), argument);
    EXPECT_TRUE(says("cairn_results: the pointer is NULL")) << cairn_last_error();

    // what a step does not write is not read
    j.after.bodies[0].position[0] = j.after.bodies[0].orientation[3] = j.after.bodies[0].linear_velocity[0] = kNan;
    EXPECT_EQ(j.evaluate(), CAIRN_OK) << cairn_last_error();
}

} // namespace
