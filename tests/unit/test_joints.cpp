// Each preset of the six-axis joint leaves exactly its free axes free; limits stop, motors drive with bounded force.
#include "methods.h"

#include <gtest/gtest.h>

namespace cairn_test {
namespace {

constexpr std::uint32_t kPresets[] = {CAIRN_JOINT_BALL, CAIRN_JOINT_HINGE, CAIRN_JOINT_SLIDER, CAIRN_JOINT_FIXED};

class JointMethods : public EachMethod {};
CAIRN_EACH_METHOD(JointMethods);

cairn_params converged(std::uint32_t method) {
    cairn_params params = preset(method);
    params.iterations = 40 * params.substeps;
    return params;
}

// Velocity of b relative to a along an axis of a's frame: translation at the anchor, or rotation.
double relative_speed(const Scene& scene, const Joint& joint, int axis) {
    const Vec3 d = frame_world(scene, joint.a, joint.frame_a) * Vec3(Vec3::Unit(axis % 3));
    const auto point_speed = [&](int i) {
        if (i < 0)
            return Vec3(Vec3::Zero());
        const Body& body = scene.bodies[static_cast<std::size_t>(i)];
        const Vec3 arm = anchor_world(scene, joint.b, joint.anchor_b) - body.position;
        return Vec3(body.linear + body.angular.cross(arm));
    };
    const auto spin = [&](int i) { return i < 0 ? Vec3(Vec3::Zero()) : scene.bodies[static_cast<std::size_t>(i)].angular; };
    return axis < 3 ? d.dot(point_speed(joint.b) - point_speed(joint.a)) : d.dot(spin(joint.b) - spin(joint.a));
}

TEST(JointPresets, AreThePapers) {
    const auto free = [](std::uint32_t kind) {
        std::string axes;
        for (const std::uint32_t a : axes_of(kind))
            axes += a == CAIRN_AXIS_FREE ? 'f' : a == CAIRN_AXIS_LOCKED ? 'L' : '?';
        return axes;
    };
    EXPECT_EQ(free(CAIRN_JOINT_BALL), "LLLfff");
    EXPECT_EQ(free(CAIRN_JOINT_HINGE), "LLLLLf");
    EXPECT_EQ(free(CAIRN_JOINT_SLIDER), "fLLLLL");
    EXPECT_EQ(free(CAIRN_JOINT_FIXED), "LLLLLL");
    Axes axes{};
    EXPECT_EQ(cairn_joint_axes(4, axes.data()), CAIRN_ERROR_INVALID_ARGUMENT);
}

// Two bodies about one point, pushed apart along one axis at a time: a free axis accelerates as if there were no joint, a
// locked one does not move.
TEST_P(JointMethods, LeaveExactlyTheFreeAxesFree) {
    const cairn_params params = converged(GetParam());
    const Solver solver;
    check(cairn_solver_set_params(solver.get(), &params));
    Random random(11);
    for (const std::uint32_t kind : kPresets) {
        for (int axis = 0; axis < 6; ++axis) {
            Scene scene;
            const Quat frame = random_quat(random);
            for (const double mass : {1.0, 2.5}) {
                Body body = Body::sphere(mass, 0.5, {0.3, -0.2, 0.1});
                body.orientation = random_quat(random);
                scene.add(body);
            }
            const Joint joint = scene.join(0, 1, scene.bodies[0].position, axes_of(kind), frame);
            const Vec3 direction = frame * Vec3(Vec3::Unit(axis % 3));
            const double push = 0.6;
            Body &a = scene.bodies[0], &b = scene.bodies[1];
            (axis < 3 ? b.force : b.torque) = push * direction;
            (axis < 3 ? a.force : a.torque) = -push * direction;
            const double inverse = axis < 3 ? a.inverse_mass + b.inverse_mass : a.inverse_inertia[0] + b.inverse_inertia[0];
            const int frames = 10;
            for (int i = 0; i < frames; ++i) {
                scene.step(solver);
            }
            const double expected = joint.axes[static_cast<std::size_t>(axis)] == CAIRN_AXIS_FREE ? push * inverse * frames * scene.dt : 0;
            for (int other = 0; other < 6; ++other) {
                const double speed = relative_speed(scene, joint, other), wanted = other == axis ? expected : 0;
                // a soft joint gives a little under load
                EXPECT_NEAR(speed, wanted, 2e-3) << "joint " << kind << ", pushed along " << axis << ", seen along " << other;
            }
        }
    }
}

// Bodies off the joint's centre, thrown at random: what is locked stays, and the free axes do move.
TEST_P(JointMethods, HoldTheirLockedAxesWhenThrown) {
    const cairn_params params = converged(GetParam());
    const Solver solver;
    check(cairn_solver_set_params(solver.get(), &params));
    const bool one_step = params.substeps == 1;
    for (const std::uint32_t kind : kPresets) {
        Random random(23 + kind);
        Scene scene;
        scene.dt = one_step ? 0.002 : 0.016;
        for (int i = 0; i < 2; ++i) {
            Body body = random_body(random);
            body.position *= 0.5;
            scene.add(body);
        }
        const Joint joint = scene.join(0, 1, random_vec(random, 0.2), axes_of(kind), random_quat(random));
        double travelled = 0, gap = 0, turn = 0;
        const Quat first = (scene.bodies[0].orientation.conjugate() * scene.bodies[1].orientation).normalized();
        for (int frame = 0; frame < 200; ++frame) {
            scene.step(solver);
            const Vec3 d = frame_world(scene, 0, joint.frame_a).conjugate() * joint_gap(scene, joint);
            for (int i = 0; i < 3; ++i) {
                if (joint.axes[static_cast<std::size_t>(i)] == CAIRN_AXIS_LOCKED)
                    gap = std::max(gap, std::abs(d[i]));
            }
            const Quat q = frame_world(scene, 0, joint.frame_a).conjugate() * frame_world(scene, 1, joint.frame_b);
            // a hinge may turn about z alone: then x and y of the quaternion stay 0
            const Vec3 v = q.vec();
            for (int i = 0; i < 3; ++i) {
                if (kind != CAIRN_JOINT_BALL && joint.axes[static_cast<std::size_t>(3 + i)] == CAIRN_AXIS_LOCKED) {
                    turn = std::max(turn, 2 * std::abs(v[i]));
                }
            }
            travelled =
                std::max(travelled, kind == CAIRN_JOINT_SLIDER
                                        ? std::abs(d.x())
                                        : first.angularDistance(scene.bodies[0].orientation.conjugate() * scene.bodies[1].orientation));
        }
        EXPECT_LT(gap, 5e-3) << "joint " << kind;
        EXPECT_LT(turn, 1e-2) << "joint " << kind;
        if (kind != CAIRN_JOINT_FIXED) {
            EXPECT_GT(travelled, 0.01) << "joint " << kind << " does not move";
        }
    }
}

// A wheel on a limited hinge spins up to each limit and no further.
TEST_P(JointMethods, LimitsStopAtTheLimit) {
    for (const double spin : {3.0, -3.0}) {
        Scene scene;
        Body wheel = Body::box(1, {0.4, 0.1, 0.1}, {0.4, 0, 0});
        wheel.angular = Vec3(0, 0, spin);
        wheel.linear = wheel.angular.cross(wheel.position);
        scene.add(wheel);
        Joint& joint = scene.join(CAIRN_WORLD, 0, Vec3::Zero(), axes_of(CAIRN_JOINT_HINGE));
        joint.axes[5] = CAIRN_AXIS_LIMITED;
        joint.lower[5] = -0.5;
        joint.upper[5] = 0.7;
        const Solver solver;
        const cairn_params params = converged(GetParam());
        check(cairn_solver_set_params(solver.get(), &params));
        double low = 0, high = 0;
        for (int frame = 0; frame < 120; ++frame) {
            const Impulses out = scene.step(solver);
            const Quat q = scene.bodies[0].orientation;
            const double angle = 2 * std::atan2(q.z(), q.w());
            low = std::min(low, angle);
            high = std::max(high, angle);
            if (frame < 5) {
                EXPECT_NEAR(out.joint[5], 0, 1e-6) << "pushes before the limit";
            }
        }
        EXPECT_GT(low, -0.52);
        EXPECT_LT(high, 0.72);
        EXPECT_TRUE(spin > 0 ? high > 0.68 : low < -0.48);
        EXPECT_LT(scene.bodies[0].angular.norm(), 0.2) << "bounces off its limit";
    }
}

// A limit without room locks the axis in its own coordinate, also far from zero.
TEST_P(JointMethods, AHingeIsHeldAtTheAngleItIsPinnedTo) {
    Scene scene;
    Body body = Body::box(1, {0.2, 0.1, 0.3}, {1, 0, 0});
    body.orientation = Quat(Eigen::AngleAxisd(2.5, Vec3::UnitZ()));
    body.angular = Vec3(0, 0, 0.5);
    scene.add(body);
    Joint joint;
    joint.b = 0;
    joint.anchor_a = Vec3(1, 0, 0);
    joint.axes = {1, 1, 1, 1, 1, CAIRN_AXIS_LIMITED};
    joint.lower[5] = joint.upper[5] = 2.5;
    scene.joints.push_back(joint);
    const Solver solver;
    const cairn_params params = converged(GetParam());
    check(cairn_solver_set_params(solver.get(), &params));
    for (int frame = 0; frame < 60; ++frame) {
        scene.step(solver);
        EXPECT_LT(Eigen::AngleAxisd(scene.bodies[0].orientation * body.orientation.conjugate()).angle(), 0.02);
    }
    EXPECT_LT(scene.bodies[0].angular.norm(), 0.05);
}

TEST_P(JointMethods, LimitsHoldAWeightOnASlider) {
    Scene scene;
    scene.gravity = Vec3(0, 0, -9.81);
    scene.add(Body::sphere(2, 0.2, Vec3::Zero()));
    const Quat vertical(Eigen::AngleAxisd(-std::acos(-1.0) / 2, Vec3::UnitY())); // the slider's x points up
    Joint& joint = scene.join(CAIRN_WORLD, 0, Vec3::Zero(), axes_of(CAIRN_JOINT_SLIDER), vertical);
    joint.axes[0] = CAIRN_AXIS_LIMITED;
    joint.lower[0] = -0.25;
    joint.upper[0] = 1;
    const Solver solver;
    const cairn_params params = converged(GetParam());
    check(cairn_solver_set_params(solver.get(), &params));
    Impulses out;
    for (int frame = 0; frame < 120; ++frame)
        out = scene.step(solver);
    EXPECT_NEAR(scene.bodies[0].position.z(), -0.25, 5e-3);
    EXPECT_NEAR(scene.bodies[0].position.head<2>().norm(), 0, 1e-3);
    EXPECT_NEAR(out.joint[0], 2 * 9.81 * scene.dt, 1e-3); // on b, along the axis, over the step
}

// A motor accelerates with its full force until it has its speed, then holds it.
TEST_P(JointMethods, MotorsReachTheirSpeedWithBoundedForce) {
    Scene scene;
    Body wheel = Body::box(2, {0.3, 0.3, 0.1}, Vec3::Zero());
    scene.add(wheel);
    const double inertia = 1 / wheel.inverse_inertia.z(), torque = 0.5, speed = 4;
    Joint& joint = scene.join(CAIRN_WORLD, 0, Vec3::Zero(), axes_of(CAIRN_JOINT_HINGE));
    joint.axes[5] = CAIRN_AXIS_DRIVEN;
    joint.motor_speed[5] = speed;
    joint.motor_force[5] = torque;
    const Solver solver;
    const cairn_params params = converged(GetParam());
    check(cairn_solver_set_params(solver.get(), &params));
    double time = 0;
    for (int frame = 0; frame < 120; ++frame) {
        const Impulses out = scene.step(solver);
        time += scene.dt;
        EXPECT_LE(std::abs(out.joint[5]), torque * scene.dt * (1 + 1e-5));
        EXPECT_NEAR(scene.bodies[0].angular.z(), std::min(speed, torque / inertia * time), 2e-2 * speed) << "after " << time << " s";
    }
    EXPECT_NEAR(scene.bodies[0].angular.z(), speed, 1e-4);
}

// A motor too weak to lift its load slips at its force; a strong one lifts it.
TEST_P(JointMethods, MotorsOnSlidersLiftWhatTheyCan) {
    for (const double force : {10.0, 1000.0, kInfinity}) {
        Scene scene;
        scene.gravity = Vec3(0, 0, -9.81);
        scene.add(Body::sphere(2, 0.2, Vec3::Zero()));
        const Quat vertical(Eigen::AngleAxisd(-std::acos(-1.0) / 2, Vec3::UnitY()));
        Joint& joint = scene.join(CAIRN_WORLD, 0, Vec3::Zero(), axes_of(CAIRN_JOINT_SLIDER), vertical);
        joint.axes[0] = CAIRN_AXIS_DRIVEN;
        joint.motor_speed[0] = 1;
        joint.motor_force[0] = force;
        const Solver solver;
        const cairn_params params = converged(GetParam());
        check(cairn_solver_set_params(solver.get(), &params));
        for (int frame = 0; frame < 50; ++frame)
            scene.step(solver);
        const double weight = 2 * 9.81, time = 50 * scene.dt;
        const double expected = force < weight ? (force - weight) / 2 * time : 1;
        EXPECT_NEAR(scene.bodies[0].linear.z(), expected, 1e-2) << "motor of " << force << " N";
    }
}

// Both at once: a driven axis with limits stops at the limit against its motor.
TEST_P(JointMethods, AMotorStopsAtItsLimit) {
    Scene scene;
    scene.add(Body::box(1, {0.3, 0.3, 0.1}, Vec3::Zero()));
    Joint& joint = scene.join(CAIRN_WORLD, 0, Vec3::Zero(), axes_of(CAIRN_JOINT_HINGE));
    joint.axes[5] = CAIRN_AXIS_DRIVEN | CAIRN_AXIS_LIMITED;
    joint.motor_speed[5] = 2;
    joint.motor_force[5] = 1;
    joint.lower[5] = -1;
    joint.upper[5] = 0.5;
    const Solver solver;
    const cairn_params params = converged(GetParam());
    check(cairn_solver_set_params(solver.get(), &params));
    for (int frame = 0; frame < 120; ++frame)
        scene.step(solver);
    const Quat q = scene.bodies[0].orientation;
    EXPECT_NEAR(2 * std::atan2(q.z(), q.w()), 0.5, 1e-2);
    EXPECT_LT(scene.bodies[0].angular.norm(), 1e-2);
}

// Coordinates as the header defines them: Cardan angles x-y-z where two or three rotations are not locked.
TEST_P(JointMethods, CardanLimitsStopEachAngle) {
    for (int axis = 0; axis < 3; ++axis) {
        Scene scene;
        Body body = Body::sphere(1, 0.3, Vec3::Zero());
        body.angular = 2 * Vec3(Vec3::Unit(axis));
        scene.add(body);
        Joint& joint = scene.join(CAIRN_WORLD, 0, Vec3::Zero(), axes_of(CAIRN_JOINT_BALL));
        for (std::size_t i = 3; i < 6; ++i) {
            joint.axes[i] = CAIRN_AXIS_LIMITED;
            joint.lower[i] = -0.3 - 0.1 * static_cast<double>(i);
            joint.upper[i] = 0.3 + 0.1 * static_cast<double>(i);
        }
        const double limit = joint.upper[static_cast<std::size_t>(3 + axis)];
        const Solver solver;
        const cairn_params params = converged(GetParam());
        check(cairn_solver_set_params(solver.get(), &params));
        double highest = 0;
        for (int frame = 0; frame < 60; ++frame) {
            scene.step(solver);
            const Quat q = scene.bodies[0].orientation;
            highest = std::max(highest, 2 * std::atan2(q.vec()[axis], q.w()));
        }
        EXPECT_NEAR(highest, limit, 1e-2) << "axis " << axis;
        EXPECT_LT(scene.bodies[0].angular.norm(), 0.15) << "bounces off its limit";
    }
}

} // namespace
} // namespace cairn_test
