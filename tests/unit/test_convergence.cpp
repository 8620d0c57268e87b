// Sweeps are majorise-minimise steps: they never raise the energy, and the residual trace says how far they are.
#include "dense.h"
#include "methods.h"

namespace cairn_test {
namespace {

class Convergence : public EachMethod {};
CAIRN_EACH_METHOD(Convergence);

Scene bilateral(std::uint64_t seed) {
    Random random(seed);
    Scene scene = random_bodies(random, 6);
    add_random_joints(random, scene, 0.01);
    return scene;
}
Scene frictionless(std::uint64_t seed) {
    Random random(seed);
    Scene scene = random_bodies(random, 6);
    add_random_contacts(random, scene, 16, 0);
    return scene;
}

TEST_P(Convergence, TraceHasOneResidualASweepAndDecreases) {
    for (const std::uint32_t splitting : {CAIRN_SPLIT_POINT, CAIRN_SPLIT_MANIFOLD}) {
        for (std::uint64_t seed = 1; seed <= 6; ++seed) {
            Scene scene = seed % 2 != 0 ? bilateral(seed) : frictionless(seed);
            const Solver solver(64);
            cairn_params params = plain(GetParam(), 60);
            params.splitting = splitting;
            params.residual_trace = 1;
            check(cairn_solver_set_params(solver.get(), &params));
            scene.step(solver);
            const std::vector<double> trace = solver.residual_trace();
            ASSERT_EQ(trace.size(), 60u);
            EXPECT_EQ(solver.statistics().residual, trace.back());
            EXPECT_GT(trace.front(), 0);
            // a step is a contraction in the metric of D: its length cannot grow (the inner sweep of a manifold is not one)
            const bool contracts = seed % 2 != 0 || splitting == CAIRN_SPLIT_POINT;
            for (std::size_t i = 1; i < trace.size() && contracts; ++i)
                EXPECT_LE(trace[i], trace[i - 1] * (1 + 1e-9)) << "sweep " << i;
            EXPECT_LT(trace.back(), 0.5 * trace.front());
        }
    }
}

TEST(ResidualTrace, IsEmptyUnlessAskedForAndCoversSubsteps) {
    const Solver solver;
    cairn_params params = plain(CAIRN_METHOD_TJ, 30, 5);
    check(cairn_solver_set_params(solver.get(), &params));
    Scene scene = bilateral(1);
    scene.step(solver);
    EXPECT_TRUE(solver.residual_trace().empty());
    EXPECT_EQ(solver.statistics().residual, 0);
    params.residual_trace = 1;
    check(cairn_solver_set_params(solver.get(), &params));
    scene.step(solver);
    EXPECT_EQ(solver.residual_trace().size(), 30u);
    EXPECT_EQ(solver.statistics().iterations, 30u);
    double one = 0;
    std::size_t count = 0;
    EXPECT_EQ(cairn_solver_residual_trace(solver.get(), &one, 1, &count), CAIRN_ERROR_BUFFER_TOO_SMALL);
    EXPECT_EQ(count, 30u);
    EXPECT_EQ(one, 0);
}

// 1/2 lambda^T (A + Gamma) lambda + lambda^T q after 1, 2, 3 ... sweeps from zero.
TEST_P(Convergence, EnergyNeverRises) {
    for (const std::uint32_t splitting : {CAIRN_SPLIT_POINT, CAIRN_SPLIT_MANIFOLD}) {
        for (std::uint64_t seed = 1; seed <= 6; ++seed) {
            const Scene scene = frictionless(seed);
            cairn_params params = plain(GetParam(), 1);
            params.splitting = splitting;
            const BiasRule rule = BiasRule::of(params, scene.dt);
            Dense dense(scene, scene.dt);
            for (const Contact& c : scene.contacts)
                dense.add_contact(scene, c, rule, false, 0);
            Mat m = dense.a();
            m.diagonal() += dense.gamma;
            const Vec q = dense.q();
            double last = 0, first = 0;
            for (std::uint32_t sweeps = 1; sweeps <= 25; ++sweeps) {
                params.iterations = sweeps;
                const Solver solver(64);
                check(cairn_solver_set_params(solver.get(), &params));
                Scene copy = scene;
                const Impulses out = copy.step(solver);
                const Vec lambda = Eigen::Map<const Vec>(out.contact.data(), static_cast<Eigen::Index>(out.contact.size()));
                const double energy = 0.5 * lambda.dot(m * lambda) + lambda.dot(q);
                EXPECT_LE(energy, last + 1e-12 * std::abs(last)) << "seed " << seed << ", sweep " << sweeps;
                last = energy;
                if (sweeps == 1)
                    first = energy;
            }
            EXPECT_LT(last, first);
        }
    }
}

TEST_P(Convergence, NesterovNeedsFewerSweeps) {
    int wins = 0, trials = 0;
    for (std::uint64_t seed = 1; seed <= 6; ++seed) {
        double reached[2];
        for (const std::uint32_t acceleration : {CAIRN_ACCELERATION_NONE, CAIRN_ACCELERATION_NESTEROV}) {
            Scene scene = bilateral(seed);
            const Solver solver(64);
            cairn_params params = plain(GetParam(), 150);
            params.acceleration = acceleration;
            params.residual_trace = 1;
            check(cairn_solver_set_params(solver.get(), &params));
            scene.step(solver);
            reached[acceleration] = solver.residual_trace().back();
        }
        ++trials;
        wins += reached[CAIRN_ACCELERATION_NESTEROV] < reached[CAIRN_ACCELERATION_NONE];
    }
    EXPECT_GE(wins, trials - 1);
}

TEST_P(Convergence, ToleranceStopsEarlyAndNotTooEarly) {
    Scene scene = bilateral(3);
    scene.joints.pop_back(); // an open tree: no row contradicts another
    const Solver solver(64);
    cairn_params params = plain(GetParam(), 20000);
    params.residual_trace = 1;
    params.residual_tolerance = 1e-6;
    check(cairn_solver_set_params(solver.get(), &params));
    scene.step(solver);
    const cairn_statistics s = solver.statistics();
    EXPECT_LT(s.iterations, 20000u);
    EXPECT_GT(s.iterations, 1u);
    EXPECT_LT(s.residual, 1e-6);
    const std::vector<double> trace = solver.residual_trace();
    ASSERT_GE(trace.size(), s.iterations);
    EXPECT_GE(trace[s.iterations - 2], 1e-6);
}

} // namespace
} // namespace cairn_test
