// FCL and Cairn alone: what stands stays, what is round rolls, nothing is lost or left to chance.
#include "world.h"

namespace {

using namespace fcl_test;

void standsStill(const Geometry& shape, double height, const Quaterniond& q = Quaterniond::Identity()) {
    constexpr int kLayers = 6;
    World world;
    world.addFloor();
    for (int i = 0; i < kLayers; ++i)
        world.add(shape, Vector3d(0, height * (i + 0.5), 0), q * turn(0.1 * i, {0, 0, 1}));
    world.step(120);
    const std::vector<Body> settled = world.bodies;
    world.step(480);
    double drift = 0, speed = 0;
    for (std::size_t i = 0; i < settled.size(); ++i) {
        drift = std::max(drift, (world.bodies[i].position - settled[i].position).norm());
        speed = std::max(speed, world.bodies[i].linear.norm() + world.bodies[i].angular.norm());
    }
    EXPECT_LT(drift, 0.001 * height) << "in eight seconds";
    EXPECT_LT(speed, 0.001);
    EXPECT_LT(world.deepest(), 0.01 * height);
    const cairn_statistics s = world.statistics();
    EXPECT_EQ(s.contacts, 4u * kLayers);
    EXPECT_EQ(s.warm_started, s.contacts);
}

const Quaterniond kUp = turn(-1.5707963267948966, {1, 0, 0}); // z, the axis of prisms and cylinders, upwards

TEST(Motion, ATowerOfBoxesStands) { standsStill(box(0.5, 0.5, 0.4), 0.4, kUp); }
TEST(Motion, ATowerOfMeshesStands) { standsStill(boxMesh(0.5, 0.5, 0.4, true), 0.4, kUp); }
TEST(Motion, ATowerOfPrismsStands) { standsStill(prism(6, 0.4, 0.4), 0.4, kUp); }
TEST(Motion, ATowerOfDrumsStands) { standsStill(std::make_shared<::fcl::Cylinderd>(0.4, 0.4), 0.4, kUp); }

TEST(Motion, ABallRolls) {
    World world;
    world.addFloor();
    Body& ball = world.add(sphere(0.5), Vector3d(0, 0.5, 0));
    ball.linear = Vector3d(3, 0, 0);
    world.step(300);
    // It slides until the friction at its foot has turned it: angular momentum about the floor is kept, so v = 5/7 of the start's.
    EXPECT_NEAR(ball.linear.x(), 3 * 5.0 / 7, 0.01);
    EXPECT_NEAR(ball.angular.z(), -ball.linear.x() / 0.5, 0.01);
    EXPECT_NEAR(ball.position.y(), 0.5, 0.005);
    EXPECT_EQ(world.statistics().warm_started, 1u);
}

TEST(Motion, ALyingCapsuleDoesNotRock) {
    World world;
    world.addFloor();
    Body& lying = world.add(capsule(0.2, 1), Vector3d(0, 0.2, 0));
    world.step(300);
    EXPECT_LT(lying.angular.norm() + lying.linear.norm(), 1e-3);
    EXPECT_LT((lying.position - Vector3d(0, 0.2, 0)).norm(), 0.005);
}

TEST(Motion, MomentumIsKept) {
    World world(Vector3d::Zero());
    const Geometry shapes[] = {box(0.4, 0.5, 0.6), sphere(0.3), capsule(0.2, 0.4), prism(5, 0.3, 0.5)};
    Dice dice(3);
    for (int i = 0; i < 27; ++i) { // a loose cube of bodies that falls into its own middle
        const Vector3d place((i % 3) - 1.0, (i / 3 % 3) - 1.0, (i / 9) - 1.0);
        world.add(shapes[i % 4], place, dice.turn()).linear = -place + dice.vector(0.3);
    }
    const auto momentum = [&] {
        Vector3d sum = Vector3d::Zero();
        for (const Body& body : world.bodies)
            sum += body.linear / body.inverseMass;
        return sum;
    };
    const Vector3d before = momentum();
    double mass = 0;
    unsigned met = 0;
    for (const Body& body : world.bodies)
        mass += 1 / body.inverseMass;
    for (int i = 0; i < 120; ++i) {
        world.step();
        met += static_cast<unsigned>(world.contacts.contacts().size());
    }
    EXPECT_GT(met, 500u);
    EXPECT_LT((momentum() - before).norm() / mass, 1e-6) << "m/s, of the centre of mass";
}

TEST(Motion, TheSameBitsEachTimeAndWithAnyThreads) {
    uint64_t hashes[3];
    const uint32_t threads[3] = {1, 1, 3};
    for (int run = 0; run < 3; ++run) {
        std::vector<std::unique_ptr<char[]>> elsewhere; // so that objects lie at other addresses
        World world(Vector3d(0, -9.81, 0), threads[run]);
        world.addFloor();
        Dice dice(9);
        const Geometry shapes[] = {box(0.4, 0.5, 0.6), sphere(0.3), capsule(0.2, 0.4), boxMesh(0.5, 0.4, 0.3, true)};
        for (int i = 0; i < 60; ++i) {
            if (run == 1)
                elsewhere.push_back(std::make_unique<char[]>(static_cast<std::size_t>(137 * (i % 7) + 1)));
            world.add(shapes[i % 4], Vector3d(0.6 * (i % 3), 0.5 + 0.6 * (i / 9), 0.6 * (i / 3 % 3)) + dice.vector(0.05), dice.turn());
        }
        world.step(80);
        EXPECT_GT(world.contacts.contacts().size(), 60u);
        hashes[run] = world.hash();
    }
    EXPECT_EQ(hashes[0], hashes[1]);
    EXPECT_EQ(hashes[0], hashes[2]);
}

} // namespace
