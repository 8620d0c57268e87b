// True mass splitting (paper eq. 19): the blocks D of the split effective mass bound A = J M^-1 J^T, so that a sweep is a
// majorise-minimise step and cannot overshoot.
#include "dense.h"

#include <gtest/gtest.h>

namespace cairn_test {
namespace {

struct Built {
    Scene scene;
    Dense dense;
};

// A random scene with joints, contacts with friction and its rows in blocks.
Built random_scene(std::uint64_t seed, std::uint32_t splitting) {
    Random random(seed);
    Scene scene = random_bodies(random, 3 + static_cast<int>(seed % 8));
    if (seed % 3 != 0)
        add_random_joints(random, scene, 0.01);
    add_random_contacts(random, scene, 5 + static_cast<int>(seed % 20), 0.5);
    const BiasRule rule = BiasRule::of(plain(CAIRN_METHOD_PJ, 1), scene.dt);
    Dense dense(scene, scene.dt);
    const std::vector<int> blocks = contact_blocks(scene, splitting);
    for (std::size_t i = 0; i < scene.contacts.size(); ++i)
        dense.add_contact(scene, scene.contacts[i], rule, true, blocks[i]);
    int block = 1000;
    for (const Joint& joint : scene.joints)
        dense.add_joint(scene, joint, rule, block++);
    return {scene, dense};
}

std::vector<std::uint32_t> counts_of(Scene scene, std::uint32_t splitting) {
    const Solver solver;
    cairn_params params = plain(CAIRN_METHOD_PJ, 1);
    params.splitting = splitting;
    check(cairn_solver_set_params(solver.get(), &params));
    scene.step(solver);
    return solver.split_counts();
}

class Splitting : public testing::TestWithParam<std::uint32_t> {};
INSTANTIATE_TEST_SUITE_P(PointAndManifold, Splitting, testing::Values(CAIRN_SPLIT_POINT, CAIRN_SPLIT_MANIFOLD));

TEST_P(Splitting, BlocksBoundTheSystem) {
    for (std::uint64_t seed = 1; seed <= 30; ++seed) {
        const Built built = random_scene(seed, GetParam());
        const Mat d = built.dense.split(counts_of(built.scene, GetParam()));
        const Eigen::SelfAdjointEigenSolver<Mat> eigen(d - built.dense.a(), Eigen::EigenvaluesOnly);
        EXPECT_GE(eigen.eigenvalues().minCoeff(), -1e-12 * d.norm()) << "seed " << seed;
    }
}

// The bound is not there by a wide margin: one block fewer on any body that has two, and somewhere it no longer holds.
TEST_P(Splitting, CountsAreNoLargerThanTheBoundNeeds) {
    int broken = 0;
    for (std::uint64_t seed = 1; seed <= 30; ++seed) {
        const Built built = random_scene(seed, GetParam());
        std::vector<std::uint32_t> counts = counts_of(built.scene, GetParam());
        for (std::uint32_t& n : counts)
            n = n > 1 ? n - 1 : n;
        const Mat d = built.dense.split(counts);
        const Eigen::SelfAdjointEigenSolver<Mat> eigen(d - built.dense.a(), Eigen::EigenvaluesOnly);
        broken += eigen.eigenvalues().minCoeff() < -1e-9 * d.norm();
    }
    EXPECT_GT(broken, 15);
}

TEST(SplitCounts, OfASceneThatOneCanCount) {
    // ground (static) - box on four points - ball on one point of the box; the box hinged to a second ball, the second ball
    // also held by a raw block of two rows and one more of another block
    Scene scene;
    Body ground;
    ground.inverse_mass = 0;
    ground.inverse_inertia.setZero();
    scene.add(ground);
    const int box = scene.add(Body::box(1, Vec3::Constant(0.5), {0, 0, 0.5}));
    const int ball = scene.add(Body::sphere(1, 0.5, {0, 0, 1.5}));
    const int other = scene.add(Body::sphere(1, 0.5, {2, 0, 0.5}));
    const int alone = scene.add(Body::sphere(1, 0.5, {9, 0, 0.5}));
    for (const double x : {-0.5, 0.5}) {
        for (const double y : {-0.5, 0.5}) {
            Contact c;
            c.a = 0;
            c.b = box;
            c.arm_a = Vec3(x, y, 0);
            c.arm_b = Vec3(x, y, -0.5);
            scene.contacts.push_back(c);
        }
    }
    Contact top;
    top.a = box;
    top.b = ball;
    top.arm_a = Vec3(0, 0, 0.5);
    top.arm_b = Vec3(0, 0, -0.5);
    top.separation = 0;
    scene.contacts.push_back(top);
    scene.join(box, other, {1, 0, 0.5}, axes_of(CAIRN_JOINT_HINGE));
    for (const std::uint32_t block : {0u, 0u, 1u}) {
        Row row;
        row.a = CAIRN_WORLD;
        row.b = other;
        row.jacobian_b[static_cast<Eigen::Index>(scene.rows.size())] = 1;
        row.block = block;
        scene.rows.push_back(row);
    }
    const auto counts_with = [&](std::uint32_t splitting) { return counts_of(scene, splitting); };
    // a static body is not split: whatever is reported for it has no effect
    const std::vector<std::uint32_t> points = counts_with(CAIRN_SPLIT_POINT), manifolds = counts_with(CAIRN_SPLIT_MANIFOLD);
    ASSERT_EQ(points.size(), scene.bodies.size());
    const auto at = [](const std::vector<std::uint32_t>& counts, int i) { return counts[static_cast<std::size_t>(i)]; };
    EXPECT_EQ(at(points, box), 6u);
    EXPECT_EQ(at(manifolds, box), 3u);
    EXPECT_EQ(at(points, ball), 1u);
    EXPECT_EQ(at(manifolds, ball), 1u);
    EXPECT_EQ(at(points, other), 3u);
    EXPECT_EQ(at(manifolds, other), 3u);
    EXPECT_EQ(at(points, alone), 0u);

    const Solver solver;
    const cairn_params params = plain(CAIRN_METHOD_PJ, 3);
    check(cairn_solver_set_params(solver.get(), &params));
    scene.step(solver);
    const cairn_statistics s = solver.statistics();
    EXPECT_EQ(s.bodies, 4u);
    EXPECT_EQ(s.contacts, 5u);
    EXPECT_EQ(s.manifolds, 2u);
    EXPECT_EQ(s.joints, 1u);
    EXPECT_EQ(s.islands, 2u); // what hangs together, and the ball that nothing touches
    EXPECT_EQ(s.rows, 5u + 5u + 3u);
    EXPECT_EQ(s.iterations, 3u);
    EXPECT_EQ(s.substeps, 1u);
    EXPECT_EQ(s.threads, 1u);
}

} // namespace
} // namespace cairn_test
