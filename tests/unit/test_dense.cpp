// With enough sweeps every method reaches the exact solution of its equations, whatever the splitting and the acceleration.
#include "dense.h"

#include <gtest/gtest.h>

namespace cairn_test {
namespace {

struct Variant {
    std::uint32_t method, splitting, acceleration, precision;
};
std::vector<Variant> variants() {
    std::vector<Variant> all;
    for (const std::uint32_t method : {CAIRN_METHOD_PJ, CAIRN_METHOD_PJNJ, CAIRN_METHOD_PJSOFT, CAIRN_METHOD_TJ, CAIRN_METHOD_TJSOFT}) {
        for (const std::uint32_t splitting : {CAIRN_SPLIT_POINT, CAIRN_SPLIT_MANIFOLD}) {
            for (const std::uint32_t acceleration : {CAIRN_ACCELERATION_NONE, CAIRN_ACCELERATION_NESTEROV}) {
                for (const std::uint32_t precision : {32u, 64u})
                    all.push_back({method, splitting, acceleration, precision});
            }
        }
    }
    return all;
}
std::string name_of(const testing::TestParamInfo<Variant>& info) {
    const Variant& v = info.param;
    return std::string(cairn_method_name(v.method)) + (v.splitting == CAIRN_SPLIT_POINT ? "_point" : "_manifold") +
           (v.acceleration == CAIRN_ACCELERATION_NONE ? "_plain" : "_nesterov") + (v.precision == 32 ? "_float" : "_double");
}
cairn_params params_of(const Variant& v) {
    cairn_params params = plain(v.method, 1);
    params.splitting = v.splitting;
    params.acceleration = v.acceleration;
    return params;
}
double tolerance_of(const Variant& v) { return v.precision == 64 ? 1e-9 : 1e-4; }
// Floats gain nothing from sweeps beyond their precision; rounding of the velocities would only add up.
double shrink_of(const Variant& v) { return v.precision == 64 ? 1e-12 : 1e-6; }
std::uint32_t most_of(const Variant& v) { return v.precision == 64 ? 20000 : 5000; }

// Its smallest eigenvalue is more than `least` of its largest: the impulse is unique.
bool regular(const Mat& m, double least) {
    const Eigen::SelfAdjointEigenSolver<Mat> eigen(m, Eigen::EigenvaluesOnly);
    return eigen.eigenvalues().minCoeff() > least * eigen.eigenvalues().maxCoeff();
}

class Converged : public testing::TestWithParam<Variant> {};
INSTANTIATE_TEST_SUITE_P(All, Converged, testing::ValuesIn(variants()), name_of);

// Bilateral: (A + Gamma) lambda = -(J v_free + bias). Velocities always; the impulse where A + Gamma is regular.
TEST_P(Converged, ReachTheDenseSolutionOfJoints) {
    const Solver solver(GetParam().precision);
    int solved = 0;
    for (std::uint64_t seed = 1; seed <= 40 && solved < 6; ++seed) {
        Random random(seed);
        Scene scene = random_bodies(random, 3 + static_cast<int>(seed % 4));
        add_random_joints(random, scene, 0.01);
        cairn_params params = params_of(GetParam());
        const BiasRule rule = BiasRule::of(params, scene.dt);
        Dense dense(scene, scene.dt);
        int block = 0;
        for (const Joint& joint : scene.joints)
            dense.add_joint(scene, joint, rule, block++);

        const Vec lambda = dense.solve_bilateral();
        if (dense.residual(lambda) > 1e-9)
            continue; // a loop that its other joints leave no solution
        const std::vector<std::uint32_t> counts = block_counts(scene, GetParam().splitting);
        const auto sweeps = dense.sweeps_needed(lambda, counts, shrink_of(GetParam()), most_of(GetParam()));
        if (!sweeps)
            continue;
        params.iterations = *sweeps;
        check(cairn_solver_set_params(solver.get(), &params));
        const Impulses out = scene.step(solver);
        EXPECT_LT((velocities(scene) - dense.velocity(lambda)).cwiseAbs().maxCoeff(), tolerance_of(GetParam())) << "seed " << seed;
        EXPECT_EQ(solver.split_counts(), counts);

        Mat m = dense.a();
        m.diagonal() += dense.gamma;
        if (GetParam().precision == 64 && regular(m, 1e-6)) {
            Eigen::Index row = 0;
            double worst = 0;
            for (std::size_t i = 0; i < scene.joints.size(); ++i) {
                for (std::size_t axis = 0; axis < 6; ++axis) {
                    const double expected = scene.joints[i].axes[axis] == CAIRN_AXIS_LOCKED ? lambda[row++] : 0;
                    // hinges may count their angular axes the other way round, so compare sizes there
                    const double got = out.joint[6 * i + axis];
                    worst = std::max(worst, axis < 3 ? std::abs(got - expected) : std::abs(std::abs(got) - std::abs(expected)));
                }
            }
            EXPECT_LT(worst, tolerance_of(GetParam()) * 10 * (1 + lambda.cwiseAbs().maxCoeff())) << "seed " << seed;
        }
        ++solved;
    }
    EXPECT_GE(solved, 5) << "too few scenes converge quickly enough to be compared";
}

// Frictionless contacts are a linear complementarity problem with one velocity as its answer.
TEST_P(Converged, ReachTheExactLcpOfContacts) {
    const Solver solver(GetParam().precision);
    int solved = 0, unique = 0;
    for (std::uint64_t seed = 101; seed <= 140 && solved < 6; ++seed) {
        Random random(seed);
        Scene scene = random_bodies(random, 3 + static_cast<int>(seed % 8));
        add_random_contacts(random, scene, 4 + static_cast<int>(seed % 7), 0);
        cairn_params params = params_of(GetParam());
        if (seed % 2 == 1) // soft ones as stiff as half as long a substep makes them
            params.contact_hertz_floor = 2 * params.contact_hertz * scene.dt;
        const BiasRule rule = BiasRule::of(params, scene.dt);
        Dense dense(scene, scene.dt);
        const std::vector<int> blocks = contact_blocks(scene, GetParam().splitting);
        for (std::size_t i = 0; i < scene.contacts.size(); ++i)
            dense.add_contact(scene, scene.contacts[i], rule, false, blocks[i]);
        const std::optional<Vec> lambda = dense.solve_lcp();
        ASSERT_TRUE(lambda) << "seed " << seed;
        const auto sweeps =
            dense.sweeps_needed(*lambda, block_counts(scene, GetParam().splitting), shrink_of(GetParam()), most_of(GetParam()));
        if (!sweeps)
            continue;
        params.iterations = 2 * *sweeps; // the rows that act have to be found first
        check(cairn_solver_set_params(solver.get(), &params));
        const Impulses out = scene.step(solver);
        EXPECT_LT((velocities(scene) - dense.velocity(*lambda)).cwiseAbs().maxCoeff(), tolerance_of(GetParam())) << "seed " << seed;
        Mat m = dense.a();
        m.diagonal() += dense.gamma;
        if (regular(m, 1e-4)) {
            ++unique;
            const Vec got = Eigen::Map<const Vec>(out.contact.data(), static_cast<Eigen::Index>(out.contact.size()));
            // an impulse loses as many digits as lie between A's eigenvalues
            EXPECT_LT((got - *lambda).cwiseAbs().maxCoeff(), tolerance_of(GetParam()) * 1e3) << "seed " << seed;
        }
        ++solved;
    }
    EXPECT_GE(solved, 5);
    EXPECT_GE(unique, 1) << "no scene with a unique impulse";
}

// Joints and contacts together: a mixed complementarity problem.
TEST_P(Converged, ReachTheMixedProblem) {
    const Solver solver(GetParam().precision);
    int solved = 0;
    for (std::uint64_t seed = 201; seed <= 240 && solved < 4; ++seed) {
        Random random(seed);
        Scene scene = random_bodies(random, 4);
        add_random_joints(random, scene, 0.005);
        scene.joints.pop_back();
        add_random_contacts(random, scene, 4, 0);
        cairn_params params = params_of(GetParam());
        const BiasRule rule = BiasRule::of(params, scene.dt);
        Dense dense(scene, scene.dt);
        const std::vector<int> blocks = contact_blocks(scene, GetParam().splitting);
        for (std::size_t i = 0; i < scene.contacts.size(); ++i)
            dense.add_contact(scene, scene.contacts[i], rule, false, blocks[i]);
        int block = 1000;
        for (const Joint& joint : scene.joints)
            dense.add_joint(scene, joint, rule, block++);
        // fully held bodies leave contacts no solution: such a scene has no answer to compare with
        const std::optional<Vec> lambda = dense.solve_lcp();
        if (!lambda)
            continue;
        const auto sweeps =
            dense.sweeps_needed(*lambda, block_counts(scene, GetParam().splitting), shrink_of(GetParam()), most_of(GetParam()));
        if (!sweeps)
            continue;
        params.iterations = 2 * *sweeps;
        check(cairn_solver_set_params(solver.get(), &params));
        scene.step(solver);
        EXPECT_LT((velocities(scene) - dense.velocity(*lambda)).cwiseAbs().maxCoeff(), tolerance_of(GetParam())) << "seed " << seed;
        ++solved;
    }
    EXPECT_GE(solved, 3);
}

// Substeps: n dense steps of dt / n, with the joints' rows made afresh at each, end where the substepped method ends.
TEST(Substeps, OfJointsAreStepsOfTheirOwn) {
    for (const std::uint32_t method : {CAIRN_METHOD_TJ, CAIRN_METHOD_TJSOFT}) {
        Random random(7);
        Scene whole = random_bodies(random, 4);
        add_random_joints(random, whole, 0.005);
        whole.joints.pop_back();
        Scene parts = whole;
        const std::uint32_t n = 4;
        const Solver substepped(64), stepped(64);
        cairn_params params = plain(method, 2000 * n, n);
        check(cairn_solver_set_params(substepped.get(), &params));
        whole.step(substepped);
        params.iterations = 2000;
        params.substeps = 1;
        check(cairn_solver_set_params(stepped.get(), &params));
        parts.dt /= n;
        for (std::uint32_t i = 0; i < n; ++i)
            parts.step(stepped);
        EXPECT_LT((velocities(whole) - velocities(parts)).cwiseAbs().maxCoeff(), 1e-9);
        for (std::size_t i = 0; i < whole.bodies.size(); ++i) {
            EXPECT_LT((whole.bodies[i].position - parts.bodies[i].position).norm(), 1e-11);
            EXPECT_LT(whole.bodies[i].orientation.angularDistance(parts.bodies[i].orientation), 1e-7);
        }
    }
}

// PJNJ's position sweeps alone: they close joints and part contacts, and leave velocities and the centre of mass alone.
TEST(PositionSweeps, ReachZeroErrorWithoutTouchingVelocities) {
    Random random(3);
    Scene scene = random_bodies(random, 4);
    scene.gravity.setZero();
    add_random_joints(random, scene, 0.02);
    scene.joints.pop_back();
    scene.joints.erase(scene.joints.begin()); // nothing is held by the world
    for (Body& b : scene.bodies)
        b.force = b.torque = b.linear = b.angular = Vec3::Zero();
    const auto center = [&] {
        Vec3 sum = Vec3::Zero();
        double mass = 0;
        for (const Body& b : scene.bodies) {
            sum += b.position / b.inverse_mass;
            mass += 1 / b.inverse_mass;
        }
        return Vec3(sum / mass);
    };
    const Vec3 before = center();
    double gap_before = 0;
    for (const Joint& joint : scene.joints) {
        if (joint.axes[0] == CAIRN_AXIS_LOCKED)
            gap_before = std::max(gap_before, joint_gap(scene, joint).norm());
    }
    const Solver solver(64);
    cairn_params params = plain(CAIRN_METHOD_PJNJ, 10);
    params.position_iterations = 5000;
    check(cairn_solver_set_params(solver.get(), &params));
    scene.step(solver);
    EXPECT_GT(gap_before, 0.005);
    EXPECT_EQ(solver.statistics().position_iterations, 5000u);
    EXPECT_LT(velocities(scene).cwiseAbs().maxCoeff(), 1e-12);
    EXPECT_LT((center() - before).norm(), 1e-12);
    for (const Joint& joint : scene.joints) {
        const Vec3 gap = frame_world(scene, joint.a, joint.frame_a).conjugate() * joint_gap(scene, joint);
        for (int i = 0; i < 3; ++i) {
            if (joint.axes[static_cast<std::size_t>(i)] == CAIRN_AXIS_FREE)
                continue;
            EXPECT_LT(std::abs(gap[i]), 1e-9);
        }
    }
}

} // namespace
} // namespace cairn_test
