// Machines with a closed formula.
#include "methods.h"

#include <cmath>
#include <gtest/gtest.h>

namespace cairn_test {
namespace {

class Mechanisms : public EachMethod {};
CAIRN_EACH_METHOD(Mechanisms);

// A slider-crank: a crank of radius r turned by a motor, a rod of length l, a piston on a slider along x.
//   x(theta) = r cos theta + sqrt(l^2 - r^2 sin^2 theta)
TEST_P(Mechanisms, CrankMovesThePistonByTheFormula) {
    const double r = 0.3, l = 1;
    Scene scene;
    scene.gravity = Vec3(0, -9.81, 0);
    const cairn_params params = [&] {
        cairn_params p = preset(GetParam());
        p.iterations = 60 * p.substeps;
        return p;
    }();
    scene.dt = params.substeps == 1 ? 0.004 : 0.016;
    const int crank = scene.add(Body::box(2, {r / 2, 0.05, 0.05}, {r / 2, 0, 0}));
    const int rod = scene.add(Body::box(1, {l / 2, 0.03, 0.03}, {r + l / 2, 0, 0}));
    const int piston = scene.add(Body::box(1.5, {0.1, 0.1, 0.1}, {r + l, 0, 0}));
    Joint& motor = scene.join(CAIRN_WORLD, crank, Vec3::Zero(), axes_of(CAIRN_JOINT_HINGE));
    motor.axes[5] = CAIRN_AXIS_DRIVEN;
    motor.motor_speed[5] = 3;
    motor.motor_force[5] = 200;
    scene.join(crank, rod, {r, 0, 0}, axes_of(CAIRN_JOINT_HINGE));
    scene.join(rod, piston, {r + l, 0, 0}, axes_of(CAIRN_JOINT_HINGE));
    scene.join(CAIRN_WORLD, piston, {r + l, 0, 0}, axes_of(CAIRN_JOINT_SLIDER));

    const Solver solver;
    check(cairn_solver_set_params(solver.get(), &params));
    double worst = 0, leftmost = r + l, turned = 0, last = 0;
    const int frames = static_cast<int>(5 / scene.dt);
    for (int frame = 0; frame < frames; ++frame) {
        scene.step(solver);
        const Body& c = scene.bodies[static_cast<std::size_t>(crank)];
        const double theta = 2 * std::atan2(c.orientation.z(), c.orientation.w());
        turned += std::remainder(theta - last, 2 * std::acos(-1.0));
        last = theta;
        const double s = r * std::sin(theta), x = r * std::cos(theta) + std::sqrt(l * l - s * s);
        worst = std::max(worst, std::abs(scene.bodies[static_cast<std::size_t>(piston)].position.x() - x));
        leftmost = std::min(leftmost, scene.bodies[static_cast<std::size_t>(piston)].position.x());
    }
    RecordProperty("worst_error_m", std::to_string(worst));
    EXPECT_LT(worst, 2e-3);
    EXPECT_NEAR(leftmost, l - r, 5e-3); // it went all the way
    EXPECT_NEAR(turned, 3 * 5.0, 0.3);  // at the motor's speed
}

// A pendulum on a hinge keeps its energy: 2 pi sqrt(I / (m g d)) for a small swing.
TEST_P(Mechanisms, PendulumHasItsPeriod) {
    Scene scene;
    scene.gravity = Vec3(0, -9.81, 0);
    scene.dt = 0.002;
    const Vec3 half(0.05, 0.4, 0.05);
    Body bob = Body::box(1, half, Vec3::Zero());
    const double d = 0.5, tilt = 0.05;
    bob.orientation = Quat(Eigen::AngleAxisd(tilt, Vec3::UnitZ()));
    bob.position = bob.orientation * Vec3(0, -d, 0);
    scene.add(bob);
    Joint joint;
    joint.b = 0;
    joint.anchor_b = Vec3(0, d, 0);
    joint.axes = axes_of(CAIRN_JOINT_HINGE);
    scene.joints.push_back(joint);
    const double period = 2 * std::acos(-1.0) * std::sqrt((1 / bob.inverse_inertia.z() + d * d) / (9.81 * d));
    const Solver solver;
    cairn_params params = preset(GetParam());
    params.substeps = std::min(params.substeps, 2u);
    params.iterations = 20;
    check(cairn_solver_set_params(solver.get(), &params));
    std::vector<double> crossings;
    double last = bob.position.x();
    for (int frame = 0; frame < 3000; ++frame) {
        scene.step(solver);
        const double x = scene.bodies[0].position.x();
        if (last < 0 && x >= 0)
            crossings.push_back((frame + last / (last - x)) * scene.dt);
        last = x;
    }
    ASSERT_GE(crossings.size(), 3u);
    const double measured = (crossings.back() - crossings.front()) / static_cast<double>(crossings.size() - 1);
    EXPECT_NEAR(measured, period, 0.01 * period);
}

} // namespace
} // namespace cairn_test
