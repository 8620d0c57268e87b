// What leaves the range of numbers is said, never handed on: not-a-number leaves the solver unreported under no circumstance.
#include "dense.h"
#include "methods.h"

namespace cairn_test {
namespace {

class Range : public EachMethod {};
CAIRN_EACH_METHOD(Range);

bool finite(const Scene& scene, const Impulses& out) {
    bool all = true;
    for (const Body& b : scene.bodies) {
        all = all && b.position.allFinite() && b.orientation.coeffs().allFinite() && b.linear.allFinite() && b.angular.allFinite();
    }
    for (const std::vector<double>* values : {&out.contact, &out.friction, &out.joint, &out.row}) {
        for (const double v : *values)
            all = all && std::isfinite(v);
    }
    return all;
}

TEST_P(Range, AnOverflowIsReportedAndNothingIsWritten) {
    Scene scene;
    scene.add(Body::sphere(1, 0.5, Vec3::Zero()));
    scene.add(Body::sphere(1, 0.5, {0, 0, 1}));
    scene.bodies[1].force = Vec3(3e38, 0, 0);
    scene.bodies[1].inverse_mass = 1e10;
    const Scene before = scene;
    const Solver solver;
    const cairn_params params = preset(GetParam());
    check(cairn_solver_set_params(solver.get(), &params));
    Impulses out;
    EXPECT_EQ(scene.try_step(solver, out), CAIRN_ERROR_NOT_FINITE);
    EXPECT_NE(std::string(cairn_last_error()), "");
    EXPECT_EQ(scene.hash(), before.hash());
    EXPECT_TRUE(finite(scene, out));
    // and the solver goes on as if that step had never been
    scene.bodies[1].force.setZero();
    scene.bodies[1].inverse_mass = 1;
    scene.bodies[1].linear = Vec3(0, 0, 1);
    EXPECT_EQ(scene.try_step(solver, out), CAIRN_OK);
    EXPECT_TRUE(finite(scene, out));
}

// A failed step leaves the warm-start cache alone too.
TEST_P(Range, AFailedStepLeavesTheCacheAlone) {
    Random random(3);
    Scene scene = random_bodies(random, 4);
    add_random_joints(random, scene, 0.005);
    add_random_contacts(random, scene, 6, 0.5);
    for (std::size_t i = 0; i < scene.joints.size(); ++i)
        scene.joints[i].key = 1000 + i;
    for (std::size_t i = 0; i < scene.contacts.size(); ++i)
        scene.contacts[i].key = 1 + i;
    const Solver solver;
    cairn_params params = preset(GetParam());
    params.contact_warm_start = 0.9;
    params.joint_warm_start = 0.5;
    check(cairn_solver_set_params(solver.get(), &params));
    scene.step(solver);
    const std::vector<char> cache = solver.save_cache();
    Scene bad = scene;
    bad.bodies[2].force = Vec3(0, 3e38, 0);
    bad.bodies[2].inverse_mass = 1e20;
    Impulses out;
    EXPECT_EQ(bad.try_step(solver, out), CAIRN_ERROR_NOT_FINITE);
    EXPECT_EQ(solver.save_cache(), cache);
}

// Numbers of every size: a step either succeeds with finite results or changes nothing and says so.
TEST_P(Range, WildNumbersAreEitherSolvedOrReported) {
    int solved = 0, reported = 0;
    for (std::uint64_t seed = 1; seed <= 200; ++seed) {
        Random random(seed);
        Scene scene = random_bodies(random, 4);
        add_random_joints(random, scene, 0.1);
        add_random_contacts(random, scene, 6, 0.5);
        const auto wild = [&] { return std::pow(10.0, uniform(random, -30, 30)); };
        for (Body& body : scene.bodies) {
            if (random() % 2 != 0)
                body.linear *= wild();
            if (random() % 2 != 0)
                body.angular *= wild();
            if (random() % 3 == 0)
                body.inverse_mass *= wild();
            if (random() % 3 == 0)
                body.inverse_inertia *= wild();
            if (random() % 4 == 0)
                body.torque *= wild();
            body.flags = random() % 2 != 0 ? CAIRN_BODY_NO_GYROSCOPIC : 0;
        }
        if (seed % 5 == 0)
            scene.dt = std::max(1e-9, wild());
        const Scene before = scene;
        const Solver solver;
        cairn_params params = preset(GetParam());
        params.iterations = 2 * params.substeps;
        check(cairn_solver_set_params(solver.get(), &params));
        Impulses out;
        const cairn_status status = scene.try_step(solver, out);
        if (status == CAIRN_OK) {
            ++solved;
            ASSERT_TRUE(finite(scene, out)) << "seed " << seed;
            for (const Body& b : scene.bodies)
                ASSERT_NEAR(b.orientation.norm(), 1, 1e-3) << "seed " << seed;
            const cairn_statistics s = solver.statistics();
            ASSERT_TRUE(std::isfinite(s.residual)) << "seed " << seed;
        } else {
            ++reported;
            ASSERT_EQ(status, CAIRN_ERROR_NOT_FINITE) << "seed " << seed << ": " << cairn_last_error();
            ASSERT_EQ(scene.hash(), before.hash()) << "seed " << seed;
        }
    }
    EXPECT_GT(solved, 10);
    EXPECT_GT(reported, 10);
}

TEST_P(Range, EmptyAndLonelyScenesStep) {
    const Solver solver;
    const cairn_params params = preset(GetParam());
    check(cairn_solver_set_params(solver.get(), &params));
    Scene empty;
    empty.step(solver);
    EXPECT_EQ(solver.statistics().bodies, 0u);
    Scene lonely;
    lonely.gravity = Vec3(0, 0, -10);
    lonely.add(Body::sphere(1, 1, Vec3::Zero()));
    for (int i = 0; i < 10; ++i)
        lonely.step(solver);
    EXPECT_NEAR(lonely.bodies[0].linear.z(), -10 * 10 * lonely.dt, 1e-5);
    EXPECT_EQ(solver.statistics().islands, 1u);
    // results may be left out altogether
    const cairn_bodies table = body_table(lonely.bodies);
    cairn_step step{};
    step.struct_size = sizeof step;
    step.dt = 0.01;
    step.bodies = &table;
    const std::uint64_t before = lonely.hash();
    EXPECT_EQ(cairn_solver_step(solver.get(), &step, nullptr), CAIRN_OK);
    EXPECT_EQ(lonely.hash(), before);
}

// The caller's arrays may be of floats and apart; results into views of either width.
TEST(FloatArrays, GiveTheSameAsDoubles) {
    Scene scene;
    scene.gravity = Vec3(0, 0, -9.75);
    Body ball = Body::sphere(1, 0.5, {0.25, 0, 1});
    ball.inverse_inertia = Vec3::Constant(8);
    ball.linear = Vec3(0.5, 0, -1);
    scene.add(ball);
    const Solver solver;
    std::vector<float> position = {0.25f, 0, 1}, orientation = {0, 0, 0, 1}, linear = {0.5f, 0, -1}, angular = {0, 0, 0}, mass = {1},
                       inertia = {8, 8, 8};
    cairn_bodies table{};
    table.struct_size = sizeof table;
    table.count = 1;
    table.position = view_of(position);
    table.orientation = view_of(orientation);
    table.linear_velocity = view_of(linear);
    table.angular_velocity = view_of(angular);
    table.inverse_mass = view_of(mass);
    table.inverse_inertia = view_of(inertia);
    cairn_step step{};
    step.struct_size = sizeof step;
    step.dt = scene.dt;
    step.gravity[2] = -9.75;
    step.bodies = &table;
    std::vector<double> moved(3);
    cairn_results results{};
    results.struct_size = sizeof results;
    results.position = view_of(moved);
    results.linear_velocity = table.linear_velocity;
    ASSERT_EQ(cairn_solver_step(solver.get(), &step, &results), CAIRN_OK) << cairn_last_error();
    scene.step(solver);
    for (int i = 0; i < 3; ++i) {
        EXPECT_NEAR(moved[static_cast<std::size_t>(i)], scene.bodies[0].position[i], 1e-12);
        EXPECT_EQ(linear[static_cast<std::size_t>(i)], static_cast<float>(scene.bodies[0].linear[i]));
    }
    EXPECT_EQ(position[2], 1) << "an input that is no result was written";
}

} // namespace
} // namespace cairn_test
