// Bodies that only the caller moves, and bodies that may move in some directions only.
#include "dense.h"
#include "methods.h"
#include "shapes.h"

namespace cairn_test {
namespace {

class Kinematic : public EachMethod {};
CAIRN_EACH_METHOD(Kinematic);

Body platform(const Vec3& position, const Vec3& velocity) {
    Body body;
    body.position = position;
    body.inverse_mass = 0;
    body.inverse_inertia.setZero();
    body.linear = velocity;
    return body;
}

// A conveyor whose top is at its centre: its body stays where it is from the caller's point of view.
TEST_P(Kinematic, ABoxIsCarriedByFriction) {
    const Vec3 half(0.3, 0.3, 0.2);
    Scene scene;
    scene.gravity = Vec3(0, 0, -9.81);
    const int belt = scene.add(platform(Vec3::Zero(), {1, 0.5, 0}));
    const int box = scene.add(Body::box(2, half, {0, 0, half.z()}));
    const Solver solver;
    cairn_params params = preset(GetParam());
    params.iterations = std::max(params.iterations, 100u);
    check(cairn_solver_set_params(solver.get(), &params));
    const auto frames = [&](int count) {
        for (int frame = 0; frame < count; ++frame) {
            scene.contacts.clear();
            touch_box(scene, box, half, Plane{}, 0.5);
            for (Contact& c : scene.contacts) {
                c.a = belt;
                c.arm_a -= scene.bodies[0].position;
            }
            scene.step(solver);
        }
    };
    frames(5);
    // it gains mu g each second until it moves with the belt
    EXPECT_NEAR(scene.bodies[1].linear.norm(), 0.5 * 9.81 * 5 * scene.dt, 0.02);
    frames(55);
    EXPECT_NEAR((scene.bodies[1].linear - scene.bodies[0].linear).norm(), 0, 2e-3);
    // never written
    EXPECT_EQ(scene.bodies[0].position, Vec3(Vec3::Zero()));
    EXPECT_EQ(scene.bodies[0].linear, Vec3(1, 0.5, 0));
}

// A lift pushes a box up, and substeps see it move within the step.
TEST_P(Kinematic, ALiftCarriesABoxUp) {
    const Vec3 half(0.3, 0.3, 0.2);
    Scene scene;
    scene.gravity = Vec3(0, 0, -9.81);
    const int lift = scene.add(platform(Vec3::Zero(), {0, 0, 2}));
    const int box = scene.add(Body::box(2, half, {0, 0, half.z()}));
    const Solver solver;
    const cairn_params params = preset(GetParam());
    check(cairn_solver_set_params(solver.get(), &params));
    for (int frame = 0; frame < 100; ++frame) {
        scene.contacts.clear();
        Body& b = scene.bodies[static_cast<std::size_t>(box)];
        const double top = scene.bodies[static_cast<std::size_t>(lift)].position.z();
        b.position.z() -= top;
        touch_box(scene, box, half, Plane{}, 0.5, 0, 0.1);
        b.position.z() += top;
        for (Contact& c : scene.contacts)
            c.a = lift;
        scene.step(solver);
        scene.bodies[static_cast<std::size_t>(lift)].position.z() += 2 * scene.dt;
    }
    const double over = scene.bodies[1].position.z() - scene.bodies[0].position.z() - half.z();
    EXPECT_NEAR(over, 0, 5e-3);
    EXPECT_NEAR(scene.bodies[1].linear.z(), 2, 2e-2);
}

// A kinematic body given at the end of its step is the same body as one given at its start.
TEST_P(Kinematic, AtEndPoseIsTheStartPoseMovedOn) {
    Scene scenes[2];
    for (const bool at_end : {false, true}) {
        Scene& scene = scenes[at_end];
        scene.gravity = Vec3(0, 0, -9.81);
        Body hand = platform(Vec3::Zero(), {1, 0, 0.5});
        hand.angular = Vec3(0, 0, 2);
        scene.add(hand);
        scene.add(Body::sphere(1, 0.2, {1, 0, 0}));
        scene.join(0, 1, {0.8, 0, 0}, axes_of(CAIRN_JOINT_FIXED));
        if (at_end)
            scene.bodies[0].flags = CAIRN_BODY_AT_END_POSE;
        const Solver solver(64);
        const cairn_params params = preset(GetParam());
        check(cairn_solver_set_params(solver.get(), &params));
        for (int frame = 0; frame < 30; ++frame) {
            Body& moved = scene.bodies[0];
            const auto advance = [&] {
                moved.position += scene.dt * moved.linear;
                moved.orientation = Quat(Eigen::AngleAxisd(2 * scene.dt, Vec3::UnitZ())) * moved.orientation;
            };
            if (at_end)
                advance();
            scene.step(solver);
            if (!at_end)
                advance();
        }
    }
    EXPECT_LT((scenes[0].bodies[1].position - scenes[1].bodies[1].position).norm(), 1e-7);
    EXPECT_LT((scenes[0].bodies[1].linear - scenes[1].bodies[1].linear).norm(), 1e-6);
    EXPECT_GT(scenes[0].bodies[1].linear.norm(), 0.5);
}

TEST_P(Kinematic, StaticBodiesAndTheWorldAreOneAndTheSame) {
    const Vec3 half(0.3, 0.2, 0.2);
    std::uint64_t hashes[2];
    for (const bool body : {false, true}) {
        Scene scene;
        scene.gravity = Vec3(0, 0, -9.81);
        Body box = Body::box(2, half, {0, 0, half.z()});
        box.linear = Vec3(1, 0.3, 0);
        scene.add(box);
        if (body)
            scene.add(platform(Vec3::Zero(), Vec3::Zero()));
        const Solver solver;
        const cairn_params params = preset(GetParam());
        check(cairn_solver_set_params(solver.get(), &params));
        for (int frame = 0; frame < 20; ++frame) {
            scene.contacts.clear();
            touch_box(scene, 0, half, Plane{}, 0.4);
            if (body) {
                for (Contact& c : scene.contacts)
                    c.a = 1;
            }
            scene.step(solver);
        }
        scene.bodies.resize(1);
        hashes[body] = scene.hash();
    }
    EXPECT_EQ(hashes[0], hashes[1]);
}

// Factors of 0 and 1 lock directions; others weigh: W = F M^-1 F, which stays symmetric, so that the dense solution holds.
TEST_P(Kinematic, FactorsActAsFMF) {
    for (std::uint64_t seed = 1; seed <= 4; ++seed) {
        Random random(seed);
        Scene scene = random_bodies(random, 4);
        scene.gravity.setZero();
        for (Body& body : scene.bodies) {
            body.force = body.torque = Vec3::Zero();
            body.linear_factor = Vec3(uniform(random, 0.5, 1), 1, uniform(random, 0.5, 1));
            body.angular_factor = Vec3(1, uniform(random, 0.5, 1), seed % 2 != 0 ? 0.0 : 0.7);
        }
        add_random_joints(random, scene, 0.005);
        scene.joints.pop_back();
        cairn_params params = plain(GetParam(), 20000);
        const BiasRule rule = BiasRule::of(params, scene.dt);
        Dense dense(scene, scene.dt);
        int block = 0;
        for (const Joint& joint : scene.joints)
            dense.add_joint(scene, joint, rule, block++);
        const Vec lambda = dense.solve_bilateral();
        const Vec residual = dense.a() * lambda + dense.gamma.cwiseProduct(lambda) + dense.q();
        if (residual.cwiseAbs().maxCoeff() > 1e-9)
            continue; // the factors leave it no solution
        const Solver solver(64);
        check(cairn_solver_set_params(solver.get(), &params));
        scene.step(solver);
        EXPECT_LT((velocities(scene) - dense.velocity(lambda)).cwiseAbs().maxCoeff(), 1e-6) << "seed " << seed;
    }
}

TEST_P(Kinematic, ZeroFactorsLockDirections) {
    Scene scene;
    Body body = Body::box(1, {0.3, 0.2, 0.2}, {0, 0, 1});
    body.linear_factor = Vec3(1, 0, 1);
    body.angular_factor = Vec3(0, 1, 0);
    scene.add(body);
    Contact c; // off centre in every direction
    c.b = 0;
    c.normal = Vec3(1, 2, 3).normalized();
    c.arm_b = Vec3(0.2, -0.1, -0.2);
    c.separation = -0.05;
    c.arm_a = body.position + c.arm_b - c.separation * c.normal;
    c.friction = 0.5;
    scene.contacts.push_back(c);
    scene.bodies[0].linear = Vec3(-1, 0, -1);
    const Solver solver;
    const cairn_params params = preset(GetParam());
    check(cairn_solver_set_params(solver.get(), &params));
    const Impulses out = scene.step(solver);
    const Body& now = scene.bodies[0];
    EXPECT_GT(out.contact[0], 0.1);
    EXPECT_EQ(now.linear.y(), 0);
    EXPECT_EQ(now.position.y(), 0);
    EXPECT_EQ(now.angular.x(), 0);
    EXPECT_EQ(now.angular.z(), 0);
    EXPECT_GT(std::abs(now.angular.y()), 0.1);
}

} // namespace
} // namespace cairn_test
