// Springs, servos, cones, bounded forces: the joints' further kinds against closed formulas.
#include "methods.h"

#include <cmath>
#include <gtest/gtest.h>

namespace cairn_test {
namespace {

class JointDrives : public EachMethod {
  protected:
    JointDrives() : params_(preset(GetParam())) {
        params_.iterations = 40 * params_.substeps;
        solver_.set(params_);
    }
    cairn_params params_;
    Solver solver_{64};
};
CAIRN_EACH_METHOD(JointDrives);

// A sphere on a slider along x, or at its centre on a hinge about z, with one axis to play with.
Joint& one_axis(Scene& scene, std::uint32_t kind, std::size_t axis, std::uint32_t state) {
    if (scene.bodies.empty())
        scene.add(Body::sphere(2, 0.5, Vec3::Zero()));
    Joint& joint = scene.join(CAIRN_WORLD, 0, Vec3::Zero(), axes_of(kind));
    joint.axes[axis] = state;
    return joint;
}
double turn_about_z(const Body& body) { return 2 * std::atan2(body.orientation.z(), body.orientation.w()); }

// Each substep is implicit Euler: (m + h c + h^2 k) v+ = m v + h k (target - x), x+ = x + h v+.
TEST_P(JointDrives, ASpringIsImplicitEuler) {
    for (const bool turns : {false, true}) {
        const std::size_t axis = turns ? 5 : 0;
        Scene scene;
        Joint& joint = one_axis(scene, turns ? CAIRN_JOINT_HINGE : CAIRN_JOINT_SLIDER, axis, CAIRN_AXIS_SPRING);
        const double k = 80, c = 1.5, target = 0.4, h = scene.dt / params_.substeps;
        joint.stiffness[axis] = k;
        joint.damping[axis] = c;
        joint.target[axis] = target;
        const Body& body = scene.bodies[0];
        const double m = turns ? 1 / body.inverse_inertia.z() : 1 / body.inverse_mass;
        double x = 0, v = 0, most = 0;
        for (int frame = 0; frame < 60; ++frame) {
            double impulse = 0;
            for (std::uint32_t i = 0; i < params_.substeps; ++i) {
                const double next = (m * v + h * k * (target - x)) / (m + h * c + h * h * k);
                impulse += m * (next - v);
                v = next;
                x += h * v;
            }
            const Impulses out = scene.step(solver_);
            const double seen = turns ? turn_about_z(body) : body.position.x();
            ASSERT_NEAR(seen, x, 1e-6) << "frame " << frame << (turns ? ", rotation" : "");
            ASSERT_NEAR(out.joint[axis], impulse, 1e-5);
            most = std::max(most, seen);
        }
        EXPECT_GT(most, 1.2 * target) << "does not swing";
    }
}

TEST_P(JointDrives, AWeightHangsOnItsSpringBetweenLimits) {
    Scene scene;
    scene.gravity = Vec3(-9.81, 0, 0);
    Joint& joint = one_axis(scene, CAIRN_JOINT_SLIDER, 0, CAIRN_AXIS_SPRING | CAIRN_AXIS_LIMITED);
    joint.stiffness[0] = 100;
    joint.damping[0] = 20;
    joint.lower[0] = -0.5;
    joint.upper[0] = 0.5;
    for (int frame = 0; frame < 300; ++frame)
        scene.step(solver_);
    EXPECT_NEAR(scene.bodies[0].position.x(), -2 * 9.81 / 100, 1e-4);
    scene.joints[0].stiffness[0] = 10; // now the limit carries what the spring does not
    Impulses out;
    for (int frame = 0; frame < 300; ++frame)
        out = scene.step(solver_);
    EXPECT_NEAR(scene.bodies[0].position.x(), -0.5, 5e-3);
    EXPECT_NEAR(out.joint[0], 2 * 9.81 * scene.dt, 1e-4);
}

TEST_P(JointDrives, AStiffSpringIsALock) {
    Scene scene;
    scene.gravity = Vec3(-9.81, 0, 0);
    one_axis(scene, CAIRN_JOINT_SLIDER, 0, CAIRN_AXIS_SPRING).stiffness[0] = 1e9;
    for (int frame = 0; frame < 60; ++frame)
        scene.step(solver_);
    EXPECT_NEAR(scene.bodies[0].position.x(), 0, 1e-6);
}

TEST_P(JointDrives, ASpringWithoutStiffnessIsFree) {
    Scene scene;
    one_axis(scene, CAIRN_JOINT_SLIDER, 0, CAIRN_AXIS_SPRING);
    scene.bodies[0].linear = Vec3(1, 0, 0);
    for (int frame = 0; frame < 10; ++frame)
        scene.step(solver_);
    EXPECT_NEAR(scene.bodies[0].position.x(), 10 * scene.dt, 1e-6);
}

// At its speed as far as it is away, then there; the shorter way round; with no more than its force.
TEST_P(JointDrives, AServoGoesToItsTarget) {
    for (const double target : {0.5, -3.0}) {
        Scene scene;
        Joint& joint = one_axis(scene, CAIRN_JOINT_HINGE, 5, CAIRN_AXIS_DRIVEN | CAIRN_AXIS_SERVO);
        scene.bodies[0].orientation = Quat(Eigen::AngleAxisd(target < 0 ? 3.0 : 0.0, Vec3::UnitZ()));
        joint.frame_b = Quat::Identity();
        joint.target[5] = target;
        joint.stiffness[5] = kInfinity;
        joint.motor_speed[5] = 0.5;
        joint.motor_force[5] = 100;
        const double way = target < 0 ? 2 * std::acos(-1.0) - 6 : 0.5; // from 3 on to 2 pi - 3
        for (int frame = 1; frame <= 80; ++frame) {
            scene.step(solver_);
            const double gone = std::remainder(turn_about_z(scene.bodies[0]) - (target < 0 ? 3.0 : 0.0), 2 * std::acos(-1.0));
            ASSERT_NEAR(gone, std::min(way, 0.5 * frame * scene.dt), 1e-3) << "frame " << frame;
        }
        EXPECT_NEAR(scene.bodies[0].angular.z(), 0, 1e-3);
    }
    Scene scene; // too weak for its load
    scene.gravity = Vec3(-9.81, 0, 0);
    Joint& joint = one_axis(scene, CAIRN_JOINT_SLIDER, 0, CAIRN_AXIS_DRIVEN | CAIRN_AXIS_SERVO);
    joint.stiffness[0] = kInfinity;
    joint.motor_speed[0] = kInfinity;
    joint.motor_force[0] = 12;
    scene.step(solver_);
    EXPECT_NEAR(scene.bodies[0].linear.x(), (-9.81 + 6) * scene.dt, 1e-4);
    scene.joints[0].motor_force[0] = kInfinity; // of bounded stiffness: hangs where that is the weight
    scene.joints[0].stiffness[0] = 200;
    scene.joints[0].rate[0] = 5;
    for (int frame = 0; frame < 500; ++frame)
        scene.step(solver_);
    EXPECT_NEAR(scene.bodies[0].position.x(), -2 * 9.81 / 200, 2e-2);
}

TEST_P(JointDrives, ThreeServosTurnToAnOrientation) {
    Random random(3);
    for (int trial = 0; trial < 4; ++trial) {
        Scene scene;
        scene.add(Body::box(1, {0.2, 0.3, 0.4}, Vec3::Zero()));
        Joint joint;
        joint.b = 0;
        joint.axes = axes_of(CAIRN_JOINT_BALL);
        joint.rotation = CAIRN_ROTATION_VECTOR;
        joint.frame_a = random_quat(random);
        for (std::size_t i = 3; i < 6; ++i) {
            joint.axes[i] = CAIRN_AXIS_DRIVEN | CAIRN_AXIS_SERVO;
            joint.motor_speed[i] = joint.motor_force[i] = joint.stiffness[i] = kInfinity;
            joint.rate[i] = 10;
        }
        scene.joints.push_back(joint);
        const double far = scene.bodies[0].orientation.angularDistance(joint.frame_a);
        for (int frame = 0; frame < 20; ++frame)
            scene.step(solver_);
        // e' = -10 e, straight; the sphere of shortest rotations has no other path
        EXPECT_NEAR(scene.bodies[0].orientation.angularDistance(joint.frame_a) / far, std::exp(-10 * 20 * scene.dt), 0.02);
    }
}

// Swing vector and twist of b's frame in a's, as cairn.h defines them.
struct SwingTwist {
    Vec3 swing;
    double twist;
};
SwingTwist swing_twist(const Quat& given) {
    const Quat q = given.w() < 0 ? Quat(-given.coeffs()) : given;
    const Quat twist = Quat(q.w(), q.x(), 0, 0).normalized();
    const Eigen::AngleAxisd swing(q * twist.conjugate());
    return {swing.angle() * swing.axis(), 2 * std::atan2(twist.x(), twist.w())};
}
double ellipse(const Quat& q, double y, double z) {
    const Vec3 s = swing_twist(q).swing;
    return std::hypot(s.y() / y, s.z() / z);
}

TEST_P(JointDrives, AConeHoldsTheSwingAndTheTwist) {
    Random random(17);
    const double y = 0.5, z = 1.1, twist = 0.4;
    double widest = 0, most_twist = 0;
    for (int trial = 0; trial < 6; ++trial) {
        Scene scene;
        scene.dt = params_.substeps == 1 ? 0.002 : 0.016;
        Body body = Body::sphere(1, 0.3, Vec3::Zero());
        body.angular = 3 * random_unit(random);
        scene.add(body);
        Joint& joint = scene.join(CAIRN_WORLD, 0, Vec3::Zero(), axes_of(CAIRN_JOINT_BALL), random_quat(random));
        joint.rotation = CAIRN_ROTATION_CONE;
        joint.axes[3] = joint.axes[4] = joint.axes[5] = CAIRN_AXIS_LIMITED;
        joint.lower[3] = -twist;
        joint.upper[3] = twist;
        joint.upper[4] = y;
        joint.upper[5] = z;
        for (int frame = 0; frame < 200; ++frame) {
            scene.step(solver_);
            const Quat q = joint.frame_a.conjugate() * scene.bodies[0].orientation * joint.frame_b;
            widest = std::max(widest, ellipse(q, y, z));
            most_twist = std::max(most_twist, std::abs(swing_twist(q).twist));
        }
    }
    EXPECT_NEAR(widest, 1, 0.03);
    EXPECT_NEAR(most_twist, twist, 0.02);
}

// What the cone's limit gives is along the gradient of the ellipse' function, found by differences, and twists nothing.
TEST(JointCone, PushesAlongTheGradient) {
    Random random(29);
    Solver solver(64);
    solver.set(plain(CAIRN_METHOD_PJ, 200));
    int pushed = 0;
    for (int trial = 0; trial < 40; ++trial) {
        Scene scene;
        scene.dt = 1e-4;
        Body body = Body::sphere(1, 0.3, Vec3::Zero());
        body.orientation = random_quat(random);
        body.angular = random_vec(random, 1);
        scene.add(body);
        const double y = uniform(random, 0.1, 1.5), z = uniform(random, 0.1, 1.5);
        Joint joint;
        joint.b = 0;
        joint.axes = {0, 0, 0, 0, CAIRN_AXIS_LIMITED, CAIRN_AXIS_LIMITED};
        joint.rotation = CAIRN_ROTATION_CONE;
        joint.upper[4] = y;
        joint.upper[5] = z;
        joint.frame_a = random_quat(random);
        joint.frame_b = random_quat(random);
        scene.joints.push_back(joint);
        const auto at = [&](const Vec3& turn) {
            const Quat moved = Quat(Eigen::AngleAxisd(turn.norm(), turn.normalized())) * body.orientation;
            return ellipse(joint.frame_a.conjugate() * moved * joint.frame_b, y, z);
        };
        const double d = 1e-6;
        Vec3 gradient;
        for (int i = 0; i < 3; ++i)
            gradient[i] = (at(d * Vec3::Unit(i)) - at(-d * Vec3::Unit(i))) / (2 * d);
        const Impulses out = scene.step(solver);
        const Vec3 torque(out.joint_angular[0], out.joint_angular[1], out.joint_angular[2]);
        if (at(d * Vec3::UnitX()) < 1 || swing_twist(joint.frame_a.conjugate() * body.orientation * joint.frame_b).swing.norm() > 3) {
            continue; // inside, or where swings point any way
        }
        ASSERT_GT(torque.norm(), 0);
        ++pushed;
        EXPECT_LT((torque.normalized() + gradient.normalized()).norm(), 1e-5) << "trial " << trial;
        EXPECT_NEAR(out.joint[5], 0, 0) << "the cone has one row";
    }
    EXPECT_GT(pushed, 15);
}

TEST_P(JointDrives, ForceIsBoundedOnEveryAxis) {
    for (const bool limit : {false, true}) {
        Scene scene;
        scene.gravity = Vec3(0, -9.81, 0);
        scene.add(Body::sphere(2, 0.5, Vec3::Zero()));
        Joint& joint = scene.join(CAIRN_WORLD, 0, Vec3::Zero(), axes_of(CAIRN_JOINT_FIXED));
        joint.max_force = 15;
        if (limit)
            joint.axes[1] = CAIRN_AXIS_LIMITED;
        Impulses out;
        for (int frame = 0; frame < 20; ++frame)
            out = scene.step(solver_);
        EXPECT_NEAR(out.joint[1], 15 * scene.dt, 1e-6 + (limit ? 0.05 : 0) * scene.dt);
        EXPECT_NEAR(scene.bodies[0].linear.y(), (-9.81 + 7.5) * 20 * scene.dt, 2e-2);
        scene.joints[0].max_force = 60; // enough to bring it back
        for (int frame = 0; frame < 400; ++frame)
            out = scene.step(solver_);
        EXPECT_NEAR(out.joint[1], 2 * 9.81 * scene.dt, 1e-3);
        EXPECT_NEAR(scene.bodies[0].position.y(), 0, 5e-3);
    }
}

// Cardan axes are nobody's axes: the world impulses account for the body's momentum all the same.
TEST(JointImpulses, InWorldAxesAreTheMomentumGiven) {
    Random random(41);
    for (const std::uint32_t rotation : {CAIRN_ROTATION_BY_AXES, CAIRN_ROTATION_VECTOR, CAIRN_ROTATION_CONE}) {
        Scene scene;
        scene.gravity = Vec3(1, -9.81, 2);
        Body body = Body::sphere(1.5, 0.4, Vec3(0.3, 0.2, 0.1));
        body.orientation = random_quat(random);
        body.angular = random_vec(random, 3);
        scene.add(body);
        Joint& joint = scene.join(CAIRN_WORLD, 0, Vec3(0.1, -0.3, 0.2), axes_of(CAIRN_JOINT_BALL), random_quat(random));
        joint.rotation = rotation;
        for (std::size_t i = 3; i < 6; ++i) {
            joint.axes[i] = CAIRN_AXIS_LIMITED;
            joint.lower[i] = -0.2;
            joint.upper[i] = 0.2;
        }
        Solver solver(64);
        solver.set(plain(CAIRN_METHOD_PJ, 300));
        double turned = 0;
        for (int frame = 0; frame < 60; ++frame) {
            const Body before = scene.bodies[0];
            const Vec3 arm = anchor_world(scene, 0, joint.anchor_b) - before.position;
            const Impulses out = scene.step(solver);
            const Vec3 p(out.joint_linear[0], out.joint_linear[1], out.joint_linear[2]);
            const Vec3 l(out.joint_angular[0], out.joint_angular[1], out.joint_angular[2]);
            const Body& after = scene.bodies[0];
            EXPECT_LT(((after.linear - before.linear) / before.inverse_mass - scene.gravity * scene.dt / before.inverse_mass - p).norm(),
                      1e-9);
            EXPECT_LT((inertia_world(before) * (after.angular - before.angular) - l - arm.cross(p)).norm(), 1e-9);
            turned += l.norm();
        }
        EXPECT_GT(turned, 0.1) << "its limits do nothing: this test checks little";
    }
}

} // namespace
} // namespace cairn_test
