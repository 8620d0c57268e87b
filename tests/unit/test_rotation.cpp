// Free rotation keeps angular momentum and energy; rolling surfaces open no false gap.
#include "methods.h"
#include "shapes.h"

namespace cairn_test {
namespace {

class Rotation : public EachMethod {};
CAIRN_EACH_METHOD(Rotation);

Scene spinning(double disturbance) {
    Scene scene;
    Body body;
    body.inverse_inertia = Vec3(1, 1.0 / 2, 1.0 / 3);
    body.angular = Vec3(disturbance, 10, disturbance); // the middle axis: it tumbles
    scene.add(body);
    return scene;
}

TEST_P(Rotation, FreeSpinKeepsMomentumAndEnergy) {
    for (const std::uint32_t precision : {32u, 64u}) {
        Scene scene = spinning(0.01);
        const Vec3 momentum = scene.angular_momentum();
        const double energy = scene.kinetic_energy();
        const Solver solver(precision);
        const cairn_params params = preset(GetParam());
        check(cairn_solver_set_params(solver.get(), &params));
        double least = 10;
        for (int frame = 0; frame < 625; ++frame) { // 10 s
            scene.step(solver);
            least = std::min(least, scene.bodies[0].orientation.conjugate().operator*(scene.bodies[0].angular).y());
        }
        EXPECT_LT(least, -9) << "it did not tumble: the gyroscopic term is missing";
        EXPECT_LT((scene.angular_momentum() - momentum).norm() / momentum.norm(),
                  precision == 64 ? 1e-10 : 3e-5); // float: rounding, over 625 or 6250 turns
        EXPECT_LT(std::abs(scene.kinetic_energy() - energy) / energy, 1e-4);
        EXPECT_NEAR(scene.bodies[0].orientation.norm(), 1, precision == 64 ? 1e-12 : 1e-6);
    }
}

TEST_P(Rotation, WithoutTheGyroscopicTermAngularVelocityIsKept) {
    Scene scene = spinning(1);
    scene.bodies[0].flags = CAIRN_BODY_NO_GYROSCOPIC;
    const Vec3 spin = scene.bodies[0].angular;
    const Solver solver;
    const cairn_params params = preset(GetParam());
    check(cairn_solver_set_params(solver.get(), &params));
    for (int frame = 0; frame < 100; ++frame)
        scene.step(solver);
    EXPECT_LT((scene.bodies[0].angular - spin).norm(), 1e-5);
}

// A constant spin about a principal axis turns by omega t.
TEST_P(Rotation, TurnsByTheAngleOfItsSpin) {
    Scene scene;
    Body body = Body::sphere(1, 1, Vec3::Zero());
    body.angular = Vec3(1, -2, 0.5);
    scene.add(body);
    const Solver solver(64);
    const cairn_params params = preset(GetParam());
    check(cairn_solver_set_params(solver.get(), &params));
    for (int frame = 0; frame < 50; ++frame)
        scene.step(solver);
    const Quat expected(Eigen::AngleAxisd(body.angular.norm() * 50 * scene.dt, body.angular.normalized()));
    EXPECT_LT(scene.bodies[0].orientation.angularDistance(expected), 1e-6);
}

// Too fast for one substep: the turn is cut, and the statistics say so.
TEST_P(Rotation, ClampedTurnsAreCounted) {
    Scene scene;
    Body body = Body::sphere(1, 1, Vec3::Zero());
    scene.add(body);
    const Solver solver;
    cairn_params params = preset(GetParam());
    check(cairn_solver_set_params(solver.get(), &params));
    scene.bodies[0].angular = Vec3(0, 0, 10);
    scene.step(solver);
    EXPECT_EQ(solver.statistics().rotation_clamped, 0u);
    scene.bodies[0].angular = Vec3(0, 0, 1000 * params.substeps);
    scene.step(solver);
    EXPECT_EQ(solver.statistics().rotation_clamped, params.substeps);
}

// A ball that rolls at 5 m/s turns by 0.16 rad a step. Its contact point stays below its centre; one that turned with the ball
// would rise by 6 mm within the step and the ball sink into the gap.
TEST(Round, RollingBallOpensNoFalseGap) {
    for (const std::uint32_t method : {CAIRN_METHOD_TJ, CAIRN_METHOD_TJSOFT}) {
        double sunk[2];
        for (const bool round : {false, true}) {
            const double radius = 0.5;
            Scene scene;
            scene.gravity = Vec3(0, 0, -9.81);
            Body ball = Body::sphere(4, radius, {0, 0, radius});
            ball.linear = Vec3(5, 0, 0);
            ball.angular = Vec3(0, 10, 0);
            scene.add(ball);
            const Solver solver;
            cairn_params params = preset(method);
            params.substeps = 10;
            params.iterations = 100;
            check(cairn_solver_set_params(solver.get(), &params));
            double lowest = radius;
            for (int frame = 0; frame < 60; ++frame) {
                scene.contacts.clear();
                touch_sphere(scene, 0, radius, Plane{}, 0.5);
                ASSERT_EQ(scene.contacts.size(), 1u);
                if (!round)
                    scene.contacts[0].flags = 0;
                scene.step(solver);
                lowest = std::min(lowest, scene.bodies[0].position.z());
            }
            sunk[round] = radius - lowest;
            if (!round)
                continue;
            EXPECT_NEAR(scene.bodies[0].linear.x(), 5, 1e-3);
            EXPECT_NEAR(scene.bodies[0].angular.y(), 10, 1e-2);
        }
        EXPECT_LT(sunk[true], 1e-4);
        EXPECT_GT(sunk[false], 3e-4) << "the flag makes no difference: this test checks nothing";
    }
}

} // namespace
} // namespace cairn_test
